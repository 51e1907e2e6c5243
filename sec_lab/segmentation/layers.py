"""The default segmentation: a static scene, what moves in it, and what the movement takes, puts or brings to light.

Plain tracking gives a label to whatever is of one colour; what makes a segment *permanent* is that it rests, moves as
one, or is carried. So the scene is kept in layers: the picture of all that rests with the label of every pixel, the
background that lies behind it, and the segments that move. Each pixel of a new frame has a cost under every layer (how
well the picture of the static scene explains it, a shadow allowed; how usual its colour is in a moving segment near
by; a constant for something unknown), and a relaxation on the lattice of pixels with bonds between like colours (§2.2)
decides. Nothing is known of objects or hands. It is causal: a frame is labelled from what came before it.
"""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.flow import dense_inverse_search, grey_flow, reduced_grey
from sec_lab.segmentation.layer_parameters import DEFAULT, LayerParameters
from sec_lab.segmentation.record import Segmentation
from sec_lab.segmentation.static_scene import static_segments

if TYPE_CHECKING:
    from sec_lab.recording import Frame, Recording

Lab = NDArray[np.uint8]
Slots = NDArray[np.uint8]


def layered_segments(recording: "Recording", *, parameters: LayerParameters = DEFAULT) -> Segmentation:
    """Segments of a movie that keep their labels: what rests, what moves, what is carried (step 1, §2.2).

    Parameters
    ----------
    recording : Recording
        Its depth, where it has any, tells objects from what they lie on in the first frames.
    parameters : LayerParameters, optional

    Returns
    -------
    Segmentation
        Lazy; label 1 is the background. The first label image comes after ``parameters.opening_frames`` frames were
        read, every other one after its own frame.

    Raises
    ------
    ValueError
        While it is read: for the reasons of :class:`~sec_lab.recording.Recording`, or if there are more than 65,535
        segments.

    Examples
    --------
    A square that moves from the left to the right:

    >>> from sec_lab.recording import Recording
    >>> movie = np.full((12, 40, 60, 3), (60, 120, 80), dtype=np.uint8)
    >>> for place, frame in zip((5, 5, 5, 5, 5, 8, 11, 14, 17, 20, 23, 26), movie, strict=True):
    ...     frame[10:26, place : place + 16] = 200, 40, 30
    >>> segmentation = layered_segments(Recording.from_frames(movie))
    >>> [int(image[18, 12]) for image in segmentation][::11]
    [2, 1]
    """
    return Segmentation(partial(_layered, recording, parameters), recording.size, background=1)


def _layered(recording: "Recording", parameters: LayerParameters) -> Iterator[tuple[int, NDArray[np.uint16]]]:
    frames = iter(recording)
    opening = list(islice(frames, parameters.opening_frames))
    if not opening:
        return
    layers = Layers(opening[0].image, _static_scene(opening, parameters), parameters)
    yield opening[0].index, layers.label_image
    for frame in chain(opening[1:], frames):
        layers.step(frame.image)
        yield frame.index, layers.label_image


