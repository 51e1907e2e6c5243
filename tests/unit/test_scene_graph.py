import pickle
from collections.abc import Iterator
from itertools import combinations, permutations, product

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.relations import SegmentRelations
from sec_lab.scene_graph import (
    Comparison,
    MainGraphs,
    SceneGraph,
    as_key_frames,
    main_graphs,
    same_spectrum,
    scene_graph,
    to_networkx,
)

O, T = Relation.OVERLAPPING, Relation.TOUCHING  # noqa: E741
METHODS: tuple[Comparison, ...] = ("relations", "spectrum", "eigenvalues")


def by_method(*expected: list[int]) -> list[tuple[Comparison, list[int]]]:
    """What the relations, the spectrum and the eigenvalues alone should find."""
    return list(zip(METHODS, expected, strict=True))


def graph_of(segments: list[int], edges: dict[tuple[int, int], int]) -> SceneGraph:
    """Scene graph of its edges, all other pairs non-touching."""
    relations = np.zeros((len(segments), len(segments)), dtype=int)
    for (i, j), code in edges.items():
        a, b = segments.index(i), segments.index(j)
        relations[a, b] = relations[b, a] = code
    return SceneGraph(segments, relations)


@st.composite
def adjacencies(draw: st.DrawFn, *, n: int) -> NDArray[np.int64]:
    upper = np.zeros((n, n), dtype=np.int64)
    upper[np.triu_indices(n, k=1)] = draw(
        st.lists(st.integers(0, 2), min_size=n * (n - 1) // 2, max_size=n * (n - 1) // 2)
    )
    return upper + upper.T


class TestSceneGraph:
    def test_edges_are_what_touches_or_overlaps(self) -> None:
        graph = graph_of([7, 1, 4], {(7, 1): T, (1, 4): O})
        assert graph.edges() == [(1, 4, O), (1, 7, T)]
        assert graph_of([1, 2], {}).edges() == []

    def test_types_follow_their_segments(self) -> None:
        graph = SceneGraph([9, 2, 5], np.zeros((3, 3)), types=["nine", "two", "five"])
        assert graph.segments.tolist() == [2, 5, 9]
        assert graph.types == ("two", "five", "nine")

    def test_types_survive_a_pickle(self) -> None:
        graph = SceneGraph([9, 2], np.zeros((2, 2)), types=["nine", "two"])
        assert pickle.loads(pickle.dumps(graph)).types == ("two", "nine")

    @pytest.mark.parametrize("types", [["cup"], ["cup", "lid", "hand"], "ab", ["cup", 3], ["cup", None], []])
    def test_bad_types(self, types: object) -> None:
        for make in (
            lambda: SceneGraph([1, 2], np.zeros((2, 2)), types=types),  # type: ignore[arg-type]
            lambda: scene_graph(SegmentRelations([1, 2], np.zeros((2, 2))), types=types),  # type: ignore[arg-type]
        ):
            with pytest.raises(ValueError, match="types: expected 2 names, one a segment, got"):
                make()

    def test_same_relations(self) -> None:
        graph = graph_of([1, 2, 3], {(1, 2): T})
        moved = SceneGraph(graph.segments, graph.relations, [[0, 0], [5, 5], [9, 9]], ["a", "b", "c"])
        assert graph.same_relations(moved)
        assert not graph.same_relations(graph_of([1, 2, 3], {(1, 2): O}))
        assert not graph.same_relations(graph_of([1, 2, 4], {(1, 2): T}))
        assert not graph.same_relations(graph_of([1, 2], {(1, 2): T}))

    def test_networkx(self) -> None:
        drawn = to_networkx(graph_of([7, 1, 4], {(7, 1): T, (1, 4): O}))
        assert sorted(drawn) == [1, 4, 7]
        assert {frozenset(edge): data["relation"] for *edge, data in drawn.edges(data=True)} == {
            frozenset((1, 7)): T,
            frozenset((1, 4)): O,
        }


class TestFromRelations:
    found = SegmentRelations([9, 2], [[0, 1], [1, 0]], [[9, 0], [2, 0]])

    def test_keeps_what_was_found(self) -> None:
        graph = scene_graph(self.found)
        assert graph.edges() == [(2, 9, O)]
        np.testing.assert_array_equal(graph.positions, [[2, 0], [9, 0]])
        assert graph.types is None

    def test_types_are_in_the_order_of_the_relations(self) -> None:
        assert scene_graph(self.found, types=["two", "nine"]).types == ("two", "nine")

    def test_scene_graph_stays_what_it_is(self) -> None:
        graph = scene_graph(self.found, types=["two", "nine"])
        assert scene_graph(graph) is graph
        assert scene_graph(graph, types=["a", "b"]).types == ("a", "b")


class TestMainGraphs:
    @pytest.mark.parametrize("method", METHODS)
    def test_only_changes_are_kept(self, method: Comparison) -> None:
        apart, touching = graph_of([1, 2, 3], {}), graph_of([1, 2, 3], {(1, 2): T})
        found = main_graphs([apart, apart, touching, touching, apart], method=method)
        assert found.key_frames.tolist() == [0, 2, 4]
        assert [len(graph.edges()) for graph in found] == [0, 1, 0]
        assert len(found) == 3

    @pytest.mark.parametrize("method", METHODS)
    def test_motion_is_no_change(self, method: Comparison) -> None:
        first = SceneGraph([1, 2], [[0, 2], [2, 0]], [[0, 0], [1, 1]])
        moved = SceneGraph([1, 2], [[0, 2], [2, 0]], [[5, 5], [9, 9]])
        found = main_graphs([first, moved], method=method)
        assert found.key_frames.tolist() == [0]
        assert found.graphs[0] is first

    @pytest.mark.parametrize("method", METHODS)
    def test_segment_that_comes_or_goes_is_a_change(self, method: Comparison) -> None:
        two, three = graph_of([1, 2], {(1, 2): T}), graph_of([1, 2, 3], {(1, 2): T})
        assert main_graphs([two, three, three, two], method=method).key_frames.tolist() == [0, 1, 3]

    @pytest.mark.parametrize("method", METHODS)
    def test_change_is_seen_against_the_last_main_graph(self, method: Comparison) -> None:
        apart, touching = graph_of([1, 2], {}), graph_of([1, 2], {(1, 2): T})
        assert main_graphs([apart, touching, apart, touching], method=method).key_frames.tolist() == [0, 1, 2, 3]

    @pytest.mark.parametrize(("method", "expected"), by_method([0, 1], [0], [0]))
    def test_touching_that_turns_into_overlapping(self, method: Comparison, expected: list[int]) -> None:
        """An edge stands for either, so the spectrum misses it."""
        graphs = [graph_of([1, 2, 3], {(1, 2): code, (1, 3): O}) for code in (T, O)]
        assert main_graphs(graphs, method=method).key_frames.tolist() == expected

    @pytest.mark.parametrize(("method", "expected"), by_method([0, 1], [0, 1], [0]))
    def test_edge_that_goes_when_another_comes(self, method: Comparison, expected: list[int]) -> None:
        """Object 3 goes over from 1 to 2 in one step: a path before and after, only its middle is another."""
        graphs = [graph_of([1, 2, 3], {(1, 2): O, (1, 3): T}), graph_of([1, 2, 3], {(1, 2): O, (2, 3): T})]
        assert main_graphs(graphs, method=method).key_frames.tolist() == expected

    @pytest.mark.parametrize(("method", "expected"), by_method([0, 1], [0, 1], [0]))
    def test_cospectral_graphs(self, method: Comparison, expected: list[int]) -> None:
        """The star K₁,₄ and the square with a node apart have eigenvalues ±2, 0, 0, 0, but are no renaming."""
        star = graph_of([1, 2, 3, 4, 5], {(1, 2): T, (1, 3): T, (1, 4): T, (1, 5): T})
        square = graph_of([1, 2, 3, 4, 5], {(1, 2): T, (2, 3): T, (3, 4): T, (1, 4): T})
        assert not nx.is_isomorphic(to_networkx(star), to_networkx(square))
        assert main_graphs([star, square], method=method).key_frames.tolist() == expected

    @pytest.mark.parametrize(("method", "expected"), by_method([0, 1], [0], [0]))
    def test_segment_that_takes_the_place_of_another(self, method: Comparison, expected: list[int]) -> None:
        graphs = [graph_of([1, 2, 3], {(1, 3): T}), graph_of([1, 2, 4], {(1, 4): T})]
        assert main_graphs(graphs, method=method).key_frames.tolist() == expected

    def test_no_segment_at_all(self) -> None:
        nothing = SceneGraph([], np.zeros((0, 0)))
        for method in METHODS:
            assert main_graphs([nothing, nothing], method=method).key_frames.tolist() == [0]

    def test_frame_numbers(self) -> None:
        apart, touching = graph_of([1, 2], {}), graph_of([1, 2], {(1, 2): T})
        assert main_graphs([apart, apart, touching], frames=iter([10, 15, 20, 25])).key_frames.tolist() == [10, 20]

    def test_graphs_are_read_one_by_one(self) -> None:
        read = 0

        def stream() -> Iterator[SceneGraph]:
            nonlocal read
            for read in range(1000):
                yield graph_of([1, 2], {(1, 2): T} if read == 500 else {})

        assert main_graphs(stream()).key_frames.tolist() == [0, 500, 501]
        assert read == 999

    def test_record_is_protected_also_after_a_pickle(self) -> None:
        found = main_graphs([graph_of([1, 2], {})])
        for record in (found, pickle.loads(pickle.dumps(found))):
            assert record.key_frames.tolist() == [0]
            assert not record.key_frames.flags.writeable
            assert not record.graphs[0].relations.flags.writeable

    @pytest.mark.parametrize(
        ("graphs", "options", "message"),
        [
            ([], {}, "main graphs: expected at least one scene graph, got none"),
            ([graph_of([1], {})] * 2, {"frames": [4]}, "frames: expected a number for every graph, got 1 numbers"),
            ([graph_of([1], {})], {"frames": [0.5]}, "key frames: expected whole numbers, got 0.5"),
            ([graph_of([1], {}), graph_of([2], {})], {"frames": [4, 4]}, "ascending frame numbers, got 4 before 4"),
            ([graph_of([1], {})], {"method": "size"}, "method: expected 'relations', 'spectrum' or 'eigenvalues'"),
        ],
    )
    def test_bad_input(self, graphs: list[SceneGraph], options: dict[str, object], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            main_graphs(graphs, **options)  # type: ignore[arg-type]

    @pytest.mark.parametrize(
        ("key_frames", "message"),
        [
            ([0], "key frames: expected 2 frame numbers, got 1"),
            ([0, 0], "expected ascending frame numbers, got 0 before 0"),
            ([5, 3], "expected ascending frame numbers, got 5 before 3"),
            ([0, np.nan], "key frames: expected whole numbers, got nan"),
            ([[0, 1]], "key frames: expected 1 dimensions"),
            ([0, "1"], "key frames: expected numbers"),
        ],
    )
    def test_bad_key_frames(self, key_frames: object, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            MainGraphs([graph_of([1], {})] * 2, key_frames)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match=message):
            as_key_frames(key_frames, n=2)  # type: ignore[arg-type]


class TestSpectrum:
    @given(st.integers(0, 8).flatmap(lambda n: st.tuples(adjacencies(n=n), adjacencies(n=n))))
    def test_with_eigenvectors_it_tells_adjacencies_apart(self, pair: tuple[NDArray[np.int64], ...]) -> None:
        a, b = (SceneGraph(np.arange(len(codes)), codes) for codes in pair)
        assert same_spectrum(a, b) == np.array_equal(pair[0] > 0, pair[1] > 0)

    @given(st.integers(2, 8).flatmap(lambda n: st.tuples(adjacencies(n=n), st.permutations(range(n)))))
    def test_renamed_nodes(self, drawn: tuple[NDArray[np.int64], list[int]]) -> None:
        """Renaming keeps the eigenvalues; the eigenvectors see it unless the adjacency is the same."""
        codes, order = drawn
        renamed = codes[np.ix_(order, order)]
        a, b = SceneGraph(range(len(codes)), codes), SceneGraph(range(len(codes)), renamed)  # type: ignore[arg-type]
        assert same_spectrum(a, b, eigenvectors=False)
        assert same_spectrum(a, b) == np.array_equal(codes > 0, renamed > 0)

    @given(st.integers(0, 7).flatmap(lambda n: st.tuples(adjacencies(n=n), adjacencies(n=n))))
    def test_eigenvalues_are_equal_as_the_closed_walks_are(self, pair: tuple[NDArray[np.int64], ...]) -> None:
        """Numbers of closed walks of 1 to n steps determine the eigenvalues, in whole numbers (Newton's identities)."""

        def walks(codes: NDArray[np.int64]) -> list[int]:
            edges = (codes > 0).astype(np.int64)
            return [int(np.trace(np.linalg.matrix_power(edges, k))) for k in range(1, len(edges) + 1)]

        a, b = (SceneGraph(np.arange(len(codes)), codes) for codes in pair)
        assert same_spectrum(a, b, eigenvectors=False) == (walks(pair[0]) == walks(pair[1]))

    def test_how_often_eigenvalues_alone_miss_a_swap_of_edges(self) -> None:
        """In 55 % of all cases at four labelled nodes; with eigenvectors in none."""
        pairs = list(combinations(range(1, 5), 2))
        missed = total = 0
        for present in product((False, True), repeat=len(pairs)):
            edges = {pair: int(T) for pair, is_edge in zip(pairs, present, strict=True) if is_edge}
            before = graph_of([1, 2, 3, 4], edges)
            for gone, new in permutations(pairs, 2):
                if gone in edges and new not in edges:
                    after = graph_of([1, 2, 3, 4], {pair: int(T) for pair in (edges.keys() - {gone}) | {new}})
                    assert not same_spectrum(before, after)
                    missed += same_spectrum(before, after, eigenvectors=False)
                    total += 1
        assert missed / total == 0.55

    def test_size_is_compared_first(self) -> None:
        assert not same_spectrum(graph_of([1, 2], {}), graph_of([1, 2, 3], {}))
