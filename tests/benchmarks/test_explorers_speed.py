"""One move of an explorer's control: drawn as SVG, against the same drawn by matplotlib as a picture."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab import viz
from sec_lab.noise import noisy_samples
from sec_lab.noise_seeds import SEEDS
from sec_lab.similarity import compare, similarity_table
from sec_lab.viz.style import figure_of, png_bytes
from sec_lab.viz.svg.match import match_svg, row_similarity_svg
from sec_lab.viz.svg.table import table_layout, table_svg

MEDIANS: dict[str, dict[str, float]] = {}


def drawings() -> dict[str, dict[str, Callable[[], object]]]:
    seed, rng = SEEDS["8×8"], np.random.default_rng(5)
    samples = list(noisy_samples(seed, 0.1, n_samples=20, rng=rng))
    match = compare(seed, samples[0])
    table: pd.DataFrame = similarity_table({f"sample {i}": chain for i, chain in enumerate(samples)})
    classes = [str(i % 4) for i in range(len(table))]
    layout = table_layout(table, classes)

    def table_picture() -> bytes:
        return png_bytes(figure_of(viz.draw_similarity_table(table, classes=classes)))

    return {
        "match": {
            "SVG": lambda: match_svg(match) + row_similarity_svg(match),
            "matplotlib": lambda: png_bytes(viz.draw_match(match)),
        },
        "table of 20": {"SVG": lambda: table_svg(layout, threshold_percent=64), "matplotlib": table_picture},
    }


@pytest.mark.parametrize("what", ["match", "table of 20"])
@pytest.mark.parametrize("way", ["matplotlib", "SVG"])
def test_drawing_of_a_move(
    benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], what: str, way: str
) -> None:
    benchmark.group = f"move of an explorer: {what}"
    assert benchmark.pedantic(drawings()[what][way], rounds=5, warmup_rounds=1)
    if benchmark.stats is not None:
        of = MEDIANS.setdefault(what, {})
        of[way] = benchmark.stats.stats.median
        if len(of) == 2:
            with capsys.disabled():
                slow, fast = 1000 * of["matplotlib"], 1000 * of["SVG"]
                print(f"\n{what}: matplotlib {slow:.0f} ms, SVG {fast:.1f} ms, {slow / fast:.0f} times as fast")
