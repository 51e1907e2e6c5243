"""Pictures of counts, of spread within groups, and of shares with their intervals."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from sec_lab.viz.counts import draw_counts
from sec_lab.viz.dots import draw_intervals, draw_spread
from sec_lab.viz.style import INK, PAPER, new_figure, png_bytes

CONFUSED = pd.DataFrame(
    [[7, 3, 0], [0, 0, 0], [1, 0, 9]],
    index=pd.Index(["push", "put", "pour"], name="class"),
    columns=pd.Index(["push", "pour", "US$"], name="recognised"),
)


def test_counts_stand_in_their_cells() -> None:
    ax = draw_counts(CONFUSED, title="Confusion")
    assert {text.get_position(): text.get_text() for text in ax.texts} == {
        (0, 0): "7",
        (1, 0): "3",
        (0, 2): "1",
        (2, 2): "9",
    }
    assert [label.get_text() for label in ax.get_yticklabels()] == ["push", "put", "pour"]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["push", "pour", "US$"]
    assert (ax.get_ylabel(), ax.get_xlabel()) == ("class", "recognised")
    np.testing.assert_allclose(ax.images[0].get_array(), [[0.7, 0.3, 0], [0, 0, 0], [0.1, 0, 0.9]])
    png_bytes(ax.get_figure(root=True))


def test_numbers_are_light_on_dark_cells() -> None:
    colours = {text.get_text(): text.get_color() for text in draw_counts(CONFUSED).texts}
    assert colours == {"7": PAPER, "3": INK, "1": INK, "9": PAPER}


def test_cells_of_one_name_are_framed() -> None:
    framed = [
        one for one in draw_counts(CONFUSED).patches if isinstance(one, Rectangle) and one.get_gid() == "same name"
    ]
    assert [(one.get_center()[1], one.get_center()[0]) for one in framed] == [(0, 0), (2, 1)]


def test_counts_are_drawn_where_they_are_wanted() -> None:
    ax = new_figure(4, 3).add_subplot()
    assert draw_counts(CONFUSED, ax=ax) is ax


def test_all_names_lie_inside_the_figure() -> None:
    long = ["a very long name indeed", "b", "another long name"]
    ax = draw_counts(pd.DataFrame(np.eye(3, dtype=int), long, long))
    figure = ax.get_figure(root=True)
    assert figure is not None
    for label in [*ax.get_xticklabels(), *ax.get_yticklabels()]:
        box = label.get_window_extent()
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= figure.bbox.x1


@pytest.mark.parametrize("values", [[[1.5]], [[-1]], [[np.nan]]])
def test_what_is_no_count_is_refused(values: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="whole numbers from 0 on"):
        draw_counts(pd.DataFrame(values))


def test_a_table_without_cells_is_refused() -> None:
    with pytest.raises(ValueError, match=r"got shape \(0, 0\)"):
        draw_counts(pd.DataFrame())


def test_every_value_is_a_dot_and_none_hides_another() -> None:
    frame = pd.DataFrame({"key frames": [4, 4, 9, 5], "rows": [1, 2, 3, 4]}, list("abcd"))
    figure = draw_spread(frame, {"a": "put", "b": "put", "c": "take", "d": "put"})
    assert [ax.get_xlabel() for ax in figure.axes] == ["key frames", "rows"]
    dots = [line.get_xydata() for line in figure.axes[0].lines]
    assert len(dots) == 2
    put, take = (np.asarray(one) for one in dots)
    assert put[:, 0].tolist() == [4, 4, 5]
    assert len(np.unique(put, axis=0)) == 3
    assert take.tolist() == [[9, 1]]
    medians = [np.asarray(bar.get_segments()[0])[0, 0] for bar in figure.axes[0].collections]
    assert medians == [4, 9]
    png_bytes(figure)


def test_spread_needs_groups_and_few_columns() -> None:
    with pytest.raises(ValueError, match="got none for 'b'"):
        draw_spread(pd.DataFrame({"x": [1, 2]}, list("ab")), {"a": "put"})
    with pytest.raises(ValueError, match=r"got shape \(1, 5\)"):
        draw_spread(pd.DataFrame([[1] * 5], ["a"]), {"a": "put"})
    with pytest.raises(ValueError, match=r"got shape \(0, 1\)"):
        draw_spread(pd.DataFrame({"x": []}), {})


INTERVALS = pd.DataFrame(
    {"percent": [40, 50, 20.0], "low_percent": [30, 39, 13.0], "high_percent": [51, 61, 30.0], "n": [3, 4, 5]},
    index=pd.MultiIndex.from_tuples([("all", "longer", "spatial"), ("all", "longer", "temporal"), ("few", "x", "y")]),
)


def test_intervals_reach_from_low_to_high() -> None:
    ax = draw_intervals(INTERVALS, x_label="recognised in %", title="Variants")
    assert [label.get_text() for label in ax.get_yticklabels()] == ["longer, spatial", "longer, temporal", "x, y"]
    assert [text.get_text() for text in ax.texts] == ["all", "few"]
    ends = [np.asarray(segment)[:, 0].tolist() for segment in ax.collections[0].get_segments()]
    assert ends == [[30, 51], [39, 61], [13, 30]]
    assert ax.lines[0].get_xdata().tolist() == [40, 50, 20]
    places = ax.get_yticks()
    assert places[2] - places[1] > places[1] - places[0]
    png_bytes(ax.get_figure(root=True))


def test_other_values_are_lines_with_their_names_inside_the_figure() -> None:
    lines = {"guessing": 12.5, "published": 97.0}
    ax = draw_intervals(INTERVALS, x_label="recognised in %", lines=lines)
    figure = ax.get_figure(root=True)
    assert figure is not None
    png_bytes(figure)
    drawn = [line for line in ax.lines if isinstance(line, Line2D) and line.get_gid() == "line"]
    assert [line.get_xdata()[0] for line in drawn] == [12.5, 97.0]
    names = [text for text in ax.texts if "%" in text.get_text()]
    assert [text.get_text() for text in names] == ["guessing: 12.5 %", "published: 97 %"]
    assert [to_rgb(text.get_color()) for text in names] == [to_rgb(line.get_color()) for line in drawn]
    for text in ax.texts:
        box = text.get_window_extent()
        assert 0 <= box.x0 <= box.x1 <= figure.bbox.x1
        assert 0 <= box.y0 <= box.y1 <= figure.bbox.y1


def test_no_line_runs_through_the_name_of_another() -> None:
    lines = {"guessing": 12.5, "published: with something": 85.0, "published: with something else": 97.0, "less": 20.0}
    ax = draw_intervals(INTERVALS, x_label="recognised in %", lines=lines)
    figure = ax.get_figure(root=True)
    assert figure is not None
    png_bytes(figure)
    names = [text.get_window_extent() for text in ax.texts if "%" in text.get_text()]
    assert len(names) == 4
    for line in (line for line in ax.lines if line.get_gid() == "line"):
        (x, _), (_, top) = line.get_transform().transform(line.get_xydata())
        assert not any(name.x0 < x < name.x1 and name.y0 < top for name in names)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (INTERVALS.iloc[:0], "with 0 rows"),
        (INTERVALS[["percent"]], "expected columns"),
        (INTERVALS.assign(high_percent=101.0), "got 101.0"),
    ],
)
def test_what_is_no_interval_is_refused(frame: pd.DataFrame, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        draw_intervals(frame, x_label="%")
