"""The static scene at the beginning of a movie: a background, and what stands or lies on it.

Two things tell an object from what it lies on: it rises above the plane on which it lies (where there is depth), and it
has a colour that is unusual there. Each gives places that are certain; from these, regions grow on the lattice of
pixels (bonds between like colours, as in §2.2) up to their borders.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.appearance import smoothed_lab

Labels = NDArray[np.uint8]
Floats = NDArray[np.float32]

BACKGROUND = 1
_RISES = 3.0
_STRANGE = 2.0
_JUMP = 6.0
_SURROUNDED = 0.8
_SOLID = 0.85
_OTHER_HUE, _SAME_HUE = 25.0, 5.0
_BRIGHTER = 10.0
_AT_BORDER = 0.15
_A_SIDE = 0.1
MAX_OBJECTS = 100


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
        1 for the background, 2, 3, … for objects from left to right.
    """
    from sec_lab.segmentation import _layer_kernels as kernels
    from sec_lab.segmentation.potts import PottsParameters, superparamagnetic_clustering

    lab = smoothed_lab(image)
    bins = kernels.colour_bins(lab)
    unusual = _unusualness(bins)
    rise = None if depth_m is None else rise_above_plane(depth_m)
    seeds = _seeds(unusual, rise, least_px)
    grown = _confirmed(_grown(lab, bins, seeds, rise, least_px), unusual, rise)
    whole = _parted(bins, grown, least_px)
    if not (whole > BACKGROUND).any():
        return whole
    domains = superparamagnetic_clustering(image, parameters=PottsParameters(minimum_size_px=max(10, least_px)))
    if rise is not None:
        whole = _with_things_on_top(bins, domains, whole, rise, least_px)
    return _coloured(lab, bins, domains, whole, least_px)


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
        raised = len(heights) > 0.4 * inside.sum() and np.median(heights) >= _RISES
        if not raised and np.median(unusual[inside]) < typical + _STRANGE:
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
        raised = smooth > _RISES
        flat = np.isfinite(rise) & (np.abs(smooth) < 0.6 * _RISES)
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
                if np.median(heights[known]) < 0.75 * _RISES:
                    continue
            elif np.median(unusual[inside]) < typical + 3.0:
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
        level = np.minimum(0.25 * np.maximum(_RISES - smooth, 0.0) ** 2, 4).astype(np.float32)
        level[~np.isfinite(rise)] = 0
        stands = {int(slot) for slot in objects if np.nanmedian(np.append(rise[seeds == slot], 0)) > 2 * _RISES}
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
    return _tidied(labels, least_px)


