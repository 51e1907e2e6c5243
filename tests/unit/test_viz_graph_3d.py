"""Scene graphs in three dimensions: what stands in the page is where the segments are, when they are there."""

import base64
import gzip
import html
import re
import socket
import urllib.request
from typing import Any

import numpy as np
import psutil
import pytest
import trimesh
import umsgpack
from meshcat import Visualizer

from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz.graph_3d import Record, _turn_from_y, draw_graph_3d, put_graph, scene_3d
from sec_lab.viz.graph_3d_server import LiveView

CUP, HAND, TABLE = 2, 5, 7


def observation() -> Observation:
    """A hand comes, touches a cup that is on a table, and goes."""
    table, cup = [0.0, 0.2, 1.0], [0.1, 0.1, 1.0]
    first = SceneGraph([CUP, TABLE], [[0, 2], [2, 0]], [cup, table])
    near = SceneGraph(
        [CUP, HAND, TABLE], [[0, 2, 2], [2, 0, 1], [2, 1, 0]], [cup, [0.4, 0.1, 0.9], table]
    )  # fmt: skip
    lifted = SceneGraph(
        [CUP, HAND, TABLE], [[0, 2, 0], [2, 0, 0], [0, 0, 0]], [[0.1, -0.2, 1.0], [0.2, -0.2, 1.0], table]
    )  # fmt: skip
    last = SceneGraph([CUP, TABLE], [[0, 0], [0, 0]], [[0.1, -0.2, 1.0], table])
    names = {CUP: "cup", HAND: "<hand>"}
    return Observation([first, near, None, lifted, last], [10, 20, 25, 30, 60], names, position_unit="m")


def commands(**options: Any) -> list[dict[str, Any]]:
    record = Record()
    put_graph(Visualizer(window=record), scene_3d(observation()), **options)
    return record.commands


def objects(sent: list[dict[str, Any]]) -> dict[str, str]:
    """Type of geometry by path."""
    return {
        one["path"].removeprefix("/meshcat/graph/"): one["object"]["geometries"][0]["type"]
        for one in sent
        if one["type"] == "set_object"
    }


def keys(sent: list[dict[str, Any]], name: str, track: str) -> dict[float, Any]:
    """Values of an animated property by time."""
    (animation,) = [one for one in sent if one["type"] == "set_animation"]
    (clip,) = [one["clip"] for one in animation["animations"] if one["path"] == f"/meshcat/graph/{name}"]
    (found,) = [one for one in clip["tracks"] if one["name"] == f".{track}"]
    return {key["time"]: key["value"] for key in found["keys"]}


def test_a_scene_knows_where_everything_is_and_when() -> None:
    scene = scene_3d(observation())
    assert scene.segments.tolist() == [CUP, HAND, TABLE]
    assert scene.names == ("cup", "<hand>", "segment 7")
    assert scene.key_frames.tolist() == [10, 20, 30, 60]
    assert scene.present[:, 1].tolist() == [False, True, True, False]
    # Before it comes it is where it comes, afterwards where it was last.
    assert scene.positions[:, 1].tolist() == [[0.4, 0.1, 0.9]] * 2 + [[0.2, -0.2, 1.0]] * 2
    assert scene.relations[:, 0, 1].tolist() == [9, 2, 2, 9]


def test_segments_are_spheres_and_edges_tubes() -> None:
    assert objects(commands()) == {
        "segment 2": "SphereGeometry",
        "segment 5": "SphereGeometry",
        "segment 7": "SphereGeometry",
        "touching 2 5": "CylinderGeometry",
        "touching 2 7": "CylinderGeometry",
        "overlapping 5 7": "CylinderGeometry",
    }


def test_spheres_move_and_vanish_and_tubes_hold_as_long_as_the_relation() -> None:
    sent = commands()
    places = keys(sent, "segment 2", "position")
    assert places == {0: [0.1, 0.1, 1.0], 10: [0.1, 0.1, 1.0], 20: [0.1, -0.2, 1.0], 50: [0.1, -0.2, 1.0]}
    assert keys(sent, "segment 5", "visible") == {0: False, 10: True, 20: True, 50: False}
    assert keys(sent, "touching 2 7", "visible") == {0: True, 10: True, 20: False, 50: False}
    assert keys(sent, "overlapping 5 7", "visible") == {0: False, 10: True, 20: False, 50: False}


def test_a_tube_reaches_from_one_segment_to_the_other_at_every_time() -> None:
    sent, scene = commands(), scene_3d(observation())
    times = scene.key_frames - scene.key_frames[0]
    middles, turns, sizes = (keys(sent, "touching 2 5", track) for track in ("position", "quaternion", "scale"))
    assert len(middles) > len(times)
    for time, middle in middles.items():
        cup, hand = (
            np.array([np.interp(time, times, scene.positions[:, segment, axis]) for axis in range(3)])
            for segment in (0, 1)
        )  # fmt: skip
        x, y, z, w = turns[time]
        # Where the quaternion turns the y axis to.
        along = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
        assert np.allclose(np.array(middle) + along * sizes[time][1] / 2, hand)
        assert np.allclose(np.array(middle) - along * sizes[time][1] / 2, cup)


