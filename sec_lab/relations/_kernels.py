"""Compiled scan of a label image for :mod:`sec_lab.relations` (A.1).

Most neighbouring pixels carry the same label, so pixels are compared eight (or four) at a time as 64-bit words and only
those at which a line changes its label are looked at. The sequences of all columns are gathered row by row, which
spares a transposed copy. Neighbouring lines mostly show the same sequence; its hints are counted once for all of them.
Everything is local to a call: any number of threads may scan at once.
"""

import numba as nb
import numpy as np
from numpy.typing import NDArray

Codes = NDArray[np.uint8 | np.uint16]
Words = NDArray[np.uint64]
Integers = NDArray[np.int64]


@nb.njit(cache=True, nogil=True)
def _first_lane(word: np.uint64, bits: np.uint64) -> np.uint64:
    """Number of the lowest lane (of ``bits`` bits each) of a non-zero word that is not zero."""
    shift = np.uint64(0)
    if word & np.uint64(0xFFFFFFFF) == np.uint64(0):
        word >>= np.uint64(32)
        shift += np.uint64(32)
    if word & np.uint64(0xFFFF) == np.uint64(0):
        word >>= np.uint64(16)
        shift += np.uint64(16)
    if word & np.uint64(0xFF) == np.uint64(0):
        shift += np.uint64(8)
    return shift // bits


@nb.njit(cache=True, nogil=True)
def find_runs(codes: Codes, words: Words, width: int) -> tuple[NDArray[np.int32], Integers, Integers]:
    """Runs of equal labels in the rows of an image.

    Parameters
    ----------
    codes : (height, padded width) uint8 or uint16
        Labels; the columns beyond ``width`` repeat the last one.
    words : (height, padded width / lanes) uint64
        The same memory, 8 or 4 labels a word, the leftmost in the lowest bits.
    width : int

    Returns
    -------
    starts : (height · width,) int32
        Column at which each run begins, row after row; undefined after the last run.
    first_run : (height + 1,) int64
        The runs of row r are first_run[r] … first_run[r + 1] − 1.
    labels : (n,) int64
        All labels, ascending.
    """
    height, n_words = words.shape
    lanes = 8 // codes.itemsize
    bits = np.uint64(8 * codes.itemsize)
    rest = np.uint64(64 - 8 * codes.itemsize)
    lane_mask = np.uint64(2 ** (8 * codes.itemsize) - 1)
    starts = np.empty(height * width, np.int32)
    first_run = np.empty(height + 1, np.int64)
    present = np.zeros(2 ** (8 * codes.itemsize), np.bool_)
    n_runs = 0
    for row in range(height):
        first_run[row] = n_runs
        starts[n_runs] = 0
        n_runs += 1
        left = np.uint64(codes[row, 0])
        present[codes[row, 0]] = True
        for k in range(n_words):
            word = words[row, k]
            changes = word ^ ((word << bits) | left)
            left = word >> rest
            while changes != np.uint64(0):
                lane = _first_lane(changes, bits)
                changes &= ~(lane_mask << (lane * bits))
                column = k * lanes + np.int64(lane)
                starts[n_runs] = column
                n_runs += 1
                present[codes[row, column]] = True
    first_run[height] = n_runs
    return starts, first_run, np.flatnonzero(present).astype(np.int64)


@nb.njit(cache=True, nogil=True)
def _process(
    sequence: Integers,
    length: int,
    n_lines: int,
    stack: Integers,
    place: Integers,
    touching: Integers,
    overlapping: Integers,
    lines: Integers,
) -> None:
    """Count the hints of one sequence that was seen on ``n_lines`` lines, by the rules of A.1.

    ``place[segment]`` is 0 before a segment is met, its position on the stack counted from 1 while it is there, and
    −1 after it was removed; it is all 0 again at the end.
    """
    depth = 0
    for k in range(length):
        segment = sequence[k]
        if depth > 0:
            touching[stack[depth - 1], segment] += n_lines
        found = place[segment]
        if found > 0:
            for a in range(found, depth):
                inner = stack[a]
                overlapping[segment, inner] += n_lines
                place[inner] = -1
                for b in range(found, a):
                    other = stack[b]
                    overlapping[inner, other] -= n_lines
                    overlapping[other, inner] -= n_lines
            depth = found
        else:
            if found == 0:
                lines[segment] += n_lines
            stack[depth] = segment
            depth += 1
            place[segment] = depth
    for k in range(length):
        place[sequence[k]] = 0


