"""Figures of chapter 3: what is drawn is what was given."""

import numpy as np
import pandas as pd
import pytest

import sec_lab as sl
from sec_lab import viz
from sec_lab.noise import noisy_samples
from sec_lab.noise_seeds import LIFTING
from sec_lab.viz.style import figure_of, png_bytes

LEVELS = pd.Index([0.0, 0.5, 1.0], name="noise level p")


def test_curves_have_bars_a_threshold_and_the_whole_range() -> None:
    mean = pd.DataFrame({"4×6": [100.0, 60, 40], "5×7": [100.0, 55, 35]}, index=LEVELS)
    ax = viz.draw_levels(mean, mean * 0 + 2, y_label="similarity in %", threshold=64)
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_ylim()) == ("noise level p", "similarity in %", (0, 105))
    assert [text.get_text() for text in ax.texts] == ["64 %"]
    assert len(ax.containers) == 2
    assert png_bytes(figure_of(ax))
    # The name of the threshold stands right of the axes, clear of curves and legend.
    box = ax.texts[0].get_window_extent()
    legend = ax.get_legend()
    assert legend is not None
    assert box.x0 >= ax.get_window_extent().x1
    assert not box.overlaps(legend.get_window_extent())


def test_what_noise_added_is_framed() -> None:
    samples = noisy_samples(LIFTING, 0.6, n_samples=3, rng=np.random.default_rng(1))
    for number in range(3):
        ax = viz.draw_noisy_sample(samples, number)
        n_rows, n_columns = samples[number].relations.shape
        frames = [patch for patch in ax.patches if patch.get_gid() == "added"]
        assert len(frames) == n_rows - 3 + n_columns - 5
        wide = [int(patch.get_y()) for patch in frames if patch.get_width() == n_columns]
        assert wide == [y for y, there in enumerate(np.flatnonzero(samples.rows[number])) if there % 2]
    with pytest.raises(ValueError, match="number: expected one of 3 samples, got 3"):
        viz.draw_noisy_sample(samples, 3)


def test_bars_are_the_counts() -> None:
    columns = pd.MultiIndex.from_product([["put", "take"], ["TP", "FP"]])
    frame = pd.DataFrame(np.arange(12).reshape(3, 4), index=LEVELS, columns=columns)
    figure = viz.draw_positives({"similarity": frame, "network": frame + 50})
    axes = figure.axes
    assert [ax.get_title(loc="left") for ax in axes] == [
        f"{name}: {one}" for name in ("put", "take") for one in ("similarity", "network")
    ]
    heights = [[bar.get_height() for bar in bars] for bars in axes[3].containers]
    assert heights == [[52, 56, 60], [53, 57, 61]]


def test_curves_of_precision_keep_the_colours_of_classes() -> None:
    curve = (np.array([1.0, 0.5, 0.0]), np.array([0.25, 0.5, 1.0]))
    by_class = dict.fromkeys(("a", "b", "c", "d"), curve)
    figure = viz.draw_precision_recall({p: {"similarity": by_class, "network": by_class} for p in (0.1, 0.2)})
    for ax in figure.axes:
        colours = [line.get_color() for line in ax.lines]
        assert colours[:4] == colours[4:]
        assert [line.get_linestyle() for line in ax.lines] == ["-"] * 4 + ["--"] * 4


def test_network_and_models_are_drawn_with_their_numbers() -> None:
    texts = [text.get_text() for text in viz.draw_network([36, 5, 5, 4]).axes[0].texts]
    assert {"input: 36", "hidden: 5", "output: 4"} <= set(texts)
    model = sl.learn([LIFTING] * 3)
    figure = viz.draw_models({"p = 0.1": model, "p = 0.9": None})
    first, second = figure.axes
    assert [text.get_text() for text in first.texts].count("1.00") == 3
    assert [label.get_text() for label in first.get_xticklabels()] == ["1.00"] * 5
    assert second.texts[0].get_text() == "nothing learned"
