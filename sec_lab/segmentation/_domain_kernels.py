"""Compiled domains of a label image: connected pixels of one label, bonds along their borders."""

import numba as nb
import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation._potts_kernels import FORWARD_COLUMNS, FORWARD_ROWS

Integers = NDArray[np.int64]
Domains = NDArray[np.int32]
Couplings = NDArray[np.int8]


@nb.njit(cache=True, nogil=True)
def root_of(parents: Integers, node: int) -> int:
    """Root of a node in a forest, its path halved on the way."""
    while parents[node] != node:
        parents[node] = parents[parents[node]]
        node = parents[node]
    return node


@nb.njit(cache=True, nogil=True)
def join(parents: Integers, a: int, b: int) -> None:
    """Join two trees; the lower root stays root."""
    a, b = root_of(parents, a), root_of(parents, b)
    if a < b:
        parents[b] = a
    else:
        parents[a] = b


@nb.njit(cache=True, nogil=True)
def domains_of(labels: NDArray[np.integer]) -> tuple[Domains, Integers, Integers]:
    """Connected pixels (8 neighbours) of equal labels, numbered from 0 on in the order of their first pixel.

    Parameters
    ----------
    labels : (height, width) int

    Returns
    -------
    domains : (height, width) int32
    sizes : (n,) int64
        In pixels.
    label_of : (n,) int64
    """
    height, width = labels.shape
    starts = np.empty(height * width, np.int32)
    values = np.empty(height * width, np.int32)
    first_run = np.empty(height + 1, np.int64)
    n_runs = 0
    for y in range(height):
        first_run[y] = n_runs
        row = labels[y]
        last = row[0]
        starts[n_runs] = 0
        values[n_runs] = last
        n_runs += 1
        for x in range(1, width):
            if row[x] != last:
                last = row[x]
                starts[n_runs] = x
                values[n_runs] = last
                n_runs += 1
    first_run[height] = n_runs
    parents = np.arange(n_runs)
    for y in range(1, height):
        above, stop = first_run[y - 1], first_run[y]
        for run in range(stop, first_run[y + 1]):
            begin = starts[run]
            end = starts[run + 1] if run + 1 < first_run[y + 1] else width
            # Runs above that end before this one, by more than the diagonal, meet no later one either.
            while above + 1 < stop and starts[above + 1] < begin:
                above += 1
            other = above
            while other < stop and starts[other] <= end:
                if values[other] == values[run]:
                    join(parents, other, run)
                other += 1
    number = np.empty(n_runs, np.int32)
    sizes = np.zeros(n_runs, np.int64)
    label_of = np.empty(n_runs, np.int64)
    n = 0
    domains = np.empty((height, width), np.int32)
    for y in range(height):
        for run in range(first_run[y], first_run[y + 1]):
            root = root_of(parents, run)
            if root == run:
                number[run] = n
                label_of[n] = values[run]
                n += 1
            number[run] = number[root]
            end = starts[run + 1] if run + 1 < first_run[y + 1] else width
            sizes[number[run]] += end - starts[run]
            domains[y, starts[run] : end] = number[run]
    return domains, sizes[:n].copy(), label_of[:n].copy()


@nb.njit(cache=True, nogil=True)
def bond_domains_of(
    labels: NDArray[np.integer], couplings: Couplings, least: int
) -> tuple[Domains, Integers, Integers]:
    """Pixels of one label that bonds above ``least`` connect; what it gives is like that of :func:`domains_of`."""
    height, width = labels.shape
    node = np.empty((height, width), np.int32)
    parents = np.empty(height * width, np.int64)
    n_nodes = 0
    for y in range(height):
        for x in range(width):
            label = labels[y, x]
            mine = -1
            if (
                x
                and labels[y, x - 1] == label
                and couplings[0, 2 * (y & 1) + ((x - 1) & 1), (y >> 1) + 1, ((x - 1) >> 1) + 1] > least
            ):
                mine = node[y, x - 1]
            if y:
                for direction in range(1, 4):
                    u = x - FORWARD_COLUMNS[direction]
                    if (
                        0 <= u < width
                        and labels[y - 1, u] == label
                        and couplings[direction, 2 * ((y - 1) & 1) + (u & 1), ((y - 1) >> 1) + 1, (u >> 1) + 1] > least
                    ):
                        other = node[y - 1, u]
                        if mine < 0:
                            mine = other
                        elif mine != other:
                            join(parents, mine, other)
            if mine < 0:
                mine = n_nodes
                parents[n_nodes] = n_nodes
                n_nodes += 1
            node[y, x] = mine
    number = np.empty(n_nodes, np.int32)
    n = 0
    for i in range(n_nodes):
        root = root_of(parents, i)
        if root == i:
            number[i] = n
            n += 1
        else:
            number[i] = number[root]
    sizes, label_of = np.zeros(n, np.int64), np.zeros(n, np.int64)
    for y in range(height):
        for x in range(width):
            domain = number[node[y, x]]
            node[y, x] = domain
            sizes[domain] += 1
            label_of[domain] = labels[y, x]
    return node, sizes, label_of


