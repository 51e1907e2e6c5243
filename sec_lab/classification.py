"""Classification of manipulations (step 6A, §2.7) from the table of their similarities.

Two manipulations are type-similar if their similarity reaches a threshold (64 % in §2.7); without any threshold and any
known type, X-means finds the classes from the correlations between the columns of the table; and with known types, a
manipulation is recognised by its most similar neighbour.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array

if TYPE_CHECKING:
    import pandas as pd

Table: TypeAlias = "pd.DataFrame | ArrayLike"
Classes: TypeAlias = "pd.Series[Any] | ArrayLike"

# Percentages are quotients of whole numbers; differences below this come from rounding.
_ROUNDING_PERCENT = 1e-9

# Jolliffe (1972): of a principal component of correlations that is kept.
_LEAST_EIGENVALUE = 0.7


def type_similar(table: Table, *, threshold_percent: float) -> NDArray[np.bool_]:
    """Which pairs of manipulations are similar enough to be of the same type (§2.6.2, §2.7).

    Parameters
    ----------
    table : (n, n) pandas.DataFrame or array_like of float
        Similarities in percent, see :func:`~sec_lab.similarity.similarity_table`.
    threshold_percent : float
        Least similarity of type-similar manipulations, 0 to 100.

    Returns
    -------
    (n, n) bool

    Raises
    ------
    ValueError
        If the table is not square, empty or not finite, or names its rows other than its columns; or if the threshold
        is not a number from 0 to 100.

    Examples
    --------
    >>> type_similar([[100, 64, 20], [64, 100, 30], [20, 30, 100]], threshold_percent=64)
    array([[ True,  True, False],
           [ True,  True, False],
           [False, False,  True]])
    """
    values = _as_table(table, at_least=1)
    (threshold,) = _as_thresholds([threshold_percent])
    return np.asarray(values >= threshold - _ROUNDING_PERCENT)


def threshold_errors(
    table: Table, classes: Classes, *, thresholds_percent: ArrayLike, directed: bool = False
) -> "pd.DataFrame":
    """Count the wrong decisions at one or more thresholds (§2.7: none and one at 64 %).

    Parameters
    ----------
    table : (n, n) pandas.DataFrame or array_like of float
        Similarities in percent.
    classes : (n,) array_like
        Known type of each manipulation.
    thresholds_percent : float or (k,) array_like of float
        Least similarities of type-similar manipulations, 0 to 100.
    directed : bool, optional
        False: each unordered pair counts once, and the table has to be symmetric. True: each ordered pair counts.
        A manipulation is never compared with itself.

    Returns
    -------
    pandas.DataFrame
        One row a threshold: ``false_negatives`` are pairs of one type below it, ``false_positives`` pairs of two types
        at or above it. ``attrs`` has the numbers of pairs of either kind, ``same_type`` and ``different_types``.

    Raises
    ------
    ValueError
        If the table is not square, not finite, has fewer than two rows, names its rows other than its columns, or is
        not symmetric although ``directed`` is False; if a class is missing or their number is another; or if a
        threshold is not a number from 0 to 100.

    Examples
    --------
    >>> table = [[100, 64, 20], [64, 100, 70], [20, 70, 100]]
    >>> threshold_errors(table, ["push", "push", "pour"], thresholds_percent=[64, 71])
                       false_negatives  false_positives
    threshold_percent
    64.0                             0                1
    71.0                             1                0
    """
    import pandas as pd

    values = _as_table(table, at_least=2)
    types = _as_classes(classes, what="classes", n=len(values))
    thresholds = _as_thresholds(thresholds_percent)
    pairs = ~np.eye(len(values), dtype=bool)
    if not directed:
        _check_symmetric(values)
        pairs = np.triu(pairs)
    equal = types[:, np.newaxis] == types
    same, different = np.sort(values[pairs & equal]), np.sort(values[pairs & ~equal])
    least = thresholds - _ROUNDING_PERCENT
    frame = pd.DataFrame(
        {
            "false_negatives": np.searchsorted(same, least),
            "false_positives": len(different) - np.searchsorted(different, least),
        },
        index=pd.Index(thresholds, name="threshold_percent"),
    )
    frame.attrs = {"same_type": len(same), "different_types": len(different)}
    return frame


def correlation_features(table: Table) -> NDArray[np.float64]:
    """Pearson correlations between the columns of a table of similarities, the features of §2.7.

    Parameters
    ----------
    table : (n, n) pandas.DataFrame or array_like of float
        Similarities in percent; at least three rows. In a directed table a column is what a manipulation is like as ξ².

    Returns
    -------
    (n, n) float64
        Row i has the features of manipulation i, −1 to 1; exactly symmetric, with ones on the diagonal.

    Raises
    ------
    ValueError
        If the table is not square, not finite, has fewer than three rows or names its rows other than its columns; or
        if all values of a column are equal, so that it correlates with nothing.

    Examples
    --------
    >>> correlation_features([[100, 80, 10], [80, 100, 20], [10, 20, 100]]).round(2)
    array([[ 1.  ,  0.9 , -0.99],
           [ 0.9 ,  1.  , -0.94],
           [-0.99, -0.94,  1.  ]])
    """
    values = _as_table(table, at_least=3)
    low, high = values.min(axis=0), values.max(axis=0)
    constant = np.flatnonzero(high - low <= 1e-12 * np.maximum(np.abs(low), np.abs(high)))
    if constant.size:
        at = int(constant[0])
        name = getattr(table, "columns", range(len(values)))[at]
        raise ValueError(
            f"table: expected different values in every column, got {values[0, at]:g} everywhere in column {name!r}"
        )
    with _one_thread():
        deviations = (values - low) / (high - low)
        deviations -= deviations.mean(axis=0)
        deviations /= np.sqrt(np.square(deviations).sum(axis=0))
        correlations = deviations.T @ deviations
    symmetric: NDArray[np.float64] = np.clip((correlations + correlations.T) / 2, -1.0, 1.0)
    np.fill_diagonal(symmetric, 1.0)
    return symmetric


def unsupervised_classes(
    table: Table, *, rng: np.random.Generator | None = None, k_max: int | None = None
) -> NDArray[np.int64]:
    """Find classes of manipulations without knowing any: X-means on correlation features (§2.7, §2.9).

    Parameters
    ----------
    table : (n, n) pandas.DataFrame or array_like of float
        Similarities in percent; at least three rows.
    rng : numpy.random.Generator, optional
        Where k-means gets its random starts; ``numpy.random.default_rng(0)`` if left out, so the same table always has
        the same classes.
    k_max : int, optional
        Greatest number of classes; n / 2, but no more than :func:`most_classes`, if left out.

    Returns
    -------
    (n,) int64
        Class of each manipulation, 0, 1, … in the order in which the classes first appear. Where all similarities are
        equal, nothing tells the manipulations apart: one class.

    Raises
    ------
    ValueError
        As in :func:`correlation_features`; if ``rng`` is no Generator, or ``k_max`` is less than 1.

    Notes
    -----
    The n features are not independent of each other: with four classes they hardly leave a space of three dimensions.
    The criterion of X-means takes every feature for evidence of its own and would find more than twice as many classes.
    Versions of a type that are nearly the same leave no spread either, and are parted by whatever little differs, such
    as a thing that stands aside in some of them: so the number of classes is limited by what the correlations span.
    Classes are told apart by contrast: a table of a single type has none, and its noise is not always left whole.

    Examples
    --------
    >>> table = np.full((9, 9), 30.0)
    >>> table[:3, :3] = table[3:6, 3:6] = table[6:, 6:] = 80.0
    >>> np.fill_diagonal(table, 100.0)
    >>> unsupervised_classes(table)
    array([0, 0, 0, 1, 1, 1, 2, 2, 2])
    """
    from sec_lab.xmeans import x_means

    values = _as_table(table, at_least=3)
    if np.ptp(values) == 0:
        return np.zeros(len(values), np.int64)
    features = correlation_features(table)
    # Departure: the number of classes is chosen with the dimensions that the features fill, not with their number n;
    # and it is limited by what the correlations span.
    found = x_means(
        features,
        rng=np.random.default_rng(0) if rng is None else rng,
        k_max=min(max(1, len(values) // 2), most_classes(table)) if k_max is None else k_max,
        n_dimensions=principal_dimensions(features),
    )
    return found.labels.copy()


def most_classes(table: Table) -> int:
    """Greatest number of classes that the correlations between the columns of a table tell apart.

    The columns of k classes that differ from each other span k − 1 dimensions; what is left is spread within classes.
    How many principal components of a correlation matrix are to be kept is an old question, and the usual answer is a
    least eigenvalue: 1 is the share of a single variable (Kaiser, 1960), 0.7 allows for chance (Jolliffe, 1972).

    Parameters
    ----------
    table : (n, n) pandas.DataFrame or array_like of float
        Similarities in percent; at least three rows.

    Returns
    -------
    int
        1 more than :func:`correlation_features` has eigenvalues of at least 0.7.

    Raises
    ------
    ValueError
        As in :func:`correlation_features`.

    Examples
    --------
    >>> most_classes([[100, 90, 30, 35], [90, 100, 40, 30], [30, 40, 100, 80], [35, 30, 80, 100]])
    2
    """
    features = correlation_features(table)
    with _one_thread():
        eigenvalues = np.linalg.eigvalsh(features)
    return int(np.count_nonzero(eigenvalues >= _LEAST_EIGENVALUE)) + 1


def principal_dimensions(features: ArrayLike, *, share_percent: float = 95.0) -> int:
    """Number of principal axes that carry a share of the variance of features.

    Parameters
    ----------
    features : (n, m) array_like of float
        One point a row.
    share_percent : float, optional
        Share of the variance, above 0 and at most 100.

    Returns
    -------
    int
        1 to m; 1 if all points are equal.

    Raises
    ------
    ValueError
        If there is no point or no feature, a value is not finite, or the share is out of range.

    Examples
    --------
    >>> principal_dimensions([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [2.0, 4.0, 0.1]])
    1
    """
    points = as_array(features, what="features", ndim=2).astype(np.float64)
    if not points.size or not np.isfinite(points).all():
        raise ValueError(f"features: expected finite numbers, at least one, got {_first_wrong(points)}")
    if not 0 < share_percent <= 100:
        raise ValueError(f"share_percent: expected more than 0, at most 100, got {share_percent}")
    with _one_thread():
        variances = np.square(np.linalg.svd(points - points.mean(axis=0), compute_uv=False))
    carried = np.cumsum(variances)
    if not carried[-1]:
        return 1
    return int(np.argmax(carried >= (share_percent / 100 - 1e-12) * carried[-1])) + 1


def leave_one_out(table: Table, classes: Classes) -> NDArray[Any]:
    """Recognise each manipulation by its nearest neighbour among all others.

    Parameters
    ----------
    table : (n, n) pandas.DataFrame or array_like of float
        Similarities in percent. In a directed table, column j is the manipulation that is recognised and the rows are
        what it is held against.
    classes : (n,) array_like
        Known type of each manipulation.

    Returns
    -------
    (n,) array of the type of ``classes``
        Type of the most similar other manipulation. If several are equally similar, the type that most of them have; if
        that is a tie too, the one of them that comes first in the table: :func:`undecided` says where.

    Raises
    ------
    ValueError
        If the table is not square, not finite, has fewer than two rows or names its rows other than its columns; or if
        a class is missing or their number is another.

    Examples
    --------
    >>> table = [[100, 64, 20], [64, 100, 70], [20, 70, 100]]
    >>> leave_one_out(table, ["push", "push", "pour"]).tolist()
    ['push', 'pour', 'push']
    """
    types = _as_classes(classes, what="classes", n=len(_as_table(table, at_least=2)))
    return types[[at[0] for at in _most_frequent_nearest(table, types)]]


def undecided(table: Table, classes: Classes) -> NDArray[np.bool_]:
    """Which answers of :func:`leave_one_out` hang on the order of the table alone.

    Parameters
    ----------
    table, classes
        As in :func:`leave_one_out`.

    Returns
    -------
    (n,) bool
        True where the nearest neighbours, all equally similar, have several types equally often.

    Raises
    ------
    ValueError
        As in :func:`leave_one_out`.

    Examples
    --------
    >>> undecided([[100, 50, 50], [50, 100, 20], [50, 20, 100]], ["push", "push", "pour"]).tolist()
    [True, False, False]
    """
    types = _as_classes(classes, what="classes", n=len(_as_table(table, at_least=2)))
    return np.array([len(at) > 1 for at in _most_frequent_nearest(table, types)])


def confusion(classes: Classes, predicted: Classes) -> "pd.DataFrame":
    """Confusion matrix: how often manipulations of each type are recognised as each type.

    Parameters
    ----------
    classes, predicted : (n,) array_like
        Known type of each manipulation, and what it was recognised as.

    Returns
    -------
    pandas.DataFrame
        Row = known type, column = recognised type, both in the order of first appearance in ``classes``, then in
        ``predicted``; counts.

    Raises
    ------
    ValueError
        If there is none, one is missing, or the numbers are not the same.

    Examples
    --------
    >>> confusion(["push", "push", "pour"], ["push", "pour", "pour"])
    recognised  push  pour
    class
    push           1     1
    pour           0     1
    """
    import pandas as pd
    from sklearn.metrics import confusion_matrix

    known = _as_classes(classes, what="classes")
    found = _as_classes(predicted, what="predicted", n=len(known))
    names = list(dict.fromkeys([*known.tolist(), *found.tolist()]))
    numbers = {name: number for number, name in enumerate(names)}
    counts = confusion_matrix([numbers[c] for c in known.tolist()], [numbers[c] for c in found.tolist()])
    return pd.DataFrame(counts, index=pd.Index(names, name="class"), columns=pd.Index(names, name="recognised"))


def _most_frequent_nearest(table: Table, types: NDArray[Any]) -> Iterator[list[int]]:
    """For each column the most similar rows, reduced to the first of each type that is the most frequent among them."""
    values = _as_table(table, at_least=2).copy()
    np.fill_diagonal(values, -np.inf)
    for column in values.T:
        nearest = np.flatnonzero(column >= column.max() - _ROUNDING_PERCENT)
        _, first, counts = np.unique(types[nearest], return_index=True, return_counts=True)
        yield sorted(nearest[first[counts == counts.max()]].tolist())


@contextmanager
def _one_thread() -> Iterator[None]:
    """Sums that are spread over several threads depend on their number in the last digits."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield


