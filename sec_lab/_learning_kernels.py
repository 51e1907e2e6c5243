"""Compiled loops of learning (step 7, §2.9): which rows and columns of a model every demonstration has.

Chains come packed: relations as codes below four, rows that never change left out, chain after chain in flat arrays.
Every function releases the GIL and draws no random number, so results do not depend on the number of threads.
"""

import numpy as np

from sec_lab._assignment_kernels import largest_assignment
from sec_lab._chain_kernels import (
    LANES,
    Codes,
    Counts,
    Flags,
    Integers,
    Numbers,
    compiled,
    fill_lanes,
    mutual_best,
    ordered_columns,
    row_similarity,
)
from sec_lab._pair_kernels import Chains, Pair, room_to_work
from sec_lab._permutation_kernels import best_permutation

N_CODES = 4
MOST_TURNS = 5
"""Turns of rows and columns; noisy chains need two or three."""


@compiled
def pack_changing_rows(
    relations: Codes, n_rows: Integers, n_columns: Integers, codes: Codes, rows: Integers, n_changing: Integers
) -> int:
    """Write the codes and the numbers of the rows that change, chain after chain; returns how many codes there are."""
    source = target = row = 0
    for chain in range(len(n_rows)):
        u = n_columns[chain]
        n = 0
        for i in range(n_rows[chain]):
            changes = False
            for a in range(1, u):
                changes |= relations[source + a] != relations[source]
            if changes:
                for a in range(u):
                    codes[target + a] = min(relations[source + a], N_CODES - 1)
                rows[row] = i
                target += u
                row += 1
                n += 1
            source += u
        n_changing[chain] = n
    return target


@compiled
def align_chains(
    first: int, last: int, model: Codes, strong_rows: Flags, strong_columns: Flags, codes: Codes, code_starts: Integers,
    n_changing: Integers, n_columns: Integers, shorter: int, tolerance: float, effort: int, row_of: Integers,
    column_of: Integers, similarity: Numbers,
) -> None:  # fmt: skip
    """Align chains ``first:last`` with a model, see :func:`align`; one row of each output a chain."""
    for chain in range(first, last):
        k, v = n_changing[chain], n_columns[chain]
        b = codes[code_starts[chain] : code_starts[chain] + k * v].reshape((k, v))
        similarity[chain] = align(
            model, strong_rows, strong_columns, b, shorter, tolerance, effort, row_of[chain], column_of[chain]
        )


@compiled
def align(
    model: Codes, strong_rows: Flags, strong_columns: Flags, b: Codes, shorter: int, tolerance: float, effort: int,
    row_of: Integers, column_of: Integers,
) -> float:  # fmt: skip
    """Find the rows and columns of a model in a chain: partner of each, or −1; returns ψ_temporal in percent.

    The strong rows and columns are compared as in step 5; then rows and columns by turns keep or find the partner with
    which more than half of their entries agree. What is left over is offered to the weak rows and columns.
    """
    rows, columns = np.flatnonzero(strong_rows), np.flatnonzero(strong_columns)
    a = np.empty((len(rows), len(columns)), np.uint8)
    for i in range(len(rows)):
        for x in range(len(columns)):
            a[i, x] = model[rows[i], columns[x]]
    partner, temporal = step_five(a, b, shorter, tolerance, effort)
    settle_by_turns(a, b, partner)
    row_of[:] = -1
    column_of[:] = -1
    taken = np.zeros(len(b), np.bool_)
    for i in range(len(rows)):
        row_of[rows[i]] = partner[i]
        if partner[i] >= 0:
            taken[partner[i]] = True
    align_columns(model, b, row_of, strong_columns, column_of)
    if len(rows) < len(model):
        weak = np.flatnonzero(~strong_rows)
        left = np.flatnonzero(~taken)
        gain = agreement(model, b, weak, left, column_of)
        chosen = largest_assignment(gain)
        for i in range(len(weak)):
            if chosen[i] < len(left) and gain[i, chosen[i]] > 0:
                row_of[weak[i]] = left[chosen[i]]
    return temporal


