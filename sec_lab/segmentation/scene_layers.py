"""The layers of a scene as a movie goes on: what rests, what lies behind it, what moves (see ``layers.py``)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.appearance import Lab, background_behind, smoothed_lab
from sec_lab.segmentation.flow import dense_inverse_search, grey_flow, reduced_grey
from sec_lab.segmentation.layer_parameters import LayerParameters

Slots = NDArray[np.uint8]

UNTAUGHT = 256
"""Added to a slot: a part belongs to it, but its colours are not learned."""


@dataclass(frozen=True, eq=False)
class _Part:
    """A connected part of the picture and what is around it; the arrays have an entry for every slot."""

    slot: int
    area: int
    box: NDArray[np.int64]
    border: bool
    thick: bool
    unknown_for: float
    around: NDArray[np.float32]
    guess: NDArray[np.float32]
    below: NDArray[np.float32]
    colour: NDArray[np.float32]
    fits: NDArray[np.float32]


class Layers:
    """The layers of a scene as seen so far: the static scene, the background behind it, the segments that move.

    Parameters
    ----------
    image : (height, width, 3) uint8
        First frame, RGB.
    static : (height, width) int
        Segments of the first frame, 1 for the background and larger numbers, up to 200, for what stands on it.
    parameters : LayerParameters
    """

    def __init__(self, image: NDArray[np.uint8], static: NDArray[Any], parameters: LayerParameters) -> None:
        import cv2

        from sec_lab.segmentation import _layer_kernels as kernels

        self._p = parameters
        height, width = static.shape
        self._size = height, width
        self._least_px = max(12, round(height * width * parameters.least_share))
        self._new_px = max(25, round(height * width * parameters.new_share))
        self.image: Lab = smoothed_lab(image)
        self.slots: Slots = static.astype(np.uint8)
        self.rest: Slots = self.slots.copy()
        self._seen = self.image.astype(np.float32)
        hidden: Any = cv2.dilate((self.slots != 1).astype(np.uint8), np.ones((5, 5), np.uint8))
        self._behind = background_behind(self._seen, hidden)
        self._behind_sigma = hidden * np.float32(4)
        self._brightest = np.full((height, width), 1.05, np.float32)
        self._unknown_for: Slots = np.zeros((height, width), np.uint8)
        self._resting_for: Slots = np.full((height, width), 250, np.uint8)
        self.mover = np.zeros(256, dtype=np.bool_)
        self._moving = np.zeros(256, dtype=np.bool_)
        self._known = np.zeros(256, dtype=np.bool_)
        self._counts = np.zeros((256, kernels.N_BINS), np.float32)
        self._anchors = np.zeros((256, kernels.N_BINS), np.float32)
        self._anchored = np.zeros(256, dtype=np.bool_)
        self._tables = np.full((256, kernels.N_BINS), kernels.CAP, np.float32)
        self._boxes = np.full((256, 4), -1, np.int64)
        self._born = np.zeros(256, np.int64)
        self._touched = np.zeros(256, dtype=np.bool_)
        self._hidden = np.zeros(256, dtype=np.bool_)
        self._missing = np.zeros(256, dtype=np.bool_)
        self._present = np.zeros(256, dtype=np.bool_)
        self._most_px = np.zeros(256, np.int64)
        self._n_steps = 0
        self._visit = 0
        self.labels = np.zeros(256, dtype=np.uint16)
        self._next_label = 1
        for slot in np.unique(self.slots):
            self._give_label(int(slot))
        self._learn(kernels.colour_bins(self.image), np.ones((height, width), np.uint8), self._known)
        self._flow = dense_inverse_search()

    @property
    def label_image(self) -> NDArray[np.uint16]:
        """Label of every pixel of the last frame, (height, width) uint16."""
        return self.labels[self.slots]

    def step(self, image: NDArray[np.uint8]) -> None:
        """Label the next frame, (height, width, 3) uint8 RGB."""
        from sec_lab.segmentation import _layer_kernels as kernels
        from sec_lab.segmentation import _part_kernels

        p = self._p
        self._n_steps += 1
        lab = self._compensated(smoothed_lab(image))
        bins = kernels.colour_bins(lab)
        predicted = self._predicted(lab)
        moving = self._candidates()
        costs = self._costs(lab, bins, predicted, moving)
        found, relaxed = np.empty_like(self.slots), np.empty_like(self.slots)
        taught = np.empty_like(self.slots)
        kernels.cheapest(costs, self.rest, moving, found, taught)
        awake = np.ones(self._size, np.bool_)
        for _ in range(p.sweeps):
            kernels.relax(costs, lab, self.rest, moving, found, relaxed, np.float32(p.bond), awake)
            found, relaxed = relaxed, found
        slots = found.copy()
        self._judge(slots, taught, predicted, bins)
        movers_there = self.mover[slots].any()
        if not movers_there:
            self._visit = self._n_steps
        _part_kernels.settle(
            lab,
            self.image,
            found,
            slots,
            self.slots,
            self.mover,
            movers_there,
            p.settle_frames,
            p.moved_by,
            self._unknown_for,
            self._resting_for,
            self.rest,
            self._seen,
            self._behind,
            self._behind_sigma,
            self._brightest,
        )
        self._update_moving(found, slots)
        self.image, self.slots = lab, slots
        self._learn(bins, taught, self._moving & self._known)

    def _candidates(self) -> NDArray[np.uint8]:
        """Slots that may be anywhere near: at most 15, movers first, then the latest."""
        hidden = self._hidden & ~self.mover
        hidden[:2] = False
        slots = np.flatnonzero(self._moving | self._touched | hidden)[::-1]
        return slots[np.argsort(~self.mover[slots], kind="stable")][:15].astype(np.uint8)

    def _compensated(self, lab: Lab) -> Lab:
        """The frame as bright as the static scene was, where the camera has changed its exposure."""
        rows, columns = slice(2, None, 7), slice(3, None, 7)
        still = self.slots[rows, columns] == self.rest[rows, columns]
        if still.sum() < 50:
            return lab
        ratio = (lab[rows, columns, 0][still] + 16.0) / (self._seen[rows, columns, 0][still] + 16.0)
        gain = float(np.median(ratio))
        if abs(gain - 1) < 0.008 or not 0.5 < gain < 2:
            return lab
        levels = np.clip(np.round((np.arange(256) + 16) / gain - 16), 0, 255).astype(np.uint8)
        changed = lab.copy()
        changed[..., 0] = levels[lab[..., 0]]
        chroma = np.clip(np.round((np.arange(256) - 128) / gain + 128), 0, 255).astype(np.uint8)
        changed[..., 1:] = chroma[lab[..., 1:]]
        return changed

    def _predicted(self, lab: Lab) -> Slots:
        from sec_lab.segmentation import _layer_kernels as kernels

        if not self._moving.any():
            return self.slots
        before, now = (reduced_grey(np.ascontiguousarray(picture[..., 0])) for picture in (self.image, lab))
        flow = grey_flow(before, now, self._flow)
        warped: Slots = kernels.warp(self.slots, flow)
        return warped

    def _costs(
        self, lab: Lab, bins: NDArray[np.uint16], predicted: Slots, moving: NDArray[np.uint8]
    ) -> NDArray[np.float32]:
        import cv2

        from sec_lab.segmentation import _layer_kernels as kernels

        p = self._p
        near = np.zeros(self._size, np.uint32)
        reach = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * p.reach_px + 1, 2 * p.reach_px + 1))
        for k, slot in enumerate(moving):
            inside = (predicted == slot).view(np.uint8)
            around = cv2.dilate(inside, reach)
            near |= (inside + around).astype(np.uint32) << np.uint32(2 * k)
        lost = (self._hidden | self._missing)[moving]
        carried = (self._moving[moving] | self._hidden[moving]) & ~self.mover[moving]
        # What is hidden may come to light again anywhere.
        far = np.where(carried, np.where(lost, p.hidden_cost, p.far_cost), kernels.CAP)
        far = far.astype(np.float32)
        extra = np.where(self._moving[moving] | self._hidden[moving], 0, p.touched_cost).astype(np.float32)
        numbers = np.array(
            [
                p.static_cost,
                p.unknown_cost,
                p.lightness_sigma,
                p.chroma_sigma,
                p.shadow_sigma,
                p.shadow_cost,
                p.prediction_cost,
                1.5,
            ],
            np.float32,
        )
        costs = np.empty((3 + len(moving), *self._size), np.float32)
        kernels.label_costs(
            lab,
            bins,
            self.rest,
            self._seen,
            self._behind,
            self._behind_sigma,
            self._brightest,
            predicted,
            near,
            moving,
            far,
            extra,
            self._tables,
            numbers,
            costs,
        )
        for plane in costs[:-1]:
            cv2.blur(plane, (3, 3), dst=plane)
        return costs

    def _judge(self, slots: Slots, taught: Slots, predicted: Slots, bins: NDArray[np.uint16]) -> None:
        """Give every part that is small, unknown or left behind the segment it belongs to."""
        from sec_lab.segmentation import _part_kernels

        parts = np.empty(self._size, np.int32)
        n = _part_kernels.components(slots, parts)
        slot, area, box, unknown, resting, inner = _part_kernels.describe(
            parts, n, slots, self._unknown_for, self._resting_for
        )
        largest = np.zeros(256, np.int64)
        np.maximum.at(largest, slot, area)
        small = area < self._least_px
        doubtful = (slot == 0) | (small & (area < largest[slot])) | (area < 6)
        # What a segment has left behind where it lay: its shadow, a rim.
        rests = resting >= self._p.wait_frames
        remnant = (slot > 1) & ~self.mover[slot] & rests
        crumb = (area < 0.1 * self._most_px[slot]) & ~self._touched[slot]
        remnant &= (area < np.where(self._moving[slot], 1, 0.3) * largest[slot]) | crumb
        border = self._at_border(box)
        enters = np.zeros(256, dtype=np.bool_)
        enters[slot[border]] = True
        # Of a mover that has left the picture nothing can remain.
        gone = self.mover[slot] & ~enters[slot] & (largest[slot] < 0.2 * self._most_px[slot])
        doubtful |= small & gone
        # While a mover pauses, its fingers may seem to be parts of their own.
        pause = np.zeros(256, np.float64)
        main = area == largest[slot]
        pause[slot[main]] = resting[main]
        goes_on = pause[slot] < 3
        left = self.mover[slot] & ~small & ~border & ((rests & goes_on & (area < largest[slot])) | gone)
        asked = np.flatnonzero(doubtful | left | remnant)
        if not len(asked):
            return
        question = np.full(n, -1, np.int32)
        question[asked] = np.arange(len(asked))
        around, guess, below, colour, fits = _part_kernels.surroundings(
            parts, question, len(asked), slots, predicted, self.rest, bins, self._known, self._tables
        )
        new = np.full(n, -1, np.int64)
        # Nothing is like a segment of unknown colours, nor like one that comes up below.
        colour[:, ~self._known] = np.inf
        for k in np.argsort(-area[asked], kind="stable"):
            at = asked[k]
            part = _Part(
                int(slot[at]),
                int(area[at]),
                box[at],
                bool(border[at]),
                bool(inner[at] > self._p.inner_share),
                float(unknown[at]),
                around[k],
                guess[k],
                below[k],
                colour[k],
                fits[k],
            )
            if left[at]:
                # What has the mover's own colours stays with it as long as it is there.
                if gone[at] or part.fits[part.slot] < 0.5:
                    new[at] = self._left_behind(part)
            elif remnant[at] and part.around[self.mover].sum() < 0.05:
                taken = self._absorbing(part)
                new[at] = UNTAUGHT + taken
                where = parts == at
                self.rest[where] = taken
                self._seen[where] = self.image[where]
            elif remnant[at] and not doubtful[at]:
                pass  # a mover in front may have cut the segment in two
            elif part.slot == 0 and not small[at]:
                new[at] = self._unknown(part)
            else:
                new[at] = UNTAUGHT + self._absorbing(part)
        _part_kernels.recolour(parts, new, slots, taught)

    def _unknown(self, part: "_Part") -> int:
        """Slot of a part that no layer explains; with UNTAUGHT added if its colours shall not be learned."""
        p = self._p
        # Where a segment has gone away, what it lay on comes to light.
        gone = self._moving & ~self.mover & (part.around < 0.2)
        if part.below[gone].sum() > 0.5 and part.colour[1] < p.fitting_cost + 0.5:
            return UNTAUGHT + 1
        if self._is_ground(part):
            return UNTAUGHT + 1
        best, least, fits = 0, np.inf, False
        for slot in np.flatnonzero((part.around > 0.03) | (part.guess > 0.2) | self._close_to(part.box)):
            if slot <= 1 or not self._known[slot]:
                continue
            # A segment of which much is missing takes what is next to it, even in another light.
            lacking = bool(self._missing[slot]) and part.around[slot] > 0.25
            fitting = part.colour[slot] < p.fitting_cost + (2.5 if lacking else 0)
            near = part.around[slot] > 0.1 or part.guess[slot] > 0.2
            grows = self.mover[slot] and (fitting or part.border or self._young(slot))
            if near and (grows or ((self._moving[slot] or self._missing[slot]) and fitting)):
                score = part.colour[slot] + 6 * (1 - max(min(1.0, 2 * part.around[slot]), part.guess[slot]))
            elif part.colour[slot] < p.fitting_cost - 1:
                score = part.colour[slot] + (2 if self._hidden[slot] else 4)
            else:
                continue
            if score < least:
                best, least, fits = int(slot), float(score), bool(fitting)
        if not best and part.border:
            best = self._mover_close_by(part.box)
        if best and (fits or part.border or self._young(best)):
            self._moving[best] = True
            return best
        if part.border and part.area >= 2 * self._new_px:
            return self._found_again(part) or self._new(part, mover=True)
        if not part.border and part.unknown_for >= p.wait_frames:
            return self._put(part)
        return UNTAUGHT + self._absorbing(part)

    def _left_behind(self, part: "_Part") -> int:
        """Slot of a resting part that was taken for a mover, which has gone on: something it has put, or uncovered."""
        if self._is_ground(part):
            return UNTAUGHT + 1
        fitting = np.where(self._known, part.colour, np.inf)
        fitting[[0, 1, part.slot]] = np.inf
        # What is to be seen nowhere else is looked for.
        fitting[self._hidden] -= 2
        fitting[self._missing & (part.around > 0.15)] -= 2.5
        best = int(np.argmin(fitting))
        if fitting[best] < self._p.fitting_cost - 1.5:
            return best
        return self._put(part)

    def _is_ground(self, part: _Part) -> bool:
        """Whether a part lies in the background and has its colours: other light, no other thing."""
        return bool(part.around[1] > 0.5 and part.colour[1] < self._p.fitting_cost)

    def _put(self, part: _Part) -> int:
        """Slot of a part that came to rest: with what came to rest beside it in the same visit it is one thing."""
        fresh = (self._born > self._visit) & ~self.mover & self._known & (part.around > 0.1)
        if fresh.any():
            return int(np.argmax(np.where(fresh, part.around, 0)))
        hand = float(part.around[self.mover].sum())
        large = part.area >= self._new_px and part.thick
        if large and (hand < 0.3 or part.area >= 4 * self._new_px):
            return self._new(part, mover=False)
        return UNTAUGHT + self._absorbing(part)

    def _absorbing(self, part: "_Part") -> int:
        """Slot that a part falls to which is too small, or not to be explained yet."""
        weight = part.around + 0.3 * part.guess + 0.5 * part.below
        weight[[0, part.slot]] = 0
        return int(np.argmax(weight)) if weight.any() else 1

    def _young(self, slot: Any) -> bool:
        """Whether a mover has come in only now, so that most of it is still to be seen for the first time."""
        return bool(self.mover[slot]) and self._n_steps - self._born[slot] < self._p.young_frames

    def _close_to(self, box: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Slots that are, or were when last seen, not far from a box."""
        boxes = self._boxes
        rows = np.maximum(0, np.maximum(box[0] - boxes[:, 2], boxes[:, 0] - box[2]))
        columns = np.maximum(0, np.maximum(box[1] - boxes[:, 3], boxes[:, 1] - box[3]))
        return np.asarray((boxes[:, 2] >= 0) & (np.hypot(rows, columns) < self._p.close_share * max(self._size)))

    def _mover_close_by(self, box: NDArray[np.int64]) -> int:
        close = np.flatnonzero(self.mover & self._present & self._close_to(box))
        return int(close[0]) if len(close) else 0

    def _found_again(self, part: "_Part") -> int:
        """A mover that has left and comes in again, of the same colours; 0 if there is none."""
        lost = self.mover & self._known
        lost[np.unique(self.slots)] = False
        # A hand that brings something is of other colours in part.
        fitting = np.where(lost, part.fits, 0)
        best = int(np.argmax(fitting))
        return best if fitting[best] > 0.4 else 0

    def _new(self, part: _Part, *, mover: bool) -> int:
        free = np.flatnonzero(self.labels[2:] == 0)
        if not len(free):
            gone = np.setdiff1d(np.arange(2, 256), np.union1d(self.slots, self.rest))
            if not len(gone):
                return 1
            self._forget(int(gone[0]))
            free = gone[:1] - 2
        slot = int(free[0]) + 2
        self._give_label(slot)
        self.mover[slot] = mover
        self._moving[slot] = True
        self._born[slot] = self._n_steps
        self._present[slot] = True
        self._boxes[slot] = part.box
        return slot

    def _forget(self, slot: int) -> None:
        from sec_lab.segmentation import _layer_kernels as kernels

        self.labels[slot] = 0
        self._known[slot] = self.mover[slot] = self._moving[slot] = self._anchored[slot] = False
        self._hidden[slot] = self._missing[slot] = self._touched[slot] = False
        self._counts[slot] = self._anchors[slot] = 0
        self._tables[slot] = kernels.CAP
        self._most_px[slot] = 0
        self._boxes[slot] = -1

    def _give_label(self, slot: int) -> None:
        if self._next_label > np.iinfo(np.uint16).max:
            raise ValueError("movie: expected at most 65,535 segments, got more")
        self.labels[slot] = self._next_label
        self._next_label += 1
        self._known[slot] = True

    def _learn(self, bins: NDArray[np.uint16], taught: Slots, wanted: NDArray[np.bool_]) -> None:
        from sec_lab.segmentation import _layer_kernels as kernels

        if not wanted.any():
            return
        there = wanted & (np.bincount(self.slots.ravel(), minlength=256) > 30)
        # What a segment looked like at first is never forgotten: it may be carried through a shadow.
        first = there & ~self._anchored & ~self.mover
        self._counts[there] = np.maximum(self._counts[there] * np.float32(self._p.memory), self._anchors[there])
        kernels.count_colours(bins, self.slots, taught, there, self._counts)
        self._anchors[first] = self._counts[first]
        self._anchored[first] = self._counts[first].any(axis=1)
        for slot in np.flatnonzero(there):
            kernels.colour_costs(self._counts[slot], self._tables[slot])

    def _update_moving(self, found: Slots, slots: Slots) -> None:
        """Which segments are on the way: their place is given up, or they are elsewhere."""
        from sec_lab.segmentation import _part_kernels

        counts, self._touched = _part_kernels.presence(found, slots, self.rest, self.mover, self._boxes)
        resting, recognised, covered, visible, elsewhere = counts.T
        self._present = visible > 0
        self._most_px = np.maximum(visible, self._most_px)
        self._hidden = self._known & (visible < 0.3 * self._most_px)
        self._missing = self._known & ~self.mover & (visible < 0.8 * self._most_px)
        self._missing[:2] = False
        vacated = resting - recognised - covered
        bound = np.maximum(8, 0.12 * resting)
        starts = (resting > 0) & ((vacated > bound) | (self._touched & (elsewhere > bound)))
        ends = (resting > 0) & (elsewhere <= np.maximum(8, 0.05 * resting)) & ~self.mover
        self._moving = (self._moving & ~ends) | starts
        self._moving[:2] = False
        self._moving &= self._known
        self._touched &= self._known & ~self.mover
        self._touched[:2] = False

    def _at_border(self, box: NDArray[np.int64]) -> NDArray[np.bool_]:
        height, width = self._size
        return np.asarray((box[:, 0] == 0) | (box[:, 1] == 0) | (box[:, 2] == height - 1) | (box[:, 3] == width - 1))
