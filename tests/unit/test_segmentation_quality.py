"""Covering, object IoU and label permanence: worked by hand, and held equal to the plain Python twin."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sec_lab.segmentation import Segmentation
from sec_lab.segmentation.quality import covering, quality
from tests.naive_quality import naive_covering, naive_iou, naive_kept

# One row a frame: two objects (2 and 3) on a background (1).
TRUTH = np.array([[[1, 1, 2, 2, 3, 3]]] * 4)


def movie(*rows: str) -> np.ndarray:
    """One frame of one row of labels per text."""
    return np.array([[[int(label) for label in row]] for row in rows])


class TestCovering:
    def test_weighs_by_area(self) -> None:
        # Five of six pixels: |{1}| = 4 with IoU 4/5; |{2}| = 2 with IoU 1/2.
        assert covering([[8, 8, 8, 8, 8, 5]], [[1, 1, 1, 1, 2, 2]]) == pytest.approx((4 * 4 / 5 + 2 * 1 / 2) / 6)

    def test_does_not_ask_for_the_same_labels(self) -> None:
        assert covering(np.where(TRUTH[0] == 1, 500, 10 * TRUTH[0]), TRUTH[0]) == 1

    def test_one_segment_covers_as_much_as_its_best_part(self) -> None:
        assert covering(np.zeros((4, 4), int), np.arange(16).reshape(4, 4)) == pytest.approx(1 / 16)
        assert covering(np.arange(16).reshape(4, 4), np.zeros((4, 4), int)) == pytest.approx(1 / 16)

    def test_largest_labels(self) -> None:
        assert covering(np.uint16([[65535, 0]]), [[0, 65535]]) == 1

    @pytest.mark.parametrize(
        ("labels", "truth", "message"),
        [
            ([[1, 2]], [[1], [2]], r"labels: expected shape \(2, 1\) like the truth, got \(1, 2\)"),
            ([1, 2], [[1, 2]], "labels: expected 2 dimensions"),
            ([[1.0]], [[1]], "labels: expected whole numbers, got values of float64"),
            ([[1]], [[-1]], "truth: expected labels from 0 on, got -1"),
            ([[65536]], [[1]], "labels: expected labels up to 65535, got 65536"),
            (np.zeros((0, 2), int), np.zeros((0, 2), int), "at least one pixel"),
        ],
    )
    def test_refuses(self, labels: object, truth: object, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            covering(labels, truth)


class TestKept:
    def test_all_labels_kept(self) -> None:
        found = quality(5 * TRUTH, TRUTH, background=1, min_pixels=1)
        assert (found.kept, found.object_iou, found.covering, found.n_labels) == (1, 1, 1, 3)
        assert dict(found.kept_of) == {2: 1, 3: 1}

    def test_a_new_label_is_not_the_own_one(self) -> None:
        found = quality(movie("112233", "112233", "112233", "117733"), TRUTH, background=1, min_pixels=1)
        assert dict(found.kept_of) == {2: 3 / 4, 3: 1}
        assert found.kept == pytest.approx(7 / 8)
        assert found.object_iou == 1  # the segment is right, its label is not
        assert found.n_labels == 4

    def test_a_swap_is_seen(self) -> None:
        found = quality(movie("112233", "112233", "112233", "113322"), TRUTH, background=1, min_pixels=1)
        assert dict(found.kept_of) == {2: 3 / 4, 3: 3 / 4}

    def test_two_objects_of_one_label_are_both_not_kept(self) -> None:
        found = quality(movie(*["112222"] * 4), TRUTH, background=1, min_pixels=1)
        assert dict(found.kept_of) == {2: 0, 3: 0}
        assert dict(found.iou_of) == {2: 1 / 2, 3: 1 / 2}

    def test_what_the_background_swallows_is_not_kept(self) -> None:
        labels = movie("111133", "111133", "111133", "112233")
        assert dict(quality(labels, TRUTH, background=1, min_pixels=1).kept_of) == {2: 0, 3: 1}

    def test_the_background_is_an_object_unless_it_is_named(self) -> None:
        assert set(quality(TRUTH, TRUTH, min_pixels=1).kept_of) == {1, 2, 3}

    def test_most_pixels_decide_and_the_smaller_label_of_equals(self) -> None:
        truth = [[[1, 2, 2, 2]], [[1, 2, 2, 2]], [[1, 1, 2, 2]]]
        labels = [[[1, 5, 5, 9]], [[1, 5, 9, 9]], [[1, 1, 9, 5]]]  # wears 5, 9, 5
        assert quality(labels, truth, background=1, min_pixels=1).kept == pytest.approx(2 / 3)

    def test_frames_with_too_few_pixels_do_not_count(self) -> None:
        truth = [[[1, 2, 2, 2]], [[1, 1, 1, 2]], [[1, 1, 1, 1]]]
        labels = [[[1, 2, 2, 2]], [[1, 1, 1, 7]], [[1, 1, 1, 1]]]
        assert quality(labels, truth, background=1, min_pixels=1).kept == 1 / 2
        assert quality(labels, truth, background=1, min_pixels=2).kept == 1

    def test_reads_a_segmentation(self) -> None:
        segmentation = Segmentation.from_labels(TRUTH, background=1)
        assert quality(segmentation, iter(TRUTH), background=1, min_pixels=1).kept == 1

    @pytest.mark.parametrize(
        ("labels", "truth", "options", "message"),
        [
            (TRUTH[:3], TRUTH, {}, "labels: expected as many label images as of truth, got 3"),
            (TRUTH, TRUTH[:2], {}, "truth: expected as many label images as of labels, got 2"),
            ([], [], {}, "at least one label image"),
            ([TRUTH[0], TRUTH[0, :, :3]], TRUTH[:2], {}, "label image 1: labels: expected shape"),
            (TRUTH, TRUTH, {"min_pixels": 0}, "min_pixels: expected at least 1, got 0"),
            (TRUTH, TRUTH, {"min_pixels": 3}, "expected an object of 3 pixels or more"),
            (TRUTH, TRUTH, {"background": -1}, "background: expected a label from 0"),
        ],
    )
    def test_refuses(self, labels: object, truth: object, options: dict[str, int], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            quality(labels, truth, **options)

    def test_record_is_frozen_and_can_be_sent(self) -> None:
        found = pickle.loads(pickle.dumps(quality(TRUTH, TRUTH, background=1, min_pixels=1)))
        assert found.kept == 1
        with pytest.raises(ValueError, match="read-only"):
            found.covering_by_frame[0] = 0
        with pytest.raises(TypeError):
            found.kept_of[2] = 0


@st.composite
def movies(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    shape = draw(st.tuples(st.integers(1, 4), st.integers(1, 4), st.integers(1, 5)))
    few, many = (arrays(np.uint16, shape, elements=st.integers(0, n)) for n in (2, 4))
    return draw(many), draw(few)


@given(movies(), st.sampled_from([None, 0, 1]), st.integers(1, 3))
def test_equals_the_twin(both: tuple[np.ndarray, np.ndarray], background: int | None, min_pixels: int) -> None:
    labels, truth = both
    options = {"background": background, "min_pixels": min_pixels}
    expected = [naive_covering(*images) for images in zip(labels.tolist(), truth.tolist(), strict=True)]
    assert [covering(*images) for images in zip(labels, truth, strict=True)] == pytest.approx(expected)
    kept = naive_kept(labels.tolist(), truth.tolist(), **options)
    if not kept:
        with pytest.raises(ValueError, match="expected an object"):
            quality(labels, truth, **options)
        return
    found = quality(labels, truth, **options)
    iou = naive_iou(labels.tolist(), truth.tolist(), **options)
    assert dict(found.kept_of) == pytest.approx(kept)
    assert dict(found.iou_of) == pytest.approx(iou)
    assert found.kept == pytest.approx(sum(kept.values()) / len(kept))
    assert found.object_iou == pytest.approx(sum(iou.values()) / len(iou))
    assert found.covering == pytest.approx(sum(expected) / len(expected))
    assert found.covering_by_frame.tolist() == pytest.approx(expected)
    assert found.n_labels == len(set(labels.ravel().tolist()))
