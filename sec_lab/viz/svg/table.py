"""A table of similarities in which one can point, and what a threshold makes of it (step 6A, §2.7)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import to_rgb

from sec_lab.classification import threshold_errors, type_similar
from sec_lab.codes import as_array
from sec_lab.viz.style import CURVE_COLOURS, SIMILARITY_COLOURS
from sec_lab.viz.svg.match import similarity_colour
from sec_lab.viz.svg.paper import SMALL_PX, TEXT_PX, Paper, data_address, words_px
from sec_lab.viz.tint import strong_colour

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

FALSE_POSITIVE, FALSE_NEGATIVE = "#e2553f", "#f4b63f"
"""Colours of wrong decisions; in small tables crosses and rings tell them apart as well."""

_WIDTH_PX, _STRIP_PX = 660.0, 9.0
_MOST_DRAWN = 40
_KNOWN_COLOURS = len(CURVE_COLOURS)


@dataclass(frozen=True, eq=False)
class TableLayout:
    """Where the cells of a drawn table are; made by :func:`table_layout`.

    Attributes
    ----------
    names : tuple of str
        Of the rows, in the order of the table that was given.
    values : (n, n) float64
        Percent, in the same order.
    classes : tuple of str
        Class of each row in that order; empty where none are known.
    order : (n,) int64
        Row that is drawn at each place: rows of a class stand together.
    cell_px, left_px, top_px : float
    """

    names: tuple[str, ...]
    values: "NDArray[np.float64]"
    classes: tuple[str, ...]
    order: "NDArray[np.int64]"
    cell_px: float
    left_px: float
    top_px: float

    def __post_init__(self) -> None:
        for name in ("values", "order"):
            array = np.array(getattr(self, name))
            array.setflags(write=False)
            object.__setattr__(self, name, array)


def table_layout(
    table: "pd.DataFrame", classes: Sequence[object] | Mapping[object, object] | None = None
) -> TableLayout:
    """Lay out a table of similarities.

    Parameters
    ----------
    table : (n, n) pandas.DataFrame
        Similarities in percent; symmetric, with one name for row and column.
    classes : sequence or mapping, optional
        Class of each row, in the order of the rows or by row name.

    Raises
    ------
    ValueError
        If the table is not a symmetric square of percentages, or there is not one class a row.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame([[100, 20, 60], [20, 100, 30], [60, 30, 100]], list("abc"), list("abc"))
    >>> table_layout(frame, ["put", "take", "put"]).order.tolist()
    [0, 2, 1]
    """
    if not hasattr(table, "columns"):
        raise ValueError(f"table: expected a table with names of rows and columns, got {type(table).__name__}")
    type_similar(table, threshold_percent=0)
    values = as_array(table.to_numpy(), what="table", ndim=2).astype(np.float64)
    wrong = ~((values >= 0) & (values <= 100 + 1e-9))
    if wrong.any():
        raise ValueError(f"table: expected percent from 0 to 100, got {values[wrong][0]:g}")
    names = tuple(map(str, table.index))
    of_row: tuple[str, ...] = ()
    if classes is not None:
        if isinstance(classes, Mapping):
            missing = [name for name in table.index if name not in classes]
            if missing:
                raise ValueError(f"classes: expected a class for every row, got none for {missing[0]!r}")
            of_row = tuple(str(classes[name]) for name in table.index)
        else:
            of_row = tuple(map(str, classes))
        # Says what is wrong with classes, and with a table that is not symmetric.
        threshold_errors(values, of_row, thresholds_percent=50)
    present = list(dict.fromkeys(of_row))
    order = np.argsort([present.index(one) for one in of_row], kind="stable") if of_row else np.arange(len(names))
    cell = float(np.clip(_WIDTH_PX / len(names), 3, 34))
    named = len(names) <= _MOST_DRAWN
    left = (words_px(names) + 10 if named else 6.0) + (_STRIP_PX + 3 if of_row else 0.0)
    top = (0.72 * words_px(names) + 20 if named else 6.0) + (_STRIP_PX + 3 if of_row else 0.0) + 20.0
    return TableLayout(names, values, of_row, order, cell, left, top)


def cell_at(layout: TableLayout, x: float, y: float) -> tuple[int, int] | None:
    """Row and column, in the order of the table that was given, at a place of the drawing; None beside the cells.

    Examples
    --------
    >>> import pandas as pd
    >>> layout = table_layout(pd.DataFrame([[100, 20], [20, 100]], list("ab"), list("ab")))
    >>> cell_at(layout, layout.left_px + 1.5 * layout.cell_px, layout.top_px + 1), cell_at(layout, 0, 0)
    ((0, 1), None)
    """
    column, row = (
        int(np.floor((at - begin) / layout.cell_px)) for at, begin in ((x, layout.left_px), (y, layout.top_px))
    )
    n = len(layout.names)
    if not (0 <= row < n and 0 <= column < n):
        return None
    return int(layout.order[row]), int(layout.order[column])


def moved(layout: TableLayout, cell: tuple[int, int], *, down: int = 0, right: int = 0) -> tuple[int, int]:
    """The cell so many places below and right of another one in the drawing, as far as the table goes.

    Examples
    --------
    >>> import pandas as pd
    >>> layout = table_layout(pd.DataFrame([[100, 20], [20, 100]], list("ab"), list("ab")))
    >>> moved(layout, (0, 0), right=1), moved(layout, (0, 0), down=-1)
    ((0, 1), (0, 0))
    """
    last = len(layout.names) - 1
    place = np.argsort(layout.order)
    row, column = (
        min(max(int(place[at]) + step, 0), last) for at, step in zip(cell, (down, right), strict=True)
    )  # fmt: skip
    return int(layout.order[row]), int(layout.order[column])


def wrong_decisions(layout: TableLayout, threshold_percent: float) -> "NDArray[np.int64]":
    """Which pairs a threshold decides wrongly, (n, n) int64: 1 false positives, −1 false negatives, 0 the others."""
    similar = type_similar(layout.values, threshold_percent=threshold_percent)
    wrong = np.zeros(similar.shape, np.int64)
    if layout.classes:
        types = np.array(layout.classes)
        same = types[:, np.newaxis] == types
        wrong[similar & ~same] = 1
        wrong[~similar & same] = -1
        np.fill_diagonal(wrong, 0)
    return wrong


def table_words(layout: TableLayout, threshold_percent: float) -> str:
    """What a threshold decides, in one sentence.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame([[100, 20, 60], [20, 100, 30], [60, 30, 100]], list("abc"), list("abc"))
    >>> table_words(table_layout(frame, ["put", "take", "put"]), 25).partition("; ")[2]
    '0 false negatives (of 1 pair of one class), 1 false positive (of 2 pairs of two classes)'
    """
    n = len(layout.names)
    similar = type_similar(layout.values, threshold_percent=threshold_percent)
    n_similar, n_pairs = int(np.triu(similar, 1).sum()), _many(n * (n - 1) // 2, "pair")
    said = f"threshold {threshold_percent:g} %: {n_similar} of {n_pairs} are similar"
    if not layout.classes:
        return f"{said}; no classes are known"
    errors = threshold_errors(layout.values, layout.classes, thresholds_percent=threshold_percent)
    negative, positive = errors[["false_negatives", "false_positives"]].iloc[0].tolist()
    same, different = (_many(errors.attrs[kind], "pair") for kind in ("same_type", "different_types"))
    return (
        f"{said}; {_many(negative, 'false negative')} (of {same} of one class), "
        f"{_many(positive, 'false positive')} (of {different} of two classes)"
    )


def class_colours(classes: Sequence[str]) -> dict[str, str]:
    """Colour of each class, in the order of first appearance."""
    colours: dict[str, str] = {}
    for name in dict.fromkeys(classes):
        number = len(colours)
        if number < _KNOWN_COLOURS:
            colours[name] = CURVE_COLOURS[number]
        else:
            red, green, blue = strong_colour(number - _KNOWN_COLOURS + 1)
            colours[name] = f"#{red:02x}{green:02x}{blue:02x}"
    return colours


def table_svg(
    layout: TableLayout, *, threshold_percent: float | None = None, chosen: tuple[int, int] | None = None
) -> str:
    """Draw a table of similarities: classes at its edges, wrong decisions marked, one cell with a frame.

    Parameters
    ----------
    layout : TableLayout
    threshold_percent : float, optional
        Pairs that it decides wrongly are marked, if classes are known.
    chosen : tuple of two int, optional
        Cell with a frame, in the order of the table that was given.

    Returns
    -------
    str
        SVG.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame([[100, 20, 60], [20, 100, 30], [60, 30, 100]], list("abc"), list("abc"))
    >>> table_svg(table_layout(frame, ["put", "take", "put"]), threshold_percent=25).count("data-decision")
    2
    """
    n, cell, left, top = len(layout.names), layout.cell_px, layout.left_px, layout.top_px
    ordered = layout.values[np.ix_(layout.order, layout.order)]
    wrong = np.zeros((n, n), np.int64)
    if threshold_percent is not None:
        wrong = wrong_decisions(layout, threshold_percent)[np.ix_(layout.order, layout.order)]
    slant = 0.72 * words_px(layout.names) if n <= _MOST_DRAWN else 0.0
    below = 44.0 if layout.classes else 24.0
    paper = Paper(
        max(left + n * cell + slant + 10, 420.0), top + n * cell + below, label="similarities of all pairs in percent"
    )
    if layout.classes:
        _draw_classes(paper, layout)
    if n <= _MOST_DRAWN:
        _draw_cells(paper, layout, ordered, wrong)
    else:
        paper.picture(
            left, top, n * cell, n * cell, data_address(_pixels(ordered, wrong)), preserveAspectRatio="none",
            style="image-rendering:pixelated", data_table=str(n),
        )  # fmt: skip
    if chosen is not None:
        place = np.argsort(layout.order)
        x, y = left + place[chosen[1]] * cell, top + place[chosen[0]] * cell
        paper.rect(x - 1, y - 1, cell + 1, cell + 1, fill="none", stroke="#ffffff", stroke_width="4")
        paper.rect(x - 1, y - 1, cell + 1, cell + 1, fill="none", stroke="#e2553f", stroke_width="2", data_chosen="1")
    foot = top + n * cell + 14
    paper.words(0, foot, "similarity in %, dark is high", size_px=SMALL_PX, soft=True)
    if layout.classes:
        _mark(paper, 6, foot + 17, 8, 1, on_dark=False, attribute="data_legend")
        paper.words(16, foot + 17, "false positive", size_px=SMALL_PX, soft=True)
        _mark(paper, 106, foot + 17, 8, -1, on_dark=False, attribute="data_legend")
        paper.words(116, foot + 17, "false negative", size_px=SMALL_PX, soft=True)
    return paper.markup()


def _draw_classes(paper: Paper, layout: TableLayout) -> None:
    colours = class_colours(layout.classes)
    x = 0.0
    for name, colour in colours.items():
        paper.rect(x, 2, 12, 12, fill=colour, data_class=name)
        paper.words(x + 17, 8, name)
        x += 17 + words_px([name]) + 14
    for place, row in enumerate(layout.order.tolist()):
        colour, cell = colours[layout.classes[row]], layout.cell_px
        paper.rect(layout.left_px - _STRIP_PX - 3, layout.top_px + place * cell, _STRIP_PX, cell, fill=colour)
        paper.rect(layout.left_px + place * cell, layout.top_px - _STRIP_PX - 3, cell, _STRIP_PX, fill=colour)


def _draw_cells(
    paper: Paper, layout: TableLayout, values: "NDArray[np.float64]", wrong: "NDArray[np.int64]"
) -> None:  # fmt: skip
    cell, left, top = layout.cell_px, layout.left_px, layout.top_px
    names = [layout.names[row] for row in layout.order]
    beside = _STRIP_PX + 9 if layout.classes else 6.0
    size = min(TEXT_PX, 0.8 * cell)
    for i, row in enumerate(values.tolist()):
        y = top + i * cell
        paper.words(left - beside, y + cell / 2, names[i], size_px=size, anchor="end")
        at = left + (i + 0.5) * cell
        paper.words(
            at, top - beside - 4, names[i], size_px=size, transform=f"rotate(-45 {at:.1f} {top - beside - 4:.1f})"
        )
        for j, value in enumerate(row):
            x = left + j * cell
            paper.rect(x, y, cell - 1, cell - 1, fill=similarity_colour(value), data_cell=f"{names[i]}|{names[j]}")
            if cell >= 20:
                paper.words(
                    x + cell / 2 - 0.5, y + cell / 2 + 0.5, f"{value:.0f}", size_px=SMALL_PX, anchor="middle",
                    fill="#ffffff" if value > 55 else "#22262c",
                )  # fmt: skip
            if wrong[i, j]:
                _mark(paper, x + cell - 6, y + 5, min(8.0, 0.5 * cell), int(wrong[i, j]), on_dark=value > 55)


def _mark(
    paper: Paper, x: float, y: float, size: float, kind: int, *, on_dark: bool, attribute: str = "data_decision"
) -> None:  # fmt: skip
    half = size / 2
    if kind > 0:
        corners = [(x - half, y - half), (x + half, y + half), (x - half, y + half), (x + half, y - half)]
        way = "".join(f"{letter}{px:.1f} {py:.1f}" for letter, (px, py) in zip("MLML", corners, strict=True))
        colour = "#ff9d8c" if on_dark else FALSE_POSITIVE
        paper.path(way, **{"stroke": colour, "stroke_width": "2", attribute: "false positive"})
    else:
        colour = FALSE_NEGATIVE if on_dark else "#a86f00"
        paper.circle(
            x, y, half - 0.5, fill="none", **{"stroke": colour, "stroke_width": "2", attribute: "false negative"}
        )


def _pixels(values: "NDArray[np.float64]", wrong: "NDArray[np.int64]") -> "NDArray[np.uint8]":
    """A pixel for each cell of a table that is too large for rectangles; wrong decisions have colours of their own."""
    colours = SIMILARITY_COLOURS(np.clip(values / 100, 0, 1))[..., :3]
    colours[wrong > 0], colours[wrong < 0] = to_rgb(FALSE_POSITIVE), to_rgb(FALSE_NEGATIVE)
    return np.asarray(np.round(255 * colours), np.uint8)


def _many(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
