"""What was seen in a movie as one HTML page that needs nothing else: segments, event chain, key frames with graphs."""

import base64
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.observation import Observation
from sec_lab.recording import Recording
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz.lettering import fitted, font
from sec_lab.viz.style import RELATION_WORD
from sec_lab.viz.tint import Tint, strong_colour

if TYPE_CHECKING:
    from sec_lab.event_chain import EventChain
    from sec_lab.segmentation import Segmentation

_PICTURE_WIDTH, _JPEG_QUALITY = 360, 82
_MOST_PICTURES_BYTES = 2_600_000
_MOST_CELLS, _MOST_KEY_FRAMES, _MOST_CHANGES, _MOST_SEGMENTS = 12_000, 120, 6, 150
_NODE_PX = 12


def observation_page(observation: Observation, recording: Recording | None = None, *, title: str) -> str:
    """Page about an observation, for any browser: light and dark, without scripts and without the network.

    Parameters
    ----------
    observation : Observation
        If it has a segmentation, that is read once more, as far as the last key frame that is shown.
    recording : Recording, optional
        The movie, which is read once more; if left out, segments are drawn on paper.
    title : str
        What the page is called.

    Returns
    -------
    str
        HTML of less than 5 MB: of very long chains the rows that change most and the first key frames are shown, and it
        is said what is left out.

    Raises
    ------
    ValueError
        If pictures and label images differ in size, or nothing was recorded.

    Examples
    --------
    >>> from sec_lab.scene_graph import SceneGraph
    >>> seen = Observation([SceneGraph([1, 2], [[0, 2], [2, 0]])], [0], {1: "<cup>"})
    >>> "&lt;cup&gt;" in observation_page(seen, title="a movie")
    True
    """
    # Imported when it is used: figures in a notebook need no templates.
    from jinja2 import Environment

    segmentation = observation.segmentation
    if None not in (recording, segmentation) and recording.size != segmentation.size:  # type: ignore[union-attr]
        raise ValueError(f"page: expected pictures of {segmentation.size} like the masks, got {recording.size}")  # type: ignore[union-attr]
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(files("sec_lab.viz").joinpath("observation.html").read_text(encoding="utf-8"))
    chain = observation.chain if len(observation.segments) > 1 else None
    frames, size, left_out = _key_frames(observation, segmentation, recording)
    shown = {key["number"] for key in frames}
    rows, unsaid = _rows(chain)
    recorded = observation.recorded
    labels = observation.segments.tolist()
    n = len(labels)
    return template.render(
        title=title,
        said=f"{n} segment{'s' * (n != 1)}, {len(recorded)} key frame{'s' * (len(recorded) != 1)}",
        segments=[
            {"label": label, "name": observation.names.get(label), "colour": _css(label)}
            for label in labels[:_MOST_SEGMENTS]
        ],
        rows=rows,
        columns=[{"number": number, "shown": number in shown} for number in recorded.key_frames.tolist()],
        words=[(int(relation), word) for relation, word in RELATION_WORD.items()],
        unsaid=unsaid,
        frames=frames,
        left_out=left_out,
        height=size[0],
        width=size[1],
    )


@dataclass(frozen=True)
class _Canvas:
    """Size of the drawings, and how much smaller than the label images they are."""

    height: int
    width: int
    scale: float


