"""Masks of polygons, as COCO writes objects that were outlined by hand."""

import numpy as np
from numpy.typing import ArrayLike

from sec_lab.codes import as_array
from sec_lab.segmentation.masks.objects import Mask

MAX_CORNERS = 100_000
"""Most corners of the polygons of one mask."""

_FARTHEST = 1e7


def polygon_mask(polygons: object, size: tuple[int, int]) -> Mask:
    """Mask of the pixels whose centres lie inside of any of the polygons.

    Coordinates are (column, row) of points, not of pixels: (0, 0) is the corner of the first pixel and (0.5, 0.5) its
    centre, as in the COCO API, where a box from (0, 0) to (1, 1) encloses the first pixel. What a polygon encloses
    twice is outside of it.

    Departure from the COCO API: it traces outlines on a grid five times as fine, which may differ by a pixel along
    them.

    Parameters
    ----------
    polygons : list of list of float
        Each [x0, y0, x1, y1, …], at least three corners.
    size : tuple of int
        (height, width).

    Returns
    -------
    (height, width) ndarray of bool

    Raises
    ------
    ValueError
        If there is no polygon, or one has fewer than three corners, half a corner, or a coordinate that is not finite
        or far off any picture.

    Examples
    --------
    >>> polygon_mask([[1, 0, 3, 0, 3, 2, 1, 2]], (2, 4)).astype(int)
    array([[0, 1, 1, 0],
           [0, 1, 1, 0]])
    """
    if not isinstance(polygons, list) or not polygons:
        raise ValueError("polygons: expected a list of at least one polygon")
    if sum(len(polygon) if isinstance(polygon, list) else 1 for polygon in polygons) > 2 * MAX_CORNERS:
        raise ValueError(f"polygons: expected at most {MAX_CORNERS} corners")
    mask = np.zeros(size, dtype=bool)
    for polygon in polygons:
        mask |= _inside(polygon, size)
    return mask


def _inside(polygon: ArrayLike, size: tuple[int, int]) -> Mask:
    numbers = as_array(polygon, what="polygon", ndim=1).astype(np.float64)
    if numbers.size < 6 or numbers.size % 2:
        raise ValueError(f"polygon: expected x and y of at least three corners, got {numbers.size} numbers")
    if not (np.abs(numbers) <= _FARTHEST).all():
        raise ValueError(
            f"polygon: expected coordinates of at most {_FARTHEST:g}, got {numbers[~(abs(numbers) <= 1e7)][0]}"
        )
    height, width = size
    corners = numbers.reshape(-1, 2)
    # A row of pixels, looked at along its centres, goes in or out wherever it crosses an edge.
    crossings = np.zeros((height, width + 1), dtype=np.int64)
    for (x, y), (next_x, next_y) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        (low_y, low_x), (high_y, high_x) = sorted([(y, x), (next_y, next_x)])
        first, last = (int(np.clip(np.ceil(edge - 0.5), 0, height)) for edge in (low_y, high_y))
        if first < last:
            rows = np.arange(first, last)
            columns = low_x + (rows + 0.5 - low_y) * (high_x - low_x) / (high_y - low_y)
            crossings[rows, np.clip(np.ceil(columns - 0.5), 0, width).astype(np.int64)] += 1
    inside: Mask = np.cumsum(crossings[:, :width], axis=1) % 2 == 1
    return inside
