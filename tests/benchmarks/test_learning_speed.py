"""Learning (§2.9): chains a second, cost against the number of chains, and beside learning online."""

import time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.event_chain import EventChain
from sec_lab.learning import OnlineLearner, learn
from tests import noisy_chains

SIZE = (8, 8)


def chains(n: int, *, p: float = 0.1) -> list[EventChain]:
    """Chains of exactly 8×8 with a tenth of their entries flipped."""
    rng = np.random.default_rng(5)
    rows = noisy_chains.seed(*SIZE, rng)
    pairs = [(2 * i, 2 * i + 1) for i in range(SIZE[0])]
    flipped = [np.where(rng.random(SIZE) < p, rng.choice(noisy_chains.RELATIONS, SIZE), rows) for _ in range(1000)]
    few = [EventChain(one, pairs) for one in flipped if (one != one[:, :1]).any()]
    return [few[i % len(few)] for i in range(n)]


@pytest.mark.parametrize("n", [1000, 4000, 16_000, 64_000])
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
