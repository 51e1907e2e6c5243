"""Compiled parts of the layered segmentation: costs of labels, relaxation on the lattice, components, bookkeeping.

Images hold *slots*, numbers up to 255 that stand for segments: 0 is unknown, 1 the background. Each kernel runs on one
thread: they take fractions of a millisecond, less than threads need to meet.
"""

import numba as nb
import numpy as np
from numpy.typing import NDArray

Slots = NDArray[np.uint8]
Lab = NDArray[np.uint8]
Floats = NDArray[np.float32]
Integers = NDArray[np.int64]
Measures = NDArray[np.float64]

UNKNOWN, BACKGROUND = 0, 1

N_LIGHTNESS, N_CHROMA = 8, 40
N_BINS = N_LIGHTNESS * N_CHROMA * N_CHROMA
_LIGHTNESS_STEP = 32.0
_CHROMA_STEP = 4.0
# Chroma is compared as it would be at this lightness: shading scales all three.
_MIDDLE = 150.0
CAP = np.float32(16.0)
"""Largest cost: no colour is less likely under a label than under uniform noise."""


@nb.njit(cache=True, nogil=True, inline="always")
def _bin(lightness: int, a: int, b: int) -> int:
    scale = _MIDDLE / (lightness + 16.0) / _CHROMA_STEP
    i = int((a - 128) * scale + 20.5)
    j = int((b - 128) * scale + 14.5)
    i = min(max(i, 0), N_CHROMA - 1)
    j = min(max(j, 0), N_CHROMA - 1)
    return ((lightness >> 5) * N_CHROMA + i) * N_CHROMA + j


@nb.njit(cache=True, nogil=True)
def colour_bins(image: Lab) -> NDArray[np.uint16]:
    """Bin of the colour histogram that each pixel falls into, (height, width) uint16."""
    height, width = image.shape[:2]
    found = np.empty((height, width), np.uint16)
    for y in range(height):
        for x in range(width):
            found[y, x] = _bin(np.int64(image[y, x, 0]), np.int64(image[y, x, 1]), np.int64(image[y, x, 2]))
    return found


@nb.njit(cache=True, nogil=True)
def count_colours(
    bins: NDArray[np.uint16], slots: Slots, taught: NDArray[np.uint8], wanted: NDArray[np.bool_], counts: Floats
) -> None:
    """Add the pixels of the wanted slots to their histograms, ``counts`` (256, N_BINS)."""
    height, width = slots.shape
    for y in range(height):
        for x in range(width):
            slot = slots[y, x]
            if wanted[slot] and taught[y, x]:
                counts[slot, bins[y, x]] += np.float32(1)


@nb.njit(cache=True, nogil=True)
def colour_costs(counts: Floats, costs: Floats) -> None:
    """Minus log density of colours under one histogram, (N_BINS,), smoothed over neighbouring bins.

    Counts are tempered, so that a small part of another colour (the rim of a plate) still belongs to the segment.
    """
    tempered = np.empty(N_BINS, np.float32)
    total = np.float32(0)
    for i in range(N_BINS):
        tempered[i] = counts[i] ** np.float32(0.6) if counts[i] > 0 else np.float32(0)
        total += tempered[i]
    if total <= 0:
        costs[:] = CAP
        return
    plane = N_CHROMA * N_CHROMA
    smooth = np.zeros(N_BINS, np.float32)
    for level in range(N_LIGHTNESS):
        for i in range(N_CHROMA):
            for j in range(N_CHROMA):
                at = level * plane + i * N_CHROMA + j
                if tempered[at] == 0:
                    continue
                value = tempered[at]
                smooth[at] += np.float32(0.52) * value
                if i > 0:
                    smooth[at - N_CHROMA] += np.float32(0.12) * value
                if i < N_CHROMA - 1:
                    smooth[at + N_CHROMA] += np.float32(0.12) * value
                if j > 0:
                    smooth[at - 1] += np.float32(0.12) * value
                if j < N_CHROMA - 1:
                    smooth[at + 1] += np.float32(0.12) * value
    volume = np.float32(_LIGHTNESS_STEP * _CHROMA_STEP * _CHROMA_STEP)
    for level in range(N_LIGHTNESS):
        stretch = 2 * np.log(_MIDDLE / (level * _LIGHTNESS_STEP + 32.0))
        for k in range(plane):
            value = np.float32(0)
            for other in range(max(0, level - 2), min(N_LIGHTNESS, level + 3)):
                gap = abs(other - level)
                weight = np.float32(0.4) if gap == 0 else (np.float32(0.24) if gap == 1 else np.float32(0.06))
                value += weight * smooth[other * plane + k]
            density = np.float32(0.97) * value / (total * volume) + np.float32(1.2e-8)
            costs[level * plane + k] = min(-np.log(density) - stretch, CAP)


