import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy import stats
from sklearn.base import BaseEstimator, clone
from sklearn.utils.estimator_checks import parametrize_with_checks
from threadpoolctl import threadpool_limits

from sec_lab.estimators import XMeans
from sec_lab.xmeans import Clustering, bic, x_means

Floats = NDArray[np.float64]


def blobs(centers: list[list[float]], *, size: int, seed: int) -> tuple[Floats, NDArray[np.int64]]:
    """Gaussian blobs with deviation 1, one after the other."""
    labels = np.repeat(np.arange(len(centers)), size)
    return np.array(centers)[labels] + np.random.default_rng(seed).normal(size=(len(labels), len(centers[0]))), labels


def divided_points() -> st.SearchStrategy[tuple[Floats, NDArray[np.int64]]]:
    """Points on a grid, so that they are equal or clearly different, and some division of them."""
    shapes = st.tuples(st.integers(1, 9), st.integers(1, 3))
    grid = st.integers(-20, 20).map(float)
    return shapes.flatmap(
        lambda shape: st.tuples(
            hnp.arrays(np.float64, shape, elements=grid), hnp.arrays(np.int64, shape[0], elements=st.integers(0, 3))
        )
    )


def bic_of_the_mixture(points: Floats, labels: NDArray[np.int64]) -> float:
    """Schwarz's criterion from the densities: each point is drawn from its own cluster's Gaussian."""
    (r, m), clusters = points.shape, np.unique(labels)
    k = len(clusters)
    own = {c: points[labels == c] for c in clusters}
    squares = sum(float(((group - group.mean(axis=0)) ** 2).sum()) for group in own.values())
    variance = squares / (m * (r - k))
    log_likelihood = sum(
        math.log(len(own[c]) / r) + float(stats.multivariate_normal(own[c].mean(axis=0), variance).logpdf(point))
        for point, c in zip(points, labels, strict=True)
    )
    return log_likelihood - ((k - 1) + m * k + 1) / 2 * math.log(r)


def test_bic_by_hand() -> None:
    points = [[0.0], [2.0], [10.0], [12.0]]
    # One cluster: mean 6, SSE = 36 + 16 + 16 + 36 = 104, variance 104 / 3, two parameters.
    one = -4 / 2 * math.log(2 * math.pi * 104 / 3) - 3 / 2 - 2 / 2 * math.log(4)
    assert bic(points, [0, 0, 0, 0]) == pytest.approx(one)
    # Two: means 1 and 11, SSE = 4, variance 4 / 2, four parameters; ln R_n / R = -ln 2 for each of the four points.
    two = -4 * math.log(2) - 4 / 2 * math.log(2 * math.pi * 2) - 2 / 2 - 4 / 2 * math.log(4)
    assert bic(points, [0, 0, 1, 1]) == pytest.approx(two)
    # Two features: SSE = 2 + 2 = 4 for (0, 0), (2, 0) and one more at (9, 9); variance 2 / (2 * 1); p = 1 + 4 + 1.
    three = 2 * math.log(2) - 3 * math.log(3) - 3 * math.log(2 * math.pi * 1) - 2 / 2 - 6 / 2 * math.log(3)
    assert bic([[0.0, 0.0], [2.0, 0.0], [9.0, 9.0]], [0, 0, 1]) == pytest.approx(three)


@given(divided_points())
def test_bic_is_that_of_the_mixture(example: tuple[Floats, NDArray[np.int64]]) -> None:
    points, labels = example
    groups = [points[labels == c] for c in np.unique(labels)]
    if len(points) <= len(groups):
        assert bic(points, labels) == -np.inf
    elif all((group == group[0]).all() for group in groups):
        assert bic(points, labels) == np.inf
    else:
        assert bic(points, labels) == pytest.approx(bic_of_the_mixture(points, labels), rel=1e-9)
        renamed, moved = 7 - 2 * labels, points + np.arange(1.0, points.shape[1] + 1)
        assert bic(moved, renamed) == pytest.approx(bic(points, labels), rel=1e-9)


def test_bic_counts_as_many_dimensions_as_it_is_told() -> None:
    points, labels = blobs([[0.0, 0.0], [5.0, 0.0]], size=6, seed=1)
    idle = np.hstack([points, np.full((12, 3), 4.0)])
    assert bic(idle, labels, n_dimensions=2) == pytest.approx(bic(points, labels))
    assert bic(idle, labels) != pytest.approx(bic(points, labels))


ROW = [[9.0 * i] for i in range(5)]
PLANE = [[0.0, 0.0], [12.0, 3.0], [-4.0, 11.0], [9.0, -10.0], [-11.0, -8.0]]
CORNERS = np.eye(5) * 12


