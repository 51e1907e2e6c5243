"""Frames of a stream at any place: what was read lately is kept, so that one can scrub (§2.2)."""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from typing import Generic, TypeVar

T = TypeVar("T")

KEPT = 120
"""Frames that are kept: 30 MB of 320×256 pixels."""


class FrameShelf(Generic[T]):
    """The frames of a stream that begins anew with every iteration, by their place.

    Parameters
    ----------
    frames : iterable
        E.g. a :class:`~sec_lab.recording.Recording` or a :class:`~sec_lab.segmentation.Segmentation`.
    kept : int, optional
        Frames that are kept at least as long as so many others have not been asked for.

    Examples
    --------
    >>> shelf = FrameShelf("abcdef", kept=2)
    >>> shelf.at(3), shelf.at(4), shelf.at(0)
    ('d', 'e', 'a')
    """

    def __init__(self, frames: Iterable[T], *, kept: int = KEPT) -> None:
        self._frames, self._n_kept = frames, kept
        self._kept: OrderedDict[int, T] = OrderedDict()
        self._reading: Iterator[T] = iter(())
        self._next = 0
        self._is_begun = False

    def at(self, place: int, *, report: Callable[[int, int], None] | None = None) -> T:
        """The frame at a place, counted from 0; reads on from where it is, or from the beginning.

        Parameters
        ----------
        place : int
        report : callable, optional
            Is told after every frame that is read how many were read, and how many have to be.

        Raises
        ------
        ValueError
            If there are fewer frames.
        """
        if place in self._kept:
            self._kept.move_to_end(place)
            return self._kept[place]
        if place < self._next or not self._is_begun:
            self._reading, self._next, self._is_begun = iter(self._frames), 0, True
        begin = self._next
        while self._next <= place:
            try:
                frame = next(self._reading)
            except StopIteration:
                n, self._is_begun = self._next, False
                raise ValueError(f"frame: expected one from 0 to {n - 1}, got {place}") from None
            self._keep(self._next, frame)
            self._next += 1
            if report is not None:
                report(self._next - begin, place + 1 - begin)
        return self._kept[place]

    def _keep(self, place: int, frame: T) -> None:
        self._kept[place] = frame
        self._kept.move_to_end(place)
        if len(self._kept) > self._n_kept:
            self._kept.popitem(last=False)
