"""GraphML of the thesis (A.2): read as it is meant, refused where it is damaged or hostile."""

import logging
from pathlib import Path

import numpy as np
import pytest

import sec_lab as sl
from sec_lab.codes import Relation
from sec_lab.files import UnusableFileError
from sec_lab.graphml import assembly, markup
from sec_lab.graphml import dialect as thesis_dialect
from sec_lab.graphml import standard as standard_graphml
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph
from tests.written_graphml import (
    DIALECTS,
    KEY_FRAMES,
    POSITIONS,
    RELATIONS,
    SEGMENTS,
    assert_refused,
    assert_same,
    document,
    edge,
    figure_a2,
    frame,
    node,
)

N, O, T = Relation.NON_TOUCHING, Relation.OVERLAPPING, Relation.TOUCHING  # noqa: E741


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "chain.graphml"


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
