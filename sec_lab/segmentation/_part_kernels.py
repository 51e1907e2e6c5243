"""Compiled parts of the layered segmentation: connected parts of a picture, and what is remembered of each pixel.

Images hold slots, see :mod:`sec_lab.segmentation._layer_kernels`.
"""

import numba as nb
import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation._layer_kernels import BACKGROUND, UNKNOWN, Floats, Integers, Lab, Measures, Slots


@nb.njit(cache=True, nogil=True)
def components(slots: Slots, parts: NDArray[np.int32]) -> int:
    """Connected parts (8 neighbours) of equal slots, numbered from 0 in the order of their first pixels."""
    height, width = slots.shape
    parent = np.empty(height * width // 2 + 2, np.int32)
    n = 0
    for y in range(height):
        for x in range(width):
            slot = slots[y, x]
            # All other neighbours seen so far are neighbours of the one above.
            if y > 0 and slots[y - 1, x] == slot:
                parts[y, x] = parts[y - 1, x]
                continue
            root = -1
            if x > 0 and slots[y, x - 1] == slot:
                root = _root(parent, parts[y, x - 1])
            elif x > 0 and y > 0 and slots[y - 1, x - 1] == slot:
                root = _root(parent, parts[y - 1, x - 1])
            if y > 0 and x < width - 1 and slots[y - 1, x + 1] == slot:
                other = _root(parent, parts[y - 1, x + 1])
                if root < 0:
                    root = other
                elif other != root:
                    if other < root:
                        root, other = other, root
                    parent[other] = root
            if root < 0:
                if n == parent.size:
                    longer = np.empty(2 * n, np.int32)
                    longer[:n] = parent
                    parent = longer
                parent[n] = n
                root = n
                n += 1
            parts[y, x] = root
    number = np.full(n, -1, np.int32)
    count = 0
    for k in range(n):
        root = _root(parent, k)
        if number[root] < 0:
            number[root] = count
            count += 1
        number[k] = number[root]
    for y in range(height):
        for x in range(width):
            parts[y, x] = number[parts[y, x]]
    return count


@nb.njit(cache=True, nogil=True, inline="always")
def _root(parent: NDArray[np.int32], k: int) -> int:
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@nb.njit(cache=True, nogil=True)
def describe(
    parts: NDArray[np.int32], n: int, slots: Slots, unknown_for: NDArray[np.uint8], resting_for: NDArray[np.uint8]
) -> tuple[Integers, Integers, Integers, Measures, Measures, Measures]:
    """Slot, area, box (top, left, bottom, right), mean time unknown, mean time at rest, share of inner pixels of parts.

    An inner pixel has its own part two steps away on all four sides.
    """
    height, width = parts.shape
    slot, area = np.zeros(n, np.int64), np.zeros(n, np.int64)
    box = np.zeros((n, 4), np.int64)
    box[:, :2] = max(height, width)
    unknown, resting, inner = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64)
    for y in range(height):
        above, row, below = parts[max(y - 2, 0)], parts[y], parts[min(y + 2, height - 1)]
        begin = 0
        while begin < width:
            k, end = row[begin], begin + 1
            while end < width and row[end] == k:
                end += 1
            slot[k] = slots[y, begin]
            area[k] += end - begin
            box[k, 0] = min(box[k, 0], y)
            box[k, 1] = min(box[k, 1], begin)
            box[k, 2] = max(box[k, 2], y)
            box[k, 3] = max(box[k, 3], end - 1)
            n_unknown, n_resting, n_inner = 0, 0, 0
            for x in range(begin, end):
                n_unknown += unknown_for[y, x]
                n_resting += resting_for[y, x]
                n_inner += (
                    (above[x] == k) & (below[x] == k) & (row[max(x - 2, 0)] == k) & (row[min(x + 2, width - 1)] == k)
                )
            unknown[k] += n_unknown
            resting[k] += n_resting
            inner[k] += n_inner
            begin = end
    return slot, area, box, unknown / area, resting / area, inner / area


