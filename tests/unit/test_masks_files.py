"""Masks in single files: COCO, YouTube-VIS, SA-V, MOTS, NumPy; each written here by the rules of its format."""

import json
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.files import UnusableFileError
from sec_lab.recording import json_files
from sec_lab.segmentation import Segmentation
from sec_lab.segmentation.masks import open_masks, open_objects
from sec_lab.segmentation.masks.options import MaskOptions
from sec_lab.segmentation.masks.sa_v import open_sa_v
from tests import naive_masks as naive

Labels = NDArray[np.uint8]

# Three frames: a hand 1 that comes to a cup 2 in the second and hides it in the third.
SCENE = np.zeros((3, 3, 4), dtype=np.uint8)
SCENE[0, 1:, 3:] = SCENE[1, 1:, 3:] = 2
SCENE[1, 1, 1:3] = 1
SCENE[2, 1:, 1:] = 1


def encoded(mask: NDArray[np.bool_], *, compressed: bool = True) -> dict[str, Any]:
    runs = naive.runs_of_mask(mask)
    return {"size": list(mask.shape), "counts": naive.compress(runs) if compressed else runs}


def youtube_vis(labels: Labels, *, compressed: bool = True) -> dict[str, Any]:
    """By the description of the data set: null where an object is absent; frames are named by every fifth number."""
    n, height, width = labels.shape
    annotations = [
        {
            "id": 100 + label,
            "video_id": 7,
            "category_id": label,
            "iscrowd": 0,
            "segmentations": [
                encoded(i == label, compressed=compressed) if (i == label).any() else None for i in labels
            ],
        }
        for label in np.unique(labels[labels > 0]).tolist()
    ]
    video = {"id": 7, "width": width, "height": height, "length": n}
    video["file_names"] = [f"0043f083b5/{5 * i:05d}.jpg" for i in range(n)]
    return {
        "videos": [video],
        "categories": [{"id": 1, "name": "hand"}, {"id": 2, "name": "cup"}],
        "annotations": annotations,
    }


def coco(labels: Labels) -> dict[str, Any]:
    n, height, width = labels.shape
    images = [{"id": 40 + i, "height": height, "width": width, "file_name": f"movie/{i}.jpg"} for i in range(n)]
    annotations = [
        {
            "id": 1000 * place + label,
            "image_id": 40 + place,
            "category_id": label,
            "track_id": 10 * label,
            "iscrowd": 1,
            "segmentation": encoded(image == label, compressed=False),
        }
        for place, image in enumerate(labels)
        for label in np.unique(image[image > 0]).tolist()
    ]
    return {"images": images[::-1], "annotations": annotations, "categories": [{"id": 2, "name": "cup"}]}


def sa_v(labels: Labels) -> dict[str, Any]:
    """By the data set's own description: numbers are floats, every object is listed in every frame."""
    n, height, width = labels.shape
    ids = [label - 1 for label in np.unique(labels[labels > 0]).tolist()]
    return {
        "video_id": "sav_000001",
        "video_height": float(height),
        "video_width": float(width),
        "video_frame_count": 4.0 * n,
        "masklet": [[encoded(image == number + 1) for number in ids] for image in labels],
        "masklet_id": ids,
        "masklet_type": ["manual"] * len(ids),
    }


def save(path: Path, document: object) -> Path:
    path.write_text(json.dumps(document))
    return path


def images_of(segmentation: Segmentation) -> NDArray[np.uint16]:
    return np.stack(list(segmentation))


def frames_of(segmentation: Segmentation) -> list[int]:
    return [number for number, _ in segmentation.numbered()]


def refused(act: object, *parts: object, error: type[Exception] = UnusableFileError) -> None:
    with pytest.raises(error) as raised:
        act()  # type: ignore[operator]
    message = str(raised.value)
    assert "\n" not in message
    for part in parts:
        assert str(part) in message, message


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "masks.json"


