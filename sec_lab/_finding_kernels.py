"""Compiled scores of one action at one place of a longer movie, for :mod:`sec_lab.finding`.

Relations come as three codes: no contact, contact (touching or overlapping), absent.
"""

import numpy as np

from sec_lab._chain_kernels import Codes, Integers, Numbers, compiled

CONTACT = 1


@compiled
def score(
    movie: Codes, model: Codes, ends: Integers, row_weights: Numbers, column_weights: Numbers, played: Integers,
    first: int, last: int, begin: int, end: int, n_columns: int,
) -> float:  # fmt: skip
    """Weighted share of the entries of a model, up to column ``n_columns``, that are found in a movie.

    ``movie[t, s, r]`` is the relation of segments at key frame t. Column ``begin`` of the model lies at key frame
    ``first``, ``end`` at ``last`` (−1: nowhere yet); the others lie before, between and behind them, in their order.
    Rows of which a role is not played yet (−1) count nothing.
    """
    v = len(movie)
    gain = np.zeros((n_columns, v))
    whole = 0.0
    for i in range(len(ends)):
        a, b = played[ends[i, 0]], played[ends[i, 1]]
        for x in range(n_columns):
            weight = row_weights[i] * column_weights[x]
            whole += weight
            if a >= 0 and b >= 0:
                for t in range(v):
                    if movie[t, a, b] == model[i, x]:
                        gain[x, t] += weight
    total = gain[begin, first] + in_order(gain, 0, begin, 0, first)
    if last >= 0:
        total += in_order(gain, begin + 1, end, first + 1, last) + gain[end, last]
        total += in_order(gain, end + 1, n_columns, last + 1, v)
    else:
        total += in_order(gain, begin + 1, n_columns, first + 1, v)
    return total / whole


@compiled
def in_order(gain: Numbers, x0: int, x1: int, t0: int, t1: int) -> float:
    """Largest sum over pairs of columns, each used once and in the same order in both."""
    best = np.zeros(max(t1 - t0, 0) + 1)
    for x in range(x0, x1):
        diagonal = 0.0
        for t in range(t0, t1):
            above = best[t - t0 + 1]
            best[t - t0 + 1] = max(best[t - t0], max(above, diagonal + gain[x, t]))
            diagonal = above
    return best[-1]


@compiled
def cast_roles(
    movie: Codes, model: Codes, ends: Integers, row_weights: Numbers, column_weights: Numbers, played: Integers,
    first: int, last: int, begin: int, end: int, n_columns: int,
) -> float:  # fmt: skip
    """Give every open role the segment that fits best, one after the other, twice; returns the score."""
    n_roles, n_segments = len(played), movie.shape[1]
    is_open = played < 0
    best = score(movie, model, ends, row_weights, column_weights, played, first, last, begin, end, n_columns)
    for _turn in range(2):
        for role in range(n_roles):
            if not is_open[role]:
                continue
            chosen = played[role]
            for segment in range(n_segments):
                free = True
                for other in range(n_roles):
                    free &= other == role or played[other] != segment
                if not free:
                    continue
                before = played[role]
                played[role] = segment
                value = score(
                    movie, model, ends, row_weights, column_weights, played, first, last, begin, end, n_columns
                )
                played[role] = before
                if value > best + 1e-12:
                    best, chosen = value, segment
            played[role] = chosen
    return best
