"""Segments of the right picture called like those of the left one that they lie on (Fig. 2.3 (e, f))."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array


@dataclass(frozen=True, eq=False)
class MatchedLabels:
    """Segments of the right picture under the labels of the left one.

    Attributes
    ----------
    labels : (height, width) int64
        Right label image; a segment without a counterpart has a label that the left one does not have.
    agreeing : float
        Share, from 0 to 1, of the pixels with known disparity that have one label left and right.
    """

    labels: NDArray[np.int64]
    agreeing: float

    def __post_init__(self) -> None:
        labels = np.array(self.labels)
        labels.setflags(write=False)
        object.__setattr__(self, "labels", labels)


def matched_labels(left: ArrayLike, right: ArrayLike, disparity: ArrayLike) -> MatchedLabels:
    """Give the segments of the right picture the labels of the left ones that show the same.

    Pixels that show the same point, by their disparity, vote: each pair of segments with more votes than any other pair
    of either of the two gets one label.

    Parameters
    ----------
    left, right : (height, width) array_like of int
        Label images that were found independently of each other.
    disparity : (height, width) array_like of float
        Pixel (row, column) of the left picture is at (row, column − disparity) in the right one; NaN where unknown.

    Raises
    ------
    ValueError
        If the shapes differ, or no pixel of the left picture is seen in the right one.

    Examples
    --------
    >>> found = matched_labels([[1, 1, 2, 2]], [[8, 9, 9, 8]], [[1.0, 1.0, 1.0, 1.0]])
    >>> found.labels, round(found.agreeing, 2)
    (array([[1, 2, 2, 1]]), 1.0)
    """
    a, b = as_array(left, what="left", ndim=2).astype(np.int64), as_array(right, what="right", ndim=2).astype(np.int64)
    shift: NDArray[Any] = as_array(disparity, what="disparity", ndim=2)
    if not a.shape == b.shape == shift.shape:
        raise ValueError(f"right, disparity: expected shape {a.shape} like left, got {b.shape} and {shift.shape}")
    rows, columns = np.nonzero(np.isfinite(shift))
    places = columns - np.round(shift[rows, columns]).astype(np.int64)
    inside = (places >= 0) & (places < a.shape[1])
    rows, columns, places = rows[inside], columns[inside], places[inside]
    if not rows.size:
        raise ValueError("disparity: expected pixels that are seen in the right picture, got none")
    labels_a, index_a = np.unique(a[rows, columns], return_inverse=True)
    labels_b, index_b = np.unique(b, return_inverse=True)
    index_b = index_b.reshape(b.shape)
    votes = np.zeros((len(labels_a), len(labels_b)), dtype=np.int64)
    np.add.at(votes, (index_a, index_b[rows, places]), 1)
    new = int(max(a.max(), b.max())) + 1 + np.arange(len(labels_b))
    for j in range(len(labels_b)):
        i = int(votes[:, j].argmax())
        if votes[i, j] and votes[i].argmax() == j:
            new[j] = labels_a[i]
    named = new[index_b]
    return MatchedLabels(named, float(np.mean(named[rows, places] == a[rows, columns])))
