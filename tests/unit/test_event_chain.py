import copy
import pickle
from collections.abc import Callable, Iterator
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sec_lab.event_chain import EventChain, as_names, event_chain
from sec_lab.scene_graph import MainGraphs, SceneGraph, main_graphs
from tests.naive_event_chain import NaiveGraph, naive_compressed, naive_derived, naive_main_frames, naive_rows

# Sample action 1 (Fig. 2.5): green background 1, vessels 2 and 3, object 4. Table 2.2 (b) gives the rows that change.
MOVING_OBJECT = {(2, 1): "12111", (3, 1): "11121", (4, 1): "02120", (3, 2): "00000", (4, 2): "12000", (4, 3): "00021"}


def graphs_of(rows: dict[tuple[int, int], str]) -> list[SceneGraph]:
    """The main graphs that a table stands for, if no segment is ever absent."""
    segments = sorted({label for pair in rows for label in pair})
    graphs = []
    for column in zip(*rows.values(), strict=True):
        relations = np.zeros((len(segments), len(segments)), dtype=int)
        for (i, j), code in zip(rows, column, strict=True):
            a, b = segments.index(i), segments.index(j)
            relations[a, b] = relations[b, a] = int(code)
        graphs.append(SceneGraph(segments, relations))
    return graphs


def rows_of(chain: EventChain) -> dict[tuple[int, ...], str]:
    return {
        tuple(pair): "".join(map(str, row)) for pair, row in zip(chain.pairs.tolist(), chain.relations, strict=True)
    }


class TestWorkedExample:
    """The artificial *Moving Object* of §2.5."""

    def test_original_chain(self) -> None:
        chain = event_chain(graphs_of(MOVING_OBJECT))
        assert chain.pairs.tolist() == [[2, 1], [3, 1], [4, 1], [3, 2], [4, 2], [4, 3]]
        assert rows_of(chain) == MOVING_OBJECT
        assert chain.key_frames.tolist() == [0, 1, 2, 3, 4]
        assert chain.segments.tolist() == [1, 2, 3, 4]

    def test_derivative_drops_the_row_in_which_nothing_happens(self) -> None:
        chain = event_chain(graphs_of(MOVING_OBJECT))
        assert chain.pairs[chain.changing_rows].tolist() == [[2, 1], [3, 1], [4, 1], [4, 2], [4, 3]]
        assert chain.derived.tolist() == [
            [12, 21, 11, 11],
            [11, 11, 12, 21],
            [2, 21, 12, 20],
            [12, 20, 0, 0],
            [0, 0, 2, 21],
        ]

    def test_compressed_chain(self) -> None:
        compressed = event_chain(graphs_of(MOVING_OBJECT)).compressed
        assert [row.tolist() for row in compressed] == [[12, 21], [12, 21], [2, 21, 12, 20], [12, 20], [2, 21]]

    def test_frames_between_leave_no_trace(self) -> None:
        """92 frames, 5 main graphs."""
        lengths = (20, 9, 30, 11, 22)
        long = [graph for graph, n in zip(graphs_of(MOVING_OBJECT), lengths, strict=True) for _ in range(n)]
        assert len(long) == 92
        chain = event_chain(long)
        assert rows_of(chain) == MOVING_OBJECT
        assert chain.key_frames.tolist() == [0, 20, 29, 59, 70]


@st.composite
def sequences(draw: st.DrawFn) -> list[NaiveGraph]:
    """Segments come and go and change their relations; a frame often looks like the one before."""
    labels = draw(st.lists(st.integers(-3, 40), min_size=2, max_size=5, unique=True))
    graphs: list[NaiveGraph] = []
    for _ in range(draw(st.integers(1, 8))):
        if graphs and draw(st.booleans()):
            graphs.append(graphs[-1])
            continue
        present = {label for label in labels if draw(st.integers(0, 3))}
        relations = {frozenset(pair): draw(st.integers(0, 2)) for pair in combinations(sorted(present), 2)}
        graphs.append((present, relations))
    return graphs


def scene_graph_of(graph: NaiveGraph) -> SceneGraph:
    segments = sorted(graph[0])
    codes = [graph[1].get(frozenset((i, j)), 0) for i in segments for j in segments]
    return SceneGraph(segments, np.reshape(codes, (len(segments), len(segments))))


