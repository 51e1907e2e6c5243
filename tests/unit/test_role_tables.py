"""Role tables: which segments get which role, what is said when one is missing, and how alike two tables are."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import sec_lab as sl
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.ontology import decide, decision_table
from sec_lab.relations.boxes import box_relations
from sec_lab.role_classifier import role_features
from sec_lab.role_tables import (
    NO_CLEANING,
    ROLES,
    ROWS,
    RoleTable,
    SegmentHistory,
    in_words,
    played_by,
    role_similarity,
    role_similarity_table,
    role_table,
    segment_history,
)
from sec_lab.role_tables.motion import up_direction, vertical_share
from sec_lab.role_tables.similarity import common_subsequence, compressed_rows, row_similarity
from sec_lab.role_tables.table import _worked_on
from sec_lab.scene_graph import SceneGraph, scene_graph
from tests import naive_role_tables as naive
from tests.unit.test_role_cleaning import movies, recording_of

NAMES = {1: "cup", 2: "box", 7: "arm"}
TAKE = EventChain([[9, 0, 2, 2, 0, 9], [9, 0, 0, 0, 0, 9], [2, 2, 2, 0, 0, 0]], [(7, 1), (7, 2), (2, 1)], names=NAMES)
PUT = EventChain([[9, 0, 2, 2, 0, 9], [9, 0, 0, 0, 0, 9], [0, 0, 0, 2, 2, 2]], [(7, 1), (7, 2), (2, 1)], names=NAMES)


@given(movies())
def test_object_2_is_the_one_of_the_twin(movie: naive.Movie) -> None:
    assume(naive.segments(movie))
    history = segment_history(recording_of(movie))
    for i, label in enumerate(naive.segments(movie)):
        found, _ = _worked_on(history, i, others=(i,))
        expected = naive.worked_on(movie, label, {label})
        if expected is None or found is None:
            assert found == expected
        else:
            assert rank(movie, label, history.members[found][0]) == rank(movie, label, expected)


def rank(movie: naive.Movie, of: int, label: int) -> tuple[int, int, float]:
    touching = [moment.code(of, label) > 0 for moment in movie]
    both = [of in moment.places and label in moment.places for moment in movie]
    changes = [k for k, (a, b) in enumerate(pairwise(touching), 1) if a != b]
    time = sum(share for share, yes in zip(naive.lasting(movie), touching, strict=True) if yes)
    return len(changes), sum(not (both[k] and both[k - 1]) for k in changes), round(time, 9)


@given(movies())
def test_table_without_cleaning_is_what_was_recorded_between_its_segments(movie: naive.Movie) -> None:
    assume(naive.segments(movie))
    table = role_table(recording_of(movie), cleaning=NO_CLEANING)
    labels = [table.segments[role][0] if table.segments[role] else None for role in ROLES]
    for row, (a, b) in zip(table.relations.tolist(), ROWS, strict=True):
        for moment, code in zip(movie, row, strict=True):
            i, j = labels[a], labels[b]
            if i is None or j is None or i not in moment.places or j not in moment.places:
                assert code == 9
            else:
                assert code == (2 if moment.code(i, j) > (1 if a == 0 else 0) else 0)
    for label, row in zip(labels, table.present.tolist(), strict=True):
        assert row == [label in moment.places for moment in movie]
    unclear = {f"clear {role}" for role in ROLES}
    assert {role for role in ROLES if not table.segments[role]} == set(table.missing) - {"positions"} - unclear


@given(movies(), st.permutations(range(41, 46)), st.booleans())
def test_labels_and_their_order_do_not_matter(movie: naive.Movie, labels: list[int], chains: bool) -> None:
    assume(naive.segments(movie) and naive.hand(movie) is not None)
    new = dict(enumerate(labels, 1))
    renamed = [
        naive.Moment(
            moment.number,
            {new[label]: place for label, place in moment.places.items()},
            {frozenset(new[label] for label in pair): code for pair, code in moment.touch.items()},
        )
        for moment in movie
    ]
    seen = [recording_of(one) for one in (movie, renamed)]
    table, other = (role_table(one.chain if chains and len(one.segments) > 1 else one) for one in seen)
    # Only what nothing but its label tells from another may depend on it, and then the table says so.
    assume("label alone" not in str(dict(table.missing)))
    np.testing.assert_array_equal(table.rows, other.rows)
    assert [{new[label] for label in labels} for labels in table.segments.values()] == [
        set(labels) for labels in other.segments.values()
    ]
    assert table.missing.keys() == other.missing.keys()


def test_ties_are_settled_by_what_happens_and_told() -> None:
    for a, b in ((1, 2), (2, 1)):
        # Both are held equally long; the first is touched earlier.
        seen = EventChain([[9, 2, 0, 0, 9], [9, 0, 2, 0, 9], [0, 0, 0, 0, 0]], [(7, a), (7, b), (a, b)], range(5))
        table = role_table(seen)
        assert table.segments["object 1"] == (a,)
        told = f"segments {a} and {b} are equal in what decides; {a} is taken, as it touched first"
        assert table.missing["clear object 1"] == told
        assert f"There is no clear object 1: {told}." in in_words(table)
    # Two hands that do the same, one after the other.
    for a, b in ((7, 8), (8, 7)):
        rows = [[9, 2, 0, 9], [0, 0, 0, 0], [9, 0, 2, 9], [9, 0, 0, 9], [9, 0, 0, 9], [9, 0, 0, 9]]
        seen = EventChain(rows, [(a, 1), (1, 2), (b, 2), (a, b), (a, 2), (b, 1)])
        table = role_table(seen, cleaning=NO_CLEANING)
        assert table.segments["hand"] == (a,)
        assert "as it touched first" in table.missing["clear hand"]
    alike = role_table(EventChain([[9, 2, 9], [9, 2, 9], [0, 0, 0]], [(7, 1), (7, 2), (1, 2)]))
    assert alike.missing["clear object 1"].endswith("1 is taken, by its label alone")
    assert "hand" not in alike.missing


def test_what_appears_in_touch_and_stays_is_no_hand() -> None:
    liquid = EventChain([[0, 0, 0, 0], [9, 9, 2, 2], [9, 9, 0, 0]], [(1, 2), (2, 3), (1, 3)])
    table = role_table(liquid)
    assert table.missing["hand"] == "what comes or goes neither touches nor lets go of anything while it is there"
    assert not any(table.segments.values())
    # A hand that was there from the beginning lets go before it leaves.
    late = EventChain([[2, 2, 0, 9], [0, 0, 0, 9], [0, 0, 0, 0]], [(7, 1), (7, 2), (1, 2)])
    assert role_table(late).segments["hand"] == (7,)


def test_roles_of_a_simple_action() -> None:
    table = sl.role_table(TAKE)
    assert dict(table.segments) == {"hand": (7,), "object 1": (1,), "object 2": (2,), "object 3": (), "partner": ()}
    assert table.relations.tolist()[:3] == [[9, 0, 2, 2, 0, 9], [2, 2, 2, 0, 0, 0], [9, 0, 0, 0, 0, 9]]
    assert (table.relations[3:] == 9).all()
    assert table.present.tolist() == [[False, *[True] * 4, False], [True] * 6, [True] * 6, [False] * 6, [False] * 6]
    assert table.name_of("object 2") == "box"
    assert sl.role_table(table) is table


def test_overlapping_counts_between_things_but_not_for_the_hand() -> None:
    chain = EventChain([[9, 1, 2, 1, 9], [9, 1, 1, 1, 9], [1, 1, 0, 1, 1]], [(7, 1), (7, 2), (2, 1)])
    table = role_table(chain)
    assert table.relations.tolist()[:3] == [[9, 0, 2, 0, 9], [2, 2, 0, 2, 2], [9, 0, 0, 0, 9]]


def test_of_things_touched_as_often_the_one_that_vanishes_is_worked_on() -> None:
    # Object 1 passes by a box (2) and covers a ball (3), in touch with the box for longer.
    rows = [[9, 2, 2, 2, 2, 9], [9, 0, 0, 0, 0, 9], [9, 0, 9, 9, 9, 9], [0, 0, 0, 2, 0, 0], [0, 2, 9, 9, 9, 9], [0] * 6]
    rows[5] = [0, 0, 9, 9, 9, 9]
    chain = EventChain(rows, [(7, 1), (7, 2), (7, 3), (1, 2), (1, 3), (2, 3)], [0, 10, 20, 30, 90, 100])
    table = role_table(chain)
    assert (table.segments["object 2"], table.segments["object 3"]) == ((3,), (2,))


def test_given_hands_are_taken_by_label_or_name() -> None:
    rows = [[0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 2, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 2, 0, 0]]
    names = {1: "cup", 2: "left", 3: "right", 4: "can"}
    both = EventChain(rows, [(1, 2), (3, 4), (1, 3), (2, 3), (1, 4), (2, 4)], names=names)
    assert role_table(both, hands=[2]).segments["hand"] == (2,)
    assert role_table(both, hands=["left", "right"]).segments["hand"] == (2, 3)
    assert role_table(both, hands=["right"]).hand_told_by == "given"
    assert "no segment comes or goes" in role_table(both).missing["hand"]
    for wrong in ([5], ["foot"], [], "left"):
        with pytest.raises(ValueError, match="hands: expected"):
            role_table(both, hands=wrong)


@pytest.mark.parametrize(
    ("recording", "reasons"),
    [
        (EventChain([[0, 0]], [(1, 2)]), {"hand": "nothing ever touches"}),
        (EventChain([[0, 2, 0]], [(1, 2)]), {"hand": "no segment comes or goes"}),
        (Observation([SceneGraph([4], [[0]])], [0]), {"hand": "expected at least two segments, got 1"}),
        (Observation([SceneGraph([], np.zeros((0, 0)))], [0]), {"hand": "expected at least two segments, got 0"}),
        (
            EventChain([[9, 2, 9], [9, 0, 9], [0, 0, 0]], [(1, 2), (1, 3), (2, 3)]),
            {"object 2": "object 1 touches nothing but the hand", "partner": "there is no object 2"},
        ),
        # In a chain, a thing that is left alone in the picture cannot be told from one that has gone.
        (EventChain([[9, 2, 9]], [(1, 2)]), {"object 1": "all that touches the hand comes and goes with it"}),
    ],
    ids=["nothing touches", "no hand", "one segment", "no segment", "no object 2", "no object 1"],
)
def test_what_is_missing_is_said_and_absent_throughout(
    recording: EventChain | Observation, reasons: dict[str, str]
) -> None:
    table = role_table(recording)
    for role, reason in reasons.items():
        assert table.missing[role] == reason
        assert table.segments[role] == ()
        assert not table.present[ROLES.index(role)].any()
        assert reason in str(table)
    assert np.isnan(table.vertical_share)
    assert "positions" in table.missing
    assert all(reason in in_words(table) for reason in reasons.values() if not reason.startswith("there is no"))


def test_a_given_hand_that_touches_nothing_is_said() -> None:
    table = role_table(EventChain([[0, 0], [0, 2], [0, 0]], [(7, 1), (1, 2), (7, 2)]), hands=[7])
    assert table.missing["object 1"] == "the hand touches nothing"
    assert table.segments["hand"] == (7,)


def test_boxes_in_space_get_roles_and_vertical_motion() -> None:
    # A hand lifts a cup off one of three boxes on a floor and leaves; up is z.
    floor = [[(x, y, 0.0), (x + 1, y + 1, 1.0)] for x, y in ((0, 0), (5, 0), (0, 5))]
    heights = [1.0, 1.0, 3.0, 3.0]
    graphs = []
    for k, z in enumerate(heights):
        boxes = [*floor, [(0.2, 0.2, z), (0.8, 0.8, z + 0.5)]]
        if 0 < k < 3:
            boxes.append([(0.2, 0.2, z + 0.5), (0.8, 0.8, z + 1)])
        found = box_relations(np.array(boxes, float))
        graphs.append(scene_graph(found))
    table = role_table(Observation(graphs, [0, 5, 9, 20], None, "m"))
    assert {role: labels for role, labels in table.segments.items() if labels} == {
        "hand": (5,),
        "object 1": (4,),
        "object 2": (1,),
    }
    assert table.vertical_share == pytest.approx(1.0)
    assert "positions" not in table.missing


def test_up_needs_three_things_at_rest_that_span_a_plane() -> None:
    def history(places: list[list[float]]) -> object:
        graph = SceneGraph(range(len(places)), np.zeros((len(places), len(places))), places)
        return segment_history(Observation([graph, graph], [0, 9], None, "m"))

    plane: list[list[float]] = [[0.0, 0, 0], [4, 0, 0], [0, 4, 0.0], [3, 3, 0]]
    assert np.abs(up_direction(history(plane))).tolist() == pytest.approx([0, 0, 1])  # type: ignore[arg-type]
    for bad in (plane[:2], [[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], np.vstack([np.eye(3), -np.eye(3)]).tolist()):
        assert up_direction(history(bad)) is None  # type: ignore[arg-type]


def test_vertical_share_is_unknown_where_nothing_moves() -> None:
    up = np.array([0.0, 1.0])
    assert np.isnan(vertical_share(np.zeros((3, 2)), up))
    assert np.isnan(vertical_share(np.zeros((1, 2)), up))
    assert np.isnan(vertical_share(np.ones((3, 2)), None))


def test_table_for_people_shows_changes_only() -> None:
    long = EventChain(TAKE.relations[:, [0, 1, 1, 2, 2, 3, 4, 5]], TAKE.pairs, names=NAMES)
    frame = role_table(long).to_frame()
    assert frame.shape == (10, 6)
    assert frame.columns.tolist() == [0, 1, 3, 5, 6, 7]
    assert frame.loc["object 1 – object 2"].tolist() == [2, 2, 2, 0, 0, 0]


def test_who_plays_what_in_several_takes() -> None:
    found = played_by({("one", 1): role_table(TAKE), ("one", 2): role_table(PUT)})
    assert found.index.nlevels == 2
    assert found.loc[("one", 2)].tolist() == ["arm", "cup", "box", "–", "–"]
    with pytest.raises(ValueError, match="tables: expected at least one"):
        played_by({})


def test_tables_travel_and_are_write_protected() -> None:
    table = role_table(TAKE)
    again = pickle.loads(pickle.dumps(table))
    np.testing.assert_array_equal(again.rows, table.rows)
    assert dict(again.segments) == dict(table.segments)
    with pytest.raises(ValueError, match="read-only"):
        table.relations[0, 0] = 0


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"relations": np.zeros((4, 6))}, "relations: expected shape"),
        ({"relations": np.ones((5, 6))}, "relations: expected 0, 2 and 9"),
        ({"present": np.zeros((5, 5))}, "present: expected shape"),
        ({"segments": {"hand": (7,)}}, "segments: expected those of the roles"),
    ],
)
def test_wrong_tables_are_refused(changed: dict[str, object], message: str) -> None:
    table = role_table(TAKE)
    fields = {name: getattr(table, name) for name in RoleTable.__dataclass_fields__}
    with pytest.raises(ValueError, match=message):
        RoleTable(**(fields | changed))


sequences = st.lists(st.sampled_from([0, 2, 9]), max_size=7).map(tuple)


@given(sequences, sequences)
def test_common_subsequences_are_those_of_the_twin(a: tuple[int, ...], b: tuple[int, ...]) -> None:
    assert common_subsequence(a, b) == naive.common_subsequence(a, b) == common_subsequence(b, a)


@given(movies(), movies(), st.sampled_from(["changes", "relations"]))
def test_similarity_is_symmetric_and_100_for_equals(a: naive.Movie, b: naive.Movie, compressed: str) -> None:
    assume(naive.segments(a) and naive.segments(b))
    one, other = role_table(recording_of(a)), role_table(recording_of(b))
    found = role_similarity(one, other, compressed=compressed)  # type: ignore[arg-type]
    assert 0 <= found <= 100
    assert found == role_similarity(other, one, compressed=compressed)  # type: ignore[arg-type]
    assert role_similarity(one, one, compressed=compressed) == 100  # type: ignore[arg-type]
    table = role_similarity_table({"a": one, "b": other}, compressed=compressed)  # type: ignore[arg-type]
    assert table.loc["a", "b"] == pytest.approx(found)


def test_rows_are_compressed_to_relations_or_to_changes() -> None:
    table = role_table(TAKE)
    assert compressed_rows(table, compressed="relations")[:2] == ((9, 0, 2, 0, 9), (2, 0))
    # begin → 2, 2 → 0, 0 → end
    assert compressed_rows(table)[1] == (32, 20, 4)
    assert row_similarity((32, 20, 4), (30, 2, 20, 4)) == pytest.approx(4 / 7)


def test_duration_does_not_matter_for_similarity() -> None:
    slow = EventChain(np.repeat(TAKE.relations, 3, axis=1), TAKE.pairs)
    assert role_similarity(role_table(TAKE), role_table(slow)) == 100
    assert role_similarity(role_table(TAKE), role_table(PUT)) < 100


def test_bad_comparisons_are_told() -> None:
    table = role_table(TAKE)
    with pytest.raises(ValueError, match="compressed: expected one of"):
        role_similarity(table, table, compressed="zip")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="tables: expected at least one"):
        role_similarity_table([])


def test_what_is_no_role_table_is_told() -> None:
    seen = recording_of([naive.Moment(1, {1: (0.0, 0.0, 0.0)}, {})])
    for call in (
        lambda: in_words(seen),  # type: ignore[arg-type]
        lambda: decide(seen),  # type: ignore[arg-type]
        lambda: role_features(seen),  # type: ignore[arg-type]
        lambda: role_similarity(seen, role_table(TAKE)),  # type: ignore[arg-type]
        lambda: role_similarity_table([seen]),  # type: ignore[list-item]
        lambda: played_by({"one": seen}),  # type: ignore[dict-item]
        lambda: decision_table({"one": seen}, ["taking"]),  # type: ignore[dict-item]
    ):
        with pytest.raises(ValueError, match=r"table: expected a RoleTable .*, got Observation"):
            call()
    with pytest.raises(ValueError, match="tables: expected a mapping of names to role tables, got list"):
        played_by([role_table(TAKE)])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="tables: expected a mapping with at least one role table"):
        decision_table({}, [])
    with pytest.raises(ValueError, match="hands: expected a sequence of labels or names, got 7"):
        role_table(TAKE, hands=7)  # type: ignore[arg-type]


def test_impossible_role_tables_are_refused() -> None:
    codes, there = np.zeros((5, 3), np.uint8), np.ones((5, 3), bool)
    nobody: dict[str, tuple[int, ...]] = dict.fromkeys(ROLES, ())
    frames = np.array([0, 4, 9])
    with pytest.raises(ValueError, match=r"key_frames: expected at least one, ascending, got \[\]"):
        RoleTable(codes[:, :0], there[:, :0], nobody, {}, frames[:0], {})
    with pytest.raises(ValueError, match=r"key_frames: expected at least one, ascending, got \[9, 4, 0\]"):
        RoleTable(codes, there, nobody, {}, frames[::-1], {})
    with pytest.raises(ValueError, match=r"vertical_share: expected 0 to 1, or NaN, got 7.5"):
        RoleTable(codes, there, nobody, {}, frames, {}, 7.5)
    with pytest.raises(ValueError, match="relations: expected touches of roles that are there"):
        RoleTable(codes + 2, ~there, nobody, {}, frames, {})


def test_a_history_has_a_copy_of_its_own() -> None:
    given = segment_history(TAKE)
    present = np.array(given.present)
    history = SegmentHistory(given.members, present, given.relations, given.places, given.key_frames)
    present[0, 0] = not present[0, 0]
    assert np.array_equal(history.present, given.present)
