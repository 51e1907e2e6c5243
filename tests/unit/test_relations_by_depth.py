import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.relations import CONTACT_STEP_M, depth_steps, overlap_kind, relations_by_depth, scan_line_relations
from sec_lab.relations._border_kernels import border_steps, changed_pixels
from sec_lab.relations._kernels import find_runs
from sec_lab.relations._plane_kernels import no_planes, planes_of
from sec_lab.relations.counts import coded_image
from tests.naive_depth import naive_changes, naive_plane, naive_steps

TABLE, CUP, HAND, SPECK = 1, 2, 3, 4
N, O, T = Relation.NON_TOUCHING, Relation.OVERLAPPING, Relation.TOUCHING  # noqa: E741


def scene(*, hand_above_m: float) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """A cup on a table 1 m away, and a hand beside it in the picture that is nearer by ``hand_above_m``."""
    labels = np.full((80, 120), TABLE, np.uint8)
    labels[20:60, 20:60] = CUP
    labels[30:50, 60:120] = HAND
    depth_m = np.ones(labels.shape, np.float32)
    depth_m[labels == HAND] -= hand_above_m
    return labels, depth_m


def smeared(labels: NDArray[np.uint8], depth_m: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """The nearer of two surfaces grows by some pixels, as by the window of stereo matching."""
    import cv2

    return np.asarray(cv2.erode(depth_m, np.ones((2 * width + 1,) * 2, np.uint8)), np.float32)


def test_a_hand_that_touches_in_the_picture_but_passes_above_does_not_touch() -> None:
    labels, depth_m = scene(hand_above_m=0.1)
    assert scan_line_relations(labels).relation(CUP, HAND) == T
    found = relations_by_depth(labels, depth_m)
    assert found.relation(CUP, HAND) == N
    assert found.relation(TABLE, HAND) == N
    assert found.relation(TABLE, CUP) == O


@pytest.mark.parametrize(("above_m", "expected"), [(0.0, T), (CONTACT_STEP_M - 0.01, T), (CONTACT_STEP_M + 0.01, N)])
def test_contact_ends_at_the_documented_step(above_m: float, expected: Relation) -> None:
    assert relations_by_depth(*scene(hand_above_m=above_m)).relation(CUP, HAND) == expected


@pytest.mark.parametrize("width", [1, 2, 3])
def test_borders_smeared_by_stereo_make_no_contact(width: int) -> None:
    labels, depth_m = scene(hand_above_m=0.1)
    assert relations_by_depth(labels, smeared(labels, depth_m, width)).relation(CUP, HAND) == N


def test_unknown_depth_leaves_the_decision_to_the_picture() -> None:
    labels, depth_m = scene(hand_above_m=0.1)
    nothing = np.zeros_like(depth_m)
    np.testing.assert_array_equal(relations_by_depth(labels, nothing).relations, scan_line_relations(labels).relations)
    depth_m[labels == CUP] = 0
    assert relations_by_depth(labels, depth_m).relation(CUP, HAND) == T
    assert relations_by_depth(labels, depth_m).relation(TABLE, HAND) == N


def test_specks_say_nothing() -> None:
    labels, depth_m = scene(hand_above_m=0.1)
    labels[5:8, 5:8] = HAND  # table by mistake: as deep as the table around
    steps = depth_steps(labels, depth_m)
    assert steps.segments.tolist() == [TABLE, CUP, HAND]
    assert steps.known[0, 2] > 0
    assert steps.small[0, 2] == 0


def test_in_front_says_who_hides_whom() -> None:
    labels, depth_m = scene(hand_above_m=0.1)
    steps = depth_steps(labels, depth_m)
    assert steps.in_front[2, 0] == steps.known[0, 2] > 0
    assert steps.in_front[0, 2] == 0
    assert steps.in_front[0, 1] == steps.in_front[1, 0] == 0


def test_on_top_and_inside_look_the_same_and_differ_in_depth() -> None:
    labels = np.full((60, 60), TABLE, np.uint8)
    labels[15:45, 15:45] = CUP
    depth_m = np.full(labels.shape, 1.0, np.float32)
    for surface_m, expected in ((0.97, "on top"), (1.03, "inside"), (0.8, "apart"), (0.0, "unknown")):
        depth_m[labels == CUP] = surface_m
        assert overlap_kind(labels, depth_m, TABLE, CUP) == overlap_kind(labels, depth_m, CUP, TABLE) == expected


def test_a_rim_in_front_of_one_side_is_enough_for_inside() -> None:
    """Seen from one side, the far wall of a cup meets its content without a step, the near rim hides a part of it."""
    labels = np.full((60, 60), TABLE, np.uint8)
    labels[15:45, 15:45] = CUP
    depth_m = np.full(labels.shape, 1.0, np.float32)
    depth_m[45:] = 0.96
    assert overlap_kind(labels, depth_m, CUP, TABLE) == "inside"


def test_overlap_kind_refuses_what_does_not_overlap() -> None:
    labels, depth_m = scene(hand_above_m=0.0)
    with pytest.raises(ValueError, match="expected one that surrounds the other, got 2 and 3"):
        overlap_kind(labels, depth_m, CUP, HAND)
    with pytest.raises(ValueError, match="expected labels of the picture, got 9"):
        overlap_kind(labels, depth_m, 9, TABLE)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -1.0])
def test_impossible_depth_is_refused(wrong: float) -> None:
    labels, depth_m = scene(hand_above_m=0.0)
    depth_m[3, 4] = wrong
    with pytest.raises(ValueError, match="depth_m: expected finite numbers from 0"):
        depth_steps(labels, depth_m)


