"""Classifiers against each other on the same noisy samples (§3.2.2): true and false positives, and a test.

All are trained and judged on the same chains. Training and judging samples are drawn apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.event_chain import EventChain
from sec_lab.noise import LEVELS, Noise, as_count, as_level, noisy_samples, shuffled_rows

if TYPE_CHECKING:
    import pandas as pd

FLIPS = Noise(mode="flip only")
"""Noise of §3.2: chains keep their size."""


@dataclass(frozen=True, eq=False)
class OpponentStudy:
    """What classifiers said of noisy samples of some types of actions.

    Attributes
    ----------
    classes : tuple of str
    levels : (n_levels,) float64
    known : (n,) int64
        Number of the class of each sample; the same at all levels.
    answers : mapping of str to (n_levels, n) int64
        By classifier: number of the class that it gave.
    outputs : mapping of str to (n_levels, n, n_classes) float64
        What it said of each class; larger is more.
    """

    classes: tuple[str, ...]
    levels: NDArray[np.float64]
    known: NDArray[np.int64]
    answers: Mapping[str, NDArray[np.int64]]
    outputs: Mapping[str, NDArray[np.float64]]

    def __post_init__(self) -> None:
        for name in ("levels", "known"):
            object.__setattr__(self, name, _protected(getattr(self, name)))
        for name in ("answers", "outputs"):
            arrays = {key: _protected(array) for key, array in getattr(self, name).items()}
            object.__setattr__(self, name, MappingProxyType(arrays))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.classes, self.levels, self.known, dict(self.answers), dict(self.outputs))


def _protected(array: NDArray[Any]) -> NDArray[Any]:
    copy = np.array(array)
    copy.setflags(write=False)
    return copy


def labelled_samples(
    seeds: Mapping[str, EventChain],
    p: float,
    *,
    n_samples: int = 100,
    rng: np.random.Generator,
    noise: Noise = FLIPS,
    shuffle: bool = False,
) -> tuple[list[EventChain], NDArray[np.str_]]:
    """Noisy samples of every seed with the name of the seed.

    Parameters
    ----------
    seeds, p, n_samples, rng, noise
        As in :func:`~sec_lab.noise.noisy_samples`; so many samples of each seed.
    shuffle : bool, optional
        Put the rows of every sample in any order.

    Raises
    ------
    TypeError
        If the seeds are no mapping.
    ValueError
        If there is no seed, or as in :func:`~sec_lab.noise.noisy_samples`.

    Examples
    --------
    >>> from sec_lab.noise_seeds import CLASS_SEEDS
    >>> chains, names = labelled_samples(CLASS_SEEDS, 0.1, n_samples=2, rng=np.random.default_rng(0))
    >>> len(chains), names[0].item()
    (8, 'moving')
    """
    if not isinstance(seeds, Mapping):
        raise TypeError(f"seeds: expected a mapping of names to event chains, got {type(seeds).__name__}")
    if not seeds:
        raise ValueError("seeds: expected at least one, got none")
    chains: list[EventChain] = []
    for seed in seeds.values():
        samples = noisy_samples(seed, p, n_samples=n_samples, rng=rng, noise=noise)
        chains += shuffled_rows(samples, rng=rng) if shuffle else list(samples)
    return chains, np.repeat(list(seeds), n_samples)


def opponent_study(
    classifiers: Mapping[str, Any],
    seeds: Mapping[str, EventChain],
    *,
    rng: np.random.Generator,
    levels: Sequence[float] = LEVELS,
    n_samples: int = 100,
    noise: Noise = FLIPS,
    shuffle: bool = False,
    progress: bool = False,
) -> OpponentStudy:
    """Let trained classifiers judge the same fresh samples of every level.

    Parameters
    ----------
    classifiers : mapping of str to classifier
        Fitted ones, with ``classes_``, ``predict`` and ``decision_function`` or ``predict_proba`` for sequences of
        chains; their classes are the names of the seeds.
    seeds, rng, n_samples, noise, shuffle
        As in :func:`labelled_samples`.
    levels : sequence of float, optional
        Noise levels, 0 to 1.
    progress : bool, optional
        Show a progress bar.

    Raises
    ------
    TypeError
        If classifiers or seeds are no mappings.
    ValueError
        If there is no classifier, level or seed, a classifier knows other classes, or as in
        :func:`~sec_lab.noise.noisy_samples`.
    sklearn.exceptions.NotFittedError
        If a classifier has learned nothing yet.

    Examples
    --------
    >>> from sec_lab.baselines import string_kernel_machine
    >>> from sec_lab.noise_seeds import CLASS_SEEDS
    >>> machine = string_kernel_machine().fit(list(CLASS_SEEDS.values()), list(CLASS_SEEDS))
    >>> study = opponent_study(
    ...     {"kernel": machine}, CLASS_SEEDS, levels=[0], n_samples=2, rng=np.random.default_rng(0)
    ... )
    >>> study.answers["kernel"].tolist()
    [[0, 0, 1, 1, 2, 2, 3, 3]]
    """
    from tqdm import tqdm

    _check_fitted(classifiers, list(seeds))
    as_count(n_samples, "n_samples")
    levels = [as_level(level) for level in levels]
    if not levels:
        raise ValueError("levels: expected at least one noise level, got none")
    names = list(seeds)
    answers: dict[str, list[NDArray[np.int64]]] = {name: [] for name in classifiers}
    outputs: dict[str, list[NDArray[np.float64]]] = {name: [] for name in classifiers}
    known = np.repeat(np.arange(len(names)), n_samples)
    for level in tqdm(levels, unit="level", desc="judging", disable=not progress):
        chains, _ = labelled_samples(seeds, level, n_samples=n_samples, rng=rng, noise=noise, shuffle=shuffle)
        for name, machine in classifiers.items():
            order = [machine.classes_.tolist().index(one) for one in names]
            said = getattr(machine, "decision_function", None) or machine.predict_proba
            output = np.asarray(said(chains), np.float64)
            if output.ndim == 1:
                # Of two classes scikit-learn gives only what speaks for the second.
                output = np.column_stack([-output, output])
            outputs[name].append(output[:, order])
            answers[name].append(np.array([names.index(answer) for answer in machine.predict(chains).tolist()]))
    return OpponentStudy(
        tuple(names), np.asarray(levels, np.float64), known,
        {name: np.stack(found) for name, found in answers.items()},
        {name: np.stack(found) for name, found in outputs.items()},
    )  # fmt: skip


def _check_fitted(classifiers: Mapping[str, Any], names: Sequence[str]) -> None:
    from sklearn.exceptions import NotFittedError

    if not isinstance(classifiers, Mapping):
        raise TypeError(f"classifiers: expected a mapping of names to classifiers, got {type(classifiers).__name__}")
    if not classifiers:
        raise ValueError("classifiers: expected at least one, got none")
    for name, machine in classifiers.items():
        try:
            known = np.asarray(machine.classes_).tolist()
        except AttributeError as error:
            raise NotFittedError(f"classifiers: expected fitted ones, got {name!r} that has learned nothing") from error
        if sorted(map(str, known)) != sorted(map(str, names)):
            raise ValueError(f"seeds: expected the classes of {name!r}, {known}, got {list(names)}")


def _of(study: OpponentStudy, classifier: str) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Answers and outputs of a classifier."""
    if classifier not in study.answers:
        raise ValueError(f"classifier: expected one of {list(study.answers)}, got {classifier!r}")
    return study.answers[classifier], study.outputs[classifier]


