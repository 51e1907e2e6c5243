"""One reading of a recording for two readers, what is made ahead of its reader, and depth that is found on the way."""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from sec_lab.recording.record import Frame

if TYPE_CHECKING:
    from sec_lab.recording.record import Recording

DepthOfFrame = Callable[[Frame], NDArray[np.float32]]
_Item = TypeVar("_Item")
_END = object()


class ReadAhead(Iterator[_Item]):
    """The same items in the same order, each of which a thread beside makes while the one before it is in use.

    So an item must not change when the next one is made, and one more is made than was asked for. Whoever stops early
    should close the reading: then nothing goes on behind his back.

    Parameters
    ----------
    items : iterator
        Used by the thread beside from the first item on, and by nobody else.

    Raises
    ------
    Exception
        Of any kind, what ``items`` raises, in the place of its item; the reading is over then.

    Examples
    --------
    >>> list(ReadAhead(iter("abc")))
    ['a', 'b', 'c']
    """

    def __init__(self, items: Iterator[_Item]) -> None:
        self._items = items
        # Without a `with`: left to the garbage collector, which may run in this very thread, nobody waits for it.
        self._beside = ThreadPoolExecutor(max_workers=1)
        self._coming: Future[_Item | object] | None = None
        self._is_over = False

    def __next__(self) -> _Item:
        if self._is_over:
            raise StopIteration
        coming = self._coming or self._beside.submit(next, self._items, _END)
        self._coming = None
        try:
            item = coming.result()
        except BaseException:
            self.close()
            raise
        finally:
            del coming  # an error would keep itself, and all that it has seen, alive through it
        if item is _END:
            self.close()
            raise StopIteration
        self._coming = self._beside.submit(next, self._items, _END)
        return cast("_Item", item)

    def close(self) -> None:
        """Stop; an item that is being made is waited for and dropped, and so are the items if they can be closed."""
        self._is_over = True
        self._coming = None
        self._beside.shutdown(wait=True, cancel_futures=True)
        close = getattr(self._items, "close", None)
        if close is not None:
            close()


def with_depth(recording: "Recording", start: Callable[[], DepthOfFrame]) -> "Recording":
    """The same recording with depth that is computed from its frames, as they are read.

    Parameters
    ----------
    recording : Recording
    start : callable
        Called at the beginning of every reading; gives a function from a frame to its depth in metres, shape (height,
        width), 0 where nothing is known. Frames are given in their order, so it may remember what was before.

    Returns
    -------
    Recording

    Examples
    --------
    >>> from sec_lab.recording import Recording
    >>> flat = Recording.from_frames(np.zeros((1, 2, 3, 3), dtype=np.uint8))
    >>> (frame,) = with_depth(flat, lambda: lambda frame: np.full((2, 3), 1.5, dtype=np.float32))
    >>> frame.depth_m.max()
    np.float32(1.5)
    """
    return replace(recording, read=partial(_read_with_depth, recording, start), has_depth=True)


def shared(recording: "Recording") -> tuple["Recording", Iterator[Frame]]:
    """A recording, and an iterator over the frames of its first reading.

    Whoever reads the recording first and whoever takes from the iterator get the same frames, each of which is decoded
    once. Frames that one of both is ahead of the other are kept, so the two should walk side by side. Every further
    reading begins anew.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    recording : Recording
    frames : iterator of Frame

    Examples
    --------
    >>> from sec_lab.recording import Recording
    >>> again, beside = shared(Recording.from_frames(np.zeros((2, 2, 3, 3), dtype=np.uint8)))
    >>> [next(beside) is frame for frame in again]
    [True, True]
    """
    reading = _Reading(recording)
    return replace(recording, read=reading), reading.beside()


class _Reading:
    """One reading for two readers; ``itertools.tee`` would hold back 57 frames, however close the two are."""

    def __init__(self, recording: "Recording") -> None:
        self._recording = recording
        self._source = recording.read()
        # The two may read in threads of their own, see ReadAhead.
        self._one_by_one = threading.Lock()
        self._is_taken = self._has_left = False
        self._ahead: deque[Frame] = deque()
        self._behind: deque[Frame] = deque()

    def __call__(self) -> Iterator[Frame]:
        with self._one_by_one:
            if not self._is_taken:
                self._is_taken = True
                return self._leading()
        return self._recording.read()

    def _leading(self) -> Iterator[Frame]:
        try:
            while True:
                with self._one_by_one:
                    if self._ahead:
                        frame = self._ahead.popleft()
                    elif (coming := next(self._source, None)) is not None:
                        self._behind.append(frame := coming)
                    else:
                        return
                yield frame
        finally:
            self._has_left = True
            self._ahead.clear()

    def beside(self) -> Iterator[Frame]:
        """The frames of the reading that the first reader is given."""
        while True:
            with self._one_by_one:
                if self._behind:
                    frame = self._behind.popleft()
                elif (coming := next(self._source, None)) is not None:
                    frame = coming
                    if not self._is_taken:
                        # Nobody may ever read: who comes later begins anew.
                        self._is_taken = self._has_left = True
                    if not self._has_left:
                        self._ahead.append(frame)
                else:
                    return
            yield frame


def _read_with_depth(recording: "Recording", start: Callable[[], DepthOfFrame]) -> Iterator[Frame]:
    depth_of = start()
    for frame in recording:
        try:
            deep = replace(frame, depth_m=depth_of(frame))
        except ValueError as error:
            raise ValueError(f"frame {frame.index}: {error}") from error
        yield deep
