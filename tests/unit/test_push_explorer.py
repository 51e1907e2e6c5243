"""The push explorer by its controls, and the process that its arm works in."""

import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from sec_lab.event_chain import EventChain
from sec_lab.viz.arm_process import ArmProcess, RefusedError
from sec_lab.viz.svg.pushed import pushed_svg, strip_svg
from sec_lab.viz.svg.table_top import drawn_at, place_of, table_svg
from sec_lab.viz.widgets import push, push_explorer
from sec_lab.viz.widgets.push import PushExplorer
from sec_lab.worlds.katana import Scene, View, example_scene, random_scene
from sec_lab.worlds.katana.arranging import rearranged, with_third

NAMES = {1: "robot arm", 2: "red box", 3: "green box", 4: "table"}


def data(markup: str, name: str) -> list[str]:
    return [one.attrib[name] for one in ElementTree.fromstring(markup).iter() if name in one.attrib]


class ArmOfStraw:
    """Looks at once, and pushes as it is told to."""

    def __init__(self, _: object = None) -> None:
        self.looked: list[Scene] = []
        self.is_closed = False
        self.do: Callable[..., Any] = dict

    def look(self, scene: Scene) -> View:
        self.looked.append(scene)
        camera = scene.camera
        shape = camera.height, camera.width
        return View(np.zeros((*shape, 3), np.uint8), np.ones(shape, np.float32), camera)

    def push(self, scene: Scene, **heard: Any) -> Any:
        return self.do(scene, **heard)

    def close(self) -> None:
        self.is_closed = True


@pytest.fixture
def explorer(monkeypatch: pytest.MonkeyPatch) -> Iterator[PushExplorer]:
    monkeypatch.setattr(push, "ArmProcess", ArmOfStraw)
    made = push_explorer()
    assert isinstance(made, PushExplorer)
    yield made
    made.close()
    assert made._arm.is_closed  # type: ignore[attr-defined]


def straw(explorer: PushExplorer) -> ArmOfStraw:
    arm: Any = explorer._arm
    assert isinstance(arm, ArmOfStraw)
    return arm


def test_controls_are_the_scene(explorer: PushExplorer) -> None:
    assert explorer.scene.things == example_scene("a").things
    explorer.x.value, explorer.y.value, explorer.size.value, explorer.turn.value = 0.3, 0.12, 50, 45
    explorer.shape.value = "cone"
    one = explorer.scene.things[0]
    assert (one.name, one.p_W_m[:2], one.size_m[0]) == ("red cone", (0.3, 0.12), 0.05)
    assert one.yaw_rad == pytest.approx(np.pi / 4)
    assert explorer.scene.things[1] == example_scene("a").things[1]
    explorer.third.value = "another red box"
    assert [label for label, _ in explorer.thing.options] == ["red cone", "green box", "another red box"]
    assert data(explorer.table.svg, "data-thing") == ["0", "1", "2"]
    explorer.thing.value = 2
    assert data(explorer.table.svg, "data-chosen") == ["2", "2"]
    assert explorer.shape.value == "box"
    explorer.third.value = "none"
    assert explorer.thing.value == 1
    explorer.which.value = "f"
    assert explorer.scene.things == example_scene("f").things
    assert (explorer.third.value, round(explorer.azimuth.value)) == ("blue sphere", 10)
    explorer.seed.value = 4
    assert explorer.which.value == "random"
    assert explorer.scene.things == random_scene(4).things
    assert np.array_equal(explorer.scene.camera.X_WC, random_scene(4).camera.X_WC)
    explorer.azimuth.value = -30
    assert explorer.scene.things == random_scene(4).things
    explorer.wait()
    # The last picture of the camera is that of the scene.
    assert straw(explorer).looked[-1] is explorer.scene
    assert explorer.camera.png[:4] == b"\x89PNG"
    assert explorer.trouble.value == ""


def test_clicks_choose_and_move(explorer: PushExplorer) -> None:
    explorer.table.clicked = [*drawn_at(*explorer.scene.things[1].p_W_m[:2]), 1]
    assert explorer.thing.value == 1
    explorer.table.clicked = [*drawn_at(0.25, 0.2), 2]
    assert explorer.scene.things[1].p_W_m[:2] == pytest.approx((0.25, 0.2))
    assert (explorer.x.value, explorer.y.value) == pytest.approx((0.25, 0.2))
    # Beside the drawing is no place of the table.
    explorer.table.clicked = [-5000.0, 9000.0, 3]
    assert explorer.scene.things[1].p_W_m[:2] == pytest.approx((explorer.x.min, explorer.y.max))
    # The middle of the picture is what the camera looks at, about: nothing stands there.
    explorer.camera.clicked = [160, 120, 1]
    assert explorer.scene.things[1].p_W_m[:2] == pytest.approx((0.28, 0.0), abs=0.03)
    assert explorer.trouble.value == ""


def test_a_refusal_is_a_sentence_and_the_controls_can_be_used(explorer: PushExplorer) -> None:
    def refuse(scene: Scene, **_: Any) -> None:
        raise RefusedError("scene: expected one candidate for 'red box', got 2")

    straw(explorer).do = refuse
    explorer.push.click()
    explorer.wait()
    assert "Refused, the arm has not moved: expected one candidate for ‘red box’, got 2." in explorer.trouble.value
    assert not explorer.push.disabled
    # Without asking the arm at all: contact physics would throw them apart.
    explorer.table.clicked = [*drawn_at(0.2, -0.12), 1]
    green = explorer.scene.things[1].p_W_m
    explorer.x.value, explorer.y.value = green[0], green[1] - 0.01
    explorer.push.click()
    explorer.wait()
    assert "inside each other" in explorer.trouble.value


