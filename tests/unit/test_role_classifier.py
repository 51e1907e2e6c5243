"""The estimators, and that nested runs choose without looking at what is judged."""

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.base import clone

import sec_lab as sl
from sec_lab.event_chain import EventChain
from sec_lab.role_classifier import RoleTableClassifier, RoleTableNeighbour, feature_names, role_features
from sec_lab.role_evaluation import ingredient_table, learning_curve, nested_classifier, nested_neighbours
from sec_lab.role_tables import Cleaning, RoleTable, role_table
from tests.unit.test_ontology import RECORDINGS

KINDS = ("take apart", "put together", "hide", "uncover", "stir")
NO_HAND = RECORDINGS["unknown"]


def varied(chain: EventChain, rng: np.random.Generator) -> EventChain:
    """The same with other durations."""
    frames = np.cumsum(rng.integers(1, 20, chain.relations.shape[1]))
    return EventChain(chain.relations, chain.pairs, frames)


@pytest.fixture(scope="module")
def recordings() -> tuple[list[EventChain], NDArray[np.str_]]:
    rng = np.random.default_rng(5)
    types = np.repeat(KINDS, 6)
    return [varied(RECORDINGS[kind], rng) for kind in types.tolist()], types


@pytest.mark.parametrize("estimator", [RoleTableClassifier(), RoleTableNeighbour()], ids=["classifier", "neighbour"])
def test_unseen_durations_are_recognised(
    estimator: RoleTableClassifier | RoleTableNeighbour, recordings: tuple[list[EventChain], NDArray[np.str_]]
) -> None:
    chains, types = recordings
    model = clone(estimator).fit(chains[::2], types[::2])
    assert model.predict(chains[1::2]).tolist() == types[1::2].tolist()
    assert model.score(chains[1::2], types[1::2]) == 1.0
    assert model.classes_.tolist() == sorted(KINDS)
    tables = [role_table(chain) for chain in chains]
    assert model.predict(tables).tolist() == model.predict(chains).tolist()
    assert len(model.predict([])) == 0


def test_probabilities_add_up(recordings: tuple[list[EventChain], NDArray[np.str_]]) -> None:
    chains, types = recordings
    model = sl.RoleTableClassifier().fit(chains, types)
    found = model.predict_proba(chains[:4])
    assert found.sum(axis=1).tolist() == pytest.approx([1.0] * 4)
    assert model.classes_[found.argmax(axis=1)].tolist() == model.predict(chains[:4]).tolist()
    np.testing.assert_array_equal(model.predict_proba(chains[:4]), found)


@pytest.mark.parametrize("kind", [RoleTableClassifier, RoleTableNeighbour])
def test_without_a_hand_there_is_no_answer_but_a_named_one(
    kind: type[RoleTableClassifier] | type[RoleTableNeighbour], recordings: tuple[list[EventChain], NDArray[np.str_]]
) -> None:
    chains, types = recordings
    model = kind().fit(chains, types)
    with pytest.raises(ValueError, match="got none in number 1: no segment comes or goes"):
        model.predict([chains[0], NO_HAND])
    with pytest.raises(ValueError, match="expected a hand in every recording"):
        kind().fit([*chains, NO_HAND], [*types.tolist(), "stir"])
    lenient = kind(without_hand="?").fit([*chains, NO_HAND], [*types.tolist(), "stir"])
    assert lenient.predict([chains[0], NO_HAND]).tolist() == [types[0], "?"]
    assert lenient.predict([NO_HAND]).tolist() == ["?"]
    with pytest.raises(
        ValueError, match=r"expected .* of recordings? with a hand|expected at least one recording with"
    ):
        kind(without_hand="?").fit([NO_HAND], ["stir"])


def test_probabilities_without_a_hand_are_equal(recordings: tuple[list[EventChain], NDArray[np.str_]]) -> None:
    model = RoleTableClassifier(without_hand="?").fit(*recordings)
    assert model.predict_proba([NO_HAND]).tolist() == [[0.2] * 5]


