"""Figures of segments, graphs, overviews, curves and verdicts."""

import subprocess
import sys
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgb
from matplotlib.image import imread
from matplotlib.patches import PathPatch
from numpy.typing import NDArray
from skimage.color import deltaE_ciede2000, rgb2lab

from sec_lab.codes import Relation
from sec_lab.observation import Observation
from sec_lab.pipeline import observe_segments
from sec_lab.relations import SegmentRelations, scan_line_relations
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz import Finding, draw_chain, draw_curves, draw_main_graphs, draw_segments, new_figure, verdict_table
from sec_lab.viz.overview import draw_overview
from sec_lab.viz.style import EDGE_STYLE, RELATION_COLOUR, png_bytes, segment_colours, text_width_in
from sec_lab.viz.verdicts import verdict
from sec_lab.worlds.drawn import moving_object
from tests.drawn_figures import CHAIN, FRAME, LABELS, column_names, legend_of, rendered, row_names, texts

STORED = Path(__file__).parents[2] / "datasets" / "moving_object" / "event_chain.png"

N, O, T, A = Relation  # noqa: E741

# Viénot, Brettel and Mollon (1999): what is left of linear RGB without long or middle wave receptors.
SEEN_BY = {
    "all": np.eye(3),
    "protanopes": np.array([[0.1124, 0.8876, 0.0], [0.1124, 0.8876, 0.0], [0.0040, -0.0040, 1.0]]),
    "deuteranopes": np.array([[0.2928, 0.7072, 0.0], [0.2928, 0.7072, 0.0], [-0.0223, 0.0223, 1.0]]),
}


class TestStyle:
    @pytest.mark.parametrize("eyes", SEEN_BY)
    def test_relations_are_told_apart_by_all_eyes(self, eyes: str) -> None:
        colours = np.array([to_rgb(colour) for colour in RELATION_COLOUR.values()])
        seen = np.clip(colours**2.2 @ SEEN_BY[eyes].T, 0, 1) ** (1 / 2.2)
        lab = rgb2lab(seen[None])[0]
        assert len(lab) == len(Relation)
        for one, other in combinations(lab, 2):
            assert deltaE_ciede2000(one, other) > 20

    def test_edges_differ_in_more_than_colour(self) -> None:
        assert set(EDGE_STYLE) == {O, T}
        assert EDGE_STYLE[O].dashes != EDGE_STYLE[T].dashes

    def test_the_thesis_s_colours(self) -> None:
        red, green, blue = to_rgb(EDGE_STYLE[O].colour)
        assert blue > 2 * max(red, green) * 0.6 > red
        red, green, blue = to_rgb(EDGE_STYLE[T].colour)
        assert red > 2 * max(green, blue)

    def test_segments_have_their_own_colours_whatever_else_is_there(self) -> None:
        many = segment_colours(range(60))
        assert len(set(many.values())) == 60
        assert segment_colours([7])[7] == many[7]

    def test_figure_shows_itself(self) -> None:
        figure = new_figure(3, 2)
        png, size = figure._repr_png_()  # type: ignore[attr-defined]
        assert png.startswith(b"\x89PNG")
        assert size == {"width": 300, "height": 200}

    def test_equal_figures_are_equal_files(self) -> None:
        one, other = (png_bytes(draw_chain(CHAIN).get_figure(root=True)) for _ in range(2))  # type: ignore[arg-type]
        assert one == other

    def test_text_width(self) -> None:
        assert text_width_in("", size_pt=10) == 0
        assert text_width_in("ξ¹", size_pt=20) == pytest.approx(2 * text_width_in("ξ¹", size_pt=10), rel=1e-6)


