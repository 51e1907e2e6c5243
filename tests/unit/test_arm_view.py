"""The recording of the arm as a browser shows it, and the live view."""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from PIL import Image

from sec_lab.report.pages import network_loads
from sec_lab.viz.arm import ArmRecording, LiveArm, arm_recording
from sec_lab.worlds.katana import Move, UnreachableError
from sec_lab.worlds.katana.demonstrations import demonstration_scene, pushing_program

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SCENE = demonstration_scene(2012, 0)


@pytest.fixture(scope="module")
def recording() -> ArmRecording:
    return arm_recording(SCENE, pushing_program(SCENE), title="a push")


def test_a_recording_is_one_small_page_without_network(recording: ArmRecording) -> None:
    shown = recording._repr_html_()
    assert len(shown) < 2 * 1024**2
    assert len(recording.page) < 5 * 1024**2
    assert network_loads(shown) == network_loads(recording.page) == []
    assert repr(recording) == "3D recording: a push"


def test_equal_moves_give_equal_recordings() -> None:
    one, other = (arm_recording(SCENE, pushing_program(SCENE)[:2], title="two moves") for _ in range(2))
    assert one._repr_html_() == other._repr_html_()


def test_what_is_out_of_reach_is_refused() -> None:
    with pytest.raises(UnreachableError):
        arm_recording(SCENE, [Move((0.9, 0.0, 0.1))], title="too far")


def _browse(folder: Path, recording: ArmRecording, *what: str, milliseconds: int) -> str:
    page = folder / "page.html"
    page.write_text(f"<!DOCTYPE html><html><body>{recording._repr_html_()}</body></html>", encoding="utf-8")
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader", "--window-size=900,520", f"--user-data-dir={folder / 'profile'}",
        f"--virtual-time-budget={milliseconds}", "--host-resolver-rules=MAP * ~NOTFOUND", *what, page.as_uri(),
    ]  # fmt: skip
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no browser here")
def test_it_plays_in_a_browser(recording: ArmRecording, tmp_path: Path) -> None:
    """Early and late pictures show the table, the boxes and the arm's tip, the boxes closer together in the end."""
    apart = []
    for name, milliseconds in (("early", 1500), ("late", 15000)):
        picture = tmp_path / f"{name}.png"
        _browse(tmp_path, recording, f"--screenshot={picture}", milliseconds=milliseconds)
        pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)[:430]
        red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
        seen = {
            "red": (red > green + 90) & (red > blue + 90) & (green < 100),
            "green": (green > red + 60) & (green > blue + 60),
            "tip": (red > 150) & (green > 120) & (blue < 110),
        }
        assert min(int(mask.sum()) for mask in seen.values()) > 50, {key: int(one.sum()) for key, one in seen.items()}
        middles = [np.argwhere(seen[colour]).mean(axis=0) for colour in ("red", "green")]
        apart.append(float(np.linalg.norm(middles[0] - middles[1])))
    assert apart[1] < 0.7 * apart[0]


def test_the_live_view_is_for_this_machine_only() -> None:
    live = LiveArm(SCENE)
    port = int(re.fullmatch(r"http://127\.0\.0\.1:([0-9]+)", live.url)[1])  # type: ignore[index]
    assert live.url in live._repr_html_()
    assert b"meshcat" in urlopen(live.url).read().lower()
    listening = [
        line.split()[1] for line in Path("/proc/net/tcp").read_text().splitlines()[1:] if line.split()[3] == "0A"
    ]
    assert f"0100007F:{port:04X}" in listening
    assert f"00000000:{port:04X}" not in listening
    before = live.scene.things[0].p_W_m
    live.move(pushing_program(SCENE)[0])
    assert live.scene.things[0].p_W_m == pytest.approx(before, abs=1e-3)
    live.close()
    live.close()
    with pytest.raises(ValueError, match="expected an open one"):
        live.move()


_DROPPED = """
import gc, threading, time
from sec_lab.viz.arm import LiveArm
from sec_lab.worlds.katana.demonstrations import demonstration_scene

def drop(things):
    while things:
        things.pop()
    gc.collect()

scene = demonstration_scene(2012, 0)
in_a_cycle, kept = [LiveArm(scene), LiveArm(scene)], LiveArm(scene)
in_a_cycle[0].itself = in_a_cycle[0]
made = [thread for thread in threading.enumerate() if thread.name == "live arm"]
other = threading.Thread(target=drop, args=(in_a_cycle,))
other.start()
other.join()
for thread in made[:2]:
    thread.join(20)
print(len(made), sum(thread.is_alive() for thread in made), len(kept.scene.things) == len(scene.things))
"""


def test_a_live_view_can_be_dropped_in_any_thread() -> None:
    """Drake ends the process if its viewer is dropped in another thread than it was made in."""
    done = subprocess.run([sys.executable, "-c", _DROPPED], capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout.split()) == (0, ["3", "1", "True"]), done.stderr
