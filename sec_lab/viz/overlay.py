"""The movie with what was seen in it drawn in: segments, their relations, and the chain as it grows (Fig. 2.1)."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sec_lab.observation import Observation
from sec_lab.recording import Recording
from sec_lab.viz.chain_panel import ChainPanel
from sec_lab.viz.graph_over import GraphOver
from sec_lab.viz.lettering import font
from sec_lab.viz.style import PAPER
from sec_lab.viz.tint import Tint

if TYPE_CHECKING:
    from sec_lab.event_chain import EventChain
    from sec_lab.segmentation import Segmentation

_LEAST_HEIGHT_PX = 480
_PANEL_SHARE = 0.66

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
        self._recorded = observation.recorded
        labels = observation.segments.tolist()
        background = segmentation.background
        self._tint = Tint(labels, background=background, border_px=1 if self._scale > 1 else max(1, round(high / 480)))
        self._graph = GraphOver(
            labels, observation.names, scale=self._scale, text_px=self._text_px, line_px=max(2, round(high / 220))
        )
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
            self._graph.draw(place, labels, self._recorded.graphs[column])
        self._tell_frame(place, number, time_s)
        return canvas

    def _enlarge(self, picture: NDArray[np.uint8], place: NDArray[np.uint8]) -> None:
        import cv2

        if self._scale > 1:
            size = (picture.shape[1] * self._scale, picture.shape[0] * self._scale)
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
        place[: len(picture)] = picture
        place[len(picture) :] = 0

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
