"""Cleaning of recordings and the hand, step by step, against a slow twin that loops over key frames."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.role_tables import (
    NO_CLEANING,
    Cleaning,
    SegmentHistory,
    bridge_absences,
    clean,
    drop_short_lived,
    drop_untouched,
    find_hand,
    merge_moving_together,
    merge_with_hand,
    segment_history,
)
from sec_lab.role_tables.hand import path_lengths
from sec_lab.scene_graph import SceneGraph
from tests import naive_role_tables as naive


def recording_of(movie: naive.Movie, *, unit: str = "m") -> Observation:
    graphs = []
    for moment in movie:
        labels = sorted(moment.places)
        codes = [[0 if a == b else moment.code(a, b) for b in labels] for a in labels]
        places = np.array([moment.places[label] for label in labels]).reshape(len(labels), 3)
        relations = np.array(codes, np.uint8).reshape(len(labels), len(labels))
        graphs.append(SceneGraph(labels, relations, places if len(labels) else None))
    return Observation(graphs, [moment.number for moment in movie], None, unit)  # type: ignore[arg-type]


def movie_of(history: SegmentHistory) -> naive.Movie:
    """The twin's form of a history; merged segments have the label of their first member."""
    labels = [members[0] for members in history.members]
    assert history.places is not None
    found = []
    for k, number in enumerate(history.key_frames.tolist()):
        here = [i for i in range(len(labels)) if history.present[i, k]]
        touch = {
            frozenset((labels[i], labels[j])): int(history.relations[i, j, k])
            for i in here
            for j in here
            if history.relations[i, j, k]
        }
        found.append(naive.Moment(number, {labels[i]: tuple(history.places[i, k].tolist()) for i in here}, touch))
    return found


@st.composite
def movies(draw: st.DrawFn) -> naive.Movie:
    """Few segments that come, go and touch at random, most of them rows of zeros as in recordings."""
    n, n_key_frames = draw(st.integers(2, 5)), draw(st.integers(1, 7))
    numbers = np.cumsum(draw(st.lists(st.integers(1, 9), min_size=n_key_frames, max_size=n_key_frames))).tolist()
    coordinate = st.integers(0, 4).map(float)
    movie = []
    for number in numbers:
        there = [label for label in range(1, n + 1) if draw(st.integers(0, 3))]
        places = {label: (draw(coordinate), draw(coordinate), draw(coordinate)) for label in there}
        codes = {frozenset((a, b)): draw(st.sampled_from([0, 0, 1, 2])) for a in there for b in there if a < b}
        movie.append(naive.Moment(number, places, {pair: code for pair, code in codes.items() if code}))
    return movie


@given(movies())
def test_history_is_what_was_recorded(movie: naive.Movie) -> None:
    if naive.segments(movie):
        assert movie_of(segment_history(recording_of(movie))) == movie


@given(movies())
def test_shares_of_time_are_those_of_the_twin(movie: naive.Movie) -> None:
    shares = segment_history(recording_of(movie)).shares
    assert shares.tolist() == pytest.approx(naive.lasting(movie))
    assert shares.sum() == pytest.approx(1.0)


@given(movies())
def test_hand_is_the_one_of_the_twin(movie: naive.Movie) -> None:
    if not naive.segments(movie):
        return
    history = segment_history(recording_of(movie))
    assert path_lengths(history).tolist() == pytest.approx([naive.path(movie, a) for a in naive.segments(movie)])
    expected, found = naive.hand(movie), find_hand(history).segment
    # Paths of the same length may differ by rounding.
    if expected is None or found is None:
        assert found == expected
    else:
        assert naive.path(movie, found) == pytest.approx(naive.path(movie, expected))


@given(movies())
def test_bridged_absences_are_those_of_the_twin(movie: naive.Movie) -> None:
    if naive.segments(movie):
        history = bridge_absences(segment_history(recording_of(movie)))
        assert movie_of(history) == naive.bridge(movie)


@given(movies())
def test_untouched_are_those_of_the_twin(movie: naive.Movie) -> None:
    if not naive.segments(movie):
        return
    history = drop_untouched(segment_history(recording_of(movie)))
    assert {members[0] for members in history.members} == set(naive.segments(movie)) - naive.untouched(movie)


