"""Filling of the holes of a disparity map: within segments, or from the side that is farther away."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_integers
from sec_lab.segmentation.stereo import Disparity

_SAME_SURFACE_PX = 1.5
_PLANE_PX = 1.0  # residual of what lies on the plane of its segment
_PLANE_SHARE = 0.6  # of the known pixels of a segment that must do so
_LEAST_KNOWN = 30
_MOST_FITTED = 4000
_FIT_ROUNDS = 12
_END_PIXELS = 15
_END_ROWS = 9


def fill_holes(disparity: Disparity, *, labels: ArrayLike | None = None) -> Disparity:
    """Disparity in every pixel, if there is any.

    With labels, a segment whose known disparities lie on a plane (least absolute deviations, so that a minority of
    wrong ones has no say) is filled by it; another one along its rows. What remains, and everything without labels, is
    filled along the rows: linearly between two ends of one surface; from the end that is farther away where two
    surfaces meet, as that one is hidden from the right camera; and at the margins of the picture, which the right
    camera does not show, from the known disparities nearest to them, smoothed over rows. Rows without any
    are filled from those above and below.

    Parameters
    ----------
    disparity : (height, width) ndarray of float32
        NaN in the holes.
    labels : (height, width) array_like of int, optional
        Segment of every pixel.

    Returns
    -------
    (height, width) ndarray of float32
        Known pixels are as they were; NaN only if none is known.

    Raises
    ------
    ValueError
        If the disparity is no picture of float32, or the labels have another size.

    Examples
    --------
    Between two surfaces the hole belongs to the one behind:

    >>> nan = np.nan
    >>> fill_holes(np.array([[4, nan, 9, nan, 10]], dtype=np.float32))
    array([[ 4. ,  4. ,  9. ,  9.5, 10. ]], dtype=float32)
    """
    from sec_lab.segmentation._disparity_kernels import fill_rows, row_ends

    if disparity.ndim != 2 or disparity.dtype != np.float32:
        raise ValueError(f"disparity: expected a picture of float32, got {disparity.shape} of {disparity.dtype}")
    filled = np.array(disparity, order="C")
    no_ends = np.full((len(filled), 2), np.nan, dtype=np.float32)
    if labels is not None:
        segments = as_integers(labels, what="labels", ndim=2).astype(np.int32)
        if segments.shape != disparity.shape:
            raise ValueError(f"labels: expected the size of the disparity, {disparity.shape}, got {segments.shape}")
        _fill_planes(filled, segments)
        fill_rows(filled, segments, no_ends, _SAME_SURFACE_PX)
    whole = np.zeros(filled.shape, dtype=np.int32)
    fill_rows(filled, whole, _smoothed(row_ends(filled, _END_PIXELS)), _SAME_SURFACE_PX)
    if np.isnan(filled).any() and not np.isnan(filled).all():
        columns = np.ascontiguousarray(filled.T)
        fill_rows(columns, np.ascontiguousarray(whole.T), np.full((len(columns), 2), np.nan, np.float32), 1e9)
        filled = np.ascontiguousarray(columns.T)
    return filled


def _smoothed(ends: Disparity) -> Disparity:
    """Median over rows, of those that are known."""
    padded = np.pad(ends, ((_END_ROWS // 2, _END_ROWS // 2), (0, 0)), mode="edge")
    windows = np.sort(np.lib.stride_tricks.sliding_window_view(padded, _END_ROWS, axis=0), axis=-1)  # NaN comes last
    known = np.isfinite(windows).sum(axis=-1)
    middle = np.take_along_axis(windows, np.maximum(known - 1, 0)[..., None] // 2, axis=-1)[..., 0]
    return np.where(np.isnan(ends), ends, middle).astype(np.float32)


def _fill_planes(disparity: Disparity, labels: NDArray[np.int32]) -> None:
    order = np.argsort(labels, axis=None, kind="stable")
    bounds = np.flatnonzero(np.diff(labels.ravel()[order])) + 1
    values = disparity.ravel()
    width = labels.shape[1]
    for pixels in np.split(order, bounds):
        known = np.isfinite(values[pixels])
        if known.all() or known.sum() < _LEAST_KNOWN:
            continue
        there, holes = pixels[known], pixels[~known]
        plane = _plane(there, values, width)
        if plane is None:
            continue
        room = np.ptp(values[there]) / 2
        low, high = values[there].min() - room, values[there].max() + room
        values[holes] = np.clip(_height(plane, _place(holes, width)), max(0, low), high)


def _plane(pixels: NDArray[np.int64], values: Disparity, width: int) -> NDArray[np.float64] | None:
    """Plane of least absolute deviations, by least squares weighted anew; None if too few pixels lie on it."""
    chosen = pixels[:: -(-len(pixels) // _MOST_FITTED)]
    place, seen = _place(chosen, width), values[chosen].astype(np.float64)
    weight = np.ones(len(chosen))
    for _ in range(_FIT_ROUNDS):
        # Sums without BLAS, whose last digits depend on the number of threads; a ridge keeps single rows solvable.
        weighted = place * weight
        square = (weighted[:, None] * place[None]).sum(axis=-1) + 1e-9 * np.eye(3)
        plane = np.asarray(np.linalg.solve(square, (weighted * seen).sum(axis=-1)))
        missed = np.abs(_height(plane, place) - seen)
        weight = 1 / np.maximum(missed, 0.05)
    return plane if (missed <= _PLANE_PX).mean() >= _PLANE_SHARE else None


def _place(pixels: NDArray[np.int64], width: int) -> NDArray[np.float64]:
    return np.stack([pixels % width / width, pixels // width / width, np.ones(len(pixels))])


def _height(plane: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(plane[0] * place[0] + plane[1] * place[1] + plane[2])