def positives(study: OpponentStudy, classifier: str) -> "pd.DataFrame":
    """True and false positives of each class in percent of its samples (Fig. 3.9).

    Parameters
    ----------
    study : OpponentStudy
    classifier : str

    Returns
    -------
    pandas.DataFrame
        One row a level; columns (class, ``"TP"`` or ``"FP"``). A false positive is a sample of another class that was
        taken for this one.

    Raises
    ------
    ValueError
        If there is no such classifier.

    Examples
    --------
    >>> known, answers = np.array([0, 0, 1, 1]), {"one": [[0, 0, 1, 0]], "other": [[1, 1, 1, 1]]}
    >>> outputs = {name: np.eye(2)[np.array(said)] for name, said in answers.items()}
    >>> study = OpponentStudy(("a", "b"), np.array([0.1]), known, answers, outputs)
    >>> positives(study, "one").loc[0.1, "a"].to_dict()
    {'TP': 100.0, 'FP': 50.0}
    """
    import pandas as pd

    answers, _ = _of(study, classifier)
    columns = {}
    for number, name in enumerate(study.classes):
        of_class = study.known == number
        taken = answers == number
        columns[name, "TP"] = 100.0 * (taken & of_class).sum(axis=1) / of_class.sum()
        columns[name, "FP"] = 100.0 * (taken & ~of_class).sum(axis=1) / of_class.sum()
    return pd.DataFrame(columns, index=pd.Index(study.levels, name="noise level p"))


