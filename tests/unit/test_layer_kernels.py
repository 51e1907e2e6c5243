"""Kernels of the layered segmentation against plain Python, on small pictures that hypothesis draws."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sec_lab.segmentation import _layer_kernels as kernels
from sec_lab.segmentation import _part_kernels
from tests.naive_layers import (
    CAP,
    Settled,
    naive_cheapest,
    naive_colour_bins,
    naive_components,
    naive_counts,
    naive_describe,
    naive_difference,
    naive_presence,
    naive_recoloured,
    naive_relaxed,
    naive_rims,
    naive_settled,
    naive_shared_out,
    naive_surroundings,
    naive_warped,
)

SIZES = st.tuples(st.integers(1, 9), st.integers(1, 9))
SEEDS = st.integers(0, 2**32)
Image = NDArray[np.uint8]


def labels(rng: np.random.Generator, size: tuple[int, int], values: list[int]) -> Image:
    """Slots in patches: each pixel is as the one before it, the one above it, or new."""
    image = rng.choice(np.array(values, np.uint8), size)
    for y, x in np.ndindex(*size):
        draw = rng.random()
        if x > 0 and draw < 0.4:
            image[y, x] = image[y, x - 1]
        elif y > 0 and draw < 0.8:
            image[y, x] = image[y - 1, x]
    return image


def parts_of(slots: Image) -> tuple[NDArray[np.int32], int]:
    parts = np.empty(slots.shape, np.int32)
    return parts, _part_kernels.components(slots, parts)


@given(SIZES, SEEDS)
def test_colour_bins(size: tuple[int, int], seed: int) -> None:
    lab = np.random.default_rng(seed).integers(0, 256, (*size, 3), np.uint8)
    np.testing.assert_array_equal(kernels.colour_bins(lab), naive_colour_bins(lab))


def test_shading_does_not_change_the_chroma_of_a_bin() -> None:
    # Half as bright, the distances from grey are half as large: (200 + 16) / 2 - 16 = 92.
    lit, shaded = np.array([[[200, 152, 104]]], np.uint8), np.array([[[92, 140, 116]]], np.uint8)
    bins = [int(kernels.colour_bins(lab)[0, 0]) for lab in (lit, shaded)]
    assert bins[0] % 1600 == bins[1] % 1600
    assert [k // 1600 for k in bins] == [6, 2]


@given(SIZES, SEEDS)
def test_count_colours(size: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    bins = rng.integers(0, 4, size).astype(np.uint16)
    slots, taught = labels(rng, size, [0, 1, 5]), rng.integers(0, 2, size).astype(np.uint8)
    wanted = np.isin(np.arange(256), [1, 5])
    counts = np.zeros((256, kernels.N_BINS), np.float32)
    counts[5, 3] = 7
    kernels.count_colours(bins, slots, taught, wanted, counts)
    counts[5, 3] -= 7
    expected = naive_counts(bins, slots, taught, wanted)
    assert {tuple(map(int, at)): counts[tuple(at)] for at in np.argwhere(counts)} == expected


def test_another_light_costs_less_than_another_colour() -> None:
    """Costs rise step by step up to four bins of chroma, as far as 5×5 bins spread twice; all count the same there."""
    counts, costs = np.zeros(kernels.N_BINS, np.float32), np.empty(kernels.N_BINS, np.float32)
    middle = (4 * 40 + 20) * 40 + 20
    counts[middle] = 1000
    kernels.colour_costs(counts, costs)
    assert list(costs[middle : middle + 5]) == sorted(set(costs[middle : middle + 5].tolist()))
    assert costs[middle + 4] < costs[middle + 5] == costs[middle + 9]
    np.testing.assert_array_equal(costs[middle + 1 : middle + 5], costs[middle - 4 : middle][::-1])
    # A tempered count spreads without loss, so the density over all bins stays one.
    level = np.arange(kernels.N_BINS) // 1600
    stretch = 2 * np.log(150 / (level * 32 + 32))
    far = costs[(4 * 40 + 5) * 40 + 5]
    density = np.exp(-costs - stretch) - np.exp(-far - stretch[middle])
    assert (density[level == 4] * 32 * 4 * 4).sum() == pytest.approx(0.97 * 0.4, rel=0.02)


def test_colour_costs_are_low_where_colours_were_seen() -> None:
    counts, costs = np.zeros(kernels.N_BINS, np.float32), np.empty(kernels.N_BINS, np.float32)
    kernels.colour_costs(counts, costs)
    assert (costs == CAP).all()
    seen, beside, far = (4 * 40 + 20) * 40 + 20, (4 * 40 + 20) * 40 + 21, (4 * 40 + 30) * 40 + 20
    counts[seen] = 100
    kernels.colour_costs(counts, costs)
    assert costs[seen] < costs[beside] < costs[far] - 5
    assert costs.max() <= CAP
    # The same colour in another light is less likely, but not unknown.
    assert costs[seen] < costs[seen - 1600] < costs[far] - 5
    assert costs[beside] == costs[beside - 2]


@given(SIZES, SEEDS)
@example((1, 1), 0)
@example((9, 1), 3)
def test_components(size: tuple[int, int], seed: int) -> None:
    slots = labels(np.random.default_rng(seed), size, [0, 1, 2])
    parts, n = parts_of(slots)
    expected = naive_components(slots)
    np.testing.assert_array_equal(parts, expected)
    assert n == expected.max() + 1


def test_components_of_single_pixels() -> None:
    # As many parts as pixels: no neighbour, not even across a corner, is of the same slot.
    rows, columns = np.indices((20, 20))
    slots = (2 * (rows % 2) + columns % 2).astype(np.uint8)
    parts, n = parts_of(slots)
    assert n == 400
    np.testing.assert_array_equal(parts.ravel(), np.arange(400))


@given(SIZES, SEEDS)
def test_describe(size: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    slots = labels(rng, size, [0, 1, 2])
    unknown_for, resting_for = rng.integers(0, 251, (2, *size)).astype(np.uint8)
    parts, n = parts_of(slots)
    slot, area, box, unknown, resting, inner = _part_kernels.describe(parts, n, slots, unknown_for, resting_for)
    expected = naive_describe(parts, slots, unknown_for, resting_for)
    assert slot.tolist() == [part.slot for part in expected]
    assert area.tolist() == [part.area for part in expected]
    assert box.tolist() == [list(part.box) for part in expected]
    for found, name in ((unknown, "unknown"), (resting, "resting"), (inner, "inner")):
        np.testing.assert_allclose(found, [getattr(part, name) for part in expected], rtol=1e-6, atol=1e-9)


def test_a_thin_part_has_no_inner_pixels() -> None:
    slots = np.ones((12, 20), np.uint8)
    slots[3, 4:16] = 2
    slots[6:11, 4:9] = 3
    parts, n = parts_of(slots)
    found = _part_kernels.describe(parts, n, slots, slots, slots)
    inner = dict(zip(found[0].tolist(), found[5].tolist(), strict=True))
    assert inner[2] == 0
    assert inner[3] == pytest.approx(1 / 25)  # only the middle of 5×5


@given(SIZES, SEEDS)
def test_surroundings(size: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    slots, predicted, rest = (labels(rng, size, [0, 1, 2, 255]) for _ in range(3))
    bins = rng.integers(0, kernels.N_BINS, size).astype(np.uint16)
    known = np.isin(np.arange(256), [1, 255])
    tables = rng.uniform(0, 16, (256, kernels.N_BINS)).astype(np.float32)
    parts, n = parts_of(slots)
    asked = rng.permutation(n)[: rng.integers(1, n + 1)]
    question = np.full(n, -1, np.int32)
    question[asked] = np.arange(len(asked))
    found = _part_kernels.surroundings(parts, question, len(asked), slots, predicted, rest, bins, known, tables)
    for k, part in enumerate(asked):
        expected = naive_surroundings(parts == part, slots, predicted, rest, bins, known, tables)
        for values, name in zip(found, ("around", "guess", "below", "colour", "fits"), strict=True):
            np.testing.assert_allclose(values[k], getattr(expected, name), rtol=1e-5, err_msg=name)


@given(SIZES, SEEDS)
def test_recolour(size: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    slots, taught = labels(rng, size, [0, 1, 2]), rng.integers(0, 2, size).astype(np.uint8)
    parts, n = parts_of(slots)
    new = rng.choice([-1, 0, 1, 255, 256, 256 + 255], n)
    expected = naive_recoloured(parts, new, slots, taught)
    _part_kernels.recolour(parts, new, slots, taught)
    np.testing.assert_array_equal(slots, expected[0])
    np.testing.assert_array_equal(taught, expected[1])


@given(SIZES, SEEDS)
def test_warp(size: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    slots = labels(rng, size, [0, 1, 2, 3])
    flow = rng.choice(np.arange(-3, 3.01, 0.25), ((size[0] + 1) // 2, (size[1] + 1) // 2, 2)).astype(np.float32)
    np.testing.assert_array_equal(kernels.warp(slots, flow), naive_warped(slots, flow))


def test_warp_looks_back() -> None:
    slots = np.arange(40, dtype=np.uint8).reshape(4, 10)
    flow = np.zeros((2, 5, 2), np.float32)
    flow[..., 0] = -1.5  # what is seen now was three columns further left
    assert kernels.warp(slots, flow)[1].tolist() == [10, 10, 10, *range(10, 17)]


def costs_of(rng: np.random.Generator, size: tuple[int, int], moving: Image) -> NDArray[np.float32]:
    """In steps of a quarter, so that many are equal."""
    return (rng.integers(0, 65, (3 + len(moving), *size)) / 4).astype(np.float32)


@given(SIZES, SEEDS, st.sampled_from([[], [2], [7, 2, 255]]))
def test_cheapest(size: tuple[int, int], seed: int, moving_slots: list[int]) -> None:
    rng = np.random.default_rng(seed)
    moving = np.array(moving_slots, np.uint8)
    costs, rest = costs_of(rng, size, moving), labels(rng, size, [1, 2, 3])
    slots, sure = np.empty_like(rest), np.empty_like(rest)
    kernels.cheapest(costs, rest, moving, slots, sure)
    expected = naive_cheapest(costs, rest, moving)
    np.testing.assert_array_equal(slots, expected[0])
    np.testing.assert_array_equal(sure, expected[1])


@given(SIZES, SEEDS, st.sampled_from([[], [2], [7, 2, 255]]), st.sampled_from([0, 0.8, 5]))
def test_relax(size: tuple[int, int], seed: int, moving_slots: list[int], bond: float) -> None:
    rng = np.random.default_rng(seed)
    moving = np.array(moving_slots, np.uint8)
    costs, rest = costs_of(rng, size, moving), labels(rng, size, [1, 2, 3])
    lab = rng.integers(100, 130, (*size, 3)).astype(np.uint8)
    slots = labels(rng, size, [0, 1, 2, 3, 7])
    relaxed, awake = np.empty_like(slots), np.ones(size, np.bool_)
    for _sweep in range(4):
        kernels.relax(costs, lab, rest, moving, slots, relaxed, np.float32(bond), awake)
        np.testing.assert_array_equal(relaxed, naive_relaxed(costs, lab, rest, moving, slots, bond))
        slots, relaxed = relaxed.copy(), slots


def test_pixels_that_sleep_do_not_relax() -> None:
    rest, moving = np.ones((1, 7), np.uint8), np.array([2], np.uint8)
    slots = np.array([[1, 2, 2, 2, 2, 2, 2]], np.uint8)
    costs = np.full((4, 1, 7), 16, np.float32)
    costs[0] = 0
    relaxed, awake = np.empty_like(slots), np.array([[0, 1, 0, 0, 0, 0, 0]], np.bool_)
    kernels.relax(costs, np.zeros((1, 7, 3), np.uint8), rest, moving, slots, relaxed, np.float32(0.8), awake)
    assert relaxed.tolist() == [[1, 1, 2, 2, 2, 2, 2]]
    assert awake.tolist() == [[True, True, True, False, False, False, False]]


def test_bonds_hold_alike_colours_together() -> None:
    """A single pixel gives in to its neighbours where it looks like them, and not where it does not."""
    rest, moving = np.ones((3, 3), np.uint8), np.array([2], np.uint8)
    slots = rest.copy()
    slots[1, 1] = 2
    costs = np.full((4, 3, 3), 16, np.float32)
    costs[0], costs[2] = 5, 3  # for itself it would rather be 2, by 2
    relaxed = np.empty_like(slots)
    lab = np.full((3, 3, 3), 128, np.uint8)
    awake = np.ones(slots.shape, np.bool_)
    kernels.relax(costs, lab, rest, moving, slots, relaxed, np.float32(0.8), awake)  # 8 bonds of 0.8
    assert relaxed[1, 1] == 1
    lab[1, 1] = 250, 200, 60
    awake[:] = True
    kernels.relax(costs, lab, rest, moving, slots, relaxed, np.float32(0.8), awake)  # 8 bonds of little more than 0.12
    assert relaxed[1, 1] == 2


@given(SIZES, SEEDS)
def test_uncovered(size: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    slots, rest = labels(rng, size, [1, 2, 3]), labels(rng, size, [1, 2, 3])
    carried = np.arange(256) == 2
    cost = rng.choice([4, 12, 12.5], size).astype(np.float32)
    resting_for = rng.choice([0, 1, 3, 4, 200], size).astype(np.uint8)
    still = np.full(size, 77, np.uint8)
    before = rng.integers(90, 160, (*size, 3)).astype(np.uint8)
    image = before + rng.integers(0, 12, before.shape).astype(np.uint8)
    n = _part_kernels.uncovered(image, before, 8, slots, rest, carried, cost, 12.0, resting_for, 4, still)
    is_one = (slots == 2) & (rest == 2) & (cost > 12) & (image[..., 0] - before[..., 0] <= 8)
    np.testing.assert_array_equal(still, np.where(is_one, np.minimum(resting_for, 4), 0))
    assert n == (is_one & (resting_for >= 4)).sum()


@given(SIZES, SEEDS, st.booleans())
def test_settle(size: tuple[int, int], seed: int, any_mover: bool) -> None:
    rng = np.random.default_rng(seed)
    before = rng.integers(90, 160, (*size, 3)).astype(np.uint8)
    image = np.clip(before + rng.integers(-6, 7, before.shape), 0, 255).astype(np.uint8)
    found, slots, slots_before, rest = (labels(rng, size, [0, 1, 2, 3]) for _ in range(4))
    rest = np.maximum(rest, 1)
    mover = np.arange(256) == 3
    unknown_for, resting_for = rng.choice([0, 2, 3, 9, 249, 250], (2, *size)).astype(np.uint8)
    seen, behind = (rng.uniform(90, 160, (2, *size, 3))).astype(np.float32)
    behind_sigma, brightest = rng.choice([0.0, 4.0], size).astype(np.float32), np.full(size, 1.05, np.float32)
    state = {
        pixel: Settled(
            int(unknown_for[pixel]),
            int(resting_for[pixel]),
            int(rest[pixel]),
            seen[pixel].copy(),
            behind[pixel].copy(),
            behind_sigma[pixel],
            brightest[pixel],
        )
        for pixel in np.ndindex(*size)
    }
    _part_kernels.settle(
        image,
        before,
        found,
        slots,
        slots_before,
        mover,
        np.bool_(any_mover),
        3,
        4,
        unknown_for,
        resting_for,
        rest,
        seen,
        behind,
        behind_sigma,
        brightest,
    )
    for pixel, known in state.items():
        expected = naive_settled(
            known,
            image[pixel],
            before[pixel],
            int(found[pixel]),
            int(slots[pixel]),
            int(slots_before[pixel]),
            is_mover=bool(mover[slots[pixel]]),
            any_mover=any_mover,
            settle_frames=3,
            moved_by=4,
        )
        assert (unknown_for[pixel], resting_for[pixel]) == (expected.unknown_for, expected.resting_for)
        assert (rest[pixel], behind_sigma[pixel]) == (expected.rest, expected.behind_sigma)
        assert brightest[pixel] == expected.brightest
        np.testing.assert_array_equal(seen[pixel], expected.seen)
        np.testing.assert_array_equal(behind[pixel], expected.behind)


@given(SIZES, SEEDS)
def test_presence(size: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    found, slots, rest = (labels(rng, size, [0, 1, 2, 3, 255]) for _ in range(3))
    mover = np.isin(np.arange(256), [3, 255])
    boxes = np.full((256, 4), -1, np.int64)
    boxes[4] = boxes[2] = 1, 1, 2, 2
    counts, touched = _part_kernels.presence(found, slots, rest, mover, boxes)
    expected_counts, expected_touched, expected_boxes = naive_presence(found, slots, rest, mover)
    np.testing.assert_array_equal(counts, expected_counts)
    np.testing.assert_array_equal(touched, expected_touched)
    # What is not to be seen is still known to have been where it was.
    remembered = {2: (1, 1, 2, 2), 4: (1, 1, 2, 2)} | expected_boxes
    assert {int(slot): tuple(boxes[slot].tolist()) for slot in np.flatnonzero(boxes[:, 2] >= 0)} == remembered


@given(SIZES, SEEDS)
def test_close_rims(size: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    slots, rest = (rng.choice(np.array([1, 1, 1, 2, 3, 4], np.uint8), size) for _ in range(2))
    costs = rng.uniform(8, 16, (2, *size)).astype(np.float32)
    moving = np.zeros(256, np.bool_)
    moving[2:4] = rng.random(2) < 0.5
    expected = naive_rims(slots, rest, costs, moving, 12.0, 3)
    closed, taught = slots.copy(), np.ones(size, np.uint8)
    _part_kernels.close_rims(closed, rest, costs, moving, np.float32(12), 3, taught)
    np.testing.assert_array_equal(closed, expected)
    np.testing.assert_array_equal(taught == 0, closed != slots)


@given(SIZES, SEEDS)
@example((9, 9), 0)
def test_share_out(size: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    slots = labels(rng, size, [0, 0, 0, 1, 2, 3])
    bins = rng.integers(0, 4, size).astype(np.uint16)
    tables = rng.choice(np.array([5, 9, 16], np.float32), (256, 4))
    shared, taught = slots.copy(), np.ones(size, np.uint8)
    _part_kernels.share_out(shared, taught, bins, tables)
    np.testing.assert_array_equal(shared, naive_shared_out(slots, bins, tables))
    np.testing.assert_array_equal(taught == 0, slots == 0)


def test_a_rim_is_shared_by_the_nearest_and_in_the_middle_it_goes_to_the_likest() -> None:
    tables = np.full((256, 2), 16, np.float32)
    tables[3, 1] = 4
    for colour, expected in ((0, [2, 2, 2, 2, 3, 3, 3]), (1, [2, 2, 2, 3, 3, 3, 3])):
        slots = np.array([[2, 2, 0, 0, 0, 3, 3]], np.uint8)
        _part_kernels.share_out(slots, np.ones_like(slots), np.full(slots.shape, colour, np.uint16), tables)
        assert slots[0].tolist() == expected


def test_a_rim_between_a_hand_and_what_it_holds_is_closed_and_a_gap_is_not() -> None:
    slots = np.array([[2, 2, 1, 1, 3, 3]], np.uint8)
    rest = np.ones_like(slots)
    moving = np.arange(256) == 2
    for strange, expected in ((15.0, [2, 2, 2, 3, 3, 3]), (5.0, [2, 2, 1, 1, 3, 3])):
        closed = slots.copy()
        costs = np.full((2, *slots.shape), strange, np.float32)
        _part_kernels.close_rims(closed, rest, costs, moving, np.float32(12), 3, np.ones_like(slots))
        assert closed[0].tolist() == expected


@given(SIZES, SEEDS, st.lists(st.integers(2, 5), unique=True))
def test_label_costs(size: tuple[int, int], seed: int, moving_slots: list[int]) -> None:
    rng = np.random.default_rng(seed)
    moving = np.array(moving_slots, np.uint8)
    rest, predicted = (labels(rng, size, [1, 2, 3, 4, 5]) for _ in range(2))
    image = rng.integers(100, 160, (*size, 3)).astype(np.uint8)
    seen, behind = (rng.uniform(100, 160, (*size, 3)).astype(np.float32) for _ in range(2))
    behind_sigma = rng.choice(np.array([0, 4], np.float32), size)
    brightest = rng.choice(np.array([1.05, 1.45], np.float32), size)
    near = rng.integers(0, 3, (*size, len(moving)))
    far = rng.choice(np.array([3, 5, 16], np.float32), len(moving))
    extra = rng.choice(np.array([0, 2], np.float32), len(moving))
    tables = rng.uniform(4, 16, (256, kernels.N_BINS)).astype(np.float32)
    p = np.array([4.2, 12, 3, 1.4, 5, 6, 2, 1.5], np.float32)
    bins = kernels.colour_bins(image)
    codes = sum((near[..., k].astype(np.uint32) << np.uint32(2 * k) for k in range(len(moving))), np.zeros(size, int))
    costs = np.empty((3 + len(moving), *size), np.float32)
    kernels.label_costs(
        image, bins, rest, seen, behind, behind_sigma, brightest, predicted, codes.astype(np.uint32), moving, far,
        extra, tables, p, costs,
    )  # fmt: skip
    for y, x in np.ndindex(*size):
        resting, expected_here = rest[y, x], predicted[y, x]
        same = naive_difference(image[y, x], seen[y, x], brightest[y, x], p, 0)
        bare = naive_difference(image[y, x], behind[y, x], 1.05, p, behind_sigma[y, x])
        expected = [
            same + (p[6] if expected_here != resting else 0),
            CAP if resting == 1 else p[7] + bare + (1.5 if expected_here != 1 else 0),
        ]
        for k, slot in enumerate(moving_slots):
            place = [far[k], 2.0, 0.0 if extra[k] else -1.0][near[y, x, k]]
            cost = tables[slot, bins[y, x]] + place + extra[k] * (2 if resting == slot else 1)
            expected.append(CAP if near[y, x, k] == 0 and far[k] >= CAP else cost)
        np.testing.assert_allclose(costs[:, y, x], np.minimum([*expected, p[1]], CAP), rtol=2e-3)


def test_what_looks_otherwise_where_a_touched_thing_rests_is_hardly_that_thing() -> None:
    """``extra`` counts once elsewhere and twice where it rests; on the way it costs 1 less where it is expected."""
    rest = np.array([[2, 1]], np.uint8)
    grey = np.full((1, 2, 3), 128, np.uint8)
    seen, flat = grey.astype(np.float32), np.zeros((1, 2), np.float32)
    tables = np.full((256, kernels.N_BINS), 5, np.float32)
    parameters = np.array([4.2, 12, 3, 1.4, 5, 6, 2, 1.5], np.float32)
    found = {}
    for extra in (0.0, 2.0):
        costs = np.empty((4, 1, 2), np.float32)
        kernels.label_costs(
            grey, kernels.colour_bins(grey), rest, seen, seen, flat, flat + 1, rest, np.full((1, 2), 2, np.uint32),
            np.array([2], np.uint8), np.full(1, 16, np.float32), np.array([extra], np.float32), tables, parameters,
            costs,
        )  # fmt: skip
        found[extra] = costs[2, 0].tolist()
    assert found == {0.0: [4.0, 4.0], 2.0: [9.0, 7.0]}
