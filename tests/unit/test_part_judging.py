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
    segments.n_steps, segments.moved_at[CUP] = 50, 50
    for slot in (TABLE, CUP, PLATE):
        segments.give_label(slot)
    return segments, Judge(segments, slots, slots, 10, DEFAULT, new_px=98)


def part(
    around: dict[int, float],
    below: dict[int, float],
    colour: dict[int, float],
    *,
    area: int = 200,
    slot: int = 0,
    border: bool = False,
    thick: bool = True,
    unknown_for: float = 9.0,
) -> Part:
    values = [np.zeros(N_SLOTS, np.float32) for _ in range(2)]
    for given, value in zip((around, below), values, strict=True):
        value[list(given)] = list(given.values())
    costs = np.full(N_SLOTS, FAR, np.float32)
    costs[list(colour)] = list(colour.values())
    nothing = np.zeros(N_SLOTS, np.float32)
    return Part(
        slot, area, np.array([10, 10, 19, 29]), border, thick, unknown_for, values[0], nothing, values[1], costs,
        nothing, lambda: np.zeros(area, np.uint16),
    )  # fmt: skip


def test_what_is_left_where_half_of_a_carried_thing_is_missing_is_that_half() -> None:
    _, judge = scene()
    half = part({TABLE: 0.4, CUP: 0.6}, {TABLE: 1.0}, {CUP: 13.0})
    assert judge.left_behind(half) == UNTAUGHT + CUP


@pytest.mark.parametrize(
    ("around", "cost", "area"),
    [
        pytest.param(0.08, 13.0, 200, id="hardly beside it"),
        pytest.param(0.6, 14.5, 200, id="of colours quite unlike"),
        pytest.param(0.6, 13.0, 600, id="larger than what is missing"),
    ],
)
def test_and_otherwise_it_is_a_new_thing(around: float, cost: float, area: int) -> None:
    segments, judge = scene()
    new = judge.left_behind(part({TABLE: 1 - around, CUP: around}, {TABLE: 1.0}, {CUP: cost}, area=area))
    assert new > PLATE
    assert segments.labels[new] == 4


def test_less_of_it_around_is_enough_if_nothing_beside_is_more_like_it() -> None:
    _, judge = scene()
    around = {TABLE: 0.3, CUP: 0.3, PLATE: 0.4}
    assert judge.left_behind(part(around, {TABLE: 1.0}, {CUP: 13.0, PLATE: 13.5})) == UNTAUGHT + CUP
    assert judge.left_behind(part(around, {TABLE: 1.0}, {CUP: 13.5, PLATE: 13.0})) > PLATE


def test_nothing_is_missing_of_what_rests() -> None:
    segments, judge = scene()
    segments.moving[CUP], segments.moved_at[CUP] = False, -1000
    assert judge.left_behind(part({TABLE: 0.4, CUP: 0.6}, {TABLE: 1.0}, {CUP: 13.0})) > PLATE


def test_a_part_is_of_what_was_carried_just_now_if_it_is_most_like_it() -> None:
    segments, judge = scene()
    segments.missing[CUP], segments.most_px[CUP] = False, 210
    beside = part({TABLE: 0.8, CUP: 0.2}, {TABLE: 1.0}, {CUP: 10.5, PLATE: 13.0})
    assert judge.left_behind(beside) == CUP
    assert judge.unknown(beside) == CUP
    as_like_the_plate = part({TABLE: 0.8, CUP: 0.2}, {TABLE: 1.0}, {CUP: 10.5, PLATE: 11.0})
    assert judge.left_behind(as_like_the_plate) > PLATE


def test_a_part_amid_what_was_carried_just_now_is_of_it() -> None:
    segments, judge = scene()
    segments.missing[CUP] = False
    assert judge.unknown(part({TABLE: 0.1, CUP: 0.9}, {TABLE: 1.0}, {}, area=99)) == UNTAUGHT + CUP
    assert judge.unknown(part({TABLE: 0.1, CUP: 0.9}, {TABLE: 1.0}, {}, area=101)) > PLATE


def test_what_rests_elsewhere_does_not_come_to_light_here_however_alike_it_is() -> None:
    segments, judge = scene()
    segments.hidden[CUP] = True
    comes_up = part({TABLE: 1.0}, {TABLE: 1.0}, {CUP: 11.5, PLATE: 11.6}, unknown_for=0)
    assert judge.unknown(comes_up) == CUP
    segments.touched[PLATE] = True
    assert judge.unknown(comes_up) == UNTAUGHT + TABLE


def test_what_a_thing_lay_on_comes_to_light_when_it_is_gone() -> None:
    segments, judge = scene()
    uncovered = part({PLATE: 0.95, TABLE: 0.05}, {CUP: 0.9, PLATE: 0.1}, {PLATE: 10.5})
    assert judge.unknown(uncovered) == UNTAUGHT + PLATE
    segments.moving[CUP] = False
    assert judge.unknown(uncovered) > PLATE


def test_a_third_of_a_part_where_a_thing_lay_is_enough_if_it_is_like_what_is_around() -> None:
    _, judge = scene()
    around = {PLATE: 0.95, TABLE: 0.05}
    assert judge.unknown(part(around, {CUP: 0.4, PLATE: 0.6}, {PLATE: 10.5})) == UNTAUGHT + PLATE
    assert judge.unknown(part(around, {CUP: 0.2, PLATE: 0.8}, {PLATE: 10.5})) > PLATE
    assert judge.unknown(part(around, {CUP: 0.4, PLATE: 0.6}, {PLATE: 11.5})) > PLATE


