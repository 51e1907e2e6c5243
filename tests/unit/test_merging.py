"""Fragments taken together, in label images and in scene graphs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sec_lab import EventChain, Observation, SceneGraph, Segmentation, observe, observe_segments
from sec_lab.codes import Relation
from sec_lab.observation import merge_segments
from sec_lab.segmentation.merging import merged_labels, merged_segments
from sec_lab.segmentation.record import FoundNames


@given(arrays(np.uint8, (4, 5), elements=st.integers(0, 6)), st.permutations(range(7)))
def test_each_pixel_by_itself(labels: np.ndarray, order: list[int]) -> None:
    groups = [order[:3], order[3:5]]
    expected = [[next((g[0] for g in groups if int(x) in g), int(x)) for x in row] for row in labels]
    assert merged_labels(labels, groups).tolist() == expected


@pytest.mark.parametrize(
    ("groups", "says"),
    [([[3]], r"at least two segments to merge, got \[3\]"), ([[1, 2], [2, 3]], "2 twice"), ([[1, -1]], "got -1")],
)
def test_what_no_group_is(groups: list[list[int]], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        merged_labels([[1]], groups)


def test_the_background_and_names_that_are_found_later_stay() -> None:
    asked = []
    names = FoundNames(lambda: asked.append(1) or {2: None, 3: "cup"})  # type: ignore[func-returns-value]
    whole = merged_segments(Segmentation.from_labels([[[1, 2, 3]]], background=1, names=names), [[4, 1], [2, 3]])
    assert not asked
    assert (whole.background, dict(whole.names)) == (4, {2: "cup"})
    assert [image.tolist() for image in whole] == [[[4, 2, 2]]]


def halves() -> np.ndarray:
    """A cup of two halves, left and right, moves to a box: they touch each other, and the box one after the other."""
    labels = np.ones((5, 12, 30), dtype=np.uint8)
    labels[:, 3:9, 20:26] = 4
    for image, left in zip(labels, (2, 6, 10, 12, 12), strict=True):
        image[3:9, left : left + 4], image[3:9, left + 4 : left + 8] = 2, 3
    return labels


def test_the_chain_of_the_whole_is_as_if_there_never_were_fragments() -> None:
    labels = halves()
    whole = np.where(labels == 3, 2, labels)
    merged = merged_segments(Segmentation.from_labels(labels), [[2, 3]])
    for method in (observe, observe_segments):
        chain, expected = method(merged).chain, method(Segmentation.from_labels(whole)).chain
        assert np.array_equal(chain.relations, expected.relations)
        assert np.array_equal(chain.pairs, expected.pairs)


def test_graphs_alone_keep_the_closest_relation() -> None:
    seen = observe_segments(halves())
    merged = merge_segments(seen, [[2, 3]])
    assert isinstance(merged.chain, EventChain)
    assert merged.segments.tolist() == [1, 2, 4]
    for graph, frame in zip(merged.graphs, merged.key_frames, strict=True):
        before = seen.graphs[int(np.searchsorted(seen.key_frames, frame, side="right")) - 1]
        assert graph is not None
        assert before is not None
        assert graph.relation(2, 4) == max(before.relation(2, 4), before.relation(3, 4))


def test_key_frames_go_where_only_fragments_had_changed_and_unrecorded_ones_stay() -> None:
    apart, touching = ([[0, a, 2], [a, 0, 2], [2, 2, 0]] for a in (0, 2))
    positions = [[0, 0], [4, 2], [9, 9]]
    first, second = (SceneGraph([1, 2, 3], r, positions, ["a", "b", "c"]) for r in (apart, touching))
    merged = merge_segments(Observation([first, None, second], [0, 3, 5], {2: "left"}), [[1, 2]])
    assert merged.key_frames.tolist() == [0, 3]
    assert merged.graphs[1] is None
    (graph,) = merged.recorded
    assert graph.positions is not None
    assert graph.positions.tolist() == [[2, 1], [9, 9]]
    assert graph.edges() == [(1, 3, Relation.TOUCHING)]
    assert (graph.types, dict(merged.names)) == (("a", "c"), {1: "left"})
    with pytest.raises(ValueError, match="labels that were seen, got 8"):
        merge_segments(merged, [[1, 8]])
