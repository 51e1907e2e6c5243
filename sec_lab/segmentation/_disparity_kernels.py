"""Compiled parts of disparity: filling of holes along the rows, and the running mean of what rests."""

import numba as nb
import numpy as np
from numpy.typing import NDArray

Disparity = NDArray[np.float32]


@nb.njit(cache=True, nogil=True)
def row_ends(disparity: Disparity, n: int) -> Disparity:
    """Disparity at both ends of every row: the median of the first and of the last ``n`` known ones; NaN without any.

    Parameters
    ----------
    disparity : (height, width) float32
    n : int

    Returns
    -------
    (height, 2) float32
    """
    height, width = disparity.shape
    ends = np.full((height, 2), np.nan, np.float32)
    known = np.empty(n, np.float32)
    for row in range(height):
        for side in range(2):
            count = 0
            for k in range(width):
                value = disparity[row, k if side == 0 else width - 1 - k]
                if value == value:
                    known[count] = value
                    count += 1
                    if count == n:
                        break
            if count > 0:
                ends[row, side] = np.median(known[:count])
    return ends


@nb.njit(cache=True, nogil=True)
def fill_rows(disparity: Disparity, labels: NDArray[np.int32], ends: Disparity, same_px: float) -> None:
    """Fill, in place, the holes of every row from within the run of equal labels that they lie in.

    Between two known disparities a hole is filled linearly if these differ by at most ``same_px`` (one surface), by
    the smaller of the two otherwise: what one of two cameras cannot see belongs to what is farther away. A hole that
    reaches an end of its run takes the one disparity beside it; at an end of the row that of ``ends``, unless NaN.

    Parameters
    ----------
    disparity : (height, width) float32
        NaN in the holes.
    labels : (height, width) int32
    ends : (height, 2) float32
    same_px : float
    """
    height, width = disparity.shape
    for row in range(height):
        column = 0
        while column < width:
            if disparity[row, column] == disparity[row, column]:
                column += 1
                continue
            label = labels[row, column]
            first = column
            while column < width and labels[row, column] == label and disparity[row, column] != disparity[row, column]:
                column += 1
            before, after = np.float32(np.nan), np.float32(np.nan)
            if first == 0:
                before = ends[row, 0]
            elif labels[row, first - 1] == label:
                before = disparity[row, first - 1]
            if column == width:
                after = ends[row, 1]
            elif labels[row, column] == label:
                after = disparity[row, column]
            if after != after or (first == 0 and column < width and before == before):
                after = before
            elif before != before or (column == width and first > 0):
                before = after
            if abs(after - before) <= same_px:
                slope = (after - before) / np.float32(column - first + 1)
                for k in range(first, column):
                    disparity[row, k] = before + slope * np.float32(k - first + 1)
            else:
                for k in range(first, column):
                    disparity[row, k] = min(before, after)


@nb.njit(cache=True, nogil=True)
def blend_resting(
    disparity: Disparity,
    moved: NDArray[np.bool_],
    mean: Disparity,
    count: NDArray[np.uint8],
    longest: int,
    jump_px: float,
) -> None:
    """Update, in place, the running mean of the disparity of pixels at which the picture does not change.

    Parameters
    ----------
    disparity : (height, width) float32
        Of this frame; NaN where unknown.
    moved : (height, width) bool
        Where the picture has changed: the mean begins anew.
    mean : (height, width) float32
        NaN where nothing is known so far.
    count : (height, width) uint8
        Number of frames in the mean, at most ``longest``. A frame without a disparity, or with one that is farther than
        ``jump_px`` from the mean, takes one off: a mean that is confirmed less than every other time is given up, as
        where chance finds a match now and then.
    longest : int
    jump_px : float
    """
    height, width = disparity.shape
    for row in range(height):
        for column in range(width):
            new = disparity[row, column]
            n = count[row, column]
            old = mean[row, column]
            if moved[row, column] or n == 0:
                mean[row, column] = new
                count[row, column] = 1 if new == new else 0
            elif abs(new - old) <= jump_px:
                if n < longest:
                    n += 1
                    count[row, column] = n
                mean[row, column] = old + (new - old) / np.float32(n)
            else:
                count[row, column] = n - 1
                if n == 1:
                    mean[row, column] = np.nan