class TestYoutubeVis:
    @pytest.mark.parametrize("compressed", [True, False])
    def test_masks_frames_and_names(self, file: Path, compressed: bool) -> None:
        segmentation = open_masks(save(file, youtube_vis(SCENE, compressed=compressed)))
        np.testing.assert_array_equal(images_of(segmentation), np.array([0, 101, 102])[SCENE])
        assert frames_of(segmentation) == [0, 5, 10]
        assert dict(segmentation.names) == {0: "background", 101: "hand", 102: "cup"}
        np.testing.assert_array_equal(images_of(segmentation), np.array([0, 101, 102])[SCENE])

    def test_stride_replaces_the_numbers_of_files(self, file: Path) -> None:
        assert frames_of(open_masks(save(file, youtube_vis(SCENE)), stride=2)) == [0, 2, 4]
        assert frames_of(open_masks(file, frames=[3, 4, 9])) == [3, 4, 9]

    def test_results(self, file: Path) -> None:
        """Results are a list without ids, and have no more than a category."""
        results = [
            {"video_id": 7, "score": 0.9, "category_id": 1, "segmentations": entry["segmentations"]}
            for entry in youtube_vis(SCENE)["annotations"]
        ]
        segmentation = open_masks(save(file, results), names={1: "left hand"})
        np.testing.assert_array_equal(images_of(segmentation), SCENE)
        assert dict(segmentation.names) == {0: "background", 1: "left hand", 2: "category 1 2"}
        assert frames_of(segmentation) == [0, 1, 2]
        results[0]["segmentations"] = results[1]["segmentations"] = [None] * 3
        refused(lambda: open_masks(save(file, results)), file, "at least one run-length encoding")

    def test_ids_above_labels_are_counted(self, file: Path) -> None:
        document = youtube_vis(SCENE)
        for entry in document["annotations"]:
            entry["id"] += 70_000
        segmentation = open_masks(save(file, document), background=1)
        np.testing.assert_array_equal(images_of(segmentation), np.array([1, 2, 3])[SCENE])
        assert dict(segmentation.names) == {1: "background", 2: "hand", 3: "cup"}

    def test_several_movies(self, file: Path) -> None:
        document = youtube_vis(SCENE)
        document["videos"].append({"id": 8, "width": 4, "height": 3, "length": 1, "name": "other"})
        document["annotations"].append(
            {"id": 1, "video_id": 8, "category_id": 2, "segmentations": [encoded(SCENE[0] == 2)]}
        )
        save(file, document)
        refused(
            lambda: open_masks(file), file, "expected one of the 2 movies (7 (0043f083b5), 8 (other)), none was chosen"
        )
        refused(lambda: open_masks(file, video="third"), "got 'third'")
        for video in (8, "other"):
            assert len(open_masks(file, video=video)) == 1
        for video in (7, "0043f083b5"):
            assert len(open_masks(file, video=video)) == 3

    def test_polygons(self, file: Path) -> None:
        document = youtube_vis(SCENE)
        document["annotations"][1]["segmentations"] = [[[3, 1, 4, 1, 4, 3, 3, 3]], [[3, 1, 4, 1, 4, 3, 3, 3]], None]
        segmentation = open_masks(save(file, document))
        np.testing.assert_array_equal(images_of(segmentation), np.array([0, 101, 102])[SCENE])

    @pytest.mark.parametrize(
        ("path", "value", "reason"),
        [
            (["videos"], None, "videos: expected a list, got NoneType"),
            (["videos"], [3], "videos[0]: expected an object, got int"),
            (["videos", 0, "height"], 5, "frame 0: object 102: expected a mask of 5×4, got size [3, 4]"),
            (["videos", 0, "height"], 3.5, "video.height: expected a whole number from 0 on, got 3.5"),
            (["videos", 0, "height"], 10**9, "video: expected 1 to 67108864 pixels"),
            (["videos", 0, "length"], 2, "video: expected 2 file_names, got 3"),
            (["videos", 0, "length"], 10**12, "file_names"),
            (["videos", 0, "file_names"], None, ""),
            (["videos", 0, "file_names"], ["b/1.jpg", "b/3.jpg", "b/2.jpg"], "ascending"),
            (["videos", 0, "file_names"], ["b/1.jpg", "b/1.jpg", "b/2.jpg"], "two with the number 1"),
            (["annotations", 0, "video_id"], "7", "annotation.video_id: expected a whole number from 0 on, got 7"),
            (["annotations", 0, "id"], 102, "expected each id once, got 102 twice"),
            (["annotations", 0, "id"], True, "annotation.id: expected a whole number"),
            (["annotations", 0, "category_id"], -1, "object 101.category_id"),
            (["annotations", 0, "segmentations"], {}, "object 101: expected a list of segmentations"),
            (["annotations", 0, "segmentations"], [None], "object 101: expected 3 segmentations, one a frame, got 1"),
            (["annotations", 0, "segmentations", 1], 7, "frame 5: object 101: expected a run-length encoding"),
            (["annotations", 0, "segmentations", 1, "counts"], [1, 2], "frame 5: object 101: runs: expected 12 pixels"),
            (["annotations", 0, "segmentations", 1], [[0, 0, 1, 1]], "frame 5: object 101: polygon: expected x and y"),
            (["categories", 0, "name"], 5, "expected a name of category 1, got 5"),
        ],
    )
    def test_malformed(self, file: Path, path: list[Any], value: object, reason: str) -> None:
        document = place = youtube_vis(SCENE)
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        save(file, document)
        if reason:
            refused(lambda: list(open_masks(file)), file, reason)
        else:
            assert frames_of(open_masks(file)) == [0, 1, 2]

    def test_length_that_nothing_has(self, file: Path) -> None:
        """A length alone makes no list of frames."""
        document = youtube_vis(SCENE)
        del document["videos"][0]["file_names"]
        document["videos"][0]["length"] = 10**12
        refused(lambda: open_masks(save(file, document)), file, "expected 1000000000000 segmentations")
        del document["videos"][0]["length"]
        refused(lambda: open_masks(save(file, document)), file, "expected length or file_names, got neither")


