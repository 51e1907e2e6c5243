"""Every leaf of the tree, reached by the smallest recording that ends there."""

import pytest

import sec_lab as sl
from sec_lab.event_chain import EventChain
from sec_lab.ontology import LEAVES, TREE, decide, decision_table
from sec_lab.role_tables import role_table

HAND_1, HAND_2 = [9, 0, 2, 2, 0, 9], [9, 0, 0, 0, 0, 9]
PAIRS = [(7, 1), (7, 2), (1, 2), (7, 3), (1, 3), (2, 3)]
NEVER = [0, 0, 0, 0, 0, 0]


def three(between: list[int], partner: list[int]) -> EventChain:
    there = [9 if code == 9 else 0 for code in partner]
    hand = [9 if a == 9 or b == 9 else 0 for a, b in zip(HAND_2, there, strict=True)]
    return EventChain([HAND_1, HAND_2, between, hand, there, partner], PAIRS)


def two(between: list[int]) -> EventChain:
    hand = [9 if a == 9 or b == 9 else 0 for a, b in zip(HAND_2, between, strict=True)]
    return EventChain([HAND_1, hand, between], PAIRS[:3])


RECORDINGS = {
    "move": two(NEVER),
    "move together": two([2, 2, 2, 2, 2, 2]),
    "uncover": two([9, 9, 9, 2, 0, 0]),
    "take apart": two([2, 2, 2, 0, 0, 0]),
    "hide": two([0, 0, 0, 2, 9, 9]),
    "put together": two([0, 0, 0, 2, 2, 2]),
    "stir": three([0, 0, 0, 2, 0, 0], [2, 2, 2, 2, 2, 2]),
    "cut": three([0, 0, 0, 2, 0, 0], [2, 2, 2, 2, 0, 9]),
    "poke": two([0, 0, 0, 2, 0, 0]),
    "unknown": EventChain([[0, 2, 0]], [(1, 2)]),
}


@pytest.mark.parametrize("leaf", LEAVES)
def test_every_leaf_is_reached(leaf: str) -> None:
    found = sl.ontology.decide(role_table(RECORDINGS[leaf]))
    assert found.leaf == leaf
    assert LEAVES[leaf].what in str(found)
    assert leaf in TREE


def test_unknown_says_what_is_missing() -> None:
    assert decide(role_table(RECORDINGS["unknown"])).steps == ("there is no hand: no segment comes or goes",)


def test_table_of_decisions_counts_each_recording_once() -> None:
    tables = {leaf: role_table(one) for leaf, one in RECORDINGS.items()}
    counts = decision_table(tables, [leaf.upper() for leaf in tables])
    assert counts.columns.tolist() == list(LEAVES)
    assert (counts.sum(axis=1) == 1).all()
    assert all(counts.loc[leaf.upper(), leaf] == 1 for leaf in tables)
    with pytest.raises(ValueError, match="classes: expected one for each of 10"):
        decision_table(tables, ["a"])
