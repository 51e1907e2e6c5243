"""Segments of the right picture called like those of the left one."""

import numpy as np
import pytest

from sec_lab.segmentation.stereo_labels import matched_labels


def scene(shift: int) -> np.ndarray:
    labels = np.ones((20, 40), dtype=np.int64)
    labels[5:15, 20 - shift : 30 - shift] = 2
    return labels


def test_other_labels_of_a_shifted_scene_become_the_same() -> None:
    left, right = scene(0), 10 * scene(4)
    found = matched_labels(left, right, np.full(left.shape, 4.0))
    assert np.array_equal(found.labels, scene(4))
    assert found.agreeing == 1.0


def test_wrong_disparity_agrees_less() -> None:
    left, right = scene(0), scene(4)
    # Of 36 visible columns of 20 rows, the object's 10 rows disagree in four columns at either side.
    found = matched_labels(left, right, np.zeros(left.shape))
    assert found.agreeing == pytest.approx(1 - 10 * 8 / (20 * 40))


def test_a_segment_without_counterpart_gets_a_label_of_its_own() -> None:
    left = scene(0)
    right = scene(0)
    right[5:15, 20:25] = 3
    right[0:3, 0:3] = 2
    found = matched_labels(left, right, np.zeros(left.shape))
    # 50 pixels of the object are 3 and 50 are 2 (and 9 of the background): only one of them can be the object.
    assert len(set(np.unique(found.labels)) - {1, 2}) == 1


def test_unknown_disparity_does_not_vote() -> None:
    left = scene(0)
    disparity = np.full(left.shape, np.nan)
    disparity[10, 25] = 0.0
    found = matched_labels(left, scene(0), disparity)
    assert found.agreeing == 1.0
    with pytest.raises(ValueError, match="disparity: expected pixels that are seen in the right picture, got none"):
        matched_labels(left, left, np.full(left.shape, np.nan))


def test_shapes_must_agree() -> None:
    with pytest.raises(ValueError, match="right, disparity: expected shape"):
        matched_labels(scene(0), scene(0)[:5], np.zeros((20, 40)))
