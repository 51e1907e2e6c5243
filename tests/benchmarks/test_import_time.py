"""What it costs to begin: ``import sec_lab`` in a fresh interpreter, and the first use of what is behind it."""

import statistics
import subprocess
import sys

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

STATEMENTS = {
    "import sec_lab": "import sec_lab",
    "first event chain": "import sec_lab; sec_lab.EventChain([[0, 2]], [(1, 2)])",
    "first comparison": "import sec_lab as sl; chain = sl.EventChain([[0, 2]], [(1, 2)]); sl.compare(chain, chain)",
}


def seconds_in_fresh_interpreter(statement: str) -> float:
    """Time for the statement alone, without the start of the interpreter."""
    code = f"import time; start = time.perf_counter(); {statement}; print(time.perf_counter() - start)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return float(done.stdout)


@pytest.mark.parametrize("name", STATEMENTS)
def test_start(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], name: str) -> None:
    benchmark.group = "fresh interpreter, its own start included"
    spent: list[float] = []
    benchmark.pedantic(lambda: spent.append(seconds_in_fresh_interpreter(STATEMENTS[name])), rounds=5, warmup_rounds=1)
    assert min(spent) > 0
    if benchmark.stats is not None:
        with capsys.disabled():
            print(f"\n{name}: {statistics.median(spent):.3f} s (least {min(spent):.3f} s)")
