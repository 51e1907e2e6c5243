"""Tables of distances and takes of boxes, read and refused."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

from sec_lab.files import UnusableFileError
from sec_lab.tracks import read_box_take, read_distance_table

TABLE = "RH,plate,plate\nRH,plate:0,0,1,0,0,2\nRH,plate:2,2,2,2,2,2\nplate,plate:1,1,1,1,0,0\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "table.txt"
    path.write_text(text)
    return path


def test_distances_become_a_chain(tmp_path: Path) -> None:
    seen = read_distance_table(written(tmp_path, TABLE))
    # Rows 2–1, 3–1 and 3–2; near and far are both non-touching, and only changes are key frames.
    assert seen.chain.relations.tolist() == [[2, 0, 2, 2, 0], [0] * 5, [0, 0, 0, 2, 2]]
    assert seen.key_frames.tolist() == [0, 2, 3, 4, 5]
    assert dict(seen.names) == {1: "RH", 2: "plate", 3: "plate"}


def test_what_does_not_last_is_taken_for_what_was_before(tmp_path: Path) -> None:
    seen = read_distance_table(written(tmp_path, TABLE), least_frames=2)
    assert seen.chain.relations.tolist() == [[2, 2], [0, 0], [0, 2]]
    assert seen.key_frames.tolist() == [0, 4]
    with pytest.raises(ValueError, match="least_frames: expected a whole number of at least 1, got 0"):
        read_distance_table(written(tmp_path, TABLE), least_frames=0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it is empty"),
        ("RH\n", "expected at least two names"),
        ("RH,cup\n", "expected 1 pairs of 2 things, got 0"),
        ("RH,cup\ncup,RH:0,1\n", "expected the pair 'RH,cup' in its place"),
        ("RH,cup\nRH,cup:0,7\n", "expected 0, 1 and 2 for 'RH,cup', got '7'"),
        ("RH,cup\nRH,cup:\n", "expected 0, 1 and 2 for 'RH,cup', got ''"),
        ("a,b,c\na,b:0\na,c:0,1\nb,c:0\n", "expected rows of the same length"),
    ],
)
def test_damaged_tables_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(UnusableFileError, match=message):
        read_distance_table(written(tmp_path, text))


def test_missing_and_binary_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnusableFileError, match="expected a table of distances, but there is no such file"):
        read_distance_table(tmp_path / "none.txt")
    path = tmp_path / "binary.txt"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UnusableFileError, match="it is damaged"):
        read_distance_table(path)


def box(name: str, x: float, size: float = 1.0) -> list[Any]:
    return [name, x, x + size, 0.0, 1.0, 0.0, 1.0]


def take() -> dict[str, Any]:
    """A hand comes to a cup, is not seen for a frame, and leaves."""
    at = [5.0, 0.5, None, 0.5, 5.0]
    frames = {
        str(number): {"objects": [box("cup", 0.0), *([] if x is None else [box("hand", x)])]}
        for number, x in zip((0, 3, 4, 5, 9), at, strict=True)
    }
    return {"frames": frames, "gt": {"right_hand": [0, [0, None, None], 3, [5, 4, "cup"], 9]}}


def packed(folder: Path, content: object) -> Path:
    path = folder / "take.json.gz"
    path.write_bytes(gzip.compress(json.dumps(content).encode()))
    return path


def test_boxes_become_an_observation(tmp_path: Path) -> None:
    found = read_box_take(packed(tmp_path, take()))
    seen = found.observation
    assert seen.chain.relations.tolist() == [[0, 2, 9, 2, 0]]
    assert seen.key_frames.tolist() == [0, 3, 4, 5, 9]
    assert dict(seen.names) == {1: "cup", 2: "hand"}
    assert seen.position_unit == "m"
    assert seen.recorded.graphs[1].positions is not None
    assert seen.recorded.graphs[1].positions.tolist() == [[0.5, 0.5, 0.5], [1.0, 0.5, 0.5]]
    assert dict(found.actions) == {"right hand": ((0, 3, "idle", None), (3, 9, "hold", "cup"))}


def test_a_gap_counts_as_touch_up_to_its_limit(tmp_path: Path) -> None:
    path = packed(tmp_path, take())
    assert read_box_take(path, gap_m=3.9).observation.chain.relations.tolist() == [[0, 2, 9, 2, 0]]
    assert read_box_take(path, gap_m=4.0).observation.chain.relations.tolist() == [[2, 9, 2]]


def test_a_box_that_is_lost_for_a_moment_is_held(tmp_path: Path) -> None:
    seen = read_box_take(packed(tmp_path, take()), least_frames=2).observation
    assert seen.key_frames.tolist() == [0, 3]
    assert seen.chain.relations.tolist() == [[0, 2]]


@pytest.mark.parametrize(
    "content",
    [
        [],
        {"frames": {}},
        {"frames": {"0": {"objects": [["cup", 1]]}}, "gt": {}},
        {"frames": {"x": {"objects": []}}, "gt": {}},
        {"frames": {"0": {"objects": [box("cup", 1.0, -1.0)]}}, "gt": {}},
        {**take(), "gt": {"right_hand": [0, [0, None, None]]}},
        {**take(), "gt": {"right_hand": [0, [99, None, None], 5]}},
        {**take(), "gt": {"right_hand": [0, [-1, None, None], 5]}},
        {"frames": {"0": {"objects": [box("cup", 0.0), box("cup", 7.0)]}}, "gt": {}},
    ],
)
def test_damaged_takes_are_refused(tmp_path: Path, content: object) -> None:
    with pytest.raises(UnusableFileError, match="expected a take of boxes, but it is damaged"):
        read_box_take(packed(tmp_path, content))


def test_options_out_of_range_are_not_the_fault_of_the_file(tmp_path: Path) -> None:
    path = packed(tmp_path, take())
    for options, message in (
        ({"least_frames": 0}, "least_frames: expected a whole number of at least 1, got 0"),
        ({"least_frames": 1.5}, "least_frames: expected a whole number of at least 1, got 1.5"),
        ({"gap_m": -1}, "gap_m: expected a finite distance of at least 0, got -1"),
        ({"gap_m": float("nan")}, "gap_m: expected a finite distance of at least 0, got nan"),
    ):
        with pytest.raises(ValueError, match=message) as error:
            read_box_take(path, **options)  # type: ignore[arg-type]
        assert not isinstance(error.value, UnusableFileError)


def test_cut_off_and_plain_files_are_refused(tmp_path: Path) -> None:
    path = packed(tmp_path, take())
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(UnusableFileError, match="it is damaged"):
        read_box_take(path)
    path.write_bytes(b"{}")
    with pytest.raises(UnusableFileError, match="it is damaged"):
        read_box_take(path)
