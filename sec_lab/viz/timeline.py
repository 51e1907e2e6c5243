"""Events on the time axis of a movie, those that were found beside the true ones."""

from collections.abc import Iterable

from matplotlib.axes import Axes

from sec_lab.takes_and_puts import EventAgreement
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

_ROW_IN, _LETTER_IN = 0.3, 0.62 * SMALL_PT / 72
_HIT, _FALSE = CURVE_COLOURS[2], CURVE_COLOURS[1]


def draw_events(
    agreement: EventAgreement,
    *,
    n_frames: int,
    spans: Iterable[tuple[int, int]] = (),
    spans_name: str = "",
    title: str | None = None,
) -> Axes:
    """Draw events that were found and the true ones over the frames of a movie, a row for each kind of event.

    Parameters
    ----------
    agreement : EventAgreement
        What :func:`~sec_lab.takes_and_puts.match_events` gives.
    n_frames : int
        Length of the movie.
    spans : iterable of (int, int), optional
        First and last frames of what shall be shaded, e.g. of hands being in the picture.
    spans_name : str, optional
        What these spans are.
    title : str, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If there is no event at all.

    Examples
    --------
    >>> from sec_lab.takes_and_puts import match_events
    >>> found = match_events([("put", 42)], [("put", 40), ("take", 9)], tolerance_frames=5)
    >>> ax = draw_events(found, n_frames=60)
    >>> [label.get_text() for label in ax.get_yticklabels()]
    ['take', 'put']
    """
    table = agreement.to_frame()
    if table.empty:
        raise ValueError("events: expected at least one, found or true")
    kinds = list(dict.fromkeys(table["event"]))
    row_of = {kind: row for row, kind in enumerate(kinds)}
    left_in = 0.2 + _LETTER_IN * max(map(len, kinds))
    top_in = 0.35 if title is not None else 0.1
    height_in = _ROW_IN * len(kinds)
    figure = new_figure(PAGE_WIDTH_IN, top_in + height_in + 0.85)
    ax = axes_at(
        figure, left_in=left_in, top_in=top_in, width_in=PAGE_WIDTH_IN - left_in - 0.15, height_in=height_in
    )  # fmt: skip
    tidy(ax, title=title)
    for number, (first, last) in enumerate(spans):
        ax.axvspan(first, last, color=LINE, alpha=0.6, linewidth=0, label=spans_name if number == 0 else None)
    true = [(what, frame) for what, frame, _ in agreement.hits] + list(agreement.missed)
    for events, marker, colour, size, name in (
        (true, "|", INK, 15.0, "true"),
        ([(what, found) for what, _, found in agreement.hits], "o", _HIT, 6.0, "found, a hit"),
        (list(agreement.false), "X", _FALSE, 7.0, "found, false"),
    ):
        frames, rows = [frame for _, frame in events], [row_of[what] for what, _ in events]
        ax.plot(frames, rows, marker, color=colour, markersize=size, markeredgewidth=1.6 if marker == "|" else 0.0,
                label=name, clip_on=False)  # fmt: skip
    ax.set(xlim=(0, n_frames), ylim=(len(kinds) - 0.5, -0.5))
    ax.set_yticks(range(len(kinds)), kinds, parse_math=False)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=True, axis="y", color=LINE, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.set_xlabel("frame", fontsize=TEXT_PT, color=SOFT)
    ax.legend(
        loc="upper center", bbox_to_anchor=(0.45, -0.42 / height_in), ncols=4, frameon=False, fontsize=SMALL_PT,
        labelcolor=INK, borderaxespad=0.0, handlelength=1.4,
    )  # fmt: skip
    return ax
