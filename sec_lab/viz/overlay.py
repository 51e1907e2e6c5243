"""The movie with what was seen in it drawn in: segments, their relations, and the chain as it grows (Fig. 2.1)."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.observation import Observation
from sec_lab.recording import Recording
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz.chain_panel import ChainPanel
from sec_lab.viz.lettering import badge, font, paste
from sec_lab.viz.style import EDGE_STYLE, PAPER, rgb
from sec_lab.viz.tint import Tint, centres_of, strong_colour

if TYPE_CHECKING:
    from sec_lab.event_chain import EventChain
    from sec_lab.segmentation import Segmentation

_LEAST_HEIGHT_PX = 480
_PANEL_SHARE = 0.66

Point = tuple[float, float]
Labels = NDArray[np.integer]


def overlay_frames(observation: Observation, recording: Recording | None = None) -> Iterator[NDArray[np.uint8]]:
    """Pictures of a movie in which its segments, their relations and the event chain are shown.

    Segments have a tint, a border and a label at their centre; overlapping ones are joined by a solid blue line,
    touching ones by a dashed red one (Fig. 2.4). Beside the picture stands the chain, and its column of now is lit. A
    frame without a label image of its own shows the last one; small pictures are enlarged.

    Parameters
    ----------
    observation : Observation
        With a segmentation, which is read once more.
    recording : Recording, optional
        The movie, which is read once more; if left out, segments are drawn on paper.

    Yields
    ------
    (height, width, 3) uint8 ndarray
        RGB, of one size with even sides. A new array each.

    Raises
    ------
    ValueError
        If the observation has no segmentation, the sizes differ, or label images go on after the movie.

    Examples
    --------
    >>> from sec_lab.pipeline import observe_segments
    >>> from sec_lab.segmentation import Segmentation
    >>> labels = np.ones((3, 20, 30), dtype=np.uint8)
    >>> labels[1:, 5:15, 5:15] = 2
    >>> seen = observe_segments(Segmentation.from_labels(labels))
    >>> [picture.shape for picture in overlay_frames(seen)]
    [(480, 1196, 3), (480, 1196, 3), (480, 1196, 3)]
    """
    segmentation = observation.segmentation
    if segmentation is None:
        raise ValueError("overlay: expected an observation with its segmentation, got one without")
    if recording is not None and recording.size != segmentation.size:
        raise ValueError(f"overlay: expected pictures of {segmentation.size} like the masks, got {recording.size}")
    return _drawn(observation, segmentation, recording)


def _drawn(
    observation: Observation, segmentation: "Segmentation", recording: Recording | None
) -> Iterator[NDArray[np.uint8]]:
    drawer = _Drawer(observation, segmentation)
    if recording is None:
        for number, labels in segmentation.numbered():
            yield drawer.draw(None, labels, number, None)
        return
    images = segmentation.numbered()
    ahead = next(images, None)
    held: Labels | None = None
    for frame in recording:
        while ahead is not None and ahead[0] <= frame.index:
            held = ahead[1]
            ahead = next(images, None)
        yield drawer.draw(frame.image, held, frame.index, frame.time_s)
    # The last frames may be corrupt ones that were left out on request.
    if ahead is not None and (recording.n_frames is None or ahead[0] >= recording.n_frames):
        raise ValueError(f"masks: expected masks of frames that the recording has, got one of frame {ahead[0]}")


class _Drawer:
    """Draws one picture after the other into a canvas with the chain beside it."""

    def __init__(self, observation: Observation, segmentation: "Segmentation") -> None:
        height, width = segmentation.size
        self._scale = -(-_LEAST_HEIGHT_PX // height) if height < _LEAST_HEIGHT_PX else 1
        high, wide = height * self._scale, width * self._scale
        panel = round(_PANEL_SHARE * max(wide, high))
        # Players want even sides.
        self._height, self._picture_wide = high + high % 2, wide
        self._width = wide + panel + (wide + panel) % 2
        self._text_px = float(np.clip(0.026 * high, 12, 26))
        self._line_px = max(2, round(high / 220))
        self._step = max(1, max(height, width) // 400)
        self._recorded = observation.recorded
        labels = observation.segments.tolist()
        background = segmentation.background
        self._tint = Tint(labels, background=background, border_px=1 if self._scale > 1 else max(1, round(high / 480)))
        names = observation.names
        self._badges = {
            label: badge(names.get(label) or str(label), strong_colour(label), size_px=self._text_px)
            for label in labels
        }
        self._last: dict[int, Point] = {}
        panel_wide = self._width - wide
        self._panel = ChainPanel(_chain_of(observation), height_px=self._height, width_px=panel_wide)

    def draw(
        self, picture: NDArray[np.uint8] | None, labels: Labels | None, number: int, time_s: float | None
    ) -> NDArray[np.uint8]:
        canvas: NDArray[np.uint8] = np.empty((self._height, self._width, 3), dtype=np.uint8)
        column = max(0, int(np.searchsorted(self._recorded.key_frames, number, side="right")) - 1)
        canvas[:, self._picture_wide :] = self._panel.at(column)
        place = canvas[:, : self._picture_wide]
        if labels is None:
            assert picture is not None
            self._enlarge(picture, place)
        else:
            self._enlarge(self._tint.over(picture, labels), place)
            self._draw_graph(place, labels, self._recorded.graphs[column])
        self._tell_frame(place, number, time_s)
        return canvas

    def _enlarge(self, picture: NDArray[np.uint8], place: NDArray[np.uint8]) -> None:
        import cv2

        if self._scale > 1:
            size = (picture.shape[1] * self._scale, picture.shape[0] * self._scale)
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
        place[: len(picture)] = picture
        place[len(picture) :] = 0

    def _draw_graph(self, place: NDArray[np.uint8], labels: Labels, graph: SceneGraph) -> None:
        shift = (self._scale - 1) / 2
        now = {
            label: (self._scale * x + shift, self._scale * y + shift)
            for label, (x, y) in centres_of(labels, step=self._step).items()
        }
        self._last |= now
        # The canvas is wider than the picture, and OpenCV needs its rows without gaps.
        drawn = np.ascontiguousarray(place)
        for i, j, relation in graph.edges():
            if i in self._last and j in self._last:
                self._draw_edge(drawn, self._last[i], self._last[j], relation)
        place[:] = drawn
        taken: list[tuple[float, float, float, float]] = []
        for label in graph.segments.tolist():
            # A segment that is held through an occlusion stays where it was, half as bright.
            if label in self._last:
                patch = self._badges[label]
                if label not in now:
                    patch = patch.copy()
                    patch[..., 3] //= 2
                x, y = self._free(self._last[label], patch.shape[1], patch.shape[0], taken)
                taken.append((x, y, patch.shape[1], patch.shape[0]))
                paste(place, patch, x, y)

    def _free(self, at: Point, wide: int, high: int, taken: list[tuple[float, float, float, float]]) -> Point:
        """Place near a segment's centre, inside the picture, where its label covers no other."""
        x = float(np.clip(at[0], wide / 2 + 2, max(wide / 2 + 2, self._picture_wide - wide / 2 - 2)))
        wanted = float(np.clip(at[1], high / 2 + 2, self._height - high / 2 - 2))
        for turn in range(9):
            y = wanted + (turn + 1) // 2 * (high + 2) * (1 if turn % 2 else -1)
            if not high / 2 <= y <= self._height - high / 2:
                continue
            if not any(abs(x - a) < (wide + w) / 2 and abs(y - b) < (high + h) / 2 for a, b, w, h in taken):
                return x, y
        return x, wanted

    def _draw_edge(self, picture: NDArray[np.uint8], a: Point, b: Point, relation: Relation) -> None:
        import cv2

        style = EDGE_STYLE[relation]
        colour = (255 * rgb(style.colour)).round().tolist()
        paper = (255 * rgb(PAPER)).tolist()
        ends = [(round(x), round(y)) for x, y in (a, b)]
        cv2.line(picture, ends[0], ends[1], paper, self._line_px + 2, cv2.LINE_AA)
        lines = [(a, b)] if not style.dashes else _dashes(a, b, [2.4 * n * self._line_px for n in style.dashes])
        for start, end in lines:
            first, last = ((round(x), round(y)) for x, y in (start, end))
            cv2.line(picture, first, last, colour, self._line_px, cv2.LINE_AA)

    def _tell_frame(self, place: NDArray[np.uint8], number: int, time_s: float | None) -> None:
        from PIL import Image, ImageDraw

        text = f"frame {number}" if time_s is None else f"frame {number}   {time_s:.2f} s"
        letters = font(self._text_px)
        wide, high = round(letters.getlength(text) + self._text_px), round(1.6 * self._text_px)
        corner = np.ascontiguousarray(place[:high, :wide])
        dark = Image.fromarray((corner * 0.35).astype(np.uint8))
        ImageDraw.Draw(dark).text((0.5 * self._text_px, high / 2), text, font=letters, fill=PAPER, anchor="lm")
        place[:high, :wide] = np.asarray(dark)


def _chain_of(observation: Observation) -> "EventChain | None":
    return observation.chain if len(observation.segments) > 1 else None


def _dashes(a: Point, b: Point, lengths_px: list[float]) -> list[tuple[Point, Point]]:
    """Dashes of a line: a dash, a gap, and so on."""
    start, way = np.array(a), np.subtract(b, a)
    length = float(np.hypot(*way))
    if not length:
        return []
    dash, gap = lengths_px
    ends = np.arange(0, length, dash + gap)
    pieces = [(near / length, min(near + dash, length) / length) for near in ends.tolist()]
    return [
        ((float(p[0]), float(p[1])), (float(q[0]), float(q[1])))
        for p, q in ((start + near * way, start + far * way) for near, far in pieces)
    ]
