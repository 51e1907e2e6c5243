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
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import ConnectionPatch, PathPatch
from numpy.typing import NDArray
from skimage.color import deltaE_ciede2000, rgb2lab

from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.pipeline import observe_segments
from sec_lab.relations import SegmentRelations, scan_line_relations
from sec_lab.scene_graph import SceneGraph
from sec_lab.similarity import compare
from sec_lab.viz import (
    Finding,
    chain_forms,
    draw_chain,
    draw_curves,
    draw_main_graphs,
    draw_match,
    draw_segments,
    draw_similarity_table,
    new_figure,
    verdict_table,
)
from sec_lab.viz.overview import draw_overview
from sec_lab.viz.style import EDGE_STYLE, RELATION_COLOUR, png_bytes, segment_colours, text_width_in
from sec_lab.viz.verdicts import verdict
from sec_lab.worlds.drawn import moving_object

STORED = Path(__file__).parents[2] / "datasets" / "moving_object" / "event_chain.png"
N, O, T, A = Relation  # noqa: E741

LABELS = np.ones((40, 60), dtype=np.uint8)
LABELS[5:20, 5:25], LABELS[20:35, 10:20], LABELS[10:25, 40:55] = 2, 4, 3
FRAME = np.full((40, 60, 3), 200, dtype=np.uint8)

CHAIN = EventChain(
    [[1, 2, 1, 1], [0, 0, 0, 0], [9, 0, 2, 9]], [(2, 1), (3, 1), (3, 2)], [0, 27, 37, 54], {2: "cup", 3: "US$ and CA$"}
)


def texts(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.texts]


def row_names(ax: Axes) -> list[str]:
    return [label.get_text() for label in ax.get_yticklabels()]


def column_names(ax: Axes) -> list[str]:
    return [label.get_text() for label in ax.get_xticklabels()]


def legend_of(ax: Axes | Figure) -> list[str]:
    legend = ax.get_legend() if isinstance(ax, Axes) else ax.legends[0]
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


def rendered(drawn: Axes | Figure) -> NDArray[np.uint8]:
    """Pixels of the figure, so that everything in it is really drawn."""
    from io import BytesIO

    figure = drawn if isinstance(drawn, Figure) else drawn.get_figure(root=True)
    assert figure is not None
    return (imread(BytesIO(png_bytes(figure)))[:, :, :3] * 255).astype(np.uint8)


def random_chain(rng: np.random.Generator, n_rows: int, n_columns: int) -> EventChain:
    relations = rng.choice([0, 0, 1, 2, 9], size=(n_rows, n_columns))
    relations[0, :2] = 0, 2
    return EventChain(relations, [(100 + row, 1) for row in range(n_rows)])


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


