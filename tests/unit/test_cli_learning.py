"""``sec-lab learn`` and ``sec-lab find``."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import sec_lab as sl
from sec_lab import recording
from sec_lab.cli import main
from sec_lab.graphml import read_model
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph

DATASETS = Path(__file__).parents[2] / "datasets" / "tabletop_actions"
PUTTING = {(1, 2): [0, 2, 2, 0], (2, 3): [0, 0, 2, 2]}


def write_movie(path, rows=PUTTING, *, first=0, names=None):
    graphs = []
    for column in zip(*rows.values(), strict=True):
        relations = np.zeros((3, 3))
        for (a, b), code in zip(rows, column, strict=True):
            relations[a - 1, b - 1] = relations[b - 1, a - 1] = code
        graphs.append(SceneGraph([1, 2, 3], relations, [[0, 0], [1, 1], [2, 2]]))
    frames = range(first, first + 10 * len(graphs), 10)
    sl.graphml.write(path, Observation(graphs, frames, names or {1: "hand", 2: "cup", 3: "plate"}))


@pytest.fixture
def chains(tmp_path):
    for number in (1, 2):
        write_movie(tmp_path / f"putting_{number}.graphml", first=number)
    return [str(tmp_path / f"putting_{number}.graphml") for number in (1, 2)]


def test_learn_shows_and_keeps_the_model(chains, tmp_path, capsys):
    file = tmp_path / "putting.graphml"
    assert main(["learn", *chains, "-o", str(file)]) == 0
    shown = capsys.readouterr().out
    assert shown.splitlines()[0] == "model of 2 demonstrations: 2 rows, 4 columns"
    assert "cup, hand      0    2    2    0  1.00" in shown
    model = read_model(file)
    assert model.demonstrations == ("putting_1", "putting_2")
    assert model.key_frames.tolist() == [[1, 11, 21, 31], [2, 12, 22, 32]]


def test_online_says_what_was_passed_over(chains, tmp_path, capsys):
    write_movie(tmp_path / "shaking.graphml", {(1, 3): [2, 0, 2, 0, 2, 0, 2], (1, 2): [2, 0, 2, 0, 2, 0, 0]})
    file = tmp_path / "model.graphml"
    arguments = ["learn", *chains, str(tmp_path / "shaking.graphml"), "--mode", "online", "-o", str(file)]
    assert main(arguments) == 0
    assert "not type-similar: shaking" in capsys.readouterr().out


def test_find_says_when_an_action_begins_and_ends(chains, tmp_path, capsys):
    file = tmp_path / "putting.graphml"
    main(["learn", *chains, "-o", str(file)])
    capsys.readouterr()
    assert main(["find", str(file), chains[0]]) == 0
    assert capsys.readouterr().out == "putting  from frame     11 to     31  (100 %)\n"
    assert main(["find", str(file), chains[0], "--online"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0].startswith("frame     11  putting may have begun")
    assert told[-1].startswith("frame     31  putting ends, began in frame 11")
    write_movie(tmp_path / "still.graphml", {(1, 2): [2, 0], (2, 3): [0, 0]})
    assert main(["find", str(file), str(tmp_path / "still.graphml")]) == 0
    assert capsys.readouterr().out == "nothing found\n"


@pytest.mark.slow
def test_find_in_a_stereo_movie(tmp_path, capsys):
    """Two files or side by side: the same is found; online it is told in the frame in which it happens."""
    folder = DATASETS / "moving_object_2_laboratory"
    left, right = (
        np.stack([frame.image for frame in sl.Recording.open(folder / f"{name}.mp4")]) for name in ("left", "right")
    )
    for name, frames in (("left", left), ("right", right), ("both", np.concatenate([left, right], axis=2))):
        recording.write_movie(tmp_path / f"{name}.mkv", frames, frames_per_second=25, lossless=True)
    calibration = ["--calibration", str(folder / "calibration.json")]
    pair = [str(tmp_path / "left.mkv"), "--right", str(tmp_path / "right.mkv"), *calibration]
    one, two, model = (str(tmp_path / name) for name in ("one.graphml", "two.graphml", "moving.graphml"))
    assert main(["observe", *pair, "-o", one]) == 0
    shutil.copy(one, two)
    assert main(["learn", one, two, "-o", model]) == 0
    capsys.readouterr()
    assert main(["find", model, *pair]) == 0
    found = capsys.readouterr().out
    assert found.startswith("moving  from frame")
    assert main(["find", model, str(tmp_path / "both.mkv"), "--side-by-side", *calibration]) == 0
    assert capsys.readouterr().out == found
    assert main(["find", model, *pair, "--online"]) == 0
    told = capsys.readouterr().out
    assert main(["find", model, one, "--online"]) == 0
    assert told == capsys.readouterr().out != ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["learn", "{one}", "-o", "{new}"], "demonstrations: expected at least two, got 1"),
        (["learn", "{one}", "{one}", "-o", "{new}"], "expected every chain once, got it twice"),
        (["learn", "{one}", "{two}", "-o", "{new}", "--threshold", "2"], "weight_threshold: expected 0 to 1, got 2.0"),
        (["learn", "{one}", "missing.graphml", "-o", "{new}"], "missing.graphml"),
        (["find", "{one}", "{two}"], "expected the model of an action, got what was seen in a movie"),
        (["find", "missing.graphml", "{two}"], "missing.graphml"),
    ],
)
def test_bad_input_is_one_line(chains, tmp_path, capsys, arguments, message):
    places = {"one": chains[0], "two": chains[1], "new": str(tmp_path / "new.graphml")}
    assert main([argument.format(**places) for argument in arguments]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not (tmp_path / "new.graphml").exists()
