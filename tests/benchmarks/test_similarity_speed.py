"""The similarity measure (§2.6): pairs a second, cost against the number of chains, and what the two steps save.

A pair is an unordered pair of chains, each chain with itself included; both directions of it, ψ_spatial and
ψ_temporal, come out of one comparison. The plain Python twin computes one direction of the same, in the same run.
Where few rows of long chains differ, the permutations are too many for it: such pairs are left out and counted.
"""

import math
import os
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

import sec_lab as sl
from sec_lab.event_chain import EventChain
from sec_lab.files import write_whole
from sec_lab.similarity import compare, pairwise_similarity, similarity_table
from sec_lab.viz import draw_curves
from sec_lab.viz.style import figure_of, png_bytes
from tests.naive_similarity import Table, all_permutations_similarity, naive_compare

FOLDER = Path(os.environ.get("SEC_LAB_DATA") or "/nonexistent") / "maniac"
BUILD = Path(__file__).parents[2] / "build" / "bench"
TWIN_PERMUTATIONS = 1000
TWIN_SECONDS = 2.0


def uniform(rng: np.random.Generator, n_rows: int, n_columns: int) -> NDArray[np.int64]:
    """Random relations."""
    return rng.choice((0, 1, 2, 9), (n_rows, n_columns))


def events(
    rng: np.random.Generator, n_rows: int, n_columns: int, codes: tuple[int, ...] = (0, 1, 2, 9)
) -> NDArray[np.int64]:
    """From each column to the next one or two rows change, as in recorded chains."""
    table = np.repeat(rng.choice(codes, (n_rows, 1)), n_columns, axis=1)
    for column in range(1, n_columns):
        for row in rng.choice(n_rows, rng.integers(1, 3), replace=False):
            table[row, column:] = rng.choice([code for code in codes if code != table[row, column]])
    return table


def binary_events(rng: np.random.Generator, n_rows: int, n_columns: int) -> NDArray[np.int64]:
    """Events between two relations only, as in the tables of chapter 4."""
    return events(rng, n_rows, n_columns, (0, 2))


Maker = Callable[[np.random.Generator, int, int], NDArray[np.int64]]


def chain_of(table: NDArray[np.int64] | Table) -> EventChain:
    return EventChain(table, [(i + 2, 1) for i in range(len(table))])


def drawn(make: Maker, n_rows: int, n_columns: int, n: int, *, seed: int = 7) -> list[EventChain]:
    """Chains in which every row changes."""
    rng = np.random.default_rng(seed)
    chains: list[EventChain] = []
    while len(chains) < n:
        table = make(rng, n_rows, n_columns)
        if (table != table[:, :1]).any(axis=1).all():
            chains.append(chain_of(table))
    return chains


def n_pairs(n: int) -> int:
    return n * (n + 1) // 2


def warm() -> None:
    """Load the compiled kernels, so that this is not timed."""
    similarity_table(drawn(uniform, 3, 3, 2))


def naive_pairs_per_second(chains: list[EventChain], *, seconds: float, permutations: int) -> tuple[float, int, int]:
    """Speed of the twin on pairs drawn at random, which must agree; and how many of them were taken and left out."""
    rng = np.random.default_rng(7)
    spent, taken, left_out = 0.0, 0, 0
    while spent < seconds and left_out < 100:
        a, b = (chains[i] for i in rng.choice(len(chains), 2, replace=False))
        match = compare(a, b)
        if math.prod(max(1, int(n)) for n in match.candidates.sum(axis=1)) > permutations:
            left_out += 1
            continue
        tables = a.relations.tolist(), b.relations.tolist()
        start = time.perf_counter()
        naive = naive_compare(*tables, partial=False)
        spent += time.perf_counter() - start
        taken += 1
        assert match.spatial == pytest.approx(float(naive.spatial))
        assert match.temporal <= float(naive.temporal) + 1e-9
        if match.exact:
            assert match.temporal == pytest.approx(float(naive.temporal))
    return taken / spent if taken else math.nan, taken, left_out


