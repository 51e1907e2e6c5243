"""Movies: read frame by frame, joined from several cameras, refused where they are damaged; written."""

import itertools
import json
import struct
import subprocess
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from sec_lab.files import UnusableFileError
from sec_lab.recording import Calibration, Recording, movies, write_movie
from tests.recorded import Pictures, movie_of, moving_texture, pictures_of, refused, save


class TestMovies:
    def test_frames_are_those_that_were_written(self, tmp_path: Path) -> None:
        frames = moving_texture(12)
        path = movie_of(tmp_path / "movie.mp4", frames, codec="libx264rgb", layout="rgb24")
        recording = Recording.open(path)
        assert (len(recording), recording.size, recording.frames_per_second) == (12, (48, 64), 25)
        assert not recording.has_right
        assert not recording.has_depth
        # x264 in RGB loses little at its default quality.
        assert np.abs(pictures_of(recording).astype(int) - frames).mean() < 12
        assert [frame.index for frame in recording] == list(range(12))
        np.testing.assert_allclose([frame.time_s for frame in recording], np.arange(12) / 25)  # type: ignore[arg-type]

    def test_is_read_anew_with_every_iteration(self, tmp_path: Path) -> None:
        recording = Recording.open(movie_of(tmp_path / "movie.mp4", moving_texture(8)))
        first, second = iter(recording), iter(recording)
        next(first)
        np.testing.assert_array_equal(next(first).image, list(itertools.islice(second, 2))[1].image)
        np.testing.assert_array_equal(pictures_of(recording), pictures_of(recording))

    def test_times_of_the_container(self, tmp_path: Path) -> None:
        times = [0, 4, 8, 20, 50]
        path = movie_of(tmp_path / "movie.mkv", moving_texture(5), times=times)
        np.testing.assert_allclose([frame.time_s for frame in Recording.open(path)], np.array(times) / 100)  # type: ignore[arg-type]
        steady = Recording.open(path, frames_per_second=10)
        np.testing.assert_allclose([frame.time_s for frame in steady], np.arange(5) / 10)  # type: ignore[arg-type]

    def test_times_begin_with_the_first_frame(self, tmp_path: Path) -> None:
        path = movie_of(tmp_path / "movie.mkv", moving_texture(3), times=[300, 304, 308])
        np.testing.assert_allclose([frame.time_s for frame in Recording.open(path)], [0, 0.04, 0.08])  # type: ignore[arg-type]

    def test_number_of_frames_may_be_unknown(self, tmp_path: Path) -> None:
        recording = Recording.open(movie_of(tmp_path / "movie.mkv", moving_texture(5)))
        assert recording.n_frames is None
        with pytest.raises(TypeError, match="is not known"):
            len(recording)
        assert len(list(recording)) == 5

    def test_turned_as_a_telephone_is_held(self, tmp_path: Path) -> None:
        """The track header's matrix says x' = h − y, y' = x: a quarter turn clockwise."""
        frames = moving_texture(3)
        path = movie_of(tmp_path / "movie.mp4", frames)
        upright = pictures_of(Recording.open(path))
        content = bytearray(path.read_bytes())
        at = content.index(b"tkhd") + 4 + 4 + 20 + 8 + 8
        one = 1 << 16
        assert struct.unpack(">9i", content[at : at + 36]) == (one, 0, 0, 0, one, 0, 0, 0, 1 << 30)
        content[at : at + 36] = struct.pack(">9i", 0, one, 0, -one, 0, 0, 48 * one, 0, 1 << 30)
        path.write_bytes(content)
        turned = Recording.open(path)
        assert turned.size == (64, 48)
        row, column = 5, 7
        np.testing.assert_array_equal(pictures_of(turned)[:, column, 47 - row], upright[:, row, column])

    def test_side_by_side(self, tmp_path: Path) -> None:
        path = movie_of(tmp_path / "movie.mp4", moving_texture(4))
        whole = pictures_of(Recording.open(path))
        both = Recording.open(path, stereo="side by side")
        assert both.size == (48, 32)
        assert both.has_right
        for frame, image in zip(both, whole, strict=True):
            assert frame.right is not None
            np.testing.assert_array_equal(np.hstack([frame.image, frame.right]), image)

    def test_two_movies(self, tmp_path: Path) -> None:
        left = movie_of(tmp_path / "left.mp4", moving_texture(4))
        right = movie_of(tmp_path / "right.mp4", moving_texture(4, seed=1))
        recording = Recording.open(left, right=right, calibration=Calibration(300, (32, 24), 0.1))
        assert recording.has_right
        assert recording.calibration == Calibration(300, (32, 24), 0.1)
        alone = pictures_of(Recording.open(right))
        for frame, image in zip(recording, alone, strict=True):
            np.testing.assert_array_equal(frame.right, image)