@nb.njit(cache=True, nogil=True)
def count_hints(
    codes: Codes, words: Words, width: int, starts: NDArray[np.int32], first_run: Integers, labels: Integers
) -> tuple[Integers, Integers, Integers, Integers, NDArray[np.float64]]:
    """Counters of hints of all rows and columns (A.1), with the sizes and centres of the segments.

    Parameters are those of :func:`find_runs` and what it returns.

    Returns
    -------
    touching, overlapping : (n, n) int64
    lines, pixels : (n,) int64
    centres : (n, 2) float64
        (column, row).
    """
    height, n_words = words.shape
    lanes = 8 // codes.itemsize
    bits = np.uint64(8 * codes.itemsize)
    lane_mask = np.uint64(2 ** (8 * codes.itemsize) - 1)
    n = len(labels)
    touching = np.zeros((n, n), np.int64)
    overlapping = np.zeros((n, n), np.int64)
    lines = np.zeros(n, np.int64)
    pixels = np.zeros(n, np.int64)
    sums = np.zeros((n, 2), np.int64)  # twice the sums of columns and rows: whole numbers, so centres are exact
    segment_of = np.empty(2 ** (8 * codes.itemsize), np.int64)
    for i in range(n):
        segment_of[labels[i]] = i

    stack = np.empty(n, np.int64)
    place = np.zeros(n, np.int64)
    sequence = np.empty(max(width, height), np.int64)

    length, n_lines = 0, 0
    for row in range(height):
        first, last = first_run[row], first_run[row + 1]
        same = last - first == length
        for run in range(first, last):
            column = np.int64(starts[run])
            end = np.int64(starts[run + 1]) if run + 1 < last else width
            segment = segment_of[codes[row, column]]
            pixels[segment] += end - column
            sums[segment, 0] += (end - column) * (column + end - 1)
            sums[segment, 1] += (end - column) * 2 * row
            same = same and sequence[run - first] == segment
        if not same:
            _process(sequence, length, n_lines, stack, place, touching, overlapping, lines)
            length, n_lines = int(last - first), 0
            for run in range(first, last):
                sequence[run - first] = segment_of[codes[row, starts[run]]]
        n_lines += 1
    _process(sequence, length, n_lines, stack, place, touching, overlapping, lines)

    columns = np.empty((height, width), codes.dtype)  # k-th label of each column's sequence
    lengths = np.ones(width, np.int64)
    columns[0] = codes[0, :width]
    for row in range(1, height):
        for k in range(n_words):
            changes = words[row, k] ^ words[row - 1, k]
            while changes != np.uint64(0):
                lane = _first_lane(changes, bits)
                changes &= ~(lane_mask << (lane * bits))
                column = k * lanes + np.int64(lane)
                if column < width:
                    columns[lengths[column], column] = codes[row, column]
                    lengths[column] += 1
    length, n_lines = 0, 0
    for line in range(width):
        same = lengths[line] == length
        if same:
            for k in range(length):
                if segment_of[columns[k, line]] != sequence[k]:
                    same = False
                    break
        if not same:
            _process(sequence, length, n_lines, stack, place, touching, overlapping, lines)
            length, n_lines = int(lengths[line]), 0
            for k in range(length):
                sequence[k] = segment_of[columns[k, line]]
        n_lines += 1
    _process(sequence, length, n_lines, stack, place, touching, overlapping, lines)

    centres = np.empty((n, 2), np.float64)
    for i in range(n):
        centres[i, 0] = sums[i, 0] / (2 * pixels[i])
        centres[i, 1] = sums[i, 1] / (2 * pixels[i])
        for j in range(i):
            hints = touching[i, j] + touching[j, i]
            touching[i, j] = hints
            touching[j, i] = hints
    return touching, overlapping, lines, pixels, centres
