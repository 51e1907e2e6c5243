"""Compiled search for the permutation of rows with the largest temporal similarity (§2.6.2)."""

import numpy as np

from sec_lab._assignment_kernels import equal_entries, largest_assignment
from sec_lab._chain_kernels import LANES, Flags, Integers, add_tables, compiled, ordered_columns
from sec_lab._pair_kernels import (
    CHOICE,
    CHOSEN,
    DEMAND,
    FREE,
    MAY_STAY_ALONE,
    N_OPTIONS,
    OPTIONS,
    ROOM,
    TRIAL,
    Chains,
    Pair,
    Scratch,
    add_pair,
    bound_of_open_rows,
    table_value,
)

NOTHING = np.uint8(255)
"""A code that no entry has."""

FEW = 16
"""Up to this many permutations all are looked at; above, a bound saves more than it costs."""


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
        best, exact = -1, True
        node_limit = effort // (pair.u * pair.v)
        # Where the search may be cut short it begins with a good permutation; where not, that would cost more than it.
        if n_permutations > node_limit:
            best = search_by_turns(chains, pair, candidate, n_free, bound, scratch)
        if best < bound:
            best, exact = branch_and_bound(chains, pair, n_free, best, bound, node_limit, scratch)
    for d in range(n_free):
        assigned[scratch.work[FREE, d]] = scratch.work[CHOSEN, d]
    return best, exact


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
