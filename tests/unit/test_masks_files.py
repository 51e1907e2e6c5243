"""Masks in one file of lines or of arrays: MOTS, NumPy."""

import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.segmentation.masks import open_masks
from tests import naive_masks as naive
from tests.mask_files import SCENE, Labels, frames_of, images_of, refused


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "masks.json"


def mots(labels: Labels, *, first: int = 0) -> str:
    """A line an object and frame: frame, id, class, height, width, mask."""
    lines = []
    for frame, image in enumerate(labels, start=first):
        for label in np.unique(image[image > 0]).tolist():
            number = {1: 2001, 2: 1005}[label]
            text = naive.compress(naive.runs_of_mask(image == label))
            lines.append(f"{frame} {number} {number // 1000} {image.shape[0]} {image.shape[1]} {text}")
    return "\n".join(lines) + "\n"


class TestMots:
    @pytest.fixture
    def file(self, tmp_path: Path) -> Path:
        return tmp_path / "0002.txt"

    def test_masks_and_names(self, file: Path) -> None:
        file.write_text(mots(SCENE))
        segmentation = open_masks(file)
        np.testing.assert_array_equal(images_of(segmentation), np.array([0, 2001, 1005])[SCENE])
        assert frames_of(segmentation) == [0, 1, 2]
        assert dict(segmentation.names) == {0: "background", 1005: "car 5", 2001: "pedestrian 1"}

    def test_frames_without_objects_have_no_line(self, file: Path) -> None:
        empty = np.zeros((1, 3, 4), dtype=np.uint8)
        file.write_text(mots(np.concatenate([SCENE[:1], empty, SCENE[1:]]), first=5))
        segmentation = open_masks(file)
        assert frames_of(segmentation) == [5, 6, 7, 8]
        assert images_of(segmentation).any(axis=(1, 2)).tolist() == [True, False, True, True]
        whole = open_masks(file, frames=range(2, 11))
        assert images_of(whole).any(axis=(1, 2)).tolist() == [False] * 3 + [True, False, True, True] + [False] * 2
        refused(lambda: open_masks(file, frames=range(5, 8)), file, "the frames 5 to 7 only, got one for frame 8")

    def test_region_to_be_ignored(self, file: Path) -> None:
        file.write_text("3 10000 10 1 2 011\n")
        segmentation = open_masks(file)
        assert dict(segmentation.names) == {0: "background", 10000: None}
        assert images_of(segmentation).tolist() == [[[10000, 0]]]

    @pytest.mark.parametrize(
        ("text", "reason"),
        [
            ("", "expected at least one line, got none"),
            ("\n \n", "expected at least one line, got none"),
            ("0 1005 1 3 4\n", "line 1: expected 'frame id class height width rle', got '0 1005 1 3 4'"),
            ("0 1005 1 1 2 11 5\n", "line 1: expected 'frame id class height width rle'"),
            ("\n0 x 1 1 2 11\n", "line 2: expected 'frame id class height width rle'"),
            ("0 -5 1 1 2 11\n", "line 1: expected 'frame id class height width rle'"),
            ("0 1005 1 1 2 11\n0 1005 1 1 2 11\n", "line 2: expected object 1005 once in frame 0, got it again"),
            ("0 1005 1 1 2 11\n1 1005 2 1 2 11\n", "line 2: expected object 1005 in class 1, got class 2"),
            ("0 1005 1 1 2 11\n1 1005 1 2 1 11\n", "line 2: expected a mask of 1×2 as before, got 2×1"),
            ("0 1005 1 1 2 11\n999999999 1005 1 1 2 11\n", "at most 10000000 frames, got 1000000000"),
            ("0 1005 1 100000 100000 0\n", "expected 1 to 67108864 pixels"),
            ("0 1005 1 1 2 15\n", "frame 0: object 1005: runs: expected 2 pixels in all, got a run of 5"),
            ("\xff\xfe binary", "line 1: expected 'frame id class height width rle'"),
        ],
    )
    def test_malformed(self, file: Path, text: str, reason: str) -> None:
        file.write_bytes(text.encode("latin-1"))
        refused(lambda: list(open_masks(file)), file, reason)

    def test_other_size(self, file: Path) -> None:
        file.write_text(mots(SCENE))
        refused(lambda: open_masks(file, size=(4, 4)), file, "expected masks of 4×4 like the pictures, got 3×4")


