"""Masks as PNG: palette, 16 bits, RGB, one an object; each written here by the rules of the tool that writes it."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from sec_lab.segmentation import Segmentation
from sec_lab.segmentation.masks import flatten, open_masks, open_objects, write_palette_pngs
from tests.mask_files import images_of, refused

LABELS = np.zeros((3, 4, 6), dtype=np.uint8)
LABELS[:, 1:3, 1:3] = 1
LABELS[1:, 2:, 3:] = 2
LABELS[2, 0] = 9


def write_png(path: Path, rows: NDArray[np.uint8], *, bits: int, colours: int, palette: bytes = b"") -> None:
    """A PNG by its specification alone: rows of bytes (height, bytes a row), no filter."""

    def chunk(name: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    channels = {0: 1, 2: 3, 3: 1, 6: 4}[colours]
    width = rows.shape[1] * 8 // bits // channels
    header = struct.pack(">IIBBBBB", width, len(rows), bits, colours, 0, 0, 0)
    data = b"".join(b"\0" + row.tobytes() for row in rows)
    content = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    if palette:
        content += chunk(b"PLTE", palette)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


def write_palette(folder: Path, labels: NDArray[np.uint8], *, first: int = 0, step: int = 1) -> Path:
    """As DAVIS: 00000.png, …; indices into a palette."""
    for place, image in enumerate(labels):
        write_png(
            folder / f"{first + step * place:05d}.png", image, bits=8, colours=3, palette=bytes(range(255, 225, -1))
        )
    return folder


class TestPalette:
    def test_davis(self, tmp_path: Path) -> None:
        segmentation = open_masks(write_palette(tmp_path / "bear", LABELS))
        np.testing.assert_array_equal(images_of(segmentation), LABELS)
        assert segmentation.size == (4, 6)
        assert segmentation.frames is not None
        assert segmentation.frames.tolist() == [0, 1, 2]
        assert (segmentation.background, dict(segmentation.names)) == (0, {0: "background"})
        assert all(image.dtype == np.uint16 and not image.flags.writeable for image in segmentation)
        np.testing.assert_array_equal(images_of(segmentation), LABELS)  # once more

    def test_sam_2_xmem_cutie(self, tmp_path: Path) -> None:
        """They put a palette on an 8-bit picture with Pillow; names of frames are those of the pictures."""
        for place, image in enumerate(LABELS):
            picture = Image.fromarray(image)
            picture.putpalette([0, 0, 0, 128, 0, 0, 0, 128, 0] + [7] * 759)
            picture.save(tmp_path / f"frame{place + 8}.png")
        segmentation = open_masks(tmp_path, names={1: "hand", 0: "table"})
        np.testing.assert_array_equal(images_of(segmentation), LABELS)
        assert segmentation.frames is not None
        assert segmentation.frames.tolist() == [8, 9, 10]
        assert dict(segmentation.names) == {0: "table", 1: "hand"}

    @pytest.mark.parametrize("bits", [1, 2, 4])
    @pytest.mark.parametrize("colours", [0, 3])
    def test_palettes_of_few_colours(self, tmp_path: Path, bits: int, colours: int) -> None:
        """A writer may pack few indices into fewer bits."""
        labels = np.arange(32, dtype=np.uint8).reshape(2, 16) % (1 << bits)
        packed = np.packbits(np.unpackbits(labels[..., None], axis=2)[..., 8 - bits :].reshape(2, -1), axis=1)
        palette = bytes(range(3 << bits)) if colours == 3 else b""
        write_png(tmp_path / "0.png", packed, bits=bits, colours=colours, palette=palette)
        np.testing.assert_array_equal(images_of(open_masks(tmp_path)), labels[None])

    def test_grey_of_davis_2016(self, tmp_path: Path) -> None:
        write_png(tmp_path / "0.png", (LABELS[0] > 0) * np.uint8(255), bits=8, colours=0)
        segmentation = open_masks(tmp_path, names={255: "object"})
        assert np.unique(images_of(segmentation)).tolist() == [0, 255]
        assert dict(segmentation.names) == {0: "background", 255: "object"}

    def test_one_file_alone(self, tmp_path: Path) -> None:
        write_palette(tmp_path, LABELS[2:], first=17)
        segmentation = open_masks(tmp_path / "00017.png")
        assert [number for number, _ in segmentation.numbered()] == [17]

    def test_stride_and_frames(self, tmp_path: Path) -> None:
        write_palette(tmp_path, LABELS, step=5)
        assert [number for number, _ in open_masks(tmp_path, stride=5).numbered()] == [0, 5, 10]
        assert [number for number, _ in open_masks(tmp_path, frames=[1, 2, 4]).numbered()] == [1, 2, 4]
        refused(lambda: open_masks(tmp_path), tmp_path, "frame 1 has none", "say stride=5")
        refused(lambda: open_masks(tmp_path, frames=[1, 2]), tmp_path, "expected 2 masks", "got 3")

    def test_missing_in_the_middle(self, tmp_path: Path) -> None:
        write_palette(tmp_path, LABELS)
        (tmp_path / "00001.png").unlink()
        refused(lambda: open_masks(tmp_path), f"{tmp_path}: expected a mask for every frame, but frame 1 has none")
        write_palette(tmp_path, LABELS[:1], first=7)
        refused(lambda: open_masks(tmp_path, stride=2), "every 2th frame", "frame 4 has none")
        write_palette(tmp_path, LABELS[:1], first=3)
        refused(lambda: open_masks(tmp_path, stride=2), "got masks for 2 and 3")

    def test_sizes(self, tmp_path: Path) -> None:
        write_palette(tmp_path, LABELS)
        assert open_masks(tmp_path, size=(4, 6)).size == (4, 6)
        refused(lambda: open_masks(tmp_path, size=(5, 6)), tmp_path, "expected masks of 5×6 like the pictures, got 4×6")
        write_png(tmp_path / "00001.png", LABELS[0, :3], bits=8, colours=0)
        refused(lambda: list(open_masks(tmp_path)), tmp_path / "00001.png", "expected a mask of 4×6 as before, got 3×6")

    def test_kind_that_changes(self, tmp_path: Path) -> None:
        write_palette(tmp_path, LABELS)
        write_png(tmp_path / "00001.png", np.zeros((4, 18), dtype=np.uint8), bits=8, colours=2)
        refused(
            lambda: list(open_masks(tmp_path)), tmp_path / "00001.png", "expected a mask of 8 bits", "got RGB of 8 bits"
        )

    @pytest.mark.parametrize("lost", [1, 20, 60])
    def test_truncated(self, tmp_path: Path, lost: int) -> None:
        file = write_palette(tmp_path, LABELS) / "00001.png"
        file.write_bytes(file.read_bytes()[:-lost])
        refused(lambda: list(open_masks(tmp_path)), file, "expected a whole PNG, but it ends early")

    def test_damaged(self, tmp_path: Path) -> None:
        """A bit that tips over changes labels; decoders alone would not mind."""
        file = write_palette(tmp_path, LABELS) / "00001.png"
        content = bytearray(file.read_bytes())
        content[content.index(b"IDAT") + 8] ^= 1
        file.write_bytes(content)
        refused(lambda: list(open_masks(tmp_path)), file, "the checksum of 'IDAT' is another")

    def test_bombs(self, tmp_path: Path) -> None:
        content = bytearray((write_palette(tmp_path, LABELS) / "00000.png").read_bytes())
        content[16:24] = struct.pack(">II", 100_000, 100_000)
        (tmp_path / "00000.png").write_bytes(content)
        refused(lambda: open_masks(tmp_path), tmp_path / "00000.png", "100000×100000")
        # A text that unpacks to 200 MB.
        text = b"note\0\0" + zlib.compress(bytes(200_000_000), 9)
        chunk = struct.pack(">I", len(text)) + b"zTXt" + text + struct.pack(">I", zlib.crc32(b"zTXt" + text))
        write_palette(tmp_path, LABELS)
        sound = (tmp_path / "00000.png").read_bytes()
        (tmp_path / "00000.png").write_bytes(sound[:33] + chunk + sound[33:])
        refused(lambda: list(open_masks(tmp_path)), tmp_path / "00000.png", "cannot be decoded")


class TestSixteenBits:
    def test_any_ids(self, tmp_path: Path) -> None:
        ids = np.array([[0, 1, 300], [65535, 1, 300]], dtype=np.uint16)
        write_png(tmp_path / "000000.png", ids.astype(">u2").view(np.uint8), bits=16, colours=0)
        segmentation = open_masks(tmp_path)
        np.testing.assert_array_equal(images_of(segmentation)[0], ids)
        assert dict(segmentation.names) == {0: "background"}

    def test_mots(self, tmp_path: Path) -> None:
        """An id is class · 1000 + instance, 10000 a region to be ignored."""
        ids = np.array([[0, 1005, 2001], [10000, 3007, 2001]], dtype=np.uint16)
        for place in range(2):
            write_png(
                tmp_path / f"{place:06d}.png", (ids * (place + 1 > 1)).astype(">u2").view(np.uint8), bits=16, colours=0
            )
        segmentation = open_masks(tmp_path, format="MOTS PNG", names={3007: "dog"})
        np.testing.assert_array_equal(images_of(segmentation)[1], ids)
        named = {0: "background", 1005: "car 5", 2001: "pedestrian 1", 10000: None, 3007: "dog"}
        assert dict(segmentation.names) == named

    def test_eight_bits_are_another_format(self, tmp_path: Path) -> None:
        write_palette(tmp_path, LABELS)
        refused(
            lambda: open_masks(tmp_path, format="16-bit PNG"), "expected a mask of 16 bits, grey, got palette of 8 bits"
        )


def rgb(ids: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Rows of R + 256 G + 65536 B, as COCO's panoptic API writes an id."""
    return np.stack([ids % 256, ids // 256 % 256, ids // 65536], axis=-1).astype(np.uint8).reshape(len(ids), -1)


class TestRgb:
    def test_small_ids_are_labels(self, tmp_path: Path) -> None:
        ids = np.array([[0, 7, 300], [65535, 7, 300]])
        write_png(tmp_path / "1.png", rgb(ids), bits=8, colours=2)
        segmentation = open_masks(tmp_path, names={7: "cup"})
        np.testing.assert_array_equal(images_of(segmentation)[0], ids)
        assert dict(segmentation.names) == {0: "background", 7: "cup"}

    def test_large_ids_are_recoded_and_named(self, tmp_path: Path) -> None:
        first, second = np.array([[0, 70_000, 5]]), np.array([[9_000_000, 70_000, 1 << 17]])
        for place, ids in enumerate((first, second)):
            write_png(tmp_path / f"{place}.png", rgb(ids), bits=8, colours=2)
        segmentation = open_masks(tmp_path, names={9_000_000: "hand", 12: "not there"})
        assert images_of(segmentation)[:, 0].tolist() == [[0, 65535, 5], [65533, 65535, 65534]]
        named = {0: "background", 65535: "70000", 65534: "131072", 65533: "hand"}
        assert dict(segmentation.names) == named
        # Names are the same if they are asked for first, and images if they are read anew.
        again = open_masks(tmp_path, names={9_000_000: "hand"})
        assert dict(again.names) == named
        np.testing.assert_array_equal(images_of(again), images_of(segmentation))

    def test_background_of_any_colour(self, tmp_path: Path) -> None:
        white = (1 << 24) - 1
        write_png(tmp_path / "0.png", rgb(np.array([[white, 0, 3]])), bits=8, colours=2)
        segmentation = open_masks(tmp_path, background=white)
        assert segmentation.background == 65535
        assert images_of(segmentation).tolist() == [[[65535, 0, 3]]]
        assert dict(segmentation.names) == {65535: "background"}
        assert open_masks(tmp_path, background=None).background is None

    def test_opaque_and_transparent(self, tmp_path: Path) -> None:
        colours = np.array([[[1, 0, 0, 255], [2, 0, 0, 255]]], dtype=np.uint8)
        write_png(tmp_path / "0.png", colours.reshape(1, -1), bits=8, colours=6)
        assert images_of(open_masks(tmp_path)).tolist() == [[[1, 2]]]
        colours[0, 0, 3] = 254
        write_png(tmp_path / "0.png", colours.reshape(1, -1), bits=8, colours=6)
        refused(lambda: list(open_masks(tmp_path)), tmp_path, "opaque")

    def test_more_ids_than_labels(self, tmp_path: Path) -> None:
        every = np.arange(65537)[None] + 100_000
        write_png(tmp_path / "0.png", rgb(every[:, :-1]), bits=8, colours=2)
        assert len(np.unique(images_of(open_masks(tmp_path, background=None)))) == 65536
        write_png(tmp_path / "0.png", rgb(every), bits=8, colours=2)
        refused(lambda: list(open_masks(tmp_path)), tmp_path, "frame 0: ids: expected at most 65536 different ids")

    def test_label_that_is_taken(self, tmp_path: Path) -> None:
        for place, ids in enumerate(([[70_000]], [[65_535]])):
            write_png(tmp_path / f"{place}.png", rgb(np.array(ids)), bits=8, colours=2)
        refused(
            lambda: list(open_masks(tmp_path)), tmp_path, "frame 1", "65535 is the label that a larger id was given"
        )

    def test_ids_of_more_than_24_bits(self, tmp_path: Path) -> None:
        write_png(tmp_path / "0.png", rgb(np.array([[1]])), bits=8, colours=2)
        refused(lambda: open_masks(tmp_path, background=1 << 24), "numbers of 24 bits, got 16777216")
        refused(lambda: open_masks(tmp_path, names={-1: "cup"}), "numbers of 24 bits, got -1")


def write_object(folder: Path, masks: NDArray[np.bool_], *, numbers: list[int], value: int = 1) -> None:
    """As SAM 2 writes an object: 0 and 1 with a palette, a file a frame."""
    for number, mask in zip(numbers, masks, strict=True):
        write_png(folder / f"{number:05d}.png", mask * np.uint8(value), bits=8, colours=3, palette=bytes(768))


class TestObjects:
    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        """A body (000) with its hand (001) on it, and a cup (005) that comes with the second frame, every 4th frame."""
        body, hand, cup = np.zeros((3, 2, 4, 5), dtype=bool)
        body[:, 1:, :3] = True
        hand[:, 2, 1:3] = True
        cup[1, 0, 4] = True
        write_object(tmp_path / "video" / "000", body, numbers=[0, 4])
        write_object(tmp_path / "video" / "001", hand, numbers=[0, 4])
        write_object(tmp_path / "video" / "005", cup[1:], numbers=[4])
        return tmp_path / "video"

    def test_overlaps_are_kept(self, folder: Path) -> None:
        objects = open_objects(folder, stride=4)
        (first, second) = list(objects)
        assert (first[0], second[0]) == (0, 4)
        # 0 is the background, so labels are ids + 1, and names tell the ids.
        assert [label for label, _ in first[1]] == [1, 2]
        assert [label for label, _ in second[1]] == [1, 2, 6]
        assert dict(objects.names) == {1: "0", 2: "1", 6: "5"}
        assert [int(mask.sum()) for _, mask in second[1]] == [9, 2, 1]
        assert int((first[1][0][1] & first[1][1][1]).sum()) == 2
        assert len(objects) == 2

    @pytest.mark.parametrize(
        ("overlap", "middle"),
        [("smaller on top", [1, 2, 2, 0, 0]), ("first on top", [1, 1, 1, 0, 0]), ("last on top", [1, 2, 2, 0, 0])],
    )
    def test_overlap_policies(self, folder: Path, overlap: str, middle: list[int]) -> None:
        segmentation = open_masks(folder, stride=4, overlap=overlap, names={5: "cup", 0: "body"})  # type: ignore[arg-type]
        first, second = images_of(segmentation)
        assert first[2].tolist() == middle
        assert second[0].tolist() == [0, 0, 0, 0, 6]
        assert dict(segmentation.names) == {0: "background", 1: "body", 2: "1", 6: "cup"}
        np.testing.assert_array_equal(images_of(flatten(open_objects(folder, stride=4), overlap=overlap))[0], first)  # type: ignore[arg-type]

    def test_overlap_is_an_error_unless_said(self, folder: Path) -> None:
        refused(
            lambda: list(open_masks(folder, stride=4)), folder, "frame 0: objects 1 and 2 overlap in row 2, column 1"
        )

    def test_equal_masks(self, tmp_path: Path) -> None:
        for name in ("1", "2"):
            write_object(tmp_path / name, np.ones((1, 2, 2), dtype=bool), numbers=[0])
        assert np.unique(images_of(open_masks(tmp_path, overlap="smaller on top"))).tolist() == [1]

    def test_other_background(self, folder: Path) -> None:
        segmentation = open_masks(folder, stride=4, overlap="last on top", background=1000)
        assert np.unique(images_of(segmentation)).tolist() == [0, 1, 5, 1000]
        assert dict(segmentation.names) == {1000: "background"}
        refused(lambda: open_masks(folder, stride=4, background=None), "background: expected a label", error=ValueError)

    def test_folders_with_names(self, tmp_path: Path) -> None:
        for name in ("hand 10", "hand 9", "cup"):
            write_object(tmp_path / name, np.eye(2, dtype=bool)[None] & (name == "cup"), numbers=[0], value=255)
        refused(lambda: open_masks(tmp_path), tmp_path, "say format='object PNG'")
        segmentation = open_masks(tmp_path, format="object PNG")
        assert dict(segmentation.names) == {0: "background", 1: "cup", 2: "hand 9", 3: "hand 10"}
        assert images_of(segmentation).tolist() == [[[1, 0], [0, 1]]]

    def test_frame_that_no_object_has(self, folder: Path) -> None:
        write_object(folder / "005", np.zeros((1, 4, 5), dtype=bool), numbers=[12])
        refused(lambda: open_masks(folder, stride=4), folder, "every 4th frame, but frame 8 has none")

    def test_malformed(self, folder: Path, tmp_path: Path) -> None:
        file = folder / "001" / "00004.png"
        write_png(file, np.array([[0, 1, 2, 0, 0]] * 4, dtype=np.uint8), bits=8, colours=0)
        refused(lambda: list(open_masks(folder, stride=4, overlap="last on top")), file, "the mask of one object")
        write_png(file, np.zeros((3, 5), dtype=np.uint8), bits=8, colours=0)
        refused(lambda: list(open_masks(folder, stride=4, overlap="last on top")), file, "expected a mask of 4×5")
        file.rename(folder / "001" / "b_c.png")
        refused(lambda: open_masks(folder, stride=4), folder, "differ in one number, the frame number")
        refused(lambda: open_masks(folder, format="object PNG", names={9: "cup"}, stride=4), folder)
        (folder / "0001").mkdir()
        refused(lambda: open_masks(folder, stride=4), folder, "two with the number 1")
        (tmp_path / "empty" / "1").mkdir(parents=True)
        refused(lambda: open_masks(tmp_path / "empty"), tmp_path / "empty" / "1", "got none")
        refused(lambda: open_masks(tmp_path / "empty" / "1", format="object PNG"), "expected folders of masks")

    def test_names_of_objects_that_are_not_there(self, folder: Path) -> None:
        refused(lambda: open_masks(folder, stride=4, names={7: "cup"}), "expected ids of objects (0, 1, 5), got 7")

    def test_no_masks_of_single_objects(self, tmp_path: Path) -> None:
        write_palette(tmp_path, LABELS)
        refused(
            lambda: open_objects(tmp_path), "which have masks of single objects, got 'palette PNG'", error=ValueError
        )


class TestWriting:
    def test_davis_folders_come_back(self, tmp_path: Path) -> None:
        frames = [3, 5, 7]
        write_palette_pngs(tmp_path / "masks", Segmentation.from_labels(LABELS, frames=frames))
        assert sorted(file.name for file in (tmp_path / "masks").iterdir()) == ["00003.png", "00005.png", "00007.png"]
        segmentation = open_masks(tmp_path / "masks", stride=2)
        np.testing.assert_array_equal(images_of(segmentation), LABELS)
        with Image.open(tmp_path / "masks" / "00005.png") as picture:
            assert picture.mode == "P"
            # The colours of DAVIS: black, dark red, dark green.
            assert picture.getpalette()[:9] == [0, 0, 0, 128, 0, 0, 0, 128, 0]  # type: ignore[index]

    def test_plain_images(self, tmp_path: Path) -> None:
        write_palette_pngs(tmp_path / "masks", list(LABELS))
        np.testing.assert_array_equal(images_of(open_masks(tmp_path / "masks")), LABELS)

    def test_whole_or_not_at_all(self, tmp_path: Path) -> None:
        target = tmp_path / "masks"
        labels = LABELS.astype(np.uint16)
        labels[2, 0, 0] = 256
        refused(
            lambda: write_palette_pngs(target, Segmentation.from_labels(labels)), "frame 2", "got 256", error=ValueError
        )
        refused(lambda: write_palette_pngs(target, []), "at least one label image", error=ValueError)
        refused(lambda: write_palette_pngs(tmp_path / "no" / "masks", LABELS), "there is no folder")
        assert list(tmp_path.iterdir()) == []
        target.mkdir()
        refused(lambda: write_palette_pngs(target, LABELS), target, "it exists already")
        assert list(target.iterdir()) == []
