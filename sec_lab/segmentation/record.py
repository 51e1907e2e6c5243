"""What step 1 gives: label images in which a segment keeps its label from frame to frame (§2.2)."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array, as_integers

if TYPE_CHECKING:
    from sec_lab.recording import Recording

Labels = NDArray[np.uint16]
Names = Mapping[int, str | None]

MAX_LABEL = (1 << 16) - 1
"""Largest label of a segment: label images have 16 bits a pixel."""


class FoundNames(Mapping[int, str | None]):
    """Names of segments that are only known once all label images were read; asking for them reads what is left.

    Parameters
    ----------
    find : callable
        Gives the names; it is called once.

    Examples
    --------
    >>> FoundNames(lambda: {1: "cup"})[1]
    'cup'
    """

    def __init__(self, find: Callable[[], Names]) -> None:
        self._find = find
        self._found: Names | None = None

    @property
    def _names(self) -> Names:
        if self._found is None:
            self._found = self._find()
        return self._found

    def __getitem__(self, label: int) -> str | None:
        return self._names[label]

    def __iter__(self) -> Iterator[int]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Label images of a movie, one after the other: nothing is kept, and every iteration begins anew (§2.2).

    A segment keeps its label as long as it is followed. Pixels of the background carry a label like any other, as a
    chain needs the background as a segment (§2.5); to leave it out of an observation, say
    ``without_segments(observation, [segmentation.background])``.

    Parameters
    ----------
    read : callable
        Gives, with every call, an iterator over pairs of frame number (ascending) and label image, shape (height,
        width), whole numbers from 0 to 65,535.
    size : tuple of int
        (height, width) in pixels.
    frames : sequence of int, optional
        Frame numbers, where they are known in advance.
    background : int, optional
        Label of the background, if there is one.
    names : mapping of int to str or None, optional
        Names of segments; None marks a segment that is known to be no object. The background is called "background"
        unless it has a name.

    Raises
    ------
    ValueError
        If a size, a frame number, a label or a name is not allowed. While label images are read: if one has another
        size, is no label image, or frame numbers do not ascend or are not those that were said.

    Examples
    --------
    >>> segmentation = Segmentation.from_labels([[[0, 0], [0, 7]], [[0, 7], [0, 7]]], background=0)
    >>> len(segmentation), segmentation.names[0], [image.max() for image in segmentation]
    (2, 'background', [np.uint16(7), np.uint16(7)])
    """

    read: Callable[[], Iterable[tuple[int, ArrayLike]]]
    size: tuple[int, int]
    frames: NDArray[np.int64] | None
    background: int | None
    names: Names

    def __init__(
        self,
        read: Callable[[], Iterable[tuple[int, ArrayLike]]],
        size: tuple[int, int],
        frames: Sequence[int] | ArrayLike | None = None,
        background: int | None = None,
        names: Names | None = None,
    ) -> None:
        height, width = as_integers(size, what="size", ndim=1).tolist() if len(size) == 2 else (0, 0)
        if height < 1 or width < 1:
            raise ValueError(f"size: expected (height, width), at least one pixel each, got {size}")
        object.__setattr__(self, "read", read)
        object.__setattr__(self, "size", (height, width))
        object.__setattr__(self, "frames", None if frames is None else as_frames(frames))
        object.__setattr__(self, "background", None if background is None else as_label(background, what="background"))
        object.__setattr__(self, "names", _with_background(names, self.background))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.read, self.size, self.frames, self.background, dict(self.names))

    @classmethod
    def from_labels(
        cls,
        labels: ArrayLike,
        *,
        frames: Sequence[int] | ArrayLike | None = None,
        background: int | None = None,
        names: Names | None = None,
    ) -> "Segmentation":
        """Segmentation of label images in one array, which is not copied.

        Parameters
        ----------
        labels : (n, height, width) array_like of int
            May be a memory map.
        frames : (n,) sequence of int, optional
            Frame numbers, ascending; 0, 1, 2, … if left out.
        background, names
            See :class:`Segmentation`.

        Raises
        ------
        ValueError
            If the array has another number of dimensions or no image, or there are more or fewer frame numbers.

        Examples
        --------
        >>> Segmentation.from_labels([[[1, 2]]], frames=[40]).frames
        array([40])
        """
        array = as_array(labels, what="labels", ndim=3)
        numbers = as_frames(range(len(array)) if frames is None else frames)
        if len(numbers) != len(array):
            raise ValueError(f"frames: expected {len(array)} numbers, one a label image, got {len(numbers)}")
        return cls(partial(_numbered, array, numbers.tolist()), array.shape[1:], numbers, background, names)

    @property
    def n_frames(self) -> int | None:
        """Number of label images, where it is known in advance."""
        return None if self.frames is None else len(self.frames)

    def __len__(self) -> int:
        if self.frames is None:
            raise TypeError("segmentation: the number of label images is not known before the last one was read")
        return len(self.frames)

    def __bool__(self) -> bool:
        return True

    def __iter__(self) -> Iterator[Labels]:
        return (image for _, image in self.numbered())

    def numbered(self) -> Iterator[tuple[int, Labels]]:
        """Frame numbers and label images, write-protected arrays of type uint16, shape (height, width).

        Raises
        ------
        ValueError
            For the reasons that :class:`Segmentation` gives.

        Examples
        --------
        >>> [number for number, _ in Segmentation.from_labels([[[1]], [[1]]], frames=[0, 4]).numbered()]
        [0, 4]
        """
        last: int | None = None
        n_images = 0
        for number, values in self.read():
            if last is not None and number <= last:
                raise ValueError(f"frames: expected ascending frame numbers, got {number} after {last}")
            if self.frames is not None and (n_images == len(self.frames) or self.frames[n_images] != number):
                expected = "no frame more" if n_images == len(self.frames) else f"frame {self.frames[n_images]}"
                raise ValueError(f"frames: expected {expected}, got frame {number}")
            yield number, self._checked(values, number)
            n_images += 1
            last = number
        if self.frames is not None and n_images < len(self.frames):
            raise ValueError(f"frames: expected {len(self.frames)} label images, got {n_images}")

    def _checked(self, values: ArrayLike, number: int) -> Labels:
        image = as_array(values, what=f"frame {number}: label image")
        if image.shape != self.size:
            raise ValueError(
                f"frame {number}: label image: expected {self.size[0]}×{self.size[1]}, got shape {image.shape}"
            )
        if image.dtype.kind not in "ub":
            if image.dtype.kind == "f":
                raise ValueError(f"frame {number}: label image: expected whole numbers, got values of {image.dtype}")
            if image.min() < 0:
                raise ValueError(f"frame {number}: label image: expected labels from 0 on, got {image.min()}")
        if image.dtype.itemsize > 2 and image.max() > MAX_LABEL:
            raise ValueError(f"frame {number}: label image: expected labels up to {MAX_LABEL}, got {image.max()}")
        labels = image.astype(np.uint16, copy=False).view()
        labels.setflags(write=False)
        return labels


