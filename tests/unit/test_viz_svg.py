"""Drawings as SVG: what they show is what was computed, whatever the names are."""

from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sec_lab.action_model import ActionModel
from sec_lab.classification import threshold_errors
from sec_lab.event_chain import EventChain
from sec_lab.learning import learn
from sec_lab.noise import Noise, noisy_samples
from sec_lab.noise_seeds import LIFTING, SEEDS
from sec_lab.similarity import Match, compare, permutations
from sec_lab.viz.svg.curves import curves_svg
from sec_lab.viz.svg.match import (
    agreement,
    listed_permutations,
    match_svg,
    match_words,
    roles_svg,
    row_similarity_svg,
    with_permutation,
)
from sec_lab.viz.svg.model import model_svg, sample_svg
from sec_lab.viz.svg.paper import Paper, data_address, sentence
from sec_lab.viz.svg.table import (
    cell_at,
    class_colours,
    moved,
    table_layout,
    table_svg,
    table_words,
    wrong_decisions,
)

PUT = EventChain(
    [[9, 2, 2, 9], [2, 2, 0, 0], [0, 0, 2, 2]], [(1, 2), (2, 3), (2, 4)], names={1: "hand", 2: 'a "<b>" & c'}
)
TAKE = EventChain([[9, 2, 9], [0, 0, 2], [2, 0, 0]], [(7, 8), (8, 6), (8, 5)])


def parsed(markup: str) -> ElementTree.Element:
    return ElementTree.fromstring(markup)


def with_attribute(markup: str, name: str) -> list[str]:
    return [element.attrib[name] for element in parsed(markup).iter() if name in element.attrib]


def texts(markup: str) -> str:
    return " ".join("".join(element.itertext()) for element in parsed(markup).iter() if element.tag.endswith("text"))


def noisy_match(seed: int, p: float, **options: object) -> Match:
    rng = np.random.default_rng(seed)
    name = list(SEEDS)[seed % len(SEEDS)]
    sample = noisy_samples(SEEDS[name], p, n_samples=1, rng=rng)[0]
    return compare(SEEDS[name], sample, **options)  # type: ignore[arg-type]


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    p=st.sampled_from([0.0, 0.1, 0.3]),
    normalizer=st.sampled_from(["longer", "shorter"]),
    tolerance=st.sampled_from([0.0, 20.0, 100.0]),
    temporal_input=st.sampled_from(["original", "derived"]),
)
def test_full_cells_over_all_cells_are_the_temporal_similarity(
    seed: int, p: float, normalizer: str, tolerance: float, temporal_input: str
) -> None:
    match = noisy_match(
        seed, p, normalizer=normalizer, tolerance_percent=tolerance, temporal_input=temporal_input
    )  # fmt: skip
    listed, are_all = listed_permutations(match, most=40)
    for permutation in listed[:6]:
        shown = with_permutation(match, permutation)
        equal, different = agreement(shown)
        m, u = equal.shape
        v = match.b.relations.shape[1] - (temporal_input == "derived")
        assert 100 * equal.sum() / (m * min(u, v)) == pytest.approx(permutation.temporal)
        assert not (equal & different).any()
        assert (equal | different).sum() == len(permutation.rows) * len(permutation.columns)
    if are_all:
        assert sorted(one.temporal for one in listed) == sorted(one.temporal for one in permutations(match))
        assert listed[0].temporal == max(one.temporal for one in listed)


def test_columns_of_a_permutation_ascend_in_both_chains() -> None:
    match = noisy_match(3, 0.3, tolerance_percent=30.0)
    for permutation in listed_permutations(match)[0]:
        assert (np.diff(permutation.columns, axis=0) > 0).all()


def test_match_joins_the_rows_that_correspond_and_frames_what_differs() -> None:
    match = compare(PUT, TAKE, normalizer="shorter", tolerance_percent=50)
    drawn = match_svg(match, row_names="names", titles=("put <1>", "take"))
    assert with_attribute(drawn, "data-row") == [f"{a}-{b}" for a, b in match.rows.tolist()]
    assert len(with_attribute(drawn, "data-aligned")) == 2 * len(match.columns)
    _, different = agreement(match)
    assert with_attribute(drawn, "data-mark").count("different") == 2 * different.sum()
    assert 'a "<b>" & c' in texts(drawn)
    assert "put <1>" in texts(drawn)


