"""Slow twins of the Potts lattice: plain Python over pixels, in the arithmetic of the kernels."""

from collections.abc import Iterator
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Pixel = tuple[int, int]
Bonds = dict[frozenset[Pixel], int]

STEPS = [(0, 1), (1, 0), (1, 1), (1, -1)]


def pairs_of_neighbours(height: int, width: int) -> Iterator[tuple[Pixel, Pixel]]:
    for y in range(height):
        for x in range(width):
            for down, right in STEPS:
                if y + down < height and 0 <= x + right < width:
                    yield (y, x), (y + down, x + right)


def naive_bonds(channels: NDArray[np.uint8], alpha: float) -> Bonds:
    """J of every pair of neighbours, in 32nds."""
    distance = {}
    for here, there in pairs_of_neighbours(*channels.shape[1:]):
        difference = channels[(slice(None), *here)].astype(int) - channels[(slice(None), *there)].astype(int)
        distance[frozenset((here, there))] = np.sqrt(np.float32((difference**2).sum()))
    mean = sum(int(16 * d) for d in distance.values()) / 16 / max(len(distance), 1)
    slope = np.float32(32 / max(alpha * mean, 1.0))
    return {
        pair: int(np.floor(max(np.float32(32) - slope * d, np.float32(-127)) + np.float32(0.5)))
        for pair, d in distance.items()
    }


def naive_energy(labels: NDArray[np.int64], bonds: Bonds) -> int:
    return -sum(j for pair, j in bonds.items() if len({int(labels[pixel]) for pixel in pair}) == 1)


def mixed(number: int) -> int:
    number = (number ^ (number >> 30)) * 0xBF58476D1CE4E5B9 % (1 << 64)
    number = (number ^ (number >> 27)) * 0x94D049BB133111EB % (1 << 64)
    return number ^ (number >> 31)


PROPOSED = [(0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)]


def naive_sweeps(
    labels: NDArray[np.int16], bonds: Bonds, noise: NDArray[np.int16], lowest: int, seed: int
) -> NDArray[np.int16]:
    """Metropolis sweeps, field after field of the 2×2 checkerboard, pixel by pixel."""
    labels = labels.copy()
    height, width = labels.shape
    half_rows, half_columns = (height + 1) // 2, (width + 1) // 2
    for sweep, energies in enumerate(noise):
        for plane in range(4):
            for half_row in range(half_rows):
                place = (sweep * 4 + plane) * half_rows + half_row
                draw = mixed((seed + (place + 1) * 0x9E3779B97F4A7C15) % (1 << 64))
                down, right = PROPOSED[draw % 8]
                start = (draw >> 8) % (len(energies) - half_columns + 1)
                for half_column in range(half_columns):
                    y, x = 2 * half_row + plane // 2, 2 * half_column + plane % 2
                    if not (y < height and x < width and 0 <= y + down < height and 0 <= x + right < width):
                        continue
                    mine, its = labels[y, x], labels[y + down, x + right]
                    gain = int(energies[start + half_column])
                    for dy, dx in PROPOSED:
                        j = bonds.get(frozenset(((y, x), (y + dy, x + dx))))
                        if j is not None:
                            neighbour = labels[y + dy, x + dx]
                            gain += max(j, lowest) * (int(neighbour == its) - int(neighbour == mine))
                    if gain > 0:
                        labels[y, x] = its
    return labels


def naive_domains(labels: NDArray[np.integer], bonds: Bonds | None = None, least: int = 0) -> NDArray[np.int64]:
    """Pixels of one label that are connected, by bonds above the least if there are any, in order of the first."""
    domains = np.full(labels.shape, -1)
    n = 0
    for start in np.ndindex(*labels.shape):
        if domains[start] >= 0:
            continue
        stack = [start]
        domains[start] = n
        while stack:
            y, x = stack.pop()
            for dy, dx in PROPOSED:
                other = y + dy, x + dx
                inside = 0 <= other[0] < labels.shape[0] and 0 <= other[1] < labels.shape[1]
                if bonds is not None and bonds.get(frozenset(((y, x), other)), least) <= least:
                    continue
                if inside and domains[other] < 0 and labels[other] == labels[start]:
                    domains[other] = n
                    stack.append(other)
        n += 1
    return domains


def naive_borders(domains: NDArray[np.int64], bonds: Bonds) -> dict[tuple[int, int], list[int]]:
    """Couplings of the bonds between every two domains, in the order in which the pairs are met."""
    borders: dict[tuple[int, int], list[int]] = {}
    for here, there in pairs_of_neighbours(*domains.shape):
        a, b = sorted((int(domains[here]), int(domains[there])))
        if a != b:
            borders.setdefault((a, b), []).append(bonds[frozenset((here, there))])
    return borders


def naive_merging(domains: NDArray[np.int64], bonds: Bonds, minimum: int, thickness: int) -> NDArray[np.int64]:
    """Domains joined while they attract each other, then the small and thin ones: borders are looked up anew."""
    domains = domains.copy()
    forced = False
    while True:
        borders = naive_borders(domains, bonds)
        mean = {pair: Fraction(sum(couplings), len(couplings)) for pair, couplings in borders.items()}
        best: dict[int, tuple[int, int]] = {}
        n_bonds: dict[int, int] = {}
        for pair, couplings in borders.items():
            for domain in pair:
                n_bonds[domain] = n_bonds.get(domain, 0) + len(couplings)
                if domain not in best or mean[pair] > mean[best[domain]]:
                    best[domain] = pair
        sizes = {domain: int((domains == domain).sum()) for domain in best}
        slight = {d for d in best if forced and (sizes[d] < minimum or 6 * sizes[d] < thickness * n_bonds[d])}
        wanted = [
            pair
            for pair in borders
            if (mean[pair] > 0 and all(best[d] == pair for d in pair))
            or any(d in slight and best[d] == pair for d in pair)
        ]
        if not wanted and forced:
            return domains
        forced = forced or not wanted
        group = {domain: domain for domain in best}
        for a, b in wanted:
            low, high = sorted((group[a], group[b]))
            group = {domain: low if root == high else root for domain, root in group.items()}
        for domain, root in group.items():
            domains[domains == domain] = root