def test_what_nobody_expected_is_told_too(explorer: PushExplorer) -> None:
    def end(scene: Scene, **_: Any) -> None:
        raise OSError("arm: expected its process to answer, but it has ended")

    straw(explorer).do = end
    explorer.push.click()
    explorer.wait()
    assert "has ended" in explorer.trouble.value
    assert not explorer.push.disabled


def test_cancel_stops_the_push_at_its_next_report(explorer: PushExplorer) -> None:
    begun, stopped = threading.Event(), threading.Event()

    def go_on(scene: Scene, *, report: Callable[[int, int], None], **_: Any) -> None:
        try:
            for _move in range(3000):
                begun.set()
                report(1, 7)
                time.sleep(0.01)
        except Exception:
            stopped.set()
            raise

    explorer.wait()
    straw(explorer).do = go_on
    explorer.push.click()
    assert begun.wait(10)
    assert explorer.push.disabled
    assert explorer.x.disabled
    scene = explorer.scene
    explorer.table.clicked = [*drawn_at(0.25, 0.2), 1]
    assert explorer.scene is scene
    explorer.cancel.click()
    assert stopped.wait(10)
    explorer.wait()
    assert not explorer.push.disabled
    assert "Stopped" in explorer.said.value
    assert explorer.work_bar.layout.visibility == "hidden"


def test_bad_input_is_a_sentence() -> None:
    assert "scene: expected a Scene, got int" in push_explorer(3).trouble.value  # type: ignore[arg-type]
    lonely = Scene(example_scene("a").things[:1], example_scene("a").camera, (-0.1, -0.3, 0.3), (-0.1, 0.3, 0.3))
    assert "expected two things at least, got 1" in push_explorer(lonely).trouble.value


def test_places_of_the_drawing_are_places_of_the_table() -> None:
    for place in ((0.0, 0.0), (0.5, -0.3), (0.25, 0.1)):
        assert place_of(*drawn_at(*place)) == pytest.approx(place)
    # Up is away from the arm, left its left.
    assert drawn_at(0.4, 0.0)[1] < drawn_at(0.3, 0.0)[1]
    assert drawn_at(0.3, 0.1)[0] < drawn_at(0.3, 0.0)[0]
    scene = example_scene("f")
    assert data(table_svg(scene, afterwards=scene.things), "data-after") == ["red cone", "green box", "blue sphere"]


def test_rows_stand_beside_those_of_the_model() -> None:
    model = EventChain([[9, 0, 2, 0], [0, 0, 0, 2]], [(1, 2), (2, 3)], names=NAMES)
    executed = EventChain([[0, 0, 2], [0, 2, 2], [9, 0, 9]], [(2, 3), (1, 4), (1, 2)], names=NAMES)
    assert data(pushed_svg(model, executed), "data-standing") == ["differs", "agrees"]
    text = "".join(ElementTree.fromstring(pushed_svg(model, executed)).itertext())
    assert "differs: expected ANTN, got ANA" in text
    assert "not in the model: NT" in text
    assert data(pushed_svg(model, None), "data-standing") == ["missing", "missing"]
    with pytest.raises(ValueError, match="titles: expected one a picture, got 2 for 1"):
        strip_svg([np.zeros((2, 2, 3), np.uint8)], ["a", "b"])
    with pytest.raises(ValueError, match="pictures: expected one size"):
        strip_svg([np.zeros((2, n, 3), np.uint8) for n in (2, 3)], ["a", "b"])


def n_listening(pid: int) -> int:
    """Servers of a process."""
    own = {link.readlink().name for link in Path(f"/proc/{pid}/fd").iterdir() if link.is_symlink()}
    lines = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return sum(f"socket:[{words[9]}]" in own for words in lines if words[3] == "0A")


def memory_mb(pid: int) -> float:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="servers are counted as Linux lists them")
def test_the_process_refuses_leaks_nothing_and_is_started_anew() -> None:
    scene = example_scene("a")
    green = scene.things[1].p_W_m
    side_by_side = rearranged(rearranged(scene, 1, yaw_rad=0.0), 0, at_m=(green[0], green[1] - 0.06), yaw_rad=0.0)
    bad = {
        "one candidate for 'red box', got 2": with_third(scene, "another red box"),
        "touching already": side_by_side,
        "from the arm's own column, expected at least 0.1 m": rearranged(scene, 0, at_m=(0.1, -0.02)),
    }
    addresses: list[str] = []
    here = n_listening(os.getpid())
    with ArmProcess() as arm:
        for said, one in bad.items():
            with pytest.raises(RefusedError, match=said):
                arm.push(one, on_live=addresses.append)
        pid = arm.pid
        assert pid is not None
        before = memory_mb(pid)
        for _ in range(5):
            with pytest.raises(RefusedError):
                arm.push(bad["touching already"], on_live=addresses.append)
        assert arm.look(scene).image.std() > 1
        # Each push had a live view; none is left, neither there nor here.
        assert len(addresses) == 8
        assert all(one.startswith("http://127.0.0.1:") for one in addresses)
        assert (n_listening(pid), n_listening(os.getpid())) == (0, here)
        # Each size is built anew, which takes 3 MB; none is kept.
        for size_mm in range(40, 60):
            arm.look(rearranged(scene, 0, size_m=size_mm / 1000))
        assert memory_mb(pid) < before + 30
        os.kill(pid, 9)
        with pytest.raises(OSError, match="expected its process to answer"):
            arm.look(scene)
        assert arm.look(scene).image.shape == (256, 320, 3)

        def stop(done: int, total: int) -> None:
            if total > 1:
                raise KeyError("no more")

        with pytest.raises(KeyError, match="no more"):
            arm.push(scene, report=stop)
        assert arm.look(scene).image.shape == (256, 320, 3)
        last = arm.pid
    assert not Path(f"/proc/{last}").exists()
