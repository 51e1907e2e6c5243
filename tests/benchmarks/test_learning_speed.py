"""Learning (§2.9): chains a second, cost against the number of chains, and beside learning online."""

import time
import timeit
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy import stats

from sec_lab import viz
from sec_lab.event_chain import EventChain
from sec_lab.learning import OnlineLearner, learn
from tests import noisy_chains

SIZE = (8, 8)
FIGURE = Path(__file__).parents[2] / "build" / "learning_speed.png"


def chains(n: int, *, p: float = 0.1) -> list[EventChain]:
    """Chains of exactly 8×8 with a tenth of their entries flipped."""
    rng = np.random.default_rng(5)
    rows = noisy_chains.seed(*SIZE, rng)
    pairs = [(2 * i, 2 * i + 1) for i in range(SIZE[0])]
    flipped = [np.where(rng.random(SIZE) < p, rng.choice(noisy_chains.RELATIONS, SIZE), rows) for _ in range(1000)]
    few = [EventChain(one, pairs) for one in flipped if (one != one[:, :1]).any()]
    return [few[i % len(few)] for i in range(n)]


@pytest.mark.parametrize("n", [1000, 4000, 16_000])
def test_chains_a_second(benchmark: BenchmarkFixture, n: int) -> None:
    """≥ 20,000 8×8 chains a second, linear in their number: the same figure for every n."""
    given = chains(n)
    learn(given[:10])
    model = benchmark.pedantic(learn, (given,), rounds=3)
    assert model.chain.relations.shape == SIZE
    if benchmark.stats:
        started = time.process_time()
        learn(given)
        processor = n / (time.process_time() - started)
        rate = n / benchmark.stats.stats.min
        print(f"\n{n:>6} chains: {rate:,.0f} chains/s, {processor:,.0f} a second of one processor")


def test_cost_is_linear(benchmark: BenchmarkFixture) -> None:
    """Processor time, least of three, against the number of chains, a line through it, and a picture in ``build/``."""
    numbers = [2000, 4000, 8000, 16_000, 32_000]
    given = chains(numbers[-1])
    learn(given[:10])

    def best_times() -> list[float]:
        return [
            min(timeit.repeat(lambda n=n: learn(given[:n]), timer=time.process_time, number=1, repeat=3))
            for n in numbers
        ]

    if not benchmark.enabled:
        numbers = numbers[:1]
    times = benchmark.pedantic(best_times, rounds=1)
    assert len(times) == len(numbers)
    if benchmark.stats:
        line = stats.linregress(numbers, times)
        table = pd.DataFrame({"measured": times}, index=pd.Index(numbers, name="chains of 8×8"))
        table["line"] = line.intercept + line.slope * table.index
        for n, seconds in table["measured"].items():
            print(f"\n{n:>6} chains: {seconds:.3f} s of one processor, {n / seconds:,.0f} chains/s", end="")
        print(f"\nline: {line.intercept:.3f} s and 1 s for {1 / line.slope:,.0f} chains, R² = {line.rvalue**2:.4f}")
        FIGURE.parent.mkdir(parents=True, exist_ok=True)
        viz.draw_curves(table, y_label="processor time, in s").figure.savefig(FIGURE)


def test_batch_beside_online(benchmark: BenchmarkFixture) -> None:
    """The same demonstrations online, one after the other, in the same run."""
    given = chains(1000)
    learn(given[:10])
    benchmark.pedantic(learn, (given,), rounds=3)
    if benchmark.stats:
        learner = OnlineLearner()
        started = time.perf_counter()
        for chain in given:
            learner.add(chain)
        seconds = time.perf_counter() - started
        print(f"\nbatch is {seconds / benchmark.stats.stats.min:.1f} times as fast as online ({seconds:.2f} s)")