@given(movies(), st.sampled_from([0.0, 5.0, 20.0]))
def test_what_joins_the_hand_is_what_joins_it_in_the_twin(movie: naive.Movie, tolerance: float) -> None:
    of = naive.hand(movie)
    if of is None:
        return
    group = naive.with_hand(movie, of, tolerance / 100 + 1e-12)
    history = merge_with_hand(segment_history(recording_of(movie)), hand=of, tolerance_percent=tolerance + 1e-10)
    others = [[label] for label in naive.segments(movie) if label not in group]
    assert history.members[0][0] == of
    assert set(history.members[0]) == set(group)
    # Where they are is told by the hand, then by the one that is there longest.
    lives = [naive.life(movie, label) for label in history.members[0]]
    assume(len({round(life, 9) for life in lives}) == len(lives))
    rounds = naive.with_hand_by_rounds(movie, of, tolerance / 100 + 1e-12)
    group = [of, *(a for one in rounds for a in sorted(one, key=lambda a: -naive.life(movie, a)))]
    assert history.members[0] == tuple(group)
    assert movie_of(history) == naive.merged(movie, [group, *others])


@given(movies(), st.sampled_from([10.0, 30.0, 60.0]))
def test_short_lived_are_those_of_the_twin(movie: naive.Movie, least: float) -> None:
    of = naive.hand(movie)
    if of is None:
        return
    history = drop_short_lived(segment_history(recording_of(movie)), hand=of, least_percent=least - 1e-10)
    expected = [a for a in naive.segments(movie) if a == of or naive.life(movie, a) >= least / 100 - 1e-12]
    assert [members[0] for members in history.members] == expected


@given(movies())
def test_cleaning_does_the_steps_in_their_order(movie: naive.Movie) -> None:
    of = naive.hand(movie)
    if of is None:
        return
    history = segment_history(recording_of(movie))
    cleaned = clean(history, hands=[of], cleaning=Cleaning())
    assert cleaned.members[0][0] == of
    assert len({label for members in cleaned.members for label in members}) <= len(history.members)
    untouched = clean(history, hands=[of], cleaning=NO_CLEANING)
    assert sorted(untouched.members) == sorted(history.members)
    np.testing.assert_array_equal(untouched.relations.sum(), history.relations.sum())


def fragments(*, moves: bool, from_first: bool) -> SegmentHistory:
    """A hand (9), a thing (1) and a second segment (2) that touches the thing whenever both are there."""
    steps = [0.0, 1.0, 2.0, 3.0] if moves else [0.0] * 4
    movie = []
    for k, x in enumerate(steps):
        places: dict[int, naive.Place] = {1: (x, 0.0, 0.0)}
        touch = {}
        if 0 < k < 3:
            places[9] = (x, 1.0 + k, 0.0)
            touch[frozenset((1, 9))] = 2
        if from_first or k > 1:
            places[2] = (x + 0.5, 0.0, 0.0)
            touch[frozenset((1, 2))] = 2
        movie.append(naive.Moment(10 * k, places, touch))
    return segment_history(recording_of(movie))


@pytest.mark.parametrize(
    ("moves", "from_first", "merged"),
    [(True, True, True), (True, False, True), (False, False, True), (False, True, False)],
    ids=["carried along", "split off while carried", "split off at rest", "two things at rest"],
)
def test_a_fragment_is_merged_and_a_neighbour_at_rest_is_not(moves: bool, from_first: bool, merged: bool) -> None:
    history = merge_moving_together(fragments(moves=moves, from_first=from_first), hand=9)
    assert ((1, 2) in history.members) == merged
    assert (9,) in history.members


def test_without_positions_nothing_is_merged_by_motion() -> None:
    history = segment_history(EventChain([[2, 2, 2], [9, 2, 9], [9, 0, 9]], [(1, 2), (1, 9), (2, 9)]))
    assert merge_moving_together(history, hand=9) is history


