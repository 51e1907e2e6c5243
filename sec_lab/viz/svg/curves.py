"""Curves over a parameter, with a line where one stands."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from sec_lab.viz.style import CURVE_COLOURS
from sec_lab.viz.svg.paper import SMALL_PX, Paper, words_px

if TYPE_CHECKING:
    import pandas as pd

_DASHES = ("", "7 3", "2 3", "9 3 2 3", "4 2", "12 4")


def curves_svg(
    frame: "pd.DataFrame",
    *,
    x_label: str,
    y_label: str,
    error: "pd.DataFrame | None" = None,
    marker: float | None = None,
    y_top: float | None = None,
    width_px: float = 460.0,
    height_px: float = 240.0,
) -> str:
    """Draw columns of a table over its index, told apart by colour and dashes.

    Parameters
    ----------
    frame : pandas.DataFrame
        One row a value of the parameter, ascending; one column a curve, at most six.
    x_label, y_label : str
        With units.
    error : pandas.DataFrame, optional
        Of the same shape: bars up and down by so much.
    marker : float, optional
        Where an upright line stands.
    y_top : float, optional
        Upper end of the axis; the largest value if left out.
    width_px, height_px : float, optional

    Returns
    -------
    str
        SVG.

    Raises
    ------
    ValueError
        If there is nothing to draw, or more than six curves.

    Examples
    --------
    >>> import pandas as pd
    >>> curves_svg(pd.DataFrame({"ψ": [100.0, 50.0]}, index=[0, 1]), x_label="p", y_label="%").count("data-curve")
    1
    """
    if not 1 <= frame.shape[1] <= len(_DASHES) or not len(frame):
        raise ValueError(f"frame: expected a row and one to six columns, got shape {frame.shape}")
    xs, ys = frame.index.to_numpy(np.float64), frame.to_numpy(np.float64)
    top = float(np.nanmax(ys)) if y_top is None else y_top
    whole = frame.dtypes.map(lambda kind: kind.kind in "iu").all()
    ticks = MaxNLocator(4, integer=bool(whole), steps=[1, 2, 2.5, 5, 10]).tick_values(0, top if top > 0 else 1.0)
    top = float(ticks[-1])
    low, high = float(xs.min()), float(xs.max())
    left, right, above = 44.0, 12.0, 34.0
    below = 40.0
    wide, deep = width_px - left - right, height_px - above - below
    across = left + wide * (xs - low) / (high - low or 1.0)

    def down(value: float) -> float:
        return above + deep * (1 - min(max(value, 0.0), top) / top)

    paper = Paper(width_px, height_px, label=f"{y_label} over {x_label}")
    for value in ticks:
        y = down(float(value))
        paper.line(left, y, left + wide, y, opacity="0.18")
        paper.words(left - 6, y, f"{value:g}", size_px=SMALL_PX, soft=True, anchor="end")
    for value in np.linspace(low, high, 6):
        x = left + wide * (value - low) / (high - low or 1.0)
        paper.words(float(x), above + deep + 11, f"{value:g}", size_px=SMALL_PX, soft=True, anchor="middle")
    paper.words(left + wide / 2, above + deep + 28, x_label, size_px=SMALL_PX, soft=True, anchor="middle")
    paper.words(0, 8, y_label, size_px=SMALL_PX, soft=True)
    begin = left
    for number, name in enumerate(map(str, frame.columns)):
        colour, dashes = CURVE_COLOURS[number], _DASHES[number]
        points = [(x, down(y)) for x, y in zip(across.tolist(), ys[:, number].tolist(), strict=True) if np.isfinite(y)]
        # On a page of any colour: a light casing under the line.
        way = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) if points else ""
        for stroke, width, kind in (("#ffffff", "4", "casing"), (colour, "2.2", "curve")):
            style = {"stroke": stroke, "stroke_width": width, "stroke_linejoin": "round", f"data_{kind}": name}
            paper.path(way, **({"stroke_dasharray": dashes} if dashes and kind == "curve" else {}), **style)
        if error is not None:
            spread = error.to_numpy(np.float64)[:, number].tolist()
            for x, y, by in zip(across.tolist(), ys[:, number].tolist(), spread, strict=True):
                if np.isfinite(by):
                    paper.line(x, down(y - by), x, down(y + by), stroke=colour, stroke_width="1.2")
        paper.line(
            begin, 24, begin + 22, 24, stroke=colour, stroke_width="3",
            **({"stroke_dasharray": dashes} if dashes else {}),
        )  # fmt: skip
        paper.words(begin + 27, 24, name, size_px=SMALL_PX)
        begin += 27 + words_px([name], size_px=SMALL_PX) + 12
    if marker is not None:
        x = left + wide * (min(max(marker, low), high) - low) / (high - low or 1.0)
        paper.line(x, above, x, above + deep, stroke_width="1.6", stroke_dasharray="3 3", data_marker=f"{marker:g}")
    return paper.markup()
