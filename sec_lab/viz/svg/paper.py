"""A drawing in the making: rectangles, lines, words and pictures, then SVG markup."""

import base64
import html
import io
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from sec_lab.codes import Relation, as_array
from sec_lab.viz.cells import Table
from sec_lab.viz.style import CODE_COLOUR, RELATION_COLOUR, RELATION_WORD

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

TEXT_PX, SMALL_PX = 12.0, 10.0
"""Sizes of text in CSS pixels."""

SOFT_OPACITY = "0.75"
FADED_OPACITY = "0.28"

_STYLE = "max-width:100%;height:auto;color:var(--jp-ui-font-color1,currentColor);"
_FONT = "var(--jp-ui-font-family,system-ui,sans-serif)"


class Paper:
    """A drawing in the making; its unit is the CSS pixel.

    Parameters
    ----------
    width, height : float
        Of the whole drawing.
    label : str
        What is to be seen, for those who do not see it.

    Examples
    --------
    >>> paper = Paper(40, 20, label="a box")
    >>> paper.rect(0, 0, 40, 20, fill="#2459ad")
    >>> paper.markup().count("<rect")
    1
    """

    def __init__(self, width: float, height: float, *, label: str) -> None:
        self.width, self.height = float(width), float(height)
        self._root = ElementTree.Element(
            "svg",
            {
                "xmlns": "http://www.w3.org/2000/svg", "role": "img", "aria-label": label, "width": _number(width),
                "height": _number(height), "viewBox": f"0 0 {_number(width)} {_number(height)}", "style": _STYLE,
                "font-family": _FONT,
            },
        )  # fmt: skip

    def rect(self, x: float, y: float, width: float, height: float, *, fill: str, **more: str) -> None:
        """A rectangle; ``more`` are attributes of SVG, with underscores for hyphens."""
        self._add("rect", {"x": x, "y": y, "width": width, "height": height}, fill=fill, **more)

    def line(self, x1: float, y1: float, x2: float, y2: float, **more: str) -> None:
        """A line in the colour of the page's text."""
        self._add("line", {"x1": x1, "y1": y1, "x2": x2, "y2": y2}, **{"stroke": "currentColor", **more})

    def circle(self, x: float, y: float, radius: float, *, fill: str, **more: str) -> None:
        """A disc."""
        self._add("circle", {"cx": x, "cy": y, "r": radius}, fill=fill, **more)

    def path(self, way: str, **more: str) -> None:
        """A line along a path of SVG, not filled unless ``fill`` is given."""
        self._add("path", {}, d=way, **{"fill": "none", "stroke": "currentColor", **more})

    def words(
        self, x: float, y: float, text: str, *, size_px: float = TEXT_PX, soft: bool = False, bold: bool = False,
        anchor: str = "start", **more: str | None,
    ) -> None:  # fmt: skip
        """Words whose middle line is at ``y``; of the name of a relation, ρ2,1, the numbers are set lower."""
        given = {"fill": "currentColor", "text_anchor": anchor, "dominant_baseline": "central"}
        given |= {name: value for name, value in more.items() if value is not None}
        if soft:
            given["opacity"] = SOFT_OPACITY
        if bold:
            given["font_weight"] = "600"
        element = self._add("text", {"x": x, "y": y, "font-size": size_px}, **given)
        _typeset(element, text, size_px)

    def picture(self, x: float, y: float, width: float, height: float, address: str, **more: str) -> None:
        """A picture by its address, e.g. of :func:`data_address`."""
        self._add("image", {"x": x, "y": y, "width": width, "height": height}, href=address, **more)

    def markup(self) -> str:
        """All of it as SVG."""
        return ElementTree.tostring(self._root, encoding="unicode")

    def _add(self, tag: str, numbers: dict[str, float], **more: str) -> ElementTree.Element:
        given = {name: _number(value) for name, value in numbers.items()}
        given |= {name.replace("_", "-"): value for name, value in more.items()}
        return ElementTree.SubElement(self._root, tag, given)


def note(markup: str) -> str:
    """A paragraph of HTML in the colour of the page's text; what stands in it must be escaped already."""
    return f'<div style="color:var(--jp-ui-font-color1,currentColor);line-height:1.5">{markup}</div>'


def sentence(text: str) -> str:
    """Plain text as a paragraph of HTML.

    Examples
    --------
    >>> "a &lt; b" in sentence("a < b")
    True
    """
    return note(html.escape(text))


def words_px(texts: Sequence[str], *, size_px: float = TEXT_PX) -> float:
    """Room that the longest of some texts is likely to need; the fonts of the page are not known."""
    return 0.58 * size_px * max(map(len, texts), default=0)


def data_address(picture: "ArrayLike") -> str:
    """Address that holds a picture itself, as PNG.

    Parameters
    ----------
    picture : (height, width, 3 or 4) array_like of uint8
        RGB, and opacity if there is any.

    Raises
    ------
    ValueError
        If it is something else.

    Examples
    --------
    >>> data_address(np.zeros((2, 2, 3), np.uint8))[:22]
    'data:image/png;base64,'
    """
    return "data:image/png;base64," + base64.b64encode(png(picture)).decode("ascii")