def test_a_hand_without_positions_is_told_by_presence_and_touch() -> None:
    chain = EventChain(
        [[9, 2, 0, 2, 9, 9], [9, 0, 0, 0, 9, 9], [9, 2, 2, 2, 9, 9], [0, 0, 0, 0, 0, 0], [9] * 6, [9, 9, 9, 9, 0, 9]],
        [(7, 1), (7, 2), (7, 3), (1, 2), (8, 7), (8, 1)],
    )
    found = find_hand(segment_history(chain))
    assert found.segment == 7
    assert "touching" in found.reason


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([[0, 0, 0]], "nothing ever touches"),
        ([[0, 2, 0]], "no segment comes or goes"),
        ([[2, 2, 2], [9, 0, 9], [9, 0, 9]], "what comes or goes touches nothing"),
    ],
)
def test_no_hand_is_said_with_its_reason(rows: list[list[int]], reason: str) -> None:
    pairs = [(1, 2), (1, 3), (2, 3)][: len(rows)]
    found = find_hand(EventChain(rows, pairs))
    assert (found.segment, found.reason) == (None, reason)


def test_one_segment_is_no_hand() -> None:
    found = find_hand(Observation([SceneGraph([4], [[0]])], [0]))
    assert (found.segment, found.reason) == (None, "expected at least two segments, got 1")


def test_a_hand_that_is_seen_to_leave_only_will_do() -> None:
    found = find_hand(segment_history(EventChain([[2, 0, 9], [0, 0, 9], [0, 0, 0]], [(7, 1), (7, 2), (1, 2)])))
    assert found.segment == 7
    assert found.reason.startswith("absent at first or at last")


def test_pixels_in_the_dialect_are_row_and_column() -> None:
    graph = SceneGraph([1, 2], [[0, 2], [2, 0]], [[40.0, 300.0, 0.0], [50.0, 200.0, 0.0]])
    history = segment_history(Observation([graph], [0]))
    assert history.places is not None
    assert history.places[:, 0].tolist() == [[300.0, 40.0], [200.0, 50.0]]
    named = segment_history(Observation([graph], [0], None, "m"))
    assert named.places is not None
    assert named.places.shape == (2, 1, 3)


@pytest.mark.parametrize("name", ["hand_percent", "short_percent", "together_percent"])
@pytest.mark.parametrize("value", [-1, 101, float("nan")])
def test_percentages_out_of_range_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name}: expected 0 to 100"):
        Cleaning(**{name: value})


def test_bad_input_is_told() -> None:
    history = segment_history(EventChain([[0, 2]], [(1, 2)]))
    with pytest.raises(ValueError, match="segment: expected one of"):
        merge_with_hand(history, hand=5)
    with pytest.raises(ValueError, match="hands: expected at least one"):
        clean(history, hands=[], cleaning=Cleaning())
    with pytest.raises(ValueError, match="recording: expected an Observation or an EventChain, got int"):
        segment_history(3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="places: expected those of all segments"):
        path_lengths(history)


def test_percentages_out_of_range_are_told() -> None:
    history = segment_history(EventChain([[9, 2, 9], [9, 0, 9], [0, 0, 0]], [(7, 1), (7, 2), (1, 2)]))
    for call, name in (
        (lambda: merge_with_hand(history, hand=7, tolerance_percent=-1), "tolerance_percent"),
        (lambda: drop_short_lived(history, hand=7, least_percent=101), "least_percent"),
        (lambda: merge_moving_together(history, hand=7, most_percent=float("nan")), "most_percent"),
    ):
        with pytest.raises(ValueError, match=f"{name}: expected 0 to 100, got"):
            call()


def test_all_that_joins_the_hand_joins_at_once() -> None:
    # 3 leaves with the hand 7, 4 comes with it. Would 3, which comes earlier, join alone and first, 4 would not come
    # with the hand any more: the order of labels would decide.
    life = {7: range(2, 5), 3: range(1, 5), 4: range(2, 4), 1: range(7), 2: range(7)}
    for a, b in ((3, 4), (4, 3)):
        now = {7: life[7], a: life[3], b: life[4], 1: life[1], 2: life[2]}
        pairs = [(7, 1), (a, 1), (b, 1), (a, 7), (b, 7), (a, b), (1, 2)]
        codes = [
            [(2 if (x, y) == (7, 1) else 0) if k in now[x] and k in now[y] else 9 for k in range(7)] for x, y in pairs
        ]
        history = segment_history(EventChain(codes, pairs, range(0, 70, 10)))
        assert merge_with_hand(history, hand=7).members == ((7, a, b), (1,), (2,))
