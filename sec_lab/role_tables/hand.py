"""The hand, found without knowing what a hand looks like."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.role_tables.history import SegmentHistory, held, largest, segment_history, settled


@dataclass(frozen=True)
class Hand:
    """The segment that acts, or why none was found.

    Attributes
    ----------
    segment : int or None
        Label of the segment, None if there is no hand.
    reason : str
        By what it was told, or what is missing.
    doubt : str
        Which segments are equal in what decides, and by what it was settled; empty if one is ahead.
    """

    segment: int | None
    reason: str
    doubt: str = field(default="", repr=False)


def find_hand(recording: Observation | EventChain | SegmentHistory) -> Hand:
    """The segment that comes from outside, acts and leaves again.

    A hand is not there at first and at last, touches something in between, and of all such segments moves along the
    longest path. Without places the one is taken that is there longest and touches and lets go most often (the
    product of both). If the movie begins too late or ends too early to see the hand come or go, a segment that is
    absent at one of both ends will do, if it touches or lets go of something while both are there: what appears in
    touch and stays so (a liquid, a slice) does not act. Equal ones are settled by
    :func:`~sec_lab.role_tables.history.settled`.

    Parameters
    ----------
    recording : Observation, EventChain or SegmentHistory
        As recorded.

    Returns
    -------
    Hand
        Without a segment if nothing comes or goes, or what does touches nothing, or does not act.

    Raises
    ------
    ValueError
        If the recording is something else, or has no content.

    Examples
    --------
    >>> seen = EventChain([[9, 0, 2, 0, 9], [9, 0, 0, 0, 9], [0, 0, 0, 0, 0]], [(1, 7), (2, 7), (1, 2)])
    >>> find_hand(seen)
    Hand(segment=7, reason='absent at first and at last, longest there and most often touching')
    """
    history = recording if isinstance(recording, SegmentHistory) else segment_history(recording)
    if len(history.members) < 2:
        return Hand(None, f"expected at least two segments, got {len(history.members)}")
    touching = history.relations == Relation.TOUCHING
    touches = touching.any(axis=(1, 2))
    if not touches.any():
        return Hand(None, "nothing ever touches")
    away_at_first, away_at_last = ~history.present[:, 0], ~history.present[:, -1]
    come_or_go = away_at_first | away_at_last
    candidates, reason = away_at_first & away_at_last & touches, "absent at first and at last"
    if not candidates.any():
        candidates, reason = come_or_go & _acts(history, touching), "absent at first or at last"
    if candidates.any():
        how, values = _activity(history, touching)
        equal = candidates & largest(np.where(candidates, values, 0.0))
        order, doubt = settled(history, np.flatnonzero(equal).tolist())
        return Hand(history.members[order[0]][0], f"{reason}, {how}", doubt)
    if not come_or_go.any():
        return Hand(None, "no segment comes or goes")
    if not (come_or_go & touches).any():
        return Hand(None, "what comes or goes touches nothing")
    return Hand(None, "what comes or goes neither touches nor lets go of anything while it is there")


def path_lengths(history: SegmentHistory) -> NDArray[np.float64]:
    """Length of the path of each segment, in the unit of its places, shape (n,); over absences as the crow flies.

    Raises
    ------
    ValueError
        If places are not known.
    """
    if history.places is None:
        raise ValueError("places: expected those of all segments, got none")
    filled = held(history.places, history.present)
    steps: NDArray[np.float64] = np.sqrt((np.diff(filled, axis=1) ** 2).sum(axis=2)).sum(axis=1)
    return steps


def _activity(history: SegmentHistory, touching: NDArray[np.bool_]) -> tuple[str, NDArray[np.float64]]:
    if history.places is not None:
        return "longest path", path_lengths(history)
    changes = (touching[..., 1:] != touching[..., :-1]).sum(axis=(1, 2))
    return "longest there and most often touching", (history.present @ history.shares) * (1.0 + changes)


def _acts(history: SegmentHistory, touching: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which segments begin or end a touch while both are there, (n,) bool."""
    changes = touching[..., 1:] != touching[..., :-1]
    present = history.present
    through = present[:, 1:] & present[:, :-1]
    acts: NDArray[np.bool_] = (changes & through[:, None] & through).any(axis=(1, 2))
    return acts
