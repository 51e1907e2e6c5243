"""The opponents of §3.2: the network against its twin, the kernel against its definition, features, bad input."""

import pickle
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.exceptions import NotFittedError

import sec_lab as sl
from sec_lab import _network_kernels as kernels
from sec_lab.baselines import (
    SimilarityClassifier,
    ThesisNetwork,
    boosted_trees,
    chain_features,
    chain_vectors,
    closest_code,
    row_words,
    string_kernel_machine,
)
from sec_lab.event_chain import EventChain
from sec_lab.noise import Noise, noisy_samples, shuffled_rows
from sec_lab.noise_seeds import CLASS_SEEDS
from tests.naive_network import naive_outputs, naive_step

Labelled = tuple[list[EventChain], list[str]]


def labelled(p: float, *, n: int = 30, mode: Any = "flip only", shuffle: bool = False, seed: int = 0) -> Labelled:
    rng = np.random.default_rng(seed)
    chains: list[EventChain] = []
    for chain in CLASS_SEEDS.values():
        samples = noisy_samples(chain, p, n_samples=n, rng=rng, noise=Noise(mode=mode))
        chains += shuffled_rows(samples, rng=rng) if shuffle else list(samples)
    return chains, [name for name in CLASS_SEEDS for _ in range(n)]


def classifiers() -> dict[str, Any]:
    return {
        "network": ThesisNetwork(random_state=0),
        "similarity": SimilarityClassifier(),
        "string kernel": string_kernel_machine(),
        "boosted trees": boosted_trees(n_trees=20, random_state=0),
    }


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_one_step_of_the_network_follows_the_measured_gradient(number: int, by_epoch: bool) -> None:
    rng = np.random.default_rng(number)
    n = 4 if by_epoch else 1
    inputs, wanted = rng.random((n, 6)), np.eye(3)[rng.integers(3, size=n)]
    weights = [rng.normal(size=shape) for shape in ((7, 4), (5, 2), (3, 3))]
    expected = naive_step(inputs, wanted, weights, rate=0.5)
    stepped = [layer.copy() for layer in weights]
    losses = kernels.train(inputs, wanted, np.arange(n)[None], 0.5, by_epoch, *stepped)
    for ours, theirs in zip(stepped, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-7)
    np.testing.assert_allclose(kernels.outputs(inputs, *weights), naive_outputs(inputs, weights), atol=1e-12)
    assert losses[0] == pytest.approx(((naive_outputs(inputs, weights) - wanted) ** 2).mean())


def test_network_has_the_layers_of_figure_3_8_and_repeats_itself() -> None:
    chains, names = labelled(0.1)
    one, two = (ThesisNetwork(epochs=20, random_state=3).fit(chains, names) for _ in range(2))
    assert [layer.shape for layer in one.weights_] == [(37, 5), (6, 5), (6, 4)]
    assert one.loss_curve_.tobytes() == two.loss_curve_.tobytes()
    other = ThesisNetwork(epochs=20, random_state=4).fit(chains, names)
    assert other.loss_curve_.tobytes() != one.loss_curve_.tobytes()
    outputs = one.decision_function(chains)
    assert outputs.shape == (120, 4)
    assert ((outputs > 0) & (outputs < 1)).all()


@pytest.mark.parametrize("name", classifiers())
def test_all_tell_the_classes_apart_at_the_noise_of_their_training(name: str) -> None:
    machine = classifiers()[name].fit(*labelled(0.1))
    chains, names = labelled(0.1, seed=1)
    # Chance is a quarter; three times as much is far from it for all of them.
    assert np.mean(machine.predict(chains) == names) > 0.75
    stored = pickle.loads(pickle.dumps(machine))
    assert stored.predict(chains).tolist() == machine.predict(chains).tolist()
    assert machine.decision_function(chains).shape == (120, 4)


@pytest.mark.parametrize("name", ["similarity", "string kernel", "boosted trees"])
def test_order_of_rows_does_not_matter_to_them(name: str) -> None:
    machine = classifiers()[name].fit(*labelled(0.1))
    chains, _ = labelled(0.2, seed=1)
    rng = np.random.default_rng(0)
    moved = []
    for chain in chains:
        order = rng.permutation(len(chain.pairs))
        moved.append(EventChain(chain.relations[order], chain.pairs[order]))
    np.testing.assert_allclose(machine.decision_function(moved), machine.decision_function(chains), atol=1e-9)


def test_network_fails_where_rows_are_shuffled() -> None:
    network = ThesisNetwork(random_state=0).fit(*labelled(0.1))
    straight, moved = (labelled(0.0, shuffle=shuffle, seed=2) for shuffle in (False, True))
    assert np.mean(network.predict(straight[0]) == straight[1]) == 1.0
    assert np.mean(network.predict(moved[0]) == moved[1]) < 0.75


def test_similarities_are_those_of_compare() -> None:
    machine = SimilarityClassifier(normalizer="shorter", tolerance_percent=10).fit(*labelled(0.1))
    chains, _ = labelled(0.4, mode="flip and add", n=5)
    chains.append(EventChain([[0, 0, 0]], [(1, 2)]))
    found = machine.decision_function(chains)
    for row, chain in zip(found[:-1], chains[:-1], strict=True):
        expected = [
            sl.compare(model.chain, chain, normalizer="shorter", tolerance_percent=10).temporal / 100
            for model in machine.models_
        ]
        assert row.tolist() == expected
    assert found[-1].tolist() == [0, 0, 0, 0]


