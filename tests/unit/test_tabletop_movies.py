"""Rendered movies and their files: the same seed gives the same, and picture, labels and depth agree."""

import numpy as np
import pytest

from sec_lab.files import UnusableFileError
from sec_lab.recording import Recording, read_calibration
from sec_lab.worlds.tabletop.__main__ import main
from sec_lab.worlds.tabletop.camera import Camera, Sensor, eye_poses, project
from sec_lab.worlds.tabletop.lights import Lighting
from sec_lab.worlds.tabletop.make import make_movie
from sec_lab.worlds.tabletop.plan import Actor, Plan, pose, still
from sec_lab.worlds.tabletop.scene import far_table, stage
from sec_lab.worlds.tabletop.shapes import rounded_box
from sec_lab.worlds.tabletop.truth import Truth, contact_relations, read_truth, write_truth

GREEN, RED = (np.full((4, 4, 3), colour, dtype=np.uint8) for colour in ((40, 120, 60), (200, 40, 40)))


@pytest.fixture(scope="module")
def plan():
    """A red box that jumps from the left to the right, then is gone, beside one that rests."""
    box = rounded_box((0.06, 0.06, 0.05), 0.004, RED)
    paths = np.stack([pose((x, 0.0, 0.0)) for x in (-0.1, 0.1, 0.1)])
    jumping = Actor("box", (box, box), paths, np.array([0, 1, -1]))
    lighting = Lighting((0.3, -0.2, 1.9), 0.2, 1, 2.0, (1.0, 1.0, 1.0), 0.6)
    camera = Camera(size_px=(80, 64))
    resting = still("rest", box, pose((0.0, 0.12, 0.0)), 3)
    return Plan("boxes", (jumping, resting), far_table(GREEN), camera, lighting, Sensor(), 4)


