"""Which segment a part of the picture belongs to that is small, unknown or left behind (``layers.py``)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.known_segments import CLEARLY, N_SLOTS, SURELY, KnownSegments, Slots
from sec_lab.segmentation.layer_parameters import LayerParameters

UNTAUGHT = 256
"""Added to a slot: a part belongs to it, but its colours are not learned. By itself: its pixels are shared out."""

_PAUSE_FRAMES = 3
"""A mover that rests for so long makes a pause; its parts that rest are not left behind."""

# Shares of the rim of a part that borders on a segment, and of its area where a segment was expected.
_HARDLY_BESIDE, _BESIDE, _LARGELY_BESIDE = 0.03, 0.1, 0.25
_EXPECTED = 0.2

_LARGELY_BELOW = 0.3
"""Share of the area of a part where a thing was taken away; its other pixels are the shade of the hand around it."""

# In the unit of costs, nats per pixel (see LayerParameters).
_OUT_OF_PLACE = 6.0
"""Of a part that a segment neither borders on nor was expected at; less, the more it does."""
_ELSEWHERE, _COME_TO_LIGHT = 4.0, 2.0
"""Of a part away from its segment, by colour alone; and if the segment was hidden."""
_LACKING = 2.5
"""By so much colours may fit worse if most of a segment is missing right here: it is in another light."""


@dataclass(frozen=True, eq=False)
class Parts:
    """The connected parts of a picture.

    Parameters
    ----------
    where : (height, width) int32
        Number of the part of every pixel.
    slot, area : (n,) int64
    box : (n, 4) int64
        Top, left, bottom, right.
    unknown_for, resting_for : (n,) float
        Mean time unknown and at rest, in frames.
    inner_share : (n,) float
        Share of pixels more than two away from the border.
    at_border : (n,) bool
        It reaches the border of the picture.
    """

    where: NDArray[np.int32]
    slot: NDArray[np.int64]
    area: NDArray[np.int64]
    box: NDArray[np.int64]
    unknown_for: NDArray[np.float64]
    resting_for: NDArray[np.float64]
    inner_share: NDArray[np.float64]
    at_border: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Questions:
    """Which parts are in question, (n,) bool each.

    Parameters
    ----------
    small : of fewer pixels than may stand for themselves
    doubtful : unknown, or small beside the rest of its segment
    remnant : what a segment has left behind where it lay: its shadow, a rim
    gone : of a mover that has left the picture, of which nothing can remain
    left : at rest inside the picture while the mover it was taken for goes on
    """

    small: NDArray[np.bool_]
    doubtful: NDArray[np.bool_]
    remnant: NDArray[np.bool_]
    gone: NDArray[np.bool_]
    left: NDArray[np.bool_]

    @property
    def asked(self) -> NDArray[np.int64]:
        """Numbers of the parts in question."""
        return np.flatnonzero(self.doubtful | self.left | self.remnant)


@dataclass(frozen=True, eq=False)
class Part:
    """A part in question and what is around it; the arrays have an entry for every slot.

    ``colours`` gives the bins of its pixels.
    """

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
    colours: Callable[[], NDArray[np.uint16]]


def parts_of(slots: Slots, unknown_for: Slots, resting_for: Slots) -> Parts:
    """Connected parts of equal slots, 8 neighbours; images (height, width) uint8, times in frames."""
    from sec_lab.segmentation import _part_kernels

    height, width = slots.shape
    where = np.empty((height, width), np.int32)
    n = _part_kernels.components(slots, where)
    slot, area, box, unknown, resting, inner = _part_kernels.describe(where, n, slots, unknown_for, resting_for)
    border = (box[:, 0] == 0) | (box[:, 1] == 0) | (box[:, 2] == height - 1) | (box[:, 3] == width - 1)
    return Parts(where, slot, area, box, unknown, resting, inner, border)


def questions_about(parts: Parts, segments: KnownSegments, parameters: LayerParameters, *, least_px: int) -> Questions:
    """Parts that may belong to another segment than the lattice has found."""
    slot, area = parts.slot, parts.area
    largest = np.zeros(N_SLOTS, np.int64)
    np.maximum.at(largest, slot, area)
    small = area < least_px
    doubtful = (slot == 0) | (small & (area < largest[slot])) | (area < 6)
    rests = parts.resting_for >= parameters.wait_frames
    remnant = (slot > 1) & ~segments.mover[slot] & rests
    crumb = (area < 0.1 * segments.most_px[slot]) & ~segments.touched[slot]
    remnant &= (area < np.where(segments.moving[slot], 1, 0.3) * largest[slot]) | crumb
    enters = np.zeros(N_SLOTS, dtype=np.bool_)
    enters[slot[parts.at_border]] = True
    gone = segments.mover[slot] & ~enters[slot] & (largest[slot] < 0.2 * segments.most_px[slot])
    doubtful |= small & gone
    # While a mover pauses, its fingers may seem to be parts of their own.
    pause = np.zeros(N_SLOTS, np.float64)
    main = area == largest[slot]
    pause[slot[main]] = parts.resting_for[main]
    goes_on = pause[slot] < _PAUSE_FRAMES
    left = segments.mover[slot] & ~small & ~parts.at_border & ((rests & goes_on & (area < largest[slot])) | gone)
    return Questions(small, doubtful, remnant, gone, left)


@dataclass(frozen=True, eq=False)
class Judge:
    """Gives a part in question a slot, by what is known of the segments and of the last frame.

    Parameters
    ----------
    segments : KnownSegments
        A new segment is added to them where one is needed.
    slots, rest : (height, width) uint8
        Of the last frame, and of what rests.
    visit : int
        Last step without a mover in the picture.
    parameters : LayerParameters
    new_px : int
        Smallest new segment inside the picture.
    """

    segments: KnownSegments
    slots: Slots
    rest: Slots
    visit: int
    parameters: LayerParameters
    new_px: int

    def unknown(self, part: Part) -> int:
        """Slot of a part that no layer explains; with UNTAUGHT added if its colours shall not be learned."""
        p, segments = self.parameters, self.segments
        # Where a segment has gone away, what it lay on comes to light.
        gone = segments.moving & ~segments.mover & (part.around < 0.2)
        if part.below[gone].sum() > _LARGELY_BELOW:
            if part.colour[1] < p.fitting_cost + 0.5:
                return UNTAUGHT + 1
            support = int(np.argmax(part.around))
            if support and part.around[support] > 0.5 and segments.most_like(support, part.colour):
                return UNTAUGHT + support
        if self._is_ground(part):
            return UNTAUGHT + 1
        best, least, fits = 0, np.inf, False
        # A rim at the border that has been strange for long is what a hand has shifted there, not a hand that comes in.
        enters = part.border and part.unknown_for < p.wait_frames
        asked = (part.around > _HARDLY_BESIDE) | (part.guess > _EXPECTED) | segments.close_to(part.box)
        # What was carried under a hand comes to light far from where it was last seen.
        asked |= segments.hidden & ~segments.mover
        just_moved = segments.just_moved
        for slot in np.flatnonzero(asked):
            if slot <= 1 or not segments.known[slot]:
                continue
            # A segment of which much is missing takes what is next to it, even in another light.
            lacking = bool(segments.missing[slot]) and part.around[slot] > _LARGELY_BESIDE
            fitting = part.colour[slot] < p.fitting_cost + (_LACKING if lacking else 0)
            # Mixed colours of a rim may be like a third thing: orange and white make skin.
            if not fitting and part.thick and (segments.mover[slot] or just_moved[slot]):
                fitting = segments.most_like(int(slot), part.colour)
            near = part.around[slot] > _BESIDE or part.guess[slot] > _EXPECTED
            grows = segments.mover[slot] and (fitting or enters or segments.young(slot))
            if near and (grows or ((just_moved[slot] or segments.missing[slot]) and fitting)):
                score = part.colour[slot] + _OUT_OF_PLACE * (1 - max(min(1.0, 2 * part.around[slot]), part.guess[slot]))
            elif part.colour[slot] < p.fitting_cost - SURELY:
                score = part.colour[slot] + (_COME_TO_LIGHT if segments.hidden[slot] else _ELSEWHERE)
            elif self._comes_to_light(part, int(slot)):
                score, fitting = part.colour[slot] + _COME_TO_LIGHT, True
            else:
                continue
            if score < least:
                best, least, fits = int(slot), float(score), bool(fitting)
        if not best and enters:
            best = segments.mover_close_by(part.box)
        if best and (fits or part.border or segments.young(best)):
            segments.moving[best] = True
            return best
        if part.border and not part.thick and part.around[segments.mover].sum() > _LARGELY_BESIDE:
            return UNTAUGHT + self.absorbing(part)
        if part.border and part.area >= 2 * self.new_px:
            return segments.found_again(part.fits, part.colour, self.slots) or self._new(part, mover=True)
        if not part.border and part.unknown_for >= p.wait_frames:
            return self._put(part)
        return UNTAUGHT + self.absorbing(part)

    def left_behind(self, part: Part) -> int:
        """Slot of a resting part that was taken for a mover, which has gone on: something it has put, or uncovered."""
        if self._is_ground(part):
            return UNTAUGHT + 1
        fitting = np.where(self.segments.known, part.colour, np.inf)
        fitting[[0, 1, part.slot]] = np.inf
        # What is to be seen nowhere else is looked for.
        fitting[self.segments.hidden] -= _ELSEWHERE - _COME_TO_LIGHT
        fitting[self.segments.missing & (part.around > 0.15)] -= _LACKING
        best = int(np.argmin(fitting))
        if fitting[best] < self.parameters.fitting_cost - 1.5 or self.segments.most_like(best, part.colour):
            return best
        return self._put(part)

    def _comes_to_light(self, part: Part, slot: int) -> bool:
        """Whether a part is of a segment that is hidden, or that lacks it here: nothing else is nearly so like it."""
        segments = self.segments
        bound, margin = self.parameters.unknown_cost, CLEARLY
        others = self._may_be_here(part)
        if segments.missing[slot] and part.around[slot] > _LARGELY_BESIDE:
            bound += CLEARLY
            others = part.around > _HARDLY_BESIDE
        elif segments.mover[slot] or not segments.hidden[slot]:
            return False
        elif segments.moving[slot] and part.around[segments.mover].sum() > _LARGELY_BESIDE:
            # A hand shows it again from another side; the less it is like itself, the less may be others.
            bound, margin = (bound, SURELY) if part.colour[slot] < bound else (bound + CLEARLY, CLEARLY)
        others[slot] = False
        fits = part.colour[slot] < min(bound, part.colour[others].min(initial=np.inf) - margin)
        return bool(fits and part.area < 1.2 * segments.most_px[slot])

    def _may_be_here(self, part: Part) -> NDArray[np.bool_]:
        """Slots that a part may be of: not those that rest elsewhere, untouched and wholly to be seen."""
        segments = self.segments
        elsewhere = ~(segments.moving | segments.touched | segments.hidden | segments.missing)
        return np.asarray(segments.known & (~elsewhere | (part.around > _HARDLY_BESIDE)))

    def _is_ground(self, part: Part) -> bool:
        """Whether a part lies in the background and has its colours: other light, no other thing."""
        return bool(part.around[1] > 0.5 and part.colour[1] < self.parameters.fitting_cost)

    def _put(self, part: Part) -> int:
        """Slot of a part that came to rest: with what came to rest beside it in the same visit it is one thing."""
        fresh = (self.segments.born > self.visit) & ~self.segments.mover & self.segments.known & (part.around > _BESIDE)
        if fresh.any():
            return int(np.argmax(np.where(fresh, part.around, 0)))
        lifted = self.segments.moving & ~self.segments.mover
        if part.below[lifted].sum() > 0.5:
            below = int(np.argmax(np.where(lifted, part.below, 0)))
            for slot in self.segments.of_one_hue(part.colours(), below, np.flatnonzero(part.around > _HARDLY_BESIDE)):
                return slot
        whole = self._lacking(part) or self._unsettled(part)
        if whole:
            return UNTAUGHT + whole
        hand = float(part.around[self.segments.mover].sum())
        large = part.area >= self.new_px and part.thick
        if large and (hand < 0.3 or part.area >= 4 * self.new_px):
            return self._new(part, mover=False)
        return UNTAUGHT + self.absorbing(part)

    def _lacking(self, part: Part) -> int:
        """A segment, carried just now, that lacks more than half as much as a part that it is around; 0 if none does.

        If it is around less than half of it, nothing else beside the part is as much like it.
        """
        segments = self.segments
        now = np.bincount(self.slots.ravel(), minlength=N_SLOTS) - part.guess * part.area
        lacks = segments.just_moved & ~segments.mover & (segments.most_px - now > part.area / 2)
        beside = part.colour[(part.around > _HARDLY_BESIDE) & ~segments.mover].min(initial=np.inf)
        lacks &= (part.around > 0.5) | ((part.around > _LARGELY_BESIDE) & (part.colour <= beside))
        lacks &= part.colour < self.parameters.unknown_cost + CLEARLY
        return int(np.argmax(np.where(lacks, part.around, 0)))

    def _unsettled(self, part: Part) -> int:
        """A segment, carried just now, beside a part that is like no other one nearly as much, or all around; else 0.

        Its outline has been what the hand left of it to be seen.
        """
        segments = self.segments
        cost = np.where(segments.known & ~segments.mover, part.colour, np.inf)
        moved = segments.just_moved & np.isfinite(cost)
        moved[:2] = False
        best = int(np.argmin(cost))
        others = self._may_be_here(part)
        others[best] = False
        bound = min(self.parameters.unknown_cost + CLEARLY, cost[others].min(initial=np.inf) - CLEARLY)
        if moved[best] and part.area < segments.most_px[best] and part.around[best] > _BESIDE and cost[best] < bound:
            return best
        moved &= (part.around > 0.8) & (part.area < 0.25 * segments.most_px)
        return int(np.argmax(np.where(moved, part.around, 0)))

    def absorbing(self, part: Part) -> int:
        """Slot that a part falls to which is too small, or not to be explained yet.

        0 if it is unknown and thin: then its pixels are shared out (:func:`_part_kernels.share_out`).
        """
        if part.slot == 0 and not part.thick:
            return 0
        weight = part.around + 0.3 * part.guess + 0.5 * part.below
        weight[[0, part.slot]] = 0
        return int(np.argmax(weight)) if weight.any() else 1

    def _new(self, part: Part, *, mover: bool) -> int:
        return self.segments.new(part.box, self.slots, self.rest, mover=mover)