class TestCorruptMovies:
    N = 30

    @pytest.fixture(params=[("mpeg4", "mp4", "yuv420p"), ("libx264", "mp4", "yuv420p"), ("mjpeg", "avi", "yuvj420p")])
    def movie(self, request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, int]:
        """Movie whose packet in the middle holds noise, and the number of its frame."""
        codec, suffix, layout = request.param
        path = movie_of(tmp_path / f"movie.{suffix}", moving_texture(self.N), codec=codec, layout=layout)
        with av.open(str(path)) as container:
            packets = [packet for packet in container.demux() if packet.size]
        shown = sorted(packet.pts for packet in packets if packet.pts is not None)
        packet = packets[self.N // 2]
        assert packet.pts is not None
        assert packet.pos is not None
        content = bytearray(path.read_bytes())
        noise = np.random.default_rng(1).integers(0, 256, packet.size - 8, dtype=np.uint8)
        content[packet.pos + 8 : packet.pos + packet.size] = noise.tobytes()
        path.write_bytes(content)
        return path, shown.index(packet.pts)

    def test_corrupt_frame_is_named(self, movie: tuple[Path, int]) -> None:
        path, lost = movie
        seen: list[int] = []

        def read() -> None:
            for frame in Recording.open(path):
                seen.append(frame.index)

        refused(read, f"{path}: frame {lost}: expected an intact picture, but it is corrupt")
        assert seen == list(range(lost))

    def test_rest_goes_on_on_request(self, movie: tuple[Path, int]) -> None:
        path, lost = movie
        recording = Recording.open(path, on_corrupt="skip")
        assert [frame.index for frame in recording] == [index for index in range(self.N) if index != lost]
        for frame in recording:
            assert frame.time_s == pytest.approx(frame.index / 25)

    def test_second_camera_with_the_corrupt_frame(self, movie: tuple[Path, int], tmp_path: Path) -> None:
        path, lost = movie
        sound = movie_of(tmp_path / "sound.mp4", moving_texture(self.N))
        others = [index for index in range(self.N) if index != lost]
        recording = Recording.open(sound, right=path, on_corrupt="skip")
        assert [frame.index for frame in recording] == others
        refused(lambda: list(Recording.open(sound, right=path)), path, f"frame {lost}")
        alone = pictures_of(Recording.open(sound))
        np.testing.assert_array_equal(pictures_of(recording), alone[others])

    def test_movie_that_was_cut_off(self, tmp_path: Path) -> None:
        path = movie_of(tmp_path / "movie.mp4", moving_texture(self.N))
        with (
            av.open(str(path)) as source,
            av.open(str(tmp_path / "fast.mp4"), "w", options={"movflags": "faststart"}) as out,
        ):
            stream = out.add_stream_from_template(source.streams.video[0])
            for packet in source.demux():
                if packet.size:
                    packet.stream = stream
                    out.mux(packet)
        content = (tmp_path / "fast.mp4").read_bytes()
        path.write_bytes(content[: len(content) * 3 // 4])
        refused(lambda: list(Recording.open(path)), path)
        assert 0 < len(list(Recording.open(path, on_corrupt="skip"))) < self.N

    def test_matroska_that_was_cut_off(self, tmp_path: Path) -> None:
        path = movie_of(tmp_path / "movie.mkv", moving_texture(self.N))
        content = path.read_bytes()
        path.write_bytes(content[: len(content) * 3 // 4])
        refused(lambda: list(Recording.open(path)), path, "expected 1.2 seconds as its header says")
        assert 0 < len(list(Recording.open(path, on_corrupt="skip"))) < self.N

    @pytest.mark.parametrize("place", [-1, -2, -3])
    def test_corrupt_frame_at_the_end(self, tmp_path: Path, place: int) -> None:
        """Decoders with several threads keep errors at the end to themselves."""
        path = movie_of(tmp_path / "movie.mp4", moving_texture(self.N))
        with av.open(str(path)) as container:
            packets = [packet for packet in container.demux() if packet.size]
        lost = sorted(packet.pts or 0 for packet in packets).index(packets[place].pts or 0)
        position, size = packets[place].pos, packets[place].size
        assert position is not None
        content = bytearray(path.read_bytes())
        content[position + 4 : position + size] = b"\xff" * (size - 4)
        path.write_bytes(content)
        refused(lambda: list(Recording.open(path)), path, f"frame {lost}")
        assert {frame.index for frame in Recording.open(path, on_corrupt="skip")} == {*range(self.N)} - {lost}

    def test_medium_that_fails(self) -> None:
        """What was read until then is given; then comes the error, unless corrupt frames are left out."""

        class Failing:
            streams = type("Streams", (), {"video": [None]})

            def demux(self, _: object) -> Iterator["av.Packet[Any]"]:
                yield av.Packet(b"picture")
                raise av.error.OSError(5, "Input/output error")

        packets = movies._packets(Path("movie.mkv"), Failing(), skip_corrupt=False)  # type: ignore[arg-type]
        assert next(packets) is not None
        assert next(packets) is None
        refused(lambda: next(packets), "movie.mkv: it cannot be read to its end (Input/output error)")
        packets = movies._packets(Path("movie.mkv"), Failing(), skip_corrupt=True)  # type: ignore[arg-type]
        assert [packet is None for packet in packets] == [False, True]


class TestWhatIsNoMovie:
    def test_no_such_file(self, tmp_path: Path) -> None:
        refused(lambda: Recording.open(tmp_path / "no.mp4"), tmp_path / "no.mp4", "there is no such file")

    @pytest.mark.parametrize("content", [b"", b"hello, world\n" * 100, bytes(5000)])
    def test_not_a_movie(self, tmp_path: Path, content: bytes) -> None:
        path = tmp_path / "movie.mp4"
        path.write_bytes(content)
        refused(lambda: Recording.open(path), path, "expected a movie")

    def test_sound_alone(self, tmp_path: Path) -> None:
        path = tmp_path / "sound.wav"
        with av.open(str(path), "w") as container:
            stream = container.add_stream("pcm_s16le", rate=8000)
            sound = av.AudioFrame.from_ndarray(np.zeros((1, 800), dtype=np.int16), layout="mono")
            sound.sample_rate = 8000
            container.mux(stream.encode(sound))
        refused(lambda: Recording.open(path), path, "it has no pictures")

    def test_movie_without_frames(self, tmp_path: Path) -> None:
        path = tmp_path / "movie.avi"
        with av.open(str(path), "w") as container:
            stream = container.add_stream("libx264", rate=25)
            stream.width, stream.height = 64, 48
            container.start_encoding()
        refused(lambda: Recording.open(path), path, "no frame")

    def test_playlist_reaches_for_nothing_else(self, tmp_path: Path) -> None:
        """A playlist may not name an address: it is refused without a look at the net."""
        path = tmp_path / "movie.m3u8"
        path.write_text("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n#EXT-X-ENDLIST\n")
        refused(lambda: Recording.open(path), path, "expected a movie")

    def test_size_that_changes_midway(self, tmp_path: Path) -> None:
        small = movie_of(tmp_path / "a.mjpeg", moving_texture(3), codec="mjpeg", layout="yuvj420p")
        large = movie_of(tmp_path / "b.mjpeg", moving_texture(3, 56, 72), codec="mjpeg", layout="yuvj420p")
        path = tmp_path / "movie.mjpeg"
        path.write_bytes(small.read_bytes() + large.read_bytes())
        with pytest.raises(ValueError, match=r"movie.mjpeg: frame 3: expected a picture of 48×64 as before, got 56×72"):
            list(Recording.open(path))

    @pytest.mark.parametrize(("left", "right"), [("mp4", "mp4"), ("mkv", "mkv"), ("mkv", "mp4")])
    @pytest.mark.parametrize("longer", ["left", "right"])
    def test_left_and_right_of_different_length(self, tmp_path: Path, left: str, right: str, longer: str) -> None:
        one = movie_of(tmp_path / f"left.{left}", moving_texture(6 if longer == "left" else 4))
        other = movie_of(tmp_path / f"right.{right}", moving_texture(6 if longer == "right" else 4))
        refused(
            lambda: list(Recording.open(one, right=other)), other, "frames like the left" if longer == "right" else ""
        )

    def test_left_and_right_of_different_size(self, tmp_path: Path) -> None:
        one = movie_of(tmp_path / "left.mp4", moving_texture(2))
        other = movie_of(tmp_path / "right.mp4", moving_texture(2, 64, 48))
        refused(lambda: Recording.open(one, right=other), other, "48×64 like the left, got 64×48")

    def test_options(self, tmp_path: Path) -> None:
        path = movie_of(tmp_path / "movie.mp4", moving_texture(2, 48, 66))
        odd = save(tmp_path / "odd", moving_texture(1, 4, 5))
        refused(lambda: Recording.open(path, stereo="above"), "stereo: expected one of")  # type: ignore[arg-type]
        refused(lambda: Recording.open(path, stereo="side by side", right=path), "right: expected none")
        refused(lambda: Recording.open(odd, stereo="side by side"), odd, "expected an even width", 5)
        refused(lambda: Recording.open(path, on_corrupt="stop"), "on_corrupt: expected one of")  # type: ignore[arg-type]
        for number in (0, -1, float("nan"), float("inf")):
            refused(lambda number=number: Recording.open(path, frames_per_second=number), "frames_per_second", number)  # type: ignore[misc]
            refused(lambda number=number: Recording.open(path, depth_unit_m=number), "depth_unit_m", number)  # type: ignore[misc]


class TestWriting:
    def test_lossless(self, tmp_path: Path) -> None:
        for shape in ((48, 64), (47, 63)):
            frames = moving_texture(4, *shape)
            path = tmp_path / "movie.mp4"
            write_movie(path, frames, frames_per_second=Fraction(30000, 1001), lossless=True)
            recording = Recording.open(path)
            np.testing.assert_array_equal(pictures_of(recording), frames)
            assert recording.frames_per_second == pytest.approx(30000 / 1001)
            assert len(recording) == 4

    @pytest.mark.parametrize(("shape", "layout"), [((48, 64), "yuv420p"), ((47, 63), "yuv444p")])
    def test_lossy(self, tmp_path: Path, shape: tuple[int, int], layout: str) -> None:
        rows, columns = np.ogrid[: shape[0], : shape[1]]
        smooth = np.stack([rows * 4 + 0 * columns, columns * 3 + 0 * rows, rows + columns], axis=2).astype(np.uint8)
        path = tmp_path / "movie.mp4"
        write_movie(path, [smooth] * 3, frames_per_second=12.5)
        recording = Recording.open(path)
        assert recording.size == shape
        assert np.abs(pictures_of(recording).astype(int) - smooth).mean() < 3
        assert [frame.time_s for frame in recording] == pytest.approx([0, 0.08, 0.16])
        with av.open(str(path)) as container:
            assert container.streams.video[0].codec_context.pix_fmt == layout

    def test_quality(self, tmp_path: Path) -> None:
        sizes = []
        for crf in (10, 40):
            write_movie(tmp_path / "movie.mp4", moving_texture(5), frames_per_second=25, crf=crf)
            sizes.append((tmp_path / "movie.mp4").stat().st_size)
        assert sizes[0] > 3 * sizes[1]

    def test_same_frames_give_the_same_bytes(self, tmp_path: Path) -> None:
        for name in ("a.mp4", "b.mp4"):
            write_movie(tmp_path / name, moving_texture(20), frames_per_second=25)
        assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()

    def test_still_noisy_frames_give_the_same_bytes_every_time(self, tmp_path: Path) -> None:
        # x264 left to itself writes about ten different movies of these frames where there is AVX-512.
        rng = np.random.default_rng(0)
        frames = np.full((25, 64, 96, 3), (40, 120, 60), dtype=np.float64)
        frames[:, 20:40, 5:25] = (200, 40, 40)
        noisy = np.clip(np.round(frames + 1.5 * rng.standard_normal(frames.shape)), 0, 255).astype(np.uint8)
        written = set()
        for _ in range(12):
            write_movie(tmp_path / "movie.mp4", noisy, frames_per_second=25)
            written.add((tmp_path / "movie.mp4").read_bytes())
        assert len(written) == 1

    def frames_then(self, error: BaseException) -> Iterator[Pictures]:
        yield from moving_texture(70)
        raise error

    @pytest.mark.parametrize("older", [False, True])
    @pytest.mark.parametrize(
        "error", [KeyboardInterrupt(), ValueError("frame 70: broken"), UnusableFileError("in.mp4: no")]
    )
    def test_whole_or_not_at_all(self, tmp_path: Path, older: bool, error: BaseException) -> None:
        path = tmp_path / "movie.mp4"
        if older:
            path.write_text("old")
        with pytest.raises(type(error)) as raised:
            write_movie(path, self.frames_then(error), frames_per_second=25)
        assert raised.value is error
        assert [(file, file.read_text()) for file in tmp_path.iterdir()] == ([(path, "old")] if older else [])

    @pytest.mark.parametrize(
        ("frames", "options", "reason"),
        [
            ([], {}, "expected at least one frame, got none"),
            ([moving_texture(1)[0], moving_texture(1, 46)[0]], {}, "frame 1: expected shape (48, 64, 3) as before"),
            ([np.zeros((4, 4, 4), dtype=np.uint8)], {}, "frame 0: expected shape (height, width, 3)"),
            ([np.zeros((4, 4, 3))], {}, "of type uint8, got (4, 4, 3) of float64"),
            ([], {"frames_per_second": 0}, "frames_per_second: expected a number above 0"),
            ([], {"frames_per_second": float("nan")}, "frames_per_second: expected a number above 0"),
            ([], {"preset": "hasty"}, "preset: expected one of"),
            ([], {"crf": 60}, "crf: expected a number from 0 to 51, got 60"),
        ],
    )
    def test_bad_input(self, tmp_path: Path, frames: list[Pictures], options: dict[str, Any], reason: str) -> None:
        refused(lambda: write_movie(tmp_path / "movie.mp4", frames, **{"frames_per_second": 25, **options}), reason)
        assert list(tmp_path.iterdir()) == []

    def test_places_that_cannot_be_written_to(self, tmp_path: Path) -> None:
        frames = moving_texture(1)
        refused(lambda: write_movie(tmp_path / "no" / "m.mp4", frames, frames_per_second=25), "there is no folder")
        refused(lambda: write_movie(tmp_path, frames, frames_per_second=25), "this is a directory")
        for name in ("movie", "movie.txt", "movie.wav"):
            refused(lambda name=name: write_movie(tmp_path / name, frames, frames_per_second=25), tmp_path / name)  # type: ignore[misc]
        assert list(tmp_path.iterdir()) == []


LONG = """
import resource, sys, time
from itertools import islice
from pathlib import Path
from sec_lab.recording import Recording
import sec_lab.recording.movies

def most_kilobytes():
    # Unlike what the system counts for the process, this begins anew with the program.
    return int(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))

begin = time.perf_counter()
recording = Recording.open(sys.argv[1])
seconds = time.perf_counter() - begin
frames = iter(recording)
for frame in islice(frames, 40):
    pass
early = most_kilobytes()
for frame in islice(frames, 260):
    pass
print(len(recording), *recording.size, seconds, early, most_kilobytes(), frame.index)
"""


def test_an_hour_opens_at_once_and_streams_in_bounded_memory(tmp_path: Path) -> None:
    """A second of 1280×720 is encoded once, and its packets are written 3600 times with their times moved on."""
    second, hour = tmp_path / "second.mp4", tmp_path / "hour.mp4"
    frames = np.full((25, 720, 1280, 3), 90, dtype=np.uint8)
    for index, image in enumerate(frames):
        image[300:400, 40 * index : 40 * index + 100] = 200, 30, 30
    write_movie(second, frames, frames_per_second=25)
    with av.open(str(second)) as source, av.open(str(hour), "w") as out:
        template = source.streams.video[0]
        stream = out.add_stream_from_template(template)
        packets = [(bytes(p), p.pts, p.dts, p.is_keyframe) for p in source.demux(template) if p.size]
        unit = template.time_base
        assert template.duration is not None
        assert unit is not None
        for repetition in range(3600):
            for content, pts, dts, is_keyframe in packets:
                assert pts is not None
                assert dts is not None
                packet = av.Packet(content)
                packet.stream, packet.time_base, packet.is_keyframe = stream, unit, is_keyframe
                packet.pts, packet.dts = pts + repetition * template.duration, dts + repetition * template.duration
                out.mux(packet)
    done = subprocess.run([sys.executable, "-c", LONG, str(hour)], capture_output=True, text=True, check=True)
    hour.unlink()
    n_frames, height, width, seconds, early, late, last = (json.loads(word) for word in done.stdout.split())
    assert (n_frames, height, width, last) == (90_000, 720, 1280, 299)
    assert seconds < 2
    # A picture takes 2.8 MB; 260 of them would be 720 MB.
    assert late - early < 60_000
    assert late < 500_000
