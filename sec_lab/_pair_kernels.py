"""Two chains before the search for their best permutation: where they lie, room to work in, and the bound."""

from typing import NamedTuple

import numpy as np

from sec_lab._chain_kernels import (
    LANES,
    Codes,
    Counts,
    Integers,
    Words,
    add_row,
    add_tables,
    compiled,
    ordered_columns_value,
)


class Chains(NamedTuple):
    """The flat arrays of all chains.

    Attributes
    ----------
    codes : flat uint8
        Entries of the changing rows, row by row.
    lanes : flat uint64
        Lanes of all rows for all codes.
    first : flat int64
        For each row the first row of its chain with the same entries, because identical rows are interchangeable.
    """

    codes: Codes
    lanes: Words
    first: Integers


class Pair(NamedTuple):
    """Where two chains lie in the arrays of :class:`Chains`: ξ¹ with m rows and u columns, ξ² with k and v.

    Attributes
    ----------
    code_a, code_b, lane_b, row_a, row_b : int
        Where they begin in ``codes``, ``lanes`` and ``first``.
    m, k, u, v : int
    n_codes : int
        Number of codes, each of which has its lanes.
    """

    code_a: int
    code_b: int
    lane_b: int
    row_a: int
    row_b: int
    m: int
    k: int
    u: int
    v: int
    n_codes: int


# Rows of Scratch.work. Classes are those of identical rows of ξ², counted at their first row; rows those of ξ¹.
ROOM = 0  # free places in each class
DEMAND = 1  # rows that could take a place in each class
N_OPTIONS = 2  # number of classes that each row may correspond to
FREE = 3  # open rows in the order of branching
MAY_STAY_ALONE = 4  # whether it can pay to leave the d-th open row without a partner
CHOSEN = 5  # class of the d-th open row in the best permutation so far
TRIAL = 6  # the same in the one that is tried
CHOICE = 7  # how far the d-th open row has come in its options
BEST_SUMS = 8  # for the alignment of columns
COMPONENT = 9  # number of the component that the d-th open row belongs to
CLASS_COMPONENT = 10  # the same of each class, or −1
COMPLETE = 11  # whether all rows of a component may correspond to all its classes
OPTIONS = 12  # from here on: classes that the d-th open row may correspond to


class Scratch(NamedTuple):
    """Room to work in; few arrays, because each costs time in every call.

    Attributes
    ----------
    work : (12 + m, …) int64
        Rows as named above.
    table, counts : the same memory as flat uint64 and as flat uint16
        Tables of u · ⌈v / 4⌉ words of lanes, each given by where it begins. The first holds what settled rows have, the
        second what is weighed; then come n_free + 1 of what open rows could reach and as many of what the chosen have;
        behind all tables there is room for :func:`bound_of_open_rows`.
    """

    work: Integers
    table: Words
    counts: Counts


