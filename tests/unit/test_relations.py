import pickle
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.relations import (
    MAX_SEGMENTS,
    ScanLineCounts,
    SegmentRelations,
    edge_count_relations,
    line_sequences,
    normalized_counts,
    relations_from_counts,
    scan_line_relations,
    scan_lines,
    sequence_counts,
)
from sec_lab.worlds.drawn import scene_of_figure_a1
from tests.naive_relations import naive_hints, naive_places

N, O, T = Relation.NON_TOUCHING, Relation.OVERLAPPING, Relation.TOUCHING  # noqa: E741

SIZES = ((160, 128), (320, 256), (640, 512), (1280, 1024))


def images(*, labels: st.SearchStrategy[int], dtype: type = np.int64) -> st.SearchStrategy[NDArray[np.integer]]:
    return hnp.arrays(dtype, hnp.array_shapes(min_dims=2, max_dims=2, max_side=21), elements=labels)


def assert_as_naive(image: NDArray[np.integer]) -> None:
    counts, hints, places = scan_lines(image), naive_hints(image.tolist()), naive_places(image.tolist())
    labels = sorted(places)
    assert counts.segments.tolist() == labels
    assert counts.touching.tolist() == [[hints.touching[i, j] for j in labels] for i in labels]
    assert counts.overlapping.tolist() == [[hints.overlapping[i, j] for j in labels] for i in labels]
    assert counts.lines.tolist() == [hints.lines[i] for i in labels]
    assert counts.pixels is not None
    assert counts.pixels.tolist() == [len(places[i]) for i in labels]
    np.testing.assert_allclose(counts.centres, [np.mean(places[i], axis=0) for i in labels], rtol=1e-12, atol=1e-12)


def between(counts: ScanLineCounts, i: int, j: int) -> tuple[int, int, int]:
    """C^t and both directions of C^o."""
    a, b = np.searchsorted(counts.segments, (i, j))
    return int(counts.touching[a, b]), int(counts.overlapping[a, b]), int(counts.overlapping[b, a])


def labelled_scene(width: int, height: int) -> NDArray[np.uint8]:
    """One scene drawn at any size; lengths are in 1/320 of the width.

    On background 1: vessel 2 with content 4; vessel 3 with content 5 on its rim; dish 7 with fruit 8, both partly under
    hand 6; ball 9 held by hand 11; square 10 cut by the upper border.
    """
    rows, columns = np.mgrid[:height, :width]
    x, y = (columns + 0.5) * 320 / width, (rows + 0.5) * 256 / height
    labels = np.ones((height, width), dtype=np.uint8)

    def disc(centre_x: float, centre_y: float, radius: float, label: int) -> None:
        labels[(x - centre_x) ** 2 + (y - centre_y) ** 2 < radius**2] = label

    def box(left: float, top: float, right: float, bottom: float, label: int) -> None:
        labels[(x > left) & (x < right) & (y > top) & (y < bottom)] = label

    disc(70, 150, 45, 2)
    disc(70, 150, 17, 4)
    disc(170, 150, 45, 3)
    disc(170, 105, 18, 5)
    disc(262, 152, 26, 7)
    disc(262, 152, 12, 8)
    box(245, 160, 275, 256, 6)
    disc(240, 60, 16, 9)
    box(253, 52, 320, 68, 11)
    box(20, 0, 60, 40, 10)
    return labels


# What the scene shows to a person; 5 is half out of its vessel, so the background surrounds it on most lines (A.1).
SEEN = {
    (1, 2): O, (1, 3): O, (1, 5): O, (1, 6): O, (1, 7): O, (1, 9): O, (1, 10): O, (1, 11): O,
    (2, 4): O, (7, 8): O, (3, 5): T, (6, 7): T, (6, 8): T, (9, 11): T,
}  # fmt: skip


def seen(found: SegmentRelations) -> dict[tuple[int, int], Relation]:
    """Pairs that touch or overlap."""
    pairs = combinations(found.segments.tolist(), 2)
    return {(i, j): found.relation(i, j) for i, j in pairs if found.relation(i, j) is not N}


