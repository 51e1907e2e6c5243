"""Rates, variants and controls of recognition."""

from itertools import product
from math import sqrt

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.distance import cdist

from sec_lab.classification import leave_one_out
from sec_lab.event_chain import EventChain
from sec_lab.recognition import (
    class_means,
    closeness,
    exact_percent,
    nearest_neighbours,
    rate,
    recognition_rate,
    recognition_table,
    search_table,
    symmetrised,
)
from sec_lab.similarity import PairwiseSimilarity, pairwise_similarity, similarity_table

CHAINS = [
    EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)]),
    EventChain([[0, 2, 2, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)]),
    EventChain([[9, 0, 2, 9]], [(1, 2)]),
    EventChain([[2, 0, 0], [9, 0, 2], [9, 9, 0]], [(1, 2), (1, 3), (2, 3)]),
]
TYPES = ["put", "put", "take", "take"]


def tables(n: int):
    return arrays(np.float64, (n, n), elements=st.integers(0, 4).map(lambda x: 25.0 * x))


def similarity_of(temporal, *, exact=None) -> PairwiseSimilarity:
    values = np.asarray(temporal, dtype=float)
    return PairwiseSimilarity(values, values, np.ones(values.shape, bool) if exact is None else np.asarray(exact))


@pytest.mark.parametrize(("n_right", "n"), [(0, 80), (38, 80), (80, 80), (1, 2)])
def test_the_interval_is_wilsons(n_right, n):
    # Wilson 1927: centre (p + z²/2n)/(1 + z²/n), half width z·sqrt(p(1−p)/n + z²/4n²)/(1 + z²/n).
    z, p = 1.959963984540054, n_right / n
    centre = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * sqrt(p * (1 - p) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    found = rate(n_right, n)
    assert found.percent == pytest.approx(100 * p)
    assert found.low_percent == pytest.approx(100 * max(0, centre - half), abs=1e-9)
    assert found.high_percent == pytest.approx(100 * min(1, centre + half), abs=1e-9)


def test_more_confidence_needs_a_wider_interval():
    assert rate(40, 80, confidence_percent=99).low_percent < rate(40, 80).low_percent


@pytest.mark.parametrize(("n_right", "n"), [(0, 0), (-1, 3), (4, 3)])
def test_impossible_counts_are_refused(n_right, n):
    with pytest.raises(ValueError, match=f"got {n_right} of {n}"):
        rate(n_right, n)


@pytest.mark.parametrize("confidence", [0, 100, float("nan")])
def test_impossible_confidence_is_refused(confidence):
    with pytest.raises(ValueError, match="confidence_percent"):
        rate(1, 2, confidence_percent=confidence)


@pytest.mark.parametrize("direction", ["mean", "smaller", "larger", "directed"])
def test_tables_are_symmetrised_as_similarity_table_does(direction):
    directed = pairwise_similarity(CHAINS).temporal
    np.testing.assert_array_equal(
        symmetrised(directed, direction=direction), similarity_table(CHAINS, direction=direction)
    )


def test_what_cannot_be_symmetrised_is_refused():
    with pytest.raises(ValueError, match="direction: expected one of"):
        symmetrised([[1]], direction="median")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"square, got shape \(1, 2\)"):
        symmetrised([[1, 2]], direction="mean")


def test_every_variant_is_recognised_by_its_own_table():
    found = recognition_table({("x",): pairwise_similarity(CHAINS)}, TYPES, names=["chains"])
    assert found.index.names == ["chains", "measure", "direction"]
    assert len(found) == 8
    for measure, direction in product(("temporal", "spatial"), ("mean", "smaller", "larger", "directed")):
        table = similarity_table(CHAINS, measure=measure, direction=direction)
        n_right = int((leave_one_out(table, TYPES) == np.array(TYPES)).sum())
        row = found.loc[("x", measure, direction)]
        expected = rate(n_right, 4)
        assert (row["n_right"], row["percent"]) == (n_right, expected.percent)
        assert (row["low_percent"], row["high_percent"]) == (expected.low_percent, expected.high_percent)


def test_undecided_answers_are_counted():
    found = recognition_table(
        {("x",): similarity_of(np.full((3, 3), 50.0))}, ["a", "b", "c"], names=["x"], directions=["mean"]
    )
    assert found["n_undecided"].tolist() == [3, 3]