class TestCoco:
    def test_masks_frames_and_names(self, file: Path) -> None:
        segmentation = open_masks(save(file, coco(SCENE)))
        np.testing.assert_array_equal(images_of(segmentation), np.array([0, 10, 20])[SCENE])
        assert frames_of(segmentation) == [0, 1, 2]
        assert dict(segmentation.names) == {0: "background", 10: "category 1", 20: "cup"}

    def test_frame_ids_and_movies(self, file: Path) -> None:
        document = coco(SCENE)
        for image in document["images"]:
            image["frame_id"] = (image["id"] - 40) * 3
            image["video_id"] = 2
            image["file_name"] = "same.jpg"
        document["images"].append({"id": 1, "height": 9, "width": 9, "frame_id": 0, "video_id": 3})
        save(file, document)
        assert frames_of(open_masks(file, video=2, stride=3)) == [0, 3, 6]
        refused(lambda: open_masks(file, video=2), file, "frame 1 has none")
        refused(lambda: open_masks(file), file, "expected one of the 2 movies (2, 3), none was chosen")

    def test_objects_known_by_category(self, file: Path) -> None:
        document = coco(SCENE)
        for entry in document["annotations"]:
            del entry["track_id"]
        np.testing.assert_array_equal(images_of(open_masks(save(file, document))), SCENE)
        document["annotations"][1]["category_id"] = document["annotations"][2]["category_id"] = 2
        refused(lambda: open_masks(save(file, document)), file, "expected a track_id", "image 41 shows 2 of category 2")

    @pytest.mark.parametrize(
        ("path", "value", "reason"),
        [
            (["images"], [], "images: expected at least one, got none"),
            (["images", 0, "height"], 5, "expected 5×4, got 3×4"),
            (["images", 1, "id"], 42, "expected each id once"),
            (["images", 0, "file_name"], "movie/7.jpg", "frame 2 has none"),
            (["annotations", 0, "image_id"], None, "annotation.image_id: expected a whole number"),
            (["annotations", 0, "track_id"], None, "annotation.track_id: expected a whole number"),
            (["annotations", 1, "track_id"], 20, "image 41: expected object 20 once, got it twice"),
            (["annotations", 0, "segmentation"], "x", "frame 0: object 20: expected a run-length encoding"),
        ],
    )
    def test_malformed(self, file: Path, path: list[Any], value: object, reason: str) -> None:
        document = place = coco(SCENE)
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        refused(lambda: list(open_masks(save(file, document))), file, reason)

    def test_without_segmentation(self, file: Path) -> None:
        document = coco(SCENE)
        del document["annotations"][0]["segmentation"]
        refused(
            lambda: open_masks(save(file, document)), file, "image 40: expected a segmentation of object 20, got none"
        )


