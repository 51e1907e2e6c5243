"""Compiled joining of domains that attract each other (cluster moves, §2.2), and of slight ones."""

import numba as nb
import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation._domain_kernels import join, root_of

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


@nb.njit(cache=True, nogil=True)
def _lists_of(pairs: Integers, n_domains: int) -> tuple[Integers, Integers, Integers]:
    """Borders of every domain as linked lists of sides: side s is the end s % 2 of border s // 2; -1 ends a list."""
    first, last = np.full(n_domains, -1), np.full(n_domains, -1)
    after = np.full(2 * len(pairs), -1)
    for side in range(2 * len(pairs)):
        domain = pairs[side >> 1, side & 1]
        if last[domain] < 0:
            first[domain] = side
        else:
            after[last[domain]] = side
        last[domain] = side
    return first, last, after


@nb.njit(cache=True, nogil=True)
def _most_attractive(
    domain: int, first: Integers, after: Integers, alive: Flags, sums: Integers, counts: Integers
) -> tuple[int, int]:
    """Border with the highest mean coupling, of equal ones the first, or -1; and the domain's number of bonds."""
    best, bonds = -1, 0
    side = first[domain]
    while side >= 0:
        border = side >> 1
        if alive[border]:
            bonds += counts[border]
            if best < 0:
                best = border
            else:
                # Means compared without rounding.
                mine, others = sums[border] * counts[best], sums[best] * counts[border]
                if mine > others or (mine == others and border < best):
                    best = border
        side = after[side]
    return best, bonds


@nb.njit(cache=True, nogil=True)
def _add_up(
    root: int,
    parents: Integers,
    pairs: Integers,
    sums: Integers,
    counts: Integers,
    first: Integers,
    last: Integers,
    after: Integers,
    alive: Flags,
    met: Integers,
) -> None:
    """Borders of a domain that has grown: those with one neighbour added up, those within it dropped."""
    side = first[root]
    while side >= 0:
        border = side >> 1
        if alive[border]:
            other = root_of(parents, pairs[border, 1 - (side & 1)])
            pairs[border, side & 1], pairs[border, 1 - (side & 1)] = root, other
            if other == root:
                alive[border] = False
            elif met[other] < 0:
                met[other] = border
            else:
                # The lower number stays, so that equal means are told apart by what was met first in the picture.
                kept, gone = min(border, met[other]), max(border, met[other])
                sums[kept] += sums[gone]
                counts[kept] += counts[gone]
                alive[gone] = False
                met[other] = kept
        side = after[side]
    # Sides of dropped borders leave the list; the lists of neighbours keep them until those grow.
    side, end = first[root], -1
    first[root] = -1
    while side >= 0:
        following = after[side]
        if alive[side >> 1]:
            met[pairs[side >> 1, 1 - (side & 1)]] = -1
            if end < 0:
                first[root] = side
            else:
                after[end] = side
            end = side
        side = following
    last[root] = end
    if end >= 0:
        after[end] = -1


@nb.njit(cache=True, nogil=True)
def merge_domains(
    pairs: Integers, sums: Integers, counts: Integers, sizes: Integers, minimum: int, thickness: int
) -> Integers:
    """Join domains that attract each other, then those that are too small or too thin.

    Two domains are joined if each is the other's neighbour with the highest mean coupling along the border and that is
    above 0; again, until no such pair is left. Then domains of fewer pixels than the minimum, and those with fewer than
    ``thickness`` / 6 pixels for every bond along their border, are joined to the neighbour with the highest mean
    coupling, whatever that is. (A band of that thickness has 3 bonds a pixel of length on either side.)

    Each round looks only at the domains that grew in the round before and at their neighbours: for the others, nothing
    has changed.

    Parameters
    ----------
    pairs, sums, counts
        See :func:`sec_lab.segmentation._domain_kernels.borders_of`.
    sizes : (n_domains,) int64
        In pixels.
    minimum, thickness : int
        In pixels.

    Returns
    -------
    (n_domains,) int64
        For every domain, the lowest number among those it was joined with.
    """
    n_domains = len(sizes)
    parents = np.arange(n_domains)
    pairs, sums, counts, sizes = pairs.copy(), sums.copy(), counts.copy(), sizes.copy()
    first, last, after = _lists_of(pairs, n_domains)
    alive = np.ones(len(sums), np.bool_)
    best, slight = np.full(n_domains, -1), np.zeros(n_domains, np.bool_)
    met = np.full(n_domains, -1)
    waiting, n_waiting, is_waiting = np.arange(n_domains), n_domains, np.zeros(n_domains, np.bool_)
    grown = np.empty(n_domains, np.int64)
    forced = False
    while True:
        for place in range(n_waiting):
            domain = waiting[place]
            is_waiting[domain] = False
            best[domain], bonds = _most_attractive(domain, first, after, alive, sums, counts)
            slight[domain] = sizes[domain] < minimum or 6 * sizes[domain] < thickness * bonds
        n_grown = 0
        for place in range(n_waiting):
            border = best[waiting[place]]
            if border < 0:
                continue
            a, b = pairs[border, 0], pairs[border, 1]
            mutual = sums[border] > 0 and best[a] == border and best[b] == border
            if not mutual and not (forced and slight[waiting[place]]):
                continue
            a, b = root_of(parents, a), root_of(parents, b)
            if a != b:
                a, b = min(a, b), max(a, b)
                join(parents, a, b)
                sizes[a] += sizes[b]
                after[last[a]], last[a] = first[b], last[b]
                grown[n_grown] = a
                n_grown += 1
        n_waiting = 0
        for place in range(n_grown):
            root = grown[place]
            if parents[root] != root or is_waiting[root]:
                continue
            _add_up(root, parents, pairs, sums, counts, first, last, after, alive, met)
            waiting[n_waiting], is_waiting[root] = root, True
            n_waiting += 1
        # A neighbour may itself have grown: lists are walked only once all of them are added up.
        for place in range(n_waiting):
            side = first[waiting[place]]
            while side >= 0:
                neighbour = pairs[side >> 1, 1 - (side & 1)]
                if alive[side >> 1] and not is_waiting[neighbour]:
                    waiting[n_waiting], is_waiting[neighbour] = neighbour, True
                    n_waiting += 1
                side = after[side]
        if n_grown == 0:
            if forced:
                break
            forced = True
            for domain in range(n_domains):
                if parents[domain] == domain:
                    waiting[n_waiting] = domain
                    n_waiting += 1
    for domain in range(n_domains):
        parents[domain] = root_of(parents, domain)
    return parents
