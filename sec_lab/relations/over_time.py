"""Relations that hold for a while: from the evidence of single frames to steady relations (step 2, §2.3)."""

from collections import deque
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relations
from sec_lab.relations.counts import as_label_image, coded_image
from sec_lab.relations.depth import REACH_PX, as_depth, told
from sec_lab.relations.record import SegmentRelations
from sec_lab.relations.time_parameters import TimeParameters

_DEFAULT = TimeParameters()
_MAX_LABEL = (1 << 16) - 1


class SeenFrame(NamedTuple):
    """What is seen in one frame.

    Attributes
    ----------
    number : int
        Frame number.
    labels : (height, width) array_like of int
        Label image, labels up to 65,535.
    depth_m : (height, width) array_like of float, optional
        Metres along the optical axis, 0 where it is unknown; None if there is no depth.
    moving : iterable of int, optional
        Labels of the segments that move, if step 1 knows; None to have motion measured from the label images.
    """

    number: int
    labels: ArrayLike
    depth_m: ArrayLike | None = None
    moving: Iterable[int] | None = None


def steady_relations(
    frames: Iterable[tuple[int, ArrayLike] | tuple[int, ArrayLike, ArrayLike | None] | SeenFrame],
    *,
    parameters: TimeParameters = _DEFAULT,
) -> Iterator[tuple[int, SegmentRelations]]:
    """Relations of every frame that have held, and will hold, for a while.

    A change counts when it has lasted, and is dated to the frame at which it began: so frames come out late, by
    max(``hysteresis_frames``, ``min_life_frames``) + ``together_frames`` frames, and after the last frame all that is
    left. Nothing else of the future is used, and the memory does not grow with the length of the movie.

    Parameters
    ----------
    frames : iterable of SeenFrame or tuple
        (number, labels), (number, labels, depth) or (number, labels, depth, moving segments), see :class:`SeenFrame`.
        The camera stands still: the largest segment is taken to rest.
    parameters : TimeParameters, optional
        The rules. The defaults are meant for 25 frames per second, see
        :func:`~sec_lab.relations.time_parameters.at_frame_rate`.

    Yields
    ------
    number : int
    relations : SegmentRelations
        Of the segments that are there, be they hidden for a while or not. Positions are centres (column, row) in pixels
        where a segment was last seen.

    Raises
    ------
    ValueError
        While frames are read: if an image is no label image, the size changes, a label is above 65,535, or the depth
        does not fit or is negative or not finite. What is wrong is said with the number of the frame.

    Examples
    --------
    A thing on a table is hidden for three frames, and a speck shows up once:

    >>> movie = np.ones((40, 30, 40), np.uint8)
    >>> movie[:, 8:20, 8:20] = 2
    >>> movie[10:13], movie[20, 5:9, 30:34] = 1, 3
    >>> found = list(steady_relations(enumerate(movie)))
    >>> len(found), {(tuple(r.segments.tolist()), int(r.relations[0, 1])) for _, r in found}
    (40, {((1, 2), 1)})
    """
    return _joined(_steady(frames, parameters), parameters.together_frames)


def _steady(
    frames: Iterable[tuple[int, ArrayLike] | tuple[int, ArrayLike, ArrayLike | None] | SeenFrame],
    parameters: TimeParameters,
) -> Iterator[tuple[int, SegmentRelations]]:
    state = _State(parameters)
    for frame in frames:
        seen = SeenFrame(*frame)
        try:
            state.add(seen)
        except ValueError as error:
            raise ValueError(f"frame {seen.number}: {error}") from error
        if len(state.numbers) == state.length:
            yield state.take()
    state.finish()
    while state.numbers:
        yield state.take()


class _Evidence(NamedTuple):
    """What one frame says: the smaller side of the state that :func:`advance_pairs` takes."""

    labels: NDArray[np.int64]
    pixels: NDArray[np.int64]
    centres: NDArray[np.float64]
    hints: NDArray[np.int64]
    touching_2d: NDArray[np.float64]
    touching: NDArray[np.float64]
    overlapping: NDArray[np.float64]
    sure: NDArray[np.bool_]
    at_border: NDArray[np.bool_]


