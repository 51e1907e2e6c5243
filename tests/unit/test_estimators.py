"""The interface of scikit-learn: cloned, validated, searched, pickled."""

import pickle

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.svm import SVC

import sec_lab as sl
from sec_lab.estimators import EventChainClassifier, SimilarityKernel, as_sample, similarities
from sec_lab.similarity import pairwise_similarity
from tests import noisy_chains

SEEDS = [noisy_chains.seed(4, 6, np.random.default_rng([20, i])) for i in range(3)]
RNG = np.random.default_rng(21)
CHAINS = [noisy_chains.sample(rows, 0.1, RNG) for _ in range(8) for rows in SEEDS]
TYPES = ["pour", "push", "stir"] * 8
CHANCE = 1 / 3


@pytest.mark.parametrize("method", ["models", "nearest"])
def test_classifier_learns_and_recognises(method):
    X = as_sample(CHAINS)
    classifier = EventChainClassifier(method=method)
    assert cross_val_score(classifier, X, TYPES, cv=4).mean() > 2 * CHANCE
    fitted = clone(classifier).fit(X, TYPES)
    assert fitted.classes_.tolist() == ["pour", "push", "stir"]
    again = pickle.loads(pickle.dumps(fitted))
    assert again.predict(X).tolist() == fitted.predict(X).tolist()
    assert (method == "models") == all(model is not None for model in fitted.models_)
    assert not hasattr(clone(fitted), "classes_")


def test_options_are_searched():
    search = GridSearchCV(
        EventChainClassifier(), {"method": ["models", "nearest"], "weight_threshold": [0.3, 0.6]}, cv=2
    )
    search.fit(as_sample(CHAINS), TYPES)
    assert search.best_score_ > 2 * CHANCE
    assert set(search.best_params_) == {"method", "weight_threshold"}


@pytest.mark.parametrize("spectrum", ["keep", "clip", "flip"])
def test_kernel_feeds_a_support_vector_machine(spectrum):
    machine = make_pipeline(SimilarityKernel(spectrum=spectrum), SVC(kernel="precomputed", C=10))
    X = as_sample(CHAINS)
    assert cross_val_score(machine, X, TYPES, cv=4).mean() > 2 * CHANCE
    fitted = pickle.loads(pickle.dumps(clone(machine).fit(X, TYPES)))
    assert (fitted.predict(X) == TYPES).all()


def test_negative_eigenvalues_are_reported_and_can_be_removed():
    X = as_sample(CHAINS)
    kernel = SimilarityKernel().fit(X)
    matrix = kernel.transform(X)
    assert np.diag(matrix) == pytest.approx(1)
    values = np.linalg.eigvalsh(matrix)
    assert kernel.eigenvalues_ == pytest.approx(values)
    assert kernel.n_negative_ == (values < -1e-9 * values.max()).sum() > 0
    assert kernel.negative_share_ == pytest.approx(-values[values < 0].sum() / np.abs(values).sum(), rel=1e-6)
    clipped = np.linalg.eigvalsh(SimilarityKernel(spectrum="clip").fit(X).transform(X))
    assert clipped == pytest.approx(np.maximum(values, 0), abs=1e-9)
    flipped = np.linalg.eigvalsh(SimilarityKernel(spectrum="flip").fit(X).transform(X))
    assert flipped == pytest.approx(np.sort(np.abs(values)), abs=1e-9)


def test_similarities_are_those_of_compare():
    table = similarities(CHAINS[:3], CHAINS[3:8], direction="directed")
    expected = [[sl.compare(a, b).temporal for b in CHAINS[3:8]] for a in CHAINS[:3]]
    assert table == pytest.approx(np.array(expected))
    backward = np.array([[sl.compare(b, a).temporal for b in CHAINS[3:8]] for a in CHAINS[:3]])
    assert similarities(CHAINS[:3], CHAINS[3:8]) == pytest.approx((table + backward) / 2)


def test_only_seeds_are_compared_with_others():
    table = pairwise_similarity(CHAINS[:5], n_seeds=2)
    assert np.isfinite(table.temporal[:2, 2:]).all()
    assert np.isnan(table.temporal[:2, :2]).all()
    with pytest.raises(ValueError, match="n_seeds: expected 1 to 4 of 5 chains, got 5"):
        pairwise_similarity(CHAINS[:5], n_seeds=5)


def test_a_class_of_one_demonstration_stands_for_itself():
    classifier = EventChainClassifier().fit(CHAINS[:4], TYPES[:4])
    assert [model is None for model in classifier.models_] == [False, True, True]
    assert classifier.predict(CHAINS[1:3]).tolist() == TYPES[1:3]


def test_bad_input_is_explained():
    with pytest.raises(ValueError, match="X: expected at least one event chain, got none"):
        EventChainClassifier().fit([], [])
    with pytest.raises(TypeError, match="X: expected event chains or observations, got int"):
        EventChainClassifier().fit([1, 2], [1, 2])
    with pytest.raises(ValueError, match="y: expected a class for each of 2 chains, got shape"):
        EventChainClassifier().fit(CHAINS[:2], ["push"])
    with pytest.raises(ValueError, match="method: expected one of"):
        EventChainClassifier(method="guess").fit(CHAINS, TYPES)
    with pytest.raises(ValueError, match="direction: expected mean, smaller or larger for a kernel, got 'directed'"):
        SimilarityKernel(direction="directed").fit(CHAINS)
    with pytest.raises(ValueError, match="spectrum: expected keep, clip or flip, got 'bend'"):
        SimilarityKernel(spectrum="bend").fit(CHAINS)
    two = [sl.EventChain([row], [(1, 2)]) for row in ([0, 2, 0], [9, 1, 9])]
    with pytest.raises(ValueError, match="class push: demonstrations: expected rows that are common to some"):
        EventChainClassifier().fit(two, ["push", "push"])
