import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from itertools import combinations, permutations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats
from threadpoolctl import threadpool_limits

import sec_lab as sl
from sec_lab.classification import (
    confusion,
    correlation_features,
    leave_one_out,
    most_classes,
    principal_dimensions,
    threshold_errors,
    type_similar,
    undecided,
    unsupervised_classes,
)
from sec_lab.event_chain import EventChain
from sec_lab.xmeans import x_means

Floats = NDArray[np.float64]
TYPES = ["Moving Object", "Making Sandwich", "Filling Liquid", "Opening Book"]


def planted(
    *, n_types: int, n_versions: int, within: float, between: float, noise: float, seed: int
) -> tuple[Floats, list[int]]:
    """Symmetric table: a level for each pair of types, and noise on each pair of versions."""
    rng = np.random.default_rng(seed)
    levels = rng.uniform(between - 15, between + 15, (n_types, n_types))
    np.fill_diagonal(levels, within)
    types = np.repeat(np.arange(n_types), n_versions)
    table = np.triu(levels[np.ix_(types, types)] + rng.normal(0, noise, (len(types), len(types))), k=1).clip(0, 100)
    return table + table.T + 100 * np.eye(len(types)), types.tolist()


def table_as_described() -> pd.DataFrame:
    """What §2.7 says of Fig. 2.7: all versions of a type at 64 % or more, once equal, one pair of two types as well."""
    names = [f"{name} {version}" for name in TYPES for version in ("I", "II", "III", "IV")]
    values, _ = planted(n_types=4, n_versions=4, within=80, between=40, noise=5, seed=27)
    frame = pd.DataFrame(values, index=names, columns=names)
    for a, b, value in (
        ("Filling Liquid I", "Filling Liquid IV", 64.0),
        ("Opening Book IV", "Making Sandwich IV", 66.0),
    ):
        frame.loc[a, b] = frame.loc[b, a] = value
    return frame


def tables(*, symmetric: bool) -> st.SearchStrategy[tuple[Floats, list[str]]]:
    """Small tables of few different values, so that ties are frequent, with classes."""

    def build(draw: st.DrawFn) -> tuple[Floats, list[str]]:
        n = draw(st.integers(2, 7))
        values = draw(st.lists(st.sampled_from([0.0, 25.0, 50.0, 64.0, 100.0]), min_size=n * n, max_size=n * n))
        table = np.array(values).reshape(n, n)
        classes = draw(st.lists(st.sampled_from(["push", "pour", "cut"]), min_size=n, max_size=n))
        return (np.maximum(table, table.T) if symmetric else table), classes

    return st.composite(build)()


def test_type_similar_from_the_threshold_on() -> None:
    table = pd.DataFrame([[100, 64, 63.9], [64, 100, 65], [63.9, 65, 100]])
    expected = [[True, True, False], [True, True, True], [False, True, True]]
    assert type_similar(table, threshold_percent=64).tolist() == expected
    # (100 / 3 + 100 / 3) and 200 / 3 are rounded differently.
    assert type_similar([[100 / 3 * 2 - 1e-13]], threshold_percent=200 / 3).all()


def test_threshold_errors_as_in_section_2_7() -> None:
    frame, classes = table_as_described(), np.repeat(TYPES, 4)
    errors = threshold_errors(frame, classes, thresholds_percent=[64.0, 64.5, 66.5])
    assert errors.to_dict("list") == {"false_negatives": [0, 1, 1], "false_positives": [1, 1, 0]}
    assert errors.index.tolist() == [64.0, 64.5, 66.5]
    # Four types of four versions: 4 * 6 pairs of one type among all 16 * 15 / 2.
    assert errors.attrs == {"same_type": 24, "different_types": 96}
    pd.testing.assert_frame_equal(threshold_errors(frame, classes, thresholds_percent=64), errors.iloc[:1])