class TestEventChain:
    @given(sequences())
    def test_as_naive(self, graphs: list[NaiveGraph]) -> None:
        rows = naive_rows(graphs)
        if not rows:
            with pytest.raises(ValueError, match="expected at least two segments"):
                event_chain(map(scene_graph_of, graphs))
            return
        chain = event_chain(map(scene_graph_of, graphs))
        frames = naive_main_frames(graphs)
        assert chain.key_frames.tolist() == frames
        assert chain.pairs.tolist() == [list(pair) for pair in rows]
        expected = {pair: "".join(row[frame] for frame in frames) for pair, row in rows.items()}
        assert rows_of(chain) == expected
        n = len(chain.segments)
        assert len(chain.pairs) == n * (n - 1) / 2  # Eq. 2.1
        changing = [row for row in expected.values() if set(row) != {row[0]}]
        assert chain.derived.tolist() == [[int(change) for change in naive_derived(row)] for row in changing]
        assert [row.tolist() for row in chain.compressed] == [
            [int(change) for change in naive_compressed(row)] for row in changing
        ]

    def test_changes_are_those_of_the_thesis(self) -> None:
        """§2.6.1 lists the twelve values that an entry of ξ_c can have."""
        chain = EventChain([[a, b] for a in (0, 1, 2, 9) for b in (0, 1, 2, 9)], [(i, 0) for i in range(1, 17)])
        changes = sorted(int(change) for row in chain.compressed for change in row)
        assert changes == [1, 2, 9, 10, 12, 19, 20, 21, 29, 90, 91, 92]
        assert chain.derived.dtype == np.uint8

    def test_segment_that_is_not_there_is_absent(self) -> None:
        alone, both = SceneGraph([3], [[0]]), SceneGraph([3, 5], [[0, 1], [1, 0]])
        assert rows_of(event_chain([alone, both, alone])) == {(5, 3): "919"}

    def test_main_graphs_keep_their_key_frames(self) -> None:
        graphs = graphs_of({(2, 1): "002"})
        assert event_chain(MainGraphs(graphs, [4, 7, 11])).key_frames.tolist() == [4, 7, 11]
        assert event_chain(main_graphs(graphs, frames=[4, 7, 11])).key_frames.tolist() == [4, 11]
        assert event_chain(graphs, frames=[4, 7, 11]).key_frames.tolist() == [4, 11]

    def test_method_of_step_three(self) -> None:
        graphs = graphs_of({(2, 1): "0221", (3, 1): "0002", (3, 2): "0020"})
        assert event_chain(graphs).key_frames.tolist() == [0, 1, 2, 3]
        assert event_chain(graphs, method="spectrum").key_frames.tolist() == [0, 1, 2, 3]
        assert event_chain(graphs, method="eigenvalues").key_frames.tolist() == [0, 1, 2]

    def test_graphs_may_be_a_stream(self) -> None:
        def stream() -> Iterator[SceneGraph]:
            yield from graphs_of(MOVING_OBJECT)

        assert rows_of(event_chain(stream(), names={4: "ball"})) == MOVING_OBJECT

    @pytest.mark.parametrize(
        ("graphs", "options", "message"),
        [
            ([], {}, "expected at least one scene graph, got none"),
            ([SceneGraph([1], [[0]])], {}, "event chain: expected at least two segments, got 1"),
            ([SceneGraph([], np.zeros((0, 0)))], {}, "event chain: expected at least two segments, got 0"),
            (graphs_of({(2, 1): "02"}), {"frames": [3]}, "frames: expected a number for every graph, got 1 numbers"),
            (graphs_of({(2, 1): "02"}), {"method": "colour"}, "method: expected"),
            (
                MainGraphs(graphs_of({(2, 1): "02"}), [0, 1]),
                {"frames": [3, 4]},
                "frames: expected none beside main graphs",
            ),
        ],
    )
    def test_bad_graphs(self, graphs: object, options: dict[str, object], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            event_chain(graphs, **options)  # type: ignore[arg-type]


class TestRecord:
    @staticmethod
    def chain() -> EventChain:
        return EventChain([[0, 2, 0], [9, 9, 1]], [(2, 1), (3, 1)], [5, 8, 13], {1: "table", 2: "cup", 3: None})

    def test_key_frames_are_counted_if_left_out(self) -> None:
        assert EventChain([[0, 2, 0]], [(2, 1)]).key_frames.tolist() == [0, 1, 2]

    def test_single_column(self) -> None:
        """A chain in which nothing happens can be looked at, but has no events."""
        chain = EventChain([[0], [2]], [(2, 1), (3, 1)])
        assert chain.changing_rows.shape == (0,)
        assert chain.derived.shape == (0, 0)
        assert chain.compressed == ()

    def test_no_change(self) -> None:
        chain = EventChain([[0, 0], [2, 2]], [(2, 1), (3, 1)])
        assert chain.derived.shape == (0, 1)
        assert chain.compressed == ()

    def test_arrays_are_copied(self) -> None:
        relations, pairs, frames = np.array([[0, 2]], np.uint8), np.array([[2, 1]]), np.array([3, 4])
        names = {1: "table"}
        chain = EventChain(relations, pairs, frames, names)
        relations[:], pairs[:], frames[:], names[1] = 1, 7, 0, "cup"
        assert rows_of(chain) == {(2, 1): "02"}
        assert chain.key_frames.tolist() == [3, 4]
        assert dict(chain.names) == {1: "table"}

    @pytest.mark.parametrize("again", [lambda c: c, lambda c: pickle.loads(pickle.dumps(c)), copy.deepcopy])
    def test_protected_also_after_a_copy(self, again: Callable[[EventChain], EventChain]) -> None:
        chain = again(self.chain())
        assert rows_of(chain) == {(2, 1): "020", (3, 1): "991"}
        assert chain.key_frames.tolist() == [5, 8, 13]
        assert dict(chain.names) == {1: "table", 2: "cup", 3: None}
        for array in (chain.relations, chain.pairs, chain.key_frames):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0
        with pytest.raises(TypeError):
            chain.names[1] = "lid"  # type: ignore[index]
        with pytest.raises(AttributeError):
            chain.relations = np.zeros((2, 3), np.uint8)  # type: ignore[misc]

    def test_row_labels(self) -> None:
        assert [self.chain().row_label(row) for row in (0, 1)] == ["cup, table", "3, table"]

    def test_frame_for_people(self) -> None:
        frame = self.chain().to_frame()
        assert frame.index.tolist() == ["cup, table", "3, table"]
        assert frame.columns.tolist() == [5, 8, 13]
        assert frame.to_numpy().tolist() == [[0, 2, 0], [9, 9, 1]]
        assert (frame.index.name, frame.columns.name) == ("pair", "key frame")

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"relations": []}, "relations: expected 2 dimensions"),
            ({"relations": [[]]}, r"expected at least one row and one column, got shape \(1, 0\)"),
            ({"relations": np.zeros((0, 3))}, r"expected at least one row and one column, got shape \(0, 3\)"),
            ({"relations": [0, 2]}, r"relations: expected 2 dimensions, got shape \(2,\)"),
            ({"relations": [[[0, 2]]]}, "relations: expected 2 dimensions"),
            ({"relations": [[0, 2], [1]]}, "relations: expected a rectangular array of numbers, got ragged rows"),
            ({"relations": [[0, np.nan], [0, 0]]}, "relations: expected whole numbers, got nan"),
            ({"relations": [[0, 3], [0, 0]]}, "relations: expected codes 0, 1, 2 or 9, got 3"),
            ({"relations": [[0, -1], [0, 0]]}, "relations: expected codes 0, 1, 2 or 9, got -1"),
            ({"relations": [[0, 265], [0, 0]]}, "relations: expected codes 0, 1, 2 or 9, got 265"),
            ({"relations": [[0, 1.5], [0, 0]]}, "relations: expected whole numbers, got 1.5"),
            ({"relations": [["N", "T"], ["N", "N"]]}, "relations: expected numbers"),
            ({"relations": None}, "relations: expected numbers"),
            ({"pairs": [(2, 1)]}, r"pairs: expected shape \(2, 2\) for 2 rows, got \(1, 2\)"),
            ({"pairs": [(2, 1, 0), (3, 1, 0)]}, r"pairs: expected shape \(2, 2\) for 2 rows, got \(2, 3\)"),
            ({"pairs": [2, 1]}, "pairs: expected 2 dimensions"),
            ({"pairs": [(2, 1), (3,)]}, "pairs: .* ragged rows"),
            ({"pairs": [(2, 1), (2, 1)]}, r"pairs: expected each pair once, got \(1, 2\) twice"),
            ({"pairs": [(2, 1), (1, 2)]}, r"pairs: expected each pair once, got \(1, 2\) twice"),
            ({"pairs": [(2, 1), (3, 3)]}, r"pairs: expected two different segments, got \(3, 3\)"),
            ({"pairs": [(2, 1), (3, np.nan)]}, "pairs: expected whole numbers, got nan"),
            ({"pairs": [(2, 1), (3, 0.5)]}, "pairs: expected whole numbers, got 0.5"),
            ({"key_frames": [0]}, "key frames: expected 2 frame numbers, got 1"),
            ({"key_frames": [4, 4]}, "key frames: expected ascending frame numbers, got 4 before 4"),
            ({"key_frames": [4, 3]}, "key frames: expected ascending frame numbers, got 4 before 3"),
            ({"key_frames": [0, np.inf]}, "key frames: expected whole numbers, got inf"),
            ({"names": {1: 3.5}}, "names: expected text or None, got 3.5"),
            ({"names": {1.5: "cup"}}, "labels of names: expected whole numbers, got 1.5"),
            ({"names": {"1": "cup"}}, "labels of names: expected numbers"),
        ],
    )
    def test_bad_input(self, change: dict[str, object], message: str) -> None:
        good: dict[str, object] = {"relations": [[0, 2], [0, 0]], "pairs": [(2, 1), (3, 1)]}
        EventChain(**good)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match=message):
            EventChain(**(good | change))  # type: ignore[arg-type]


def test_names() -> None:
    assert dict(as_names(None)) == {}
    assert dict(as_names({np.int64(3): np.str_("cup"), 2.0: None})) == {3: "cup", 2: None}  # type: ignore[dict-item]
    assert all(type(label) is int for label in as_names({np.int64(3): "cup"}))  # type: ignore[dict-item]
