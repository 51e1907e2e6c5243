"""Compiled search for the permutation of rows with the largest temporal similarity (§2.6.2)."""

from typing import NamedTuple

import numpy as np

from sec_lab._chain_kernels import (
    LANES,
    Codes,
    Counts,
    Flags,
    Integers,
    Words,
    add_row,
    add_tables,
    compiled,
    ordered_columns,
    ordered_columns_value,
)

NOTHING = np.uint8(255)
"""A code that no entry has."""

FEW = 16
"""Up to this many permutations all are looked at; above, a bound saves more than it costs."""


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
def best_permutation(
    chains: Chains, pair: Pair, candidate: Flags, effort: int, assigned: Integers, scratch: Scratch
) -> tuple[int, bool]:
    """The permutation with the largest temporal similarity: sum of equal entries over aligned columns, and proof.

    Parameters
    ----------
    chains, pair
        The chains and where the two of them are.
    candidate : at least m · k bool
        ``candidate[i · k + j]``: rows i and j may correspond; equal for identical rows.
    effort : int
        How many pairs of columns may be looked at in search of a better permutation.
    assigned : (m,) int64, output
        Class of identical rows (its first row) of ξ² that each row of ξ¹ corresponds to, or −1.
    scratch : Scratch
        Of :func:`room_to_work`, for chains at least as large.

    Returns
    -------
    (int, bool)
        The sum, and whether no permutation of candidates can exceed it.
    """
    n_free = settle_rows(chains, pair, candidate, assigned, scratch)
    if n_free == 0:
        return table_value(pair, 0, scratch), True
    n_permutations = list_options(chains, pair, candidate, n_free, scratch)
    for i in range(pair.m):
        if assigned[i] >= 0:
            scratch.work[ROOM, assigned[i]] -= 1
    if n_permutations <= FEW:
        best, exact = best_of_few(chains, pair, n_free, scratch), True
    else:
        bound = bound_of_open_rows(chains, pair, n_free, scratch)
        best, exact = search_by_turns(chains, pair, candidate, n_free, bound, scratch), True
        if best < bound:
            node_limit = effort // (pair.u * pair.v)
            best, exact = branch_and_bound(chains, pair, n_free, best, bound, node_limit, scratch)
    for d in range(n_free):
        assigned[scratch.work[FREE, d]] = scratch.work[CHOSEN, d]
    return best, exact


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
def settle_rows(chains: Chains, pair: Pair, candidate: Flags, assigned: Integers, scratch: Scratch) -> int:
    """Assign the rows without a choice (table 0) and list the open ones; returns how many are open.

    Open rows are sorted for branching: few options first, identical rows side by side.
    """
    m, k = pair.m, pair.k
    for j in range(k):
        scratch.work[ROOM, j] = 0
        scratch.work[DEMAND, j] = 0
    for j in range(k):
        scratch.work[ROOM, chains.first[pair.row_b + j]] += 1
    for w in range(pair.u * -(-pair.v // LANES)):
        scratch.table[w] = 0
    for i in range(m):
        assigned[i] = -1
        n = 0
        only = -1
        for j in range(k):
            takes = candidate[i * k + j] & (chains.first[pair.row_b + j] == j)
            n += takes
            scratch.work[DEMAND, j] += takes
            only = j if takes else only
        scratch.work[N_OPTIONS, i] = n
        scratch.work[CHOICE, i] = only
    n_free = 0
    for i in range(m):
        n = scratch.work[N_OPTIONS, i]
        if n == 1:
            only = scratch.work[CHOICE, i]
            if scratch.work[DEMAND, only] <= scratch.work[ROOM, only]:
                assigned[i] = only
                add_pair(chains, pair, i, only, 0, scratch)
        if n == 0 or assigned[i] >= 0:
            continue
        at = n_free
        while at > 0:
            before = scratch.work[FREE, at - 1]
            n_before = scratch.work[N_OPTIONS, before]
            in_order = chains.first[pair.row_a + before] <= chains.first[pair.row_a + i]
            if n_before < n or (n_before == n and in_order):
                break
            scratch.work[FREE, at] = before
            at -= 1
        scratch.work[FREE, at] = i
        n_free += 1
    return n_free


@compiled
def list_options(chains: Chains, pair: Pair, candidate: Flags, n_free: int, scratch: Scratch) -> float:
    """List the options of the open rows; returns the number of permutations if none excluded another.

    A row with an option that nobody can take away need not be tried without a partner.
    """
    k = pair.k
    n_permutations = 1.0
    for d in range(n_free):
        i = scratch.work[FREE, d]
        at = 0
        alone = True
        for j in range(k):
            if candidate[i * k + j] and chains.first[pair.row_b + j] == j:
                scratch.work[OPTIONS + d, at] = j
                at += 1
                alone &= scratch.work[DEMAND, j] > scratch.work[ROOM, j]
        scratch.work[MAY_STAY_ALONE, d] = alone
        scratch.work[CHOSEN, d] = -1
        n_permutations *= at + alone
    return n_permutations


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


@compiled
def branch_and_bound(
    chains: Chains, pair: Pair, n_free: int, best: int, bound: int, node_limit: int, scratch: Scratch
) -> tuple[int, bool]:
    """Improve on the best sum depth first; returns it and whether the search was complete."""
    size = pair.u * -(-pair.v // LANES)
    table = scratch.table
    reachable, so_far = 2 * size, (3 + n_free) * size
    for w in range(size):
        table[so_far + w] = table[w]
    nodes = 0
    d = 0
    scratch.work[CHOICE, 0] = -1
    scratch.work[TRIAL, 0] = -1
    while d >= 0:
        if not take_next_option(chains, pair, d, scratch):
            d -= 1
            continue
        if nodes >= node_limit:
            return best, False
        nodes += 1
        after = so_far + (d + 1) * size
        add_choice(chains, pair, d, after, scratch)
        add_tables(table, after, reachable + (d + 1) * size, size, size)
        value = table_value(pair, size, scratch)
        if value <= best:
            continue
        if d + 1 == n_free:
            best = value
            for e in range(n_free):
                scratch.work[CHOSEN, e] = scratch.work[TRIAL, e]
            if best == bound:
                return best, True
        else:
            d += 1
            scratch.work[CHOICE, d] = -1
            scratch.work[TRIAL, d] = -1
    return best, True


@compiled
def best_of_few(chains: Chains, pair: Pair, n_free: int, scratch: Scratch) -> int:
    """Look at every permutation; returns the best sum."""
    size = pair.u * -(-pair.v // LANES)
    table = scratch.table
    so_far = 2 * size
    for w in range(size):
        table[so_far + w] = table[w]
    best = -1
    d = 0
    scratch.work[CHOICE, 0] = -1
    scratch.work[TRIAL, 0] = -1
    while d >= 0:
        if not take_next_option(chains, pair, d, scratch):
            d -= 1
            continue
        after = so_far + (d + 1) * size
        add_choice(chains, pair, d, after, scratch)
        if d + 1 < n_free:
            d += 1
            scratch.work[CHOICE, d] = -1
            scratch.work[TRIAL, d] = -1
        elif not needlessly_alone(n_free, scratch):
            value = table_value(pair, after, scratch)
            if value > best:
                best = value
                for e in range(n_free):
                    scratch.work[CHOSEN, e] = scratch.work[TRIAL, e]
    return best


@compiled
def take_next_option(chains: Chains, pair: Pair, d: int, scratch: Scratch) -> bool:
    """Let the d-th open row give back what it took and take its next option; False when it has no more.

    The last option of a row is to stay alone, where that can pay.
    """
    i = scratch.work[FREE, d]
    if scratch.work[TRIAL, d] >= 0:
        scratch.work[ROOM, scratch.work[TRIAL, d]] += 1
        scratch.work[TRIAL, d] = -1
    at = scratch.work[CHOICE, d] + 1
    # Identical rows take their options in ascending order, so no permutation is seen twice.
    if at == 0 and d > 0 and chains.first[pair.row_a + scratch.work[FREE, d - 1]] == chains.first[pair.row_a + i]:
        at = scratch.work[CHOICE, d - 1]
    n = scratch.work[N_OPTIONS, i]
    while at < n and scratch.work[ROOM, scratch.work[OPTIONS + d, at]] == 0:
        at += 1
    scratch.work[CHOICE, d] = at
    if at < n:
        scratch.work[TRIAL, d] = scratch.work[OPTIONS + d, at]
        scratch.work[ROOM, scratch.work[TRIAL, d]] -= 1
        return True
    return at == n and scratch.work[MAY_STAY_ALONE, d] != 0


@compiled
def add_choice(chains: Chains, pair: Pair, d: int, after: int, scratch: Scratch) -> None:
    """Write the table that lies before ``after``, with what the d-th open row took added."""
    size = pair.u * -(-pair.v // LANES)
    for w in range(size):
        scratch.table[after + w] = scratch.table[after - size + w]
    if scratch.work[TRIAL, d] >= 0:
        add_pair(chains, pair, scratch.work[FREE, d], scratch.work[TRIAL, d], after, scratch)


@compiled
def needlessly_alone(n_free: int, scratch: Scratch) -> bool:
    """Whether an open row has no partner although one of its options is left over."""
    for d in range(n_free):
        if scratch.work[TRIAL, d] < 0:
            for at in range(scratch.work[N_OPTIONS, scratch.work[FREE, d]]):
                if scratch.work[ROOM, scratch.work[OPTIONS + d, at]] > 0:
                    return True
    return False


@compiled
def search_by_turns(chains: Chains, pair: Pair, candidate: Flags, n_free: int, bound: int, scratch: Scratch) -> int:
    """A good permutation to begin with, from two column alignments: that of the bound, and an even one."""
    u, v = pair.u, pair.v
    size = u * -(-v // LANES)
    best = -1
    partner = ordered_columns(scratch.counts, LANES * size, u, v, LANES * -(-v // LANES))
    for start in range(2):
        if start == 1:
            for a in range(u):
                partner[a] = a * v // u if u <= v else (a if a < v else -1)
        value = improve_by_turns(chains, pair, candidate, n_free, partner, scratch)
        if value > best:
            best = value
            for d in range(n_free):
                scratch.work[CHOSEN, d] = scratch.work[TRIAL, d]
        if best == bound:
            break
    return best


@compiled
def improve_by_turns(
    chains: Chains, pair: Pair, candidate: Flags, n_free: int, partner: Integers, scratch: Scratch
) -> int:
    """Rows given the columns, columns given the rows, until neither improves; returns the sum, fills ``trial``.

    ``partner`` is the column alignment to start from.
    """
    k, u, v = pair.k, pair.u, pair.v
    n_words = -(-v // LANES)
    size = u * n_words
    trial_table = (3 + n_free) * size
    places = 0
    for j in range(k):
        places += min(scratch.work[ROOM, j], n_free)
    class_of_place = np.full(max(places, n_free), -1, np.int64)
    at = 0
    for j in range(k):
        for _ in range(min(scratch.work[ROOM, j], n_free)):
            class_of_place[at] = j
            at += 1
    gain = np.zeros((n_free, len(class_of_place)), np.int64)
    aligned = np.empty(u, np.uint8)
    best = -1
    for _ in range(20):
        for p in range(places):
            j = class_of_place[p]
            if p > 0 and j == class_of_place[p - 1]:
                gain[:, p] = gain[:, p - 1]
                continue
            for a in range(u):
                aligned[a] = chains.codes[pair.code_b + j * v + partner[a]] if partner[a] >= 0 else NOTHING
            for d in range(n_free):
                i = scratch.work[FREE, d]
                gain[d, p] = equal_entries(chains.codes[pair.code_a + i * u :], aligned) if candidate[i * k + j] else 0
        place = largest_assignment(gain)
        for w in range(size):
            scratch.table[trial_table + w] = scratch.table[w]
        for d in range(n_free):
            j = class_of_place[place[d]]
            if j >= 0 and candidate[scratch.work[FREE, d] * k + j]:
                add_pair(chains, pair, scratch.work[FREE, d], j, trial_table, scratch)
        value = table_value(pair, trial_table, scratch)
        if value <= best:
            break
        best = value
        for d in range(n_free):
            j = class_of_place[place[d]]
            scratch.work[TRIAL, d] = j if j >= 0 and candidate[scratch.work[FREE, d] * k + j] else -1
        partner = ordered_columns(scratch.counts, LANES * trial_table, u, v, LANES * n_words)
    return best


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