def test_depth_of_another_size_is_refused() -> None:
    labels, depth_m = scene(hand_above_m=0.0)
    with pytest.raises(ValueError, match=r"depth_m: expected shape \(80, 120\) as of the label image, got \(80, 119\)"):
        depth_steps(labels, depth_m[:, 1:])
    with pytest.raises(ValueError, match="step_m: expected a finite number from 0 on, got -1"):
        depth_steps(labels, depth_m, step_m=-1)
    with pytest.raises(ValueError, match="skip_px: expected a number from 0 on, got -1"):
        depth_steps(labels, depth_m, skip_px=-1)


def test_steps_are_protected_and_can_be_pickled() -> None:
    steps = pickle.loads(pickle.dumps(depth_steps(*scene(hand_above_m=0.1))))
    with pytest.raises(ValueError, match="read-only"):
        steps.known[0, 1] = 3


@given(data=st.data(), dtype=st.sampled_from([np.uint8, np.uint16]), skip=st.integers(0, 3))
def test_steps_as_the_slow_reference_counts_them(data: st.DataObject, dtype: type, skip: int) -> None:
    shape = data.draw(hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=24))
    cells = data.draw(hnp.arrays(dtype, (-(-shape[0] // 4), -(-shape[1] // 4)), elements=st.integers(0, 4)))
    labels = np.kron(cells, np.ones((4, 4), dtype))[: shape[0], : shape[1]]
    depth_m = data.draw(hnp.arrays(np.float32, shape, elements=st.sampled_from([0.0, 0.5, 0.75, 1.0])))
    steps = depth_steps(labels, depth_m, step_m=0.3, skip_px=skip)
    known, small, in_front = naive_steps(labels.tolist(), depth_m.tolist(), step_m=0.3, skip=skip)
    values = steps.segments.tolist()
    for counted, expected in ((steps.known, known), (steps.small, small), (steps.in_front, in_front)):
        assert counted.tolist() == [[expected[i, j] for j in values] for i in values]


@given(data=st.data(), spreads=st.floats(0, 3))
def test_steps_beside_planes_as_the_slow_reference_counts_them(data: st.DataObject, spreads: float) -> None:
    cells = data.draw(hnp.arrays(np.uint8, (3, 4), elements=st.integers(0, 3)))
    labels = np.kron(cells, np.ones((5, 6), np.uint8))
    depth_m = data.draw(hnp.arrays(np.float32, labels.shape, elements=st.sampled_from([0.0, 0.5, 0.75, 1.0])))
    codes, width, _ = coded_image(labels)
    words = codes.view(np.uint64)
    starts, first_run, values = find_runs(codes, words, width)
    numbers = st.sampled_from([0.0, 0.5, 1.0, 1.5, 2.0])
    planes = data.draw(hnp.arrays(np.float64, (len(values), 4), elements=numbers))
    planes[:, 3] *= spreads
    found = border_steps(codes, words, width, starts, first_run, values, depth_m, 0.3, 1, 3, planes)
    fits = dict(zip(values.tolist(), map(tuple, planes.tolist()), strict=True))
    expected = naive_steps(labels.tolist(), depth_m.tolist(), step_m=0.3, skip=1, planes=fits)
    for counted, wanted in zip(found, expected, strict=True):
        assert counted.tolist() == [[wanted[i, j] for j in values.tolist()] for i in values.tolist()]


@pytest.mark.parametrize("spreads", [0.0, 1.5])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize(("cell", "step"), [((20, 25), 2), ((5, 15), 2), ((130, 129), 3)])
def test_planes_as_the_slow_reference_finds_them(cell: tuple[int, int], step: int, dtype: type, spreads: float) -> None:
    """Segments of many pixels and of few, in pictures narrower than their memory and so large that some do."""
    rng = np.random.default_rng(cell)
    labels = np.kron(rng.integers(1, 5, (3, 3)), np.ones(cell, dtype)).astype(dtype)
    labels[:4, :5] = 9  # too few pixels
    labels[-1, :] = 11  # no more than a line
    height, width = labels.shape
    y, x = np.mgrid[:height, :width] / np.array([height, width])[:, None, None]
    inverse = 1 + 0.2 * (labels % 3) + 0.3 * x - 0.1 * y + rng.normal(0, 0.01, labels.shape)
    inverse[rng.random(labels.shape) < 0.1] += 0.3  # smear
    depth_m = np.where(rng.random(labels.shape) < 0.1, 0, 1 / inverse).astype(np.float32)
    codes, _, _ = coded_image(labels)
    values = np.unique(labels).astype(np.int64)
    found = planes_of(codes, width, values, depth_m, spreads)
    seen = np.zeros(labels.shape, np.bool_)
    seen[::step, ::step] = True
    expected = []
    for label in values:
        rows, columns = np.nonzero(seen & (labels == label) & (depth_m > 0))
        points = list(zip(columns / width, rows / height, 1 / depth_m[rows, columns].astype(float), strict=True))
        expected.append(naive_plane(points, spreads))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert found[-2].tolist() == found[-1].tolist() == no_planes(1)[0].tolist()


@given(data=st.data(), dtype=st.sampled_from([np.uint8, np.uint16]))
def test_changes_as_the_slow_reference_counts_them(data: st.DataObject, dtype: type) -> None:
    shape = data.draw(hnp.array_shapes(min_dims=2, max_dims=2, max_side=21))
    before, after = (data.draw(hnp.arrays(dtype, shape, elements=st.integers(0, 4))) for _ in range(2))
    (codes, width, _), (old, _, _) = coded_image(after), coded_image(before)
    values = np.union1d(before, after).astype(np.int64)
    found = changed_pixels(codes, codes.view(np.uint64), old, old.view(np.uint64), width, values)
    expected = naive_changes(before.tolist(), after.tolist())
    assert found.tolist() == [[expected[i, j] for j in values.tolist()] for i in values.tolist()]
