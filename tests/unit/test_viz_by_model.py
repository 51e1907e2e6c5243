"""Similarities to models, drawn: what is shown is what was given, and bad input is named."""

import pandas as pd
import pytest

from sec_lab import viz


def test_every_movie_has_a_bar_for_every_model() -> None:
    frame = pd.DataFrame({"Putting": [90.0, 40.0, 70.0], "Taking": [45.0, 88.0, 75.0]}, ["P1", "T1", "M1"])
    ax = viz.draw_by_model(frame, {"P1": "Putting", "T1": "Taking", "M1": "mixed"}, threshold=64, title="All")
    heights = [[bar.get_height() for bar in bars] for bars in ax.containers]
    assert heights == [frame["Putting"].tolist(), frame["Taking"].tolist()]
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["P1", "T1", "M1"]
    assert [text.get_text() for text in ax.texts] == ["Putting", "Taking", "mixed"]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["Putting", "Taking"]


def test_every_movie_has_a_panel_with_its_curves_and_spans() -> None:
    curves = {
        name: pd.DataFrame({"Putting": [0.0, high], "Taking": [0.0, 20.0]}, index=[0, 30])
        for name, high in (("(a)", 80.0), ("(b)", 60.0))
    }
    figure = viz.draw_over_time(curves, spans={"(a)": [("Taking", 3, 12)]}, threshold=64)
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["(a)", "(b)"]
    assert [line.get_ydata()[-1] for line in figure.axes[1].lines[:2]] == [60.0, 20.0]
    (span,) = figure.axes[0].patches
    assert (span.get_x(), span.get_x() + span.get_width()) == (3, 12)
    assert not figure.axes[1].patches


def test_bad_input_is_named() -> None:
    frame = pd.DataFrame({"Putting": [90.0]}, ["P1"])
    with pytest.raises(ValueError, match="groups: expected a group for every movie, got none for 'P1'"):
        viz.draw_by_model(frame, {})
    with pytest.raises(ValueError, match="models: expected at least one movie and one to six models"):
        viz.draw_by_model(frame.iloc[:0], {})
    with pytest.raises(ValueError, match="curves: expected one to six models, the same in every movie"):
        viz.draw_over_time({})
    with pytest.raises(ValueError, match="spans: expected one of the models"):
        viz.draw_over_time({"(a)": frame.set_axis([0])}, spans={"(a)": [("Pushing", 0, 1)]})
