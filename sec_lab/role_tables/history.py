"""What every segment did in the course of one movie: the form in which cleaning steps take and give a recording."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation

PlaceUnit = Literal["px", "m", "unknown"]


@dataclass(frozen=True, eq=False)
class SegmentHistory:
    """When every segment was there, what it touched and where it was.

    Attributes
    ----------
    members : tuple of n tuples of int
        Labels of the recorded segments that each segment stands for; one label each until segments are merged.
    present : (n, n_key_frames) bool
    relations : (n, n, n_key_frames) uint8
        0, 1 or 2 (:class:`~sec_lab.codes.Relation`), symmetric; 0 where one of the two is absent.
    places : (n, n_key_frames, 2 or 3) float64 or None
        (column, row) in pixels, or coordinates in space; NaN while a segment is absent. None if any is not known.
    key_frames : (n_key_frames,) int64
        Frame numbers, ascending.
    """

    members: tuple[tuple[int, ...], ...]
    present: NDArray[np.bool_]
    relations: NDArray[np.uint8]
    places: NDArray[np.float64] | None
    key_frames: NDArray[np.int64]

    def __post_init__(self) -> None:
        n, n_key_frames = len(self.members), len(self.key_frames)
        if self.present.shape != (n, n_key_frames):
            raise ValueError(f"present: expected shape {(n, n_key_frames)}, got {self.present.shape}")
        if self.relations.shape != (n, n, n_key_frames):
            raise ValueError(f"relations: expected shape {(n, n, n_key_frames)}, got {self.relations.shape}")
        if self.places is not None and (self.places.ndim != 3 or self.places.shape[:2] != (n, n_key_frames)):
            raise ValueError(f"places: expected shape {(n, n_key_frames)} and coordinates, got {self.places.shape}")
        for name in ("present", "relations", "places", "key_frames"):
            array = getattr(self, name)
            if array is not None:
                copy = np.array(array)
                copy.setflags(write=False)
                object.__setattr__(self, name, copy)

    @property
    def shares(self) -> NDArray[np.float64]:
        """Share of the time that each key frame stands for, see :func:`time_shares`."""
        return time_shares(self.key_frames)

    def index_of(self, segment: int) -> int:
        """Where a recorded segment is now.

        Raises
        ------
        ValueError
            If it is not there (any more).
        """
        for i, labels in enumerate(self.members):
            if segment in labels:
                return i
        raise ValueError(
            f"segment: expected one of {[label for labels in self.members for label in labels]}, got {segment}"
        )


def held(values: NDArray[Any], present: NDArray[np.bool_]) -> NDArray[Any]:
    """Values with each absence filled by the last one before it, the first absence by the first one after it.

    Parameters
    ----------
    values : (n, n_key_frames, ...) array
        One row a segment.
    present : (n, n_key_frames) bool

    Returns
    -------
    Array of the shape of the values.

    Examples
    --------
    >>> held(np.array([[0, 5, 0, 7]]), np.array([[False, True, False, True]]))
    array([[5, 5, 5, 7]])
    """
    at = np.where(present, np.arange(present.shape[1]), -1)
    at = np.maximum(np.maximum.accumulate(at, axis=1), present.argmax(axis=1)[:, None])
    filled: NDArray[Any] = values[np.arange(len(values))[:, None], at]
    return filled


def largest(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Which numbers, none of them negative, are the largest, but for rounding; (n,) bool.

    Examples
    --------
    >>> largest(np.array([0.3, 0.1 + 0.2, 0.2]))
    array([ True,  True, False])
    """
    most: NDArray[np.bool_] = values >= values.max() * (1 - 1e-12)
    return most


_SETTLED_BY = ("it touched first", "by its place", "by what else it does", "by its label alone")


def settled(history: SegmentHistory, equal: Sequence[int], *, partner: int | None = None) -> tuple[list[int], str]:
    """Segments that are equal in what decides, in an order that does not depend on their labels if that can be.

    The one that touches first comes first; of those that touch at once the one whose first place is smaller; then what
    they do decides, and only where that is the same too, the label.

    Parameters
    ----------
    history : SegmentHistory
    equal : sequence of int
        Their indices.
    partner : int, optional
        Index of the segment whose touch counts; any if left out.

    Returns
    -------
    order : list of int
        The indices, the one to be taken first.
    reason : str
        What was equal and by what it was settled; empty if there is only one.

    Examples
    --------
    >>> seen = segment_history(EventChain([[0, 0, 2], [0, 2, 2], [0, 0, 0]], [(1, 2), (1, 3), (2, 3)]))
    >>> settled(seen, [1, 2], partner=0)
    ([2, 1], 'segments 3 and 2 are equal in what decides; 3 is taken, as it touched first')
    """
    if len(equal) < 2:
        return list(equal), ""
    keys = {i: _settling(history, i, partner) for i in equal}
    order = sorted(equal, key=lambda i: (*keys[i], history.members[i]))
    level = next((k for k in range(3) if keys[order[0]][k] != keys[order[1]][k]), 3)
    labels = [str(history.members[i][0]) for i in order]
    why = _SETTLED_BY[level]
    return order, (
        f"segments {', '.join(labels[:-1])} and {labels[-1]} are equal in what decides; {labels[0]} is taken, "
        f"{'as ' if level == 0 else ''}{why}"
    )