@compiled
def step_five(a: Codes, b: Codes, shorter: int, tolerance: float, effort: int) -> tuple[Integers, float]:
    """Corresponding rows of two chains as in step 5 (§2.6), the partner of each row of ``a`` or −1; and ψ_temporal."""
    partner = np.full(len(a), -1, np.int64)
    u, v, k = a.shape[1], b.shape[1], len(b)
    changing = np.zeros(len(a), np.bool_)
    for i in range(len(a)):
        for x in range(1, u):
            changing[i] |= a[i, x] != a[i, 0]
    rows = np.flatnonzero(changing)
    m = len(rows)
    if m == 0 or k == 0:
        return partner, 0.0
    codes = np.empty(m * u + k * v, np.uint8)
    for i in range(m):
        for x in range(u):
            codes[i * u + x] = a[rows[i], x]
    for j in range(k):
        for y in range(v):
            codes[m * u + j * v + y] = b[j, y]
    symbols, starts = compress(codes, m, u, k, v)
    first = first_identical(codes, m, u, k, v)
    similarity = np.empty(m * k)
    for j in range(k):
        for i in range(m):
            similarity[j * m + i] = row_similarity(
                symbols[starts[i] : starts[i + 1]], symbols[starts[m + j] : starts[m + j + 1]], shorter
            )
    candidate = np.empty(m * k, np.bool_)
    mutual_best(similarity, m, k, tolerance, candidate, np.empty(m), np.empty(m, np.bool_))
    lanes = np.zeros(k * N_CODES * -(-v // LANES), np.uint64)
    fill_lanes(codes[m * u :], k, v, N_CODES, lanes, 0)
    pair = Pair(0, m * u, 0, 0, m, m, k, u, v, N_CODES)
    assigned = np.empty(m, np.int64)
    total, _ = best_permutation(
        Chains(codes, lanes, first), pair, candidate, effort, assigned, room_to_work(m, k, u, v, N_CODES)
    )
    used = np.zeros(k, np.bool_)
    for i in range(m):
        if assigned[i] >= 0:
            j = assigned[i]
            while used[j] or first[m + j] != assigned[i]:
                j += 1
            used[j] = True
            partner[rows[i]] = j
    return partner, 100.0 * total / min(u, v) / m


@compiled
def compress(codes: Codes, m: int, u: int, k: int, v: int) -> tuple[Codes, Integers]:
    """Changes of each row in their order (ξ_c), and where those of a row begin."""
    symbols = np.empty(len(codes), np.uint8)
    starts = np.zeros(m + k + 1, np.int64)
    at = row_at = 0
    for row in range(m + k):
        n = u if row < m else v
        for x in range(1, n):
            if codes[row_at + x] != codes[row_at + x - 1]:
                symbols[at] = N_CODES * codes[row_at + x - 1] + codes[row_at + x]
                at += 1
        row_at += n
        starts[row + 1] = at
    return symbols, starts


@compiled
def first_identical(codes: Codes, m: int, u: int, k: int, v: int) -> Integers:
    """For each row the first one of the same chain with the same entries, counted within its chain."""
    first = np.empty(m + k, np.int64)
    for chain in range(2):
        n, width = (m, u) if chain == 0 else (k, v)
        base = 0 if chain == 0 else m * u
        for i in range(n):
            first[(0 if chain == 0 else m) + i] = i
            for j in range(i):
                equal = True
                for x in range(width):
                    equal &= codes[base + i * width + x] == codes[base + j * width + x]
                if equal:
                    first[(0 if chain == 0 else m) + i] = j
                    break
    return first


@compiled
def settle_by_turns(a: Codes, b: Codes, partner: Integers) -> None:
    """Columns given the rows, rows given the columns, until the number of equal entries grows no more."""
    every_row, every_other = np.arange(len(a)), np.arange(len(b))
    strong = np.ones(a.shape[1], np.bool_)
    columns = np.empty(a.shape[1], np.int64)
    best = -1
    for _ in range(MOST_TURNS):
        align_columns(a, b, partner, strong, columns)
        gain = agreement(a, b, every_row, every_other, columns)
        chosen = largest_assignment(gain)
        total = 0
        for i in range(len(a)):
            total += gain[i, chosen[i]]
        if total <= best:
            return
        best = total
        for i in range(len(a)):
            partner[i] = chosen[i] if gain[i, chosen[i]] > 0 else -1


@compiled
def align_columns(a: Codes, b: Codes, partner: Integers, strong: Flags, columns: Integers) -> None:
    """Partner of each column, or −1: in their order, and more than half of the corresponding rows agree there.

    Where a strong and a weak column agree equally well, the strong one is taken.
    """
    u, v = a.shape[1], b.shape[1]
    counts: Counts = np.zeros(u * v, np.uint16)
    n = 0
    for i in range(len(a)):
        if partner[i] >= 0:
            n += 1
            for x in range(u):
                for y in range(v):
                    counts[x * v + y] += a[i, x] == b[partner[i], y]
    for x in range(u):
        for y in range(v):
            equal = counts[x * v + y]
            counts[x * v + y] = 2 * equal + strong[x] if 2 * equal > n else 0
    columns[:] = ordered_columns(counts, 0, u, v, v)
    # Of columns of the chain that agree equally well, the first: there the event began.
    free = 0
    for x in range(u):
        if columns[x] >= 0:
            while counts[x * v + free] != counts[x * v + columns[x]]:
                free += 1
            columns[x] = free
            free += 1


@compiled
def agreement(a: Codes, b: Codes, rows: Integers, others: Integers, columns: Integers) -> Integers:
    """Equal entries in aligned columns of each pair of rows, 0 where it is not more than half; padded to be wide."""
    aligned = np.flatnonzero(columns >= 0)
    gain = np.zeros((len(rows), max(len(rows), len(others))), np.int64)
    for i in range(len(rows)):
        for j in range(len(others)):
            equal = 0
            for x in aligned:
                equal += a[rows[i], x] == b[others[j], columns[x]]
            gain[i, j] = equal if 2 * equal > len(aligned) else 0
    return gain


@compiled
def count_votes(
    codes: Codes, code_starts: Integers, n_columns: Integers, row_of: Integers, column_of: Integers, votes: Integers
) -> None:
    """Count for every row and column of the model which code the chains have there."""
    for chain in range(len(row_of)):
        for i in range(row_of.shape[1]):
            if row_of[chain, i] >= 0:
                at = code_starts[chain] + row_of[chain, i] * n_columns[chain]
                for x in range(column_of.shape[1]):
                    if column_of[chain, x] >= 0:
                        votes[i, x, codes[at + column_of[chain, x]]] += 1


@compiled
def segments_of_roles(
    ends: Integers, n_roles: int, pairs: Integers, pair_starts: Integers, row_of: Integers, segments: Integers,
    known: Flags,
) -> None:  # fmt: skip
    """Segment that plays each role in every chain, by counting which label meets which in corresponding rows (§2.8).

    ``ends[i]`` are the two roles of row i of the model, ``row_of`` its row in the chain or −1. A role is known where
    one segment has more votes than any other that is free, and the role more votes than any other has for it.
    """
    n_rows = len(ends)
    labels = np.empty(2 * n_rows, np.int64)
    votes = np.empty((n_roles, 2 * n_rows), np.int64)
    for chain in range(len(row_of)):
        n = 0
        votes[:] = 0
        for i in range(n_rows):
            if row_of[chain, i] < 0:
                continue
            for side in range(2):
                label = pairs[pair_starts[chain] + row_of[chain, i], side]
                at = 0
                while at < n and labels[at] != label:
                    at += 1
                if at == n:
                    labels[n] = label
                    n += 1
                votes[ends[i, 0], at] += 1
                votes[ends[i, 1], at] += 1
        fixed = True
        while fixed:
            fixed = False
            for role in range(n_roles):
                if known[chain, role]:
                    continue
                at = only_best(votes[role, :n])
                if at >= 0 and only_best(votes[:, at]) == role:
                    segments[chain, role] = labels[at]
                    known[chain, role] = True
                    votes[role, :] = 0
                    votes[:, at] = 0
                    fixed = True


@compiled
def only_best(votes: Integers) -> int:
    """Where the largest positive number stands, or −1 if it is not alone."""
    best, at = 0, -1
    for i in range(len(votes)):
        if votes[i] > best:
            best, at = votes[i], i
        elif votes[i] == best:
            at = -1
    return at
