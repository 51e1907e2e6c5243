"""The drawn movie written in every format gives the chain that its labels give; formats are told by their files."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from sec_lab.files import UnusableFileError
from sec_lab.observation import Observation, without_segments
from sec_lab.pipeline import observe_segments
from sec_lab.segmentation import Segmentation
from sec_lab.segmentation.masks import open_masks, write_palette_pngs
from sec_lab.worlds.drawn import moving_object
from tests import naive_masks as naive

Labels = NDArray[np.uint8]
SMALL = slice(None), slice(None, None, 4), slice(None, None, 4)
BACKGROUND = 1


@pytest.fixture(scope="module")
def labels() -> Labels:
    """Every second frame of the first sample at a quarter of its size, where the slow encoder is quick enough."""
    return moving_object(1).labels[SMALL][::2]


@pytest.fixture(scope="module")
def truth(labels: Labels) -> Observation:
    return observe_segments(labels, relations="edge counting")


def segments(image: Labels) -> list[int]:
    return [label for label in np.unique(image).tolist() if label != BACKGROUND]


def encoded(mask: naive.Mask) -> dict[str, Any]:
    return {"size": list(mask.shape), "counts": naive.compress(naive.runs_of_mask(mask))}


def as_palette(folder: Path, labels: Labels) -> Path:
    write_palette_pngs(folder / "masks", Segmentation.from_labels(labels))
    return folder / "masks"


def as_16_bits(folder: Path, labels: Labels) -> Path:
    for number, image in enumerate(labels):
        Image.fromarray(image.astype(np.uint16)).save(folder / f"{number:06d}.png")
    return folder


def as_rgb(folder: Path, labels: Labels) -> Path:
    for number, image in enumerate(labels):
        Image.fromarray(np.stack([image, 0 * image, 0 * image], axis=2)).save(folder / f"{number}.png")
    return folder


def as_objects(folder: Path, labels: Labels) -> Path:
    for label in segments(labels):
        (folder / f"{label:03d}").mkdir()
        for number, image in enumerate(labels):
            Image.fromarray((image == label).astype(np.uint8)).save(folder / f"{label:03d}" / f"{number:05d}.png")
    return folder


def as_coco(folder: Path, labels: Labels) -> Path:
    height, width = labels.shape[1:]
    images = [{"id": i, "frame_id": i, "height": height, "width": width} for i in range(len(labels))]
    annotations = [
        {"image_id": i, "category_id": 1, "instance_id": label, "segmentation": encoded(image == label)}
        for i, image in enumerate(labels)
        for label in segments(image)
    ]
    (folder / "coco.json").write_text(json.dumps({"images": images, "annotations": annotations}))
    return folder / "coco.json"


def as_youtube_vis(folder: Path, labels: Labels) -> Path:
    height, width = labels.shape[1:]
    annotations = [
        {"id": label, "video_id": 1, "category_id": 1, "segmentations": [encoded(image == label) for image in labels]}
        for label in segments(labels)
    ]
    video = {"id": 1, "height": height, "width": width, "length": len(labels)}
    (folder / "vis.json").write_text(json.dumps({"videos": [video], "annotations": annotations}))
    return folder / "vis.json"


def as_sa_v(folder: Path, labels: Labels) -> Path:
    height, width = labels.shape[1:]
    masklets = [[encoded(image == label) for label in segments(labels)] for image in labels]
    document = {"masklet": masklets, "masklet_id": segments(labels), "video_height": height, "video_width": width}
    (folder / "sav_000001_manual.json").write_text(json.dumps(document))
    return folder / "sav_000001_manual.json"


def as_mots(folder: Path, labels: Labels) -> Path:
    height, width = labels.shape[1:]
    lines = [
        f"{i} {label} 1 {height} {width} {encoded(image == label)['counts']}"
        for i, image in enumerate(labels)
        for label in segments(image)
    ]
    (folder / "0000.txt").write_text("\n".join(lines))
    return folder / "0000.txt"


def as_npy(folder: Path, labels: Labels) -> Path:
    np.save(folder / "labels.npy", labels.astype(np.int32))
    return folder / "labels.npy"


def as_npz(folder: Path, labels: Labels) -> Path:
    np.savez_compressed(folder / "labels.npz", labels=labels)
    return folder / "labels.npz"


Writer = Callable[[Path, Labels], Path]
WRITERS: list[Writer] = [
    as_palette,
    as_16_bits,
    as_rgb,
    as_objects,
    as_coco,
    as_youtube_vis,
    as_sa_v,
    as_mots,
    as_npy,
    as_npz,
]


@pytest.mark.parametrize("write", WRITERS)
def test_every_format_gives_the_same_chain(tmp_path: Path, labels: Labels, truth: Observation, write: Writer) -> None:
    stride = 1 if write is as_sa_v else None
    segmentation = open_masks(write(tmp_path, labels), background=BACKGROUND, stride=stride)
    seen = observe_segments(segmentation, relations="edge counting")
    np.testing.assert_array_equal(seen.chain.relations, truth.chain.relations)
    np.testing.assert_array_equal(seen.chain.pairs, truth.chain.pairs)
    np.testing.assert_array_equal(seen.key_frames, truth.key_frames)
    assert seen.names[BACKGROUND] == "background"


def test_whole_movie_in_the_format_of_davis(tmp_path: Path) -> None:
    movie = moving_object(1)
    write_palette_pngs(tmp_path / "masks", movie.labels)
    segmentation = open_masks(tmp_path / "masks", background=1, names=movie.names, size=(256, 320))
    seen, truth = (observe_segments(images, names=movie.names) for images in (segmentation, movie.labels))
    assert seen.chain.names == truth.chain.names
    np.testing.assert_array_equal(seen.chain.relations, truth.chain.relations)
    np.testing.assert_array_equal(seen.key_frames, truth.key_frames)


class TestObservation:
    def test_names_and_frames_are_the_segmentation_s_own(self, labels: Labels, truth: Observation) -> None:
        frames = 3 * np.arange(len(labels)) + 7
        segmentation = Segmentation.from_labels(labels, frames=frames, background=1, names={4: "ball"})
        seen = observe_segments(segmentation, relations="edge counting")
        np.testing.assert_array_equal(seen.key_frames, frames[truth.key_frames])
        assert dict(seen.names) == {1: "background", 4: "ball"}

    def test_names_and_frames_of_the_caller_come_first(self, labels: Labels, truth: Observation) -> None:
        segmentation = Segmentation.from_labels(labels, frames=np.arange(len(labels)) + 7, background=1)
        seen = observe_segments(segmentation, relations="edge counting", names={2: "cup"}, frames=range(len(labels)))
        np.testing.assert_array_equal(seen.key_frames, truth.key_frames)
        assert dict(seen.names) == {2: "cup"}

    def test_names_that_are_found_on_the_way(self, tmp_path: Path) -> None:
        for number, red in enumerate((1, 2)):
            image = np.zeros((6, 6, 3), dtype=np.uint8)
            image[1:3, 1:3] = red, 0, 7
            Image.fromarray(image).save(tmp_path / f"{number}.png")
        seen = observe_segments(open_masks(tmp_path))
        assert dict(seen.names) == {0: "background", 65535: "458753", 65534: "458754"}
        assert seen.segments.tolist() == [0, 65534, 65535]

    def test_background_can_be_left_out(self, labels: Labels) -> None:
        segmentation = Segmentation.from_labels(labels, background=1)
        seen = observe_segments(segmentation, relations="edge counting")
        assert segmentation.background is not None
        smaller = without_segments(seen, [segmentation.background])
        assert smaller.segments.tolist() == [2, 3, 4]
        assert dict(smaller.names) == {}

    def test_progress_knows_the_number_of_frames(self, labels: Labels, capsys: pytest.CaptureFixture[str]) -> None:
        observe_segments(Segmentation.from_labels(labels), progress=True)
        assert f"{len(labels)}/{len(labels)}" in capsys.readouterr().err

    def test_error_on_the_way_names_file_and_frame(self, tmp_path: Path, labels: Labels) -> None:
        folder = as_palette(tmp_path, labels)
        (folder / "00003.png").write_bytes(b"no picture")
        with pytest.raises(UnusableFileError, match=r"00003.png: expected a mask of 8 bits"):
            observe_segments(open_masks(folder))


class TestOptions:
    def test_what_is_no_mask(self, tmp_path: Path) -> None:
        def refused(path: Path, reason: str, **options: Any) -> None:
            with pytest.raises(ValueError, match=reason) as raised:
                open_masks(path, **options)
            assert "\n" not in str(raised.value)

        refused(tmp_path / "no", "no: expected masks, but there is no such file or folder")
        refused(tmp_path, "the folder holds no PNG and no folder")
        (tmp_path / "video").mkdir()
        refused(tmp_path, "folders that may be movies or objects")
        (tmp_path / "masks.tar").touch()
        refused(tmp_path / "masks.tar", "a file with the ending .json")
        (tmp_path / "masks.png").write_bytes(b"no picture")
        refused(tmp_path / "masks.png", "it does not begin like one")
        file = as_npz(tmp_path, np.zeros((2, 3, 4), dtype=np.uint8))
        refused(file, "format: expected one of", format="PNG")
        refused(file, "overlap: expected one of", overlap="mine")
        refused(file, "stride: expected a whole number from 1", stride=0)
        refused(file, "background: expected a label", background=-1)
        refused(file, "frames: expected ascending", frames=[3, 3])
        refused(file, "names: expected text or None", names={1: 2})
        refused(file, "size: expected", size=(3, 4, 5))
        refused(file, "expected masks of 4×4 like the pictures, got 3×4", size=(4, 4))
