"""Tables of coloured cells, which event chains are drawn as (Fig. 2.5 d–f)."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast, get_args

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation, as_integers, as_relations
from sec_lab.event_chain import EventChain
from sec_lab.viz.style import (
    CODE_COLOUR,
    INK,
    PAPER,
    RELATION_COLOUR,
    RELATION_WORD,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    figure_of,
    rgb,
    text_width_in,
    tidy,
)

ChainForm = Literal["original", "derived", "compressed"]
RowNames = Literal["relations", "names"]
ChainArray = ArrayLike | Sequence[ArrayLike]

# Codes are legible in cells of at least this size, and names in rows of at least that height.
LEAST_CODE_PT, _LEAST_NAME_PT = 9.0, 6.5


@dataclass(frozen=True, eq=False)
class Table:
    """A chain in one of its forms, ready to be drawn.

    Attributes
    ----------
    form : {"original", "derived", "compressed"}
    before, after : (n_rows, n_columns) int64
        Relations in the left and the right half of each cell; equal in ξ_o, −1 where there is no cell.
    rows, columns : tuple of str
        Names, one each.
    column_title : str
        What the columns are.
    """

    form: ChainForm
    before: NDArray[np.int64]
    after: NDArray[np.int64]
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    column_title: str

    def __post_init__(self) -> None:
        for field in ("before", "after"):
            half = np.array(getattr(self, field), dtype=np.int64)
            half.setflags(write=False)
            object.__setattr__(self, field, half)


def relation_name(pair: ArrayLike) -> str:
    """Name of a row as in the thesis.

    Examples
    --------
    >>> relation_name((2, 1))
    'ρ2,1'
    """
    i, j = np.asarray(pair).tolist()
    return f"ρ{i},{j}"


def typeset(name: str) -> str:
    r"""The name of a relation with its subscript, any other name as it is, for matplotlib.

    Examples
    --------
    >>> typeset("ρ2,1"), typeset("US$ and CA$")
    ('ρ$_{2{,}1}$', 'US\\$ and CA\\$')
    """
    escaped = name.replace("$", r"\$")
    return re.sub(r"ρ(\d+), ?(\d+)", r"ρ$_{\1{,}\2}$", escaped)


def table_of(
    chain: EventChain | ChainArray,
    *,
    form: ChainForm,
    changing_only: bool = False,
    row_names: RowNames = "relations",
) -> Table:
    """What :func:`draw_chain` draws; parameters and errors are described there."""
    if form not in get_args(ChainForm):
        raise ValueError(f"form: expected one of {get_args(ChainForm)}, got {form!r}")
    if row_names not in get_args(RowNames):
        raise ValueError(f"row_names: expected one of {get_args(RowNames)}, got {row_names!r}")
    if not isinstance(chain, EventChain):
        before, after = _halves_of_array(chain, form)
        rows, columns = ([str(number + 1) for number in range(length)] for length in before.shape)
        return Table(form, before, after, tuple(rows), tuple(columns), "column")
    shown = np.arange(len(chain.pairs)) if form == "original" and not changing_only else chain.changing_rows
    if not len(shown) or (form != "original" and chain.relations.shape[1] < 2):
        raise ValueError("event chain: expected a row that changes, got none")
    names = [chain.row_label(row) if row_names == "names" else relation_name(chain.pairs[row]) for row in shown]
    frames = [str(frame) for frame in chain.key_frames.tolist()]
    if form == "original":
        codes = chain.relations[shown].astype(np.int64)
        return Table(form, codes, codes, tuple(names), tuple(frames), "key frame")
    if form == "derived":
        before, after = _halves_of_changes(chain.derived.astype(np.int64))
        return Table(form, before, after, tuple(names), tuple(frames[1:]), "change at key frame")
    before, after = _halves_of_array(chain.compressed, form)
    return Table(form, before, after, tuple(names), tuple(str(i + 1) for i in range(before.shape[1])), "change")


def draw_table(ax: Axes, table: Table, *, title: str | None = None) -> None:
    """Draw cells, codes and names into axes."""
    n_rows, n_columns = table.before.shape
    ax.imshow(_image(table), extent=(0, n_columns, n_rows, 0), aspect="auto", interpolation="nearest", zorder=1)
    tidy(ax, title=title)
    ax.tick_params(length=0)
    for spine in ax.spines.values():
        spine.set_visible(False)
    ax.set(xlim=(0, n_columns), ylim=(n_rows, 0))
    width_pt, height_pt = cell_size_pt(ax)
    gap_pt = min(1.6, 0.1 * min(width_pt, height_pt))
    ax.hlines(np.arange(n_rows + 1), 0, n_columns, colors=PAPER, linewidth=gap_pt, zorder=2)
    ax.vlines(np.arange(n_columns + 1), 0, n_rows, colors=PAPER, linewidth=gap_pt, zorder=2)
    _print_codes(ax, table, min(width_pt if table.form == "original" else width_pt / 1.3, height_pt))
    name_pt = min(TEXT_PT, 0.72 * height_pt)
    if name_pt >= _LEAST_NAME_PT:
        names = [typeset(name) for name in table.rows]
        ax.set_yticks(np.arange(n_rows) + 0.5, names, fontsize=name_pt)
    else:
        ax.set_yticks([])
        ax.set_ylabel(f"{n_rows} relations", fontsize=TEXT_PT, color=INK)
    needed_pt = 0.68 * SMALL_PT * max(len(name) for name in table.columns) + 3
    step = max(1, int(np.ceil(needed_pt / width_pt)))
    ax.set_xticks(np.arange(0, n_columns, step) + 0.5, table.columns[::step], fontsize=SMALL_PT)
    ax.set_xlabel(table.column_title, fontsize=TEXT_PT, color=SOFT)


def cell_size_pt(ax: Axes) -> tuple[float, float]:
    """Width and height of a unit of the axes in points."""
    figure = figure_of(ax)
    box = ax.get_window_extent()
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    return box.width / abs(right - left) * 72 / figure.dpi, box.height / abs(top - bottom) * 72 / figure.dpi


def names_width_in(names: Sequence[str]) -> float:
    """Room that row names need, in inches."""
    # The few longest ones decide.
    longest = sorted(names, key=len)[-8:]
    return 0.13 + max(text_width_in(typeset(name), size_pt=TEXT_PT) for name in longest)


def cell_handles(tables: Sequence[Table]) -> list[Patch]:
    """Patches for a legend of the relations that occur in tables."""
    present = [one for one in Relation if any(one in table.before or one in table.after for table in tables)]
    return [Patch(facecolor=RELATION_COLOUR[one], label=f"{int(one)} {RELATION_WORD[one]}") for one in present]


def _halves_of_array(values: ChainArray, form: ChainForm) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Relations before and after in every cell, −1 where a row of ξ_c has ended."""
    if form == "original":
        codes = as_relations(cast("ArrayLike", values), what="event chain", ndim=2).astype(np.int64)
        before, after = codes, codes
    elif form == "derived":
        before, after = _halves_of_changes(as_integers(cast("ArrayLike", values), what="event chain", ndim=2))
    else:
        rows = [as_integers(row, what="event chain", ndim=1) for row in cast("Sequence[ArrayLike]", values)]
        before, after = np.full((2, len(rows), max((len(row) for row in rows), default=0)), -1)
        for i, row in enumerate(rows):
            before[i, : len(row)], after[i, : len(row)] = _halves_of_changes(row)
    if not before.size:
        raise ValueError(f"event chain: expected at least one row and one column, got shape {before.shape}")
    return before, after


