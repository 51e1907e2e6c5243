"""`sec-lab observe` as a user meets it: outputs whole or not at all, and one line for everything that may be wrong."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from sec_lab import graphml, pipeline
from sec_lab.cli import main
from sec_lab.recording import Frame, Recording, write_movie
from sec_lab.segmentation import Segmentation
from sec_lab.segmentation.colour import NamedColour, colour_segmentation
from sec_lab.segmentation.masks import write_palette_pngs

COLOURS = (NamedColour("red box", (330, 30), (50, 100)), NamedColour("green box", (90, 150), (50, 100)))
by_colour = partial(colour_segmentation, colours=COLOURS)
LEFTS = (4, 12, 20, 28, 28, 16)
N = len(LEFTS)

Pictures = NDArray[np.uint8]


def pushed() -> Pictures:
    """A red box is pushed to a green one and drawn back."""
    movie = np.full((N, 48, 64, 3), 90, dtype=np.uint8)
    movie[:, 8:24, 40:56] = 10, 200, 10
    for frame, left in zip(movie, LEFTS, strict=True):
        frame[8:24, left : left + 12] = 200, 10, 10
    return movie


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A movie, its masks as a tracker writes them, and names."""
    write_movie(tmp_path / "movie.mkv", pushed(), frames_per_second=10, lossless=True)
    write_palette_pngs(tmp_path / "masks", by_colour(Recording.from_frames(pushed())))
    (tmp_path / "names.json").write_text(json.dumps({"1": "red <box>", "2": "green & box"}))
    return tmp_path


