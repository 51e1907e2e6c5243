"""Regions of the static scene parted into things: one before the other, one on the other, one in the other."""

import numpy as np
from numpy.typing import NDArray

Labels = NDArray[np.uint8]
Floats = NDArray[np.float32]

BACKGROUND = 1
MAX_OBJECTS = 100
RISES = 3.0
"""Height that is more than noise, in units of the noise of depth."""

_SURROUNDED = 0.8
_NARROW = 3
_SOLID = 0.8
_OTHER_HUE, _A_SHADE, _SAME_HUE = 20.0, 10.0, 5.0
"""Distances of chroma in one light, 0 to 255: of pages and their cover; more than a shade makes; of one cloth."""
_BRIGHTER = 10.0
_AT_BORDER = 0.15
_NEAR_BORDER = 0.15
_THICK, _VERY_THICK = 0.6, 0.75
"""More than a rim, and more than a band, as shares of a disc: a rectangle of 2 to 1 has 0.63, one of 1.4 to 1 0.75."""

_A_SIDE = 0.1


def tidied(labels: Labels, least_px: int) -> Labels:
    """Each connected region without holes an object of its own; what is too small belongs to the background.

    So do all but the ``MAX_OBJECTS`` largest.
    """
    import cv2

    found: list[tuple[int, int, NDArray[np.bool_]]] = []
    for slot in np.unique(labels[labels > BACKGROUND]):
        n, parts, statistics, _ = cv2.connectedComponentsWithStats((labels == slot).astype(np.uint8), connectivity=8)
        areas = statistics[:n, cv2.CC_STAT_AREA]
        found += [(int(areas[k]), int(slot), parts == k) for k in range(1, n) if areas[k] >= least_px]
    largest = set(sorted(range(len(found)), key=lambda k: -found[k][0])[:MAX_OBJECTS])
    tidied = np.full_like(labels, BACKGROUND)
    number = BACKGROUND
    for k, (_, slot, part) in enumerate(found):
        if k in largest:
            number += 1
            tidied[_filled(part) & ((labels == slot) | (labels == BACKGROUND))] = number
    return tidied


def parted_at_necks(bins: NDArray[np.uint16], labels: Labels, least_px: int) -> Labels:
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
            other = None
            for k in large[1:]:
                # The narrower the neck is against both, the less their colours have to say.
                narrow = min(depth[cores == core].max() for core in (large[0], k)) >= _NARROW * radius
                if _differ(bins, cores == large[0], cores == k, by=1.5 if narrow else 3.0):
                    other = k
                    break
            if other is None:
                continue
            far = [cv2.distanceTransform((cores != k).astype(np.uint8), cv2.DIST_L2, 5) for k in (large[0], other)]
            costs = [_table(bins, cores == k)[bins] for k in (large[0], other)]
            beyond = cv2.blur(costs[1] - costs[0], (3, 3)) + 0.3 * (far[1] - far[0]) < 0
            number += 1
            parted[(inside > 0) & beyond] = number
            waiting += [slot, number]
            break
    return tidied(parted, least_px)


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


def with_things_on_top(
    lab: NDArray[np.uint8],
    bins: NDArray[np.uint16],
    domains: NDArray[np.uint16],
    labels: Labels,
    rise: Floats,
    least_px: int,
) -> Labels:
    """Regions in two where something of other colours rises out of them, surrounded by the rest: what is on a plate.

    Depth from matched windows reaches beyond borders, so that it only says which domains of colour belong to the thing.
    Bands and caps near the border of the region stay, and what is thin and of one hue with it: a highlight.
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
            if np.median(smooth[region & (domains == domain)]) >= level + RISES
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
            # A band or a cap rises, too, where it is nearer to the camera than most of its thing.
            thin = _thickness(piece) <= _THICK and _hue_distance(lab, piece, rest) <= _A_SHADE
            if thin or _near_border(piece, labels):
                continue
            number += 1
            parted[piece] = number
    return parted


def _touch(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> bool:

    return bool(_dilated(one, 3)[other].any())


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


def with_coloured_parts(
    lab: NDArray[np.uint8],
    bins: NDArray[np.uint16],
    domains: NDArray[np.uint16],
    labels: Labels,
    rise: Floats | None,
    least_px: int,
) -> Labels:
    """Regions with a part of another colour in two: what a cup holds, the pages of a closed book.

    What is large and thick is a part; amid its region, its colours may be less unlike. What is small is one if it is of
    another hue, which no shade makes, and lies amid its region, lower than what is around it, or is a strip near its
    border. Rims, bands, caps and painted marks stay.
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
            within = not _near_border(piece, labels)
            hue = _hue_distance(lab, piece, rest)
            large = piece.sum() >= 0.12 * area and _thickness(piece) > (_THICK if within else _VERY_THICK)
            if not (large and _differ(bins, piece, rest, by=1.5 if within and hue > _A_SHADE else 3.0)):
                if hue < _OTHER_HUE or not _differ(bins, piece, rest, by=1.5):
                    continue
                if _is_ground(lab, piece, labels):
                    parted[piece] = BACKGROUND
                    continue
                lower = within and rise is not None and _is_lower(rise, piece, region)
                strip = not within and _is_strip(piece) and not _is_band(piece, region)
                if not _is_solid(piece) or _at_border(piece, labels) or not (lower or strip):
                    continue
            number += 1
            parted[piece] = number
    return parted


