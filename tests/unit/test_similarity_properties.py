"""The similarity measure against its slow twin, on drawn chains."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sec_lab.event_chain import EventChain
from sec_lab.similarity import Match, compare, pairwise_similarity, permutations, similarity_table
from tests.naive_similarity import (
    NaiveMatch,
    Table,
    all_permutations_similarity,
    naive_assignments,
    naive_changing_rows,
    naive_compare,
)

OPTIONS = st.fixed_dictionaries(
    {
        "normalizer": st.sampled_from(["longer", "shorter"]),
        # Differences of similarities are multiples of 100/2, 100/3, …: such tolerances lie on the edge.
        "tolerance_percent": st.sampled_from([0, 100 / 6, 20, 25, 100 / 3, 50, 100]) | st.integers(0, 100),
        "temporal_input": st.sampled_from(["original", "derived"]),
    }
)
# Few codes make similar rows likely.
CODES = st.sampled_from([(0, 2), (0, 1, 2), (0, 1, 2, 9)])


@st.composite
def tables(draw: st.DrawFn, *, max_rows: int = 5, max_columns: int = 7) -> Table:
    """Relations in which something changes; rows are repeated often, some never change."""
    n_columns = draw(st.integers(2, max_columns))
    row = st.lists(st.sampled_from(draw(CODES)), min_size=n_columns, max_size=n_columns)
    pool = draw(st.lists(row, min_size=1, max_size=3))
    rows = st.lists(st.sampled_from(pool) | row, min_size=1, max_size=max_rows)
    return draw(rows.filter(lambda table: bool(naive_changing_rows(table))))


@st.composite
def versions(draw: st.DrawFn, *, max_rows: int = 5, max_columns: int = 7) -> tuple[Table, Table]:
    """Two manipulations: unrelated, or the second a version of the first with other rows and another timing."""
    first = draw(tables(max_rows=max_rows, max_columns=max_columns))
    second = draw(tables(max_rows=max_rows, max_columns=max_columns))
    if draw(st.booleans()):
        kept = sorted(draw(st.lists(st.integers(0, len(first[0]) - 1), min_size=2, max_size=max_columns)))
        stretched = [[row[x] for x in kept] for row in draw(st.permutations(first))]
        if naive_changing_rows(stretched):
            second = stretched
    return first, second


def chain_of(table: Table, labels: Sequence[int] | None = None) -> EventChain:
    labels = labels or range(1, len(table) + 2)
    return EventChain(table, [(labels[i + 1], labels[0]) for i in range(len(table))])


def among_changing(match: Match) -> tuple[tuple[int, int], ...]:
    """``match.rows``, counted among the changing rows."""
    places_a = {int(row): i for i, row in enumerate(match.a.changing_rows)}
    places_b = {int(row): j for j, row in enumerate(match.b.changing_rows)}
    return tuple((places_a[i], places_b[j]) for i, j in match.rows.tolist())


def assert_consistent(match: Match) -> None:
    """Rows are one-to-one candidates, columns keep their order, and both give the similarity that is reported."""
    pairs = among_changing(match)
    assert all(match.candidates[i, j] for i, j in pairs)
    for side in (0, 1):
        assert len(set(match.rows[:, side].tolist())) == len(match.rows)
        assert (np.diff(match.columns[:, side]) > 0).all()
    a, b = (
        chain.relations.astype(int) if match.temporal_input == "original" else
        10 * chain.relations[:, :-1].astype(int) + chain.relations[:, 1:]
        for chain in (match.a, match.b)
    )  # fmt: skip
    equal = sum(int(a[i, x] == b[j, y]) for i, j in match.rows for x, y in match.columns)
    largest = len(match.candidates) * min(a.shape[1], b.shape[1])
    assert match.temporal == pytest.approx(100 * equal / largest, rel=1e-12)


def assert_first_step_as_naive(match: Match, naive: NaiveMatch) -> None:
    expected = [[float(value) for value in row] for row in naive.row_similarity]
    np.testing.assert_allclose(match.row_similarity, expected, rtol=1e-12)
    assert match.candidates.tolist() == naive.candidates
    assert match.spatial == pytest.approx(float(naive.spatial), rel=1e-12)


@given(versions(), OPTIONS)
def test_as_naive(two: tuple[Table, Table], options: dict[str, Any]) -> None:
    a, b = two
    match, naive = compare(chain_of(a), chain_of(b), **options), naive_compare(a, b, **options)
    assert_first_step_as_naive(match, naive)
    assert_consistent(match)
    assert match.exact
    assert match.temporal == pytest.approx(float(naive.temporal), rel=1e-12)
    assert among_changing(match) in naive.best


@pytest.mark.slow
@settings(max_examples=25)
@given(versions(max_rows=6, max_columns=6), OPTIONS)
def test_six_rows_as_naive(two: tuple[Table, Table], options: dict[str, Any]) -> None:
    a, b = two
    match, naive = compare(chain_of(a), chain_of(b), **options), naive_compare(a, b, **options)
    assert_first_step_as_naive(match, naive)
    assert_consistent(match)
    assert match.exact
    assert match.temporal == pytest.approx(float(naive.temporal), rel=1e-12)


@given(versions(), OPTIONS, st.integers(1, 400))
def test_little_effort_gives_a_lower_bound(two: tuple[Table, Table], options: dict[str, Any], effort: int) -> None:
    a, b = two
    match, naive = compare(chain_of(a), chain_of(b), **options, effort=effort), naive_compare(a, b, **options)
    assert_first_step_as_naive(match, naive)
    assert_consistent(match)
    if match.exact:
        assert match.temporal == pytest.approx(float(naive.temporal), rel=1e-12)
    else:
        assert match.temporal <= float(naive.temporal) + 1e-9


@given(tables(max_rows=8, max_columns=9), OPTIONS)
def test_itself(table: Table, options: dict[str, Any]) -> None:
    match = compare(chain_of(table), chain_of(table), **options)
    assert (match.spatial, match.temporal, match.exact) == (100, 100, True)


@given(versions(), OPTIONS, st.data())
def test_neither_order_of_rows_nor_labels_matter(
    two: tuple[Table, Table], options: dict[str, Any], data: st.DataObject
) -> None:
    match = compare(*map(chain_of, two), **options)
    labels = [data.draw(st.permutations(range(len(table) + 1))) for table in two]
    shuffled = [data.draw(st.permutations(table)) for table in two]
    again = compare(*map(chain_of, shuffled, labels), **options)
    assert again.temporal == match.temporal
    assert again.spatial == pytest.approx(match.spatial, rel=1e-12)


@given(versions(), OPTIONS)
def test_both_directions_find_the_same_correspondence(two: tuple[Table, Table], options: dict[str, Any]) -> None:
    there, back = compare(*map(chain_of, two), **options), compare(*map(chain_of, two[::-1]), **options)
    m, k = there.candidates.shape
    assert there.candidates.tolist() == back.candidates.T.tolist()
    # They differ only in the number of rows that divides (Eq. 2.7).
    assert m * there.temporal == pytest.approx(k * back.temporal, rel=1e-12)


@given(versions(max_rows=4), OPTIONS)
def test_permutations(two: tuple[Table, Table], options: dict[str, Any]) -> None:
    a, b = two
    match = compare(chain_of(a), chain_of(b), **options)
    found = permutations(match)
    expected = {
        tuple((int(match.a.changing_rows[i]), int(match.b.changing_rows[j])) for i, j in pairs)
        for pairs in naive_assignments(match.candidates.tolist(), partial=False)
    }
    assert len(found) == len(expected)
    assert {tuple(map(tuple, one.rows.tolist())) for one in found} == expected
    assert max(one.temporal for one in found) == match.temporal
    naive = naive_compare(a, b, **options, partial=False)
    assert sum(one.temporal == match.temporal for one in found) == len(naive.best)


@given(versions(max_rows=4), OPTIONS)
def test_larger_assignments_never_agree_less(two: tuple[Table, Table], options: dict[str, Any]) -> None:
    a, b = two
    assert naive_compare(a, b, **options).temporal == naive_compare(a, b, **options, partial=False).temporal


@given(versions(max_rows=4), OPTIONS)
def test_the_spatial_step_only_narrows_the_search(two: tuple[Table, Table], options: dict[str, Any]) -> None:
    a, b = two
    value, _ = all_permutations_similarity(a, b, temporal_input=options["temporal_input"])
    assert compare(chain_of(a), chain_of(b), **options).temporal <= float(value) + 1e-9


@given(st.lists(tables(max_rows=6, max_columns=9), min_size=1, max_size=5), OPTIONS, st.sampled_from([1, 300, 10**5]))
def test_pairs_as_one_by_one(drawn: list[Table], options: dict[str, Any], effort: int) -> None:
    chains = [chain_of(table) for table in drawn]
    results = [pairwise_similarity(chains, **options, effort=effort, n_threads=n) for n in (1, 2, 3)]
    first = results[0]
    for other in results[1:]:
        assert first.spatial.tolist() == other.spatial.tolist()
        assert first.temporal.tolist() == other.temporal.tolist()
        assert first.exact.tolist() == other.exact.tolist()
    for i, a in enumerate(chains):
        for j, b in enumerate(chains):
            match = compare(a, b, **options, effort=effort)
            assert first.spatial[i, j] == match.spatial
            # The search runs once for both directions, so only what is proven is the same in both.
            if i <= j or (match.exact and first.exact[i, j]):
                assert first.temporal[i, j] == match.temporal
            if i <= j:
                assert first.exact[i, j] == first.exact[j, i] == match.exact


@given(
    st.lists(tables(), min_size=1, max_size=4),
    OPTIONS,
    st.sampled_from(["temporal", "spatial"]),
    st.sampled_from([1, 2, 3]),
)
def test_tables_as_pairs(drawn: list[Table], options: dict[str, Any], measure: Any, n_threads: int) -> None:
    chains = {f"movie {i}": chain_of(table) for i, table in enumerate(drawn)}
    there = np.array([[getattr(compare(a, b, **options), measure) for b in chains.values()] for a in chains.values()])
    expected: dict[Any, NDArray[np.float64]] = {
        "directed": there,
        "mean": (there + there.T) / 2,
        "smaller": np.minimum(there, there.T),
        "larger": np.maximum(there, there.T),
    }
    for direction, values in expected.items():
        table = similarity_table(chains, direction=direction, measure=measure, n_threads=n_threads, **options)
        assert table.to_numpy().tolist() == values.tolist()


@given(st.lists(tables(max_rows=6), min_size=2, max_size=4), OPTIONS, st.sampled_from([1, 200]))
def test_the_table_says_how_much_of_it_is_proven(drawn: list[Table], options: dict[str, Any], effort: int) -> None:
    chains = [chain_of(table) for table in drawn]
    exact = pairwise_similarity(chains, **options, effort=effort).exact
    pairs = exact[np.triu_indices(len(chains), k=1)]
    assert similarity_table(chains, **options, effort=effort).attrs["exact_percent"] == 100 * pairs.sum() / len(pairs)
