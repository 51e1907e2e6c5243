"""Role tables: of the largest chains, against the slow twin's steps and the thesis's measure in the same run."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.role_tables import role_similarity, role_table, segment_history
from sec_lab.scene_graph import SceneGraph
from sec_lab.similarity import compare
from tests import naive_role_tables as naive

N_SEGMENTS, N_KEY_FRAMES = 25, 57


def crowded() -> EventChain:
    """25 segments in 57 key frames: more than any real recording at hand, and most of them come and go."""
    rng = np.random.default_rng(0)
    pairs = [(i, j) for i in range(1, N_SEGMENTS + 1) for j in range(1, i)]
    relations = rng.choice([0, 0, 0, 2], (len(pairs), N_KEY_FRAMES)).astype(np.uint8)
    present = rng.random((N_SEGMENTS + 1, N_KEY_FRAMES)) > 0.2
    present[3, [0, -1]] = False
    for row, (i, j) in zip(relations, pairs, strict=True):
        row[~(present[i] & present[j])] = 9
    return EventChain(relations, pairs)


def rows_of(chain: EventChain, n: int) -> EventChain:
    changing = chain.changing_rows[:n]
    return EventChain(chain.relations[changing], chain.pairs[changing], chain.key_frames)


def twin(chain: EventChain) -> naive.Movie:
    movie = [naive.Moment(int(number), {}) for number in chain.key_frames]
    for (a, b), row in zip(chain.pairs.tolist(), chain.relations.tolist(), strict=True):
        for moment, code in zip(movie, row, strict=True):
            if code != 9:
                moment.places |= {a: (0.0,), b: (0.0,)}
            if code not in (0, 9):
                moment.touch[frozenset((a, b))] = code
    return movie


def seconds(function: Callable[[], object], *, repeats: int) -> float:
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        taken.append(time.perf_counter() - start)
    return min(taken)


@pytest.mark.parametrize("what", ["25 rows", "25 segments"])
def test_role_table_of_a_25_by_57_chain(benchmark: BenchmarkFixture, what: str) -> None:
    """Asked for: at most 1 ms. "25×57" may mean 25 rows or 25 segments (300 rows); both are measured."""
    chain = crowded() if what == "25 segments" else rows_of(crowded(), 25)
    benchmark(role_table, chain)
    ours = seconds(lambda: role_table(chain), repeats=30)
    movie = twin(chain)
    slow = seconds(lambda: naive.bridge(movie), repeats=3)
    print(f"\n{what}: {1e3 * ours:.2f} ms; one step of the plain Python twin takes {slow / ours:.0f} times as long")


def test_similarity_of_role_tables(benchmark: BenchmarkFixture) -> None:
    chain = rows_of(crowded(), 25)
    other = EventChain(chain.relations[:, ::-1], chain.pairs)
    a, b = role_table(chain), role_table(other)
    benchmark(role_similarity, a, b)
    ours = seconds(lambda: role_similarity(a, b), repeats=30)
    thesis = seconds(lambda: compare(chain, other), repeats=1)
    print(f"\n{1e6 * ours:.0f} µs a pair; the thesis's measure on the chains takes {thesis / ours:.0f} times as long")


def test_history_of_an_observation(benchmark: BenchmarkFixture) -> None:
    rng = np.random.default_rng(0)
    graphs = []
    for _ in range(N_KEY_FRAMES):
        codes = np.triu(rng.choice([0, 0, 0, 2], (N_SEGMENTS, N_SEGMENTS)), k=1)
        graphs.append(SceneGraph(range(N_SEGMENTS), codes + codes.T, rng.random((N_SEGMENTS, 3))))
    seen = Observation(graphs, range(N_KEY_FRAMES), None, "m")
    benchmark(segment_history, seen)
