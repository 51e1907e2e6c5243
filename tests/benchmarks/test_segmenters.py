"""Segmenters of other libraries on the same frames, their labels linked from frame to frame, beside ours.

Each of the others is given the setting that is best on a few frames of each setting *by the truth*, which ours is not.
Times are of one process, decoded frames in memory; linking is not counted.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import ArrayLike
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.segmentation.quality import covering, quality
from tests.benchmarks import ours
from tests.benchmarks.competitors import COMPETITORS, HAS_GRAPH_SEGMENTATION, Method, linked
from tests.benchmarks.movies import Movie, Source, drawn

MOST_MOVIES = 8
"""The others take up to half a second a frame."""

TRIED_FRAMES = 3
"""Frames of a movie on which settings are tried."""

OURS = "sec_lab"


@dataclass(frozen=True)
class Result:
    """Of one segmenter in one movie."""

    milliseconds: float
    covering: float
    kept: float
    n_labels: int


def judged(movie: Movie, labels: Sequence[ArrayLike], seconds: float) -> Result:
    found = quality(labels, movie.labels, background=movie.background)
    return Result(1000 * seconds / len(movie.labels), found.covering, found.kept, found.n_labels)


def result_of(movie: Movie, method: Method) -> Result:
    start = time.perf_counter()
    single = [method(picture) for picture in movie.pictures]
    seconds = time.perf_counter() - start
    return judged(movie, list(linked(single)), seconds)


def our_result(movie: Movie) -> Result:
    recording = movie.left
    start = time.perf_counter()
    labels = [image.copy() for image in ours.segmentation_of(recording)]
    return judged(movie, labels, time.perf_counter() - start)


def best_by_truth(methods: Sequence[Method], sources: Sequence[Source]) -> Method:
    """The setting with the largest covering on a few frames of these movies."""
    sums = np.zeros(len(methods))
    for source in sources:
        movie = source.open()
        for frame in np.linspace(0, len(movie.labels) - 1, TRIED_FRAMES, dtype=int):
            sums += [covering(method(movie.pictures[frame]), movie.labels[frame]) for method in methods]
    return methods[int(sums.argmax())]


def compared(
    sources: Sequence[Source], competitors: Mapping[str, Sequence[Method]]
) -> tuple[dict[str, dict[str, Result]], list[str]]:
    """Results by movie and segmenter, and what was chosen for each setting."""
    results: dict[str, dict[str, Result]] = {}
    chosen: list[str] = []
    for setting in dict.fromkeys(source.setting for source in sources):
        of_setting = [source for source in sources if source.setting == setting]
        methods = {name: best_by_truth(variants, of_setting) for name, variants in competitors.items()}
        chosen.append(f"{setting}: {', '.join(f'{name} {_options(method)}' for name, method in methods.items())}")
        for source in of_setting:
            movie = source.open()
            results[source.name] = {name: result_of(movie, method) for name, method in methods.items()}
            if ours.READY:
                results[source.name][OURS] = our_result(movie)
    return results, chosen


def _options(method: Method) -> str:
    options = getattr(method, "keywords", {})
    return "(" + ", ".join(f"{name} {value}" for name, value in options.items()) + ")"


def table(results: dict[str, dict[str, Result]]) -> str:
    names = list(next(iter(results.values())))
    lines = ["", f"{'':40}" + "".join(f" | {name:^29}" for name in names)]
    lines.append(f"{'movie':40}" + " | ms/frame cover.  kept  labels" * len(names))
    lines += [_line(movie, [of_movie[name] for name in names]) for movie, of_movie in results.items()]
    means = [_mean([of_movie[name] for of_movie in results.values()]) for name in names]
    lines.append(_line(f"mean of {len(results)} movies", means))
    if OURS in names:
        others = [mean for name, mean in zip(names, means, strict=True) if name != OURS]
        mine = means[names.index(OURS)]
        lines.append(
            f"{OURS}: {min(other.milliseconds for other in others) / mine.milliseconds:.1f} times faster than the "
            f"fastest of them (to be reached: 10), covering {mine.covering:.3f} against at most "
            f"{max(other.covering for other in others):.3f} (at least as good)"
        )
    return "\n".join(lines)


def _line(name: str, results: Sequence[Result]) -> str:
    cells = (f" | {r.milliseconds:8.1f} {r.covering:6.3f} {r.kept:5.3f} {r.n_labels:7.0f}" for r in results)
    return f"{name:40}" + "".join(cells)


def _mean(results: Sequence[Result]) -> Result:
    rows = [(r.milliseconds, r.covering, r.kept, r.n_labels) for r in results]
    return Result(*np.mean(rows, axis=0).tolist())


def test_other_segmenters(
    benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], sources: list[Source]
) -> None:
    benchmark.group = "segmenters of others"
    competitors = {name: variants[:1] if benchmark.disabled else variants for name, variants in COMPETITORS.items()}
    taken = sources[: 1 if benchmark.disabled else MOST_MOVIES]
    results, chosen = benchmark.pedantic(compared, args=(taken, competitors), rounds=1)
    assert all(0 < result.covering <= 1 for of_movie in results.values() for result in of_movie.values())
    if benchmark.stats is not None:
        with capsys.disabled():
            print(table(results))
            print("settings chosen by the truth: " + "; ".join(chosen))
            if not HAS_GRAPH_SEGMENTATION:
                print("OpenCV's GraphSegmentation is not in this build (no cv2.ximgproc); mean shift is OpenCV's")
            if not ours.READY:
                print("ours is not there yet")


@pytest.mark.parametrize("name", COMPETITORS)
def test_each_finds_the_shapes_of_a_drawn_movie(name: str) -> None:
    movie = drawn()[0].open()
    assert result_of(movie, COMPETITORS[name][0]).covering > 0.8


def test_linking_keeps_labels_and_gives_new_ones() -> None:
    first = np.array([[0, 0, 0, 1, 1, 1, 2, 2]])
    # Other numbers; 1 has shrunk to two of its three pixels, what was 2 is split, and its halves overlap it by 1/2.
    second = np.array([[5, 5, 5, 5, 4, 4, 9, 8]])
    images = list(linked([first, second, second]))
    assert [image.tolist() for image in images[:2]] == [[[0, 0, 0, 1, 1, 1, 2, 2]], [[0, 0, 0, 0, 1, 1, 3, 2]]]
    assert (images[2] == images[1]).all()
    # Without enough overlap nothing is taken over.
    far = list(linked([first, second], least_iou=0.9))[1]
    assert sorted(np.unique(far)) == [3, 4, 5, 6]
