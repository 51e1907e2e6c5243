"""Relations of boxes in space (§4.2)."""

import numpy as np
from numpy.typing import ArrayLike

from sec_lab.codes import Relation, as_array
from sec_lab.relations.record import SegmentRelations

# Closed boxes that share a face often miss each other by the rounding of their corners; a nanometre is no real gap.
_ROUNDING_M = 1e-9


def box_relations(boxes: ArrayLike, *, segments: ArrayLike | None = None, gap_m: float = 0.0) -> SegmentRelations:
    """Relations of axis-aligned boxes in space (§4.2: intersecting bounding boxes give an edge).

    Case Study II knows touching and non-touching only: boxes that intersect, one inside the other included, touch.

    Parameters
    ----------
    boxes : (n, 2, 3) array_like of float
        Corner with the smallest and corner with the largest coordinates of each box, in metres.
    segments : (n,) array_like of int, optional
        Labels of the boxes; 1, …, n if left out.
    gap_m : float, optional
        Largest distance in metres at which two boxes still touch; 0: they share at least a point.

    Returns
    -------
    SegmentRelations
        Positions are the centres of the boxes in metres.

    Raises
    ------
    ValueError
        If the shape is another, a coordinate is not finite, a smallest coordinate exceeds the largest, or the gap is
        negative or not finite.

    Examples
    --------
    >>> table, cup, lamp = [[0, 0, 0], [1, 1, 0.1]], [[0.4, 0.4, 0.1], [0.5, 0.5, 0.2]], [[0, 0, 1], [1, 1, 1.2]]
    >>> box_relations([table, cup, lamp]).relations
    array([[0, 2, 0],
           [2, 0, 0],
           [0, 0, 0]], dtype=uint8)
    """
    corners = as_array(boxes, what="boxes").astype(np.float64)
    if corners.ndim != 3 or corners.shape[1:] != (2, 3):
        raise ValueError(f"boxes: expected shape (n, 2, 3), got {corners.shape}")
    if not np.isfinite(corners).all():
        raise ValueError(f"boxes: expected finite coordinates, got {corners[~np.isfinite(corners)][0]}")
    low, high = corners[:, 0], corners[:, 1]
    if (low > high).any():
        i, axis = np.argwhere(low > high)[0]
        raise ValueError(
            f"boxes: expected smallest before largest coordinates, got {low[i, axis]} and {high[i, axis]} "
            f"for {'xyz'[axis]} of box {i}"
        )
    if not np.isfinite(gap_m) or gap_m < 0:
        raise ValueError(f"gap_m: expected a finite number from 0 on, got {gap_m}")
    apart_m = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).clip(min=0.0)
    touching = np.linalg.norm(apart_m, axis=2) <= gap_m + _ROUNDING_M
    relations = np.where(touching, Relation.TOUCHING, Relation.NON_TOUCHING)
    np.fill_diagonal(relations, Relation.NON_TOUCHING)
    labels = np.arange(1, len(corners) + 1) if segments is None else segments
    return SegmentRelations(labels, relations, (low + high) / 2)
