"""Learning from movies of putting and taking (§2.9), held against the aims: classes, models, begins and ends.

``--seeds 11,12`` renders movies of these seeds and observes them; the kept chains are taken otherwise. The first six
movies of a seed are the fewest from which something can be learned: ``--movies`` takes at least so many.
"""

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tests.benchmarks.put_and_take import Seen, figures


def test_learned_and_found(
    benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], put_and_take: dict[str, Seen]
) -> None:
    benchmark.group = "putting and taking, learned and found"

    def judged() -> dict[str, str]:
        return {
            f"{name}, from {source}": str(figures(chains, seen.deeds))
            for name, seen in put_and_take.items()
            for source, chains in seen.chains.items()
            if sum(movie.startswith("putting") for movie in chains) > 1 < sum(m.startswith("taking") for m in chains)
        }

    lines = benchmark.pedantic(judged, rounds=1)
    assert lines
    if benchmark.stats is not None:
        with capsys.disabled():
            print()
            for name, line in lines.items():
                print(f"{name}: {line}")
