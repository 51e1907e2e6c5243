"""How well manipulations are recognised: rates with their uncertainty, variants beside each other, controls.

Recognition itself is :func:`~sec_lab.classification.leave_one_out` on a table of similarities (§2.7); here the outcomes
are counted. A share of few recordings says little, so each comes with its Wilson interval.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.classification import Classes, Table, leave_one_out, undecided
from sec_lab.codes import as_array
from sec_lab.similarity import Direction, Measure, PairwiseSimilarity

if TYPE_CHECKING:
    import pandas as pd

# Percentages are quotients of whole numbers; differences below this come from rounding.
_ROUNDING_PERCENT = 1e-9


@dataclass(frozen=True)
class Rate:
    """Share of right answers, and the interval that holds the true share with some confidence.

    Attributes
    ----------
    n_right, n : int
        Right answers, and all answers.
    percent : float
        100 · n_right / n.
    low_percent, high_percent : float
        Wilson score interval.
    """

    n_right: int
    n: int
    percent: float
    low_percent: float
    high_percent: float


def rate(n_right: int, n: int, *, confidence_percent: float = 95.0) -> Rate:
    """Share of right answers with its Wilson score interval.

    The interval takes the answers for independent of each other. Those of a leave-one-out run are not quite: the same
    recordings serve as neighbours again and again.

    Parameters
    ----------
    n_right, n : int
        Right answers, and all answers.
    confidence_percent : float, optional
        Above 0 and below 100.

    Returns
    -------
    Rate

    Raises
    ------
    ValueError
        If there is no answer, or not 0 to n of them are right, or the confidence is out of range.

    Examples
    --------
    >>> half = rate(40, 80)
    >>> half.percent, round(half.low_percent, 1), round(half.high_percent, 1)
    (50.0, 39.3, 60.7)
    """
    from scipy.stats import binomtest

    if n < 1 or not 0 <= n_right <= n:
        raise ValueError(f"rate: expected 0 to n right answers and n from 1 on, got {n_right} of {n}")
    if not 0 < confidence_percent < 100:
        raise ValueError(f"confidence_percent: expected more than 0, less than 100, got {confidence_percent}")
    interval = binomtest(n_right, n).proportion_ci(confidence_percent / 100, method="wilson")
    return Rate(n_right, n, 100.0 * n_right / n, 100.0 * float(interval.low), 100.0 * float(interval.high))


def symmetrised(table: "pd.DataFrame | ArrayLike", *, direction: Direction) -> NDArray[np.float64]:
    """Bring the two directions of a directed table together, as :func:`~sec_lab.similarity.similarity_table` does.

    Parameters
    ----------
    table : (n, n) array_like of float
        Directed similarities, row = ξ¹.
    direction : {"mean", "smaller", "larger", "directed"}
        Mean, smaller or larger of both directions; or the table as it is.

    Returns
    -------
    (n, n) float64

    Raises
    ------
    ValueError
        If the table is not square, or the direction is unknown.

    Examples
    --------
    >>> symmetrised([[100, 40], [60, 100]], direction="mean")
    array([[100.,  50.],
           [ 50., 100.]])
    """
    if direction not in get_args(Direction):
        raise ValueError(f"direction: expected one of {get_args(Direction)}, got {direction!r}")
    values = _as_square(table)
    if direction == "directed":
        return values
    if direction == "mean":
        return (values + values.T) / 2
    both: NDArray[np.float64] = (np.minimum if direction == "smaller" else np.maximum)(values, values.T)
    return both


def recognition_table(
    similarities: Mapping[tuple[str, ...], PairwiseSimilarity],
    classes: Classes,
    *,
    names: Sequence[str],
    directions: Sequence[Direction] = get_args(Direction),
) -> "pd.DataFrame":
    """Leave-one-out recognition for each measure and direction of several sets of similarities.

    Parameters
    ----------
    similarities : mapping of tuple of str to PairwiseSimilarity
        All of the same manipulations; the key tells what was varied. Both measures must have been computed.
    classes : (n,) array_like
        Known type of each manipulation.
    names : sequence of str
        What each entry of a key is.
    directions : sequence of {"mean", "smaller", "larger", "directed"}, optional

    Returns
    -------
    pandas.DataFrame
        Index: the keys, ``measure``, ``direction``. ``n_right``, ``percent``, ``low_percent`` and ``high_percent`` are
        those of :func:`rate`; ``n_undecided`` of the answers hang on the order of the table alone (see
        :func:`~sec_lab.classification.undecided`).

    Raises
    ------
    ValueError
        If there is no set, a key has another number of entries than ``names``, a measure is missing, or the classes
        are not one a manipulation.

    Examples
    --------
    >>> alike = PairwiseSimilarity(np.eye(4) + 9, np.kron(np.eye(2), np.ones((2, 2))) * 90, np.ones((4, 4), bool))
    >>> table = recognition_table({("all",): alike}, list("aabb"), names=["segments"], directions=["mean"])
    >>> table[["n_right", "n_undecided"]]
                                 n_right  n_undecided
    segments measure  direction
    all      temporal mean             4            0
             spatial  mean             0            0
    """
    import pandas as pd

    if not similarities:
        raise ValueError("recognition: expected at least one set of similarities, got none")
    rows: dict[tuple[str, ...], dict[str, float]] = {}
    for key, similarity in similarities.items():
        if len(key) != len(names):
            raise ValueError(f"names: expected one for each entry of a key, got {list(names)} for {key}")
        for measure in get_args(Measure):
            table = getattr(similarity, measure)
            if not table.size:
                raise ValueError(f"recognition: expected both measures, got no {measure} one for {key}")
            for direction in directions:
                one_way = symmetrised(table, direction=direction)
                found = recognition_rate(classes, leave_one_out(one_way, classes))
                rows[(*key, measure, direction)] = {
                    "n_right": found.n_right,
                    "percent": found.percent,
                    "low_percent": found.low_percent,
                    "high_percent": found.high_percent,
                    "n_undecided": int(undecided(one_way, classes).sum()),
                }
    index = pd.MultiIndex.from_tuples(list(rows), names=[*names, "measure", "direction"])
    return pd.DataFrame(list(rows.values()), index=index)


def recognition_rate(classes: Classes, predicted: Classes) -> Rate:
    """Share of manipulations that were recognised as what they are.

    Parameters
    ----------
    classes, predicted : (n,) array_like
        Known type of each manipulation, and what it was recognised as.

    Raises
    ------
    ValueError
        If there is none, or the numbers are not the same.

    Examples
    --------
    >>> recognition_rate(["push", "pour"], ["push", "push"]).percent
    50.0
    """
    known, found = np.asarray(classes), np.asarray(predicted)
    if known.ndim != 1 or known.shape != found.shape:
        raise ValueError(f"predicted: expected shape {known.shape} as the classes, got {found.shape}")
    return rate(int((known == found).sum()), len(known))


def nearest_neighbours(table: Table, classes: Classes) -> "pd.DataFrame":
    """Who is most similar to whom: what stands behind each answer of :func:`~sec_lab.classification.leave_one_out`.

    Parameters
    ----------
    table : (n, n) pandas.DataFrame
        Similarities in percent; in a directed table, column j is the manipulation that is recognised.
    classes : (n,) array_like
        Known type of each manipulation.

    Returns
    -------
    pandas.DataFrame
        One row a manipulation: its ``class``; its ``nearest`` neighbour, whose ``nearest_class`` is the answer, and
        their ``similarity``; the nearest neighbour of its own class, ``own``, and ``own_similarity`` (None and NaN if
        the class has one member). The first of equally similar ones is named.

    Raises
    ------
    ValueError
        As in :func:`~sec_lab.classification.leave_one_out`.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame([[100, 64, 20], [64, 100, 70], [20, 70, 100]], list("abc"), list("abc"))
    >>> nearest_neighbours(frame, ["push", "push", "pour"]).loc["b"].to_dict()
    {'class': 'push', 'nearest': 'c', 'nearest_class': 'pour', 'similarity': 70.0, 'own': 'a', 'own_similarity': 64.0}
    """
    import pandas as pd

    answers = leave_one_out(table, classes)
    types = np.asarray(classes)
    names = list(getattr(table, "columns", range(len(types))))
    values = _as_square(table).copy()
    np.fill_diagonal(values, -np.inf)
    rows = []
    for column, known, answer in zip(values.T, types.tolist(), answers.tolist(), strict=True):
        nearest, similarity = _first_best(column, types == answer)
        own, own_similarity = _first_best(column, types == known)
        rows.append(
            {
                "class": known,
                "nearest": names[nearest],
                "nearest_class": answer,
                "similarity": similarity,
                "own": None if np.isnan(own_similarity) else names[own],
                "own_similarity": own_similarity,
            }
        )
    return pd.DataFrame(rows, index=pd.Index(names))


def class_means(table: Table, classes: Classes) -> "pd.DataFrame":
    """Mean of a table over each pair of classes, without its diagonal.

    Parameters
    ----------
    table : (n, n) pandas.DataFrame or array_like of float
        E.g. similarities in percent.
    classes : (n,) array_like
        Type of each row.

    Returns
    -------
    pandas.DataFrame
        Row and column: type, in the order of first appearance. NaN within a type that has one member.

    Raises
    ------
    ValueError
        If the table is not square, or the classes are not one a row.

    Examples
    --------
    >>> class_means([[100, 64, 20], [64, 100, 70], [20, 70, 100]], ["push", "push", "pour"])
          push  pour
    push  64.0  45.0
    pour  45.0   NaN
    """
    import pandas as pd

    values = _as_square(table).copy()
    types = np.asarray(classes)
    if types.shape != (len(values),):
        raise ValueError(f"classes: expected one for each of {len(values)} rows, got shape {types.shape}")
    present = list(dict.fromkeys(types.tolist()))
    member = np.array([types == one for one in present], dtype=float)
    counted = member @ (1.0 - np.eye(len(values))) @ member.T
    np.fill_diagonal(values, 0.0)
    means = np.divide(member @ values @ member.T, counted, out=np.full(counted.shape, np.nan), where=counted > 0)
    return pd.DataFrame(means, index=present, columns=present)


def closeness(numbers: "pd.DataFrame | ArrayLike") -> NDArray[np.float64]:
    """How close manipulations are in some plain numbers, such as how many key frames they have: a trivial control.

    Parameters
    ----------
    numbers : (n, k) pandas.DataFrame or array_like
        One row a manipulation. Each column is brought to mean 0 and standard deviation 1 first.

    Returns
    -------
    (n, n) float64
        Negative Euclidean distances, to be used like similarities.

    Raises
    ------
    ValueError
        If there is no row or no column, or a column is not finite or has the same number everywhere.

    Examples
    --------
    >>> closeness([[1], [3]])
    array([[-0., -2.],
           [-2., -0.]])
    """
    values = as_array(np.asarray(numbers), what="numbers", ndim=2).astype(np.float64)
    if not values.size or not np.isfinite(values).all():
        raise ValueError(f"numbers: expected finite ones, at least one row and column, got shape {values.shape}")
    spread = values.std(axis=0)
    if not spread.all():
        raise ValueError(
            f"numbers: expected different ones in column {int(np.argmin(spread))}, got the same everywhere"
        )
    standard = (values - values.mean(axis=0)) / spread
    distances: NDArray[np.float64] = np.linalg.norm(standard[:, None] - standard, axis=2)
    return -distances


def search_table(similarities: Mapping[int, PairwiseSimilarity], *, reference: int) -> "pd.DataFrame":
    """What more or less effort in the search for the best permutation changes (§2.6.2).

    Parameters
    ----------
    similarities : mapping of int to PairwiseSimilarity
        Of the same manipulations, by effort.
    reference : int
        Effort with which the others are compared.

    Returns
    -------
    pandas.DataFrame
        One row an effort: ``exact_percent`` is the share of ordered pairs proven to be optimal, ``changed_percent`` the
        share whose ψ_temporal differs from the reference, ``largest_change`` the largest difference in percentage
        points. A manipulation is never counted with itself.

    Raises
    ------
    ValueError
        If the reference is none of the efforts, or ψ_temporal is missing.

    Examples
    --------
    >>> none = np.empty((0, 0))
    >>> low = PairwiseSimilarity(none, np.array([[100.0, 50], [60, 100]]), np.array([[True, False], [True, True]]))
    >>> high = PairwiseSimilarity(none, np.array([[100.0, 55], [60, 100]]), np.ones((2, 2), bool))
    >>> search_table({10: low, 100: high}, reference=10)
            exact_percent  changed_percent  largest_change
    effort
    10               50.0              0.0             0.0
    100             100.0             50.0             5.0
    """
    import pandas as pd

    if reference not in similarities:
        raise ValueError(f"reference: expected one of {list(similarities)}, got {reference}")
    base = similarities[reference].temporal
    others = ~np.eye(len(base), dtype=bool)
    if not others.any():
        raise ValueError("search: expected temporal similarities of at least two manipulations, got fewer")
    rows = {}
    for effort, similarity in similarities.items():
        difference = np.abs(similarity.temporal - base)[others]
        rows[effort] = {
            "exact_percent": exact_percent(similarity),
            "changed_percent": 100.0 * float((difference > _ROUNDING_PERCENT).mean()),
            "largest_change": float(difference.max()),
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("effort")


def exact_percent(similarity: PairwiseSimilarity) -> float:
    """Share of ordered pairs, of different manipulations, whose ψ_temporal is proven to be the optimum.

    Raises
    ------
    ValueError
        If ψ_temporal is missing, or there are fewer than two manipulations.

    Examples
    --------
    >>> none = np.empty((0, 0))
    >>> exact_percent(PairwiseSimilarity(none, np.ones((2, 2)), np.array([[True, False], [True, True]])))
    50.0
    """
    n = len(similarity.exact)
    if n < 2:
        raise ValueError(f"similarity: expected temporal ones of at least two manipulations, got {n}")
    return 100.0 * float(similarity.exact[~np.eye(n, dtype=bool)].mean())


def _first_best(column: NDArray[np.float64], eligible: NDArray[np.bool_]) -> tuple[int, float]:
    """Place and value of the first of the largest values that are eligible; NaN if none is."""
    values = np.where(eligible, column, -np.inf)
    best = float(values.max())
    return int(np.argmax(values >= best - _ROUNDING_PERCENT)), np.nan if np.isneginf(best) else best


def _as_square(table: "pd.DataFrame | ArrayLike") -> NDArray[np.float64]:
    values = as_array(np.asarray(table), what="table", ndim=2).astype(np.float64)
    if values.shape[0] != values.shape[1]:
        raise ValueError(f"table: expected a square, got shape {values.shape}")
    return values
