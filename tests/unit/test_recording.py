"""Recordings from arrays, their calibration and the numbers of their frames."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from sec_lab.recording import Calibration, Frame, Recording, json_files, read_calibration
from sec_lab.recording.numbering import frame_numbers, natural_key
from tests.recorded import moving_texture, pictures_of, refused, save


class TestFromFrames:
    def test_streams_what_is_given(self) -> None:
        frames, depth = moving_texture(4), np.ones((4, 48, 64))
        recording = Recording.from_frames(frames, right=frames[::-1], depth=depth, frames_per_second=50)
        assert (len(recording), recording.size, recording.frames_per_second) == (4, (48, 64), 50)
        assert recording.has_right
        assert recording.has_depth
        for index, frame in enumerate(recording):
            assert (frame.index, frame.time_s) == (index, index / 50)
            np.testing.assert_array_equal(frame.image, frames[index])
            np.testing.assert_array_equal(frame.right, frames[3 - index])

    def test_frames_cannot_be_written_to(self) -> None:
        frames = moving_texture(1)
        (frame,) = Recording.from_frames(frames, right=frames, depth=np.ones((1, 48, 64)))
        for array in (frame.image, frame.right, frame.depth_m):
            with pytest.raises(ValueError, match="read-only"):
                array[0, 0] = 0  # type: ignore[index]
        frames[0, 0, 0] = 7  # the caller's own array stays writable

    def test_nothing_is_copied(self) -> None:
        frames = moving_texture(1)
        (frame,) = Recording.from_frames(frames)
        assert np.shares_memory(frame.image, frames)

    def test_can_be_sent_to_another_process(self) -> None:
        recording = pickle.loads(pickle.dumps(Recording.from_frames(moving_texture(2))))
        np.testing.assert_array_equal(pictures_of(recording), moving_texture(2))

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"frames": np.zeros((2, 4, 5), dtype=np.uint8)}, "frames: expected 4 dimensions"),
            ({"frames": np.zeros((2, 4, 5, 4), dtype=np.uint8)}, r"frames: expected shape \(n, height, width, 3\)"),
            ({"frames": np.zeros((2, 4, 5, 3))}, "of type uint8, got .* float64"),
            ({"frames": np.zeros((2, 0, 5, 3), dtype=np.uint8)}, "at least one frame and one pixel"),
            ({"right": np.zeros((3, 4, 5, 3), dtype=np.uint8)}, "right: expected 2 frames like the left, got 3"),
            (
                {"right": np.zeros((2, 5, 5, 3), dtype=np.uint8)},
                "right: expected pictures of 4×5 like the left, got 5×5",
            ),
            ({"depth": np.zeros((3, 4, 5))}, "depth: expected 2 depth pictures, got 3"),
            ({"depth": np.zeros((2, 5, 4))}, "frame 0: depth: expected 4×5"),
            ({"depth": np.full((2, 4, 5), np.nan)}, "frame 0: depth: expected finite metres"),
        ],
    )
    def test_bad_input(self, arguments: dict[str, object], message: str) -> None:
        given = {"frames": np.zeros((2, 4, 5, 3), dtype=np.uint8), **arguments}
        with pytest.raises(ValueError, match=message):
            list(Recording.from_frames(**given))  # type: ignore[arg-type]

    def test_frame_checks_its_parts(self) -> None:
        image = np.zeros((4, 5, 3), dtype=np.uint8)
        refused(lambda: Frame(0, image[:, :, 0]), "image: expected shape (height, width, 3)")
        refused(lambda: Frame(0, image, right=image[:2]), "right: expected a picture of 4×5 like the left, got 2×5")
        refused(lambda: Frame(0, image, depth_m=np.ones((4, 5))), "of type float32, got")  # type: ignore[arg-type]


class TestCalibration:
    def test_read(self, tmp_path: Path) -> None:
        file = tmp_path / "camera.json"
        file.write_text('{"focal_length_px": 400, "principal_point_px": [160, 128.5], "baseline_m": 0.12}')
        assert read_calibration(file) == Calibration(400.0, (160.0, 128.5), 0.12)
        frames = save(tmp_path / "movie", moving_texture(1))
        assert Recording.open(frames, calibration=file).calibration == Calibration(400, (160, 128.5), 0.12)

    @pytest.mark.parametrize(
        ("text", "reason"),
        [
            ("[1, 2]", "expected an object"),
            ("{", "it is no JSON"),
            ('{"focal_length_px": NaN}', "NaN is no number of JSON"),
            ('{"focal_length_px": 400}', "expected principal_point_px, but it is missing"),
            ('{"focal_length_px": 400, "principal_point_px": [1, 2], "baseline": 1}', "got 'baseline'"),
            (
                '{"focal_length_px": 0, "principal_point_px": [1, 2]}',
                "focal_length_px: expected a number above 0, got 0",
            ),
            ('{"focal_length_px": "4", "principal_point_px": [1, 2]}', "expected a finite number, got '4'"),
            ('{"focal_length_px": 1e999, "principal_point_px": [1, 2]}', "expected a finite number, got 'inf'"),
            (
                '{"focal_length_px": 1' + 400 * "0" + ', "principal_point_px": [1, 2]}',
                "expected a finite number, got '1000",
            ),
            ('{"focal_length_px": 4, "principal_point_px": [1]}', "expected (column, row), got [1]"),
            ('{"focal_length_px": 4, "principal_point_px": 3}', "expected (column, row), got 3"),
            (
                '{"focal_length_px": 4, "principal_point_px": [1, 2], "baseline_m": -1}',
                "baseline_m: expected a number above",
            ),
        ],
    )
    def test_bad_input(self, tmp_path: Path, text: str, reason: str) -> None:
        file = tmp_path / "camera.json"
        file.write_text(text)
        refused(lambda: read_calibration(file), file, reason)

    def test_hostile_json(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        file = tmp_path / "camera.json"
        file.write_text("[" * 100_000)
        refused(lambda: read_calibration(file), file, "nested too deeply")
        monkeypatch.setattr(json_files, "MAX_CONTAINERS", 1000)
        file.write_text("[" + "[]," * 2000 + "[]]")
        refused(lambda: read_calibration(file), file, "at most 1000 lists and objects, got 2002")
        monkeypatch.setattr(json_files, "MAX_VALUES", 1000)
        file.write_text("[" + "1," * 2000 + "1]")
        refused(lambda: read_calibration(file), file, "at most 1000 values, got 2000")


class TestNumbering:
    @pytest.mark.parametrize(
        ("names", "numbers"),
        [
            (["9.png", "10.png"], (9, 10)),
            (["cam2_f008_left.png", "cam2_f009_left.png"], (8, 9)),
            (["video1_7.png"], (7,)),
            (["a.png", "b.png"], None),
            (["a1.png", "b2.png"], None),
            (["1_1.png", "2_2.png"], None),
            (["1.png", "x.png"], None),
        ],
    )
    def test_frame_numbers(self, names: list[str], numbers: tuple[int, ...] | None) -> None:
        assert sorted(names, key=natural_key) == names
        assert frame_numbers(names) == numbers
