"""Compiled loops over the rows and columns of two chains (§2.6); :mod:`sec_lab.similarity` says what they compute.

All chains lie in flat arrays, and a chain is given by where it begins in them: views cost more than the work on small
chains does. Entries of ξ¹ come as codes; rows of ξ² come as *lanes*: for every row and every code a bit pattern of
16-bit lanes, one a column, that are 1 where the entry has this code. Adding such patterns counts equal entries in four
columns at once.

Every function releases the GIL and draws no random number, so results do not depend on the number of threads.
"""

import numba as nb
import numpy as np
from numpy.typing import NDArray

Codes = NDArray[np.uint8]
Counts = NDArray[np.uint16]
Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]
Numbers = NDArray[np.float64]
Words = NDArray[np.uint64]

# numba looks for changes in the file of a compiled function only, not in those of the functions it calls: the set-up
# empties the cache when any source has changed.
compiled = nb.njit(cache=True, nogil=True)

LANES = 4
"""Columns in one 64-bit word."""

MAX_ROWS = 2**16 - 1
"""Rows that a lane can count."""

_NIBBLES = 16

SLACK = 1e-9
"""Room for rounding when similarities are compared up to a tolerance in percent."""


@compiled
def row_similarity(a: Codes, b: Codes, shorter: int) -> float:
    """Similarity M of two compressed rows in percent: the best overlap of the shorter with the longer (Eq. 2.2)."""
    if len(a) > len(b):
        a, b = b, a
    n = len(a)
    best = 0
    for shift in range(len(b) - n + 1):
        equal = 0
        for i in range(n):
            equal += a[i] == b[i + shift]
        best = max(best, equal)
    return 100.0 * best / (n if shorter else len(b))


@compiled
def row_similarities_of_kinds(
    symbols: Codes, starts: Integers, first: int, last: int, shorter: int, out: Numbers
) -> None:
    """Fill rows ``first:last`` of the symmetric table of similarities between all kinds of compressed rows.

    Symbols below 16 fit into half a byte: two rows of at most 15 are compared as two words, all their places at once.
    """
    n_kinds = len(starts) - 1
    words, fits = np.zeros(n_kinds, np.uint64), np.ones(n_kinds, np.bool_)
    for kind in range(n_kinds):
        n = starts[kind + 1] - starts[kind]
        fits[kind] = n < _NIBBLES
        for i in range(n):
            symbol = symbols[starts[kind] + i]
            fits[kind] &= symbol < _NIBBLES
            if fits[kind]:
                words[kind] |= np.uint64(symbol) << np.uint64(4 * i)
    for i in range(first, last):
        a = symbols[starts[i] : starts[i + 1]]
        for j in range(i, n_kinds):
            if fits[i] and fits[j]:
                n_b = starts[j + 1] - starts[j]
                best, n, longer = best_overlap(words[i], len(a), words[j], n_b)
                out[i, j] = 100.0 * best / (n if shorter else longer)
            else:
                out[i, j] = row_similarity(a, symbols[starts[j] : starts[j + 1]], shorter)
            out[j, i] = out[i, j]


@compiled
def best_overlap(a: np.uint64, n_a: int, b: np.uint64, n_b: int) -> tuple[int, int, int]:
    """Most equal places of the shorter of two rows laid over the longer, and both lengths; half a byte a place."""
    if n_a > n_b:
        a, n_a, b, n_b = b, n_b, a, n_a
    ones = np.uint64(0x1111111111111111) & ((np.uint64(1) << np.uint64(4 * n_a)) - np.uint64(1))
    fewest = n_a
    for _ in range(n_b - n_a + 1):
        different = a ^ b
        different |= different >> np.uint64(1)
        different |= different >> np.uint64(2)
        count = int(((different & ones) * np.uint64(0x1111111111111111)) >> np.uint64(60))
        fewest = min(fewest, count)
        b >>= np.uint64(4)
    return n_a - fewest, n_a, n_b


@compiled
def mutual_best(
    similarity: Numbers, m: int, k: int, tolerance: float, candidate: Flags, best_a: Numbers, counts: Flags
) -> tuple[float, float]:
    """Mark mutually best row pairs (Eq. 2.5, up to a tolerance); return the sums of Eq. 2.4 for both directions.

    ``similarity[j · m + i]`` and ``candidate[i · k + j]`` belong to row i of the first and row j of the second chain;
    ``best_a`` and ``counts`` are room for m entries. Free of branches, because whether a pair fits is a coin toss for
    the processor.
    """
    slack = tolerance + SLACK
    for i in range(m):
        best_a[i] = 0.0
        counts[i] = False
    for j in range(k):
        for i in range(m):
            best_a[i] = max(best_a[i], similarity[j * m + i])
    sum_b = 0.0
    for j in range(k):
        best = 0.0
        for i in range(m):
            best = max(best, similarity[j * m + i])
        counted = False
        for i in range(m):
            s = similarity[j * m + i]
            fits = (s > 0.0) & (s >= best - slack) & (s >= best_a[i] - slack)
            candidate[i * k + j] = fits
            counts[i] |= fits
            counted |= fits
        sum_b += best * counted
    sum_a = 0.0
    for i in range(m):
        sum_a += best_a[i] * counts[i]
    return sum_a, sum_b


