"""Roles of segments: the thesis's counting, its remedy for ties, and ties that remain."""

import pickle

import numpy as np
import pytest

from sec_lab import AmbiguousRoleError, EventChain, compare, corresponding_segments
from sec_lab.roles import role_votes

# §2.5, §2.6: the artificial *Moving Object* action.
SAMPLE_1 = EventChain(
    [[1, 2, 1, 1, 1], [1, 1, 1, 2, 1], [0, 2, 1, 2, 0], [0, 0, 0, 0, 0], [1, 2, 0, 0, 0], [0, 0, 0, 2, 1]],
    [(2, 1), (3, 1), (4, 1), (3, 2), (4, 2), (4, 3)],
)
SAMPLE_2 = EventChain(
    [[1, 1, 1, 2, 1], [0, 2, 1, 2, 0], [1, 2, 1, 1, 1], [0, 0, 0, 2, 1], [1, 2, 0, 0, 0]],
    [(2, 1), (3, 1), (6, 1), (3, 2), (3, 6)],
)


def test_the_thesis_finds_the_roles_of_its_example():
    assert corresponding_segments(compare(SAMPLE_1, SAMPLE_2)) == {1: 1, 2: 6, 3: 2, 4: 3}


def test_votes_are_the_counts_of_the_thesis():
    votes = role_votes(compare(SAMPLE_1, SAMPLE_2))
    # §2.8: node 1 three times with 1 and once each with 2, 3, 6; node 2 twice with 6; node 3 twice with 2; node 4
    # three times with 3. Columns are the segments 1, 2, 3, 6.
    np.testing.assert_array_equal(votes, [[3, 1, 1, 1], [1, 0, 1, 2], [1, 2, 1, 0], [1, 1, 3, 1]])


def test_roles_do_not_depend_on_the_order_of_rows_or_of_a_pair():
    order = [3, 0, 4, 2, 1]
    shuffled = EventChain(SAMPLE_2.relations[order], SAMPLE_2.pairs[order][:, ::-1])
    assert corresponding_segments(compare(SAMPLE_1, shuffled)) == {1: 1, 2: 6, 3: 2, 4: 3}


def test_a_chain_has_its_own_roles():
    assert corresponding_segments(compare(SAMPLE_1, SAMPLE_1)) == {1: 1, 2: 2, 3: 3, 4: 4}


def test_a_single_row_does_not_tell_its_two_segments_apart():
    a, b = EventChain([[0, 2]], [(1, 2)]), EventChain([[0, 2]], [(3, 4)])
    with pytest.raises(AmbiguousRoleError, match="1 ≈ 3 or 4; 2 ≈ 3 or 4") as caught:
        corresponding_segments(compare(a, b))
    assert caught.value.solved == {}
    assert caught.value.ambiguous == {1: (3, 4), 2: (3, 4)}
    assert corresponding_segments(compare(a, b), on_tie="omit") == {}


def test_a_role_that_is_taken_is_no_option_any_more():
    # The hand 1 touches two things, one after the other; each thing meets the hand and its counterpart once.
    a = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (1, 3)])
    b = EventChain([[0, 2, 2], [0, 0, 2]], [(4, 5), (4, 6)])
    assert corresponding_segments(compare(a, b)) == {1: 4, 2: 5, 3: 6}


def test_identical_rows_are_not_told_apart_by_guessing():
    # 2 and 3 do the same at the same time: either could be 5 or 6.
    a = EventChain([[0, 2], [0, 2]], [(1, 2), (1, 3)])
    b = EventChain([[0, 2], [0, 2]], [(4, 5), (4, 6)])
    with pytest.raises(AmbiguousRoleError) as caught:
        corresponding_segments(compare(a, b))
    assert caught.value.solved == {1: 4}
    assert caught.value.ambiguous == {2: (5, 6), 3: (5, 6)}
    assert corresponding_segments(compare(a, b), on_tie="omit") == {1: 4}


def test_the_second_highest_similarity_breaks_a_tie():
    # Rows (1, 2) and (1, 3) correspond to (5, 6) and (7, 8), so 1 meets all four of them once. The second most similar
    # rows are (5, 7) and (5, 8), 50 % each: there 1 meets 5 twice.
    a = EventChain([[0, 2, 0], [0, 1, 0]], [(1, 2), (1, 3)])
    b = EventChain([[0, 2, 0], [0, 1, 0], [0, 2, 2], [0, 1, 1]], [(5, 6), (7, 8), (5, 7), (5, 8)])
    match = compare(a, b)
    assert match.rows.tolist() == [[0, 0], [1, 1]]
    assert match.row_similarity.tolist() == [[100, 0, 50, 0], [0, 100, 0, 50]]
    assert role_votes(match)[0].tolist() == [1, 1, 1, 1]
    # Then 2 is left with 6; and 3 meets 8 in the second row as well, but 7 does not come up again.
    assert corresponding_segments(match) == {1: 5, 2: 6, 3: 8}


def test_a_tie_that_the_second_highest_similarity_leaves_is_not_guessed():
    # One row corresponds, (1, 2) to (5, 6); the second most similar row is (5, 7). Both ends of the row lean to 5.
    a = EventChain([[0, 2, 0, 0], [1, 1, 1, 2]], [(1, 2), (1, 3)])
    b = EventChain([[0, 2, 0, 0], [0, 2, 1, 1]], [(5, 6), (5, 7)])
    with pytest.raises(AmbiguousRoleError) as caught:
        corresponding_segments(compare(a, b))
    assert caught.value.ambiguous == {1: (5, 6), 2: (5, 6)}


def test_an_unknown_option_is_refused():
    with pytest.raises(ValueError, match=r"on_tie: expected one of .* got 'guess'"):
        corresponding_segments(compare(SAMPLE_1, SAMPLE_2), on_tie="guess")  # type: ignore[arg-type]


def test_the_error_survives_pickling():
    error = pickle.loads(pickle.dumps(AmbiguousRoleError({1: 4}, {2: (5, 6)})))
    assert (error.solved, error.ambiguous) == ({1: 4}, {2: (5, 6)})
