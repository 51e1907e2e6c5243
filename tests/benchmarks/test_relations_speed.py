"""Scan lines (A.1): the compiled scan against the plain Python twin, on the same images in the same run.

The twin is timed on the hints alone; the compiled scan gives sizes and centres as well.
"""

import time

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.relations import edge_count_relations, scan_line_relations, scan_lines
from tests.naive_relations import naive_hints


def scene(width: int, height: int, n_segments: int) -> NDArray[np.uint8]:
    """Discs and boxes of many sizes on a background, all of them visible."""
    rng = np.random.default_rng(7)
    rows, columns = np.ogrid[:height, :width]
    while True:
        labels = np.zeros((height, width), dtype=np.uint8)
        for label in range(1, n_segments):
            column, row = rng.uniform((0, 0), (width, height))
            radius = rng.uniform(0.04, 0.12) * width
            if label % 2:
                labels[(columns - column) ** 2 + (rows - row) ** 2 <= radius**2] = label
            else:
                labels[(abs(columns - column) <= radius) & (abs(rows - row) <= 0.6 * radius)] = label
        if len(np.unique(labels)) == n_segments:
            return labels


IMAGES = {
    "320x256, 20 segments": scene(320, 256, 20),
    "1280x720, 20 segments": scene(1280, 720, 20),
    "320x256, noise of 20 labels": np.random.default_rng(7).integers(0, 20, (256, 320), dtype=np.uint8),
}


@pytest.mark.parametrize("name", IMAGES)
def test_scan_lines(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], name: str) -> None:
    image = IMAGES[name]
    benchmark.group = f"scan lines, {name}"
    scan_lines(image)
    counts = benchmark(scan_lines, image)
    pixels = image.tolist()
    naive_s = []
    for _ in range(3):
        start = time.perf_counter()
        naive = naive_hints(pixels)
        naive_s.append(time.perf_counter() - start)
    assert counts.touching.sum() == sum(naive.touching.values())
    if benchmark.stats is not None:
        ratio = min(naive_s) / benchmark.stats.stats.min
        benchmark.extra_info["times faster than plain Python"] = round(ratio)
        milliseconds = 1000 * benchmark.stats.stats.median
        with capsys.disabled():
            print(f"\nscan_lines, {name}: {milliseconds:.3f} ms, {ratio:.0f} times faster than plain Python")


@pytest.mark.parametrize("relations", [scan_line_relations, edge_count_relations])
@pytest.mark.parametrize("name", list(IMAGES)[:2])
def test_relations(benchmark: BenchmarkFixture, name: str, relations: object) -> None:
    benchmark.group = f"relations, {name}"
    found = benchmark(relations, IMAGES[name])
    assert len(found.segments) == 20