@compiled
def fill_lanes(codes: Codes, n_rows: int, n_columns: int, n_codes: int, lanes: Words, at: int) -> None:
    """Write the lanes of the rows of one chain."""
    n_words = -(-n_columns // LANES)
    for i in range(n_rows):
        for b in range(n_columns):
            word = at + (i * n_codes + codes[i * n_columns + b]) * n_words + b // LANES
            lanes[word] |= np.uint64(1) << np.uint64(16 * (b % LANES))


@compiled
def fill_all_lanes(
    codes: Codes, starts: Integers, n_rows: Integers, n_columns: Integers, n_codes: int, lanes: Words, at: Integers
) -> None:
    """:func:`fill_lanes` for chain after chain."""
    for i in range(len(n_rows)):
        fill_lanes(codes[starts[i] : starts[i + 1]], n_rows[i], n_columns[i], n_codes, lanes, at[i])


@compiled
def describe_rows(
    codes: Codes, n_rows: Integers, n_columns: Integers, n_codes: int, first: Integers, symbols: Codes, starts: Integers
) -> None:
    """For each row of all chains the first one of its chain with the same entries, and its changes in their order.

    The changes of row r (ξ_c) lie in ``symbols`` from ``starts[r]`` on, as ``n_codes`` × before + after.
    """
    row = at = end = 0
    for chain in range(len(n_rows)):
        u, base = n_columns[chain], at
        for _ in range(n_rows[chain]):
            starts[row] = end
            for x in range(1, u):
                if codes[at + x] != codes[at + x - 1]:
                    symbols[end] = n_codes * codes[at + x - 1] + codes[at + x]
                    end += 1
            j = 0
            while not np.array_equal(codes[base + j * u : base + (j + 1) * u], codes[at : at + u]):
                j += 1
            first[row] = j
            at += u
            row += 1
    starts[row] = end


@compiled
def add_row(codes: Codes, row_a: int, u: int, lanes: Words, row_b: int, n_words: int, table: Words, at: int) -> None:
    """Count 1 for every pair of columns in which row a has the same entry as row b (Eq. 2.8)."""
    for a in range(u):
        pattern = row_b + codes[row_a + a] * n_words
        word = at + a * n_words
        for w in range(n_words):
            table[word + w] += lanes[pattern + w]


@compiled
def add_tables(table: Words, x: int, y: int, n: int, total: int) -> None:
    """Write the sum of two tables of n words."""
    for w in range(n):
        table[total + w] = table[x + w] + table[y + w]


@compiled
def ordered_columns_value(counts: Counts, at: int, u: int, v: int, stride: int, best: Integers) -> int:
    """Largest sum over pairs of columns, each used once and in the same order in both chains (LCS, Eq. 2.9).

    ``counts[at + a · stride + b]`` belongs to columns a and b; ``best`` is room for v + 1 numbers.
    """
    for b in range(v + 1):
        best[b] = 0
    for a in range(u):
        diagonal = 0
        left = 0
        row = counts[at + a * stride : at + a * stride + v]
        for b in range(v):
            above = best[b + 1]
            left = max(left, max(above, diagonal + np.int64(row[b])))
            best[b + 1] = left
            diagonal = above
    return best[v]


@compiled
def ordered_columns(counts: Counts, at: int, u: int, v: int, stride: int) -> Integers:
    """The column pairs of :func:`ordered_columns_value`: for each column of the first chain its partner, or −1."""
    best = np.zeros((u + 1, v + 1), np.int64)
    for a in range(u):
        for b in range(v):
            paired = best[a, b] + np.int64(counts[at + a * stride + b])
            best[a + 1, b + 1] = max(paired, max(best[a, b + 1], best[a + 1, b]))
    partner = np.full(u, -1, np.int64)
    a, b = u, v
    while a > 0 and b > 0:
        equal = np.int64(counts[at + (a - 1) * stride + b - 1])
        if equal > 0 and best[a, b] == best[a - 1, b - 1] + equal:
            partner[a - 1] = b - 1
            a -= 1
            b -= 1
        elif best[a, b] == best[a - 1, b]:
            a -= 1
        else:
            b -= 1
    return partner
