"""What was seen in one movie: key frames, scene graphs with positions and names, and the event chain of it all."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_integers
from sec_lab.event_chain import EventChain, Names, as_names, event_chain
from sec_lab.scene_graph import MainGraphs, SceneGraph, as_key_frames
from sec_lab.segmentation import Segmentation
from sec_lab.segmentation.merging import Groups, as_groups, merged_names, merged_segments

PositionUnit = Literal["px", "m", "unknown"]


@dataclass(frozen=True, eq=False)
class Observation:
    """What was seen in one movie.

    Parameters
    ----------
    graphs : sequence of SceneGraph or None
        The main graph of each key frame; None where a key frame is listed but its content was *not recorded*, which
        is not the same as a frame in which everything is absent (A.2).
    key_frames : (n,) array_like of int
        Frame number of each graph, ascending.
    names : mapping of int to str or None, optional
        Names of segments; None marks a segment that is known to be no object (a fragment).
    position_unit : {"px", "m", "unknown"}, optional
        Unit of the positions in the graphs: pixels (column, row) or metres.
    segmentation : Segmentation, optional
        The label images that the graphs come from; iterating over it reads them anew from wherever they are, or
        segments the movie again. It is a stream, no content: copies, pickles and files of the observation are without
        it.

    Raises
    ------
    ValueError
        If there is no key frame, the key frames are not as many as the graphs or not ascending, the unit is unknown,
        a name is neither text nor None, or the segmentation is something else.

    Examples
    --------
    >>> apart, touching = SceneGraph([1, 2], [[0, 0], [0, 0]]), SceneGraph([1, 2], [[0, 2], [2, 0]])
    >>> seen = Observation([apart, None, touching], [4, 7, 9])
    >>> seen.chain.relations, seen.chain.key_frames
    (array([[0, 2]], dtype=uint8), array([4, 9]))
    """

    graphs: tuple[SceneGraph | None, ...]
    key_frames: NDArray[np.int64]
    names: Names
    position_unit: PositionUnit
    segmentation: Segmentation | None = field(repr=False)

    def __init__(
        self,
        graphs: Sequence[SceneGraph | None],
        key_frames: ArrayLike,
        names: Names | None = None,
        position_unit: PositionUnit = "unknown",
        segmentation: Segmentation | None = None,
    ) -> None:
        if not len(graphs):
            raise ValueError("observation: expected at least one key frame, got none")
        if position_unit not in get_args(PositionUnit):
            raise ValueError(f"position_unit: expected one of {get_args(PositionUnit)}, got {position_unit!r}")
        if not isinstance(segmentation, Segmentation | None):
            raise ValueError(f"segmentation: expected a Segmentation, got {type(segmentation).__name__}")
        object.__setattr__(self, "graphs", tuple(graphs))
        object.__setattr__(self, "key_frames", as_key_frames(key_frames, n=len(graphs)))
        object.__setattr__(self, "names", as_names(names))
        object.__setattr__(self, "position_unit", position_unit)
        object.__setattr__(self, "segmentation", segmentation)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.graphs, self.key_frames, dict(self.names), self.position_unit)

    @property
    def recorded(self) -> MainGraphs:
        """The key frames whose content was recorded.

        Raises
        ------
        ValueError
            If none was.
        """
        seen = [(graph, frame) for graph, frame in zip(self.graphs, self.key_frames, strict=True) if graph is not None]
        if not seen:
            raise ValueError(f"observation: expected the content of a key frame, none of {len(self.graphs)} has any")
        return MainGraphs([graph for graph, _ in seen], [frame for _, frame in seen])

    @property
    def chain(self) -> EventChain:
        """Event chain ξ_o of the recorded key frames, one column each (§2.5).

        Raises
        ------
        ValueError
            If nothing was recorded, or fewer than two segments.
        """
        return event_chain(self.recorded, names=self.names)

    @property
    def segments(self) -> NDArray[np.int64]:
        """Labels of all segments that were seen, ascending, shape (n_segments,).

        Raises
        ------
        ValueError
            If nothing was recorded.
        """
        return np.unique(np.concatenate([graph.segments for graph in self.recorded]))


def without_segments(observation: Observation, segments: Iterable[int]) -> Observation:
    """The same observation as if some segments had never been seen.

    Key frames at which nothing else changed are no key frames any more (step 3 is applied again); key frames that were
    not recorded stay. Label images stay as they are.

    Raises
    ------
    ValueError
        If a segment was not seen.

    Examples
    --------
    >>> one, two = SceneGraph([1, 2, 3], np.zeros((3, 3))), SceneGraph([1, 2], np.zeros((2, 2)))
    >>> without_segments(Observation([one, two], [0, 5]), [3]).key_frames
    array([0])
    """
    dropped = as_integers(list(segments), what="segments", ndim=1)
    unknown = np.setdiff1d(dropped, observation.segments)
    if unknown.size:
        raise ValueError(f"segments: expected labels that were seen, got {unknown[0]}")
    smaller = [None if graph is None else _without(graph, dropped) for graph in observation.graphs]
    graphs, frames = _changed(smaller, observation.key_frames)
    names = {label: name for label, name in observation.names.items() if label not in dropped}
    return Observation(graphs, frames, names, observation.position_unit, observation.segmentation)


def merge_segments(observation: Observation, groups: Groups) -> Observation:
    """The same observation with the fragments of objects taken together, by its scene graphs alone (§2.11).

    Of the relations that the fragments of a group had to another segment the closest stays: touching before
    overlapping before non-touching. Key frames at which nothing else changed are no key frames any more. Where label
    images are at hand, relations that are found anew in :func:`~sec_lab.segmentation.merging.merged_segments` are
    better: fragments that surround a segment between them overlap with it, though none of them did.

    Parameters
    ----------
    observation : Observation
    groups : iterable of iterable of int
        Labels that belong together; the first of a group stays.

    Returns
    -------
    Observation
        A node stands in the middle of its fragments. The segmentation, if there is one, is merged too.

    Raises
    ------
    ValueError
        If a label was not seen, a group has fewer than two, or a label is in two groups.

    Examples
    --------
    >>> graph = SceneGraph([1, 2, 3], [[0, 0, 2], [0, 0, 2], [2, 2, 0]])
    >>> merge_segments(Observation([graph], [0]), [[2, 3]]).graphs[0].edges()
    [(1, 2, <Relation.TOUCHING: 2>)]
    """
    checked = as_groups(groups)
    unknown = np.setdiff1d([label for group in checked for label in group], observation.segments)
    if unknown.size:
        raise ValueError(f"groups: expected labels that were seen, got {int(unknown[0])}")
    new_label = {label: group[0] for group in checked for label in group}
    merged = [None if graph is None else _with_labels(graph, new_label) for graph in observation.graphs]
    graphs, frames = _changed(merged, observation.key_frames)
    segmentation = observation.segmentation
    return Observation(
        graphs,
        frames,
        merged_names(observation.names, checked),
        observation.position_unit,
        None if segmentation is None else merged_segments(segmentation, checked),
    )


def without_fragments(observation: Observation) -> Observation:
    """The same observation without the segments whose name is None (recorded as no object).

    Examples
    --------
    >>> graph = SceneGraph([1, 2, 3], np.zeros((3, 3)))
    >>> without_fragments(Observation([graph], [0], {3: None})).segments
    array([1, 2])
    """
    seen = set(observation.segments.tolist())
    fragments = [label for label, name in observation.names.items() if name is None and label in seen]
    return without_segments(observation, fragments)


def _without(graph: SceneGraph, dropped: NDArray[np.int64]) -> SceneGraph:
    keep = np.flatnonzero(~np.isin(graph.segments, dropped))
    return SceneGraph(
        graph.segments[keep],
        graph.relations[np.ix_(keep, keep)],
        None if graph.positions is None else graph.positions[keep],
        None if graph.types is None else [graph.types[i] for i in keep],
    )


def _with_labels(graph: SceneGraph, new_label: dict[int, int]) -> SceneGraph:
    """The graph with some nodes taken together; of several relations the closest, which has the largest code."""
    renamed = np.array([new_label.get(label, label) for label in graph.segments.tolist()], dtype=np.int64)
    segments, first, place = np.unique(renamed, return_index=True, return_inverse=True)
    codes = np.zeros((len(segments), len(segments)), dtype=np.uint8)
    np.maximum.at(codes, (place[:, None], place[None, :]), graph.relations)
    np.fill_diagonal(codes, 0)
    positions = None
    if graph.positions is not None:
        sums = np.zeros((len(segments), graph.positions.shape[1]))
        np.add.at(sums, place, graph.positions)
        positions = sums / np.bincount(place, minlength=len(segments))[:, None]
    types = None if graph.types is None else [graph.types[i] for i in first]
    return SceneGraph(segments, codes, positions, types)


def _changed(
    graphs: Sequence[SceneGraph | None], key_frames: NDArray[np.int64]
) -> tuple[list[SceneGraph | None], list[int]]:
    """The graphs that differ from the one before, and those that were not recorded, with their frames (step 3)."""
    kept: list[SceneGraph | None] = []
    frames: list[int] = []
    last: SceneGraph | None = None
    for graph, frame in zip(graphs, key_frames.tolist(), strict=True):
        if graph is None or last is None or not last.same_relations(graph):
            kept.append(graph)
            frames.append(frame)
        last = graph or last
    return kept, frames
