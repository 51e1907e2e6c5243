"""A learned model with its weights (§2.9, Fig. 2.10 b, c), and a noisy sample of a seed (§3.1, Fig. 3.1)."""

import numpy as np

from sec_lab.action_model import ActionModel
from sec_lab.noise import NoisySamples
from sec_lab.viz.cells import RowNames, table_of
from sec_lab.viz.svg.paper import SMALL_PX, Paper, draw_cells, draw_columns, draw_legend, words_px

_WEIGHT_COLOUR, _BAR_PX, _ABOVE_PX = "#2f8f6b", 70.0, 30.0


def model_svg(model: ActionModel, *, row_names: RowNames = "names", title: str = "model") -> str:
    """Draw a model: its chain, ω^r as bars at the right and ω^c as bars below.

    Parameters
    ----------
    model : ActionModel
    row_names : {"relations", "names"}, optional
    title : str, optional

    Returns
    -------
    str
        SVG.

    Examples
    --------
    >>> from sec_lab.learning import learn
    >>> from sec_lab.event_chain import EventChain
    >>> put = EventChain([[0, 2, 2, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)])
    >>> model_svg(learn([put, put])).count("data-weight")
    6
    """
    table = table_of(model.chain, form="original", row_names=row_names)
    m, k = table.before.shape
    left = words_px(table.rows) + 14
    width = float(np.clip((900 - left - _BAR_PX) / k, 14, 40))
    height = float(np.clip(520 / m, 8, 24))
    deep = _ABOVE_PX + m * height
    paper = Paper(max(left + k * width + _BAR_PX + 60, 420.0), deep + 106, label=f"{title} with its weights")
    paper.words(0, 9, title, bold=True)
    draw_cells(paper, table, x=left, y=_ABOVE_PX, cell_px=(width, height))
    beside = left + k * width + 12
    paper.words(beside, _ABOVE_PX - 11, "ωʳ (share)", size_px=SMALL_PX, soft=True)
    for row, weight in enumerate(model.row_weights.tolist()):
        y = _ABOVE_PX + row * height
        paper.rect(beside, y + 1, _BAR_PX * weight, height - 3, fill=_WEIGHT_COLOUR, data_weight=f"{weight:.2f}")
        if height >= 9:
            paper.words(beside + _BAR_PX + 5, y + height / 2, f"{weight:.2f}", size_px=min(SMALL_PX, height), soft=True)
    for column, weight in enumerate(model.column_weights.tolist()):
        x = left + column * width
        paper.rect(x + 1, deep + 6, width - 3, 34 * weight, fill=_WEIGHT_COLOUR, data_weight=f"{weight:.2f}")
        turn = f"rotate(-90 {x + width / 2:.1f} {deep + 58:.1f})" if width < 26 else None
        paper.words(
            x + width / 2, deep + 58, f"{weight:.2f}", size_px=SMALL_PX, soft=True, anchor="middle", transform=turn
        )
    paper.words(left - 8, deep + 14, "ωᶜ (share)", size_px=SMALL_PX, soft=True, anchor="end")
    draw_columns(paper, [""] * k, x=left, y=deep + 58, width=width, title="columns: what happens, in its order")
    draw_legend(paper, [table], x=0, y=deep + 98)
    return paper.markup()


def sample_svg(samples: NoisySamples, number: int, *, title: str = "sample") -> str:
    """Draw a noisy sample; what is flipped has a frame, rows and columns that noise added are pale (§3.1, Fig. 3.1).

    Parameters
    ----------
    samples : NoisySamples
    number : int
        Which of them, from 0 on.
    title : str, optional

    Returns
    -------
    str
        SVG.

    Raises
    ------
    ValueError
        If there is no such sample.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.noise import noisy_samples
    >>> seed = EventChain([[0, 2, 0], [0, 0, 2]], [(1, 2), (2, 3)])
    >>> sample_svg(noisy_samples(seed, 1.0, n_samples=1, rng=np.random.default_rng(0)), 0).count("different")
    6
    """
    if not 0 <= number < len(samples):
        raise ValueError(f"number: expected a sample from 0 to {len(samples) - 1}, got {number}")
    rows, columns = samples.rows[number], samples.columns[number]
    own = np.zeros(samples.relations.shape[1:], np.bool_)
    own[::2, ::2] = True
    flipped = np.zeros_like(own)
    flipped[::2, ::2] = samples.relations[number, ::2, ::2] != samples.seed.relations
    own, flipped = own[rows][:, columns], flipped[rows][:, columns]
    table = table_of(samples[number], form="original", row_names="names")
    m, k = table.before.shape
    left = words_px(table.rows) + 14
    width, height = float(np.clip(520 / k, 12, 26)), float(np.clip(420 / m, 10, 24))
    deep = _ABOVE_PX + m * height
    paper = Paper(max(left + k * width + 10, 420.0), deep + 62, label=title)
    paper.words(0, 9, title, bold=True)
    draw_cells(paper, table, x=left, y=_ABOVE_PX, cell_px=(width, height), faded=~own, outlined=flipped)
    draw_columns(paper, table.columns, x=left, y=deep, width=width, title="column")
    draw_legend(paper, [table], x=0, y=deep + 40)
    paper.words(0, deep + 55, "framed: flipped · pale: row or column that was added", size_px=SMALL_PX, soft=True)
    return paper.markup()