def _rows(chain: "EventChain | None") -> tuple[list[dict[str, Any]], str]:
    """Rows that are shown, and what is said of the others."""
    if chain is None:
        return [], "There are fewer than two segments, and so no chain."
    changing = chain.changing_rows
    most = max(1, _MOST_CELLS // len(chain.key_frames))
    n_changes = (chain.relations[changing, 1:] != chain.relations[changing, :-1]).sum(axis=1)
    shown = np.sort(changing[np.argsort(-n_changes, kind="stable")[:most]])
    rows = [{"name": chain.row_label(row), "codes": chain.relations[row].tolist()} for row in shown.tolist()]
    unsaid = []
    if len(shown) < len(changing):
        unsaid.append(f"{len(changing) - len(shown)} more rows change, but less often.")
    if len(changing) < len(chain.pairs):
        n_still = len(chain.pairs) - len(changing)
        unsaid.append(f"Rows in which nothing ever happens are left out ({n_still} of {len(chain.pairs)}).")
    return rows, " ".join(unsaid)


def _key_frames(
    observation: Observation, segmentation: "Segmentation | None", recording: Recording | None
) -> tuple[list[dict[str, Any]], tuple[int, int], str]:
    """Key frames that are shown, the size of their drawings, and what is said of the others."""
    canvas, names = _canvas(observation, segmentation), _short_names(observation)
    recorded = observation.recorded
    graphs = dict(zip(recorded.key_frames.tolist(), recorded.graphs, strict=True))
    numbers = list(graphs)[:_MOST_KEY_FRAMES]
    shown: list[dict[str, Any]] = []
    n_bytes = 0
    before: SceneGraph | None = None
    pictures = _pictures(observation, segmentation, recording, set(numbers)) if segmentation is not None else iter(())
    ahead = next(pictures, None)
    for number in numbers:
        while ahead is not None and ahead[0] < number:
            ahead = next(pictures, None)
        picture = time_s = None
        if ahead is not None and ahead[0] == number:
            picture, time_s = _data_address(ahead[1], canvas), ahead[2]
            n_bytes += len(picture)
            if n_bytes > _MOST_PICTURES_BYTES:
                break
        graph = graphs[number]
        changes = "" if before is None else _changes(before, graph, names)
        shown.append(
            {
                "number": number,
                "time": None if time_s is None else f"{time_s:.2f} s",
                "picture": picture,
                "changes": changes,
                "said": f"Frame {number} with its scene graph",
                **_graph(graph, names if observation.position_unit == "px" else None, canvas),
            }
        )
        before = graph
    n_left_out = len(graphs) - len(shown)
    left_out = f"The first {len(shown)} of {len(graphs)} key frames are shown." if n_left_out else ""
    return shown, (canvas.height, canvas.width), left_out


def _canvas(observation: Observation, segmentation: "Segmentation | None") -> _Canvas:
    if segmentation is not None:
        height, width = segmentation.size
        scale = _PICTURE_WIDTH / width
        return _Canvas(round(scale * height), _PICTURE_WIDTH, scale)
    places = [graph.positions[:, :2] for graph in observation.recorded.graphs if graph.positions is not None]
    far = np.concatenate(places).max(axis=0) if places and observation.position_unit == "px" else np.array([360, 270])
    width, height = (1.15 * far + 1).tolist()
    scale = _PICTURE_WIDTH / width
    return _Canvas(int(np.clip(round(scale * height), 90, 720)), _PICTURE_WIDTH, scale)


def _pictures(
    observation: Observation, segmentation: "Segmentation", recording: Recording | None, numbers: set[int]
) -> Iterator[tuple[int, NDArray[np.uint8], float | None]]:
    """Frame number, tinted picture and time of each key frame."""
    wide = max(1, round(segmentation.size[1] / _PICTURE_WIDTH))
    tint = Tint(observation.segments.tolist(), background=segmentation.background, border_px=wide)
    frames = None if recording is None else iter(recording)
    left = set(numbers)
    for number, labels in segmentation.numbered():
        if number not in left:
            continue
        frame = None
        while frames is not None and (frame is None or frame.index < number):
            frame = next(frames, None)
            if frame is None:
                frames = None
        is_there = frame is not None and frame.index == number
        picture = frame.image if frame is not None and is_there else None
        yield number, tint.over(picture, labels), frame.time_s if frame is not None and is_there else None
        left.discard(number)
        if not left:
            return


def _data_address(picture: NDArray[np.uint8], canvas: _Canvas) -> str:
    import cv2

    # Shown on fine displays at twice its size.
    size = (min(picture.shape[1], 2 * canvas.width), min(picture.shape[0], 2 * canvas.height))
    if size != (picture.shape[1], picture.shape[0]):
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    done, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    assert done
    return f"data:image/jpeg;base64,{base64.b64encode(data.tobytes()).decode()}"


def _graph(graph: SceneGraph, names: Mapping[int, str] | None, canvas: _Canvas) -> dict[str, list[dict[str, Any]]]:
    """Nodes and edges for the drawing; none without positions in the picture."""
    if graph.positions is None or names is None:
        return {"nodes": [], "edges": []}
    high = np.array([canvas.width - 14, canvas.height - 11])
    places = np.clip(canvas.scale * (graph.positions[:, :2] + 0.5), (14, 11), np.maximum(high, (14, 11)))
    texts = [names[label] for label in graph.segments.tolist()]
    widths = [font(_NODE_PX, bold=True).getlength(text) + 12 for text in texts]
    # Labels that would cover each other move apart, downwards first.
    taken: list[tuple[float, float, float]] = []
    for place, wide in zip(places, widths, strict=True):
        place[0] = np.clip(place[0], wide / 2 + 2, max(wide / 2 + 2, canvas.width - wide / 2 - 2))
        wanted = place[1]
        for turn in range(11):
            place[1] = wanted + (turn + 1) // 2 * 20 * (1 if turn % 2 else -1)
            inside = 10 <= place[1] <= canvas.height - 10
            if inside and not any(abs(place[0] - x) < (wide + w) / 2 and abs(place[1] - y) < 20 for x, y, w in taken):
                break
        else:
            place[1] = wanted
        taken.append((place[0], place[1], wide))
    at = dict(zip(graph.segments.tolist(), places.round(1).tolist(), strict=True))
    edges = [
        {"x1": at[i][0], "y1": at[i][1], "x2": at[j][0], "y2": at[j][1], "code": int(relation)}
        for i, j, relation in graph.edges()
    ]
    nodes = [
        {"x": x, "y": y, "wide": round(wide, 1), "text": text, "colour": _css(label)}
        for (label, (x, y)), wide, text in zip(at.items(), widths, texts, strict=True)
    ]
    return {"nodes": nodes, "edges": edges}


def _changes(before: SceneGraph, after: SceneGraph, names: Mapping[int, str]) -> str:
    """What happened at a key frame, in words."""
    stay, old, new = np.intersect1d(before.segments, after.segments, return_indices=True)
    differ = before.relations[np.ix_(old, old)] != after.relations[np.ix_(new, new)]
    pairs = [(int(new[i]), int(new[j])) for i, j in np.argwhere(np.tril(differ)).tolist()]
    came = np.setdiff1d(after.segments, stay).tolist()
    left = np.setdiff1d(before.segments, stay).tolist()
    said = [f"{names[label]} comes" for label in came] + [f"{names[label]} leaves" for label in left]
    more = len(said) + len(pairs) - _MOST_CHANGES
    for i, j in pairs[: max(0, _MOST_CHANGES - len(said))]:
        first, second = (names[int(after.segments[place])] for place in (i, j))
        said.append(f"{first} and {second}: {_WORDS[Relation(after.relations[i, j])]}")
    return "; ".join(said[:_MOST_CHANGES]) + (f"; and {more} more" if more > 0 else "")


_WORDS = {
    Relation.NON_TOUCHING: "apart",
    Relation.OVERLAPPING: "overlapping",
    Relation.TOUCHING: "touching",
    Relation.ABSENT: "absent",
}


def _short_names(observation: Observation) -> dict[int, str]:
    """What each segment is called in a drawing."""
    return {
        label: fitted(observation.names.get(label) or str(label), 110, size_px=_NODE_PX, bold=True)
        for label in observation.segments.tolist()
    }


def _css(label: int) -> str:
    red, green, blue = strong_colour(label)
    return f"#{red:02x}{green:02x}{blue:02x}"
