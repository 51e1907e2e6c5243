"""Compiled Potts lattice for :mod:`sec_lab.segmentation.potts`: couplings and Metropolis sweeps.

The picture is taken apart into four planes as on a checkerboard of 2×2 fields: plane 2a + b holds the pixels (2i + a,
2j + b) at (i + 1, j + 1). No two pixels of a plane are neighbours, so a plane is updated at once, and all neighbours of
a row of it lie in rows of other planes: the compiler turns the update into vector instructions. Each plane has a rim
of one, where couplings are 0 and labels ``OUTSIDE``.

Everything is local to a call and runs on one thread: what a frame needs is done in a fraction of the time in which the
threads of a parallel loop find together on a busy machine. Frames are worked at side by side instead, see
:mod:`sec_lab.segmentation.tracking`.
"""

import numba as nb
import numpy as np
from numpy.typing import NDArray

Spins = NDArray[np.int16]
Couplings = NDArray[np.int8]
Channels = NDArray[np.uint8]

UNIT = 32
"""Coupling J = 1 in the whole numbers of the kernels."""

LOWEST = -127
"""Lowest coupling in whole numbers; anything stronger repels as much."""

OUTSIDE = -1
"""Label beyond the picture."""

FORWARD_ROWS = np.array([0, 1, 1, 1])
"""Rows to the neighbours of which a pixel keeps the coupling: east, south, south-east, south-west."""

FORWARD_COLUMNS = np.array([1, 0, 1, -1])
"""Columns to the same."""


