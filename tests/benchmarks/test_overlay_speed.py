"""The overlay movie at 320×256: how many frames a second are drawn, and drawn and encoded."""

from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.observation import Observation
from sec_lab.pipeline import observe_segments
from sec_lab.recording import Recording, write_movie
from sec_lab.segmentation import Segmentation
from sec_lab.viz.overlay import overlay_frames

N = 100


def scene() -> tuple[Observation, Recording]:
    """Six boxes on a table, one of which goes from one to the next."""
    rng = np.random.default_rng(7)
    labels = np.ones((N, 256, 320), dtype=np.uint8)
    for label in range(2, 7):
        labels[:, 60 + 20 * (label % 3) :, 20 + 50 * (label - 2) :][:, :40, :40] = label
    for number, image in enumerate(labels):
        image[80:120, 2 * number :][:, :50] = 7
    pictures = (40 * labels[..., None] % 200 + rng.integers(0, 20, (N, 256, 320, 3))).astype(np.uint8)
    names = {label: f"box {label}" for label in range(2, 7)}
    seen = observe_segments(Segmentation.from_labels(labels, background=1, names=names))
    return seen, Recording.from_frames(pictures, frames_per_second=25)


@pytest.mark.parametrize("what", ["drawn", "drawn and encoded"])
def test_overlay(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], tmp_path: Path, what: str) -> None:
    benchmark.group = "overlay movie, 320x256"
    seen, recording = scene()

    def draw() -> int:
        return sum(1 for _ in overlay_frames(seen, recording))

    def write() -> int:
        frames = overlay_frames(seen, recording)
        write_movie(tmp_path / "overlay.mp4", frames, frames_per_second=25, crf=20, preset="veryfast")
        return N

    assert benchmark.pedantic(draw if what == "drawn" else write, rounds=3, warmup_rounds=1) == N
    if benchmark.stats is not None:
        rate = N / benchmark.stats.stats.min
        benchmark.extra_info["frames a second"] = round(rate)
        with capsys.disabled():
            print(f"\noverlay, {what}: {rate:.0f} frames a second")