class TestSegments:
    def test_nodes_and_edges(self) -> None:
        graph = scan_line_relations(LABELS)
        ax = draw_segments(LABELS, graph, title="Frame 7")
        assert texts(ax) == ["1", "2", "3", "4"]
        drawn = [patch.get_gid() for patch in ax.patches if patch.get_gid() != "casing"]
        assert drawn == ["overlapping"] * 3 + ["touching"]
        assert legend_of(ax) == ["overlapping", "touching"]
        assert ax.get_title(loc="left") == "Frame 7"
        rendered(ax)

    def test_edges_have_the_colours_of_the_thesis(self) -> None:
        ax = draw_segments(LABELS, scan_line_relations(LABELS))
        for patch in ax.patches:
            if patch.get_gid() != "casing":
                style = EDGE_STYLE[O if patch.get_gid() == "overlapping" else T]
                assert patch.get_edgecolor()[:3] == to_rgb(style.colour)
                assert (patch.get_linestyle() in ("solid", "-")) == (not style.dashes)

    def test_frame_is_shown_as_it_is(self) -> None:
        (image,) = draw_segments(FRAME).images
        np.testing.assert_array_equal(image.get_array(), FRAME)

    def test_faded_frame_is_pale(self) -> None:
        (image,) = draw_segments(FRAME, faded=True).images
        assert image.get_array() is not None
        assert (np.asarray(image.get_array()) == round(255 - 0.45 * 55)).all()

    def test_segments_are_seen_in_their_colours(self) -> None:
        (image,) = draw_segments(LABELS).images
        colours = segment_colours([1, 3])
        for label, (row, column) in ((1, (38, 30)), (3, (18, 48))):
            expected = np.round(np.array(colours[label]) * 255)
            np.testing.assert_array_equal(np.asarray(image.get_array())[row, column], expected)

    def test_node_stands_at_the_centre(self) -> None:
        ax = draw_segments(np.ones((100, 100), dtype=int), SceneGraph([1], [[0]], [[30, 60]]))
        assert places(ax)[0] == pytest.approx([30, 60], abs=0.1)

    def test_nodes_on_one_spot_are_parted(self) -> None:
        graph = SceneGraph([1, 2, 5], np.ones((3, 3)) - np.eye(3), [[50, 50]] * 3)
        ax = draw_segments(np.ones((100, 100), dtype=int), graph)
        assert gaps(ax).min() >= 1.5 * node_px(ax)

    @settings(max_examples=20)
    @given(hnp.arrays(float, (6, 2), elements=st.floats(0, 199)))
    def test_no_node_covers_another_or_leaves_the_picture(self, positions: NDArray[np.float64]) -> None:
        ax = draw_segments(np.ones((200, 200), dtype=int), SceneGraph(range(6), np.zeros((6, 6)), positions))
        assert gaps(ax).min() >= node_px(ax)
        assert (places(ax) > 0).all()
        assert (places(ax) < 199).all()

    def test_edge_goes_around_a_node_in_its_way(self) -> None:
        relations = [[0, 0, 1], [0, 0, 0], [1, 0, 0]]
        ax = draw_segments(
            np.ones((200, 200), dtype=int), SceneGraph([1, 2, 3], relations, [[20, 50], [90, 50], [180, 50]])
        )
        (edge,) = [patch for patch in ax.patches if patch.get_gid() == "overlapping"]
        assert isinstance(edge, PathPatch)
        way = edge.get_path().interpolated(1)
        (polygon,) = way.to_polygons(closed_only=False)
        distance = np.linalg.norm(polygon - places(ax)[1], axis=1).min()
        assert distance >= 0.6 * node_px(ax)

    def test_graph_without_nodes(self) -> None:
        ax = draw_segments(LABELS, SceneGraph([], np.zeros((0, 0))))
        assert texts(ax) == []
        assert ax.get_legend() is None

    def test_part_of_the_rows(self) -> None:
        ax = draw_segments(LABELS, scan_line_relations(LABELS), rows_px=(10, 30))
        assert ax.get_ylim() == (29.5, 9.5)
        assert np.asarray(ax.images[0].get_array()).shape == (20, 60, 3)

    def test_into_given_axes(self) -> None:
        ax = new_figure(4, 3).add_subplot()
        assert draw_segments(LABELS, ax=ax, legend=False) is ax

    @pytest.mark.parametrize(
        ("picture", "message"),
        [
            (np.ones((4, 5, 3)), "expected an RGB frame"),
            (np.ones((4, 5, 4), dtype=np.uint8), r"got shape \(4, 5, 4\) of uint8"),
            (np.ones((4, 5)), "of float64"),
            (np.ones((0, 5), dtype=int), "expected an RGB frame"),
            ([[1, 2], [3]], "ragged"),
        ],
    )
    def test_bad_picture(self, picture: object, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            draw_segments(picture)  # type: ignore[arg-type]

    @pytest.mark.parametrize("positions", [None, [[0, 0, 0]]])
    def test_graph_needs_positions_in_the_picture(self, positions: object) -> None:
        with pytest.raises(ValueError, match="expected positions"):
            draw_segments(LABELS, SegmentRelations([1], [[0]], positions))  # type: ignore[arg-type]

    @pytest.mark.parametrize("rows", [(-1, 3), (5, 5), (0, 41)])
    def test_bad_rows(self, rows: tuple[int, int]) -> None:
        with pytest.raises(ValueError, match="rows_px: expected rows from 0 to 40"):
            draw_segments(LABELS, rows_px=rows)


def places(ax: Axes) -> NDArray[np.float64]:
    (nodes,) = (one for one in ax.collections if isinstance(one, PathCollection))
    return np.asarray(nodes.get_offsets())


def gaps(ax: Axes) -> NDArray[np.float64]:
    at = places(ax)
    i, j = np.triu_indices(len(at), k=1)
    return np.linalg.norm(at[i] - at[j], axis=1)


def node_px(ax: Axes) -> float:
    """Diameter of a node in pixels of the picture."""
    (nodes,) = (one for one in ax.collections if isinstance(one, PathCollection))
    figure = ax.get_figure(root=True)
    assert figure is not None
    (left, right), width_pt = ax.get_xlim(), ax.get_position().width * figure.get_figwidth() * 72
    return float(np.sqrt(nodes.get_sizes()[0])) * (right - left) / width_pt


class TestMainGraphs:
    MOVIE = (LABELS, LABELS, np.where(LABELS == 4, 1, LABELS), LABELS)

    def seen(self) -> Observation:
        return observe_segments(self.MOVIE, names={2: "cup"})

    def test_rows_and_columns_of_the_strip(self) -> None:
        frames = np.stack([FRAME] * 4)
        figure = draw_main_graphs(self.seen(), frames=frames, labels=self.MOVIE)
        assert len(figure.axes) == 3 * 3 + 3
        assert [ax.get_title(loc="left") for ax in figure.axes[:3]] == ["frame 0", "frame 2", "frame 3"]
        assert [len(ax.texts) for ax in figure.axes[:9]] == [0] * 6 + [4, 3, 4]
        assert [ax.get_title(loc="left") for ax in figure.axes[9:]] == ["ξ$_o$", "ξ$_d$", "ξ$_c$"]
        assert {"(a)", "(b)", "(c)", "(d)", "(e)", "(f)"} == {text.get_text() for text in figure.texts}
        assert legend_of(figure)[:2] == ["overlapping", "touching"]
        rendered(figure)

    def test_frames_or_labels_alone(self) -> None:
        assert len(draw_main_graphs(self.seen(), labels=self.MOVIE).axes) == 2 * 3 + 3
        assert len(draw_main_graphs(self.seen(), frames=[FRAME] * 4).axes) == 2 * 3 + 3

    def test_some_columns_and_changing_rows(self) -> None:
        figure = draw_main_graphs(self.seen(), labels=self.MOVIE, columns=[2], changing_only=True)
        assert figure.axes[0].get_title(loc="left") == "frame 3"
        assert len(row_names(figure.axes[2])) == 3
        rendered(figure)

    def test_many_rows(self) -> None:
        rng = np.random.default_rng(0)
        labels = [rng.integers(1, 13, (12, 12)).repeat(4, 0).repeat(4, 1) for _ in range(14)]
        figure = draw_main_graphs(observe_segments(labels), labels=labels, columns=range(12))
        assert rendered(figure).shape[1] == 1660

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({}, "expected frames or label images"),
            ({"labels": MOVIE, "columns": []}, "expected 1 to 12 main graphs in a strip, got 0"),
            ({"labels": MOVIE, "columns": range(13)}, "got 13"),
            ({"labels": MOVIE, "columns": [3]}, "expected numbers from 0 to 2, got 3"),
            ({"labels": MOVIE[:3]}, "key frame 3: expected a frame of the movie, which has 3"),
        ],
    )
    def test_bad_call(self, options: dict[str, object], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            draw_main_graphs(self.seen(), **options)  # type: ignore[arg-type]


class TestOverview:
    def test_stored_picture_is_what_is_drawn(self, tmp_path: Path) -> None:
        done = self.run(str(tmp_path / "picture.png"))
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        drawn, stored = imread(tmp_path / "picture.png"), imread(STORED)
        assert drawn.shape == stored.shape
        assert drawn.shape[1] == 1800
        assert np.abs(drawn - stored).mean() < 0.01
        assert (stored[..., 3] == 1).all()
        assert STORED.stat().st_size < 300_000

    def test_readme_names_the_command(self) -> None:
        command = "python -m sec_lab.viz.overview datasets/moving_object/event_chain.png"
        assert command in (STORED.parent / "README.md").read_text()

    @pytest.mark.parametrize("arguments", [(), ("no/such/folder/picture.png",)])
    def test_bad_call_is_one_line(self, arguments: tuple[str, ...]) -> None:
        done = self.run(*arguments)
        assert done.returncode != 0
        assert len(done.stderr.strip().splitlines()) == 1

    def test_too_many_key_frames(self) -> None:
        graphs = [SceneGraph([1, 2], [[0, i % 3], [i % 3, 0]], [[1, 1], [5, 5]]) for i in range(9)]
        movie = moving_object(1)
        with pytest.raises(ValueError, match="at most 8 key frames, got 9"):
            draw_overview(Observation(graphs, range(9)), movie.frames, movie.labels, rows_px=(0, 9))

    @staticmethod
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-W", "error", "-m", "sec_lab.viz.overview", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=False)


class TestCurves:
    def test_curves(self) -> None:
        index = pd.Index([160, 320, 640], name="width in pixels")
        frame = pd.DataFrame({"a": [1.0, 0.5, 0.25], "b": [1.0, 1.0, 1.0]}, index=index)
        ax = draw_curves(frame, y_label="hints a line", x_scale="log", y_scale="log", title="Resolution")
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("width in pixels", "hints a line")
        assert legend_of(ax) == ["a", "b"]
        assert column_names(ax)[:3] == ["160", "320", "640"]
        np.testing.assert_array_equal(np.asarray(ax.lines[0].get_ydata()), frame["a"])
        assert len({(line.get_color(), line.get_marker(), str(line.get_linestyle())) for line in ax.lines}) == 2
        rendered(ax)

    @pytest.mark.parametrize("n", [0, 7])
    def test_bad_number_of_curves(self, n: int) -> None:
        with pytest.raises(ValueError, match=f"expected one to 6 columns, got {n}"):
            draw_curves(pd.DataFrame(np.zeros((2, n))), y_label="")


class TestVerdicts:
    @pytest.mark.parametrize(
        ("thesis", "ours", "tolerance", "expected"),
        [
            (5, 5, 0, "agrees"),
            (5, 7, 0, "differs"),
            (84, 83.6, 0.5, "agrees"),
            (84, 83.4, 0.5, "differs"),
            (84, np.nan, 0.5, "differs"),
            (True, np.False_, 0, "differs"),
            ("ρ3,2", "ρ3,2", 0, "agrees"),
            ("ρ3,2", "ρ4,2", 0, "differs"),
            ({1: 1, 2: 6}, {1: 1, 2: 6}, 0, "agrees (2/2)"),
            ({1: 1, 2: 6}, {1: 1, 3: 6}, 0, "differs (1/3)"),
            ([[1, 2]], np.array([[1, 2]]), 0, "agrees (2/2)"),
            ([[1, 2]], [[1, 3]], 0, "differs (1/2)"),
            ([1, 2], [1, 2, 3], 0, "differs (shape)"),
            (["a", "b"], ["a", "c"], 0, "differs (1/2)"),
        ],
    )
    def test_verdict(self, thesis: object, ours: object, tolerance: float, expected: str) -> None:
        assert verdict(Finding("value", thesis, ours, tolerance)) == expected

    def test_table_is_text(self) -> None:
        table = verdict_table(
            [
                Finding("similarity", 84, 84.0, unit=" %"),
                Finding("holds", thesis=True, ours=False),
                Finding("roles", {1: 6}, {1: 6}),
                Finding("few", [225, 40], np.array([225, 40])),
                Finding("many", np.zeros((5, 5)), np.zeros((5, 5))),
            ]
        )
        assert table.columns.tolist() == ["thesis", "ours", "verdict"]
        assert table.loc["similarity"].tolist() == ["84 %", "84 %", "agrees"]
        assert table.loc["holds"].tolist() == ["yes", "no", "differs"]
        assert table.loc["roles"].tolist() == ["1≈6", "1≈6", "agrees (1/1)"]
        assert table.loc["few"].tolist() == ["225, 40", "225, 40", "agrees (2/2)"]
        assert table.loc["many"].tolist() == ["5×5 entries", "5×5 entries", "agrees (25/25)"]

    @pytest.mark.parametrize(
        ("findings", "message"),
        [
            ([], "expected at least one finding"),
            ([Finding("value", 1, 1, -1)], "tolerance: expected a number from 0 on, got -1"),
            ([Finding("value", 1, 1, np.nan)], "tolerance: expected a number from 0 on, got nan"),
            ([Finding("value", 1, [1])], "value: expected two values of one kind"),
            ([Finding("value", {1: 1}, [1])], "value: expected two values of one kind"),
        ],
    )
    def test_bad_findings(self, findings: Sequence[Finding], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            verdict_table(findings)


def test_nothing_global_is_touched() -> None:
    """No figure can stay open, and other people's figures look as before."""
    before = dict(mpl.rcParams)
    draw_chain(CHAIN)
    draw_segments(LABELS, scan_line_relations(LABELS))
    assert dict(mpl.rcParams) == before
    code = (
        "import sys, sec_lab.viz as viz, numpy as np\n"
        "figure = viz.draw_chain([[0, 1]]).figure\n"
        "viz.draw_segments(np.ones((9, 9), int)).figure._repr_png_(), figure._repr_png_()\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_chains_of_the_readme_picture() -> None:
    """The picture shows five columns, as the thesis has five main graphs."""
    movie = moving_object(1)
    seen = observe_segments(movie.labels, relations="edge counting")
    figure = draw_overview(seen, movie.frames, movie.labels, rows_px=(72, 208))
    titles = [ax.get_title() for ax in figure.axes if ax.get_title()]
    assert titles == [f"frame {frame}" for frame in seen.key_frames]
    assert "".join(texts(figure.axes[-1])) == "".join(map(str, seen.chain.relations.ravel()))
