"""Contact by depth: what touches in the picture but is apart in space does not touch (§2.3, end of A.1)."""

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation, as_array
from sec_lab.relations.counts import as_label_image, coded_image, scan_lines
from sec_lab.relations.record import SegmentRelations, check_pairwise
from sec_lab.relations.thresholds import TOUCHING_THRESHOLD, relations_from_counts

Depth = NDArray[np.float32]
OverlapKind = Literal["on top", "inside", "apart", "unknown"]

CONTACT_STEP_M = 0.05
"""Largest step in depth, along the optical axis, between the two sides of a border at which segments may touch.

Things that touch have different depths where they meet in the picture: a ball of 7 cm that lies on a table hides what
is 1.5 cm (below) to 5 cm (at its sides) behind it if the camera looks down at 45°, a finger is 1 to 2 cm thick. An arm
or a lifted thing that passes above others is 8 cm and more in front. What is lifted by less than about 4 cm is not told
apart from what lies.
"""

SKIP_PX = 4
"""Pixels next to a border that say nothing of the depth of their segment: stereo smears the nearer of two surfaces over
the farther one by half the matching window, and labels are off by a pixel or two."""

LEAST_PLACES = 10
"""Places of a border with known depth that are needed to say anything; of a short border, a quarter of it."""

REACH_PX = 3
"""Pixels that are averaged after those."""

_RIM_M = 0.01
_RIM_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class DepthSteps:
    """Steps in depth along the common borders of all pairs of segments.

    Parameters
    ----------
    segments : (n,) int64
        Labels, ascending.
    known : (n, n) int64
        Places of the common border at which both depths are known, symmetric.
    small : (n, n) int64
        Those of them with a small step, symmetric.
    in_front : (n, n) int64
        Those of them at which i (row) is nearer than j (column) by more than that.

    Raises
    ------
    ValueError
        If the shapes disagree, or ``known`` or ``small`` is not symmetric.
    """

    segments: NDArray[np.int64]
    known: NDArray[np.int64]
    small: NDArray[np.int64]
    in_front: NDArray[np.int64]

    def __post_init__(self) -> None:
        for field in fields(self):
            array = np.array(getattr(self, field.name), dtype=np.int64)
            array.setflags(write=False)
            object.__setattr__(self, field.name, array)
        check_pairwise(self.known, self.segments, what="known")
        check_pairwise(self.small, self.segments, what="small")
        if self.in_front.shape != self.known.shape:
            raise ValueError(f"in_front: expected shape {self.known.shape}, got {self.in_front.shape}")

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), tuple(getattr(self, field.name) for field in fields(self))


def depth_steps(
    labels: ArrayLike, depth_m: ArrayLike, *, step_m: float = CONTACT_STEP_M, skip_px: int = SKIP_PX
) -> DepthSteps:
    """Steps in depth along the common borders of all pairs of segments.

    The depth of each side is the mean of a few pixels that lie ``skip_px`` pixels inside the segment. Where a segment
    is too thin for that, as at specks, the place does not count.

    Parameters
    ----------
    labels : (height, width) array_like of int
        Label image.
    depth_m : (height, width) array_like of float
        Metres along the optical axis; 0 where it is unknown.
    step_m : float, optional
        Largest step that is small, in metres.
    skip_px : int, optional
        Pixels next to the border that are passed over.

    Returns
    -------
    DepthSteps

    Raises
    ------
    ValueError
        If an image is none, sizes differ, a depth is negative or not finite, or a parameter is not allowed.

    Examples
    --------
    >>> labels, depth_m = np.ones((30, 60), np.uint8), np.ones((30, 60))
    >>> labels[5:25, 10:30], labels[5:25, 35:55] = 2, 3
    >>> depth_m[labels == 3] = 0.8
    >>> steps = depth_steps(labels, depth_m)
    >>> steps.small[0].tolist(), steps.in_front[2].tolist()
    ([0, 48, 0], [48, 0, 0])
    """
    if not np.isfinite(step_m) or step_m < 0:
        raise ValueError(f"step_m: expected a finite number from 0 on, got {step_m}")
    if skip_px < 0:
        raise ValueError(f"skip_px: expected a number from 0 on, got {skip_px}")
    codes, width, values = coded_image(as_label_image(labels))
    depth = as_depth(depth_m, shape=(len(codes), width))
    from sec_lab.relations import _border_kernels, _kernels, _plane_kernels

    words = codes.view(np.uint64)
    starts, first_run, segments = _kernels.find_runs(codes, words, width)
    planes = _plane_kernels.no_planes(len(segments))
    counted = _border_kernels.border_steps(
        codes, words, width, starts, first_run, segments, depth, step_m, skip_px, REACH_PX, planes
    )
    return DepthSteps(segments if values is None else values[segments], *counted)