class _State:
    """All that is remembered: segments in slots, pairs of slots, and a ring of the last frames."""

    def __init__(self, parameters: TimeParameters) -> None:
        self.parameters = parameters
        self.length = max(parameters.hysteresis_frames, parameters.min_life_frames) + 1
        self.now = 0
        self.numbers: deque[int] = deque()
        self._shape: tuple[int, ...] | None = None
        self._images: deque[tuple[NDArray[np.uint8 | np.uint16], NDArray[np.int64]]] = deque(
            maxlen=parameters.motion_frames
        )
        self._slots: dict[int, int] = {}
        self._make_room(8)

    def _make_room(self, n: int) -> None:
        """Room for n slots, the first of them as they are."""
        length = self.length
        for name, shape, dtype in (
            ("active", (n,), np.bool_),
            ("owner", (n,), np.int64),
            ("table", (n, 6), np.int64),
            ("largest", (n,), np.int64),
            ("still", (n,), np.int64),
            ("has_moved", (n,), np.bool_),
            ("place", (n, 2), np.float64),
            ("rest_place", (n, 2), np.float64),
            ("pairs", (n, n, 9), np.int64),
            ("ring", (length, n, n), np.uint8),
            ("present", (length, n), np.uint8),
            ("places", (length, n, 2), np.float64),
        ):
            new: NDArray[np.generic] = np.zeros(shape, dtype)
            old = getattr(self, name, None)
            if old is not None:
                new[tuple(slice(0, size) for size in old.shape)] = old
            setattr(self, name, new)

    active: NDArray[np.bool_]
    owner: NDArray[np.int64]
    table: NDArray[np.int64]
    largest: NDArray[np.int64]
    still: NDArray[np.int64]
    has_moved: NDArray[np.bool_]
    place: NDArray[np.float64]
    rest_place: NDArray[np.float64]
    pairs: NDArray[np.int64]
    ring: Relations
    present: NDArray[np.uint8]
    places: NDArray[np.float64]

    def _slot_of(self, label: int) -> int:
        from sec_lab.relations._time_kernels import FIRST, STATE, UNDECIDED

        slot = self._slots.get(label, -1)
        if slot >= 0 and self.active[slot]:
            return slot
        # A slot whose segment is still a node of a frame to come out is not free yet.
        free = np.flatnonzero(~self.active & ~self.present.any(axis=0))
        if not len(free):
            self._make_room(2 * len(self.active))
            return self._slot_of(label)
        slot = int(free[0])
        before = int(self.owner[slot])
        if self._slots.get(before) == slot:
            del self._slots[before]
        self._slots[label] = slot
        self.owner[slot] = label
        self.active[slot] = True
        self.table[slot] = 0
        self.table[slot, FIRST] = self.now
        self.largest[slot] = self.still[slot] = 0
        self.has_moved[slot] = False
        for pairs in (self.pairs[slot], self.pairs[:, slot]):
            pairs[...] = 0
            pairs[:, STATE] = UNDECIDED
        return slot

    def add(self, frame: SeenFrame) -> None:
        from sec_lab.relations import _time_kernels as kernels

        p = self.parameters
        image = as_label_image(frame.labels)
        self._shape = self._shape or image.shape
        if image.shape != self._shape:
            raise ValueError(f"label image: expected shape {self._shape} as before, got {image.shape}")
        if image.dtype not in (np.uint8, np.uint16):
            if image.max() > _MAX_LABEL:
                raise ValueError(f"label image: expected labels up to {_MAX_LABEL}, got {image.max()}")
            image = image.astype(np.uint16)
        codes, width, _ = coded_image(image)
        seen = _evidence(codes, width, frame.depth_m, p)
        slots = np.array([self._slot_of(label) for label in seen.labels.tolist()], np.int64)
        new = self.table[slots, kernels.SEEN] == 0
        self.largest[slots] = np.maximum(self.largest[slots], seen.pixels)
        self.rest_place[slots[new]] = seen.centres[new]
        from_place = seen.centres - self.rest_place[slots]
        away = (from_place**2).sum(axis=1) * np.pi > self.largest[slots]

        known = frame.moving is not None or p.rest_px is not None
        measured = frame.moving is not None or len(self._images) > 0
        if frame.moving is not None:
            rests = ~np.isin(seen.labels, list(frame.moving))
        elif p.rest_px is not None:
            rests = self._measured(codes, width, seen, slots, away, p.rest_px)
        else:
            rests = np.zeros(len(slots), np.bool_)
        crumbs = seen.pixels <= p.crumb_share * self.largest[slots]
        crumbs &= (self.table[slots, kernels.LEAVES] > 0) & ~seen.at_border
        rests |= crumbs
        pauses = np.zeros(len(slots), np.bool_)
        if known:
            self.still[slots] = np.where(rests, self.still[slots] + 1, 0)
            self.has_moved[slots] |= ~rests & measured
            pauses = rests & seen.at_border & self.has_moved[slots] & (self.still[slots] < p.pause_frames)
        covered = (seen.hints[:, ~rests] > 0).any(axis=1) & known
        calm = rests & ~covered
        self.rest_place[slots[calm]] = seen.centres[calm]

        # Of what rests where too little depth is known to have decided anything so far, the picture alone decides.
        state = self.pairs[np.minimum.outer(slots, slots), np.maximum.outer(slots, slots), kernels.STATE]
        untold = ~seen.sure & (state == kernels.UNDECIDED) & calm[:, None] & calm
        touching, sure = np.where(untold, seen.touching_2d, seen.touching), seen.sure | untold
        hidden = seen.pixels < p.visible_share * self.largest[slots]
        sure &= ~(hidden[:, None] | hidden)
        ground = np.arange(len(slots)) == seen.pixels.argmax()
        sure &= ~((pauses[:, None] & ground) | (ground[:, None] & pauses))
        if known and p.contact_by_motion:
            touching = np.where(rests[:, None] != rests, 0.0, touching)
        if known and p.carried:
            for i in np.flatnonzero(away & ~rests):
                sure[i] = sure[:, i] = True
                carriers = np.where(~rests & (seen.pixels > seen.pixels[i]), seen.hints[i], 0)
                j = int(carriers.argmax())
                if carriers[j] > 0:
                    touching[i, j] = touching[j, i] = seen.touching_2d[i, j]

        here = np.zeros(len(self.active), np.bool_)
        small = seen.pixels <= p.leaving_share * self.largest[slots]
        self.table[slots, kernels.LEAVES] = (seen.at_border & ~rests & small) | crumbs
        here[slots] = ~crumbs
        self.table[slots, kernels.RESTS] = np.where(rests, self.table[slots, kernels.RESTS] + 1, 0)
        self.place[slots] = seen.centres
        lasting = max(1, p.hysteresis_frames)
        kernels.advance_segments(
            self.now, self.table, self.active, here, self.present, p.min_life_frames, lasting, p.hold_frames
        )
        kernels.advance_pairs(
            self.now, self.table, self.active, slots, self.pairs, self.ring, touching, seen.overlapping, sure, covered,
            seen.pixels, np.array([*p.touching_thresholds, *p.overlapping_thresholds]), lasting,
            p.hysteresis_frames if known and p.freeze else -1, int(known and p.kind_at_rest),
        )  # fmt: skip
        self.places[self.now % self.length] = self.place
        self.numbers.append(frame.number)
        self.now += 1

    def _measured(
        self,
        codes: NDArray[np.uint8 | np.uint16],
        width: int,
        seen: _Evidence,
        slots: NDArray[np.int64],
        away: NDArray[np.bool_],
        rest_px: float,
    ) -> NDArray[np.bool_]:
        """Which segments rest, by the label image some frames ago."""
        from sec_lab.relations import _border_kernels, _time_kernels

        if self._images and self._images[0][0].dtype != codes.dtype:
            self._images.clear()
        rests = np.zeros(len(slots), np.bool_)
        if self._images:
            before, labels_before = self._images[0]
            both = np.union1d(seen.labels, labels_before)
            changed = _border_kernels.changed_pixels(
                codes, codes.view(np.uint64), before, before.view(np.uint64), width, both
            )
            at = np.searchsorted(both, seen.labels)
            found = _time_kernels.resting(changed[np.ix_(at, at)], seen.hints, seen.pixels, rest_px)
            # What borders on nothing that rests, or was hidden, shows no motion: it goes on as it was, where it was.
            before_that = (self.table[slots, _time_kernels.RESTS] > 0) & ~away
            told_nothing = (found < 0) | ~np.isin(seen.labels, labels_before)
            rests = np.where(told_nothing, before_that, found > 0)
        # The caller may use the memory of its image again.
        self._images.append((codes.copy(), seen.labels))
        return rests

    def finish(self) -> None:
        """A movie that is too short for anything to become a node shows what was there from the beginning."""
        from sec_lab.relations._time_kernels import FIRST, LAST, NODE

        if self.now >= self.parameters.min_life_frames:
            return
        for slot in np.flatnonzero(self.active & (self.table[:, NODE] == 0) & (self.table[:, FIRST] == 0)):
            self.present[: self.table[slot, LAST] + 1, slot] = 1

    def take(self) -> tuple[int, SegmentRelations]:
        row = (self.now - len(self.numbers)) % self.length
        nodes = np.flatnonzero(self.present[row])
        relations = SegmentRelations(self.owner[nodes], self.ring[row][np.ix_(nodes, nodes)], self.places[row, nodes])
        return self.numbers.popleft(), relations


