"""Chains in tables, in files of any name and in folders of them."""

from pathlib import Path

import pytest

import sec_lab as sl
from sec_lab.codes import Relation
from sec_lab.files import UnusableFileError
from tests.written_graphml import SEGMENTS, document, edge, figure_a2, frame, node

N, O, T = Relation.NON_TOUCHING, Relation.OVERLAPPING, Relation.TOUCHING  # noqa: E741


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "chain.graphml"


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
