"""Some moments of a movie: frames with their segments and scene graphs (Fig. 2.4, 2.5 a–c)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sec_lab.observation import Observation
from sec_lab.recording import Recording
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz.scene import draw_segments, edge_handles
from sec_lab.viz.style import INK, PAGE_WIDTH_IN, SMALL_PT, axes_at, new_figure
from sec_lab.viz.tint import Tint, centres_of

_GAP_IN, _TITLE_IN, _LEGEND_IN = 0.08, 0.26, 0.3


def draw_moments(
    observation: Observation, recording: Recording, moments: Mapping[int, str], *, n_columns: int = 3
) -> Figure:
    """Draw some frames of a movie with their segments and the scene graph of that moment over them.

    The background is no node: everything would be joined to it. A segment that is hidden in the frame is not drawn.

    Parameters
    ----------
    observation : Observation
        With its segmentation, which is read once more.
    recording : Recording
        The movie, which is read once more.
    moments : mapping of int to str
        Title of the picture of each frame number.
    n_columns : int, optional
        Pictures side by side.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If there is no moment, the observation has no segmentation, or a frame does not exist.

    Examples
    --------
    >>> from sec_lab.pipeline import observe
    >>> from sec_lab.segmentation import Segmentation
    >>> labels = np.ones((3, 20, 30), dtype=np.uint8)
    >>> labels[:, 5:15, 5:15] = 2
    >>> seen = observe(Segmentation.from_labels(labels), over_time=None)
    >>> movie = Recording.from_frames(np.zeros((3, 20, 30, 3), dtype=np.uint8))
    >>> figure = draw_moments(seen, movie, {0: "before", 2: "after"})
    >>> [ax.get_title(loc="left") for ax in figure.axes]
    ['before', 'after']
    """
    segmentation = observation.segmentation
    if segmentation is None:
        raise ValueError("moments: expected an observation with its segmentation, got one without")
    if not moments or n_columns < 1:
        raise ValueError("moments: expected at least one, and at least one picture in a row")
    # Frames as they are numbered by each of the two, so that only a few of them are kept.
    labels = {number: image for number, image in segmentation.numbered() if number in moments}
    pictures = {frame.index: frame.image for frame in recording if frame.index in moments}
    missing = [number for number in moments if number not in labels or number not in pictures]
    if missing:
        raise ValueError(f"moments: expected frames of the movie that have a label image, got {missing[0]}")
    tint = Tint(observation.segments.tolist(), background=segmentation.background)
    graphs = {number: _graph_at(observation, number, labels[number]) for number in moments}
    height, width = segmentation.size
    width_in = (PAGE_WIDTH_IN - (n_columns - 1) * _GAP_IN) / n_columns
    height_in = width_in * height / width
    n_rows = -(-len(moments) // n_columns)
    figure = new_figure(PAGE_WIDTH_IN, n_rows * (_TITLE_IN + height_in + _GAP_IN) + _LEGEND_IN)
    for place, (number, title) in enumerate(moments.items()):
        row, column = divmod(place, n_columns)
        ax = axes_at(
            figure, left_in=column * (width_in + _GAP_IN), top_in=row * (_TITLE_IN + height_in + _GAP_IN) + _TITLE_IN,
            width_in=width_in, height_in=height_in,
        )  # fmt: skip
        picture = tint.over(pictures[number], labels[number])
        draw_segments(picture, graphs[number], ax=ax, legend=False)
        ax.set_title(title, loc="left", fontsize=SMALL_PT, color=INK, pad=3)
    handles = edge_handles(sorted({relation for graph in graphs.values() for _, _, relation in graph.edges()}))
    if handles:
        figure.legend(handles=handles, loc="lower center", ncols=2, frameon=False, fontsize=SMALL_PT, labelcolor=INK)
    return figure


def _graph_at(observation: Observation, number: int, labels: NDArray[np.integer]) -> SceneGraph:
    """The main graph that holds in a frame, of what is visible in it, with the places of that frame."""
    recorded = observation.recorded
    graph = recorded.graphs[max(0, int(np.searchsorted(recorded.key_frames, number, side="right")) - 1)]
    centres = centres_of(labels)
    background = None if observation.segmentation is None else observation.segmentation.background
    keep = [k for k, label in enumerate(graph.segments.tolist()) if label in centres and label != background]
    segments = graph.segments[keep]
    return SceneGraph(segments, graph.relations[np.ix_(keep, keep)], [centres[label] for label in segments.tolist()])