class TestNumpy:
    @pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int64, ">i4"])
    def test_npy_and_npz(self, tmp_path: Path, dtype: Any) -> None:
        labels = SCENE.astype(dtype)
        np.save(tmp_path / "a.npy", labels)
        np.savez(tmp_path / "b.npz", whatever=labels, names=np.arange(4))
        np.savez_compressed(tmp_path / "c.npz", labels=labels, scores=np.zeros((3, 3, 4)))
        np.savez(tmp_path / "d.npz", *labels)
        for name in ("a.npy", "b.npz", "c.npz", "d.npz"):
            segmentation = open_masks(tmp_path / name, names={2: "cup"}, stride=3)
            np.testing.assert_array_equal(images_of(segmentation), SCENE)
            np.testing.assert_array_equal(images_of(segmentation), SCENE)
            assert frames_of(segmentation) == [0, 3, 6]
            assert dict(segmentation.names) == {0: "background", 2: "cup"}

    def test_more_than_ten_frames_stay_in_order(self, tmp_path: Path) -> None:
        labels = np.arange(12, dtype=np.uint8)[:, None, None] * np.ones((1, 1, 2), dtype=np.uint8)
        np.savez(tmp_path / "masks.npz", *labels)
        assert images_of(open_masks(tmp_path / "masks.npz"))[:, 0, 0].tolist() == list(range(12))

    def test_true_and_false(self, tmp_path: Path) -> None:
        np.save(tmp_path / "a.npy", SCENE > 0)
        np.testing.assert_array_equal(images_of(open_masks(tmp_path / "a.npy")), SCENE > 0)

    def test_long_stack_is_streamed(self, tmp_path: Path) -> None:
        np.savez_compressed(tmp_path / "a.npz", labels=np.zeros((2000, 100, 100), dtype=np.uint8))
        tracemalloc.start()
        assert sum(1 for _ in open_masks(tmp_path / "a.npz")) == 2000
        assert tracemalloc.get_traced_memory()[1] < 2_000_000
        tracemalloc.stop()

    @pytest.mark.parametrize(
        ("labels", "reason"),
        [
            (SCENE * 1.0, "expected whole numbers, got values of type float64"),
            (SCENE[0], None),
            (SCENE[None], "expected label images of shape (n, height, width), got a (1, 3, 3, 4)"),
            (SCENE[:0], "expected at least one frame, got none"),
            (SCENE[:, :0], "expected 1 to 67108864 pixels, got 0×4"),
            (np.asfortranarray(SCENE), "save np.ascontiguousarray(labels)"),
            (SCENE.astype(np.int64) * 40_000, "frame 0: label image: expected labels up to 65535, got 80000"),
            (SCENE.astype(np.int64) - 1, "frame 0: label image: expected labels from 0 on, got -1"),
            (np.array([[["a"]]]), "expected whole numbers"),
            (np.array([[[(1, 2)]]], dtype="i4,i4"), "expected whole numbers"),
        ],
    )
    def test_arrays_of_another_kind(self, tmp_path: Path, labels: NDArray[Any], reason: str | None) -> None:
        file = tmp_path / "a.npy"
        np.save(file, labels)
        if reason is None:
            assert images_of(open_masks(file)).shape == (1, 3, 4)
        else:
            refused(lambda: list(open_masks(file)), file, reason)

    def test_several_stacks(self, tmp_path: Path) -> None:
        np.savez(tmp_path / "a.npz", left=SCENE, right=SCENE)
        refused(
            lambda: open_masks(tmp_path / "a.npz"), tmp_path, "expected one array of label images, got left and right"
        )
        np.savez(tmp_path / "b.npz", a=SCENE[0], b=SCENE[0, :2])
        refused(lambda: open_masks(tmp_path / "b.npz"), tmp_path, "b: expected 3×4 as before, got (2, 4)")

    def test_damaged_and_hostile(self, tmp_path: Path) -> None:
        file = tmp_path / "a.npy"
        np.save(file, SCENE)
        content = file.read_bytes()
        file.write_bytes(content[:-1])
        refused(lambda: list(open_masks(file)), file, "a ends within image 2 of 3")
        file.write_bytes(content.replace(b"(3, 3, 4)", b"(9**9,)  "))
        refused(lambda: open_masks(file), file, "cannot be read")
        for wrong in (b"", b"hello", content[:30]):
            file.write_bytes(wrong)
            refused(lambda: open_masks(file), file, "cannot be read")
        np.save(file, np.array([{"a": 1}]), allow_pickle=True)
        refused(lambda: open_masks(file), file, "it holds Python objects")
        packed = tmp_path / "a.npz"
        packed.write_bytes(b"PK hello")
        refused(lambda: open_masks(packed), packed, "cannot be read")
        np.savez_compressed(packed, labels=SCENE)
        damaged = bytearray(packed.read_bytes())
        damaged[100:110] = b"\xff" * 10
        packed.write_bytes(damaged)
        refused(lambda: list(open_masks(packed)), packed)
        with zipfile.ZipFile(packed, "w") as archive:
            archive.writestr("readme.txt", "no array")
        refused(lambda: open_masks(packed), packed, "got nothing")

    def test_frames_that_a_head_claims(self, tmp_path: Path) -> None:
        """Ten thousand million frames are claimed, none is there: nothing is reserved for them."""
        file = tmp_path / "a.npy"
        header = b"{'descr': '|u1', 'fortran_order': False, 'shape': (9999999999, 3, 4), }"
        header += b" " * (117 - len(header)) + b"\n"
        file.write_bytes(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
        tracemalloc.start()
        refused(lambda: open_masks(file), file, "at most 10000000 frames, got 9999999999")
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
        tracemalloc.stop()
