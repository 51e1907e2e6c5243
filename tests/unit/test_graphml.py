"""GraphML of the thesis (A.2), standard GraphML and tables: read, written, refused."""

import logging
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
from sec_lab.graphml import assembly, markup
from sec_lab.graphml import dialect as thesis_dialect
from sec_lab.graphml import standard as standard_graphml
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph

DIALECTS = ("thesis", "standard")
N, O, T = Relation.NON_TOUCHING, Relation.OVERLAPPING, Relation.TOUCHING  # noqa: E741

# The numbers of Fig. A.2: a robot arm pushes a red box to a green box on a table.
SEGMENTS = {76: "Robot Arm", 226: "Red Box", 236: "Table", 248: "Green Box"}
KEY_FRAMES = [4, 39, 53, 63, 83, 117, 124]
POSITIONS = {
    53: [[137, 45, 101], [90, 50, 152], [72, 77, 178], [75, 98, 152]],
    63: [[128, 65, 102], [79, 71, 146], [74, 74, 178], [74, 99, 152]],
}
RELATIONS = {
    53: {(76, 226): T, (76, 236): N, (76, 248): N, (226, 236): T, (226, 248): N, (236, 248): O},
    63: {(76, 226): T, (76, 236): N, (76, 248): N, (226, 236): T, (226, 248): T, (236, 248): T},
}


def figure_a2(*, closed: bool) -> str:
    """Fig. A.2: as printed, its five folded key frames are left open; closed, they are empty elements."""
    lines = ["<?xml version='1.0' encoding='UTF-8'?>", "<GraphML>"]
    for frame in KEY_FRAMES:
        if frame not in POSITIONS:
            lines.append(f'  <KeyFrame ID="{frame}"{"/" if closed else ""}>')
            continue
        lines.append(f'  <KeyFrame ID="{frame}">')
        for (segment, name), (x, y, z) in zip(SEGMENTS.items(), POSITIONS[frame], strict=True):
            lines.append(f'    <Node pos_X="{x}" pos_Y="{y}" pos_Z="{z}" type="{name}" id="{segment}"/>')
        for (i, j), relation in RELATIONS[frame].items():
            lines.append(f'    <Edge target="{j}" relation="{WORD_OF[relation]}" source="{i}"/>')
        lines.append("  </KeyFrame>")
    return "\n".join([*lines, "</GraphML>", ""])


def document(*lines: str) -> str:
    return "\n".join(["<GraphML>", *lines, "</GraphML>"])


def frame(*content: str) -> str:
    return document('<KeyFrame ID="5">', *content, "</KeyFrame>")


def node(segment: object, more: str = "") -> str:
    return f'<Node id="{segment}" {more}/>'


def edge(i: object, j: object, relation: str = "Touching") -> str:
    return f'<Edge source="{i}" target="{j}" relation="{relation}"/>'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "chain.graphml"


def assert_same(a: Observation, b: Observation) -> None:
    """Equal in everything, positions to the last bit."""
    assert a.key_frames.tolist() == b.key_frames.tolist()
    assert a.names == b.names
    assert a.position_unit == b.position_unit
    for one, other in zip(a.graphs, b.graphs, strict=True):
        assert (one is None) == (other is None)
        if one is None or other is None:
            continue
        assert one.same_relations(other)
        assert one.types == other.types
        assert (one.positions is None) == (other.positions is None)
        if one.positions is not None and other.positions is not None:
            assert one.positions.shape == other.positions.shape
            assert one.positions.tobytes() == other.positions.tobytes()


