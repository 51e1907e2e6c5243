"""Compiled parts of the layered segmentation: costs of labels, and relaxation on the lattice.

Images hold *slots*, numbers up to 255 that stand for segments: 0 is unknown, 1 the background. Each kernel runs on one
thread: they take fractions of a millisecond, less than threads need to meet.
"""

import numba as nb
import numpy as np
from numpy.typing import NDArray

Slots = NDArray[np.uint8]
Lab = NDArray[np.uint8]
Float = np.float32
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
def _bin(lightness: int, a: int, b: int, scales: Measures) -> int:
    i = int((a - 128) * scales[lightness] + 20.5)
    j = int((b - 128) * scales[lightness] + 14.5)
    i = min(max(i, 0), N_CHROMA - 1)
    j = min(max(j, 0), N_CHROMA - 1)
    return ((lightness >> 5) * N_CHROMA + i) * N_CHROMA + j


@nb.njit(cache=True, nogil=True)
def colour_bins(image: Lab) -> NDArray[np.uint16]:
    """Bin of the colour histogram that each pixel falls into, (height, width) uint16."""
    height, width = image.shape[:2]
    found = np.empty((height, width), np.uint16)
    scales = np.empty(256)
    for lightness in range(256):
        scales[lightness] = _MIDDLE / (lightness + 16.0) / _CHROMA_STEP
    for y in range(height):
        for x in range(width):
            light, a, b = np.int64(image[y, x, 0]), np.int64(image[y, x, 1]), np.int64(image[y, x, 2])
            found[y, x] = _bin(light, a, b, scales)
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
    level_weights = (np.float32(0.4), np.float32(0.24), np.float32(0.06))
    values = np.empty(plane, np.float32)
    for level in range(N_LIGHTNESS):
        stretch = 2 * np.log(_MIDDLE / (level * _LIGHTNESS_STEP + 32.0))
        never = min(-np.log(_RARE) - stretch, CAP)
        values[:] = 0
        for other in range(max(0, level - 2), min(N_LIGHTNESS, level + 3)):
            weight = level_weights[abs(other - level)]
            for k in range(plane):
                values[k] += weight * smooth[other * plane + k]
        for k in range(plane):
            if values[k] == 0:  # most colours, and logarithms are slow
                costs[level * plane + k] = never
                continue
            density = np.float32(0.97) * values[k] / (total * volume) + _RARE
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
def _deviation(
    now: tuple[Float, Float, Float],
    before: tuple[Float, Float, Float],
    brightest: Float,
    noise: tuple[Float, Float, Float, Float],
    extra: Float,
) -> tuple[Float, Float, Float]:
    """Cost of a colour where another one was seen before, in the likeliest light; and the noise and shade of that."""
    static_cost, lightness_sigma, chroma_sigma, shadow_sigma = noise
    light0, a0, b0 = before[0] + np.float32(16), before[1] - np.float32(128), before[2] - np.float32(128)
    light1, a1, b1 = now[0] + np.float32(16), now[1] - np.float32(128), now[2] - np.float32(128)
    shade = (light1 * light0 + a1 * a0 + b1 * b0) / (light0 * light0 + a0 * a0 + b0 * b0)
    shade = min(max(shade, np.float32(0.62)), brightest)
    off = np.float32(1) - shade
    off = np.float32(-0.5) * off if off < 0 else off
    sigma_light = lightness_sigma + extra + shadow_sigma * off
    sigma = chroma_sigma + np.float32(0.5) * extra + shadow_sigma * off
    d0, d1, d2 = light1 - shade * light0, a1 - shade * a0, b1 - shade * b0
    squares = d0 * d0 / (sigma_light * sigma_light) + (d1 * d1 + d2 * d2) / (sigma * sigma)
    cost = static_cost + np.float32(0.5) * squares
    return cost, sigma, shade


@nb.njit(cache=True, nogil=True, inline="always")
def _with_shade(cost: Float, sigma: Float, shade: Float, chroma_sigma: Float, shadow_cost: Float) -> Float:
    """A cost and what the noise and the shade add to it (see LayerParameters)."""
    if sigma > np.float32(1.02) * chroma_sigma:  # most pixels are in no shadow, and logarithms are slow
        cost += np.float32(2) * np.log(sigma / chroma_sigma)
    if shade < np.float32(0.98):
        cost += shadow_cost * (np.float32(0.98) - shade)
    elif shade > np.float32(1.03):
        cost += shadow_cost * (shade - np.float32(1.03))
    return cost


