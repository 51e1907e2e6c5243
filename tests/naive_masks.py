"""Masks encoded and decoded slowly and obviously: pixel by pixel, character by character, corner by corner."""

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


def runs_of_mask(mask: Mask) -> list[int]:
    """Lengths of runs, column by column, beginning with pixels outside."""
    runs = [0]
    inside = False
    for column in range(mask.shape[1]):
        for row in range(mask.shape[0]):
            if bool(mask[row, column]) != inside:
                runs.append(0)
                inside = not inside
            runs[-1] += 1
    return runs


def mask_of_runs(runs: list[int], size: tuple[int, int]) -> Mask:
    """The way back: pixels one after the other."""
    mask = np.zeros(size, dtype=bool)
    position = 0
    for turn, run in enumerate(runs):
        for _ in range(run):
            mask[position % size[0], position // size[0]] = turn % 2 == 1
            position += 1
    assert position == size[0] * size[1]
    return mask


def compress(runs: list[int]) -> str:
    """Text of runs as COCO writes it: differences, five bits at a time."""
    text = ""
    for place, run in enumerate(runs):
        number = run - runs[place - 2] if place > 2 else run
        while True:
            group = number % 32
            number //= 32  # rounds down, so a negative number ends at -1
            is_done = number == (-1 if group >= 16 else 0)
            text += chr(48 + group + (0 if is_done else 32))
            if is_done:
                break
    return text


def decompress(text: str) -> list[int]:
    """Runs of a text: the groups of each number put together one by one."""
    runs: list[int] = []
    groups: list[int] = []
    for character in text:
        code = ord(character) - 48
        groups.append(code % 32)
        if code < 32:
            number = sum(group * 32**place for place, group in enumerate(groups))
            if groups[-1] >= 16:
                number -= 32 ** len(groups)
            runs.append(number + (runs[-2] if len(runs) > 2 else 0))
            groups = []
    return runs


def polygon_mask(corners: list[tuple[float, float]], size: tuple[int, int]) -> Mask:
    """Pixels from whose centres a ray to the left crosses the outline an odd number of times."""
    mask = np.zeros(size, dtype=bool)
    for row in range(size[0]):
        for column in range(size[1]):
            x, y = column + 0.5, row + 0.5
            n_crossings = 0
            for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
                if (ay <= y) != (by <= y) and ax + (y - ay) * (bx - ax) / (by - ay) <= x:
                    n_crossings += 1
            mask[row, column] = n_crossings % 2 == 1
    return mask