@nb.njit(cache=True, nogil=True, inline="always")
def _difference(
    light: float, a: float, b: float, base: Floats, y: int, x: int, brightest: float, p: Floats, extra: float
) -> float:
    """Cost of a colour where another one was seen before, with a shadow on it or without (see LayerParameters)."""
    light0, a0, b0 = base[y, x, 0] + np.float32(16), base[y, x, 1] - np.float32(128), base[y, x, 2] - np.float32(128)
    light1, a1, b1 = light + np.float32(16), a - np.float32(128), b - np.float32(128)
    shade = (light1 * light0 + a1 * a0 + b1 * b0) / (light0 * light0 + a0 * a0 + b0 * b0)
    shade = min(max(shade, np.float32(0.62)), brightest)
    off = np.float32(1) - shade
    if off < 0:
        off = np.float32(-0.5) * off
    sigma_light = p[2] + extra + p[4] * off
    sigma = p[3] + np.float32(0.5) * extra + p[4] * off
    d0, d1, d2 = light1 - shade * light0, a1 - shade * a0, b1 - shade * b0
    cost = p[0] + np.float32(0.5) * (d0 * d0 / (sigma_light * sigma_light) + (d1 * d1 + d2 * d2) / (sigma * sigma))
    cost += np.float32(2) * np.log(sigma / p[3])
    if shade < np.float32(0.98):
        cost += p[5] * (np.float32(0.98) - shade)
    elif shade > np.float32(1.03):
        cost += p[5] * (shade - np.float32(1.03))
    return cost


@nb.njit(cache=True, nogil=True)
def label_costs(
    image: Lab,
    bins: NDArray[np.uint16],
    rest: Slots,
    seen: Floats,
    behind: Floats,
    behind_sigma: Floats,
    brightest: Floats,
    predicted: Slots,
    near: NDArray[np.uint32],
    moving: NDArray[np.uint8],
    far: Floats,
    extra: Floats,
    tables: Floats,
    p: Floats,
    costs: Floats,
) -> None:
    """Cost of every candidate at every pixel, ``costs`` (3 + n_moving, height, width).

    Candidates: what rests here; the background that comes to light; each moving segment; something unknown.
    """
    height, width = rest.shape
    n = moving.size
    for y in range(height):
        for x in range(width):
            light, a, b = np.float32(image[y, x, 0]), np.float32(image[y, x, 1]), np.float32(image[y, x, 2])
            cost = _difference(light, a, b, seen, y, x, brightest[y, x], p, np.float32(0))
            if predicted[y, x] != rest[y, x]:
                cost += p[6]
            costs[0, y, x] = min(cost, CAP)
            if rest[y, x] == BACKGROUND:
                costs[1, y, x] = CAP
            else:
                cost = p[7] + _difference(light, a, b, behind, y, x, np.float32(1.05), p, behind_sigma[y, x])
                if predicted[y, x] != BACKGROUND:
                    cost += np.float32(1.5)
                costs[1, y, x] = min(cost, CAP)
            colour = bins[y, x]
            for k in range(n):
                place = (near[y, x] >> np.uint32(2 * k)) & np.uint32(3)
                cost = tables[moving[k], colour] + extra[k]
                if place == 0:
                    cost += far[k]
                elif place == 1:
                    cost += np.float32(2.0)
                elif extra[k] == 0:
                    cost -= np.float32(1.0)
                costs[2 + k, y, x] = min(cost, CAP)
            costs[2 + n, y, x] = p[1]


@nb.njit(cache=True, nogil=True)
def cheapest(costs: Floats, rest: Slots, moving: NDArray[np.uint8], slots: Slots, sure: NDArray[np.uint8]) -> None:
    """Cheapest candidate of every pixel, and whether it is cheaper by more than 1 than any other segment."""
    n_costs, height, width = costs.shape
    for y in range(height):
        for x in range(width):
            best, second, at = costs[0, y, x], np.float32(1e9), 0
            for k in range(1, n_costs):
                cost = costs[k, y, x]
                if cost < best:
                    second, best, at = best, cost, k
                elif cost < second:
                    second = cost
            slots[y, x] = _slot(at, rest[y, x], moving)
            sure[y, x] = second - best > np.float32(1)


@nb.njit(cache=True, nogil=True, inline="always")
def _slot(at: int, rest: int, moving: NDArray[np.uint8]) -> np.uint8:
    if at == 0:
        return np.uint8(rest)
    if at == 1:
        return np.uint8(BACKGROUND)
    if at < 2 + moving.size:
        return moving[at - 2]
    return np.uint8(UNKNOWN)


@nb.njit(cache=True, nogil=True, inline="always")
def _cost_of(slot: int, costs: Floats, rest: int, moving: NDArray[np.uint8], y: int, x: int) -> np.float32:
    if slot == UNKNOWN:
        return costs[2 + moving.size, y, x]
    cost = CAP
    if slot == rest:
        cost = costs[0, y, x]
    if slot == BACKGROUND:
        cost = min(cost, costs[1, y, x])
    for k in range(moving.size):
        if moving[k] == slot:
            cost = min(cost, costs[2 + k, y, x])
    return cost


