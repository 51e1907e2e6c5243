"""The numbers of §2.7 that say how well a table parts types."""

import numpy as np
import pandas as pd
import pytest

from sec_lab.separation import n_outliers, type_separation

TYPES = ["put"] * 4 + ["take"] * 4 + ["pour"] * 4


def blocks(within: float, between: float) -> pd.DataFrame:
    types = np.array(TYPES)
    table = np.where(types[:, None] == types, within, between)
    np.fill_diagonal(table, 100.0)
    return pd.DataFrame(table)


def test_three_clean_types() -> None:
    found = type_separation(blocks(80, 30), TYPES)
    expected = {"least within": 80, "most between": 30, "fewest wrong": 0, "at": 30.5, "classes": 3, "Rand": 1.0}
    assert found == {**expected, "outliers": 0, "nearest": 12}


def test_one_pair_in_between() -> None:
    table = blocks(80, 30)
    table.iloc[0, 4] = table.iloc[4, 0] = 90.0
    found = type_separation(table, TYPES)
    # No threshold parts this pair from the others; both of its members have each other as nearest neighbour.
    assert (found["most between"], found["fewest wrong"], found["nearest"]) == (90.0, 1, 10)


def test_outliers() -> None:
    assert n_outliers(["a", "a", "b", "b"], [0, 0, 1, 1]) == 0
    assert n_outliers(["a", "a", "b", "b"], [0, 1, 0, 1]) == 2
    with pytest.raises(ValueError, match="found: expected 2 classes, got 1"):
        n_outliers(["a", "b"], [0])


def test_one_type_alone_is_refused() -> None:
    with pytest.raises(ValueError, match="classes: expected pairs of one type and of two"):
        type_separation(blocks(80, 30), ["put"] * 12)
