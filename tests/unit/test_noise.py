"""Noisy chains (§3.1): what noise does, and the compiled comparison against compare() and corresponding_segments()."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joblib import parallel_config

import sec_lab as sl
from sec_lab.event_chain import EventChain
from sec_lab.noise import (
    DEFAULT_NOISE,
    LEVELS,
    Noise,
    NoisySamples,
    compare_with_seed,
    noisy_samples,
    shuffled_rows,
)
from sec_lab.noise_seeds import CLASS_SEEDS, LIFTING, SEEDS
from sec_lab.noise_studies import model_study, noise_study
from sec_lab.roles import AmbiguousRoleError, corresponding_segments

MODES = st.sampled_from(["flip and add", "add only", "flip only"])
NOISES = st.builds(
    Noise,
    mode=MODES,
    added_values=st.sampled_from(["uniform", "lasting"]),
    added_pair=st.sampled_from(["fragment", "one object", "two fragments"]),
)
ALL_SEEDS = {"3×5": LIFTING, **SEEDS, **CLASS_SEEDS}


@st.composite
def seeds(draw: st.DrawFn) -> EventChain:
    """Small chains with a change; rows repeat and stay constant often."""
    k = draw(st.integers(2, 5))
    row = st.lists(st.sampled_from(draw(st.sampled_from([(0, 2), (0, 2, 9), (0, 1, 2, 9)]))), min_size=k, max_size=k)
    pool = draw(st.lists(row, min_size=1, max_size=3))
    table = draw(
        st.lists(st.sampled_from(pool) | row, min_size=1, max_size=5).filter(
            lambda rows: any(len(set(one)) > 1 for one in rows)
        )
    )
    every = [(b, a) for b in range(2, 6) for a in range(1, b)]
    pairs = draw(st.permutations(every))[: len(table)]
    return EventChain(table, pairs)


def samples_of(seed: EventChain, p: float, noise: Noise = DEFAULT_NOISE, n: int = 100, number: int = 0) -> NoisySamples:
    return noisy_samples(seed, p, n_samples=n, rng=np.random.default_rng(number), noise=noise)


@pytest.mark.parametrize("name", ALL_SEEDS)
def test_seeds_have_the_sizes_that_the_thesis_names(name: str) -> None:
    seed = ALL_SEEDS[name]
    m, k = seed.relations.shape
    assert f"{m}×{k}" == (name if "×" in name else "6×6")
    assert len(seed.segments) <= 5
    assert len(seed.changing_rows) == m
    steps = seed.relations[:, 1:] != seed.relations[:, :-1]
    assert steps.any(axis=0).all(), "a column without any event"
    assert corresponding_segments(sl.compare(seed, seed)) == {int(s): int(s) for s in seed.segments}


def test_without_noise_a_sample_is_the_seed() -> None:
    for sample in samples_of(SEEDS["6×8"], 0.0):
        assert np.array_equal(sample.relations, SEEDS["6×8"].relations)
        assert np.array_equal(sample.pairs, SEEDS["6×8"].pairs)


def test_full_noise_flips_everything_and_fills_every_gap() -> None:
    seed = SEEDS["5×7"]
    for sample in samples_of(seed, 1.0):
        assert sample.relations.shape == (9, 13)
        assert (sample.relations[::2, ::2] != seed.relations).all()


def test_adding_alone_keeps_the_seed_and_flipping_alone_its_size() -> None:
    seed = SEEDS["4×6"]
    samples = samples_of(seed, 1.0, Noise(mode="add only"))
    assert all(np.array_equal(one.relations[::2, ::2], seed.relations) for one in samples)
    assert {one.relations.shape for one in samples_of(seed, 0.7, Noise(mode="flip only"))} == {(4, 6)}


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(sorted(ALL_SEEDS)), st.floats(0.05, 0.95), NOISES)
def test_noise_comes_as_often_as_p_says(name: str, p: float, noise: Noise) -> None:
    seed, n = ALL_SEEDS[name], 4000
    samples = samples_of(seed, p, noise, n=n)
    (m, k), flips, adds = seed.relations.shape, noise.mode != "add only", noise.mode != "flip only"
    shares = {
        "flips": ((samples.relations[:, ::2, ::2] != seed.relations).mean(), p * flips, n * m * k),
        "rows": (samples.rows[:, 1::2].mean(), p * adds, n * (m - 1)),
        "columns": (samples.columns[:, 1::2].mean(), p * adds, n * (k - 1)),
    }
    for what, (share, expected, count) in shares.items():
        # Five standard deviations of a binomial share.
        assert abs(share - expected) <= 5 * np.sqrt(p * (1 - p) / count), what


def test_a_flip_goes_to_every_other_relation_alike() -> None:
    samples = samples_of(LIFTING, 1.0, n=4000)
    for place in np.ndindex(LIFTING.relations.shape):
        got = samples.relations[:, 2 * place[0], 2 * place[1]]
        shares = [(got == other).mean() for other in (0, 1, 2, 9) if other != LIFTING.relations[place]]
        assert np.allclose(shares, 1 / 3, atol=5 * np.sqrt(2 / 9 / 4000))


def test_lasting_rows_change_less_often() -> None:
    changes = {
        values: np.mean(
            [
                (row[1:] != row[:-1]).mean()
                for one in samples_of(SEEDS["8×8"], 1.0, Noise(mode="add only", added_values=values), n=50)  # type: ignore[arg-type]
                for row in one.relations[1::2]
            ]
        )
        for values in ("uniform", "lasting")
    }
    assert changes["lasting"] < 0.6 * changes["uniform"]


@pytest.mark.parametrize("p", [0.3, 1.0])
def test_lasting_holds_on_to_the_column_that_is_there_before(p: float) -> None:
    same = n = 0
    for samples in [samples_of(SEEDS["6×8"], p, Noise(mode="add only", added_values="lasting"), n=3000)]:
        for one, rows in zip(samples, samples.rows, strict=True):
            added = one.relations[np.flatnonzero(rows) % 2 == 1]
            same += int((added[:, 1:] == added[:, :-1]).sum())
            n += added[:, 1:].size
    # Half of them hold on; of the others a quarter comes to the same by chance.
    assert abs(same / n - 0.625) <= 5 * np.sqrt(0.25 / n)


def test_added_rows_are_pairs_of_what_was_asked_for() -> None:
    seed = SEEDS["8×8"]
    old = set(seed.segments.tolist())
    for kind, n_old in (("fragment", 1), ("one object", 1), ("two fragments", 0)):
        for one in samples_of(seed, 1.0, Noise(added_pair=kind), n=20):  # type: ignore[arg-type]
            added = one.pairs[1::2].tolist()
            assert all(len(old.intersection(pair)) == n_old for pair in added)
            if kind == "one object":
                assert len(set.union(*(old.intersection(pair) for pair in added))) == 1


@settings(max_examples=150, deadline=None)
@given(
    seeds(),
    st.sampled_from([0.0, 0.1, 0.3, 0.5, 0.8, 1.0]),
    NOISES,
    st.sampled_from(["longer", "shorter"]),
    st.sampled_from([0.0, 20.0, 50.0]),
    st.integers(0, 2**32),
)
def test_compiled_comparison_is_compare_and_corresponding_segments(
    seed: EventChain, p: float, noise: Noise, normalizer: Any, tolerance: float, number: int
) -> None:
    samples = samples_of(seed, p, noise, n=6, number=number)
    found = compare_with_seed(samples, normalizer=normalizer, tolerance_percent=tolerance)
    things = np.unique(seed.pairs[seed.changing_rows]).tolist()
    assert found.n_objects == len(things)
    for i, sample in enumerate(samples):
        if not len(sample.changing_rows):
            assert (found.spatial[i], found.temporal[i], found.objects_right[i]) == (0, 0, 0)
            continue
        match = sl.compare(seed, sample, normalizer=normalizer, tolerance_percent=tolerance)
        assert found.spatial[i] == pytest.approx(match.spatial, abs=1e-9)
        assert (found.temporal[i], found.exact[i]) == (match.temporal, match.exact)
        try:
            solved, ambiguous = corresponding_segments(match), {}
        except AmbiguousRoleError as error:
            solved, ambiguous = error.solved, error.ambiguous
        assert found.objects_right[i] == sum(solved.get(thing) == thing for thing in things)
        assert found.objects_wrong[i] == sum(solved.get(thing, thing) != thing for thing in things)
        assert found.objects_tied[i] == len(ambiguous)


def test_studies_are_the_same_on_any_number_of_threads_and_processes() -> None:
    def study(n_jobs: int) -> Any:
        return noise_study(SEEDS, rng=np.random.default_rng(4), levels=[0.2, 0.7], n_samples=1500, n_jobs=n_jobs)

    one, two, with_processes = study(1), study(2), None
    with parallel_config(backend="loky"):
        with_processes = study(2)
    for other in (two, with_processes):
        assert one.similarity.tobytes() == other.similarity.tobytes()
        assert one.objects.tobytes() == other.objects.tobytes()
    models = [
        model_study({"3×5": LIFTING}, rng=np.random.default_rng(4), levels=[0.2], n_samples=20, n_models=3, n_jobs=n)
        for n in (1, 2)
    ]
    assert models[0].similarity.tobytes() == models[1].similarity.tobytes()


def test_a_study_on_a_dask_cluster_is_the_same_to_the_bit() -> None:
    import distributed

    here = noise_study(SEEDS, rng=np.random.default_rng(5), levels=[0.1, 0.6], n_samples=1200, n_jobs=1)
    model_here = model_study({"3×5": LIFTING}, rng=np.random.default_rng(5), levels=[0.3], n_samples=10, n_models=4)
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    with cluster, distributed.Client(cluster) as client, parallel_config(backend="dask"):
        assert len(client.scheduler_info()["workers"]) == 2
        there = noise_study(SEEDS, rng=np.random.default_rng(5), levels=[0.1, 0.6], n_samples=1200)
        model_there = model_study(
            {"3×5": LIFTING}, rng=np.random.default_rng(5), levels=[0.3], n_samples=10, n_models=4
        )
    assert here.similarity.tobytes() == there.similarity.tobytes()
    assert here.objects.tobytes() == there.objects.tobytes()
    assert model_here.similarity.tobytes() == model_there.similarity.tobytes()


def test_a_study_gives_means_and_standard_errors_as_the_figures_show_them() -> None:
    study = noise_study({"3×5": LIFTING}, rng=np.random.default_rng(6), levels=[0, 0.5], n_samples=64)
    mean, error = study.mean(), study.standard_error()
    assert mean.index.name == "noise level p"
    assert (mean.loc[0.0, "3×5"], error.loc[0.0, "3×5"]) == (100.0, 0.0)
    values = study.similarity[0, 1]
    assert mean.loc[0.5, "3×5"] == pytest.approx(values.sum() / 64)
    spread = np.sqrt(((values - values.mean()) ** 2).sum() / 63)
    assert error.loc[0.5, "3×5"] == pytest.approx(spread / 8)
    with pytest.raises(ValueError, match="measure: expected 'similarity', 'objects' or 'tied', got 'foo'"):
        study.mean("foo")  # type: ignore[arg-type]
    single = noise_study({"3×5": LIFTING}, rng=np.random.default_rng(6), levels=[0.5], n_samples=1)
    assert single.standard_error().isna().all(axis=None)


def test_models_are_learned_without_noise_and_nothing_is_learned_from_nothing_but_noise() -> None:
    study = model_study(
        SEEDS, rng=np.random.default_rng(7), levels=[0, 0.1], n_samples=40, noise=Noise(mode="add only")
    )
    assert (study.mean().loc[0.0] == 100).all()
    assert (study.mean().loc[0.1] > 90).all()
    assert study.rows[:, 0, 0].tolist() == [4, 5, 6, 8]
    assert study.standard_error().isna().all(axis=None)
    several = model_study({"3×5": LIFTING}, rng=np.random.default_rng(7), levels=[0.5], n_samples=10, n_models=5)
    values = several.similarity[0, 0]
    assert several.standard_error().loc[0.5, "3×5"] == pytest.approx(np.std(values, ddof=1) / np.sqrt(5))


def test_shuffling_moves_rows_with_their_pairs() -> None:
    samples = samples_of(SEEDS["6×8"], 0.3, n=20)
    moved = shuffled_rows(samples, rng=np.random.default_rng(0))
    orders = 0
    for before, after in zip(samples, moved, strict=True):
        rows = [dict(zip(map(tuple, c.pairs.tolist()), c.relations.tolist(), strict=True)) for c in (before, after)]
        assert rows[0] == rows[1]
        orders += not np.array_equal(before.pairs, after.pairs)
        assert sl.compare(samples.seed, after).temporal == sl.compare(samples.seed, before).temporal
    assert orders > 15


def test_samples_are_a_sequence_and_read_only() -> None:
    samples = samples_of(LIFTING, 0.5, n=4)
    assert len(samples[1:3]) == 2
    assert np.array_equal(samples[1:3][0].relations, samples[1].relations)
    with pytest.raises(ValueError, match="read-only"):
        samples.relations[0, 0, 0] = 1
    assert LEVELS[0] == 0.0
    assert LEVELS[-1] == 1.0


@pytest.mark.parametrize("p", [-0.1, 1.1, np.nan, np.inf, "0.5", None])
def test_levels_outside_the_range_are_refused(p: Any) -> None:
    with pytest.raises(ValueError, match=r"p: expected a probability from 0 to 1, got"):
        noisy_samples(LIFTING, p, rng=np.random.default_rng(0))
    if isinstance(p, float):
        with pytest.raises(ValueError, match="p: expected a probability"):
            noise_study(SEEDS, rng=np.random.default_rng(0), levels=[0.1, p])


def test_other_bad_input_is_refused() -> None:
    rng = np.random.default_rng(0)
    for n in (0, -3, 2.5, True):
        with pytest.raises(ValueError, match=r"n_samples: expected a whole number of at least 1"):
            noisy_samples(LIFTING, 0.1, n_samples=n, rng=rng)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"seed: expected an event chain with a change"):
        noisy_samples(EventChain([[0, 0]], [(1, 2)]), 0.1, rng=rng)
    with pytest.raises(ValueError, match=r"seed: expected an event chain of at least two columns"):
        noisy_samples(EventChain([[0]], [(1, 2)]), 0.1, rng=rng)
    with pytest.raises(TypeError, match=r"seed: expected an event chain, got list"):
        noisy_samples([], 0.1, rng=rng)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"seeds: expected at least one, got none"):
        noise_study({}, rng=rng)
    with pytest.raises(ValueError, match=r"levels: expected at least one noise level"):
        noise_study(SEEDS, rng=rng, levels=[])
    with pytest.raises(ValueError, match=r"seed: expected relations out of \(0, 2\), got 9 too"):
        noisy_samples(LIFTING, 0.1, rng=rng, noise=Noise(relations=(0, 2)))
    with pytest.raises(ValueError, match=r"relations: expected at least two"):
        Noise(relations=(0,))
    with pytest.raises(ValueError, match=r"mode: expected one of"):
        Noise(mode="both")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"n_samples: expected a whole number of at least 2, got 1"):
        model_study(SEEDS, rng=rng, n_samples=1)
    with pytest.raises(ValueError, match=r"normalizer: expected one of"):
        noise_study(SEEDS, rng=rng, normalizer="both")  # type: ignore[arg-type]
