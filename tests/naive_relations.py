"""Slow, obvious reference of the scan-line method (A.1): every line of the image on its own, in plain Python."""

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class NaiveHints:
    touching: Counter[tuple[int, int]] = field(default_factory=Counter)
    overlapping: Counter[tuple[int, int]] = field(default_factory=Counter)
    lines: Counter[int] = field(default_factory=Counter)


def naive_hints(image: list[list[int]]) -> NaiveHints:
    hints = NaiveHints()
    rows = image
    columns = [[line[column] for line in image] for column in range(len(image[0]))]
    for line in rows + columns:
        _add_line(hints, line)
    return hints


def naive_places(image: list[list[int]]) -> dict[int, list[tuple[int, int]]]:
    """(column, row) of every pixel of each segment."""
    places: dict[int, list[tuple[int, int]]] = {}
    for row, line in enumerate(image):
        for column, label in enumerate(line):
            places.setdefault(label, []).append((column, row))
    return places


def _add_line(hints: NaiveHints, line: list[int]) -> None:
    for label in set(line):
        hints.lines[label] += 1
    stack: list[int] = []
    previous = None
    for label in line:
        if label == previous:
            continue
        if previous is not None:
            hints.touching[previous, label] += 1
            hints.touching[label, previous] += 1
        if label in stack:
            inner = []
            while stack[-1] != label:
                inner.append(stack.pop())
            for j in inner:
                hints.overlapping[label, j] += 1
            for j in inner:
                for k in inner:
                    if j != k:
                        hints.overlapping[j, k] -= 1
        else:
            stack.append(label)
        previous = label
