"""Chain from pixels against chain from truth: what is missing and what is too much both cost."""

import pytest

from sec_lab.chain_agreement import ChainAgreement, chain_agreement
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.pipeline import observe_segments
from sec_lab.scene_graph import SceneGraph
from sec_lab.similarity import compare

TRUTH = EventChain([[0, 2, 2, 0], [0, 0, 2, 2], [9, 9, 9, 2]], [(1, 2), (1, 3), (2, 3)])
RESTING = EventChain([[0, 0], [2, 2]], [(1, 2), (1, 3)])


def test_of_itself() -> None:
    assert chain_agreement(TRUTH, TRUTH) == ChainAgreement(100, 100)


def test_missing_rows_cost_in_one_direction() -> None:
    two_of_three = EventChain(TRUTH.relations[:2], TRUTH.pairs[:2])
    agreement = chain_agreement(two_of_three, TRUTH)
    assert agreement.found_again == pytest.approx(200 / 3)
    assert agreement.to_the_point == 100
    assert agreement.mean == pytest.approx(250 / 3)


def test_spurious_rows_cost_in_the_other() -> None:
    two_of_three = EventChain(TRUTH.relations[:2], TRUTH.pairs[:2])
    agreement = chain_agreement(TRUTH, two_of_three)
    assert (agreement.found_again, agreement.to_the_point) == (100, pytest.approx(200 / 3))


def test_options_are_those_of_compare() -> None:
    one = EventChain([[0, 2, 9, 0], [9, 9, 2, 2]], [(1, 2), (1, 3)])
    other = EventChain([[9, 2, 9, 0], [0, 9, 9, 0]], [(1, 2), (1, 3)])
    means = set()
    for options in ({}, {"normalizer": "shorter"}, {"normalizer": "shorter", "tolerance_percent": 20}):
        agreement = chain_agreement(one, other, **options)
        assert agreement.found_again == compare(other, one, **options).temporal
        assert agreement.to_the_point == compare(one, other, **options).temporal
        means.add(agreement.mean)
    assert len(means) == 3
    with pytest.raises(ValueError, match="normalizer"):
        chain_agreement(TRUTH, TRUTH, normalizer="none")


def test_chains_without_change() -> None:
    assert chain_agreement(RESTING, TRUTH).mean == 0
    assert chain_agreement(TRUTH, RESTING).mean == 0
    assert chain_agreement(RESTING, RESTING).mean == 100


def test_observations() -> None:
    seen = observe_segments([[[1, 2, 3]], [[1, 3, 2]], [[2, 1, 3]]])
    assert chain_agreement(seen, seen.chain).mean == 100
    blind = Observation([SceneGraph([1], [[0]])], [0])
    assert chain_agreement(blind, seen).mean == 0
    with pytest.raises(ValueError, match="content"):
        chain_agreement(Observation([None], [0]), seen)
