"""X-means (Pelleg and Moore, 2000): k-means that finds the number of clusters itself; used in step 6A (§2.7).

Starting from few clusters, every cluster is tried out as two; if the Bayesian information criterion of its own points
prefers the two, it wants to be split (Improve-Structure). Then k-means runs on all points with all centres
(Improve-Params), and so on. Of all divisions on this way, the one with the largest criterion on all points is taken.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.cluster.vq import kmeans2, vq
from threadpoolctl import threadpool_limits

from sec_lab.codes import as_array, as_integers

_STARTS = 10  # of every k-means whose centres are not given; the best one counts
_MAX_STEPS = 1000  # of every k-means; it stops earlier, as soon as no point changes its cluster
_LARGEST = 1e150  # so that squares stay finite
_GROWTH = 8  # one in so many clusters, and at least one, is split at a time
_BEYOND = 8  # the search goes on to twice as many clusters as the best division has, and so many more


@dataclass(frozen=True, eq=False)
class Clustering:
    """Points divided into clusters.

    Attributes
    ----------
    labels : (n,) int64
        Cluster of each point, 0, 1, … in the order in which the clusters first appear.
    centers : (k, m) float64
        Mean of the points of each cluster.
    bic : float
        Bayesian information criterion of this division, see :func:`bic`.
    """

    labels: NDArray[np.int64]
    centers: NDArray[np.float64]
    bic: float

    def __post_init__(self) -> None:
        labels = as_integers(self.labels, what="labels", ndim=1)
        centers = np.array(as_array(self.centers, what="centers", ndim=2), np.float64)
        if not np.array_equal(np.unique(labels), np.arange(len(centers))):
            raise ValueError(
                f"labels: expected each of 0 to {len(centers) - 1} for {len(centers)} centers, "
                f"got {np.unique(labels).tolist()}"
            )
        for name, array in (("labels", labels), ("centers", centers)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "bic", float(self.bic))


def bic(features: ArrayLike, labels: ArrayLike, *, n_dimensions: int | None = None) -> float:
    """Bayesian information criterion of points divided into clusters; larger is better.

    The model is a mixture of K spherical Gaussians with one variance σ² for all of them, each point belonging to one::

        σ²  = SSE / (M (R − K))
        l   = Σ R_n ln R_n − R ln R − (R M / 2) ln(2πσ²) − M (R − K) / 2
        BIC = l − (p / 2) ln R,   p = (K − 1) + M K + 1

    with R points of M features, R_n of them in cluster n, and SSE the summed squared distances to the cluster means.

    Parameters
    ----------
    features : (R, M) array_like of float
    labels : (R,) array_like of int
        Cluster of each point.
    n_dimensions : int, optional
        M, if fewer directions than features are independent of each other; otherwise the number of features.

    Returns
    -------
    float
        −∞ if R ≤ K, where no variance can be estimated; +∞ if every point lies on the mean of its cluster (σ² = 0).

    Raises
    ------
    ValueError
        If there is no point or no feature, a value is not finite, the number of labels is another, or not
        1 ≤ n_dimensions ≤ number of features.

    Notes
    -----
    Pelleg and Moore (2000) print a variance without M, which does not fit the rest. Here all terms follow from one
    likelihood, so the criteria of different K can be compared.

    Examples
    --------
    >>> points = [[0.0], [2.0], [10.0], [12.0]]
    >>> round(bic(points, [0, 0, 0, 0]), 3), round(bic(points, [0, 0, 1, 1]), 3)
    (-13.654, -11.607)
    """
    points = _as_features(features)
    numbers = as_integers(labels, what="labels", ndim=1)
    if len(numbers) != len(points):
        raise ValueError(f"labels: expected one for each of {len(points)} points, got {len(numbers)}")
    m = _check_dimensions(n_dimensions, points)
    return _bic(points, _numbered(numbers), m=m, resolution=_resolution(points))


def x_means(
    features: ArrayLike,
    *,
    rng: np.random.Generator,
    k_min: int = 1,
    k_max: int | None = None,
    n_dimensions: int | None = None,
) -> Clustering:
    """Divide points into as many clusters as the Bayesian information criterion asks for (§2.7).

    Parameters
    ----------
    features : (n, m) array_like of float
        One point a row.
    rng : numpy.random.Generator
        Where the k-means runs get their random starts. The result depends on nothing else: neither on the number of
        threads nor on earlier calls.
    k_min, k_max : int, optional
        Least and greatest number of clusters; ``k_max=None`` allows n / 2, two points a cluster.
    n_dimensions : int, optional
        M of the criterion that chooses among the divisions, see :func:`bic`. Whether a cluster wants to be split is
        always judged with the number of features.

    Returns
    -------
    Clustering

    Raises
    ------
    ValueError
        If there is no point or no feature, a value is not finite, ``rng`` is no Generator, not 1 ≤ k_min ≤ k_max with
        k_min different points, or not 1 ≤ n_dimensions ≤ number of features.

    Notes
    -----
    A cluster of two points is never split, as nothing is left to estimate a variance from; a cluster of identical
    points neither, as there is nothing to gain. If both halves of a cluster consist of identical points, it is better
    as two however close they are (σ² = 0, see :func:`bic`). Among very few points (less than about twenty) chance
    arranges what looks like clusters to the criterion.

    Examples
    --------
    >>> points = [[0.0], [0.2], [0.1], [5.0], [5.1], [5.2], [9.0], [9.1], [9.2]]
    >>> x_means(points, rng=np.random.default_rng(0)).labels
    array([0, 0, 0, 1, 1, 1, 2, 2, 2])
    """
    points = _as_features(features)
    if not isinstance(rng, np.random.Generator):
        raise ValueError(f"rng: expected a numpy.random.Generator, got {type(rng).__name__}")
    limit = _check_limits(k_min, k_max, points)
    m = _check_dimensions(n_dimensions, points)
    resolution = _resolution(points)
    # Differences to a point are exact for points that are equal, which differences to a mean are not.
    shifted = points - points[0]
    # Sums that are spread over several threads depend on their number in the last digits.
    with threadpool_limits(limits=1):
        labels = np.zeros(len(points), np.int64) if k_min == 1 else _k_means(shifted, k_min, rng)
        best, best_bic = labels, _bic(shifted, labels, m=m, resolution=resolution)
        best_k, tried = k_min, dict[bytes, _Split]()
        while (k := int(labels.max()) + 1) < min(limit, 2 * best_k + _BEYOND):
            tried = _improve_structure(shifted, labels, rng, tried, resolution=resolution)
            splits = sorted(
                (split for split in tried.values() if len(split.second_half)), key=lambda split: -split.gain
            )
            if not splits:
                break
            # Departure: Pelleg and Moore split all clusters at once that want it, which steps over the right number,
            # and end where none does; but five clusters in a row gain nothing by the first split. So here a few are
            # split at a time, at least the best one, and the criterion of all points decides in the end.
            wanted = sum(split.gain > 0 for split in splits)
            chosen = splits[: max(1, min(wanted, k // _GROWTH, limit - k))]
            labels = labels.copy()
            for new, split in enumerate(chosen, start=k):
                labels[split.second_half] = new
            labels = _k_means(shifted, _means(shifted, labels), rng)
            if labels.max() < k:  # what is left to split is as close together as k-means can see
                break
            score = _bic(shifted, labels, m=m, resolution=resolution)
            if score > best_bic:
                best, best_bic, best_k = labels, score, int(labels.max()) + 1
    return Clustering(best, _means(shifted, best) + points[0], best_bic)


class _Split(NamedTuple):
    """What the criterion gains by splitting a cluster, and which points leave it."""

    gain: float
    second_half: NDArray[np.intp]


def _improve_structure(
    points: NDArray[np.float64],
    labels: NDArray[np.int64],
    rng: np.random.Generator,
    tried: Mapping[bytes, _Split],
    *,
    resolution: float,
) -> dict[bytes, _Split]:
    """Try out every cluster as two, unless the same points were tried before; the keys are the clusters' members."""
    splits = {}
    for cluster in range(labels.max() + 1):
        members = np.flatnonzero(labels == cluster)
        key = members.tobytes()
        splits[key] = tried[key] if key in tried else _split(points, members, rng, resolution=resolution)
    return splits


