"""Compiled parts of the layered segmentation: costs of labels, and relaxation on the lattice.

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
# Density of colours that were never seen.
_RARE = np.float32(1.2e-8)
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
    # Colours of one thing in another light lie farther apart than noise moves them, along a and b most.
    wide = _spread(_spread(tempered))
    for i in range(N_BINS):
        smooth[i] = np.float32(0.85) * smooth[i] + np.float32(0.15) * wide[i]
    volume = np.float32(_LIGHTNESS_STEP * _CHROMA_STEP * _CHROMA_STEP)
    for level in range(N_LIGHTNESS):
        stretch = 2 * np.log(_MIDDLE / (level * _LIGHTNESS_STEP + 32.0))
        never = min(-np.log(_RARE) - stretch, CAP)
        for k in range(plane):
            value = np.float32(0)
            for other in range(max(0, level - 2), min(N_LIGHTNESS, level + 3)):
                gap = abs(other - level)
                weight = np.float32(0.4) if gap == 0 else (np.float32(0.24) if gap == 1 else np.float32(0.06))
                value += weight * smooth[other * plane + k]
            if value == 0:  # most colours, and logarithms are slow
                costs[level * plane + k] = never
                continue
            density = np.float32(0.97) * value / (total * volume) + _RARE
            costs[level * plane + k] = min(-np.log(density) - stretch, CAP)


@nb.njit(cache=True, nogil=True)
def _spread(counts: Floats) -> Floats:
    """Every count spread evenly over 5×5 bins of chroma; at the rim it stays inside."""
    plane = N_CHROMA * N_CHROMA
    rows, both = np.zeros(N_BINS, np.float32), np.zeros(N_BINS, np.float32)
    for at in range(N_BINS):
        if counts[at] != 0:
            j = at % N_CHROMA
            value = counts[at] / np.float32(5)
            for step in range(-2, 3):
                rows[at - j + min(max(j + step, 0), N_CHROMA - 1)] += value
    for at in range(N_BINS):
        if rows[at] != 0:
            level, i, j = at // plane, at % plane // N_CHROMA, at % N_CHROMA
            value = rows[at] / np.float32(5)
            for step in range(-2, 3):
                both[level * plane + min(max(i + step, 0), N_CHROMA - 1) * N_CHROMA + j] += value
    return both


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
    if sigma > np.float32(1.02) * p[3]:  # most pixels are in no shadow, and logarithms are slow
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
                if place == 0 and far[k] >= CAP:
                    costs[2 + k, y, x] = CAP
                    continue
                cost = tables[moving[k], colour] + extra[k]
                if place == 0:
                    cost += far[k]
                elif place == 1:
                    cost += np.float32(2.0)
                elif extra[k] == 0:
                    cost -= np.float32(1.0)
                if rest[y, x] == moving[k]:  # nothing if it is on the way
                    cost += extra[k]
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
    costs: Floats,
    image: Lab,
    rest: Slots,
    moving: NDArray[np.uint8],
    slots: Slots,
    relaxed: Slots,
    bond: float,
    awake: NDArray[np.bool_],
) -> None:
    """One sweep at temperature zero over the lattice of 8 neighbours: spins with a field (costs) and bonds (colour).

    Only pixels that are ``awake``, (height, width) bool, may change. Afterwards those are awake that have changed or
    have a neighbour that has: the next sweep can change no other.
    """
    height, width = slots.shape
    weights = np.empty(8, np.float32)
    around = np.empty(8, np.uint8)
    for y in range(height):
        for x in range(width):
            own = slots[y, x]
            relaxed[y, x] = own
            if not awake[y, x]:
                continue
            if (
                0 < y < height - 1
                and 0 < x < width - 1
                and slots[y, x - 1] == own
                and slots[y, x + 1] == own
                and slots[y - 1, x] == own
                and slots[y + 1, x] == own
                and slots[y - 1, x - 1] == own
                and slots[y - 1, x + 1] == own
                and slots[y + 1, x - 1] == own
                and slots[y + 1, x + 1] == own
            ):
                continue
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
    awake[:] = False
    for y in range(height):
        for x in range(width):
            if relaxed[y, x] != slots[y, x]:
                awake[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = True


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
