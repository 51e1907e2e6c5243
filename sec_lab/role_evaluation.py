"""How well role tables recognise recordings that had no part in any choice.

Whatever can be chosen (a step of cleaning, a strength of regularisation) is chosen anew for every recording that is
judged, by those that are not judged: a nested run. Folds are made without chance, so a run is the same every time.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn import config_context
from sklearn.base import clone

from sec_lab.classification import Classes, leave_one_out
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.recognition import rate
from sec_lab.role_classifier import RoleTableClassifier
from sec_lab.role_tables import Cleaning, Compressed, RoleTable, role_similarity_table, role_table

if TYPE_CHECKING:
    import pandas as pd

_LEAST_PROBABILITY = 1e-12

Option = tuple[RoleTableClassifier, Sequence[RoleTable]]
Step = TypeVar("Step")


@dataclass(frozen=True, eq=False)
class NestedAnswers:
    """Answers of a nested run.

    Attributes
    ----------
    predicted : (n,) ndarray
        What each recording was recognised as.
    chosen : tuple of n str
        The option that was chosen for it.
    """

    predicted: NDArray[Any]
    chosen: tuple[str, ...]


def nested_neighbours(
    similarities: Mapping[str, ArrayLike],
    classes: Classes,
    *,
    groups: "Classes | None" = None,
    progress: bool = False,
) -> NestedAnswers:
    """Nearest neighbours, each by the table that serves best among the others.

    The best table has the largest mean margin: how much more similar a recording is to its nearest neighbour of its own
    class than to the nearest one of any other. The number of right answers would do as well but for its steps, by
    which a single recording decides.

    Parameters
    ----------
    similarities : mapping of str to (n, n) array_like of float
        Options.
    classes : (n,) array_like
        What each recording shows.
    groups : (n,) array_like, optional
        What is left out together, e.g. all recordings of one person; each recording alone if left out.
    progress : bool, optional
        Show a progress bar.

    Raises
    ------
    ValueError
        If there is no option, or as in :func:`~sec_lab.classification.leave_one_out`.

    Examples
    --------
    >>> good, bad = np.kron(np.eye(2), np.ones((3, 3))), np.kron(np.ones((3, 3)), np.eye(2))
    >>> nested_neighbours({"bad": bad, "good": good}, list("aaabbb")).predicted.tolist()
    ['a', 'a', 'a', 'b', 'b', 'b']
    """
    types, held_out = _outer(classes, groups)
    tables = {name: np.asarray(table, np.float64) for name, table in similarities.items()}
    if not tables:
        raise ValueError("similarities: expected at least one option, got none")
    predicted: NDArray[Any] = types.copy()
    chosen = [""] * len(types)
    for left in _watched(held_out, progress=progress):
        train = np.flatnonzero(~left)
        margins = {name: _mean_margin(table[np.ix_(train, train)], types[train]) for name, table in tables.items()}
        best = max(margins, key=lambda name: margins[name])
        for i in np.flatnonzero(left).tolist():
            with_others = np.append(train, i)
            among = tables[best][np.ix_(with_others, with_others)]
            predicted[i] = leave_one_out(among, types[with_others])[-1]
            chosen[i] = best
    return NestedAnswers(predicted, tuple(chosen))


def nested_classifier(
    options: Mapping[str, Option],
    classes: Classes,
    *,
    groups: "Classes | None" = None,
    n_folds: int = 5,
    progress: bool = False,
) -> NestedAnswers:
    """Answers of the classifier, each by the option that serves best among the others.

    The best option gives the classes of the recordings the largest mean logarithm of their probability, in a cross
    validation among the others.

    Parameters
    ----------
    options : mapping of str to (RoleTableClassifier, sequence of n RoleTable)
        A classifier, and the role tables of all recordings by its cleaning.
    classes : (n,) array_like
    groups : (n,) array_like, optional
        What is left out together, for judging and for choosing; each recording alone if left out.
    n_folds : int, optional
        Parts into which the others are divided to choose, unless there are groups.
    progress : bool, optional
        Show a progress bar.

    Raises
    ------
    ValueError
        If there is no option, an option has another number of tables than there are classes, or there are fewer than
        two parts.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> pairs = [(7, 1), (7, 2), (2, 1)]
    >>> put = role_table(EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [0, 0, 0, 2, 2]], pairs))
    >>> take = role_table(EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [2, 2, 2, 0, 0]], pairs))
    >>> options = {f"C = {C}": (RoleTableClassifier(C=C), [put, take] * 3) for C in (0.3, 1.0)}
    >>> found = nested_classifier(options, ["put", "take"] * 3, n_folds=2)
    >>> found.predicted[:2].tolist(), found.chosen[0]
    (['put', 'take'], 'C = 1.0')
    """
    types, held_out = _outer(classes, groups)
    if not options:
        raise ValueError("options: expected at least one, got none")
    for name, (_, tables) in options.items():
        if len(tables) != len(types):
            raise ValueError(f"options: expected {len(types)} role tables in {name!r}, got {len(tables)}")
    if not isinstance(n_folds, int | np.integer) or n_folds < 2:
        raise ValueError(f"n_folds: expected a whole number of at least 2, got {n_folds!r}")
    parts = None if groups is None else np.asarray(groups)
    predicted: NDArray[Any] = types.copy()
    chosen = [""] * len(types)
    for left in _watched(held_out, progress=progress):
        train = np.flatnonzero(~left)
        best = next(iter(options))
        if len(options) > 1:
            folds = _folds(types[train], n_folds) if parts is None else parts[train]
            scores = {name: _mean_log_probability(option, types, train, folds) for name, option in options.items()}
            best = max(scores, key=lambda name: scores[name])
        answers = _answers(options[best], types, train, np.flatnonzero(left))
        predicted[left] = answers
        for i in np.flatnonzero(left).tolist():
            chosen[i] = best
    return NestedAnswers(predicted, tuple(chosen))


def ingredient_table(
    recordings: Mapping[str, Observation | EventChain],
    classes: Classes,
    *,
    cleanings: Mapping[str, Cleaning],
    strengths: Sequence[float] = (0.3, 1.0),
    nested: bool = True,
    progress: bool = False,
) -> "pd.DataFrame":
    """What each way of cleaning changes, recordings being left out one at a time.

    Parameters
    ----------
    recordings : mapping of str to Observation or EventChain
    classes : (n,) array_like
        What each recording shows.
    cleanings : mapping of str to Cleaning
        What is compared.
    strengths : sequence of float, optional
        Values of C that the nested run chooses from; the other run takes the default.
    nested : bool, optional
        Run the nested choice of C too. It takes longest, so here one recording of each class is left out at a time.
    progress : bool, optional
        Show a progress bar.

    Returns
    -------
    pandas.DataFrame
        A row a cleaning: how many are recognised by their nearest neighbour (with rows compressed to changes, and with
        the compression chosen in a nested run), by the classifier, and by the classifier with a nested choice of C; of
        the last of these runs percent and Wilson interval.

    Raises
    ------
    ValueError
        If there is no recording or way of cleaning, or another number of classes than of recordings.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> pairs = [(7, 1), (7, 2), (2, 1)]
    >>> put = EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [0, 0, 0, 2, 2]], pairs)
    >>> take = EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [2, 2, 2, 0, 0]], pairs)
    >>> seen = {f"{what} {n}": chain for n in range(3) for what, chain in (("put", put), ("take", take))}
    >>> table = ingredient_table(seen, ["put", "take"] * 3, cleanings={"default": Cleaning()}, nested=False)
    >>> table.loc["default", ["neighbour", "classifier", "percent"]].tolist()
    [6.0, 6.0, 100.0]
    """
    import pandas as pd

    for name, given in (("recordings", recordings), ("cleanings", cleanings)):
        if not isinstance(given, Mapping) or not given:
            raise ValueError(f"{name}: expected a mapping with at least one entry, got {type(given).__name__}")
    rows = {}
    types = np.asarray(classes)
    if types.shape != (len(recordings),):
        raise ValueError(f"classes: expected one for each of {len(recordings)} recordings, got shape {types.shape}")
    rounds = _folds(types, len(types))
    for name, cleaning in _watched(list(cleanings.items()), progress=progress):
        tables = [role_table(one, cleaning=cleaning) for one in recordings.values()]
        similar = {way: role_similarity_table(tables, compressed=way) for way in get_args(Compressed)}
        row = {
            "neighbour": int((nested_neighbours({"changes": similar["changes"]}, types).predicted == types).sum()),
            "neighbour, nested": int((nested_neighbours(similar, types).predicted == types).sum()),
        }
        alone = {"default": (RoleTableClassifier(), tables)}
        row["classifier"] = int((nested_classifier(alone, types).predicted == types).sum())
        last = row["classifier"]
        if nested:
            options = {f"C = {C}": (RoleTableClassifier(C=C), tables) for C in strengths}
            last = int((nested_classifier(options, types, groups=rounds).predicted == types).sum())
            row["classifier, nested"] = last
        found = rate(last, len(types))
        rows[name] = row | {
            "percent": found.percent,
            "low_percent": found.low_percent,
            "high_percent": found.high_percent,
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("cleaned")


def learning_curve(
    option: Option,
    classes: Classes,
    *,
    n_demonstrations: Sequence[int],
    n_draws: int,
    rng: np.random.Generator,
    progress: bool = False,
) -> dict[int, NDArray[np.float64]]:
    """Percent recognised of all others, after few demonstrations of each class.

    Parameters
    ----------
    option : (RoleTableClassifier, sequence of n RoleTable)
    classes : (n,) array_like
    n_demonstrations : sequence of int
        Demonstrations of each class that are learned from.
    n_draws : int
        How often demonstrations are drawn.
    rng : numpy.random.Generator
    progress : bool, optional
        Show a progress bar.

    Returns
    -------
    dict of int to (n_draws,) float64

    Raises
    ------
    ValueError
        If a number leaves no recording to be judged, a class has fewer recordings, or nothing is drawn.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> pairs = [(7, 1), (7, 2), (2, 1)]
    >>> put = role_table(EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [0, 0, 0, 2, 2]], pairs))
    >>> take = role_table(EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [2, 2, 2, 0, 0]], pairs))
    >>> option = RoleTableClassifier(), [put, take] * 3
    >>> learning_curve(
    ...     option, ["put", "take"] * 3, n_demonstrations=[1, 2], n_draws=2, rng=np.random.default_rng(0)
    ... )
    {1: array([100., 100.]), 2: array([100., 100.])}
    """
    if not isinstance(n_draws, int | np.integer) or n_draws < 1:
        raise ValueError(f"n_draws: expected a whole number of at least 1, got {n_draws!r}")
    types = np.asarray(classes)
    members = [np.flatnonzero(types == one) for one in dict.fromkeys(types.tolist())]
    fewest = min(len(one) for one in members)
    found = {}
    for n in _watched(list(n_demonstrations), progress=progress):
        if not 1 <= n < fewest:
            raise ValueError(f"n_demonstrations: expected 1 to {fewest - 1}, got {n}")
        draws = []
        for _ in range(n_draws):
            train = np.sort(np.concatenate([rng.choice(one, n, replace=False) for one in members]))
            others = np.setdiff1d(np.arange(len(types)), train)
            draws.append(100.0 * float((_answers(option, types, train, others) == types[others]).mean()))
        found[n] = np.array(draws)
    return found


def _watched(steps: Sequence[Step], *, progress: bool) -> Iterable[Step]:
    """The steps, with a progress bar if asked for."""
    from tqdm import tqdm

    bar: Iterable[Step] = tqdm(steps, unit="step", desc="judging", disable=not progress)
    return bar


def _outer(classes: Classes, groups: "Classes | None") -> tuple[NDArray[Any], list[NDArray[np.bool_]]]:
    types = np.asarray(classes)
    parts = np.arange(len(types)) if groups is None else np.asarray(groups)
    if parts.shape != types.shape:
        raise ValueError(f"groups: expected one for each of {len(types)} recordings, got shape {parts.shape}")
    return types, [parts == part for part in dict.fromkeys(parts.tolist())]


def _folds(types: NDArray[Any], n_folds: int) -> NDArray[np.int64]:
    """Fold of each recording: the members of each class are dealt out in turn."""
    folds = np.empty(len(types), np.int64)
    for one in dict.fromkeys(types.tolist()):
        at = np.flatnonzero(types == one)
        folds[at] = np.arange(len(at)) % n_folds
    return folds


def _mean_margin(similar: NDArray[np.float64], types: NDArray[Any]) -> float:
    same = types[:, None] == types
    others = ~np.eye(len(types), dtype=np.bool_)
    own = np.where(same & others, similar, -np.inf).max(axis=1, initial=-np.inf)
    foreign = np.where(same, -np.inf, similar).max(axis=1, initial=-np.inf)
    judged = np.isfinite(own) & np.isfinite(foreign)
    return float((own - foreign)[judged].mean()) if judged.any() else 0.0


def _mean_log_probability(option: Option, types: NDArray[Any], train: NDArray[np.intp], folds: NDArray[Any]) -> float:
    logs = []
    for fold in np.unique(folds):
        learned, judged = train[folds != fold], train[folds == fold]
        model = _learned(option, types, learned)
        probabilities = model.predict_proba([option[1][i] for i in judged.tolist()])
        # A class that was not among the learned ones has no probability at all.
        own = np.where(model.classes_ == types[judged][:, None], probabilities, 0.0).sum(axis=1)
        logs.append(np.log(np.maximum(own, _LEAST_PROBABILITY)))
    return float(np.concatenate(logs).mean())


def _answers(option: Option, types: NDArray[Any], train: NDArray[np.intp], judged: NDArray[np.intp]) -> NDArray[Any]:
    model = _learned(option, types, train)
    found: NDArray[Any] = model.predict([option[1][i] for i in judged.tolist()])
    return found


def _learned(option: Option, types: NDArray[Any], train: NDArray[np.intp]) -> RoleTableClassifier:
    classifier, tables = option
    # Thousands of fits of small tables that are known to be sound: checking them would take a third of the time.
    with config_context(assume_finite=True, skip_parameter_validation=True):
        model: RoleTableClassifier = clone(classifier).fit([tables[i] for i in train.tolist()], types[train])
    return model
