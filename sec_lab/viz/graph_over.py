"""A scene graph drawn over the picture that it comes from, fast enough for every frame of a movie (Fig. 2.4)."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.event_chain import Names
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz.lettering import badge, paste
from sec_lab.viz.style import EDGE_STYLE, PAPER, rgb
from sec_lab.viz.tint import centres_of, strong_colour

Point = tuple[float, float]
Labels = NDArray[np.integer]


class GraphOver:
    """Draws nodes at the centres of segments, and edges between them; a segment that is hidden stays where it was.

    Overlapping segments are joined by a solid blue line, touching ones by a dashed red one.

    Parameters
    ----------
    segments : iterable of int
        All labels that may occur.
    names : mapping of int to str or None
        A segment without a name is called by its label.
    scale : int
        How many times larger than the label images the pictures are.
    text_px, line_px : float
        Size of letters, and width of lines.

    Examples
    --------
    >>> picture = np.full((40, 60, 3), 255, dtype=np.uint8)
    >>> graph = SceneGraph([1], [[0]])
    >>> GraphOver([1], {}, scale=1, text_px=12, line_px=2).draw(picture, np.ones((40, 60), dtype=np.uint8), graph)
    >>> (picture < 255).any()
    np.True_
    """

    def __init__(
        self, segments: Iterable[int], names: Names, *, scale: int = 1, text_px: float = 13, line_px: int = 2
    ) -> None:
        self._scale, self._line_px = scale, line_px
        self._badges = {
            label: badge(names.get(label) or str(label), strong_colour(label), size_px=text_px) for label in segments
        }
        self._last: dict[int, Point] = {}

    def draw(self, place: NDArray[np.uint8], labels: Labels, graph: SceneGraph) -> None:
        """Draw a graph into a picture.

        Parameters
        ----------
        place : (scale · height, scale · width, 3) ndarray of uint8
            RGB; drawn into.
        labels : (height, width) ndarray of int
            Label image.
        graph : SceneGraph
            Segments that are not in the label image stand where they were last.
        """
        shift = (self._scale - 1) / 2
        step = max(1, max(labels.shape) // 400)
        now = {
            label: (self._scale * x + shift, self._scale * y + shift)
            for label, (x, y) in centres_of(labels, step=step).items()
        }
        self._last |= now
        self._draw_at(place, graph, self._last, now)

    def draw_at(self, place: NDArray[np.uint8], graph: SceneGraph, places: dict[int, Point]) -> None:
        """Draw a graph whose nodes stand at given places (column, row) of the picture."""
        self._draw_at(place, graph, places, places)

    def _draw_at(
        self, place: NDArray[np.uint8], graph: SceneGraph, at: dict[int, Point], now: dict[int, Point]
    ) -> None:
        # The canvas may be wider than the picture, and OpenCV needs its rows without gaps.
        drawn = np.ascontiguousarray(place)
        for i, j, relation in graph.edges():
            if i in at and j in at:
                self._draw_edge(drawn, at[i], at[j], relation)
        place[:] = drawn
        taken: list[tuple[float, float, float, float]] = []
        for label in graph.segments.tolist():
            # A segment that is held through an occlusion stays where it was, half as bright.
            if label in at:
                patch = self._badges[label]
                if label not in now:
                    patch = patch.copy()
                    patch[..., 3] //= 2
                x, y = _free(at[label], patch.shape[1], patch.shape[0], taken, size=place.shape[:2])
                taken.append((x, y, patch.shape[1], patch.shape[0]))
                paste(place, patch, x, y)

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


def _free(
    at: Point, wide: int, high: int, taken: list[tuple[float, float, float, float]], *, size: tuple[int, ...]
) -> Point:
    """Place near a segment's centre, inside the picture, where its label covers no other."""
    height, width = size
    x = float(np.clip(at[0], wide / 2 + 2, max(wide / 2 + 2, width - wide / 2 - 2)))
    wanted = float(np.clip(at[1], high / 2 + 2, height - high / 2 - 2))
    for turn in range(9):
        y = wanted + (turn + 1) // 2 * (high + 2) * (1 if turn % 2 else -1)
        if not high / 2 <= y <= height - high / 2:
            continue
        if not any(abs(x - a) < (wide + w) / 2 and abs(y - b) < (high + h) / 2 for a, b, w, h in taken):
            return x, y
    return x, wanted


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
