"""Learning an archetypal event chain from demonstrations (step 7, §2.9).

Rows and columns of demonstrations of one type correspond (step 5); those that occur again and again make the model,
what few have falls below a threshold. Batch mode begins with the most typical demonstration, whatever their order;
online mode takes them as they come.
"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from sec_lab import _learning_kernels as kernels
from sec_lab._model_making import Ballot, Frame, make_model, often_enough
from sec_lab._packed_chains import PackedChains
from sec_lab._profile import LEAST_COUNT, Options, Packed, Profile
from sec_lab.action_model import ActionModel
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.similarity import EFFORT, Normalizer, check_options, temporal_of_packed

if TYPE_CHECKING:
    import pandas as pd

Mode = Literal["batch", "online"]
Demonstration: TypeAlias = EventChain | Observation
Demonstrations: TypeAlias = Sequence[Demonstration] | Mapping[str, Demonstration]

WEIGHT_THRESHOLD = 0.51
"""Share of the demonstrations that a row or column of a model needs: what most of them have, not just every second."""

TYPE_THRESHOLD_PERCENT = 64.0
"""Least similarity of type-similar manipulations (§2.7)."""

SAMPLE = 40
"""Demonstrations from which the rows and columns of a model are gathered in batch mode; all others vote on them."""

_SETTLING = 200
_MOST_BALLOTS = 6
_CHUNK = 256


def learn(
    demonstrations: Demonstrations,
    *,
    mode: Mode = "batch",
    weight_threshold: float = WEIGHT_THRESHOLD,
    type_threshold_percent: float = TYPE_THRESHOLD_PERCENT,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    effort: int = EFFORT,
    n_threads: int | None = None,
) -> ActionModel:
    """Learn the model event chain of one type of manipulation from its demonstrations (step 7, §2.9).

    Parameters
    ----------
    demonstrations : sequence of EventChain or Observation, or mapping of names to them
        At least two. Without names they are called "1", "2", … Observations give positions too.
    mode : {"batch", "online"}, optional
        Batch: all demonstrations are taken to be of one type (see :func:`learn_types` where they are not); the most
        typical one comes first, whatever their order. Online: they come in the given order, and those that are not
        type-similar to what has been learned so far are passed over, as §2.9 describes; a bad first example spoils it.
    weight_threshold : float, optional
        Least ω^r and ω^c, 0 to 1; rows and columns below it are deleted, and those that only one demonstration has.
    type_threshold_percent : float, optional
        Least ψ_temporal of a type-similar demonstration, for online mode.
    normalizer, tolerance_percent, effort
        As in :func:`~sec_lab.similarity.compare`.
    n_threads : int, optional
        Threads to use, all cores if left out; the result is the same for any number.

    Returns
    -------
    ActionModel

    Raises
    ------
    TypeError
        If a demonstration is neither a chain nor an observation.
    ValueError
        If there are fewer than two, one has a single column, no change or negative key frames, no row is common to two
        of them, or the threshold leaves nothing; in online mode, if fewer than two are type-similar.

    Examples
    --------
    >>> putting = EventChain([[0, 2, 2, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)])
    >>> noisy = EventChain([[0, 2, 2, 2, 0], [0, 0, 2, 2, 2], [0, 0, 0, 2, 2]], [(7, 8), (8, 9), (7, 9)])
    >>> model = learn([putting, noisy, putting])
    >>> model.chain.relations.tolist(), model.row_weights, dict(model.roles["2"])
    ([[0, 2, 2, 0], [0, 0, 2, 2]], array([1., 1.]), {1: 7, 2: 8, 3: 9})

    Notes
    -----
    Weights are normalised occurrences. Entries are what most demonstrations have where both row and column correspond:
    two thirds of the entries of a row (over the aligned columns) and more than half of those of a column (over the
    corresponding rows) have to agree. Columns that are left without any difference are no events, and are joined.
    """
    if mode not in get_args(Mode):
        raise ValueError(f"mode: expected one of {get_args(Mode)}, got {mode!r}")
    options = _as_options(weight_threshold, normalizer, tolerance_percent, effort)
    names, given = _as_demonstrations(demonstrations)
    if mode == "online":
        learner = OnlineLearner(
            weight_threshold=weight_threshold, type_threshold_percent=type_threshold_percent, normalizer=normalizer,
            tolerance_percent=tolerance_percent, effort=effort,
        )  # fmt: skip
        for name, one in zip(names, given, strict=True):
            learner.add(one, name=name)
        return learner.model()
    if len(given) < LEAST_COUNT:
        raise ValueError(f"demonstrations: expected at least two, got {len(given)}")
    packed = Packed([_chain_of(one) for one in given], names)
    frame = _gather(packed, options, n_threads)
    # A part of the demonstrations settles what is deleted, all of them have the last word; then again without that, so
    # that nothing of a demonstration is lost to it.
    some = np.unique(np.linspace(0, len(given) - 1, min(len(given), _SETTLING)).astype(int))
    kept = often_enough(_vote(packed, frame, options, n_threads, some), options)
    voters = some
    for _ in range(_MOST_BALLOTS):
        before = kept.frame.codes
        ballot = _vote(packed, kept.frame, options, n_threads, voters)
        kept = often_enough(ballot, options)
        if np.array_equal(kept.frame.codes, before):
            if len(voters) == len(given):
                break
            voters = np.arange(len(given))
    if len(voters) < len(given):
        ballot = _vote(packed, kept.frame, options, n_threads, np.arange(len(given)))
        kept = often_enough(ballot, options)
    return make_model(packed, given, kept, ballot.rows[:, kept.rows], ballot.columns[:, kept.columns])


class OnlineLearner:
    """Learning from demonstrations as they come (§2.9).

    Parameters
    ----------
    weight_threshold, type_threshold_percent, normalizer, tolerance_percent, effort
        As in :func:`learn`.

    Attributes
    ----------
    accepted, passed_over : list of str
        Names of the demonstrations that were learned from, and of those that were not type-similar.

    Examples
    --------
    >>> putting = EventChain([[0, 2, 2, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)])
    >>> learner = OnlineLearner()
    >>> [learner.add(putting), learner.add(EventChain([[9, 2, 9]], [(1, 2)])), learner.add(putting)]
    [True, False, True]
    >>> learner.model().demonstrations, learner.passed_over
    (('1', '3'), ['2'])
    """

    def __init__(
        self,
        *,
        weight_threshold: float = WEIGHT_THRESHOLD,
        type_threshold_percent: float = TYPE_THRESHOLD_PERCENT,
        normalizer: Normalizer = "longer",
        tolerance_percent: float = 0.0,
        effort: int = EFFORT,
    ) -> None:
        if not 0 <= type_threshold_percent <= 100:
            raise ValueError(f"type_threshold_percent: expected 0 to 100, got {type_threshold_percent}")
        self._options = _as_options(weight_threshold, normalizer, tolerance_percent, effort)
        self._least = type_threshold_percent
        self._profile: Profile | None = None
        self._given: list[Demonstration] = []
        self.accepted: list[str] = []
        self.passed_over: list[str] = []

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns that are kept, weak ones included: what lossy counting keeps bounded."""
        return (0, 0) if self._profile is None else self._profile.initial.shape

    def add(self, demonstration: Demonstration, *, name: str | None = None) -> bool:
        """Learn from one more demonstration, if it is type-similar to what was learned so far.

        Returns
        -------
        bool
            Whether it was.

        Raises
        ------
        TypeError, ValueError
            If it is no chain that can be learned from, or the name was used before.
        """
        called = str(len(self.accepted) + len(self.passed_over) + 1) if name is None else name
        if called in self.accepted or called in self.passed_over:
            raise ValueError(f"name: expected another for each demonstration, got {called!r} twice")
        codes = Packed([_chain_of(demonstration)], [called]).codes_of(0)
        if self._profile is None:
            self._profile = Profile(codes, self._options)
        else:
            alignment = self._profile.align(codes)
            if alignment.similarity < self._least - 1e-9:
                self.passed_over.append(called)
                return False
            self._profile.add(codes, alignment)
        self.accepted.append(called)
        self._given.append(demonstration)
        return True

    def model(self) -> ActionModel:
        """Model of what was learned so far: sub-threshold rows and columns are deleted.

        Raises
        ------
        ValueError
            If fewer than two demonstrations were learned from, no row is common to two of them, or the threshold
            leaves nothing.
        """
        if self._profile is None or len(self.accepted) < LEAST_COUNT:
            n = len(self.accepted)
            least = f", {len(self.passed_over)} were not" if self.passed_over else ""
            raise ValueError(f"demonstrations: expected at least two that are type-similar, got {n}{least}")
        counted = self._profile
        none = np.empty((0, 0), np.int64)
        kept = often_enough(
            Ballot(
                counted.votes, counted.initial, counted.row_counts, counted.column_counts, counted.n, none, none
            ), self._options,
        )  # fmt: skip
        packed = Packed([_chain_of(one) for one in self._given], self.accepted)
        ballot = _vote(packed, kept.frame, self._options, 1, np.arange(len(self._given)))
        return make_model(packed, self._given, kept, ballot.rows, ballot.columns)