@pytest.fixture(autouse=True)
def colour_instead_of_layers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Movies of single colours are segmented by colour, and each frame is judged by itself."""
    named = pipeline.segmenter
    monkeypatch.setattr(pipeline, "segmenter", lambda one: by_colour if one == "layers" else named(one))


def run(*arguments: object) -> int:
    return main(["observe", "--over-time", "none", *(str(argument) for argument in arguments)])


def outputs(folder: Path) -> list[str]:
    return [
        "-o",
        f"{folder}/a.graphml",
        "--csv",
        f"{folder}/a.csv",
        "--overlay",
        f"{folder}/a.mp4",
        "--html",
        f"{folder}/a.html",
    ]


def refused(capsys: pytest.CaptureFixture[str], folder: Path, arguments: list[object], message: str) -> None:
    """Exit code 2, one line, and nothing new in the folder."""
    before = sorted(folder.rglob("*"))
    assert run(*arguments, *outputs(folder)) == 2
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    assert line.startswith("sec-lab observe: ")
    assert re.search(message, line), line
    assert sorted(folder.rglob("*")) == before


class TestOutputs:
    def test_movie_becomes_chain_table_overlay_and_page(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        before = {*folder.iterdir()}
        assert run(folder / "movie.mkv", *outputs(folder)) == 0
        out, err = capsys.readouterr()
        assert err == ""
        lines = out.splitlines()
        assert lines[:2] == ["6 frames, 3 segments, 3 key frames", "segments: 0 background, 1 red box, 2 green box"]
        assert [" ".join(line.split()) for line in lines[3:]] == [
            "key frame 0 3 5",
            "green box, red box 0 2 0",
            "(and 2 rows in which nothing happens)",
        ]
        made = {path.name for path in {*folder.iterdir()} - before}
        assert made == {"a.graphml", "a.csv", "a.mp4", "a.html"}

        seen = graphml.read(folder / "a.graphml")
        assert seen.key_frames.tolist() == [0, 3, 5]
        with (folder / "a.csv").open() as stream:
            rows = list(csv.reader(stream))
        assert rows[0] == ["segment 1", "segment 2", "name 1", "name 2", "0", "3", "5"]
        assert ["2", "1", "green box", "red box", "0", "2", "0"] in rows
        overlay = Recording.open(folder / "a.mp4")
        assert [frame.image.shape for frame in overlay] == [(480, overlay.size[1], 3)] * N
        assert overlay.frames_per_second == 10
        page = (folder / "a.html").read_text()
        assert page.count("data:image/jpeg;base64,") == 3
        assert not re.search(r"(?:src|href)=[\"']?https?:|<script", page)

    def test_is_segmented_once_however_much_is_written(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        n_read = 0

        def counted(recording: Recording) -> Segmentation:
            def read() -> Iterator[tuple[int, NDArray[np.uint16]]]:
                nonlocal n_read
                for item in by_colour(recording).numbered():
                    n_read += 1
                    yield item

            return Segmentation(read, recording.size)

        monkeypatch.setattr(pipeline, "segmenter", lambda one: counted if isinstance(one, str) else one)
        assert run(folder / "movie.mkv", *outputs(folder)) == 0
        assert n_read == N

    def test_masks_alone(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert (
            run("--masks", folder / "masks", "--names", folder / "names.json", "--names", "2=goal", *outputs(folder))
            == 0
        )
        out = capsys.readouterr().out
        assert "goal, red <box>  0 2 0" in out
        assert dict(graphml.read(folder / "a.graphml").names)[2] == "goal"
        page = (folder / "a.html").read_text()
        assert "red &lt;box&gt;" in page
        assert "red <box>" not in page
        assert Recording.open(folder / "a.mp4").frames_per_second == 25

    def test_movie_with_masks_of_some_frames(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        for number in (1, 2, 4, 5):
            (folder / "masks" / f"{number:05d}.png").unlink()
        arguments = [folder / "movie.mkv", "--masks", folder / "masks", "--stride", 3, "--overlay", folder / "a.mp4"]
        assert run(*arguments) == 0
        assert capsys.readouterr().out.startswith("2 frames, 3 segments, 2 key frames")
        assert len(list(Recording.open(folder / "a.mp4"))) == N

    def test_names_of_computed_segments(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(folder / "movie.mkv", "--names", "2=goal") == 0
        assert "goal, red box" in capsys.readouterr().out
        (folder / "more.json").write_text(json.dumps({"2": "goal", "9": "never seen"}))
        assert run(folder / "movie.mkv", "--names", folder / "more.json") == 0
        assert "goal, red box" in capsys.readouterr().out
        refused(capsys, folder, [folder / "movie.mkv", "--names", "9=goal"], r"--names: .*\(0, 1, 2\), got 9")

    def test_older_files_are_replaced_only_by_whole_ones(self, folder: Path) -> None:
        (folder / "a.html").write_text("older")
        assert run(folder / "movie.mkv", "--html", folder / "a.html", "--masks", folder / "nothing") == 2
        assert (folder / "a.html").read_text() == "older"
        assert run(folder / "movie.mkv", "--html", folder / "a.html") == 0
        assert (folder / "a.html").read_text().startswith("<!DOCTYPE html>")

    def test_side_by_side(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        """Depth comes from the pair; here there is depth already, so that nothing has to be matched."""
        pair = np.concatenate([pushed(), pushed()], axis=2)
        write_movie(folder / "pair.mkv", pair, frames_per_second=10, lossless=True)
        np.save(folder / "depth.npy", np.ones((N, 48, 64), np.float32))
        camera = folder / "camera.json"
        camera.write_text('{"focal_length_px": 400, "principal_point_px": [32, 24], "baseline_m": 0.1}')
        arguments = ["--side-by-side", "--calibration", camera, "--depth", folder / "depth.npy"]
        assert run(folder / "pair.mkv", *arguments) == 0
        assert "key frame           0 3 5" in capsys.readouterr().out


def changed(folder: Path, number: int, change: Callable[[Path], object]) -> Path:
    """Masks of which one file is another."""
    change(folder / "masks" / f"{number:05d}.png")
    return folder / "masks"


class TestBadInput:
    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ([], "expected a movie or --masks, got neither"),
            (["{}/none.mp4"], "none.mp4: expected a movie, but there is no such file"),
            (["{}/names.json"], "names.json: expected a movie, but it cannot be read as one"),
            (["{}/masks", "--right", "{}/none"], "none: expected .*|--calibration: expected the camera"),
            (["{}/movie.mkv", "--side-by-side"], "--calibration: expected the camera of a stereo pair"),
            (["{}/movie.mkv", "--depth", "{}/none"], "none: expected a folder of depth pictures"),
            (["{}/movie.mkv", "--calibration", "{}/names.json"], "names.json: expected only focal_length_px"),
            (["{}/movie.mkv", "--masks", "{}/none"], "none: expected masks, but there is no such file or folder"),
            (["{}/movie.mkv", "--stride", "2"], "--stride: expected --masks beside it"),
            (["--masks", "{}/masks", "--depth", "{}/masks"], "--depth: expected a movie beside it"),
            (
                ["{}/movie.mkv", "--masks", "{}/masks", "--segmentation", "potts"],
                "--segmentation: expected none beside",
            ),
            (["--masks", "{}/masks", "--background", "sky"], "--background: expected the id of a segment, got 'sky'"),
            (["--masks", "{}/masks", "--names", "{}/none.json"], "none.json: expected names of segments"),
            (
                ["--masks", "{}/masks", "--names", "7=cup"],
                r"names: expected ids of segments that were seen \(0, 1, 2\), got 7",
            ),
            (["{}/movie.mkv", "--fps", "0"], "frames_per_second: expected a number above 0"),
        ],
    )
    def test_arguments(
        self, folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
    ) -> None:
        refused(capsys, folder, [argument.format(folder) for argument in arguments], message)

    @pytest.mark.parametrize(
        ("option", "place", "message"),
        [
            ("--html", "{}/no/a.html", "a.html: cannot be written, there is no folder"),
            ("--csv", "{}", "cannot be written, this is a directory"),
            ("--overlay", "{}/a.txt", r"{}/a\.txt: cannot be written \(no movie of this codec has the ending '.txt'\)"),
            ("--overlay", "{}/movie.mkv", "movie.mkv: expected another place for the output than that of the input"),
            ("--csv", "{}/a.graphml", "a.graphml: expected every file once, got it for two things"),
        ],
    )
    def test_outputs_that_cannot_be_written_are_told_before_the_movie_is_read(
        self,
        folder: Path,
        capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch,
        option: str,
        place: str,
        message: str,
    ) -> None:
        def fail(_: object) -> Iterator[Frame]:
            raise AssertionError("read")

        monkeypatch.setattr(Recording, "__iter__", fail)
        before = sorted(folder.iterdir())
        assert run(folder / "movie.mkv", "-o", folder / "a.graphml", option, place.format(folder)) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert re.search(message.format(re.escape(str(folder))), line), line
        assert sorted(folder.iterdir()) == before

    def test_zero_frames(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        with av.open(str(folder / "empty.avi"), "w") as container:
            stream = container.add_stream("libx264", rate=25)
            stream.width, stream.height = 64, 48
            container.start_encoding()
        refused(capsys, folder, [folder / "empty.avi"], "empty.avi: .*no frame")

    def test_size_that_changes_midway(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (folder / "frames").mkdir()
        for number, image in enumerate(pushed()):
            Image.fromarray(image[: 48 - 2 * (number == 3)]).save(folder / "frames" / f"{number}.png")
        refused(capsys, folder, [folder / "frames"], "frame 3: expected a picture of 48×64 as before, got 46×64")

    def test_corrupt_frame_is_named_and_skipped_on_request(
        self, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (folder / "frames").mkdir()
        for number, image in enumerate(pushed()):
            Image.fromarray(image).save(folder / "frames" / f"{number}.png")
        broken = folder / "frames" / "3.png"
        broken.write_bytes(broken.read_bytes()[:60])
        refused(capsys, folder, [folder / "frames"], r"3.png: .*\(frame 3\)")
        assert run(folder / "frames", "--skip-corrupt", *outputs(folder)) == 0
        out = capsys.readouterr().out
        assert out.startswith("5 frames, 3 segments, 3 key frames")
        assert "key frame           0 4 5" in out
        # With masks of all frames the chain knows frame 3, the pictures do not.
        assert run(folder / "frames", "--skip-corrupt", "--masks", folder / "masks", *outputs(folder)) == 0
        assert capsys.readouterr().out.startswith("6 frames, 3 segments, 3 key frames")
        assert "no picture" not in (folder / "a.html").read_text()
        refused(capsys, folder, [folder / "frames", "--masks", folder / "masks"], r"3.png: .*\(frame 3\)")

    def test_depth_that_is_not_a_number(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        depth = np.ones((N, 48, 64), np.float32)
        depth[4, 5, 6] = np.nan
        np.save(folder / "depth.npy", depth)
        arguments = [folder / "movie.mkv", "--depth", folder / "depth.npy"]
        refused(capsys, folder, [*arguments], "frame 4: depth: expected finite metres .* got nan")
        refused(capsys, folder, [*arguments, "--masks", folder / "masks"], "frame 4: depth: expected finite metres")

    def test_masks_of_another_size(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        masks = changed(folder, 2, lambda path: Image.fromarray(np.zeros((47, 64), np.uint8)).save(path))
        refused(capsys, folder, [folder / "movie.mkv", "--masks", masks], "00002.png|frame 2")
        write_movie(folder / "small.mkv", pushed()[:, :40], frames_per_second=10)
        refused(capsys, folder, [folder / "small.mkv", "--masks", masks], "40×64")

    def test_missing_mask(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        masks = changed(folder, 2, Path.unlink)
        refused(capsys, folder, [folder / "movie.mkv", "--masks", masks], "masks: .*2")

    def test_masks_of_frames_that_are_not_there(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        masks = np.ones((N + 1, 48, 64), np.uint8)
        masks[:, 8:24] = 2
        np.save(folder / "masks.npy", masks)
        refused(capsys, folder, [folder / "movie.mkv", "--masks", folder / "masks.npy"], "masks: .*got one of frame 6")

    def test_ids_beyond_16_bits(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        labels = np.zeros((1, 48, 64), np.int64)
        labels[0, 3, 4] = 65_536
        np.save(folder / "many.npy", labels)
        refused(capsys, folder, ["--masks", folder / "many.npy"], "65536")

    def test_left_and_right_of_different_length(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        camera = folder / "camera.json"
        camera.write_text('{"focal_length_px": 400, "principal_point_px": [32, 24], "baseline_m": 0.1}')
        np.save(folder / "depth.npy", np.ones((N, 48, 64), np.float32))
        for n in (N - 1, N + 1):
            frames = np.concatenate([pushed(), pushed()])[:n]
            write_movie(folder / "right.mkv", frames, frames_per_second=10)
            arguments = [folder / "movie.mkv", "--right", folder / "right.mkv", "--calibration", camera]
            refused(capsys, folder, [*arguments, "--depth", folder / "depth.npy"], "right.mkv: expected .*frames")

    def test_no_chain_of_one_segment(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        np.save(folder / "one.npy", np.zeros((3, 48, 64), np.uint8))
        refused(capsys, folder, ["--masks", folder / "one.npy"], "expected at least two segments, got 1")


class TestInterruption:
    @pytest.mark.parametrize("at", ["segmentation", "overlay"])
    def test_leaves_no_file(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], at: str
    ) -> None:
        def interrupted(recording: Recording) -> Segmentation:
            def read() -> Iterator[tuple[int, NDArray[np.uint16]]]:
                for number, labels in by_colour(recording).numbered():
                    if number == 3:
                        raise KeyboardInterrupt
                    yield number, labels

            return Segmentation(read, recording.size)

        if at == "segmentation":
            monkeypatch.setattr(pipeline, "segmenter", lambda one: interrupted if isinstance(one, str) else one)
        else:
            from sec_lab.viz import overlay

            def draw(*_: object) -> None:
                raise KeyboardInterrupt

            monkeypatch.setattr(overlay._Drawer, "_tell_frame", draw)
        before = sorted(folder.rglob("*"))
        assert run(folder / "movie.mkv", *outputs(folder)) == 130
        out, err = capsys.readouterr()
        assert (out, err) == ("", "sec-lab observe: interrupted\n")
        assert sorted(folder.rglob("*")) == before

    def test_termination_from_outside_leaves_no_file(self, folder: Path) -> None:
        masks = np.zeros((4000, 240, 320), np.uint8)
        masks[:, 20:60, 30:90] = 1
        masks[::2, 100:140, 30:90] = 2
        np.save(folder / "long.npy", masks)
        (folder / "out").mkdir()
        command = [
            sys.executable,
            "-m",
            "sec_lab.cli",
            "observe",
            "--over-time",
            "none",
            "--masks",
            f"{folder}/long.npy",
        ]
        with subprocess.Popen(
            [*command, *outputs(folder / "out")], stderr=subprocess.PIPE, env={**os.environ, "PYTHONWARNINGS": "error"}
        ) as process:
            deadline = time.monotonic() + 100
            while not any((folder / "out").iterdir()) and time.monotonic() < deadline:
                time.sleep(0.02)
            time.sleep(0.5)
            assert process.poll() is None, "it is still at work"
            process.send_signal(signal.SIGTERM)
            _, err = process.communicate(timeout=60)
        assert process.returncode == 130
        assert err == b"sec-lab observe: interrupted\n"
        assert list((folder / "out").iterdir()) == []
