"""Columns of a table as curves."""

from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.axes import Axes

from sec_lab.viz.style import CURVE_COLOURS, INK, LINE, SMALL_PT, SOFT, TEXT_PT, new_figure, tidy

if TYPE_CHECKING:
    import pandas as pd

Scale = Literal["linear", "log"]

_MARKERS = "osD^vP"
_DASHES: tuple[tuple[float, ...], ...] = ((), (4.0, 1.6), (1.4, 1.2), (6.0, 1.5, 1.4, 1.5), (3.0, 1.0), (8.0, 2.0))


def draw_curves(
    frame: "pd.DataFrame",
    *,
    y_label: str,
    x_scale: Scale = "linear",
    y_scale: Scale = "linear",
    ax: Axes | None = None,
    title: str | None = None,
) -> Axes:
    """Draw every column of a table against its index, with a legend.

    Parameters
    ----------
    frame : pandas.DataFrame
        Index: the horizontal axis, called by the index's name; columns: one curve each, at most six.
    y_label : str
        What the values are, with their unit.
    x_scale, y_scale : {"linear", "log"}, optional
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out.
    title : str, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If there is no column or there are more than six.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"share": [0.4, 0.1]}, index=pd.Index([160, 640], name="width in pixels"))
    >>> draw_curves(frame, y_label="hints a line").get_xlabel()
    'width in pixels'
    """
    if not 1 <= frame.shape[1] <= len(CURVE_COLOURS):
        raise ValueError(f"curves: expected one to {len(CURVE_COLOURS)} columns, got {frame.shape[1]}")
    if ax is None:
        ax = new_figure(6.4, 3.2, layout="constrained").add_subplot()
    places = frame.index.to_numpy()
    for number, name in enumerate(frame.columns):
        (line,) = ax.plot(
            places, frame[name].to_numpy(), color=CURVE_COLOURS[number], marker=_MARKERS[number], markersize=4.5,
            linewidth=1.8, label=str(name),
        )  # fmt: skip
        if _DASHES[number]:
            line.set_dashes(_DASHES[number])
    ax.set(xscale=x_scale, yscale=y_scale)
    tidy(ax, title=title)
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(visible=True, color=LINE, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.set_xlabel(str(frame.index.name or ""), fontsize=TEXT_PT, color=SOFT)
    ax.set_ylabel(y_label, fontsize=TEXT_PT, color=SOFT)
    if y_scale == "log":
        ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    if x_scale == "log" and len(places) <= 8:
        ax.set_xticks(places, [f"{place:g}" for place in np.asarray(places, dtype=float)])
        ax.set_xticks([], minor=True)
    ax.legend(
        frameon=False,
        fontsize=SMALL_PT,
        labelcolor=INK,
        loc="center left",
        bbox_to_anchor=(1.01, 0.5),
        handlelength=3.0,
    )
    return ax
