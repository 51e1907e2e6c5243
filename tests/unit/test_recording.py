"""Recordings: read frame by frame, joined from several cameras, refused where they are damaged; movies written."""

import itertools
import json
import pickle
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from sec_lab.files import UnusableFileError
from sec_lab.recording import Calibration, Frame, Recording, json_files, movies, read_calibration, write_movie
from sec_lab.recording.numbering import frame_numbers, natural_key
from sec_lab.recording.pictures import read_picture, read_png

Pictures = NDArray[np.uint8]


def moving_texture(n: int, height: int = 48, width: int = 64, *, seed: int = 0) -> Pictures:
    """Noise that moves on by a pixel a frame, so no frame is like another."""
    texture = np.random.default_rng(seed).integers(0, 256, (height, width + n, 3), dtype=np.uint8)
    return np.stack([texture[:, i : i + width] for i in range(n)])


def movie_of(
    path: Path, frames: Pictures, *, codec: str = "libx264", layout: str = "yuv420p", times: list[int] | None = None
) -> Path:
    """Movie written by PyAV alone, at 25 frames a second unless times (in hundredths of a second) are given."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = frames.shape[2], frames.shape[1], layout  # type: ignore[union-attr]
        if times is not None:
            stream.codec_context.time_base = stream.time_base = Fraction(1, 100)
        for index, image in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            if times is not None:
                frame.pts, frame.time_base = times[index], Fraction(1, 100)
            container.mux(stream.encode(frame))  # type: ignore[union-attr, arg-type]
        container.mux(stream.encode())  # type: ignore[union-attr]
    return path


def pictures_of(recording: Recording) -> Pictures:
    return np.stack([frame.image for frame in recording])


def save(folder: Path, frames: Pictures, *, name: str = "{:05d}.png", first: int = 0, step: int = 1) -> Path:
    folder.mkdir(exist_ok=True)
    for index, image in enumerate(frames):
        Image.fromarray(image).save(folder / name.format(first + step * index))
    return folder


def refused(act: Callable[[], object], *parts: object) -> None:
    """One line, in which all parts occur."""
    with pytest.raises(ValueError) as raised:
        act()
    message = str(raised.value)
    assert "\n" not in message
    for part in parts:
        assert str(part) in message, message


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


class TestFolders:
    def test_natural_order_and_numbers(self, tmp_path: Path) -> None:
        frames = moving_texture(12)
        folder = save(tmp_path / "movie", frames, name="cam2_{}.png", first=5, step=3)
        (folder / "notes.txt").write_text("passed over")
        (folder / "._cam2_5.png").write_text("passed over")
        recording = Recording.open(folder)
        np.testing.assert_array_equal(pictures_of(recording), frames)
        assert [frame.index for frame in recording] == list(range(5, 41, 3))
        assert recording.numbers == tuple(range(5, 41, 3))
        assert {frame.time_s for frame in recording} == {None}
        assert recording.frames_per_second is None

    def test_times(self, tmp_path: Path) -> None:
        recording = Recording.open(save(tmp_path / "movie", moving_texture(3), first=10, step=5), frames_per_second=25)
        np.testing.assert_allclose([frame.time_s for frame in recording], [0, 0.2, 0.4])  # type: ignore[arg-type]

    def test_names_without_numbers(self, tmp_path: Path) -> None:
        frames = moving_texture(2)
        (tmp_path / "movie").mkdir()
        for name, image in zip(("apple", "pear"), frames, strict=True):
            Image.fromarray(image).save(tmp_path / "movie" / f"{name}.BMP")
        recording = Recording.open(tmp_path / "movie")
        assert [frame.index for frame in recording] == [0, 1]
        np.testing.assert_array_equal(pictures_of(recording), frames)

    def test_grey_palette_and_turned_pictures(self, tmp_path: Path) -> None:
        grey = np.arange(12, dtype=np.uint8).reshape(3, 4)
        Image.fromarray(grey).save(tmp_path / "grey.png")
        np.testing.assert_array_equal(read_picture(tmp_path / "grey.png"), np.stack([grey] * 3, axis=2))
        indexed = Image.fromarray(grey % 2)
        indexed.putpalette([10, 20, 30, 40, 50, 60])
        indexed.save(tmp_path / "palette.png")
        assert read_picture(tmp_path / "palette.png")[0, :2].tolist() == [[10, 20, 30], [40, 50, 60]]
        exif = Image.Exif()
        exif[0x0112] = 6  # as seen, the first row is the right side
        Image.fromarray(grey).save(tmp_path / "turned.tiff", exif=exif)
        np.testing.assert_array_equal(read_picture(tmp_path / "turned.tiff")[:, :, 0], grey[::-1].T)

    def test_corrupt_picture(self, tmp_path: Path) -> None:
        folder = save(tmp_path / "movie", moving_texture(4), first=7)
        file = folder / "00009.png"
        file.write_bytes(file.read_bytes()[:-500])
        refused(lambda: list(Recording.open(folder)), file, "frame 9")
        assert [frame.index for frame in Recording.open(folder, on_corrupt="skip")] == [7, 8, 10]

    def test_truncated_jpeg_is_not_filled_up(self, tmp_path: Path) -> None:
        folder = save(tmp_path / "movie", moving_texture(2), name="{}.jpg")
        file = folder / "1.jpg"
        file.write_bytes(file.read_bytes()[:-500])
        refused(lambda: list(Recording.open(folder)), file, "truncated")

    def test_size_that_changes_midway(self, tmp_path: Path) -> None:
        folder = save(tmp_path / "movie", moving_texture(2))
        save(folder, moving_texture(1, 10, 20), first=2)
        refused(lambda: list(Recording.open(folder)), folder, "frame 2", "48×64 as before, got 10×20")

    def test_folders_that_hold_no_movie(self, tmp_path: Path) -> None:
        refused(lambda: Recording.open(tmp_path), tmp_path, "expected a folder of pictures", "got none")
        save(tmp_path, moving_texture(1))
        save(tmp_path, moving_texture(1), name="{}.jpg", first=1)
        refused(lambda: Recording.open(tmp_path), tmp_path, "of one kind, got .jpg and .png")

    def test_two_files_of_one_number(self, tmp_path: Path) -> None:
        save(tmp_path, moving_texture(1), name="1.png")
        save(tmp_path, moving_texture(1), name="01.png")
        refused(lambda: Recording.open(tmp_path), tmp_path, "one file a frame, got two with the number 1")

    def test_two_folders_of_different_numbers(self, tmp_path: Path) -> None:
        left, right = save(tmp_path / "l", moving_texture(3)), save(tmp_path / "r", moving_texture(3), step=2)
        refused(lambda: Recording.open(left, right=right), right, "frame 1 has one side only")

    @pytest.mark.parametrize(
        ("mode", "reason"),
        [("RGBA", "it is partly transparent"), ("I;16", "it has 16 bits a channel"), ("F", "values of kind F")],
    )
    def test_kinds_that_would_have_to_be_repaired(self, tmp_path: Path, mode: str, reason: str) -> None:
        file = tmp_path / ("1.tiff" if mode == "F" else "1.png")
        Image.new(mode, (4, 3)).save(file)
        refused(lambda: Recording.open(tmp_path, on_corrupt="error"), file, reason)

    def test_opaque_transparency_is_none(self, tmp_path: Path) -> None:
        Image.new("RGBA", (4, 3), (1, 2, 3, 255)).save(tmp_path / "1.png")
        assert next(iter(Recording.open(tmp_path))).image[0, 0].tolist() == [1, 2, 3]

    def test_many_pictures_in_one_file(self, tmp_path: Path) -> None:
        file = tmp_path / "1.tiff"
        Image.new("L", (4, 3)).save(file, save_all=True, append_images=[Image.new("L", (4, 3))])
        refused(lambda: Recording.open(tmp_path), file, "2 pictures in one file")


def png(width: int, height: int, *, bits: int, kind: int, data: bytes) -> bytes:
    def chunk(name: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    header = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


class TestPng:
    def test_few_bits_of_grey_stay_as_they_are(self, tmp_path: Path) -> None:
        for bits, values in ((1, [0, 1, 0, 1]), (2, [0, 1, 2, 3]), (4, [0, 5, 9, 15])):
            word = "".join(f"{value:0{bits}b}" for value in values).ljust(16, "0")
            file = tmp_path / f"{bits}.png"
            row = b"\0" + int(word, 2).to_bytes(2, "big")[: (4 * bits + 7) // 8]
            file.write_bytes(png(4, 1, bits=bits, kind=0, data=row))
            header, found = read_png(file, expected="a mask")
            assert (header.bits, header.colours, found.tolist()) == (bits, "grey", [values])

    def test_bombs_are_refused_before_they_are_decoded(self, tmp_path: Path) -> None:
        file = tmp_path / "1.png"
        file.write_bytes(png(100_000, 100_000, bits=8, kind=0, data=bytes(10)))
        for read in (read_picture, lambda path: read_png(path, expected="a mask")):
            refused(lambda read=read: read(file), file, "100000×100000")  # type: ignore[misc]
        # Pillow warns from 89 million pixels on, which would be an error here.
        Image.new("1", (10_000, 9_500)).save(tmp_path / "2.tiff", compression="group4")
        refused(lambda: read_picture(tmp_path / "2.tiff"), tmp_path / "2.tiff")

    def test_colours_of_16_bits(self, tmp_path: Path) -> None:
        file = tmp_path / "1.png"
        file.write_bytes(png(1, 1, bits=16, kind=2, data=bytes(7)))
        refused(lambda: read_png(file, expected="a mask"), file, "RGB of 16 bits a channel")
        refused(lambda: read_picture(file), file, "16 bits a channel")

    def test_what_is_no_png(self, tmp_path: Path) -> None:
        file = tmp_path / "1.png"
        for content in (
            b"",
            b"GIF89a" * 10,
            png(1, 1, bits=8, kind=7, data=bytes(2)),
            png(0, 1, bits=8, kind=0, data=b""),
        ):
            file.write_bytes(content)
            refused(lambda: read_png(file, expected="a mask"), file, "expected a mask")


class TestDepth:
    N, SIZE = 3, (4, 5)

    def depths(self) -> NDArray[np.uint16]:
        return np.arange(self.N * 20, dtype=np.uint16).reshape(self.N, *self.SIZE) * 100

    @pytest.fixture
    def movie(self, tmp_path: Path) -> Path:
        return save(tmp_path / "movie", moving_texture(self.N, *self.SIZE), first=2)

    @pytest.mark.parametrize("kind", ["png", "npy", "metres", "stack"])
    def test_depth_in_metres(self, movie: Path, tmp_path: Path, kind: str) -> None:
        depth = self.depths()
        folder = tmp_path / "depth"
        folder.mkdir()
        for number, picture in enumerate(depth, start=2):
            if kind == "png":
                Image.fromarray(picture).save(folder / f"depth{number}.png")
            elif kind == "npy":
                np.save(folder / f"{number}.npy", picture)
            elif kind == "metres":
                np.save(folder / f"{number}.npy", picture * 0.0002)
        if kind == "stack":
            folder = tmp_path / "depth.npy"
            np.save(folder, depth)
        recording = Recording.open(movie, depth=folder, depth_unit_m=0.0002)
        assert recording.has_depth
        found = np.stack([frame.depth_m for frame in recording if frame.depth_m is not None])
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, depth * 0.0002, rtol=1e-6)

    def test_millimetres_are_the_default(self, movie: Path, tmp_path: Path) -> None:
        np.save(tmp_path / "depth.npy", np.full((self.N, *self.SIZE), 1500, dtype=np.uint16))
        frame = next(iter(Recording.open(movie, depth=tmp_path / "depth.npy")))
        assert frame.depth_m is not None
        assert np.unique(frame.depth_m).tolist() == [1.5]

    def test_with_a_movie(self, tmp_path: Path) -> None:
        np.save(tmp_path / "depth.npy", np.ones((3, 48, 64)))
        for suffix in ("mp4", "mkv"):
            path = movie_of(tmp_path / f"movie.{suffix}", moving_texture(3))
            assert all(frame.depth_m is not None for frame in Recording.open(path, depth=tmp_path / "depth.npy"))
            for n, told in ((2, "frame 2 has none"), (4, "got 4")):
                wrong = tmp_path / f"{n}.npy"
                np.save(wrong, np.ones((n, 48, 64)))
                told_at_once = f"expected 3 depth pictures, got {n}"
                refused(
                    lambda path=path, wrong=wrong: list(Recording.open(path, depth=wrong)),  # type: ignore[misc]
                    wrong,
                    told_at_once if suffix == "mp4" else told,
                )

    def test_missing_depth(self, movie: Path, tmp_path: Path) -> None:
        folder = tmp_path / "depth"
        folder.mkdir()
        for number in (2, 4):
            Image.fromarray(self.depths()[0]).save(folder / f"{number}.png")
        refused(lambda: Recording.open(movie, depth=folder), folder, "frame 3 has none")

    @pytest.mark.parametrize("wrong", [np.nan, np.inf, -1.0])
    def test_depth_that_is_none(self, movie: Path, tmp_path: Path, wrong: float) -> None:
        depth = np.ones((self.N, *self.SIZE))
        depth[1, 2, 3] = wrong
        np.save(tmp_path / "depth.npy", depth)
        refused(
            lambda: list(Recording.open(movie, depth=tmp_path / "depth.npy")),
            f"{movie}: frame 3: depth: expected finite metres from 0 on (0 where nothing was measured), got {wrong}",
        )

    def test_other_shapes_and_kinds(self, movie: Path, tmp_path: Path) -> None:
        file = tmp_path / "depth.npy"
        np.save(file, np.ones((self.N, 5, 4)))
        refused(lambda: list(Recording.open(movie, depth=file)), movie, "frame 2: depth: expected 4×5", "(5, 4)")
        np.save(file, np.ones((self.N, 4, 5)) > 0)
        refused(lambda: list(Recording.open(movie, depth=file)), movie, "values of type bool")
        file.write_bytes(file.read_bytes()[:-5])
        refused(lambda: Recording.open(movie, depth=file), file, "expected depth pictures (.npy)")
        refused(lambda: Recording.open(movie, depth=tmp_path / "no"), tmp_path / "no", "no such folder")
        refused(lambda: Recording.open(movie, depth=tmp_path / "no.npy"), tmp_path / "no.npy", "no such file")
        folder = save(tmp_path / "depth8", np.zeros((self.N, 4, 5), dtype=np.uint8), first=2)
        refused(
            lambda: list(Recording.open(movie, depth=folder)), folder / "00002.png", "of 16 bits, got grey of 8 bits"
        )


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
