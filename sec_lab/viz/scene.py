"""Scene graphs over frames or label images, drawn as in the thesis (Fig. 2.4, 2.5)."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation, as_array
from sec_lab.relations import SegmentRelations
from sec_lab.scene_graph import SceneGraph, scene_graph
from sec_lab.viz.style import (
    EDGE_STYLE,
    INK,
    PAPER,
    RELATION_WORD,
    TEXT_PT,
    axes_at,
    bare,
    figure_of,
    new_figure,
    segment_colours,
    title_width_in,
)

_WIDTH_IN = 4.15


def draw_segments(
    picture: ArrayLike,
    graph: SegmentRelations | None = None,
    *,
    ax: Axes | None = None,
    title: str | None = None,
    legend: bool = True,
    faded: bool = False,
    rows_px: tuple[int, int] | None = None,
) -> Axes:
    """Draw a frame or its segments, with the scene graph over it (Fig. 2.4).

    Nodes stand at the segments' centres and carry their labels; overlapping is a solid blue edge, touching a dashed red
    one. Nodes that would cover each other or their edge are moved apart, and edges bent around nodes in their way.

    Parameters
    ----------
    picture : (height, width, 3) array_like of uint8, or (height, width) array_like of int
        RGB frame or label image.
    graph : SceneGraph or SegmentRelations, optional
        With positions (column, row) in pixels.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out.
    title : str, optional
    legend : bool, optional
        Explain the edges below the picture, if there are any.
    faded : bool, optional
        Draw the picture pale, so that the graph stands out.
    rows_px : tuple of two int, optional
        Show only the rows of the picture from the first up to, not including, the second.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the picture has another shape, or the graph has nodes without positions in the picture's plane.

    Examples
    --------
    >>> graph = SceneGraph([1, 2], [[0, 1], [1, 0]], [[3.5, 2.5], [1.5, 1.5]])
    >>> ax = draw_segments([[1, 1, 1, 1], [1, 2, 2, 1], [1, 1, 1, 1]], graph)
    >>> [text.get_text() for text in ax.texts]
    ['1', '2']
    """
    image = _as_picture(picture)
    top, bottom = (0, len(image)) if rows_px is None else rows_px
    if not 0 <= top < bottom <= len(image):
        raise ValueError(f"rows_px: expected rows from 0 to {len(image)}, the first above the second, got {rows_px}")
    image = image[top:bottom]
    height, width = image.shape[:2]
    if ax is None:
        below = 0.35 if legend and graph is not None else 0.0
        above = 0.0 if title is None else 0.3
        height_in = _WIDTH_IN * height / width
        figure = new_figure(max(_WIDTH_IN, title_width_in(title)), above + height_in + below)
        ax = axes_at(figure, left_in=0.0, top_in=above, width_in=_WIDTH_IN, height_in=height_in)
    if faded:
        image = (255.0 - 0.45 * (255.0 - image)).round().astype(np.uint8)
    ax.imshow(image, extent=(-0.5, width - 0.5, bottom - 0.5, top - 0.5), aspect="equal")
    bare(ax, title=title)
    if graph is not None:
        edges = scene_graph(graph).edges()
        _draw_scene_graph(ax, scene_graph(graph))
        if legend and edges:
            handles = edge_handles(sorted({relation for _, _, relation in edges}))
            ax.legend(
                handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=2, frameon=False,
                fontsize=TEXT_PT, labelcolor=INK, handlelength=2.6, borderaxespad=0.3,
            )  # fmt: skip
    return ax


def _draw_scene_graph(ax: Axes, graph: SceneGraph) -> None:
    """Draw nodes and edges into axes that show a picture."""
    if not len(graph.segments):
        return
    positions = graph.positions
    if positions is None or positions.shape[1] != 2:
        raise ValueError("scene graph: expected positions (column, row) in pixels to draw it, got none")
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    width_pt = ax.get_position().width * figure_of(ax).get_figwidth() * 72
    node_pt = float(np.clip(0.075 * width_pt, 9.0, 17.0))
    node = node_pt * (right - left) / width_pt
    low, high = np.array([left, top]) + 0.6 * node, np.array([right, bottom]) - 0.6 * node
    places = _apart(positions, distance=1.7 * node, low=low, high=np.maximum(low, high))
    width_share = 0.45 + 0.55 * node_pt / 17.0
    for i, j, relation in graph.edges():
        a, b = np.searchsorted(graph.segments, (i, j))
        path = _around(places, int(a), int(b), clearance=0.95 * node)
        style = EDGE_STYLE[relation]
        line = "solid" if not style.dashes else (0, style.dashes)
        for colour, width, dashes, name in (
            (PAPER, style.width_pt * width_share + 2.0, "solid", "casing"),
            (style.colour, style.width_pt * width_share, line, RELATION_WORD[relation]),
        ):
            ax.add_patch(
                PathPatch(
                    path, fill=False, edgecolor=colour, linewidth=width, linestyle=dashes, capstyle="butt", gid=name,
                    zorder=2 + (name != "casing") / 2,
                )
            )  # fmt: skip
    ax.scatter(
        places[:, 0], places[:, 1], s=node_pt**2, c=PAPER, edgecolors=INK, linewidths=1.1 * width_share, zorder=3
    )
    for label, (x, y) in zip(graph.segments.tolist(), places, strict=True):
        ax.text(
            x, y, str(label), ha="center", va="center_baseline", fontsize=0.56 * node_pt, color=INK, fontweight="bold",
            zorder=4,
        )  # fmt: skip


def edge_handles(relations: Iterable[Relation]) -> list[Line2D]:
    """Lines for a legend of the edges that stand for these relations."""
    lines = []
    for relation in relations:
        if relation in EDGE_STYLE:
            style = EDGE_STYLE[relation]
            line = Line2D([], [], color=style.colour, linewidth=style.width_pt, label=RELATION_WORD[relation])
            if style.dashes:
                line.set_linestyle((0, style.dashes))
            lines.append(line)
    return lines


def _as_picture(picture: ArrayLike) -> NDArray[np.uint8]:
    """RGB of a frame or a label image."""
    array = as_array(picture, what="picture")
    if array.ndim == 3 and array.shape[2] == 3 and array.dtype == np.uint8 and array.size:
        return array
    if array.ndim != 2 or array.dtype.kind not in "ui" or not array.size:
        raise ValueError(
            "picture: expected an RGB frame (height, width, 3) of uint8 or a label image (height, width) of integers, "
            f"got shape {array.shape} of {array.dtype}"
        )
    labels, index = np.unique(array, return_inverse=True)
    colours = segment_colours(labels.tolist())
    image = np.array([colours[label] for label in labels.tolist()])[index.reshape(array.shape)]
    border = np.zeros(array.shape, dtype=bool)
    border[:, 1:] |= array[:, 1:] != array[:, :-1]
    border[1:] |= array[1:] != array[:-1]
    image[border] *= 0.55
    return (255.0 * image).round().astype(np.uint8)


def _apart(
    positions: NDArray[np.float64], *, distance: float, low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Positions at least ``distance`` from each other, as far as there is room for it, and between two corners."""
    # Nodes on the same spot need a direction to part: each gets its own.
    angles = 2.4 * np.arange(len(positions))
    aside = 1e-3 * distance * np.column_stack([np.cos(angles), np.sin(angles)])
    places: NDArray[np.float64] = positions + aside
    for step in range(400):
        # Where there is no room, less and less is asked for.
        wanted = distance * min(1.0, 1.6 - step / 250)
        gap = places[:, None] - places[None]
        length = np.linalg.norm(gap, axis=2)
        np.fill_diagonal(length, np.inf)
        short = np.maximum(wanted - length, 0.0)
        outside = ((places < low) | (places > high)).any()
        if short.max() <= 1e-2 * distance and not outside:
            break
        push = gap / np.maximum(length, 1e-9)[:, :, None] * short[:, :, None]
        places = np.clip(places + 0.5 * push.sum(axis=1), low, high) + aside * (length.min() < 1e-6)
    return places


def _around(places: NDArray[np.float64], a: int, b: int, *, clearance: float) -> Path:
    """Way from node a to node b, bent around the nodes that lie on the straight one."""
    start, way = places[a], places[b] - places[a]
    length = float(np.hypot(*way))
    normal = np.array([-way[1], way[0]]) / length
    others = np.delete(places, [a, b], axis=0) - start
    along, aside = others @ way / length**2, others @ normal
    near = (along > 0.05) & (along < 0.95) & (np.abs(aside) < clearance)
    bend = 0.0
    if near.any():
        # A quadratic curve is 2 t (1 − t) times its control point away from the straight line.
        needed = (clearance - np.abs(aside[near])) / (2 * along[near] * (1 - along[near]))
        side = -1.0 if aside[near][needed.argmax()] >= 0 else 1.0
        bend = side * min(float(needed.max()), 0.6 * length)
    middle = start + way / 2 + bend * normal
    return Path([start, middle, places[b]], [Path.MOVETO, Path.CURVE3, Path.CURVE3])
