"""Finding learned actions in a longer movie: the time-slicing of §2.9, and when each action begins and ends.

The thesis says of time-slicing only that "the similarity … increases together with the completion of the respective
manipulation"; the detector is ours. It follows §2.10.2: an action begins when its first contact comes about, and ends
when that contact is over.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sec_lab import _finding_kernels as kernels
from sec_lab._learning_kernels import step_five
from sec_lab._packed_chains import CODE_OF_RELATION
from sec_lab.action_model import ActionModel
from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph
from sec_lab.similarity import EFFORT, Normalizer, check_options

if TYPE_CHECKING:
    import pandas as pd

Models = Mapping[str, ActionModel]

LEAST_PERCENT = 80.0
"""Least similarity of an action that is reported."""

_ABSENT = 2
_CODE = np.zeros(10, np.uint8)
_CODE[[Relation.OVERLAPPING, Relation.TOUCHING, Relation.ABSENT]] = kernels.CONTACT, kernels.CONTACT, _ABSENT


@dataclass(frozen=True)
class FoundAction:
    """An action that was found in a movie.

    Attributes
    ----------
    model : str
        Name of the model.
    begin : int
        Frame in which the first contact of the action comes about.
    end : int or None
        Frame in which that contact is over; None while it lasts.
    similarity_percent : float
        Weighted share of the entries of the model that are found, of those columns that may have come.
    roles : mapping of int to int
        Role (segment of the model's chain) → segment of the movie.
    """

    model: str
    begin: int
    end: int | None
    similarity_percent: float
    roles: Mapping[int, int]

    def __post_init__(self) -> None:
        object.__setattr__(self, "roles", MappingProxyType(dict(self.roles)))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.model, self.begin, self.end, self.similarity_percent, dict(self.roles))


def time_slices(
    models: Models,
    movie: EventChain | Observation,
    *,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    effort: int = EFFORT,
) -> "pd.DataFrame":
    """How far each action has come at every key frame of a movie: the time-slicing of §2.9.

    Parameters
    ----------
    models : mapping of names to ActionModel
    movie : EventChain or Observation
        At least two key frames.
    normalizer, tolerance_percent, effort
        As in :func:`~sec_lab.similarity.compare`.

    Returns
    -------
    pandas.DataFrame
        Index: key frame; one column a model: ψ_temporal in percent of the model with the chain of all key frames up to
        this one.

    Raises
    ------
    ValueError
        If there is no model, the movie has a single key frame, or as in :func:`~sec_lab.similarity.compare`.

    Notes
    -----
    Departure: the sum of Eq. 2.9 is divided by the columns of the model, not by the smaller number of columns, for a
    movie that has just begun would be as similar as a whole one.

    Examples
    --------
    >>> chain = EventChain([[0, 2, 2, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)])
    >>> model = ActionModel(chain, [1, 1], [1, 1, 1, 1], ["one"], {}, [[0, 1, 2, 3]])
    >>> time_slices({"putting": model}, chain)["putting"].round().tolist()
    [0.0, 25.0, 38.0, 100.0]
    """
    import pandas as pd

    check_options(normalizer, tolerance_percent, "original", effort)
    _check_models(models)
    chain = _chain_of(movie)
    curves: dict[str, list[float]] = {name: [] for name in models}
    for n in range(1, chain.relations.shape[1] + 1):
        seen = chain.relations[:, :n]
        codes = CODE_OF_RELATION[seen[(seen != seen[:, :1]).any(axis=1)]]
        for name, model in models.items():
            wanted = CODE_OF_RELATION[model.chain.relations[model.chain.changing_rows]]
            _, temporal = step_five(
                wanted, np.ascontiguousarray(codes), int(normalizer == "shorter"), float(tolerance_percent), effort
            )
            curves[name].append(temporal * min(n, wanted.shape[1]) / wanted.shape[1])
    return pd.DataFrame(curves, index=pd.Index(chain.key_frames, name="key frame"))


def find_actions(
    models: Models, movie: EventChain | Observation, *, least_percent: float = LEAST_PERCENT, unfinished: bool = False
) -> list[FoundAction]:
    """Find when learned actions begin and end in a movie, and who plays their roles.

    Parameters
    ----------
    models : mapping of names to ActionModel
    movie : EventChain or Observation
        At least two key frames.
    least_percent : float, optional
        Least similarity of what is reported, 0 to 100.
    unfinished : bool, optional
        Also report actions whose first contact still lasts when the movie ends.

    Returns
    -------
    list of FoundAction
        In the order of their begins. Several actions may go on at the same time, but of those that would explain the
        same contact only the most similar one is reported.

    Raises
    ------
    ValueError
        If there is no model, a model has no row in which a contact comes about, the movie has a single key frame, or
        the threshold is not 0 to 100.

    Notes
    -----
    Only rows with a change to or from contact are looked at (§2.10.1 ignores all others), and touching and overlapping
    are both contact. The row in which contact comes about first gives the first role pair: every contact of the movie
    that comes about, and ends, may be this one. The other roles go to the segments with which most entries agree, in
    order of time, weighted by ω^r · ω^c. Roles are played by one segment each, which step 5 does not ask for.

    Examples
    --------
    >>> chain = EventChain([[0, 2, 2, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)])
    >>> model = ActionModel(chain, [1, 1], [1, 1, 1, 1], ["one"], {}, [[0, 1, 2, 3]])
    >>> movie = EventChain([[0, 0, 0, 2, 2, 0], [0, 0, 0, 0, 2, 2], [0, 2, 0, 0, 0, 0]], [(5, 6), (6, 7), (5, 9)])
    >>> [(found.begin, found.end, dict(found.roles)) for found in find_actions({"putting": model}, movie)]
    [(3, 5, {1: 5, 2: 6, 3: 7})]
    """
    if not 0 <= least_percent <= 100:
        raise ValueError(f"least_percent: expected 0 to 100, got {least_percent}")
    _check_models(models)
    patterns = [_Pattern(name, model) for name, model in models.items()]
    chain = _chain_of(movie)
    if chain.relations.shape[1] < 2:
        raise ValueError("movie: expected at least two key frames, got one")
    return _find(patterns, chain, least_percent, unfinished=unfinished)


def has_contact(model: ActionModel) -> bool:
    """Whether a contact comes about in a model, so that it can be looked for.

    Parameters
    ----------
    model : ActionModel

    Returns
    -------
    bool

    Examples
    --------
    >>> chains = [EventChain([row], [(1, 2)]) for row in ([0, 2], [2, 0])]
    >>> comes, goes = (ActionModel(chain, [1], [1, 1], ["one"], {}, [[0, 1]]) for chain in chains)
    >>> has_contact(comes), has_contact(goes)
    (True, False)
    """
    return bool(_comes_about(_CODE[model.chain.relations] == kernels.CONTACT).any())


def _comes_about(contact: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.asarray(contact[:, 1:] & ~contact[:, :-1])


class OnlineFinder:
    """Finding actions while a movie goes on, frame by frame.

    Parameters
    ----------
    models : mapping of names to ActionModel
    least_percent : float, optional
        As in :func:`find_actions`.

    Examples
    --------
    >>> chain = EventChain([[0, 2, 0]], [(1, 2)])
    >>> finder = OnlineFinder({"touching": ActionModel(chain, [1], [1, 1, 1], ["one"], {}, [[0, 1, 2]])})
    >>> apart, together = SceneGraph([5, 6], [[0, 0], [0, 0]]), SceneGraph([5, 6], [[0, 2], [2, 0]])
    >>> for frame, graph in enumerate([apart, together, together, apart, apart]):
    ...     print(frame, [(found.begin, found.end) for found in finder.add(frame, graph)])
    0 []
    1 [(1, None)]
    2 []
    3 [(1, 3)]
    4 []
    """

    def __init__(self, models: Models, *, least_percent: float = LEAST_PERCENT) -> None:
        if not 0 <= least_percent <= 100:
            raise ValueError(f"least_percent: expected 0 to 100, got {least_percent}")
        _check_models(models)
        self._patterns = [_Pattern(name, model) for name, model in models.items()]
        self._least = least_percent
        self._graphs: list[SceneGraph] = []
        self._frames: list[int] = []
        self._last_frame: int | None = None
        self._told: set[tuple[str, int, bool]] = set()

    def add(self, frame: int, graph: SceneGraph) -> list[FoundAction]:
        """See one more frame; returns what begins (``end`` is None) or ends with it.

        What has begun may be several actions at once, as long as nothing tells them apart.

        Raises
        ------
        ValueError
            If the frame does not come after the last one.
        """
        if self._last_frame is not None and frame <= self._last_frame:
            raise ValueError(f"frame: expected one after {self._last_frame}, got {frame}")
        self._last_frame = frame
        if self._graphs and self._graphs[-1].same_relations(graph):
            return []
        self._graphs.append(graph)
        self._frames.append(frame)
        seen = Observation(self._graphs, self._frames)
        if len(self._graphs) < 2 or len(seen.segments) < 2:
            return []
        found = _find(self._patterns, seen.chain, self._least, unfinished=True)
        new = [one for one in found if (one.model, one.begin, one.end is None) not in self._told]
        self._told |= {(one.model, one.begin, one.end is None) for one in new}
        return new


class _Pattern:
    """What is looked for: rows of a model with a change to or from contact, and where its first contact is."""

    def __init__(self, name: str, model: ActionModel) -> None:
        codes = _CODE[model.chain.relations]
        contact = codes == kernels.CONTACT
        rows = np.flatnonzero((contact != contact[:, :1]).any(axis=1))
        comes = _comes_about(contact[rows])
        if not comes.any():
            raise ValueError(f"model {name}: expected a row in which a contact comes about, got none")
        self.name = name
        self.codes = np.ascontiguousarray(codes[rows])
        self.roles, ends = np.unique(model.chain.pairs[rows], return_inverse=True)
        self.ends = ends.reshape(-1, 2).astype(np.int64)
        self.row_weights, self.column_weights = model.row_weights[rows].copy(), model.column_weights.copy()
        at = np.where(comes.any(axis=1), comes.argmax(axis=1), comes.shape[1])
        self.row = int(np.argmin(at))
        self.begin = int(at[self.row]) + 1
        goes = np.flatnonzero(contact[rows[self.row], :-1] & ~contact[rows[self.row], 1:])
        goes = goes[goes >= self.begin]
        self.end = int(goes[-1]) + 1 if len(goes) else -1
        self.n_contacts = len(goes)


def _find(
    patterns: Sequence[_Pattern], chain: EventChain, least_percent: float, *, unfinished: bool
) -> list[FoundAction]:
    segments, movie = _cube(chain)
    ended: list[tuple[float, int, FoundAction, frozenset[int]]] = []
    lasting: list[tuple[float, int, FoundAction, frozenset[int]]] = []
    for number, pattern in enumerate(patterns):
        for a, b in chain.pairs[chain.changing_rows].tolist():
            pair = np.searchsorted(segments, [a, b])
            for first, last in _contacts(movie[:, pair[0], pair[1]], pattern):
                if last < 0 and not (unfinished or pattern.end < 0):
                    continue
                best, played = _best_cast(pattern, movie, pair, first, last)
                if 100.0 * best < least_percent - 1e-9:
                    continue
                known = played >= 0
                roles = dict(zip(pattern.roles[known].tolist(), segments[played[known]].tolist(), strict=True))
                end = int(chain.key_frames[last]) if last >= 0 else None
                found = FoundAction(pattern.name, int(chain.key_frames[first]), end, 100.0 * best, roles)
                (ended if last >= 0 else lasting).append((-best, number, found, frozenset((a, b))))
    kept = _best_of_overlapping(ended)
    over = {(found.begin, pair) for found, pair in kept}
    # While a contact lasts, whatever it may become is reported.
    kept += [(found, pair) for _, _, found, pair in lasting if (found.begin, pair) not in over]
    return sorted((found for found, _ in kept), key=lambda found: (found.begin, found.end is None, found.model))


def _best_of_overlapping(
    candidates: list[tuple[float, int, FoundAction, frozenset[int]]],
) -> list[tuple[FoundAction, frozenset[int]]]:
    """Of actions that explain the same contact at the same time the most similar one, the first model of several."""
    kept: list[tuple[FoundAction, frozenset[int]]] = []
    for _, _, found, pair in sorted(candidates, key=lambda one: (one[0], one[1], one[2].begin)):
        overlaps = any(
            pair == other and found.begin < (last.end or 0) and last.begin < (found.end or 0) for last, other in kept
        )
        if not overlaps:
            kept.append((found, pair))
    return kept


def _best_cast(
    pattern: _Pattern, movie: NDArray[np.uint8], pair: NDArray[np.intp], first: int, last: int
) -> tuple[float, NDArray[np.int64]]:
    """Who plays which role if the first contact is this one, and how well it fits."""
    whole = pattern.codes.shape[1]
    # While the contact lasts, any of the columns from its begin to its end may be the last that has come.
    come = [whole] if last >= 0 or pattern.end < 0 else range(pattern.begin + 1, pattern.end + 1)
    best, cast = -1.0, np.empty(0, np.int64)
    for n_columns in come:
        for ends in (pair, pair[::-1]):
            played = np.full(len(pattern.roles), -1, np.int64)
            played[pattern.ends[pattern.row]] = ends
            value = kernels.cast_roles(
                movie, pattern.codes, pattern.ends, pattern.row_weights, pattern.column_weights, played, first, last,
                pattern.begin, pattern.end, n_columns,
            )  # fmt: skip
            if value > best + 1e-12:
                best, cast = float(value), played
    return best, cast


def _contacts(relation: NDArray[np.uint8], pattern: _Pattern) -> list[tuple[int, int]]:
    """Where the first contact of an action may begin and end, as indices of key frames; −1 while it lasts."""
    contact = relation == kernels.CONTACT
    comes = np.flatnonzero(contact[1:] & ~contact[:-1]) + 1
    goes = np.flatnonzero(contact[:-1] & ~contact[1:]) + 1
    places: list[tuple[int, int]] = []
    for first in comes.tolist():
        later = goes[goes > first]
        if pattern.end < 0:
            places.append((first, -1))
        elif len(later) >= pattern.n_contacts:
            # A contact that flickers ends more often than that of the model.
            places += [(first, int(last)) for last in later[pattern.n_contacts - 1 : pattern.n_contacts + 1]]
        else:
            places.append((first, -1))
    return places


def _cube(chain: EventChain) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """All segments, and relations of all pairs of them at every key frame, absent if unknown."""
    segments = chain.segments
    cube = np.full((chain.relations.shape[1], len(segments), len(segments)), _ABSENT, np.uint8)
    first, second = np.searchsorted(segments, chain.pairs).T
    codes = _CODE[chain.relations].T
    cube[:, first, second] = codes
    cube[:, second, first] = codes
    return segments, cube


def _check_models(models: Models) -> None:
    if not isinstance(models, Mapping) or not models:
        raise ValueError("models: expected a mapping of names to at least one model, got none")
    for name, model in models.items():
        if not isinstance(model, ActionModel):
            raise ValueError(f"model {name}: expected an ActionModel, got {type(model).__name__}")


def _chain_of(movie: EventChain | Observation) -> EventChain:
    return movie.chain if isinstance(movie, Observation) else movie
