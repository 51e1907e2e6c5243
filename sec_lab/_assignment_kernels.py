"""Compiled assignment of rows to rows: equal entries of two rows, and the Hungarian method."""

import numpy as np

from sec_lab._chain_kernels import Codes, Integers, compiled


@compiled
def equal_entries(x: Codes, y: Codes) -> int:
    """Number of places up to the end of y in which x and y are equal."""
    equal = 0
    for a in range(len(y)):
        equal += x[a] == y[a]
    return equal


@compiled
def largest_assignment(gain: Integers) -> Integers:
    """Assignment of rows to columns (n ≤ m) with the largest sum of gains: column of each row (Hungarian method)."""
    n, m = gain.shape
    potential_row = np.zeros(n + 1, np.int64)
    potential_column = np.zeros(m + 1, np.int64)
    row_of = np.zeros(m + 1, np.int64)
    way = np.zeros(m + 1, np.int64)
    infinite = np.int64(1) << 60
    for row in range(1, n + 1):
        row_of[0] = row
        column = 0
        shortest = np.full(m + 1, infinite, np.int64)
        used = np.zeros(m + 1, np.bool_)
        while True:
            used[column] = True
            at = row_of[column]
            delta = infinite
            following = 0
            for j in range(1, m + 1):
                if not used[j]:
                    reduced = -gain[at - 1, j - 1] - potential_row[at] - potential_column[j]
                    if reduced < shortest[j]:
                        shortest[j] = reduced
                        way[j] = column
                    if shortest[j] < delta:
                        delta = shortest[j]
                        following = j
            for j in range(m + 1):
                if used[j]:
                    potential_row[row_of[j]] += delta
                    potential_column[j] -= delta
                else:
                    shortest[j] -= delta
            column = following
            if row_of[column] == 0:
                break
        while column != 0:
            previous = way[column]
            row_of[column] = row_of[previous]
            column = previous
    column_of = np.full(n, -1, np.int64)
    for j in range(1, m + 1):
        if row_of[j] > 0:
            column_of[row_of[j] - 1] = j - 1
    return column_of