@nb.njit(cache=True, nogil=True, error_model="numpy")
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

    Candidates: what rests here; the background that comes to light; each moving segment; something unknown. A row goes
    through one short loop after the other, which the compiler turns into vector instructions where it can.
    """
    height, width = rest.shape
    n = moving.size
    noise = (p[0], p[2], p[3], p[4])
    now, before = np.empty((3, width), np.float32), np.empty((3, width), np.float32)
    sigmas, shades = np.empty(width, np.float32), np.empty(width, np.float32)
    place_costs = np.zeros(4, np.float32)
    for y in range(height):
        for x in range(width):
            for c in range(3):
                now[c, x], before[c, x] = image[y, x, c], seen[y, x, c]
        row = costs[0, y]
        for x in range(width):
            row[x], sigmas[x], shades[x] = _deviation(
                (now[0, x], now[1, x], now[2, x]),
                (before[0, x], before[1, x], before[2, x]),
                brightest[y, x],
                noise,
                np.float32(0),
            )
        for x in range(width):
            cost = _with_shade(row[x], sigmas[x], shades[x], p[3], p[5])
            if predicted[y, x] != rest[y, x]:
                cost += p[6]
            row[x] = min(cost, CAP)
        row = costs[1, y]
        for x in range(width):
            row[x] = CAP
            if rest[y, x] == BACKGROUND:
                continue
            cost, sigma, shade = _deviation(
                (now[0, x], now[1, x], now[2, x]),
                (behind[y, x, 0], behind[y, x, 1], behind[y, x, 2]),
                np.float32(1.05),
                noise,
                behind_sigma[y, x],
            )
            cost = p[7] + _with_shade(cost, sigma, shade, p[3], p[5])
            if predicted[y, x] != BACKGROUND:
                cost += np.float32(1.5)
            row[x] = min(cost, CAP)
        for k in range(n):
            row, table, slot = costs[2 + k, y], tables[moving[k]], moving[k]
            # Far from where it is expected, near there, and there.
            place_costs[0], place_costs[1], place_costs[2] = far[k], 2, 0 if extra[k] else -1
            for x in range(width):
                place = (near[y, x] >> np.uint32(2 * k)) & np.uint32(3)
                row[x] = CAP
                if place == 0 and place_costs[0] >= CAP:
                    continue
                cost = table[bins[y, x]] + extra[k] + place_costs[place]
                if rest[y, x] == slot:  # nothing if it is on the way
                    cost += extra[k]
                row[x] = min(cost, CAP)
        costs[2 + n, y] = p[1]


@nb.njit(cache=True, nogil=True)
def cheapest(costs: Floats, rest: Slots, moving: NDArray[np.uint8], slots: Slots, sure: NDArray[np.uint8]) -> None:
    """Cheapest candidate of every pixel, and whether it is cheaper by more than 1 than any other segment."""
    n_costs, height, width = costs.shape
    second, at = np.empty(width, np.float32), np.empty(width, np.uint8)
    best = np.empty(width, np.float32)
    for y in range(height):
        best[:], second[:], at[:] = costs[0, y], np.float32(1e9), 0
        for k in range(1, n_costs):
            row = costs[k, y]
            for x in range(width):
                cost = row[x]
                is_best = cost < best[x]
                second[x] = best[x] if is_best else min(cost, second[x])
                at[x] = k if is_best else at[x]
                best[x] = cost if is_best else best[x]
        for x in range(width):
            slots[y, x] = _slot(at[x], rest[y, x], moving)
            sure[y, x] = second[x] - best[x] > np.float32(1)


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


@nb.njit(cache=True, nogil=True, error_model="numpy")
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
    mixed = np.ones(width, np.uint8)
    for y in range(height):
        relaxed[y] = slots[y]
        if not awake[y].any():
            continue
        if 0 < y < height - 1:  # all of a row at once, in vector instructions
            above, row, below = slots[y - 1], slots[y], slots[y + 1]
            for x in range(1, width - 1):
                own = row[x]
                beside = (row[x - 1] ^ own) | (row[x + 1] ^ own)
                over = (above[x - 1] ^ own) | (above[x] ^ own) | (above[x + 1] ^ own)
                mixed[x] = beside | over | (below[x - 1] ^ own) | (below[x] ^ own) | (below[x + 1] ^ own)
        else:
            mixed[:] = 1
        for x in range(width):
            if not awake[y, x] or not mixed[x]:
                continue
            own = slots[y, x]
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
        changed = False
        for x in range(width):
            changed |= relaxed[y, x] != slots[y, x]
        if not changed:
            continue
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