def right_percent(study: OpponentStudy) -> "pd.DataFrame":
    """Share of right answers in percent, one row a level, one column a classifier.

    Examples
    --------
    >>> known, answers = np.array([0, 0, 1, 1]), {"one": [[0, 0, 1, 0]], "other": [[1, 1, 1, 1]]}
    >>> outputs = {name: np.eye(2)[np.array(said)] for name, said in answers.items()}
    >>> study = OpponentStudy(("a", "b"), np.array([0.1]), known, answers, outputs)
    >>> right_percent(study).loc[0.1].to_dict()
    {'one': 75.0, 'other': 50.0}
    """
    import pandas as pd

    right = {name: 100.0 * (answers == study.known).mean(axis=1) for name, answers in study.answers.items()}
    return pd.DataFrame(right, index=pd.Index(study.levels, name="noise level p"))


def paired_test(study: OpponentStudy, one: str, other: str) -> "pd.DataFrame":
    """Test whether two classifiers are right equally often on the same samples (McNemar's exact test).

    Parameters
    ----------
    study : OpponentStudy
    one, other : str
        Classifiers.

    Returns
    -------
    pandas.DataFrame
        One row a level: how many samples only the one or only the other has right, the probability of a difference as
        large by chance, and the same after Holm's correction for all levels.

    Raises
    ------
    ValueError
        If there is no such classifier.

    Examples
    --------
    >>> known, answers = np.array([0, 0, 1, 1]), {"one": [[0, 0, 1, 0]], "other": [[1, 1, 1, 1]]}
    >>> outputs = {name: np.eye(2)[np.array(said)] for name, said in answers.items()}
    >>> study = OpponentStudy(("a", "b"), np.array([0.1]), known, answers, outputs)
    >>> paired_test(study, "one", "other").loc[0.1, ["only one", "only other", "chance"]].tolist()
    [2.0, 1.0, 1.0]
    """
    import pandas as pd
    from scipy.stats import binomtest

    right = [_of(study, name)[0] == study.known for name in (one, other)]
    only_one, only_other = (right[0] & ~right[1]).sum(axis=1), (right[1] & ~right[0]).sum(axis=1)
    p_values = np.array(
        [
            binomtest(int(a), int(a + b)).pvalue if a + b else 1.0
            for a, b in zip(only_one.tolist(), only_other.tolist(), strict=True)
        ]
    )
    order = np.argsort(p_values)
    steps = np.maximum.accumulate(p_values[order] * np.arange(len(order), 0, -1))
    corrected = np.empty_like(p_values)
    corrected[order] = np.minimum(steps, 1.0)
    return pd.DataFrame(
        {f"only {one}": only_one, f"only {other}": only_other, "chance": p_values, "chance, corrected": corrected},
        index=pd.Index(study.levels, name="noise level p"),
    )


def precision_recall(
    study: OpponentStudy, classifier: str, level: float, *, relative: bool = False
) -> "dict[str, tuple[Any, Any]]":
    """Recall and precision of each class for all thresholds of the outputs (Fig. 3.10).

    What the threshold is for, the thesis does not say. Either each output stands for itself; or what counts is how far
    it is above the best of the others of the same sample, as the answer is the class with the largest output.

    Parameters
    ----------
    study : OpponentStudy
    classifier : str
    level : float
        One of the levels of the study.
    relative : bool, optional
        Take each output less the best of the others, instead of the output itself.

    Returns
    -------
    dict of str to (recall, precision)
        By class; flat float64 from 0 to 1.

    Raises
    ------
    ValueError
        If the level was not studied, there is no such classifier, or nothing to be relative to.

    Examples
    --------
    Each sample is most like its own class, but what the second is like is larger altogether:

    >>> outputs = np.array([[[0.4, 0.1], [0.8, 0.9]]])
    >>> study = OpponentStudy(("a", "b"), np.array([0.1]), np.array([0, 1]), {"one": [[0, 1]]}, {"one": outputs})
    >>> precision_recall(study, "one", 0.1)["a"][1], precision_recall(study, "one", 0.1, relative=True)["a"][1]
    (array([0.5, 0. , 1. ]), array([0.5, 1. , 1. ]))
    """
    from sklearn.metrics import precision_recall_curve

    at = np.flatnonzero(np.isclose(study.levels, level))
    if not len(at):
        raise ValueError(f"level: expected one of {study.levels.tolist()}, got {level}")
    said = _of(study, classifier)[1][at[0]]
    if relative:
        if said.shape[1] < 2:
            raise ValueError(f"relative: expected at least two classes, got {said.shape[1]}")
        said = np.column_stack([said[:, k] - np.delete(said, k, axis=1).max(axis=1) for k in range(said.shape[1])])
    curves = {}
    for number, name in enumerate(study.classes):
        precision, recall, _ = precision_recall_curve(study.known == number, said[:, number])
        curves[name] = recall, precision
    return curves
