"""Slow twin of the compiled loops that let a model grow (step 7): one demonstration, one change at a time."""

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]


class NaiveProfile:
    """Rows and columns of a growing model with their counts, as :class:`sec_lab._profile.Profile` keeps them."""

    def __init__(self, codes: NDArray[np.uint8], threshold: float) -> None:
        self.n = 1
        self.width = int(np.ceil(2 / threshold)) if threshold > 0 else None
        self.initial = codes.tolist()
        self.votes = [[[int(code == c) for c in range(4)] for code in row] for row in self.initial]
        self.rows = [[1, 0] for _ in codes]
        self.columns = [[1, 0] for _ in codes.T]

    def shown(self, i: int, x: int) -> int:
        """Most voted code of a place; of a tie the one that was there first, then the smallest."""
        votes, first = self.votes[i][x], self.initial[i][x]
        return max(range(4), key=lambda code: (2 * votes[code] + (code == first), -code))

    def add(self, codes: NDArray[np.uint8], row_of: Integers, column_of: Integers) -> None:
        """Append what is new, then count, then forget."""
        missed = self.n // self.width if self.width else 0
        columns = self._insert_columns(codes.shape[1], column_of.tolist(), missed)
        rows = row_of.tolist()
        new_rows = [j for j in range(len(codes)) if j not in rows]
        for j in new_rows:
            last, row = max(columns[0], 0), []
            for y in columns:
                last = y if y >= 0 else last
                row.append(int(codes[j, last]))
            self.initial.append(row)
            self.votes.append([[0] * 4 for _ in columns])
            self.rows.append([0, missed])
        rows += new_rows
        self.n += 1
        for i, j in enumerate(rows):
            self.rows[i][0] += j >= 0
            for x, y in enumerate(columns):
                if j >= 0 and y >= 0:
                    self.votes[i][x][int(codes[j, y])] += 1
        for x, y in enumerate(columns):
            self.columns[x][0] += y >= 0
        if self.width and self.n % self.width == 0:
            self._forget(self.n // self.width)

    def _insert_columns(self, v: int, column_of: list[int], missed: int) -> list[int]:
        new = [y for y in range(v) if y not in column_of]
        columns = list(column_of)
        known = any(y >= 0 for y in columns)
        for y in new:
            earlier = [x for x, other in enumerate(columns) if 0 <= other < y]
            at = earlier[-1] + 1 if earlier else (0 if known else len(columns))
            # What is held is what the model showed before any of these columns came.
            source = max(at - 1, 0)
            held = [self.shown(i, source) for i in range(len(self.initial))]
            for i, code in enumerate(held):
                self.initial[i].insert(at, code)
                self.votes[i].insert(at, [0] * 4)
            self.columns.insert(at, [0, missed])
            columns.insert(at, y)
        return columns

    def _forget(self, bucket: int) -> None:
        rows = [i for i, (count, missed) in enumerate(self.rows) if count + missed > bucket]
        columns = [x for x, (count, missed) in enumerate(self.columns) if count + missed > bucket]
        if rows and columns:
            self.initial = [[self.initial[i][x] for x in columns] for i in rows]
            self.votes = [[self.votes[i][x] for x in columns] for i in rows]
            self.rows, self.columns = [self.rows[i] for i in rows], [self.columns[x] for x in columns]
