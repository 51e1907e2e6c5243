"""Relations by counting the edges of the adjacency graph of the segments (§2.3)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation, Relations, as_integers
from sec_lab.relations.counts import scan_lines
from sec_lab.relations.record import SegmentRelations, check_pairwise
from sec_lab.relations.thresholds import TOUCHING_THRESHOLD, Normalization, as_threshold, normalized_counts


def edge_counting(adjacency: SegmentRelations | ArrayLike) -> SegmentRelations:
    """Touching and overlapping told apart by the edges of the adjacency graph of the segments (§2.3).

    §2.3 says that relations "can also be calculated by simply counting the number of edges at each graph node". The
    reading that gives the thesis's worked example (Fig. 2.5, 2.6): a segment whose only way to the others leads over
    one edge is surrounded by the segment at its other end. So an edge that lies on a cycle means touching, and an edge
    without which the graph falls apart (a bridge) overlapping.

    Parameters
    ----------
    adjacency : (n, n) array_like of bool or {0, 1}, or SegmentRelations
        Which segments are adjacent: a symmetric matrix, whose segments are called 1, …, n, or relations of which those
        that touch or overlap count, whichever of the two.

    Returns
    -------
    SegmentRelations
        Same segments and positions.

    Raises
    ------
    ValueError
        If the matrix is not square, symmetric, 0 on its diagonal, or has other values.

    Examples
    --------
    An object 4 straddles the rim of vessel 2 on background 1, vessel 3 stands apart:

    >>> edge_counting([[0, 1, 1, 1], [1, 0, 0, 1], [1, 0, 0, 0], [1, 1, 0, 0]]).relations
    array([[0, 2, 1, 2],
           [2, 0, 0, 2],
           [1, 0, 0, 0],
           [2, 2, 0, 0]], dtype=uint8)
    """
    if isinstance(adjacency, SegmentRelations):
        relations = _cycles_and_bridges(adjacency.relations > Relation.NON_TOUCHING)
        return SegmentRelations(adjacency.segments, relations, adjacency.positions)
    matrix = as_integers(adjacency, what="adjacency", ndim=2)
    other = (matrix != 0) & (matrix != 1)
    if other.any():
        raise ValueError(f"adjacency: expected 0 or 1, got {matrix[other][0]}")
    segments = np.arange(1, len(matrix) + 1, dtype=np.int64)
    check_pairwise(matrix, segments, what="adjacency")
    return SegmentRelations(segments, _cycles_and_bridges(matrix > 0))


def edge_count_relations(
    labels: ArrayLike,
    *,
    normalization: Normalization = "scan lines",
    touching_threshold: float | None = None,
) -> SegmentRelations:
    """Relations of all pairs of segments of a label image by counting edges (§2.3).

    Segments are adjacent if their normalized touching hints exceed the threshold; which edges mean touching and which
    overlapping, see :func:`edge_counting`.

    Parameters
    ----------
    labels : (height, width) array_like of int
        Segment label of every pixel, 0 or greater; every label is a segment, 0 too.
    normalization : {"scan lines", "pixel area"}, optional
        See :func:`~sec_lab.relations.normalized_counts`.
    touching_threshold : float, optional
        What the normalized touching hints of adjacent segments must exceed;
        :data:`~sec_lab.relations.TOUCHING_THRESHOLD` of the normalization if left out.

    Returns
    -------
    SegmentRelations
        Positions are the segments' centres (column, row) in pixels.

    Raises
    ------
    ValueError
        As in :func:`~sec_lab.relations.scan_line_relations`.

    Examples
    --------
    >>> edge_count_relations([[1, 1, 1, 1], [1, 4, 5, 1], [1, 1, 1, 1]]).relations
    array([[0, 2, 2],
           [2, 0, 2],
           [2, 2, 0]], dtype=uint8)
    """
    counts = scan_lines(labels)
    touching, _ = normalized_counts(counts, normalization=normalization)
    least_touching = as_threshold(
        touching_threshold, default=TOUCHING_THRESHOLD[normalization], what="touching_threshold"
    )
    return SegmentRelations(counts.segments, _cycles_and_bridges(touching > least_touching), counts.centres)


def _cycles_and_bridges(adjacent: NDArray[np.bool_]) -> Relations:
    import networkx as nx

    graph: nx.Graph = nx.Graph()
    graph.add_edges_from(np.argwhere(np.triu(adjacent)).tolist())
    relations = np.where(adjacent, np.uint8(Relation.TOUCHING), np.uint8(Relation.NON_TOUCHING))
    for i, j in nx.bridges(graph):
        relations[i, j] = relations[j, i] = Relation.OVERLAPPING
    return relations
