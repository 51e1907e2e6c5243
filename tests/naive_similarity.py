"""Slow, obvious reference of the similarity measure (§2.6): plain Python, exact fractions, every permutation tried.

A chain is a table of relations as lists: one row a segment pair, one entry a key frame. Equations are those of the
thesis; where its text leaves a choice, the reading is the one that :func:`sec_lab.compare` states in its notes.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise, permutations, product

Table = list[list[int]]
Pairs = tuple[tuple[int, int], ...]
"""Corresponding rows, or aligned columns: index in the first table, index in the second."""


@dataclass
class NaiveMatch:
    row_similarity: list[list[Fraction]]
    candidates: list[list[bool]]
    spatial: Fraction
    temporal: Fraction
    best: list[Pairs]
    """All assignments of rows that reach ``temporal``; rows are counted among the changing ones."""
    n_assignments: int


def naive_compare(
    a: Table,
    b: Table,
    *,
    normalizer: str = "longer",
    tolerance_percent: float = 0,
    temporal_input: str = "original",
    partial: bool = True,
) -> NaiveMatch:
    """Both steps; ``partial=False`` leaves out assignments to which a pair could be added, which never agree better."""
    rows_a, rows_b = naive_changing_rows(a), naive_changing_rows(b)
    changes_a, changes_b = [compressed(row) for row in rows_a], [compressed(row) for row in rows_b]
    similarity = [[naive_row_similarity(x, y, normalizer=normalizer) for y in changes_b] for x in changes_a]
    candidates = naive_candidates(similarity, tolerance_percent=tolerance_percent)
    chosen = [(i, j) for i, fits in enumerate(candidates) for j in indices(fits)]
    tables = agreements(rows_a, rows_b, chosen, temporal_input=temporal_input)
    n_columns = tuple(len(rows[0]) - (temporal_input == "derived") for rows in (rows_a, rows_b))
    best_value, best, n_assignments = Fraction(-1), [], 0
    for pairs in naive_assignments(candidates, partial=partial):
        n_assignments += 1
        value = temporal_of(pairs, tables, n_rows=len(rows_a), n_columns=n_columns)
        if value > best_value:
            best_value, best = value, []
        if value == best_value:
            best.append(pairs)
    spatial = naive_spatial(similarity, candidates)
    return NaiveMatch(similarity, candidates, spatial, best_value, best, n_assignments)


def naive_changing_rows(table: Table) -> Table:
    """Rows in which something happens (§2.5)."""
    return [row for row in table if len(set(row)) > 1]


def derived(row: list[int]) -> list[int]:
    """Row of ξ_d: two digits, before and after (§2.5)."""
    return [10 * before + after for before, after in pairwise(row)]


def compressed(row: list[int]) -> list[int]:
    """Row of ξ_c: ξ_d without 00, 11, 22 and 99 (§2.5)."""
    return [change for change in derived(row) if change not in (0, 11, 22, 99)]


def naive_row_similarity(a: list[int], b: list[int], *, normalizer: str) -> Fraction:
    """M of Eq. 2.2 and 2.3: the shorter row is shifted along the longer one."""
    if len(a) > len(b):
        return naive_row_similarity(b, a, normalizer=normalizer)
    gamma = {"longer": len(b), "shorter": len(a)}[normalizer]
    equal = []
    for shift in range(len(b) - len(a) + 1):
        window = b[shift : shift + len(a)]
        equal.append(sum(x == y for x, y in zip(a, window, strict=True)))
    return Fraction(100 * max(equal), gamma)


def naive_candidates(similarity: list[list[Fraction]], *, tolerance_percent: float) -> list[list[bool]]:
    """Mutually best pairs (Eq. 2.5): up to the tolerance the largest of their row and of their column, and above 0."""
    tolerance = Fraction(tolerance_percent).limit_denominator(10**6)  # 100 / 3 is meant as written, not as rounded
    columns = list(zip(*similarity, strict=True))
    best_rows, best_columns = [max(row) for row in similarity], [max(column) for column in columns]
    return [
        [s > 0 and best_rows[i] - s <= tolerance and best_columns[j] - s <= tolerance for j, s in enumerate(row)]
        for i, row in enumerate(similarity)
    ]


def naive_spatial(similarity: list[list[Fraction]], candidates: list[list[bool]]) -> Fraction:
    """Eq. 2.4: maxima of the rows that have a mutually best pair, over the number of all rows."""
    counted = [max(row) for row, fits in zip(similarity, candidates, strict=True) if any(fits)]
    return Fraction(sum(counted), len(similarity))


def naive_assignments(candidates: list[list[bool]], *, partial: bool = True) -> Iterator[Pairs]:
    """All one-to-one choices of candidates, or only those that no pair can be added to."""
    rows = range(len(candidates))
    # A row that is the only one to want some candidate need not stay alone: that candidate is always free.
    may_stay_alone = [
        partial or all(any(candidates[t][j] for t in rows if t != i) for j in indices(candidates[i])) for i in rows
    ]
    for pairs in _choices(candidates, may_stay_alone, 0, ()):
        if partial or not any(addable(i, j, pairs) for i in rows for j in indices(candidates[i])):
            yield pairs


def _choices(candidates: list[list[bool]], may_stay_alone: list[bool], i: int, chosen: Pairs) -> Iterator[Pairs]:
    if i == len(candidates):
        yield chosen
        return
    if may_stay_alone[i]:
        yield from _choices(candidates, may_stay_alone, i + 1, chosen)
    for j in indices(candidates[i]):
        if addable(i, j, chosen):
            yield from _choices(candidates, may_stay_alone, i + 1, (*chosen, (i, j)))


def addable(i: int, j: int, pairs: Pairs) -> bool:
    return all(i != row and j != partner for row, partner in pairs)


def indices(fits: list[bool]) -> list[int]:
    return [j for j, fit in enumerate(fits) if fit]


def agreements(
    rows_a: Table, rows_b: Table, pairs: Iterable[tuple[int, int]], *, temporal_input: str
) -> dict[tuple[int, int], Table]:
    """δ of Eq. 2.8 for pairs of rows: a table over their columns."""
    if temporal_input == "derived":
        rows_a, rows_b = [derived(row) for row in rows_a], [derived(row) for row in rows_b]
    return {(i, j): [[int(x == y) for y in rows_b[j]] for x in rows_a[i]] for i, j in pairs}


def temporal_of(
    pairs: Pairs, tables: dict[tuple[int, int], Table], *, n_rows: int, n_columns: tuple[int, ...]
) -> Fraction:
    """ψ_temporal of one permutation (Eq. 2.7, 2.9): dummy rows make q the number of rows of the first chain."""
    u, v = n_columns
    equal = [[sum(tables[pair][x][y] for pair in pairs) for y in range(v)] for x in range(u)]
    return Fraction(100 * ordered_sum(equal), n_rows * min(u, v))


def ordered_sum(weights: Table) -> int:
    """Largest sum over pairs of columns in the same order in both chains, each column at most once (LCS)."""
    u, v = len(weights), len(weights[0])
    best = [[0] * (v + 1) for _ in range(u + 1)]
    for x in range(u):
        for y in range(v):
            best[x + 1][y + 1] = max(best[x][y] + weights[x][y], best[x][y + 1], best[x + 1][y])
    return best[u][v]


def all_permutations_similarity(a: Table, b: Table, *, temporal_input: str = "original") -> tuple[Fraction, int]:
    """ψ_temporal without the spatial step (last paragraph of §2.6.2): any row may correspond to any other.

    Returns the best value and the number of permutations that were tried: n! for two chains of n changing rows.
    """
    rows_a, rows_b = naive_changing_rows(a), naive_changing_rows(b)
    m, k = len(rows_a), len(rows_b)
    tables = agreements(rows_a, rows_b, product(range(m), range(k)), temporal_input=temporal_input)
    n_columns = tuple(len(rows[0]) - (temporal_input == "derived") for rows in (rows_a, rows_b))
    if m <= k:
        tried = [tuple(zip(range(m), chosen, strict=True)) for chosen in permutations(range(k), m)]
    else:
        tried = [tuple(zip(chosen, range(k), strict=True)) for chosen in permutations(range(m), k)]
    return max(temporal_of(pairs, tables, n_rows=m, n_columns=n_columns) for pairs in tried), len(tried)
