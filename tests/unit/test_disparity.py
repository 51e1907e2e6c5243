"""Disparity: textures whose shift is known, holes, streams, and what is refused."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from sec_lab.recording import Calibration, Frame
from sec_lab.segmentation._disparity_kernels import blend_resting, fill_rows, row_ends
from sec_lab.segmentation.disparity import dense_disparity, depth_from_disparity
from sec_lab.segmentation.disparity_filling import fill_holes
from sec_lab.segmentation.disparity_stream import DisparityEstimator, disparities
from sec_lab.segmentation.matching import MatcherOptions, estimate_range, matched
from sec_lab.segmentation.phase_disparity import phase_disparity
from tests.naive_disparity import naive_blend, naive_fill_rows, naive_row_ends

Picture = NDArray[np.uint8]
HEIGHT, WIDTH = 96, 160


def texture(columns: NDArray[np.float64], rows: NDArray[np.float64], *, seed: int = 0) -> NDArray[np.float64]:
    """Sum of waves: it can be asked for between pixels, so that shifts are exact."""
    rng = np.random.default_rng(seed)
    value = np.full(np.broadcast_shapes(columns.shape, rows.shape), 128.0)
    for _ in range(40):
        wavelength, direction, phase = rng.uniform(4, 25), rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi)
        along = np.cos(direction) * columns + np.sin(direction) * rows
        value += 9 * np.sin(2 * np.pi * along / wavelength + phase)
    return value


def pair(disparity: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> tuple[Picture, Picture]:
    """Left and right picture of a surface whose disparity is a function of the column in the right picture."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    left = texture(columns, rows)
    right = texture(columns + disparity(columns), rows)
    return tuple(np.clip(np.round(side), 0, 255).astype(np.uint8) for side in (left, right))  # type: ignore[return-value]


def flat(shift: float) -> tuple[Picture, Picture]:
    return pair(lambda columns: np.full(columns.shape, shift))


