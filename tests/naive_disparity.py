"""Plain Python twins of the compiled parts of disparity."""

import math
from statistics import median

Rows = list[list[float]]


def naive_row_ends(disparity: Rows, n: int) -> Rows:
    ends = []
    for row in disparity:
        known = [value for value in row if not math.isnan(value)]
        ends.append([median(known[:n]), median(known[-n:])] if known else [math.nan, math.nan])
    return ends


def naive_fill_rows(disparity: Rows, labels: list[list[int]], ends: Rows, same_px: float) -> Rows:
    filled = [list(row) for row in disparity]
    for row, marks, (left_end, right_end), out in zip(disparity, labels, ends, filled, strict=True):
        for column, value in enumerate(row):
            if not math.isnan(value):
                continue
            # The hole around this pixel, within its segment.
            first = last = column
            while first > 0 and math.isnan(row[first - 1]) and marks[first - 1] == marks[column]:
                first -= 1
            while last < len(row) - 1 and math.isnan(row[last + 1]) and marks[last + 1] == marks[column]:
                last += 1
            starts, stops = first == 0, last == len(row) - 1
            before = left_end if starts else row[first - 1] if marks[first - 1] == marks[column] else math.nan
            after = right_end if stops else row[last + 1] if marks[last + 1] == marks[column] else math.nan
            if starts and not stops and not math.isnan(before):
                out[column] = before
            elif stops and not starts and not math.isnan(after):
                out[column] = after
            elif math.isnan(before) or math.isnan(after):
                out[column] = after if math.isnan(before) else before
            elif abs(after - before) <= same_px:
                share = (column - first + 1) / (last - first + 2)
                out[column] = before + share * (after - before)
            else:
                out[column] = min(before, after)
    return filled


def naive_blend(history: list[tuple[float, bool]], longest: int, jump_px: float) -> list[float]:
    """Means of one pixel, given what each frame says of it: its disparity, and whether the picture has moved."""
    means: list[float] = []
    mean, n = math.nan, 0
    for value, moved in history:
        if moved or n == 0:
            mean, n = value, 0 if math.isnan(value) else 1
        elif not math.isnan(value) and abs(value - mean) <= jump_px:
            n = min(n + 1, longest)
            mean += (value - mean) / n
        else:
            n -= 1
            mean = mean if n else math.nan
        means.append(mean)
    return means
