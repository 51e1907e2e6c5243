"""Figures of chapter 3: curves over noise, bars of true and false positives, precision and recall, networks, models."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from sec_lab.viz.chain import draw_chain
from sec_lab.viz.curves import draw_curves
from sec_lab.viz.style import CURVE_COLOURS, INK, LINE, PAGE_WIDTH_IN, PAPER, SMALL_PT, SOFT, TEXT_PT, new_figure, tidy

if TYPE_CHECKING:
    import pandas as pd

    from sec_lab.action_model import ActionModel
    from sec_lab.noise import NoisySamples

TP_COLOUR, FP_COLOUR = CURVE_COLOURS[:2]
ADDED_COLOUR = "#b00020"
CLASS_COLOURS = ("#d62f2f", "#2f8f4b", "#2459ad", "#22262c")
"""Red, green, blue and black for the classes, as in Fig. 3.10."""


def draw_levels(
    mean: "pd.DataFrame",
    error: "pd.DataFrame | None" = None,
    *,
    y_label: str,
    threshold: float | None = None,
    ax: Axes | None = None,
    title: str | None = None,
) -> Axes:
    """Draw means in percent over noise levels, with bars of their standard errors (Fig. 3.2, 3.4, 3.5).

    Parameters
    ----------
    mean, error : pandas.DataFrame
        One row a level, one column a curve; at most six.
    y_label : str
    threshold : float, optional
        A level in percent that gets a thin line, named at its right end.
    ax, title : optional

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import pandas as pd
    >>> mean = pd.DataFrame({"seed": [100.0, 50.0]}, index=pd.Index([0, 1], name="noise level p"))
    >>> draw_levels(mean, mean / 50, y_label="similarity in %").get_xlabel()
    'noise level p'
    """
    ax = draw_curves(mean, y_label=y_label, ax=ax, title=title)
    if error is not None:
        for colour, name in zip(CURVE_COLOURS, mean.columns, strict=False):
            ax.errorbar(mean.index, mean[name], error[name], fmt="none", ecolor=colour, elinewidth=1.0, capsize=2.5)
    if threshold is not None:
        ax.axhline(threshold, color=SOFT, linewidth=0.8, linestyle=(0, (2, 2)))
        # Right of the axes, where no curve can cross it; a legend that stands there makes room.
        ax.annotate(f"{threshold:g} %", (1.01, threshold), xycoords=("axes fraction", "data"), va="center",
                    fontsize=SMALL_PT, color=SOFT, annotation_clip=False)  # fmt: skip
        legend = ax.get_legend()
        if legend is not None:
            legend.set_bbox_to_anchor((1.1, 0.5))
    ax.set_ylim(0, 105)
    return ax


def draw_noisy_sample(
    samples: "NoisySamples", number: int = 0, *, ax: Axes | None = None, title: str | None = None
) -> Axes:
    """Draw a noisy sample, with red frames around the rows and columns that noise has added (Fig. 3.1).

    Parameters
    ----------
    samples : NoisySamples
    number : int, optional
        Which of them.
    ax, title : optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If there is no such sample.

    Examples
    --------
    >>> from sec_lab.noise import noisy_samples
    >>> from sec_lab.noise_seeds import LIFTING
    >>> len(draw_noisy_sample(noisy_samples(LIFTING, 1.0, rng=np.random.default_rng(0))).patches) >= 6
    True
    """
    if not -len(samples) <= number < len(samples):
        raise ValueError(f"number: expected one of {len(samples)} samples, got {number}")
    ax = draw_chain(samples[number], ax=ax, title=title)
    # Every other place is a gap of the seed.
    rows, columns = (np.flatnonzero(there[number]) % 2 == 1 for there in (samples.rows, samples.columns))
    frames = [((0, y), len(columns), 1) for y in np.flatnonzero(rows).tolist()]
    frames += [((x, 0), 1, len(rows)) for x in np.flatnonzero(columns).tolist()]
    for corner, width, height in frames:
        ax.add_patch(Rectangle(corner, width, height, fill=False, edgecolor=ADDED_COLOUR, linewidth=2.2, clip_on=False,
                               zorder=5, gid="added"))  # fmt: skip
    return ax


def draw_positives(frames: "Mapping[str, pd.DataFrame]", *, title: str | None = None, height_in: float = 2.0) -> Figure:
    """Draw true and false positives of every class, one column of axes a classifier (Fig. 3.9).

    Parameters
    ----------
    frames : mapping of str to pandas.DataFrame
        By classifier, of :func:`~sec_lab.opponents.positives`.
    title : str, optional
    height_in : float, optional
        Height of a row in inches.

    Returns
    -------
    matplotlib.figure.Figure
    """
    first = next(iter(frames.values()))
    classes = list(dict.fromkeys(first.columns.get_level_values(0)))
    figure = new_figure(PAGE_WIDTH_IN, height_in * len(classes) + 0.3, layout="constrained")
    grid = figure.subplots(len(classes), len(frames), sharex=True, sharey=True, squeeze=False)
    for row, name in zip(grid, classes, strict=True):
        for ax, (classifier, frame) in zip(row, frames.items(), strict=True):
            levels = frame.index.to_numpy()
            for shift, kind, colour in ((-0.018, "TP", TP_COLOUR), (0.018, "FP", FP_COLOUR)):
                ax.bar(levels + shift, frame[name, kind], 0.036, color=colour, label=kind)
            tidy(ax, title=f"{name}: {classifier}")
            ax.set_xticks(levels)
    for ax in grid[:, 0]:
        ax.set_ylabel("% of a class", fontsize=TEXT_PT)
    for ax in grid[-1]:
        ax.set_xlabel("noise level p", fontsize=TEXT_PT)
    grid[0, -1].legend(fontsize=SMALL_PT, frameon=False, loc="upper right")
    if title:
        figure.suptitle(title, fontsize=TEXT_PT)
    return figure


def draw_precision_recall(
    curves: Mapping[float, Mapping[str, Mapping[str, tuple[Any, Any]]]],
) -> Figure:
    """Draw precision against recall, one axes a noise level; classes by colour, classifiers by dashes (Fig. 3.10).

    Parameters
    ----------
    curves : mapping of float to mapping of str to mapping of str to (recall, precision)
        By level, classifier and class; at most four of each.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(PAGE_WIDTH_IN, 2.6 * -(-len(curves) // 2) + 0.5, layout="constrained")
    grid = figure.subplots(-(-len(curves) // 2), 2, sharex=True, sharey=True, squeeze=False)
    for ax, (level, by_classifier) in zip(grid.flat, curves.items(), strict=False):
        for dashes, (classifier, by_class) in zip(("-", "--", ":", "-."), by_classifier.items(), strict=False):
            for colour, (name, (recall, precision)) in zip(CLASS_COLOURS, by_class.items(), strict=False):
                ax.plot(recall, precision, dashes, color=colour, linewidth=1.3, label=f"{name}, {classifier}")
        tidy(ax, title=f"p = {level:g}")
        ax.set(xlim=(0, 1.02), ylim=(0, 1.04))
    for ax in grid[-1]:
        ax.set_xlabel("recall", fontsize=TEXT_PT)
    for ax in grid[:, 0]:
        ax.set_ylabel("precision", fontsize=TEXT_PT)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=SMALL_PT, frameon=False)
    return figure


def draw_network(sizes: Sequence[int], *, names: Sequence[str] = ("input", "hidden", "hidden", "output")) -> Figure:
    """Draw the layers of a network and their connections; large layers are shortened (Fig. 3.8).

    Parameters
    ----------
    sizes : sequence of int
        Units of each layer.
    names : sequence of str, optional
        Of the layers.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(PAGE_WIDTH_IN, 2.9, layout="constrained")
    ax = figure.add_subplot()
    places = [np.linspace(-1, 1, min(size, 9)) * min(size, 9) / 9 for size in sizes]
    for x, (before, after) in enumerate(pairwise(places)):
        for y in before:
            ax.plot(np.stack([np.full(len(after), x), np.full(len(after), x + 1)]), [np.full(len(after), y), after],
                    color=LINE, linewidth=0.6, zorder=1)  # fmt: skip
    for x, (size, ys, name) in enumerate(zip(sizes, places, names, strict=True)):
        ax.scatter(np.full(len(ys), x), ys, s=70, color=PAPER, edgecolor=INK, linewidth=1.0, zorder=2)
        ax.text(x, 1.2, f"{name}: {size}", ha="center", fontsize=TEXT_PT, color=INK)
        if size > len(ys):
            ax.text(x - 0.06, 0, "⋮", ha="right", va="center", fontsize=TEXT_PT, color=SOFT)
    ax.set(xlim=(-0.4, len(sizes) - 0.6), ylim=(-1.15, 1.4))
    ax.axis("off")
    return figure


def draw_models(models: "Mapping[str, ActionModel | None]") -> Figure:
    """Draw learned models side by side, with the weights of rows at the right and of columns below (Fig. 3.7).

    Parameters
    ----------
    models : mapping of str to ActionModel or None
        By title; None where nothing could be learned.

    Returns
    -------
    matplotlib.figure.Figure
    """
    tallest = max([len(model.row_weights) for model in models.values() if model is not None], default=1)
    figure = new_figure(PAGE_WIDTH_IN, 0.3 * tallest + 1.0, layout="constrained")
    for ax, (title, model) in zip(np.atleast_1d(figure.subplots(1, len(models))), models.items(), strict=True):
        if model is None:
            ax.text(0.5, 0.5, "nothing learned", ha="center", fontsize=TEXT_PT, color=SOFT, transform=ax.transAxes)
            ax.axis("off")
            ax.set_title(title, loc="left", fontsize=TEXT_PT, color=INK)
            continue
        draw_chain(model.chain, ax=ax, legend=False)
        ax.set_title(title, loc="left", fontsize=TEXT_PT, color=INK)
        k = model.chain.relations.shape[1]
        for row, weight in enumerate(model.row_weights):
            ax.text(k + 0.1, row + 0.5, f"{weight:.2f}", va="center", fontsize=SMALL_PT - 1, color=SOFT, clip_on=False)
        ax.set_xticks(np.arange(k) + 0.5, [f"{weight:.2f}" for weight in model.column_weights], rotation=90,
                      fontsize=SMALL_PT - 1)  # fmt: skip
        ax.set_xlabel("weights of columns", fontsize=SMALL_PT)
    return figure
