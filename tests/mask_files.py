"""Mask files by the documented rules of the tools that write them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.files import UnusableFileError
from sec_lab.segmentation import Segmentation
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
