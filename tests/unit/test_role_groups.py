"""Segments of several demonstrations grouped by their role."""

import pickle

import pytest

from sec_lab.event_chain import EventChain
from sec_lab.role_groups import landed, role_groups

ROWS = [[0, 2, 2], [0, 0, 2], [2, 0, 0]]


def demonstration(first: int, *names: str) -> EventChain:
    """Three segments with three different rows, so that each role is clear."""
    a, b, c = range(first, first + 3)
    return EventChain(ROWS, [(a, b), (b, c), (a, c)], names=dict(zip((a, b, c), names, strict=True)))


def three() -> dict[str, EventChain]:
    names = ("hand", "cup", "box")
    return {"one": demonstration(1, *names), "two": demonstration(4, *names), "three": demonstration(7, *names)}


def test_each_role_is_a_group_of_all_demonstrations() -> None:
    groups = role_groups(three())
    assert groups.reference == "one"
    assert [dict(group) for group in groups.members.values()] == [
        {"one": k, "two": k + 3, "three": k + 6} for k in (1, 2, 3)
    ]
    assert landed(groups, three(), roles=["hand", "cup"]) == {"hand": (2, 2), "cup": (2, 2)}


def test_the_reference_is_most_like_the_others() -> None:
    chains = {"odd": EventChain([[0, 1, 0, 1, 0]], [(1, 2)]), **three()}
    assert role_groups(chains).reference == "one"
    assert role_groups(chains, reference="three").reference == "three"


def test_what_has_no_clear_role_is_in_no_group() -> None:
    # Two segments that do exactly the same cannot be told apart.
    twins = EventChain([[0, 2], [0, 2]], [(1, 2), (1, 3)])
    groups = role_groups({"one": twins, "two": twins})
    assert dict(groups.members[1]) == {"one": 1, "two": 1}
    assert dict(groups.members[2]) == {"one": 2}


def test_exchanged_names_do_not_land() -> None:
    chains = three() | {"two": demonstration(4, "hand", "box", "cup")}
    found = landed(role_groups(chains), chains, roles=["hand", "cup", "box", "lid"])
    assert found == {"hand": (2, 2), "cup": (1, 2), "box": (1, 2), "lid": (0, 2)}


def test_groups_go_through_pickle() -> None:
    groups = role_groups(three())
    assert pickle.loads(pickle.dumps(groups)).members == groups.members


def test_bad_input_is_named() -> None:
    with pytest.raises(ValueError, match="chains: expected at least two demonstrations, got 1"):
        role_groups({"one": three()["one"]})
    with pytest.raises(ValueError, match="reference: expected one of"):
        role_groups(three(), reference="four")