def _as_table(table: Table, *, at_least: int) -> NDArray[np.float64]:
    frame: Any = table
    is_frame = hasattr(frame, "columns")
    if is_frame and not frame.columns.equals(frame.index):
        raise ValueError("table: expected rows and columns of the same names in the same order, got different ones")
    values = as_array(frame.to_numpy() if is_frame else table, what="table", ndim=2).astype(np.float64)
    n = len(values)
    if values.shape != (n, n) or n < at_least:
        raise ValueError(f"table: expected a square with at least {at_least} rows, got shape {values.shape}")
    if not np.isfinite(values).all():
        raise ValueError(f"table: expected finite numbers, got {_first_wrong(values)}")
    return values


def _first_wrong(values: NDArray[np.float64]) -> str:
    return str(values[~np.isfinite(values)][0]) if values.size else f"shape {values.shape}"


def _check_symmetric(values: NDArray[np.float64]) -> None:
    wrong = np.argwhere(np.abs(values - values.T) > _ROUNDING_PERCENT)
    if len(wrong):
        i, j = wrong[0].tolist()
        raise ValueError(
            f"table: expected a symmetric one (or directed=True), got {values[i, j]:g} in row {i}, column {j} and "
            f"{values[j, i]:g} in row {j}, column {i}"
        )


def _as_thresholds(thresholds: ArrayLike) -> NDArray[np.float64]:
    values = np.atleast_1d(as_array(thresholds, what="threshold").astype(np.float64))
    if values.ndim != 1 or not values.size:
        raise ValueError(f"threshold: expected one number or a list of them, got shape {values.shape}")
    wrong = ~((values >= 0) & (values <= 100))
    if wrong.any():
        raise ValueError(f"threshold: expected 0 to 100 percent, got {values[wrong][0]}")
    return values


def _as_classes(classes: Classes, *, what: str, n: int | None = None) -> NDArray[Any]:
    values = np.asarray(classes)
    if values.ndim != 1 or (not values.size if n is None else len(values) != n):
        expected = "one for each" if n is None else f"one for each of {n} manipulations"
        raise ValueError(f"{what}: expected {expected}, got shape {values.shape}")
    missing = [at for at, value in enumerate(values.tolist()) if value is None or value != value]
    if missing:
        raise ValueError(f"{what}: expected a type for each manipulation, got {values[missing[0]]} at {missing[0]}")
    return values