@pytest.mark.parametrize("kind", [RoleTableClassifier, RoleTableNeighbour])
def test_bad_input_is_told(kind: type[RoleTableClassifier] | type[RoleTableNeighbour]) -> None:
    chain = RECORDINGS["hide"]
    with pytest.raises(ValueError, match="y: expected one class for each of 2 recordings"):
        kind().fit([chain, chain], ["hide"])
    with pytest.raises(ValueError, match="X: expected a sequence of recordings, got a single EventChain"):
        kind().fit(chain, ["hide"])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="recording: expected an Observation"):
        kind().fit([chain, "hide"], ["hide", "hide"])  # type: ignore[list-item]


def test_one_class_cannot_be_told_from_others() -> None:
    with pytest.raises(ValueError, match="y: expected at least two classes"):
        RoleTableClassifier().fit([RECORDINGS["hide"]] * 2, ["hide", "hide"])


def test_features_have_their_names() -> None:
    chain = RECORDINGS["take apart"]
    table = role_table(EventChain(chain.relations, chain.pairs, [0, 10, 20, 50, 60, 70]))
    found = dict(zip(feature_names(), role_features(table).tolist(), strict=True))
    assert found["object 1 – object 2 is 2 at first"] == 1
    assert found["object 1 – object 2 is 2 at last"] == 0
    assert found["object 1 – object 2 from 2 to 0"] == 1
    # The first three key frames hold for 50 of 80 frames, the last one counted as the median of the others.
    assert found["object 1 – object 2: share of time in touch"] == pytest.approx(50 / 80)
    assert found["object 3 there is 9 at first"] == 1
    assert np.isnan(found["vertical share of the motion of object 1"])
    with pytest.raises(ValueError, match="most_counted: expected at least 1"):
        role_features(table, most_counted=0)


def test_changes_are_counted_up_to_a_limit() -> None:
    often = EventChain([[9, *[0, 2] * 5, 9], [9] + [0] * 10 + [9], [0] * 12], [(7, 1), (7, 2), (1, 2)])
    name = feature_names().index("hand – object 1 from 0 to 2")
    assert [role_features(role_table(often), most_counted=n)[name] for n in (1, 2, 9)] == [1, 2, 5]


def test_of_equally_near_the_frequent_one_is_taken() -> None:
    chain = RECORDINGS["hide"]
    assert RoleTableNeighbour().fit([chain] * 3, ["rare", "often", "often"]).predict([chain]).tolist() == ["often"]
    assert RoleTableNeighbour().fit([chain] * 2, ["first", "second"]).predict([chain]).tolist() == ["first"]


def tables_of(chains: list[EventChain]) -> list[RoleTable]:
    return [role_table(chain) for chain in chains]


def test_nested_run_learns_nothing_of_the_one_that_is_judged(
    recordings: tuple[list[EventChain], NDArray[np.str_]],
) -> None:
    chains, types = recordings
    options = {f"C {C}": (RoleTableClassifier(C=C), tables_of(chains)) for C in (1e-6, 1.0)}
    found = nested_classifier(options, types)
    assert found.predicted.tolist() == types.tolist()
    assert set(found.chosen) == {"C 1.0"}
    # With another class of its own, a recording must not be recognised as that class.
    renamed = types.astype(object)
    renamed[0] = "unheard of"
    assert nested_classifier({"only": options["C 1.0"]}, renamed).predicted[0] == types[0]


def test_groups_are_left_out_together(recordings: tuple[list[EventChain], NDArray[np.str_]]) -> None:
    chains, types = recordings
    options = {"only": (RoleTableClassifier(), tables_of(chains))}
    # Whoever shows a manipulation alone is never recognised in it.
    alone = np.where(types == "stir", "A", np.where(np.arange(len(types)) % 2, "B", "C"))
    found = nested_classifier(options, types, groups=alone).predicted
    assert (found[types != "stir"] == types[types != "stir"]).all()
    assert not (found[types == "stir"] == "stir").any()
    table = {"t": sl.role_similarity_table(tables_of(chains))}
    nearest = nested_neighbours(table, types, groups=alone).predicted
    assert not (nearest[types == "stir"] == "stir").any()
    assert (nearest[types != "stir"] == types[types != "stir"]).all()


