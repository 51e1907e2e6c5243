"""Run-length encodings and polygons: equal to slow, obvious ones, and no bomb."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from sec_lab.segmentation.masks.polygons import polygon_mask
from sec_lab.segmentation.masks.rle import decode, decode_runs, runs_of_text
from tests import naive_masks as naive

SIZES = st.tuples(st.integers(1, 12), st.integers(1, 12))
MASKS = npst.arrays(np.bool_, SIZES)


class TestRunLengths:
    @given(MASKS)
    def test_masks_come_back(self, mask: naive.Mask) -> None:
        runs = naive.runs_of_mask(mask)
        text = naive.compress(runs)
        np.testing.assert_array_equal(decode_runs(runs, mask.shape), mask)
        np.testing.assert_array_equal(decode_runs(text, mask.shape), mask)
        encoded = {"size": list(mask.shape), "counts": text}
        np.testing.assert_array_equal(decode(encoded, mask.shape), naive.mask_of_runs(runs, mask.shape))

    @given(st.lists(st.integers(0, 1 << 30), max_size=40))
    def test_texts_of_any_numbers(self, runs: list[int]) -> None:
        text = naive.compress(runs)
        assert runs_of_text(text).tolist() == naive.decompress(text) == runs

    @given(st.text(st.characters(min_codepoint=48, max_codepoint=111), max_size=40))
    def test_any_text_is_read_the_same_or_refused(self, text: str) -> None:
        groups = text.translate({code: "x" if code < 48 + 32 else "-" for code in range(48, 112)}).split("x")
        if groups[-1] or max(map(len, groups)) > 6:
            with pytest.raises(ValueError, match="runs: expected"):
                runs_of_text(text)
        else:
            assert runs_of_text(text).tolist() == naive.decompress(text)

    @pytest.mark.parametrize(
        ("runs", "text"),
        [
            # 0 6 1 are written as they are; then 3 - 6 = -3, which is 29 in five bits: 48 + 29 is M.
            ([0, 6, 1, 3], "061M"),
            # 1024 is 0, 0, 1 in groups of five bits; the first two have one more behind them: 48 + 32 is P.
            ([0, 1024], "0PP1"),
            # 16 would look negative, so it takes a second group.
            ([16], "`0"),
            ([], ""),
        ],
    )
    def test_examples(self, runs: list[int], text: str) -> None:
        assert runs_of_text(text).tolist() == runs
        assert naive.compress(runs) == text

    def test_columns_come_first(self) -> None:
        mask = np.array([[0, 0, 1, 0], [0, 1, 1, 0]], dtype=bool)
        np.testing.assert_array_equal(decode_runs([3, 3, 2], (2, 4)), mask)

    @pytest.mark.parametrize(
        ("encoded", "reason"),
        [
            (None, 'with "size" and "counts"'),
            ("061", 'with "size" and "counts"'),
            ({"counts": [6]}, 'with "size" and "counts"'),
            ({"size": [3, 2], "counts": [6]}, "expected a mask of 2×3, got size \\[3, 2\\]"),
            ({"size": "2x3", "counts": [6]}, "got size '2x3'"),
            ({"size": [[2], [3]], "counts": [6]}, "expected a mask of 2×3"),
            ({"size": [2, 3], "counts": [5]}, "expected 6 pixels in all, got 5"),
            ({"size": [2, 3], "counts": []}, "expected 6 pixels in all, got 0"),
            ({"size": [2, 3], "counts": [2, 5, -1]}, "from 0 on, got -1"),
            ({"size": [2, 3], "counts": [1.5, 4.5]}, "whole numbers"),
            ({"size": [2, 3], "counts": [[1, 5]]}, "runs: expected 1 dimensions"),
            ({"size": [2, 3], "counts": [1, [5]]}, "runs: expected a rectangular array"),
            ({"size": [2, 3], "counts": ["1", "5"]}, "runs: expected numbers"),
            ({"size": [2, 3], "counts": None}, "runs: expected numbers"),
            ({"size": [2, 3], "counts": {"a": 1}}, "runs: expected numbers"),
            ({"size": [2, 3], "counts": "15~"}, "characters from '0' to 'o'"),
            ({"size": [2, 3], "counts": "15ü"}, "characters from '0' to 'o'"),
            ({"size": [2, 3], "counts": "1\ud800"}, "characters from '0' to 'o'"),
            ({"size": [2, 3], "counts": "1P"}, "expected a whole number at the end"),
            ({"size": [2, 3], "counts": "1" + "P" * 8 + "0"}, "at most 7 characters, got one of 9"),
            ({"size": [2, 3], "counts": "1M"}, "from 0 on, got -3"),
        ],
    )
    def test_malformed(self, encoded: object, reason: str) -> None:
        with pytest.raises(ValueError, match=reason):
            decode(encoded, (2, 3))

    @pytest.mark.parametrize(
        "counts",
        [
            [1 << 62, 1 << 62, 1 << 62, 1 << 62, 12],  # goes round to 12
            [6_000_000_000, 1],
            [1 << 70],
            naive.compress([1 << 33, 1 << 33]),
            naive.compress([0, 30_000_000_000]),
        ],
    )
    def test_no_memory_bomb(self, counts: list[int] | str) -> None:
        tracemalloc.start()
        with pytest.raises(ValueError, match="expected"):
            decode({"size": [3, 4], "counts": counts}, (3, 4))
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert most < 1_000_000


class TestPolygons:
    @given(
        st.lists(st.tuples(st.integers(-8, 40), st.integers(-8, 40)), min_size=3, max_size=8),
        st.sampled_from([1, 2, 8]),
    )
    def test_as_a_ray_sees_it(self, corners: list[tuple[int, int]], divisor: int) -> None:
        # Such coordinates are exact, so it is beyond doubt on which side of an edge a centre lies.
        points = [(x / divisor, y / divisor) for x, y in corners]
        flat = [coordinate for point in points for coordinate in point]
        np.testing.assert_array_equal(polygon_mask([flat], (9, 11)), naive.polygon_mask(points, (9, 11)))

    def test_unit_box_is_the_first_pixel(self) -> None:
        assert np.argwhere(polygon_mask([[0, 0, 1, 0, 1, 1, 0, 1]], (3, 3))).tolist() == [[0, 0]]

    def test_parts_of_one_object(self) -> None:
        box, other = [0, 0, 2, 0, 2, 2, 0, 2], [1, 1, 3, 1, 3, 3, 1, 3]
        mask = polygon_mask([box, other], (3, 3))
        assert mask.astype(int).tolist() == [[1, 1, 0], [1, 1, 1], [0, 1, 1]]

    @pytest.mark.parametrize(
        ("polygons", "reason"),
        [
            ([], "at least one polygon"),
            ({}, "at least one polygon"),
            ([[0, 0, 1, 1]], "at least three corners, got 4 numbers"),
            ([[0, 0, 1, 1, 2, 2, 3]], "at least three corners, got 7 numbers"),
            ([[0, 0, 1, 1, 2, float("nan")]], "coordinates of at most"),
            ([[0, 0, 1, 1, 2, 1e300]], "coordinates of at most 1e\\+07, got 1e\\+300"),
            ([[0, 0, 1, 1, 2, "2"]], "polygon: expected numbers"),
            ([7], "polygon: expected 1 dimensions"),
            ([[0] * 200_002], "at most 100000 corners"),
        ],
    )
    def test_malformed(self, polygons: object, reason: str) -> None:
        with pytest.raises(ValueError, match=reason):
            polygon_mask(polygons, (3, 3))