class TestSaV:
    def test_every_fourth_frame(self, file: Path) -> None:
        segmentation = open_masks(save(file, sa_v(SCENE)))
        np.testing.assert_array_equal(images_of(segmentation), SCENE)
        assert frames_of(segmentation) == [0, 4, 8]
        assert dict(segmentation.names) == {0: "background", 1: "0", 2: "1"}
        assert frames_of(open_masks(file, stride=1)) == [0, 1, 2]

    def test_overlaps_and_absence(self, file: Path) -> None:
        document = sa_v(SCENE)
        document["masklet"][0][0] = encoded(np.ones((3, 4), dtype=bool))
        document["masklet"][1][0] = None
        save(file, document)
        (_, first), (_, second), _ = open_objects(file)
        assert [(label, int(mask.sum())) for label, mask in first] == [(1, 12), (2, 2)]
        assert [label for label, _ in second] == [2]
        refused(lambda: list(open_masks(file)), file, "frame 0: objects 1 and 2 overlap")
        assert images_of(open_masks(file, overlap="smaller on top"))[0].tolist() == [
            [1] * 4,
            [1, 1, 1, 2],
            [1, 1, 1, 2],
        ]

    @pytest.mark.parametrize(
        ("path", "value", "reason"),
        [
            (["masklet"], [], "masklet: expected a list of frames"),
            (["masklet"], {"a": 1}, "masklet: expected a list of frames"),
            (["masklet", 0], 3, "masklet[0]: expected a list of masks, got int"),
            (["masklet", 1], [], "masklet[1]: expected masks of 2 objects, got 0"),
            (["masklet", 1], 3, "masklet[1]: expected masks of 2 objects, got int"),
            (["masklet_id"], [0], "masklet[0]: expected masks of 1 objects, got 2"),
            (["masklet_id"], [3, 3], "masklet_id: expected each id once"),
            (["masklet_id"], [0, "x"], "masklet.id: expected a whole number"),
            (["masklet_id"], 5, "masklet_id: expected a list of ids, got int"),
            (["video_height"], None, "video.video_height: expected a whole number"),
            (["video_height"], 10**400, "video.video_height: expected a whole number from 0 on, got 1000"),
            (["video_height"], 9.0, "frame 0: object 1: expected a mask of 9×4, got size [3, 4]"),
            (["video_frame_count"], 8.0, "expected masks of 8 frames, got one of frame 8"),
            (["masklet", 2, 1, "counts"], "0", "frame 8: object 2: runs: expected 12 pixels in all, got 0"),
        ],
    )
    def test_malformed(self, file: Path, path: list[Any], value: object, reason: str) -> None:
        document = place = sa_v(SCENE)
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        refused(lambda: list(open_masks(save(file, document))), file, reason)


class TestHostileJson:
    def test_infinity_by_another_name(self, file: Path) -> None:
        text = json.dumps(sa_v(SCENE))
        for key in ('"video_height": 3.0', '"video_frame_count": 12.0'):
            assert key in text
            file.write_text(text.replace(key, key.split(":")[0] + ": 1e999"))
            refused(lambda: open_masks(file), file, "expected a whole number from 0 on, got inf")

    @pytest.mark.parametrize("format", [None, "COCO", "YouTube-VIS", "SA-V"])
    @pytest.mark.parametrize(
        "content", ["", "{", "3", "null", '{"a": 1}', '{"masklet": NaN}', "[" * 100_000, "\xff\xfe\x00"]
    )
    def test_what_is_no_mask(self, file: Path, format: Any, content: str) -> None:  # noqa: A002
        file.write_bytes(content.encode("latin-1"))
        refused(lambda: open_masks(file, format=format), file, "expected")

    def test_documents_of_another_format(self, file: Path) -> None:
        save(file, sa_v(SCENE))
        refused(lambda: open_masks(file, format="COCO"), file, "images: expected a list")
        refused(lambda: open_masks(file, format="YouTube-VIS"), file, "annotations: expected a list")
        save(file, [])
        refused(lambda: open_masks(file, format="SA-V"), file, "expected masks (SA-V), an object, got list")
        refused(lambda: open_masks(file), file, "expected one of the 0 movies")

    def test_sizes_that_no_picture_has(self, file: Path) -> None:
        document = sa_v(SCENE)
        document["video_height"] = document["video_width"] = 100_000.0
        document["masklet"] = [[{"size": [100_000, 100_000], "counts": [10**10]}]]
        document["masklet_id"] = [0]
        refused(lambda: open_masks(save(file, document)), file, "expected 1 to 67108864 pixels, got 100000×100000")
        tracemalloc.start()
        with pytest.raises(ValueError, match="pixels"):
            open_sa_v(document, MaskOptions(), background=0)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
        tracemalloc.stop()

    def test_many_lists(self, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(json_files, "MAX_CONTAINERS", 10_000)
        file.write_text("[" + "[]," * 20_000 + "[]]")
        refused(lambda: open_masks(file), file, "at most 10000 lists and objects")


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