def with_hand(*, present: bool = True) -> tuple[KnownSegments, Judge, int]:
    segments, judge = scene()
    hand = segments.new(np.array([0, 0, 9, 9]), judge.slots, judge.rest, mover=True)
    segments.n_steps, segments.present[hand] = 500, present
    if present:
        judge.slots[:10, :10] = hand
    return segments, judge, hand


def test_a_hand_in_its_own_shade_is_most_like_a_hand() -> None:
    _, judge, hand = with_hand()
    shaded = part({PLATE: 0.75, hand: 0.25}, {PLATE: 1.0}, {hand: 10.5, PLATE: 12.0}, unknown_for=0)
    assert judge.unknown(shaded) == hand
    rim = part({PLATE: 0.75, hand: 0.25}, {PLATE: 1.0}, {hand: 10.5, PLATE: 12.0}, unknown_for=0, thick=False)
    assert judge.unknown(rim) == UNTAUGHT
    as_like_the_plate = part({PLATE: 0.75, hand: 0.25}, {PLATE: 1.0}, {hand: 10.5, PLATE: 11.0}, unknown_for=0)
    assert judge.unknown(as_like_the_plate) == UNTAUGHT + PLATE


@pytest.mark.parametrize(
    ("cost", "other", "seen"),
    [
        pytest.param(11.5, 13.0, True, id="hardly like itself, others less"),
        pytest.param(11.5, 12.0, False, id="others nearly as much"),
        pytest.param(13.0, 15.5, True, id="unlike itself, others clearly more"),
        pytest.param(13.0, 14.5, False, id="unlike itself, others hardly more"),
        pytest.param(14.5, 16.0, False, id="quite unlike itself"),
    ],
)
def test_a_hand_shows_what_it_carries_from_another_side(cost: float, other: float, seen: bool) -> None:
    segments, judge, hand = with_hand()
    segments.hidden[CUP] = segments.touched[PLATE] = True
    turned = part({TABLE: 0.6, hand: 0.4}, {TABLE: 1.0}, {CUP: cost, PLATE: other}, unknown_for=0)
    assert judge.unknown(turned) == (CUP if seen else UNTAUGHT + TABLE)
    away = part({TABLE: 1.0}, {TABLE: 1.0}, {CUP: cost, PLATE: other}, unknown_for=0)
    assert judge.unknown(away) == UNTAUGHT + TABLE


def test_a_piece_that_settles_while_a_hand_hides_the_rest_is_still_on_the_way() -> None:
    segments, _, hand = with_hand()
    rest = np.full(SIZE, TABLE, np.uint8)
    rest[20:30, 10:20] = CUP  # a quarter of it
    seen = rest.copy()
    seen[20:30, 20:40] = hand
    segments.update(seen, seen, rest)
    assert segments.moving[CUP]
    rest[20:30, 10:40], seen[20:30, 10:40] = CUP, CUP
    segments.update(seen, seen, rest)
    assert not segments.moving[CUP]


def test_nothing_hidden_is_on_the_way_without_a_hand_and_a_hand_comes_back_at_work() -> None:
    segments, _, hand = with_hand()
    empty = np.full(SIZE, TABLE, np.uint8)
    seen = empty.copy()
    seen[:10, :10] = hand
    segments.moving[CUP] = True
    segments.update(seen, seen, empty)
    assert segments.moving[[CUP, hand]].all()
    segments.update(empty, empty, empty)
    assert segments.moving[[CUP, hand]].tolist() == [False, True]
    segments.update(seen, seen, empty)
    assert hand in segments.candidates()


def test_a_rim_is_of_all_that_it_lies_between_and_a_patch_of_one() -> None:
    _, judge = scene()
    between: tuple[dict[int, float], ...] = ({CUP: 0.6, PLATE: 0.4}, {TABLE: 1.0}, {CUP: 13.0, PLATE: 13.0})
    assert judge.absorbing(part(*between, thick=False)) == 0
    assert judge.absorbing(part(*between)) == CUP
    # What has been of a segment is not unknown.
    assert judge.absorbing(part(*between, thick=False, slot=PLATE)) == CUP


def test_a_hand_that_has_left_is_found_again_and_young() -> None:
    segments, judge, hand = with_hand(present=False)
    enters = part({TABLE: 1.0}, {TABLE: 1.0}, {hand: 10.5, PLATE: 12.0}, border=True, unknown_for=0)
    assert not segments.young(hand)
    assert judge.unknown(enters) == hand
    assert segments.young(hand)
    other = part({TABLE: 1.0}, {TABLE: 1.0}, {hand: 10.5, PLATE: 11.0}, border=True, unknown_for=0)
    assert judge.unknown(other) > hand


def test_a_strip_along_a_hand_is_no_second_hand() -> None:
    _, judge, hand = with_hand()
    colour = {hand: 13.0, TABLE: 14.0}
    strip = part({TABLE: 0.5, hand: 0.5}, {TABLE: 1.0}, colour, border=True, thick=False)
    assert judge.unknown(strip) == UNTAUGHT
    assert judge.unknown(part({TABLE: 0.5, hand: 0.5}, {TABLE: 1.0}, colour, border=True)) > hand


def test_what_a_hand_covers_is_not_missing() -> None:
    segments, judge, hand = with_hand()
    seen = judge.slots.copy()
    seen[10:30, 40:70] = hand
    segments.moving[:] = False
    segments.update(seen, seen, judge.rest)
    assert not segments.missing[PLATE]
    seen[10:30, 40:70] = TABLE
    segments.update(seen, seen, judge.rest)
    assert segments.missing[PLATE]
