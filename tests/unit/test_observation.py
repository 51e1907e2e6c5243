import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sec_lab.event_chain import event_chain
from sec_lab.observation import Observation, without_fragments, without_segments
from sec_lab.scene_graph import SceneGraph


def graph_of(*segments: int, touching: tuple[int, int] | None = None) -> SceneGraph:
    """Segments at (label, 2 · label), of which two may touch."""
    n = len(segments)
    codes = [2 if touching and {i, j} == set(touching) else 0 for i in segments for j in segments]
    relations = np.reshape(codes, (n, n))
    positions = np.reshape([(label, 2 * label) for label in segments], (n, 2))
    return SceneGraph(segments, relations, positions, [f"type {label}" for label in segments])


APART, TOUCHING = graph_of(1, 2), graph_of(1, 2, touching=(1, 2))


class TestObservation:
    def test_chain_has_a_column_for_each_recorded_key_frame(self) -> None:
        seen = Observation([APART, None, TOUCHING, None], [4, 7, 9, 12], {1: "table"})
        assert seen.chain.relations.tolist() == [[0, 2]]
        assert seen.chain.key_frames.tolist() == [4, 9]
        assert dict(seen.chain.names) == {1: "table"}
        assert seen.recorded.key_frames.tolist() == [4, 9]

    def test_not_recorded_is_not_absent(self) -> None:
        nothing = SceneGraph([], np.zeros((0, 0)))
        assert Observation([APART, nothing, APART], [0, 1, 2]).chain.relations.tolist() == [[0, 9, 0]]
        assert Observation([APART, None, APART], [0, 1, 2]).chain.relations.tolist() == [[0, 0]]

    def test_key_frames_are_taken_as_they_are(self) -> None:
        """A key frame that a file lists is a column, whether or not a relation changed."""
        assert Observation([APART, APART], [0, 1]).chain.relations.tolist() == [[0, 0]]

    def test_segments(self) -> None:
        assert Observation([graph_of(5, 2), None, graph_of(9, 2)], [0, 1, 2]).segments.tolist() == [2, 5, 9]

    def test_nothing_recorded(self) -> None:
        seen = Observation([None, None], [0, 1])
        for look in (lambda: seen.recorded, lambda: seen.chain, lambda: seen.segments):
            with pytest.raises(ValueError, match="expected the content of a key frame, none of 2 has any"):
                look()

    def test_too_few_segments_for_a_chain(self) -> None:
        with pytest.raises(ValueError, match="event chain: expected at least two segments, got 1"):
            _ = Observation([graph_of(3)], [0]).chain

    @pytest.mark.parametrize("again", [lambda o: o, lambda o: pickle.loads(pickle.dumps(o)), copy.deepcopy])
    def test_protected_also_after_a_copy(self, again: Callable[[Observation], Observation]) -> None:
        frames, names = np.array([4, 7]), {1: "table", 2: None}
        seen = again(Observation([APART, None], frames, names, "m"))
        frames[:], names[1] = 0, "cup"
        assert seen.key_frames.tolist() == [4, 7]
        assert dict(seen.names) == {1: "table", 2: None}
        assert seen.position_unit == "m"
        (graph, missing) = seen.graphs
        assert missing is None
        assert graph is not None
        assert graph.types == APART.types
        np.testing.assert_array_equal(graph.positions, APART.positions)
        for array in (seen.key_frames, graph.segments, graph.relations, graph.positions):
            assert array is not None
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0
        with pytest.raises(TypeError):
            seen.names[1] = "lid"  # type: ignore[index]
        with pytest.raises(AttributeError):
            seen.position_unit = "px"  # type: ignore[misc]

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"graphs": [], "key_frames": []}, "observation: expected at least one key frame, got none"),
            ({"key_frames": [0]}, "key frames: expected 2 frame numbers, got 1"),
            ({"key_frames": [5, 5]}, "key frames: expected ascending frame numbers, got 5 before 5"),
            ({"key_frames": [5, 4]}, "key frames: expected ascending frame numbers, got 5 before 4"),
            ({"key_frames": [0, np.nan]}, "key frames: expected whole numbers, got nan"),
            ({"key_frames": [[0], [1, 2]]}, "key frames: .* ragged rows"),
            ({"position_unit": "mm"}, r"position_unit: expected one of \('px', 'm', 'unknown'\), got 'mm'"),
            ({"names": {1: 7}}, "names: expected text or None, got 7"),
            ({"names": {0.5: "cup"}}, "labels of names: expected whole numbers, got 0.5"),
        ],
    )
    def test_bad_input(self, change: dict[str, object], message: str) -> None:
        good: dict[str, object] = {"graphs": [APART, TOUCHING], "key_frames": [0, 1]}
        Observation(**good)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match=message):
            Observation(**(good | change))  # type: ignore[arg-type]


