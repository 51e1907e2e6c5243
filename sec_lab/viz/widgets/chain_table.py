"""The event chain as a picture that knows which cell lies where (Fig. 2.5 d)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.viz.lettering import fitted, font
from sec_lab.viz.style import CODE_COLOUR, RELATION_COLOUR, RELATION_WORD

# Pictures are drawn at twice their size on the page, for fine displays.
FINE = 2
_CELL_HIGH, _CELL_WIDE, _LEAST_WIDE = 24 * FINE, 34 * FINE, 8 * FINE
_TEXT, _SMALL, _MARGIN = 13 * FINE, 11 * FINE, 6 * FINE
_MOST_ROWS = 60


@dataclass(frozen=True)
class Theme:
    """Colours of paper and ink, for pages that are light or dark."""

    paper: str
    ink: str
    soft: str
    lit: str


LIGHT = Theme("#ffffff", "#22262c", "#5f6670", "#1b7f4b")
DARK = Theme("#15181d", "#e3e5e8", "#a3abb5", "#5fd394")


class ChainTable:
    """Draws the rows of a chain in which something happens, lights one column and one row, and says what lies where.

    Parameters
    ----------
    chain : EventChain or None
        None: there are fewer than two segments.
    width_px : int
        Greatest width on the page.
    theme : Theme, optional

    Attributes
    ----------
    rows : (n,) ndarray of int
        Row of the chain that each row of the picture shows.

    Examples
    --------
    >>> table = ChainTable(EventChain([[0, 2], [1, 1]], [(2, 1), (3, 1)], [0, 17]), width_px=400)
    >>> picture = table.draw(column=1)
    >>> table.rows, picture.shape[1] <= 800
    (array([0]), True)
    >>> x, y = table.centre_of(0, 1)
    >>> table.cell_at(x, y), table.cell_at(1, y), table.cell_at(x, 1)
    ((0, 1), (0, None), (None, 1))
    """

    def __init__(self, chain: EventChain | None, *, width_px: int, theme: Theme = LIGHT) -> None:
        self._width, self._theme = FINE * width_px, theme
        self.rows = np.zeros(0, dtype=np.intp) if chain is None else chain.changing_rows[:_MOST_ROWS]
        self._n_more = 0 if chain is None else len(chain.changing_rows) - len(self.rows)
        self._codes = np.zeros((0, 1), dtype=np.uint8) if chain is None else chain.relations[self.rows]
        self._frames = [0] if chain is None else chain.key_frames.tolist()
        names = [] if chain is None else [chain.row_label(row) for row in self.rows.tolist()]
        self._names = [fitted(name, 0.42 * self._width, size_px=_TEXT) for name in names]
        longest = max((font(_TEXT).getlength(name) for name in self._names), default=0)
        self._left = round(max(longest, font(_SMALL).getlength("key frame")) + 3 * _MARGIN)
        room = self._width - self._left - _MARGIN
        self._wide = float(np.clip(room / len(self._frames), 1, _CELL_WIDE))
        # No wider than the table and its legend need.
        legend = sum(
            font(_SMALL).getlength(f"0 {word}") + 1.35 * _SMALL + 3 * _MARGIN for word in RELATION_WORD.values()
        )
        needed = max(self._left + self._wide * len(self._frames) + _MARGIN, legend + _MARGIN)
        self._width = min(self._width, FINE * -(-int(needed) // FINE))
        self._top = round(2.2 * _SMALL)
        bottom = self._top + max(1, len(self.rows)) * _CELL_HIGH + (2 * _SMALL if self._n_more else 0)
        self._legend_top = bottom + _MARGIN
        self._base = self._drawn(bottom + round(2.4 * _SMALL))

    @property
    def width_px(self) -> int:
        """Width on the page."""
        return self._width // FINE

    def cell_at(self, x: int, y: int) -> tuple[int | None, int | None]:
        """Row of the chain and column at a place of the picture; None for each that is not there.

        Names at the left belong to their rows, the numbers above to their columns.
        """
        place, column = (y - self._top) // _CELL_HIGH, int((x - self._left) / self._wide // 1)
        is_row = 0 <= place < len(self.rows)
        is_column = 0 <= column < len(self._frames) and y < self._legend_top
        return int(self.rows[place]) if is_row else None, column if is_column else None

    def centre_of(self, row: int, column: int) -> tuple[int, int]:
        """Place of the middle of a cell, (x, y), by row of the chain and column.

        Raises
        ------
        ValueError
            If the row is not shown, or there is no such column.
        """
        place = np.flatnonzero(self.rows == row)
        if not place.size or not 0 <= column < len(self._frames):
            raise ValueError(f"cell: expected one that is shown, got row {row}, column {column}")
        return self._column_left(column + 0.5), self._top + int(place[0]) * _CELL_HIGH + _CELL_HIGH // 2

    def draw(self, *, column: int | None = None, row: int | None = None) -> NDArray[np.uint8]:
        """Picture with a column and a row lit, (height, width, 3) uint8 RGB."""
        image = self._base.copy()
        draw = ImageDraw.Draw(image)
        bottom = self._top + len(self.rows) * _CELL_HIGH
        if column is not None and len(self.rows):
            left, right = self._column_left(column), self._column_left(column + 1)
            if right - left < 4 * FINE:
                left, right = left - 2 * FINE, right + 2 * FINE
            draw.rectangle((left, 1, right, bottom), outline=self._theme.lit, width=2 * FINE)
            draw.rectangle((left, 1, right, self._top - 2), fill=self._theme.lit)
            told = str(self._frames[column])
            half = font(_SMALL, bold=True).getlength(told) / 2 + 2 * FINE
            middle = float(np.clip((left + right) / 2, half, self._width - half))
            draw.rectangle((middle - half, 2, middle + half, self._top - 2), fill=self._theme.lit)
            draw.text((middle, self._top / 2), told, font=font(_SMALL, bold=True), fill=self._theme.paper, anchor="mm")
        if row is not None and row in self.rows:
            top = self._top + int(np.flatnonzero(self.rows == row)[0]) * _CELL_HIGH
            right = self._column_left(len(self._frames))
            draw.rectangle((1, top, right, top + _CELL_HIGH - FINE), outline=self._theme.ink, width=2 * FINE)
        return np.asarray(image)

    def _column_left(self, column: float) -> int:
        return round(self._left + column * self._wide)

    def _drawn(self, height: int) -> Image.Image:
        theme = self._theme
        image = Image.new("RGB", (self._width, height), theme.paper)
        draw = ImageDraw.Draw(image)
        draw.text((_MARGIN, self._top / 2), "key frame", font=font(_SMALL), fill=theme.soft, anchor="lm")
        self._number_columns(draw)
        if not len(self.rows):
            draw.text(
                (_MARGIN, self._top + _CELL_HIGH / 2), "nothing changes", font=font(_TEXT), fill=theme.soft, anchor="lm"
            )
        for place, (name, codes) in enumerate(zip(self._names, self._codes.tolist(), strict=True)):
            y = self._top + place * _CELL_HIGH
            beside = self._left - _MARGIN, y + _CELL_HIGH / 2
            draw.text(beside, name, font=font(_TEXT), fill=theme.ink, anchor="rm")
            for column, code in enumerate(codes):
                left, right = self._column_left(column), self._column_left(column + 1)
                gap = FINE if self._wide > _LEAST_WIDE / 2 else 0
                box = (left, y, max(left, right - 1 - gap), y + _CELL_HIGH - 1 - FINE)
                draw.rectangle(box, fill=RELATION_COLOUR[Relation(code)])
                if self._wide >= 1.2 * _LEAST_WIDE:
                    inside = (left + right - gap) / 2, y + _CELL_HIGH / 2
                    draw.text(inside, str(code), font=font(_SMALL), fill=CODE_COLOUR[Relation(code)], anchor="mm")
        if self._n_more:
            below = _MARGIN, self._top + len(self.rows) * _CELL_HIGH + _SMALL
            draw.text(below, f"and {self._n_more} more rows", font=font(_SMALL), fill=theme.soft, anchor="lm")
        self._explain(draw)
        return image

    def _number_columns(self, draw: ImageDraw.ImageDraw) -> None:
        needed = font(_SMALL).getlength(str(self._frames[-1])) + 2 * _MARGIN
        step = max(1, int(np.ceil(needed / self._wide)))
        for column in range(0, len(self._frames), step):
            at = self._column_left(column + 0.5), self._top / 2
            draw.text(at, str(self._frames[column]), font=font(_SMALL), fill=self._theme.soft, anchor="mm")

    def _explain(self, draw: ImageDraw.ImageDraw) -> None:
        x, square = float(_MARGIN), 0.9 * _SMALL
        middle = self._legend_top + _SMALL
        for relation, colour in RELATION_COLOUR.items():
            draw.rectangle((x, middle - square / 2, x + square, middle + square / 2), fill=colour)
            words = f"{int(relation)} {RELATION_WORD[relation]}"
            draw.text((x + 1.5 * square, middle), words, font=font(_SMALL), fill=self._theme.soft, anchor="lm")
            x += 1.5 * square + font(_SMALL).getlength(words) + 3 * _MARGIN
