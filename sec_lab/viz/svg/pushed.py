"""What came of a push: the camera's strip, and the executed chain beside the model (Fig. 2.20, 2.21)."""

import html
import textwrap
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sec_lab.event_chain import EventChain
from sec_lab.execution.account import ComparedRow, compared_rows
from sec_lab.viz.cells import Table, table_of
from sec_lab.viz.svg.paper import (
    SMALL_PX,
    Paper,
    data_address,
    draw_cells,
    draw_columns,
    draw_legend,
    note,
    words_px,
)

AGREES_COLOUR, DIFFERS_COLOUR = "#2459ad", "#c4571d"
"""Blue and orange, which no kind of colour blindness mixes up; a mark and a word say the same."""

_PICTURE_PX, _GAP_PX = 184.0, 10.0
_ABOVE_PX, _CELL_PX, _ROW_PX = 34.0, 26.0, 24.0


def strip_svg(pictures: Sequence[ArrayLike], titles: Sequence[str]) -> str:
    """Draw pictures of a camera beside each other, each with its title.

    Parameters
    ----------
    pictures : sequence of (height, width, 3) array_like of uint8
        As many as titles, one at least, all of one size.
    titles : sequence of str

    Returns
    -------
    str
        SVG.

    Raises
    ------
    ValueError
        If there are none, or there is another number of titles.

    Examples
    --------
    >>> strip_svg([np.zeros((4, 5, 3), np.uint8)] * 2, ["start", "end"]).count("<image")
    2
    """
    if not len(pictures) == len(titles) > 0:
        raise ValueError(f"titles: expected one a picture, got {len(titles)} for {len(pictures)}")
    shapes = {np.asarray(picture).shape for picture in pictures}
    if len(shapes) > 1:
        raise ValueError(f"pictures: expected one size, got {sorted(shapes)}")
    height, width = shapes.pop()[:2]
    high = _PICTURE_PX * height / width
    paper = Paper(len(pictures) * (_PICTURE_PX + _GAP_PX), high + 34, label="what the camera saw")
    for number, (picture, title) in enumerate(zip(pictures, titles, strict=True)):
        left = number * (_PICTURE_PX + _GAP_PX)
        for line, part in enumerate(textwrap.wrap(title, 32)[:2]):
            paper.words(left, 7 + 13 * line, part, size_px=SMALL_PX, soft=True)
        paper.picture(left, 30, _PICTURE_PX, high, data_address(picture), data_moment=title)
    return paper.markup()


def pushed_svg(model: EventChain, executed: EventChain | None) -> str:
    """Draw the model and an executed chain, each row of the one beside its row in the other (Fig. 2.21).

    Parameters
    ----------
    model : EventChain
    executed : EventChain or None
        None: nothing was seen.

    Returns
    -------
    str
        SVG; ``data-standing`` of every row says whether it agrees.

    Examples
    --------
    >>> names = {1: "arm", 2: "box", 3: "ball"}
    >>> chain = EventChain([[0, 2, 0], [0, 0, 2]], [(1, 2), (2, 3)], names=names)
    >>> pushed_svg(chain, chain).count('data-standing="agrees"')
    2
    """
    rows = compared_rows(model, executed)
    tables = [None if chain is None else _sorted_table(chain, rows) for chain in (model, executed)]
    names_px = words_px([row.names for row in rows]) + 14
    n_columns = [0 if table is None else table.before.shape[1] for table in tables]
    widths = [max(n * _CELL_PX, 90.0) for n in n_columns]
    starts = [names_px, names_px + widths[0] + 34]
    said_px = starts[1] + widths[1] + 14
    deep = _ABOVE_PX + len(rows) * _ROW_PX
    said = [_said(row) for row in rows]
    paper = Paper(said_px + words_px(said) + 24, deep + 62, label="the executed chain beside the model")
    for start, title in zip(starts, ("model", "executed"), strict=True):
        paper.words(start, 9, title, bold=True)
    for number, row in enumerate(rows):
        y = _ABOVE_PX + (number + 0.5) * _ROW_PX
        is_good, is_extra = row.standing.startswith("agrees"), row.standing == "not in the model"
        colour = AGREES_COLOUR if is_good else DIFFERS_COLOUR
        paper.words(names_px - 6, y, row.names, anchor="end", opacity="0.6" if is_extra else None)
        mark = "·" if is_extra else "✓" if is_good else "✗"
        if not is_extra:
            paper.rect(said_px - 4, y - 9, 17, 17, rx="4", fill=colour, data_standing=row.standing)
        paper.words(said_px + 4.5, y, mark, anchor="middle", bold=True, fill="currentColor" if is_extra else "#ffffff")
        paper.words(said_px + 20, y, said[number], opacity="0.6" if is_extra else None)
    for start, table, chain in zip(starts, tables, (model, executed), strict=True):
        if table is None:
            continue
        draw_cells(paper, table, x=start, y=_ABOVE_PX, cell_px=(_CELL_PX, _ROW_PX))
        names = [""] * table.before.shape[1] if chain is model else table.columns
        title = "columns of the model" if chain is model else "key frame"
        draw_columns(paper, names, x=start, y=deep, width=_CELL_PX, title=title)
    draw_legend(paper, [table for table in tables if table is not None], x=0, y=deep + 46)
    return paper.markup()


def verdicts_html(verdicts: Sequence[tuple[bool, str]]) -> str:
    """Sentences below each other, each with a mark and a colour that say whether it is good.

    Parameters
    ----------
    verdicts : sequence of (bool, str)

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> "✗" in verdicts_html([(True, "good."), (False, "bad.")])
    True
    """
    lines = []
    for is_good, text in verdicts:
        mark, colour = ("✓", AGREES_COLOUR) if is_good else ("✗", DIFFERS_COLOUR)
        badge = f"background:{colour};color:#fff;border-radius:4px;padding:0 4px;margin-right:6px;font-weight:600"
        lines.append(f'<div data-agrees="{is_good}"><span style="{badge}">{mark}</span>{html.escape(text)}</div>')
    return note("".join(lines))


def _said(row: ComparedRow) -> str:
    if row.standing == "differs":
        return f"differs: expected {row.model}, got {row.executed}"
    if row.standing == "missing":
        return f"missing: expected {row.model}"
    return f"{row.standing}: {row.executed}"


def _sorted_table(chain: EventChain, rows: Sequence[ComparedRow]) -> Table:
    """The cells of a chain, with its rows at the places of the compared ones, and no cell where it has no row."""
    table = table_of(chain, form="original", row_names="names")
    places = {row.names: number for number, row in enumerate(rows)}
    shape = len(rows), table.before.shape[1]
    cells = np.full(shape, -1, dtype=np.int64)
    for number, name in enumerate(table.rows):
        cells[places[", ".join(sorted(name.split(", ")))]] = table.before[number]
    return Table("original", cells, cells, ("",) * len(rows), table.columns, table.column_title)
