"""Compiled state of all pairs of segments for :mod:`sec_lab.relations.over_time`.

Segments live in slots, pairs in the upper triangle of slot × slot. The last frames lie in a ring: what is decided late
is written back to the frame at which it began.
"""

import numba as nb
import numpy as np
from numpy.typing import NDArray

from sec_lab.relations._kernels import Integers

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]

UNDECIDED = 255
# Columns of the table of slots.
FIRST, LAST, SEEN, NODE, LEAVES, RESTS = range(6)
# Columns of the table of pairs: state, two running candidates (contact, kind) with their first frame and number of
# frames, and how often each code was seen since.
STATE, CONTACT_START, CONTACT_COUNT, KIND_START, KIND_COUNT, ONES, TWOS, ZEROS, TOGETHER = range(9)


@nb.njit(cache=True, nogil=True)
def resting(changed: Integers, hints: Integers, pixels: Integers, most_px: float) -> NDArray[np.int8]:
    """Which segments have not moved against the background, by the pixels that changed along their borders.

    Segments are settled one after the other, the one with the longest border to what is known to rest first; those
    that have no such border count as moving.

    Parameters
    ----------
    changed : (n, n) int64
        Pixels that went from one segment to another.
    hints : (n, n) int64
        Length of the common borders.
    pixels : (n,) int64
        Sizes; the largest segment is the background.
    most_px : float
        Largest mean shift of a border that rests.

    Returns
    -------
    (n,) int8
        1 rests, 0 moves, −1 open.
    """
    n = len(pixels)
    rests = np.full(n, -1, np.int8)
    settled = np.zeros(n, np.bool_)
    border = np.zeros(n, np.int64)
    shifted = np.zeros(n, np.int64)
    latest = int(np.argmax(pixels))
    while latest >= 0:
        settled[latest] = True
        if latest == np.argmax(pixels) or shifted[latest] <= most_px * border[latest]:
            rests[latest] = 1
            for j in range(n):
                border[j] += hints[latest, j]
                shifted[j] += changed[latest, j] + changed[j, latest]
        else:
            rests[latest] = 0
        latest = -1
        longest = 0
        for j in range(n):
            if not settled[j] and border[j] > longest:
                latest, longest = j, border[j]
    return rests


@nb.njit(cache=True, nogil=True)
def _write_back(ring: Bytes, i: int, j: int, start: int, now: int, code: int) -> None:
    length = len(ring)
    for frame in range(max(start, now - length + 1), now + 1):
        ring[frame % length, i, j] = code
        ring[frame % length, j, i] = code


@nb.njit(cache=True, nogil=True)
def _code(state: int, touching: float, overlapping: float, thresholds: Floats) -> int:
    """Relation of one frame; what holds already needs less to go on holding."""
    enough = thresholds[2] if state == 1 else thresholds[3]
    if state == UNDECIDED:
        enough = 0.5 * (thresholds[2] + thresholds[3])
    linked = thresholds[0] if state == 1 or state == 2 else thresholds[1]
    if state == UNDECIDED:
        linked = 0.5 * (thresholds[0] + thresholds[1])
    if touching > linked:
        return 1 if overlapping > enough else 2
    return 0


@nb.njit(cache=True, nogil=True)
def advance_segments(
    now: int,
    table: Integers,
    active: Bools,
    here: Bools,
    present: NDArray[np.uint8],
    min_life: int,
    absence: int,
    hold: int,
) -> None:
    """Which segments are nodes at this frame.

    Parameters
    ----------
    now : int
        Frames before this one.
    table : (n, 6) int64
        State of the slots.
    active, here : (n,) bool
        Slots in use; those whose segment is seen.
    present : (length, n) uint8
        Ring of nodes.
    min_life, absence, hold : int
        Frames for which a segment must be seen to become a node, be unseen to be gone once it has left the picture,
        and be unseen to be gone in any case.
    """
    length = len(present)
    for i in range(len(active)):
        present[now % length, i] = 0
        if not active[i]:
            continue
        if here[i]:
            table[i, LAST] = now
            table[i, SEEN] += 1
            if not table[i, NODE] and table[i, SEEN] >= min_life:
                table[i, NODE] = 1
                for frame in range(max(table[i, FIRST], now - length + 1), now):
                    present[frame % length, i] = 1
            present[now % length, i] = table[i, NODE]
            continue
        gap = now - table[i, LAST]
        if not table[i, NODE]:
            if gap > min_life:
                active[i] = False
        elif gap >= absence and (table[i, LEAVES] or hold <= absence):
            active[i] = False
            for frame in range(max(table[i, LAST] + 1, now - length + 1), now):
                present[frame % length, i] = 0
        elif gap >= hold:
            active[i] = False
        else:
            present[now % length, i] = 1


