"""Takes and puts: what an event chain says of things that leave what they lie on, or come to lie on it.

A thing that rests is in contact with what it rests on, the background as a rule; when it is carried, it is not (§2.3).
So a change of this one relation, that lasts, is a *take* or a *put*, and nothing has to be known of things and hands.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation, as_integers
from sec_lab.observation import Observation
from sec_lab.scene_graph import MainGraphs, SceneGraph

if TYPE_CHECKING:
    import pandas as pd

Kind = Literal["take", "put"]
_Rest = tuple[int, int]
"""Main graphs, from the first up to, not including, the last, in which a segment rests."""

REST_FRAMES = 15
"""Frames for which something must rest, or be away, to count: half a second."""
TOGETHER_FRAMES = 50
"""Frames within which parts of one thing are taken, or put: two seconds, so long as a hand stays with it."""
NEAR_PX = 20.0
"""How far the centre of a segment may wander while a hand lets it go: more and more of it comes to light."""


@dataclass(frozen=True)
class TakeOrPut:
    """Something is taken from where it rested, or put to where it rests.

    Parameters
    ----------
    kind : {"take", "put"}
    frame : int
        Frame number at which it leaves what it rests on, or meets it.
    segments : tuple of int
        Labels of the segments that the thing consists of, ascending.
    by : tuple of int
        Labels of what moves and touches it then, ascending; it may be none, where the contact is not seen.
    place : tuple of float or None
        Centre (column, row, …) of where it rests, the mean over the segments; None where positions are not known.
    """

    kind: Kind
    frame: int
    segments: tuple[int, ...]
    by: tuple[int, ...] = ()
    place: tuple[float, ...] | None = None


@dataclass(frozen=True)
class _Change:
    """One segment begins or ends to rest. Columns count the main graphs."""

    kind: Kind
    segment: int
    frame: int
    columns: range
    """Main graphs from just before the change until it is complete."""
    at_rest: int
    """Main graph in which the segment rests."""


def takes_and_puts(
    observation: Observation,
    *,
    supports: Iterable[int] | None = None,
    rest_frames: int = REST_FRAMES,
    together_frames: int = TOGETHER_FRAMES,
    near_px: float = NEAR_PX,
) -> list[TakeOrPut]:
    """Takes and puts in a movie, read off its main graphs.

    A segment *rests* while it touches or overlaps what things rest on, see ``supports``. When that ends, for a while at
    least, and something moves (is there and does not rest), it is taken; when that begins, it is put. A segment that
    appears where it comes to rest has been put when it appeared: as long as a hand holds it, one cannot see that it
    rests. Segments that touch each other and are taken, or put, one shortly after the other, are parts of one thing.
    What holds still for a short time, in contact with something that rests for longer, is a hand.

    Parameters
    ----------
    observation : Observation
        With steady relations, as :func:`~sec_lab.pipeline.observe` finds them by default: there, what moves is not in
        contact with what rests.
    supports : iterable of int, optional
        Labels of what things rest on; if left out, the background of the segmentation.
    rest_frames : int, optional
        A rest that is shorter is none, and so is a shorter time between two rests.
    together_frames : int, optional
        Longest time between two parts of one thing, between the appearance of a segment and its rest, and for which a
        hand holds still.
    near_px : float, optional
        How far a segment may move from where it appeared to be put at that time.

    Returns
    -------
    list of TakeOrPut
        By frame, takes first.

    Raises
    ------
    ValueError
        If nothing was recorded, a parameter is negative, or ``supports`` is left out and there is no segmentation that
        knows its background, or one of them was never seen.

    Examples
    --------
    A hand (3) comes, and takes a cup (2) from the table (1):

    >>> def graph(*edges, n):
    ...     relations = np.zeros((n, n), dtype=int)
    ...     for i, j in edges:
    ...         relations[[i - 1, j - 1], [j - 1, i - 1]] = 2
    ...     return SceneGraph(range(1, n + 1), relations)
    >>> graphs = [graph((1, 2), n=2), graph((1, 2), n=3), graph((2, 3), n=3), graph(n=1)]
    >>> takes_and_puts(Observation(graphs, [0, 30, 42, 60]), supports=[1])
    [TakeOrPut(kind='take', frame=42, segments=(2,), by=(3,), place=None)]
    """
    for name, value in (("rest_frames", rest_frames), ("together_frames", together_frames), ("near_px", near_px)):
        if not value >= 0:
            raise ValueError(f"{name}: expected a number from 0 on, got {value!r}")
    recorded = observation.recorded
    below = _supports(observation, supports)
    rests = {
        segment: _rests(recorded, segment, below, rest_frames)
        for segment in observation.segments.tolist()
        if segment not in below
    }
    rests = {
        segment: [rest for rest in intervals if not _holds_still(recorded, segment, rest, rests, together_frames)]
        for segment, intervals in rests.items()
    }
    changes = [
        change
        for segment, intervals in rests.items()
        for change in _changes(recorded, segment, intervals, together_frames, near_px)
    ]
    changes.sort(key=lambda change: (change.frame, change.kind == "put", change.segment))
    events = []
    for thing in _things(recorded, changes, together_frames):
        movers, touching = _movers(recorded, thing, rests)
        if movers:
            place = _place(recorded, thing)
            segments = tuple(sorted({change.segment for change in thing}))
            events.append(TakeOrPut(thing[0].kind, thing[0].frame, segments, tuple(sorted(touching)), place))
    return events


@dataclass(frozen=True, eq=False)
class EventAgreement:
    """Events that were found, held against the true ones.

    Parameters
    ----------
    hits : tuple of (str, int, int)
        What, its true frame and the frame at which it was found; by true frame.
    missed, false : tuple of (str, int)
        What and when: true events that were not found, and found ones that are not true; by frame.
    """

    hits: tuple[tuple[str, int, int], ...]
    missed: tuple[tuple[str, int], ...]
    false: tuple[tuple[str, int], ...]

    @property
    def errors_frames(self) -> NDArray[np.int64]:
        """How many frames too late each hit was found (negative: too early), shape (n_hits,)."""
        return np.array([found - true for _, true, found in self.hits], dtype=np.int64)

    @property
    def median_error_frames(self) -> float:
        """Median of the hits' errors, whether early or late; NaN without any hit."""
        return float(np.median(np.abs(self.errors_frames))) if self.hits else float("nan")

    def to_frame(self) -> "pd.DataFrame":
        """Table of all events, by frame: ``event``, ``true_frame``, ``found_frame``, ``error_frames``, ``verdict``."""
        import pandas as pd

        rows = [(what, true, found, found - true, "hit") for what, true, found in self.hits]
        table = pd.DataFrame(
            [
                *rows,
                *((what, true, None, None, "missed") for what, true in self.missed),
                *((what, None, found, None, "false") for what, found in self.false),
            ],
            columns=["event", "true_frame", "found_frame", "error_frames", "verdict"],
        )
        numbers = ["true_frame", "found_frame", "error_frames"]
        table[numbers] = table[numbers].astype("Int64")
        order = table["true_frame"].fillna(table["found_frame"]).argsort(kind="stable")
        return table.iloc[order].reset_index(drop=True)


