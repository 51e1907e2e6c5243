"""GraphML as the thesis prints it, line by line."""

from pathlib import Path

import pytest

import sec_lab as sl
from sec_lab.codes import WORD_OF, Relation
from sec_lab.files import UnusableFileError
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

SEEN = Observation([SceneGraph([1, 2], [[0, 2], [2, 0]])], [4])
