"""Found begins and ends against the truth."""

import numpy as np
import pytest

from sec_lab.worlds.tabletop.deeds import TimedDeed
from sec_lab.worlds.tabletop.timing import timing_errors

TAKING = TimedDeed("taking", "hand", "object", "first plate", "bread", 40, 50, 50, 20, 120)
PUTTING = TimedDeed("putting", "hand", "object", "second plate", "bread", 50, 90, 80, 20, 120)


def test_each_deed_gets_what_was_found_of_its_kind() -> None:
    table = timing_errors([("putting", 48, 95), ("taking", 44, 49)], [TAKING, PUTTING])
    assert table["kind"].tolist() == ["taking", "putting"]
    assert table["begin_error"].tolist() == [4, -2]
    assert table["end_error"].tolist() == [-1, 5]
    assert table.attrs["superfluous"] == 0


def test_two_of_a_kind_are_paired_so_that_errors_are_least() -> None:
    later = TimedDeed("putting", "hand", "other", "second plate", "orange", 100, 118, 110, 20, 120)
    # The nearest to the first deed, taken alone, would leave the second one with the worse partner.
    table = timing_errors([("putting", 99, 119), ("putting", 60, 92)], [PUTTING, later])
    assert table["begin_error"].tolist() == [10, -1]
    assert table["end_error"].tolist() == [2, 1]


def test_what_is_missed_has_no_error_and_what_is_too_much_is_counted() -> None:
    table = timing_errors([("taking", 41, 52), ("taking", 60, 70), ("putting", 121, 140)], [TAKING, PUTTING])
    assert table["begin_error"][0] == 1
    assert np.isnan(table[["found_begin", "found_end", "begin_error", "end_error"]].iloc[1]).all()
    assert table.attrs["superfluous"] == 2
    nothing = timing_errors([], [TAKING])
    assert nothing["begin_error"].isna().all()
    assert nothing.attrs["superfluous"] == 0


def test_a_visit_lasts_from_the_appearance_of_the_hand_until_it_is_gone() -> None:
    table = timing_errors([("putting", 21, 118)], [PUTTING], extent="visit")
    assert table[["begin", "end", "begin_error", "end_error"]].to_numpy().tolist() == [[20, 120, 1, -2]]


def test_bad_input_is_named() -> None:
    with pytest.raises(ValueError, match="extent: expected one of hold, visit, got 'all'"):
        timing_errors([], [TAKING], extent="all")
    with pytest.raises(ValueError, match="found: expected begins before ends, got taking from 5 to 4"):
        timing_errors([("taking", 5, 4)], [TAKING])