def _settling(history: SegmentHistory, i: int, partner: int | None) -> tuple[int, tuple[float, ...], tuple[bytes, ...]]:
    rows = history.relations[i]
    touching = (rows if partner is None else rows[[partner]]) == Relation.TOUCHING
    at = np.flatnonzero(touching.any(axis=0))
    present = history.present[i]
    place: tuple[float, ...] = ()
    if history.places is not None and present.any():
        place = tuple(history.places[i, int(present.argmax())].tolist())
    does = (present.tobytes(), *sorted(row.tobytes() for row in rows))
    return int(at[0]) if at.size else present.size, place, does


def time_shares(key_frames: NDArray[np.int64]) -> NDArray[np.float64]:
    """Share of the time that each key frame stands for, shape (n_key_frames,), sum 1.

    A key frame holds until the next; for how long the last one holds is not recorded, so it counts as the median of the
    others.

    Examples
    --------
    >>> time_shares(np.array([0, 10, 40]))
    array([0.16666667, 0.5       , 0.33333333])
    """
    if len(key_frames) == 1:
        return np.ones(1)
    n = len(key_frames) - 1
    lasting = np.empty(n + 1)
    lasting[:n] = key_frames[1:] - key_frames[:-1]
    # The median; numpy's own takes longer than all the rest of this.
    ordered = np.sort(lasting[:n])
    lasting[n] = (ordered[(n - 1) // 2] + ordered[n // 2]) / 2
    lasting /= lasting.sum()
    return lasting


def segment_history(recording: Observation | EventChain) -> SegmentHistory:
    """What every segment of a recording did, as it was recorded.

    Parameters
    ----------
    recording : Observation or EventChain
        A chain knows no places; a segment that is alone in the picture is not in its chain.

    Raises
    ------
    ValueError
        If it is neither, or no key frame has any content.

    Examples
    --------
    >>> segment_history(EventChain([[0, 2, 9]], [(1, 2)])).present
    array([[ True,  True, False],
           [ True,  True, False]])
    """
    if isinstance(recording, EventChain):
        return _of_chain(recording)
    if isinstance(recording, Observation):
        return _of_observation(recording)
    raise ValueError(f"recording: expected an Observation or an EventChain, got {type(recording).__name__}")


def _of_chain(chain: EventChain) -> SegmentHistory:
    labels, at = np.unique(chain.pairs, return_inverse=True)
    a, b = at.reshape(chain.pairs.shape).T
    n, codes = len(labels), chain.relations
    cube = np.full((n, n, codes.shape[1]), Relation.ABSENT, np.uint8)
    cube[a, b] = cube[b, a] = codes
    there = cube != Relation.ABSENT
    cube[~there] = Relation.NON_TOUCHING
    return SegmentHistory(tuple((label,) for label in labels.tolist()), there.any(axis=1), cube, None, chain.key_frames)


def _of_observation(seen: Observation) -> SegmentHistory:
    recorded = seen.recorded
    graphs = recorded.graphs
    labels = np.unique(np.concatenate([graph.segments for graph in graphs]))
    n, n_key_frames = len(labels), len(graphs)
    present = np.zeros((n_key_frames, n), np.bool_)
    cube = np.zeros((n_key_frames, n, n), np.uint8)
    known = n > 0 and all(graph.positions is not None or not len(graph.segments) for graph in graphs)
    found = [graph.positions for graph in graphs if graph.positions is not None]
    widths = {positions.shape[1] for positions in found}
    known = known and len(widths) == 1
    places = np.full((n_key_frames, n, widths.pop()), np.nan) if known else None
    for k, graph in enumerate(graphs):
        at = np.searchsorted(labels, graph.segments)
        present[k, at] = True
        cube[k, at[:, None], at] = graph.relations
        if places is not None and graph.positions is not None:
            places[k, at] = graph.positions
    if places is not None:
        places = _in_one_form(places, seen.position_unit).transpose(1, 0, 2)
    members = tuple((label,) for label in labels.tolist())
    return SegmentHistory(
        members, present.T, np.ascontiguousarray(cube.transpose(1, 2, 0)), places, recorded.key_frames
    )


def _in_one_form(places: NDArray[np.float64], unit: PlaceUnit) -> NDArray[np.float64]:
    """Places in pixels as (column, row), places in space as they are."""
    if places.shape[2] == 3 and unit != "m" and not np.nan_to_num(places[..., 2]).any():
        # Files in the dialect of A.2 without a unit write pixels as (row, column, 0).
        return places[..., :2] if unit == "px" else places[..., 1::-1]
    return places
