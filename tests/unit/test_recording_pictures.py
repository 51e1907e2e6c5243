"""Folders of pictures and of depth: read, numbered, refused where they are damaged."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from sec_lab.recording import Recording
from sec_lab.recording.pictures import read_picture, read_png
from tests.recorded import movie_of, moving_texture, pictures_of, refused, save


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