class TestText:
    """What A.1 says, in its own examples."""

    def test_inner_segments_do_not_overlap_each_other(self) -> None:
        counts = sequence_counts({(1, 5, 3, 1): 40})
        assert between(counts, 1, 5) == (40, 40, 0)
        assert between(counts, 1, 3) == (40, 40, 0)
        assert between(counts, 3, 5) == (40, -40, -40)
        assert counts.lines.tolist() == [40, 40, 40]

    def test_recursive_overlap_reaches_neighbours_only(self) -> None:
        # Segments 2 and 4 touch when 4 begins and when it ends: two hints a line, where the text spells out one.
        counts = sequence_counts({(1, 2, 4, 2, 1): 7})
        assert between(counts, 2, 4) == (14, 7, 0)
        assert between(counts, 1, 2) == (14, 7, 0)
        assert between(counts, 1, 4) == (0, 0, 0)
        graph = relations_from_counts(counts)
        assert seen(graph) == {(1, 2): O, (2, 4): O}
        assert graph.positions is None

    def test_sequences_of_figure_a1(self) -> None:
        sequences = line_sequences(scene_of_figure_a1())
        assert sequences[(1,)] == 225
        assert sequences[1, 2, 1, 3, 1] == 40
        assert sequences[1, 5, 3, 1] == 40
        assert sum(sequences.values()) == 320 + 256

    def test_relations_of_figure_a1(self) -> None:
        graph = scan_line_relations(scene_of_figure_a1())
        assert (graph.relation(1, 2), graph.relation(2, 4), graph.relation(1, 4)) == (O, O, N)
        assert graph.relation(3, 5) is T

    def test_counters_of_figure_a1(self) -> None:
        # Segment 5 covers rows 50 to 140, vessel 3 begins at row 111: 61 rows (1, 5, 1), 30 rows (…, 3, 5, 3, …),
        # 40 columns (1, 5, 3, 1).
        counts = scan_lines(scene_of_figure_a1())
        assert between(counts, 1, 5) == (2 * 61 + 40, 61 + 40, 0)
        assert between(counts, 3, 5) == (2 * 30 + 40, 30 - 40, -40)
        assert counts.lines[4] == 61 + 30 + 40

    def test_list_l_and_image_agree(self) -> None:
        labels = scene_of_figure_a1()
        of_list, of_image = sequence_counts(line_sequences(labels)), scan_lines(labels)
        for name in ("segments", "touching", "overlapping", "lines"):
            np.testing.assert_array_equal(getattr(of_list, name), getattr(of_image, name))
        assert of_list.pixels is None
        assert of_list.centres is None


class TestLineSequences:
    def test_rows_from_left_columns_from_top(self) -> None:
        assert line_sequences([[7, 7, 2], [0, 7, 2]]) == {(7, 2): 1, (0, 7, 2): 1, (7, 0): 1, (7,): 1, (2,): 1}

    @given(images(labels=st.integers(0, 3)))
    def test_every_line_is_counted_once(self, image: NDArray[np.int64]) -> None:
        sequences = line_sequences(image)
        assert sum(sequences.values()) == sum(image.shape)
        assert all(a != b for sequence in sequences for a, b in pairwise(sequence))


