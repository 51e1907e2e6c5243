"""Two chains side by side with all that step 5 found about them (§2.6, Tables 2.1 and 2.2)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import to_hex

from sec_lab.event_chain import EventChain
from sec_lab.roles import corresponding_segments
from sec_lab.similarity import Match, Permutation, permutations
from sec_lab.viz.cells import RowNames, Table, relation_name, table_of
from sec_lab.viz.style import SIMILARITY_COLOURS
from sec_lab.viz.svg.paper import (
    SMALL_PX,
    SOFT_OPACITY,
    TEXT_PX,
    Paper,
    draw_cells,
    draw_columns,
    draw_legend,
    words_px,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_PERMUTATIONS = 100
"""Permutations of a match that are listed; there may be thousands."""

_WIDTH_PX, _JOIN_PX, _ABOVE_PX, _BELOW_PX = 960.0, 64.0, 46.0, 67.0
_PICTURE_PX, _MOST_PRINTED = 56.0, 24
_ROWS_EXPLAINED = "dot: may correspond (mutually best) · frame: corresponds"
_EQUAL_PERCENT = 1e-9


def listed_permutations(match: Match, *, most: int = MOST_PERMUTATIONS) -> tuple[list[Permutation], bool]:
    """Permutations that the spatial step leaves, the best one first, and whether these are all (Table 2.2).

    Parameters
    ----------
    match : Match
    most : int, optional
        Where there are more, only the one that was chosen is given.

    Examples
    --------
    >>> from sec_lab.similarity import compare
    >>> twice = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (2, 3)])
    >>> found, are_all = listed_permutations(compare(twice, twice))
    >>> [round(one.temporal) for one in found], are_all
    ([100, 67], True)
    """
    chosen = Permutation(match.rows, match.columns, match.temporal)
    try:
        found = permutations(match, limit=most)
    except ValueError:
        return [chosen], False
    # Of equally good ones the chosen one comes first, wherever it stands in the list.
    others = [one for one in found if not np.array_equal(one.rows, chosen.rows)]
    return [chosen, *sorted(others, key=lambda one: -one.temporal)], True


def with_permutation(match: Match, permutation: Permutation) -> Match:
    """The match as it would be with another permutation of rows."""
    return replace(match, rows=permutation.rows, columns=permutation.columns, temporal=permutation.temporal)


def agreement(match: Match) -> tuple["NDArray[np.bool_]", "NDArray[np.bool_]"]:
    """Where chains agree: cells of both that are aligned and equal, and those that are aligned and differ (Eq. 2.9).

    Parameters
    ----------
    match : Match

    Returns
    -------
    equal : (m, u) bool
        By changing row and column of the temporal input of ``match.a``. ψ_temporal is their number over m · min(u, v).
    different : (m, u) bool

    Examples
    --------
    >>> from sec_lab.similarity import compare
    >>> a, b = (EventChain([[0, 2, 0], [0, last, 2]], [(1, 2), (2, 3)]) for last in (2, 0))
    >>> [where.sum() for where in agreement(compare(a, b))]
    [np.int64(5), np.int64(1)]
    """
    tables = _tables(match, "relations")
    return _agreement(match, tables)[0]


def match_svg(match: Match, *, row_names: RowNames = "relations", titles: tuple[str, str] = ("ξ¹", "ξ²")) -> str:
    """Draw two chains side by side, their corresponding rows joined and their aligned columns numbered.

    Cells that agree are full, those that differ have a frame, those that are not aligned are pale.

    Parameters
    ----------
    match : Match
        Of :func:`~sec_lab.similarity.compare` or :func:`with_permutation`.
    row_names : {"relations", "names"}, optional
        Rows are called ρ2,1, or by the names of their segments.
    titles : tuple of two str, optional

    Returns
    -------
    str
        SVG.

    Raises
    ------
    ValueError
        If the choice of names is unknown.

    Examples
    --------
    >>> from sec_lab.similarity import compare
    >>> chain = EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)])
    >>> match_svg(compare(chain, chain)).count("data-row")
    2
    """
    tables = _tables(match, row_names)
    names = [words_px(table.rows) + 14 for table in tables]
    n_columns = [len(table.columns) for table in tables]
    free = _WIDTH_PX - sum(names) - _JOIN_PX
    width = float(np.clip(free / sum(n_columns), 7, 26 if match.temporal_input == "original" else 34))
    height = float(np.clip(560 / max(len(table.rows) for table in tables), 6, 24))
    starts = [names[0], names[0] + n_columns[0] * width + _JOIN_PX + names[1]]
    whole = max(starts[1] + n_columns[1] * width + 8, 560.0)
    deep = _ABOVE_PX + height * max(len(table.rows) for table in tables)
    paper = Paper(whole, deep + _BELOW_PX, label=f"{titles[0]} and {titles[1]}: corresponding rows are joined")
    equal, different = zip(*_agreement(match, tables), strict=True)
    for side, table in enumerate(tables):
        paper.words(starts[side], 9, titles[side], bold=True)
        for number, column in enumerate(match.columns[:, side].tolist(), start=1):
            paper.rect(
                starts[side] + column * width + 1, _ABOVE_PX - 5, width - 3, 2, fill="currentColor", data_aligned="1"
            )
            if width >= 13:
                at = starts[side] + (column + 0.5) * width
                paper.words(at, _ABOVE_PX - 14, str(number), size_px=SMALL_PX, anchor="middle", soft=True)
        draw_cells(
            paper, table, x=starts[side], y=_ABOVE_PX, cell_px=(width, height),
            faded=~(equal[side] | different[side]), outlined=different[side],
        )  # fmt: skip
        bottom = _ABOVE_PX + len(table.rows) * height
        draw_columns(paper, table.columns, x=starts[side], y=bottom, width=width, title=table.column_title)
    ranks = [{int(row): rank for rank, row in enumerate(chain.changing_rows)} for chain in (match.a, match.b)]
    begin, end = starts[0] + n_columns[0] * width + 3, starts[1] - names[1]
    for row_a, row_b in match.rows.tolist():
        from_y, to_y = (_ABOVE_PX + (ranks[side][row] + 0.5) * height for side, row in enumerate((row_a, row_b)))
        middle = (begin + end) / 2
        way = f"M{begin:.1f} {from_y:.1f}C{middle:.1f} {from_y:.1f} {middle:.1f} {to_y:.1f} {end:.1f} {to_y:.1f}"
        paper.path(way, data_row=f"{row_a}-{row_b}", stroke_width="1.4", opacity=SOFT_OPACITY)
    draw_legend(paper, tables, x=0, y=deep + 42)
    explained = "full: agree · framed: differ · pale: not aligned, or no partner"
    paper.words(0, deep + 57, explained, size_px=SMALL_PX, soft=True)
    return paper.markup()


def row_similarity_svg(match: Match, *, row_names: RowNames = "relations") -> str:
    """Draw the table of row similarities; candidates have a dot, the rows that correspond a frame (Table 2.1).

    Parameters
    ----------
    match : Match
    row_names : {"relations", "names"}, optional

    Returns
    -------
    str
        SVG.

    Examples
    --------
    >>> from sec_lab.similarity import compare
    >>> chain = EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)])
    >>> drawn = row_similarity_svg(compare(chain, chain))
    >>> drawn.count("data-similarity"), drawn.count("data-chosen")
    (4, 2)
    """
    rows, columns = (_row_names(chain, row_names) for chain in (match.a, match.b))
    m, k = match.row_similarity.shape
    cell = float(np.clip(620 / max(m, k), 5, 34))
    named = cell >= 10
    left = words_px(rows) + 12 if named else 20.0
    above = 0.72 * words_px(columns) + 22 if named else 20.0
    slant = 0.72 * words_px(columns) if named else 0.0
    wide = max(left + k * cell + slant, words_px([_ROWS_EXPLAINED], size_px=SMALL_PX))
    paper = Paper(wide + 12, above + m * cell + 34, label="similarity of rows in percent")
    paper.words(0, 8, "similarity of rows ζ in %", size_px=SMALL_PX, soft=True)
    low = match.row_similarity.tolist()
    candidates = match.candidates
    ranks = [{int(row): rank for rank, row in enumerate(chain.changing_rows)} for chain in (match.a, match.b)]
    chosen = {(ranks[0][a], ranks[1][b]) for a, b in match.rows.tolist()}
    for i in range(m):
        y = above + i * cell
        if named:
            paper.words(left - 6, y + cell / 2, rows[i], size_px=min(TEXT_PX, 0.8 * cell), anchor="end")
        for j in range(k):
            x, value = left + j * cell, low[i][j]
            paper.rect(
                x, y, cell - 1, cell - 1, fill=similarity_colour(value),
                **({"data-similarity": f"{value:.0f}"} if cell < 22 else {}),
            )  # fmt: skip
            dark = "#ffffff" if value > 55 else "#22262c"
            if cell >= 22:
                paper.words(
                    x + cell / 2 - 0.5, y + cell / 2 + 0.5, f"{value:.0f}", size_px=SMALL_PX, anchor="middle",
                    fill=dark, data_similarity=f"{value:.0f}",
                )  # fmt: skip
            if candidates[i, j]:
                paper.circle(x + cell - 5, y + 4, min(2.0, cell / 6), fill=dark, data_candidate="1")
            if (i, j) in chosen:
                paper.rect(x, y, cell - 1, cell - 1, fill="none", stroke="#e2553f", stroke_width="2.5", data_chosen="1")
    if named:
        for j, name in enumerate(columns):
            x = left + (j + 0.5) * cell
            turn = f"rotate(-45 {x:.1f} {above - 8:.1f})"
            paper.words(x, above - 8, name, size_px=min(TEXT_PX, 0.8 * cell), transform=turn)
    paper.words(0, above + m * cell + 18, _ROWS_EXPLAINED, size_px=SMALL_PX, soft=True)
    return paper.markup()


def roles_svg(match: Match, *, pictures: tuple[Mapping[int, str], Mapping[int, str]] = ({}, {})) -> str:
    """Draw which segments play the same role, as pairs of pictures where there are pictures (§2.8).

    Parameters
    ----------
    match : Match
    pictures : tuple of two mapping of int to str, optional
        Address of the picture of a segment, see :func:`~sec_lab.viz.svg.paper.data_address`; for each of the chains.

    Returns
    -------
    str
        SVG.

    Examples
    --------
    >>> from sec_lab.similarity import compare
    >>> chain = EventChain([[0, 2, 2], [0, 0, 2], [2, 0, 0]], [(1, 2), (2, 3), (1, 3)], names={1: "hand"})
    >>> "hand" in roles_svg(compare(chain, chain))
    True
    """
    pairs = list(corresponding_segments(match, on_tie="omit").items())
    names = [
        [_segment_name(chain, pair[side]) for pair in pairs] for side, chain in enumerate((match.a, match.b))
    ]  # fmt: skip
    shown = any(pair[side] in pictures[side] for pair in pairs for side in (0, 1))
    cell = max(2 * _PICTURE_PX + 22 if shown else 0.0, words_px([*names[0], *names[1]]) + 16, 90.0)
    per_row = max(1, int(_WIDTH_PX // cell))
    deep = (_PICTURE_PX + 8 if shown else 0.0) + 38
    n_rows = max(1, -(-len(pairs) // per_row))
    paper = Paper(min(max(len(pairs), 4), per_row) * cell, 20 + n_rows * deep, label="segments that play the same role")
    counted = f"{len(pairs)} pair{'s' if len(pairs) != 1 else ''} of segments"
    said = f"roles: {counted}" if pairs else "roles: no segment clearly plays the same one"
    paper.words(0, 8, said, size_px=SMALL_PX, soft=True)
    for number, pair in enumerate(pairs):
        x, y = (number % per_row) * cell, 22 + (number // per_row) * deep
        if shown:
            for side in (0, 1):
                place = x + side * (_PICTURE_PX + 8)
                paper.rect(
                    place, y, _PICTURE_PX, _PICTURE_PX, rx="4", fill="none", stroke="currentColor", opacity="0.35"
                )
                if pair[side] in pictures[side]:
                    paper.picture(place + 2, y + 2, _PICTURE_PX - 4, _PICTURE_PX - 4, pictures[side][pair[side]])
            y += _PICTURE_PX + 8
        paper.words(x, y + 4, names[0][number], data_role=f"{pair[0]}-{pair[1]}")
        paper.words(x, y + 19, f"≈ {names[1][number]}", soft=True)
    return paper.markup()


def match_words(match: Match, listed: list[Permutation], *, place: int, are_all: bool) -> str:
    """What step 5 found, in one sentence.

    Examples
    --------
    >>> from sec_lab.similarity import compare
    >>> twice = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (2, 3)])
    >>> match = compare(twice, twice)
    >>> found, are_all = listed_permutations(match)
    >>> match_words(match, found, place=0, are_all=are_all)
    'ψ_spatial 100 %, ψ_temporal 100 % (6 of 6 cells agree); permutation 1 of 2, the best'
    """
    equal, _ = agreement(match)
    agree = f"{int(equal.sum())} of {_n_cells(match)} cells agree"
    said = f"ψ_spatial {match.spatial:.0f} %, ψ_temporal {match.temporal:.0f} % ({agree})"
    if not are_all:
        said += f"; the best of more than {MOST_PERMUTATIONS} permutations"
        said += "" if match.exact else ", as far as was searched"
    elif len(listed) == 1:
        said += "; the only permutation"
    else:
        said += f"; permutation {place + 1} of {len(listed)}"
        best = listed[0].temporal
        said += ", the best" if listed[place].temporal >= best - _EQUAL_PERCENT else f", the best has {best:.0f} %"
    return said


def similarity_colour(percent: float) -> str:
    """Colour of a similarity in percent."""
    return _COLOURS[round(min(max(percent, 0.0), 100.0))]


def _tables(match: Match, row_names: RowNames) -> list[Table]:
    form = match.temporal_input
    return [table_of(chain, form=form, changing_only=True, row_names=row_names) for chain in (match.a, match.b)]


def _agreement(
    match: Match, tables: list[Table]
) -> list[tuple["NDArray[np.bool_]", "NDArray[np.bool_]"]]:  # fmt: skip
    """Equal and different cells of both chains."""
    places = [np.searchsorted(chain.changing_rows, match.rows[:, i]) for i, chain in enumerate((match.a, match.b))]
    grids = [np.ix_(places[side], match.columns[:, side]) for side in (0, 1)]
    same = np.logical_and(
        tables[0].before[grids[0]] == tables[1].before[grids[1]],
        tables[0].after[grids[0]] == tables[1].after[grids[1]],
    )
    found = []
    for table, grid in zip(tables, grids, strict=True):
        equal, different = np.zeros((2, *table.before.shape), np.bool_)
        equal[grid], different[grid] = same, ~same
        found.append((equal, different))
    return found


def _n_cells(match: Match) -> int:
    """Cells that could agree: the denominator of Eq. 2.9."""
    shorter = min(chain.relations.shape[1] for chain in (match.a, match.b)) - (match.temporal_input == "derived")
    return int(len(match.row_similarity) * shorter)


def _row_names(chain: EventChain, row_names: RowNames) -> list[str]:
    rows = chain.changing_rows.tolist()
    return [chain.row_label(row) if row_names == "names" else relation_name(chain.pairs[row]) for row in rows]


def _segment_name(chain: EventChain, segment: int) -> str:
    name = chain.names.get(segment)
    return f"{segment} {name}" if name else f"segment {segment}"


_COLOURS = [to_hex(SIMILARITY_COLOURS(percent / 100)) for percent in range(101)]
