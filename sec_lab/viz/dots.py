"""Single values as dots on a line: what varies within groups, and shares with their intervals."""

from collections.abc import Mapping
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import blended_transform_factory
from numpy.typing import NDArray

from sec_lab.viz.style import (
    CURVE_COLOURS,
    INK,
    LINE,
    PAGE_WIDTH_IN,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    axes_at,
    new_figure,
    tidy,
)

if TYPE_CHECKING:
    import pandas as pd

_ROW_IN, _LETTER_IN = 0.24, 0.6 * SMALL_PT / 72


def draw_spread(frame: "pd.DataFrame", groups: Mapping[str, str]) -> Figure:
    """Draw every value of each column as a dot, one row a group, with a bar at the group's median.

    Equal values of a group are stacked, so that none hides another.

    Parameters
    ----------
    frame : pandas.DataFrame
        One panel a column, at most four; the column's name is the name of the axis.
    groups : mapping
        Group of each row, by row name.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If there is no row, there is no column or more than four, or a row has no group.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"key frames": [4, 6, 9]}, list("abc"))
    >>> figure = draw_spread(frame, {"a": "put", "b": "put", "c": "take"})
    >>> [tick.get_text() for tick in figure.axes[0].get_yticklabels()]
    ['put', 'take']
    """
    if not len(frame) or not 1 <= frame.shape[1] <= 4:
        raise ValueError(f"spread: expected at least one row and one to four columns, got shape {frame.shape}")
    missing = [name for name in frame.index if name not in groups]
    if missing:
        raise ValueError(f"groups: expected a group for every row, got none for {missing[0]!r}")
    of_row = [groups[name] for name in frame.index]
    present = list(dict.fromkeys(of_row))
    left_in, gap_in, top_in, below_in = 0.2 + _LETTER_IN * max(map(len, present)), 0.28, 0.1, 0.5
    width_in = (PAGE_WIDTH_IN - left_in - 0.1) / frame.shape[1] - gap_in
    height_in = 1.5 * _ROW_IN * len(present)
    figure = new_figure(PAGE_WIDTH_IN, top_in + height_in + below_in)
    for number, name in enumerate(frame.columns):
        ax = axes_at(
            figure, left_in=left_in + number * (width_in + gap_in), top_in=top_in, width_in=width_in,
            height_in=height_in,
        )  # fmt: skip
        tidy(ax)
        for place, group in enumerate(present):
            values = frame[name].to_numpy(dtype=np.float64)[[one == group for one in of_row]]
            ax.plot(
                values,
                place - 0.09 * _rank_among_equal(values),
                "o",
                color=CURVE_COLOURS[0],
                markersize=3.6,
                clip_on=False,
            )
            ax.vlines(np.median(values), place - 0.36, place + 0.2, colors=CURVE_COLOURS[1], linewidth=2.0, zorder=1)
        ax.set(ylim=(len(present) - 0.5, -0.7), xlim=(0, None))
        ax.set_yticks(range(len(present)), present if number == 0 else [""] * len(present), parse_math=False)
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=True, axis="x", color=LINE, linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right", "left"]].set_visible(False)
        ax.set_xlabel(str(name), fontsize=TEXT_PT, color=SOFT)
    return figure


