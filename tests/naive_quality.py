"""Slow, obvious reference of the quality of a segmentation: sets of pixels, one after the other, in plain Python."""

from collections import Counter
from fractions import Fraction

Image = list[list[int]]


def naive_segments(image: Image) -> dict[int, set[tuple[int, int]]]:
    """Places of every segment."""
    places: dict[int, set[tuple[int, int]]] = {}
    for row, line in enumerate(image):
        for column, label in enumerate(line):
            places.setdefault(label, set()).add((row, column))
    return places


def naive_best_iou(segment: set[tuple[int, int]], labels: Image) -> Fraction:
    return max(Fraction(len(segment & other), len(segment | other)) for other in naive_segments(labels).values())


def naive_covering(labels: Image, truth: Image) -> Fraction:
    segments = naive_segments(truth).values()
    return sum(len(segment) * naive_best_iou(segment, labels) for segment in segments) / sum(map(len, segments))


def naive_worn(segment: int, labels: list[Image], truth: list[Image], min_pixels: int) -> list[int]:
    """The most frequent label of a true segment in each frame in which it is visible."""
    worn = []
    for found, true in zip(labels, truth, strict=True):
        places = naive_segments(true).get(segment, set())
        if len(places) >= min_pixels:
            worn.append(naive_most_frequent([found[row][column] for row, column in places]))
    return worn


def naive_most_frequent(labels: list[int]) -> int:
    counts = Counter(labels)
    return min(label for label in counts if counts[label] == max(counts.values()))


def naive_kept(
    labels: list[Image], truth: list[Image], *, background: int | None, min_pixels: int
) -> dict[int, Fraction]:
    """By object that is ever visible, the share of its frames in which it wears its own label."""
    segments = {segment for image in truth for segment in naive_segments(image)}
    worn = {segment: naive_worn(segment, labels, truth, min_pixels) for segment in segments}
    dominant = {segment: naive_most_frequent(labels) for segment, labels in worn.items() if labels}
    kept = {}
    for segment, label in dominant.items():
        if segment == background:
            continue
        shared = any(other != segment and dominant[other] == label for other in dominant)
        kept[segment] = Fraction(0) if shared else Fraction(worn[segment].count(label), len(worn[segment]))
    return kept


def naive_iou(
    labels: list[Image], truth: list[Image], *, background: int | None, min_pixels: int
) -> dict[int, Fraction]:
    """By object that is ever visible, the mean of its best intersection over union."""
    ious: dict[int, list[Fraction]] = {}
    for found, true in zip(labels, truth, strict=True):
        for segment, places in naive_segments(true).items():
            if segment != background and len(places) >= min_pixels:
                ious.setdefault(segment, []).append(naive_best_iou(places, found))
    return {segment: sum(values) / len(values) for segment, values in ious.items()}
