"""Compiled walk along the borders of segments for :mod:`sec_lab.relations`: depth steps and pixels that change hands.

Only pixels at which a line changes its label are looked at; they are found as in :mod:`sec_lab.relations._kernels`,
eight (or four) pixels at a time. Everything is local to a call: any number of threads may walk at once.
"""

import numba as nb
import numpy as np
from numpy.typing import NDArray

from sec_lab.relations._kernels import Codes, Integers, Words, _first_lane

Depth = NDArray[np.float32]
Planes = NDArray[np.float64]


@nb.njit(cache=True, nogil=True)
def _side(
    codes: Codes, depth_m: Depth, row: int, column: int, down: int, right: int, width: int, skip: int, reach: int
) -> float:
    """Mean known depth of one side of a border, ``skip`` pixels away from the border in all directions if possible.

    Walking straight away from a border that runs aslant hardly leaves it; so pixels count whose neighbours to both
    sides belong to the segment too. A segment that is too thin for that is taken in its middle.
    """
    height = codes.shape[0]
    label = codes[row, column]
    total, known, taken = 0.0, 0, 0
    length = 1
    while length < 4 * skip + reach:
        r, c = row + down * length, column + right * length
        if r < 0 or r >= height or c < 0 or c >= width or codes[r, c] != label:
            break
        if length >= skip:
            one, other = r + right * skip, r - right * skip
            left, far = c - down * skip, c + down * skip
            inside = min(one, other) >= 0 and max(one, other) < height and min(left, far) >= 0
            inside = inside and max(left, far) < width
            if inside and codes[one, far] == label and codes[other, left] == label:
                value = depth_m[r, c]
                taken += 1
                if value > 0:
                    total += value
                    known += 1
                if taken == reach:
                    break
        length += 1
    return total / known if known else 0.0


@nb.njit(cache=True, nogil=True)
def border_steps(
    codes: Codes,
    words: Words,
    width: int,
    starts: NDArray[np.int32],
    first_run: Integers,
    labels: Integers,
    depth_m: Depth,
    limit_m: float,
    skip: int,
    reach: int,
    planes: Planes,
) -> tuple[Integers, Integers, Integers]:
    """Steps in depth along the common border of every pair of segments.

    Parameters
    ----------
    codes, words, width, starts, first_run, labels
        As of :func:`sec_lab.relations._kernels.count_hints`.
    depth_m : (height, width) float32
        Metres; 0 is unknown.
    limit_m : float
        Largest step that is small.
    skip, reach : int
        Pixels next to the border that are passed over, and how many are averaged after them.
    planes : (n, 4) float64
        Of the segments, see :func:`sec_lab.relations._plane_kernels.planes_of`. Where the step is small and the side
        whose plane is the farther one is nearer than that allows, this is smear of the other side, and the plane counts
        at the border.

    Returns
    -------
    known, small : (n, n) int64
        Places of the border at which the depth of both sides is known, and those of them with a small step; symmetric.
    in_front : (n, n) int64
        Places at which i (row) is nearer than j (column) by more than the limit.
    """
    height, n_words = words.shape
    lanes = 8 // codes.itemsize
    bits = np.uint64(8 * codes.itemsize)
    lane_mask = np.uint64(2 ** (8 * codes.itemsize) - 1)
    n = len(labels)
    known = np.zeros((n, n), np.int64)
    small = np.zeros((n, n), np.int64)
    in_front = np.zeros((n, n), np.int64)
    segment_of = np.empty(2 ** (8 * codes.itemsize), np.int64)
    for i in range(n):
        segment_of[labels[i]] = i
    for row in range(height):
        for run in range(first_run[row] + 1, first_run[row + 1]):
            column = np.int64(starts[run])
            before = _side(codes, depth_m, row, column - 1, 0, -1, width, skip, reach)
            after = _side(codes, depth_m, row, column, 0, 1, width, skip, reach)
            if before > 0 and after > 0:
                i, j = segment_of[codes[row, column - 1]], segment_of[codes[row, column]]
                x, y = column / width, row / height
                _count(known, small, in_front, i, j, before, after, planes, x, y, limit_m)
        if row == 0:
            continue
        for k in range(n_words):
            changes = words[row, k] ^ words[row - 1, k]
            while changes != np.uint64(0):
                lane = _first_lane(changes, bits)
                changes &= ~(lane_mask << (lane * bits))
                column = k * lanes + np.int64(lane)
                if column < width:
                    before = _side(codes, depth_m, row - 1, column, -1, 0, width, skip, reach)
                    after = _side(codes, depth_m, row, column, 1, 0, width, skip, reach)
                    if before > 0 and after > 0:
                        i, j = segment_of[codes[row - 1, column]], segment_of[codes[row, column]]
                        x, y = column / width, row / height
                        _count(known, small, in_front, i, j, before, after, planes, x, y, limit_m)
    return known, small, in_front


@nb.njit(cache=True, nogil=True)
def _count(
    known: Integers,
    small: Integers,
    in_front: Integers,
    i: int,
    j: int,
    before: float,
    after: float,
    planes: Planes,
    x: float,
    y: float,
    limit_m: float,
) -> None:
    known[i, j] += 1
    known[j, i] += 1
    if abs(before - after) <= limit_m:
        one = planes[i, 0] * x + planes[i, 1] * y + planes[i, 2]
        other = planes[j, 0] * x + planes[j, 1] * y + planes[j, 2]
        if 0 < one < other and 1 / before - one > planes[i, 3]:
            before = 1 / one
        elif 0 < other < one and 1 / after - other > planes[j, 3]:
            after = 1 / other
    if abs(before - after) <= limit_m:
        small[i, j] += 1
        small[j, i] += 1
    elif before < after:
        in_front[i, j] += 1
    else:
        in_front[j, i] += 1


@nb.njit(cache=True, nogil=True)
def changed_pixels(
    codes: Codes, words: Words, before: Codes, words_before: Words, width: int, labels: Integers
) -> Integers:
    """How many pixels went from each segment to each other one between two label images.

    Parameters
    ----------
    codes, words, before, words_before
        Both images, padded alike, with the memory of each as 64-bit words.
    width : int
    labels : (n,) int64
        All labels of both images.

    Returns
    -------
    (n, n) int64
        Pixels that were i (row) and are j (column).
    """
    height, n_words = words.shape
    lanes = 8 // codes.itemsize
    bits = np.uint64(8 * codes.itemsize)
    lane_mask = np.uint64(2 ** (8 * codes.itemsize) - 1)
    n = len(labels)
    changed = np.zeros((n, n), np.int64)
    segment_of = np.zeros(2 ** (8 * codes.itemsize), np.int64)
    for i in range(n):
        segment_of[labels[i]] = i
    for row in range(height):
        for k in range(n_words):
            changes = words[row, k] ^ words_before[row, k]
            while changes != np.uint64(0):
                lane = _first_lane(changes, bits)
                changes &= ~(lane_mask << (lane * bits))
                column = k * lanes + np.int64(lane)
                if column < width:
                    changed[segment_of[before[row, column]], segment_of[codes[row, column]]] += 1
    return changed