def _evidence(
    codes: NDArray[np.uint8 | np.uint16], width: int, depth_m: ArrayLike | None, p: TimeParameters
) -> _Evidence:
    from sec_lab.relations import _border_kernels, _kernels, _plane_kernels

    words = codes.view(np.uint64)
    starts, first_run, labels = _kernels.find_runs(codes, words, width)
    hints, surrounds, lines, pixels, centres = _kernels.count_hints(codes, words, width, starts, first_run, labels)
    smaller = np.minimum.outer(lines, lines)
    touching_2d = hints / (2 * smaller)
    touching = touching_2d
    sure = np.ones(hints.shape, np.bool_)
    if depth_m is not None and p.step_m is not None:
        depth = as_depth(depth_m, shape=(len(codes), width))
        planes = _plane_kernels.no_planes(len(labels))
        if p.smear_spreads is not None:
            planes = _plane_kernels.planes_of(codes, width, labels, depth, p.smear_spreads)
        known, small, _ = _border_kernels.border_steps(
            codes, words, width, starts, first_run, labels, depth, p.step_m, p.skip_px, REACH_PX, planes
        )
        touching = np.where(known > 0, touching_2d * small / np.maximum(known, 1), touching_2d)
        sure = (hints == 0) | told(known, hints)
    edge = np.zeros(1 << (8 * codes.itemsize), np.bool_)
    for line in (codes[0, :width], codes[-1, :width], codes[:, 0], codes[:, width - 1]):
        edge[line] = True
    overlapping = np.maximum(surrounds, surrounds.T) / smaller
    return _Evidence(labels, pixels, centres, hints, touching_2d, touching.copy(), overlapping, sure, edge[labels])


def _joined(steady: Iterator[tuple[int, SegmentRelations]], within: int) -> Iterator[tuple[int, SegmentRelations]]:
    """Let changes that begin within some frames of the first of them begin with it."""
    ahead: deque[tuple[int, SegmentRelations]] = deque()
    last: SegmentRelations | None = None
    left = 0  # frames that still show the outcome of the last event
    for item in steady:
        ahead.append(item)
        if len(ahead) > within:
            last, left = _next(ahead, last, left)
            yield ahead.popleft()[0], last
    while ahead:
        last, left = _next(ahead, last, left)
        yield ahead.popleft()[0], last


def _next(
    ahead: deque[tuple[int, SegmentRelations]], last: SegmentRelations | None, left: int
) -> tuple[SegmentRelations, int]:
    now = ahead[0][1]
    if left == 0 and (last is None or not _same(last, now)):
        left = len(ahead)
        last = ahead[-1][1]
    if left == 0 or last is None:
        return now, 0
    return (now if _same(last, now) else last), left - 1


def _same(a: SegmentRelations, b: SegmentRelations) -> bool:
    return np.array_equal(a.segments, b.segments) and np.array_equal(a.relations, b.relations)
