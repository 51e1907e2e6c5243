"""Role tables: a whole recording as the handful of rows between the hand and the things it works with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation, as_relations
from sec_lab.event_chain import EventChain, Names
from sec_lab.observation import Observation
from sec_lab.role_tables.cleaning import Cleaning, clean
from sec_lab.role_tables.hand import find_hand
from sec_lab.role_tables.history import SegmentHistory, largest, segment_history, settled, time_shares
from sec_lab.role_tables.motion import up_direction, vertical_share

if TYPE_CHECKING:
    import pandas as pd

ROLES = ("hand", "object 1", "object 2", "object 3", "partner")
"""The hand; what it holds; what that works on; what else that touches; what else object 2 touches."""

ROWS = ((0, 1), (1, 2), (0, 2), (1, 3), (2, 4))
"""Pairs of roles whose relations are kept, as indices of :data:`ROLES`."""

POSITIONS = "positions"
"""What :attr:`RoleTable.missing` calls the positions of segments."""

_DEFAULT = Cleaning()


@dataclass(frozen=True, eq=False)
class RoleTable:
    """Relations between the roles of one recording, and when each role was there.

    Attributes
    ----------
    relations : (5, n_key_frames) uint8
        Rows hand–1, 1–2, hand–2, 1–3 and 2–partner; 0 apart, 2 touching, 9 one of both is absent
        (:class:`~sec_lab.codes.Relation`). Overlapping counts as touching, but for the hand: a hand in front of a
        surface does not touch it.
    present : (5, n_key_frames) bool
        When hand, object 1, object 2, object 3 and partner are there.
    segments : mapping of str to tuple of int
        Labels of the segments that play each role of :data:`ROLES`; empty for a role that is missing.
    missing : mapping of str to str
        What is missing, and why: role → reason. A missing role is absent throughout. ``"positions"`` is among them if
        none are known: then the hand is told by presence and touch alone, and no motion is known. ``"clear hand"``,
        ``"clear object 1"`` and so on are among them if several segments are equal in what decides on a role that is
        played all the same (:func:`~sec_lab.role_tables.history.settled`).
    key_frames : (n_key_frames,) int64
        Frame numbers.
    names : mapping of int to str or None
        Names of segments, for people only: no role depends on them.
    vertical_share : float
        Share of the motion of object 1 that goes up or down, 0 to 1; NaN if it is not known.
    hand_told_by : str
        How the hand was found.

    Raises
    ------
    ValueError
        If shapes disagree, a code is none of 0, 2 and 9, an absent role touches, there is no key frame, frames do not
        ascend, or the share is not from 0 to 1.
    """

    relations: NDArray[np.uint8]
    present: NDArray[np.bool_]
    segments: Mapping[str, tuple[int, ...]]
    missing: Mapping[str, str]
    key_frames: NDArray[np.int64]
    names: Names
    vertical_share: float = float("nan")
    hand_told_by: str = "given"

    def __post_init__(self) -> None:
        codes = as_relations(self.relations, ndim=2)
        present = np.array(self.present, np.bool_)
        frames = np.array(self.key_frames, np.int64)
        if codes.shape != (len(ROWS), len(frames)):
            raise ValueError(f"relations: expected shape {(len(ROWS), len(frames))}, got {codes.shape}")
        if present.shape != (len(ROLES), len(frames)):
            raise ValueError(f"present: expected shape {(len(ROLES), len(frames))}, got {present.shape}")
        if (codes == Relation.OVERLAPPING).any():
            raise ValueError("relations: expected 0, 2 and 9 in a role table, got 1")
        if not len(frames) or (frames[1:] <= frames[:-1]).any():
            raise ValueError(f"key_frames: expected at least one, ascending, got {frames.tolist()}")
        first, second = np.transpose(ROWS)
        if ((codes == Relation.TOUCHING) & ~(present[first] & present[second])).any():
            raise ValueError("relations: expected touches of roles that are there, got one of an absent role")
        if not (np.isnan(self.vertical_share) or 0 <= self.vertical_share <= 1 + 1e-9):
            raise ValueError(f"vertical_share: expected 0 to 1, or NaN, got {self.vertical_share}")
        if tuple(self.segments) != ROLES:
            raise ValueError(f"segments: expected those of the roles {ROLES}, got {tuple(self.segments)}")
        for name, array in (("relations", codes), ("present", present), ("key_frames", frames)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        for name in ("segments", "missing", "names"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __reduce__(self) -> tuple[object, ...]:
        kept = (dict(self.segments), dict(self.missing), self.key_frames, dict(self.names))
        return type(self), (self.relations, self.present, *kept, self.vertical_share, self.hand_told_by)

    @property
    def rows(self) -> NDArray[np.uint8]:
        """Five relations and, below, five presences as 0 (there) and 9 (absent), shape (10, n_key_frames)."""
        return np.vstack([self.relations, np.where(self.present, 0, Relation.ABSENT).astype(np.uint8)])

    @property
    def shares(self) -> NDArray[np.float64]:
        """Share of the time that each key frame stands for, as of :class:`~sec_lab.role_tables.SegmentHistory`."""
        return time_shares(self.key_frames)

    @property
    def chain(self) -> EventChain:
        """The five relations as an event chain between segments 1 (hand) to 5 (partner), named by their roles."""
        pairs = [(a + 1, b + 1) for a, b in ROWS]
        return EventChain(self.relations, pairs, self.key_frames, dict(enumerate(ROLES, 1)))

    def name_of(self, role: str) -> str:
        """What a role is called: the name of its segment where it has one, else its label; "–" if it is missing."""
        labels = self.segments[role]
        return (self.names.get(labels[0]) or str(labels[0])) if labels else "–"

    def to_frame(self) -> "pd.DataFrame":
        """Table for people: one row a pair of roles, then one a role; columns only where something changes.

        Examples
        --------
        >>> seen = EventChain([[9, 0, 2, 0, 9], [0, 0, 0, 0, 0], [9, 0, 0, 0, 9]], [(3, 1), (2, 1), (3, 2)])
        >>> role_table(seen).to_frame().loc["hand – object 1"].tolist()
        [9, 0, 2, 0, 9]
        """
        import pandas as pd

        rows = self.rows
        kept = np.flatnonzero(np.append(True, (rows[:, 1:] != rows[:, :-1]).any(axis=0)))
        index = [f"{ROLES[a]} – {ROLES[b]}" for a, b in ROWS] + [f"{role} there" for role in ROLES]
        frame = pd.DataFrame(rows[:, kept], index=index, columns=pd.Index(self.key_frames[kept], name="key frame"))
        return frame.rename_axis("roles")

    def __str__(self) -> str:
        who = "; ".join(f"{role}: {self.name_of(role)}" for role in ROLES)
        lacking = "".join(f"\nno {what}: {why}" for what, why in self.missing.items())
        return f"{who}\n{self.to_frame().to_string()}{lacking}"


def role_table(
    recording: Observation | EventChain | RoleTable | SegmentHistory,
    *,
    hands: Sequence[int | str] | None = None,
    cleaning: Cleaning = _DEFAULT,
) -> RoleTable:
    """Find the roles of hand and things in one recording, and keep only their rows.

    No model of any thing is needed. The hand is found by :func:`~sec_lab.role_tables.find_hand`. Object 1 is what the
    hand touches longest. Object 2 is what object 1 touches, with most beginnings and ends of touching; of equal ones
    the one that appears or vanishes while it is touched, then the one that is touched longest. Object 3 is the next of
    these, the partner is what object 2 touches otherwise, by the same rule. Where several are equal in all of this, the
    one that touched first is taken, and :attr:`RoleTable.missing` says so.

    Parameters
    ----------
    recording : Observation, EventChain or SegmentHistory
        Whatever it comes from: a movie, label masks, boxes, GraphML. A RoleTable is given back as it is. An observation
        says more than its chain: positions, and what is alone in the picture.
    hands : sequence of int or str, optional
        Labels or names of the segments that are known to be the hand; together they are one. If left out, it is found.
    cleaning : Cleaning, optional
        What is cleaned before.

    Returns
    -------
    RoleTable
        Always; what is missing is named in it with the reason, and absent throughout.

    Raises
    ------
    ValueError
        If the recording is something else, has no content, or a given hand is not in it.

    Examples
    --------
    A hand (7) takes a cup (1) that stands on a box (2):

    >>> seen = EventChain([[9, 0, 2, 2, 0, 9], [9, 0, 0, 0, 0, 9], [2, 2, 2, 0, 0, 0]], [(7, 1), (7, 2), (2, 1)])
    >>> table = role_table(seen)
    >>> dict(table.segments)
    {'hand': (7,), 'object 1': (1,), 'object 2': (2,), 'object 3': (), 'partner': ()}
    >>> table.relations[1], table.missing["object 3"]
    (array([2, 2, 2, 0, 0, 0], dtype=uint8), 'object 1 touches nothing else')
    """
    if isinstance(recording, RoleTable):
        return recording
    names: Names = {} if isinstance(recording, SegmentHistory) else recording_names(recording)
    history = recording if isinstance(recording, SegmentHistory) else segment_history(recording)
    if hands is None:
        found = find_hand(history)
        labels, told_by, doubt = ([] if found.segment is None else [found.segment]), found.reason, found.doubt
    else:
        labels, told_by, doubt = _known_hands(hands, history, names), "given", ""
    if not labels:
        return _without_hand(history, names, told_by)
    cleaned = clean(history, hands=labels, cleaning=cleaning)
    at, missing = _roles(cleaned)
    missing = ({f"clear {ROLES[0]}": doubt} if doubt else {}) | missing | _without_positions(history)
    relations = np.full((len(ROWS), len(history.key_frames)), Relation.ABSENT, np.uint8)
    present = np.zeros((len(ROLES), len(history.key_frames)), np.bool_)
    for role, i in enumerate(at):
        if i is not None:
            present[role] = cleaned.present[i]
    for row, (a, b) in enumerate(ROWS):
        i, j = at[a], at[b]
        if i is not None and j is not None:
            touching = cleaned.relations[i, j] > (Relation.OVERLAPPING if a == 0 else Relation.NON_TOUCHING)
            codes = np.where(touching, Relation.TOUCHING, Relation.NON_TOUCHING)
            relations[row] = np.where(present[a] & present[b], codes, Relation.ABSENT)
    segments = {role: () if i is None else cleaned.members[i] for role, i in zip(ROLES, at, strict=True)}
    share = float("nan")
    if at[1] is not None and cleaned.places is not None:
        way = cleaned.places[at[1], cleaned.present[at[1]]]
        share = vertical_share(way, up_direction(history))
    return RoleTable(relations, present, segments, missing, history.key_frames, names, share, told_by)


def as_role_table(table: RoleTable) -> RoleTable:
    """A role table, checked.

    Raises
    ------
    ValueError
        If it is something else.
    """
    if not isinstance(table, RoleTable):
        raise ValueError(f"table: expected a RoleTable (see role_table), got {type(table).__name__}")
    return table


def recording_names(recording: Observation | EventChain) -> Names:
    """Names of the segments of an observation or a chain.

    Raises
    ------
    ValueError
        If it is neither.
    """
    if not isinstance(recording, Observation | EventChain):
        raise ValueError(f"recording: expected an Observation or an EventChain, got {type(recording).__name__}")
    return recording.names


def _known_hands(hands: Sequence[int | str], history: SegmentHistory, names: Names) -> list[int]:
    if isinstance(hands, str) or not isinstance(hands, Sequence | np.ndarray) or not len(hands):
        raise ValueError(f"hands: expected a sequence of labels or names, got {hands!r}")
    recorded = [label for labels in history.members for label in labels]
    found = []
    for hand in hands:
        labels = [label for label in recorded if (names.get(label) == hand if isinstance(hand, str) else label == hand)]
        if not labels:
            raise ValueError(f"hands: expected labels or names of segments that were seen, got {hand!r}")
        found.extend(labels)
    return found


def _without_hand(history: SegmentHistory, names: Names, reason: str) -> RoleTable:
    missing = {role: reason if role == "hand" else "there is no hand" for role in ROLES} | _without_positions(history)
    n = len(history.key_frames)
    absent = np.full((len(ROWS), n), Relation.ABSENT, np.uint8)
    nobody: dict[str, tuple[int, ...]] = dict.fromkeys(ROLES, ())
    never = np.zeros((len(ROLES), n), np.bool_)
    return RoleTable(absent, never, nobody, missing, history.key_frames, names, hand_told_by="not found")


def _without_positions(history: SegmentHistory) -> dict[str, str]:
    return {POSITIONS: "not all segments have a recorded one"} if history.places is None else {}


def _roles(history: SegmentHistory) -> tuple[list[int | None], dict[str, str]]:
    """Index of the segment of each role, the hand being the first; and why a role is missing."""
    at: list[int | None] = [0, None, None, None, None]
    held = (history.relations[0] == Relation.TOUCHING) @ history.shares
    held[0] = 0.0
    if not held.any():
        alone = len(history.members[0]) == 1
        why = "the hand touches nothing" if alone else "all that touches the hand comes and goes with it"
        return at, {ROLES[1]: why, **dict.fromkeys(ROLES[2:], "there is no object 1")}
    equal = np.flatnonzero(largest(held))
    order, why = settled(history, equal.tolist(), partner=0)
    first, doubts = order[0], {1: why}
    second, doubts[2] = _worked_on(history, first, others=(0, first))
    at[1], at[2] = first, second
    if second is None:
        return at, _unclear(doubts) | {
            ROLES[2]: "object 1 touches nothing but the hand",
            ROLES[3]: "object 1 touches nothing else",
            ROLES[4]: "there is no object 2",
        }
    at[3], doubts[3] = _worked_on(history, first, others=(0, first, second))
    at[4], doubts[4] = _worked_on(history, second, others=(0, first, second))
    whys = {3: "object 1 touches nothing else", 4: "object 2 touches nothing else"}
    return at, _unclear(doubts) | {ROLES[role]: why for role, why in whys.items() if at[role] is None}


def _unclear(doubts: Mapping[int, str]) -> dict[str, str]:
    return {f"clear {ROLES[role]}": why for role, why in doubts.items() if why}


def _worked_on(history: SegmentHistory, segment: int, *, others: tuple[int, ...]) -> tuple[int | None, str]:
    """What a segment touches, with most changes, appearing or vanishing in touch, longest; None if nothing.

    And a word on equal ones, if there are any.
    """
    touching = history.relations[segment] > 0
    touched = touching.any(axis=1)
    touched[list(others)] = False
    if not touched.any():
        return None, ""
    change = touching[:, 1:] != touching[:, :-1]
    both = history.present & history.present[segment]
    in_touch = change & ~(both[:, 1:] & both[:, :-1])
    best = touched
    for values in (change.sum(axis=1), in_touch.sum(axis=1), touching @ history.shares):
        best = best & largest(np.where(best, values, 0))
    order, why = settled(history, np.flatnonzero(best).tolist(), partner=segment)
    return order[0], why