def _split(
    points: NDArray[np.float64], members: NDArray[np.intp], rng: np.random.Generator, *, resolution: float
) -> _Split:
    own, m = points[members], points.shape[1]
    parent = _bic(own, np.zeros(len(own), np.int64), m=m, resolution=resolution)
    if len(own) <= 2 or parent == np.inf:
        return _Split(-np.inf, members[:0])
    # Departure: the two centres start by k-means++, several times, instead of once on a random line through the centre:
    # with many features a random line misses the direction in which the cluster is long.
    halves = _k_means(own, 2, rng)
    return _Split(_bic(own, halves, m=m, resolution=resolution) - parent, members[halves == 1])


def _k_means(
    points: NDArray[np.float64], start: int | NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.int64]:
    """Clusters of points by k-means from given centres, or the best of several k-means++ starts with so many.

    Centres that lose all their points are dropped.
    """
    if not isinstance(start, int):
        return _settle(points, start)
    starts = (kmeans2(points, start, iter=1, minit="++", missing="raise", rng=rng)[0] for _ in range(_STARTS))
    found = [_settle(points, centers) for centers in starts]
    return min(found, key=lambda labels: float(np.square(points - _means(points, labels)[labels]).sum()))


def _settle(points: NDArray[np.float64], centers: NDArray[np.float64]) -> NDArray[np.int64]:
    """Points go to the nearest centre, centres to the mean of their points, until nothing changes."""
    labels = _numbered(vq(points, centers)[0].astype(np.int64))
    for _ in range(_MAX_STEPS):
        before = labels
        labels = _numbered(vq(points, _means(points, labels))[0].astype(np.int64))
        if np.array_equal(labels, before):
            break
    return labels


