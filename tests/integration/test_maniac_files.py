"""The files of 80 recorded manipulations: all are read, and the tables beside them say the same."""

import logging
import os
from collections import Counter
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

import sec_lab as sl
from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation

FOLDER = Path(os.environ.get("SEC_LAB_DATA") or "/nonexistent") / "maniac"
if not FOLDER.is_dir():
    pytest.skip("SEC_LAB_DATA is not set to the folder of the recordings", allow_module_level=True)

Table = dict[tuple[int, int], list[int]]


@pytest.fixture(scope="module")
def recordings() -> dict[str, Observation]:
    return sl.graphml.read_collection(FOLDER)


@pytest.fixture(scope="module")
def tables() -> dict[str, EventChain]:
    return {path.parent.name: sl.graphml.read_table(path) for path in sorted(FOLDER.rglob("SEC.dat"))}


def as_table(chain: EventChain) -> Table:
    """Rows by unordered pair: the two kinds of file order rows and pairs differently."""
    return {
        (min(pair), max(pair)): row.tolist() for pair, row in zip(chain.pairs.tolist(), chain.relations, strict=True)
    }


def first_seen(chain: EventChain) -> list[int]:
    """Segments in the order in which they first appear, by label where they appear together."""
    at = {
        segment: min(
            int(np.flatnonzero(row != Relation.ABSENT)[0])
            if (row != Relation.ABSENT).any()
            else chain.relations.shape[1]
            for pair, row in zip(chain.pairs.tolist(), chain.relations, strict=True)
            if segment in pair
        )
        for segment in chain.segments.tolist()
    }
    return sorted(at, key=lambda segment: (at[segment], segment))


def test_all_are_read(recordings: dict[str, Observation]) -> None:
    assert Counter(sl.graphml.manipulation(name) for name in recordings) == {
        "Chopping": 10,
        "Cutting": 10,
        "Hiding": 10,
        "Pushing": 10,
        "Put on Top": 10,
        "Stirring": 10,
        "Take Down": 10,
        "Uncover": 10,
    }
    lengths = [len(seen.graphs) for seen in recordings.values()]
    assert (min(lengths), max(lengths), sum(lengths)) == (4, 72, 1488)
    assert max(len(seen.segments) for seen in recordings.values()) == 24


def test_what_they_say(recordings: dict[str, Observation]) -> None:
    for seen in recordings.values():
        assert set(seen.segments.tolist()) <= set(seen.names)
        assert None not in seen.graphs
        for graph in seen.recorded:
            assert set(np.unique(graph.relations)) <= {Relation.NON_TOUCHING, Relation.TOUCHING}
            assert graph.positions is not None
            assert graph.positions.shape[1] == 3
            assert set(graph.types or ()) == {"Unknown"}


def test_every_key_frame_is_a_change(recordings: dict[str, Observation]) -> None:
    """No two consecutive key frames have the same segments in the same relations."""
    same = [
        (name, int(frame))
        for name, seen in recordings.items()
        for (a, b), frame in zip(pairwise(seen.recorded), seen.key_frames[1:], strict=True)
        if a.same_relations(b)
    ]
    assert same == []


def test_names_of_segments_that_never_appear(recordings: dict[str, Observation]) -> None:
    extra = {name: set(seen.names) - set(seen.segments.tolist()) for name, seen in recordings.items()}
    assert {name: segments for name, segments in extra.items() if segments} == {
        "Cutting_03": {1, 43},
        "Take_Down_08": {13},
    }


def test_one_segment_has_two_names(caplog: pytest.LogCaptureFixture) -> None:
    """Segment 22 of Chopping_08 is listed as Hand and as Arm; Stirring_03 repeats a name, which is no contradiction."""
    with caplog.at_level(logging.WARNING):
        recordings = sl.graphml.read_collection(FOLDER)
    assert [record.getMessage() for record in caplog.records] == [
        "Chopping_08/GraphML.xml: segment 22 is named 'Hand', then 'Arm'; the last counts"
    ]
    assert recordings["Chopping_08"].names[22] == "Arm"
    assert recordings["Stirring_03"].names[23] == "Knife"


@pytest.mark.parametrize("dialect", ["thesis", "standard"])
def test_round_trip(recordings: dict[str, Observation], tmp_path: Path, dialect: str) -> None:
    path = tmp_path / "GraphML.xml"
    for name, seen in recordings.items():
        sl.graphml.write(path, seen, dialect=dialect)  # type: ignore[arg-type]
        again = sl.graphml.read(path)
        assert again.key_frames.tolist() == seen.key_frames.tolist(), name
        assert again.names == seen.names, name
        for one, other in zip(again.recorded, seen.recorded, strict=True):
            assert one.same_relations(other)
            assert one.types == other.types
            assert one.positions is not None
            assert other.positions is not None
            assert one.positions.tobytes() == other.positions.tobytes()


def test_tables_agree_with_graphml(recordings: dict[str, Observation], tables: dict[str, EventChain]) -> None:
    """45 of 46 tables hold exactly the pairs and relations of their GraphML file."""
    assert Counter(sl.graphml.manipulation(name) for name in tables) == {
        "Chopping": 10,
        "Cutting": 10,
        "Pushing": 2,
        "Put on Top": 1,
        "Stirring": 3,
        "Take Down": 10,
        "Uncover": 10,
    }
    differing = [name for name, table in tables.items() if as_table(table) != as_table(recordings[name].chain)]
    assert differing == ["Cutting_07"]


def test_the_table_of_cutting_07_begins_earlier(
    recordings: dict[str, Observation], tables: dict[str, EventChain]
) -> None:
    """It has two more columns in front; the other 33 are those of the GraphML file.

    The two are true key frames: between them the arm (3) and the bread (11) come to touch, and after them the knife
    (4) appears, which the GraphML file shows from its first key frame on. When they were is not recorded.
    """
    table, chain = tables["Cutting_07"], recordings["Cutting_07"].chain
    assert table.relations.shape[1] == 35
    assert chain.relations.shape[1] == 33
    assert {pair: row[2:] for pair, row in as_table(table).items()} == as_table(chain)
    rows = as_table(table)
    assert [pair for pair, row in rows.items() if row[0] != row[1]] == [(3, 11)]
    assert {pair for pair, row in rows.items() if row[1] != row[2]} == {
        (min(4, other), max(4, other)) for other in (2, 3, 6, 9, 11, 12, 14, 16)
    }
    assert all(row[:2] == [9, 9] for pair, row in rows.items() if 4 in pair)
    assert {recordings["Cutting_07"].names[segment] for segment in (3, 11, 4)} == {"Arm", "Bread", "Knife"}


def test_rows_of_tables_follow_the_first_appearance(tables: dict[str, EventChain]) -> None:
    """So in 16 of them some pair has its larger label first; only the unordered pair can be compared."""
    for name, table in tables.items():
        assert [tuple(pair) for pair in table.pairs.tolist()] == list(combinations(first_seen(table), 2)), name
    assert sum(bool((table.pairs[:, 0] > table.pairs[:, 1]).any()) for table in tables.values()) == 16