def test_vectors_are_cut_off_and_filled_up() -> None:
    long = EventChain(np.full((7, 7), 2), [(i + 2, 1) for i in range(7)])
    short = EventChain([[0, 9]], [(1, 2)])
    vectors = chain_vectors([long, short])
    assert vectors.shape == (2, 36)
    assert (vectors[0] == 2 / 9).all()
    assert vectors[1].tolist() == [0.0, *[1.0] * 35]


def test_closest_code_is_the_nearest_of_all_codes() -> None:
    rng = np.random.default_rng(0)
    outputs = rng.random((200, 4))
    distances = np.linalg.norm(outputs[:, None] - np.eye(4), axis=2)
    assert closest_code(outputs).tolist() == distances.argmin(axis=1).tolist()
    assert closest_code([[0.1, 0.2, 0.8, 0.5]]).tolist() == [2]
    for bad in ([0.1, 0.2], [[np.nan, 1.0]], np.empty((2, 0))):
        with pytest.raises(ValueError, match="outputs: expected finite numbers"):
            closest_code(bad)


def test_string_kernel_is_the_sum_over_pairs_of_rows() -> None:
    def words(chain: EventChain) -> list[list[str]]:
        return [row_words(EventChain([row], [(1, 2)])) for row in chain.relations.tolist()]

    a, b = (labelled(0.3, n=1, seed=seed)[0][0] for seed in (1, 2))
    by_pairs = sum(x == y for one, other in product(words(a), words(b)) for x, y in product(one, other))
    counts = [{word: row_words(chain).count(word) for word in row_words(chain)} for chain in (a, b)]
    assert by_pairs == sum(n * counts[1].get(word, 0) for word, n in counts[0].items())
    chains, names = labelled(0.1)
    vectors = string_kernel_machine().fit(chains, names)[:-1].transform([a, b]).toarray()
    norms = [np.sqrt(sum(n * n for n in count.values())) for count in counts]
    assert (vectors @ vectors.T)[0, 1] == pytest.approx(by_pairs / norms[0] / norms[1])


def test_features_count_what_they_say() -> None:
    chain = EventChain([[0, 2, 0, 9], [1, 1, 1, 1]], [(1, 2), (2, 3)])
    features = chain_features([chain])[0]
    assert features.shape == (46,)
    assert features[:3].tolist() == [2, 4, 1]
    assert features[3:7].tolist() == [2 / 8, 4 / 8, 1 / 8, 1 / 8]
    assert features[7:11].tolist() == [0.5, 0.5, 0, 0]
    assert features[15:31].sum() == 1.5  # three changes in two rows
    assert features[31:34].tolist() == [1.5, 0, 3]
    assert features[34:38].tolist() == [1, 0, 1, 1]  # of the one row that changes


def test_bad_input_is_refused() -> None:
    chains, names = labelled(0.1, n=2)
    with pytest.raises(ValueError, match="chains: expected at least one event chain, got none"):
        chain_vectors([])
    with pytest.raises(TypeError, match="chains: expected event chains, got list"):
        chain_features([[[0, 1]]])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="n_inputs: expected at least 1, got 0"):
        chain_vectors(chains, n_inputs=0)
    with pytest.raises(ValueError, match="y: expected at least two classes"):
        ThesisNetwork().fit(chains, ["one"] * 8)
    with pytest.raises(ValueError, match="y: expected one class for each of 8 chains"):
        SimilarityClassifier().fit(chains, names[:3])
    with pytest.raises(ValueError, match="updates: expected one of"):
        ThesisNetwork(updates="never").fit(chains, names)  # type: ignore[arg-type]
    for options, message in (
        ({"epochs": 0}, "epochs: expected a whole number of at least 1, got 0"),
        ({"epochs": 1.5}, "epochs: expected a whole number of at least 1, got 1.5"),
        ({"learning_rate": np.nan}, "learning_rate: expected a finite number above 0, got nan"),
        ({"n_hidden": (5,)}, r"n_hidden: expected two whole numbers of at least 1, got \(5,\)"),
        ({"n_hidden": (0, 5)}, r"n_hidden: expected two whole numbers of at least 1, got \(0, 5\)"),
    ):
        with pytest.raises(ValueError, match=message):
            ThesisNetwork(**options).fit(chains, names)  # type: ignore[arg-type]
    makers: list[Any] = [SimilarityClassifier, ThesisNetwork, string_kernel_machine, boosted_trees]
    for make in makers:
        with pytest.raises(NotFittedError):
            make().predict(chains)
        fitted = make(**({"epochs": 2} if make is ThesisNetwork else {})).fit(chains, names)
        with pytest.raises(TypeError, match="chains: expected a sequence of event chains, got a single one"):
            fitted.predict(chains[0])
        with pytest.raises(TypeError, match="chains: expected event chains, got int"):
            fitted.predict([1, 2])
    with pytest.raises(ValueError, match="cost: expected a number above 0, got 0"):
        string_kernel_machine(cost=0)
    with pytest.raises(ValueError, match="longest: expected at least 1"):
        string_kernel_machine(longest=0)
