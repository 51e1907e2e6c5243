"""Compiled loops over a model that grows while it learns (step 7, §2.9); :mod:`sec_lab._profile` says what they count.

Every function releases the GIL and draws no random number, so results do not depend on the number of threads.
"""

import numpy as np

from sec_lab._chain_kernels import Codes, Flags, Integers, compiled
from sec_lab._learning_kernels import N_CODES, align

LEAST_COUNT = 2
ROUNDING = 1e-9

State = tuple[Integers, Codes, Integers, Integers, Integers, Integers]
"""Votes, initial codes; counts of rows, and how many each may have missed; the same of columns."""


@compiled
def often(counts: Integers, n: int, threshold: float) -> Flags:
    """Rows or columns that enough of n demonstrations have."""
    enough = np.empty(len(counts), np.bool_)
    for i in range(len(counts)):
        enough[i] = counts[i] >= threshold * n - ROUNDING and counts[i] >= min(LEAST_COUNT, n)
    return enough


@compiled
def most_voted(votes: Integers, initial: Codes) -> Codes:
    """Code with most votes in every place; of a tie, and where nobody voted, the one that was there first."""
    codes = np.empty(initial.shape, np.uint8)
    for i in range(initial.shape[0]):
        for x in range(initial.shape[1]):
            best = -1
            for code in range(N_CODES):
                vote = 2 * votes[i, x, code] + (code == initial[i, x])
                if vote > best:
                    best = vote
                    codes[i, x] = code
    return codes


@compiled
def grow(
    state: State, n: int, order: Integers, codes: Codes, code_starts: Integers, n_changing: Integers,
    n_columns: Integers, threshold: float, shorter: int, tolerance: float, effort: int,
) -> State:  # fmt: skip
    """Align the chains of ``order``, one after the other, with what n demonstrations have left, and add each to it."""
    for chain in order:
        k, v = n_changing[chain], n_columns[chain]
        b = codes[code_starts[chain] : code_starts[chain] + k * v].reshape((k, v))
        votes, initial, row_counts, _, column_counts, _ = state
        rows, columns = np.empty(len(row_counts), np.int64), np.empty(len(column_counts), np.int64)
        align(
            most_voted(votes, initial), often(row_counts, n, threshold), often(column_counts, n, threshold), b, shorter,
            tolerance, effort, rows, columns,
        )  # fmt: skip
        state = add(state, n, b, rows, columns, threshold)
        n += 1
    return state


@compiled
def add(state: State, n: int, b: Codes, row_of: Integers, column_of: Integers, threshold: float) -> State:
    """Raise the weights of what a chain has too, append what it has besides, forget what is seen too seldom.

    ``row_of`` and ``column_of`` are the partners of the rows and columns of the model in the chain, or −1.
    """
    votes, initial, row_counts, row_missed, column_counts, column_missed = state
    width = int(np.ceil(2 / threshold)) if threshold > 0 else n + 2
    source, columns = merged_columns(column_of, b.shape[1])
    rows = with_new(row_of, len(b))
    old, m, u = len(row_of), len(rows), len(columns)
    shown = most_voted(votes, initial)
    new_votes = np.zeros((m, u, N_CODES), np.int64)
    new_initial = np.empty((m, u), np.uint8)
    new_row_counts, new_row_missed = np.zeros(m, np.int64), np.full(m, n // width)
    new_column_counts, new_column_missed = np.zeros(u, np.int64), np.full(u, n // width)
    new_row_counts[:old], new_row_missed[:old] = row_counts, row_missed
    before = 0
    for x in range(u):
        if source[x] >= 0:
            new_column_counts[x], new_column_missed[x] = column_counts[source[x]], column_missed[source[x]]
            before = source[x]
        for i in range(old):
            if source[x] >= 0:
                new_initial[i, x] = initial[i, source[x]]
                new_votes[i, x] = votes[i, source[x]]
            else:
                # Where nothing was seen yet, a relation lasts until it is seen to change.
                new_initial[i, x] = shown[i, before]
    last = max(columns[0], 0)
    for x in range(u):
        last = columns[x] if columns[x] >= 0 else last
        for i in range(old, m):
            new_initial[i, x] = b[rows[i], last]
    for i in range(m):
        new_row_counts[i] += rows[i] >= 0
        for x in range(u):
            if rows[i] >= 0 and columns[x] >= 0:
                new_votes[i, x, b[rows[i], columns[x]]] += 1
    for x in range(u):
        new_column_counts[x] += columns[x] >= 0
    state = new_votes, new_initial, new_row_counts, new_row_missed, new_column_counts, new_column_missed
    return forget(state, (n + 1) // width) if (n + 1) % width == 0 else state


@compiled
def merged_columns(column_of: Integers, v: int) -> tuple[Integers, Integers]:
    """Columns of the model and those of a chain that it lacks, in their order: number in each, or −1.

    A column that the model lacks comes right after the last one before it that both have.
    """
    taken = np.zeros(v, np.bool_)
    n = len(column_of)
    for partner in column_of:
        if partner >= 0:
            taken[partner] = True
    total = n + v - taken.sum()
    source, columns = np.full(total, -1), np.full(total, -1)
    at = 0
    if taken.any():
        y = 0
        while not taken[y]:
            columns[at] = y
            at += 1
            y += 1
    for x in range(n):
        source[at], columns[at] = x, column_of[x]
        at += 1
        if column_of[x] >= 0:
            y = column_of[x] + 1
            while y < v and not taken[y]:
                columns[at] = y
                at += 1
                y += 1
    if not taken.any():
        columns[at:] = np.arange(v)
    return source, columns


@compiled
def with_new(row_of: Integers, k: int) -> Integers:
    """Partners of all rows, those of the chain that the model lacks appended."""
    taken = np.zeros(k, np.bool_)
    for partner in row_of:
        if partner >= 0:
            taken[partner] = True
    return np.concatenate((row_of, np.flatnonzero(~taken)))


@compiled
def forget(state: State, bucket: int) -> State:
    """Lossy counting: drop rows and columns that were seen less often than one in a bucket since they came."""
    votes, initial, row_counts, row_missed, column_counts, column_missed = state
    rows = np.flatnonzero(row_counts + row_missed > bucket)
    columns = np.flatnonzero(column_counts + column_missed > bucket)
    if not len(rows) or not len(columns):
        return state
    kept_votes = np.empty((len(rows), len(columns), N_CODES), np.int64)
    kept_initial = np.empty((len(rows), len(columns)), np.uint8)
    for i in range(len(rows)):
        for x in range(len(columns)):
            kept_votes[i, x] = votes[rows[i], columns[x]]
            kept_initial[i, x] = initial[rows[i], columns[x]]
    return (
        kept_votes, kept_initial, row_counts[rows], row_missed[rows], column_counts[columns], column_missed[columns]
    )  # fmt: skip