@dataclass(frozen=True, eq=False)
class LearnedTypes:
    """Types of manipulations that were found among demonstrations, and their models.

    Attributes
    ----------
    table : (n, n) pandas.DataFrame
        Similarities in percent, from which the types were found.
    classes : (n,) int64
        Type of each demonstration.
    models : tuple of ActionModel or None
        Model of each type; None where a type has a single demonstration, from which nothing can be learned.
    """

    table: "pd.DataFrame"
    classes: NDArray[np.int64]
    models: tuple[ActionModel | None, ...]


def learn_types(
    demonstrations: Demonstrations,
    *,
    weight_threshold: float = WEIGHT_THRESHOLD,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    effort: int = EFFORT,
    rng: np.random.Generator | None = None,
    k_max: int | None = None,
    n_threads: int | None = None,
) -> LearnedTypes:
    """Find the types of manipulations among demonstrations, then learn each: batch mode of §2.9.

    Parameters
    ----------
    demonstrations : sequence of EventChain or Observation, or mapping of names to them
        At least three.
    weight_threshold, normalizer, tolerance_percent, effort, n_threads
        As in :func:`learn`.
    rng, k_max
        As in :func:`~sec_lab.classification.unsupervised_classes`.

    Returns
    -------
    LearnedTypes

    Raises
    ------
    TypeError, ValueError
        As in :func:`learn` and :func:`~sec_lab.classification.unsupervised_classes`.

    Examples
    --------
    >>> put, take = ([[0, 2, 2, 0], [0, 0, 2, 2]], [[0, 2, 2, 0], [2, 2, 0, 0]])
    >>> chains = [EventChain(rows, [(1, 2), (2, 3)]) for rows in (put, take, put, take, put, take)]
    >>> learned = learn_types(chains)
    >>> learned.classes, learned.models[1].chain.relations.tolist()
    (array([0, 1, 0, 1, 0, 1]), [[0, 2, 2, 0], [2, 2, 0, 0]])
    """
    from sec_lab.classification import unsupervised_classes
    from sec_lab.similarity import similarity_table

    names, given = _as_demonstrations(demonstrations, at_least="three")
    if len(given) < LEAST_COUNT + 1:
        raise ValueError(f"demonstrations: expected at least three, got {len(given)}")
    table = similarity_table(
        {name: _chain_of(one) for name, one in zip(names, given, strict=True)}, normalizer=normalizer,
        tolerance_percent=tolerance_percent, effort=effort, n_threads=n_threads,
    )  # fmt: skip
    classes = unsupervised_classes(table, rng=rng, k_max=k_max)
    models: list[ActionModel | None] = []
    for number in range(classes.max() + 1):
        members = {names[i]: given[i] for i in np.flatnonzero(classes == number)}
        models.append(
            learn(
                members, weight_threshold=weight_threshold, normalizer=normalizer, tolerance_percent=tolerance_percent,
                effort=effort, n_threads=n_threads,
            ) if len(members) >= LEAST_COUNT else None
        )  # fmt: skip
    return LearnedTypes(table, classes, tuple(models))


