"""Tracks broken as trackers break them (chapter 3, beyond the thesis)."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sec_lab.worlds.tabletop.faults import (
    RATES,
    REPEATS,
    SEED,
    fault_study,
    judged,
    main,
    model_similarity,
    observe_broken,
)
from sec_lab.worlds.tabletop.truth import Truth
from sec_lab.worlds.tracker_faults import FAULTS, Fault, broken_tracks

N = 30
TABLES = Path(__file__).parents[2] / "datasets" / "tracker_faults"


def movie() -> NDArray[np.uint8]:
    """A background with three blocks, one of which comes late."""
    labels = np.full((N, 24, 36), 1, np.uint8)
    labels[:, 2:10, 2:14], labels[:, 12:22, 4:10], labels[N // 2 :, 4:20, 22:32] = 3, 4, 7
    return labels


def broken(fault: Fault, *, rate: float = 4.0, seed: int = 0, **options: Any) -> tuple[NDArray[np.uint16], int]:
    return broken_tracks(movie(), fault, per_hundred_frames=rate, rng=np.random.default_rng(seed), **options)


@pytest.mark.parametrize("fault", FAULTS)
def test_rate_zero_changes_nothing_and_the_same_seed_gives_the_same(fault: Fault) -> None:
    labels, n = broken(fault, rate=0)
    assert n == 0
    assert np.array_equal(labels, movie())
    one, two, other = broken(fault), broken(fault), broken(fault, seed=1)
    assert one[1] == two[1] > 0
    assert one[0].tobytes() == two[0].tobytes() != other[0].tobytes()


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([1.0, 5.0, 100.0]))
def test_what_each_fault_may_change(seed: int, rate: float) -> None:
    true = movie()
    split, n = broken("split", rate=rate, seed=seed)
    fresh = split >= 8
    assert np.array_equal(split[~fresh], true[~fresh])
    assert set(np.unique(true[fresh])) <= {3, 4, 7}
    assert len(np.unique(split[fresh])) == n
    vanished, _ = broken("vanish", rate=rate, seed=seed)
    assert set(np.unique(true[vanished != true])) <= {3, 4, 7}
    assert (vanished[vanished != true] == 1).all()
    swapped, _ = broken("swap", rate=rate, seed=seed)
    for before, after in zip(true, swapped, strict=True):
        pairs = np.unique(np.stack([before, after]).reshape(2, -1), axis=1).T.tolist()
        assert len(pairs) == len(np.unique(before)) == len(np.unique(after)), "a swap is one to one"
        assert [1, 1] in pairs


def test_faults_last_as_long_as_they_should() -> None:
    rng = np.random.default_rng(0)
    still = np.ones((400, 4, 6), np.uint8)
    still[:, 1:3, 1:4] = 2
    labels, n = broken_tracks(still, "vanish", per_hundred_frames=3, rng=rng, duration=5)
    gone = ~(labels == 2).any(axis=(1, 2))
    assert n > 3
    assert gone[:-5].sum() == pytest.approx(5 * n, abs=5)


def test_flicker_grows_and_shrinks() -> None:
    labels, _ = broken("flicker", rate=100, duration=4, border_px=1)
    sizes = (labels[:4] == 3).sum(axis=(1, 2)).tolist()
    # The block of 8×12 grows by its border, then shrinks by it.
    assert (sizes[0], sizes[1]) == (10 * 14, 6 * 10)


def test_rate_is_that_of_a_segment_in_a_hundred_frames() -> None:
    still = np.ones((5000, 2, 4), np.uint8)
    still[:, :, 1], still[:, :, 2] = 2, 3
    _, n = broken_tracks(still, "swap", per_hundred_frames=2, rng=np.random.default_rng(1))
    # Two segments, 5000 frames: 200 expected, five standard deviations.
    assert abs(n - 200) < 5 * np.sqrt(200)


def test_bad_input_is_refused() -> None:
    rng = np.random.default_rng(0)
    for options, says in (
        ({"fault": "melt"}, "fault: expected one of"),
        ({"per_hundred_frames": -1}, "per_hundred_frames: expected 0 to 100, got -1"),
        ({"per_hundred_frames": np.nan}, "per_hundred_frames: expected 0 to 100"),
        ({"duration": 0}, "duration: expected a whole number of at least 1, got 0"),
        ({"duration": 2.5}, "duration: expected a whole number of at least 1, got 2.5"),
        ({"labels": np.full((1, 2, 2), 70000)}, "labels: expected 0 to 32767"),
    ):
        given = {"labels": movie(), "fault": "split", "per_hundred_frames": 1, **options}
        with pytest.raises(ValueError, match=says):
            broken_tracks(given.pop("labels"), given.pop("fault"), rng=rng, **given)


def test_a_bad_study_of_faults_is_refused() -> None:
    two = ["opening_book_1_laboratory", "opening_book_2_laboratory"]
    good: dict[str, Any] = {"movies": two, "rates": [1.0], "repeats": 1, "seed": 1}
    for changed, says in (
        ({"movies": ["foo_1_laboratory"]}, "movies: expected names as .*, got 'foo_1_laboratory'"),
        ({"movies": two[:1]}, "movies: expected at least two of each action, got one of 'opening_book'"),
        ({"movies": []}, "movies: expected at least one, got none"),
        ({"rates": [200]}, r"rates: expected faults in a hundred frames, 0 to 100, got \[200\]"),
        ({"repeats": 0}, "repeats: expected a whole number of at least 1, got 0"),
        ({"faults": ["melt"]}, "faults: expected some of .*, got 'melt'"),
    ):
        with pytest.raises(ValueError, match=says):
            fault_study(TABLES.parent / "tabletop_actions", **{**good, **changed})


def test_a_swap_strikes_two_segments() -> None:
    # Of two segments that swap whenever one of them is struck, each suffers twice the rate.
    labels = np.ones((4000, 1, 3), np.uint8)
    labels[:, 0, :2] = 2, 3
    broken, n_faults = broken_tracks(labels, "swap", per_hundred_frames=2, rng=np.random.default_rng(0))
    suffered = int((np.diff(broken[:, 0, 0].astype(int)) != 0).sum())
    assert abs(suffered / n_faults - 1) < 0.1
    assert abs(suffered / 4000 - 2 * 0.02) <= 5 * np.sqrt(0.04 / 4000)


def small_truth() -> Truth:
    """A hand (3) comes to a box (4) on the table (1), and both leave."""
    labels = np.full((40, 32, 48), 1, np.uint8)
    depth = np.full(labels.shape, 900, np.uint16)
    for t, frame in enumerate(labels):
        left = 30 if t < 20 else min(30 + t - 20, 40)
        frame[10:22, left : left + 8] = 4
        if t >= 5:
            hand = max(2, 22 - 2 * max(0, 12 - t)) + left - 30
            frame[12:20, hand : hand + 8] = 3
        depth[t][frame > 1] = 880
    pairs = [(1, 3), (1, 4), (3, 4)]
    return Truth(labels, depth, pairs, np.zeros((40, 3), bool), {1: "table", 3: "right hand", 4: "box"})


def test_broken_tracks_are_observed_under_their_true_names() -> None:
    whole, none = observe_broken(small_truth(), "vanish", per_hundred_frames=0, rng=np.random.default_rng(0))
    assert none == 0
    assert set(whole.names.values()) == {"table", "first hand", "box"}
    perfect = judged(whole, whole, {"put_1_laboratory": whole.chain})
    assert (perfect["similarity"], perfect["nearest"]) == (100.0, "put_1_laboratory")
    swapped, n = observe_broken(small_truth(), "swap", per_hundred_frames=8, rng=np.random.default_rng(0))
    assert n > 0
    assert set(swapped.names) == set(swapped.segments.tolist())
    assert set(swapped.names.values()) <= {"table", "first hand", "box"}
    assert judged(swapped, whole, {})["nearest"] == ""
    assert model_similarity([whole.chain] * 2, [whole.chain] * 2) == 100.0


def test_stored_tables_are_complete_and_a_part_of_them_comes_out_again() -> None:
    movies, models = (pd.read_csv(TABLES / f"{name}.csv") for name in ("movies", "models"))
    assert len(movies) == 16 * (1 + len(FAULTS) * len(RATES) * REPEATS)
    assert len(models) == 4 * len(FAULTS) * len(RATES) * REPEATS
    assert not movies.drop(columns="nearest").isna().any(axis=None)
    two = ["opening_book_1_laboratory", "opening_book_2_laboratory"]
    anew, _ = fault_study(TABLES.parent / "tabletop_actions", movies=two, rates=RATES[:1], repeats=1, seed=SEED)
    keys = ["movie", "fault", "rate", "repeat", "n_faults", "rows", "columns", "similarity", "roles_percent"]
    assert len(anew[keys].merge(movies[keys])) == len(anew) == 2 * (1 + len(FAULTS))


def test_command_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as error:
        main([str(tmp_path), str(tmp_path)])
    assert error.value.code == 2
    assert "expected folders of movies, got none" in capsys.readouterr().err