@pytest.mark.parametrize("way", [[0, 0, 0], [0, 2, 0], [0, -2, 0], [3, 0, 0], [0, 0, -1], [1, -2, 0.5]])
def test_tubes_can_lie_in_every_direction(way: list[float]) -> None:
    x, y, z, w = _turn_from_y(np.array(way, float))
    along = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
    assert np.isclose(x * x + y * y + z * z + w * w, 1)
    if any(way):
        assert np.allclose(along, np.array(way) / np.linalg.norm(way))


def test_segments_may_have_shapes_of_their_own() -> None:
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    assert objects(commands(parts={TABLE: box}))["segment 7"] == "BufferGeometry"
    with pytest.raises(ValueError, match=r"parts: expected segments out of \[2, 5, 7\], got 3"):
        commands(parts={3: box})


def test_everything_fits_the_view_shapes_included() -> None:
    box = trimesh.creation.box((4.0, 0.2, 0.3))
    for parts in ({}, {TABLE: box}):
        (sent,) = [
            one for one in commands(parts=parts) if one["type"] == "set_transform" and one["path"] == "/meshcat/graph"
        ]  # fmt: skip
        matrix = np.array(sent["matrix"]).reshape(4, 4).T
        places = scene_3d(observation()).positions.reshape(-1, 3)
        if parts:
            places = np.concatenate([places, [[-2.0, 0.2, 1.0], [2.0, 0.2, 1.0]]])
        seen = places @ matrix[:3, :3].T + matrix[:3, 3]
        assert np.isclose((seen.max(axis=0) - seen.min(axis=0)).max(), 2.0)
        assert np.abs(seen).max() <= 1.0 + 1e-9
        # What is down in the picture is down in the view.
        assert matrix[2, 1] < 0


def test_bad_input_is_refused() -> None:
    with pytest.raises(ValueError, match="frames_per_second: expected a number above 0, got 0"):
        commands(frames_per_second=0)
    without = Observation([SceneGraph([1, 2], [[0, 2], [2, 0]])], [4])
    with pytest.raises(ValueError, match="positions: expected some in every scene graph, got none at key frame 4"):
        scene_3d(without)


def test_positions_in_the_picture_stand_upright() -> None:
    flat = Observation([SceneGraph([1, 2], [[0, 2], [2, 0]], [[10, 20], [30, 5]])], [0], position_unit="px")
    assert scene_3d(flat).positions.tolist() == [[[10, 20, 0], [30, 5, 0]]]
    page = draw_graph_3d(flat)
    # A single key frame does not move.
    assert b"set_animation" not in b"".join(commands_of(page.html))


def commands_of(page: str) -> list[bytes]:
    return [base64.b64decode(data) for data in re.findall(r"octet-binary;base64,([^\"]+)\"", page)]


def test_the_page_holds_all_commands_needs_no_network_and_is_the_same_every_time(tmp_path: Any) -> None:
    page = draw_graph_3d(observation(), title="a <cup>")
    assert page.html == draw_graph_3d(observation(), title="a <cup>").html
    assert [umsgpack.unpackb(data)["type"] for data in commands_of(page.html)] == [one["type"] for one in commands()]
    own = page.html.partition("<script>")[0]
    assert "a &lt;cup&gt;" in own
    assert "&lt;hand&gt;" in own
    assert not re.search(r"(src|href)=", own)
    page.save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == page.html
    shown = page._repr_html_()
    source = re.search(r'srcdoc="([^"]*)"', shown)
    assert source is not None
    packed = re.search(r"base64,([^\"]+)", html.unescape(source[1]))
    assert packed is not None
    assert gzip.decompress(base64.b64decode(packed[1])).decode() == page.html
    # What a notebook stores of it.
    assert len(shown) < 0.45 * len(page.html)
    assert repr(page) == "3D view: a <cup>"


def test_the_live_view_listens_on_loopback_only_and_ends() -> None:
    with LiveView() as view:
        view.show(observation())
        assert view.url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(view.url, timeout=10) as answer:
            assert b"MeshCat" in answer.read()
        listening = [
            one.laddr.ip
            for one in psutil.Process(view._server.pid).net_connections("inet")
            if one.status == psutil.CONN_LISTEN
        ]
        assert len(listening) >= 2
        assert set(listening) == {"127.0.0.1"}
        port = int(view.url.split(":")[2].split("/")[0])
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0