class TestWithoutSegments:
    def test_what_is_left(self) -> None:
        seen = Observation([graph_of(1, 2, 3, touching=(1, 3))], [6], {1: "table", 2: "cup"}, "px")
        left = without_segments(seen, [2])
        (graph,) = left.recorded
        assert graph.segments.tolist() == [1, 3]
        assert graph.relations.tolist() == [[0, 2], [2, 0]]
        assert graph.positions is not None
        assert graph.positions.tolist() == [[1, 2], [3, 6]]
        assert graph.types == ("type 1", "type 3")
        assert dict(left.names) == {1: "table"}
        assert left.position_unit == "px"
        assert left.key_frames.tolist() == [6]

    def test_key_frames_of_the_dropped_segment_alone_go(self) -> None:
        graphs = [
            graph_of(1, 2),
            graph_of(1, 2, 3),
            graph_of(1, 2, 3, touching=(1, 2)),
            graph_of(1, 2, touching=(1, 2)),
        ]
        left = without_segments(Observation(graphs, [0, 10, 20, 30]), [3])
        assert left.key_frames.tolist() == [0, 20]
        assert left.chain.relations.tolist() == [[0, 2]]

    def test_what_was_not_recorded_stays(self) -> None:
        seen = Observation([graph_of(1, 2, 3), None, graph_of(1, 2), None, graph_of(1, 2, touching=(1, 2))], range(5))
        left = without_segments(seen, [3])
        assert left.key_frames.tolist() == [0, 1, 3, 4]
        assert [graph is None for graph in left.graphs] == [False, True, True, False]

    def test_nothing_is_left(self) -> None:
        (graph,) = without_segments(Observation([graph_of(1, 2)], [0]), [1, 2]).recorded
        assert len(graph.segments) == 0

    def test_nothing_is_dropped(self) -> None:
        seen = Observation([APART, TOUCHING], [3, 5], {1: "table"})
        left = without_segments(seen, [])
        assert left.key_frames.tolist() == [3, 5]
        assert dict(left.names) == {1: "table"}

    @given(
        st.lists(st.tuples(st.sets(st.integers(1, 4)), st.booleans()), min_size=1, max_size=6), st.sampled_from([3, 4])
    )
    def test_chain_is_that_of_a_movie_without_the_segment(
        self, frames: list[tuple[set[int], bool]], dropped: int
    ) -> None:
        def movie(left_out: set[int]) -> list[SceneGraph]:
            return [graph_of(*sorted(there - left_out), touching=(1, 2) if touch else None) for there, touch in frames]

        everything = set().union(*(there for there, _ in frames))
        assume(dropped in everything and len(everything) >= 3)
        found = without_segments(Observation(movie(set()), range(len(frames))), [dropped]).chain
        expected = event_chain(movie({dropped}))
        assert found.pairs.tolist() == expected.pairs.tolist()
        assert found.relations.tolist() == expected.relations.tolist()
        assert found.key_frames.tolist() == expected.key_frames.tolist()

    @pytest.mark.parametrize(
        ("segments", "message"),
        [
            ([7], "segments: expected labels that were seen, got 7"),
            ([1, 7], "segments: expected labels that were seen, got 7"),
            ([1.5], "segments: expected whole numbers, got 1.5"),
            ([np.nan], "segments: expected whole numbers, got nan"),
            (["cup"], "segments: expected numbers"),
        ],
    )
    def test_bad_segments(self, segments: list[int], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            without_segments(Observation([APART], [0]), segments)


class TestWithoutFragments:
    def test_only_what_is_known_to_be_no_object_goes(self) -> None:
        seen = Observation([graph_of(1, 2, 3, 4)], [0], {2: None, 3: "cup", 4: None, 8: None})
        left = without_fragments(seen)
        assert left.segments.tolist() == [1, 3]
        assert dict(left.names) == {3: "cup", 8: None}

    def test_no_fragment(self) -> None:
        assert without_fragments(Observation([APART], [0], {1: "cup"})).segments.tolist() == [1, 2]
