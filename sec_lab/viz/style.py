"""Colours, sizes and fonts that all pictures share.

Pictures are made without pyplot: nothing global is changed and no figure stays open. Relations keep the thesis's
colours (Fig. 2.1): overlapping blue, touching red. Line styles, and the codes in the cells, tell them apart as well.
"""

import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath
from numpy.typing import NDArray

from sec_lab.codes import Relation

PAPER, INK, SOFT, LINE = "#ffffff", "#22262c", "#69707b", "#d9dce1"
"""Background, text, secondary text and thin lines."""

DOTS_PER_INCH = 200
PAGE_WIDTH_IN = 8.3
"""Width of a full figure. A page shows it 830 pixels wide, half the pixels it has, so 10 pt look like 14 pixels."""

TITLE_PT, TEXT_PT, SMALL_PT = 11.0, 9.5, 8.5

RELATION_COLOUR: Mapping[Relation, str] = MappingProxyType(
    {
        Relation.NON_TOUCHING: "#edeff2",
        Relation.OVERLAPPING: "#2459ad",
        Relation.TOUCHING: "#e2553f",
        Relation.ABSENT: "#848d9a",
    }
)
"""Fill of a cell."""

CODE_COLOUR: Mapping[Relation, str] = MappingProxyType(
    {
        Relation.NON_TOUCHING: "#7b838f",
        Relation.OVERLAPPING: "#ffffff",
        Relation.TOUCHING: "#ffffff",
        Relation.ABSENT: "#ffffff",
    }
)
"""Colour of the code that is printed in a cell."""


@dataclass(frozen=True)
class EdgeStyle:
    """How an edge of a scene graph is drawn: colour, width in points, and lengths of dashes and gaps in widths."""

    colour: str
    width_pt: float
    dashes: tuple[float, ...] = ()


EDGE_STYLE: Mapping[Relation, EdgeStyle] = MappingProxyType(
    {
        Relation.OVERLAPPING: EdgeStyle(RELATION_COLOUR[Relation.OVERLAPPING], 2.6),
        Relation.TOUCHING: EdgeStyle("#cf2f1c", 2.2, (2.2, 1.1)),
    }
)

RELATION_WORD: Mapping[Relation, str] = MappingProxyType(
    {
        Relation.NON_TOUCHING: "non-touching",
        Relation.OVERLAPPING: "overlapping",
        Relation.TOUCHING: "touching",
        Relation.ABSENT: "absent",
    }
)

SIMILARITY_COLOURS = LinearSegmentedColormap.from_list(
    "similarity", ["#f6f4ee", "#cfe0e6", "#86b6cf", "#3f83b5", "#1f5590", "#142c57"]
)
"""From 0 % (light) to 100 % (dark); lightness alone tells the value."""

CURVE_COLOURS = ("#2459ad", "#e2553f", "#2f8f6b", "#8a5fbf", "#b5831f", "#4d5664")

# Light and quiet, so that nodes and edges stand out on them.
_SEGMENT_COLOURS = (
    "#dde8d3", "#f4dca6", "#f0b6ac", "#b2cbe6", "#cfc0e6", "#b3ddd6", "#f6c79c", "#e6b9d5", "#dbe09a", "#bdc5ec",
    "#b9dfae", "#dcc5b0",
)  # fmt: skip


class Picture(Figure):
    """Figure that shows itself in a notebook, at the size of the page, without any state in pyplot."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        width, height = (self.get_size_inches() * DOTS_PER_INCH / 2).round().astype(int).tolist()
        return png_bytes(self), {"width": width, "height": height}


def new_figure(width_in: float, height_in: float, **options: Any) -> Figure:
    """Empty figure in the style of all others.

    Examples
    --------
    >>> new_figure(4, 3)
    <Picture size 800x600 with 0 Axes>
    """
    return Picture(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, facecolor=PAPER, **options)


def axes_at(figure: Figure, *, left_in: float, top_in: float, width_in: float, height_in: float) -> Axes:
    """New axes at a place in inches from the upper left corner of the figure.

    Examples
    --------
    >>> axes_at(new_figure(4, 2), left_in=1, top_in=0.5, width_in=2, height_in=1).get_position().extents.tolist()
    [0.25, 0.25, 0.75, 0.75]
    """
    width, height = figure.get_size_inches().tolist()
    bottom_in = height - top_in - height_in
    return figure.add_axes((left_in / width, bottom_in / height, width_in / width, height_in / height))


def text_width_in(text: str, *, size_pt: float, bold: bool = False) -> float:
    """Width of a text in inches.

    Examples
    --------
    >>> text_width_in("ξ", size_pt=10) < text_width_in("ξ¹ and ξ²", size_pt=10)
    True
    """
    font = FontProperties(weight="bold" if bold else "normal")
    return float(TextPath((0, 0), text, size=size_pt, prop=font).get_extents().width) / 72 if text.strip() else 0.0


def title_width_in(title: str | None) -> float:
    """Room that the title of a figure needs, in inches."""
    return 0.0 if title is None else text_width_in(title, size_pt=TITLE_PT, bold=True) + 0.1


def png_bytes(figure: Figure) -> bytes:
    r"""The figure as a PNG file without date and version, so that equal figures are equal bytes.

    Examples
    --------
    >>> png_bytes(new_figure(1, 1))[:4]
    b'\x89PNG'
    """
    buffer = io.BytesIO()
    figure.savefig(
        buffer, format="png", dpi=DOTS_PER_INCH, facecolor=figure.get_facecolor(), metadata={"Software": None}
    )
    return buffer.getvalue()


def figure_of(ax: Axes) -> Figure:
    """The figure that axes belong to.

    Raises
    ------
    ValueError
        If they belong to none.
    """
    figure = ax.get_figure(root=True)
    if figure is None:
        raise ValueError("axes: expected axes of a figure, got axes that were removed from it")
    return figure


def tidy(ax: Axes, *, title: str | None = None) -> None:
    """Axes with quiet ticks and frame, and a title at the left."""
    ax.tick_params(which="both", colors=SOFT, labelcolor=INK, labelsize=SMALL_PT, width=0.6, length=3)
    for spine in ax.spines.values():
        spine.set(color=LINE, linewidth=0.8)
    if title is not None:
        ax.set_title(title, loc="left", fontsize=TITLE_PT, color=INK, fontweight="bold")


def bare(ax: Axes, *, title: str | None = None) -> None:
    """Axes without ticks and frame."""
    tidy(ax, title=title)
    ax.set(xticks=[], yticks=[])
    for spine in ax.spines.values():
        spine.set_visible(False)


def segment_colours(labels: Iterable[int]) -> dict[int, tuple[float, float, float]]:
    """Light colour of each segment label; a label has the same colour in every picture, and 60 have different ones.

    Examples
    --------
    >>> len(set(segment_colours(range(1, 61)).values()))
    60
    """
    colours = {}
    for label in labels:
        turn, place = divmod(int(label) - 1, len(_SEGMENT_COLOURS))
        red, green, blue = (rgb(_SEGMENT_COLOURS[place]) * (1.0 - 0.09 * (turn % 5))).tolist()
        colours[int(label)] = (red, green, blue)
    return colours


def rgb(colour: str) -> NDArray[np.float64]:
    """Red, green and blue from 0 to 1."""
    return np.array(to_rgb(colour))