def match_events(
    found: Iterable[tuple[str, int]], truth: Iterable[tuple[str, int]], *, tolerance_frames: int
) -> EventAgreement:
    """Hold events against the true ones: as many hits as possible, and with the smallest errors.

    Parameters
    ----------
    found, truth : iterable of (str, int)
        What happens (only equal ones match) and the number of the frame.
    tolerance_frames : int
        Largest error of a hit.

    Returns
    -------
    EventAgreement

    Raises
    ------
    ValueError
        If the tolerance is negative.

    Examples
    --------
    >>> truth = [("take", 10), ("put", 40), ("take", 80)]
    >>> result = match_events([("take", 12), ("put", 70), ("take", 79)], truth, tolerance_frames=5)
    >>> result.hits, result.missed, result.false, result.median_error_frames
    ((('take', 10, 12), ('take', 80, 79)), (('put', 40),), (('put', 70),), 1.5)
    """
    from scipy.optimize import linear_sum_assignment

    if not tolerance_frames >= 0:
        raise ValueError(f"tolerance_frames: expected a number from 0 on, got {tolerance_frames!r}")
    ours, true = ([(str(what), int(frame)) for what, frame in events] for events in (found, truth))
    hits: list[tuple[str, int, int]] = []
    used: tuple[set[int], set[int]] = (set(), set())
    if ours and true:
        gaps = np.array([[abs(frame - other) for _, other in ours] for _, frame in true], dtype=np.float64)
        fits = np.array([[what == other for other, _ in ours] for what, _ in true]) & (gaps <= tolerance_frames)
        # A hit is worth more than all errors together.
        worth = np.where(fits, gaps - (tolerance_frames + 1) * (len(ours) + len(true)), 0.0)
        for i, j in zip(*linear_sum_assignment(worth), strict=True):
            if fits[i, j]:
                hits.append((true[i][0], true[i][1], ours[j][1]))
                used[0].add(int(i))
                used[1].add(int(j))
    missed, false = (
        tuple(sorted((event for k, event in enumerate(events) if k not in taken), key=lambda event: event[1]))
        for events, taken in zip((true, ours), used, strict=True)
    )
    return EventAgreement(tuple(sorted(hits, key=lambda hit: hit[1])), missed, false)


