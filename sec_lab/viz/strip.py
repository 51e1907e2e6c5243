"""The film strip of main graphs, from frames to tables (Fig. 2.5, 2.6)."""

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz.cells import ChainForm, Table, cell_handles, draw_table, names_width_in, table_of
from sec_lab.viz.chain import CELL_IN, WIDE_CELL_IN
from sec_lab.viz.scene import draw_segments, edge_handles
from sec_lab.viz.style import INK, PAGE_WIDTH_IN, SMALL_PT, SOFT, TEXT_PT, TITLE_PT, axes_at, new_figure

_SYMBOL_OF: Mapping[ChainForm, str] = {"original": "ξ$_o$", "derived": "ξ$_d$", "compressed": "ξ$_c$"}
_MOST_COLUMNS = 12
_GAP_IN, _LETTER_IN, _ROW_IN = 0.08, 0.32, 0.31


def draw_main_graphs(
    observation: Observation,
    *,
    frames: Sequence[ArrayLike] | ArrayLike | None = None,
    labels: Sequence[ArrayLike] | ArrayLike | None = None,
    columns: Sequence[int] | None = None,
    changing_only: bool = False,
) -> Figure:
    """Draw an action as Fig. 2.5 does: frames, segments, main graphs, and the chain in its three forms.

    Parameters
    ----------
    observation : Observation
        Of a movie, with positions in pixels.
    frames : sequence of (height, width, 3) array_like of uint8, optional
        Every frame of the movie, found by its frame number; row (a).
    labels : sequence of (height, width) array_like of int, optional
        Every label image of the movie, found by its frame number; row (b).
    columns : sequence of int, optional
        Which main graphs to show, counted from 0; all if left out.
    changing_only : bool, optional
        Leave out rows of ξ_o in which nothing ever happens.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If neither frames nor labels are given, nothing changes, there are more than 12 columns or none, a column does
        not exist, or a key frame is not in the movie.

    Examples
    --------
    >>> from sec_lab.pipeline import observe_segments
    >>> labels = np.ones((3, 20, 20), dtype=np.uint8)
    >>> labels[1:, 5:15, 5:15] = 2
    >>> seen = observe_segments(labels)
    >>> [ax.get_title(loc="left") for ax in draw_main_graphs(seen, labels=labels).axes[:2]]
    ['frame 0', 'frame 1']
    """
    if frames is None and labels is None:
        raise ValueError("main graphs: expected frames or label images of the movie, got neither")
    shown = _chosen(observation, columns)
    chain = observation.chain
    strips = [(letter, source) for letter, source in (("a", frames), ("b", labels)) if source is not None]
    background = labels if labels is not None else frames
    pictures = [[_picture_at(source, frame) for frame, _ in shown] for _, source in strips]
    graphs = [_picture_at(background, frame) for frame, _ in shown]  # type: ignore[arg-type]

    height, width = graphs[0].shape[:2]
    wide_in = (PAGE_WIDTH_IN - _LETTER_IN - _GAP_IN * len(shown)) / max(len(shown), 4)
    high_in = wide_in * height / width
    tables = [table_of(chain, form=form, changing_only=changing_only and form == "original") for form in _SYMBOL_OF]
    row_in = min(_ROW_IN, 6.0 / len(tables[0].rows))
    table_in = row_in * max(len(table.rows) for table in tables)
    film_in = (len(strips) + 1) * (high_in + _GAP_IN)
    whole_in = 0.28 + film_in + 0.42 + table_in + 0.5 + 0.32
    figure = new_figure(PAGE_WIDTH_IN, whole_in)

    top_in = 0.28
    for number, (letter, row) in enumerate([*zip((one for one, _ in strips), pictures, strict=True), ("c", graphs)]):
        _letter(figure, letter, 0.004, 1 - (top_in + high_in / 2) / whole_in)
        for column, picture in enumerate(row):
            left_in = _LETTER_IN + column * (wide_in + _GAP_IN)
            ax = axes_at(figure, left_in=left_in, top_in=top_in, width_in=wide_in, height_in=high_in)
            with_graph = letter == "c"
            draw_segments(picture, shown[column][1] if with_graph else None, ax=ax, legend=False, faded=with_graph)
            if number == 0:
                ax.set_title(f"frame {shown[column][0]}", loc="left", fontsize=SMALL_PT, color=SOFT, pad=3)
        top_in += high_in + _GAP_IN
    _draw_tables(figure, tables, top_in=top_in + 0.34, row_in=row_in)
    relations = [relation for relation in Relation if any(relation in table.before for table in tables)]
    figure.legend(
        handles=[*edge_handles(relations), *cell_handles(tables)], loc="lower left",
        bbox_to_anchor=((_LETTER_IN - 0.05) / PAGE_WIDTH_IN, 0.0), ncols=8, frameon=False, fontsize=SMALL_PT,
        labelcolor=INK, handlelength=1.8, handletextpad=0.5, columnspacing=1.4, borderaxespad=0.2,
    )  # fmt: skip
    return figure


