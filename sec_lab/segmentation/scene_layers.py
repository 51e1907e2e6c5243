"""The layers of a scene as a movie goes on: what rests, what lies behind it, what moves (see ``layers.py``)."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.appearance import Lab, background_behind, smoothed_lab
from sec_lab.segmentation.flow import dense_inverse_search, grey_flow, reduced_grey
from sec_lab.segmentation.known_segments import KnownSegments, Slots
from sec_lab.segmentation.layer_parameters import LayerParameters
from sec_lab.segmentation.part_judging import UNTAUGHT, Judge, Part, Parts, parts_of, questions_about

_OFF_SHARE = 0.2
"""Share of the largest area of a segment that must come to light below it to be a thing of its own."""

_STILL_FRAMES = 2
"""Pixels that are still for so long belong to it, too."""

_RIM_PX = 3
"""How far pixels of mixed colours may lie from a segment: the blur of a camera and of compression."""


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
        self._segments = KnownSegments((height, width), parameters)
        self._visit = 0
        for slot in np.unique(self.slots):
            self._segments.give_label(int(slot))
        self._segments.learn(
            kernels.colour_bins(self.image), self.slots, np.ones((height, width), np.uint8), self._segments.known
        )
        self._flow = dense_inverse_search()

    @property
    def label_image(self) -> NDArray[np.uint16]:
        """Label of every pixel of the last frame, (height, width) uint16."""
        return self._segments.labels[self.slots]

    def step(self, picture: Lab) -> None:
        """Label the next frame, (height, width, 3) uint8 as of :func:`smoothed_lab`."""
        from sec_lab.segmentation import _layer_kernels as kernels
        from sec_lab.segmentation import _part_kernels

        p, segments = self._p, self._segments
        segments.n_steps += 1
        lab = self._compensated(picture)
        bins = kernels.colour_bins(lab)
        predicted = self._predicted(lab)
        moving = segments.candidates()
        costs = self._costs(lab, bins, predicted, moving)
        found, relaxed = np.empty_like(self.slots), np.empty_like(self.slots)
        taught = np.empty_like(self.slots)
        kernels.cheapest(costs, self.rest, moving, found, taught)
        awake = np.ones(self._size, np.bool_)
        for _ in range(p.sweeps):
            kernels.relax(costs, lab, self.rest, moving, found, relaxed, np.float32(p.bond), awake)
            found, relaxed = relaxed, found
        slots = found.copy()
        self._judge(slots, taught, predicted, lab, bins)
        self._part_off(slots, taught, costs[0], lab, bins)
        _part_kernels.close_rims(
            slots, self.rest, costs, segments.just_moved, np.float32(p.unknown_cost), _RIM_PX, taught
        )
        movers_there = segments.mover[slots].any()
        if not movers_there:
            self._visit = segments.n_steps
        _part_kernels.settle(
            lab,
            self.image,
            found,
            slots,
            self.slots,
            segments.mover,
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
        segments.update(found, slots, self.rest)
        self.image, self.slots = lab, slots
        segments.learn(bins, slots, taught, segments.moving & segments.known)

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

        if not self._segments.moving.any():
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

        p, segments = self._p, self._segments
        near = np.zeros(self._size, np.uint32)
        reach = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * p.reach_px + 1, 2 * p.reach_px + 1))
        for k, slot in enumerate(moving):
            inside = (predicted == slot).view(np.uint8)
            around = cv2.dilate(inside, reach)
            near |= (inside + around).astype(np.uint32) << np.uint32(2 * k)
        lost = (segments.hidden | segments.missing)[moving]
        carried = (segments.moving[moving] | segments.hidden[moving]) & ~segments.mover[moving]
        # What is hidden may come to light again anywhere.
        far = np.where(carried, np.where(lost, p.hidden_cost, p.far_cost), kernels.CAP)
        far = far.astype(np.float32)
        extra = np.where(segments.moving[moving] | segments.hidden[moving], 0, p.touched_cost).astype(np.float32)
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
            segments.tables,
            numbers,
            costs,
        )
        for plane in costs[:-1]:
            cv2.blur(plane, (3, 3), dst=plane)
        return costs

    def _judge(self, slots: Slots, taught: Slots, predicted: Slots, lab: Lab, bins: NDArray[np.uint16]) -> None:
        """Give every part that is small, unknown or left behind the segment it belongs to."""
        from sec_lab.segmentation import _part_kernels

        segments = self._segments
        parts = parts_of(slots, self._unknown_for, self._resting_for)
        questions = questions_about(parts, segments, self._p, least_px=self._least_px)
        asked = questions.asked
        if not len(asked):
            return
        number = np.full(len(parts.slot), -1, np.int32)
        number[asked] = np.arange(len(asked))
        around, guess, below, colour, fits = _part_kernels.surroundings(
            parts.where, number, len(asked), slots, predicted, self.rest, bins, segments.known, segments.tables
        )
        # Nothing is like a segment of unknown colours, nor like one that comes up below.
        colour[:, ~segments.known] = np.inf
        judge = Judge(segments, self.slots, self.rest, self._visit, self._p, self._new_px)
        new = np.full(len(parts.slot), -1, np.int64)
        for k in np.argsort(-parts.area[asked], kind="stable"):
            at = asked[k]
            part = Part(
                int(parts.slot[at]),
                int(parts.area[at]),
                parts.box[at],
                bool(parts.at_border[at]),
                bool(parts.inner_share[at] > self._p.inner_share),
                float(parts.unknown_for[at]),
                around[k],
                guess[k],
                below[k],
                colour[k],
                fits[k],
                partial(_colours_of, bins, parts, at),
            )
            if questions.left[at]:
                # What has the mover's own colours stays with it as long as it is there.
                if questions.gone[at] or part.fits[part.slot] < 0.5:
                    new[at] = judge.left_behind(part)
            elif questions.remnant[at] and part.around[segments.mover].sum() < 0.05:
                taken = judge.absorbing(part)
                new[at] = UNTAUGHT + taken
                where = parts.where == at
                self.rest[where] = taken
                self._seen[where] = lab[where]
            elif questions.remnant[at] and not questions.doubtful[at]:
                pass  # a mover in front may have cut the segment in two
            elif part.slot == 0 and not questions.small[at]:
                new[at] = judge.unknown(part)
            else:
                new[at] = UNTAUGHT + judge.absorbing(part)
        _part_kernels.recolour(parts.where, new, slots, taught)
        _part_kernels.share_out(slots, taught, bins, segments.tables)

    def _part_off(
        self, slots: Slots, taught: Slots, static_cost: NDArray[np.float32], lab: Lab, bins: NDArray[np.uint16]
    ) -> None:
        """Make a segment of what lay below another one that was lifted off it: two things, taken for one so far."""
        import cv2

        from sec_lab.segmentation import _part_kernels

        segments, p = self._segments, self._p
        carried = segments.moving & segments.known & ~segments.mover
        carried[:2] = False
        if not carried.any():
            return
        still = np.empty_like(slots)
        wait = p.wait_frames // 2
        n = _part_kernels.uncovered(
            lab,
            self.image,
            p.moved_by,
            slots,
            self.rest,
            carried,
            static_cost,
            p.unknown_cost,
            self._resting_for,
            wait,
            still,
        )
        if n < self._new_px:
            return
        square, rims = (np.ones((2 * px + 1, 2 * px + 1), np.uint8) for px in (1, _RIM_PX))
        below = cv2.morphologyEx((still >= _STILL_FRAMES).astype(np.uint8), cv2.MORPH_OPEN, square)
        n_parts, parts, boxes, _ = cv2.connectedComponentsWithStats(below, connectivity=4)
        for part in range(1, n_parts):
            where = parts == part
            slot = int(slots[where][0])
            least = max(self._new_px, _OFF_SHARE * segments.most_px[slot])
            if (still[where] >= wait).sum() < least:
                continue
            beside, near = (
                np.unique(slots[(cv2.dilate(where.view(np.uint8), reach) > 0) & ~where]) for reach in (square, rims)
            )
            fresh = [k for k in beside if segments.parted_off[k]] or segments.of_one_hue(bins[where], slot, near)
            left, top, width, height = boxes[part, : cv2.CC_STAT_AREA]
            box = np.array([top, left, top + height - 1, left + width - 1], dtype=np.int64)
            new = fresh[0] if fresh else segments.new(box, self.slots, self.rest, mover=False)
            segments.parted_off[new] = new > 1
            slots[where] = new
            taught[where] = 1


def _colours_of(bins: NDArray[np.uint16], parts: Parts, at: int) -> NDArray[np.uint16]:
    """Bins of the pixels of a part."""
    top, left, bottom, right = parts.box[at]
    box = np.s_[top : bottom + 1, left : right + 1]
    return np.asarray(bins[box][parts.where[box] == at])
