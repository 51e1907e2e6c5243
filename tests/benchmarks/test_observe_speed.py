"""observe() from decoded frames to the chain: the default with its layers, with and without depth from stereo.

Beside it, on the same frames in the same run, plain Potts tracking and scikit-image's felzenszwalb of every frame by
itself (which neither tracks nor relates).
"""

import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.pipeline import observe
from sec_lab.recording import Recording, read_calibration

FOLDER = Path("datasets/tabletop_actions")
MOVIE = "moving_object_1_laboratory"
LEAST = {"left eye": 150, "stereo": 60}


@cache
def frames() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Decoded pictures of both eyes."""
    return tuple(  # type: ignore[return-value]
        np.stack([frame.image for frame in Recording.open(FOLDER / MOVIE / f"{eye}.mp4")]) for eye in ("left", "right")
    )


def recording(eyes: str) -> Recording:
    left, right = frames()
    if eyes == "left eye":
        return Recording.from_frames(left)
    calibration = read_calibration(FOLDER / MOVIE / "calibration.json")
    return Recording.from_frames(left, right=right, calibration=calibration)


@pytest.mark.parametrize("eyes", LEAST)
def test_observe(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], eyes: str) -> None:
    from skimage.segmentation import felzenszwalb

    movie = recording(eyes)
    benchmark.group = "observe() at 320x256"
    seen = benchmark.pedantic(lambda: observe(movie), rounds=3, warmup_rounds=1)
    assert seen.chain.relations.size
    if benchmark.stats is None:
        return
    n = len(frames()[0])
    ours = benchmark.stats.stats.min / n
    start = time.perf_counter()
    observe(recording("left eye"), segmentation="potts")
    potts = (time.perf_counter() - start) / n
    start = time.perf_counter()
    for image in frames()[0][::20]:
        felzenszwalb(image, scale=300, sigma=0.8, min_size=60)
    other = (time.perf_counter() - start) / len(frames()[0][::20])
    with capsys.disabled():
        print(
            f"\nobserve(), {eyes}: {1 / ours:.0f} frames/s (asked: {LEAST[eyes]}); plain Potts {1 / potts:.0f}; "
            f"felzenszwalb alone {1 / other:.0f}, ours is {other / ours:.1f} times as fast"
        )