def _draw_tables(figure: Figure, tables: Sequence[Table], *, top_in: float, row_in: float) -> None:
    """The three forms of the chain side by side, as wide as the page allows."""
    names_in = [names_width_in(table.rows) for table in tables]
    wanted_in = [len(table.columns) * (CELL_IN if table.form == "original" else WIDE_CELL_IN) for table in tables]
    free_in = PAGE_WIDTH_IN - _LETTER_IN * len(tables) - sum(names_in)
    scale = min(1.0, free_in / sum(wanted_in))
    spare_in = max(0.0, free_in - sum(wanted_in)) / len(tables)
    left_in = 0.0
    for letter, table, name_in, wide_in in zip("def", tables, names_in, wanted_in, strict=True):
        left_in += _LETTER_IN + name_in
        height_in = row_in * len(table.rows)
        ax = axes_at(figure, left_in=left_in, top_in=top_in, width_in=scale * wide_in, height_in=height_in)
        draw_table(ax, table)
        ax.set_title(_SYMBOL_OF[table.form], loc="left", fontsize=TITLE_PT, color=INK, fontweight="bold", pad=5)
        box = ax.get_position()
        _letter(figure, letter, 0.004 + (left_in - name_in - _LETTER_IN) / PAGE_WIDTH_IN, box.y1 + 0.004, va="bottom")
        left_in += scale * wide_in + spare_in


def _letter(figure: Figure, letter: str, x: float, y: float, *, va: str = "center") -> None:
    figure.text(x, y, f"({letter})", ha="left", va=va, fontsize=TEXT_PT, color=SOFT)


def _chosen(observation: Observation, columns: Sequence[int] | None) -> list[tuple[int, SceneGraph]]:
    """Frame number and graph of the main graphs that are shown."""
    recorded = observation.recorded
    all_columns = list(zip(recorded.key_frames.tolist(), recorded.graphs, strict=True))
    chosen = list(range(len(all_columns))) if columns is None else list(columns)
    if not 1 <= len(chosen) <= _MOST_COLUMNS:
        raise ValueError(f"columns: expected 1 to {_MOST_COLUMNS} main graphs in a strip, got {len(chosen)}")
    outside = [column for column in chosen if not 0 <= column < len(all_columns)]
    if outside:
        raise ValueError(f"columns: expected numbers from 0 to {len(all_columns) - 1}, got {outside[0]}")
    return [all_columns[column] for column in chosen]


def _picture_at(source: Sequence[ArrayLike] | ArrayLike, frame: int) -> NDArray[np.generic]:
    pictures = cast("Sequence[ArrayLike]", source)
    if not 0 <= frame < len(pictures):
        raise ValueError(f"key frame {frame}: expected a frame of the movie, which has {len(pictures)}")
    return np.asarray(pictures[frame])
