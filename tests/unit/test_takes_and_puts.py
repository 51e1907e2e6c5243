"""What an event chain says of things that are taken and put, and how that is held against the truth."""

from collections.abc import Sequence
from itertools import permutations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sec_lab.observation import Observation
from sec_lab.pipeline import observe
from sec_lab.scene_graph import SceneGraph
from sec_lab.segmentation import Segmentation
from sec_lab.takes_and_puts import EventAgreement, TakeOrPut, match_events, takes_and_puts

TABLE, HAND, BOX, CAP = 1, 2, 3, 4
TOP, HEIGHT = 50, 20
# Motion is measured over 8 frames (TimeParameters.motion_frames): what was moved seems to move on for so long.
WITHIN_FRAMES = 8

Picture = NDArray[np.uint8]


def picture(*, tip: int | None = None, box: int | None = TOP, column: int = 40, cap: int = 0) -> Picture:
    """A hand with two fingers that reaches down to row ``tip``, and a box, whose ``cap`` uppermost rows are a segment.

    ``box`` is the row of its upper side.
    """
    labels = np.full((90, 120), TABLE, np.uint8)
    if box is not None:
        labels[max(box, 0) : max(box + HEIGHT, 0), column : column + 16] = BOX
        labels[max(box, 0) : max(box + cap, 0), column : column + 16] = CAP
    if tip is not None:
        labels[: max(tip - 8, 0), column + 2 : column + 22] = HAND
        labels[max(tip - 8, 0) : max(tip, 0), column + 2 : column + 6] = HAND
        labels[max(tip - 8, 0) : max(tip, 0), column + 14 : column + 22] = HAND
    return labels


def taking(*, cap: int = 0) -> tuple[list[Picture], int]:
    """A hand comes, waits at the box, takes it away; and the number of the first frame in which the box has moved."""
    movie = [picture(cap=cap)] * 20
    movie += [picture(tip=tip, cap=cap) for tip in range(2, TOP, 2)]
    movie += [picture(tip=TOP, cap=cap)] * 12
    n = len(movie)
    movie += [picture(tip=tip, box=tip, cap=cap) for tip in range(TOP - 2, -HEIGHT - 2, -2)]
    return movie + [picture(box=None)] * 30, n


def putting(*, column: int) -> tuple[list[Picture], int]:
    """A hand comes with the box and leaves it; and the number of the first frame in which the box stays."""
    movie = [picture(tip=tip, box=tip, column=column) for tip in range(-HEIGHT, TOP, 2)]
    n = len(movie)
    movie += [picture(tip=TOP, column=column)] * 12
    movie += [picture(tip=tip, column=column) for tip in range(TOP - 2, -2, -2)]
    return movie + [picture(column=column)] * 30, n


def seen_in(movie: Sequence[Picture]) -> list[TakeOrPut]:
    return takes_and_puts(observe(Segmentation.from_labels(np.stack(movie), background=TABLE)))


def graph(*contacts: tuple[int, int], there: Sequence[int], at: tuple[float, float] = (0.0, 0.0)) -> SceneGraph:
    """Segments that are there, of which some are in contact; all of them have their centre at one place."""
    relations = np.zeros((len(there), len(there)), dtype=int)
    for pair in contacts:
        i, j = (there.index(label) for label in pair)
        relations[i, j] = relations[j, i] = 2
    return SceneGraph(there, relations, [at] * len(there))


def test_a_thing_is_taken_and_put_elsewhere() -> None:
    first, taken = taking()
    second, put = putting(column=80)
    found = seen_in(first + second)
    assert [(one.kind, one.segments) for one in found] == [("take", (BOX,)), ("put", (BOX,))]
    truth = [("take", taken), ("put", len(first) + put)]
    agreement = match_events([(one.kind, one.frame) for one in found], truth, tolerance_frames=WITHIN_FRAMES)
    assert len(agreement.hits) == 2
    assert found[0].by == (HAND,)
    # The middle of columns 40 to 55, and of 80 to 95; rows 50 to 69.
    assert [one.place for one in found] == [(47.5, 59.5), (87.5, 59.5)]