def test_neighbours_take_the_table_that_serves_the_others() -> None:
    good, bad = np.kron(np.eye(2), np.ones((4, 4))), np.kron(np.ones((4, 4)), np.eye(2))
    found = nested_neighbours({"bad": bad, "good": good}, list("aaaabbbb"))
    assert set(found.chosen) == {"good"}
    assert found.predicted.tolist() == list("aaaabbbb")


def test_learning_curve_rises_to_all(recordings: tuple[list[EventChain], NDArray[np.str_]]) -> None:
    chains, types = recordings
    curve = learning_curve(
        (RoleTableClassifier(C=1.0), tables_of(chains)),
        types,
        n_demonstrations=[1, 5],
        n_draws=3,
        rng=np.random.default_rng(1),
    )
    assert curve[5].tolist() == [100.0] * 3
    assert curve[1].shape == (3,)
    with pytest.raises(ValueError, match="n_demonstrations: expected 1 to 5, got 6"):
        learning_curve(
            (RoleTableClassifier(), tables_of(chains)), types, n_demonstrations=[6], n_draws=1,
            rng=np.random.default_rng(1),
        )  # fmt: skip


def test_bad_options_are_told() -> None:
    with pytest.raises(ValueError, match="similarities: expected at least one"):
        nested_neighbours({}, ["a", "b"])
    with pytest.raises(ValueError, match="options: expected at least one"):
        nested_classifier({}, ["a", "b"])
    with pytest.raises(ValueError, match="options: expected 2 role tables in 'x', got 1"):
        nested_classifier({"x": (RoleTableClassifier(), [role_table(RECORDINGS["hide"])])}, ["a", "b"])
    with pytest.raises(ValueError, match="groups: expected one for each of 2"):
        nested_neighbours({"x": np.eye(2)}, ["a", "b"], groups=["p"])


@pytest.mark.parametrize("kind", [RoleTableClassifier, RoleTableNeighbour])
def test_answers_stay_of_their_type(
    kind: type[RoleTableClassifier] | type[RoleTableNeighbour],
    recordings: tuple[list[EventChain], NDArray[np.str_]],
) -> None:
    chains, types = recordings
    numbers = np.unique(types, return_inverse=True)[1]
    asked = [chains[0], NO_HAND]
    mixed = kind(without_hand="?").fit(chains, numbers).predict(asked)
    assert mixed.tolist() == [numbers[0], "?"]
    same = kind(without_hand=-1).fit(chains, numbers).predict(asked)
    assert same.dtype.kind == "i"
    assert same.tolist() == [numbers[0], -1]
    words = kind(without_hand="no hand in this one").fit(chains, types).predict(asked)
    assert words.tolist() == [types[0], "no hand in this one"]


def test_studies_tell_bad_input_and_show_bars(
    recordings: tuple[list[EventChain], NDArray[np.str_]], capsys: pytest.CaptureFixture[str]
) -> None:
    chains, types = recordings
    tables = tables_of(chains)
    option = RoleTableClassifier(), tables
    with pytest.raises(ValueError, match="n_folds: expected a whole number of at least 2, got 0"):
        nested_classifier({"": option}, types, n_folds=0)
    with pytest.raises(ValueError, match="n_draws: expected a whole number of at least 1, got 0"):
        learning_curve(option, types, n_demonstrations=[2], n_draws=0, rng=np.random.default_rng(0))
    named = {str(i): chain for i, chain in enumerate(chains)}
    with pytest.raises(ValueError, match="cleanings: expected a mapping with at least one entry"):
        ingredient_table(named, types, cleanings={})
    with pytest.raises(ValueError, match=r"classes: expected one for each of 30 recordings, got shape \(3,\)"):
        ingredient_table(named, types[:3], cleanings={"": Cleaning()})
    assert not capsys.readouterr().err
    similar = {"": np.eye(len(types))}
    nested_neighbours(similar, types, progress=True)
    nested_classifier({"": option}, types, groups=np.arange(30) % 2, progress=True)
    learning_curve(option, types, n_demonstrations=[2], n_draws=1, rng=np.random.default_rng(0), progress=True)
    ingredient_table(named, types, cleanings={"": Cleaning()}, nested=False, progress=True)
    assert capsys.readouterr().err.count("\n") == 4