@compiled
def room_to_work(m: int, k: int, u: int, v: int, n_codes: int) -> Scratch:
    """Scratch arrays for :func:`best_permutation` on chains of up to m rows, u columns and k rows, v columns."""
    n_words = -(-v // LANES)
    tables, places, rows = (2 * m + 6) * u * n_words, m * n_codes * n_words, -(-m * n_codes * u // LANES)
    table = np.empty(tables + places + rows, np.uint64)
    return Scratch(np.empty((OPTIONS + m, max(m, k, v + 1)), np.int64), table, table.view(np.uint16))


@compiled
def table_value(pair: Pair, table: int, scratch: Scratch) -> int:
    """Sum of a table over its best ordered alignment of columns."""
    stride = LANES * -(-pair.v // LANES)
    return ordered_columns_value(scratch.counts, LANES * table, pair.u, pair.v, stride, scratch.work[BEST_SUMS])


@compiled
def add_pair(chains: Chains, pair: Pair, i: int, j: int, table: int, scratch: Scratch) -> None:
    """Count the equal entries of row i of ξ¹ and row j of ξ² into a table."""
    n_words = -(-pair.v // LANES)
    row_a = pair.code_a + i * pair.u
    row_b = pair.lane_b + j * pair.n_codes * n_words
    add_row(chains.codes, row_a, pair.u, chains.lanes, row_b, n_words, scratch.table, table)


@compiled
def bound_of_open_rows(chains: Chains, pair: Pair, n_free: int, scratch: Scratch) -> int:
    """What no permutation can exceed, pair of columns by pair of columns.

    Where all open rows of a component may correspond to all its classes, no more of them can have a certain entry in
    common than either chain has in these two columns. In other components every row gives what any option could give.
    Table 2 + d holds this for the open rows from d on, table 1 the sum that was weighed.
    """
    u, n_codes = pair.u, pair.n_codes
    n_words = -(-pair.v // LANES)
    size, stride = u * n_words, LANES * n_words
    table, counts, work = scratch.table, scratch.counts, scratch.work
    n_components = find_components(pair, n_free, scratch)
    places = (2 * pair.m + 6) * size  # entries of each code in each column of ξ², for every component
    rows = LANES * (places + n_components * n_codes * n_words)  # the same of the open rows of ξ¹
    for w in range(n_components * n_codes * n_words):
        table[places + w] = 0
    for at in range(n_components * n_codes * u):
        counts[rows + at] = 0
    for j in range(pair.k):
        if work[CLASS_COMPONENT, j] >= 0:
            here = places + work[CLASS_COMPONENT, j] * n_codes * n_words
            lanes = pair.lane_b + j * n_codes * n_words
            for w in range(n_codes * n_words):
                table[here + w] += chains.lanes[lanes + w] * np.uint64(work[ROOM, j])
    for w in range(size):
        table[(2 + n_free) * size + w] = 0
    for d in range(n_free - 1, -1, -1):
        i = work[FREE, d]
        component = work[COMPONENT, d]
        for a in range(u):
            code = np.int64(chains.codes[pair.code_a + i * u + a])
            this = (2 + d) * size + a * n_words
            if work[COMPLETE, component]:
                at = rows + (component * n_codes + code) * u + a
                counts[at] += 1
                n_rows = counts[at]
                n_places = LANES * (places + (component * n_codes + code) * n_words)
                for b in range(stride):
                    counts[LANES * this + b] = counts[LANES * (this + size) + b] + (counts[n_places + b] >= n_rows)
            else:
                pattern = pair.lane_b + code * n_words
                for w in range(n_words):
                    any_option = np.uint64(0)
                    for at in range(work[N_OPTIONS, i]):
                        any_option |= chains.lanes[pattern + work[OPTIONS + d, at] * n_codes * n_words + w]
                    table[this + w] = table[this + size + w] + any_option
    add_tables(table, 0, 2 * size, size, size)
    return table_value(pair, size, scratch)


@compiled
def find_components(pair: Pair, n_free: int, scratch: Scratch) -> int:
    """Number the parts of the open rows that have no options in common, and mark the complete ones."""
    work = scratch.work
    for j in range(pair.k):
        work[CLASS_COMPONENT, j] = -1
    n_components = 0
    for d in range(n_free):
        n = work[N_OPTIONS, work[FREE, d]]
        component = n_components
        for at in range(n):
            other = work[CLASS_COMPONENT, work[OPTIONS + d, at]]
            if other >= 0 and other != component:
                if component == n_components:
                    component = other
                else:
                    for j in range(pair.k):
                        if work[CLASS_COMPONENT, j] == other:
                            work[CLASS_COMPONENT, j] = component
                    for e in range(d):
                        if work[COMPONENT, e] == other:
                            work[COMPONENT, e] = component
        n_components += component == n_components
        work[COMPONENT, d] = component
        for at in range(n):
            work[CLASS_COMPONENT, work[OPTIONS + d, at]] = component
    for component in range(n_components):
        n_classes = 0
        for j in range(pair.k):
            n_classes += work[CLASS_COMPONENT, j] == component
        work[COMPLETE, component] = True
        for d in range(n_free):
            if work[COMPONENT, d] == component and work[N_OPTIONS, work[FREE, d]] != n_classes:
                work[COMPLETE, component] = False
    return n_components
