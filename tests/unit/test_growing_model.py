"""A growing model counts what its slow twin counts, whatever chains come."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sec_lab import EventChain
from sec_lab._profile import Options, Packed, Profile
from tests.naive_learning import NaiveProfile


@st.composite
def some_chains(draw: st.DrawFn) -> list[EventChain]:
    """Three to nine small chains in which something changes, akin to each other."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    m, u = draw(st.integers(1, 4)), draw(st.integers(2, 5))
    seed = rng.choice([0, 1, 2, 9], size=(m, u))
    chains = []
    for _ in range(draw(st.integers(3, 9))):
        rows, columns = m + rng.integers(0, 3), u + rng.integers(0, 3)
        table = rng.choice([0, 1, 2, 9], size=(rows, columns))
        table[:m, :u] = np.where(rng.random(seed.shape) < 0.2, table[:m, :u], seed)
        if (table != table[:, :1]).any():
            chains.append(EventChain(table, [(2 * i + 1, 2 * i + 2) for i in range(rows)]))
    return chains or [EventChain([[0, 2]], [(1, 2)])]


@given(chains=some_chains(), threshold=st.sampled_from([0.0, 0.3, 0.5, 1.0]), shorter=st.booleans())
@settings(max_examples=150, deadline=None)
def test_counts_are_those_of_the_twin(chains: list[EventChain], threshold: float, shorter: bool) -> None:
    packed = Packed(chains, [str(i) for i in range(len(chains))])
    options = Options(shorter, 0.0, 1000, threshold)
    one_by_one, twin = Profile(packed.codes_of(0), options), NaiveProfile(packed.codes_of(0), options.threshold_so_far)
    at_once = Profile(packed.codes_of(0), options)
    for i in range(1, len(chains)):
        alignment = one_by_one.align(packed.codes_of(i))
        one_by_one.add(packed.codes_of(i), alignment)
        twin.add(packed.codes_of(i), alignment.rows, alignment.columns)
        np.testing.assert_array_equal(one_by_one.votes, twin.votes)
        np.testing.assert_array_equal(one_by_one.initial, twin.initial)
        assert one_by_one.row_counts.tolist() == [count for count, _ in twin.rows]
        assert one_by_one.column_counts.tolist() == [count for count, _ in twin.columns]
        shown = [[twin.shown(a, x) for x in range(len(twin.columns))] for a in range(len(twin.rows))]
        np.testing.assert_array_equal(one_by_one.codes, shown)
    at_once.add_all(packed, np.arange(1, len(chains)))
    assert at_once.n == one_by_one.n == twin.n
    np.testing.assert_array_equal(at_once.votes, one_by_one.votes)
    np.testing.assert_array_equal(at_once.initial, one_by_one.initial)
    assert at_once.row_counts.tolist() == one_by_one.row_counts.tolist()
    assert at_once.column_counts.tolist() == one_by_one.column_counts.tolist()


def test_a_chain_of_too_many_rows_is_refused_by_name() -> None:
    n = 2**16
    large = EventChain(np.tile([[0, 2]], (n, 1)), np.arange(2 * n).reshape(n, 2))
    with pytest.raises(ValueError, match="demonstration big: expected at most 65535 changing rows, got 65536"):
        Packed([large], ["big"])
