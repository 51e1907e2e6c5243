"""Compiled bookkeeping of :mod:`sec_lab.segmentation.tracking`: labels carried along, domains that get labels."""

import numba as nb
import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation._domain_kernels import bond_domains_of, borders_of, domains_of, join, root_of

Spins = NDArray[np.int16]
Channels = NDArray[np.uint8]
Couplings = NDArray[np.int8]
Domains = NDArray[np.int32]
Integers = NDArray[np.int64]
Floats = NDArray[np.float64]

NEW, LOST, SPLIT, MERGED, FOUND = 0, 1, 2, 3, 4
"""Kinds of events."""

VACANT, FRESH = 0, -1


@nb.njit(cache=True, nogil=True)
def _keep_row(
    new: Spins, labels: Spins, first: Channels, second: Channels, worst: np.int32, y: int, width: int
) -> None:
    """Labels of a row that stands still."""
    for x in range(width):
        p = np.int32(second[0, y, x]) - np.int32(first[0, y, x])
        q = np.int32(second[1, y, x]) - np.int32(first[1, y, x])
        r = np.int32(second[2, y, x]) - np.int32(first[2, y, x])
        residual = np.int32(p * p + q * q + r * r)
        new[y, x] = labels[y, x] if residual <= worst else np.int16(VACANT)


@nb.njit(cache=True, nogil=True)
def warp(labels: Spins, before: Channels, after: Channels, flow: NDArray[np.float32], limit: float) -> Spins:
    """Labels carried along the flow (of fields of 2×2 pixels, in fields); 0 where the colours differ by too much."""
    height, width = labels.shape
    new = np.empty_like(labels)
    worst = np.int32(min(limit * limit, 200000.0))
    for y in range(height):
        # Most of a picture stands still, and that is faster; what moves is done anew.
        _keep_row(new, labels, before, after, worst, y, width)
        for j in range((width + 1) >> 1):
            along, down_by = flow[y >> 1, j, 0], flow[y >> 1, j, 1]
            if abs(along) < 0.25 and abs(down_by) < 0.25:
                continue
            right, down = np.int64(np.rint(2 * along)), np.int64(np.rint(2 * down_by))
            v = y + down
            for x in range(2 * j, min(2 * j + 2, width)):
                u = x + right
                if not (0 <= u < width and 0 <= v < height):
                    continue
                still, moved = np.int32(0), np.int32(0)
                for i in range(3):
                    here = np.int32(after[i, y, x])
                    p, q = here - np.int32(before[i, y, x]), here - np.int32(before[i, v, u])
                    still += np.int32(p * p)
                    moved += np.int32(q * q)
                if moved <= still:
                    new[y, x] = labels[v, u] if moved <= worst else np.int16(VACANT)
    return new


@nb.njit(cache=True, nogil=True)
def joined_within_labels(
    pairs: Integers, sums: Integers, counts: Integers, sizes: Integers, label_of: Integers, minimum: int, thickness: int
) -> Integers:
    """Domains of one label joined along borders that attract, and slight ones in any case.

    Returns
    -------
    (n_domains,) int64
        For every domain, the lowest number among those it was joined with.
    """
    n_domains = len(sizes)
    parents = np.arange(n_domains)
    bonds = np.zeros(n_domains, np.int64)
    for edge in range(len(sums)):
        bonds[pairs[edge, 0]] += counts[edge]
        bonds[pairs[edge, 1]] += counts[edge]
    slight = (sizes < minimum) | (6 * sizes < thickness * bonds)
    for edge in range(len(sums)):
        a, b = pairs[edge, 0], pairs[edge, 1]
        if label_of[a] == label_of[b] and sums[edge] > 0:
            join(parents, a, b)
    # Slight ones do not pass a connection on: each goes to one neighbour only.
    best = np.full(n_domains, -1)
    for edge in range(len(sums)):
        a, b = pairs[edge, 0], pairs[edge, 1]
        if label_of[a] != label_of[b]:
            continue
        for side in range(2):
            domain, other = pairs[edge, side], pairs[edge, 1 - side]
            if slight[domain] and not slight[other] and parents[domain] == domain:
                chosen = best[domain]
                if chosen < 0 or sums[edge] * counts[chosen] > sums[chosen] * counts[edge]:
                    best[domain] = edge
    for domain in range(n_domains):
        if best[domain] >= 0 and root_of(parents, domain) == domain:
            a, b = pairs[best[domain], 0], pairs[best[domain], 1]
            join(parents, a, b)
    for domain in range(n_domains):
        parents[domain] = root_of(parents, domain)
    return parents


@nb.njit(cache=True, nogil=True)
def moments_of(domains: Domains, channels: Channels, n_domains: int) -> Floats:
    """Of every second pixel of every second row: their number, sums of the three channels, of columns and of rows."""
    height, width = domains.shape
    moments = np.zeros((n_domains, 6))
    for y in range(0, height, 2):
        x = 0
        while x < width:
            domain = domains[y, x]
            n, a, b, c, columns = 0, 0, 0, 0, 0
            while x < width and domains[y, x] == domain:
                n += 1
                a += channels[0, y, x]
                b += channels[1, y, x]
                c += channels[2, y, x]
                columns += x
                x += 2
            moments[domain, 0] += n
            moments[domain, 1] += a
            moments[domain, 2] += b
            moments[domain, 3] += c
            moments[domain, 4] += columns
            moments[domain, 5] += n * y
    return moments


