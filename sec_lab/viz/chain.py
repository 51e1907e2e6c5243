"""Event chains as tables of coloured cells (Fig. 2.5 d–f), and as text."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from sec_lab.event_chain import EventChain
from sec_lab.viz.cells import (
    ChainArray,
    ChainForm,
    RowNames,
    Table,
    cell_handles,
    draw_table,
    names_width_in,
    relation_name,
    table_of,
)
from sec_lab.viz.style import (
    INK,
    PAGE_WIDTH_IN,
    SMALL_PT,
    axes_at,
    figure_of,
    new_figure,
    text_width_in,
    title_width_in,
)

if TYPE_CHECKING:
    import pandas as pd

CELL_IN, WIDE_CELL_IN = 0.36, 0.46
"""Width of a cell of ξ_o, and of a change, in a figure of its own."""


def draw_chain(
    chain: EventChain | ChainArray,
    *,
    form: ChainForm = "original",
    changing_only: bool = False,
    row_names: RowNames = "relations",
    ax: Axes | None = None,
    title: str | None = None,
    legend: bool = True,
) -> Axes:
    """Draw an event chain as a table of coloured cells with the relation codes in them (Fig. 2.5 d–f).

    A cell of ξ_d or ξ_c is a change: its left half shows the relation before, its right half the one after. What does
    not change is pale. Codes and row names are left out where the table is too large for them.

    Parameters
    ----------
    chain : EventChain, array of ξ_o, array of ξ_d, or rows of ξ_c
        An array must be of the form that is asked for.
    form : {"original", "derived", "compressed"}, optional
        ξ_o, ξ_d or ξ_c (§2.5).
    changing_only : bool, optional
        Leave out rows of ξ_o in which nothing ever happens, as ξ_d and ξ_c do.
    row_names : {"relations", "names"}, optional
        Rows are called ρ2,1, or by the names of their segments.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure of fitting size if left out.
    title : str, optional
    legend : bool, optional
        Explain the colours below the table.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the form or the choice of names is unknown, or there is nothing to draw in that form.

    Examples
    --------
    >>> ax = draw_chain(EventChain([[1, 2, 1]], [(2, 1)], [0, 27, 37]))
    >>> [text.get_text() for text in ax.texts], [tick.get_text() for tick in ax.get_yticklabels()]
    (['1', '2', '1'], ['ρ$_{2{,}1}$'])
    """
    table = table_of(chain, form=form, changing_only=changing_only, row_names=row_names)
    if ax is None:
        ax = _new_axes(table, title=title, legend=legend)
    draw_table(ax, table, title=title)
    if legend:
        _explain_cells(ax, table)
    return ax


def chain_forms(chain: EventChain) -> "pd.DataFrame":
    """Rows that change in all three forms, as text (Fig. 2.5 d–f).

    Parameters
    ----------
    chain : EventChain

    Returns
    -------
    pandas.DataFrame
        Columns ``ξ_o``, ``ξ_d`` and ``ξ_c``; rows are called as in the thesis.

    Examples
    --------
    >>> chain_forms(EventChain([[1, 2, 2], [0, 0, 0]], [(2, 1), (3, 1)]))
            ξ_o    ξ_d ξ_c
    ρ2,1  1 2 2  12 22  12
    """
    import pandas as pd

    rows = chain.changing_rows
    forms = {
        "ξ_o": [" ".join(f"{code}" for code in row) for row in chain.relations[rows].tolist()],
        "ξ_d": [" ".join(f"{change:02}" for change in row) for row in chain.derived.tolist()],
        "ξ_c": [" ".join(f"{change:02}" for change in row.tolist()) for row in chain.compressed],
    }
    return pd.DataFrame(forms, index=[relation_name(chain.pairs[row]) for row in rows])


def _new_axes(table: Table, *, title: str | None, legend: bool) -> Axes:
    """Axes in a figure of their own, with cells of one size as long as they fit on a page."""
    n_rows, n_columns = table.before.shape
    left, right = names_width_in(table.rows), 0.12
    below, above = 0.48 + (0.3 if legend else 0.0), 0.08 if title is None else 0.3
    cell_in = CELL_IN if table.form == "original" else WIDE_CELL_IN
    # Cells shrink so that the table fits on a page; very long names make the figure wider instead.
    width_in = min(cell_in * n_columns, max(PAGE_WIDTH_IN - left - right, 3.0))
    height_in = float(np.clip(CELL_IN * n_rows, CELL_IN, 7.0))
    # Room for the legend, however few columns there are.
    legend_in = _legend_width_in(table) + 0.1 if legend else 0.0
    whole_in = max(left + max(width_in + right, title_width_in(title)), legend_in)
    figure = new_figure(whole_in, above + height_in + below)
    return axes_at(figure, left_in=left, top_in=above, width_in=width_in, height_in=height_in)


def _legend_width_in(table: Table) -> float:
    labels = [str(patch.get_label()) for patch in cell_handles([table])]
    return sum(0.32 + text_width_in(label, size_pt=SMALL_PT) for label in labels)


def _explain_cells(ax: Axes, table: Table) -> None:
    """Legend below the axes; it begins left of them where the figure would end before it."""
    figure = figure_of(ax)
    box, whole_in = ax.get_position(), figure.get_figwidth()
    left_in = max(0.0, min(box.x0 * whole_in, whole_in - _legend_width_in(table)))
    height_in = box.height * figure.get_figheight()
    ax.legend(
        handles=cell_handles([table]), loc="upper left", ncols=4, frameon=False, fontsize=SMALL_PT, labelcolor=INK,
        bbox_to_anchor=((left_in / whole_in - box.x0) / box.width, -0.48 / height_in), handlelength=0.9,
        handleheight=0.9, handletextpad=0.4, columnspacing=1.1, borderpad=0.0, borderaxespad=0.0,
    )  # fmt: skip