@pytest.mark.parametrize("temporal_input", ["original", "derived"])
def test_rows_are_named_as_in_the_thesis(temporal_input: str) -> None:
    match = compare(PUT, TAKE, temporal_input=temporal_input)  # type: ignore[arg-type]
    drawn = match_svg(match)
    # Chain codes are the whole of both tables.
    codes = len(with_attribute(drawn, "data-code"))
    cells = sum(len(c.changing_rows) * c.relations.shape[1] for c in (PUT, TAKE))
    halves = sum(len(c.changing_rows) * 2 * (c.relations.shape[1] - 1) for c in (PUT, TAKE))
    assert codes == (cells if temporal_input == "original" else halves)
    assert "ρ1,2" in texts(drawn)


def test_table_of_row_similarities_marks_candidates_and_choice() -> None:
    match = compare(PUT, TAKE, normalizer="shorter", tolerance_percent=50)
    drawn = row_similarity_svg(match)
    values = [float(value) for value in with_attribute(drawn, "data-similarity")]
    assert values == [round(value) for value in match.row_similarity.ravel().tolist()]
    assert len(with_attribute(drawn, "data-candidate")) == match.candidates.sum()
    assert len(with_attribute(drawn, "data-chosen")) == len(match.rows)


def test_words_say_which_permutation_is_shown() -> None:
    twice = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (2, 3)])
    match = compare(twice, twice)
    listed, are_all = listed_permutations(match)
    second = match_words(with_permutation(match, listed[1]), listed, place=1, are_all=are_all)
    assert "ψ_temporal 67 % (4 of 6 cells agree)" in second
    assert second.endswith("permutation 2 of 2, the best has 100 %")
    one, cut = listed_permutations(match, most=1)
    assert (len(one), cut) == (1, False)
    assert "the best of more than" in match_words(match, one, place=0, are_all=cut)


def test_roles_are_pairs_of_pictures() -> None:
    match = compare(PUT, PUT)
    address = data_address(np.zeros((4, 4, 4), np.uint8))
    drawn = roles_svg(match, pictures=({1: address}, {1: address, 2: address}))
    assert len(with_attribute(drawn, "href")) == 3
    assert with_attribute(drawn, "data-role")[:2] == ["1-1", "2-2"]
    assert "no segment clearly" in texts(
        roles_svg(compare(*(EventChain([[0, 2]], [pair]) for pair in ((1, 2), (3, 4)))))
    )


@pytest.mark.parametrize("picture", [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), np.uint8)])
def test_only_pictures_become_addresses(picture: np.ndarray) -> None:
    with pytest.raises(ValueError, match="picture: expected shape"):
        data_address(picture)


def random_table(n: int, n_classes: int, seed: int) -> tuple[pd.DataFrame, list[str]]:
    rng = np.random.default_rng(seed)
    values = rng.uniform(0, 100, (n, n)).round()
    values = np.triu(values, 1) + np.triu(values, 1).T + 100 * np.eye(n)
    names = [f"movie {i}" for i in range(n)]
    return pd.DataFrame(values, names, names), [f"class {i}" for i in rng.integers(n_classes, size=n)]


@settings(max_examples=40)
@given(n=st.integers(2, 60), seed=st.integers(0, 1000), threshold=st.integers(0, 100))
def test_marked_pairs_are_those_that_are_counted(n: int, seed: int, threshold: int) -> None:
    table, classes = random_table(n, 3, seed)
    layout = table_layout(table, classes)
    wrong = wrong_decisions(layout, threshold)
    counted = threshold_errors(table, classes, thresholds_percent=threshold).iloc[0]
    assert (wrong == -1).sum() == 2 * counted["false_negatives"]
    assert (wrong == 1).sum() == 2 * counted["false_positives"]
    drawn = table_svg(layout, threshold_percent=threshold, chosen=(0, n - 1))
    if n <= 40:
        marks = with_attribute(drawn, "data-decision")
        assert marks.count("false negative") == 2 * counted["false_negatives"]
        assert marks.count("false positive") == 2 * counted["false_positives"]
    assert f"{counted['false_negatives']} false negative" in table_words(layout, threshold)


