"""Slow twins of the kernels of the layered segmentation: pixel after pixel, or scipy, in the same arithmetic."""

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Image = NDArray[np.uint8]
CAP = np.float32(16)

NEIGHBOURS = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dy, dx) != (0, 0)]


def naive_colour_bins(lab: Image) -> NDArray[np.int64]:
    """8 steps of lightness times 40 × 40 of chroma as it were at lightness 150, each 4 wide."""
    bins = np.empty(lab.shape[:2], np.int64)
    for y, x in np.ndindex(*bins.shape):
        lightness, a, b = (int(value) for value in lab[y, x])
        scale = 150 / (lightness + 16) / 4
        i = min(max(int((a - 128) * scale + 20.5), 0), 39)
        j = min(max(int((b - 128) * scale + 14.5), 0), 39)
        bins[y, x] = (lightness // 32) * 1600 + i * 40 + j
    return bins


def naive_counts(
    bins: NDArray[np.integer], slots: Image, taught: Image, wanted: NDArray[np.bool_]
) -> dict[tuple[int, int], int]:
    """Pixels of every (slot, bin)."""
    return Counter(
        (int(slots[pixel]), int(bins[pixel]))
        for pixel in np.ndindex(*slots.shape)
        if wanted[slots[pixel]] and taught[pixel]
    )


def naive_components(slots: Image) -> NDArray[np.int64]:
    """Parts of each slot by scipy, numbered in the order of their first pixels."""
    parts = np.zeros(slots.shape, np.int64)
    n = 0
    for slot in np.unique(slots):
        found, n_found = ndimage.label(slots == slot, structure=np.ones((3, 3)))
        parts[found > 0] = found[found > 0] + n
        n += n_found
    order = list(dict.fromkeys(parts.ravel().tolist()))
    return np.array([order.index(part) for part in parts.ravel()]).reshape(slots.shape)


@dataclass(frozen=True)
class Described:
    slot: int
    area: int
    box: tuple[int, int, int, int]
    unknown: float
    resting: float
    inner: float


def naive_describe(parts: NDArray[np.integer], slots: Image, unknown_for: Image, resting_for: Image) -> list[Described]:
    found = []
    for part in range(int(parts.max()) + 1):
        inside = parts == part
        rows, columns = np.nonzero(inside)
        # Beyond the picture it goes on as at its border.
        padded = np.pad(inside, 2, mode="edge")
        inner = inside & padded[:-4, 2:-2] & padded[4:, 2:-2] & padded[2:-2, :-4] & padded[2:-2, 4:]
        found.append(
            Described(
                int(slots[rows[0], columns[0]]),
                len(rows),
                (rows.min(), columns.min(), rows.max(), columns.max()),
                float(unknown_for[inside].mean()),
                float(resting_for[inside].mean()),
                float(inner.sum() / inside.sum()),
            )
        )
    return found


@dataclass(frozen=True)
class Around:
    around: NDArray[np.float64]
    guess: NDArray[np.float64]
    below: NDArray[np.float64]
    colour: NDArray[np.float64]
    fits: NDArray[np.float64]


def naive_surroundings(
    part: NDArray[np.bool_],
    slots: Image,
    predicted: Image,
    rest: Image,
    bins: NDArray[np.integer],
    known: NDArray[np.bool_],
    tables: NDArray[np.float32],
) -> Around:
    """Of one part: slots beside it, predicted, at rest below; mean cost of colours, share of pixels that fit."""
    beside: Counter[int] = Counter()
    for y, x in np.argwhere(part):
        for dy, dx in ((0, 2), (2, 0), (0, -2), (-2, 0)):
            y2, x2 = y + dy, x + dx
            if 0 <= y2 < part.shape[0] and 0 <= x2 < part.shape[1] and not part[y2, x2]:
                beside[int(slots[y2, x2])] += 1
    shares = np.zeros(256)
    for slot, n in beside.items():
        shares[slot] = n / beside.total()
    colour = np.array([tables[slot][bins[part]].astype(float).mean() if known[slot] else 0.0 for slot in range(256)])
    guess, below = (np.bincount(image[part], minlength=256) / part.sum() for image in (predicted, rest))
    fits = np.array([(tables[slot][bins[part]] < 9).mean() if known[slot] else 0.0 for slot in range(256)])
    return Around(shares, guess, below, colour, fits)


def naive_recoloured(
    parts: NDArray[np.integer], new: NDArray[np.int64], slots: Image, taught: Image
) -> tuple[Image, Image]:
    slots, taught = slots.copy(), taught.copy()
    for part, slot in enumerate(new):
        inside = parts == part
        if slot >= 0:
            slots[inside] = slot % 256
        if slot >= 256:
            taught[inside] = 0
    return slots, taught


def naive_warped(slots: Image, flow: NDArray[np.float32]) -> Image:
    """What was seen where the flow, in pixels of the halved picture, says that each pixel comes from."""
    height, width = slots.shape
    warped = np.empty_like(slots)
    for y, x in np.ndindex(height, width):
        right, down = flow[min(y // 2, len(flow) - 1), min(x // 2, flow.shape[1] - 1)]
        row = min(max(y + round(float(2 * down)), 0), height - 1)
        column = min(max(x + round(float(2 * right)), 0), width - 1)
        warped[y, x] = slots[row, column]
    return warped


def candidates(rest: int, moving: Image) -> list[int]:
    """Slots that the planes of costs stand for: what rests, the background, what moves, unknown."""
    return [rest, 1, *(int(slot) for slot in moving), 0]


def naive_cheapest(costs: NDArray[np.float32], rest: Image, moving: Image) -> tuple[Image, Image]:
    slots, sure = np.empty_like(rest), np.empty_like(rest)
    for pixel in np.ndindex(*rest.shape):
        order = np.argsort(costs[(slice(None), *pixel)], kind="stable")
        slots[pixel] = candidates(int(rest[pixel]), moving)[order[0]]
        first, second = costs[(order[0], *pixel)], costs[(order[1], *pixel)]
        sure[pixel] = second - first > 1
    return slots, sure


def naive_bond(lab: Image, here: tuple[int, int], there: tuple[int, int], bond: float) -> np.float32:
    d = lab[here].astype(np.float32) - lab[there].astype(np.float32)
    far = (np.float32(0.5) * d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / np.float32(60)
    return np.float32(np.float32(bond) * (np.float32(0.15) + np.float32(0.85) / (np.float32(1) + far)))


def naive_energy_of(
    slot: int,
    pixel: tuple[int, int],
    costs: NDArray[np.float32],
    lab: Image,
    rest: Image,
    moving: Image,
    slots: Image,
    bond: float,
) -> np.float32:
    """The least of the costs that stand for the slot here, CAP if none does, and the bonds to others that it breaks."""
    planes = [k for k, other in enumerate(candidates(int(rest[pixel]), moving)) if other == slot]
    energy = min([CAP, *(costs[(k, *pixel)] for k in planes)])
    for dy, dx in NEIGHBOURS:
        other = pixel[0] + dy, pixel[1] + dx
        inside = 0 <= other[0] < slots.shape[0] and 0 <= other[1] < slots.shape[1]
        if inside and slots[other] != slot:
            energy += naive_bond(lab, pixel, other, bond)
    return np.float32(energy)


def naive_relaxed(
    costs: NDArray[np.float32], lab: Image, rest: Image, moving: Image, slots: Image, bond: float
) -> Image:
    """Every pixel the slot of least energy among its own and its neighbours'; if equal, its own or the first met."""
    relaxed = slots.copy()
    for y, x in np.ndindex(*slots.shape):
        around = slots[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].ravel().tolist()
        best = np.float32(math.inf)
        for slot in dict.fromkeys([int(slots[y, x]), *around]):
            energy = naive_energy_of(slot, (y, x), costs, lab, rest, moving, slots, bond)
            if energy < best - np.float32(1e-4):
                best, relaxed[y, x] = energy, slot
    return relaxed


@dataclass
class Settled:
    """What is known of one pixel of the static scene."""

    unknown_for: int
    resting_for: int
    rest: int
    seen: NDArray[np.float32]
    behind: NDArray[np.float32]
    behind_sigma: np.float32
    brightest: np.float32


def naive_settled(
    before: Settled,
    colour: Image,
    colour_before: Image,
    found: int,
    slot: int,
    slot_before: int,
    *,
    is_mover: bool,
    any_mover: bool,
    settle_frames: int,
    moved_by: int,
) -> Settled:
    """One pixel: how long it rests, and what it is taken for once it has rested long enough."""
    moved = abs(int(colour[0]) - int(colour_before[0])) > moved_by
    now = Settled(
        0 if moved or found != 0 else min(before.unknown_for + 1, 250),
        0 if moved or slot != slot_before else min(before.resting_for + 1, 250),
        before.rest,
        before.seen.copy(),
        before.behind.copy(),
        before.behind_sigma,
        before.brightest,
    )
    if is_mover or slot == 0 or now.resting_for < settle_frames:
        return now
    if slot != now.rest:
        now.rest, now.seen = slot, colour.astype(np.float32)
        now.brightest = np.float32(1.45 if any_mover else 1.05)
    else:
        # A shadow is not learned, or only where it is slight; light is learned faster.
        ratio = (np.float32(colour[0]) + np.float32(16)) / (now.seen[0] + np.float32(16))
        rate = np.float32(0.2 if ratio > np.float32(1.05) else (0.1 if ratio > np.float32(0.95) else 0))
        now.seen = now.seen + rate * (colour.astype(np.float32) - now.seen)
    if slot == 1:
        now.behind, now.behind_sigma = now.seen.copy(), np.float32(0)
    return now


def naive_presence(
    found: Image, slots: Image, rest: Image, mover: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.bool_], dict[int, tuple[int, int, int, int]]]:
    """Counts (256, 5), whether a mover is two pixels beside or above or below, and boxes of what is to be seen."""
    counts = np.zeros((256, 5), np.int64)
    touched = np.zeros(256, np.bool_)
    boxes = {}
    for slot in range(256):
        resting, visible = rest == slot, slots == slot
        recognised = resting & (found == rest)
        counts[slot] = [
            resting.sum(),
            recognised.sum(),
            (resting & ~recognised & mover[slots]).sum(),
            visible.sum(),
            (visible & ~resting).sum(),
        ]
        if slot > 1 and visible.any():
            rows, columns = np.nonzero(visible)
            boxes[slot] = (rows.min(), columns.min(), rows.max(), columns.max())
        for y, x in np.argwhere(visible):
            for dy, dx in ((0, 2), (2, 0), (0, -2), (-2, 0)):
                y2, x2 = y + dy, x + dx
                if 0 <= y2 < slots.shape[0] and 0 <= x2 < slots.shape[1] and mover[slots[y2, x2]]:
                    touched[slot] = True
    return counts, touched, boxes


def naive_rims(
    slots: Image, rest: Image, costs: NDArray[np.float32], moving: NDArray[np.bool_], bound: float, reach: int
) -> Image:
    """Slots after strange pixels of the background between two segments went to the nearer one, pixel by pixel."""
    closed = slots.copy()
    height, width = slots.shape
    for y, x in np.argwhere(slots == 1):
        if costs[0 if rest[y, x] == 1 else 1, y, x] < bound:
            continue
        nearest = reach + 1
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            ends = []
            for sign in (1, -1):
                places = [(y + sign * k * dy, x + sign * k * dx) for k in range(1, reach + 1)]
                seen = [
                    (k, int(slots[place]))
                    for k, place in enumerate(places, start=1)
                    if 0 <= place[0] < height and 0 <= place[1] < width and slots[place] > 1
                ]
                ends.append(seen[0] if seen else None)
            if None in ends:
                continue
            (far, one), (away, other) = ends
            if one != other and (moving[one] or moving[other]) and min(far, away) < nearest:
                nearest = min(far, away)
                closed[y, x] = one if far <= away else other
    return closed


def naive_shared_out(slots: Image, bins: NDArray[np.integer], tables: NDArray[np.float32]) -> Image:
    """Slots after what is unknown was given to its neighbours, ring after ring: the most frequent, then the likest."""
    given = slots.copy()
    while (given == 0).any():
        ring = {}
        for y, x in np.argwhere(given == 0):
            around = given[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].ravel().tolist()
            counts = Counter(slot for slot in around if slot)
            if counts:
                order = list(counts)
                ring[y, x] = min(order, key=lambda slot: (-counts[slot], tables[slot, bins[y, x]], order.index(slot)))
        if not ring:
            return np.ones_like(slots)
        for place, slot in ring.items():
            given[place] = slot
    return given


def naive_difference(
    colour: Image, base: NDArray[np.float32], brightest: float, p: NDArray[np.float32], extra: float
) -> float:
    """Cost of a colour where another one was seen before: the best shade of it, and what is left beside that."""
    now, before = (np.asarray(lab, np.float64) + np.array([16, -128, -128]) for lab in (colour, base))
    shade = min(max(now @ before / (before @ before), 0.62), brightest)
    off = 1 - shade if shade <= 1 else (shade - 1) / 2
    sigmas = p[2:4] + extra * np.array([1, 0.5]) + p[4] * off
    left = (now - shade * before) / sigmas[[0, 1, 1]]
    cost = p[0] + left @ left / 2
    if sigmas[1] > 1.02 * p[3]:
        cost += 2 * math.log(sigmas[1] / p[3])
    return float(cost + p[5] * max(0.98 - shade, 0, shade - 1.03))