SIZES = [(5, 6, 1000), (8, 8, 500), (25, 57, 100)]


@pytest.mark.parametrize("make", [uniform, events, binary_events])
@pytest.mark.parametrize(("n_rows", "n_columns", "n"), SIZES)
def test_pairs_per_second(
    benchmark: BenchmarkFixture,
    capsys: pytest.CaptureFixture[str],
    make: Maker,
    n_rows: int,
    n_columns: int,
    n: int,
) -> None:
    benchmark.group = f"similarity_table, {n_rows}x{n_columns} chains"
    n = 8 if benchmark.disabled else n
    chains = drawn(make, n_rows, n_columns, n)
    warm()
    table = benchmark.pedantic(similarity_table, args=(chains,), rounds=5, warmup_rounds=1)
    assert (np.diag(table) == 100).all()
    seconds, permutations = (0.05, 20) if benchmark.disabled else (TWIN_SECONDS, TWIN_PERMUTATIONS)
    naive, taken, left_out = naive_pairs_per_second(chains, seconds=seconds, permutations=permutations)
    assert taken + left_out
    if benchmark.stats is not None:
        speed = n_pairs(n) / benchmark.stats.stats.median
        twin = f"{naive:,.1f} pairs/s in plain Python, {speed / naive:,.0f} times" if taken else "none for plain Python"
        with capsys.disabled():
            print(
                f"\n{n_rows}x{n_columns} {make.__name__}, {n} chains: {speed:,.0f} pairs/s, "
                f"{table.attrs['exact_percent']:.1f} % proven; {twin} ({taken} pairs, {left_out} left out)"
            )


@pytest.mark.parametrize("n", [1000, 5000])
def test_table_of_many_chains(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], n: int) -> None:
    benchmark.group = "similarity_table, many 5x6 chains"
    n = 40 if benchmark.disabled else n
    chains = drawn(uniform, 5, 6, n)
    warm()
    table = benchmark.pedantic(similarity_table, args=(chains,), rounds=3 if n <= 1000 else 1)
    assert table.shape == (n, n)
    if benchmark.stats is not None:
        tracemalloc.start()
        similarity_table(chains)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        with capsys.disabled():
            print(
                f"\nsimilarity_table of {n} 5x6 chains: {benchmark.stats.stats.median:.2f} s, "
                f"at most {peak / 2**20:.0f} MiB, of which the table is {8 * n * n / 2**20:.0f}"
            )


def test_cost_against_the_number_of_chains(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str]) -> None:
    benchmark.group = "similarity_table, 100 to 2000 5x6 chains"
    numbers = [5, 10, 20] if benchmark.disabled else [100, 200, 500, 1000, 2000]
    chains = drawn(uniform, 5, 6, numbers[-1])
    warm()

    def seconds() -> list[float]:
        fastest = []
        for n in numbers:
            runs = []
            for _ in range(3):
                start = time.perf_counter()
                similarity_table(chains[:n])
                runs.append(time.perf_counter() - start)
            fastest.append(min(runs))
        return fastest

    spent = benchmark.pedantic(seconds, rounds=1)
    assert len(spent) == len(numbers)
    if benchmark.stats is not None:
        exponent = np.polyfit(np.log(numbers), np.log(spent), 1)[0]
        with capsys.disabled():
            print("\n     N       s   pairs/s")
            for n, s in zip(numbers, spent, strict=True):
                print(f"{n:6} {s:7.3f} {n_pairs(n) / s:9,.0f}")
            print(f"time grows as N to the power of {exponent:.2f}")
            print(f"drawn in {draw_cost(numbers, spent)}")


def draw_cost(numbers: list[int], seconds: list[float]) -> Path:
    """Draw seconds against the number of chains, with a line that grows as its square."""
    quadratic = seconds[-1] * (np.array(numbers) / numbers[-1]) ** 2
    curves = {"similarity_table": seconds, "N², through the last point": quadratic}
    frame = pd.DataFrame(curves, index=pd.Index(numbers, name="number of chains N"))
    axes = draw_curves(frame, y_label="seconds", x_scale="log", y_scale="log", title="All pairs of N 5×6 chains")
    BUILD.mkdir(parents=True, exist_ok=True)
    path = BUILD / "cost_against_n.png"
    write_whole(path, png_bytes(figure_of(axes)))
    return path.relative_to(BUILD.parents[1])