class TestScanLines:
    def test_by_hand(self) -> None:
        # rows (1, 5, 1), (1, 5, 3); columns (1), (5), (1, 3)
        counts = scan_lines([[1, 5, 1], [1, 5, 3]])
        assert counts.segments.tolist() == [1, 3, 5]
        assert between(counts, 1, 5) == (3, 1, 0)
        assert between(counts, 3, 5) == (1, 0, 0)
        assert between(counts, 1, 3) == (1, 0, 0)
        assert counts.lines.tolist() == [4, 2, 3]
        assert counts.pixels is not None
        assert counts.pixels.tolist() == [3, 1, 2]
        assert counts.centres is not None
        assert counts.centres.tolist() == [[2 / 3, 1 / 3], [2, 1], [1, 0.5]]

    def test_one_segment(self) -> None:
        counts = scan_lines(np.zeros((3, 5), dtype=np.uint8))
        assert counts.segments.tolist() == [0]
        assert counts.touching.tolist() == counts.overlapping.tolist() == [[0]]
        assert counts.lines.tolist() == [8]

    @given(images(labels=st.integers(0, 3), dtype=np.uint8))
    def test_as_naive_few_labels(self, image: NDArray[np.uint8]) -> None:
        assert_as_naive(image)

    @given(images(labels=st.integers(0, 255), dtype=np.uint8))
    def test_as_naive_many_labels(self, image: NDArray[np.uint8]) -> None:
        assert_as_naive(image)

    @given(images(labels=st.sampled_from([0, 1, 255, 256, 257, 511, 65535]), dtype=np.uint16))
    def test_as_naive_two_bytes(self, image: NDArray[np.uint16]) -> None:
        assert_as_naive(image)

    @given(images(labels=st.one_of(st.integers(0, 4), st.sampled_from([300, 65536, 2**40, 2**63 - 1]))))
    def test_as_naive_large_labels(self, image: NDArray[np.int64]) -> None:
        assert_as_naive(image)

    @given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1), st.sampled_from([np.uint8, np.uint16]))
    def test_as_naive_blocks(self, width: int, height: int, seed: int, dtype: type) -> None:
        """Long runs, as in real label images, and neighbouring lines that agree."""
        rng = np.random.default_rng(seed)
        image = np.ones((height, width), dtype=dtype)
        for label in range(2, 9):
            left, right = np.sort(rng.integers(0, width + 1, 2))
            top, bottom = np.sort(rng.integers(0, height + 1, 2))
            image[top:bottom, left:right] = label
        assert_as_naive(image)

    def test_most_labels(self) -> None:
        image = np.arange(MAX_SEGMENTS, dtype=np.uint16).reshape(64, 64)
        counts = scan_lines(image)
        assert counts.touching.sum() == 2 * 2 * 64 * 63
        assert not counts.overlapping.any()

    @pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.uint16, np.int16, np.uint32, np.int64, np.uint64, ">u2"])
    def test_every_integer_type(self, dtype: str) -> None:
        image = np.array([[1, 5, 3, 1], [1, 1, 2, 2]])
        counts = scan_lines(image.astype(dtype))
        assert_same(counts, scan_lines(image))

    @pytest.mark.parametrize("width", [8, 16, 13])
    def test_any_memory_layout(self, width: int) -> None:
        image = np.random.default_rng(3).integers(0, 4, (24, width)).astype(np.uint8)
        expected = scan_lines(image)
        wide = np.zeros((24, width + 3), dtype=np.uint8)
        wide[:, 3:] = image
        unaligned = np.zeros(image.size + 1, dtype=np.uint8)[1:].reshape(image.shape)
        unaligned[:] = image
        read_only = image.copy()
        read_only.setflags(write=False)
        for same in (np.asfortranarray(image), wide[:, 3:], image[::-1][::-1], unaligned, read_only, image.tolist()):
            assert_same(scan_lines(same), expected)

    def test_image_is_left_alone(self) -> None:
        image = np.random.default_rng(3).integers(0, 4, (16, 16)).astype(np.uint8)
        before = image.copy()
        scan_lines(image)
        assert image.flags.writeable
        np.testing.assert_array_equal(image, before)

    def test_transposed_image_counts_the_same(self) -> None:
        image = labelled_scene(160, 128)
        one, other = scan_lines(image), scan_lines(image.T)
        np.testing.assert_array_equal(one.touching, other.touching)
        np.testing.assert_array_equal(one.overlapping, other.overlapping)

    def test_threads_agree(self) -> None:
        image = labelled_scene(320, 256)
        expected = scan_lines(image)
        with ThreadPoolExecutor(4) as pool:
            for counts in pool.map(scan_lines, [image] * 64):
                assert_same(counts, expected)

    @pytest.mark.parametrize(
        ("image", "message"),
        [
            (np.zeros(5, dtype=int), r"expected shape \(height, width\).* got \(5,\)"),
            (np.zeros((2, 3, 4), dtype=int), r"got \(2, 3, 4\)"),
            (np.zeros((0, 5), dtype=int), r"got \(0, 5\)"),
            ([], r"got \(0,\)"),
            (np.zeros((2, 2)), "integer type, got float64"),
            ([[1.0, np.nan]], "integer type, got float64"),
            (np.zeros((2, 2), dtype=bool), "integer type, got bool"),
            ([[1, -2]], "from 0 on, got -2"),
            ([[1, 2], [3]], "ragged"),
            ([["a", "b"]], "expected numbers"),
            (np.full((2, 2), 2**63, dtype=np.uint64), r"below 2\*\*63"),
            (np.arange(MAX_SEGMENTS + 1).reshape(1, -1), "at most 4096 segments, got 4097"),
            (np.arange(MAX_SEGMENTS + 1).reshape(1, -1) * 100_000, "at most 4096 segments, got 4097"),
        ],
    )
    def test_bad_image(self, image: object, message: str) -> None:
        for function in (scan_lines, scan_line_relations, edge_count_relations):
            with pytest.raises(ValueError, match=message):
                function(image)  # type: ignore[operator]

    def test_bad_image_has_no_sequences_either(self) -> None:
        with pytest.raises(ValueError, match="from 0 on, got -1"):
            line_sequences([[-1]])


