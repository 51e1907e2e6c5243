"""Tables of counts as pictures: what was taken for what."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from sec_lab.viz.style import (
    INK,
    PAGE_WIDTH_IN,
    PAPER,
    SIMILARITY_COLOURS,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    axes_at,
    new_figure,
    tidy,
)

if TYPE_CHECKING:
    import pandas as pd

_CELL_IN = 0.42


def draw_counts(frame: "pd.DataFrame", *, ax: Axes | None = None, title: str | None = None) -> Axes:
    """Draw a table of counts with the numbers in the cells, dark where a row has most of its counts.

    A cell is as dark as its share of its row; an empty cell stays empty. Cells whose row and column have the same name
    are framed: in a confusion matrix they hold the right answers.

    Parameters
    ----------
    frame : pandas.DataFrame
        Whole numbers from 0 on, e.g. of :func:`~sec_lab.classification.confusion`; the names of index and columns stand
        beside the axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out.
    title : str, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the table is empty, or an entry is no whole number from 0 on.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame([[3, 1], [0, 4]], pd.Index(["put", "take"], name="class"), ["put", "take"])
    >>> [text.get_text() for text in draw_counts(frame).texts]
    ['3', '1', '4']
    """
    values = frame.to_numpy(dtype=np.float64)
    if not values.size:
        raise ValueError(f"counts: expected at least one row and one column, got shape {values.shape}")
    wrong = ~((values >= 0) & (values == np.floor(values)))
    if wrong.any():
        raise ValueError(f"counts: expected whole numbers from 0 on, got {values[wrong][0]}")
    rows, columns = [str(name) for name in frame.index], [str(name) for name in frame.columns]
    if ax is None:
        ax = _new_axes(rows, columns, titled=title is not None)
    totals = values.sum(axis=1, keepdims=True)
    shares = np.divide(values, totals, out=np.zeros_like(values), where=totals > 0)
    ax.imshow(shares, cmap=SIMILARITY_COLOURS, vmin=0, vmax=1, interpolation="nearest", aspect="auto")
    tidy(ax, title=title)
    ax.tick_params(length=0)
    for (row, column), value in np.ndenumerate(values):
        if value:
            colour = PAPER if shares[row, column] > 0.55 else INK
            ax.text(
                column, row, f"{value:.0f}", ha="center", va="center_baseline", fontsize=SMALL_PT, color=colour,
                parse_math=False,
            )  # fmt: skip
        if rows[row] == columns[column]:
            ax.add_patch(_frame_around(row, column))
    n_rows, n_columns = values.shape
    ax.hlines(np.arange(n_rows + 1) - 0.5, -0.5, n_columns - 0.5, colors=PAPER, linewidth=1.6)
    ax.vlines(np.arange(n_columns + 1) - 0.5, -0.5, n_rows - 0.5, colors=PAPER, linewidth=1.6)
    ax.set_yticks(range(n_rows), rows, fontsize=SMALL_PT, parse_math=False)
    ax.set_xticks(range(n_columns), columns, fontsize=SMALL_PT, parse_math=False)
    for tick in ax.get_xticklabels():
        tick.set(rotation=40, ha="right", rotation_mode="anchor")
    rows_are = str(frame.index.name or "")
    ax.set_ylabel(rows_are, fontsize=TEXT_PT, color=SOFT, rotation=90 if len(rows_are) > 2 else 0, va="center")
    ax.set_xlabel(str(frame.columns.name or ""), fontsize=TEXT_PT, color=SOFT)
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


def _frame_around(row: int, column: int) -> Rectangle:
    return Rectangle(
        (column - 0.43, row - 0.43), 0.86, 0.86, fill=False, edgecolor=INK, linewidth=0.9, zorder=3, gid="same name"
    )


def _new_axes(rows: list[str], columns: list[str], *, titled: bool) -> Axes:
    """Axes in a figure of their own, with room for all names."""
    letter_in = 0.6 * SMALL_PT / 72
    left_in = 0.45 + letter_in * max(map(len, rows))
    below_in = 0.5 + 0.66 * letter_in * max(map(len, columns))
    above_in = 0.34 if titled else 0.1
    # The first slanted name may reach farther to the left than the row names.
    left_in = max(left_in, 0.77 * letter_in * len(columns[0]))
    width_in = min(_CELL_IN * len(columns), PAGE_WIDTH_IN - left_in - 0.12)
    height_in = 0.7 * _CELL_IN * len(rows)
    figure = new_figure(left_in + width_in + 0.12, above_in + height_in + below_in)
    return axes_at(figure, left_in=left_in, top_in=above_in, width_in=width_in, height_in=height_in)
