"""Tables of similarities as pictures (Table 2.1, Fig. 2.7, 2.10 a)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from sec_lab.viz.cells import typeset
from sec_lab.viz.style import (
    INK,
    PAGE_WIDTH_IN,
    PAPER,
    SIMILARITY_COLOURS,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    axes_at,
    figure_of,
    new_figure,
    text_width_in,
    tidy,
    title_width_in,
)

if TYPE_CHECKING:
    import pandas as pd

_MOST_PRINTED = 20
# Names up to this length stand below their column without touching their neighbours.
_LONGEST_LEVEL = 6


def draw_similarity_table(
    frame: "pd.DataFrame",
    *,
    classes: Sequence[object] | Mapping[object, object] | None = None,
    ax: Axes | None = None,
    title: str | None = None,
) -> Axes:
    """Draw a table of similarities in percent, dark where they are high (Fig. 2.7).

    Up to 20 rows the values are printed in the cells, and beside them the names of rows and columns. With classes the
    rows are ordered by class, in the order in which classes first occur, and lines part the classes.

    Parameters
    ----------
    frame : pandas.DataFrame
        Similarities from 0 to 100 in percent; e.g. of :func:`~sec_lab.similarity.similarity_table`, or
        :meth:`~sec_lab.similarity.Match.row_similarity_frame`, which need not be square.
    classes : sequence or mapping, optional
        Class of each row, in the order of the rows or by row name. The table must then be square.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out.
    title : str, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the table is empty, a value is not between 0 and 100, or the classes are not one a row of a square table.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame([[100, 20, 60], [20, 100, 30], [60, 30, 100]], list("abc"), list("abc"))
    >>> ax = draw_similarity_table(frame, classes=["put", "take", "put"])
    >>> [tick.get_text() for tick in ax.get_yticklabels()]
    ['a', 'c', 'b']
    """
    values = frame.to_numpy(dtype=np.float64)
    if not values.size:
        raise ValueError(f"similarity table: expected at least one row and one column, got shape {values.shape}")
    wrong = ~((values >= 0) & (values <= 100 + 1e-9))
    if wrong.any():
        raise ValueError(f"similarity table: expected percent from 0 to 100, got {values[wrong][0]}")
    rows, columns = [str(name) for name in frame.index], [str(name) for name in frame.columns]
    groups: list[tuple[str, int]] = []
    if classes is not None:
        order, groups = _by_class(frame, classes)
        values = values[np.ix_(order, order)]
        rows, columns = ([names[i] for i in order] for names in (rows, columns))
    n_rows, n_columns = values.shape
    printed = n_rows <= _MOST_PRINTED and n_columns <= _MOST_PRINTED
    own = ax is None
    if ax is None:
        names = [*rows, *columns] if printed else [name for name, _ in groups]
        ax = _new_axes(names, n_rows, n_columns, printed=printed, title=title)
    picture = ax.imshow(values, cmap=SIMILARITY_COLOURS, vmin=0, vmax=100, interpolation="nearest", aspect="auto")
    tidy(ax, title=title)
    ax.tick_params(length=0)
    if printed:
        _print_values(ax, values)
        _name_columns(ax, np.arange(n_columns), columns)
        ax.set_yticks(range(n_rows), [typeset(name) for name in rows], fontsize=SMALL_PT)
        for spine in ax.spines.values():
            spine.set_visible(False)
        ax.hlines(np.arange(n_rows + 1) - 0.5, -0.5, n_columns - 0.5, colors=PAPER, linewidth=1.6)
        ax.vlines(np.arange(n_columns + 1) - 0.5, -0.5, n_rows - 0.5, colors=PAPER, linewidth=1.6)
    else:
        ax.set(xticks=[], yticks=[])
        if not groups:
            ax.set_ylabel(f"{n_rows} chains", fontsize=TEXT_PT, color=INK)
            ax.set_xlabel(f"{n_columns} chains", fontsize=TEXT_PT, color=INK)
    if groups:
        _part_classes(ax, groups, n_rows, named=not printed)
    if printed:
        ax.set_xlabel("similarity in %", fontsize=TEXT_PT, color=SOFT)
    else:
        _explain_colours(ax, picture, room=own)
    return ax


def _name_columns(ax: Axes, places: NDArray[np.generic], names: Sequence[str]) -> None:
    """Names below the columns; all slanted if one is long."""
    ax.set_xticks(places, [typeset(name) for name in names], fontsize=SMALL_PT)
    if max(map(len, names)) > _LONGEST_LEVEL:
        for tick in ax.get_xticklabels():
            tick.set(rotation=40, ha="right", rotation_mode="anchor")


def _by_class(
    frame: "pd.DataFrame", classes: Sequence[object] | Mapping[object, object]
) -> tuple[NDArray[np.intp], list[tuple[str, int]]]:
    """Order of the rows by class, and the name and size of each class in that order."""
    n = len(frame)
    if frame.shape != (n, n) or len(classes) != n:
        raise ValueError(f"classes: expected one a row of a square table, got {len(classes)} for shape {frame.shape}")
    if isinstance(classes, Mapping):
        missing = [name for name in frame.index if name not in classes]
        if missing:
            raise ValueError(f"classes: expected a class for every row, got none for {missing[0]!r}")
        of_row = [classes[name] for name in frame.index]
    else:
        of_row = list(classes)
    present = list(dict.fromkeys(of_row))
    number = np.array([present.index(one) for one in of_row])
    return np.argsort(number, kind="stable"), [(str(one), of_row.count(one)) for one in present]


def _print_values(ax: Axes, values: NDArray[np.float64]) -> None:
    for (row, column), value in np.ndenumerate(values):
        colour = PAPER if value > 55 else INK
        ax.text(column, row, f"{value:.0f}", ha="center", va="center_baseline", fontsize=SMALL_PT, color=colour)


def _part_classes(ax: Axes, groups: Sequence[tuple[str, int]], n: int, *, named: bool) -> None:
    ends = np.cumsum([size for _, size in groups])
    for end in ends[:-1] - 0.5:
        ax.axhline(end, color=INK, linewidth=1.1, gid="class")
        ax.axvline(end, color=INK, linewidth=1.1, gid="class")
    if named:
        middles = ends - np.array([size for _, size in groups]) / 2 - 0.5
        names = [name for name, _ in groups]
        ax.set_yticks(middles, [typeset(name) for name in names], fontsize=SMALL_PT)
        _name_columns(ax, middles, names)
    ax.set(xlim=(-0.5, n - 0.5), ylim=(n - 0.5, -0.5))


def _explain_colours(ax: Axes, picture: AxesImage, *, room: bool) -> None:
    """Colour bar at the right: where room was left for it, or at the cost of the axes."""
    figure = figure_of(ax)
    if room:
        box, whole_in = ax.get_position(), figure.get_figwidth()
        bar_ax = figure.add_axes((box.x1 + 0.15 / whole_in, box.y0, 0.16 / whole_in, box.height))
        bar = figure.colorbar(picture, cax=bar_ax)
    else:
        bar = figure.colorbar(picture, ax=ax)
    bar.set_label("similarity in %", fontsize=TEXT_PT, color=SOFT)
    tidy(bar.ax)


def _new_axes(names: Sequence[str], n_rows: int, n_columns: int, *, printed: bool, title: str | None) -> Axes:
    """Axes in a figure of their own, with room for row and column names and, if nothing is printed, a colour bar."""
    name_in = 0.2 + max((text_width_in(typeset(name), size_pt=SMALL_PT) for name in names), default=0.1)
    slanted = max(map(len, names), default=0) > _LONGEST_LEVEL
    below_in = (0.68 * name_in + 0.1 if slanted else 0.3) + (0.22 if printed else 0.0)
    right_in, above_in = 0.1 if printed else 0.85, 0.1 if title is None else 0.32
    cell_in = 0.46 if printed else 0.06
    most_in = PAGE_WIDTH_IN - name_in - right_in
    width_in = float(np.clip(cell_in * n_columns, 1.2 if printed else 4.0, max(2.0, most_in)))
    height_in = float(np.clip(0.8 * cell_in * n_rows, 0.36 if printed else 3.6, 6.0))
    whole_in = name_in + max(width_in + right_in, title_width_in(title))
    figure = new_figure(whole_in, above_in + height_in + below_in)
    return axes_at(figure, left_in=name_in, top_in=above_in, width_in=width_in, height_in=height_in)
