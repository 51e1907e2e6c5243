"""Cleaning of a recording before roles are looked for: named steps, each of which can be left out.

Real chains drown in fragments and bystanders. Every step takes a history and gives a smaller or calmer one; none needs
to know what the segments are.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.role_tables.history import SegmentHistory, settled

# Of the time that two segments share, or that the shorter-lived of them is there: enough to be called "always".
_NEARLY_ALWAYS = 0.95
_MOSTLY = 0.8
# Sums of shares that are equal may differ by rounding, which may depend on the order of segments.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Cleaning:
    """Which steps are done, and how far they go.

    Attributes
    ----------
    touching_only : bool
        See :func:`drop_untouched`.
    bridged : bool
        See :func:`bridge_absences`.
    hand_percent : float or None
        Tolerance of :func:`merge_with_hand`; None leaves the step out.
    short_percent : float or None
        Limit of :func:`drop_short_lived`; None leaves the step out.
    together_percent : float or None
        Limit of :func:`merge_moving_together`; None leaves the step out.

    Raises
    ------
    ValueError
        If a percentage is not from 0 to 100.

    Examples
    --------
    >>> Cleaning(short_percent=120)
    Traceback (most recent call last):
    ...
    ValueError: short_percent: expected 0 to 100 or None, got 120
    """

    touching_only: bool = True
    bridged: bool = True
    hand_percent: float | None = 5.0
    short_percent: float | None = 5.0
    together_percent: float | None = 10.0

    def __post_init__(self) -> None:
        for name in ("hand_percent", "short_percent", "together_percent"):
            value = getattr(self, name)
            if value is not None and not 0 <= value <= 100:
                raise ValueError(f"{name}: expected 0 to 100 or None, got {value}")


NO_CLEANING = Cleaning(touching_only=False, bridged=False, hand_percent=None, short_percent=None, together_percent=None)
"""Nothing is cleaned: what the steps are measured against."""


STEPS: Mapping[str, str] = {
    "touching_only": "only what ever touches",
    "bridged": "absences bridged",
    "hand_percent": "fragments merged to the hand",
    "short_percent": "short-lived dropped",
    "together_percent": "moving together merged",
}
"""The steps in words, by their parameter."""


def cleanings_step_by_step() -> dict[str, Cleaning]:
    """Nothing cleaned, then each step of :data:`STEPS` added to those before it.

    Examples
    --------
    >>> list(cleanings_step_by_step())[:3]
    ['nothing', '+ only what ever touches', '+ absences bridged']
    """
    found, now = {"nothing": NO_CLEANING}, NO_CLEANING
    for step, words in STEPS.items():
        now = replace(now, **{step: getattr(Cleaning(), step)})
        found[f"+ {words}"] = now
    return found


def cleanings_one_by_one() -> dict[str, Cleaning]:
    """Each step of :data:`STEPS` alone, and all but it.

    Examples
    --------
    >>> len(cleanings_one_by_one()), cleanings_one_by_one()["all but: absences bridged"].bridged
    (10, False)
    """
    whole = Cleaning()
    alone = {f"only: {words}": replace(NO_CLEANING, **{step: getattr(whole, step)}) for step, words in STEPS.items()}
    return alone | {
        f"all but: {words}": replace(whole, **{step: getattr(NO_CLEANING, step)}) for step, words in STEPS.items()
    }


def clean(history: SegmentHistory, *, hands: Sequence[int], cleaning: Cleaning) -> SegmentHistory:
    """All steps that are asked for; the hand is the first segment of the result.

    Parameters
    ----------
    history : SegmentHistory
    hands : sequence of int
        Labels of the segments that are known to be the hand, at least one; they are merged.
    cleaning : Cleaning

    Raises
    ------
    ValueError
        If there is no hand, or it is not in the history.

    Examples
    --------
    A hand (7) and its sleeve (8), a cup (1) and what nobody touches (2):

    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.history import segment_history
    >>> rows = [[9, 2, 2, 9], [9, 0, 2, 9], [9, 0, 0, 9], [0, 0, 0, 0]]
    >>> seen = segment_history(EventChain(rows, [(7, 8), (7, 1), (8, 1), (1, 2)]))
    >>> clean(seen, hands=[7], cleaning=Cleaning()).members
    ((7, 8), (1,))
    """
    if not len(hands):
        raise ValueError("hands: expected at least one segment, got none")
    group = list(dict.fromkeys(history.index_of(hand) for hand in hands))
    if cleaning.bridged:
        history = bridge_absences(history)
    history = merge(history, group)
    hand = history.members[0][0]
    if cleaning.touching_only:
        history = drop_untouched(history, keep=hand)
    if cleaning.hand_percent is not None:
        history = merge_with_hand(history, hand=hand, tolerance_percent=cleaning.hand_percent)
    if cleaning.short_percent is not None:
        history = drop_short_lived(history, hand=hand, least_percent=cleaning.short_percent)
    if cleaning.together_percent is not None:
        history = merge_moving_together(history, hand=hand, most_percent=cleaning.together_percent)
    return history


def drop_untouched(history: SegmentHistory, *, keep: int | None = None) -> SegmentHistory:
    """Keep the segments that ever touch (or overlap) another one; the others are bystanders.

    Parameters
    ----------
    history : SegmentHistory
    keep : int, optional
        A segment that is kept whatever it does.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.history import segment_history
    >>> seen = segment_history(EventChain([[0, 2], [0, 0], [0, 0]], [(1, 2), (1, 3), (2, 3)]))
    >>> drop_untouched(seen).members
    ((1,), (2,))
    """
    kept: NDArray[np.bool_] = np.asarray(history.relations.any(axis=(1, 2)))
    if keep is not None:
        kept[history.index_of(keep)] = True
    return _subset(history, kept)


def bridge_absences(history: SegmentHistory) -> SegmentHistory:
    """Let a segment that vanishes and comes back be there in between, as it was when it was last seen.

    If two are hidden, or one is, their relation is the one of the key frame in which the one that has been hidden for
    longer was last seen.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.history import segment_history
    >>> seen = segment_history(EventChain([[2, 9, 2], [0, 0, 0], [0, 9, 0]], [(1, 2), (1, 3), (2, 3)]))
    >>> bridge_absences(seen).relations[0, 1]
    array([2, 2, 2], dtype=uint8)
    """
    present = history.present
    n_key_frames = present.shape[1]
    ever: NDArray[np.bool_] = np.asarray(present.any(axis=1))
    first = present.argmax(axis=1)
    last = n_key_frames - 1 - present[:, ::-1].argmax(axis=1)
    time = np.arange(n_key_frames)
    within = (time >= first[:, None]) & (time <= last[:, None]) & ever[:, None]
    gaps = np.flatnonzero((within & ~present).any(axis=1))
    if not gaps.size:
        return history
    relations = history.relations.copy()
    places = None if history.places is None else history.places.copy()
    # When each segment was last seen; before and after its life it does not matter.
    seen = np.maximum.accumulate(np.where(present | ~within, time, -1), axis=1)
    every = np.arange(len(present))[:, None]
    for i in gaps.tolist():
        relations[i] = relations[:, i] = history.relations[i][every, np.minimum(seen, seen[i])]
        if places is not None:
            places[i] = places[i, seen[i]]
    relations *= within[:, None] & within[None]
    return replace(history, present=within, relations=relations, places=places)


def merge_with_hand(history: SegmentHistory, *, hand: int, tolerance_percent: float = 5.0) -> SegmentHistory:
    """Merge to the hand what enters or leaves with it: arms, sleeves, fragments of either.

    Such a segment is absent at first and at last, as the hand is. It comes or goes when the hand does; or it touches
    the hand, and the one of both that is there for less time is there while the other is.

    Parameters
    ----------
    history : SegmentHistory
    hand : int
        Label.
    tolerance_percent : float, optional
        Difference in time, in percent of the whole, at which two still come or go together.

    Returns
    -------
    SegmentHistory
        Its first segment is the hand.

    Raises
    ------
    ValueError
        If there is no such segment, or the tolerance is not from 0 to 100.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.history import segment_history
    >>> rows = [[9, 2, 9], [9, 2, 9], [9, 0, 9], [0, 0, 0]]
    >>> seen = segment_history(EventChain(rows, [(7, 8), (7, 1), (8, 1), (1, 2)]))
    >>> merge_with_hand(seen, hand=7).members
    ((7, 8), (1,), (2,))
    """
    _check_percent(tolerance_percent, "tolerance_percent")
    present, shares = history.present, history.shares
    since = np.append(0.0, np.cumsum(shares))
    first = present.argmax(axis=1)
    last = present.shape[1] - 1 - present[:, ::-1].argmax(axis=1)
    lives = present @ shares
    comes_and_goes = ~present[:, 0] & ~present[:, -1] & (lives > 0)
    touching = history.relations == Relation.TOUCHING
    tolerance = tolerance_percent / 100 + _ROUNDING
    group = [history.index_of(hand)]
    # Again and again, as those that join may bring more; all at once, so that no order of the labels matters.
    while True:
        there: NDArray[np.bool_] = np.asarray(present[group].any(axis=0))
        if not there.any():
            break
        begin, end = int(there.argmax()), int(len(there) - 1 - there[::-1].argmax())
        with_it = (np.abs(since[first] - since[begin]) <= tolerance) | (np.abs(since[last] - since[end]) <= tolerance)
        shared = (present & there) @ shares >= _MOSTLY * np.minimum(lives, there @ shares) - _ROUNDING
        joining = comes_and_goes & (with_it | (shared & touching[group].any(axis=(0, 2))))
        joining[group] = False
        if not joining.any():
            break
        group += _by_life(history, np.flatnonzero(joining).tolist())
    return merge(history, group)


def _by_life(history: SegmentHistory, some: Sequence[int]) -> list[int]:
    """Segments in the order of how long they are there, longest first."""
    lives = (history.present[list(some)] @ history.shares).round(12).tolist()
    order: list[int] = []
    for life in sorted(set(lives), reverse=True):
        order += settled(history, [i for i, other in zip(some, lives, strict=True) if other == life])[0]
    return order


def _check_percent(value: float, name: str) -> None:
    if not 0 <= value <= 100:
        raise ValueError(f"{name}: expected 0 to 100, got {value}")


def drop_short_lived(history: SegmentHistory, *, hand: int, least_percent: float = 5.0) -> SegmentHistory:
    """Drop segments that are there for less than a share of the time; the hand stays.

    Parameters
    ----------
    history : SegmentHistory
    hand : int
        Label.
    least_percent : float, optional
        Of the whole time.

    Raises
    ------
    ValueError
        If there is no such segment, or the share is not from 0 to 100.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.history import segment_history
    >>> seen = segment_history(EventChain([[0, 0, 0], [0, 9, 9]], [(1, 2), (1, 3)], [0, 1, 50]))
    >>> drop_short_lived(seen, hand=1).members
    ((1,), (2,))
    """
    _check_percent(least_percent, "least_percent")
    kept = history.present @ history.shares >= least_percent / 100 - _ROUNDING
    kept[history.index_of(hand)] = True
    return _subset(history, kept)


def merge_moving_together(history: SegmentHistory, *, hand: int, most_percent: float = 10.0) -> SegmentHistory:
    """Merge segments that touch and move together: a thing and its fragments.

    Two segments are merged that touch whenever both are there, and whose places relative to each other hardly change.
    Without places nothing is merged.

    # Departure: two segments that are both there at first stay apart even so, unless both of them move. They were told
    # apart before anything was done, so neither is a fragment of the other (a board and the cucumber on it); two that
    # move as one all the time are one thing that was seen in two pieces.

    Parameters
    ----------
    history : SegmentHistory
    hand : int
        Label; the hand is not merged, as it touches and moves what it holds.
    most_percent : float, optional
        Largest change of their relative place, in percent of how far the hand gets from where it was first seen.

    Raises
    ------
    ValueError
        If there is no such segment, or the limit is not from 0 to 100.

    Examples
    --------
    A box (1) and the part of it (2) that is seen as a segment of its own once a hand (7) pushes it:

    >>> places = np.array([[[0, 0], [0, 0], [9, 0]], [[np.nan] * 2, [1, 0], [10, 0]], [[np.nan] * 2, [0, 5], [9, 5]]])
    >>> present = ~np.isnan(places[..., 0])
    >>> relations = np.zeros((3, 3, 3), np.uint8)
    >>> relations[0, 1, 1:] = relations[1, 0, 1:] = relations[0, 2, 1:] = relations[2, 0, 1:] = 2
    >>> seen = SegmentHistory(((1,), (2,), (7,)), present, relations, places, np.array([0, 10, 20]))
    >>> merge_moving_together(seen, hand=7).members
    ((1, 2), (7,))
    """
    _check_percent(most_percent, "most_percent")
    places, present = history.places, history.present
    if places is None:
        return history
    at_hand = history.index_of(hand)
    way = places[at_hand, present[at_hand]]
    reach = float(np.linalg.norm(way - way[0], axis=1).max()) if len(way) else 0.0
    at_first = present[:, 0]
    both = present[:, None] & present[None]
    shares = history.shares
    shared = both @ shares
    touched = (history.relations > 0) @ shares
    moves = _extents(places, present) > most_percent / 100 * reach
    apart_at_first = (at_first[:, None] & at_first) & ~(moves[:, None] & moves)
    close = (shared > 0) & (touched >= _NEARLY_ALWAYS * shared - _ROUNDING) & ~apart_at_first
    close[at_hand] = close[:, at_hand] = False
    roots = np.arange(len(present))
    for i, j in np.argwhere(np.triu(close, k=1)).tolist():
        apart = places[i, both[i, j]] - places[j, both[i, j]]
        if np.linalg.norm(apart - apart[0], axis=1).max() < most_percent / 100 * reach:
            roots[roots == roots[j]] = roots[i]
    if len(np.unique(roots)) == len(roots):
        return history
    # Within a group the one that is there longest gives the place.
    order = _by_life(history, range(len(present)))
    groups = [[i for i in order if roots[i] == root] for root in dict.fromkeys(roots.tolist())]
    return _merged(history, groups)


def _extents(places: NDArray[np.float64], present: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Diagonal of the box around the path of each segment, shape (n,)."""
    there = present[..., None]
    low, high = np.where(there, places, np.inf).min(axis=1), np.where(there, places, -np.inf).max(axis=1)
    diagonals: NDArray[np.float64] = np.linalg.norm(np.maximum(high - low, 0.0), axis=1)
    return diagonals


