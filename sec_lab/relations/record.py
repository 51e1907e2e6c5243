"""The record that step 2 gives: segments and the relation of every pair of them (§2.3)."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation, Relations, as_array, as_integers, as_relations


@dataclass(frozen=True, eq=False)
class SegmentRelations:
    """Segments of one picture or scene and their pairwise relations ρ_{i,j} = ρ_{j,i} (§2.3).

    Parameters
    ----------
    segments : (n,) array_like of int
        Segment labels, each once; they are kept in ascending order.
    relations : (n, n) array_like of {0, 1, 2}
        Symmetric :class:`~sec_lab.codes.Relation` codes in the order of ``segments``; the diagonal is 0. A segment
        that is absent is not listed, so 9 does not occur.
    positions : (n, 2) or (n, 3) array_like of float, optional
        Centres of the segments: (column, row) in pixels for label images, metres for boxes in space.

    Raises
    ------
    ValueError
        If shapes disagree, a segment occurs twice, the relations are not symmetric or unknown, or a position is not
        finite.

    Examples
    --------
    >>> found = SegmentRelations([4, 1], [[0, 2], [2, 0]], [[10, 20], [30, 40]])
    >>> found.segments, found.positions[0], found.relation(1, 4)
    (array([1, 4]), array([30., 40.]), <Relation.TOUCHING: 2>)
    """

    segments: NDArray[np.int64]
    relations: Relations
    positions: NDArray[np.float64] | None = None

    def __init__(self, segments: ArrayLike, relations: ArrayLike, positions: ArrayLike | None = None) -> None:
        labels = as_integers(segments, what="segments", ndim=1)
        codes = as_relations(relations, ndim=2)
        if (codes == Relation.ABSENT).any():
            raise ValueError("relations: expected 0, 1 or 2 between segments that are there, got 9 (absent)")
        check_pairwise(codes, labels, what="relations")
        centres = None if positions is None else _as_positions(positions, n=len(labels))
        if not (labels[1:] > labels[:-1]).all():
            order = np.argsort(labels, kind="stable")
            labels, codes = labels[order], codes[np.ix_(order, order)]
            centres = None if centres is None else centres[order]
            twice = labels[1:][labels[1:] == labels[:-1]]
            if twice.size:
                raise ValueError(f"segments: expected each label once, got {twice[0]} twice")
        for name, array in (("segments", labels), ("relations", codes), ("positions", centres)):
            if array is not None:
                array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __reduce__(self) -> tuple[object, ...]:
        # Arrays come back writable from a pickle; constructing anew protects them.
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    def relation(self, i: int, j: int) -> Relation:
        """Relation ρ of segments ``i`` and ``j``; absent if either of them is not there."""
        at = [np.flatnonzero(self.segments == label) for label in (i, j)]
        if not all(len(index) for index in at):
            return Relation.ABSENT
        return Relation(self.relations[at[0][0], at[1][0]])


def check_pairwise(matrix: NDArray[np.integer], labels: NDArray[np.int64], *, what: str) -> None:
    """Refuse a matrix that cannot say one thing of each pair of different segments.

    Parameters
    ----------
    matrix : ndarray of int
        Two-dimensional.
    labels : (n,) int64
        Segment of each row and column.
    what : str
        Name of the matrix in the error message.

    Raises
    ------
    ValueError
        If its shape is not (n, n), it is not symmetric, or its diagonal is not 0.

    Examples
    --------
    >>> check_pairwise(np.array([[0, 2], [1, 0]]), np.array([4, 7]), what="relations")
    Traceback (most recent call last):
    ...
    ValueError: relations: expected a symmetric matrix, got 2 for (4, 7) and 1 for (7, 4)
    """
    n = len(labels)
    if matrix.shape != (n, n):
        raise ValueError(f"{what}: expected shape ({n}, {n}) for {n} segments, got {matrix.shape}")
    diagonal = matrix.diagonal()
    if diagonal.any():
        raise ValueError(f"{what}: expected 0 on the diagonal, got {diagonal[diagonal != 0][0]}")
    uneven = matrix != matrix.T
    if uneven.any():
        i, j = np.argwhere(uneven)[0]
        raise ValueError(
            f"{what}: expected a symmetric matrix, "
            f"got {matrix[i, j]} for ({labels[i]}, {labels[j]}) and {matrix[j, i]} for ({labels[j]}, {labels[i]})"
        )


def _as_positions(values: ArrayLike, *, n: int) -> NDArray[np.float64]:
    array = as_array(values, what="positions", ndim=2).astype(np.float64)
    if array.shape not in ((n, 2), (n, 3)):
        raise ValueError(f"positions: expected shape ({n}, 2) or ({n}, 3), got {array.shape}")
    finite = np.isfinite(array)
    if not finite.all():
        raise ValueError(f"positions: expected finite numbers, got {array[~finite][0]}")
    return array