def test_what_is_hidden_or_passed_by_is_not_taken() -> None:
    still = [picture()] * 20
    before = []
    for tip in [*range(2, 90, 4), *[88] * 10, *range(88, 0, -4)]:
        frame = picture(tip=tip, column=38)
        frame[TOP : TOP + HEIGHT, 40:56] = np.where(frame[TOP : TOP + HEIGHT, 40:56] == HAND, HAND, BOX)
        frame[: max(tip - 8, 0), 38:60] = HAND
        before.append(frame)
    assert seen_in([*still, *before, *still]) == []
    above = [picture(tip=tip) for tip in [*range(2, TOP - 10, 2), *range(TOP - 10, 0, -2)]]
    assert seen_in([*still, *above, *still]) == []


def test_parts_of_one_thing_are_taken_once() -> None:
    movie, taken = taking(cap=6)
    (found,) = seen_in(movie)
    assert (found.kind, found.segments) == ("take", (BOX, CAP))
    assert abs(found.frame - taken) <= WITHIN_FRAMES


def test_two_things_at_once_are_two_takes() -> None:
    movie, taken = taking()
    twice = []
    for frame in movie:
        both = frame.copy()
        half = frame[:, 30:70]
        both[:, 75:115] = np.where(half == BOX, 5, np.where(half == HAND, 6, half))
        twice.append(both)
    found = seen_in(twice)
    assert [(one.kind, one.segments, one.by) for one in found] == [("take", (3,), (2,)), ("take", (5,), (6,))]
    assert max(abs(one.frame - taken) for one in found) <= WITHIN_FRAMES


def test_nothing_is_taken_where_nothing_moves() -> None:
    graphs = [graph((1, 3), (1, 4), there=[1, 3, 4]), graph((1, 4), there=[1, 4])]
    assert takes_and_puts(Observation(graphs, [0, 40]), supports=[1]) == []


@pytest.mark.parametrize(("frames", "n_events"), [([0, 40, 54, 90], 0), ([0, 40, 55, 90], 2)])
def test_a_short_lift_is_none(frames: list[int], n_events: int) -> None:
    on, off = graph((1, 3), there=[1, 2, 3]), graph((2, 3), there=[1, 2, 3])
    graphs = [on, off, on, graph((1, 3), there=[1, 3])]
    assert len(takes_and_puts(Observation(graphs, frames), supports=[1], rest_frames=15)) == n_events


@pytest.mark.parametrize(("frames", "n_events"), [([0, 40, 54], 0), ([0, 40, 55], 2)])
def test_a_short_rest_is_none(frames: list[int], n_events: int) -> None:
    off, on = graph(there=[1, 2, 3]), graph((1, 3), there=[1, 2, 3])
    assert len(takes_and_puts(Observation([off, on, off], frames), supports=[1], rest_frames=15)) == n_events


@pytest.mark.parametrize(
    ("place", "frames", "put_at"),
    [((10.0, 0.0), [0, 40, 60], 40), ((30.0, 0.0), [0, 40, 60], 60), ((10.0, 0.0), [0, 40, 91], 91)],
    ids=["near", "far", "long before"],
)
def test_what_appears_where_it_stays_was_put_then(place: tuple[float, float], frames: list[int], put_at: int) -> None:
    graphs = [graph(there=[1, 2]), graph((2, 3), there=[1, 2, 3], at=place), graph((1, 3), there=[1, 2, 3])]
    (found,) = takes_and_puts(Observation(graphs, frames), supports=[1], together_frames=50, near_px=20)
    assert (found.kind, found.frame, found.by) == ("put", put_at, (2,))


def test_a_hand_that_holds_still_is_not_put() -> None:
    graphs = [
        graph((2, 3), there=[1, 2, 3]),
        graph((1, 2), (1, 3), (2, 3), there=[1, 2, 3]),
        graph((1, 3), there=[1, 2, 3]),
        graph((1, 3), there=[1, 3]),
    ]
    (found,) = takes_and_puts(Observation(graphs, [0, 40, 60, 90]), supports=[1])
    assert (found.kind, found.frame, found.segments, found.by) == ("put", 40, (3,), (2,))


@pytest.mark.parametrize(("until", "n_events"), [(80, 0), (81, 2)])
def test_a_thing_may_rest_beside_another(until: int, n_events: int) -> None:
    graphs = [
        graph((1, 5), (2, 3), there=[1, 2, 3, 5]),
        graph((1, 5), (1, 3), (3, 5), there=[1, 2, 3, 5]),
        graph((1, 5), (2, 3), there=[1, 2, 3, 5]),
    ]
    # For so short a time, and beside something that rests for longer, it might be a hand.
    found = takes_and_puts(Observation(graphs, [0, 30, until]), supports=[1], together_frames=50)
    assert len(found) == n_events


