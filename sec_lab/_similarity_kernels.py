"""Compiled comparison of one chain with all that follow it, for :mod:`sec_lab.similarity`."""

import numpy as np

from sec_lab._chain_kernels import Codes, Flags, Integers, Numbers, Words, compiled, mutual_best, row_similarity
from sec_lab._pair_kernels import Chains, Pair, room_to_work
from sec_lab._permutation_kernels import best_permutation


@compiled
def compare_with_later(
    i: int,
    begin: int,
    row_starts: Integers,
    columns: Integers,
    codes: Codes,
    code_starts: Integers,
    lanes: Words,
    lane_starts: Integers,
    n_codes: int,
    first: Integers,
    kinds: Integers,
    kind_table: Numbers,
    symbols: Codes,
    symbol_starts: Integers,
    shorter: int,
    tolerance: float,
    effort: int,
    mode: int,
    temporal: Numbers,
    spatial: Numbers,
    exact: Flags,
) -> int:
    """Compare chain ``i`` with all chains from ``begin`` ≥ i on, and write both directions into the tables.

    ``mode`` says what is written: 0 each direction as it is, 1 their mean, 2 the smaller, 3 the larger. A table of size
    0 is left out. Returns how many of the pairs with later chains were solved exactly.
    """
    n_chains = len(columns)
    m, u = row_starts[i + 1] - row_starts[i], columns[i]
    most_rows, most_columns = 0, 0
    for j in range(begin, n_chains):
        most_rows = max(most_rows, row_starts[j + 1] - row_starts[j])
        most_columns = max(most_columns, columns[j])
    assigned = np.empty(m, np.int64)
    similarity = np.empty(m * most_rows)
    candidate = np.empty(m * most_rows, np.bool_)
    best_a = np.empty(m)
    counts = np.empty(m, np.bool_)
    # Similarities of the rows of this chain with every kind of row, those of one kind side by side.
    of_kind = np.empty(kind_table.size and len(kind_table) * m)
    for kind in range(len(kind_table)):
        for p in range(m):
            of_kind[kind * m + p] = kind_table[kinds[row_starts[i] + p], kind]
    scratch = room_to_work(m, most_rows, u, most_columns, n_codes)
    chains = Chains(codes, lanes, first)
    n_exact = 0
    for j in range(begin, n_chains):
        k, v = row_starts[j + 1] - row_starts[j], columns[j]
        for q in range(k):
            kind_b = kinds[row_starts[j] + q]
            for p in range(m):
                if of_kind.size:
                    similarity[q * m + p] = of_kind[kind_b * m + p]
                else:
                    kind_a = kinds[row_starts[i] + p]
                    similarity[q * m + p] = row_similarity(
                        symbols[symbol_starts[kind_a] : symbol_starts[kind_a + 1]],
                        symbols[symbol_starts[kind_b] : symbol_starts[kind_b + 1]],
                        shorter,
                    )
        sum_a, sum_b = mutual_best(similarity, m, k, tolerance, candidate, best_a, counts)
        if spatial.size:
            _write(spatial, i, j, sum_a / m, sum_b / k, mode)
        if temporal.size:
            pair = Pair(
                code_starts[i], code_starts[j], lane_starts[j], row_starts[i], row_starts[j], m, k, u, v, n_codes
            )  # fmt: skip
            total, proven = best_permutation(chains, pair, candidate, effort, assigned, scratch)
            # One search serves both directions: they differ in the number q of rows of Eq. 2.7 only.
            share = 100.0 * total / min(u, v)
            _write(temporal, i, j, share / m, share / k, mode)
            if exact.size:
                exact[i, j] = proven
                exact[j, i] = proven
            n_exact += proven and j > i
    return n_exact


@compiled
def _write(table: Numbers, i: int, j: int, forward: float, backward: float, mode: int) -> None:
    if mode == 1:
        forward = backward = (forward + backward) / 2.0
    elif mode == 2:
        forward = backward = min(forward, backward)
    elif mode == 3:
        forward = backward = max(forward, backward)
    table[i, j] = forward
    table[j, i] = backward
