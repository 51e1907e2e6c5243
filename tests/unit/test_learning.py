"""Learning of models (step 7): what is common stays, whatever the order, the labels and the noise."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sec_lab as sl
from sec_lab._learning_kernels import step_five
from sec_lab.learning import OnlineLearner, learn, learn_types
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph
from tests import noisy_chains

# Putting as in Fig. 2.10 (b): hand and thing, plate and thing, thing and table.
PUTTING = [[9, 0, 2, 2, 0, 9], [0, 0, 0, 2, 2, 2], [2, 2, 2, 0, 0, 0]]
TAKING = [[9, 0, 2, 2, 0, 9], [2, 2, 2, 0, 0, 0], [0, 0, 0, 0, 2, 2]]
PAIRS = [(1, 2), (2, 3), (2, 4)]


def rows_of(chain):
    return sorted(map(tuple, chain.relations.tolist()))


def test_equal_demonstrations_are_the_model():
    chain = sl.EventChain(PUTTING, PAIRS, names={1: "hand"})
    model = learn({"one": chain, "two": chain})
    assert model.chain.relations.tolist() == PUTTING
    assert model.row_weights.tolist() == [1, 1, 1]
    assert model.column_weights.tolist() == [1] * 6
    assert dict(model.roles["two"]) == {1: 1, 2: 2, 3: 3, 4: 4}
    assert dict(model.chain.names) == {1: "hand"}


def test_weights_are_normalised_occurrences_and_what_is_rare_is_deleted():
    whole = sl.EventChain([*PUTTING, [0, 2, 0, 2, 0, 2]], [*PAIRS, (1, 5)])
    without = sl.EventChain(PUTTING, PAIRS)
    model = learn([whole, whole, whole, without])
    assert model.row_weights.tolist() == [1, 1, 1, 0.75]
    assert len(learn([whole, whole, whole, without], weight_threshold=0.8).row_weights) == 3
    assert len(learn([without, without, without, whole]).row_weights) == 3


def test_what_every_second_demonstration_has_is_not_common():
    """Most have to have it; a threshold that is given is the least weight."""
    whole = sl.EventChain([*PUTTING, [0, 2, 0, 2, 0, 2]], [*PAIRS, (1, 5)])
    halves = [whole, sl.EventChain(PUTTING, PAIRS)] * 2
    for mode in ("batch", "online"):
        assert rows_of(learn(halves, mode=mode).chain) == sorted(map(tuple, PUTTING)), mode
        assert sorted(learn(halves, mode=mode, weight_threshold=0.5).row_weights.tolist()) == [0.5, 1, 1, 1], mode


@pytest.mark.parametrize("order", range(4))
def test_a_row_that_only_the_most_typical_one_lacks_is_appended(order):
    whole = sl.EventChain([*PUTTING, [0, 2, 0, 2, 0, 2]], [*PAIRS, (1, 5)])
    chains = [whole, whole, whole]
    chains.insert(order, sl.EventChain(PUTTING, PAIRS))
    for mode in ("batch", "online"):
        assert rows_of(learn(chains, mode=mode).chain) == rows_of(whole), mode


def test_a_column_that_the_first_example_lacks_is_inserted():
    """Departure: the thesis extends a model by rows only; a first example without some event was never outgrown."""
    whole = sl.EventChain(PUTTING, PAIRS)
    first = sl.EventChain(np.delete(PUTTING, 3, axis=1), PAIRS)
    model = learn([first, whole, whole, whole], mode="online")
    assert rows_of(model.chain) == rows_of(whole)
    assert model.column_weights.tolist() == [1, 1, 1, 0.75, 1, 1]
    assert model.key_frames[0].tolist() == [0, 1, 2, -1, 3, 4]


@pytest.mark.parametrize("p", [0.1, 0.2, 0.3, 0.4])
@pytest.mark.parametrize("size", [(4, 6), (5, 7), (6, 8), (8, 8)])
def test_models_are_right_up_to_noise_of_two_fifths_without_flips(size, p):
    """§3.1.3: "models can be correctly learned until the noise rate 0.4"; other seeds than those of development."""
    seed = noisy_chains.seed(*size, np.random.default_rng([9, *size]))
    rng = np.random.default_rng([10, *size, round(10 * p)])
    model = learn([noisy_chains.sample(seed, p, rng) for _ in range(100)])
    assert rows_of(model.chain) == sorted(map(tuple, seed.tolist()))


def test_a_bad_first_example_spoils_online_learning_and_not_batch():
    bad = sl.EventChain([[2, 9, 2, 9, 0], [9, 2, 9, 0, 9]], [(1, 2), (3, 4)])
    good = [sl.EventChain(PUTTING, PAIRS)] * 9
    learner = OnlineLearner()
    for chain in [bad, *good]:
        learner.add(chain)
    assert learner.accepted == ["1"]
    assert learner.passed_over == [str(i) for i in range(2, 11)]
    with pytest.raises(ValueError, match="at least two that are type-similar, got 1, 9 were not"):
        learner.model()
    assert learn([bad, *good]).chain.relations.tolist() == PUTTING


def test_what_is_kept_of_noise_stays_bounded():
    """Lossy counting: without it every sample would leave its noisy rows behind, about 4000 of them here."""
    seed = noisy_chains.seed(8, 8, np.random.default_rng(3))
    rng = np.random.default_rng(4)
    learner = OnlineLearner(type_threshold_percent=0)
    sizes = []
    for _ in range(1000):
        learner.add(noisy_chains.sample(seed, 0.5, rng))
        sizes.append(learner.size)
    early, late = np.max(sizes[:200], axis=0), np.max(sizes[200:], axis=0)
    assert (late <= 1.5 * early).all()
    assert late.max() < 60


def test_types_are_found_and_each_is_learned():
    rng = np.random.default_rng(5)
    kinds = [PUTTING, TAKING, PUTTING, TAKING, PUTTING, TAKING, PUTTING, TAKING]
    chains = {f"{i}": noisy_chains.sample(np.array(rows, np.uint8), 0.0, rng) for i, rows in enumerate(kinds)}
    learned = learn_types(chains)
    assert learned.classes.tolist() == [0, 1] * 4
    assert [rows_of(model.chain) for model in learned.models] == [
        sorted(map(tuple, rows)) for rows in (PUTTING, TAKING)
    ]
    assert learned.models[1].demonstrations == ("1", "3", "5", "7")


def test_labels_and_order_of_rows_do_not_matter_and_threads_neither():
    seed = noisy_chains.seed(6, 8, np.random.default_rng(6))
    rng = np.random.default_rng(7)
    chains = [noisy_chains.sample(seed, 0.1, rng, flip=True) for _ in range(600)]
    one, two = learn(chains, n_threads=1), learn(chains, n_threads=3)
    assert pickle.dumps(one) == pickle.dumps(two)
    assert rows_of(one.chain) == sorted(map(tuple, seed.tolist()))


def test_roles_key_frames_and_positions_are_kept_of_every_demonstration():
    def seen(labels, frames, shift):
        graphs = []
        for column in np.array(PUTTING).T:
            relations = np.zeros((4, 4))
            for (a, b), code in zip(PAIRS, column, strict=True):
                relations[a - 1, b - 1] = relations[b - 1, a - 1] = 0 if code == 9 else code
            there = [label for label in range(4) if column[0] != 9 or label != 0]
            positions = [[10 * label + shift, shift] for label in there]
            graphs.append(SceneGraph([labels[i] for i in there], relations[np.ix_(there, there)], positions))
        return Observation(graphs, frames, {labels[0]: "hand"}, "px")

    model = learn({"a": seen([1, 2, 3, 4], range(0, 60, 10), 0.5), "b": seen([5, 6, 7, 8], range(3, 9), 1.5)})
    assert model.key_frames.tolist() == [[0, 10, 20, 30, 40, 50], [3, 4, 5, 6, 7, 8]]
    roles = {name: role for role, name in model.chain.names.items()}
    assert [model.roles[name][roles["hand"]] for name in "ab"] == [1, 5]
    hand = model.chain.segments.tolist().index(roles["hand"])
    assert model.positions[1, 2, hand].tolist() == [1.5, 1.5]
    assert np.isnan(model.positions[:, 0, hand]).all()
    assert model.position_unit == "px"


@given(st.integers(0, 2**32), st.sampled_from(["longer", "shorter"]))
@settings(max_examples=60, deadline=None)
def test_step_five_in_the_compiled_loop_is_compare(number, normalizer):
    rng = np.random.default_rng(number)
    a, b = (noisy_chains.seed(int(rng.integers(2, 6)), int(rng.integers(3, 7)), rng) for _ in range(2))
    chains = [sl.EventChain(rows, [(2 * i, 2 * i + 1) for i in range(len(rows))]) for rows in (a, b)]
    match = sl.compare(*chains, normalizer=normalizer)
    codes = [np.minimum(rows, 3) for rows in (a, b)]
    partner, temporal = step_five(*codes, int(normalizer == "shorter"), 0.0, 50_000)
    assert temporal == pytest.approx(match.temporal)
    assert [[i, j] for i, j in enumerate(partner.tolist()) if j >= 0] == match.rows.tolist()


GOOD = sl.EventChain(PUTTING, PAIRS)


@pytest.mark.parametrize(
    ("demonstrations", "options", "message"),
    [
        ([], {}, "demonstrations: expected at least two, got none"),
        ([GOOD], {}, "demonstrations: expected at least two, got 1"),
        ([GOOD, sl.EventChain([[2], [0]], [(1, 2), (2, 3)])], {}, "demonstration 2: .* two columns, got one"),
        ([GOOD, sl.EventChain([[2, 2]], [(1, 2)])], {}, "demonstration 2: .*no row of it ever changes"),
        ([GOOD, sl.EventChain([[0, 2]], [(1, 2)], [-3, 4])], {}, "demonstration 2: expected frame numbers from 0 on"),
        (
            [sl.EventChain([[0, 2, 0]], [(1, 2)]), sl.EventChain([[9, 1, 9]], [(1, 2)])],
            {},
            "common to some, got chains without a common row",
        ),
        ([GOOD, GOOD], {"weight_threshold": 1.5}, "weight_threshold: expected 0 to 1, got 1.5"),
        ([GOOD, GOOD], {"mode": "lazy"}, "mode: expected one of"),
        ([GOOD, GOOD], {"normalizer": "both"}, "normalizer: expected one of"),
    ],
)
def test_bad_input_is_explained(demonstrations, options, message):
    with pytest.raises(ValueError, match=message):
        learn(demonstrations, **options)


def test_a_threshold_that_leaves_nothing_is_refused():
    chains = [sl.EventChain([row], [(1, 2)]) for row in ([0, 2, 0], [9, 1, 9]) for _ in range(2)]
    with pytest.raises(ValueError, match=r"got 0.8, which leaves nothing \(largest weight of a row 0.50"):
        learn(chains, weight_threshold=0.8)


@pytest.mark.parametrize(("n", "told"), [(0, "none"), (2, "2")])
def test_types_are_found_among_three_at_least(n, told):
    with pytest.raises(ValueError, match=f"demonstrations: expected at least three, got {told}"):
        learn_types([GOOD] * n)


def test_something_else_than_a_chain_is_refused():
    with pytest.raises(TypeError, match="demonstration 2: expected an event chain or an observation, got list"):
        learn([GOOD, [[0, 2]]])
    with pytest.raises(TypeError, match="several chains or observations, got a single one"):
        learn(GOOD)