def draw_intervals(
    frame: "pd.DataFrame",
    *,
    x_label: str,
    lines: Mapping[str, float] | None = None,
    title: str | None = None,
) -> Axes:
    """Draw values with their intervals below each other, in groups.

    Parameters
    ----------
    frame : pandas.DataFrame
        Columns ``percent``, ``low_percent`` and ``high_percent``, 0 to 100; one row a value, which is called by its
        index. The first level of an index of several levels makes groups, whose name stands before their first row.
    x_label : str
        What the values are.
    lines : mapping of str to float, optional
        Other values to compare with, drawn as vertical lines with these names.
    title : str, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If there is no row, a column is missing, or a value is not between 0 and 100.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"percent": [40], "low_percent": [30], "high_percent": [51]}, ["spatial"])
    >>> [tick.get_text() for tick in draw_intervals(frame, x_label="recognised in %").get_yticklabels()]
    ['spatial']
    """
    needed = ["percent", "low_percent", "high_percent"]
    if not len(frame) or not set(needed) <= set(frame.columns):
        raise ValueError(f"intervals: expected columns {needed}, got {list(frame.columns)} with {len(frame)} rows")
    shown = frame[needed].to_numpy(dtype=np.float64)
    wrong = ~((shown >= 0) & (shown <= 100))
    if wrong.any():
        raise ValueError(f"intervals: expected percent from 0 to 100, got {shown[wrong][0]}")
    keys = [key if isinstance(key, tuple) else (key,) for key in frame.index]
    heads = ["" if len(key) == 1 else str(key[0]) for key in keys]
    names = [", ".join(str(part) for part in (key[1:] or key)) for key in keys]
    # Rows of a group are one unit apart, groups a little more.
    sizes = [len(list(rows)) for _, rows in groupby(heads)]
    group_of_row = np.repeat(np.arange(len(sizes)), sizes)
    places = np.arange(len(keys)) + 0.8 * group_of_row
    head_in = 0.15 + _LETTER_IN * max(map(len, heads)) if any(heads) else 0.0
    left_in, right_in = head_in + 0.15 + _LETTER_IN * max(map(len, names)), 0.2
    above_in = (0.3 if title else 0.05) + (0.24 * len(lines) + 0.05 if lines else 0.05)
    height_in = _ROW_IN * float(places[-1] + 1)
    figure = new_figure(PAGE_WIDTH_IN, above_in + height_in + 0.5)
    ax = axes_at(
        figure, left_in=left_in, top_in=above_in, width_in=PAGE_WIDTH_IN - left_in - right_in, height_in=height_in
    )
    tidy(ax)
    middle, low, high = shown.T
    ax.hlines(places, low, high, colors=CURVE_COLOURS[0], linewidth=1.6)
    ax.plot(middle, places, "o", color=CURVE_COLOURS[0], markersize=5)
    ax.set(xlim=(0, 100), ylim=(float(places[-1]) + 0.6, -0.6))
    ax.set_yticks(places, names, fontsize=SMALL_PT, parse_math=False)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=True, axis="x", color=LINE, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.set_xlabel(x_label, fontsize=TEXT_PT, color=SOFT)
    for first in np.unique(group_of_row, return_index=True)[1].tolist():
        ax.text(
            -(left_in - 0.05) / (PAGE_WIDTH_IN - left_in - right_in), float(places[first]), heads[first],
            transform=blended_transform_factory(ax.transAxes, ax.transData), va="center_baseline", fontsize=SMALL_PT,
            color=INK, fontweight="bold", parse_math=False,
        )  # fmt: skip
    _draw_lines(ax, lines or {}, height_in)
    if title is not None:
        figure.text(
            0.05 / PAGE_WIDTH_IN, 1 - 0.05 / figure.get_figheight(), title, va="top", fontsize=TEXT_PT + 1.5, color=INK,
            fontweight="bold", parse_math=False,
        )  # fmt: skip
    return ax


def _rank_among_equal(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """How many equal values stand before each value."""
    earlier: NDArray[np.int64] = np.tril(values[:, None] == values, k=-1).sum(axis=1)
    return earlier


def _draw_lines(ax: Axes, lines: Mapping[str, float], height_in: float) -> None:
    """Vertical lines with their names above the axes, each on a line of its own.

    Names stand towards the middle; those of outer lines stand higher, so that no line runs through a name.
    """
    levels = sorted(lines, key=lambda name: (lines[name] > 60, lines[name] if lines[name] <= 60 else -lines[name]))
    for number, (name, value) in enumerate(lines.items()):
        colour = CURVE_COLOURS[1:][number % (len(CURVE_COLOURS) - 1)]
        top = 1 + (0.1 + 0.22 * (len(lines) - 1 - levels.index(name))) / height_in
        ax.plot(
            [value, value], [0, top], transform=ax.get_xaxis_transform(), color=colour, linewidth=1.3, linestyle="--",
            clip_on=False, zorder=1, gid="line",
        )  # fmt: skip
        ax.annotate(
            f"{name}: {value:.3g} %", (value, top), xycoords=ax.get_xaxis_transform(), textcoords="offset points",
            xytext=(-4 if value > 60 else 4, 0), ha="right" if value > 60 else "left", va="center", color=colour,
            fontsize=SMALL_PT, parse_math=False, annotation_clip=False,
        )  # fmt: skip