def _thickness(part: NDArray[np.bool_]) -> float:
    """As a share of that of a disc of the same area."""
    import cv2

    thickness = float(cv2.distanceTransform(np.pad(part, 1).astype(np.uint8), cv2.DIST_L2, 5).max())
    return thickness / float(np.sqrt(part.sum() / np.pi))


def _is_strip(part: NDArray[np.bool_]) -> bool:
    """Whether a part is at least as long and thin as a rectangle with sides of 4 to 1."""
    return _thickness(part) < float(np.sqrt(np.pi / 16))


def _is_lower(rise: Floats, piece: NDArray[np.bool_], region: NDArray[np.bool_]) -> bool:
    """Whether a piece lies lower than what is around it in its region, as in a cup."""
    near = [_dilated(piece, side) for side in (3, 9)]
    heights = [rise[where][np.isfinite(rise[where])] for where in (piece, near[1] & ~near[0] & region)]
    if any(len(known) < 10 for known in heights):
        return False
    return bool(np.median(heights[0]) < np.median(heights[1]) - RISES)


def _at_border(piece: NDArray[np.bool_], labels: Labels) -> bool:
    """Whether the background is next to much of a piece."""
    around = _dilated(piece, 3) & ~piece
    return bool((labels[around] == BACKGROUND).mean() >= _AT_BORDER)


def _near_border(piece: NDArray[np.bool_], labels: Labels) -> bool:
    """Whether the background begins a few pixels beyond a piece: pages show at an edge, a title amid its cover."""
    around = _dilated(piece, 15) & ~piece
    return bool((labels[around] == BACKGROUND).mean() >= _NEAR_BORDER)


def _is_solid(part: NDArray[np.bool_]) -> bool:
    """Whether a part fills its convex hull, which no rim and no writing does."""
    import cv2

    outlines, _ = cv2.findContours(part.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return bool(part.sum() >= _SOLID * cv2.contourArea(cv2.convexHull(np.concatenate(outlines))))


def _is_band(piece: NDArray[np.bool_], region: NDArray[np.bool_]) -> bool:
    """Whether a piece runs across a region, with much of it on either side."""
    import cv2

    # A region reaches a few pixels beyond the thing that it is of, on both ends of a band.
    cut = _dilated(piece, 7)
    n, _, statistics, _ = cv2.connectedComponentsWithStats((region & ~cut).astype(np.uint8), connectivity=4)
    sides = np.sort(statistics[1:n, cv2.CC_STAT_AREA])[::-1]
    return len(sides) > 1 and bool(sides[1] >= _A_SIDE * region.sum())


def _is_ground(lab: NDArray[np.uint8], piece: NDArray[np.bool_], labels: Labels) -> bool:
    """Whether a piece at the border of a region is the background around, lit as it is or in a shade."""
    if not _at_border(piece, labels):
        return False
    near = _dilated(piece, 31) & (labels == BACKGROUND)
    brighter = float(np.median(lab[piece][:, 0])) - float(np.median(lab[near][:, 0]))
    return brighter < _BRIGHTER and _hue_distance(lab, piece, near) < _SAME_HUE


def _dilated(part: NDArray[np.bool_], side_px: int) -> NDArray[np.bool_]:
    """A part with all that a square of so many pixels, centred on one of its own, covers."""
    import cv2

    return np.asarray(cv2.dilate(part.astype(np.uint8), np.ones((side_px, side_px), np.uint8)) > 0)


def _hue_distance(lab: NDArray[np.uint8], one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """How far two parts differ in chroma in the light of the darker one: a shade scales L* + 16, a* and b* alike."""
    lightness, *chroma = np.array([np.median(lab[where], axis=0) for where in (one, other)]).T
    light = lightness + 16 * 255 / 100
    scale = light.min() / light
    return float(np.hypot(*(np.subtract(*((values - 128) * scale)) for values in chroma)))