@nb.njit(cache=True, nogil=True)
def paint(labels: NDArray[np.integer], domains: Domains, label_of: Integers) -> None:
    """Give every pixel the label of its domain."""
    height, width = domains.shape
    for y in range(height):
        for x in range(width):
            labels[y, x] = label_of[domains[y, x]]


@nb.njit(cache=True, nogil=True)
def _colour_distance(first: Floats, second: Floats) -> float:
    total = 0.0
    for i in range(3):
        difference = first[1 + i] / max(first[0], 1.0) - second[1 + i] / max(second[0], 1.0)
        total += difference * difference
    return np.sqrt(total)


@nb.njit(cache=True, nogil=True)
def _place_distance(first: Floats, second: Floats) -> float:
    across = first[4] / max(first[0], 1.0) - second[4] / max(second[0], 1.0)
    along = first[5] / max(first[0], 1.0) - second[5] / max(second[0], 1.0)
    return np.sqrt(across * across + along * along)


@nb.njit(cache=True, nogil=True)
def assign(
    label_of: Integers,
    sizes: Integers,
    moments: Floats,
    pairs: Integers,
    sums: Integers,
    counts: Integers,
    memory: Floats,
    born: Integers,
    seen: Integers,
    apart: Integers,
    n_labels: int,
    step: int,
    minimum: int,
    thickness: int,
    colour_limit: float,
    reach: float,
    young: int,
    patience: int,
) -> tuple[Integers, int, list[tuple[int, int, int]]]:
    """Give every domain of a frame its label.

    Parameters
    ----------
    label_of : (n,) int64
        Label that each domain was carried along with; 0 for vacant ones.
    sizes, moments
        Of the domains; see :func:`moments_of`.
    pairs, sums, counts
        See :func:`borders_of`.
    memory : (capacity, 6) float64
        Last moments of every label; its number of pixels decays slowly. Changed, like the next three.
    born, seen : (capacity,) int64
        Step in which a label first and last was there.
    apart : (capacity,) int64
        Steps for which a label has been in two pieces by now.
    n_labels : int
        Labels 1 … ``n_labels`` have been given.
    step : int
    minimum, thickness : int
        A domain below is slight, in pixels.
    colour_limit : float
        Colours that differ by less are of one segment.
    reach : float
        Pixels within which a lost segment is found again.
    young, patience : int
        Steps for which a label may be taken back, and for which pieces of a segment keep one label.

    Returns
    -------
    final : (n,) int64
    n_labels : int
        Beyond the capacity if labels have run out; nothing else is of use then.
    events : list of tuple of int
        Kind and two labels, the second 0 if there is one only.
    """
    n_domains = len(sizes)
    final = np.zeros(n_domains, np.int64)
    origin = np.zeros(n_domains, np.int64)
    events = [(0, 0, 0)]
    events.clear()
    bonds = np.zeros(n_domains, np.int64)
    for edge in range(len(sums)):
        bonds[pairs[edge, 0]] += counts[edge]
        bonds[pairs[edge, 1]] += counts[edge]

    main = np.full(n_labels + 1, -1)
    for domain in range(n_domains):
        label = label_of[domain]
        if label > 0 and (main[label] < 0 or sizes[domain] > sizes[main[label]]):
            main[label] = domain

    pieces = np.zeros(n_labels + 1, np.int64)
    for domain in range(n_domains):
        label = label_of[domain]
        slight = sizes[domain] < minimum or 6 * sizes[domain] < thickness * bonds[domain]
        if label > 0 and main[label] == domain:
            # What has a label keeps it down to a quarter of what a new segment needs.
            if 4 * sizes[domain] >= minimum:
                final[domain] = label
        elif not slight:
            if label == VACANT:
                final[domain] = FRESH
            elif _colour_distance(moments[domain], moments[main[label]]) > colour_limit:
                final[domain] = FRESH
                origin[domain] = label
            else:
                pieces[label] += 1
                if apart[label] >= patience:
                    final[domain] = FRESH
                    origin[domain] = label
                else:
                    final[domain] = label
    for label in range(1, n_labels + 1):
        apart[label] = apart[label] + 1 if pieces[label] else 0

    # What its neighbour attracts is part of it: places that were uncovered, mostly.
    for edge in range(len(sums)):
        if sums[edge] <= 0:
            continue
        for side in range(2):
            domain, other = pairs[edge, side], pairs[edge, 1 - side]
            if final[domain] == FRESH and final[other] > 0:
                final[domain] = 0

    # The others without a label go to the neighbour with the highest mean coupling, from the settled ones outwards.
    best = np.full(n_domains, -1)
    settled = final != 0
    while True:
        best[:] = -1
        for edge in range(len(sums)):
            for side in range(2):
                domain, other = pairs[edge, side], pairs[edge, 1 - side]
                if settled[domain] or not settled[other]:
                    continue
                chosen = best[domain]
                if chosen < 0 or sums[edge] * counts[chosen] > sums[chosen] * counts[edge]:
                    best[domain] = edge
        changed = False
        for domain in range(n_domains):
            if best[domain] >= 0:
                edge = best[domain]
                other = pairs[edge, 0] if pairs[edge, 1] == domain else pairs[edge, 1]
                final[domain] = -2 - other if final[other] == FRESH else final[other]
                settled[domain] = True
                changed = True
        if not changed:
            break
    for domain in range(n_domains):
        if final[domain] == 0:
            final[domain] = FRESH

    present = np.zeros(n_labels + 1, np.bool_)
    for domain in range(n_domains):
        if final[domain] > 0:
            present[final[domain]] = True
    for domain in range(n_domains):
        if final[domain] != FRESH:
            continue
        chosen, least = 0, colour_limit
        for label in range(1, len(present)):
            # A quarter of the pixels was counted.
            if present[label] or sizes[domain] > 2 * 4 * memory[label, 0]:
                continue
            if _place_distance(moments[domain], memory[label]) > reach:
                continue
            distance = _colour_distance(moments[domain], memory[label])
            if distance < least:
                chosen, least = label, distance
        if chosen:
            final[domain] = chosen
            present[chosen] = True
            if seen[chosen] < step - 1:
                events.append((FOUND, chosen, 0))
            continue
        n_labels += 1
        if n_labels < len(born):
            final[domain] = n_labels
            born[n_labels] = step
            if origin[domain]:
                events.append((SPLIT, origin[domain], n_labels))
            else:
                events.append((NEW, n_labels, 0))
    if n_labels >= len(born):
        return final, n_labels, events
    for domain in range(n_domains):
        while final[domain] < 0:
            final[domain] = final[-2 - final[domain]]

    # A young label goes back to the older neighbour that attracts it.
    parents = np.arange(n_labels + 1)
    for edge in range(len(sums)):
        a, b = final[pairs[edge, 0]], final[pairs[edge, 1]]
        if a == b or sums[edge] <= 0:
            continue
        if born[a] > born[b] or (born[a] == born[b] and a > b):
            a, b = b, a
        if step - born[b] < young and born[b] > 0 and parents[b] == b:
            total = 0
            for other in range(len(sums)):
                p, q = final[pairs[other, 0]], final[pairs[other, 1]]
                if (p == a and q == b) or (p == b and q == a):
                    total += sums[other]
            if total > 0:
                parents[b] = a
                memory[b] = 0
                events.append((MERGED, b, a))
    for domain in range(n_domains):
        label = final[domain]
        while parents[label] != label:
            label = parents[label]
        final[domain] = label

    now = np.zeros((n_labels + 1, 6))
    for domain in range(n_domains):
        now[final[domain]] += moments[domain]
    for label in range(1, n_labels + 1):
        if now[label, 0] > 0:
            seen[label] = step
            remembered = max(now[label, 0], 0.98 * memory[label, 0])
            memory[label] = now[label] * (remembered / now[label, 0])
        elif seen[label] == step - 1 and parents[label] == label:
            events.append((LOST, label, 0))
    return final, n_labels, events


