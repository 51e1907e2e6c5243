"""How similar two role tables are, with nothing that would have to be fitted."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from sec_lab.role_tables.table import RoleTable, as_role_table

if TYPE_CHECKING:
    import pandas as pd

Compressed = Literal["changes", "relations"]
Symbols = tuple[int, ...]

# Beginning and end of a row, as symbols beside 0, 2 and 9.
_BEGIN, _END = 3, 4


def role_similarity(a: RoleTable, b: RoleTable, *, compressed: Compressed = "changes") -> float:
    """Similarity of two role tables in percent, 100 for equal ones; symmetric.

    Each row is compressed, so that only the order of what happens counts and not how long it lasts. Two rows a and b of
    the same roles are 2 · LCS(a, b) / (|a| + |b|) alike, where LCS is the length of the longest common subsequence;
    tables are as alike as their ten rows (five relations, five presences) on average.

    Parameters
    ----------
    a, b : RoleTable
    compressed : {"changes", "relations"}, optional
        What a compressed row lists: the changes in their order, as in ξ_c (§2.5), with how the row begins and ends as
        the first and the last of them (default); or the relations themselves, each run once. With relations, 2 0
        (lifted off) and 0 2 0 (touched and left) are alike by 80 %, with changes by 57 %.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If one of them is no role table, or the way of compression is unknown.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.table import role_table
    >>> lift = role_table(EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [2, 2, 2, 0, 0]], [(7, 1), (7, 2), (2, 1)]))
    >>> drop = role_table(EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [0, 0, 0, 2, 2]], [(7, 1), (7, 2), (2, 1)]))
    >>> role_similarity(lift, lift), role_similarity(lift, drop), role_similarity(lift, drop, compressed="relations")
    (100.0, 90.0, 95.0)
    """
    rows_a, rows_b = compressed_rows(a, compressed=compressed), compressed_rows(b, compressed=compressed)
    return 100.0 * float(np.mean([row_similarity(x, y) for x, y in zip(rows_a, rows_b, strict=True)]))


def role_similarity_table(
    tables: Sequence[RoleTable] | Mapping[str, RoleTable], *, compressed: Compressed = "changes"
) -> "pd.DataFrame":
    """Similarities of all role tables with each other in percent, see :func:`role_similarity`.

    Parameters
    ----------
    tables : sequence of n RoleTable, or mapping of names to them
    compressed : {"changes", "relations"}, optional

    Returns
    -------
    pandas.DataFrame
        (n, n) float64, symmetric.

    Raises
    ------
    ValueError
        If there is no table, or the way of compression is unknown.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.table import role_table
    >>> one = role_table(EventChain([[9, 0, 2, 0, 9], [9, 0, 0, 0, 9], [0, 0, 0, 0, 0]], [(7, 1), (7, 2), (2, 1)]))
    >>> role_similarity_table({"one": one, "again": one})
             one  again
    one    100.0  100.0
    again  100.0  100.0
    """
    import pandas as pd

    names = list(tables) if isinstance(tables, Mapping) else list(range(len(tables)))
    values = list(tables.values()) if isinstance(tables, Mapping) else list(tables)
    if not values:
        raise ValueError("tables: expected at least one role table, got none")
    rows = [compressed_rows(table, compressed=compressed) for table in values]
    # Few rows are different: each pair of different ones is compared once.
    kinds = {row: i for i, row in enumerate(dict.fromkeys(row for table in rows for row in table))}
    alike = np.array([[row_similarity(min(x, y), max(x, y)) for y in kinds] for x in kinds])
    at = np.array([[kinds[row] for row in table] for table in rows])
    similar = np.mean([alike[np.ix_(column, column)] for column in at.T], axis=0)
    frame = pd.DataFrame(100.0 * similar, index=names, columns=names)
    frame.attrs = {"measure": "role tables", "compressed": compressed}
    return frame


def compressed_rows(table: RoleTable, *, compressed: Compressed = "changes") -> tuple[Symbols, ...]:
    """The ten rows of a role table without time, see :func:`role_similarity`.

    Parameters
    ----------
    table : RoleTable
    compressed : {"changes", "relations"}, optional

    Returns
    -------
    tuple of 10 tuples of int
        Relations; or changes as numbers of two digits, 3 being the beginning and 4 the end.

    Raises
    ------
    ValueError
        If it is no role table, or the way of compression is unknown.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.table import role_table
    >>> seen = role_table(EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [2, 2, 2, 0, 0]], [(7, 1), (7, 2), (2, 1)]))
    >>> compressed_rows(seen)[:2], compressed_rows(seen, compressed="relations")[:2]
    (((39, 90, 2, 29, 94), (32, 20, 4)), ((9, 0, 2, 9), (2, 0)))
    """
    as_role_table(table)
    if compressed not in get_args(Compressed):
        raise ValueError(f"compressed: expected one of {get_args(Compressed)}, got {compressed!r}")
    found = []
    for row in table.rows:
        runs = row[np.append(True, row[1:] != row[:-1])].tolist()
        if compressed == "changes":
            steps = [_BEGIN, *runs, _END]
            runs = [10 * before + after for before, after in pairwise(steps)]
        found.append(tuple(runs))
    return tuple(found)


@lru_cache(maxsize=1 << 16)
def row_similarity(a: Symbols, b: Symbols) -> float:
    """2 · LCS(a, b) / (|a| + |b|) of two compressed rows, 0 to 1.

    Examples
    --------
    >>> row_similarity((2, 0), (0, 2, 0))
    0.8
    """
    return 2.0 * common_subsequence(a, b) / (len(a) + len(b))


def common_subsequence(a: Symbols, b: Symbols) -> int:
    """Length of the longest common subsequence of two sequences.

    Examples
    --------
    >>> common_subsequence((9, 0, 2, 0, 9), (9, 2, 9, 0))
    3
    """
    longest = [0] * (len(b) + 1)
    for symbol in a:
        diagonal = 0
        for j, other in enumerate(b):
            above = longest[j + 1]
            longest[j + 1] = diagonal + 1 if symbol == other else max(above, longest[j])
            diagonal = above
    return longest[-1]
