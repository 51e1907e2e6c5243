"""Statistics of chapter 3: samples and comparisons a second, against one comparison at a time; the network; models.

No test passes or fails on a time; what is printed are ratios of the same run.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from sklearn.neural_network import MLPRegressor

import sec_lab as sl
from sec_lab.baselines import ThesisNetwork, chain_vectors
from sec_lab.noise import LEVELS, Noise, noisy_samples
from sec_lab.noise_seeds import CLASS_SEEDS, LIFTING, SEEDS
from sec_lab.noise_studies import model_study, noise_study
from sec_lab.opponents import labelled_samples
from sec_lab.roles import corresponding_segments

MODES: dict[str, Noise] = {"flip and add": Noise(), "add only": Noise(mode="add only")}


def seconds(work: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def both_modes(n_samples: int, seeds: Any) -> None:
    for noise in MODES.values():
        noise_study(seeds, rng=np.random.default_rng(0), n_samples=n_samples, noise=noise, n_jobs=2)


def one_by_one(n_samples: int) -> None:
    """The same with what a user would write: one chain, one comparison, one look for roles at a time."""
    rng = np.random.default_rng(0)
    for noise in MODES.values():
        for seed in SEEDS.values():
            for level in LEVELS:
                for sample in noisy_samples(seed, level, n_samples=n_samples, rng=rng, noise=noise):
                    if len(sample.changing_rows):
                        corresponding_segments(sl.compare(seed, sample), on_tie="omit")


def test_figure_3_4_with_samples_and_roles(benchmark: BenchmarkFixture) -> None:
    """8,800 comparisons; the twin does a twentieth of them."""
    benchmark.pedantic(both_modes, args=(100, SEEDS), rounds=5, warmup_rounds=1)
    slow = 20 * seconds(lambda: one_by_one(5))
    fast = benchmark.stats.stats.min if benchmark.stats else seconds(lambda: both_modes(100, SEEDS))
    print(f"\n8,800 comparisons: {fast:.2f} s, one by one {slow:.1f} s, {slow / fast:.0f} times")


def test_ten_thousand_samples_a_point(benchmark: BenchmarkFixture) -> None:
    """Fig. 3.2, 3.4 and 3.5 with 10,000 samples a point: 1.1 million comparisons."""
    n = 100 if benchmark.disabled else 10_000
    benchmark.pedantic(both_modes, args=(n, {"3×5": LIFTING, **SEEDS}), rounds=1, warmup_rounds=0)


@pytest.mark.parametrize("mode", MODES)
def test_hundred_models_a_point(benchmark: BenchmarkFixture, mode: str) -> None:
    """Fig. 3.6 with 100 models of 100 samples a point: 4,400 models."""
    n = 1 if benchmark.disabled else 100

    def learn_all() -> None:
        model_study(SEEDS, rng=np.random.default_rng(0), n_models=n, noise=MODES[mode], n_jobs=2)

    benchmark.pedantic(learn_all, rounds=1, warmup_rounds=0)


def test_training_the_network(benchmark: BenchmarkFixture) -> None:
    """1000 epochs of 400 samples; scikit-learn's network with linear outputs takes the same steps."""
    chains, names = labelled_samples(CLASS_SEEDS, 0.1, rng=np.random.default_rng(0))
    benchmark.pedantic(lambda: ThesisNetwork(random_state=0).fit(chains, names), rounds=3, warmup_rounds=1)
    wanted = np.eye(4)[np.unique(names, return_inverse=True)[1]]
    other = MLPRegressor(
        hidden_layer_sizes=(5, 5),
        activation="logistic",
        solver="sgd",
        momentum=0,
        learning_rate_init=0.05,
        batch_size=1,
        max_iter=10,
        tol=0,
        n_iter_no_change=1000,
    )
    with pytest.warns(match="Maximum iterations"):
        theirs = 100 * seconds(lambda: other.fit(chain_vectors(chains), wanted))
    ours = seconds(lambda: ThesisNetwork(random_state=0).fit(chains, names))
    print(f"\ntraining: {ours:.2f} s, scikit-learn {theirs:.1f} s (10 epochs × 100), {theirs / ours:.0f} times")