@given(tables(symmetric=True), st.lists(st.sampled_from([0.0, 24.0, 25.0, 64.0, 64.5, 100.0]), min_size=1, max_size=4))
def test_threshold_errors_count_every_pair(example: tuple[Floats, list[str]], thresholds: list[float]) -> None:
    table, classes = example
    for directed, pairs in ((False, combinations), (True, permutations)):
        chosen = list(pairs(range(len(table)), 2))
        errors = threshold_errors(table, classes, thresholds_percent=thresholds, directed=directed)
        assert errors.to_numpy().tolist() == [
            [
                sum(classes[i] == classes[j] and table[i, j] < threshold for i, j in chosen),
                sum(classes[i] != classes[j] and table[i, j] >= threshold for i, j in chosen),
            ]
            for threshold in thresholds
        ]
        assert sum(errors.attrs.values()) == len(chosen)


def test_a_directed_table_counts_ordered_pairs_only_if_told() -> None:
    table, classes = [[100, 70, 10], [60, 100, 10], [10, 90, 100]], ["push", "push", "pour"]
    with pytest.raises(
        ValueError, match=r"symmetric one \(or directed=True\), got 70 in row 0, column 1 and 60 in row 1"
    ):
        threshold_errors(table, classes, thresholds_percent=64)
    errors = threshold_errors(table, classes, thresholds_percent=64, directed=True)
    assert errors.to_numpy().tolist() == [[1, 1]]
    assert errors.attrs == {"same_type": 2, "different_types": 4}


@pytest.mark.parametrize("symmetric", [True, False])
def test_features_are_the_correlations_of_columns(symmetric: bool) -> None:
    table = np.random.default_rng(1).uniform(0, 100, (9, 9))
    table = (table + table.T) / 2 if symmetric else table
    features = correlation_features(table)
    expected = [[stats.pearsonr(table[:, i], table[:, j]).statistic for j in range(9)] for i in range(9)]
    np.testing.assert_allclose(features, expected, rtol=1e-12, atol=1e-12)
    assert (features == features.T).all()
    assert (np.diag(features) == 1).all()
    # A correlation knows neither unit nor zero.
    np.testing.assert_allclose(correlation_features(table / 1e9 + 3), features, atol=1e-6)


def test_identical_and_opposite_columns() -> None:
    features = correlation_features([[10.1, 10.1, 30], [20.2, 20.2, 20], [30.3, 30.3, 10]])
    np.testing.assert_allclose(features, [[1, 1, -1], [1, 1, -1], [-1, -1, 1]], rtol=1e-14)
    rng = np.random.default_rng(0)
    features = correlation_features(rng.uniform(0, 100, (50, 1)) * rng.uniform(1, 2, 50) + rng.uniform(0, 9, 50))
    np.testing.assert_allclose(features, np.ones((50, 50)), rtol=1e-13)
    assert features.max() == 1