def test_two_steps_against_all_permutations(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str]) -> None:
    """Last paragraph of §2.6.2: what the spatial step saves, both searches in the same plain Python."""
    benchmark.group = "two steps against all n! permutations"
    rows = [3, 4] if benchmark.disabled else range(3, 9)
    warm()

    def measure() -> list[str]:
        return [
            f"{n:4} {math.factorial(n):8,} {kind:9} {two_steps_and_all(n, kind)}"
            for n in rows
            for kind in ("version", "unrelated")
        ]

    lines = benchmark.pedantic(measure, rounds=1)
    assert len(lines) == 2 * len(rows)
    if benchmark.stats is not None:
        with capsys.disabled():
            print("\nrows       n! pair      left     all s  two steps s   ratio  compiled s  points lost")
            print("\n".join(lines))


def two_steps_and_all(n: int, kind: str) -> str:
    """Means over some pairs of n x 6 chains: permutations left, times, and what the spatial step misses."""
    rng = np.random.default_rng(n)
    n_tried = max(1, min(20, 10_000 // math.factorial(n)))
    left, lost = 0, 0.0
    spent = np.zeros(3)
    for a in drawn(uniform, n, 6, n_tried, seed=n):
        if kind == "version":
            flips = rng.random(a.relations.shape) < 0.1
            b = chain_of(np.where(flips, uniform(rng, *a.relations.shape), a.relations)[rng.permutation(n)])
        else:
            b = drawn(uniform, n, 6, 1, seed=int(rng.integers(2**32)))[0]
        tables = a.relations.tolist(), b.relations.tolist()
        starts = [time.perf_counter()]
        best, n_permutations = all_permutations_similarity(*tables)
        starts.append(time.perf_counter())
        naive = naive_compare(*tables, partial=False)
        starts.append(time.perf_counter())
        match = compare(a, b)
        starts.append(time.perf_counter())
        assert n_permutations <= math.factorial(n)
        assert match.temporal == pytest.approx(float(naive.temporal))
        assert naive.temporal <= best
        left += naive.n_assignments
        lost += float(best - naive.temporal)
        spent += np.diff(starts)
    everything, two_steps, compiled = spent / n_tried
    return (
        f"{left / n_tried:7.1f} {everything:9.4f} {two_steps:12.5f} {everything / two_steps:7.1f} {compiled:11.6f} "
        f"{lost / n_tried:12.1f}"
    )


@pytest.mark.skipif(not FOLDER.is_dir(), reason="SEC_LAB_DATA is not set to the folder of the recordings")
@pytest.mark.parametrize(("normalizer", "tolerance_percent"), [("longer", 0), ("shorter", 20)])
def test_real_recordings(
    benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], normalizer: str, tolerance_percent: float
) -> None:
    benchmark.group = "similarity_table, 80 real recordings"
    chains = [observation.chain for observation in sl.graphml.read_collection(FOLDER).values()]
    assert len(chains) == 80
    chains = chains[::10] if benchmark.disabled else chains
    warm()
    options = {"normalizer": normalizer, "tolerance_percent": tolerance_percent}
    result = benchmark.pedantic(pairwise_similarity, args=(chains,), kwargs=options, rounds=3)
    assert (np.diag(result.temporal) == 100).all()
    if benchmark.stats is not None:
        proven = 100 * result.exact[np.triu_indices(len(chains), k=1)].mean()
        seconds = benchmark.stats.stats.median
        with capsys.disabled():
            print(
                f"\n{len(chains)} recordings, {normalizer} row divides, tolerance {tolerance_percent}: "
                f"{seconds:.2f} s, {n_pairs(len(chains)) / seconds:,.0f} pairs/s, {proven:.1f} % proven"
            )