@nb.njit(cache=True, nogil=True)
def _entry(keys: Integers, entries: Domains, key: int) -> np.uint64:
    """Field of a key in a hash table, or the free one where it belongs; ``entries`` is -1 in free fields."""
    mask = np.uint64(keys.size - 1)
    field = ((np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(32)) & mask
    while entries[field] >= 0 and keys[field] != key:
        field = (field + np.uint64(1)) & mask
    return field


@nb.njit(cache=True, nogil=True)
def _mark_borders(border: Domains, here: Domains, east: Domains, a: Domains, b: Domains, c: Domains) -> None:
    """Mark pixels with a neighbour of another domain to the right or below by anything but 0."""
    for x in range(border.size):
        mine = here[x]
        border[x] = (east[x] ^ mine) | (a[x] ^ mine) | (b[x] ^ mine) | (c[x] ^ mine)


@nb.njit(cache=True, nogil=True)
def _add_row(
    domains: Domains,
    couplings: Couplings,
    n_domains: int,
    y: int,
    border: Domains,
    words: NDArray[np.uint64],
    keys: Integers,
    entries: Domains,
    pairs: Integers,
    sums: Integers,
    counts: Integers,
    n: int,
) -> int:
    """Add the bonds of a row's pixels to a table of pairs; their new number."""
    height, width = domains.shape
    x = 0
    last_key, last = np.int64(-1), np.int64(0)
    while x < width:
        if border[x] == 0:
            # Most pixels are inside of a domain: eight of them at a time.
            word = x >> 1
            if x & 1 == 0 and x + 8 < width and words[word] | words[word + 1] | words[word + 2] | words[word + 3] == 0:
                x += 7
            x += 1
            continue
        here = domains[y, x]
        for direction in range(4):
            down, right = y + FORWARD_ROWS[direction], x + FORWARD_COLUMNS[direction]
            if down >= height or right < 0 or right >= width:
                continue
            there = domains[down, right]
            if there == here:
                continue
            low, high = np.int64(min(here, there)), np.int64(max(here, there))
            key = low * n_domains + high
            if key != last_key:
                field = _entry(keys, entries, key)
                if entries[field] < 0:
                    keys[field], entries[field] = key, n
                    pairs[n, 0], pairs[n, 1] = low, high
                    sums[n], counts[n] = 0, 0
                    n += 1
                last_key, last = key, np.int64(entries[field])
            sums[last] += couplings[direction, 2 * (y & 1) + (x & 1), (y >> 1) + 1, (x >> 1) + 1]
            counts[last] += 1
        x += 1
    return n


@nb.njit(cache=True, nogil=True)
def borders_of(domains: Domains, couplings: Couplings, n_domains: int) -> tuple[Integers, Integers, Integers]:
    """Bonds between domains.

    Parameters
    ----------
    domains : (height, width) int32
    couplings : (4, 4, height / 2 + 2, width / 2 + 2) int8
    n_domains : int

    Returns
    -------
    pairs : (n, 2) int64
        Two domains, the lower first; in the order in which they are met.
    sums : (n,) int64
        Sum of the couplings across their border.
    counts : (n,) int64
        Number of bonds across it.
    """
    height, width = domains.shape
    space = 1
    while space < 8 * width:
        space *= 2
    keys, entries = np.zeros(2 * space, np.int64), np.full(2 * space, -1, np.int32)
    pairs, sums, counts = np.empty((space, 2), np.int64), np.empty(space, np.int64), np.empty(space, np.int64)
    n = 0
    # The first and the last pixel of a row lack neighbours: they are looked at in any case.
    border = np.ones(width + 8, np.int32)
    words = border[: (width + 7) & ~7].view(np.uint64)
    for y in range(height):
        if width > 2:
            row, below = domains[y], domains[min(y + 1, height - 1)]
            _mark_borders(border[1 : width - 1], row[1:-1], row[2:], below[:-2], below[1:-1], below[2:])
        if n + 4 * width > len(sums):
            keys, entries, pairs, sums, counts = _grown(pairs, sums, counts, n, n_domains)
        n = _add_row(domains, couplings, n_domains, y, border, words, keys, entries, pairs, sums, counts, n)
    return pairs[:n].copy(), sums[:n].copy(), counts[:n].copy()


@nb.njit(cache=True, nogil=True)
def _grown(
    pairs: Integers, sums: Integers, counts: Integers, n: int, n_domains: int
) -> tuple[Integers, Domains, Integers, Integers, Integers]:
    """A table of n pairs in four times the space."""
    space = 4 * len(sums)
    keys, entries = np.zeros(2 * space, np.int64), np.full(2 * space, -1, np.int32)
    new_pairs, new_sums, new_counts = (
        np.empty((space, 2), np.int64),
        np.empty(space, np.int64),
        np.empty(space, np.int64),
    )
    new_pairs[:n], new_sums[:n], new_counts[:n] = pairs[:n], sums[:n], counts[:n]
    for i in range(n):
        key = pairs[i, 0] * n_domains + pairs[i, 1]
        field = _entry(keys, entries, key)
        keys[field], entries[field] = key, i
    return keys, entries, new_pairs, new_sums, new_counts
