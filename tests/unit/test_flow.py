"""Optic flow, and labels carried along it."""

import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.segmentation import optic_flow, warp_labels

IMAGE = np.zeros((4, 6, 3), dtype=np.uint8)
STILL = np.zeros((2, 3, 2), dtype=np.float32)


def pattern(height: int, width: int, seed: int = 0) -> NDArray[np.uint8]:
    """Random patches of 6×6 pixels, smoothed by averaging shifted copies: a picture with structure everywhere."""
    rng = np.random.default_rng(seed)
    patches = rng.integers(0, 256, (height // 6 + 1, width // 6 + 1, 3))
    picture = np.kron(patches, np.ones((6, 6, 1)))[:height, :width]
    return np.mean([np.roll(picture, (i, j), (0, 1)) for i in (0, 1, 2) for j in (0, 1, 2)], axis=0).astype(np.uint8)


@pytest.mark.parametrize(("rows", "columns"), [(0, 0), (0, 4), (-4, 0), (6, -2)])
def test_flow_leads_back(rows: int, columns: int) -> None:
    before = pattern(120, 150)
    flow = optic_flow(before, np.roll(before, (rows, columns), (0, 1)))
    assert flow.shape == (60, 75, 2)
    assert flow.dtype == np.float32
    inner = flow[12:-12, 12:-12]
    assert np.median(abs(inner[..., 0] + columns)) < 0.5
    assert np.median(abs(inner[..., 1] + rows)) < 0.5


def test_pictures_that_are_too_small_for_a_flow_stand_still() -> None:
    flow = optic_flow(IMAGE, IMAGE)
    assert flow.shape == (2, 3, 2)
    assert not flow.any()


def test_labels_move_with_their_pixels() -> None:
    before = pattern(24, 40)
    labels = np.arange(1, 24 * 40 + 1).reshape(24, 40)
    flow = np.zeros((12, 20, 2), dtype=np.float32)
    flow[..., 0], flow[..., 1] = -3, 2
    warped = warp_labels(labels, before, np.roll(before, (-2, 3), (0, 1)), flow, residual_limit=0)
    assert (warped[:-2, 3:] == labels[2:, :-3]).all()


def test_what_changes_its_colour_is_vacant() -> None:
    before = np.full((4, 6, 3), 100, dtype=np.uint8)
    after = before.copy()
    after[1, 1] = (103, 104, 100)
    after[2, 2] = (103, 105, 100)
    labels = np.full((4, 6), 7)
    # The differences are 5 and √34.
    warped = warp_labels(labels, before, after, STILL, residual_limit=5)
    expected = labels.copy()
    expected[2, 2] = 0
    assert (warped == expected).all()
    assert warped.dtype == np.uint16


def test_a_pixel_stays_where_the_flow_fits_worse() -> None:
    # The flow of a moving thing spills over its border; the ground beside it did not move.
    before = np.zeros((2, 6, 3), dtype=np.uint8)
    before[:, 3:] = 200
    labels = np.where(before[..., 0] > 0, 2, 1)
    flow = np.full((1, 3, 2), (2.0, 0.0), dtype=np.float32)
    assert (warp_labels(labels, before, before, flow) == labels).all()


def test_flow_from_outside_of_the_picture_counts_as_none() -> None:
    flow = np.full((2, 3, 2), 1000.0, dtype=np.float32)
    assert (warp_labels(np.full((4, 6), 3), IMAGE, IMAGE, flow) == 3).all()


def test_number_of_threads_changes_nothing() -> None:
    import cv2

    before = pattern(200, 240)
    after = np.roll(before, (3, 2), (0, 1))
    threads = cv2.getNumThreads()
    found = []
    try:
        for n_threads in (1, 2, 4):
            cv2.setNumThreads(n_threads)
            found.append(optic_flow(before, after))
    finally:
        cv2.setNumThreads(threads)
    assert all((flow == found[0]).all() for flow in found)


@pytest.mark.parametrize(
    ("labels", "after", "flow", "options", "message"),
    [
        (np.ones((4, 6), int), IMAGE[:2], STILL, {}, "pictures: expected two of one size"),
        (np.ones((6, 4), int), IMAGE, STILL, {}, r"labels: expected shape \(4, 6\) like the pictures, got \(6, 4\)"),
        (np.full((4, 6), 40_000), IMAGE, STILL, {}, "labels: expected 0 to 32767, got 40000 to 40000"),
        (np.full((4, 6), -1), IMAGE, STILL, {}, "labels: expected 0 to 32767, got -1 to -1"),
        (np.ones((4, 6), int), IMAGE, STILL[:1], {}, r"flow: expected shape \(2, 3, 2\), got \(1, 3, 2\)"),
        (np.ones((4, 6), int), IMAGE, STILL, {"residual_limit": -1}, "residual_limit: expected a number from 0 on"),
        (np.ones((4, 6), int), IMAGE, STILL, {"residual_limit": np.nan}, "residual_limit: .* got nan"),
    ],
)
def test_bad_input(
    labels: NDArray[np.int64],
    after: NDArray[np.uint8],
    flow: NDArray[np.float32],
    options: dict[str, float],
    message: str,
) -> None:
    with pytest.raises(ValueError, match=message):
        warp_labels(labels, IMAGE, after, flow, **options)


def test_flow_of_pictures_that_differ_in_size() -> None:
    with pytest.raises(ValueError, match=r"pictures: expected two of one size, got shapes \(4, 6, 3\) and \(2, 6, 3\)"):
        optic_flow(IMAGE, IMAGE[:2])