def relations_by_depth(
    labels: ArrayLike, depth_m: ArrayLike, *, step_m: float = CONTACT_STEP_M, skip_px: int = SKIP_PX
) -> SegmentRelations:
    """Relations of all pairs of segments by scan lines (A.1), where segments that are apart in depth have none (§2.3).

    A pair keeps the share of its touching hints that its small steps have of all known ones. If that is not enough to
    touch any more, the pair is apart; overlapping without contact is a perspective effect too. Without enough known
    depth the picture alone decides.

    Parameters
    ----------
    labels, depth_m, step_m, skip_px
        As of :func:`depth_steps`.

    Returns
    -------
    SegmentRelations
        Positions are the segments' centres (column, row) in pixels.

    Raises
    ------
    ValueError
        For the reasons of :func:`depth_steps`.

    Examples
    --------
    >>> labels, depth_m = np.ones((30, 60), np.uint8), np.ones((30, 60))
    >>> labels[5:25, 10:30], labels[5:25, 35:55] = 2, 3
    >>> depth_m[labels == 3] = 0.8
    >>> relations_by_depth(labels, depth_m).relations
    array([[0, 1, 0],
           [1, 0, 0],
           [0, 0, 0]], dtype=uint8)
    """
    steps = depth_steps(labels, depth_m, step_m=step_m, skip_px=skip_px)
    counts = scan_lines(labels)
    found = relations_from_counts(counts)
    share = np.divide(steps.small, steps.known, out=np.ones(steps.known.shape), where=steps.known > 0)
    smaller = np.minimum.outer(counts.lines, counts.lines)
    apart = counts.touching * share <= TOUCHING_THRESHOLD["scan lines"] * 2 * smaller
    apart &= told(steps.known, counts.touching) & (counts.touching > 0)
    relations = np.where(apart, np.uint8(Relation.NON_TOUCHING), found.relations)
    return SegmentRelations(found.segments, relations, found.positions)


def overlap_kind(labels: ArrayLike, depth_m: ArrayLike, i: int, j: int) -> OverlapKind:
    """Tell *on top* from *inside*, which are the same in the picture (end of A.1).

    Of two overlapping segments the one is surrounded by the other. If it lies inside, the rim of the other hides a part
    of it: somewhere along their border the surrounding segment is in front. What lies on top hides and is not hidden.

    Parameters
    ----------
    labels, depth_m
        As of :func:`depth_steps`.
    i, j : int
        Labels of two segments, in any order.

    Returns
    -------
    {"on top", "inside", "apart", "unknown"}
        "apart" if the surrounded segment hovers in front of the other, "unknown" if too little depth is known. What
        fills a container to within 1 cm of its rim is seen as lying on top.

    Raises
    ------
    ValueError
        If a segment is not in the picture, none surrounds the other, or for the reasons of :func:`depth_steps`.

    Examples
    --------
    >>> labels, depth_m = np.ones((40, 40), np.uint8), np.full((40, 40), 0.9)
    >>> labels[12:28, 12:28], depth_m[12:28, 12:28] = 2, 0.93
    >>> overlap_kind(labels, depth_m, 2, 1), overlap_kind(labels, 1.83 - depth_m, 2, 1)
    ('inside', 'on top')
    """
    counts = scan_lines(labels)
    at = np.searchsorted(counts.segments, (i, j)).clip(max=len(counts.segments) - 1)
    for label, found in zip((i, j), counts.segments[at], strict=True):
        if found != label:
            raise ValueError(f"segments: expected labels of the picture, got {label}")
    hints = counts.overlapping[np.ix_(at, at)]
    if hints.max() <= 0:
        raise ValueError(f"segments: expected one that surrounds the other, got {i} and {j}")
    outer, inner = (at[0], at[1]) if hints[0, 1] >= hints[1, 0] else (at[1], at[0])
    steps = depth_steps(labels, depth_m, step_m=_RIM_M)
    known = steps.known[outer, inner]
    if not told(known, counts.touching[outer, inner]):
        return "unknown"
    if steps.in_front[outer, inner] > _RIM_SHARE * known:
        return "inside"
    wide = depth_steps(labels, depth_m)
    return "on top" if wide.small[outer, inner] > _RIM_SHARE * known else "apart"


def as_depth(depth_m: ArrayLike, *, shape: tuple[int, int]) -> Depth:
    """Depth image for the kernels, or one clear error.

    Raises
    ------
    ValueError
        If it has another shape, or a depth is negative or not finite.

    Examples
    --------
    >>> as_depth([[1.0, np.nan]], shape=(1, 2))
    Traceback (most recent call last):
    ...
    ValueError: depth_m: expected finite numbers from 0 (unknown) on, got nan
    """
    values = as_array(depth_m, what="depth_m")
    if values.shape != shape:
        raise ValueError(f"depth_m: expected shape {shape} as of the label image, got {values.shape}")
    depth = np.ascontiguousarray(values, dtype=np.float32)
    # One sum tells whether all is well; only if not, it is worth looking for what is wrong.
    if not (np.isfinite(depth.sum()) and depth.min() >= 0):
        wrong = ~(np.isfinite(depth) & (depth >= 0))
        if wrong.any():
            raise ValueError(f"depth_m: expected finite numbers from 0 (unknown) on, got {depth[wrong][0]}")
    depth = depth.view()
    depth.setflags(write=False)
    return depth


def told(known: NDArray[np.int64], hints: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether depth is known at enough places of a border with so many touching hints."""
    return np.asarray(known >= np.minimum(LEAST_PLACES, hints / 4))