class TestChain:
    def test_original(self) -> None:
        ax = draw_chain(CHAIN, title="ξ_o")
        assert texts(ax) == list("121100009029")
        assert row_names(ax) == ["ρ$_{2{,}1}$", "ρ$_{3{,}1}$", "ρ$_{3{,}2}$"]
        assert column_names(ax) == ["0", "27", "37", "54"]
        assert ax.get_xlabel() == "key frame"
        assert legend_of(ax) == ["0 non-touching", "1 overlapping", "2 touching", "9 absent"]
        rendered(ax)

    def test_cells_have_the_colours_of_their_relations(self) -> None:
        ax = draw_chain(CHAIN)
        cells = np.asarray(ax.images[0].get_array())[:, ::2]
        expected = [[to_rgb(RELATION_COLOUR[Relation(code)]) for code in row] for row in CHAIN.relations.tolist()]
        np.testing.assert_allclose(cells, expected, atol=1e-9)

    def test_derived(self) -> None:
        ax = draw_chain(CHAIN, form="derived")
        assert texts(ax) == list("122111" + "900229")
        assert column_names(ax) == ["27", "37", "54"]
        assert ax.get_xlabel() == "change at key frame"
        halves = np.asarray(ax.images[0].get_array())
        np.testing.assert_allclose(halves[0, :2], [to_rgb(RELATION_COLOUR[O]), to_rgb(RELATION_COLOUR[T])], atol=1e-9)
        assert halves[0, 4:].min() > 0.75  # 11 is no change, so it is pale

    def test_compressed_is_ragged(self) -> None:
        ax = draw_chain(CHAIN, form="compressed")
        assert texts(ax) == list("1221" + "900229")
        assert (np.asarray(ax.images[0].get_array())[0, 4:] == 1).all()

    def test_changing_rows_by_name(self) -> None:
        ax = draw_chain(CHAIN, changing_only=True, row_names="names")
        assert row_names(ax) == ["cup, 1", r"US\$ and CA\$, cup"]
        rendered(ax)

    def test_one_row_one_column(self) -> None:
        ax = draw_chain(EventChain([[2]], [(2, 1)]))
        assert texts(ax) == ["2"]
        rendered(ax)

    def test_many_rows_go_without_codes_and_names(self) -> None:
        ax = draw_chain(random_chain(np.random.default_rng(1), 276, 72))
        assert texts(ax) == row_names(ax) == []
        assert ax.get_ylabel() == "276 relations"
        assert 2 <= len(column_names(ax)) < 72
        assert rendered(ax).shape[1] <= 1660

    def test_long_names_stay_in_the_figure(self) -> None:
        chain = EventChain([[0, 2]], [(2, 1)], names={1: "a very long name of a thing" * 2, 2: "another" * 8})
        ax = draw_chain(chain, row_names="names")
        pixels = rendered(ax)
        assert (pixels[:, :2] == 255).all()

    @pytest.mark.parametrize(
        ("form", "values", "expected"),
        [
            ("original", [[0, 2], [1, 9]], "0219"),
            ("derived", [[2, 21], [11, 90]], "02211190"),
            ("compressed", [[2, 21], [12]], "022112"),
        ],
    )
    def test_arrays(self, form: str, values: list[list[int]], expected: str) -> None:
        ax = draw_chain(values, form=form)  # type: ignore[arg-type]
        assert texts(ax) == list(expected)
        assert row_names(ax) == ["1", "2"]

    @pytest.mark.parametrize(
        ("chain", "options", "message"),
        [
            (CHAIN, {"form": "ξ"}, "form: expected one of"),
            (CHAIN, {"row_names": "labels"}, "row_names: expected one of"),
            (EventChain([[0, 0]], [(2, 1)]), {"changing_only": True}, "expected a row that changes"),
            (EventChain([[0]], [(2, 1)]), {"form": "derived"}, "expected a row that changes"),
            ([[0, 3]], {}, "codes 0, 1, 2 or 9, got 3"),
            ([[13]], {"form": "derived"}, "codes 0, 1, 2 or 9, got 3"),
            ([[-1]], {"form": "derived"}, "codes 0, 1, 2 or 9, got -1"),
            ([[0, 1], [1]], {}, "ragged"),
            ([], {"form": "compressed"}, "at least one row"),
            ([[], []], {"form": "compressed"}, "at least one row"),
            ([[1.5]], {"form": "compressed"}, "whole numbers"),
        ],
    )
    def test_bad_chain(self, chain: object, options: dict[str, object], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            draw_chain(chain, **options)  # type: ignore[arg-type]

    def test_as_text(self) -> None:
        frame = chain_forms(CHAIN)
        assert frame.index.tolist() == ["ρ2,1", "ρ3,2"]
        assert frame.loc["ρ3,2"].tolist() == ["9 0 2 9", "90 02 29", "90 02 29"]


def partners_drawn(figure: Figure) -> int:
    return sum(isinstance(artist, ConnectionPatch) for artist in figure.get_children())


class TestMatch:
    SLOWER = EventChain([[0, 0, 2, 2], [0, 2, 2, 0]], [(2, 3), (1, 2)])
    PUTTING = EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)])

    def test_side_by_side(self) -> None:
        match = compare(self.PUTTING, self.SLOWER)
        figure = draw_match(match, titles=("fast", "$low and $"))
        left, right, agreement = figure.axes
        assert (left.get_title(loc="left"), right.get_title(loc="left")) == ("fast", "$low and $")
        assert partners_drawn(figure) == 2
        assert [text.get_text() for text in right.texts if text.get_gid() == "aligned"] == ["1", "2", "3"]
        assert row_names(agreement)[0] == "ρ$_{1{,}2}$ ↔ ρ$_{1{,}2}$"
        assert agreement.get_title(loc="right") == "6 of 6 cells agree"
        assert agreement.get_xlabel().endswith("= 100 %")
        rendered(figure)

    def test_both_codes_where_chains_differ(self) -> None:
        other = EventChain([[0, 2, 0, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)])
        figure = draw_match(compare(self.PUTTING, other))
        different = [text.get_text() for text in figure.axes[2].texts if text.get_gid() == "different"]
        assert len(different) == 1
        assert different[0] in ("2≠0", "0≠2")
        assert figure.axes[2].get_title(loc="right") == "5 of 6 cells agree"

    def test_row_without_partner(self) -> None:
        figure = draw_match(compare(self.PUTTING, EventChain([[0, 2, 0]], [(1, 2)])))
        assert partners_drawn(figure) == 1
        assert figure.axes[2].get_title(loc="right") == "3 of 6 cells agree"
        assert row_names(figure.axes[2]) == ["ρ$_{1{,}2}$ ↔ ρ$_{1{,}2}$", "ρ$_{2{,}3}$"]

    def test_nothing_in_common(self) -> None:
        figure = draw_match(compare(EventChain([[0, 2]], [(1, 2)]), EventChain([[9, 1]], [(1, 2)])))
        assert partners_drawn(figure) == 0
        assert figure.axes[2].get_title(loc="right") == "0 of 2 cells agree"
        rendered(figure)

    @settings(max_examples=25)
    @given(
        st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(1, 5), st.integers(2, 6), st.integers(2, 6),
        st.sampled_from(["original", "derived"]),
    )  # fmt: skip
    def test_cells_that_agree_are_the_temporal_similarity(
        self, seed: int, m: int, k: int, u: int, v: int, temporal_input: str
    ) -> None:
        rng = np.random.default_rng(seed)
        match = compare(random_chain(rng, m, u), random_chain(rng, k, v), temporal_input=temporal_input)  # type: ignore[arg-type]
        agreeing, _, cells, *_ = draw_match(match).axes[2].get_title(loc="right").split()
        assert 100 * int(agreeing) / int(cells) == pytest.approx(match.temporal)

    @pytest.mark.parametrize("row_names", ["relations", "names"])
    def test_large_chains(self, row_names: str) -> None:
        rng = np.random.default_rng(3)
        match = compare(random_chain(rng, 60, 40), random_chain(rng, 90, 50), effort=10)
        figure = draw_match(match, row_names=row_names)  # type: ignore[arg-type]
        assert texts(figure.axes[2]) == []
        assert rendered(figure).shape[1] == 1660

    def test_names(self) -> None:
        named = EventChain(self.PUTTING.relations, self.PUTTING.pairs, names={1: "hand", 2: "cup", 3: "table"})
        figure = draw_match(compare(named, self.SLOWER), row_names="names")
        assert row_names(figure.axes[0]) == ["hand, cup", "cup, table"]
        with pytest.raises(ValueError, match="row_names: expected one of"):
            draw_match(compare(named, self.SLOWER), row_names="labels")  # type: ignore[arg-type]


