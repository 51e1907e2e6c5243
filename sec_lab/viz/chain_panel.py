"""The event chain beside a running movie: a table whose column of now is lit (Fig. 2.5 d)."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from sec_lab.codes import Relation
from sec_lab.viz.lettering import fitted, font
from sec_lab.viz.style import CODE_COLOUR, INK, PAPER, RELATION_COLOUR, RELATION_WORD, SOFT, rgb

if TYPE_CHECKING:
    from sec_lab.event_chain import EventChain

_LEAST_CELL_PX, _MOST_CELL_PX = 5, 26
_LEAST_NAMED_PX, _LEAST_CODED_PX, _LEAST_LIT_PX = 11, 13, 15


class ChainPanel:
    """Draws the rows of a chain in which something happens, and lights one column.

    Rows that find no room are left out from the end, and said; of columns those around the one that is lit are shown.

    Parameters
    ----------
    chain : EventChain or None
        None: there are fewer than two segments.
    height_px, width_px : int
        Size of the panel.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> panel = ChainPanel(EventChain([[0, 2]], [(2, 1)]), height_px=200, width_px=300)
    >>> panel.at(0).shape, (panel.at(0) != panel.at(1)).any()
    ((200, 300, 3), np.True_)
    """

    def __init__(self, chain: "EventChain | None", *, height_px: int, width_px: int) -> None:
        self._height, self._width = height_px, width_px
        self._margin = round(0.045 * width_px)
        self._text_px = float(np.clip(0.024 * height_px, 11, 22))
        self._top = round(self._margin + 3.6 * self._text_px)
        below = round(4.4 * self._text_px)
        rows = chain.changing_rows if chain is not None else np.zeros(0, dtype=np.intp)
        room = height_px - self._top - below
        if len(rows) * _LEAST_CELL_PX > room:
            room -= round(1.6 * self._text_px)  # to say how many rows there are more
        self._cell_high = int(np.clip(room // max(1, len(rows)), _LEAST_CELL_PX, min(_MOST_CELL_PX, self._text_px * 2)))
        n_shown = min(len(rows), max(1, room // self._cell_high))
        self._n_hidden = len(rows) - n_shown
        self._codes = chain.relations[rows[:n_shown]] if chain is not None else np.zeros((0, 1), dtype=np.uint8)
        self._frames = chain.key_frames.tolist() if chain is not None else [0]
        self._names: list[str] = []
        self._left = self._margin
        if chain is not None and self._cell_high >= _LEAST_NAMED_PX and n_shown:
            self._name_px = min(self._text_px, 0.72 * self._cell_high)
            names = [chain.row_label(row) for row in rows[:n_shown]]
            self._names = [fitted(name, 0.5 * width_px, size_px=self._name_px) for name in names]
            longest = max(font(self._name_px).getlength(name) for name in self._names)
            self._left += round(longest + 0.6 * self._text_px)
        room_wide = width_px - self._left - self._margin - _LEAST_LIT_PX
        self._n_columns = max(1, min(len(self._frames), room_wide // _LEAST_CELL_PX))
        self._cell_wide = int(np.clip(room_wide // self._n_columns, _LEAST_CELL_PX, _MOST_CELL_PX))
        self._lit_wide = max(self._cell_wide, _LEAST_LIT_PX)
        self._drawn: tuple[int, NDArray[np.uint8]] | None = None

    def at(self, column: int) -> NDArray[np.uint8]:
        """Panel with one column lit, (height, width, 3) uint8; write-protected."""
        if self._drawn is None or self._drawn[0] != column:
            panel = np.asarray(self._draw(column))
            panel.setflags(write=False)
            self._drawn = column, panel
        return self._drawn[1]

    def _draw(self, lit: int) -> Image.Image:
        image = Image.new("RGB", (self._width, self._height), PAPER)
        draw = ImageDraw.Draw(image)
        title, small = font(1.2 * self._text_px, bold=True), font(0.92 * self._text_px)
        draw.text((self._margin, self._margin), "Event chain", font=title, fill=INK)
        n = len(self._frames)
        what = f"key frame {self._frames[lit]}, column {lit + 1} of {n}" if len(self._codes) else "nothing changes"
        draw.text((self._margin, self._margin + 1.7 * self._text_px), what, font=small, fill=SOFT)
        first = min(max(0, lit - self._n_columns // 2), n - self._n_columns)
        for row in range(len(self._codes)):
            y = self._top + row * self._cell_high
            if self._names:
                place = self._left - 0.5 * self._text_px, y + self._cell_high / 2
                draw.text(place, self._names[row], font=font(self._name_px), fill=INK, anchor="rm")
            for column in range(first, first + self._n_columns):
                x = self._left + (column - first) * self._cell_wide
                x += (column > lit) * (self._lit_wide - self._cell_wide)
                self._draw_cell(draw, row, column, x=x, is_lit=column == lit)
        if len(self._codes):
            left = self._left + (lit - first) * self._cell_wide
            right, bottom = left + self._lit_wide - 1, self._top + len(self._codes) * self._cell_high - 1
            draw.rectangle((left - 1, self._top - 2, right, bottom + 1), outline=INK, width=2)
            if self._n_hidden:
                more = f"and {self._n_hidden} more rows"
                draw.text((self._left, bottom + 4), more, font=small, fill=SOFT)
        self._explain(draw)
        return image

    def _draw_cell(self, draw: ImageDraw.ImageDraw, row: int, column: int, *, x: int, is_lit: bool) -> None:
        relation = Relation(self._codes[row, column])
        colour = rgb(RELATION_COLOUR[relation])
        wide = self._lit_wide if is_lit else self._cell_wide
        if not is_lit:
            colour = 1 - 0.45 * (1 - colour)
        y = self._top + row * self._cell_high
        gap = 1 if self._cell_high > _LEAST_CELL_PX else 0
        box = (x, y, x + wide - 1 - gap, y + self._cell_high - 1 - gap)
        draw.rectangle(box, fill=tuple((255 * colour).round().astype(int).tolist()))
        if is_lit and self._cell_high >= _LEAST_CODED_PX:
            letters = font(min(self._text_px, 0.62 * self._cell_high))
            middle = (x + wide / 2 - 0.5, y + self._cell_high / 2)
            draw.text(middle, str(int(relation)), font=letters, fill=CODE_COLOUR[relation], anchor="mm")

    def _explain(self, draw: ImageDraw.ImageDraw) -> None:
        """Legend at the foot, in two columns."""
        small, square = font(0.92 * self._text_px), 0.8 * self._text_px
        for place, relation in enumerate(RELATION_COLOUR):
            x = self._margin + (place % 2) * (self._width - 2 * self._margin) / 2
            y = self._height - self._margin - (1.9 - place // 2 * 1.5) * self._text_px
            draw.rectangle((x, y, x + square, y + square), fill=RELATION_COLOUR[relation])
            words = f"{int(relation)} {RELATION_WORD[relation]}"
            draw.text((x + 1.5 * square, y + square / 2), words, font=small, fill=INK, anchor="lm")
