"""Classifiers against each other (§3.2.2): counts, test and curves, held against counting by hand."""

import pickle
from math import comb
from typing import Any

import numpy as np
import pytest
from sklearn.exceptions import NotFittedError

from sec_lab.baselines import SimilarityClassifier, ThesisNetwork, boosted_trees, string_kernel_machine
from sec_lab.noise import Noise
from sec_lab.noise_seeds import CLASS_SEEDS
from sec_lab.opponents import (
    OpponentStudy,
    labelled_samples,
    opponent_study,
    paired_test,
    positives,
    precision_recall,
    right_percent,
)


def made_up() -> OpponentStudy:
    """Two classes of four and two levels; the first classifier errs twice at the first level."""
    known = np.array([0, 0, 0, 0, 1, 1, 1, 1])
    good = np.stack([[0, 0, 0, 1, 1, 1, 1, 0], known])
    bad = np.stack([[1, 1, 1, 1, 1, 1, 1, 0], 1 - known])
    outputs = {name: np.eye(2)[answers].astype(float) for name, answers in (("good", good), ("bad", bad))}
    return OpponentStudy(("a", "b"), np.array([0.1, 0.5]), known, {"good": good, "bad": bad}, outputs)


def test_positives_are_counted_per_class() -> None:
    frame = positives(made_up(), "good")
    assert frame.loc[0.1].to_dict() == {("a", "TP"): 75, ("a", "FP"): 25, ("b", "TP"): 75, ("b", "FP"): 25}
    bad = positives(made_up(), "bad").loc[0.1].to_dict()
    assert bad == {("a", "TP"): 0, ("a", "FP"): 25, ("b", "TP"): 75, ("b", "FP"): 100}
    assert right_percent(made_up())["good"].tolist() == [75, 100]


def test_paired_test_is_that_of_mcnemar_with_holm() -> None:
    found = paired_test(made_up(), "good", "bad")
    assert found["only good"].tolist() == [3, 8]
    assert found["only bad"].tolist() == [0, 0]
    # Two-sided: all of 3, and all of 8, fall on one side.
    assert comb(3, 0) / 2**2 == found["chance"].iloc[0]
    assert found["chance"].iloc[1] == pytest.approx(2 / 2**8)
    assert found["chance, corrected"].tolist() == pytest.approx([0.25, 2 * 2 / 2**8])
    assert paired_test(made_up(), "good", "good")["chance, corrected"].tolist() == [1, 1]


def test_precision_and_recall_reach_the_counts() -> None:
    recall, precision = precision_recall(made_up(), "good", 0.1)["a"]
    # At the threshold of 1 four samples are retrieved, three of which belong to the four of the class.
    assert (0.75, 0.75) in list(zip(recall.tolist(), precision.tolist(), strict=True))
    recall, precision = precision_recall(made_up(), "good", 0.5)["a"]
    assert (1.0, 1.0) in list(zip(recall.tolist(), precision.tolist(), strict=True))
    with pytest.raises(ValueError, match=r"level: expected one of \[0.1, 0.5\], got 0.3"):
        precision_recall(made_up(), "good", 0.3)


def test_all_judge_the_same_fresh_samples() -> None:
    training = labelled_samples(CLASS_SEEDS, 0.1, n_samples=20, rng=np.random.default_rng(0))
    machines = {
        "network": ThesisNetwork(epochs=200, random_state=0).fit(*training),
        "kernel": string_kernel_machine().fit(*training),
        "trees": boosted_trees(n_trees=5, random_state=0).fit(*training),
    }
    options = {"levels": [0.0, 0.2], "n_samples": 5}
    one, two = (opponent_study(machines, CLASS_SEEDS, rng=np.random.default_rng(1), **options) for _ in range(2))  # type: ignore[arg-type]
    alone = opponent_study(
        {"kernel": machines["kernel"]}, CLASS_SEEDS, rng=np.random.default_rng(1), levels=[0.0, 0.2], n_samples=5
    )
    for name in machines:
        assert one.answers[name].shape == (2, 20)
        assert one.outputs[name].shape == (2, 20, 4)
        assert one.answers[name].tolist() == two.answers[name].tolist()
        # Outputs stand in the order of the classes of the study, not in the alphabet's.
        assert (one.outputs[name].argmax(axis=2) == one.answers[name]).mean() > 0.9
    assert one.answers["kernel"].tolist() == alone.answers["kernel"].tolist()
    assert (one.answers["kernel"][0] == one.known).all()


