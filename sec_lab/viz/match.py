"""Two event chains side by side, and how they agree (step 5, Table 2.2)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import ConnectionPatch, Rectangle
from numpy.typing import NDArray

from sec_lab.event_chain import EventChain
from sec_lab.similarity import Match
from sec_lab.viz.cells import (
    LEAST_CODE_PT,
    RowNames,
    Table,
    cell_size_pt,
    draw_table,
    names_width_in,
    relation_name,
    table_of,
)
from sec_lab.viz.style import INK, LINE, PAGE_WIDTH_IN, PAPER, SMALL_PT, SOFT, TEXT_PT, TITLE_PT, axes_at, new_figure

_JOIN_IN, _APART_IN, _ABOVE_IN, _BELOW_IN, _RIGHT_IN = 0.6, 0.35, 0.66, 0.66, 0.12
_LEAST_TEXT_IN = 1.7
_TITLE_PAD_PT = 23


def draw_match(match: Match, *, row_names: RowNames = "relations", titles: tuple[str, str] = ("ξ¹", "ξ²")) -> Figure:
    """Draw two chains with their corresponding rows joined, and cell by cell where they agree (§2.6, Table 2.2).

    Columns that are aligned carry the same number above them. The third table has a row for each row of the first chain
    that changes and a column for each two aligned columns; a cell is filled where both chains agree, and shows both
    codes where they do not. ψ_temporal is the number of filled cells over the number of rows times the columns of the
    chain with fewer columns.

    Parameters
    ----------
    match : Match
        Of :func:`~sec_lab.similarity.compare`.
    row_names : {"relations", "names"}, optional
        Rows are called ρ2,1, or by the names of their segments.
    titles : tuple of two str, optional
        Names of the two chains.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If the choice of names is unknown.

    Examples
    --------
    >>> from sec_lab.similarity import compare
    >>> chain = EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)])
    >>> draw_match(compare(chain, chain)).axes[2].get_title(loc="right")
    '6 of 6 cells agree'
    """
    form = match.temporal_input
    chains = [table_of(chain, form=form, changing_only=True, row_names=row_names) for chain in (match.a, match.b)]
    tables = [*chains, _agreement(match, named=row_names == "relations")]
    most_rows = max(len(table.rows) for table in tables)
    row_in = min(0.34, 7.5 / most_rows)
    whole_in = row_in * most_rows + _ABOVE_IN + _BELOW_IN
    # Rows that are too low for names need no room for them, but for one line that says how many there are.
    names_in = [names_width_in(table.rows) if row_in > 0.13 else 0.3 for table in tables]
    shares = np.array([max(1, len(table.columns)) for table in tables])
    fixed_in = sum(names_in) + _JOIN_IN + _APART_IN + _RIGHT_IN
    # Very long names make the figure wider than a page.
    figure = new_figure(max(PAGE_WIDTH_IN, fixed_in + 3.0), whole_in)
    free_in = figure.get_figwidth() - fixed_in
    widths_in = np.clip(free_in * shares / shares.sum(), 0.2, 0.55 * shares)
    # What is written under and over a narrow third table stands out on both its sides.
    figure.set_figwidth(figure.get_figwidth() + max(0.0, (_LEAST_TEXT_IN - widths_in[2]) / 2))
    axes: list[Axes] = []
    left_in = names_in[0]
    for number, table in enumerate(tables):
        ax = axes_at(
            figure, left_in=left_in, top_in=_ABOVE_IN, width_in=float(widths_in[number]),
            height_in=row_in * len(table.rows),
        )  # fmt: skip
        draw_table(ax, table)
        axes.append(ax)
        left_in += widths_in[number] + (_JOIN_IN, _APART_IN, 0.0)[number] + (*names_in, 0.0)[number + 1]
    for side, title in enumerate(titles):
        _title(axes[side], title, loc="left")
        _number_columns(axes[side], match.columns[:, side])
    width_pt, height_pt = cell_size_pt(axes[0])
    axes[0].text(
        axes[0].get_xlim()[1] + 4 / width_pt, -6.2 / height_pt, "aligned", va="bottom", fontsize=SMALL_PT, color=SOFT
    )
    _join_rows(figure, axes, match, names_in[1])
    _finish_agreement(axes[2], match, tables[2])
    return figure


def _title(ax: Axes, text: str, *, loc: str) -> None:
    ax.set_title(text, loc=loc, fontsize=TITLE_PT, color=INK, fontweight="bold", pad=_TITLE_PAD_PT, parse_math=False)  # type: ignore[arg-type]


def _join_rows(figure: Figure, axes: Sequence[Axes], match: Match, names_in: float) -> None:
    """A line from each row of the first table to the name of its partner in the second."""
    width_pt, height_pt = cell_size_pt(axes[1])
    end = -names_in * 72 / width_pt
    begin = axes[0].get_xlim()[1] + 3 / cell_size_pt(axes[0])[0]
    ranks = [{int(row): rank for rank, row in enumerate(chain.changing_rows)} for chain in (match.a, match.b)]
    for row_a, row_b in match.rows.tolist():
        line = ConnectionPatch(
            (begin, ranks[0][row_a] + 0.5), (end, ranks[1][row_b] + 0.5), "data", "data", axesA=axes[0], axesB=axes[1],
            color=SOFT, linewidth=float(np.clip(height_pt / 14, 0.5, 1.4)), arrowstyle="-", capstyle="round",
            gid="row",
        )  # fmt: skip
        line.set_annotation_clip(False)
        figure.add_artist(line)


def _number_columns(ax: Axes, aligned: NDArray[np.int64]) -> None:
    """Number the aligned columns, or mark them where there is no room for numbers."""
    width_pt, height_pt = cell_size_pt(ax)
    for number, column in enumerate(aligned.tolist(), start=1):
        ax.add_patch(
            Rectangle((column + 0.06, -4.2 / height_pt), 0.88, 1.5 / height_pt, color=INK, linewidth=0, clip_on=False)
        )
        if width_pt >= 1.5 * SMALL_PT:
            ax.text(
                column + 0.5, -6.2 / height_pt, str(number), ha="center", va="bottom", fontsize=SMALL_PT, color=INK,
                gid="aligned",
            )  # fmt: skip


def _codes(chain: EventChain, match: Match, row: int) -> NDArray[np.int64]:
    """Relations of a row before and after each column of the temporal input, shape (2, n_columns)."""
    relations = chain.relations[row].astype(np.int64)
    return np.stack([relations[:-1], relations[1:]] if match.temporal_input == "derived" else [relations, relations])


def _agreement(match: Match, *, named: bool) -> Table:
    """The first chain in the aligned columns, without the cells in which the second differs."""
    rows, partner = match.a.changing_rows.tolist(), dict(match.rows.tolist())
    halves = np.full((2, len(rows), max(1, len(match.columns))), -1)
    names = []
    for rank, row in enumerate(rows):
        name = relation_name(match.a.pairs[row])
        if row in partner:
            a = _codes(match.a, match, row)[:, match.columns[:, 0]]
            b = _codes(match.b, match, partner[row])[:, match.columns[:, 1]]
            halves[:, rank, : len(match.columns)] = np.where((a == b).all(axis=0), a, -1)
            name = f"{name} ↔ {relation_name(match.b.pairs[partner[row]])}"
        names.append(name if named else "")
    columns = tuple(str(number + 1) for number in range(len(match.columns))) or ("none",)
    return Table(match.temporal_input, halves[0], halves[1], tuple(names), columns, "aligned columns")


def _finish_agreement(ax: Axes, match: Match, table: Table) -> None:
    """Both codes where the chains differ, and the sum of it all."""
    width_pt, height_pt = cell_size_pt(ax)
    partner = dict(match.rows.tolist())
    rows = match.a.changing_rows.tolist()
    if min(width_pt, height_pt) >= LEAST_CODE_PT:
        for rank, column in np.argwhere(table.before < 0).tolist():
            ax.add_patch(
                Rectangle(
                    (column + 0.06, rank + 0.06), 0.88, 0.88, facecolor=PAPER, edgecolor=LINE, linewidth=0.8, zorder=3
                )
            )
            if rows[rank] in partner and len(match.columns):
                at_a, at_b = match.columns[column]
                a = _codes(match.a, match, rows[rank])[:, at_a]
                b = _codes(match.b, match, partner[rows[rank]])[:, at_b]
                text = f"{a[0]}≠{b[0]}" if table.form == "original" else f"{a[0]}{a[1]}≠{b[0]}{b[1]}"
                size_pt = min(SMALL_PT, 0.3 * width_pt if table.form == "original" else 0.22 * width_pt)
                ax.text(
                    column + 0.5, rank + 0.5, text, ha="center", va="center_baseline", fontsize=size_pt, color=INK,
                    zorder=4, gid="different",
                )  # fmt: skip
    else:
        ax.spines[:].set_visible(True)
    shorter = min(chain.relations.shape[1] - (table.form == "derived") for chain in (match.a, match.b))
    _title(ax, f"{(table.before >= 0).sum()} of {len(rows) * shorter} cells agree", loc="right")
    ax.set_xlabel(f"aligned columns\nψ$_{{temporal}}$ = {match.temporal:.0f} %", fontsize=TEXT_PT, color=SOFT)
