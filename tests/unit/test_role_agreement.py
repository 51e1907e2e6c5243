"""Roles held against names: counts, chance, and the best that could be."""

from itertools import permutations
from statistics import mean

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sec_lab.event_chain import EventChain
from sec_lab.role_agreement import agreement_table, matches_within, name_table, role_counts
from sec_lab.roles import corresponding_segments
from sec_lab.similarity import Match, compare

# Every row is unlike the others, so that every segment has its role.
ROWS = [[0, 2, 2, 2], [0, 2, 0, 2], [2, 0, 0, 0], [9, 9, 2, 2], [9, 0, 9, 0], [9, 2, 9, 9]]
PAIRS = [(1, 2), (1, 3), (1, 4), (2, 3), (2, 4), (3, 4)]
NAMES = st.sampled_from(["hand", "cup", "box", None])


def chain(*names: str | None) -> EventChain:
    return EventChain(ROWS, PAIRS, names=dict(enumerate(names, start=1)))


def test_the_roles_are_clear() -> None:
    assert corresponding_segments(compare(chain(), chain())) == {1: 1, 2: 2, 3: 3, 4: 4}


def test_counts_of_one_match() -> None:
    counts = role_counts(compare(chain("hand", "cup", "box", None), chain("hand", "box", "box", "cup")))
    assert (counts.n_segments, counts.n_found, counts.n_ambiguous) == (4, 4, 0)
    # The fragment is not judged. Hand and box agree, the cup does not.
    assert (counts.n_named, counts.n_same) == (3, 2)
    # Four names in ξ²: a hand, two boxes, a cup.
    assert counts.by_chance == pytest.approx(1 / 4 + 1 / 4 + 2 / 4)
    assert counts.at_best == 3


@given(st.tuples(NAMES, NAMES, NAMES, NAMES), st.tuples(NAMES, NAMES, NAMES, NAMES))
def test_chance_and_best_are_those_of_all_assignments(
    names_a: tuple[str | None, ...], names_b: tuple[str | None, ...]
) -> None:
    counts = role_counts(compare(chain(*names_a), chain(*names_b)))
    judged = [a for a, b in zip(names_a, names_b, strict=True) if a is not None and b is not None]
    named_b = [b for b in names_b if b is not None]
    assume(judged)
    same = [sum(a == b for a, b in zip(judged, dealt, strict=True)) for dealt in permutations(named_b, len(judged))]
    assert counts.by_chance == pytest.approx(mean(same))
    assert counts.at_best == max(same)
    assert counts.n_same == sum(a == b is not None for a, b in zip(names_a, names_b, strict=True))


def test_names_that_are_not_judged_count_as_unknown() -> None:
    a, b = chain("hand", "cup", "box", "cup"), chain("hand", "hand", "box", "box")
    without = [chain(*(None if name == "hand" else name for name in one.names.values())) for one in (a, b)]
    assert role_counts(compare(a, b), not_judged={"hand"}) == role_counts(compare(*without))


def test_nothing_is_judged_without_names() -> None:
    counts = role_counts(compare(chain(), chain()))
    assert (counts.n_found, counts.n_named, counts.by_chance, counts.at_best) == (4, 0, 0.0, 0)


def ambiguous_match() -> Match:
    # 2 and 3 do the same.
    one = EventChain([[0, 2], [0, 2]], [(1, 2), (1, 3)], names={1: "hand", 2: "cup", 3: "box"})
    return compare(one, one)


def test_ambiguous_segments_are_counted_apart() -> None:
    counts = role_counts(ambiguous_match())
    assert (counts.n_segments, counts.n_found, counts.n_ambiguous, counts.n_same) == (3, 1, 2, 1)


def test_demonstrations_are_compared_within_their_type_in_both_directions() -> None:
    a, b, other = chain("hand"), EventChain(ROWS[:3], PAIRS[:3]), chain("cup")
    matches = matches_within({"a": a, "b": b, "c": other}, {"a": "put", "b": "put", "c": "take"}, normalizer="shorter")
    assert list(matches) == [("a", "b"), ("b", "a")]
    assert matches["a", "b"].a is a
    assert matches["a", "b"].temporal == compare(a, b, normalizer="shorter").temporal
    with pytest.raises(ValueError, match="got none for 'b'"):
        matches_within({"a": a, "b": b}, {"a": "put"})


def test_the_table_sums_up_before_it_divides() -> None:
    matches = {
        ("a", "b"): compare(chain("hand", "cup", "box", None), chain("hand", "box", "box", "cup")),
        ("c", "d"): ambiguous_match(),
        ("e", "f"): compare(chain(), chain()),
    }
    table = agreement_table(matches, {"a": "put", "c": "put", "e": "take"})
    assert table.index.tolist() == ["put", "take", "all"]
    put = table.loc["put"]
    assert (put["pairs"], put["ambiguous_pairs"], put["segments"], put["named"]) == (2, 50, 7, 4)
    assert put["found"] == pytest.approx(100 * 5 / 7)
    assert put["ambiguous"] == pytest.approx(100 * 2 / 7)
    # 2 of 3 and 1 of 1; chance gives 1 of 3 and 1/3 of 1; at best 3 of 3 and 1 of 1.
    assert put["same"] == pytest.approx(75)
    assert put["by_chance"] == pytest.approx(100 / 3)
    assert put["at_best"] == pytest.approx(100)
    assert table.loc["take", ["same", "by_chance", "at_best"]].isna().all()
    assert table.loc["all", "same"] == pytest.approx(75)
    assert table.loc["all", "pairs"] == 3
    only_things = agreement_table(matches, {"a": "put", "c": "put", "e": "take"}, not_judged=["hand"])
    assert only_things.loc["all", "named"] == 2
    with pytest.raises(ValueError, match="at least one match"):
        agreement_table({}, {})


def test_which_name_stands_for_which() -> None:
    table = name_table([compare(chain("hand", "cup", "box", None), chain("hand", "box", "box", "cup"))] * 2)
    assert table.index.tolist() == ["box", "hand", "cup", "no object"]
    assert table.loc["box", "box"] == 2
    assert table.loc["cup", "box"] == 2
    assert table.loc["no object", "cup"] == 2
    assert table.to_numpy().sum() == 8
    matches = {("a", "b"): ambiguous_match()}
    assert name_table(matches).to_dict() == {"hand": {"hand": 1}}


def test_a_table_without_any_role_is_refused() -> None:
    one = EventChain([[0, 2]], [(1, 2)])
    with pytest.raises(ValueError, match="clear counterpart"):
        name_table([compare(one, one)])