def square(*, far: float = 8, near: float = 20) -> tuple[Picture, Picture, NDArray[np.bool_]]:
    """A square in front of a wall, and where it is in the left picture: rows 30–65, columns 80–119."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    wall, front = [texture(columns + shift, rows) for shift in (0, far)], []
    there = []
    for shift in (0, near):
        there.append((rows >= 30) & (rows < 66) & (columns + shift >= 80) & (columns + shift < 120))
        front.append(texture(columns + shift, rows, seed=1))
    left, right = (
        np.clip(np.where(inside, square, behind), 0, 255).astype(np.uint8)
        for inside, square, behind in zip(there, front, wall, strict=True)
    )
    return left, right, there[0]


@pytest.mark.parametrize("shift", [0.0, 3.0, 7.25, 12.5])
def test_a_flat_surface_has_its_disparity_everywhere(shift: float) -> None:
    dense = dense_disparity(*flat(shift), range_px=(0, 20))
    assert dense.dtype == np.float32
    # The matcher's steps are 1/16 px; its parabola is drawn to whole pixels by some tenths.
    assert np.quantile(np.abs(dense - shift), 0.98) <= 0.25
    sparse = phase_disparity(*flat(shift), range_px=(0, 20))
    known = np.isfinite(sparse)
    assert known.mean() > 0.5
    assert np.median(np.abs(sparse[known] - shift)) <= 0.03
    assert np.quantile(np.abs(sparse[known] - shift), 0.98) <= 0.2


@pytest.mark.parametrize("method", [dense_disparity, phase_disparity])
def test_a_slanted_plane(method: Callable[..., NDArray[np.float32]]) -> None:
    # In the right picture the disparity is 5 + 0.05 u; with u = x − d in the left one d = (5 + 0.05 x) / 1.05.
    left, right = pair(lambda columns: 5 + 0.05 * columns)
    truth = (5 + 0.05 * np.arange(WIDTH)) / 1.05
    missed = np.abs(method(left, right, range_px=(0, 24)) - truth)[:, 8:]
    known = np.isfinite(missed)
    assert known.mean() > 0.5
    assert np.median(missed[known]) <= 0.12
    assert (missed[known] > 1).mean() <= 0.02


def test_the_phase_says_nothing_where_there_is_no_texture() -> None:
    left, right = flat(6.0)
    left[:, 60:], right[:, 54:] = 100, 100
    sparse = phase_disparity(left, right, range_px=(0, 15))
    assert np.isfinite(sparse[:, 10:50]).mean() > 0.5
    # Filters reach 9 pixels, the smooth picture that is taken off 36, with little weight.
    assert np.isnan(sparse[:, 75:]).all()


@pytest.mark.parametrize("method", [dense_disparity, phase_disparity])
def test_pictures_without_anything_have_no_disparity(method: Callable[..., NDArray[np.float32]]) -> None:
    grey = np.full((HEIGHT, WIDTH), 90, np.uint8)
    found = method(grey, grey)
    assert np.isnan(found).all() or not found.any()


def test_what_the_right_camera_cannot_see_is_a_hole_and_filled_from_behind() -> None:
    left, right, inside = square()
    holes = dense_disparity(left, right, range_px=(0, 31), fill=False)
    # The square hides 20 − 8 columns of the wall to its left.
    hidden = np.zeros_like(inside)
    hidden[36:60, 70:78] = True
    assert np.isnan(holes[hidden]).mean() > 0.7
    filled = dense_disparity(left, right, range_px=(0, 31))
    assert np.isfinite(filled).all()
    # Chance matches aside, it goes on as the wall (8), and never as the square (20).
    assert (np.abs(filled[hidden] - 8) <= 1).mean() > 0.6
    assert (filled[hidden] < 14).mean() > 0.95
    # All but some pixels of its rim.
    assert (np.abs(filled[inside] - 20) <= 1).mean() > 0.85


def test_labels_keep_holes_within_their_segment() -> None:
    # A slanted segment 1 beside a flat segment 2, a hole across the border: every side goes on as its own plane.
    rows, columns = np.mgrid[:40, :60]
    truth = np.where(columns < 30, 20 + 0.3 * columns - 0.1 * rows, 8.0).astype(np.float32)
    labels = np.where(columns < 30, 1, 2)
    holes = truth.copy()
    holes[10:30, 15:45] = np.nan
    np.testing.assert_allclose(fill_holes(holes, labels=labels), truth, atol=0.01)
    # Without labels the hole is of what is farther away.
    assert (fill_holes(holes)[10:30, 15:45] == 8).all()


def test_a_minority_of_wrong_matches_does_not_bend_the_plane_of_a_segment() -> None:
    columns = np.mgrid[:40, :60][1]
    truth = (12 + 0.2 * columns).astype(np.float32)
    seen = truth.copy()
    rng = np.random.default_rng(3)
    wrong = rng.random(truth.shape) < 0.3
    seen[wrong] = rng.uniform(0, 60, wrong.sum())
    seen[15:25, 20:40] = np.nan
    filled = fill_holes(seen, labels=np.ones((40, 60), dtype=int))
    np.testing.assert_allclose(filled[15:25, 20:40], truth[15:25, 20:40], atol=0.1)


def test_a_segment_that_is_no_plane_is_filled_along_its_rows() -> None:
    columns = np.mgrid[:20, :60][1]
    bowl = ((columns - 30) ** 2 / 10).astype(np.float32)
    holes = bowl.copy()
    holes[:, 10] = np.nan
    # Beside the hole it is 44.1 and 36.1: two surfaces, and the farther one counts.
    assert np.allclose(fill_holes(holes, labels=np.ones((20, 60), int))[:, 10], 36.1)


def test_filling_reaches_rows_without_anything_and_gives_up_on_nothing() -> None:
    holes = np.full((5, 4), np.nan, dtype=np.float32)
    assert np.isnan(fill_holes(holes)).all()
    holes[2, 1] = 7
    assert (fill_holes(holes) == 7).all()
    assert np.isnan(holes).sum() == 19


maps = arrays(np.float32, (4, 12), elements=st.sampled_from([np.nan, np.nan, 1.0, 2.0, 2.5, 9.0]))
marks = arrays(np.int32, (4, 12), elements=st.integers(0, 1))


@given(maps, marks, st.booleans())
def test_rows_are_filled_as_the_naive_twin_does(
    disparity: NDArray[np.float32], labels: NDArray[np.int32], with_ends: bool
) -> None:
    ends = row_ends(disparity, 3)
    np.testing.assert_array_equal(ends, np.array(naive_row_ends(disparity.tolist(), 3), np.float32))
    if not with_ends:
        ends[:] = np.nan
    expected = naive_fill_rows(disparity.tolist(), labels.tolist(), ends.tolist(), 1.5)
    filled = disparity.copy()
    fill_rows(filled, labels, ends, 1.5)
    np.testing.assert_allclose(filled, np.array(expected), rtol=1e-5)


@given(st.lists(st.tuples(st.sampled_from([np.nan, 5.0, 5.5, 6.0, 9.0]), st.booleans()), min_size=1, max_size=30))
def test_the_running_mean_is_that_of_the_naive_twin(history: list[tuple[float, bool]]) -> None:
    mean, count = np.full((1, 1), np.nan, np.float32), np.zeros((1, 1), np.uint8)
    means = []
    for value, moved in history:
        blend_resting(np.full((1, 1), value, np.float32), np.full((1, 1), moved), mean, count, 4, 1.0)
        means.append(mean[0, 0])
    np.testing.assert_allclose(means, naive_blend(history, 4, 1.0), rtol=1e-5)


def test_the_range_is_found_in_the_pictures() -> None:
    least, most = estimate_range(*flat(30.0))
    assert 20 <= least <= 30 <= most <= 40
    left, right, _ = square(far=8, near=40)
    least, most = estimate_range(left, right)
    assert least <= 8
    assert most >= 40
    grey = np.full((HEIGHT, WIDTH), 90, np.uint8)
    assert estimate_range(grey, np.random.default_rng(0).integers(0, 9, grey.shape, dtype=np.uint8)) == (0, WIDTH // 2)


def test_every_column_that_both_pictures_show_is_matched() -> None:
    # OpenCV alone leaves the first 48 columns empty, with disparities up to 48.
    found = matched(*flat(12.0), range_px=(5, 48), options=MatcherOptions())
    assert np.isfinite(found[:, 16:]).mean() > 0.9
    assert np.isnan(found[:, :10]).all()


def test_a_stream_widens_its_range_when_something_comes_near() -> None:
    far, near = flat(8.0), square(far=8, near=44)
    estimator = DisparityEstimator(smoothing=1)
    assert np.median(np.abs(estimator(*far) - 8)) < 0.2
    found = estimator(near[0], near[1])
    assert (np.abs(found[near[2]] - 44) <= 1).mean() > 0.6


def noisy(picture: Picture, rng: np.random.Generator) -> Picture:
    return np.clip(picture + rng.normal(0, 6, picture.shape), 0, 255).astype(np.uint8)


def test_a_stream_is_steadier_where_nothing_moves() -> None:
    rng = np.random.default_rng(5)
    left, right = flat(9.4)
    frames = [(noisy(left, rng), noisy(right, rng)) for _ in range(12)]
    spreads = []
    for smoothing in (1, 16):
        estimator = DisparityEstimator(range_px=(0, 15), smoothing=smoothing)
        found = [estimator(*frame) for frame in frames]
        spreads.append(np.median(np.abs(found[-1] - found[-2])[:, 16:]))
    # The mean of 12 frames moves by a twelfth of what one frame differs.
    assert spreads[1] < 0.25 * spreads[0]


def test_a_stream_begins_anew_where_the_picture_changes() -> None:
    estimator = DisparityEstimator(range_px=(0, 31))
    for _ in range(5):
        estimator(*flat(8.0))
    left, right, inside = square()
    found = estimator(left, right)
    assert (np.abs(found[inside] - 20) <= 1).mean() > 0.85


def test_a_stream_at_half_the_size_gives_pixels_of_the_whole() -> None:
    estimator = DisparityEstimator(reduction=2)
    found = estimator(*flat(9.0))
    assert found.shape == (HEIGHT, WIDTH)
    assert np.median(np.abs(found - 9)) <= 0.25


def test_large_pictures_are_shrunk_by_themselves() -> None:
    left, right = (np.tile(side, (4, 4)) for side in flat(9.0))  # 640 columns
    np.testing.assert_array_equal(DisparityEstimator()(left, right), DisparityEstimator(reduction=2)(left, right))


def test_a_stream_goes_through_a_recording() -> None:
    left, right = (np.repeat(side[..., None], 3, axis=2) for side in flat(8.0))
    found = list(disparities(Frame(index, left, right=right) for index in (3, 4)))
    assert [index for index, _ in found] == [3, 4]
    assert np.median(np.abs(found[1][1] - 8)) < 0.2
    with pytest.raises(ValueError, match="expected a right picture with every frame, frame 3 has none"):
        list(disparities([Frame(3, left)]))


def test_the_number_of_threads_changes_nothing() -> None:
    left, right, _ = square()
    rng = np.random.default_rng(2)
    frames = [(noisy(left, rng), noisy(right, rng)) for _ in range(3)]
    labels = np.add.outer(np.arange(HEIGHT) // 20, np.arange(WIDTH) // 30)
    before = cv2.getNumThreads()
    results = []
    try:
        for n in (1, 2, 5):
            cv2.setNumThreads(n)
            estimator = DisparityEstimator()
            found = [estimator(*frame) for frame in frames]
            found.append(dense_disparity(left, right, labels=labels))
            found.append(phase_disparity(left, right))
            for mode in ("3way", "5way", "8way"):
                found.append(matched(left, right, range_px=(0, 31), options=MatcherOptions(mode=mode)))
            results.append(np.stack(found))
    finally:
        cv2.setNumThreads(before)
    for other in results[1:]:
        np.testing.assert_array_equal(other, results[0])


def test_depth_is_focal_length_times_baseline_by_disparity() -> None:
    camera = Calibration(400, (160, 128), baseline_m=0.12)
    disparity = np.array([[48, 24, 0], [np.nan, -3, np.inf]], dtype=np.float32)
    depth = depth_from_disparity(disparity, camera)
    assert depth.dtype == np.float32
    np.testing.assert_allclose(depth, [[1, 2, 0], [0, 0, 0]], rtol=1e-6)
    # What comes out is depth that a frame accepts.
    Frame(0, np.zeros((2, 3, 3), np.uint8), depth_m=depth)
    with pytest.raises(ValueError, match="calibration: expected one with a baseline, got none"):
        depth_from_disparity(disparity, Calibration(400, (160, 128)))
    with pytest.raises(ValueError, match="disparity: expected floating-point"):
        depth_from_disparity(np.array([1, 2]), camera)


SIDE = np.zeros((40, 50), np.uint8)


@pytest.mark.parametrize("method", [dense_disparity, phase_disparity, estimate_range, DisparityEstimator()])
@pytest.mark.parametrize(
    ("left", "right", "message"),
    [
        (SIDE, SIDE[:, 1:], r"right: expected the size of left, \(40, 50\), got \(40, 49\)"),
        (SIDE.astype(np.float32), SIDE, "left: expected a picture of type uint8, got float32"),
        (SIDE, SIDE.tolist(), "right: expected a picture of type uint8, got list"),
        (SIDE, SIDE[..., None], r"right: expected shape .* got \(40, 50, 1\)"),
        (SIDE[:20], SIDE[:20], "left: expected at least 32 rows and columns"),
    ],
)
def test_pictures_that_are_no_pair(method: Callable[..., object], left: object, right: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        method(left, right)


@pytest.mark.parametrize("method", [dense_disparity, phase_disparity])
@pytest.mark.parametrize("range_px", [(-1, 10), (5, 5), (0, 50), (0, np.nan)])
def test_ranges_that_are_none(method: Callable[..., object], range_px: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="range_px: expected 0 <= least < most < 50"):
        method(SIDE, SIDE, range_px=range_px)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: dense_disparity(SIDE, SIDE, labels=SIDE[1:]), r"labels: expected the size of the pictures"),
        (lambda: fill_holes(SIDE), "disparity: expected a picture of float32"),
        (lambda: fill_holes(SIDE.astype(np.float32), labels=SIDE[1:]), "labels: expected the size of the disparity"),
        (lambda: phase_disparity(SIDE, SIDE, spread_rad=0), "spread_rad: expected a number above 0, got 0"),
        (lambda: DisparityEstimator(smoothing=0), "smoothing: expected 1 to 255 frames, got 0"),
        (lambda: DisparityEstimator(reduction=0), "reduction: expected a whole number from 1 on, got 0"),
        (
            lambda: DisparityEstimator(reduction=2)(SIDE, SIDE),
            "reduction: expected one that leaves 32 rows",
        ),
        (lambda: DisparityEstimator(change=np.nan), "change: expected a number of grey values above 0, got nan"),
        (lambda: MatcherOptions(step_penalty=30, jump_penalty=30), "step_penalty: expected one above 0 and below"),
        (lambda: MatcherOptions(gradient_cap=0), "gradient_cap: expected 1 to 127, got 0"),
        (lambda: MatcherOptions(uniqueness_percent=100), "uniqueness_percent: expected 0 to 99, got 100"),
        (lambda: MatcherOptions(speckle_px=-1), "speckle_px, left_right_px: expected 0 or more, got -1"),
        (lambda: MatcherOptions(mode="9way"), "mode: expected one of"),  # type: ignore[arg-type]
    ],
)
def test_parameters_that_are_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_a_stream_keeps_its_size() -> None:
    estimator = DisparityEstimator(range_px=(0, 15))
    estimator(SIDE, SIDE)
    with pytest.raises(ValueError, match=r"left: expected the size of the pictures before, \(40, 50\), got \(40, 40\)"):
        estimator(SIDE[:, :40], SIDE[:, :40])
