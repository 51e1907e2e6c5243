"""What a collection holds: sizes, and what rows tell."""

import pytest

from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph
from sec_lab.summary import kinds_of_rows, row_kind_table, summary

APART, TOUCHING = [[0, 0], [0, 0]], [[0, 2], [2, 0]]


def test_sizes() -> None:
    graphs = [
        SceneGraph([1, 2], APART),
        None,
        SceneGraph([1, 2], TOUCHING),
        SceneGraph([1, 2, 7], [[0, 2, 0], [2, 0, 0], [0, 0, 0]]),
    ]
    seen = Observation(graphs, [4, 5, 9, 30], {1: "cup", 2: None, 8: None})
    found = summary({"put": seen}).loc["put"].to_dict()
    # Segment 8 never appears; all three pairs change; a key frame that was not recorded does not count.
    expected = {"key_frames": 3, "segments": 3, "fragments": 1, "changing_rows": 3, "duration_frames": 26}
    assert found == expected | {"depth": False}


@pytest.mark.parametrize(
    ("positions", "depth"),
    [
        ([[3.0, 4.0], [5.0, 6.0]], False),
        ([[3.0, 4.0, 0.0], [5.0, 6.0, 0.0]], False),
        ([[0.1, 0.2, 0.9], [0.1, 0.3, 1.0]], True),
    ],
)
def test_depth(positions: list[list[float]], depth: bool) -> None:
    graphs = [SceneGraph([1, 2], relations, positions) for relations in (APART, TOUCHING)]
    assert summary({"put": Observation(graphs, [0, 1])}).loc["put", "depth"] == depth


def test_nothing_to_sum_up_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one observation"):
        summary({})


def test_a_row_tells_of_touching_only_if_its_relation_changes() -> None:
    rows = [[0, 2, 2], [9, 2, 9], [9, 9, 0], [2, 9, 0], [2, 2, 2], [0, 1, 9], [9, 0, 2]]
    pairs = [(1, 2), (1, 3), (1, 4), (1, 5), (2, 3), (2, 4), (5, 6)]
    chain = EventChain(rows, pairs, names={6: None, 1: "hand"})
    # Row (2, 3) never changes; a name that is not known is no fragment.
    touching, comes = "touching", "comes or goes"
    assert kinds_of_rows(chain) == [touching, comes, comes, touching, touching, "fragment"]


def test_kinds_are_summed_by_type() -> None:
    one, two = EventChain([[0, 2]], [(1, 2)]), EventChain([[0, 9], [9, 2]], [(1, 2), (1, 3)])
    table = row_kind_table({"a": one, "b": two, "c": one}, {"a": "put", "b": "take", "c": "put"})
    assert table.index.tolist() == ["put", "take", "all"]
    assert table["touching"].tolist() == [2, 0, 2]
    assert table["comes or goes"].tolist() == [0, 2, 2]
    assert table["fragment"].tolist() == [0, 0, 0]


def test_a_chain_without_type_is_refused() -> None:
    with pytest.raises(ValueError, match="got none for 'a'"):
        row_kind_table({"a": EventChain([[0, 2]], [(1, 2)])}, {})
    with pytest.raises(ValueError, match="chains: expected at least one"):
        row_kind_table({}, {})
