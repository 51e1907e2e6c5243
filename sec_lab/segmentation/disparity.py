"""Dense disparity from rectified stereo pairs, and depth from disparity (§2.2)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.recording import Calibration
from sec_lab.segmentation.disparity_filling import fill_holes
from sec_lab.segmentation.matching import MatcherOptions, estimate_range, matched
from sec_lab.segmentation.stereo import Disparity, as_range, checked_pair, grey

DENSE = MatcherOptions(block_px=5, step_penalty=2, jump_penalty=16, speckle_px=100, mode="8way")
"""Matcher of :func:`dense_disparity`: costs from all eight directions."""


def dense_disparity(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    *,
    labels: ArrayLike | None = None,
    range_px: tuple[float, float] | None = None,
    fill: bool = True,
    options: MatcherOptions = DENSE,
) -> Disparity:
    """Dense disparity of a rectified pair: semi-global matching, checked from both sides, holes filled in segments.

    OpenCV's semi-global matcher (steps of 1/16 pixel, speckles removed) runs twice, with left and with right as the
    reference; where these differ by more than ``options.left_right_px`` there is a hole. A median of 5×5 removes what
    stands alone. Then :func:`~sec_lab.segmentation.disparity_filling.fill_holes`.

    Parameters
    ----------
    left, right : (height, width) or (height, width, 3) ndarray of uint8
        Rectified pictures (grey or RGB) of one size.
    labels : (height, width) array_like of int, optional
        Segment of every pixel of the left picture: holes are filled within segments.
    range_px : (least, most) of float, optional
        Disparities that may occur; estimated from the pair if left out, see
        :func:`~sec_lab.segmentation.matching.estimate_range`.
    fill : bool, optional
        Whether to fill holes.
    options : MatcherOptions, optional

    Returns
    -------
    (height, width) ndarray of float32
        Pixel (row, column) of the left picture is at (row, column − disparity) in the right one; NaN where it is
        unknown, filled only if nothing is.

    Raises
    ------
    ValueError
        If the pictures differ in size, or are of another type or smaller than 32 pixels, or labels or range do not fit.

    Examples
    --------
    >>> scene = np.random.default_rng(1).integers(0, 255, (64, 100), dtype=np.uint8)
    >>> found = dense_disparity(scene[:, :90], scene[:, 5:95], range_px=(0, 15))
    >>> round(float(np.median(found)), 1), np.isnan(found).any()
    (5.0, np.False_)
    """
    import cv2

    checked_pair(left, right)
    segments = None if labels is None else np.asarray(labels)
    if segments is not None and segments.shape != left.shape[:2]:
        raise ValueError(f"labels: expected the size of the pictures, {left.shape[:2]}, got {segments.shape}")
    limits = estimate_range(left, right) if range_px is None else as_range(range_px, left.shape[1])
    one, other = grey(left), grey(right)
    found = matched(one, other, range_px=limits, options=options)
    # In the mirror the right camera is the left one.
    mirrored = matched(
        np.ascontiguousarray(other[:, ::-1]), np.ascontiguousarray(one[:, ::-1]), range_px=limits, options=options
    )[:, ::-1]
    columns = np.arange(found.shape[1], dtype=np.float32) - np.where(np.isnan(found), 0, found)
    there = np.take_along_axis(mirrored, np.clip(np.rint(columns), 0, None).astype(np.int64), axis=1)
    found[~(np.abs(found - there) <= options.left_right_px)] = np.nan
    hole = np.isnan(found)
    if not hole.all():
        found = np.asarray(cv2.medianBlur(fill_holes(found), 5), dtype=np.float32)
        found[hole] = np.nan
    return fill_holes(found, labels=segments) if fill else found


def depth_from_disparity(disparity: ArrayLike, calibration: Calibration) -> NDArray[np.float32]:
    """Depth along the optical axis: focal length · baseline / disparity.

    Parameters
    ----------
    disparity : array_like of float
        In pixels; not finite or not above 0 where it is unknown.
    calibration : Calibration
        With a baseline.

    Returns
    -------
    ndarray of float32
        Metres; 0 where the disparity is unknown.

    Raises
    ------
    ValueError
        If the calibration has no baseline, or the disparities are no floating-point numbers.

    Examples
    --------
    >>> camera = Calibration(400, (160, 128), baseline_m=0.12)
    >>> depth_from_disparity([24.0, 48.0, np.nan], camera)
    array([2., 1., 0.], dtype=float32)
    """
    if calibration.baseline_m is None:
        raise ValueError("calibration: expected one with a baseline, got none: depth cannot be told from disparity")
    values = np.asarray(disparity)
    if not np.issubdtype(values.dtype, np.floating):
        raise ValueError(f"disparity: expected floating-point numbers of pixels, got {values.dtype}")
    known = np.isfinite(values) & (values > 0)
    depth = np.zeros(values.shape, dtype=np.float32)
    np.divide(calibration.focal_length_px * calibration.baseline_m, values, out=depth, where=known, casting="same_kind")
    return depth