def _static_scene(opening: list["Frame"], parameters: LayerParameters) -> NDArray[np.uint8]:
    """Segments of the first frame; its depth is less noisy as the median over the first frames where nothing moves."""
    lab = smoothed_lab(opening[0].image)
    depth = None
    if opening[0].depth_m is not None:
        depths = np.stack([frame.depth_m for frame in opening if frame.depth_m is not None])
        known = np.where(depths > 0, depths, np.nan)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # pixels that are never known
            median = np.nanmedian(known, axis=0)
        depth = np.nan_to_num(median, nan=0.0).astype(np.float32)
    height, width = lab.shape[:2]
    return static_segments(lab, depth_m=depth, least_px=max(12, round(2 * height * width * parameters.least_share)))


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
        self._tables = np.full((256, kernels.N_BINS), kernels.CAP, np.float32)
        self._boxes = np.full((256, 4), -1, np.int64)
        self._born = np.zeros(256, np.int64)
        self._touched = np.zeros(256, dtype=np.bool_)
        self._hidden = np.zeros(256, dtype=np.bool_)
        self._missing = np.zeros(256, dtype=np.bool_)
        self._most_px = np.zeros(256, np.int64)
        self._n_steps = 0
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

        p = self._p
        self._n_steps += 1
        lab = self._compensated(smoothed_lab(image))
        bins = kernels.colour_bins(lab)
        predicted = self._predicted(lab)
        moving = np.flatnonzero(self._moving | self._touched)[-15:].astype(np.uint8)
        costs = self._costs(lab, bins, predicted, moving)
        found, relaxed = np.empty_like(self.slots), np.empty_like(self.slots)
        taught = np.empty_like(self.slots)
        kernels.cheapest(costs, self.rest, moving, found, taught)
        for _ in range(p.sweeps):
            kernels.relax(costs, lab, self.rest, moving, found, relaxed, np.float32(p.bond))
            found, relaxed = relaxed, found
        slots = found.copy()
        self._judge(slots, taught, predicted, bins)
        movers_there = self.mover[slots].any()
        kernels.settle(
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
        # A carried segment may come to light again anywhere; a mover grows from where it is.
        carried = self._moving[moving] & ~self.mover[moving]
        far = np.where(carried, p.far_cost, kernels.CAP).astype(np.float32)
        extra = np.where(self._moving[moving], 0, p.touched_cost).astype(np.float32)
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
        from sec_lab.segmentation import _layer_kernels as kernels

        parts = np.empty(self._size, np.int32)
        n = kernels.components(slots, parts)
        slot, area, box, unknown, resting, inner = kernels.describe(
            parts, n, slots, self._unknown_for, self._resting_for
        )
        largest = np.zeros(256, np.int64)
        np.maximum.at(largest, slot, area)
        small = area < self._least_px
        doubtful = (slot == 0) | (small & (area < largest[slot])) | (area < 6)
        # What a segment has left behind where it lay: its shadow, a rim.
        rests = resting >= self._p.wait_frames
        remnant = (slot > 1) & ~self.mover[slot] & (area < 0.3 * largest[slot]) & rests
        border = self._at_border(box)
        enters = np.zeros(256, dtype=np.bool_)
        enters[slot[border]] = True
        left = self.mover[slot] & ~small & rests & ~border & ((area < largest[slot]) | ~enters[slot])
        asked = np.flatnonzero(doubtful | left | remnant)
        if not len(asked):
            return
        question = np.full(n, -1, np.int32)
        question[asked] = np.arange(len(asked))
        around, guess, below, colour = kernels.surroundings(
            parts, question, len(asked), slots, predicted, self.rest, bins, self._known, self._tables
        )
        new = np.full(n, -1, np.int64)
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
            )
            if left[at]:
                new[at] = self._left_behind(part)
            elif remnant[at] and not doubtful[at]:
                # Where a mover is in front, it may have cut the segment in two.
                if part.around[self.mover].sum() < 0.05:
                    new[at] = UNTAUGHT + self._absorbing(part)
            elif part.slot == 0 and not small[at]:
                new[at] = self._unknown(part)
            else:
                new[at] = UNTAUGHT + self._absorbing(part)
        kernels.recolour(parts, new, slots, taught)

    def _unknown(self, part: "_Part") -> int:
        """Slot of a part that no layer explains; with UNTAUGHT added if its colours shall not be learned."""
        p = self._p
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
        if part.border and part.area >= 4 * self._least_px:
            return self._found_again(part) or self._new(mover=True)
        if not part.border and part.unknown_for >= p.wait_frames and part.area >= self._new_px and part.thick:
            return self._new(mover=False)
        return UNTAUGHT + self._absorbing(part)

    def _left_behind(self, part: "_Part") -> int:
        """Slot of a resting part that was taken for a mover, which has gone on: something it has put, or uncovered."""
        fitting = np.where(self._known, part.colour, np.inf)
        fitting[[0, 1, part.slot]] = np.inf
        # What is to be seen nowhere else is looked for.
        fitting[self._hidden] -= 2
        best = int(np.argmin(fitting))
        if fitting[best] < self._p.fitting_cost - 1.5:
            return best
        if part.area >= self._new_px and part.thick:
            return self._new(mover=False)
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
        close = np.flatnonzero(self.mover & self._close_to(box))
        return int(close[0]) if len(close) else 0

    def _found_again(self, part: "_Part") -> int:
        """A mover that has left and comes in again, of the same colours; 0 if there is none."""
        lost = self.mover & self._known
        lost[np.unique(self.slots)] = False
        fitting = np.where(lost, part.colour, np.inf)
        best = int(np.argmin(fitting))
        return best if fitting[best] < self._p.fitting_cost else 0

    def _new(self, *, mover: bool) -> int:
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
        return slot

    def _forget(self, slot: int) -> None:
        self.labels[slot] = 0
        self._known[slot] = self.mover[slot] = self._moving[slot] = False
        self._counts[slot] = 0
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
        self._counts[there] *= np.float32(self._p.memory)
        kernels.count_colours(bins, self.slots, taught, there, self._counts)
        for slot in np.flatnonzero(there):
            kernels.colour_costs(self._counts[slot], self._tables[slot])

    def _update_moving(self, found: Slots, slots: Slots) -> None:
        """Which segments are on the way: their place is given up, or they are elsewhere."""
        from sec_lab.segmentation import _layer_kernels as kernels

        counts, self._touched = kernels.presence(found, slots, self.rest, self.mover, self._boxes)
        resting, recognised, covered, visible, elsewhere = counts.T
        self._most_px = np.maximum(visible, self._most_px * 99 // 100)
        self._hidden = self._known & (visible < 0.3 * self._most_px)
        self._missing = self._known & ~self.mover & (visible < 0.8 * self._most_px)
        self._missing[:2] = False
        vacated = resting - recognised - covered
        bound = np.maximum(8, 0.12 * resting)
        starts = (resting > 0) & (vacated > bound)
        ends = (resting > 0) & (elsewhere <= np.maximum(8, 0.05 * resting)) & ~self.mover
        self._moving = (self._moving & ~ends) | starts
        self._moving[:2] = False
        self._moving &= self._known
        self._touched &= self._known & ~self.mover
        self._touched[:2] = False

    def _at_border(self, box: NDArray[np.int64]) -> NDArray[np.bool_]:
        height, width = self._size
        return np.asarray((box[:, 0] == 0) | (box[:, 1] == 0) | (box[:, 2] == height - 1) | (box[:, 3] == width - 1))


def smoothed_lab(image: NDArray[np.uint8]) -> Lab:
    """CIE L*a*b* of an RGB picture as OpenCV codes it (0 to 255 each), noise reduced a little."""
    import cv2

    return np.asarray(cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2LAB), (3, 3), 0.7))


def background_behind(picture: NDArray[np.float32], hidden: NDArray[np.uint8]) -> NDArray[np.float32]:
    """What may lie behind hidden pixels: the mean of what is seen around, from as near as possible."""
    import cv2

    known = (hidden == 0).astype(np.float32)
    filled, done, sigma = picture.copy(), known > 0, 4.0
    while not done.all() and sigma < max(picture.shape):
        weight = cv2.GaussianBlur(known, (0, 0), sigma)
        mean = cv2.GaussianBlur(picture * known[..., None], (0, 0), sigma)
        new = (weight > 0.02) & ~done
        filled[new] = mean[new] / weight[new][:, None]
        done |= new
        sigma *= 2
    return filled