def _gather(packed: Packed, options: Options, n_threads: int | None) -> Frame:
    """Rows and columns of a sample of the demonstrations, the most typical one first."""
    n = len(packed.n_columns)
    sample = np.unique(np.linspace(0, n - 1, min(n, SAMPLE)).astype(np.int64))
    table = temporal_of_packed(
        PackedChains.of_tables([packed.codes_of(i) for i in sample]), shorter=options.shorter,
        tolerance_percent=options.tolerance_percent, effort=options.effort, n_threads=n_threads,
    )  # fmt: skip
    both = (table + table.T) / 2
    typical = int(np.argmax(both.sum(axis=1)))
    profile = Profile(packed.codes_of(sample[typical]), options)
    order = np.argsort(-both[typical], kind="stable")
    profile.add_all(packed, sample[order[order != typical]])
    strong_rows, strong_columns = profile.strong
    likely = profile.row_counts >= LEAST_COUNT, profile.column_counts >= LEAST_COUNT
    rows, columns = (
        weak & (counts >= options.threshold_so_far / 2 * profile.n)
        for weak, counts in zip(likely, (profile.row_counts, profile.column_counts), strict=True)
    )
    if not rows.any():
        raise ValueError("demonstrations: expected rows that are common to some, got chains without a common row")
    if not (strong_rows & rows).any() or not (strong_columns & columns).any():
        strong_rows, strong_columns = rows, columns
    return Frame(profile.codes[rows][:, columns], strong_rows[rows], strong_columns[columns])