def _bic(points: NDArray[np.float64], labels: NDArray[np.int64], *, m: int, resolution: float) -> float:
    sizes = np.bincount(labels)
    r, k = len(points), len(sizes)
    if r <= k:
        return -np.inf
    deviations = points - _means(points, labels)[labels]
    variance = float(np.square(deviations).sum()) / (m * (r - k))
    if variance <= resolution**2:
        return np.inf
    log_likelihood = float(np.sum(sizes * np.log(sizes))) - r * np.log(r)
    log_likelihood -= r * m / 2 * np.log(2 * np.pi * variance) + m * (r - k) / 2
    return float(log_likelihood - ((k - 1) + m * k + 1) / 2 * np.log(r))


def _means(points: NDArray[np.float64], labels: NDArray[np.int64]) -> NDArray[np.float64]:
    return np.array([points[labels == cluster].mean(axis=0) for cluster in range(labels.max() + 1)])


def _resolution(points: NDArray[np.float64]) -> float:
    """Distance below which k-means cannot tell points apart: it forms x² − 2xy + y², with the error eps · x²."""
    return float(np.sqrt(np.finfo(np.float64).eps) * np.abs(points - points[0]).max())


def _numbered(labels: NDArray[np.integer[Any]]) -> NDArray[np.int64]:
    """Give labels new numbers 0, 1, … in the order of first appearance."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse].astype(np.int64)


def _as_features(features: ArrayLike) -> NDArray[np.float64]:
    points = as_array(features, what="features", ndim=2).astype(np.float64)
    if not points.size:
        raise ValueError(f"features: expected at least one point with one feature, got shape {points.shape}")
    usable = np.abs(points) <= _LARGEST
    if not usable.all():
        raise ValueError(f"features: expected finite numbers up to {_LARGEST:g}, got {points[~usable][0]}")
    return points


def _check_limits(k_min: int, k_max: int | None, points: NDArray[np.float64]) -> int:
    if k_min < 1:
        raise ValueError(f"k_min: expected at least 1, got {k_min}")
    if k_min > 1:
        cell = 4 * _resolution(points) or 1.0
        different = len(np.unique(np.round((points - points[0]) / cell), axis=0))
        if k_min > different:
            raise ValueError(f"k_min: expected at most {different}, the number of different points, got {k_min}")
    if k_max is not None and k_max < k_min:
        raise ValueError(f"k_max: expected at least k_min = {k_min}, got {k_max}")
    return max(k_min, len(points) // 2) if k_max is None else min(k_max, len(points))


def _check_dimensions(n_dimensions: int | None, points: NDArray[np.float64]) -> int:
    n_features = points.shape[1]
    if n_dimensions is None:
        return n_features
    if not 1 <= n_dimensions <= n_features:
        raise ValueError(f"n_dimensions: expected 1 to {n_features}, the number of features, got {n_dimensions}")
    return n_dimensions