@nb.njit(cache=True, nogil=True)
def relax(
    costs: Floats, image: Lab, rest: Slots, moving: NDArray[np.uint8], slots: Slots, relaxed: Slots, bond: float
) -> None:
    """One sweep at temperature zero over the lattice of 8 neighbours: spins with a field (costs) and bonds (colour)."""
    height, width = slots.shape
    for y in range(height):
        weights = np.empty(8, np.float32)
        around = np.empty(8, np.uint8)
        for x in range(width):
            own = slots[y, x]
            relaxed[y, x] = own
            n, alike = 0, True
            for dy in range(-1, 2):
                for dx in range(-1, 2):
                    y2, x2 = y + dy, x + dx
                    if (dy == 0 and dx == 0) or y2 < 0 or x2 < 0 or y2 >= height or x2 >= width:
                        continue
                    around[n] = slots[y2, x2]
                    if around[n] != own:
                        alike = False
                    n += 1
            if alike:
                continue
            n = 0
            for dy in range(-1, 2):
                for dx in range(-1, 2):
                    y2, x2 = y + dy, x + dx
                    if (dy == 0 and dx == 0) or y2 < 0 or x2 < 0 or y2 >= height or x2 >= width:
                        continue
                    d0 = np.float32(image[y, x, 0]) - np.float32(image[y2, x2, 0])
                    d1 = np.float32(image[y, x, 1]) - np.float32(image[y2, x2, 1])
                    d2 = np.float32(image[y, x, 2]) - np.float32(image[y2, x2, 2])
                    far = (np.float32(0.5) * d0 * d0 + d1 * d1 + d2 * d2) / np.float32(60)
                    weights[n] = bond * (np.float32(0.15) + np.float32(0.85) / (np.float32(1) + far))
                    n += 1
            best = np.float32(1e9)
            for k in range(-1, n):
                candidate = own if k < 0 else around[k]
                known = False
                for j in range(-1, k):
                    if (own if j < 0 else around[j]) == candidate:
                        known = True
                        break
                if known:
                    continue
                cost = _cost_of(candidate, costs, rest[y, x], moving, y, x)
                for j in range(n):
                    if around[j] != candidate:
                        cost += weights[j]
                if cost < best - np.float32(1e-4):
                    best = cost
                    relaxed[y, x] = candidate


@nb.njit(cache=True, nogil=True)
def warp(slots: Slots, flow: Floats) -> Slots:
    """Slots of the frame before, carried along a ``flow`` (height / 2, width / 2, 2) that looks back."""
    height, width = slots.shape
    half_height, half_width = flow.shape[:2]
    warped = np.empty((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            fy, fx = min(y // 2, half_height - 1), min(x // 2, half_width - 1)
            y2 = y + int(np.rint(2 * flow[fy, fx, 1]))
            x2 = x + int(np.rint(2 * flow[fy, fx, 0]))
            warped[y, x] = slots[min(max(y2, 0), height - 1), min(max(x2, 0), width - 1)]
    return warped


@nb.njit(cache=True, nogil=True)
def components(slots: Slots, parts: NDArray[np.int32]) -> int:
    """Connected parts (8 neighbours) of equal slots, numbered from 0 in the order of their first pixels."""
    height, width = slots.shape
    parent = np.empty(height * width // 2 + 2, np.int32)
    n = 0
    for y in range(height):
        for x in range(width):
            slot = slots[y, x]
            root = -1
            if x > 0 and slots[y, x - 1] == slot:
                root = _root(parent, parts[y, x - 1])
            if y > 0:
                for x2 in range(max(0, x - 1), min(width, x + 2)):
                    if slots[y - 1, x2] == slot:
                        other = _root(parent, parts[y - 1, x2])
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
    unknown, resting, inner = np.zeros(n, np.float32), np.zeros(n, np.float32), np.zeros(n, np.float32)
    for y in range(height):
        for x in range(width):
            k = parts[y, x]
            slot[k] = slots[y, x]
            area[k] += 1
            box[k, 0] = min(box[k, 0], y)
            box[k, 1] = min(box[k, 1], x)
            box[k, 2] = max(box[k, 2], y)
            box[k, 3] = max(box[k, 3], x)
            unknown[k] += unknown_for[y, x]
            resting[k] += resting_for[y, x]
            if (
                parts[max(y - 2, 0), x] == k
                and parts[min(y + 2, height - 1), x] == k
                and parts[y, max(x - 2, 0)] == k
                and parts[y, min(x + 2, width - 1)] == k
            ):
                inner[k] += 1
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
) -> tuple[Floats, Floats, Floats, Floats]:
    """Of every part in question, over all slots: share around it, share predicted, share at rest below, mean cost.

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
    colour = np.zeros((n, 256), np.float32)
    which = np.flatnonzero(known)
    for y in range(height):
        for x in range(width):
            k = question[parts[y, x]]
            if k >= 0:
                guess[k, predicted[y, x]] += 1
                below[k, rest[y, x]] += 1
                for slot in which:
                    colour[k, slot] += tables[slot, bins[y, x]]
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
    return around, guess, below, colour


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