def merge(history: SegmentHistory, group: Sequence[int]) -> SegmentHistory:
    """Merge some segments, given by their index, into one; it becomes the first.

    It is there while any of them is and touches what any of them touches; its place is that of the first of them that
    is there.
    """
    others = [[i] for i in range(len(history.members)) if i not in group]
    return _merged(history, [list(group), *others])


def _merged(history: SegmentHistory, groups: Sequence[Sequence[int]]) -> SegmentHistory:
    firsts = np.array([group[0] for group in groups])
    present, relations = history.present[firsts], history.relations[np.ix_(firsts, firsts)]
    places = None if history.places is None else history.places[firsts]
    for a, group in enumerate(groups):
        if len(group) == 1:
            continue
        present[a] = history.present[list(group)].any(axis=0)
        if places is not None and history.places is not None:
            for i in group[1:]:
                unknown = np.isnan(places[a, :, 0])
                places[a, unknown] = history.places[i, unknown]
    for a, group in enumerate(groups):
        if len(group) == 1:
            continue
        touched = history.relations[list(group)].max(axis=0)
        for b, other in enumerate(groups):
            if a != b:
                relations[a, b] = relations[b, a] = touched[list(other)].max(axis=0)
        relations[a, a] = 0
    members = tuple(tuple(label for i in group for label in history.members[i]) for group in groups)
    return SegmentHistory(members, present, relations, places, history.key_frames)


def _subset(history: SegmentHistory, kept: NDArray[np.bool_]) -> SegmentHistory:
    if kept.all():
        return history
    at = np.flatnonzero(kept)
    places = None if history.places is None else history.places[at]
    members = tuple(history.members[i] for i in at.tolist())
    return SegmentHistory(members, history.present[at], history.relations[np.ix_(at, at)], places, history.key_frames)
