"""Pictures of movies in rows and columns, with scene graphs over them (Fig. 2.3, 2.4)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz.scene import draw_segments, edge_handles
from sec_lab.viz.style import INK, PAGE_WIDTH_IN, SMALL_PT, SOFT, TEXT_PT, axes_at, bare, new_figure
from sec_lab.viz.tint import centres_of

_LETTER_IN, _GAP_IN, _TITLE_IN, _LEGEND_IN = 0.3, 0.1, 0.24, 0.3
_BAR_IN = 0.75


@dataclass(frozen=True, eq=False)
class Panel:
    """One picture: a frame, a label image, or a map of disparities or ranges; with a scene graph if there is one.

    Parameters
    ----------
    picture : (height, width, 3) array_like of uint8, (height, width) array_like of int or of float
        Frame, segments, or disparities in pixels (NaN where they are unknown).
    graph : SceneGraph, optional
        Drawn over the picture, which is then pale.
    """

    picture: ArrayLike
    graph: SceneGraph | None = None


def draw_gallery(
    rows: Sequence[Sequence[Panel]],
    *,
    columns: Sequence[str],
    names: Sequence[str] = (),
    measure: str = "disparity in pixels",
) -> Figure:
    """Draw pictures of equal size as wide as the page.

    Parameters
    ----------
    rows : sequence of sequence of Panel
        As many in every row.
    columns : sequence of str
        Titles of the columns.
    names : sequence of str, optional
        Names of the rows, written upright at their left.
    measure : str, optional
        What the maps of floats measure, for the colour bar.

    Returns
    -------
    matplotlib.figure.Figure
        With a legend of the edges, and a colour bar that all maps share.

    Raises
    ------
    ValueError
        If there is no picture, the rows differ in length, or titles or names are too few or too many.

    Examples
    --------
    >>> figure = draw_gallery([[Panel([[1, 1], [1, 2]]), Panel([[1.5, 2.0], [2.5, 3.0]])]], columns=["a", "b"])
    >>> [ax.get_title(loc="left") for ax in figure.axes[:2]]
    ['a', 'b']
    """
    lengths = {len(row) for row in rows}
    if len(lengths) != 1 or not max(lengths):
        raise ValueError(f"rows: expected as many pictures in each, at least one, got {[len(row) for row in rows]}")
    (n_columns,) = lengths
    if len(columns) != n_columns:
        raise ValueError(f"columns: expected {n_columns} titles, got {len(columns)}")
    if names and len(names) != len(rows):
        raise ValueError(f"names: expected {len(rows)}, got {len(names)}")
    panels = [panel for row in rows for panel in row]
    known = [values[np.isfinite(values)] for values in map(_disparity_of, panels) if values is not None]
    limits = _limits(known)
    relations = sorted({edge[2] for panel in panels if panel.graph is not None for edge in panel.graph.edges()})

    left_in = _LETTER_IN if names else 0.0
    right_in = _BAR_IN if known else 0.0
    wide_in = (PAGE_WIDTH_IN - left_in - right_in - _GAP_IN * (n_columns - 1)) / n_columns
    height, width = np.asarray(panels[0].picture).shape[:2]
    high_in = wide_in * height / width
    whole_in = _TITLE_IN + len(rows) * high_in + (len(rows) - 1) * _GAP_IN + (_LEGEND_IN if relations else 0.05)
    figure = new_figure(PAGE_WIDTH_IN, whole_in)
    for number, row in enumerate(rows):
        top_in = _TITLE_IN + number * (high_in + _GAP_IN)
        if names:
            middle = 1 - (top_in + high_in / 2) / whole_in
            figure.text(
                0.06 / PAGE_WIDTH_IN, middle, names[number], rotation=90, ha="left", va="center", fontsize=TEXT_PT,
                color=INK,
            )  # fmt: skip
        for column, panel in enumerate(row):
            place_in = left_in + column * (wide_in + _GAP_IN)
            ax = axes_at(figure, left_in=place_in, top_in=top_in, width_in=wide_in, height_in=high_in)
            _draw_panel(ax, panel, limits)
            if number == 0:
                ax.set_title(columns[column], loc="left", fontsize=TEXT_PT, color=INK, pad=4)
    if known:
        bar_in = PAGE_WIDTH_IN - right_in + 0.12
        bar_ax = axes_at(figure, left_in=bar_in, top_in=_TITLE_IN, width_in=0.14, height_in=high_in)
        maps = [image for ax in figure.axes for image in ax.images if image.get_gid() == "disparity"]
        bar = figure.colorbar(maps[0], cax=bar_ax, ticks=MaxNLocator(4, steps=[1, 2, 5, 10]))
        bar.set_label(measure, fontsize=SMALL_PT, color=SOFT)
        bar.ax.tick_params(labelsize=SMALL_PT, colors=SOFT, length=2)
        bar.outline.set_visible(False)
    if relations:
        _explain(figure, relations)
    return figure


def graph_at(observation: Observation, frame: int, labels: ArrayLike) -> SceneGraph:
    """The scene graph that holds in a frame, its nodes at the centres of the segments there (§2.3).

    Parameters
    ----------
    observation : Observation
    frame : int
        From the first key frame on.
    labels : (height, width) array_like of int
        Label image of the frame. What is not in it stays where it was at the last key frame.

    Raises
    ------
    ValueError
        If the frame is before the first key frame.

    Examples
    --------
    >>> seen = Observation([SceneGraph([1, 2], [[0, 2], [2, 0]], [[0.0, 0.0], [9.0, 9.0]])], [4], position_unit="px")
    >>> graph_at(seen, 6, [[1, 1, 2, 2]]).positions.tolist()
    [[0.5, 0.0], [2.5, 0.0]]
    """
    recorded = observation.recorded
    place = int(np.searchsorted(recorded.key_frames, frame, side="right")) - 1
    if place < 0:
        raise ValueError(f"frame: expected {recorded.key_frames[0]} or later, got {frame}")
    graph = recorded.graphs[place]
    if graph.positions is None:
        return graph
    centres = centres_of(np.asarray(labels))
    segments = graph.segments.tolist()
    positions = [centres.get(segment, before) for segment, before in zip(segments, graph.positions, strict=True)]
    return SceneGraph(graph.segments, graph.relations, np.array(positions), graph.types)


def _draw_panel(ax: Any, panel: Panel, limits: tuple[float, float]) -> None:
    disparity = _disparity_of(panel)
    if disparity is None:
        draw_segments(panel.picture, panel.graph, ax=ax, legend=False, faded=panel.graph is not None)
        return
    ax.set_facecolor("#22262c")
    ax.imshow(disparity, vmin=limits[0], vmax=limits[1], cmap="viridis", interpolation="nearest", gid="disparity")
    bare(ax)


def _disparity_of(panel: Panel) -> NDArray[np.float64] | None:
    """Values of a map of disparities, None for other pictures."""
    values = np.asarray(panel.picture)
    return values.astype(np.float64) if values.ndim == 2 and values.dtype.kind == "f" else None


def _limits(known: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """Range of colours; single outliers do not widen it."""
    values = np.concatenate([np.zeros(0), *known])
    if not values.size:
        return 0.0, 1.0
    low, high = np.percentile(values, [1, 99])
    return float(low), float(max(high, low + 1e-6))


def _explain(figure: Figure, relations: Sequence[Relation]) -> None:
    figure.legend(
        handles=edge_handles(relations), loc="lower left", bbox_to_anchor=(0.0, 0.0), ncols=2, frameon=False,
        fontsize=SMALL_PT, labelcolor=INK, handlelength=2.6, borderaxespad=0.2,
    )  # fmt: skip
