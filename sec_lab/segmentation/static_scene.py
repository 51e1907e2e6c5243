"""The static scene at the beginning of a movie: a background, and what stands or lies on it.

Two things tell an object from what it lies on: it rises above the plane on which it lies (where there is depth), and it
has a colour that is unusual there. Each gives places that are certain; from these, regions grow on the lattice of
pixels (bonds between like colours, as in §2.2) up to their borders.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.appearance import smoothed_lab
from sec_lab.segmentation.static_parts import (
    BACKGROUND,
    MAX_OBJECTS,
    RISES,
    Floats,
    Labels,
    parted_at_necks,
    tidied,
    with_coloured_parts,
    with_things_on_top,
)

_ALIKE, _STRANGE, _VERY_STRANGE = 0.5, 2.0, 3.0
"""How unusual a thing is beyond what is typical, in nats: no more than the ground; a thing where depth is known, and
where nothing else speaks for it."""


def static_segments(
    image: NDArray[np.uint8], *, depth_m: NDArray[np.float32] | None = None, least_px: int = 40
) -> Labels:
    """Segments of a picture of a scene at rest.

    Parameters
    ----------
    image : (height, width, 3) uint8
        RGB.
    depth_m : (height, width) float32, optional
        Metres; 0 where unknown.
    least_px : int, optional
        Smallest object.

    Returns
    -------
    (height, width) uint8
        1 for the background, 2, 3, … for objects, in the main from left to right.
    """
    from sec_lab.segmentation import _layer_kernels as kernels
    from sec_lab.segmentation.potts import PottsParameters, superparamagnetic_clustering

    lab = smoothed_lab(image)
    bins = kernels.colour_bins(lab)
    unusual = _unusualness(bins)
    rise = None if depth_m is None else rise_above_plane(depth_m)
    seeds = _seeds(unusual, rise, least_px)
    grown = _confirmed(_grown(lab, bins, seeds, rise, least_px), unusual, rise)
    whole = parted_at_necks(bins, grown, least_px)
    if not (whole > BACKGROUND).any():
        return whole
    domains = superparamagnetic_clustering(image, parameters=PottsParameters(minimum_size_px=max(10, least_px)))
    if rise is not None:
        bare = with_things_on_top(lab, bins, domains, whole, rise, least_px)
        # A neck between two like things shows when the one on top of the other is away.
        whole = parted_at_necks(bins, bare, least_px) if (bare != whole).any() else whole
    return with_coloured_parts(lab, bins, domains, whole, rise, least_px)


def rise_above_plane(depth_m: NDArray[np.float32]) -> Floats:
    """How far what is seen lies before the plane that most of it belongs to, in units of the noise.

    Inverse depth of a plane is linear in the picture, and the noise of stereo is the same everywhere in it.

    Parameters
    ----------
    depth_m : (height, width) float32
        Metres; 0 where unknown.

    Returns
    -------
    (height, width) float32
        NaN where unknown, or everywhere if there is no plane.
    """
    height, width = depth_m.shape
    nothing = np.full((height, width), np.nan, np.float32)
    rows, columns = np.nonzero(depth_m > 0)
    if min(height, width) < 8 or len(rows) < max(100, 0.2 * height * width):
        return nothing
    step = max(1, len(rows) // 12_000)
    x, y = columns[::step] / width - 0.5, rows[::step] / height - 0.5
    ones = np.ones_like(x)
    inverse = 1 / depth_m[rows[::step], columns[::step]].astype(np.float64)
    a = np.stack([x, y, ones], axis=1)
    plane = _least_squares(a, inverse)
    spread = float(np.median(np.abs(inverse - a @ plane)))
    for _ in range(30):
        residual = inverse - a @ plane
        close = np.abs(residual) < 2.5 * spread
        if close.sum() < 100:
            return nothing
        plane = _least_squares(a[close], inverse[close])
        spread = max(1.4826 * float(np.median(np.abs(residual[close]))), 1e-9)
    whole_x = np.arange(width) / width - 0.5
    whole_y = np.arange(height) / height - 0.5
    fitted = plane[0] * whole_x[None, :] + plane[1] * whole_y[:, None] + plane[2]
    with np.errstate(divide="ignore"):
        rise = ((1 / depth_m) - fitted) / spread
    return np.where(depth_m > 0, rise, np.nan).astype(np.float32)


def _least_squares(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    # The sums by einsum, so that no thread count of a linear algebra library changes the last bit.
    normal = np.einsum("ki,kj->ij", a, a)
    return np.asarray(np.linalg.solve(normal, np.einsum("ki,k->i", a, b)))


def _unusualness(bins: NDArray[np.uint16]) -> Floats:
    """Minus log density of each colour among those at the borders of the picture, where the background is seen.

    Of each colour the side that shows it most is left out: the background reaches more than one, and a thing that the
    border cuts off is no part of it.
    """
    import cv2

    from sec_lab.segmentation import _layer_kernels as kernels

    height, width = bins.shape
    rows, columns = max(1, round(0.12 * height)), max(1, round(0.12 * width))
    sides = (bins[:rows], bins[-rows:], bins[rows:-rows, :columns], bins[rows:-rows, -columns:])
    counts = np.stack([np.bincount(side.ravel(), minlength=kernels.N_BINS) for side in sides]).astype(np.float32)
    table = np.zeros(kernels.N_BINS, np.float32)
    kernels.colour_costs(counts.sum(axis=0) - counts.max(axis=0), table)
    return np.asarray(cv2.blur(table[bins], (5, 5)))


def _confirmed(labels: Labels, unusual: Floats, rise: Floats | None) -> Labels:
    """Objects that stand out as a whole, by height or by colour: what is so at its seed only was noise."""
    if rise is None:
        return labels
    confirmed = labels.copy()
    typical = float(np.median(unusual))
    for slot in np.unique(labels[labels > BACKGROUND]):
        inside = labels == slot
        heights = rise[inside]
        heights = heights[np.isfinite(heights)]
        strangeness = float(np.median(unusual[inside])) - typical
        height = float(np.median(heights)) if len(heights) else 0.0
        if len(heights) > 0.4 * inside.sum():
            # What looks like what it lies on must rise more clearly than what does not.
            real = strangeness >= _STRANGE or height >= (2 if strangeness < _ALIKE else 1) * RISES
        else:
            real = strangeness >= (_STRANGE if height >= RISES else _VERY_STRANGE)
        if not real:
            confirmed[inside] = BACKGROUND
    return confirmed


def _seeds(unusual: Floats, rise: Floats | None, least_px: int) -> NDArray[np.int32]:
    """Places that are certain: 1 for the background, 2, 3, … for objects; 0 where nothing is certain."""
    import cv2

    typical = float(np.median(unusual))
    spread = 1.4826 * float(np.median(np.abs(unusual - typical)))
    strange = unusual > typical + max(1.2, 4 * spread)
    raised = np.zeros_like(strange)
    flat = np.zeros_like(strange)
    if rise is not None:
        smooth = cv2.medianBlur(np.nan_to_num(rise, nan=0.0, posinf=0.0, neginf=0.0), 5)
        raised = smooth > RISES
        flat = np.isfinite(rise) & (np.abs(smooth) < 0.6 * RISES)
        # A colour alone is no object where depth says that it lies in the plane.
        strange &= ~cv2.erode(flat.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)
    # Depth from matched windows reaches beyond an object's border, so only what is well inside is certain.
    opened = cv2.morphologyEx(strange.astype(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    inner = cv2.erode(raised.astype(np.uint8), np.ones((5, 5), np.uint8))
    # The blur of unusualness reaches out two pixels, and pixels at a rim are mixed.
    certain = np.maximum(inner, cv2.erode(opened, np.ones((5, 5), np.uint8)))
    _, parts, statistics, _ = cv2.connectedComponentsWithStats(certain, connectivity=4)
    seeds = np.zeros(unusual.shape, np.int32)
    near = cv2.dilate(certain, np.ones((21, 21), np.uint8))
    seeds[near == 0] = BACKGROUND
    number = BACKGROUND
    for part in np.argsort(statistics[:, cv2.CC_STAT_LEFT], kind="stable"):
        if part == 0 or statistics[part, cv2.CC_STAT_AREA] < max(6, least_px // 4) or number > MAX_OBJECTS:
            continue
        inside = parts == part
        if rise is not None:
            heights = rise[inside]
            known = np.isfinite(heights)
            if known.mean() > 0.4:
                if np.median(heights[known]) < 0.75 * RISES:
                    continue
            elif np.median(unusual[inside]) < typical + _VERY_STRANGE:
                continue
        number += 1
        seeds[inside] = number
    return seeds


def _grown(
    lab: NDArray[np.uint8], bins: NDArray[np.uint16], seeds: NDArray[np.int32], rise: Floats | None, least_px: int
) -> Labels:
    """Segments around the seeds: colours of each against the background's, borders where colours change."""
    import cv2

    from sec_lab.segmentation import _layer_kernels as kernels

    labels: Any = np.where(seeds > 0, seeds, BACKGROUND).astype(np.uint8)
    objects = np.unique(labels)
    objects = objects[objects > BACKGROUND]
    height, width = labels.shape
    taught: Any = (seeds > 0).astype(np.uint8)
    counts = np.zeros((256, kernels.N_BINS), np.float32)
    tables = np.full((256, kernels.N_BINS), kernels.CAP, np.float32)
    wanted = np.isin(np.arange(256), [BACKGROUND, *objects])
    nothing = np.zeros((height, width), np.uint8)
    raised, level, stands = None, None, set[int]()
    if rise is not None:
        known = np.nan_to_num(rise, nan=0.0, posinf=0.0, neginf=0.0)
        raised = cv2.erode(known, np.ones((7, 7), np.uint8))
        # What stands out by its height ends where the plane is seen.
        smooth = cv2.dilate(cv2.medianBlur(known, 5), np.ones((3, 3), np.uint8))
        level = np.minimum(0.25 * np.maximum(RISES - smooth, 0.0) ** 2, 4).astype(np.float32)
        level[~np.isfinite(rise)] = 0
        stands = {int(slot) for slot in objects if np.nanmedian(np.append(rise[seeds == slot], 0)) > 2 * RISES}
    for _ in range(3):
        counts[:] = 0
        kernels.count_colours(bins, labels, taught, wanted, counts)
        for slot in np.flatnonzero(wanted):
            kernels.colour_costs(counts[slot], tables[slot])
        background = tables[BACKGROUND][bins]
        if raised is not None:
            # Noise of depth is normal in the plane; an object may have any height, or be flat.
            background = background + np.minimum(0.25 * np.maximum(raised, 0.0) ** 2, 4).astype(np.float32)
        background = cv2.blur(background, (3, 3))
        for slot in objects:
            inside = (labels == slot).astype(np.uint8)
            columns, rows, box_width, box_height = cv2.boundingRect(inside)
            if not box_width:
                continue
            margin = 8
            top, left = max(0, rows - margin), max(0, columns - margin)
            box = np.s_[top : rows + box_height + margin, left : columns + box_width + margin]
            own = cv2.blur(tables[slot][bins[box]], (3, 3))
            if level is not None and int(slot) in stands:
                own = own + level[box]
            part = np.ascontiguousarray(labels[box])
            reach = cv2.dilate(inside[box], np.ones((9, 9), np.uint8)) > 0
            core = seeds[box] == slot
            # Candidates of the lattice: 0, the background, in place of what is unknown; 1, the object.
            costs = np.empty((3, *part.shape), np.float32)
            costs[0] = kernels.CAP
            costs[1] = np.where(reach, own - np.where(core, 4, 0), kernels.CAP)
            costs[2] = background[box]
            free = (part == BACKGROUND) | (part == slot)
            spins = np.where(costs[1] < costs[2], 1, 0).astype(np.uint8)
            spins[~free] = 0
            relaxed = np.empty_like(spins)
            awake = np.ones_like(spins, np.bool_)
            for _sweep in range(6):
                kernels.relax(
                    costs,
                    np.ascontiguousarray(lab[box]),
                    nothing[box].copy(),
                    nothing[:0, 0],
                    spins,
                    relaxed,
                    np.float32(1.2),
                    awake,
                )
                spins, relaxed = relaxed, spins
            object_ = cv2.morphologyEx(spins, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
            part[free] = np.where(object_[free] == 1, slot, BACKGROUND)
            labels[box] = part
    return tidied(labels, least_px)