@pytest.mark.parametrize("size", [20, 60])
@pytest.mark.parametrize("k", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("centers", [ROW, PLANE, CORNERS.tolist()], ids=["row", "plane", "corners"])
def test_planted_blobs_are_found(centers: list[list[float]], k: int, size: int) -> None:
    points, labels = blobs(centers[:k], size=size, seed=3)
    found = x_means(points, rng=np.random.default_rng(0))
    assert found.labels.tolist() == labels.tolist()
    np.testing.assert_allclose(
        found.centers, [points[labels == c].mean(axis=0) for c in range(k)], rtol=1e-12, atol=1e-12
    )
    assert found.bic == pytest.approx(bic_of_the_mixture(points, labels))


def test_classes_are_numbered_by_first_appearance() -> None:
    points, labels = blobs(PLANE, size=10, seed=4)
    order = np.random.default_rng(5).permutation(len(points))
    found = x_means(points[order], rng=np.random.default_rng(0)).labels.tolist()
    seen = list(dict.fromkeys(labels[order].tolist()))
    assert found == [seen.index(label) for label in labels[order].tolist()]


def test_search_goes_on_where_the_first_split_gains_nothing() -> None:
    points, labels = blobs(ROW, size=30, seed=3)
    # Wherever the row is cut, its own criterion prefers one cluster to two.
    assert all(bic(points, labels >= cut) < bic(points, np.zeros(len(points), int)) for cut in range(1, 5))
    assert x_means(points, rng=np.random.default_rng(0)).labels.max() == 4


@given(divided_points(), st.integers(0, 3))
def test_no_division_that_is_at_hand_is_better(example: tuple[Floats, NDArray[np.int64]], seed: int) -> None:
    points, _ = example
    found = x_means(points, rng=np.random.default_rng(seed))
    one = bic(points, np.zeros(len(points), int))
    assert found.bic >= one or found.bic == pytest.approx(one)
    assert found.bic == pytest.approx(bic(points, found.labels), rel=1e-9)
    assert list(dict.fromkeys(found.labels.tolist())) == list(range(len(found.centers)))
    for c, center in enumerate(found.centers):
        np.testing.assert_allclose(center, points[found.labels == c].mean(axis=0), atol=1e-9)
    # Points that are equal are never in different clusters.
    for i, j in itertools.combinations(range(len(points)), 2):
        assert found.labels[i] == found.labels[j] or (points[i] != points[j]).any()


@pytest.mark.parametrize("n", [1, 2, 3, 40])
def test_identical_points_are_one_cluster(n: int) -> None:
    # 0.1 has no exact binary form, so means of it are rounded.
    found = x_means(np.full((n, 2), 0.1), rng=np.random.default_rng(0))
    assert found.labels.tolist() == [0] * n
    assert found.centers.tolist() == [[0.1, 0.1]]
    assert found.bic == (-np.inf if n == 1 else np.inf)


def test_two_points_are_never_split() -> None:
    assert x_means([[0.0], [1e9]], rng=np.random.default_rng(0)).labels.tolist() == [0, 0]


def test_positions_of_identical_points_are_told_apart() -> None:
    points = np.repeat([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [5.0, 5.0]], 4, axis=0)
    found = x_means(points, rng=np.random.default_rng(0))
    assert found.labels.tolist() == np.repeat(range(4), 4).tolist()
    assert found.bic == np.inf


def test_rounding_errors_are_no_clusters() -> None:
    points, labels = np.repeat([[0.3, 0.9], [0.7, -0.2]], 5, axis=0), [0] * 5 + [1] * 5
    points += np.random.default_rng(0).choice([0.0, 1e-16, 2e-16], points.shape)
    assert len(np.unique(points, axis=0)) > 2
    assert x_means(points, rng=np.random.default_rng(0)).labels.tolist() == labels


def test_number_of_clusters_stays_within_its_limits() -> None:
    points, _ = blobs(PLANE, size=20, seed=3)
    for k in range(1, 6):
        assert len(x_means(points, rng=np.random.default_rng(0), k_max=k).centers) <= k
        assert len(x_means(points, rng=np.random.default_rng(0), k_min=k, k_max=k).centers) == k
    one, _ = blobs(PLANE[:1], size=20, seed=3)
    assert len(x_means(one, rng=np.random.default_rng(0), k_min=3).centers) >= 3
    # Two points a cluster, unless more clusters are asked for.
    far = np.repeat([[4.0**i] for i in range(6)], 2, axis=0)[1:]
    assert len(x_means(far, rng=np.random.default_rng(0)).centers) == 5
    assert len(x_means(far, rng=np.random.default_rng(0), k_max=6).centers) == 6


def test_fewer_dimensions_ask_for_more_evidence() -> None:
    # Ten features that are all the same one count as tenfold evidence for a gap that is none.
    points = np.sort(np.random.default_rng(2).normal(size=12))
    copied = np.repeat(points[:, np.newaxis], 10, axis=1)
    assert len(x_means(copied, rng=np.random.default_rng(0)).centers) > 1
    assert len(x_means(copied, rng=np.random.default_rng(0), n_dimensions=1).centers) == 1


def test_result_depends_on_the_generator_alone() -> None:
    points = np.random.default_rng(6).uniform(size=(40, 2))
    results = [x_means(points, rng=np.random.default_rng(s), k_min=7, k_max=7) for s in (0, 0, 1, 2, 3)]
    assert results[0].labels.tolist() == results[1].labels.tolist()
    assert results[0].centers.tobytes() == results[1].centers.tobytes()
    assert len({tuple(result.labels.tolist()) for result in results}) > 1


def test_result_does_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    # A square is halved equally well in several ways, so the last digit decides; with many points, sums are spread.
    points = 0.1 * np.stack(np.meshgrid(np.arange(47), np.arange(47)), axis=-1).reshape(-1, 2)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")  # else not more threads than cores
    results = []
    for n_threads in (1, 2, 3, 4):
        with threadpool_limits(limits=n_threads):
            results += [XMeans(k_min=2, k_max=2, random_state=seed).fit(points) for seed in range(3)]
    for seed in range(3):
        assert len({result.labels_.tobytes() for result in results[seed::3]}) == 1
        assert len({result.cluster_centers_.tobytes() for result in results[seed::3]}) == 1


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (
            lambda rng: x_means(np.empty((0, 2)), rng=rng),
            r"features: expected at least one point .* got shape \(0, 2\)",
        ),
        (
            lambda rng: x_means(np.empty((2, 0)), rng=rng),
            r"features: expected at least one point .* got shape \(2, 0\)",
        ),
        (lambda rng: x_means([1.0, 2.0], rng=rng), r"features: expected 2 dimensions, got shape \(2,\)"),
        (lambda rng: x_means([[1.0], [np.nan]], rng=rng), "features: expected finite numbers up to .*, got nan"),
        (lambda rng: x_means([[1.0], [1e200]], rng=rng), "features: expected finite numbers up to .*, got 1e"),
        (lambda rng: x_means([["a"]], rng=rng), "features: expected numbers"),
        (lambda _: x_means([[1.0]], rng=0), "rng: expected a numpy.random.Generator, got int"),
        (lambda rng: x_means([[1.0]], rng=rng, k_min=0), "k_min: expected at least 1, got 0"),
        (lambda rng: x_means([[1.0], [1.0]], rng=rng, k_min=2), "k_min: expected at most 1, .* got 2"),
        (lambda rng: x_means([[1.0], [2.0]], rng=rng, k_min=2, k_max=1), "k_max: expected at least k_min = 2, got 1"),
        (lambda rng: x_means([[1.0]], rng=rng, k_max=0), "k_max: expected at least k_min = 1, got 0"),
        (lambda rng: x_means([[1.0]], rng=rng, n_dimensions=2), "n_dimensions: expected 1 to 1, .* got 2"),
        (lambda _: bic([[1.0]], [0], n_dimensions=0), "n_dimensions: expected 1 to 1, .* got 0"),
        (lambda _: bic([[1.0], [2.0]], [0]), "labels: expected one for each of 2 points, got 1"),
        (
            lambda _: Clustering([0, 2], [[0.0], [1.0]], 0.0),
            r"labels: expected each of 0 to 1 for 2 centers, got \[0, 2\]",
        ),
    ],
)
def test_bad_input_is_refused(call: Callable[[np.random.Generator], object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        call(np.random.default_rng(0))


def test_clustering_is_a_protected_copy() -> None:
    labels = np.array([0, 1])
    record = Clustering(labels, [[0.0], [1.0]], 3)
    labels[0] = 1
    assert record.labels.tolist() == [0, 1]
    with pytest.raises(ValueError, match="read-only"):
        record.centers[0] = 5.0


@parametrize_with_checks([XMeans(random_state=0)])
def test_estimator_keeps_the_conventions(estimator: BaseEstimator, check: Callable[[BaseEstimator], None]) -> None:
    check(estimator)


def test_estimator_is_x_means() -> None:
    points, labels = blobs(PLANE, size=15, seed=3)
    model = clone(XMeans(k_max=9, random_state=2)).fit(points)
    assert model.get_params() == {"k_min": 1, "k_max": 9, "n_dimensions": None, "random_state": 2}
    assert model.labels_.tolist() == labels.tolist()
    assert model.n_clusters_ == 5
    assert model.bic_ == pytest.approx(bic(points, labels))
    assert model.predict(np.array(PLANE) + 0.5).tolist() == [0, 1, 2, 3, 4]
    assert XMeans(k_min=2, k_max=2).fit_predict(points).max() == 1
    again = [XMeans(k_min=7, random_state=seed).fit(points).labels_.tolist() for seed in (1, np.random.RandomState(1))]
    assert again[0] == again[1]