@nb.njit(cache=True, nogil=True)
def surroundings(
    parts: NDArray[np.int32],
    question: NDArray[np.int32],
    n: int,
    slots: Slots,
    predicted: Slots,
    rest: Slots,
    bins: NDArray[np.uint16],
    known: NDArray[np.bool_],
    tables: Floats,
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Of every part in question, over all slots: share around, predicted, at rest below; mean cost; share that fits.

    Parameters
    ----------
    question : (n_parts,) int32
        Number of the question, -1 for parts that are none.
    known : (256,) bool
        Slots whose colours are known.
    """
    height, width = parts.shape
    around, guess, below = (
        np.zeros((n, 256), np.float32),
        np.zeros((n, 256), np.float32),
        np.zeros((n, 256), np.float32),
    )
    colour, fits = np.zeros((n, 256), np.float32), np.zeros((n, 256), np.float32)
    which = np.flatnonzero(known)
    for y in range(height):
        for x in range(width):
            k = question[parts[y, x]]
            if k >= 0:
                guess[k, predicted[y, x]] += 1
                below[k, rest[y, x]] += 1
                for slot in which:
                    cost = tables[slot, bins[y, x]]
                    colour[k, slot] += cost
                    if cost < np.float32(9):
                        fits[k, slot] += 1
            # Two steps away: pixels at a rim are mixed.
            for dy, dx in ((0, 2), (2, 0)):
                y2, x2 = y + dy, x + dx
                if y2 < height and x2 < width and parts[y, x] != parts[y2, x2]:
                    k2 = question[parts[y2, x2]]
                    if k >= 0:
                        around[k, slots[y2, x2]] += 1
                    if k2 >= 0:
                        around[k2, slots[y, x]] += 1
    for k in range(n):
        area = max(guess[k].sum(), np.float32(1))
        rim = max(around[k].sum(), np.float32(1))
        around[k] /= rim
        guess[k] /= area
        below[k] /= area
        colour[k] /= area
        fits[k] /= area
    return around, guess, below, colour, fits


@nb.njit(cache=True, nogil=True)
def recolour(parts: NDArray[np.int32], new: NDArray[np.int64], slots: Slots, taught: NDArray[np.uint8]) -> None:
    """Give parts another slot; below 0: as it is; 256 and more: minus 256, but its colours are not learned."""
    height, width = parts.shape
    for y in range(height):
        for x in range(width):
            slot = new[parts[y, x]]
            if slot >= 256:
                taught[y, x] = 0
                slots[y, x] = np.uint8(slot - 256)
            elif slot >= 0:
                slots[y, x] = np.uint8(slot)


@nb.njit(cache=True, nogil=True)
def share_out(slots: Slots, taught: NDArray[np.uint8], bins: NDArray[np.uint16], tables: Floats) -> None:
    """Share out what is unknown, ring after ring from its rim inwards; what is given so is not taught.

    A pixel goes to the slot that most of its 8 neighbours have; of several, to that under which its colour costs least;
    then to the first of them. A picture of nothing else becomes background. Meant for thin parts: every ring passes
    over all that is left.

    Parameters
    ----------
    slots, taught : (height, width) uint8
        Changed in place.
    bins : (height, width) uint16
    tables : (256, N_BINS) float32
    """
    height, width = slots.shape
    rows, columns = np.nonzero(slots == UNKNOWN)
    given = np.empty(rows.size, np.uint8)
    count = np.zeros(256, np.int64)
    left = rows.size
    while left > 0:
        for i in range(left):
            y, x = rows[i], columns[i]
            best, most, least = UNKNOWN, 0, np.float32(0)
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    count[slots[v, u]] += 1
            count[UNKNOWN] = 0
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    slot = slots[v, u]
                    cost = tables[slot, bins[y, x]]
                    if count[slot] > most or (count[slot] == most > 0 and cost < least):
                        best, most, least = slot, count[slot], cost
                    count[slot] = 0
            given[i] = best
        still = 0
        for i in range(left):
            y, x = rows[i], columns[i]
            if given[i] == UNKNOWN:
                rows[still], columns[still] = y, x
                still += 1
            else:
                slots[y, x] = given[i]
                taught[y, x] = 0
        if still == left:
            slots[:] = BACKGROUND
            taught[:] = 0
            return
        left = still


@nb.njit(cache=True, nogil=True, error_model="numpy")
def settle(
    image: Lab,
    before: Lab,
    found: Slots,
    slots: Slots,
    slots_before: Slots,
    mover: NDArray[np.bool_],
    any_mover: np.bool_,
    settle_frames: int,
    moved_by: int,
    unknown_for: NDArray[np.uint8],
    resting_for: NDArray[np.uint8],
    rest: Slots,
    seen: Floats,
    behind: Floats,
    behind_sigma: Floats,
    brightest: Floats,
) -> None:
    """Count how long pixels have been at rest, and let what rests long enough become part of the static scene."""
    height, width = slots.shape
    for y in range(height):
        for x in range(width):
            moved = abs(np.int64(image[y, x, 0]) - np.int64(before[y, x, 0])) > moved_by
            unknown_for[y, x] = min(unknown_for[y, x] + 1, 250) if found[y, x] == UNKNOWN and not moved else 0
            slot = slots[y, x]
            resting_for[y, x] = min(resting_for[y, x] + 1, 250) if slot == slots_before[y, x] and not moved else 0
            if mover[slot] or slot == UNKNOWN or resting_for[y, x] < settle_frames:
                continue
            if rest[y, x] != slot:
                rest[y, x] = slot
                for c in range(3):
                    seen[y, x, c] = image[y, x, c]
                # What settles while a hand is about may lie in its shadow.
                brightest[y, x] = np.float32(1.45) if any_mover else np.float32(1.05)
            else:
                ratio = (np.float32(image[y, x, 0]) + np.float32(16)) / (seen[y, x, 0] + np.float32(16))
                rate = np.float32(0)
                if ratio > np.float32(1.05):
                    rate = np.float32(0.2)
                elif ratio > np.float32(0.95):
                    rate = np.float32(0.1)
                for c in range(3):
                    seen[y, x, c] += rate * (np.float32(image[y, x, c]) - seen[y, x, c])
            if slot == BACKGROUND:
                for c in range(3):
                    behind[y, x, c] = seen[y, x, c]
                behind_sigma[y, x] = 0


@nb.njit(cache=True, nogil=True)
def presence(
    found: Slots, slots: Slots, rest: Slots, mover: NDArray[np.bool_], boxes: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Pixels of every slot, (256, 5), and whether a mover is within two pixels of it; updates boxes of what is visible.

    Columns: at rest, of these recognised, of these covered by a mover; visible, visible elsewhere.
    """
    counts = np.zeros((256, 5), np.int64)
    touched = np.zeros(256, np.bool_)
    height, width = slots.shape
    fresh = np.empty((256, 4), np.int64)
    fresh[:, :2] = max(height, width)
    fresh[:, 2:] = -1
    for y in range(height):
        for x in range(width):
            resting, slot = rest[y, x], slots[y, x]
            counts[resting, 0] += 1
            if found[y, x] == resting:
                counts[resting, 1] += 1
            elif mover[slot]:
                counts[resting, 2] += 1
            counts[slot, 3] += 1
            if slot != resting:
                counts[slot, 4] += 1
            if slot > BACKGROUND:
                fresh[slot, 0] = min(fresh[slot, 0], y)
                fresh[slot, 1] = min(fresh[slot, 1], x)
                fresh[slot, 2] = max(fresh[slot, 2], y)
                fresh[slot, 3] = max(fresh[slot, 3], x)
            if y > 1:
                other = slots[y - 2, x]
                if mover[other]:
                    touched[slot] = True
                if mover[slot]:
                    touched[other] = True
            if x > 1:
                other = slots[y, x - 2]
                if mover[other]:
                    touched[slot] = True
                if mover[slot]:
                    touched[other] = True
    for slot in range(2, 256):
        if counts[slot, 3] > 0:
            boxes[slot] = fresh[slot]
    return counts, touched


@nb.njit(cache=True, nogil=True)
def uncovered(
    image: Lab,
    before: Lab,
    moved_by: int,
    slots: Slots,
    rest: Slots,
    carried: NDArray[np.bool_],
    static_cost: Floats,
    strange_cost: float,
    resting_for: NDArray[np.uint8],
    wait_frames: int,
    still: NDArray[np.uint8],
) -> int:
    """Pixels of carried segments where these rested, that look otherwise than at rest: something below comes to light.

    ``still`` (height, width) becomes for how long they have been still, in frames up to ``wait_frames``; 0 elsewhere,
    and where something moves in this very frame, of which ``resting_for`` does not know yet. The number of those that
    have been for as long as that is returned.
    """
    height, width = slots.shape
    n = 0
    for y in range(height):
        for x in range(width):
            slot = slots[y, x]
            still[y, x] = 0
            if carried[slot] and rest[y, x] == slot and static_cost[y, x] > strange_cost:
                if abs(np.int64(image[y, x, 0]) - np.int64(before[y, x, 0])) > moved_by:
                    continue
                still[y, x] = min(resting_for[y, x], wait_frames)
                n += resting_for[y, x] >= wait_frames
    return n


@nb.njit(cache=True, nogil=True)
def close_rims(
    slots: Slots,
    rest: Slots,
    costs: Floats,
    moving: NDArray[np.bool_],
    bound: np.float32,
    reach: int,
    taught: NDArray[np.uint8],
) -> None:
    """Give mixed pixels between two segments, one of them moving, to the nearer one.

    They are those labelled as background, for which they look too strange, with the two on opposite sides.
    """
    height, width = slots.shape
    given = np.zeros((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            if slots[y, x] != BACKGROUND or costs[0 if rest[y, x] == BACKGROUND else 1, y, x] < bound:
                continue
            nearest = reach + 1
            for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
                one, far = _first(slots, y, x, dy, dx, reach)
                other, away = _first(slots, y, x, -dy, -dx, reach)
                if one in (BACKGROUND, other) or other == BACKGROUND or not (moving[one] or moving[other]):
                    continue
                if min(far, away) < nearest:
                    nearest = min(far, away)
                    given[y, x] = one if far <= away else other
    for y in range(height):
        for x in range(width):
            if given[y, x]:
                slots[y, x] = given[y, x]
                taught[y, x] = 0


@nb.njit(cache=True, nogil=True, inline="always")
def _first(slots: Slots, y: int, x: int, dy: int, dx: int, reach: int) -> tuple[int, int]:
    """The first segment in a direction that is not the background, and its distance; the background if none is near."""
    height, width = slots.shape
    for k in range(1, reach + 1):
        v, u = y + k * dy, x + k * dx
        if v < 0 or u < 0 or v >= height or u >= width:
            break
        if slots[v, u] > BACKGROUND:
            return int(slots[v, u]), k
    return BACKGROUND, reach + 1
