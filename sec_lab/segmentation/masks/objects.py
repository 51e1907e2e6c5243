"""Masks of single objects, which may overlap, and label images made of them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.record import Labels, Names, Segmentation

Mask = NDArray[np.bool_]
Overlap = Literal["error", "smaller on top", "first on top", "last on top"]


@dataclass(frozen=True, eq=False)
class ObjectMasks:
    """Masks of single objects frame by frame, overlaps as they are: nothing is kept, and iteration begins anew.

    Parameters
    ----------
    read : callable
        Gives, with every call, an iterator over pairs of frame number and list of (label, mask), in the order of the
        file; masks are (height, width) arrays of bool, one a label at most. An object that is absent is not listed, or
        has an empty mask.
    size : tuple of int
        (height, width) in pixels.
    frames : (n,) int64 ndarray
        Frame numbers.
    background : int
        Label that no object has.
    names : mapping of int to str or None
        Names of objects, by label.

    Examples
    --------
    >>> mask = np.ones((1, 2), dtype=bool)
    >>> objects = ObjectMasks(lambda: iter([(0, [(7, mask)])]), (1, 2), np.array([0]), 0, {7: "cup"})
    >>> [(number, [label for label, _ in masks]) for number, masks in objects]
    [(0, [7])]
    """

    read: Callable[[], Iterator[tuple[int, Sequence[tuple[int, Mask]]]]]
    size: tuple[int, int]
    frames: NDArray[np.int64]
    background: int
    names: Names

    def __iter__(self) -> Iterator[tuple[int, Sequence[tuple[int, Mask]]]]:
        return self.read()

    def __len__(self) -> int:
        return len(self.frames)


def flatten(objects: ObjectMasks, *, overlap: Overlap = "error") -> Segmentation:
    """Label images of masks of single objects.

    Parameters
    ----------
    objects : ObjectMasks
    overlap : {"error", "smaller on top", "first on top", "last on top"}, optional
        Whose pixel it is where masks overlap: nobody's, which is an error (default); that of the mask with fewer pixels
        in this frame (of equal ones the first), so a hand stays in front of the person it belongs to; that of the first
        or the last object in the order of the file. SAM 2 itself lets the smaller id win when it puts objects into one
        picture.

    Returns
    -------
    Segmentation

    Raises
    ------
    ValueError
        If the policy is unknown; while label images are read, if masks overlap that may not.

    Examples
    --------
    >>> body, hand = np.array([[True, True, True]]), np.array([[False, True, False]])
    >>> objects = ObjectMasks(lambda: iter([(0, [(1, hand), (2, body)])]), (1, 3), np.array([0]), 0, {})
    >>> next(iter(flatten(objects, overlap="smaller on top")))
    array([[2, 1, 2]], dtype=uint16)
    >>> next(iter(flatten(objects)))
    Traceback (most recent call last):
    ...
    ValueError: frame 0: objects 1 and 2 overlap in row 0, column 1: say with overlap=… whose pixel it is
    """
    check_overlap(overlap)
    read = partial(_flattened, objects, overlap)
    return Segmentation(read, objects.size, objects.frames, objects.background, objects.names)


def check_overlap(overlap: str) -> None:
    """Refuse an unknown policy.

    Raises
    ------
    ValueError
        If it is one.

    Examples
    --------
    >>> check_overlap("mine")
    Traceback (most recent call last):
    ...
    ValueError: overlap: expected one of ('error', 'smaller on top', 'first on top', 'last on top'), got 'mine'
    """
    if overlap not in get_args(Overlap):
        raise ValueError(f"overlap: expected one of {get_args(Overlap)}, got {overlap!r}")


def _flattened(objects: ObjectMasks, overlap: Overlap) -> Iterator[tuple[int, Labels]]:
    for number, masks in objects:
        image: Labels = np.full(objects.size, objects.background, dtype=np.uint16)
        for label, mask in _from_bottom_to_top(masks, overlap):
            if overlap == "error":
                _check_free(image, mask, label, objects.background, number)
            image[mask] = label
        yield number, image


def _from_bottom_to_top(masks: Sequence[tuple[int, Mask]], overlap: Overlap) -> Sequence[tuple[int, Mask]]:
    if overlap == "smaller on top":
        order = sorted(range(len(masks)), key=lambda place: (-np.count_nonzero(masks[place][1]), -place))
        return [masks[place] for place in order]
    return masks[::-1] if overlap == "first on top" else masks


def _check_free(image: Labels, mask: Mask, label: int, background: int, number: int) -> None:
    taken = mask & (image != background)
    if taken.any():
        row, column = np.argwhere(taken)[0]
        raise ValueError(
            f"frame {number}: objects {image[row, column]} and {label} overlap in row {row}, column {column}: "
            "say with overlap=… whose pixel it is"
        )
