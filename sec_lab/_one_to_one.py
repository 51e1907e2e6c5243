"""One-to-one choices among candidates: the permutations of corresponding rows (Table 2.2)."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray


def one_to_one(candidates: NDArray[np.bool_]) -> Iterator[list[tuple[int, int]]]:
    """Every one-to-one choice of candidates in which no further row could be added."""
    options = [np.flatnonzero(row).tolist() for row in candidates]
    wanted_later = [set[int]().union(*options[i + 1 :]) for i in range(len(options))]

    def extend(i: int, chosen: list[tuple[int, int]], taken: set[int]) -> Iterator[list[tuple[int, int]]]:
        if i == len(options):
            used = {row for row, _ in chosen}
            if all(row in used or taken.issuperset(options[row]) for row in range(len(options))):
                yield chosen
            return
        for j in options[i]:
            if j not in taken:
                yield from extend(i + 1, [*chosen, (i, j)], taken | {j})
        if all(j in taken or j in wanted_later[i] for j in options[i]):
            yield from extend(i + 1, chosen, taken)

    return extend(0, [], set())
