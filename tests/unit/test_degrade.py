"""Degraded recordings: each way does what it says, nothing else, and the same every time."""

import pickle

import numpy as np
import pytest

from sec_lab.recording import Recording
from sec_lab.worlds.degrade import Degradation, degraded, grain

SIZE = (48, 64)
GREY = np.full((6, *SIZE, 3), 100, dtype=np.uint8)


@pytest.fixture
def varied() -> np.ndarray:
    """Smooth ramps of other colours in every frame."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    ramps = np.stack([3 * columns, 4 * rows, 2 * (rows + columns)], axis=-1)
    return np.stack([np.clip(ramps + 5 * frame, 0, 255) for frame in range(6)]).astype(np.uint8)


def pictures(recording: Recording) -> np.ndarray:
    return np.stack([frame.image for frame in recording])


def made_worse(frames: np.ndarray, *, seed: int = 0, where: np.ndarray | None = None, **options: float) -> np.ndarray:
    return pictures(degraded(Recording.from_frames(frames), Degradation(**options), seed=seed, where=where))


def test_nothing_asked_nothing_done(varied: np.ndarray) -> None:
    np.testing.assert_array_equal(made_worse(varied), varied)


def test_contrast_shrinks_about_the_middle_grey(varied: np.ndarray) -> None:
    worse = made_worse(varied, contrast=0.25).astype(float)
    assert abs(worse - (128 + (varied.astype(float) - 128) / 4)).max() <= 0.5
    assert (made_worse(varied, contrast=0) == 128).all()


def test_noise_is_as_strong_as_said_and_everywhere_another() -> None:
    worse = made_worse(GREY, noise_sigma=8).astype(float) - 100
    # 55,296 values: mean and standard deviation of the sample stray by 0.03.
    assert worse.mean() == pytest.approx(0, abs=0.2)
    assert worse.std() == pytest.approx(8, abs=0.2)
    flat = worse.reshape(6, -1, 3)
    assert abs(np.corrcoef(flat[0].ravel(), flat[1].ravel())[0, 1]) < 0.05
    assert abs(np.corrcoef(flat[:, :, 0].ravel(), flat[:, :, 1].ravel())[0, 1]) < 0.05


def test_texture_rests_and_is_as_strong_as_said() -> None:
    worse = made_worse(GREY, texture=0.1)
    assert (worse == worse[0]).all()
    assert (worse[..., 0] == worse[..., 1]).all()
    assert worse[0].std() == pytest.approx(10, abs=0.3)
    # Coarse and fine: neighbours are alike, but not equal.
    row = worse[0, :, :, 0].astype(float) - 100
    assert 0.4 < np.corrcoef(row[:, 1:].ravel(), row[:, :-1].ravel())[0, 1] < 0.95


def test_texture_stays_where_it_is_put() -> None:
    where = np.zeros((6, *SIZE), dtype=bool)
    for frame in range(6):
        where[frame, :, : 8 * (frame + 1)] = True
    worse = made_worse(GREY, texture=0.3, where=where)
    everywhere = made_worse(GREY, texture=0.3)
    np.testing.assert_array_equal(worse[where], everywhere[where])
    assert (worse[~where] == 100).all()
    thinned = made_worse(GREY, texture=0.3, where=where, frame_step=2)
    np.testing.assert_array_equal(thinned, worse[::2])


def test_jpeg_does_more_harm_with_less_quality(varied: np.ndarray) -> None:
    rng = np.random.default_rng(0)
    varied = np.clip(varied + rng.normal(0, 6, varied.shape), 0, 255).astype(np.uint8)
    harm = [abs(made_worse(varied, jpeg_quality=q).astype(float) - varied).mean() for q in (95, 50, 5)]
    assert 0 < harm[0] < harm[1] < harm[2]


def test_frames_left_out(varied: np.ndarray) -> None:
    recording = Recording.from_frames(varied, frames_per_second=25)
    worse = degraded(recording, Degradation(frame_step=4))
    assert (len(worse), worse.numbers, worse.frames_per_second) == (2, (0, 4), 6.25)
    assert [(frame.index, frame.time_s) for frame in worse] == [(0, 0), (4, 0.16)]
    np.testing.assert_array_equal(pictures(worse), varied[::4])


def test_same_seed_same_recording(varied: np.ndarray) -> None:
    options = {"texture": 0.2, "noise_sigma": 5.0}
    worse = degraded(Recording.from_frames(varied), Degradation(**options), seed=3)
    first = pictures(worse)
    np.testing.assert_array_equal(pictures(worse), first)
    np.testing.assert_array_equal(pictures(pickle.loads(pickle.dumps(worse))), first)
    assert (made_worse(varied, seed=4, **options) != first).any()
    # A frame has its own noise whether or not others are read.
    noisy = made_worse(varied, seed=3, noise_sigma=5)
    np.testing.assert_array_equal(made_worse(varied, seed=3, noise_sigma=5, frame_step=3), noisy[::3])


def test_both_eyes_with_noise_of_their_own() -> None:
    pair = Recording.from_frames(GREY, right=GREY)
    frame = next(iter(degraded(pair, Degradation(noise_sigma=5, contrast=0.5))))
    assert frame.right is not None
    assert frame.right.mean() == pytest.approx(114, abs=0.3)
    assert (frame.right != frame.image).any()
    with pytest.raises(ValueError, match="texture: expected a recording of one camera"):
        degraded(pair, Degradation(texture=0.1))


def test_grain_is_of_its_rng() -> None:
    one, two = (grain((9, 11), np.random.default_rng(seed)) for seed in (1, 2))
    assert one.dtype == np.float32
    assert (one != two).any()
    assert one.mean() == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frame_step": 0}, "frame_step: expected at least 1, got 0"),
        ({"contrast": 1.1}, "contrast: expected a share from 0 to 1, got 1.1"),
        ({"contrast": float("nan")}, "contrast"),
        ({"noise_sigma": -1}, "noise_sigma: expected a finite number from 0 on, got -1"),
        ({"texture": float("inf")}, "texture"),
        ({"jpeg_quality": 0}, "jpeg_quality: expected a number from 1 to 100, got 0"),
    ],
)
def test_refuses(options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Degradation(**options)


@pytest.mark.parametrize(
    ("where", "message"),
    [
        (np.zeros((6, *SIZE)), "where: expected truth values, got values of float64"),
        (np.zeros((5, *SIZE), bool), r"where: expected shape \(6, 48, 64\) like the recording, got \(5, 48, 64\)"),
        (np.zeros(SIZE, bool), "where: expected 3 dimensions"),
    ],
)
def test_refuses_masks(where: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        degraded(Recording.from_frames(GREY), Degradation(texture=0.1), where=where)
