"""How far found begins and ends of actions are from the true ones."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sec_lab.worlds.tabletop.deeds import TimedDeed

if TYPE_CHECKING:
    import pandas as pd

Extent = Literal["hold", "visit"]
Found = tuple[str, int, int]
"""Kind of an action, and the frames in which it begins and ends."""


def timing_errors(found: Iterable[Found], deeds: Sequence[TimedDeed], *, extent: Extent = "hold") -> "pd.DataFrame":
    """Compare what a detector found in a movie with what happens there.

    What was found is paired one to one with deeds of its kind so that all errors together are least; what does not
    overlap with the visit of the hand is paired with nothing.

    Parameters
    ----------
    found : iterable of (kind, begin, end)
    deeds : sequence of TimedDeed
        The truth.
    extent : {"hold", "visit"}, optional
        What counts as true: ``begin`` and ``end`` of the deed, from contacts; or the visit of the hand, from its
        appearance until it is gone.

    Returns
    -------
    pandas.DataFrame
        One row a deed: ``kind``, ``what``, true ``begin`` and ``end``, ``found_begin`` and ``found_end``,
        ``begin_error`` and ``end_error`` in frames, found minus true; NaN where it was not found.
        ``attrs["superfluous"]`` is the number of those that were found and are paired with nothing.

    Raises
    ------
    ValueError
        If the extent is unknown, or something found ends before it begins.

    Examples
    --------
    >>> deed = TimedDeed("putting", "hand", "object", "plate", begin=40, end=80, appears=20, leaves=100)
    >>> errors = timing_errors([("putting", 43, 81), ("putting", 5, 15)], [deed])
    >>> errors[["begin_error", "end_error"]].to_numpy().tolist(), errors.attrs["superfluous"]
    ([[3.0, 1.0]], 1)
    """
    import pandas as pd

    if extent not in get_args(Extent):
        raise ValueError(f"extent: expected one of {', '.join(get_args(Extent))}, got {extent!r}")
    intervals = list(found)
    for kind, begin, end in intervals:
        if begin > end:
            raise ValueError(f"found: expected begins before ends, got {kind} from {begin} to {end}")
    partner = _paired(intervals, deeds, extent)
    rows = []
    for number, deed in enumerate(deeds):
        begin, end = _true(deed, extent)
        found_begin, found_end = map(float, intervals[partner[number]][1:] if number in partner else (np.nan, np.nan))
        rows.append(
            {
                "kind": deed.kind,
                "what": deed.what,
                "begin": begin,
                "end": end,
                "found_begin": found_begin,
                "found_end": found_end,
                "begin_error": found_begin - begin,
                "end_error": found_end - end,
            }
        )
    table = pd.DataFrame(rows)
    table.attrs["superfluous"] = len(intervals) - len(partner)
    return table


def _true(deed: TimedDeed, extent: Extent) -> tuple[int, int]:
    return (deed.begin, deed.end) if extent == "hold" else (deed.appears, deed.leaves)


def _paired(intervals: Sequence[Found], deeds: Sequence[TimedDeed], extent: Extent) -> dict[int, int]:
    """Number of the interval that belongs to each deed, where there is one."""
    from scipy.optimize import linear_sum_assignment

    if not (intervals and deeds):
        return {}
    cost: NDArray[np.float64] = np.full((len(deeds), len(intervals)), np.inf)
    for row, deed in enumerate(deeds):
        begin, end = _true(deed, extent)
        for column, (kind, found_begin, found_end) in enumerate(intervals):
            if kind == deed.kind and found_begin < deed.leaves and found_end >= deed.appears:
                cost[row, column] = abs(found_begin - begin) + abs(found_end - end)
    # A pair that cannot be is dearer than all others together.
    never = 1 + cost[np.isfinite(cost)].sum()
    rows, columns = linear_sum_assignment(np.where(np.isfinite(cost), cost, never))
    return {int(i): int(j) for i, j in zip(rows, columns, strict=True) if np.isfinite(cost[i, j])}
