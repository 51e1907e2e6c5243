"""Relations by counting edges (§2.3)."""

from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sec_lab.codes import Relation
from sec_lab.relations import SegmentRelations, edge_count_relations, edge_counting
from sec_lab.scene_graph import SceneGraph

N, O, T = Relation.NON_TOUCHING, Relation.OVERLAPPING, Relation.TOUCHING  # noqa: E741


def seen(found: SegmentRelations) -> dict[tuple[int, int], Relation]:
    """Pairs that touch or overlap."""
    pairs = combinations(found.segments.tolist(), 2)
    return {(i, j): found.relation(i, j) for i, j in pairs if found.relation(i, j) is not N}


def test_object_on_the_rim() -> None:
    # Background 1, vessels 2 and 3, object 4 on the rim of 2 (second main graph of Fig. 2.5).
    graph = edge_counting([[0, 1, 1, 1], [1, 0, 0, 1], [1, 0, 0, 0], [1, 1, 0, 0]])
    assert seen(graph) == {(1, 2): T, (1, 4): T, (2, 4): T, (1, 3): O}


@pytest.mark.parametrize("relation", [T, O])
def test_edges_of_known_relations(relation: Relation) -> None:
    known = SegmentRelations([7, 9], [[0, relation], [relation, 0]], [[0, 0], [1, 1]])
    found = edge_counting(known)
    assert seen(found) == {(7, 9): O}
    np.testing.assert_array_equal(found.positions, known.positions)


def test_scene_graph_is_known_relations() -> None:
    graph = SceneGraph([1, 2, 3], [[0, 1, 1], [1, 0, 1], [1, 1, 0]], types=["cup", "table", "lid"])
    found = edge_counting(graph)
    assert seen(found) == {(1, 2): T, (1, 3): T, (2, 3): T}
    assert type(found) is SegmentRelations


def test_truth_values_are_an_adjacency() -> None:
    adjacency = np.array([[False, True], [True, False]])
    assert seen(edge_counting(adjacency)) == {(1, 2): O}


def test_no_edges() -> None:
    assert seen(edge_counting(np.zeros((3, 3), dtype=int))) == {}


@given(st.integers(1, 7), st.data())
def test_bridges_are_what_the_graph_falls_apart_without(n: int, data: st.DataObject) -> None:
    upper = np.triu(data.draw(hnp.arrays(np.int64, (n, n), elements=st.integers(0, 1))), k=1)
    relations = edge_counting(upper + upper.T).relations
    graph = nx.from_numpy_array(upper + upper.T)
    parts = nx.number_connected_components(graph)
    for i, j in np.ndindex(n, n):
        if not graph.has_edge(i, j):
            assert relations[i, j] == N
            continue
        without = graph.copy()
        without.remove_edge(i, j)
        assert relations[i, j] == (O if nx.number_connected_components(without) > parts else T)


def test_image() -> None:
    labels = np.ones((40, 40), dtype=np.uint8)
    labels[5:25, 5:25], labels[20:35, 10:20], labels[5:12, 30:37] = 2, 4, 3
    graph = edge_count_relations(labels)
    assert seen(graph) == {(1, 2): T, (1, 4): T, (2, 4): T, (1, 3): O}
    assert graph.positions is not None
    assert graph.positions[2].tolist() == [33, 8]  # segment 3


def test_touching_threshold() -> None:
    labels = np.ones((40, 40), dtype=np.uint8)
    labels[10:20, 10:20], labels[19:29, 20:30] = 2, 3  # one contact on 20 lines: 1 / 40
    assert edge_count_relations(labels, touching_threshold=0.02).relation(2, 3) is T
    assert edge_count_relations(labels, touching_threshold=0.03).relation(2, 3) is N


@pytest.mark.parametrize(
    ("adjacency", "message"),
    [
        ([[0, 2], [2, 0]], "adjacency: expected 0 or 1, got 2"),
        ([[0, 1], [0, 0]], r"adjacency: expected a symmetric matrix, got 1 for \(1, 2\) and 0 for \(2, 1\)"),
        ([[1, 0], [0, 0]], "adjacency: expected 0 on the diagonal, got 1"),
        ([[0, 1]], r"adjacency: expected shape \(1, 1\) for 1 segments, got \(1, 2\)"),
        ([0, 1], "adjacency: expected 2 dimensions"),
        ([[0, 1], [1]], "adjacency: .* ragged"),
        ([[0, np.nan], [np.nan, 0]], "adjacency: expected whole numbers, got nan"),
    ],
)
def test_bad_adjacency(adjacency: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        edge_counting(adjacency)  # type: ignore[arg-type]
