"""Figures of event chains, of two of them matched, and of their similarities."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import ConnectionPatch

from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.similarity import compare
from sec_lab.viz import chain_forms, draw_chain, draw_match, draw_similarity_table, new_figure
from sec_lab.viz.style import RELATION_COLOUR
from tests.drawn_figures import CHAIN, column_names, legend_of, random_chain, rendered, row_names, texts

N, O, T, A = Relation  # noqa: E741


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