def assert_same(a: ScanLineCounts, b: ScanLineCounts) -> None:
    for name in ("segments", "touching", "overlapping", "lines", "pixels", "centres"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


class TestScanLineCounts:
    def test_arrays_are_copied_and_protected(self) -> None:
        lines = np.array([2, 2])
        counts = ScanLineCounts([1, 2], [[0, 1], [1, 0]], [[0, 0], [0, 0]], lines, [4, 4], [[0, 0], [1, 1]])
        lines[0] = 9
        assert counts.lines.tolist() == [2, 2]
        for name in ("segments", "touching", "overlapping", "lines", "pixels", "centres"):
            assert not getattr(counts, name).flags.writeable

    def test_what_the_scan_gives_is_protected(self) -> None:
        counts = scan_lines([[1, 2]])
        with pytest.raises(ValueError, match="read-only"):
            counts.touching[0, 0] = 1

    def test_pickles(self) -> None:
        counts = scan_lines([[1, 2, 1]])
        again = pickle.loads(pickle.dumps(counts))
        assert_same(again, counts)
        assert not again.touching.flags.writeable

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"segments": [2, 1]}, "ascending"),
            ({"segments": [1, 1]}, "ascending"),
            ({"touching": [[0, 1], [2, 0]]}, "symmetric"),
            ({"touching": [[0]]}, r"touching: expected shape \(2, 2\)"),
            ({"overlapping": [[0]]}, r"overlapping: expected shape \(2, 2\)"),
            ({"lines": [1, 0]}, "lines: expected at least 1"),
            ({"pixels": [0, 1]}, "pixels: expected at least 1"),
            ({"centres": [[0, 0], [0, np.nan]]}, "centres: expected finite numbers"),
            ({"centres": [[0, 0]]}, r"centres: expected shape \(2, 2\)"),
        ],
    )
    def test_bad_fields(self, change: dict[str, object], message: str) -> None:
        good: dict[str, object] = {
            "segments": [1, 2], "touching": [[0, 1], [1, 0]], "overlapping": [[0, 0], [0, 0]],
            "lines": [2, 2], "pixels": [1, 1], "centres": [[0, 0], [1, 0]],
        }  # fmt: skip
        ScanLineCounts(**good)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match=message):
            ScanLineCounts(**(good | change))  # type: ignore[arg-type]