def test_a_table_of_variants_wants_both_measures_and_names():
    with pytest.raises(ValueError, match="got no spatial one for"):
        recognition_table({("x",): pairwise_similarity(CHAINS, measures=["temporal"])}, TYPES, names=["chains"])
    with pytest.raises(ValueError, match="names: expected one for each entry"):
        recognition_table({("x", "y"): pairwise_similarity(CHAINS)}, TYPES, names=["chains"])
    with pytest.raises(ValueError, match="at least one set"):
        recognition_table({}, TYPES, names=["chains"])


def test_right_answers_are_counted():
    assert recognition_rate(["a", "b", "b"], ["a", "a", "b"]).n_right == 2
    with pytest.raises(ValueError, match=r"expected shape \(2,\)"):
        recognition_rate(["a", "b"], ["a"])


@given(tables(6), st.lists(st.sampled_from("abc"), min_size=6, max_size=6))
def test_the_nearest_neighbour_stands_behind_the_answer(table, types):
    found = nearest_neighbours(table, types)
    assert found["nearest_class"].tolist() == leave_one_out(table, types).tolist()
    for i, row in found.iterrows():
        others = [j for j in range(6) if j != i]
        assert types[row["nearest"]] == row["nearest_class"]
        assert row["similarity"] == table[row["nearest"], i] == max(table[j, i] for j in others)
        own = [j for j in others if types[j] == types[i]]
        if own:
            assert row["own_similarity"] == table[int(row["own"]), i] == max(table[j, i] for j in own)
        else:
            assert pd.isna(row["own"])
            assert pd.isna(row["own_similarity"])


@given(tables(5), st.lists(st.sampled_from("abc"), min_size=5, max_size=5))
def test_means_are_those_of_the_pairs(table, types):
    found = class_means(table, types)
    for a, b in product(dict.fromkeys(types), repeat=2):
        values = [table[i, j] for i, j in product(range(5), repeat=2) if i != j and (types[i], types[j]) == (a, b)]
        assert found.loc[a, b] == pytest.approx(np.mean(values) if values else np.nan, nan_ok=True)


def test_means_want_a_class_for_each_row():
    with pytest.raises(ValueError, match="one for each of 2 rows"):
        class_means([[1, 2], [3, 4]], ["a"])


def test_closeness_is_the_distance_of_standard_scores():
    numbers = np.random.default_rng(0).integers(1, 50, (7, 3)).astype(float)
    scores = (numbers - numbers.mean(axis=0)) / numbers.std(axis=0)
    np.testing.assert_allclose(closeness(numbers), -cdist(scores, scores), atol=1e-12)
    # Neither the unit of a number nor its zero matters.
    np.testing.assert_allclose(closeness(numbers * [1, 60, 0.1] + 5), closeness(numbers), atol=1e-12)


@pytest.mark.parametrize("numbers", [[[1, 2], [1, 3]], np.empty((0, 2)), [[1.0], [np.inf]]])
def test_numbers_that_tell_nothing_are_refused(numbers):
    with pytest.raises(ValueError, match="numbers: expected"):
        closeness(numbers)


def test_what_effort_changes():
    low = similarity_of([[100, 50, 40], [60, 100, 30], [0, 0, 100]], exact=~np.eye(3, dtype=bool))
    high = similarity_of([[0, 50, 44], [60, 100, 33], [0, 0, 100]], exact=np.eye(3, dtype=bool))
    found = search_table({1: low, 2: high}, reference=1)
    # Six ordered pairs of different manipulations, two of which change; the diagonal does not count.
    assert found.loc[1].tolist() == [100.0, 0.0, 0.0]
    assert found.loc[2].tolist() == [0.0, pytest.approx(100 / 3), 4.0]


def test_a_search_without_reference_or_pairs_is_refused():
    with pytest.raises(ValueError, match=r"reference: expected one of \[1\], got 2"):
        search_table({1: similarity_of(np.eye(2))}, reference=2)
    with pytest.raises(ValueError, match="at least two manipulations"):
        search_table({1: similarity_of([[100]])}, reference=1)
    with pytest.raises(ValueError, match="at least two manipulations, got 1"):
        exact_percent(similarity_of([[100]]))
