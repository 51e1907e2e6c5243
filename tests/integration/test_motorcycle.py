"""Disparity of a real pair with measured truth, beside what OpenCV's matcher gives alone.

The pair comes with scikit-image: ``stereo_motorcycle`` (Scharstein et al. 2014, a quarter of the size).
"""

from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from skimage.data import stereo_motorcycle
from skimage.segmentation import felzenszwalb

from sec_lab.segmentation.disparity import dense_disparity
from sec_lab.segmentation.matching import estimate_range
from sec_lab.segmentation.phase_disparity import phase_disparity

PAIR = cache(stereo_motorcycle)


def plain_sgbm(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
    """OpenCV's matcher with the penalties that its documentation proposes, over the true range."""
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=64,
        blockSize=5,
        P1=8 * 25,
        P2=32 * 25,
        disp12MaxDiff=1,
        uniquenessRatio=10,
        speckleWindowSize=100,
        speckleRange=2,
    )
    grey = [cv2.cvtColor(side, cv2.COLOR_RGB2GRAY) for side in (left, right)]
    found = matcher.compute(*grey).astype(np.float32) / 16
    return np.where(found < 0, np.float32(np.nan), found)


def scores(found: NDArray[np.float32]) -> tuple[float, float, float]:
    """Of the pixels with truth: share filled, median error of these, share off by more than 2 px or not filled."""
    truth = PAIR()[2]
    known = np.isfinite(truth) & (truth > 0)
    missed = np.abs(found - truth)[known]
    filled = np.isfinite(missed)
    return filled.mean(), float(np.median(missed[filled])), 1 - (missed[filled] <= 2).sum() / len(missed)


def test_the_range_holds_all_disparities() -> None:
    left, right, truth = PAIR()
    least, most = estimate_range(left, right)
    assert least <= truth[np.isfinite(truth)].min()
    assert most >= truth[np.isfinite(truth)].max()


@pytest.mark.parametrize("with_labels", [False, True], ids=["without labels", "with felzenszwalb's labels"])
def test_the_dense_map_keeps_the_bounds(capsys: pytest.CaptureFixture[str], *, with_labels: bool) -> None:
    left, right, _ = PAIR()
    labels = felzenszwalb(left, scale=100, sigma=0.8, min_size=50) if with_labels else None
    filled, median_px, off = scores(dense_disparity(left, right, labels=labels))
    plain = scores(plain_sgbm(left, right))
    with capsys.disabled():
        ours = "dense, with labels" if with_labels else "dense"
        for name, (share, error, bad) in ((ours, (filled, median_px, off)), ("plain SGBM", plain)):
            print(
                f"\n{name}: {share:.1%} filled, median error {error:.3f} px, {bad:.1%} off by more than 2 px or empty"
            )
    assert filled >= 0.95
    assert median_px <= 0.25
    assert off <= 0.10
    assert off < plain[2] / 2


def test_the_sparse_map_is_sharp_where_it_speaks() -> None:
    filled, median_px, _ = scores(found := phase_disparity(*PAIR()[:2]))
    truth = PAIR()[2]
    there = np.isfinite(found) & np.isfinite(truth)
    assert filled >= 0.3
    assert median_px <= 0.2
    assert (np.abs(found - truth)[there] > 2).mean() <= 0.08
