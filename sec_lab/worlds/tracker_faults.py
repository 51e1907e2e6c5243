"""Tracks broken as trackers break them: segments split, vanish, swap labels, and borders flicker."""

from typing import Any, Literal, get_args

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_integers

Fault = Literal["split", "vanish", "swap", "flicker"]
FAULTS: tuple[Fault, ...] = get_args(Fault)

Labels = NDArray[np.uint16]


def broken_tracks(
    labels: ArrayLike,
    fault: Fault,
    *,
    per_hundred_frames: float,
    rng: np.random.Generator,
    background: int = 1,
    duration: int = 10,
    border_px: int = 3,
) -> tuple[Labels, int]:
    """Break label images of a movie at random times.

    Every segment but the background suffers a fault that begins in any frame with the same probability, unless one
    of it lasts already. A swap strikes another segment too, and for good: at the same rate segments suffer twice as
    many swaps as other faults, and these do not end.

    Parameters
    ----------
    labels : (n, height, width) array_like of int
        Segment of every pixel, 0 where there is none.
    fault : {"split", "vanish", "swap", "flicker"}
        ``"split"``: the half of a segment beyond its middle, across its longer side, gets a label of its own for
        ``duration`` frames. ``"vanish"``: a segment is taken for background for ``duration`` frames. ``"swap"``: two
        segments exchange their labels for good. ``"flicker"``: for ``duration`` frames, a segment grows over its
        neighbours in every other frame by ``border_px`` and leaves as much of itself to the background in the others.
    per_hundred_frames : float
        Expected faults that begin with a segment that is there for a hundred frames, 0 to 100. By swaps that begin
        with others it suffers as many again.
    rng : numpy.random.Generator
    background : int, optional
        Label that suffers no fault, and takes what is lost.
    duration, border_px : int, optional
        Frames and pixels, at least 1.

    Returns
    -------
    labels : (n, height, width) uint16
    n_faults : int
        How many there are.

    Raises
    ------
    ValueError
        If the fault is unknown, a number is out of range, or labels are no label images.

    Examples
    --------
    >>> rest = np.array([[[1, 5, 5, 1]]] * 4)
    >>> broken, n = broken_tracks(rest, "split", per_hundred_frames=100, rng=np.random.default_rng(0))
    >>> broken[0].tolist(), n
    ([[1, 5, 6, 1]], 1)
    """
    if fault not in FAULTS:
        raise ValueError(f"fault: expected one of {FAULTS}, got {fault!r}")
    if not 0 <= per_hundred_frames <= 100:
        raise ValueError(f"per_hundred_frames: expected 0 to 100, got {per_hundred_frames}")
    for name, value in (("duration", duration), ("border_px", border_px)):
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < 1:
            raise ValueError(f"{name}: expected a whole number of at least 1, got {value!r}")
    whole = as_integers(labels, what="labels", ndim=3)
    if whole.size and not 0 <= whole.min() <= whole.max() < 2**15:
        raise ValueError(f"labels: expected 0 to {2**15 - 1}, got {whole.min()} to {whole.max()}")
    broken = whole.astype(np.uint16)
    there = np.zeros((len(broken), int(broken.max(initial=0)) + 1), bool)
    for row, frame in zip(there, broken, strict=True):
        row[np.unique(frame)] = True
    there[:, [label for label in (0, background) if label < there.shape[1]]] = False
    n_faults, fresh, busy_until = 0, there.shape[1], np.zeros(there.shape[1], np.int64)
    strikes = rng.random(there.shape) < per_hundred_frames / 100
    for t, label in np.argwhere(there & strikes).tolist():
        if t < busy_until[label]:
            continue
        last = min(t + duration, len(broken))
        if fault == "swap":
            others = [int(other) for other in np.flatnonzero(there[t]) if other != label]
            if not others:
                continue
            _swap(broken[t:], label, others[int(rng.integers(len(others)))])
            last = t + 1
        elif fault == "vanish":
            broken[t:last][broken[t:last] == label] = background
        elif fault == "split":
            _split(broken[t:last], label, fresh)
            fresh += 1
        else:
            _flicker(broken[t:last], label, border_px, background)
        busy_until[label] = last
        n_faults += 1
    return broken, n_faults


def _swap(frames: Labels, one: int, other: int) -> None:
    first, second = frames == one, frames == other
    frames[first], frames[second] = other, one


def _split(frames: Labels, label: int, fresh: int) -> None:
    for frame in frames:
        where = np.argwhere(frame == label)
        if len(where) > 1:
            axis = int(np.argmax(np.ptp(where, axis=0)))
            beyond = where[where[:, axis] > np.median(where[:, axis])]
            frame[tuple(beyond.T)] = fresh


def _flicker(frames: Labels, label: int, border_px: int, background: int) -> None:
    element = np.ones((2 * border_px + 1,) * 2, np.uint8)
    for step, frame in enumerate(frames):
        mask: NDArray[Any] = (frame == label).astype(np.uint8)
        if step % 2 == 0:
            frame[cv2.dilate(mask, element) > 0] = label
        else:
            frame[(mask > 0) & (cv2.erode(mask, element) == 0)] = background