class TestSimilarityTable:
    @staticmethod
    def frame(n: int) -> pd.DataFrame:
        values = np.linspace(0, 100, n * n).reshape(n, n)
        names = [f"chain {i}" for i in range(n)]
        return pd.DataFrame(values, names, names)

    def test_numbers_up_to_twenty_rows(self) -> None:
        assert len(texts(draw_similarity_table(self.frame(20)))) == 400
        ax = draw_similarity_table(self.frame(21), title="Similarity")
        assert texts(ax) == row_names(ax) == []
        assert ax.get_ylabel() == "21 chains"
        rendered(ax)

    def test_rectangular(self) -> None:
        ax = draw_similarity_table(pd.DataFrame([[100, 50.4, 0]], ["ρ2, 1"], ["ρ2,1", "ρ3,1", "ρ6,3"]))
        assert texts(ax) == ["100", "50", "0"]
        assert row_names(ax) == ["ρ$_{2{,}1}$"]
        rendered(ax)

    @pytest.mark.parametrize("as_mapping", [False, True])
    def test_ordered_by_class(self, *, as_mapping: bool) -> None:
        frame = self.frame(4)
        classes = ["put", "take", "put", "take"]
        ax = draw_similarity_table(
            frame, classes=dict(zip(frame.index, classes, strict=True)) if as_mapping else classes
        )
        order = [0, 2, 1, 3]
        assert row_names(ax) == column_names(ax) == [f"chain {i}" for i in order]
        np.testing.assert_allclose(np.asarray(ax.images[0].get_array()), frame.to_numpy()[np.ix_(order, order)])
        lines = [line for line in ax.lines if line.get_gid() == "class"]
        assert [float(np.asarray(line.get_ydata())[0]) for line in lines[::2]] == [1.5]

    def test_eighty_in_eight_classes(self) -> None:
        classes = [f"class {i % 8}" for i in range(80)]
        ax = draw_similarity_table(self.frame(80), classes=classes)
        assert row_names(ax) == [f"class {i}" for i in range(8)]
        assert len([line for line in ax.lines if line.get_gid() == "class"]) == 14
        assert rendered(ax).shape[1] <= 1660

    def test_into_given_axes(self) -> None:
        ax = new_figure(5, 4).add_subplot()
        assert draw_similarity_table(self.frame(30), ax=ax) is ax
        rendered(ax)

    @pytest.mark.parametrize(
        ("values", "classes", "message"),
        [
            (np.zeros((0, 0)), None, "at least one row"),
            ([[100, np.nan]], None, "percent from 0 to 100, got nan"),
            ([[100.5]], None, "percent from 0 to 100, got 100.5"),
            ([[-1]], None, "got -1"),
            ([[100, 50]], ["a"], "one a row of a square table"),
            ([[100, 50], [50, 100]], ["a"], "one a row of a square table, got 1"),
            ([[100, 50], [50, 100]], {0: "a", 2: "b"}, "got none for 1"),
        ],
    )
    def test_bad_table(self, values: object, classes: object, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            draw_similarity_table(pd.DataFrame(values), classes=classes)  # type: ignore[call-overload]


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