def _halves_of_changes(changes: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    before, after = np.divmod(changes, 10)
    for half in (before, after):
        as_relations(half, what="event chain")
    return before, after


def _image(table: Table) -> NDArray[np.float64]:
    """RGB image with two pixels a cell, one for each half."""
    halves = np.stack([table.before, table.after], axis=2)
    image = np.ones((*halves.shape, 3))
    for relation, colour in RELATION_COLOUR.items():
        image[halves == relation] = rgb(colour)
    if table.form != "original":
        same = table.before == table.after
        image[same] = 1.0 - 0.22 * (1.0 - image[same])
    return image.reshape(len(image), -1, 3)


def _print_codes(ax: Axes, table: Table, size_pt: float) -> None:
    if size_pt < LEAST_CODE_PT:
        return
    code_pt = min(1.05 * TEXT_PT, 0.6 * size_pt)
    for row, column in np.argwhere(table.before >= 0).tolist():
        before, after = Relation(table.before[row, column]), Relation(table.after[row, column])
        if table.form == "original":
            codes = [(0.5, before, CODE_COLOUR[before])]
        elif before == after:
            codes = [(place, before, SOFT) for place in (0.27, 0.73)]
        else:
            codes = [(0.27, before, CODE_COLOUR[before]), (0.73, after, CODE_COLOUR[after])]
        for place, code, colour in codes:
            ax.text(
                column + place, row + 0.5, str(int(code)), ha="center", va="center_baseline", fontsize=code_pt,
                color=colour, zorder=3,
            )  # fmt: skip