def test_something_may_be_put_on_something_else() -> None:
    plate = 5
    graphs = [graph((1, plate), (2, 3), there=[1, 2, 3, plate]), graph((1, plate), (3, plate), there=[1, 2, 3, plate])]
    seen = Observation(graphs, [0, 30])
    assert takes_and_puts(seen, supports=[1]) == []
    (found,) = takes_and_puts(seen, supports=[1, plate])
    assert (found.kind, found.frame, found.segments) == ("put", 30, (3,))


def test_parts_that_come_to_light_later_belong_to_what_was_put() -> None:
    graphs = [
        graph(there=[1, 2]),
        graph((1, 3), (2, 3), there=[1, 2, 3], at=(50.0, 0.0)),
        graph((1, 3), there=[1, 3], at=(50.0, 0.0)),
        graph((1, 3), (1, 4), (3, 4), there=[1, 3, 4], at=(50.0, 0.0)),
    ]
    (found,) = takes_and_puts(Observation(graphs, [0, 40, 60, 70]), supports=[1])
    assert (found.kind, found.frame, found.segments) == ("put", 40, (3, 4))
    # Much later, and with nobody about, it is nothing.
    (found,) = takes_and_puts(Observation(graphs, [0, 40, 60, 170]), supports=[1], together_frames=50)
    assert found.segments == (3,)


def test_bad_input_is_named() -> None:
    seen = Observation([graph((1, 3), there=[1, 3])], [0])
    with pytest.raises(ValueError, match="supports: expected labels of what things rest on"):
        takes_and_puts(seen)
    with pytest.raises(ValueError, match="supports: expected labels that were seen, got 9"):
        takes_and_puts(seen, supports=[9])
    with pytest.raises(ValueError, match="supports: expected labels that were seen, got none"):
        takes_and_puts(seen, supports=[])
    for name in ("rest_frames", "together_frames", "near_px"):
        with pytest.raises(ValueError, match=f"{name}: expected a number from 0 on, got -1"):
            takes_and_puts(seen, supports=[1], **{name: -1})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="tolerance_frames: expected"):
        match_events([], [], tolerance_frames=-1)


def test_nothing_found_and_nothing_true() -> None:
    nothing = match_events([], [], tolerance_frames=3)
    assert nothing == EventAgreement((), (), ()) or nothing.hits == nothing.missed == nothing.false == ()
    assert np.isnan(nothing.median_error_frames)
    assert match_events([("put", 3)], [], tolerance_frames=3).false == (("put", 3),)
    assert match_events([], [("put", 3)], tolerance_frames=3).missed == (("put", 3),)


def test_the_table_is_in_the_order_of_the_movie() -> None:
    found = [("put", 52), ("take", 30), ("take", 9)]
    table = match_events(found, [("take", 10), ("put", 40), ("put", 50)], tolerance_frames=5).to_frame()
    assert table["event"].tolist() == ["take", "take", "put", "put"]
    assert table["verdict"].tolist() == ["hit", "false", "missed", "hit"]
    assert table["error_frames"].tolist() == [-1, pd.NA, pd.NA, 2]


events = st.lists(st.tuples(st.sampled_from(["take", "put"]), st.integers(0, 30)), max_size=5)


@given(events, events, st.integers(0, 8))
def test_matches_are_the_most_and_the_nearest(
    found: list[tuple[str, int]], truth: list[tuple[str, int]], tolerance: int
) -> None:
    agreement = match_events(found, truth, tolerance_frames=tolerance)
    assert naive_best(found, truth, tolerance) == (len(agreement.hits), int(np.abs(agreement.errors_frames).sum()))
    assert sorted([*((what, frame) for what, frame, _ in agreement.hits), *agreement.missed]) == sorted(truth)
    assert sorted([*((what, frame) for what, _, frame in agreement.hits), *agreement.false]) == sorted(found)


def naive_best(found: list[tuple[str, int]], truth: list[tuple[str, int]], tolerance: int) -> tuple[int, int]:
    """Most hits and their smallest error, by trying every way to pair the events."""
    few, many = sorted((found, truth), key=len)
    best = (0, 0)
    for order in permutations(many, len(few)):
        errors = [abs(a[1] - b[1]) for a, b in zip(few, order, strict=True) if a[0] == b[0]]
        errors = [error for error in errors if error <= tolerance]
        best = max(best, (len(errors), -sum(errors)))
    return best[0], -best[1]
