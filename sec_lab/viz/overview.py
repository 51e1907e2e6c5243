"""A movie turns into an event chain: one picture of steps 1 to 4 (Fig. 2.1).

``python -m sec_lab.viz.overview FILE.png`` draws the first artificial *Moving Object* action, ``python -m
sec_lab.viz.overview FILE.png FOLDER 1=table 2=plate …`` what is seen in a stereo movie (``left.mp4``, ``right.mp4``,
``calibration.json``), with names for its segments.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.files import write_whole
from sec_lab.observation import Observation
from sec_lab.viz.cells import cell_handles, draw_table, table_of
from sec_lab.viz.scene import draw_segments, edge_handles
from sec_lab.viz.style import INK, LINE, SMALL_PT, SOFT, TEXT_PT, axes_at, new_figure, png_bytes

_WIDTH_IN, _LEFT_IN, _RIGHT_IN = 9.0, 2.2, 0.2
_TOP_IN, _GAP_IN, _ROW_IN, _BOTTOM_IN = 0.62, 0.1, 0.29, 0.5
_LABEL_RIGHT = (_LEFT_IN - 0.05) / _WIDTH_IN

_SHORT_NAMES = {1: "background", 2: "yellow vessel", 3: "red vessel", 4: "black object"}


FrameStack = NDArray[np.integer[Any]]


def draw_overview(
    observation: Observation, frames: FrameStack, labels: FrameStack, *, rows_px: tuple[int, int]
) -> Figure:
    """Draw frames, segments, scene graphs and the event chain of a movie below each other, one column a main graph.

    Parameters
    ----------
    observation : Observation
        Of the movie, with positions in pixels and at most eight key frames.
    frames : (n, height, width, 3) uint8
        Every frame of the movie.
    labels : (n, height, width) int
        Every label image of the movie.
    rows_px : tuple of two int
        Rows of the pictures that are shown, from the first up to, not including, the second.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If there are more than eight key frames.
    """
    recorded = observation.recorded
    n = len(recorded)
    if n > 8:
        raise ValueError(f"overview: expected at most 8 key frames, got {n}")
    table = table_of(observation.chain, form="original", row_names="names")
    wide_in = (_WIDTH_IN - _LEFT_IN - _RIGHT_IN) / n
    picture_in = wide_in - _GAP_IN
    width_px = labels.shape[2]
    high_in = picture_in * (rows_px[1] - rows_px[0]) / width_px
    table_in = _ROW_IN * len(table.rows)
    table_top_in = _TOP_IN + 3 * (high_in + _GAP_IN) + 0.3
    height_in = table_top_in + table_in + _BOTTOM_IN
    figure = new_figure(_WIDTH_IN, height_in)

    for column, (graph, frame) in enumerate(zip(recorded, recorded.key_frames.tolist(), strict=True)):
        sources = (frames[frame], labels[frame], labels[frame])
        for row, picture in enumerate(sources):
            ax = axes_at(
                figure, left_in=_LEFT_IN + column * wide_in + _GAP_IN / 2, top_in=_TOP_IN + row * (high_in + _GAP_IN),
                width_in=picture_in, height_in=high_in,
            )  # fmt: skip
            draw_segments(picture, graph if row == 2 else None, ax=ax, legend=False, faded=row == 2, rows_px=rows_px)
            if row == 0:
                ax.set_title(f"frame {frame}", fontsize=TEXT_PT, color=INK, pad=4)
    ax = axes_at(figure, left_in=_LEFT_IN, top_in=table_top_in, width_in=n * wide_in, height_in=table_in)
    draw_table(ax, table)
    ax.set(xticks=[], xlabel="")
    top = 1 - (table_top_in - 0.06) / height_in
    _bold(figure, top, "event chain")
    _name_steps(figure, high_in)
    _draw_time(figure, len(labels), n)
    relations = [one for one in Relation if one in table.before]
    figure.legend(
        handles=[*edge_handles(relations), *cell_handles([table])], loc="lower left", ncols=8, frameon=False,
        bbox_to_anchor=((_LEFT_IN - 0.05) / _WIDTH_IN, 0.0), fontsize=SMALL_PT, labelcolor=INK, handlelength=1.8,
        handletextpad=0.5, columnspacing=1.5, borderaxespad=0.5,
    )  # fmt: skip
    return figure


def _name_steps(figure: Figure, high_in: float) -> None:
    """Names of the rows of pictures at the left."""
    height_in = figure.get_figheight()
    steps = (("movie", "what the camera sees"), ("segments", "tracked from frame to frame"),
             ("scene graphs", "where relations change"))  # fmt: skip
    for row, (name, what) in enumerate(steps):
        middle = 1 - (_TOP_IN + row * (high_in + _GAP_IN) + high_in / 2) / height_in
        _bold(figure, middle + 0.02 / height_in, name)
        figure.text(_LABEL_RIGHT, middle - 0.02 / height_in, what, ha="right", va="top", fontsize=SMALL_PT, color=SOFT)


def _bold(figure: Figure, y: float, text: str) -> None:
    figure.text(_LABEL_RIGHT, y, text, ha="right", va="bottom", fontsize=TEXT_PT + 1, color=INK, fontweight="bold")


def _draw_time(figure: Figure, n_frames: int, n_key_frames: int) -> None:
    """Arrow of time above the pictures."""
    height_in = figure.get_figheight()
    y = 1 - 0.22 / height_in
    left, right = (_LEFT_IN + 0.05) / _WIDTH_IN, 1 - _RIGHT_IN / _WIDTH_IN
    figure.add_artist(
        FancyArrowPatch((left, y), (right, y), arrowstyle="-|>", mutation_scale=9, color=LINE, linewidth=1.2)
    )
    figure.text(
        (left + right) / 2, y, f" {n_frames} frames, {n_key_frames} of them key frames ", ha="center", va="center",
        fontsize=SMALL_PT, color=SOFT, backgroundcolor=figure.get_facecolor(),
    )  # fmt: skip


def main(arguments: Sequence[str]) -> None:
    """Write the picture to the file that is named."""
    if not arguments:
        sys.exit("usage: python -m sec_lab.viz.overview FILE.png [FOLDER [LABEL=NAME ...]]")
    path, *movie = arguments
    try:
        picture = _stereo_movie(Path(movie[0]), movie[1:]) if movie else _drawn_movie()
        write_whole(Path(path), png_bytes(picture))
    except ValueError as problem:
        sys.exit(f"error: {problem}")


def _drawn_movie() -> Figure:
    from sec_lab.pipeline import observe_segments
    from sec_lab.worlds.drawn import moving_object

    movie = moving_object(1)
    seen = observe_segments(movie.labels, relations="edge counting", names=_SHORT_NAMES)
    return draw_overview(seen, movie.frames, movie.labels, rows_px=(72, 208))


def _stereo_movie(folder: Path, names: Sequence[str]) -> Figure:
    from sec_lab.pipeline import observe
    from sec_lab.recording import Recording

    named = dict(pair.split("=", 1) for pair in names)
    movie = Recording.open(folder / "left.mp4", right=folder / "right.mp4", calibration=folder / "calibration.json")
    seen = observe(movie, names={int(label): name for label, name in named.items()})
    assert seen.segmentation is not None
    frames, labels = np.stack([frame.image for frame in movie]), np.stack(list(seen.segmentation))
    return draw_overview(seen, frames, labels, rows_px=(0, movie.size[0]))


if __name__ == "__main__":
    main(sys.argv[1:])
