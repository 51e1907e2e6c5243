"""Segments followed through a recording by superparamagnetic clustering alone (step 1, §2.2).

The first frame is annealed. Every later one begins with the labels of the frame before, carried along the optic flow;
a few sweeps settle them. Then every connected domain gets its label: it keeps the one it came with, goes to a
neighbour, gets back the label of a segment that was lost, or a new one.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import as_integers
from sec_lab.recording import Recording
from sec_lab.recording.sharing import ReadAhead
from sec_lab.segmentation.flow import RESIDUAL_LIMIT, dense_inverse_search, grey_flow, reduced_grey
from sec_lab.segmentation.potts import (
    LOWEST,
    MAX_SPIN,
    SOFT,
    PottsParameters,
    as_seed,
    channel_couplings,
    colour_channels,
    noise_table,
    superparamagnetic_clustering,
)
from sec_lab.segmentation.record import Labels, Segmentation

EventKind = Literal["new", "lost", "split", "merged", "found"]
_KINDS: tuple[EventKind, ...] = ("new", "lost", "split", "merged", "found")

_FULL_SIZE_PIXELS = 400 * 320


@dataclass(frozen=True)
class TrackingParameters:
    """How segments are followed from frame to frame.

    Parameters
    ----------
    potts : PottsParameters, optional
        Of the lattice; α = 4 in RGB with a blur of 0.7 pixels if left out: raw noise changes from frame to frame.
    lattice_step_px : {1, 2}, optional
        Pixels of the picture along a side of a pixel of the lattice; 1 up to 400×320 pixels and 2 beyond if left out.
    residual_limit : float, optional
        Colour difference from which on a pixel is taken for something else than what flowed there; it starts vacant.
    colour_limit : float, optional
        Difference of mean colours up to which two domains are taken for pieces of one segment.
    reach_percent : float, optional
        Distance within which a lost segment is found again, in percent of the picture's diagonal.
    young_frames : int, optional
        For so long a new label is taken back if an older neighbour attracts it.
    apart_frames : int, optional
        For so long two pieces of a segment keep one label; then the smaller is a segment of its own. What passes in
        front of a segment may cut it in two for a while.
    bonds_every_frames : int, optional
        Every so many frames segments are taken apart where no attracting bond holds them together.

    Raises
    ------
    ValueError
        If a value is not allowed.

    Examples
    --------
    >>> TrackingParameters(lattice_step_px=3)
    Traceback (most recent call last):
    ...
    ValueError: lattice_step_px: expected 1 or 2, got 3
    """

    potts: PottsParameters = field(
        default_factory=lambda: PottsParameters(alpha=4.0, colour_space="rgb", blur_sigma_px=0.7)
    )
    lattice_step_px: int | None = None
    residual_limit: float = RESIDUAL_LIMIT
    colour_limit: float = 40.0
    reach_percent: float = 15.0
    young_frames: int = 12
    apart_frames: int = 50
    bonds_every_frames: int = 3

    def __post_init__(self) -> None:
        if not isinstance(self.potts, PottsParameters):
            raise ValueError(f"potts: expected PottsParameters, got {type(self.potts).__name__}")
        if self.lattice_step_px not in (None, 1, 2):
            raise ValueError(f"lattice_step_px: expected 1 or 2, got {self.lattice_step_px}")
        for name in ("residual_limit", "colour_limit", "reach_percent"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise ValueError(f"{name}: expected a number from 0 on, got {value}")
        for name, least in (("young_frames", 0), ("apart_frames", 0), ("bonds_every_frames", 1)):
            whole = int(as_integers(getattr(self, name), what=name, ndim=0))
            if whole < least:
                raise ValueError(f"{name}: expected a whole number from {least} on, got {whole}")
            object.__setattr__(self, name, whole)


DEFAULT = TrackingParameters()
"""Parameters where none are said."""


@dataclass(frozen=True)
class SegmentEvent:
    """Something that happened to segments.

    Parameters
    ----------
    frame : int
        Frame number.
    kind : {"new", "lost", "split", "merged", "found"}
    labels : tuple of int
        The segment that is new, lost, or found again; of a split the old and the new one; of a merger the one that
        ended and the one that took it in.

    Examples
    --------
    >>> SegmentEvent(12, "split", (3, 8)).kind
    'split'
    """

    frame: int
    kind: EventKind
    labels: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """Segments of one frame.

    Parameters
    ----------
    frame : int
        Frame number.
    labels : (height, width) ndarray of uint16
        From 1 on; write-protected.
    events : tuple of SegmentEvent
        What happened since the frame before; in the first frame every segment is new.
    """

    frame: int
    labels: Labels
    events: tuple[SegmentEvent, ...]

    def __post_init__(self) -> None:
        protected = self.labels.view()
        protected.setflags(write=False)
        object.__setattr__(self, "labels", protected)


def track_segments(recording: Recording, *, parameters: TrackingParameters = DEFAULT, seed: int = 0) -> Segmentation:
    """Segments of a recording, followed from frame to frame by superparamagnetic clustering (step 1, §2.2).

    Parameters
    ----------
    recording : Recording
        Where it has depth, jumps of depth cut bonds.
    parameters : TrackingParameters, optional
    seed : int, optional
        Same seed, same labels, whatever the number of threads.

    Returns
    -------
    Segmentation
        Lazy: frames are read and segmented while it is iterated, every time anew. A frame depends on those before it.

    Raises
    ------
    ValueError
        If the seed is not allowed. While it is iterated: if more than 32,767 segments have come up.

    Examples
    --------
    >>> frames = np.full((3, 40, 60, 3), 60, dtype=np.uint8)
    >>> for i, frame in enumerate(frames):
    ...     frame[10:25, 10 + 3 * i : 30 + 3 * i] = (200, 60, 60)
    >>> segmentation = track_segments(Recording.from_frames(frames))
    >>> [(labels == 2).nonzero()[1].min() for labels in segmentation]
    [np.int64(10), np.int64(13), np.int64(16)]
    """
    as_seed(seed)
    return Segmentation(partial(_numbered_labels, recording, parameters, seed), recording.size)


def tracked_frames(
    recording: Recording, *, parameters: TrackingParameters = DEFAULT, seed: int = 0
) -> Iterator[TrackedFrame]:
    """Like :func:`track_segments`, and what happens to the segments.

    Parameters
    ----------
    recording, parameters, seed
        See :func:`track_segments`.

    Yields
    ------
    TrackedFrame

    Raises
    ------
    ValueError
        See :func:`track_segments`.

    Examples
    --------
    >>> frames = np.full((2, 40, 60, 3), 60, dtype=np.uint8)
    >>> frames[1, 10:25, 10:30] = (200, 60, 60)
    >>> [event for tracked in tracked_frames(Recording.from_frames(frames)) for event in tracked.events]
    [SegmentEvent(frame=0, kind='new', labels=(1,)), SegmentEvent(frame=1, kind='new', labels=(2,))]
    """
    tracker = _Tracker(parameters, as_seed(seed), recording.size)
    preparation = _Preparation(recording, parameters)
    # While a frame is relaxed, the next one is read and prepared beside it: this needs no labels.
    for prepared in ReadAhead(iter(preparation.next, None)):
        labels, events = tracker.step(prepared)
        number = prepared.number
        yield TrackedFrame(number, labels, tuple(SegmentEvent(number, *event) for event in events))


def _numbered_labels(recording: Recording, parameters: TrackingParameters, seed: int) -> Iterator[tuple[int, Labels]]:
    return ((tracked.frame, tracked.labels) for tracked in tracked_frames(recording, parameters=parameters, seed=seed))


_Event = tuple[EventKind, tuple[int, ...]]


@dataclass(frozen=True, eq=False)
class _Prepared:
    """What is known of a frame before it has labels."""

    number: int
    image: NDArray[np.uint8]
    depth_m: NDArray[np.float32] | None
    channels: NDArray[np.uint8]
    couplings: NDArray[np.int8]
    flow: NDArray[np.float32] | None


class _Preparation:
    """Frames of a recording, one after the other, with their couplings and the flow to the frame before."""

    def __init__(self, recording: Recording, parameters: TrackingParameters) -> None:
        self._frames = iter(recording)
        self._potts = parameters.potts
        self._step_px = lattice_step(recording.size, parameters)
        self._size = reduced_size(recording.size, self._step_px)
        height, width = self._size
        # Two in turn: one is in use while the other is filled.
        self._couplings = np.zeros((2, 4, 4, (height + 1) // 2 + 2, (width + 1) // 2 + 2), np.int8)
        self._scale: float | None = None
        self._grey: NDArray[np.uint8] | None = None
        self._search = dense_inverse_search()
        self._n = 0

    def next(self) -> _Prepared | None:
        """The next frame, or None after the last."""
        frame = next(self._frames, None)
        if frame is None:
            return None
        image, depth = frame.image, frame.depth_m
        if self._step_px > 1:
            import cv2

            image = np.asarray(cv2.resize(image, self._size[::-1], interpolation=cv2.INTER_AREA), np.uint8)
            depth = None if depth is None else depth[:: self._step_px, :: self._step_px]
        # Compiled code for arrays that may be written to is code of its own: one kind serves all recordings.
        depth = None if depth is None else np.array(depth)
        channels = colour_channels(image, parameters=self._potts)
        grey = reduced_grey(channels[0 if self._potts.colour_space == "lab" else 1])
        flow = None if self._grey is None else grey_flow(self._grey, grey, self._search)
        couplings = self._couplings[self._n % 2]
        # The mean colour difference is that of the frame before: a frame's own would take another pass over it.
        self._scale = channel_couplings(couplings, channels, parameters=self._potts, depth_m=depth, scale=self._scale)
        self._grey = grey
        self._n += 1
        return _Prepared(frame.index, image, depth, channels, couplings, flow)


class _Tracker:
    """Labels of the last frame, and what is remembered of every segment."""

    def __init__(self, parameters: TrackingParameters, seed: int, size: tuple[int, int]) -> None:
        self._parameters = parameters
        self._potts = potts = parameters.potts
        self._seed = seed
        self._size = size
        self._step_px = lattice_step(size, parameters)
        height, width = reduced_size(size, self._step_px)
        self._reach_px = parameters.reach_percent / 100 * math.hypot(height, width)
        self._planes = np.empty((4, (height + 1) // 2 + 2, (width + 1) // 2 + 2), np.int16)
        temperatures = (potts.relax_temperature,) * potts.relax_sweeps + (0.0,) * potts.smooth_sweeps
        self._noise = noise_table(temperatures, self._planes.shape[2])
        self._lowest = np.full(len(temperatures), LOWEST, np.int16)
        self._lowest[potts.relax_sweeps :] = SOFT
        capacity = MAX_SPIN + 1
        self._memory = np.zeros((capacity, 6))
        self._born, self._seen, self._apart = np.zeros((3, capacity), np.int64)
        self._n_labels = 0
        self._n_steps = 0
        self._labels = np.zeros((height, width), np.int16)
        self._channels = np.empty((3, height, width), np.uint8)

    def step(self, prepared: _Prepared) -> tuple[Labels, list[_Event]]:
        """Labels of the next frame, and what happened."""
        events = self._begin(prepared) if prepared.flow is None else self._go_on(prepared, prepared.flow)
        self._channels = prepared.channels
        self._n_steps += 1
        labels = self._labels.astype(np.uint16)
        if self._step_px > 1:
            labels = labels.repeat(self._step_px, 0).repeat(self._step_px, 1)[: self._size[0], : self._size[1]]
        return labels, events

    def _begin(self, prepared: _Prepared) -> list[_Event]:
        from sec_lab.segmentation._track_kernels import moments_of

        labels = superparamagnetic_clustering(
            prepared.image, parameters=self._potts, depth_m=prepared.depth_m, seed=self._seed
        )
        n = self._n_labels = int(labels.max())
        _check_number(n)
        self._labels = labels.astype(np.int16)
        self._memory[: n + 1] = moments_of(labels.astype(np.int32), prepared.channels, n + 1)
        return [("new", (label,)) for label in range(1, n + 1)]

    def _go_on(self, prepared: _Prepared, flow: NDArray[np.float32]) -> list[_Event]:
        from sec_lab.segmentation._potts_kernels import from_planes, sweep, to_planes
        from sec_lab.segmentation._track_kernels import settle, warp

        parameters, potts = self._parameters, self._potts
        labels = warp(self._labels, self._channels, prepared.channels, flow, parameters.residual_limit)
        to_planes(self._planes, labels)
        # Every step has random numbers of its own.
        seed = np.uint64((self._seed + (self._n_steps << 40)) % (1 << 64))
        sweep(self._planes, prepared.couplings, self._noise, self._lowest, seed)
        from_planes(labels, self._planes)
        self._n_labels, events = settle(
            labels,
            prepared.channels,
            prepared.couplings,
            self._memory,
            self._born,
            self._seen,
            self._apart,
            self._n_labels,
            self._n_steps,
            int(self._n_steps % parameters.bonds_every_frames == 0),
            max(potts.minimum_size_px // self._step_px**2, 1),
            potts.minimum_thickness_px,
            float(parameters.colour_limit),
            self._reach_px,
            parameters.young_frames,
            parameters.apart_frames,
        )
        _check_number(self._n_labels)
        self._labels = labels
        return [(_KINDS[kind], (a, b) if b else (a,)) for kind, a, b in events]


def lattice_step(size: tuple[int, int], parameters: TrackingParameters) -> int:
    """Pixels of a picture along a side of a pixel of the lattice."""
    return parameters.lattice_step_px or (1 if size[0] * size[1] <= _FULL_SIZE_PIXELS else 2)


def reduced_size(size: tuple[int, int], step_px: int) -> tuple[int, int]:
    """Height and width of the lattice."""
    return -(-size[0] // step_px), -(-size[1] // step_px)


def _check_number(n_labels: int) -> None:
    if n_labels > MAX_SPIN:
        raise ValueError(
            f"segments: expected at most {MAX_SPIN} in a recording, and more came up: "
            "alpha or minimum_size_px is too small for what is seen"
        )