def test_four_types_are_found_without_outliers() -> None:
    frame = table_as_described()
    assert unsupervised_classes(frame).tolist() == [0] * 4 + [1] * 4 + [2] * 4 + [3] * 4
    order = np.random.default_rng(5).permutation(16)
    shuffled = unsupervised_classes(frame.iloc[order, order])
    types = [TYPES[i // 4] for i in order]
    assert shuffled.tolist() == [list(dict.fromkeys(types)).index(name) for name in types]
    assert shuffled.dtype == np.int64


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("n_types", "n_versions", "within", "between", "noise"),
    [
        (2, 2, 85, 40, 8),
        (2, 10, 80, 55, 10),
        (4, 4, 75, 40, 8),
        (5, 2, 85, 40, 8),
        (8, 10, 75, 40, 10),
    ],
)
def test_planted_types_are_found(
    n_types: int, n_versions: int, within: float, between: float, noise: float, seed: int
) -> None:
    table, types = planted(
        n_types=n_types, n_versions=n_versions, within=within, between=between, noise=noise, seed=seed
    )
    assert unsupervised_classes(table).tolist() == types


def test_identical_manipulations_are_one_class() -> None:
    levels = np.array([[100.0, 30, 45], [30, 100, 20], [45, 20, 100]])
    table = np.kron(levels, np.ones((4, 4)))
    assert unsupervised_classes(table).tolist() == [0] * 4 + [1] * 4 + [2] * 4


@pytest.mark.parametrize("n_types", [2, 3])
def test_what_stands_aside_in_every_second_version_makes_no_class(n_types: int) -> None:
    """Versions of a type that are nearly the same but for that leave the criterion of X-means no spread."""
    types, aside = np.repeat(np.arange(n_types), 8), np.tile([0, 1], 4 * n_types)
    same, alike = types[:, None] == types, aside[:, None] == aside
    rng = np.random.default_rng(3)
    table = np.where(same, np.where(alike, 98.0, 85.0), np.where(alike, 62.0, 55.0)) + rng.uniform(0, 2, same.shape)
    table = np.triu(table, 1) + np.triu(table, 1).T + 100 * np.eye(len(types))
    features = correlation_features(table)
    without_limit = x_means(features, rng=np.random.default_rng(0), n_dimensions=principal_dimensions(features)).labels
    assert without_limit.max() + 1 > n_types
    assert unsupervised_classes(table).tolist() == types.tolist()


def test_most_classes_are_what_the_correlations_span() -> None:
    table, types = planted(n_types=5, n_versions=6, within=80, between=40, noise=2, seed=1)
    eigenvalues = np.linalg.eigvalsh(np.corrcoef(table.T))
    assert most_classes(table) == 1 + sum(value >= 0.7 for value in eigenvalues) == 5
    assert unsupervised_classes(table).tolist() == types
    # Who names a number means it.
    assert unsupervised_classes(table, k_max=6).max() == 5


def test_number_of_classes_can_be_limited() -> None:
    table, _ = planted(n_types=4, n_versions=4, within=80, between=40, noise=5, seed=0)
    assert unsupervised_classes(table).max() == 3
    assert unsupervised_classes(table, k_max=3).max() <= 2
    assert unsupervised_classes(table, k_max=1).tolist() == [0] * 16


def test_classes_depend_on_the_table_and_the_generator_alone() -> None:
    # Types so noisy that the start decides how they are divided.
    table, _ = planted(n_types=8, n_versions=5, within=70, between=45, noise=25, seed=0)
    seeded = [unsupervised_classes(table, rng=np.random.default_rng(seed)).tolist() for seed in range(6)]
    assert len({tuple(classes) for classes in seeded}) > 1
    for _ in range(3):
        assert unsupervised_classes(table).tolist() == seeded[0]


def test_features_do_not_depend_on_the_number_of_threads() -> None:
    table = np.random.default_rng(3).uniform(0, 100, (700, 700))
    results = []
    for n_threads in (1, 2, 4):
        with threadpool_limits(limits=n_threads):
            results.append(correlation_features(table).tobytes())
    assert len(set(results)) == 1


def test_chains_go_all_the_way() -> None:
    put = EventChain([[0, 2, 0, 0], [0, 2, 2, 2], [0, 0, 2, 2]], [(1, 2), (2, 3), (3, 4)])
    take = EventChain([[0, 2, 2, 0], [2, 2, 0, 0], [9, 0, 0, 2]], [(1, 2), (2, 3), (3, 4)])
    shake = EventChain([[0, 2, 0, 2], [2, 0, 2, 0], [2, 0, 2, 9]], [(1, 2), (2, 3), (3, 4)])
    table = sl.similarity_table(
        {f"{name} {i}": chain for i in range(3) for name, chain in (("a", put), ("b", take), ("c", shake))}
    )
    assert sl.unsupervised_classes(table).tolist() == [0, 1, 2] * 3
    assert leave_one_out(table, ["put", "take", "shake"] * 3).tolist() == ["put", "take", "shake"] * 3


@pytest.mark.parametrize("n", [1, 2, 5])
def test_principal_dimensions_of_known_spectra(n: int) -> None:
    rng = np.random.default_rng(n)
    axes, _ = np.linalg.qr(rng.normal(size=(8, 8)))
    scores = rng.normal(size=(30, n + 1))
    scores, _ = np.linalg.qr(scores - scores.mean(axis=0))
    # n axes of variance 1 and one of variance v carry n / (n + v) of it without the last.
    for last, dimensions in ((n * 0.06, n + 1), (n * 0.05, n)):
        points = scores * np.sqrt([1.0] * n + [last]) @ axes[: n + 1]
        assert principal_dimensions(points + 5.0) == dimensions
    assert principal_dimensions(points, share_percent=100) == n + 1


def test_principal_dimensions_of_a_point() -> None:
    assert principal_dimensions([[3.0, 4.0]]) == 1


@given(tables(symmetric=False))
def test_nearest_neighbour_is_the_obvious_one(example: tuple[Floats, list[str]]) -> None:
    table, classes = example
    predicted, open_ = leave_one_out(table, classes), undecided(table, classes)
    for j in range(len(table)):
        others = [i for i in range(len(table)) if i != j]
        nearest = [i for i in others if table[i, j] == max(table[k, j] for k in others)]
        votes = Counter(classes[i] for i in nearest)
        winners = [classes[i] for i in nearest if votes[classes[i]] == max(votes.values())]
        assert predicted[j] == winners[0]
        assert open_[j] == (len(set(winners)) > 1)


def test_ties_do_not_hang_on_rounding() -> None:
    third = 100 / 3
    more = third * (1 + 1e-15)
    assert more > third
    table = [[100, third, more, third], [third, 100, 0, 0], [more, 0, 100, 0], [third, 0, 0, 100]]
    classes = ["push", "push", "pour", "push"]
    assert leave_one_out(table, classes).tolist() == ["push"] * 4
    assert undecided(table, classes).tolist() == [False] * 4
    assert undecided(table, ["push", "push", "pour", "cut"]).tolist() == [True, False, False, False]


def test_types_may_be_of_any_kind() -> None:
    table = [[100, 90, 10], [90, 100, 20], [10, 20, 100]]
    numbers = leave_one_out(table, [7, 7, 3])
    assert numbers.tolist() == [7, 7, 7]
    assert numbers.dtype.kind == "i"
    assert leave_one_out(table, pd.Series(["a", "a", "b"], dtype="category")).tolist() == ["a", "a", "a"]


def test_confusion_matrix_in_the_order_of_the_types() -> None:
    frame = confusion(["push", "push", "cut", "cut", "cut"], ["push", "cut", "cut", "cut", "wipe"])
    assert frame.index.tolist() == frame.columns.tolist() == ["push", "cut", "wipe"]
    assert frame.to_numpy().tolist() == [[1, 1, 0], [0, 2, 1], [0, 0, 0]]
    assert (frame.index.name, frame.columns.name) == ("class", "recognised")
    assert confusion([2, 1], [2, 2]).to_dict() == {2: {2: 1, 1: 1}, 1: {2: 0, 1: 0}}


SQUARE = np.array([[100.0, 50.0, 20.0], [50.0, 100.0, 30.0], [20.0, 30.0, 100.0]])
NOT_A_NUMBER = np.where(SQUARE == 20.0, np.nan, SQUARE)
CONSTANT = pd.DataFrame([[5.0, 1, 2], [5, 2, 1], [5, 3, 3]], index=list("abc"), columns=list("abc"))


@pytest.mark.parametrize(
    ("function", "minimum"),
    [
        (lambda table: type_similar(table, threshold_percent=64), 1),
        (lambda table: threshold_errors(table, ["a"] * len(table), thresholds_percent=64), 2),
        (lambda table: leave_one_out(table, ["a"] * len(table)), 2),
        (lambda table: undecided(table, ["a"] * len(table)), 2),
        (correlation_features, 3),
        (unsupervised_classes, 3),
    ],
)
def test_bad_tables_are_refused(function: Callable[[object], object], minimum: int) -> None:
    function(SQUARE)
    for table, says in (
        (SQUARE[:2], rf"table: expected a square with at least {minimum} rows, got shape \(2, 3\)"),
        (SQUARE[: minimum - 1, : minimum - 1], f"at least {minimum} rows, got shape"),
        (SQUARE[0], r"table: expected 2 dimensions, got shape \(3,\)"),
        (NOT_A_NUMBER, "table: expected finite numbers, got nan"),
        (np.where(SQUARE == 30, np.inf, SQUARE), "table: expected finite numbers, got inf"),
        ([[1.0], [2.0, 3.0]], "table: expected a rectangular array of numbers, got ragged rows"),
        ([["a"]], "table: expected numbers"),
        (
            pd.DataFrame(SQUARE, columns=list("abc"), index=list("acb")),
            "table: expected rows and columns of the same names",
        ),
    ):
        with pytest.raises(ValueError, match=says):
            function(table)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: type_similar(SQUARE, threshold_percent=100.1), "threshold: expected 0 to 100 percent, got 100.1"),
        (lambda: type_similar(SQUARE, threshold_percent=float("nan")), "threshold: expected 0 to 100 percent, got nan"),
        (lambda: threshold_errors(SQUARE, [1, 1, 2], thresholds_percent=[64, -1]), "threshold: .* got -1"),
        (
            lambda: threshold_errors(SQUARE, [1, 1, 2], thresholds_percent=[]),
            r"threshold: expected one number or .* \(0,\)",
        ),
        (
            lambda: threshold_errors(SQUARE, [1, 1, 2], thresholds_percent=[[64]]),
            r"threshold: expected one .* \(1, 1\)",
        ),
        (lambda: threshold_errors(SQUARE, [1, 1, 2], thresholds_percent="64 %"), "threshold: expected numbers"),
        (
            lambda: threshold_errors(SQUARE, [1, 2], thresholds_percent=64),
            r"classes: .* each of 3 manipulations, got shape \(2,\)",
        ),
        (lambda: leave_one_out(SQUARE, [[1], [2], [3]]), r"classes: .* each of 3 manipulations, got shape \(3, 1\)"),
        (
            lambda: leave_one_out(SQUARE, ["a", None, "b"]),
            "classes: expected a type for each manipulation, got None at 1",
        ),
        (lambda: undecided(SQUARE, [1.0, 2.0, np.nan]), "classes: expected a type for each manipulation, got nan at 2"),
        (lambda: confusion([], []), r"classes: expected one for each, got shape \(0,\)"),
        (lambda: confusion([1, 2], [1]), r"predicted: expected one for each of 2 manipulations, got shape \(1,\)"),
        (lambda: correlation_features(np.full((3, 3), 100.0)), "every column, got 100 everywhere in column 0"),
        (lambda: unsupervised_classes(CONSTANT), "every column, got 5 everywhere in column 'a'"),
        (lambda: unsupervised_classes(SQUARE, rng=np.random), "rng: expected a numpy.random.Generator, got module"),
        (lambda: unsupervised_classes(SQUARE, k_max=0), "k_max: expected at least k_min = 1, got 0"),
        (lambda: principal_dimensions([[np.nan]]), "features: expected finite numbers, at least one, got nan"),
        (lambda: principal_dimensions(np.empty((0, 3))), r"features: expected finite numbers, .* got shape \(0, 3\)"),
        (lambda: principal_dimensions([[1.0]], share_percent=0), "share_percent: expected more than 0, .* got 0"),
    ],
)
def test_bad_options_are_refused(call: Callable[[], object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        call()


def test_importing_it_loads_neither_scikit_learn_nor_pandas() -> None:
    code = "import sys, sec_lab.classification; print([m for m in ('sklearn', 'pandas', 'scipy') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
