"""What is known of the segments of a scene, a *slot* each: what moves, its colours, where it was (``layers.py``)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.layer_parameters import LayerParameters

Slots = NDArray[np.uint8]
Flags = NDArray[np.bool_]

N_SLOTS = 256
"""0 is what no layer explains, 1 the background, the others are segments."""

CLEARLY = 2.0
"""By so much another segment must fit worse for one to be known by colours that hardly fit, in nats per pixel."""

SURELY = 1.0
"""By so much where its place speaks for it, too, or where it fits well by itself."""

_HIDDEN = 0.3
"""A segment that shows less than this share of its largest area is hidden."""

_NEVER = -(1 << 40)
_JUST_MOVED_FRAMES = 50
"""Two seconds in which parts that a hand has hidden still come to light, after what it has carried has come to rest."""

LEAST_TAUGHT_PX = 30
"""A segment must show more pixels for its colours to be learned: the rims of a smaller one are mixed with others."""


class KnownSegments:
    """Memory of the segments seen so far; every array has an entry for each of the 256 slots.

    Parameters
    ----------
    size : (height, width)
        Of the picture, in pixels.
    parameters : LayerParameters

    Attributes
    ----------
    known : bool
        The slot stands for a segment whose colours are known.
    mover : bool
        It came in over the border of the picture by itself: a hand.
    moving : bool
        It is on the way, or is not where it rests.
    touched : bool
        A mover is next to it.
    parted_off : bool
        It lay below another segment, which was lifted off it.
    hidden, missing, present : bool
        Little of it is to be seen; not all of it, nor is the rest behind a mover; something of it is.
    tables : (256, N_BINS) float32
        Cost of every colour under it.
    boxes : (256, 4) int64
        Top, left, bottom, right where it was last seen; -1 before.
    most_px : int64
        Largest area seen.
    born, moved_at : int64
        Step in which it was found, and the last one in which it was on the way, far below 0 if it never was.
    labels : uint16
        Label that it has for the reader, 0 for none.
    """

    def __init__(self, size: tuple[int, int], parameters: LayerParameters) -> None:
        from sec_lab.segmentation import _layer_kernels as kernels

        self._p = parameters
        self._size = size
        self.known = np.zeros(N_SLOTS, dtype=np.bool_)
        self.mover = np.zeros(N_SLOTS, dtype=np.bool_)
        self.moving = np.zeros(N_SLOTS, dtype=np.bool_)
        self.touched = np.zeros(N_SLOTS, dtype=np.bool_)
        self.parted_off = np.zeros(N_SLOTS, dtype=np.bool_)
        self.hidden = np.zeros(N_SLOTS, dtype=np.bool_)
        self.missing = np.zeros(N_SLOTS, dtype=np.bool_)
        self.present = np.zeros(N_SLOTS, dtype=np.bool_)
        self.tables = np.full((N_SLOTS, kernels.N_BINS), kernels.CAP, np.float32)
        self._counts = np.zeros((N_SLOTS, kernels.N_BINS), np.float32)
        self._first_counts = np.zeros((N_SLOTS, kernels.N_BINS), np.float32)
        self._has_first = np.zeros(N_SLOTS, dtype=np.bool_)
        self.boxes = np.full((N_SLOTS, 4), -1, np.int64)
        self.most_px = np.zeros(N_SLOTS, np.int64)
        self.born = np.zeros(N_SLOTS, np.int64)
        self.moved_at = np.full(N_SLOTS, _NEVER, np.int64)
        self.labels = np.zeros(N_SLOTS, dtype=np.uint16)
        self._next_label = 1
        self.n_steps = 0

    def candidates(self) -> Slots:
        """Slots that may be anywhere near: at most 15, movers first, then the latest."""
        hidden = self.hidden & ~self.mover
        hidden[:2] = False
        slots = np.flatnonzero(self.moving | self.touched | hidden)[::-1]
        return slots[np.argsort(~self.mover[slots], kind="stable")][:15].astype(np.uint8)

    def give_label(self, slot: int) -> None:
        """Let a slot stand for a segment, with the next label."""
        if self._next_label > np.iinfo(np.uint16).max:
            raise ValueError("movie: expected at most 65,535 segments, got more")
        self.labels[slot] = self._next_label
        self._next_label += 1
        self.known[slot] = True

    def new(self, box: NDArray[np.int64], slots: Slots, rest: Slots, *, mover: bool) -> int:
        """A free slot for a new segment, or that of one that is nowhere any more; the background if there is none.

        Parameters
        ----------
        box : (4,) int64
        slots, rest : (height, width) uint8
            Of the last frame, and of what rests.
        mover : bool
        """
        free = np.flatnonzero(self.labels[2:] == 0)
        if not len(free):
            gone = np.setdiff1d(np.arange(2, N_SLOTS), np.union1d(slots, rest))
            if not len(gone):
                return 1
            self._forget(int(gone[0]))
            free = gone[:1] - 2
        slot = int(free[0]) + 2
        self.give_label(slot)
        self.mover[slot] = mover
        self.moving[slot] = True
        self.born[slot] = self.n_steps
        self.present[slot] = True
        self.boxes[slot] = box
        return slot

    def _forget(self, slot: int) -> None:
        from sec_lab.segmentation import _layer_kernels as kernels

        for flags in (self.known, self.mover, self.moving, self.hidden, self.missing, self.touched, self.parted_off):
            flags[slot] = False
        self._has_first[slot] = False
        self.labels[slot] = 0
        self._counts[slot] = self._first_counts[slot] = 0
        self.tables[slot] = kernels.CAP
        self.most_px[slot] = 0
        self.boxes[slot] = -1
        self.moved_at[slot] = _NEVER

    def learn(self, bins: NDArray[np.uint16], slots: Slots, taught: Slots, wanted: Flags) -> None:
        """Learn the colours of the wanted slots where they are taught; ``bins`` as of :func:`colour_bins`."""
        from sec_lab.segmentation import _layer_kernels as kernels

        if not wanted.any():
            return
        there = wanted & (np.bincount(slots.ravel(), minlength=N_SLOTS) > LEAST_TAUGHT_PX)
        # What a segment looked like at first is never forgotten: it may be carried through a shadow.
        first = there & ~self._has_first & ~self.mover
        self._counts[there] = np.maximum(self._counts[there] * np.float32(self._p.memory), self._first_counts[there])
        kernels.count_colours(bins, slots, taught, there, self._counts)
        self._first_counts[first] = self._counts[first]
        self._has_first[first] = self._counts[first].any(axis=1)
        for slot in np.flatnonzero(there):
            kernels.colour_costs(self._counts[slot], self.tables[slot])

    def update(self, found: Slots, slots: Slots, rest: Slots) -> None:
        """Which segments are on the way: their place is given up, or they are elsewhere.

        Parameters
        ----------
        found, slots, rest : (height, width) uint8
            As the lattice found them; as they were judged to be; what rests.
        """
        from sec_lab.segmentation import _part_kernels

        counts, self.touched = _part_kernels.presence(found, slots, rest, self.mover, self.boxes)
        resting, recognised, covered, visible, elsewhere = counts.T
        self.present = visible > 0
        self.most_px = np.maximum(visible, self.most_px)
        self.hidden = self.known & (visible < _HIDDEN * self.most_px)
        vacated = resting - recognised - covered
        bound = np.maximum(8, 0.12 * resting)
        starts = (resting > 0) & ((vacated > bound) | (self.touched & (elsewhere > bound)))
        # A piece that a hand leaves to be seen may settle; that is not yet the end of the way.
        ends = (resting > _HIDDEN * self.most_px) & (elsewhere <= np.maximum(8, 0.05 * resting)) & ~self.mover
        self.moving = (self.moving & ~ends) | starts
        if not (self.mover & self.present).any():
            self.moving &= ~self.hidden | self.mover  # what nobody carries any more has been carried away
        self.moving[:2] = False
        self.moving &= self.known
        self.moved_at[self.moving] = self.n_steps
        # Of what is where it rests, nothing is missing behind a mover.
        there = visible + np.where(self.moving, 0, covered)
        self.missing = self.known & ~self.mover & (there < 0.8 * self.most_px)
        self.missing[:2] = False
        self.touched &= self.known & ~self.mover
        self.touched[:2] = False

    @property
    def just_moved(self) -> Flags:
        """Segments that are, or have just been, on the way."""
        return np.asarray(self.moved_at > self.n_steps - _JUST_MOVED_FRAMES)

    def young(self, slot: Any) -> bool:
        """Whether a mover has come in only now, so that most of it is still to be seen for the first time."""
        return bool(self.mover[slot]) and self.n_steps - self.born[slot] < self._p.young_frames

    def close_to(self, box: NDArray[np.int64]) -> Flags:
        """Slots that are, or were when last seen, not far from a box."""
        boxes = self.boxes
        rows = np.maximum(0, np.maximum(box[0] - boxes[:, 2], boxes[:, 0] - box[2]))
        columns = np.maximum(0, np.maximum(box[1] - boxes[:, 3], boxes[:, 1] - box[3]))
        return np.asarray((boxes[:, 2] >= 0) & (np.hypot(rows, columns) < self._p.close_share * max(self._size)))

    def mover_close_by(self, box: NDArray[np.int64]) -> int:
        """A mover in the picture that is not far from a box; 0 if there is none."""
        close = np.flatnonzero(self.mover & self.present & self.close_to(box))
        return int(close[0]) if len(close) else 0

    def found_again(self, fits: NDArray[np.float32], colour: NDArray[np.float32], slots: Slots) -> int:
        """A mover that has left and comes in again, of the same colours, young once more; 0 if there is none.

        Parameters
        ----------
        fits, colour : (256,) float32
            Share of what comes in that fits to the colours of each slot, and its mean cost under them.
        slots : (height, width) uint8
        """
        lost = self.mover & self.known
        lost[np.unique(slots)] = False
        # A hand that brings something is of other colours in part.
        fitting = np.where(lost, fits, 0)
        best = int(np.argmax(fitting))
        if fitting[best] <= 0.4:
            # What is seen of it first may lie in its own shadow.
            best = int(np.argmin(np.where(lost, colour, np.inf)))
            if not (lost[best] and self.most_like(best, colour)):
                return 0
        self.born[best] = self.n_steps
        return best

    def most_like(self, slot: int, colour: NDArray[np.float32]) -> bool:
        """Whether colours, of mean cost ``colour`` (256,), are hardly of a segment, but surely less of any other."""
        if colour[slot] >= self._p.unknown_cost - SURELY:
            return False
        others = self.known.copy()
        others[slot] = False
        return bool(colour[slot] < colour[others].min(initial=np.inf) - SURELY)

    def of_one_hue(self, colours: NDArray[np.uint16], slot: int, beside: NDArray[Any]) -> list[int]:
        """The segment of whose hue a part is, in any light, that comes to light from below another one; none or one.

        It is one that is beside the part, or one that was carried there, if nothing else is nearly so like it.

        Parameters
        ----------
        colours : (n,) uint16
            Bins of its pixels.
        slot : int
            What it comes to light from below.
        beside : (m,) int
            Slots next to it.
        """
        from sec_lab.segmentation._layer_kernels import N_LIGHTNESS

        known = [int(k) for k in np.flatnonzero(self.known & ~self.mover) if k > 1]
        hue = colours % (self.tables.shape[1] // N_LIGHTNESS)
        cost = {k: float(self.tables[k].reshape(N_LIGHTNESS, -1).min(axis=0)[hue].mean()) for k in known}
        others = [k for k in known if k != slot]
        best = min(others, key=cost.__getitem__, default=slot)
        margin = SURELY if best in beside else CLEARLY
        if best == slot or cost[best] >= cost.get(slot, np.inf) - margin:
            return []
        if best in beside and cost[best] < self._p.fitting_cost:
            return [best]
        alone = all(cost[best] < cost[k] - CLEARLY for k in others if k != best)
        carried = bool(self.moving[best] or self.hidden[best])
        return [best] if alone and carried and cost[best] < self._p.unknown_cost else []