@nb.njit(cache=True, nogil=True)
def settle(
    labels: Spins,
    channels: Channels,
    couplings: Couplings,
    memory: Floats,
    born: Integers,
    seen: Integers,
    apart: Integers,
    n_labels: int,
    step: int,
    by_bonds: int,
    minimum: int,
    thickness: int,
    colour_limit: float,
    reach: float,
    young: int,
    patience: int,
) -> tuple[int, list[tuple[int, int, int]]]:
    """Give every domain of a swept label image its final label, in place; see :func:`assign`.

    Unless ``by_bonds`` is 0, a label falls apart where no bond with J > 0 holds its pixels together.
    """
    if by_bonds:
        domains, sizes, label_of = bond_domains_of(labels, couplings, 0)
        pairs, sums, counts = borders_of(domains, couplings, len(sizes))
        roots = joined_within_labels(pairs, sums, counts, sizes, label_of, minimum, thickness)
        number = np.empty(len(roots), np.int64)
        n = 0
        for domain in range(len(roots)):
            if roots[domain] == domain:
                label_of[n] = label_of[domain]
                number[domain] = n
                n += 1
            number[domain] = number[roots[domain]]
        totals = np.zeros(n, np.int64)
        for domain in range(len(roots)):
            totals[number[domain]] += sizes[domain]
        paint(domains, domains, number)
        sizes, label_of = totals, label_of[:n].copy()
    else:
        domains, sizes, label_of = domains_of(labels)
    pairs, sums, counts = borders_of(domains, couplings, len(sizes))
    moments = moments_of(domains, channels, len(sizes))
    final, n_labels, events = assign(
        label_of,
        sizes,
        moments,
        pairs,
        sums,
        counts,
        memory,
        born,
        seen,
        apart,
        n_labels,
        step,
        minimum,
        thickness,
        colour_limit,
        reach,
        young,
        patience,
    )
    if n_labels < len(born):
        paint(labels, domains, final)
    return n_labels, events
