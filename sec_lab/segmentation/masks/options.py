"""What is asked of a reader of masks, and the frame numbers that follow from it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sec_lab.files import UnusableFileError
from sec_lab.segmentation.record import MAX_LABEL, Names, as_frames

Item = TypeVar("Item")


MAX_FRAMES = 10_000_000
"""Most masks of a movie: 90 hours of it; a few bytes may claim many more."""


@dataclass(frozen=True)
class MaskOptions:
    """Options of :func:`~sec_lab.segmentation.masks.open_masks`, where they are described."""

    background: int | None = 0
    stride: int | None = None
    frames: Sequence[int] | None = None
    names: Names | None = None
    size: tuple[int, int] | None = None
    video: int | str | None = None


def number_frames(
    found: Sequence[int] | None, n_masks: int, *, options: MaskOptions, default_stride: int = 1
) -> NDArray[np.int64]:
    """Frame numbers of masks, none of them missing.

    Parameters
    ----------
    found : sequence of int or None
        Ascending numbers that the masks carry; None if they are known by their places only.
    n_masks : int
    options : MaskOptions
        ``frames`` replaces what was found; ``stride`` says how far two masks are apart.
    default_stride : int, optional
        What it is by the rules of the format.

    Returns
    -------
    (n_masks,) int64 ndarray

    Raises
    ------
    ValueError
        If a number is missing in the middle, there are not as many as masks, or more than ``MAX_FRAMES``.

    Examples
    --------
    >>> number_frames(None, 3, options=MaskOptions(stride=4))
    array([0, 4, 8])
    >>> number_frames([0, 1, 3], 3, options=MaskOptions())
    Traceback (most recent call last):
    ...
    ValueError: expected a mask for every frame, but frame 2 has none
    """
    if n_masks > MAX_FRAMES:
        raise ValueError(f"expected masks of at most {MAX_FRAMES} frames, got {n_masks}")
    if options.frames is not None:
        frames = as_frames(options.frames)
        if len(frames) != n_masks:
            raise ValueError(f"expected {len(frames)} masks, one for each of the given frames, got {n_masks}")
        return frames
    stride = options.stride or default_stride
    if found is None:
        return as_frames(np.arange(n_masks) * stride)
    for number, following in pairwise(found):
        if following - number != stride:
            every = "every frame" if stride == 1 else f"every {stride}th frame"
            if following - number < stride:
                raise ValueError(f"expected a mask for {every}, got masks for {number} and {following}")
            steps = {b - a for a, b in pairwise(found)}
            hint = f" (if all is there, say stride={steps.pop()})" if len(steps) == 1 and len(found) > 2 else ""
            raise ValueError(f"expected a mask for {every}, but frame {number + stride} has none{hint}")
    return as_frames(found)


def check_size(size: tuple[int, int], options: MaskOptions) -> None:
    """Refuse masks of another size than the pictures have.

    Raises
    ------
    ValueError
        If it is so.

    Examples
    --------
    >>> check_size((240, 320), MaskOptions(size=(256, 320)))
    Traceback (most recent call last):
    ...
    ValueError: expected masks of 256×320 like the pictures, got 240×320
    """
    if options.size is not None and tuple(options.size) != tuple(size):
        raise ValueError(
            f"expected masks of {options.size[0]}×{options.size[1]} like the pictures, got {size[0]}×{size[1]}"
        )


def labels_of_ids(ids: Sequence[int], *, background: int) -> dict[int, int]:
    """Labels of objects: their ids wherever that is possible.

    If an id is that of the background (SA-V counts objects from 0 on, and 0 is the background elsewhere), every label
    is its id + 1, as in SAM 2's own loader. If an id is then larger than 65,535, objects are numbered from 1 on in
    their order.

    Parameters
    ----------
    ids : sequence of int
        Each once.
    background : int
        Label that no object may have.

    Returns
    -------
    dict of int to int

    Raises
    ------
    ValueError
        If there are more than 65,535 objects, or an id is negative.

    Examples
    --------
    >>> labels_of_ids([1005, 2003], background=0), labels_of_ids([0, 3], background=0)
    ({1005: 1005, 2003: 2003}, {0: 1, 3: 4})
    >>> labels_of_ids([70_000, 12], background=1)
    {70000: 2, 12: 3}
    """
    if len(ids) > MAX_LABEL:
        raise ValueError(f"expected at most {MAX_LABEL} objects, got {len(ids)}")
    for number in ids:
        if number < 0:
            raise ValueError(f"expected ids from 0 on, got {number}")
    for shift in (0, 1):
        labels = {number: number + shift for number in ids}
        if background not in labels.values() and max(labels.values(), default=0) <= MAX_LABEL:
            return labels
    free = (label for label in range(1, MAX_LABEL + 2) if label != background)
    return dict(zip(ids, free, strict=False))


def names_of_labels(
    labels: Mapping[int, int], *, told: Mapping[int, str | None], options: MaskOptions, background: int
) -> dict[int, str | None]:
    """Names of labels: those that are asked for, by id; else those that the file tells; else the id, if it is another.

    Parameters
    ----------
    labels : mapping of int to int
        Label of each id.
    told : mapping of int to str or None
        Names by id, as the file tells them.
    options : MaskOptions
    background : int

    Returns
    -------
    dict of int to str or None

    Raises
    ------
    ValueError
        If a name is asked for that belongs to no object.

    Examples
    --------
    >>> names_of_labels({0: 1, 3: 4}, told={}, options=MaskOptions(names={3: "cup"}), background=0)
    {1: '0', 4: 'cup'}
    """
    names: dict[int, str | None] = {
        label: told[number] if number in told else str(number)
        for number, label in labels.items()
        if number in told or number != label
    }
    for number, name in (options.names or {}).items():
        if number in labels:
            names[labels[number]] = name
        elif number == background:
            names[background] = name
        else:
            known = ", ".join(str(known) for known in list(labels)[:10])
            raise ValueError(f"names: expected ids of objects ({known}{', …' * (len(labels) > 10)}), got {number}")
    return names


def with_path(path: object, items: Iterator[Item]) -> Iterator[Item]:
    """Pass items on; the error of what goes wrong on the way begins with the path.

    Examples
    --------
    >>> list(with_path("a.json", iter([1, 2])))
    [1, 2]
    """
    try:
        yield from items
    except UnusableFileError:
        raise
    except ValueError as error:
        raise UnusableFileError(f"{path}: {error}") from error