@nb.njit(cache=True, nogil=True)
def _mixed(number: np.uint64) -> np.uint64:
    """Hash of a whole number (the finaliser of splitmix64)."""
    number = (number ^ (number >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    number = (number ^ (number >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return number ^ (number >> np.uint64(31))


@nb.njit(cache=True, nogil=True)
def _distances(
    distance: NDArray[np.float32], a: Channels, b: Channels, c: Channels, d: Channels, e: Channels, f: Channels, n: int
) -> None:
    """Distance of the colours (a, b, c) and (d, e, f) of n pairs of pixels."""
    for x in range(n):
        u = np.int32(a[x]) - np.int32(d[x])
        v = np.int32(b[x]) - np.int32(e[x])
        w = np.int32(c[x]) - np.int32(f[x])
        distance[x] = np.sqrt(np.float32(np.int32(u * u + v * v + w * w)))


@nb.njit(cache=True, nogil=True)
def _sum(distance: NDArray[np.float32], n: int) -> np.int64:
    """Sum of distances in sixteenths: whole numbers add up to the same in any order."""
    total = np.int32(0)
    for x in range(n):
        total += np.int32(distance[x] * np.float32(16))
    return np.int64(total)


@nb.njit(cache=True, nogil=True)
def _row_distances(distance: NDArray[np.float32], channels: Channels, y: int, direction: int) -> tuple[int, int]:
    """Fill in the distances of a row's pixels to their neighbours; the first pixel that has one, and their number."""
    height, width = channels.shape[1:]
    down = 0 if direction == 0 else 1
    first = 1 if direction == 3 else 0
    right = 0 if direction == 1 else (-1 if direction == 3 else 1)
    if y + down >= height:
        return first, 0
    n = width if direction == 1 else width - 1
    here, there = channels[:, y, first:], channels[:, y + down, first + right :]
    _distances(distance, here[0], here[1], here[2], there[0], there[1], there[2], n)
    return first, n


@nb.njit(cache=True, nogil=True)
def difference_sum(channels: Channels) -> int:
    """Sum of the colour distances of all pairs of neighbours, in sixteenths."""
    height, width = channels.shape[1:]
    distance = np.empty(width, np.float32)
    total = 0
    for y in range(height):
        for direction in range(4):
            _, n = _row_distances(distance, channels, y, direction)
            total += _sum(distance, n)
    return total


@nb.njit(cache=True, nogil=True)
def _to_couplings(coupling: Couplings, distance: NDArray[np.float32], slope: np.float32, n: int) -> None:
    for x in range(n):
        value = np.float32(UNIT) - slope * distance[x]
        value = max(value, np.float32(LOWEST))
        coupling[x] = np.int8(np.floor(value + np.float32(0.5)))


@nb.njit(cache=True, nogil=True)
def fill_couplings(couplings: Couplings, channels: Channels, scale: float) -> int:
    """Couplings J = 1 − distance / scale of all pairs of neighbours.

    Parameters
    ----------
    couplings : (4, 4, height / 2 + 2, width / 2 + 2) int8
        Filled in: direction, plane, row, column; the rim is left alone.
    channels : (3, height, width) uint8
    scale : float

    Returns
    -------
    int
        Sum of all distances in sixteenths, for the next frame's scale.
    """
    height, width = channels.shape[1:]
    slope = np.float32(UNIT / scale)
    distance = np.empty(width, np.float32)
    row = np.zeros(width + 2, np.int8)
    total = 0
    for y in range(height):
        for direction in range(4):
            first, n = _row_distances(distance, channels, y, direction)
            total += _sum(distance, n)
            row[0] = 0
            row[first + n :] = 0
            _to_couplings(row[first:], distance, slope, n)
            even = couplings[direction, 2 * (y & 1), (y >> 1) + 1]
            odd = couplings[direction, 2 * (y & 1) + 1, (y >> 1) + 1]
            for j in range((width + 1) >> 1):
                even[j + 1] = row[2 * j]
                odd[j + 1] = row[2 * j + 1]
    return total


@nb.njit(cache=True, nogil=True)
def cut_bonds(couplings: Couplings, depth: NDArray[np.float32], limit: float) -> None:
    """Make the coupling of neighbours repel where depth jumps by more than a limit; 0 is no measurement."""
    height, width = depth.shape
    for direction in range(4):
        down, right = FORWARD_ROWS[direction], FORWARD_COLUMNS[direction]
        for y in range(height - down):
            for x in range(max(0, -right), width - max(0, right)):
                here, there = depth[y, x], depth[y + down, x + right]
                if here > 0 and there > 0 and abs(here - there) > limit:
                    couplings[direction, 2 * (y & 1) + (x & 1), (y >> 1) + 1, (x >> 1) + 1] = LOWEST


@nb.njit(cache=True, nogil=True)
def bond_sum(couplings: Couplings, labels: NDArray[np.integer]) -> int:
    """Sum of the couplings of all pairs of neighbours with one label."""
    height, width = labels.shape
    total = 0
    for direction in range(4):
        down, right = FORWARD_ROWS[direction], FORWARD_COLUMNS[direction]
        for y in range(height - down):
            for x in range(max(0, -right), width - max(0, right)):
                if labels[y, x] == labels[y + down, x + right]:
                    total += couplings[direction, 2 * (y & 1) + (x & 1), (y >> 1) + 1, (x >> 1) + 1]
    return total


@nb.njit(cache=True, nogil=True)
def to_planes(planes: Spins, labels: NDArray[np.integer]) -> None:
    """Take a label image apart; what lies beyond the picture becomes ``OUTSIDE``."""
    planes[:] = OUTSIDE
    height, width = labels.shape
    for y in range(height):
        even, odd = planes[2 * (y & 1), (y >> 1) + 1], planes[2 * (y & 1) + 1, (y >> 1) + 1]
        for x in range(width >> 1):
            even[x + 1] = labels[y, 2 * x]
            odd[x + 1] = labels[y, 2 * x + 1]
        if width & 1:
            even[(width >> 1) + 1] = labels[y, width - 1]


@nb.njit(cache=True, nogil=True)
def from_planes(labels: NDArray[np.integer], planes: Spins) -> None:
    """Put a label image together again."""
    height, width = labels.shape
    for y in range(height):
        even, odd = planes[2 * (y & 1), (y >> 1) + 1], planes[2 * (y & 1) + 1, (y >> 1) + 1]
        for x in range(width >> 1):
            labels[y, 2 * x] = even[x + 1]
            labels[y, 2 * x + 1] = odd[x + 1]
        if width & 1:
            labels[y, width - 1] = even[(width >> 1) + 1]


@nb.njit(cache=True, nogil=True)
def _add_two(
    gain: Spins,
    spins: Spins,
    own: np.uint64,
    other: np.uint64,
    n1: np.uint64,
    n2: np.uint64,
    couplings: Couplings,
    j1: np.uint64,
    j2: np.uint64,
    lowest: np.int16,
    n: np.uint64,
) -> None:
    """Add what two neighbours of each pixel would gain by its change from its own label to another.

    All but ``gain`` are places in flat arrays, without a sign so that none counts from the end. Two neighbours and no
    more: the compiler gives up proving that arrays do not overlap when there are many in one loop.
    """
    none = np.int16(0)
    for x in range(n):
        mine, its, total = spins[own + x], spins[other + x], gain[x]
        j, label = max(np.int16(couplings[j1 + x]), lowest), spins[n1 + x]
        total = np.int16(total + np.int16((j if label == its else none) - (j if label == mine else none)))
        j, label = max(np.int16(couplings[j2 + x]), lowest), spins[n2 + x]
        total = np.int16(total + np.int16((j if label == its else none) - (j if label == mine else none)))
        gain[x] = total


@nb.njit(cache=True, nogil=True)
def _accept(spins: Spins, own: np.uint64, other: np.uint64, gain: Spins, n: np.uint64) -> None:
    none = np.int16(0)
    for x in range(n):
        mine, its = spins[own + x], spins[other + x]
        # Both inside of the picture: an odd side leaves the last field of every other plane outside.
        spins[own + x] = its if (gain[x] > none) & (its >= none) & (mine >= none) else mine


@nb.njit(cache=True, nogil=True)
def _update_row(
    spins: Spins,
    couplings: Couplings,
    rows: int,
    columns: int,
    noise: Spins,
    gain: Spins,
    plane: int,
    row: int,
    lowest: np.int16,
    draw: np.uint64,
) -> None:
    """One Metropolis step for a row of a plane: every pixel may take over the label of one neighbour.

    ``spins`` and ``couplings`` are flat views of planes with so many rows and columns.
    """
    n = np.uint64(columns - 2)
    odd_row, odd_column = plane >> 1, plane & 1
    across, down, aslant = plane ^ 1, plane ^ 2, plane ^ 3
    # Of an even row the one above lies a row back in its plane, of an odd one the row below a row on; columns alike.
    north, south = row - 1 + odd_row, row + odd_row
    west = odd_column
    own = (plane * rows + row) * columns + 1
    w = (across * rows + row) * columns + west
    u, d = (down * rows + north) * columns + 1, (down * rows + south) * columns + 1
    nw, sw = (aslant * rows + north) * columns + west, (aslant * rows + south) * columns + west
    to_e = (plane * rows + row) * columns + 1
    to_w = (across * rows + row) * columns + west
    to_u = (down * rows + north) * columns + 1
    to_nw = (aslant * rows + north) * columns + west
    one = 4 * rows * columns
    to_d, to_se, to_sw, to_ne = one + to_e, 2 * one + to_e, 3 * one + to_e, 3 * one + to_nw + 1
    to_u, to_nw = one + to_u, 2 * one + to_nw
    which = draw & np.uint64(7)
    other = w
    if which == 1:
        other = w + 1
    elif which == 2:
        other = u
    elif which == 3:
        other = d
    elif which == 4:
        other = nw
    elif which == 5:
        other = nw + 1
    elif which == 6:
        other = sw
    elif which == 7:
        other = sw + 1
    start = (draw >> np.uint64(8)) % (np.uint64(noise.size) - n + np.uint64(1))
    for x in range(n):
        gain[x] = noise[start + x]
    mine, its = np.uint64(own), np.uint64(other)
    _add_two(
        gain, spins, mine, its, np.uint64(w), np.uint64(w + 1), couplings, np.uint64(to_w), np.uint64(to_e), lowest, n
    )
    _add_two(gain, spins, mine, its, np.uint64(u), np.uint64(d), couplings, np.uint64(to_u), np.uint64(to_d), lowest, n)
    _add_two(
        gain,
        spins,
        mine,
        its,
        np.uint64(nw),
        np.uint64(sw + 1),
        couplings,
        np.uint64(to_nw),
        np.uint64(to_se),
        lowest,
        n,
    )
    _add_two(
        gain,
        spins,
        mine,
        its,
        np.uint64(nw + 1),
        np.uint64(sw),
        couplings,
        np.uint64(to_ne),
        np.uint64(to_sw),
        lowest,
        n,
    )
    _accept(spins, mine, its, gain, n)


@nb.njit(cache=True, nogil=True)
def sweep(planes: Spins, couplings: Couplings, noise: Spins, lowest: Spins, seed: np.uint64) -> None:
    """Metropolis sweeps over all pixels, in place.

    Parameters
    ----------
    planes : (4, height / 2 + 2, width / 2 + 2) int16
        Labels.
    couplings : (4, 4, height / 2 + 2, width / 2 + 2) int8
    noise : (n_sweeps, n) int16
        Draws of the energy that a change may cost, n ≥ width / 2 of every sweep.
    lowest : (n_sweeps,) int16
        Couplings below count as this.
    seed : uint64
    """
    rows, columns = planes.shape[1], planes.shape[2]
    spins, flat = planes.reshape(-1), couplings.reshape(-1)
    gain = np.empty(columns, np.int16)
    for n_swept in range(len(lowest)):
        for plane in range(4):
            for row in range(rows - 2):
                place = np.uint64((n_swept * 4 + plane) * (rows - 2) + row)
                draw = _mixed(seed + (place + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15))
                _update_row(spins, flat, rows, columns, noise[n_swept], gain, plane, row + 1, lowest[n_swept], draw)
