"""Slow, obvious references of what is counted along the borders of segments."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

Image = list[list[int]]
Pixel = tuple[int, int]


def naive_steps(
    labels: Image,
    depth_m: list[list[float]],
    *,
    step_m: float,
    skip: int,
    reach: int = 3,
    planes: dict[int, tuple[float, float, float, float]] | None = None,
) -> tuple[Counter[Pixel], Counter[Pixel], Counter[Pixel]]:
    """Known, small and in-front counts by pair of labels."""
    known: Counter[Pixel] = Counter()
    small: Counter[Pixel] = Counter()
    in_front: Counter[Pixel] = Counter()
    for first, second in _neighbours(labels):
        i, j = labels[first[0]][first[1]], labels[second[0]][second[1]]
        if i == j:
            continue
        away = (first[0] - second[0], first[1] - second[1])
        before = _side(labels, depth_m, first, away, skip, reach)
        after = _side(labels, depth_m, second, (-away[0], -away[1]), skip, reach)
        if before is None or after is None:
            continue
        if planes is not None and abs(before - after) <= step_m:
            at = second[1] / len(labels[0]), second[0] / len(labels)
            one, other = (a * at[0] + b * at[1] + c for a, b, c, _ in (planes[i], planes[j]))
            if 0 < one < other and 1 / before - one > planes[i][3]:
                before = 1 / one
            if 0 < other < one and 1 / after - other > planes[j][3]:
                after = 1 / other
        for pair in ((i, j), (j, i)):
            known[pair] += 1
            small[pair] += abs(before - after) <= step_m
        if abs(before - after) > step_m:
            in_front[(i, j) if before < after else (j, i)] += 1
    return known, small, in_front


def naive_plane(points: list[tuple[float, float, float]], spreads: float) -> tuple[float, float, float, float]:
    """Plane a x + b y + c through points (x, y, inverse depth), by those within two spreads, and what is too near."""
    kept = np.array(points)
    plane, spread = np.zeros(3), np.inf
    for _ in range(5):
        if len(kept) < 30 or min(kept[:, 0].std(), kept[:, 1].std()) == 0:
            return 0.0, 0.0, 0.0, np.inf
        design = np.column_stack([kept[:, :2], np.ones(len(kept))])
        plane = np.linalg.lstsq(design, kept[:, 2], rcond=None)[0]
        spread = float(np.sqrt(((kept[:, 2] - design @ plane) ** 2).mean()))
        everything = np.array(points)
        residual = everything[:, 2] - np.column_stack([everything[:, :2], np.ones(len(points))]) @ plane
        kept = everything[np.abs(residual) <= 2 * spread]
    return float(plane[0]), float(plane[1]), float(plane[2]), spreads * spread


def naive_changes(before: Image, after: Image) -> Counter[Pixel]:
    return Counter(
        (old, new)
        for line, next_line in zip(before, after, strict=True)
        for old, new in zip(line, next_line, strict=True)
        if old != new
    )


def naive_rest(
    changed: dict[Pixel, int], hints: dict[Pixel, int], pixels: dict[int, int], most_px: float
) -> dict[int, int]:
    """1 rests, 0 moves, −1 open."""
    background = max(sorted(pixels), key=lambda label: pixels[label])
    rests = {background: 1}
    while True:
        still = [label for label, state in rests.items() if state == 1]
        border = {
            label: sum(hints.get((label, other), 0) for other in still)
            for label in sorted(pixels)
            if label not in rests
        }
        open_ones = {label: length for label, length in border.items() if length > 0}
        if not open_ones:
            return {label: rests.get(label, -1) for label in pixels}
        label = max(open_ones, key=lambda one: open_ones[one])
        shifted = sum(changed.get((label, other), 0) + changed.get((other, label), 0) for other in still)
        rests[label] = int(shifted <= most_px * border[label])


def _neighbours(labels: Image) -> Iterator[tuple[Pixel, Pixel]]:
    height, width = len(labels), len(labels[0])
    for row in range(height):
        for column in range(width):
            if column + 1 < width:
                yield (row, column), (row, column + 1)
            if row + 1 < height:
                yield (row, column), (row + 1, column)


def _side(labels: Image, depth_m: list[list[float]], start: Pixel, away: Pixel, skip: int, reach: int) -> float | None:
    def label_at(row: int, column: int) -> int | None:
        inside = 0 <= row < len(labels) and 0 <= column < len(labels[0])
        return labels[row][column] if inside else None

    label = label_at(*start)
    found: list[float] = []
    for k in range(1, 4 * skip + reach):
        row, column = start[0] + k * away[0], start[1] + k * away[1]
        if label_at(row, column) != label:
            break
        sideways = [label_at(row + side * skip * away[1], column + side * skip * away[0]) for side in (-1, 1)]
        if k >= skip and sideways == [label, label]:
            found.append(depth_m[row][column])
            if len(found) == reach:
                break
    seen = [depth for depth in found if depth > 0]
    return sum(seen) / len(seen) if seen else None
