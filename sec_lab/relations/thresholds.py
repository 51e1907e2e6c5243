"""Relations by thresholds on the normalized counters of hints, the second half of A.1."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation
from sec_lab.relations.counts import ScanLineCounts, scan_lines
from sec_lab.relations.record import SegmentRelations

Normalization = Literal["scan lines", "pixel area"]

TOUCHING_THRESHOLD: Mapping[Normalization, float] = MappingProxyType({"scan lines": 0.02, "pixel area": 0.0025})
"""Share of touching hints that a touching pair must exceed.

Scan lines: 0.02 is a contact on one in 25 of the lines that cross the smaller segment. A hand that holds a ball has
nine times as much (.18–.20), a segment that leans on another with one of its four sides .25; less is noise at a border.
Pixel area: the same for a round segment 40 pixels across, as is usual in the thesis's 320×256 images; it holds for
segments of about that size only.
"""

OVERLAPPING_THRESHOLD: Mapping[Normalization, float] = MappingProxyType({"scan lines": 0.4, "pixel area": 0.025})
"""Share of overlapping hints that an overlapping pair must exceed.

Scan lines: a segment inside another is surrounded on all of its lines (1.00), and still on .70 of them where a hand
covers a part. A segment that has begun to cross a rim is surrounded by what lies beyond on .27 of its lines, which is
not enough. The middle is .48, but .50 is what a square at the image border has exactly (surrounded in one direction of
two), where a pixel more or less would decide; so the threshold keeps away from it. Pixel area: as for touching.
"""


def normalized_counts(
    counts: ScanLineCounts, *, normalization: Normalization = "scan lines"
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Counters of hints, normalized by the size of the smaller segment (A.1).

    Parameters
    ----------
    counts : ScanLineCounts
    normalization : {"scan lines", "pixel area"}, optional
        What the size is: the lines that cross the segment (C^t / 2l and C^o / l, the share of sides and lines on which
        the relation is seen), or its pixels as printed in A.1 (C^t / N and C^o / N).

    Returns
    -------
    touching : (n, n) float64
        Symmetric.
    overlapping : (n, n) float64
        Directed: i (row) surrounds j (column). Negative counters, hints against, are 0.

    Raises
    ------
    ValueError
        If the normalization is unknown, or pixels are asked for and not known.

    Examples
    --------
    >>> touching, overlapping = normalized_counts(scan_lines([[1, 1, 1], [1, 4, 1], [1, 1, 1]]))
    >>> touching[0, 1], overlapping[0, 1]
    (np.float64(1.0), np.float64(1.0))
    """
    clamped = np.maximum(counts.overlapping, 0)
    if normalization == "scan lines":
        # Departure: divided by pixels, counters of lines fall as 1 / size of the image, so that no fixed threshold
        # serves images of different sizes; lines divided by lines do not.
        smaller = np.minimum.outer(counts.lines, counts.lines)
        return counts.touching / (2 * smaller), clamped / smaller
    if normalization != "pixel area":
        raise ValueError(f"normalization: expected one of {get_args(Normalization)}, got {normalization!r}")
    if counts.pixels is None:
        raise ValueError("normalization: expected counts with pixels for 'pixel area', got sequences without")
    smaller = np.minimum.outer(counts.pixels, counts.pixels)
    return counts.touching / smaller, clamped / smaller


def relations_from_counts(
    counts: ScanLineCounts,
    *,
    normalization: Normalization = "scan lines",
    touching_threshold: float | None = None,
    overlapping_threshold: float | None = None,
) -> SegmentRelations:
    """Relations of all pairs of segments by thresholds on the normalized counters (A.1).

    A pair overlaps if one of the two surrounds the other on a large enough share of lines; otherwise it touches if
    there are enough touching hints; otherwise there is no connection. A.1 does not say which of the two is decided
    first, but whatever lies inside a segment touches it as well.

    Parameters
    ----------
    counts : ScanLineCounts
    normalization : {"scan lines", "pixel area"}, optional
        See :func:`normalized_counts`.
    touching_threshold, overlapping_threshold : float, optional
        What the normalized counters must exceed; :data:`TOUCHING_THRESHOLD` and :data:`OVERLAPPING_THRESHOLD` of the
        normalization if left out.

    Returns
    -------
    SegmentRelations
        Positions are the centres (column, row) in pixels, if known.

    Raises
    ------
    ValueError
        If a threshold is negative or not finite, or for the reasons of :func:`normalized_counts`.

    Examples
    --------
    >>> relations_from_counts(scan_lines([[1, 1, 1], [1, 4, 1], [1, 1, 1]])).relation(1, 4)
    <Relation.OVERLAPPING: 1>
    """
    touching, overlapping = normalized_counts(counts, normalization=normalization)
    least_overlapping = as_threshold(
        overlapping_threshold, default=OVERLAPPING_THRESHOLD[normalization], what="overlapping_threshold"
    )
    least_touching = as_threshold(
        touching_threshold, default=TOUCHING_THRESHOLD[normalization], what="touching_threshold"
    )
    relations = (touching > least_touching) * np.uint8(Relation.TOUCHING)
    relations[np.maximum(overlapping, overlapping.T) > least_overlapping] = Relation.OVERLAPPING
    return SegmentRelations(counts.segments, relations, counts.centres)


def scan_line_relations(
    labels: ArrayLike,
    *,
    normalization: Normalization = "scan lines",
    touching_threshold: float | None = None,
    overlapping_threshold: float | None = None,
) -> SegmentRelations:
    """Relations of all pairs of segments of a label image by the scan-line method (A.1).

    The same as :func:`scan_lines` followed by :func:`relations_from_counts`.

    Parameters
    ----------
    labels : (height, width) array_like of int
        Segment label of every pixel, 0 or greater; every label is a segment, 0 too.
    normalization : {"scan lines", "pixel area"}, optional
        See :func:`normalized_counts`.
    touching_threshold, overlapping_threshold : float, optional
        See :func:`relations_from_counts`.

    Returns
    -------
    SegmentRelations
        Positions are the segments' centres (column, row) in pixels.

    Raises
    ------
    ValueError
        If the image is empty or not two-dimensional, a label is negative or not whole, there are more than
        :data:`~sec_lab.relations.MAX_SEGMENTS` segments, the normalization is unknown, or a threshold is negative or
        not finite.

    Examples
    --------
    >>> scan_line_relations([[1, 1, 1, 1], [1, 4, 5, 1], [1, 1, 1, 1]]).relations
    array([[0, 1, 1],
           [1, 0, 2],
           [1, 2, 0]], dtype=uint8)
    """
    return relations_from_counts(
        scan_lines(labels),
        normalization=normalization,
        touching_threshold=touching_threshold,
        overlapping_threshold=overlapping_threshold,
    )


def as_threshold(value: float | None, *, default: float, what: str) -> float:
    """Threshold that is asked for, or the default if none is.

    Raises
    ------
    ValueError
        If it is negative or not finite.

    Examples
    --------
    >>> as_threshold(None, default=0.4, what="overlapping_threshold")
    0.4
    """
    if value is None:
        return default
    if not np.isfinite(value) or value < 0:
        raise ValueError(f"{what}: expected a finite number from 0 on, got {value}")
    return float(value)
