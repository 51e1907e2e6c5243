"""Disparity: the stream at 320×256 against OpenCV's matcher alone, on the same pictures in the same run."""

import time
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.segmentation.disparity import dense_disparity
from sec_lab.segmentation.disparity_stream import DisparityEstimator
from sec_lab.segmentation.phase_disparity import phase_disparity

Picture = NDArray[np.uint8]


def table(n: int, width: int = 320, height: int = 256) -> list[tuple[Picture, Picture]]:
    """Noisy pairs of a table that recedes from 80 px of disparity to 44, as in a movie."""
    rng = np.random.default_rng(4)
    wood = cv2.GaussianBlur(rng.uniform(0, 255, (height, width + 120)).astype(np.float32), (0, 0), 1.2)
    wood = 128 + 3 * (wood - 128)
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    sides = [wood[:, :width], cv2.remap(wood, columns + 44 + 36 * rows / height, rows, cv2.INTER_CUBIC)]
    return [
        tuple(np.clip(side + rng.normal(0, 2, side.shape), 0, 255).astype(np.uint8) for side in sides) for _ in range(n)
    ]  # type: ignore[return-value]


def whole_range(left: Picture, right: Picture) -> NDArray[np.int16]:
    """OpenCV's matcher where nothing is known: half of the width is searched, with a margin for the first columns."""
    matcher = cv2.StereoSGBM.create(minDisparity=0, numDisparities=160, blockSize=5, P1=200, P2=800, disp12MaxDiff=1)
    sides = [cv2.copyMakeBorder(side, 0, 0, 160, 0, cv2.BORDER_REPLICATE) for side in (left, right)]
    return np.asarray(matcher.compute(*sides))


def median_s(run: Callable[[Picture, Picture], object], frames: list[tuple[Picture, Picture]]) -> float:
    spent = []
    for frame in frames:
        start = time.perf_counter()
        run(*frame)
        spent.append(time.perf_counter() - start)
    return float(np.median(spent))


@pytest.mark.parametrize("reduction", [1, 2])
def test_stream(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], reduction: int) -> None:
    frames = table(20)
    benchmark.group = "disparity of a stream, 320x256"
    estimator = DisparityEstimator(reduction=reduction)
    estimator(*frames[0])
    cycle = iter(frames * 1000)
    found = benchmark(lambda: estimator(*next(cycle)))
    truth = 44 + 36 * np.arange(256) / 256
    missed = np.abs(found - truth[:, None])
    if benchmark.stats is not None:
        ratio = median_s(whole_range, frames) / benchmark.stats.stats.median
        benchmark.extra_info["times faster than SGBM over the whole range"] = round(ratio, 1)
        first_ms = 1000 * median_s(lambda left, right: DisparityEstimator(reduction=reduction)(left, right), frames[:5])
        with capsys.disabled():
            print(
                f"\ndisparity of a stream, 320x256, reduction {reduction}: "
                f"{1000 * benchmark.stats.stats.median:.1f} ms a frame, "
                f"first frame {first_ms:.1f} ms, {ratio:.1f} times faster than SGBM over the whole range, "
                f"median error {np.median(missed):.2f} px"
            )
    assert np.median(missed) < 0.25


@pytest.mark.parametrize("method", [dense_disparity, phase_disparity])
def test_one_pair(benchmark: BenchmarkFixture, method: Callable[[Picture, Picture], NDArray[np.float32]]) -> None:
    (frame,) = table(1)
    benchmark.group = "disparity of one pair, 320x256"
    found = benchmark(method, *frame)
    truth = 44 + 36 * np.arange(256) / 256
    assert np.nanmedian(np.abs(found - truth[:, None])) < 0.25