def _tidied(labels: Labels, least_px: int) -> Labels:
    """Each object one region without holes; what is too small belongs to the background."""
    import cv2

    tidied = np.full_like(labels, BACKGROUND)
    number = BACKGROUND
    for slot in np.unique(labels[labels > BACKGROUND]):
        n, parts, statistics, _ = cv2.connectedComponentsWithStats((labels == slot).astype(np.uint8), connectivity=8)
        if n < 2:
            continue
        largest = 1 + int(np.argmax(statistics[1:, cv2.CC_STAT_AREA]))
        if statistics[largest, cv2.CC_STAT_AREA] < least_px:
            continue
        outlines, _ = cv2.findContours((parts == largest).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        filled = np.zeros_like(labels)
        cv2.drawContours(filled, outlines, -1, 1, cv2.FILLED)
        number += 1
        tidied[(filled > 0) & ((labels == slot) | (labels == BACKGROUND))] = number
    return tidied


def _parted(bins: NDArray[np.uint16], labels: Labels, least_px: int) -> Labels:
    """Regions cut where a neck joins parts of other colours: two things, one before the other."""
    import cv2

    parted = labels.copy()
    waiting = [int(slot) for slot in np.unique(labels[labels > BACKGROUND])]
    number = max(waiting, default=BACKGROUND)
    while waiting and number < MAX_OBJECTS:
        slot = waiting.pop()
        inside = (parted == slot).astype(np.uint8)
        depth = cv2.distanceTransform(np.pad(inside, 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
        for radius in range(2, max(3, int(depth.max()))):
            n, cores, statistics, _ = cv2.connectedComponentsWithStats(
                (depth > radius).astype(np.uint8), connectivity=4
            )
            large = [k for k in range(1, n) if statistics[k, cv2.CC_STAT_AREA] >= max(8, least_px // 4)]
            if len(large) < 2:
                continue
            large.sort(key=lambda k: -int(statistics[k, cv2.CC_STAT_AREA]))
            other = next((k for k in large[1:] if _differ(bins, cores == large[0], cores == k)), None)
            if other is None:
                continue
            far = [cv2.distanceTransform((cores != k).astype(np.uint8), cv2.DIST_L2, 5) for k in (large[0], other)]
            costs = [_table(bins, cores == k)[bins] for k in (large[0], other)]
            beyond = cv2.blur(costs[1] - costs[0], (3, 3)) + 0.3 * (far[1] - far[0]) < 0
            number += 1
            parted[(inside > 0) & beyond] = number
            waiting += [slot, number]
            break
    return _tidied(parted, least_px)


def _table(bins: NDArray[np.uint16], where: NDArray[np.bool_]) -> Floats:
    from sec_lab.segmentation import _layer_kernels as kernels

    counts = np.bincount(bins[where], minlength=kernels.N_BINS).astype(np.float32)
    table = np.empty(kernels.N_BINS, np.float32)
    kernels.colour_costs(counts, table)
    return table


def _differ(bins: NDArray[np.uint16], one: NDArray[np.bool_], other: NDArray[np.bool_], *, by: float = 3.0) -> bool:
    """Whether the colours of two parts have little in common, either way."""
    tables = _table(bins, one), _table(bins, other)
    return all(
        float((tables[1 - k][bins[where]] - tables[k][bins[where]]).mean()) > by for k, where in enumerate((one, other))
    )


def _with_things_on_top(
    bins: NDArray[np.uint16], domains: NDArray[np.uint16], labels: Labels, rise: Floats, least_px: int
) -> Labels:
    """Regions in two where something of other colours rises out of them, surrounded by the rest: what is on a plate.

    Depth from matched windows reaches beyond borders, so that it only says which domains of colour belong to the thing.
    """
    import cv2

    smooth = cv2.medianBlur(np.nan_to_num(rise, nan=0.0, posinf=0.0, neginf=0.0), 5)
    parted = labels.copy()
    number = int(labels.max())
    for slot in np.unique(labels[labels > BACKGROUND]):
        region = labels == slot
        sizes = np.bincount(domains[region])
        floor = region & (domains == int(np.argmax(sizes)))
        level = float(np.median(smooth[floor]))
        high = [
            domain
            for domain in np.flatnonzero(sizes)
            if np.median(smooth[region & (domains == domain)]) >= level + _RISES
        ]
        raised = (region & np.isin(domains, high)).astype(np.uint8)
        raised = cv2.morphologyEx(raised, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        n, parts, _, _ = cv2.connectedComponentsWithStats(raised, connectivity=4)
        for part in range(1, n):
            piece = _filled(parts == part)
            for domain in np.setdiff1d(np.flatnonzero(sizes >= least_px), [*high, np.argmax(sizes)]):
                # The lower part of what rises is no higher than the floor: its colours tell whose it is.
                lower = region & (domains == domain) & ~piece
                if (
                    _touch(piece, lower)
                    and _is_surrounded(lower | piece, region)
                    and _is_like(bins, lower, piece, floor)
                ):
                    piece = _filled(piece | lower)
            rest = region & (parted == slot) & ~piece
            if number >= MAX_OBJECTS or not 1.5 * least_px <= piece.sum() <= 0.6 * region.sum():
                continue
            if rest.sum() < least_px or not _is_surrounded(piece, region) or not _differ(bins, piece, rest, by=1.0):
                continue
            number += 1
            parted[piece] = number
    return parted


def _touch(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> bool:
    import cv2

    return bool((cv2.dilate(one.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)[other].any())


def _is_like(
    bins: NDArray[np.uint16], part: NDArray[np.bool_], one: NDArray[np.bool_], other: NDArray[np.bool_]
) -> bool:
    """Whether a part has the colours of one region rather than those of another."""
    return bool((_table(bins, other)[bins[part]] - _table(bins, one)[bins[part]]).mean() > 1.0)


def _filled(piece: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A connected piece without holes."""
    import cv2

    outlines, _ = cv2.findContours(piece.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(piece.shape, np.uint8)
    cv2.drawContours(filled, outlines, -1, 1, cv2.FILLED)
    return filled > 0


def _is_surrounded(piece: NDArray[np.bool_], region: NDArray[np.bool_]) -> bool:
    """Whether most of what lies around a piece, as far as half its radius, belongs to its region."""
    import cv2

    reach = max(3, round(0.5 * float(np.sqrt(piece.sum() / np.pi))))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    around = (cv2.dilate(piece.astype(np.uint8), disc) > 0) & ~piece
    return bool(region[around].mean() > _SURROUNDED)


def _coloured(
    lab: NDArray[np.uint8], bins: NDArray[np.uint16], domains: NDArray[np.uint16], labels: Labels, least_px: int
) -> Labels:
    """Regions with a part of another colour in two: what a cup holds, the pages of a closed book. Rims and bands stay.

    Part is what is large and thick, or, however small, of one piece and of another hue, which no shadow makes.
    """
    import cv2

    parted = labels.copy()
    number = int(labels.max())
    for slot in np.unique(labels[labels > BACKGROUND]):
        region = labels == slot
        area = int(region.sum())
        least = 1.5 * least_px
        sizes = np.bincount(domains[region])
        for domain in np.flatnonzero(sizes >= least):
            if number >= MAX_OBJECTS:
                break
            part = cv2.morphologyEx((region & (domains == domain)).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3)))
            n, pieces, statistics, _ = cv2.connectedComponentsWithStats(part, connectivity=4)
            rest = region & (parted == slot) & (part == 0)
            if n < 2 or rest.sum() < least:
                continue
            piece = pieces == 1 + int(np.argmax(statistics[1:, cv2.CC_STAT_AREA]))
            if not least <= piece.sum() <= 0.6 * area:
                continue
            large = piece.sum() >= 0.12 * area and _is_thick(piece) and _differ(bins, piece, rest)
            if not large:
                if _hue_distance(lab, piece, rest) < _OTHER_HUE or not _differ(bins, piece, rest, by=2.5):
                    continue
                if _is_ground(lab, piece, labels):
                    parted[piece] = BACKGROUND
                    continue
                if not _is_solid(piece) or _is_band(piece, region):
                    continue
            number += 1
            parted[piece] = number
    return parted


def _is_thick(part: NDArray[np.bool_]) -> bool:
    """Whether a part is more than a rim or a band: its thickness is at least 0.6 of that of a disc of the same area."""
    import cv2

    thickness = float(cv2.distanceTransform(np.pad(part, 1).astype(np.uint8), cv2.DIST_L2, 5).max())
    return thickness > 0.6 * float(np.sqrt(part.sum() / np.pi))


def _is_solid(part: NDArray[np.bool_]) -> bool:
    """Whether a part fills its convex hull, which no rim and no writing does."""
    import cv2

    outlines, _ = cv2.findContours(part.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return bool(part.sum() >= _SOLID * cv2.contourArea(cv2.convexHull(np.concatenate(outlines))))


def _is_band(piece: NDArray[np.bool_], region: NDArray[np.bool_]) -> bool:
    """Whether a piece runs across a region, with much of it on either side."""
    import cv2

    # A region reaches a few pixels beyond the thing that it is of, on both ends of a band.
    cut = cv2.dilate(piece.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    n, _, statistics, _ = cv2.connectedComponentsWithStats((region & ~cut).astype(np.uint8), connectivity=4)
    sides = np.sort(statistics[1:n, cv2.CC_STAT_AREA])[::-1]
    return len(sides) > 1 and bool(sides[1] >= _A_SIDE * region.sum())


def _is_ground(lab: NDArray[np.uint8], piece: NDArray[np.bool_], labels: Labels) -> bool:
    """Whether a piece at the border of a region is the background around, lit as it is or in a shade."""
    import cv2

    around = (cv2.dilate(piece.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0) & ~piece
    if (labels[around] == BACKGROUND).mean() < _AT_BORDER:
        return False
    near = (cv2.dilate(piece.astype(np.uint8), np.ones((31, 31), np.uint8)) > 0) & (labels == BACKGROUND)
    brighter = float(np.median(lab[piece][:, 0])) - float(np.median(lab[near][:, 0]))
    return brighter < _BRIGHTER and _hue_distance(lab, piece, near) < _SAME_HUE


def _hue_distance(lab: NDArray[np.uint8], one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """How far two parts differ in chroma, whatever light falls on them."""
    chroma = [np.median(lab[where][:, 1:].astype(np.float32), axis=0) for where in (one, other)]
    return float(np.hypot(*(chroma[0] - chroma[1])))
