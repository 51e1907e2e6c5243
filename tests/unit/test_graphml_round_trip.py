"""Observations written to GraphML and read again."""

from pathlib import Path
from tempfile import TemporaryDirectory

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from networkx.readwrite.graphml import GraphMLReader

import sec_lab as sl
from sec_lab.codes import WORD_OF, Relation
from sec_lab.files import UnusableFileError
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph
from tests.written_graphml import DIALECTS, POSITIONS, SEEN, assert_same, figure_a2

N, O, T = Relation.NON_TOUCHING, Relation.OVERLAPPING, Relation.TOUCHING  # noqa: E741


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "chain.graphml"


words = st.text(
    st.one_of(
        st.characters(exclude_categories=["Cc", "Cs"], exclude_characters="\ufffe\uffff"), st.sampled_from("\t\n\r")
    ),
    max_size=6,
)

coordinates = st.floats(allow_nan=False, allow_infinity=False)

labels = st.one_of(st.integers(0, 9), st.integers(-(2**63), 2**63 - 1))


@st.composite
def scene_graphs(draw: st.DrawFn) -> SceneGraph:
    segments = draw(st.lists(labels, max_size=5, unique=True))
    n = len(segments)
    codes = np.zeros((n, n), dtype=np.uint8)
    upper = np.triu_indices(n, k=1)
    codes[upper] = draw(st.lists(st.integers(0, 2), min_size=len(upper[0]), max_size=len(upper[0])))
    dimension = draw(st.sampled_from([0, 2, 3])) if n else 0
    point = st.lists(coordinates, min_size=dimension, max_size=dimension)
    positions = draw(st.lists(point, min_size=n, max_size=n)) if dimension else None
    kinds = st.lists(st.one_of(words, st.sampled_from(["Cup", "Unknown", "null"])), min_size=n, max_size=n)
    return SceneGraph(segments, codes + codes.T, positions, draw(st.none() | kinds) if n else None)


@st.composite
def observations(draw: st.DrawFn) -> Observation:
    frames = sorted(draw(st.sets(st.integers(-5, 2**62), min_size=1, max_size=4)))
    graphs = draw(st.lists(st.none() | scene_graphs(), min_size=len(frames), max_size=len(frames)))
    seen = [segment for graph in graphs if graph is not None for segment in graph.segments.tolist()]
    some = st.one_of(labels, st.sampled_from(seen)) if seen else labels
    names = draw(st.dictionaries(some, st.none() | words.filter(lambda name: name != "null"), max_size=6))
    return Observation(graphs, frames, names, draw(st.sampled_from(["px", "m", "unknown"])))


@pytest.mark.parametrize("dialect", DIALECTS)
@settings(deadline=None)
@given(seen=observations())
def test_round_trip(dialect: str, seen: Observation) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "chain.graphml"
        sl.graphml.write(path, seen, dialect=dialect)  # type: ignore[arg-type]
        assert_same(sl.graphml.read(path), seen)
        assert [path.name for path in Path(folder).iterdir()] == ["chain.graphml"]


@settings(deadline=None)
@given(seen=observations())
def test_networkx_opens_standard_graphml(seen: Observation) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "chain.graphml"
        sl.graphml.write(path, seen, dialect="standard")
        first = nx.read_graphml(path, node_type=int)
        all_graphs = list(GraphMLReader(node_type=int)(path=path))
    assert nx.utils.graphs_equal(first, all_graphs[0])
    assert len(all_graphs) == len(seen.graphs)
    for drawn, graph, number in zip(all_graphs, seen.graphs, seen.key_frames.tolist(), strict=True):
        assert not drawn.is_directed()
        assert drawn.graph["key_frame"] == number
        assert drawn.graph["recorded"] is (graph is not None)
        assert drawn.graph["position_unit"] == seen.position_unit
        expected = [] if graph is None else graph.edges()
        assert sorted((min(i, j), max(i, j)) for i, j in drawn.edges) == [(i, j) for i, j, _ in expected]
        for i, j, relation in expected:
            assert drawn.edges[i, j]["relation"] == WORD_OF[relation]
        assert sorted(drawn.nodes) == ([] if graph is None else graph.segments.tolist())
        if graph is not None and graph.positions is not None:
            for segment, position in zip(graph.segments.tolist(), graph.positions.tolist(), strict=True):
                assert [drawn.nodes[segment][axis] for axis in "xyz"[: len(position)]] == position


