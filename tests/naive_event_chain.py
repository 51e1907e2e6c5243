"""Slow, obvious reference of step 4 (§2.5): the chain as strings of digits, built pair by pair."""

from collections.abc import Mapping, Sequence

NaiveGraph = tuple[set[int], Mapping[frozenset[int], int]]
"""Segments that are there, and the relation of each pair that touches or overlaps."""


def naive_rows(graphs: Sequence[NaiveGraph]) -> dict[tuple[int, int], str]:
    """Rows of ξ_o by pair, larger label first, in the order of the thesis."""
    segments = sorted(set().union(*(present for present, _ in graphs)))
    rows = {}
    for j in segments:
        for i in segments:
            if i > j:
                rows[i, j] = "".join(_relation(graph, i, j) for graph in graphs)
    return rows


def naive_main_frames(graphs: Sequence[NaiveGraph]) -> list[int]:
    """Frames at which something is other than in the frame before."""
    rows = naive_rows(graphs).values()
    present = [graph[0] for graph in graphs]
    return [
        frame
        for frame in range(len(graphs))
        if frame == 0 or present[frame] != present[frame - 1] or any(row[frame] != row[frame - 1] for row in rows)
    ]


def naive_derived(row: str) -> list[str]:
    """Row of ξ_d."""
    return [row[k] + row[k + 1] for k in range(len(row) - 1)]


def naive_compressed(row: str) -> list[str]:
    """Row of ξ_c."""
    return [change for change in naive_derived(row) if change not in ("00", "11", "22", "99")]


def _relation(graph: NaiveGraph, i: int, j: int) -> str:
    present, relations = graph
    if i not in present or j not in present:
        return "9"
    return str(relations.get(frozenset((i, j)), 0))
