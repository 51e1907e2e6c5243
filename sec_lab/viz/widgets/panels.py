"""What a frame shows, side by side: the picture with its segments, the scene graph, and depth where there is any."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from sec_lab.event_chain import Names
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz.graph_over import GraphOver
from sec_lab.viz.lettering import badge, paste
from sec_lab.viz.style import PAPER, rgb
from sec_lab.viz.tint import Tint, strong_colour
from sec_lab.viz.widgets.seen import KeptFrame, Labels

_LEAST_HIGH, _MOST_WIDE, _GAP = 256, 640, 6
_JPEG_QUALITY = 88
_OUTLINE_PX = 0.6
_DIMMED = 0.4


class FramePanels:
    """Draws frames as one picture: what was filmed with segments over it, the scene graph, depth.

    Parameters
    ----------
    observation : Observation
        Segments, names and graphs as they are now.
    sample : KeptFrame or None
        Any frame, from which sizes are taken; None: there are only graphs, at the positions of their nodes.
    background : int or None
    has_depth : bool
    new_labels : (65536,) ndarray of uint16, optional
        Label that stands for each label of the kept frames, where fragments were merged.

    Examples
    --------
    >>> from sec_lab.segmentation import Segmentation
    >>> from sec_lab.viz.widgets.seen import see
    >>> labels = np.ones((2, 40, 60), dtype=np.uint8)
    >>> labels[1:, 12:30, 12:40] = 2
    >>> seen = see(Segmentation.from_labels(labels), how=(None, "scan lines"))
    >>> panels = FramePanels(seen.observation, seen.frames[0])
    >>> panels.draw(seen.frames[1], column=1).shape, panels.segment_at(seen.frames[1], 100, 100)
    ((280, 420, 3), 2)
    """

    def __init__(
        self,
        observation: Observation,
        sample: KeptFrame | None,
        *,
        background: int | None = None,
        has_depth: bool = False,
        new_labels: Labels | None = None,
    ) -> None:
        self._recorded = observation.recorded
        self._new_labels = new_labels
        segments = observation.segments.tolist()
        self._size = _size_of(sample)
        height, width = self._size
        self.scale = max(1, -(-_LEAST_HIGH // height)) if width <= _MOST_WIDE // 2 else 1
        self._high, self._wide = self.scale * height, self.scale * width
        is_pictured = sample is not None and sample.picture is not None
        self._kinds: list[str] = ["picture"] if is_pictured else []
        self._kinds += ["graph"]
        self._kinds += ["depth"] if has_depth else []
        self._tint = Tint(segments, background=background, border_px=1)
        self._paper_tint = Tint(segments, background=background, border_px=1)
        self._graph = GraphOver(segments, observation.names, scale=self.scale, text_px=13, line_px=2)
        self._heads = {kind: _head(kind) for kind in self._kinds}
        self._far_m: float | None = None

    def draw(
        self, frame: KeptFrame | None, *, column: int, pair: Sequence[int] = (), chosen: Iterable[int] = ()
    ) -> NDArray[np.uint8]:
        """One picture of all panels, (height, width, 3) uint8 RGB.

        Parameters
        ----------
        frame : KeptFrame or None
            None: only the graph is known.
        column : int
            Main graph that holds now.
        pair : sequence of two int, optional
            Segments that stand out; the others are dimmed.
        chosen : iterable of int, optional
            Segments with a thick border.
        """
        labels = self.labels_of(frame)
        shown = None if labels is None else self._enlarged_labels(labels)
        panels = []
        for kind in self._kinds:
            panel = self._panel(kind, frame, labels)
            if kind != "depth" and shown is not None:
                self._stress(panel, shown, pair, list(chosen), is_dimmed=kind == "picture")
            if kind == "graph":
                self._draw_graph(panel, labels, self._recorded.graphs[column])
            panels.append(panel)
        gap = np.full((self._high, _GAP, 3), 128, dtype=np.uint8)
        parts = [part for panel in panels for part in (panel, gap)][:-1]
        whole = np.concatenate(parts, axis=1)
        for place, kind in enumerate(self._kinds):
            head = self._heads[kind]
            left = place * (self._wide + _GAP)
            paste(whole, head, left + head.shape[1] / 2 + 4, head.shape[0] / 2 + 4)
        return whole

    def encoded(
        self, frame: KeptFrame | None, *, column: int, pair: Sequence[int] = (), chosen: Iterable[int] = ()
    ) -> bytes:
        """The picture of :meth:`draw` as a JPEG file."""
        return jpeg_bytes(self.draw(frame, column=column, pair=pair, chosen=chosen))

    def labels_of(self, frame: KeptFrame | None) -> Labels | None:
        """Label image of a frame, or the last one before it, with fragments merged."""
        labels = None if frame is None else frame.shown_labels
        return labels if labels is None or self._new_labels is None else self._new_labels[labels]

    def segment_at(self, frame: KeptFrame | None, x: int, y: int) -> int | None:
        """Segment at a place of the picture, in whichever panel; None between panels or without label images."""
        labels = self.labels_of(frame)
        column, row = x % (self._wide + _GAP), y
        if labels is None or column >= self._wide or not 0 <= row < self._high:
            return None
        height, width = labels.shape
        return int(labels[row * height // self._high, column * width // self._wide])

    @property
    def lefts(self) -> list[int]:
        """Left edges of the panels in which segments stand out, in pixels of the picture."""
        return [place * (self._wide + _GAP) for place, kind in enumerate(self._kinds) if kind != "depth"]

    def outlines(self, frame: KeptFrame | None) -> dict[int, str]:
        """Borders of the segments of a frame as paths of SVG, in pixels of the first panel; true to a pixel."""
        import cv2

        labels = self.labels_of(frame)
        if labels is None:
            return {}
        shown, found = self._enlarged_labels(labels), {}
        for label in np.unique(shown).tolist():
            borders, _ = cv2.findContours((shown == label).astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
            coarse = [cv2.approxPolyDP(border, _OUTLINE_PX, closed=True)[:, 0] for border in borders]
            found[label] = "".join(
                "M" + "L".join(f"{x} {y}" for x, y in border.tolist()) + "Z" for border in coarse if len(border) > 2
            )
        return found

    def _panel(self, kind: str, frame: KeptFrame | None, labels: Labels | None) -> NDArray[np.uint8]:
        if kind == "depth":
            return self._enlarged(self._depth_picture(frame))
        if kind == "picture":
            picture = None if frame is None else frame.picture
            if picture is None:
                picture = np.zeros((*self._size, 3), dtype=np.uint8)
            return self._enlarged(picture if labels is None else self._tint.over(picture, self._fitting(labels)))
        if labels is not None:
            return self._enlarged(self._paper_tint.over(None, self._fitting(labels)))
        return np.full((self._high, self._wide, 3), (255 * rgb(PAPER)).round(), dtype=np.uint8)

    def _draw_graph(self, panel: NDArray[np.uint8], labels: Labels | None, graph: SceneGraph) -> None:
        if labels is not None:
            self._graph.draw(panel, self._fitting(labels), graph)
        else:
            self._graph.draw_at(panel, graph, _places(graph, self._recorded.graphs, (self._high, self._wide)))

    def _fitting(self, labels: Labels) -> Labels:
        """Label image of the size of the kept pictures, which may be smaller."""
        import cv2

        if labels.shape == self._size:
            return labels
        size = (self._size[1], self._size[0])
        return np.asarray(cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint16)

    def _enlarged(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        import cv2

        if picture.shape[:2] == (self._high, self._wide):
            return np.ascontiguousarray(picture)
        size = (self._wide, self._high)
        return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)

    def _depth_picture(self, frame: KeptFrame | None) -> NDArray[np.uint8]:
        """Near is bright and far is dark; black where nothing is known."""
        import cv2

        depth = None if frame is None else frame.depth_m
        if depth is None or not (depth > 0).any():
            return np.zeros((*self._size, 3), dtype=np.uint8)
        known = depth > 0
        if self._far_m is None:
            # One scale for the whole movie, from the first frame that is shown.
            self._near_m, self._far_m = (float(value) for value in np.percentile(depth[known], (1, 99)))
            self._heads["depth"] = _head(f"depth, {self._near_m:.2f} m (bright) to {self._far_m:.2f} m")
        span = max(self._far_m - self._near_m, 1e-6)
        grey = np.clip(255 - 225 * (depth - self._near_m) / span, 30, 255).astype(np.uint8)
        coloured = np.asarray(cv2.applyColorMap(grey, cv2.COLORMAP_VIRIDIS), dtype=np.uint8)[..., ::-1].copy()
        coloured[~known] = 0
        return coloured

    def _enlarged_labels(self, labels: Labels) -> Labels:
        import cv2

        if labels.shape == (self._high, self._wide):
            return labels
        size = (self._wide, self._high)
        return np.asarray(cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint16)

    def _stress(
        self, panel: NDArray[np.uint8], shown: Labels, pair: Sequence[int], chosen: list[int], *, is_dimmed: bool
    ) -> None:
        import cv2

        if pair and is_dimmed:
            others = ~np.isin(shown, pair)
            panel[others] = (panel[others] * _DIMMED).astype(np.uint8)
        for label in dict.fromkeys([*pair, *chosen]):
            inside = (shown == label).astype(np.uint8)
            outlines, _ = cv2.findContours(inside, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
            cv2.drawContours(panel, outlines, -1, (255, 255, 255), 5)
            cv2.drawContours(panel, outlines, -1, strong_colour(label), 3)


def jpeg_bytes(picture: NDArray[np.uint8], *, quality: int = _JPEG_QUALITY) -> bytes:
    r"""RGB picture as a JPEG file whose thin coloured lines stay sharp.

    Examples
    --------
    >>> jpeg_bytes(np.zeros((4, 4, 3), dtype=np.uint8))[:2]
    b'\xff\xd8'
    """
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, quality]
    options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    done, data = cv2.imencode(".jpg", picture[..., ::-1], options)
    assert done
    return data.tobytes()


def webp_bytes(picture: NDArray[np.uint8], *, quality: int) -> bytes:
    """RGB picture as a WebP file: slower than JPEG, and less than half as large.

    Examples
    --------
    >>> webp_bytes(np.zeros((4, 4, 3), dtype=np.uint8), quality=80)[8:12]
    b'WEBP'
    """
    import cv2

    done, data = cv2.imencode(".webp", picture[..., ::-1].copy(), [cv2.IMWRITE_WEBP_QUALITY, quality])
    assert done
    return data.tobytes()


def told_segment(label: int, names: Names) -> str:
    """What a segment is called in sentences and lists.

    Examples
    --------
    >>> told_segment(2, {2: "cup"}), told_segment(3, {3: None})
    ('2 cup', '3')
    """
    name = names.get(label)
    return f"{label} {name}" if name else str(label)


def _head(text: str) -> NDArray[np.uint8]:
    words = {"picture": "picture and segments", "graph": "scene graph"}
    return badge(words.get(text, text), (120, 128, 140), size_px=11)


def _size_of(sample: KeptFrame | None) -> tuple[int, int]:
    if sample is not None:
        picture, labels = sample.picture, sample.labels
        shape = picture.shape if picture is not None else labels.shape if labels is not None else (_LEAST_HIGH, 320)
        return int(shape[0]), int(shape[1])
    return _LEAST_HIGH, 360


def _places(graph: SceneGraph, graphs: Sequence[SceneGraph], size: tuple[int, int]) -> dict[int, tuple[float, float]]:
    """Where nodes stand in a picture: their positions fitted into it, or a circle without any."""
    height, width = size
    labels = graph.segments.tolist()
    known = [other.positions[:, :2] for other in graphs if other.positions is not None]
    if graph.positions is None or not known:
        every = sorted({label for other in graphs for label in other.segments.tolist()})
        turns = {label: 2 * np.pi * place / len(every) for place, label in enumerate(every)}
        return {
            label: (width * (0.5 + 0.36 * np.sin(turns[label])), height * (0.5 - 0.36 * np.cos(turns[label])))
            for label in labels
        }
    everywhere = np.concatenate(known)
    low, high = everywhere.min(axis=0), everywhere.max(axis=0)
    share = (graph.positions[:, :2] - low) / np.maximum(high - low, 1e-9)
    spots = (0.12 + 0.76 * share) * (width, height)
    return {label: (float(x), float(y)) for label, (x, y) in zip(labels, spots.tolist(), strict=True)}