class TestSequenceCounts:
    @given(images(labels=st.integers(0, 4)))
    def test_list_l_counts_as_the_image(self, image: NDArray[np.int64]) -> None:
        of_list, of_image = sequence_counts(line_sequences(image)), scan_lines(image)
        for name in ("segments", "touching", "overlapping", "lines"):
            np.testing.assert_array_equal(getattr(of_list, name), getattr(of_image, name))

    @pytest.mark.parametrize(
        ("sequences", "message"),
        [
            ({(): 1}, "sequence: expected"),
            ({(1, 1, 2): 1}, "twice in a row"),
            ({(-1, 2): 1}, "none negative"),
            ({(1, 2): 0}, "number of lines: expected at least 1, got 0"),
            ({(1, 2): 0.5}, "whole numbers"),
        ],
    )
    def test_bad_sequences(self, sequences: dict[tuple[int, ...], int], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            sequence_counts(sequences)

    def test_pixel_area_needs_pixels(self) -> None:
        with pytest.raises(ValueError, match="expected counts with pixels"):
            relations_from_counts(sequence_counts({(1, 2): 1}), normalization="pixel area")


class TestRelations:
    def test_normalized_by_hand(self) -> None:
        # Segment 4 is 2×1 pixels: 3 lines, all surrounded, 6 contacts. Pixel area divides by 2.
        counts = scan_lines([[1, 1, 1, 1], [1, 4, 4, 1], [1, 1, 1, 1]])
        touching, overlapping = normalized_counts(counts)
        assert (touching[0, 1], overlapping[0, 1], overlapping[1, 0]) == (1, 1, 0)
        touching, overlapping = normalized_counts(counts, normalization="pixel area")
        assert (touching[0, 1], overlapping[0, 1]) == (3, 1.5)

    def test_negative_counters_are_clamped(self) -> None:
        _, overlapping = normalized_counts(sequence_counts({(1, 5, 3, 1): 40}))
        assert overlapping.min() == 0

    def test_overlapping_is_decided_before_touching(self) -> None:
        graph = scan_line_relations([[1, 1, 1], [1, 4, 1], [1, 1, 1]])
        assert graph.relation(1, 4) is O
        assert scan_line_relations([[1, 4]]).relation(1, 4) is T

    def test_either_may_surround_the_other(self) -> None:
        for outer, inner in ((1, 4), (4, 1)):
            labels = np.full((5, 5), outer)
            labels[1:4, 1:4] = inner
            assert scan_line_relations(labels).relation(1, 4) is O

    def test_thresholds_must_be_exceeded(self) -> None:
        counts = sequence_counts({(1, 2, 1): 1, (2,): 3})  # of the 4 lines through 2 one is surrounded: .25
        counts = ScanLineCounts(counts.segments, counts.touching, counts.overlapping, [4, 4])
        assert relations_from_counts(counts, overlapping_threshold=0.24).relation(1, 2) is O
        assert relations_from_counts(counts, overlapping_threshold=0.25, touching_threshold=0.24).relation(1, 2) is T
        assert relations_from_counts(counts, overlapping_threshold=0.25, touching_threshold=0.25).relation(1, 2) is N

    def test_positions_are_centres(self) -> None:
        graph = scan_line_relations([[1, 1, 1, 1], [1, 4, 4, 1], [1, 1, 1, 1]])
        assert graph.positions is not None
        assert graph.positions.tolist() == [[1.5, 1], [1.5, 1]]

    def test_faint_contact_is_noise(self) -> None:
        labels = np.ones((100, 100), dtype=np.uint8)
        labels[20:80, 20:49], labels[20:80, 50:80] = 2, 3
        assert scan_line_relations(labels).relation(2, 3) is N
        labels[50, 49] = 2  # one contact: 1 / (2 · 90 lines)
        assert scan_line_relations(labels).relation(2, 3) is N
        labels[20:80, 49] = 2
        assert scan_line_relations(labels).relation(2, 3) is T

    @pytest.mark.parametrize("size", SIZES)
    def test_redrawn_scene_keeps_its_relations(self, size: tuple[int, int]) -> None:
        assert seen(scan_line_relations(labelled_scene(*size))) == SEEN

    @pytest.mark.parametrize("original", SIZES)
    @pytest.mark.parametrize("size", SIZES)
    def test_resized_scene_keeps_its_relations(self, original: tuple[int, int], size: tuple[int, int]) -> None:
        labels = labelled_scene(*original)
        rows = np.arange(size[1]) * original[1] // size[1]
        columns = np.arange(size[0]) * original[0] // size[0]
        assert seen(scan_line_relations(labels[np.ix_(rows, columns)])) == SEEN

    def test_no_threshold_on_pixel_area_serves_every_size(self) -> None:
        """The weakest overlapping pair of one size lies below the strongest other pair of another size."""

        def margins(normalization: str) -> tuple[float, float]:
            weakest, strongest = np.inf, 0.0
            for size in SIZES:
                counts = scan_lines(labelled_scene(*size))
                _, overlapping = normalized_counts(counts, normalization=normalization)  # type: ignore[arg-type]
                for (a, b), value in np.ndenumerate(np.maximum(overlapping, overlapping.T)):
                    pair = (int(counts.segments[a]), int(counts.segments[b]))
                    if a < b and SEEN.get(pair) is O:
                        weakest = min(weakest, value)
                    elif a < b:
                        strongest = max(strongest, value)
            return float(weakest), float(strongest)

        weakest, strongest = margins("scan lines")
        assert strongest < 0.4 < weakest
        weakest, strongest = margins("pixel area")
        assert weakest < strongest

    def test_pixel_area_is_offered(self) -> None:
        graph = scan_line_relations(labelled_scene(320, 256), normalization="pixel area")
        assert {graph.relation(2, 4), graph.relation(1, 2), graph.relation(7, 8)} == {O}
        assert {graph.relation(6, 8), graph.relation(9, 11)} == {T}

    @pytest.mark.parametrize("threshold", [-0.1, np.nan, np.inf])
    def test_bad_threshold(self, threshold: float) -> None:
        with pytest.raises(ValueError, match="touching_threshold: expected a finite number"):
            scan_line_relations([[1, 2]], touching_threshold=threshold)
        with pytest.raises(ValueError, match="overlapping_threshold: expected a finite number"):
            scan_line_relations([[1, 2]], overlapping_threshold=threshold)

    def test_bad_normalization(self) -> None:
        with pytest.raises(ValueError, match="normalization: expected one of"):
            scan_line_relations([[1, 2]], normalization="size")  # type: ignore[arg-type]
        with pytest.raises(ValueError, match="normalization: expected one of"):
            edge_count_relations([[1, 2]], normalization="size")  # type: ignore[arg-type]