@pytest.fixture(scope="module")
def movie(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("movies") / "boxes"
    return folder, make_movie(folder, plan)


def test_labels_follow_the_bodies(plan, movie) -> None:
    _, truth = movie
    assert dict(truth.names) == {1: "table", 2: "box", 3: "rest"}
    assert truth.labels.shape == (3, 64, 80)
    for frame, x in ((0, -0.1), (1, 0.1)):
        rows, columns = np.nonzero(truth.labels[frame] == 2)
        expected = project(plan.camera, np.array([(x, 0.0, 0.025)]))[0]
        assert (columns.mean(), rows.mean()) == pytest.approx(expected, abs=1.5)
    assert set(np.unique(truth.labels[2])) == {1, 3}


def test_depth_is_that_of_the_table(plan, movie) -> None:
    _, truth = movie
    eye = eye_poses(plan.camera)[0]
    for x, y in ((0.1, 0.1), (-0.15, -0.05), (0.0, -0.1)):
        column, row = np.round(project(plan.camera, np.array([(x, y, 0.0)]))[0]).astype(int)
        assert truth.labels[2, row, column] == 1
        direction = np.linalg.inv(eye[:3, :3].T) @ [
            (column - 39.5) / (40 / np.tan(np.deg2rad(22))),
            (row - 31.5) / (40 / np.tan(np.deg2rad(22))),
            1.0,
        ]
        # Along a ray whose third coordinate in the eye is 1, the distance to the plane z = 0 is the depth.
        assert truth.depth_mm[2, row, column] == pytest.approx(-1000 * eye[2, 3] / direction[2], abs=2)


def test_colours_agree_with_labels(plan, movie) -> None:
    folder, truth = movie
    frames = np.stack([frame.image for frame in Recording.open(folder / "left.mp4")])
    box = frames[0][truth.labels[0] == 2].astype(float).mean(axis=0)
    table = frames[0][truth.labels[0] == 1].astype(float).mean(axis=0)
    assert box[0] > 1.5 * box[1]
    assert table[1] > 1.2 * table[0]


def test_the_right_eye_sees_near_things_further_left(plan) -> None:
    with stage(plan) as scene:
        scene.pose(0)
        left, right = (scene.colour(eye).astype(int) for eye in (0, 1))
    red = [np.nonzero(picture[..., 0] > 1.5 * picture[..., 1])[1] for picture in (left, right)]
    assert len(red[0]) > 100
    assert red[0].mean() > red[1].mean() + 5


@pytest.fixture(scope="module")
def again(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("movies") / "again"
    make_movie(folder, plan)
    return folder


def test_the_same_plan_gives_the_same_files(movie, again) -> None:
    folder, _ = movie
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["calibration.json", "left.mp4", "names.json", "right.mp4", "truth.npz"]
    for name in names:
        assert (folder / name).read_bytes() == (again / name).read_bytes(), name


def test_calibration_is_read_back(movie) -> None:
    folder, _ = movie
    known = read_calibration(folder / "calibration.json")
    assert known.focal_length_px == pytest.approx(40 / np.tan(np.deg2rad(22)))
    assert known.baseline_m == 0.12


def test_truth_is_read_back(movie) -> None:
    folder, truth = movie
    again = read_truth(folder)
    for name in ("labels", "depth_mm", "pairs", "touching"):
        assert (getattr(again, name) == getattr(truth, name)).all()
    assert dict(again.names) == dict(truth.names)


def test_relations_by_contact(movie) -> None:
    _, truth = movie
    assert truth.pairs.tolist() == [[1, 2], [1, 3], [2, 3]]
    assert contact_relations(truth).tolist() == [[2, 2, 0], [2, 2, 0], [9, 2, 9]]


def test_any_depth_survives_the_file(tmp_path) -> None:
    rng = np.random.default_rng(0)
    truth = Truth(
        rng.integers(0, 256, (4, 5, 6)), rng.integers(0, 2**16, (4, 5, 6)), [(1, 2)], [[True]] * 4, {1: "a", 2: "b"}
    )
    write_truth(tmp_path, truth)
    again = read_truth(tmp_path)
    assert (again.labels == truth.labels).all()
    assert (again.depth_mm == truth.depth_mm).all()


def test_damaged_truth_is_refused(movie, tmp_path) -> None:
    folder, _ = movie
    content = (folder / "truth.npz").read_bytes()
    (tmp_path / "names.json").write_bytes((folder / "names.json").read_bytes())
    for damaged in (b"", content[: len(content) // 2], content[:200] + b"x" * 50 + content[250:]):
        (tmp_path / "truth.npz").write_bytes(damaged)
        with pytest.raises(UnusableFileError, match=r"truth\.npz"):
            read_truth(tmp_path)


def test_truth_refuses_arrays_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match="depth_mm"):
        Truth(np.zeros((2, 3, 4)), np.zeros((2, 3, 5)), [(1, 2)], [[True], [True]], {})
    with pytest.raises(ValueError, match="touching"):
        Truth(np.zeros((2, 3, 4)), np.zeros((2, 3, 4)), [(1, 2)], [[True]], {})


@pytest.mark.parametrize("wrong", [["--seed", "-1"], ["--size", "17", "16"], ["--action", "juggling"], ["--jobs", "0"]])
def test_bad_input_ends_with_code_2_and_one_line(wrong, tmp_path, capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path / "movies"), *wrong])
    assert ended.value.code == 2
    assert "error: " in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.slow
def test_the_command_line_makes_movies_side_by_side(tmp_path) -> None:
    wanted = ["--action", "moving_object", "--version", "2", "--seed", "3", "--size", "64", "48"]
    assert main([str(tmp_path), *wanted, "--jobs", "2"]) == 0
    for name in ("moving_object_2_kitchen", "moving_object_2_laboratory"):
        truth = read_truth(tmp_path / name)
        assert {"hand", "fruit", "plate"} <= set(truth.names.values())
        assert truth.labels.shape[1:] == (48, 64)