def assert_refused(path: Path, *said: str) -> None:
    with pytest.raises(UnusableFileError) as refusal:
        sl.graphml.read(path)
    message = str(refusal.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    for words in said:
        assert words in message


# Fig. A.2


def test_closed_sample_of_the_thesis(file: Path) -> None:
    file.write_text(figure_a2(closed=True))
    seen = sl.graphml.read(file)
    assert seen.key_frames.tolist() == KEY_FRAMES
    assert [frame for frame, graph in zip(KEY_FRAMES, seen.graphs, strict=True) if graph is not None] == [53, 63]
    assert seen.names == SEGMENTS
    assert seen.position_unit == "unknown"
    for graph, number in zip(seen.recorded, (53, 63), strict=True):
        assert graph.segments.tolist() == list(SEGMENTS)
        assert graph.types == tuple(SEGMENTS.values())
        assert graph.positions is not None
        assert graph.positions.tolist() == POSITIONS[number]
        assert {pair: graph.relation(*pair) for pair in RELATIONS[number]} == RELATIONS[number]


def test_not_recorded_is_not_absent(file: Path) -> None:
    file.write_text(figure_a2(closed=True))
    chain = sl.graphml.read(file).chain
    assert chain.key_frames.tolist() == [53, 63]
    assert (chain.relations != Relation.ABSENT).all()


def test_printed_sample_is_refused(file: Path) -> None:
    file.write_text(figure_a2(closed=False))
    assert_refused(file, "well-formed", "mismatched tag")


@pytest.mark.parametrize(
    "encoded",
    [
        figure_a2(closed=True).replace("UTF-8", "UTF-16").encode("utf-16"),
        figure_a2(closed=True).encode("utf-8-sig"),
        figure_a2(closed=True).replace("UTF-8", "ISO-8859-1").encode("latin-1"),
    ],
    ids=["utf-16", "utf-8 with mark", "latin-1"],
)
def test_encodings(file: Path, encoded: bytes) -> None:
    file.write_bytes(encoded)
    assert sl.graphml.read(file).names == SEGMENTS
    assert sl.graphml.read_chain(file).key_frames.tolist() == [53, 63]


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_truncation_is_refused(file: Path, dialect: str) -> None:
    file.write_text(figure_a2(closed=True))
    whole = sl.graphml.read(file)
    sl.graphml.write(file, whole, dialect=dialect)  # type: ignore[arg-type]
    data = file.read_bytes()
    for end in {*range(0, len(data), 11), *range(len(data) - 30, len(data))}:
        file.write_bytes(data[:end])
        if data[end:].strip():
            assert_refused(file)
        else:
            assert_same(sl.graphml.read(file), whole)


# What the dialect says


def test_names_come_from_replace_object_alone(file: Path) -> None:
    objects = '<ReplaceObject><Object id="1" obj="Cup"/><Object id="2" obj="null"/></ReplaceObject>'
    file.write_text(document(objects, '<KeyFrame ID="1">', node(7, 'type="Table"'), "</KeyFrame>"))
    assert sl.graphml.read(file).names == {1: "Cup", 2: None}


def test_names_come_from_types_that_are_known_and_constant(file: Path) -> None:
    def key_frame(number: int, *types: str) -> str:
        nodes = [node(i, f'type="{name}"') for i, name in enumerate(types)]
        return f'<KeyFrame ID="{number}">{"".join([*nodes, edge(0, 1), edge(0, 2), edge(1, 2)])}</KeyFrame>'

    file.write_text(document(key_frame(1, "Cup", "Unknown", "Hand"), key_frame(2, "Cup", "Unknown", "Arm")))
    assert sl.graphml.read(file).names == {0: "Cup"}


def test_second_name_of_a_segment_counts_and_is_reported(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    objects = "".join(f'<Object id="{i}" obj="{name}"/>' for i, name in [(1, "Hand"), (2, "Cup"), (1, "Arm")])
    file.write_text(document(f"<ReplaceObject>{objects}</ReplaceObject>", '<KeyFrame ID="1"/>'))
    with caplog.at_level(logging.WARNING):
        assert sl.graphml.read(file).names == {1: "Arm", 2: "Cup"}
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "segment 1 is named 'Hand', then 'Arm'" in caplog.text


def test_missing_edges(file: Path) -> None:
    file.write_text(frame(node(1), node(2), node(3), edge(1, 2), edge(3, 2, "Overlapping")))
    assert_refused(file, "key frame 5", "none for (1, 3)")
    graph = sl.graphml.read(file, missing_edges="non-touching").graphs[0]
    assert graph is not None
    assert graph.edges() == [(1, 2, T), (2, 3, O)]
    with pytest.raises(ValueError, match="missing_edges: expected one of"):
        sl.graphml.read(file, missing_edges="absent")  # type: ignore[arg-type]


def test_one_node_needs_no_edge(file: Path) -> None:
    file.write_text(frame(node(1, 'pos_X="1" pos_Y="-2.5e-3"')))
    graph = sl.graphml.read(file).graphs[0]
    assert graph is not None
    assert graph.positions is not None
    assert graph.positions.tolist() == [[1.0, -0.0025]]
    assert graph.types is None


def test_attributes_of_other_namespaces_and_comments_are_passed_over(file: Path) -> None:
    text = frame("<!-- by hand -->", node(1), node(2, 'a:score="3"'), edge(1, 2))
    file.write_text(text.replace("<GraphML>", '<GraphML xmlns:a="urn:a" a:made="today">'))
    assert sl.graphml.read(file).chain.relations.tolist() == [[T]]


BAD = {
    "unknown relation": (frame(node(1), node(2), edge(1, 2, "Touch")), "key frame 5: edge (1, 2)", "'Touch'"),
    "absence": (frame(node(1), node(2), edge(1, 2, "Absence")), "key frame 5: edge (1, 2)", "absent segment"),
    "edge to no node": (frame(node(1), node(2), edge(1, 2), edge(1, 3)), "key frame 5: edge (1, 3)", "got 3"),
    "edges without nodes": (frame(edge(1, 2)), "key frame 5: edge (1, 2)"),
    "edge to itself": (frame(node(1), node(2), edge(1, 2), edge(2, 2)), "key frame 5: edge (2, 2)"),
    "edge twice": (frame(node(1), node(2), edge(1, 2), edge(2, 1)), "key frame 5: edge (1, 2)", "twice"),
    "node twice": (frame(node(1), node(1)), "key frame 5", "got 1 twice"),
    "position not a number": (frame(node(1, 'pos_X="a" pos_Y="1"')), "key frame 5: node 1, pos_X", "'a'"),
    "position nan": (frame(node(1, 'pos_X="1" pos_Y="nan"')), "node 1, pos_Y", "'nan'"),
    "position infinite": (frame(node(1, 'pos_X="1" pos_Y="1e999"')), "node 1, pos_Y", "'1e999'"),
    "position empty": (frame(node(1, 'pos_X="" pos_Y="1"')), "node 1, pos_X", "''"),
    "one coordinate": (frame(node(1, 'pos_X="1"')), "node 1", "pos_X"),
    "x and z": (frame(node(1, 'pos_X="1" pos_Z="1"')), "node 1", "got pos_X, pos_Z"),
    "some positions": (frame(node(1, 'pos_X="1" pos_Y="1"'), node(2), edge(1, 2)), "2 for 1 and 0 for 2"),
    "some types": (frame(node(1, 'type="Cup"'), node(2), edge(1, 2)), "got none for 2"),
    "segment not whole": (frame(node("1.5")), "node id", "'1.5'"),
    "segment too large": (frame(node(2**63)), "node id", str(2**63)),
    "segment very long": (frame(node("1" * 9999)), "node id", "1..."),
    "edge end not whole": (frame(node(1), node(2), edge(1, "b")), "edge target", "'b'"),
    "node without id": (frame("<Node/>"), "'id'"),
    "edge without relation": (frame(node(1), node(2), '<Edge source="1" target="2"/>'), "'relation'"),
    "key frame without ID": (document("<KeyFrame/>"), "'ID'"),
    "key frame not a number": (document('<KeyFrame ID="last"/>'), "key frame ID", "'last'"),
    "key frames descend": (document('<KeyFrame ID="9"/>', '<KeyFrame ID="5"/>'), "ascending", "9 before 5"),
    "key frame twice": (document('<KeyFrame ID="5"/>', '<KeyFrame ID="5"/>'), "ascending", "5 before 5"),
    "no key frame": (document(), "at least one key frame"),
    "unknown element": (document("<Trajectory/>"), "<Trajectory>"),
    "unknown element inside": (frame(node(1), "<Pose/>"), "<KeyFrame>", "<Pose>"),
    "element inside a node": (frame('<Node id="1"><Pose/></Node>'), "<Node>", "<Pose>"),
    "unknown attribute": (frame(node(1, 'angle="3"')), "<Node>", "'angle'"),
    "unknown attribute of the root": ('<GraphML version="2"><KeyFrame ID="5"/></GraphML>', "<GraphML>", "'version'"),
    "text in a key frame": (frame(node(1), "lost"), "<KeyFrame>", "'lost'"),
    "text before the first key frame": (document("lost", '<KeyFrame ID="5"/>'), "<GraphML>", "'lost'"),
    "text between key frames": (document('<KeyFrame ID="5"/>', "lost", '<KeyFrame ID="6"/>'), "<GraphML>", "'lost'"),
    "text at the end": (document('<KeyFrame ID="5"/>', "lost"), "<GraphML>", "'lost'"),
    "two lists of names": (document("<ReplaceObject/>", "<ReplaceObject/>"), "<ReplaceObject>", "two"),
    "object without name": (document('<ReplaceObject><Object id="1"/></ReplaceObject>'), "<Object>", "'obj'"),
    "object id": (document('<ReplaceObject><Object id="a" obj="b"/></ReplaceObject>'), "object id", "'a'"),
    "position unit": ('<GraphML position_unit="mm"><KeyFrame ID="5"/></GraphML>', "position_unit", "'mm'"),
    "recorded": (document('<KeyFrame ID="5" recorded="no"/>'), "key frame 5: recorded", "'no'"),
    "recorded, yet not": (document('<KeyFrame ID="5" recorded="false"><Node id="1"/></KeyFrame>'), "got false"),
    "another root": ("<html><KeyFrame ID='5'/></html>", "<GraphML>", "got <html>"),
    "graphml of no namespace": ("<graphml/>", "got <graphml> of no namespace"),
    "root in a namespace": ('<GraphML xmlns="urn:a"/>', "got <GraphML>"),
    "empty": ("", "it is empty"),
    "blank": ("  \n", "no element found"),
    "no XML": ("1\t2\t0\t1\n", "well-formed"),
    "two roots": ("<GraphML><KeyFrame ID='5'/></GraphML><GraphML/>", "junk after document element"),
    "unknown encoding": ("<?xml version='1.0' encoding='klingon'?><GraphML/>", "well-formed"),
    "many-byte encoding": ("<?xml version='1.0' encoding='gb2312'?><GraphML/>", "multi-byte"),
}


@pytest.mark.parametrize(("text", "said"), [(text, said) for text, *said in BAD.values()], ids=list(BAD))
def test_bad_content_is_one_clear_error(file: Path, text: str, said: list[str]) -> None:
    file.write_text(text)
    assert_refused(file, *said)


@pytest.mark.parametrize(
    "data",
    [b"\x1f\x8b\x08\x00\x00\x00\x00\x00", b"\x89PNG\r\n\x1a\n", bytes(range(256)), b"\xff\xfe<", b"<GraphML>\xff\xfe"],
    ids=["gzip", "png", "bytes", "half a letter", "no UTF-8"],
)
def test_binary_files_are_refused(file: Path, data: bytes) -> None:
    file.write_bytes(data)
    assert_refused(file)


def test_directory_and_missing_file_are_refused(tmp_path: Path) -> None:
    assert_refused(tmp_path, "this is a directory")
    assert_refused(tmp_path / "none.graphml", "there is no such file")


# Hostile files

LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
HOSTILE = {
    "billion laughs": f'<!DOCTYPE GraphML [<!ENTITY l0 "ha">{LAUGHS}]>{document("&l9;")}',
    "external entity": f'<!DOCTYPE GraphML [<!ENTITY e SYSTEM "SECRET">]>{document("&e;")}',
    "external document type": f'<!DOCTYPE GraphML SYSTEM "SECRET">{document()}',
    "parameter entity": f'<!DOCTYPE GraphML [<!ENTITY % e SYSTEM "SECRET"> %e;]>{document()}',
    "harmless document type": f"<!DOCTYPE GraphML>{document()}",
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=list(HOSTILE))
def test_document_types_and_entities_are_refused(file: Path, tmp_path: Path, text: str) -> None:
    secret = tmp_path / "secret"
    secret.write_text("do not tell")
    file.write_text(text.replace("SECRET", secret.as_uri()))
    with pytest.raises(UnusableFileError, match="expected no document type") as refusal:
        sl.graphml.read(file)
    assert "do not tell" not in str(refusal.value)


def test_undeclared_entity_is_refused(file: Path) -> None:
    file.write_text(document("&l9;"))
    assert_refused(file, "undefined entity")


@pytest.mark.parametrize("closed", [False, True])
def test_deep_nesting_is_refused(file: Path, closed: bool) -> None:
    file.write_text(document("<a>" * 300_000, "</a>" * 300_000 * closed))
    assert_refused(file, "nested at most")


def test_key_frame_with_too_many_elements_is_refused(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(markup, "MOST_ELEMENTS", 10)
    file.write_text(document(*(f'<KeyFrame ID="{i}">{node(1)}</KeyFrame>' for i in range(50))))
    assert len(sl.graphml.read(file).graphs) == 50
    file.write_text(frame(*(node(i) for i in range(11))))
    assert_refused(file, "at most 10 elements")


def test_small_file_cannot_ask_for_all_memory(file: Path) -> None:
    nodes = "".join(node(i) for i in range(9000))
    file.write_text(frame(nodes))
    with pytest.raises(UnusableFileError, match=f"at most {assembly.MOST_RELATIONS} relations"):
        sl.graphml.read(file, missing_edges="non-touching")
    assert_refused(file, "none for (0, 1)")


def test_all_key_frames_together_cannot_ask_for_all_memory(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    graph = SceneGraph([1, 2, 3], np.zeros((3, 3)))
    for dialect, reader in zip(DIALECTS, (thesis_dialect, standard_graphml), strict=True):
        sl.graphml.write(file, Observation([graph] * 4, range(4)), dialect=dialect)  # type: ignore[arg-type]
        monkeypatch.setattr(reader, "MOST_RELATIONS", 36)
        assert len(sl.graphml.read(file).graphs) == 4
        sl.graphml.write(file, Observation([graph] * 5, range(5)), dialect=dialect)  # type: ignore[arg-type]
        assert_refused(file, "key frame 4", "relations in one file")


def test_key_frames_are_forgotten_once_they_are_read() -> None:
    children = markup.elements(document(*(f'<KeyFrame ID="{i}"/>' for i in range(20_000))).encode())
    root = next(children)
    assert max(len(root) for _ in children) < 2_000


# Round trips

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

STANDARD_KEYS = "".join(
    f'<key id="{scope}_{name}" for="{scope}" attr.name="{name}" attr.type="string"/>'
    for scope, name in [
        ("graphml", "unseen_names"),
        ("graph", "key_frame"),
        ("graph", "recorded"),
        ("graph", "position_unit"),
        ("node", "name"),
        ("node", "fragment"),
        ("node", "x"),
        ("node", "z"),
        ("edge", "relation"),
    ]
)


def data(scope: str, name: str, value: str) -> str:
    return f'<data key="{scope}_{name}">{value}</data>'


def graph(number: int, *content: str, recorded: str = "true", unit: str = "px", direction: str = "undirected") -> str:
    about = data("graph", "key_frame", str(number)) + data("graph", "recorded", recorded)
    about += data("graph", "position_unit", unit)
    return f'<graph edgedefault="{direction}">{about}{"".join(content)}</graph>'


def standard(*content: str) -> str:
    return f'<graphml xmlns="http://graphml.graphdrawing.org/xmlns">{STANDARD_KEYS}{"".join(content)}</graphml>'


def test_standard_graphml_written_by_hand(file: Path) -> None:
    touching = f'<edge source="2" target="1">{data("edge", "relation", "Touching")}</edge>'
    named = f'<node id="1">{data("node", "name", "cup")}</node>'
    file.write_text(
        standard(
            data("graphml", "unseen_names", '{"7": null}'),
            graph(1, recorded="false"),
            graph(4, named, '<node id="2"/>', '<node id="3"/>', touching),
        )
    )
    seen = sl.graphml.read(file)
    assert seen.names == {1: "cup", 7: None}
    assert seen.graphs[0] is None
    assert seen.chain.relations.tolist() == [[T], [N], [N]]


NAMED = f'<node id="1">{data("node", "name", "cup")}</node>'
BAD_STANDARD = {
    "no graph": (standard(), "at least one key frame"),
    "directed": (standard(graph(1, direction="directed")), "'directed'"),
    "no key frame": (standard('<graph edgedefault="undirected"/>'), "'key_frame'"),
    "key frames descend": (standard(graph(2), graph(1)), "2 before 1"),
    "units differ": (standard(graph(1), graph(2, unit="m")), "m and px"),
    "unit unknown": (standard(graph(1, unit="mm")), "'mm'"),
    "recorded": (standard(graph(1, recorded="maybe")), "key frame 1: recorded", "'maybe'"),
    "content not recorded": (standard(graph(1, NAMED, recorded="false")), "key frame 1: recorded"),
    "undeclared key": (standard(graph(1, '<data key="d0">3</data>')), "'d0'"),
    "key of another kind": (standard(graph(1, data("node", "name", "3"))), "'node_name'"),
    "data twice": (standard(graph(1, data("graph", "recorded", "true"))), "'recorded' once"),
    "unknown key": (standard('<key id="d0" for="node" attr.name="colour"/>'), "'colour' for 'node'"),
    "key twice": (standard('<key id="node_x" for="node" attr.name="y"/>'), "'node_x' twice"),
    "names differ": (standard(graph(1, NAMED), graph(2, NAMED.replace("cup", "box"))), "key frame 2: node 1"),
    "name lost": (standard(graph(1, NAMED), graph(2, '<node id="1"/>')), "key frame 2: node 1"),
    "named fragment": (
        standard(graph(1, NAMED.replace("</node>", f"{data('node', 'fragment', 'true')}</node>"))),
        "key frame 1: node 1",
        "'cup'",
    ),
    "edge without relation": (
        standard(graph(1, NAMED, '<node id="2"/>', '<edge source="1" target="2"/>')),
        "key frame 1: edge (1, 2)",
    ),
    "x alone": (standard(graph(1, f'<node id="1">{data("node", "x", "1")}</node>')), "key frame 1: node 1", "got x"),
    "label no number": (standard(graph(1, '<node id="n0"/>')), "key frame 1: node id", "'n0'"),
    "ports": (standard(graph(1, '<node id="1"><port name="a"/></node>')), "<node>", "<port>"),
    "hyperedge": (standard("<hyperedge/>"), "<hyperedge>"),
    "unseen names no JSON": (standard(data("graphml", "unseen_names", "{7}"), graph(1)), "unseen_names", "'{7}'"),
    "unseen names a list": (standard(data("graphml", "unseen_names", "[7]"), graph(1)), "unseen_names", "'[7]'"),
    "unseen names deep": (standard(data("graphml", "unseen_names", "[" * 99999), graph(1)), "unseen_names"),
    "unseen name a number": (standard(data("graphml", "unseen_names", '{"7": 7}'), graph(1)), "unseen_names"),
    "unseen label": (standard(data("graphml", "unseen_names", '{"a": "b"}'), graph(1)), "unseen_names", "'a'"),
    "unseen twice": (standard(data("graphml", "unseen_names", '{"7": "b", "7": "c"}'), graph(1)), "got 7 twice"),
    "unseen, yet seen": (standard(data("graphml", "unseen_names", '{"1": "b"}'), graph(1, NAMED)), "got 1"),
}


@pytest.mark.parametrize(
    ("text", "said"), [(text, said) for text, *said in BAD_STANDARD.values()], ids=list(BAD_STANDARD)
)
def test_bad_standard_graphml_is_one_clear_error(file: Path, text: str, said: list[str]) -> None:
    file.write_text(text)
    assert_refused(file, *said)


# Writing

SEEN = Observation([SceneGraph([1, 2], [[0, 2], [2, 0]])], [4])


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


def test_table(tmp_path: Path) -> None:
    path = tmp_path / "SEC.dat"
    path.write_bytes(b"2\t3\t0\t1\t\n6\t2\t9\t0\t\n3\t6\t9\t9\t\n")
    chain = sl.graphml.read_table(path)
    assert chain.relations.tolist() == [[0, 2], [9, 0], [9, 9]]
    assert chain.pairs.tolist() == [[2, 3], [6, 2], [3, 6]]
    assert chain.key_frames.tolist() == [0, 1]
    assert chain.names == {}
    for variant in (b"2\t3\t0\t1\r\n6\t2\t9\t0\r\n3\t6\t9\t9", b"\xef\xbb\xbf2\t3\t0\t1\n6\t2\t9\t0\n3\t6\t9\t9\n\n"):
        path.write_bytes(variant)
        assert sl.graphml.read_table(path).relations.tolist() == chain.relations.tolist()
        assert sl.graphml.read_chain(path).pairs.tolist() == chain.pairs.tolist()


BAD_TABLES = {
    "ragged": ("2\t3\t0\t1\t\n2\t6\t0\t\n3\t6\t0\t1\t\n", ", line 2: ", "(2, 6): expected 2"),
    "overlapping": ("2\t3\t0\t2\t\n", ", line 1: ", "expected 0, 1 or 9, got '2'"),
    "word": ("2\t3\t0\tT\t\n", ", line 1: ", "'T'"),
    "gap": ("2\t3\t0\t\t1\t\n", ", line 1: ", "got ''"),
    "pair twice": ("2\t3\t0\t\n3\t2\t0\t\n", ", line 2: ", "(3, 2) again"),
    "itself": ("2\t2\t0\t\n", ", line 1: ", "(2, 2)"),
    "label": ("2\tb\t0\t\n", ", line 1: ", "'b'"),
    "no relation": ("2\t3\t\n", ", line 1: ", "separated by tabs"),
    "blank line": ("2\t3\t0\t\n\n2\t6\t0\t\n", ", line 2: ", "got ''"),
    "spaces": ("2 3 0 1\n", ", line 1: ", "separated by tabs"),
    "missing pair": ("2\t3\t0\t\n2\t6\t0\t\n", ": expected a row for every pair", "(3, 6)"),
    "single open row": ("2\t3\t0\t1", ", line 1: ", "truncated"),
    "empty": ("", ": ", "it is empty"),
    "blank": ("\n\n", ": ", "it is empty"),
}


@pytest.mark.parametrize(("text", "said"), [(text, said) for text, *said in BAD_TABLES.values()], ids=list(BAD_TABLES))
@pytest.mark.parametrize("reader", ["read_table", "read_chain"])
def test_bad_tables_are_one_clear_error(tmp_path: Path, reader: str, text: str, said: list[str]) -> None:
    path = tmp_path / "SEC.dat"
    path.write_text(text)
    with pytest.raises(UnusableFileError) as refusal:
        getattr(sl.graphml, reader)(path)
    message = str(refusal.value)
    assert message.startswith(f"{path}{said[0]}")
    assert said[1] in message
    assert "\n" not in message


def test_rows_may_be_left_out_on_request(tmp_path: Path) -> None:
    path = tmp_path / "SEC.dat"
    path.write_text("2\t3\t0\t\n2\t6\t1\t\n")
    assert sl.graphml.read_table(path, missing_pairs="omit").pairs.tolist() == [[2, 3], [2, 6]]
    with pytest.raises(ValueError, match="missing_pairs: expected one of"):
        sl.graphml.read_table(path, missing_pairs="absent")  # type: ignore[arg-type]


@pytest.mark.parametrize("data", [b"\x1f\x8b\x08\x00", b"\x89PNG\r\n"], ids=["gzip", "png"])
def test_binary_tables_are_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "SEC.dat").write_bytes(data)
    with pytest.raises(UnusableFileError, match="expected a table of relations, but it is no text"):
        sl.graphml.read_table(tmp_path / "SEC.dat")


def test_truncated_tables_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "SEC.dat"
    whole = "2\t3\t0\t1\t9\t\n2\t6\t9\t0\t0\t\n3\t6\t9\t9\t1\t\n"
    first_row = whole.index("\n") + 1
    for end in range(len(whole)):
        path.write_text(whole[:end])
        if not whole[end:].strip():
            assert sl.graphml.read_table(path).relations.tolist() == [[0, 2, 9], [9, 0, 0], [9, 9, 2]]
        elif end == first_row:
            # One whole row is a whole table of two segments; nothing tells that more was to come.
            assert sl.graphml.read_table(path).relations.tolist() == [[0, 2, 9]]
        else:
            with pytest.raises(UnusableFileError):
                sl.graphml.read_table(path)


# Chains and collections


def test_chain_is_read_by_content_whatever_the_name(tmp_path: Path) -> None:
    (tmp_path / "a.dat").write_text(figure_a2(closed=True))
    assert sl.graphml.read_chain(tmp_path / "a.dat").names == SEGMENTS
    (tmp_path / "b.graphml").write_text("1\t2\t0\t1\t\n")
    assert sl.graphml.read_chain(tmp_path / "b.graphml").relations.tolist() == [[N, T]]


@pytest.mark.parametrize(
    ("text", "said"),
    [(document('<KeyFrame ID="4"/>'), "none of 1 has any"), (frame(node(1)), "at least two segments")],
)
def test_observations_without_a_chain(file: Path, text: str, said: str) -> None:
    file.write_text(text)
    with pytest.raises(UnusableFileError, match=said) as refusal:
        sl.graphml.read_chain(file)
    assert str(refusal.value).startswith(f"{file}: ")


def test_chain_of_ever_new_segments_cannot_ask_for_all_memory(file: Path) -> None:
    key_frames = [
        f'<KeyFrame ID="{i}">{node(3 * i)}{node(3 * i + 1)}{edge(3 * i, 3 * i + 1)}</KeyFrame>' for i in range(600)
    ]
    file.write_text(document(*key_frames))
    with pytest.raises(UnusableFileError, match="got 1200 segments"):
        sl.graphml.read_chain(file)


def test_collection(tmp_path: Path) -> None:
    for place in ("b/Cutting_02/GraphML.xml", "b/Cutting_01/GraphML.xml", "a/push.graphml", "a/notes.txt"):
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_text(document('<KeyFrame ID="4"/>'))
    (tmp_path / "a" / "folder.graphml").mkdir()
    assert list(sl.graphml.read_collection(tmp_path)) == ["push", "Cutting_01", "Cutting_02"]
    (tmp_path / "b" / "push.graphml").write_text(document('<KeyFrame ID="4"/>'))
    with pytest.raises(UnusableFileError, match=r"b.push\.graphml: expected recordings of different names"):
        sl.graphml.read_collection(tmp_path)


def test_collection_must_be_a_folder_with_recordings(tmp_path: Path) -> None:
    with pytest.raises(UnusableFileError, match="there is none"):
        sl.graphml.read_collection(tmp_path)
    (tmp_path / "notes.txt").touch()
    with pytest.raises(UnusableFileError, match="this is a file"):
        sl.graphml.read_collection(tmp_path / "notes.txt")
    with pytest.raises(UnusableFileError, match="there is no such folder"):
        sl.graphml.read_collection(tmp_path / "none")


@pytest.mark.parametrize(
    ("name", "shown"),
    [("Put_on_Top_06", "Put on Top"), ("Cutting_10", "Cutting"), ("push", "push"), ("Case 2 take-3", "Case 2 take")],
)
def test_manipulation(name: str, shown: str) -> None:
    assert sl.graphml.manipulation(name) == shown


def test_manipulation_needs_a_name() -> None:
    with pytest.raises(ValueError, match="got '06'"):
        sl.graphml.manipulation("06")