@nb.njit(cache=True, nogil=True)
def advance_pairs(
    now: int,
    table: Integers,
    active: Bools,
    seen: Integers,
    pairs: Integers,
    ring: Bytes,
    touching: Floats,
    overlapping: Floats,
    sure: Bools,
    covered: Bools,
    sizes: Integers,
    thresholds: Floats,
    lasting: int,
    settle: int,
    calm_kind: int,
) -> None:
    """Relation of every pair of active segments at this frame.

    Parameters
    ----------
    now, table, active
        As of :func:`advance_segments`.
    seen : (m,) int64
        Slot of each segment that is seen.
    pairs : (n, n, 9) int64
        State of the pairs.
    ring : (length, n, n) uint8
        Ring of relations.
    touching, overlapping : (m, m) float64
        Evidence of this frame, symmetric.
    sure : (m, m) bool
        Whether there is evidence; without it the relation stays.
    covered : (m,) bool
        Segments that border on one that moves.
    sizes : (m,) int64
    thresholds : (4,) float64
        Touching: to stay, to begin; overlapping: to stay, to begin.
    lasting, settle : int
        Frames for which a change must last; and for which both must rest to be frozen, never if negative.
    calm_kind : int
        1 if only segments that rest and are not covered can overlap, 0 if all can.
    """
    length = len(ring)
    m = len(seen)
    for a in range(m):
        for b in range(a):
            i, j = min(seen[a], seen[b]), max(seen[a], seen[b])
            pair = pairs[i, j]
            state = pair[STATE]
            if not sure[a, b]:
                continue
            code = _code(state, touching[a, b], overlapping[a, b], thresholds)
            smaller = a if sizes[a] < sizes[b] else b
            rest = min(table[i, RESTS], table[j, RESTS])
            calm = not calm_kind or (rest > 0 and not covered[smaller])
            if code == 1 and state != 1 and not calm:
                code = 2
            if state == UNDECIDED:
                pair[ZEROS] += code == 0
                pair[ONES] += code == 1
                pair[TWOS] += code == 2
                pair[TOGETHER] += 1
                if pair[TOGETHER] >= lasting:
                    pair[STATE] = first_state(pair)
                    _write_back(ring, i, j, max(table[i, FIRST], table[j, FIRST]), now, pair[STATE])
                    clear(pair)
                continue
            if 0 <= settle <= rest and covered[smaller]:
                clear(pair)
                continue
            if (code > 0) != (state > 0):
                if pair[CONTACT_COUNT] == 0 or now - pair[CONTACT_START] >= length:
                    pair[CONTACT_START], pair[CONTACT_COUNT], pair[ONES], pair[TWOS] = now, 0, 0, 0
                pair[CONTACT_COUNT] += 1
                pair[ONES] += code == 1
                pair[TWOS] += code == 2
                if pair[CONTACT_COUNT] >= lasting:
                    pair[STATE] = 0 if code == 0 else (1 if pair[ONES] > pair[TWOS] else 2)
                    _write_back(ring, i, j, pair[CONTACT_START], now, pair[STATE])
                    clear(pair)
                continue
            pair[CONTACT_COUNT] = 0
            if not calm:  # says nothing of the kind, neither for nor against
                continue
            if code == state:
                pair[KIND_COUNT] = 0
                continue
            if pair[KIND_COUNT] == 0 or now - pair[KIND_START] >= length:
                pair[KIND_START], pair[KIND_COUNT] = now, 0
            pair[KIND_COUNT] += 1
            if pair[KIND_COUNT] >= lasting:
                pair[STATE] = code
                _write_back(ring, i, j, pair[KIND_START], now, code)
                clear(pair)
    for i in range(len(active)):
        for j in range(i + 1, len(active)):
            if active[i] and active[j]:
                code = first_state(pairs[i, j]) if pairs[i, j, STATE] == UNDECIDED else pairs[i, j, STATE]
                ring[now % length, i, j] = code
                ring[now % length, j, i] = code


@nb.njit(cache=True, nogil=True)
def first_state(pair: Integers) -> int:
    """Most frequent relation so far; contact is decided before its kind."""
    contact = pair[ONES] + pair[TWOS]
    if contact < pair[ZEROS] or contact == 0:
        return 0
    return 1 if pair[ONES] > pair[TWOS] else 2


@nb.njit(cache=True, nogil=True)
def clear(pair: Integers) -> None:
    """Forget the candidates."""
    for k in range(1, 9):
        pair[k] = 0
