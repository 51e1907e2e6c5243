from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.relations import (
    PICTURE_ALONE,
    SeenFrame,
    SegmentRelations,
    TimeParameters,
    at_frame_rate,
    depth_steps,
    scan_line_relations,
    steady_relations,
)
from sec_lab.relations._time_kernels import resting
from sec_lab.relations.depth import LEAST_PLACES
from tests.naive_depth import naive_rest
from tests.naive_relations_over_time import naive_steady

TABLE, CUP, HAND, SPECK = 1, 2, 3, 4
N, O, T, A = Relation.NON_TOUCHING, Relation.OVERLAPPING, Relation.TOUCHING, Relation.ABSENT  # noqa: E741

Movie = NDArray[np.uint8]
Boxes = dict[int, tuple[int, int, int, int]]  # label: rows from, to, columns from, to; later ones lie over earlier ones

CUP_AT = (30, 50, 40, 60)


def picture(**boxes: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    labels = np.full((80, 120), TABLE, np.uint8)
    for name, (top, bottom, left, right) in boxes.items():
        labels[top:bottom, max(left, 0) : max(right, 0)] = {"cup": CUP, "hand": HAND, "speck": SPECK}[name]
    return labels


def hand_from_the_right(tip: int) -> tuple[int, int, int, int]:
    return 25, 55, tip, tip + 30


def story(relations: Sequence[tuple[int, SegmentRelations]], i: int, j: int) -> list[tuple[int, Relation]]:
    """Frames at which a relation begins."""
    found: list[tuple[int, Relation]] = []
    for number, record in relations:
        relation = record.relation(i, j)
        if not found or found[-1][1] != relation:
            found.append((number, relation))
    return found


def steady(movie: Sequence[NDArray[np.uint8]], **parameters: object) -> list[tuple[int, SegmentRelations]]:
    return list(steady_relations(enumerate(movie), parameters=TimeParameters(**parameters)))  # type: ignore[arg-type]


def taking() -> list[NDArray[np.uint8]]:
    """A hand comes, waits at the cup, carries it to the left, leaves it there and goes."""
    movie = [picture(cup=CUP_AT) for _ in range(15)]
    movie += [picture(cup=CUP_AT, hand=hand_from_the_right(tip)) for tip in range(118, 59, -2)]  # frames 15 … 44
    movie += [movie[-1]] * 10  # 45 … 54
    movie += [
        picture(cup=(30, 50, 40 - shift, 60 - shift), hand=hand_from_the_right(60 - shift)) for shift in range(2, 31, 2)
    ]  # 55 … 69
    movie += [movie[-1]] * 10  # 70 … 79
    last = (30, 50, 10, 30)
    movie += [picture(cup=last, hand=hand_from_the_right(tip)) for tip in range(32, 120, 2)]  # 80 … 123
    movie += [picture(cup=last)] * 20  # 124 …
    return movie


def test_all_rules_off_is_the_picture_alone() -> None:
    movie = taking()
    found = list(steady_relations(enumerate(movie), parameters=PICTURE_ALONE))
    assert [number for number, _ in found] == list(range(len(movie)))
    for labels, (_, relations) in zip(movie, found, strict=True):
        expected = scan_line_relations(labels)
        assert relations.segments.tolist() == expected.segments.tolist()
        np.testing.assert_array_equal(relations.relations, expected.relations)
        np.testing.assert_array_equal(relations.positions, expected.positions)


def test_a_hand_that_takes_a_cup_holds_it_only_while_both_move_or_rest() -> None:
    found = steady(taking(), together_frames=0)
    hand_and_cup = story(found, HAND, CUP)
    assert [relation for _, relation in hand_and_cup] == [A, N, T, N, A]
    assert hand_and_cup[1][0] == 15
    assert 45 <= hand_and_cup[2][0] <= 57  # waits at the cup, then moves with it
    assert 80 <= hand_and_cup[3][0] <= 88  # goes
    assert hand_and_cup[4][0] == 124
    cup_and_table = story(found, CUP, TABLE)
    assert [relation for _, relation in cup_and_table] == [O, N, O]
    assert 55 <= cup_and_table[1][0] <= 59
    assert [relation for _, relation in story(found, HAND, TABLE)] == [A, N, A]


def test_a_hand_that_passes_over_a_cup_does_not_touch_it() -> None:
    movie = [picture(cup=CUP_AT)] * 15
    movie += [picture(cup=CUP_AT, hand=(34, 60, tip, tip + 30)) for tip in range(118, -30, -2)]
    movie += [picture(cup=CUP_AT)] * 15
    assert [relation for _, relation in story(steady(movie), HAND, CUP)] == [A, N, A]
    assert T in [relation for _, relation in story(steady(movie, contact_by_motion=False), HAND, CUP)]
    assert story(steady(movie), CUP, TABLE) == [(0, O)]


def test_a_change_counts_from_the_frame_at_which_it_began_and_flicker_does_not() -> None:
    apart, touching = picture(cup=CUP_AT, speck=(30, 50, 70, 90)), picture(cup=CUP_AT, speck=(30, 50, 60, 90))
    movie = [apart] * 20 + [touching] * 4 + [apart] * 20 + [touching] * 20
    motionless = {"rest_px": None, "together_frames": 0}
    assert story(steady(movie, hysteresis_frames=5, **motionless), CUP, SPECK) == [(0, N), (44, T)]
    assert story(steady(movie, hysteresis_frames=4, **motionless), CUP, SPECK) == [(0, N), (20, T), (24, N), (44, T)]


def test_two_thresholds_hold_what_trembles_about_one() -> None:
    """Of the 40 lines of the smaller segment, one or two touch: 1 / 80 and 2 / 80 of its sides."""
    one, two = (picture(cup=CUP_AT, speck=(50 - n, 70, 60, 80)) for n in (1, 2))
    more = picture(cup=CUP_AT, speck=(40, 60, 60, 80))
    movie = [more] * 15 + [one, one, one, one, two, two, two, two] * 5
    off = {"rest_px": None, "together_frames": 0, "hysteresis_frames": 3, "min_life_frames": 1}
    assert len(story(steady(movie, touching_thresholds=(0.02, 0.02), **off), CUP, SPECK)) == 11
    assert story(steady(movie, touching_thresholds=(0.01, 0.03), **off), CUP, SPECK) == [(0, T)]


def test_what_is_hidden_keeps_its_relations_until_it_is_given_up() -> None:
    movie = [picture(cup=CUP_AT)] * 20 + [picture()] * 30 + [picture(cup=CUP_AT)] * 20
    assert story(steady(movie), CUP, TABLE) == [(0, O)]
    assert story(steady(movie, hold_frames=25, rest_px=None), CUP, TABLE) == [(0, O), (44, A), (50, O)]
    assert story(steady(movie, hold_frames=0, rest_px=None), CUP, TABLE) == [(0, O), (20, A), (50, O)]


def test_a_segment_that_shrinks_out_of_the_picture_is_gone_and_one_lost_on_the_way_is_held() -> None:
    arriving = [picture(hand=hand_from_the_right(tip)) for tip in range(118, 58, -3)]
    leaving = [picture(hand=hand_from_the_right(tip)) for tip in range(60, 120, 3)]
    gone, kept = (
        [picture()] * 20 + arriving + leaving + [picture()] * 20,
        [picture()] * 20 + arriving + [picture()] * 20,
    )
    assert story(steady(gone), HAND, TABLE) == [(0, A), (20, N), (60, A)]
    assert story(steady(kept), HAND, TABLE) == [(0, A), (20, N)]


def test_a_crumb_of_a_hand_that_has_left_is_not_the_hand() -> None:
    """A tracker takes 3 × 3 pixels inside the picture for the hand of 1,800, for 18 frames after it has left."""
    way = [picture(cup=CUP_AT, hand=hand_from_the_right(tip)) for tip in range(118, 58, -3)]
    movie = [*[picture(cup=CUP_AT)] * 20, *way, *way[::-1]]
    left = len(movie)
    movie += [picture(cup=CUP_AT, hand=(30, 33, 20, 23))] * 18 + [picture(cup=CUP_AT)] * 20
    told = [relation for _, relation in story(steady(movie), HAND, TABLE)]
    assert told == [A, N, A]
    (*_, (gone, _)) = story(steady(movie), HAND, TABLE)
    assert left - 1 <= gone <= left
    assert story(steady(movie, crumb_share=0.0), HAND, TABLE)[-1][1] == N
    # Half as large as the hand it is no crumb, wherever it is.
    back = [*movie[:left], *[picture(cup=CUP_AT, hand=(25, 55, 70, 100))] * 38]
    assert story(steady(back), HAND, TABLE)[-1][1] != A


def test_a_glitch_of_motion_delays_what_kind_a_contact_is_and_does_not_begin_anew() -> None:
    """Put down and at rest in the cup's place, seen to move in every fifth frame: surrounded all the same."""
    moving = [{HAND}] * 10 + [{HAND} if n % 5 == 4 else set() for n in range(30)]
    movie = [picture(cup=(20, 60, 30, 80), hand=(30, 50, 40, 60))] * 40
    frames = [SeenFrame(number, *seen) for number, seen in enumerate(zip(movie, [None] * 40, moving, strict=True))]
    p = TimeParameters(contact_by_motion=False)
    assert story(list(steady_relations(frames, parameters=p)), CUP, HAND) == [(0, T), (10, O)]


def test_splinters_never_become_segments() -> None:
    movie = [picture(cup=CUP_AT)] * 50
    movie[20:31] = [picture(cup=CUP_AT, speck=(5, 10, 5, 10))] * 11
    assert {tuple(record.segments.tolist()) for _, record in steady(movie)} == {(TABLE, CUP)}
    movie[31] = movie[30]
    lasting = [number for number, record in steady(movie, hold_frames=0) if SPECK in record.segments]
    assert lasting == list(range(20, 32))


def test_resting_segments_that_may_be_hidden_keep_their_relation() -> None:
    """A hand covers the place at which a cup and its neighbour meet."""
    still = {"cup": CUP_AT, "speck": (30, 50, 60, 80)}
    movie = [picture(**still)] * 20
    movie += [picture(**still, hand=(25, 55, 55, 65 + n)) for n in (0, 3) * 15]
    movie += [picture(**still)] * 20
    frames = [SeenFrame(number, labels, None, {HAND}) for number, labels in enumerate(movie)]
    frozen = list(steady_relations(frames, parameters=TimeParameters(freeze=True, contact_by_motion=False)))
    assert story(frozen, CUP, SPECK) == [(0, T)]
    free = list(steady_relations(frames, parameters=TimeParameters(contact_by_motion=False)))
    assert [relation for _, relation in story(free, CUP, SPECK)] == [T, N, T]


def test_what_has_left_its_place_is_carried_by_what_moves_beside_it() -> None:
    """The cup all but vanishes in the hand: a crumb of it shows at another place, deep behind the fingers."""
    depth_m = np.full((80, 120), 1.0, np.float32)
    movie = [picture(cup=CUP_AT)] * 20
    movie += [picture(hand=(20, 60, 10 + n, 90 + n), cup=(38, 42, 12 + n, 16 + n)) for n in range(25)]
    depth = [np.where(labels == HAND, np.float32(0.8), depth_m) for labels in movie]
    frames = list(zip(range(len(movie)), movie, depth, strict=True))
    held = story(list(steady_relations(frames)), CUP, HAND)
    assert [relation for _, relation in held] == [A, T] or [relation for _, relation in held] == [A, N, T]
    without = story(list(steady_relations(frames, parameters=TimeParameters(carried=False))), CUP, HAND)
    assert [relation for _, relation in without] == [A, N]


def test_an_arm_that_pauses_above_the_table_does_not_come_to_lie_on_it() -> None:
    """It reaches in from the border; what stands still within the picture, or for longer, has come to rest."""
    comes = [picture(hand=hand_from_the_right(tip)) for tip in range(118, 59, -2)]
    movie = [picture()] * 15 + comes + [comes[-1]] * 30 + comes[::-1]
    assert N in dict(story(steady(movie), TABLE, HAND)).values()
    assert T not in dict(story(steady(movie), TABLE, HAND)).values()
    for pause in (0, 10):
        relations = [relation for _, relation in story(steady(movie, pause_frames=pause), TABLE, HAND)]
        assert relations[:3] in ([A, N, O], [A, N, T])
    inside = [picture(hand=(25, 55, 10 + n, 40 + n)) for n in range(0, 40, 2)]
    put = [relation for _, relation in story(steady([*inside, *[inside[-1]] * 30]), TABLE, HAND)]
    assert put[0] == N
    assert put[1] in {O, T}


def test_contact_with_what_moves_is_touching_however_it_looks() -> None:
    """A hand is surrounded by the table when it comes from above and is not when it comes from the border."""
    inside = [picture(hand=(20, 50, 40 + n, 60 + n)) for n in range(40)]
    frames = [SeenFrame(number, labels, None, {TABLE, HAND}) for number, labels in enumerate(inside)]
    assert story(list(steady_relations(frames)), TABLE, HAND) == [(0, T)]
    anyhow = TimeParameters(kind_at_rest=False)
    assert story(list(steady_relations(frames, parameters=anyhow)), TABLE, HAND) == [(0, O)]


def test_depth_parts_what_meets_in_the_picture() -> None:
    labels = picture(cup=CUP_AT, speck=(30, 50, 60, 80))
    depth_m = np.where(labels == SPECK, 0.8, 1.0)
    frames = [(number, labels, depth_m) for number in range(20)]
    assert story(list(steady_relations(frames)), CUP, SPECK) == [(0, N)]
    assert story(list(steady_relations(frames, parameters=TimeParameters(step_m=None))), CUP, SPECK) == [(0, T)]


def test_what_rests_where_depth_is_never_known_is_told_by_the_picture() -> None:
    """At the side of a stereo picture that the other eye does not see."""
    labels = picture(cup=CUP_AT)
    depth_m = np.where(labels == CUP, 0.0, 1.0)
    assert story(list(steady_relations([(number, labels, depth_m) for number in range(20)])), TABLE, CUP) == [(0, O)]
    # A few places say nothing, whatever they seem to say.
    top, _, left, _ = CUP_AT
    depth_m[top + 3 : top + 8, left + 12 : left + 15] = 0.5
    assert 0 < depth_steps(labels, depth_m).known[0, 1] < LEAST_PLACES
    assert story(list(steady_relations([(number, labels, depth_m) for number in range(20)])), TABLE, CUP) == [(0, O)]
    moving = [SeenFrame(number, labels, depth_m, {CUP}) for number in range(20)]
    assert story(list(steady_relations(moving)), TABLE, CUP) == [(0, N)]


@pytest.mark.parametrize(("rule", "expected"), [(None, T), (1.5, N)])
def test_smear_over_a_plain_surface_is_no_contact(rule: float | None, expected: Relation) -> None:
    """A hand 10 cm above a plate: for 7 pixels around it the plate seems as near as the hand."""
    labels = picture(cup=(5, 75, 20, 100), hand=(30, 50, 70, 120))
    depth_m = np.where(labels == HAND, 0.9, 1.0)
    depth_m[23:57, 63:70] = depth_m[23:30, 70:100] = depth_m[50:57, 70:100] = 0.9
    frames = [SeenFrame(number, labels, depth_m, {CUP, HAND}) for number in range(20)]
    parameters = TimeParameters(smear_spreads=rule)
    assert story(list(steady_relations(frames, parameters=parameters)), CUP, HAND) == [(0, expected)]


def test_events_that_nearly_coincide_share_a_key_frame() -> None:
    first = picture(cup=CUP_AT, speck=(30, 50, 70, 90))
    second = picture(cup=CUP_AT, speck=(30, 50, 60, 90))
    third = picture(cup=CUP_AT, speck=(30, 50, 60, 90), hand=(50, 70, 40, 60))
    movie = [first] * 20 + [second] * 3 + [third] * 20
    alone = {"rest_px": None, "together_frames": 0}
    apart = steady(movie, **alone)
    assert story(apart, CUP, SPECK) == [(0, N), (20, T)]
    assert story(apart, CUP, HAND) == [(0, A), (23, T)]
    for frames, expected in ((2, 23), (3, 20)):
        joined = steady(movie, **{**alone, "together_frames": frames})
        assert story(joined, CUP, SPECK) == [(0, N), (20, T)]
        assert story(joined, CUP, HAND) == [(0, A), (expected, T)]


def test_frames_come_out_in_time_and_the_rest_is_not_waited_for() -> None:
    delay = 12 + 5  # min_life_frames, together_frames
    read = 0

    def frames() -> Iterator[tuple[int, NDArray[np.uint8]]]:
        nonlocal read
        for labels in taking():
            read += 1
            yield 2 * read, labels

    for place, (number, _) in enumerate(steady_relations(frames()), start=1):
        assert number == 2 * place
        assert read <= place + delay


def test_a_movie_shorter_than_a_life_shows_what_was_there_from_the_beginning() -> None:
    movie = [picture(cup=CUP_AT)] * 3 + [picture(cup=CUP_AT, speck=(5, 10, 5, 10))] * 2
    found = steady(movie)
    assert [record.segments.tolist() for _, record in found] == [[TABLE, CUP]] * 5
    assert found[0][1].relation(TABLE, CUP) == O


def test_memory_does_not_grow_with_labels_that_come_and_go() -> None:
    import tracemalloc

    def frames(n: int) -> Iterator[tuple[int, NDArray[np.uint16]]]:
        for number in range(n):
            labels = np.ones((16, 24), np.uint16)
            labels[4:8, 4:8] = 2 + number % 60_000 // 15
            yield number, labels

    peaks = []
    list(steady_relations(frames(20)))
    for n in (300, 1500):
        tracemalloc.start()
        for _ in steady_relations(frames(n)):
            pass
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.3 * peaks[0]


def test_parameters_follow_the_frame_rate() -> None:
    fast = at_frame_rate(TimeParameters(together_frames=0), 50)
    assert (fast.hysteresis_frames, fast.hold_frames, fast.min_life_frames, fast.together_frames) == (16, 120, 24, 0)
    assert at_frame_rate(TimeParameters(hysteresis_frames=2), 5).hysteresis_frames == 1
    with pytest.raises(ValueError, match="frames_per_second: expected a finite number above 0, got 0"):
        at_frame_rate(TimeParameters(), 0)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"hysteresis_frames": -1}, "hysteresis_frames: expected a whole number from 0 on, got -1"),
        ({"min_life_frames": 0}, "min_life_frames: expected a whole number from 1 on, got 0"),
        ({"hold_frames": 2.5}, "hold_frames: expected a whole number from 0 on, got 2.5"),
        ({"step_m": float("nan")}, "step_m: expected a finite number from 0 on or None, got nan"),
        ({"smear_spreads": -1.0}, "smear_spreads: expected a finite number from 0 on or None, got -1.0"),
        ({"visible_share": 1.5}, "visible_share: expected a share from 0 to 1, got 1.5"),
        ({"touching_thresholds": (0.3, 0.1)}, r"touching_thresholds: expected .* got \(0.3, 0.1\)"),
    ],
)
def test_impossible_parameters_are_refused(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TimeParameters(**wrong)  # type: ignore[arg-type]


def test_what_is_wrong_with_a_frame_is_said_with_its_number() -> None:
    good = picture(cup=CUP_AT)
    with pytest.raises(
        ValueError, match=r"frame 7: label image: expected shape \(80, 120\) as before, got \(79, 120\)"
    ):
        list(steady_relations([(3, good), (7, good[1:])]))
    with pytest.raises(ValueError, match="frame 3: depth_m: expected finite numbers from 0"):
        list(steady_relations([(3, good, np.full(good.shape, np.nan))]))
    with pytest.raises(ValueError, match="frame 3: label image: expected labels up to 65535, got 70000"):
        list(steady_relations([(3, np.full((4, 4), 70_000))]))


def test_any_integer_type_gives_the_same() -> None:
    movie = taking()
    expected = steady(movie)
    for dtype in (np.uint16, np.int64):
        for (_, a), (_, b) in zip(expected, steady([labels.astype(dtype) for labels in movie]), strict=True):
            assert a.segments.tolist() == b.segments.tolist()
            np.testing.assert_array_equal(a.relations, b.relations)


@st.composite
def movies(draw: st.DrawFn) -> tuple[Movie, list[set[int]]]:
    """Some boxes that come, go, and cover each other; each picture is shown for a while."""
    n_pictures = draw(st.integers(1, 7))
    shown: list[NDArray[np.uint8]] = []
    moving: list[set[int]] = []
    for _ in range(n_pictures):
        cells = draw(hnp.arrays(np.uint8, (3, 4), elements=st.sampled_from([1, 1, 1, 2, 3, 4])))
        cells[0, 0] = 1
        labels = np.kron(cells, np.ones((3, 3), np.uint8))
        movers = draw(st.sets(st.integers(2, 4)))
        for _ in range(draw(st.integers(1, 6))):
            shown.append(labels)
            moving.append(movers)
    return np.stack(shown), moving


@settings(max_examples=60)
@given(
    given_movie=movies(),
    hysteresis=st.integers(0, 5),
    min_life=st.integers(1, 5),
    hold=st.integers(0, 9),
    pause=st.integers(0, 9),
    switches=st.tuples(st.booleans(), st.booleans(), st.booleans(), st.booleans()),
    visible=st.sampled_from([0.0, 0.3, 0.7]),
    crumb=st.sampled_from([0.0, 0.2, 0.5]),
)
def test_steady_relations_as_the_slow_reference_finds_them(
    given_movie: tuple[Movie, list[set[int]]],
    hysteresis: int,
    min_life: int,
    hold: int,
    pause: int,
    switches: tuple[bool, bool, bool, bool],
    visible: float,
    crumb: float,
) -> None:
    movie, moving = given_movie
    names = ("freeze", "contact_by_motion", "carried", "kind_at_rest")
    p = replace(
        TimeParameters(
            hysteresis_frames=hysteresis,
            min_life_frames=min_life,
            hold_frames=hold,
            pause_frames=pause,
            together_frames=0,
            visible_share=visible,
            crumb_share=crumb,
        ),
        **dict(zip(names, switches, strict=True)),
    )
    frames = [
        SeenFrame(number, *seen) for number, seen in enumerate(zip(movie, [None] * len(movie), moving, strict=True))
    ]
    found = list(steady_relations(frames, parameters=p))
    expected = naive_steady(movie.tolist(), moving, p)
    assert len(found) == len(expected)
    for (_, relations), (segments, pairs) in zip(found, expected, strict=True):
        assert relations.segments.tolist() == segments
        assert {pair: int(relations.relation(*pair)) for pair in combinations(segments, 2)} == pairs


@given(data=st.data(), n=st.integers(1, 6))
def test_rest_as_the_slow_reference_finds_it(data: st.DataObject, n: int) -> None:
    hints = data.draw(hnp.arrays(np.int64, (n, n), elements=st.integers(0, 9)))
    hints = np.triu(hints, 1) + np.triu(hints, 1).T
    changed = data.draw(hnp.arrays(np.int64, (n, n), elements=st.integers(0, 9))) * (1 - np.eye(n, dtype=np.int64))
    pixels = data.draw(hnp.arrays(np.int64, n, elements=st.integers(1, 99)))

    def listed(matrix: NDArray[np.int64]) -> dict[tuple[int, int], int]:
        return {(i, j): int(matrix[i, j]) for i in range(n) for j in range(n)}

    expected = naive_rest(listed(changed), listed(hints), dict(enumerate(pixels.tolist())), 1.0)
    assert resting(changed, hints, pixels, 1.0).tolist() == [expected[i] for i in range(n)]
