"""Masks in JSON: YouTube-VIS, COCO, SA-V; hostile files."""

import json
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sec_lab.recording import json_files
from sec_lab.segmentation.masks import open_masks, open_objects
from sec_lab.segmentation.masks.options import MaskOptions
from sec_lab.segmentation.masks.sa_v import open_sa_v
from tests.mask_files import SCENE, coco, encoded, frames_of, images_of, refused, sa_v, save, youtube_vis


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
