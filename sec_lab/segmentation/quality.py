"""How good a segmentation is, held against the truth: what it covers, and whether objects keep their labels (§2.2).

Everything hangs on segments that keep their labels, so two questions are asked. Are the segments the right ones:
*covering* weighs every true segment by its area, *object IoU* counts every object alike. And does an object carry one
label all the time, that nothing else carries: *kept*.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from itertools import zip_longest
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array
from sec_lab.segmentation.record import MAX_LABEL, as_label

MIN_PIXELS = 50
"""An object of fewer pixels is not held to be visible; of 320×256 pixels they are 0.06 %."""


@dataclass(frozen=True, eq=False)
class Quality:
    """How well the label images of a movie agree with the true ones.

    Parameters
    ----------
    covering : float
        Mean of ``covering_by_frame``, from 0 to 1 (best).
    object_iou : float
        Mean of ``iou_of`` over objects, from 0 to 1.
    kept : float
        Mean of ``kept_of`` over objects, from 0 to 1.
    n_labels : int
        Different labels in the whole movie; every one of them becomes a segment of the chain.
    covering_by_frame : (n_frames,) array_like of float
        See :func:`covering`.
    iou_of : mapping of int to float
        By true label of an object: mean over the frames in which it is visible of its intersection over union (IoU)
        with the segment that fits it best there, whatever its label.
    kept_of : mapping of int to float
        By true label of an object: share of the frames in which it is visible and wears its own label (see
        :func:`quality`).
    """

    covering: float
    object_iou: float
    kept: float
    n_labels: int
    covering_by_frame: NDArray[np.float64]
    iou_of: Mapping[int, float]
    kept_of: Mapping[int, float]

    def __post_init__(self) -> None:
        by_frame = np.array(self.covering_by_frame, dtype=np.float64)
        if by_frame.ndim != 1 or not by_frame.size:
            raise ValueError(f"covering_by_frame: expected one number a frame, got shape {by_frame.shape}")
        by_frame.setflags(write=False)
        object.__setattr__(self, "covering_by_frame", by_frame)
        for name in ("iou_of", "kept_of"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __reduce__(self) -> tuple[object, ...]:
        values = (getattr(self, field.name) for field in fields(self))
        return type(self), tuple(dict(value) if isinstance(value, Mapping) else value for value in values)


@dataclass(frozen=True, eq=False)
class _Overlaps:
    """One frame: for every true segment (ascending) its pixels, its best IoU and its most frequent label."""

    truth: NDArray[np.int64]
    pixels: NDArray[np.int64]
    best_iou: NDArray[np.float64]
    top_label: NDArray[np.int64]
    labels: NDArray[np.int64]

    @property
    def covering(self) -> float:
        return float((self.pixels * self.best_iou).sum() / self.pixels.sum())


def covering(labels: ArrayLike, truth: ArrayLike) -> float:
    """Covering of the true segments of one frame by the found ones (Arbeláez et al. 2011, IEEE TPAMI 33(5)).

    Every true segment is given the largest intersection over union that it has with any found segment; the mean of
    these is weighted by area. The background is a segment like any other.

    Parameters
    ----------
    labels, truth : (height, width) array_like of int
        Found and true labels, from 0 to 65,535.

    Returns
    -------
    float
        From 0 to 1, which is reached by equal segments only, whatever their labels.

    Raises
    ------
    ValueError
        If an array is no label image, or they differ in size.

    Examples
    --------
    Of the first segment two of three pixels are found (IoU 2/3), of the second all, and one too many (1/2):

    >>> round(covering([[7, 7, 9, 9]], [[1, 1, 1, 2]]), 3)
    0.625
    """
    return _overlaps(labels, truth).covering


def quality(
    labels: Iterable[ArrayLike],
    truth: Iterable[ArrayLike],
    *,
    background: int | None = None,
    min_pixels: int = MIN_PIXELS,
) -> Quality:
    """Hold the label images of a movie against the true ones; both are read frame by frame, nothing is kept.

    In each frame an object *wears* the label that most of its pixels have. Its *dominant* label is the one that it
    wears in most frames. It is its *own* label if it is the dominant label of no other object and not of the
    background: an object that is not told from another is not kept, and neither is the other. Of equally frequent
    labels the smaller one counts.

    Parameters
    ----------
    labels : iterable of (height, width) array_like of int, or Segmentation
        Found labels.
    truth : iterable of (height, width) array_like of int
        True labels, as many.
    background : int, optional
        True label of the background, which is no object; without it every true segment is an object.
    min_pixels : int, optional
        An object is visible in the frames in which it has at least so many pixels. What is never visible is no object.

    Returns
    -------
    Quality

    Raises
    ------
    ValueError
        If there is no frame, there are more of the one than of the other, an array is no label image, found and true
        labels differ in size, no object is ever visible, or an option is not allowed. What is wrong with an image is
        said with its place in the movie, counted from 0.

    Examples
    --------
    An object wears label 7 in two of the three frames and covers half of a segment in the third:

    >>> truth = [[[1, 1, 2, 2]], [[1, 1, 2, 2]], [[1, 1, 2, 2]]]
    >>> labels = [[[3, 3, 7, 7]], [[3, 3, 7, 7]], [[3, 3, 3, 3]]]
    >>> found = quality(labels, truth, background=1, min_pixels=1)
    >>> round(found.kept, 3), round(found.object_iou, 3), round(found.covering, 3), found.n_labels
    (0.667, 0.833, 0.833, 2)
    """
    if background is not None:
        background = as_label(background, what="background")
    if min_pixels < 1:
        raise ValueError(f"min_pixels: expected at least 1, got {min_pixels}")
    by_frame: list[float] = []
    ious: defaultdict[int, list[float]] = defaultdict(list)
    worn: defaultdict[int, Counter[int]] = defaultdict(Counter)
    seen: set[int] = set()
    for place, (found, true) in enumerate(zip_longest(labels, truth)):
        if found is None or true is None:
            more, fewer = ("truth", "labels") if found is None else ("labels", "truth")
            raise ValueError(f"{fewer}: expected as many label images as of {more}, got {place}")
        try:
            frame = _overlaps(found, true)
        except ValueError as error:
            raise ValueError(f"label image {place}: {error}") from error
        by_frame.append(frame.covering)
        seen.update(frame.labels.tolist())
        for k in np.flatnonzero(frame.pixels >= min_pixels).tolist():
            segment = int(frame.truth[k])
            ious[segment].append(float(frame.best_iou[k]))
            worn[segment][int(frame.top_label[k])] += 1
    if not by_frame:
        raise ValueError("labels: expected at least one label image, got none")
    objects = sorted(segment for segment in worn if segment != background)
    if not objects:
        raise ValueError(f"truth: expected an object of {min_pixels} pixels or more in some frame, got none")
    dominant = {segment: min(counts, key=lambda label: (-counts[label], label)) for segment, counts in worn.items()}
    n_wearers = Counter(dominant.values())
    iou_of = {segment: float(np.mean(ious[segment])) for segment in objects}
    kept_of = {
        segment: worn[segment][dominant[segment]] / worn[segment].total() if n_wearers[dominant[segment]] == 1 else 0.0
        for segment in objects
    }
    return Quality(
        covering=float(np.mean(by_frame)),
        object_iou=float(np.mean(list(iou_of.values()))),
        kept=float(np.mean(list(kept_of.values()))),
        n_labels=len(seen),
        covering_by_frame=np.array(by_frame),
        iou_of=iou_of,
        kept_of=kept_of,
    )


def _overlaps(labels: ArrayLike, truth: ArrayLike) -> _Overlaps:
    found, true = _label_image(labels, what="labels"), _label_image(truth, what="truth")
    if found.shape != true.shape:
        raise ValueError(f"labels: expected shape {true.shape} like the truth, got {found.shape}")
    # One code for both labels. Along rows it seldom changes, so runs are sorted instead of pixels.
    codes = true.astype(np.uint32).ravel()
    codes <<= np.uint32(16)
    codes |= found.ravel()
    starts = np.concatenate([[0], np.flatnonzero(codes[1:] != codes[:-1]) + 1])
    pairs, pair_of_run = np.unique(codes[starts], return_inverse=True)
    shared = np.zeros(len(pairs), dtype=np.int64)
    np.add.at(shared, pair_of_run, np.diff(starts, append=codes.size))
    segments, first, segment_of = np.unique(pairs >> np.uint32(16), return_index=True, return_inverse=True)
    present, label_of = np.unique(pairs & np.uint32(MAX_LABEL), return_inverse=True)
    pixels = np.add.reduceat(shared, first)
    label_pixels = np.zeros(len(present), dtype=np.int64)
    np.add.at(label_pixels, label_of, shared)
    iou = shared / (pixels[segment_of] + label_pixels[label_of] - shared)
    by_frequency = np.lexsort((label_of, -shared, segment_of))
    return _Overlaps(
        truth=segments.astype(np.int64),
        pixels=pixels,
        best_iou=np.maximum.reduceat(iou, first),
        top_label=present[label_of[by_frequency[first]]].astype(np.int64),
        labels=present.astype(np.int64),
    )


def _label_image(values: ArrayLike, *, what: str) -> NDArray[Any]:
    """Labels of one frame as whole numbers that fit into 16 bits."""
    image = as_array(values, what=what, ndim=2)
    if not image.size:
        raise ValueError(f"{what}: expected at least one pixel, got shape {image.shape}")
    if image.dtype.kind == "f":
        raise ValueError(f"{what}: expected whole numbers, got values of {image.dtype}")
    if image.dtype.kind == "i" and image.min() < 0:
        raise ValueError(f"{what}: expected labels from 0 on, got {image.min()}")
    if image.dtype.itemsize > 2 and image.max() > MAX_LABEL:
        raise ValueError(f"{what}: expected labels up to {MAX_LABEL}, got {image.max()}")
    return image.astype(np.uint16, copy=False)
