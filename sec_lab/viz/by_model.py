"""Similarity of movies to learned models: one value a movie (Fig. 2.12), and over time (§2.9)."""

from collections.abc import Iterable, Mapping
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sec_lab.viz.style import (
    CURVE_COLOURS,
    INK,
    LINE,
    PAGE_WIDTH_IN,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    axes_at,
    figure_of,
    new_figure,
    tidy,
)

if TYPE_CHECKING:
    import pandas as pd

# The thesis's colours: red and blue for the two models; green, yellow and blue areas for groups of movies.
_MODELS = ("#e2553f", "#2459ad", *CURVE_COLOURS[2:])
_AREAS = ("#dcefdc", "#f8f0cf", "#dbe6f6", "#ece2f5")
_DASHES: tuple[tuple[float, ...], ...] = ((), (4.0, 1.6), (1.4, 1.2), (6.0, 1.5, 1.4, 1.5), (3.0, 1.0), (8.0, 2.0))
_PANEL_IN, _GAP_IN, _LEFT_IN, _RIGHT_IN = 1.05, 0.42, 0.75, 1.45

Span = tuple[str, int, int]


def draw_by_model(
    frame: "pd.DataFrame", groups: Mapping[str, str], *, threshold: float | None = None, title: str | None = None
) -> Axes:
    """Draw the similarity of every movie to every model (Fig. 2.12).

    Parameters
    ----------
    frame : pandas.DataFrame
        Percent; one row a movie, one column a model, at most six.
    groups : mapping of str to str
        Group of each movie; movies of a group stand beside each other, on a ground of one colour.
    threshold : float, optional
        A dashed line at this similarity.
    title : str, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If there is nothing to draw, there are more than six models, or a movie has no group.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"Putting": [90.0, 40.0], "Taking": [45.0, 88.0]}, ["P1", "T1"])
    >>> ax = draw_by_model(frame, {"P1": "Putting", "T1": "Taking"}, threshold=64)
    >>> ax.get_ylabel()
    'similarity in %'
    """
    if not len(frame) or not 1 <= frame.shape[1] <= len(_MODELS):
        raise ValueError(f"models: expected at least one movie and one to six models, got shape {frame.shape}")
    missing = [name for name in frame.index if name not in groups]
    if missing:
        raise ValueError(f"groups: expected a group for every movie, got none for {missing[0]!r}")
    ax = new_figure(PAGE_WIDTH_IN, 3.0, layout="constrained").add_subplot()
    places = np.arange(len(frame))
    start = 0
    for number, (group, members) in enumerate(groupby(frame.index, key=groups.__getitem__)):
        end = start + len(list(members))
        ax.axvspan(start - 0.5, end - 0.5, color=_AREAS[number % len(_AREAS)], linewidth=0)
        ax.text((start + end - 1) / 2, 103, group, ha="center", va="bottom", fontsize=SMALL_PT, color=SOFT)
        start = end
    width = 0.8 / frame.shape[1]
    for number, name in enumerate(frame.columns):
        at = places + (number - (frame.shape[1] - 1) / 2) * width
        ax.bar(at, frame[name].to_numpy(), width=0.92 * width, color=_MODELS[number], label=str(name))
    _finish(ax, threshold)
    tidy(ax)
    if title is not None:
        ax.set_title(title, loc="left", fontsize=TEXT_PT + 1.5, color=INK, fontweight="bold", pad=16)
    ax.set_xticks(places, [str(name) for name in frame.index])
    ax.set(xlim=(-0.5, len(frame) - 0.5), ylim=(0, 102))
    ax.set_xlabel("movie", fontsize=TEXT_PT, color=SOFT)
    ax.set_ylabel("similarity in %", fontsize=TEXT_PT, color=SOFT)
    ax.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def draw_over_time(
    curves: Mapping[str, "pd.DataFrame"],
    *,
    spans: Mapping[str, Iterable[Span]] | None = None,
    threshold: float | None = None,
) -> Figure:
    """Draw how the similarity to each model grows in the course of movies, one panel a movie.

    Parameters
    ----------
    curves : mapping of str to pandas.DataFrame
        By movie. Index: frames; one column a model, at most six, the same in all movies; percent. A value holds until
        the next frame of the index.
    spans : mapping of str to iterable of (model, begin, end), optional
        By movie: bars in the colour of a model, e.g. when its action really takes place.
    threshold : float, optional
        A dashed line at this similarity.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If there is no movie, or the models differ, or a span is of none of them.

    Examples
    --------
    >>> import pandas as pd
    >>> curve = pd.DataFrame({"Putting": [0.0, 50.0, 100.0]}, index=[0, 20, 40])
    >>> figure = draw_over_time({"(a)": curve}, spans={"(a)": [("Putting", 15, 42)]})
    >>> figure.axes[0].get_title(loc="left")
    '(a)'
    """
    models = [list(frame.columns) for frame in curves.values()]
    if not models or any(names != models[0] for names in models) or not 1 <= len(models[0]) <= len(_MODELS):
        raise ValueError(f"curves: expected one to six models, the same in every movie, got {models}")
    colours = dict(zip(models[0], _MODELS, strict=False))
    height_in = 0.3 + len(curves) * (_PANEL_IN + _GAP_IN)
    figure = new_figure(PAGE_WIDTH_IN, height_in + 0.15)
    width_in = PAGE_WIDTH_IN - _LEFT_IN - _RIGHT_IN
    last = max(int(frame.index[-1]) for frame in curves.values())
    for number, (movie, frame) in enumerate(curves.items()):
        top_in = 0.3 + number * (_PANEL_IN + _GAP_IN)
        ax = axes_at(figure, left_in=_LEFT_IN, top_in=top_in, width_in=width_in, height_in=_PANEL_IN)
        for place, name in enumerate(frame.columns):
            (line,) = ax.step(
                frame.index.to_numpy(), frame[name].to_numpy(), where="post", color=colours[name], linewidth=1.8,
                label=str(name),
            )  # fmt: skip
            if _DASHES[place]:
                line.set_dashes(_DASHES[place])
        for name, begin, end in (spans or {}).get(movie, ()):
            if name not in colours:
                raise ValueError(f"spans: expected one of the models {models[0]}, got {name!r}")
            low = 0.02 + 0.1 * models[0].index(name)
            ax.axvspan(begin, end, low, low + 0.07, color=colours[name], alpha=0.45, linewidth=0)
        _finish(ax, threshold)
        tidy(ax, title=movie)
        ax.set(xlim=(0, last), ylim=(0, 104), yticks=[0, 50, 100])
        ax.set_ylabel("similarity in %", fontsize=SMALL_PT, color=SOFT)
    figure.axes[-1].set_xlabel("frame", fontsize=TEXT_PT, color=SOFT)
    figure.axes[0].legend(
        frameon=False, fontsize=SMALL_PT, labelcolor=INK, loc="upper left", bbox_to_anchor=(1.0, 1.05), handlelength=2.6
    )
    return figure


def _finish(ax: Axes, threshold: float | None) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(visible=True, axis="y", color=LINE, linewidth=0.6)
    ax.set_axisbelow(True)
    if threshold is not None:
        ax.axhline(threshold, color=INK, linewidth=0.9, dashes=(5, 3))
    figure_of(ax).align_ylabels()