def check_fit(segmentation: Segmentation, recording: "Recording") -> None:
    """Refuse label images that do not belong to a recording.

    Not every frame needs a label image, but every label image needs a frame.

    Parameters
    ----------
    segmentation : Segmentation
    recording : Recording

    Raises
    ------
    ValueError
        If label images and pictures differ in size, or there are label images of frames that the recording does not
        have, as far as that is known in advance.

    Examples
    --------
    >>> from sec_lab.recording import Recording
    >>> recording = Recording.from_frames(np.zeros((2, 4, 5, 3), dtype=np.uint8))
    >>> check_fit(Segmentation.from_labels(np.zeros((3, 4, 5), dtype=np.uint8)), recording)
    Traceback (most recent call last):
    ...
    ValueError: masks: expected masks of frames that the recording has (0 to 1), got one of frame 2
    """
    if segmentation.size != recording.size:
        (height, width), (rows, columns) = recording.size, segmentation.size
        raise ValueError(f"masks: expected masks of {height}×{width} like the pictures, got {rows}×{columns}")
    known = recording.numbers or (None if recording.n_frames is None else range(recording.n_frames))
    if known is None or segmentation.frames is None:
        return
    alien = np.setdiff1d(segmentation.frames, known)
    if alien.size:
        raise ValueError(
            f"masks: expected masks of frames that the recording has ({known[0]} to {known[-1]}), "
            f"got one of frame {alien[0]}"
        )


def as_frames(values: Sequence[int] | ArrayLike) -> NDArray[np.int64]:
    """Write-protected copy of ascending frame numbers, at least one.

    Raises
    ------
    ValueError
        If they are no whole numbers, negative, not ascending or none.

    Examples
    --------
    >>> as_frames(range(0, 9, 4))
    array([0, 4, 8])
    """
    frames = as_integers(np.asarray(values), what="frames", ndim=1)
    if not frames.size:
        raise ValueError("frames: expected at least one frame, got none")
    if frames[0] < 0:
        raise ValueError(f"frames: expected frame numbers from 0 on, got {frames[0]}")
    back = np.flatnonzero(np.diff(frames) <= 0)
    if back.size:
        i = back[0]
        raise ValueError(f"frames: expected ascending frame numbers, got {frames[i + 1]} after {frames[i]}")
    frames.setflags(write=False)
    return frames


def as_label(value: Any, *, what: str) -> int:
    """Label of a segment, or one clear error.

    Raises
    ------
    ValueError
        If it is no whole number from 0 to 65,535.

    Examples
    --------
    >>> as_label(70_000, what="background")
    Traceback (most recent call last):
    ...
    ValueError: background: expected a label from 0 to 65535, got 70000
    """
    label = int(as_integers(value, what=what, ndim=0))
    if not 0 <= label <= MAX_LABEL:
        raise ValueError(f"{what}: expected a label from 0 to {MAX_LABEL}, got {label}")
    return label


def as_names(names: Names | None) -> Names:
    """Read-only copy of names by label or id.

    Raises
    ------
    ValueError
        If a key is no whole number, or a name neither text nor None.

    Examples
    --------
    >>> as_names({1: 3.5})
    Traceback (most recent call last):
    ...
    ValueError: names: expected text or None, got 3.5
    """
    given: dict[int, str | None] = {}
    for number, name in (names or {}).items():
        if not isinstance(name, str | None):
            raise ValueError(f"names: expected text or None, got {name!r}")
        given[int(as_integers(number, what="key of a name", ndim=0))] = name
    return MappingProxyType(given)


def _with_background(names: Names | None, background: int | None) -> Names:
    if isinstance(names, FoundNames):
        return names
    given: dict[int, str | None] = {} if background is None else {background: "background"}
    for label, name in as_names(names).items():
        given[as_label(label, what="label of a name")] = name
    return MappingProxyType(given)


def _numbered(labels: NDArray[Any], numbers: Sequence[int]) -> Iterator[tuple[int, NDArray[Any]]]:
    return zip(numbers, labels, strict=True)
