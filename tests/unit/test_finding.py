"""Finding learned actions in longer movies."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sec_lab as sl
from sec_lab._finding_kernels import in_order
from sec_lab.finding import OnlineFinder, find_actions, time_slices
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph

# Segments: hand 1, thing 2, plate 3, table 4. The hand comes, and leaves with what it takes.
PAIRS = [(1, 2), (2, 3), (2, 4), (1, 4)]
PUTTING = [[9, 0, 2, 0, 9], [0, 0, 0, 2, 2], [2, 2, 0, 0, 0], [9, 0, 0, 0, 9]]
TAKING = [[9, 0, 2, 9], [2, 2, 0, 9], [0, 0, 0, 9], [9, 0, 0, 9]]


def model_of(rows):
    chain = sl.EventChain(rows, PAIRS)
    return sl.learn([chain, chain])


MODELS = {"putting": model_of(PUTTING), "taking": model_of(TAKING)}


def movie(*parts, frames=None):
    """Parts beside each other, one (rows, hand, thing, plate) each; who is in no row of a part stays as it was."""
    table = 4
    pairs = [[(hand, thing), (thing, plate), (thing, table), (hand, table)] for _, hand, thing, plate in parts]
    known = list(dict.fromkeys(pair for of_part in pairs for pair in of_part))
    last = {}
    for (rows, *_), of_part in zip(reversed(parts), reversed(pairs), strict=True):
        last.update({pair: row[0] for pair, row in zip(of_part, rows, strict=True)})
    columns = []
    for (rows, *_), of_part in zip(parts, pairs, strict=True):
        for column in np.array(rows).T:
            last.update(zip(of_part, column.tolist(), strict=True))
            columns.append([last[pair] for pair in known])
    return sl.EventChain(np.array(columns).T, known, frames)


def told(found):
    return [(one.model, one.begin, one.end) for one in found]


def test_each_action_is_found_alone():
    assert told(find_actions(MODELS, movie((PUTTING, 1, 2, 3)))) == [("putting", 2, 3)]
    assert told(find_actions(MODELS, movie((TAKING, 1, 2, 3)))) == [("taking", 2, 3)]


def test_one_after_the_other_with_other_segments_and_frames():
    frames = [0, 10, 20, 30, 50, 60, 70, 80, 90]
    seen = movie((TAKING, 1, 2, 3), (PUTTING, 1, 5, 3), frames=frames)
    found = find_actions(MODELS, seen)
    assert told(found) == [("taking", 20, 30), ("putting", 70, 80)]
    assert all(one.similarity_percent == pytest.approx(100) for one in found)
    role = {5: "thing", 1: "hand", 3: "plate", 4: "table"}
    assert {role[s] for s in found[1].roles.values()} == set(role.values())


def test_two_hands_at_the_same_time():
    put, take = movie((PUTTING, 1, 2, 3)), movie((TAKING, 6, 7, 8))
    rows = np.vstack([put.relations, take.relations[:, [0, 1, 2, 2, 3]]])
    both = sl.EventChain(rows, [*put.pairs.tolist(), *take.pairs.tolist()])
    assert told(find_actions(MODELS, both)) == [("putting", 2, 3), ("taking", 2, 4)]


def test_the_same_action_twice_is_found_twice():
    seen = movie((PUTTING, 1, 2, 3), (PUTTING, 1, 5, 6))
    assert told(find_actions(MODELS, seen)) == [("putting", 2, 3), ("putting", 7, 8)]


def test_curves_rise_with_the_completion_of_each_action():
    curves = time_slices(MODELS, movie((TAKING, 1, 2, 3), (PUTTING, 1, 5, 3)))
    assert curves.index.tolist() == list(range(9))
    assert curves["taking"][3] == pytest.approx(100)
    assert curves["putting"][3] < 80
    assert curves["putting"][8] == pytest.approx(100)


def graphs_of(chain):
    n = chain.segments.max()
    for column in chain.relations.T:
        absent = {1} if column[chain.pairs.tolist().index([1, 4])] == 9 else set()
        labels = [label for label in range(1, n + 1) if label not in absent]
        relations = np.zeros((n + 1, n + 1))
        for (a, b), code in zip(chain.pairs.tolist(), column.tolist(), strict=True):
            relations[a, b] = relations[b, a] = code if code != 9 else 0
        yield SceneGraph(labels, relations[np.ix_(labels, labels)])


def test_online_it_is_told_when_an_action_may_have_begun_and_when_it_has_ended():
    chain = movie((PUTTING, 1, 2, 3))
    finder = OnlineFinder({"putting": MODELS["putting"]})
    events = []
    for number, graph in enumerate(graph for graph in graphs_of(chain) for _ in range(10)):
        events += [(number, *one) for one in told(finder.add(number, graph))]
    assert events[0] == (20, "putting", 20, None)
    assert events[-1][1:] == ("putting", 20, 30)
    assert events[-1][0] in (30, 40)
    assert len(events) == 2


def test_online_and_afterwards_agree_at_the_end():
    graphs = list(graphs_of(movie((PUTTING, 1, 2, 3), (PUTTING, 1, 5, 3))))
    finder = OnlineFinder(MODELS)
    online = [one for number, graph in enumerate(graphs) for one in told(finder.add(number, graph)) if one[2]]
    afterwards = told(find_actions(MODELS, Observation(graphs, range(len(graphs)))))
    assert set(afterwards) <= set(online)
    with pytest.raises(ValueError, match="frame: expected one after 9, got 9"):
        finder.add(9, graphs[-1])


@given(st.integers(0, 2**32))
@settings(max_examples=50, deadline=None)
def test_ordered_sum_is_the_best_of_all(number):
    rng = np.random.default_rng(number)
    gain = rng.integers(0, 5, (rng.integers(1, 5), rng.integers(1, 5))).astype(float)

    def best(x, t):
        if x == gain.shape[0] or t == gain.shape[1]:
            return 0.0
        return max(best(x + 1, t), best(x, t + 1), gain[x, t] + best(x + 1, t + 1))

    assert in_order(gain, 0, gain.shape[0], 0, gain.shape[1]) == best(0, 0)


def test_bad_input_is_explained():
    chain = movie((PUTTING, 1, 2, 3))
    with pytest.raises(ValueError, match="models: expected a mapping of names to at least one model, got none"):
        find_actions({}, chain)
    with pytest.raises(ValueError, match="model putting: expected an ActionModel, got EventChain"):
        time_slices({"putting": chain}, chain)
    with pytest.raises(ValueError, match="least_percent: expected 0 to 100, got 101"):
        find_actions(MODELS, chain, least_percent=101)
    with pytest.raises(ValueError, match="movie: expected at least two key frames, got one"):
        find_actions(MODELS, sl.EventChain([[0]], [(1, 2)]))
    leaving = sl.EventChain([[2, 0]], [(1, 2)])
    with pytest.raises(ValueError, match="model leaving: expected a row in which a contact comes about, got none"):
        find_actions({"leaving": sl.learn([leaving, leaving])}, chain)


def test_begins_are_in_order():
    found = find_actions(MODELS, movie((PUTTING, 1, 2, 3), (TAKING, 1, 2, 3)))
    assert all(a.begin <= b.begin for a, b in pairwise(found))
