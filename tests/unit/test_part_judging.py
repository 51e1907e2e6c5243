"""Which segment a part belongs to that came to rest: what is missing of one, or a new one."""

import numpy as np
import pytest

from sec_lab.segmentation.known_segments import N_SLOTS, KnownSegments
from sec_lab.segmentation.layer_parameters import DEFAULT
from sec_lab.segmentation.part_judging import UNTAUGHT, Judge, Part

SIZE = (60, 80)
TABLE, CUP, PLATE = 1, 2, 3
FAR = 16.0
"""Cost of colours that were never seen of a segment."""


def scene() -> tuple[KnownSegments, Judge]:
    """A cup of 400 pixels, of which the lower half is to be seen, and a plate that rests."""
    slots = np.full(SIZE, TABLE, np.uint8)
    slots[20:30, 10:30], slots[10:40, 40:70] = CUP, PLATE
    segments = KnownSegments(SIZE, DEFAULT)
    segments.known[[TABLE, CUP, PLATE]] = True
    segments.most_px[[CUP, PLATE]] = 400, 900
    segments.missing[CUP] = segments.moving[CUP] = True
    segments.n_steps = 50
    for slot in (TABLE, CUP, PLATE):
        segments.give_label(slot)
    return segments, Judge(segments, slots, slots, 10, DEFAULT, new_px=98)


def part(
    around: dict[int, float], below: dict[int, float], colour: dict[int, float], *, area: int = 200, slot: int = 0
) -> Part:
    values = [np.zeros(N_SLOTS, np.float32) for _ in range(2)]
    for given, value in zip((around, below), values, strict=True):
        value[list(given)] = list(given.values())
    costs = np.full(N_SLOTS, FAR, np.float32)
    costs[list(colour)] = list(colour.values())
    nothing = np.zeros(N_SLOTS, np.float32)
    return Part(
        slot, area, np.array([10, 10, 19, 29]), False, True, 9.0, values[0], nothing, values[1], costs, nothing,
        lambda: np.zeros(area, np.uint16),
    )  # fmt: skip


def test_what_is_left_where_half_of_a_carried_thing_is_missing_is_that_half() -> None:
    _, judge = scene()
    half = part({TABLE: 0.4, CUP: 0.6}, {TABLE: 1.0}, {CUP: 13.0})
    assert judge.left_behind(half) == UNTAUGHT + CUP


@pytest.mark.parametrize(
    ("around", "cost", "area"),
    [
        pytest.param(0.4, 13.0, 200, id="hardly beside it"),
        pytest.param(0.6, 14.5, 200, id="of colours quite unlike"),
        pytest.param(0.6, 13.0, 600, id="larger than what is missing"),
    ],
)
def test_and_otherwise_it_is_a_new_thing(around: float, cost: float, area: int) -> None:
    segments, judge = scene()
    new = judge.left_behind(part({TABLE: 1 - around, CUP: around}, {TABLE: 1.0}, {CUP: cost}, area=area))
    assert new > PLATE
    assert segments.labels[new] == 4


def test_nothing_is_missing_of_what_rests() -> None:
    segments, judge = scene()
    segments.moving[CUP] = False
    assert judge.left_behind(part({TABLE: 0.4, CUP: 0.6}, {TABLE: 1.0}, {CUP: 13.0})) > PLATE
