"""The record of step 2; a scene graph is one too, so the same holds of both."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sec_lab.codes import Relation
from sec_lab.relations import SegmentRelations
from sec_lab.scene_graph import SceneGraph

RECORDS = pytest.mark.parametrize("record", [SegmentRelations, SceneGraph])


@RECORDS
def test_segments_are_put_in_order(record: type[SegmentRelations]) -> None:
    found = record([9, 2, 5], [[0, 1, 2], [1, 0, 0], [2, 0, 0]], [[90, 9], [20, 2], [50, 5]])
    assert found.segments.tolist() == [2, 5, 9]
    assert found.relations.tolist() == [[0, 0, 1], [0, 0, 2], [1, 2, 0]]
    assert found.positions is not None
    assert found.positions.tolist() == [[20, 2], [50, 5], [90, 9]]
    assert (found.segments.dtype, found.relations.dtype, found.positions.dtype) == (np.int64, np.uint8, np.float64)


@given(st.permutations([1, 2, 3, 4]), st.lists(st.sampled_from([0, 1, 2]), min_size=6, max_size=6))
def test_order_of_segments_changes_nothing(order: list[int], codes: list[int]) -> None:
    pairs = [(1, 2), (1, 3), (1, 4), (2, 3), (2, 4), (3, 4)]
    relation_of = {frozenset(pair): code for pair, code in zip(pairs, codes, strict=True)}
    relations = [[relation_of.get(frozenset((i, j)), 0) for j in order] for i in order]
    found = SegmentRelations(order, relations)
    for i, j in pairs:
        assert found.relation(i, j) == found.relation(j, i) == relation_of[frozenset((i, j))]


@RECORDS
def test_relation_of_absent_segments(record: type[SegmentRelations]) -> None:
    found = record([1, 4], [[0, 2], [2, 0]])
    assert found.relation(1, 4) is Relation.TOUCHING
    assert found.relation(1, 1) is Relation.NON_TOUCHING
    assert found.relation(1, 2) is found.relation(2, 4) is found.relation(7, 8) is Relation.ABSENT


@RECORDS
def test_no_segment(record: type[SegmentRelations]) -> None:
    found = record([], np.zeros((0, 0)), np.zeros((0, 2)))
    assert found.segments.shape == (0,)
    assert found.relations.shape == (0, 0)


@pytest.mark.parametrize("again", [lambda r: r, lambda r: pickle.loads(pickle.dumps(r)), copy.deepcopy])
@RECORDS
def test_arrays_are_protected_also_after_a_copy(
    record: type[SegmentRelations], again: Callable[[SegmentRelations], SegmentRelations]
) -> None:
    found = again(record([1, 4], [[0, 2], [2, 0]], [[0, 0, 1], [1, 1, 0]]))
    assert type(found) is record
    assert found.relations.tolist() == [[0, 2], [2, 0]]
    for array in (found.segments, found.relations, found.positions):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(AttributeError):
        found.segments = np.array([1, 2])  # type: ignore[misc]


@RECORDS
def test_arrays_are_copied(record: type[SegmentRelations]) -> None:
    segments, relations, positions = np.array([1, 4]), np.array([[0, 2], [2, 0]], np.uint8), np.zeros((2, 2))
    found = record(segments, relations, positions)
    segments[:], relations[:], positions[:] = 7, 1, 3
    assert found.segments.tolist() == [1, 4]
    assert found.relations.tolist() == [[0, 2], [2, 0]]
    assert found.positions is not None
    assert not found.positions.any()


@pytest.mark.parametrize(
    ("segments", "relations", "positions", "message"),
    [
        ([1, 1], [[0, 2], [2, 0]], None, "segments: expected each label once, got 1 twice"),
        ([3, 1, 3], np.zeros((3, 3)), None, "segments: expected each label once, got 3 twice"),
        ([1, 2.5], np.zeros((2, 2)), None, "segments: expected whole numbers, got 2.5"),
        ([1, np.nan], np.zeros((2, 2)), None, "segments: expected whole numbers, got nan"),
        (["a", "b"], np.zeros((2, 2)), None, "segments: expected numbers"),
        ([[1, 2]], np.zeros((2, 2)), None, r"segments: expected 1 dimensions, got shape \(1, 2\)"),
        (1, np.zeros((1, 1)), None, r"segments: expected 1 dimensions, got shape \(\)"),
        ([1, 2], [[0, 2], [1, 0]], None, r"symmetric matrix, got 2 for \(1, 2\) and 1 for \(2, 1\)"),
        ([8, 3], [[0, 2], [1, 0]], None, r"symmetric matrix, got 2 for \(8, 3\) and 1 for \(3, 8\)"),
        ([1, 2], [[0, 9], [9, 0]], None, r"got 9 \(absent\)"),
        ([1, 2], [[0, 3], [3, 0]], None, "relations: expected codes 0, 1, 2 or 9, got 3"),
        ([1, 2], [[0, -1], [-1, 0]], None, "relations: expected codes 0, 1, 2 or 9, got -1"),
        ([1, 2], [[0, 258], [258, 0]], None, "relations: expected codes 0, 1, 2 or 9, got 258"),
        ([1, 2], [[0, np.nan], [np.nan, 0]], None, "relations: expected whole numbers, got nan"),
        ([1, 2], [[0, 2], [2]], None, "relations: .* ragged rows"),
        ([1, 2], [[0, 0], [0, 2]], None, "relations: expected 0 on the diagonal, got 2"),
        ([1, 2], [[0]], None, r"relations: expected shape \(2, 2\) for 2 segments, got \(1, 1\)"),
        ([1, 2], [[0, 1]], None, r"relations: expected shape \(2, 2\) for 2 segments, got \(1, 2\)"),
        ([1, 2], [0, 1], None, "relations: expected 2 dimensions"),
        ([], [], None, "relations: expected 2 dimensions"),
        ([1, 2], np.zeros((2, 2)), [[0, 0]], r"positions: expected shape \(2, 2\) or \(2, 3\), got \(1, 2\)"),
        ([1, 2], np.zeros((2, 2)), [[0], [0]], r"positions: expected shape .*, got \(2, 1\)"),
        ([1, 2], np.zeros((2, 2)), np.zeros((2, 4)), r"positions: expected shape .*, got \(2, 4\)"),
        ([1, 2], np.zeros((2, 2)), [0, 0], "positions: expected 2 dimensions"),
        ([1, 2], np.zeros((2, 2)), [[0, 0], [0, np.nan]], "positions: expected finite numbers, got nan"),
        ([1, 2], np.zeros((2, 2)), [[0, 0], [-np.inf, 0]], "positions: expected finite numbers, got -inf"),
        ([1, 2], np.zeros((2, 2)), [[0, 0], [0]], "positions: .* ragged rows"),
    ],
)
@RECORDS
def test_bad_input(
    record: type[SegmentRelations], segments: object, relations: object, positions: object, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        record(segments, relations, positions)  # type: ignore[arg-type]
