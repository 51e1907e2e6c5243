"""Compiled comparison of one seed with many noisy samples of it, for :mod:`sec_lab.noise`.

Samples are laid out at fixed places with flags that say which rows and columns are there, so that nothing has to be
packed one chain at a time. The twin is :func:`sec_lab.similarity.compare` with
:func:`sec_lab.roles.corresponding_segments`.
"""

import numpy as np
from numpy.typing import NDArray

from sec_lab._chain_kernels import (
    LANES,
    Codes,
    Flags,
    Integers,
    Numbers,
    compiled,
    fill_lanes,
    mutual_best,
    row_similarity,
)
from sec_lab._pair_kernels import Chains, Pair, room_to_work
from sec_lab._permutation_kernels import best_permutation

N_CODES = 4
RIGHT, TIED, TAKEN = 0, 1, 2
"""Columns of the counts of objects: at home, between equally good counterparts, and with a wrong one."""


@compiled
def compare_with_samples(
    seed: Codes,
    seed_pairs: Integers,
    n_objects: int,
    n_segments: int,
    samples: NDArray[np.uint8],
    rows: Flags,
    columns: Flags,
    pairs: Integers,
    shorter: int,
    tolerance: float,
    effort: int,
    spatial: Numbers,
    temporal: Numbers,
    exact: Flags,
    objects: Integers,
) -> None:
    """Compare a seed (ξ¹) with each of n samples (ξ²), and count the segments of the seed that are found again.

    ``seed`` (m, u) holds the codes of changing rows, ``seed_pairs`` (m, 2) their segments as numbers below
    ``n_objects``. ``samples`` (n, R, C) holds codes, ``pairs`` (n, R, 2) segments below ``n_segments``; a segment of
    the seed has its number there too. Results have n entries, ``objects`` (n, 3).
    """
    (m, u), (n, n_places, width) = seed.shape, samples.shape
    symbols_a, lengths_a = compressed_rows(seed, m, u)
    first = np.empty(m + n_places, np.int64)
    identical_rows(seed, m, u, first[:m])
    codes = np.empty(m * u + n_places * width, np.uint8)
    codes[: m * u] = seed.ravel()
    words = -(-width // LANES)
    lanes = np.zeros(n_places * N_CODES * words, np.uint64)
    table = np.empty((n_places, width), np.uint8)
    present = np.empty(n_places, np.int64)
    similarity = np.empty(m * n_places)
    candidate = np.empty(m * n_places, np.bool_)
    best_a, counts = np.empty(m), np.empty(m, np.bool_)
    assigned = np.empty(m, np.int64)
    scratch = room_to_work(m, n_places, u, width, N_CODES)
    for sample in range(n):
        k, v = changing_part(samples[sample], rows[sample], columns[sample], table, present)
        objects[sample] = 0
        spatial[sample], temporal[sample], exact[sample] = 0.0, 0.0, True
        if k == 0:
            continue
        for j in range(k):
            for b in range(v):
                codes[m * u + j * v + b] = table[j, b]
        symbols_b, lengths_b = compressed_rows(table, k, v)
        identical_rows(table, k, v, first[m : m + k])
        lanes[:] = 0
        fill_lanes(codes[m * u :], k, v, N_CODES, lanes, 0)
        for j in range(k):
            for i in range(m):
                similarity[j * m + i] = row_similarity(
                    symbols_a[i, : lengths_a[i]], symbols_b[j, : lengths_b[j]], shorter
                )
        total_spatial, _ = mutual_best(similarity, m, k, tolerance, candidate, best_a, counts)
        pair = Pair(0, m * u, 0, 0, m, m, k, u, v, N_CODES)
        total, proven = best_permutation(Chains(codes, lanes, first), pair, candidate, effort, assigned, scratch)
        spatial[sample] = total_spatial / m
        temporal[sample] = 100.0 * total / min(u, v) / m
        exact[sample] = proven
        count_objects(
            assigned, first[:m], first[m : m + k], similarity, seed_pairs, pairs[sample], present[:k], n_objects,
            n_segments, objects[sample],
        )  # fmt: skip


@compiled
def changing_part(sample: Codes, rows: Flags, columns: Flags, table: Codes, present: Integers) -> tuple[int, int]:
    """Write the rows of a sample that are there and change into ``table``, their places into ``present``."""
    k, v = 0, 0
    for i in range(len(rows)):
        if not rows[i]:
            continue
        v = 0
        changes = False
        for x in range(len(columns)):
            if columns[x]:
                table[k, v] = sample[i, x]
                changes |= table[k, v] != table[k, 0]
                v += 1
        if changes:
            present[k] = i
            k += 1
    return k, v


@compiled
def compressed_rows(table: Codes, k: int, v: int) -> tuple[Codes, Integers]:
    """Changes of each row, and how many there are (§2.5)."""
    symbols, lengths = np.empty((k, v), np.uint8), np.zeros(k, np.int64)
    for i in range(k):
        for x in range(1, v):
            if table[i, x] != table[i, x - 1]:
                symbols[i, lengths[i]] = N_CODES * table[i, x - 1] + table[i, x]
                lengths[i] += 1
    return symbols, lengths


@compiled
def identical_rows(table: Codes, k: int, v: int, first: Integers) -> None:
    """For each row the first one with the same entries."""
    for i in range(k):
        first[i] = i
        for j in range(i):
            same = True
            for x in range(v):
                if table[i, x] != table[j, x]:
                    same = False
                    break
            if same:
                first[i] = j
                break


@compiled
def count_objects(
    assigned: Integers,
    first_a: Integers,
    first_b: Integers,
    similarity: Numbers,
    pairs_a: Integers,
    pairs: Integers,
    present: Integers,
    n_objects: int,
    n_segments: int,
    found: Integers,
) -> None:
    """Count the objects with the right counterpart, between several, and with a wrong one (§2.8)."""
    m, k = len(first_a), len(first_b)
    votes, ranking = np.zeros((n_objects, n_segments)), np.zeros((n_objects, n_segments))
    n_a, n_b = np.zeros(m), np.zeros(k)
    for i in range(m):
        n_a[first_a[i]] += 1.0
    for j in range(k):
        n_b[first_b[j]] += 1.0
    for i in range(m):
        if assigned[i] < 0:
            continue
        # Rows identical to each other share what they have.
        share = 1.0 / (n_a[first_a[i]] * n_b[assigned[i]])
        for other in range(m):
            if first_a[other] != first_a[i]:
                continue
            for j in range(k):
                if first_b[j] == assigned[i]:
                    vote(votes, pairs_a[other], pairs[present[j]], share)
        highest = 0.0
        for j in range(k):
            highest = max(highest, similarity[j * m + i])
        second, n_second = 0.0, 0
        for j in range(k):
            value = similarity[j * m + i]
            if value < highest and value > second:
                second, n_second = value, 1
            elif value == second:
                n_second += 1
        if second > 0.0:
            for j in range(k):
                if similarity[j * m + i] == second:
                    vote(ranking, pairs_a[i], pairs[present[j]], 1.0 / n_second)
    for a in range(n_objects):
        for b in range(n_segments):
            votes[a, b] = np.rint(votes[a, b] * 1e9) / 1e9
            ranking[a, b] = np.rint(ranking[a, b] * 1e9) / 1e9 if votes[a, b] > 0.0 else -1.0
    partner = np.full(n_objects, -1)
    settle(votes, votes, partner)
    settle(votes, ranking, partner)
    settle(votes, votes, partner)
    options = best_options(votes, votes, partner)
    for a in range(n_objects):
        if partner[a] == a:
            found[RIGHT] += 1
        elif partner[a] >= 0:
            found[TAKEN] += 1
        elif options[a].any():
            found[TIED] += 1


@compiled
def vote(votes: Numbers, pair_a: Integers, pair_b: Integers, share: float) -> None:
    """Give a share of a vote to all four combinations of the segments of two rows."""
    for a in range(2):
        for b in range(2):
            votes[pair_a[a], pair_b[b]] += share


@compiled
def best_options(votes: Numbers, ranking: Numbers, partner: Integers) -> Flags:
    """For every object without a partner the free segments with most votes, then highest in the ranking."""
    n_objects, n_segments = votes.shape
    options = np.zeros((n_objects, n_segments), np.bool_)
    free = np.ones(n_segments, np.bool_)
    for a in range(n_objects):
        if partner[a] >= 0:
            free[partner[a]] = False
    for a in range(n_objects):
        if partner[a] >= 0:
            continue
        most, highest = 0.0, -np.inf
        for b in range(n_segments):
            if free[b] and (votes[a, b] > most or (votes[a, b] == most and most > 0.0 and ranking[a, b] > highest)):
                most, highest = votes[a, b], ranking[a, b]
        if most > 0.0:
            for b in range(n_segments):
                options[a, b] = free[b] and votes[a, b] == most and ranking[a, b] == highest
    return options


@compiled
def settle(votes: Numbers, ranking: Numbers, partner: Integers) -> None:
    """Fix all partners that are clear, those with most votes first, until nothing is clear any more."""
    n_objects, n_segments = votes.shape
    fixed = True
    while fixed:
        fixed = False
        options = best_options(votes, ranking, partner)
        for a in range(n_objects):
            n, b = 0, -1
            for option in range(n_segments):
                if options[a, option]:
                    n += 1
                    b = option
            if n != 1:
                continue
            ahead = True
            for rival in range(n_objects):
                if rival != a and options[rival, b]:
                    less = votes[rival, b] < votes[a, b]
                    ahead &= less or (votes[rival, b] == votes[a, b] and ranking[rival, b] < ranking[a, b])
            if ahead:
                partner[a] = b
                fixed = True
