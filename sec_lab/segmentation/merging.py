"""Fragments of one object taken together: what over-segmentation left apart (§2.11)."""

from collections.abc import Iterable, Iterator
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array
from sec_lab.segmentation.record import MAX_LABEL, FoundNames, Names, Segmentation, as_label

Groups = Iterable[Iterable[int]]


def as_groups(groups: Groups) -> tuple[tuple[int, ...], ...]:
    """Groups of labels that are to become one segment each; the first label of a group is the one that stays.

    Raises
    ------
    ValueError
        If a group has fewer than two labels, or a label is in it twice or in two groups.

    Examples
    --------
    >>> as_groups([[3, 5], [4, 7, 9]])
    ((3, 5), (4, 7, 9))
    """
    checked = tuple(tuple(as_label(label, what="groups") for label in group) for group in groups)
    seen: set[int] = set()
    for group in checked:
        if len(group) < 2:
            raise ValueError(f"groups: expected at least two segments to merge, got {list(group)}")
        for label in group:
            if label in seen:
                raise ValueError(f"groups: expected each segment once, got {label} twice")
            seen.add(label)
    return checked


def merged_labels(labels: ArrayLike, groups: Groups) -> NDArray[np.uint16]:
    """Label image in which the segments of each group carry the label of its first one.

    Parameters
    ----------
    labels : (height, width) array_like of int
        Labels from 0 to 65,535.
    groups : iterable of iterable of int
        Labels that belong together. Labels that are not in the image change nothing.

    Returns
    -------
    (height, width) ndarray of uint16

    Raises
    ------
    ValueError
        For the reasons of :func:`as_groups`, or if the image is no label image.

    Examples
    --------
    >>> merged_labels([[1, 3, 5]], [[3, 5]])
    array([[1, 3, 3]], dtype=uint16)
    """
    image = as_array(labels, what="label image", ndim=2)
    if image.dtype.kind not in "iub" or (image.size and not 0 <= image.min() <= image.max() <= MAX_LABEL):
        raise ValueError(f"label image: expected labels from 0 to {MAX_LABEL}, got values of {image.dtype}")
    return _new_labels(as_groups(groups))[image.astype(np.uint16, copy=False)]


def merged_segments(segmentation: Segmentation, groups: Groups) -> Segmentation:
    """The same label images with the fragments of objects taken together (§2.11).

    Segmentation alone cannot know what belongs together; somebody who does says it here, and relations, key frames and
    chain follow from the label images as if no fragment had ever been.

    Parameters
    ----------
    segmentation : Segmentation
    groups : iterable of iterable of int
        Labels that belong together. The first of a group stays, with its name, or with the first name that another of
        the group has.

    Returns
    -------
    Segmentation
        Lazy, like the given one.

    Raises
    ------
    ValueError
        For the reasons of :func:`as_groups`.

    Examples
    --------
    >>> two_halves = Segmentation.from_labels([[[1, 2, 3]]], background=1, names={3: "cup"})
    >>> whole = merged_segments(two_halves, [[2, 3]])
    >>> next(iter(whole)), whole.names[2]
    (array([[1, 2, 2]], dtype=uint16), 'cup')
    """
    checked = as_groups(groups)
    background = segmentation.background
    if background is not None:
        background = int(_new_labels(checked)[background])
    given = segmentation.names
    names = FoundNames(partial(merged_names, given, checked)) if isinstance(given, FoundNames) else None
    return Segmentation(
        partial(_merged, segmentation, checked),
        segmentation.size,
        segmentation.frames,
        background,
        merged_names(given, checked) if names is None else names,
    )


def merged_names(names: Names, groups: Groups) -> dict[int, str | None]:
    """Names after merging: a group is called by the first of its names.

    Examples
    --------
    >>> merged_names({3: None, 5: "cup", 7: "hand"}, [[3, 5]])
    {3: 'cup', 7: 'hand'}
    """
    merged = dict(names)
    for group in as_groups(groups):
        called = [merged.pop(label) for label in group if label in merged]
        if called:
            merged[group[0]] = next((name for name in called if name), None)
    return dict(sorted(merged.items()))


def _merged(
    segmentation: Segmentation, groups: tuple[tuple[int, ...], ...]
) -> Iterator[tuple[int, NDArray[np.uint16]]]:
    new_labels = _new_labels(groups)
    for number, labels in segmentation.numbered():
        yield number, new_labels[labels]


def _new_labels(groups: tuple[tuple[int, ...], ...]) -> NDArray[np.uint16]:
    new_labels = np.arange(MAX_LABEL + 1, dtype=np.uint16)
    for group in groups:
        new_labels[list(group)] = group[0]
    return new_labels