def png(picture: "ArrayLike") -> bytes:
    r"""A picture as a PNG file, packed for speed; parameters and errors are those of :func:`data_address`.

    Examples
    --------
    >>> png(np.zeros((2, 2, 3), np.uint8))[:4]
    b'\x89PNG'
    """
    from PIL import Image

    array = as_array(picture, what="picture")
    if array.ndim != 3 or array.shape[2] not in (3, 4) or array.dtype != np.uint8 or not array.size:
        raise ValueError(
            f"picture: expected shape (height, width, 3 or 4) of uint8, got {array.shape} of {array.dtype}"
        )
    buffer = io.BytesIO()
    Image.fromarray(array).save(buffer, format="png", compress_level=1)
    return buffer.getvalue()


def jpeg(picture: "NDArray[np.uint8]") -> bytes:
    r"""A photograph as a JPEG file: a quarter of the time and of the bytes of PNG.

    Parameters
    ----------
    picture : (height, width, 3) uint8
        RGB.

    Examples
    --------
    >>> jpeg(np.zeros((2, 2, 3), np.uint8))[:2]
    b'\xff\xd8'
    """
    import cv2

    _, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])
    return data.tobytes()


def draw_cells(
    paper: Paper,
    table: Table,
    *,
    x: float,
    y: float,
    cell_px: tuple[float, float],
    faded: "NDArray[np.bool_] | None" = None,
    outlined: "NDArray[np.bool_] | None" = None,
) -> None:
    """Draw the cells of a chain with their codes, the row names left of them.

    Parameters
    ----------
    paper : Paper
    table : Table
        Of :func:`sec_lab.viz.cells.table_of`.
    x, y : float
        Upper left corner of the first cell.
    cell_px : tuple of two float
        Width and height of a cell. Codes and names are left out where it is too small for them.
    faded, outlined : (n_rows, n_columns) bool, optional
        Cells that are pale, and cells with a frame.
    """
    width, height = cell_px
    is_original = table.form == "original"
    size = min(TEXT_PX, 0.62 * height, (0.8 if is_original else 0.62) * width)
    gap = 1.0 if min(width, height) >= 8 else 0.4
    befores, afters = table.before.tolist(), table.after.tolist()
    for row, name in enumerate(table.rows):
        top = y + row * height
        if height >= 9:
            # A row that is pale throughout has a pale name.
            opacity = "0.5" if faded is not None and bool(faded[row].all()) else None
            paper.words(
                x - 6, top + height / 2, name, size_px=min(TEXT_PX, 0.8 * height), anchor="end", opacity=opacity
            )
        for column, (before, after) in enumerate(zip(befores[row], afters[row], strict=True)):
            if before < 0:
                continue
            left = x + column * width
            is_pale = faded is not None and bool(faded[row, column])
            pale = {"opacity": FADED_OPACITY} if is_pale else {}
            codes = [before] if is_original else [before, after]
            part = (width - gap) / len(codes)
            for place, code in enumerate(codes):
                relation = Relation(code)
                paper.rect(left + place * part, top, part, height - gap, fill=RELATION_COLOUR[relation], **pale)
                if size >= 7:
                    paper.words(
                        left + (place + 0.5) * part, top + height / 2, str(code), size_px=size, anchor="middle",
                        fill="currentColor" if is_pale else CODE_COLOUR[relation], data_code=str(code),
                        opacity="0.5" if is_pale else None,
                    )  # fmt: skip
            if outlined is not None and outlined[row, column]:
                # Light and dark, as it has to stand out on cells of both kinds.
                for stroke, thick, mark in (("#ffffff", "3.4", "casing"), ("#16181c", "1.8", "different")):
                    paper.rect(
                        left + 1, top + 1, width - gap - 2, height - gap - 2, fill="none", stroke=stroke,
                        stroke_width=thick, data_mark=mark,
                    )  # fmt: skip


def draw_columns(paper: Paper, names: Sequence[str], *, x: float, y: float, width: float, title: str) -> None:
    """Names of columns below a table, as many as there is room for, and what they are."""
    step = max(1, int(np.ceil((words_px(names, size_px=SMALL_PX) + 4) / width)))
    for column in range(0, len(names), step):
        paper.words(x + (column + 0.5) * width, y + 8, names[column], size_px=SMALL_PX, soft=True, anchor="middle")
    paper.words(x, y + 23, title, size_px=SMALL_PX, soft=True)


def draw_legend(paper: Paper, tables: Sequence[Table], *, x: float, y: float) -> None:
    """Explain the colours of the relations that occur in tables."""
    for relation in Relation:
        if any(bool((half == relation).any()) for table in tables for half in (table.before, table.after)):
            paper.rect(x, y - 6, 12, 12, fill=RELATION_COLOUR[relation])
            text = f"{int(relation)} {RELATION_WORD[relation]}"
            paper.words(x + 17, y, text, size_px=SMALL_PX, soft=True)
            x += 17 + words_px([text], size_px=SMALL_PX) + 12


def _number(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _typeset(element: ElementTree.Element, text: str, size_px: float) -> None:
    last: Any = None
    position = 0
    for found in re.finditer(r"ρ(\d+), ?(\d+)", text):
        _append(element, last, text[position : found.start()] + "ρ")
        drop = 0.22 * size_px
        last = ElementTree.SubElement(element, "tspan", {"dy": _number(drop), "font-size": _number(0.78 * size_px)})
        last.text = f"{found[1]},{found[2]}"
        position = found.end()
        if position < len(text):
            rest = ElementTree.SubElement(element, "tspan", {"dy": _number(-drop)})
            rest.text, last = "\u200b", rest
    _append(element, last, text[position:])


def _append(element: ElementTree.Element, last: Any, text: str) -> None:
    if last is None:
        element.text = (element.text or "") + text
    else:
        last.text = (last.text or "") + text
