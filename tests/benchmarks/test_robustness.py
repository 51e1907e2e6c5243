"""Where the segmentation breaks: movies made worse step by step, and what is left of its quality.

Left eye only. Texture is painted on the table, where it rests; what is made worse is in ``sec_lab.worlds.degrade``.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import ArrayLike
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.files import write_whole
from sec_lab.recording import Recording
from sec_lab.segmentation.quality import Quality, quality
from sec_lab.viz import draw_curves
from sec_lab.viz.style import PAGE_WIDTH_IN, new_figure, png_bytes
from sec_lab.worlds.degrade import Degradation, degraded
from tests.benchmarks import ours
from tests.benchmarks.movies import Movie, Source, drawn

BUILD = Path(__file__).parents[2] / "build" / "bench"

MOST_MOVIES = 4

Segmenter = Callable[[Recording], Iterable[ArrayLike]]


@dataclass(frozen=True)
class Axis:
    """One way of making a movie worse, from not at all to very much."""

    option: str
    label: str
    levels: tuple[float, ...]


AXES = (
    Axis("texture", "texture of the table, share of brightness", (0, 0.05, 0.1, 0.2, 0.4)),
    Axis("contrast", "share of the contrast left", (1, 0.7, 0.5, 0.35, 0.2)),
    Axis("noise_sigma", "noise σ in grey values", (0, 4, 8, 16, 32)),
    Axis("frame_step", "motion, times as fast", (1, 2, 3, 4)),
    Axis("jpeg_quality", "JPEG quality", (100, 75, 50, 25, 10)),
)


def quality_at(movie: Movie, segment: Segmenter, axis: Axis, level: float) -> Quality:
    degradation = Degradation(**{axis.option: level})
    table = movie.labels == movie.background
    recording = degraded(movie.left, degradation, seed=7, where=table)
    return quality(segment(recording), movie.labels[:: degradation.frame_step], background=movie.background)


def measured(sources: Sequence[Source], segment: Segmenter) -> pd.DataFrame:
    """One row for each movie, axis and level."""
    rows = []
    for source in sources:
        movie = source.open()
        for axis in AXES:
            for level in axis.levels:
                found = quality_at(movie, segment, axis, level)
                rows.append((source.setting, source.name, axis.option, level, found.covering, found.kept))
    return pd.DataFrame(rows, columns=["setting", "movie", "option", "level", "covering", "kept"])


def curves(frame: pd.DataFrame, axis: Axis) -> pd.DataFrame:
    """Means over the movies of a setting; index: level."""
    means = frame[frame["option"] == axis.option].groupby(["level", "setting"], sort=False)[["covering", "kept"]].mean()
    wide = means.unstack("setting")
    wide.columns = [f"{measure}, {setting}" for measure, setting in wide.columns]
    wide.index.name = axis.label
    return wide


def draw(frame: pd.DataFrame, path: Path) -> None:
    figure = new_figure(PAGE_WIDTH_IN, 5.0, layout="constrained")
    panels = figure.subplots(2, 3, sharey=True).ravel()
    for panel, axis in zip(panels, AXES, strict=False):
        draw_curves(curves(frame, axis), y_label="share" if panel in panels[::3] else "", ax=panel)
        legend = panel.get_legend()
        handles, names = panel.get_legend_handles_labels()
        legend.remove()
        panel.set_xticks(axis.levels, [f"{level:g}" for level in axis.levels])
        if axis.levels[0] > axis.levels[-1]:
            panel.invert_xaxis()  # on every panel, worse is to the right
        panel.set_ylim(0, 1.03)
    panels[-1].axis("off")
    panels[-1].legend(handles, names, frameon=False, loc="center", handlelength=3.0)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, png_bytes(figure))


def tables(frame: pd.DataFrame) -> str:
    return "\n\n".join(curves(frame, axis).round(3).to_string() for axis in AXES)


@ours.needed
def test_where_it_breaks(
    benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], sources: list[Source]
) -> None:
    benchmark.group = "robustness"
    taken = sources[: 1 if benchmark.disabled else MOST_MOVIES]
    frame = benchmark.pedantic(measured, args=(taken, ours.segmentation_of), rounds=1)
    assert frame["covering"].between(0, 1).all()
    if benchmark.stats is not None:
        path = BUILD / "robustness.png"
        draw(frame, path)
        with capsys.disabled():
            print(f"\n{', '.join(source.name for source in taken)}\n{tables(frame)}")
            print(f"drawn in {path.relative_to(BUILD.parents[1])}")


def brighter_than_half(recording: Recording) -> Iterable[ArrayLike]:
    """A segmenter that texture, noise and a loss of contrast confuse, but neither motion nor a lost frame."""
    return [(frame.image.astype(int).sum(axis=-1) > 300).astype(np.uint8) for frame in recording]


def test_curves_fall_where_they_should(tmp_path: Path) -> None:
    sources = drawn()
    frame = measured(sources, brighter_than_half)
    assert len(frame) == len(sources) * sum(len(axis.levels) for axis in AXES)
    of_laboratory = {axis.option: curves(frame, axis)["covering, laboratory"] for axis in AXES}
    for option in ("noise_sigma", "contrast"):
        assert of_laboratory[option].iloc[-1] < of_laboratory[option].iloc[0] - 0.02
    assert of_laboratory["frame_step"].to_numpy() == pytest.approx(of_laboratory["frame_step"].iloc[0], abs=0.02)
    # Nothing is made worse at the first level of any axis but the last, which encodes all the same.
    first = [of_laboratory[axis.option].iloc[0] for axis in AXES]
    assert first[:4] == pytest.approx([first[0]] * 4)
    draw(frame, tmp_path / "build" / "robustness.png")
    assert (tmp_path / "build" / "robustness.png").stat().st_size > 10_000
    assert tables(frame).count("covering, kitchen") == len(AXES)