def _vote(packed: Packed, frame: Frame, options: Options, n_threads: int | None, voters: NDArray[np.int64]) -> Ballot:
    """Let demonstrations vote on the entries of the rows and columns that they have."""
    n, (m, u) = len(voters), frame.codes.shape
    starts, n_changing, n_columns = packed.code_starts[voters], packed.n_changing[voters], packed.n_columns[voters]
    rows, columns, similarity = np.empty((n, m), np.int64), np.empty((n, u), np.int64), np.empty(n)
    codes = np.ascontiguousarray(frame.codes)

    def task(part: tuple[int, int]) -> None:
        kernels.align_chains(
            *part, codes, frame.strong_rows, frame.strong_columns, packed.codes, starts, n_changing, n_columns,
            int(options.shorter), options.tolerance_percent, options.effort, rows, columns, similarity,
        )  # fmt: skip

    parts = list(pairwise([*range(0, n, _CHUNK), n]))
    if len(parts) == 1:
        task(parts[0])
    else:
        with ThreadPoolExecutor(n_threads or len(os.sched_getaffinity(0))) as pool:
            list(pool.map(task, parts))
    votes = np.zeros((m, u, kernels.N_CODES), np.int64)
    kernels.count_votes(packed.codes, starts, n_columns, rows, columns, votes)
    return Ballot(votes, codes, (rows >= 0).sum(axis=0), (columns >= 0).sum(axis=0), n, rows, columns)


def _as_options(weight_threshold: float, normalizer: str, tolerance_percent: float, effort: int) -> Options:
    if not 0 <= weight_threshold <= 1:
        raise ValueError(f"weight_threshold: expected 0 to 1, got {weight_threshold}")
    check_options(normalizer, tolerance_percent, "original", effort)
    return Options(normalizer == "shorter", float(tolerance_percent), effort, float(weight_threshold))


def _as_demonstrations(
    demonstrations: Demonstrations, *, at_least: str = "two"
) -> tuple[list[str], list[Demonstration]]:
    if isinstance(demonstrations, Mapping):
        names, given = [str(name) for name in demonstrations], list(demonstrations.values())
    elif isinstance(demonstrations, EventChain | Observation):
        raise TypeError("demonstrations: expected several chains or observations, got a single one")
    else:
        given = list(demonstrations)
        names = [str(i + 1) for i in range(len(given))]
    if not given:
        raise ValueError(f"demonstrations: expected at least {at_least}, got none")
    return names, given


def _chain_of(demonstration: Demonstration) -> EventChain:
    return demonstration.chain if isinstance(demonstration, Observation) else demonstration