def test_networkx_sees_names_and_types(file: Path) -> None:
    graph = SceneGraph([1, 2], [[0, 1], [1, 0]], [[0.5, 1], [2, 3]], ["Box", "Unknown"])
    sl.graphml.write(file, Observation([graph], [53], {1: "red box", 2: None}), dialect="standard")
    drawn = nx.read_graphml(file)
    assert dict(drawn.nodes(data=True)) == {
        "1": {"name": "red box", "type": "Box", "x": 0.5, "y": 1.0},
        "2": {"fragment": True, "type": "Unknown", "x": 2.0, "y": 3.0},
    }
    assert list(drawn.edges(data=True)) == [("1", "2", {"relation": "Overlapping"})]
    assert 'id="key_frame_53"' in file.read_text()


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("name", ["", " a ", "a\r\nb", "a\tb", "<a> & 'b' \"c\" ]]>", "\x85\u2028", "Schüssel", "🥄"])
def test_names_survive_to_the_letter(file: Path, dialect: str, name: str) -> None:
    graph = SceneGraph([1], [[0]], types=[name])
    seen = Observation([graph], [4], {1: name, 7: name})
    sl.graphml.write(file, seen, dialect=dialect)  # type: ignore[arg-type]
    assert_same(sl.graphml.read(file), seen)


def test_sample_of_the_thesis_is_written_as_printed(file: Path) -> None:
    file.write_text(figure_a2(closed=True))
    seen = sl.graphml.read(file)
    sl.graphml.write(file, seen)
    written = file.read_text()
    for values in POSITIONS.values():
        for value in {str(number) for position in values for number in position}:
            written = written.replace(f'"{value}.0"', f'"{value}"')
    assert written == figure_a2(closed=True)


def test_everything_absent_is_not_the_same_as_not_recorded(file: Path) -> None:
    nothing = SceneGraph([], np.zeros((0, 0)))
    sl.graphml.write(file, Observation([None, nothing], [1, 2]))
    graphs = sl.graphml.read(file).graphs
    assert graphs[0] is None
    assert graphs[1] is not None


# Standard GraphML that is not ours


def test_only_observations_are_written(file: Path) -> None:
    with pytest.raises(TypeError, match="expected an Observation or an ActionModel, got EventChain"):
        sl.graphml.write(file, SEEN.chain)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="dialect: expected one of"):
        sl.graphml.write(file, SEEN, dialect="yed")  # type: ignore[arg-type]
    assert not file.exists()


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("wrong", ["\x00", "a\x1bb", "\ud800", "\uffff"])
@pytest.mark.parametrize("place", ["type", "name", "unseen name"])
def test_characters_that_xml_cannot_hold(file: Path, dialect: str, wrong: str, place: str) -> None:
    graph = SceneGraph([1], [[0]], types=[wrong if place == "type" else "Cup"])
    names = {} if place == "type" else {1 if place == "name" else 7: wrong}
    file.write_text("as before")
    with pytest.raises(ValueError, match="expected characters that XML can hold"):
        sl.graphml.write(file, Observation([graph], [4], names), dialect=dialect)  # type: ignore[arg-type]
    assert file.read_text() == "as before"


def test_a_name_null_cannot_be_told_from_no_object(file: Path) -> None:
    seen = Observation(SEEN.graphs, SEEN.key_frames, {1: "null"})
    with pytest.raises(ValueError, match="name of segment 1: expected any name but 'null'"):
        sl.graphml.write(file, seen)
    assert not file.exists()
    sl.graphml.write(file, seen, dialect="standard")
    assert_same(sl.graphml.read(file), seen)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_nothing_is_left_where_writing_fails(tmp_path: Path, dialect: str) -> None:
    taken = tmp_path / "taken.graphml"
    taken.mkdir()
    for path, said in [(tmp_path / "none" / "chain.graphml", "there is no folder"), (taken, "this is a directory")]:
        with pytest.raises(UnusableFileError, match=said):
            sl.graphml.write(path, SEEN, dialect=dialect)  # type: ignore[arg-type]
    assert list(tmp_path.rglob("*")) == [taken]


# Tables
