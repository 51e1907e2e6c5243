"""The record of step 1, and whether it belongs to a recording."""

import pickle
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.recording import Recording
from sec_lab.segmentation import Segmentation, check_fit
from sec_lab.segmentation.record import FoundNames

LABELS = np.array([[[0, 1, 1]], [[0, 0, 1]], [[2, 2, 2]]], dtype=np.uint8)


def numbered(images: list[Any], numbers: list[int]) -> Iterator[tuple[int, Any]]:
    return zip(numbers, images, strict=True)


class TestSegmentation:
    def test_from_labels(self) -> None:
        segmentation = Segmentation.from_labels(LABELS, background=0, names={2: "cup", 1: None})
        assert (len(segmentation), segmentation.n_frames, segmentation.size) == (3, 3, (1, 3))
        assert dict(segmentation.names) == {0: "background", 1: None, 2: "cup"}
        for _ in range(2):
            np.testing.assert_array_equal(np.stack(list(segmentation)), LABELS)
        assert [number for number, _ in segmentation.numbered()] == [0, 1, 2]
        assert Segmentation.from_labels(LABELS).background is None
        assert dict(Segmentation.from_labels(LABELS, background=0, names={0: "table"}).names) == {0: "table"}

    def test_images_cannot_be_written_to(self) -> None:
        labels = LABELS.astype(np.uint16)
        image = next(iter(Segmentation.from_labels(labels)))
        assert np.shares_memory(image, labels)
        with pytest.raises(ValueError, match="read-only"):
            image[0, 0] = 1
        labels[0, 0, 0] = 5  # the caller's own array stays writable

    def test_stream_of_unknown_length(self) -> None:
        segmentation = Segmentation(partial(numbered, list(LABELS), [3, 4, 9]), (1, 3))
        assert segmentation.frames is None
        assert segmentation.n_frames is None
        with pytest.raises(TypeError, match="is not known"):
            len(segmentation)
        assert [number for number, _ in segmentation.numbered()] == [3, 4, 9]
        assert len(list(segmentation)) == 3

    def test_can_be_sent_to_another_process(self) -> None:
        segmentation = pickle.loads(pickle.dumps(Segmentation.from_labels(LABELS, background=0, frames=[1, 5, 6])))
        np.testing.assert_array_equal(np.stack(list(segmentation)), LABELS)
        assert segmentation.frames.tolist() == [1, 5, 6]
        assert not segmentation.frames.flags.writeable
        assert dict(segmentation.names) == {0: "background"}

    def test_found_names_are_looked_for_once(self) -> None:
        calls = []
        names = FoundNames(lambda: calls.append(1) or {1: "cup"})  # type: ignore[func-returns-value]
        segmentation = Segmentation.from_labels(LABELS, names=names)
        assert calls == []
        assert (dict(segmentation.names), len(segmentation.names), segmentation.names.get(7)) == ({1: "cup"}, 1, None)
        assert calls == [1]

    @pytest.mark.parametrize(
        ("images", "numbers", "frames", "message"),
        [
            (list(LABELS), [0, 2, 2], None, "frames: expected ascending frame numbers, got 2 after 2"),
            (list(LABELS), [0, 1, 3], [0, 1, 2], "frames: expected frame 2, got frame 3"),
            (list(LABELS), [0, 1, 2], [0, 1], "frames: expected no frame more, got frame 2"),
            (list(LABELS[:2]), [0, 1], [0, 1, 2], "frames: expected 3 label images, got 2"),
            ([LABELS[0], LABELS[0, :, :2]], [4, 7], None, r"frame 7: label image: expected 1×3, got shape \(1, 2\)"),
            ([LABELS[0] * 1.0], [4], None, "frame 4: label image: expected whole numbers, got values of float64"),
            ([LABELS[0].astype(int) - 1], [4], None, "frame 4: label image: expected labels from 0 on, got -1"),
            (
                [LABELS[0].astype(int) + 65535],
                [4],
                None,
                "frame 4: label image: expected labels up to 65535, got 65536",
            ),
            ([[["a"] * 3]], [4], None, "frame 4: label image: expected numbers"),
        ],
    )
    def test_streams_are_checked(self, images: list[Any], numbers: list[int], frames: Any, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            list(Segmentation(partial(numbered, images, numbers), (1, 3), frames))

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"labels": LABELS[0]}, "labels: expected 3 dimensions"),
            ({"labels": LABELS[:0]}, "frames: expected at least one frame, got none"),
            ({"labels": LABELS[:, :0]}, r"size: expected \(height, width\), at least one pixel each"),
            ({"frames": [0, 1]}, "frames: expected 3 numbers, one a label image, got 2"),
            ({"frames": [0, 2, 1]}, "frames: expected ascending frame numbers, got 1 after 2"),
            ({"frames": [-1, 2, 3]}, "frames: expected frame numbers from 0 on, got -1"),
            ({"background": 65536}, "background: expected a label from 0 to 65535, got 65536"),
            ({"background": 0.5}, "background: expected whole numbers"),
            ({"names": {1: 5}}, "names: expected text or None, got 5"),
            ({"names": {-1: "cup"}}, "label of a name: expected a label from 0 to 65535, got -1"),
        ],
    )
    def test_bad_input(self, arguments: dict[str, Any], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            Segmentation.from_labels(**{"labels": LABELS, **arguments})


class TestFit:
    def recording(self, n: int = 3, height: int = 1) -> Recording:
        frames: NDArray[np.uint8] = np.zeros((n, height, 3, 3), dtype=np.uint8)
        return Recording.from_frames(frames)

    def test_masks_of_some_frames_fit(self) -> None:
        check_fit(Segmentation.from_labels(LABELS), self.recording())
        check_fit(Segmentation.from_labels(LABELS, frames=[0, 4, 8]), self.recording(9))
        check_fit(Segmentation(partial(numbered, [], []), (1, 3)), self.recording(1))

    def test_what_does_not_fit(self) -> None:
        with pytest.raises(ValueError, match="masks: expected masks of 2×3 like the pictures, got 1×3"):
            check_fit(Segmentation.from_labels(LABELS), self.recording(height=2))
        with pytest.raises(ValueError, match=r"the recording has \(0 to 8\), got one of frame 9"):
            check_fit(Segmentation.from_labels(LABELS, frames=[0, 4, 9]), self.recording(9))