def _supports(observation: Observation, supports: Iterable[int] | None) -> frozenset[int]:
    if supports is None:
        found = observation.segmentation
        if found is None or found.background is None:
            raise ValueError("supports: expected labels of what things rest on, as the background is not known")
        return frozenset([found.background])
    labels = as_integers(list(supports), what="supports", ndim=1)
    unknown = np.setdiff1d(labels, observation.segments)
    if unknown.size or not labels.size:
        raise ValueError(f"supports: expected labels that were seen, got {unknown[0] if unknown.size else 'none'}")
    return frozenset(labels.tolist())


def _is_contact(graph: SceneGraph, i: int, j: int) -> bool:
    return graph.relation(i, j) in (Relation.TOUCHING, Relation.OVERLAPPING)


def _rests(recorded: MainGraphs, segment: int, below: frozenset[int], least: int) -> list[_Rest]:
    """Rests of a segment that are long enough, shorter breaks being closed."""
    n, frames = len(recorded.graphs), recorded.key_frames
    resting = [any(_is_contact(graph, segment, other) for other in below) for graph in recorded.graphs]
    intervals: list[_Rest] = []
    for k in range(n):
        if not resting[k]:
            continue
        if intervals and frames[k] - frames[min(intervals[-1][1], k)] < least:
            intervals[-1] = (intervals[-1][0], k + 1)
        else:
            intervals.append((k, k + 1))
    # What was before the first frame and after the last key frame is not known.
    return [(a, b) for a, b in intervals if a == 0 or b == n or frames[b] - frames[a] >= least]


def _holds_still(
    recorded: MainGraphs, segment: int, rest: _Rest, rests: Mapping[int, Sequence[_Rest]], together: int
) -> bool:
    """Whether a rest is that of a hand on a thing: short, and in contact with something that rests for longer.

    A hand comes to what has rested before, or leaves what goes on resting.
    """
    frames = recorded.key_frames
    a, b = rest
    if a == 0 or b == len(frames) or frames[b] - frames[a] > together:
        return False
    around = recorded.graphs[a - 1 : b + 1]
    for other, intervals in rests.items():
        if other == segment or not any(_is_contact(graph, segment, other) for graph in around):
            continue
        for c, d in intervals:
            is_longer = c == 0 or d == len(frames) or frames[d] - frames[c] > frames[b] - frames[a]
            if is_longer and c <= b and a <= d:
                return True
    return False