@settings(max_examples=40)
@given(n=st.integers(2, 60), seed=st.integers(0, 1000), data=st.data())
def test_a_place_in_a_cell_gives_the_cell(n: int, seed: int, data: st.DataObject) -> None:
    table, classes = random_table(n, 4, seed)
    layout = table_layout(table, dict(zip(table.index, classes, strict=True)))
    assert sorted(layout.order.tolist()) == list(range(n))
    row, column = (data.draw(st.integers(0, n - 1)) for _ in range(2))
    inside = data.draw(st.floats(0.05, 0.95))
    x = layout.left_px + (column + inside) * layout.cell_px
    y = layout.top_px + (row + inside) * layout.cell_px
    expected = (int(layout.order[row]), int(layout.order[column]))
    assert cell_at(layout, x, y) == expected
    below = moved(layout, expected, down=1)
    assert below == (int(layout.order[min(row + 1, n - 1)]), expected[1])
    assert cell_at(layout, layout.left_px + n * layout.cell_px + 1, y) is None


def test_rows_of_a_class_stand_together() -> None:
    table, _ = random_table(4, 1, 0)
    layout = table_layout(table, ["b", "a", "b", "a"])
    assert [layout.classes[i] for i in layout.order] == ["b", "b", "a", "a"]
    assert with_attribute(table_svg(layout), "data-class") == ["b", "a"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: (t.to_numpy(), None), "expected a table with names"),
        (lambda t: (t.iloc[:2], None), "expected rows and columns of the same names"),
        (lambda t: (t - 50, None), "expected percent from 0 to 100"),
        (lambda t: (t, ["a"]), "classes: expected one for each of 4"),
        (lambda t: (t, {"movie 0": "a"}), "got none for 'movie 1'"),
        (lambda t: (t.where(np.tri(4, dtype=bool), 0), list("aabb")), "expected a symmetric one"),
    ],
)
def test_bad_tables_are_refused(change, message: str) -> None:  # type: ignore[no-untyped-def]
    table, _ = random_table(4, 2, 1)
    with pytest.raises(ValueError, match=message):
        table_layout(*change(table))


def test_every_class_has_a_colour_of_its_own() -> None:
    colours = class_colours([f"class {i}" for i in range(14)])
    assert len(set(colours.values())) == 14


def test_model_shows_all_weights() -> None:
    model = learn([PUT, PUT, PUT])
    assert isinstance(model, ActionModel)
    drawn = model_svg(model, title="putting")
    weights = [float(weight) for weight in with_attribute(drawn, "data-weight")]
    assert weights == pytest.approx([*model.row_weights, *model.column_weights], abs=0.006)
    assert 'a "<b>" & c' in texts(drawn)


@settings(max_examples=30)
@given(seed=st.integers(0, 1000), p=st.sampled_from([0.0, 0.3, 1.0]), mode=st.sampled_from(["flip only", "add only"]))
def test_sample_frames_what_noise_flipped(seed: int, p: float, mode: str) -> None:
    rng = np.random.default_rng(seed)
    samples = noisy_samples(LIFTING, p, n_samples=3, rng=rng, noise=Noise(mode=mode))  # type: ignore[arg-type]
    flipped = (samples.relations[2, ::2, ::2] != LIFTING.relations).sum()
    assert with_attribute(sample_svg(samples, 2), "data-mark").count("different") == flipped
    with pytest.raises(ValueError, match="sample from 0 to 2, got 3"):
        sample_svg(samples, 3)


def test_curves_have_a_line_each_and_a_marker() -> None:
    frame = pd.DataFrame({"ψ": [100.0, 50, np.nan], "roles": [100.0, 20, 0]}, index=[0, 0.5, 1])
    drawn = curves_svg(frame, x_label="noise level p", y_label="%", error=frame / 10, marker=0.5)
    assert with_attribute(drawn, "data-curve") == ["ψ", "roles"]
    assert with_attribute(drawn, "data-marker") == ["0.5"]
    assert "noise level p" in texts(drawn)
    with pytest.raises(ValueError, match="one to six columns"):
        curves_svg(pd.DataFrame(index=[0, 1]), x_label="", y_label="")


def test_sentences_and_numbers_are_safe() -> None:
    assert "&lt;script&gt;" in sentence("<script>")
    paper = Paper(10, 10, label='"quoted" <label>')
    paper.words(0, 0, "ρ2,1 and ρ6, 3 & more")
    assert texts(paper.markup()).replace("\u200b", "") == "ρ2,1 and ρ6,3 & more"