def test_samples_are_shuffled_and_added_to_if_asked_for() -> None:
    rng = np.random.default_rng(0)
    straight, names = labelled_samples(CLASS_SEEDS, 0.0, n_samples=3, rng=rng)
    moved, _ = labelled_samples(CLASS_SEEDS, 0.0, n_samples=3, rng=rng, shuffle=True)
    added, _ = labelled_samples(CLASS_SEEDS, 1.0, n_samples=3, rng=rng, noise=Noise())
    assert names.tolist() == [name for name in CLASS_SEEDS for _ in range(3)]
    assert {chain.relations.shape for chain in added} == {(11, 11)}
    same = [np.array_equal(a.relations, b.relations) for a, b in zip(straight, moved, strict=True)]
    assert sum(same) < 3
    with pytest.raises(ValueError, match="classifiers: expected at least one, got none"):
        opponent_study({}, CLASS_SEEDS, rng=rng)


def test_relative_outputs_are_held_against_the_best_other_one_of_the_sample() -> None:
    outputs = np.array([[[0.5, 0.1, 0.4], [0.3, 0.2, 0.1], [0.6, 0.9, 0.2], [0.55, 0.7, 0.8]]])
    known, answers = np.array([0, 0, 1, 2]), np.array([[0, 0, 1, 2]])
    study = OpponentStudy(("a", "b", "c"), np.array([0.1]), known, {"one": answers}, {"one": outputs})
    # The largest outputs for "a" belong to samples of others; less the best other one, its own come first.
    recall, precision = precision_recall(study, "one", 0.1)["a"]
    assert precision[recall == 0.5].max() < 1
    recall, precision = precision_recall(study, "one", 0.1, relative=True)["a"]
    assert precision[recall == 1.0].max() == 1


def test_a_study_can_be_sent_elsewhere() -> None:
    here = made_up()
    there = pickle.loads(pickle.dumps(here))
    assert there.classes == here.classes
    for name in here.answers:
        assert np.array_equal(there.answers[name], here.answers[name])
        assert np.array_equal(there.outputs[name], here.outputs[name])


def test_two_classes_have_one_column_each() -> None:
    two = {name: CLASS_SEEDS[name] for name in ("pushing", "cutting")}
    training = labelled_samples(two, 0.1, n_samples=10, rng=np.random.default_rng(0))
    machines: dict[str, Any] = {
        "similarity": SimilarityClassifier().fit(*training),
        "kernel": string_kernel_machine().fit(*training),
        "trees": boosted_trees(n_trees=5, random_state=0).fit(*training),
    }
    study = opponent_study(machines, two, rng=np.random.default_rng(1), n_samples=10, levels=[0.1])
    for name in machines:
        assert study.outputs[name].shape == (1, 20, 2)
        assert (study.outputs[name].argmax(axis=2) == study.answers[name]).all()
        assert (study.answers[name] == study.known).mean() > 0.9


def test_bad_input_is_told_by_its_name(capsys: pytest.CaptureFixture[str]) -> None:
    training = labelled_samples(CLASS_SEEDS, 0.0, n_samples=2, rng=np.random.default_rng(0))
    kernel: dict[str, Any] = {"kernel": string_kernel_machine().fit(*training)}
    options: dict[str, Any] = {"rng": np.random.default_rng(0), "levels": [0.1], "n_samples": 2}
    for changed, message in (
        ({"levels": []}, "levels: expected at least one noise level, got none"),
        ({"n_samples": -1}, "n_samples: expected a whole number of at least 1, got -1"),
        ({"levels": [2]}, "p: expected a probability from 0 to 1, got 2"),
    ):
        with pytest.raises(ValueError, match=message):
            opponent_study(kernel, CLASS_SEEDS, **{**options, **changed})
    with pytest.raises(ValueError, match=r"seeds: expected the classes of 'kernel', .*, got \['foo'\]"):
        opponent_study(kernel, {"foo": CLASS_SEEDS["moving"]}, **options)
    with pytest.raises(NotFittedError, match="classifiers: expected fitted ones, got 'kernel'"):
        opponent_study({"kernel": string_kernel_machine()}, CLASS_SEEDS, **options)
    with pytest.raises(TypeError, match="classifiers: expected a mapping"):
        opponent_study([], CLASS_SEEDS, **options)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="seeds: expected at least one, got none"):
        labelled_samples({}, 0.1, rng=np.random.default_rng(0))
    study = made_up()
    for call in (
        lambda: positives(study, "foo"),
        lambda: paired_test(study, "good", "foo"),
        lambda: precision_recall(study, "foo", 0.1),
    ):
        with pytest.raises(ValueError, match=r"classifier: expected one of \['good', 'bad'\], got 'foo'"):
            call()
    assert not capsys.readouterr().err
    opponent_study(kernel, CLASS_SEEDS, **options, progress=True)
    assert "judging" in capsys.readouterr().err