def _changes(
    recorded: MainGraphs, segment: int, intervals: Sequence[_Rest], together: int, near_px: float
) -> Iterator[_Change]:
    frames = recorded.key_frames.tolist()
    for a, b in intervals:
        if a > 0:
            begin = _appearance(recorded, segment, a, together, near_px)
            yield _Change("put", segment, frames[begin], range(max(begin - 1, 0), a + 1), a)
        if b < len(frames):
            yield _Change("take", segment, frames[b], range(b - 1, b + 1), b - 1)


def _appearance(recorded: MainGraphs, segment: int, rests: int, together: int, near_px: float) -> int:
    """Main graph since which a segment has been near the place where it comes to rest, if it appeared there."""
    frames = recorded.key_frames
    first = rests
    while first > 0 and segment in recorded.graphs[first - 1].segments:
        first -= 1
    if first == 0 or frames[rests] - frames[first] > together:
        return rests
    places = [_position(graph, segment) for graph in recorded.graphs[first : rests + 1]]
    if any(place is None for place in places):
        return first
    shifts = np.array(places, dtype=np.float64) - np.array(places[-1], dtype=np.float64)
    return first if np.hypot(*shifts.T[:2]).max() <= near_px else rests


def _position(graph: SceneGraph, segment: int) -> NDArray[np.float64] | None:
    at = np.flatnonzero(graph.segments == segment)
    return None if graph.positions is None or not at.size else graph.positions[at[0]]


def _things(recorded: MainGraphs, changes: Sequence[_Change], together: int) -> list[list[_Change]]:
    """Changes of segments that are parts of one thing, in the order of their first changes."""
    frames = recorded.key_frames
    things: list[list[_Change]] = []
    for change in changes:
        same = [
            thing
            for thing in things
            if any(
                other.kind == change.kind
                and other.segment != change.segment
                and abs(frames[other.at_rest] - frames[change.at_rest]) <= together
                and _are_joined(recorded, other, change)
                for other in thing
            )
        ]
        joined = [*(one for thing in same for one in thing), change]
        joined.sort(key=lambda one: (one.frame, one.segment))
        things = [*(thing for thing in things if thing not in same), joined]
    things.sort(key=lambda thing: (thing[0].frame, thing[0].kind == "put", thing[0].segment))
    return things


def _are_joined(recorded: MainGraphs, a: _Change, b: _Change) -> bool:
    """Whether two segments touch while both rest: after the later put, before the earlier take."""
    at = max(a.at_rest, b.at_rest) if a.kind == "put" else min(a.at_rest, b.at_rest)
    return _is_contact(recorded.graphs[at], a.segment, b.segment)


def _movers(
    recorded: MainGraphs, thing: Sequence[_Change], rests: Mapping[int, Sequence[_Rest]]
) -> tuple[set[int], set[int]]:
    """What moves during the changes of a thing, and which of that touches it."""
    own = {change.segment for change in thing}
    movers: set[int] = set()
    touching: set[int] = set()
    for change in thing:
        for k in change.columns:
            graph = recorded.graphs[k]
            moving = {
                segment
                for segment, intervals in rests.items()
                if segment not in own and segment in graph.segments and not any(a <= k < b for a, b in intervals)
            }
            movers |= moving
            touching |= {segment for segment in moving if _is_contact(graph, segment, change.segment)}
    return movers, touching


def _place(recorded: MainGraphs, thing: Sequence[_Change]) -> tuple[float, ...] | None:
    places = [_position(recorded.graphs[change.at_rest], change.segment) for change in thing]
    known = [place for place in places if place is not None]
    return tuple(np.mean(known, axis=0).tolist()) if known else None
