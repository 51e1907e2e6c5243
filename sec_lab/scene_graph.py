"""Relational scene graphs (steps 2 to 3, §2.3) and the main graphs of a sequence (step 3, §2.4)."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation, as_integers
from sec_lab.relations import SegmentRelations

if TYPE_CHECKING:
    import networkx as nx

Comparison = Literal["relations", "spectrum", "eigenvalues"]


@dataclass(frozen=True, eq=False)
class SceneGraph(SegmentRelations):
    """Segments of one picture and their relations, seen as a graph (§2.3).

    Nodes are segments, edges join the pairs that touch or overlap. The graph is undirected and unweighted; which of
    the two relations an edge stands for is kept beside it. An absent segment is no node.

    Parameters
    ----------
    segments, relations, positions
        As of :class:`~sec_lab.relations.SegmentRelations`. The unit of the positions is named by the
        :class:`~sec_lab.observation.Observation`.
    types : sequence of n str, optional
        What is said of each node, in the order of ``segments``, e.g. ``"Red Box"`` (A.2).

    Raises
    ------
    ValueError
        If there is not one type for each segment, or for the reasons of :class:`~sec_lab.relations.SegmentRelations`.

    Examples
    --------
    >>> graph = SceneGraph([4, 1], [[0, 2], [2, 0]], types=["Cup", "Table"])
    >>> graph.edges(), graph.types
    ([(1, 4, <Relation.TOUCHING: 2>)], ('Table', 'Cup'))
    """

    types: tuple[str, ...] | None = None

    def __init__(
        self,
        segments: ArrayLike,
        relations: ArrayLike,
        positions: ArrayLike | None = None,
        types: Sequence[str] | None = None,
    ) -> None:
        super().__init__(segments, relations, positions)
        if types is not None:
            n, names = len(self.segments), list(types)
            if isinstance(types, str) or len(names) != n or not all(isinstance(name, str) for name in names):
                raise ValueError(f"types: expected {n} names, one a segment, got {types!r}")
            types = tuple(str(names[i]) for i in np.argsort(np.asarray(segments), kind="stable"))
        object.__setattr__(self, "types", types)

    def edges(self) -> list[tuple[int, int, Relation]]:
        """Pairs that touch or overlap, smaller label first."""
        upper = np.argwhere(np.triu(self.relations) > 0)
        return [(int(self.segments[i]), int(self.segments[j]), Relation(self.relations[i, j])) for i, j in upper]

    def same_relations(self, other: "SceneGraph") -> bool:
        """Whether both graphs have the same segments in the same relations, wherever they are."""
        return np.array_equal(self.segments, other.segments) and np.array_equal(self.relations, other.relations)


def scene_graph(relations: SegmentRelations, *, types: Sequence[str] | None = None) -> SceneGraph:
    """Scene graph of the relations that were found in one picture (from step 2 to step 3, §2.3).

    Parameters
    ----------
    relations : SegmentRelations
    types : sequence of n str, optional
        What is said of each node, in the order of ``relations.segments``; if left out, a scene graph keeps its own.

    Returns
    -------
    SceneGraph

    Raises
    ------
    ValueError
        If there is not one type for each segment.

    Examples
    --------
    >>> from sec_lab.relations import scan_line_relations
    >>> scene_graph(scan_line_relations([[1, 1, 1], [1, 4, 1], [1, 1, 1]])).edges()
    [(1, 4, <Relation.OVERLAPPING: 1>)]
    """
    if types is None and isinstance(relations, SceneGraph):
        return relations
    return SceneGraph(relations.segments, relations.relations, relations.positions, types)


def to_networkx(graph: SceneGraph) -> "nx.Graph":
    """The graph for networkx: nodes are labels, edges carry ``relation``.

    Examples
    --------
    >>> to_networkx(SceneGraph([1, 4], [[0, 2], [2, 0]])).edges[1, 4]["relation"].name
    'TOUCHING'
    """
    import networkx as nx

    drawn: nx.Graph = nx.Graph()
    drawn.add_nodes_from(graph.segments.tolist())
    drawn.add_edges_from((i, j, {"relation": relation}) for i, j, relation in graph.edges())
    return drawn


@dataclass(frozen=True, eq=False)
class MainGraphs:
    """Main graphs of a sequence: the scene graph of every frame at which the relations changed (§2.4).

    Parameters
    ----------
    graphs : sequence of SceneGraph
        At least one.
    key_frames : (n,) array_like of int
        Frame number of each graph, ascending.

    Raises
    ------
    ValueError
        If there is no graph, or the key frames are not as many or not ascending.
    """

    graphs: tuple[SceneGraph, ...]
    key_frames: NDArray[np.int64]

    def __init__(self, graphs: Sequence[SceneGraph], key_frames: ArrayLike) -> None:
        if not graphs:
            raise ValueError("main graphs: expected at least one scene graph, got none")
        object.__setattr__(self, "graphs", tuple(graphs))
        object.__setattr__(self, "key_frames", as_key_frames(key_frames, n=len(graphs)))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.graphs, self.key_frames)

    def __len__(self) -> int:
        return len(self.graphs)

    def __iter__(self) -> Iterator[SceneGraph]:
        return iter(self.graphs)


def main_graphs(
    graphs: Iterable[SceneGraph],
    *,
    frames: Iterable[int] | None = None,
    method: Comparison = "relations",
) -> MainGraphs:
    """Main graphs of a sequence of scene graphs (step 3, §2.4).

    The graphs are read one after the other; only main graphs are kept, so the sequence may be of any length.

    Parameters
    ----------
    graphs : iterable of SceneGraph
        One a frame.
    frames : iterable of int, optional
        Frame numbers, ascending; 0, 1, 2, … if left out.
    method : {"relations", "spectrum", "eigenvalues"}, optional
        What must change for a new main graph: the labelled relations (default), the eigenvalues or eigenvectors of
        the adjacency matrix (§2.4), or its eigenvalues alone. An edge stands for touching *or* overlapping, so the
        spectrum does not see one turn into the other; nor does it see which labels the nodes have.

    Returns
    -------
    MainGraphs

    Raises
    ------
    ValueError
        If there is no graph, fewer frame numbers than graphs, or the method is unknown.

    Examples
    --------
    >>> apart, touching = SceneGraph([1, 2], [[0, 0], [0, 0]]), SceneGraph([1, 2], [[0, 2], [2, 0]])
    >>> main_graphs([apart, apart, touching, apart]).key_frames
    array([0, 2, 3])
    """
    # Departure: §2.4 compares spectra, but segments carry persistent labels and edges two meanings, so the labelled
    # relations themselves decide by default; the spectrum alone misses 1 -> 2 and 2 -> 1.
    same: Callable[[SceneGraph, SceneGraph], bool]
    if method == "relations":
        same = SceneGraph.same_relations
    elif method in ("spectrum", "eigenvalues"):
        same = partial(same_spectrum, eigenvectors=method == "spectrum")
    else:
        raise ValueError(f"method: expected 'relations', 'spectrum' or 'eigenvalues', got {method!r}")
    kept: list[SceneGraph] = []
    key_frames: list[int] = []
    numbers = None if frames is None else iter(frames)
    for index, graph in enumerate(graphs):
        number = index if numbers is None else next(numbers, None)
        if number is None:
            raise ValueError(f"frames: expected a number for every graph, got {index} numbers")
        if not kept or not same(kept[-1], graph):
            kept.append(graph)
            key_frames.append(number)
    return MainGraphs(kept, key_frames)


def same_spectrum(a: SceneGraph, b: SceneGraph, *, eigenvectors: bool = True, tolerance: float = 1e-6) -> bool:
    """Whether the adjacency matrices of two scene graphs have the same eigenvalues, and eigenvectors (§2.4).

    Eigenvectors of a repeated eigenvalue are not unique, so the projections onto the eigenspaces are compared.

    Parameters
    ----------
    a, b : SceneGraph
    eigenvectors : bool, optional
        Compare eigenspaces too (default).
    tolerance : float, optional
        Largest difference that counts as equal.

    Examples
    --------
    >>> path = SceneGraph([1, 2, 3], [[0, 2, 0], [2, 0, 1], [0, 1, 0]])
    >>> other = SceneGraph([1, 2, 3], [[0, 2, 2], [2, 0, 0], [2, 0, 0]])
    >>> same_spectrum(path, other), same_spectrum(path, other, eigenvectors=False)
    (False, True)
    """
    if len(a.segments) != len(b.segments):
        return False
    if not len(a.segments):
        return True
    (values_a, vectors_a), (values_b, vectors_b) = (np.linalg.eigh((g.relations > 0).astype(float)) for g in (a, b))
    if np.abs(values_a - values_b).max() > tolerance:
        return False
    if not eigenvectors:
        return True
    # Eigenvalues of 0/1 matrices that differ do so by far more than this gap at the sizes that occur.
    starts = np.flatnonzero(np.r_[True, np.diff(values_a) > tolerance])
    for first, last in zip(starts, [*starts[1:], len(values_a)], strict=True):
        space_a, space_b = vectors_a[:, first:last], vectors_b[:, first:last]
        if np.abs(space_a @ space_a.T - space_b @ space_b.T).max() > tolerance:
            return False
    return True


def as_key_frames(values: ArrayLike, *, n: int) -> NDArray[np.int64]:
    """Write-protected copy of ``n`` ascending frame numbers, or one clear error."""
    frames = as_integers(values, what="key frames", ndim=1)
    if len(frames) != n:
        raise ValueError(f"key frames: expected {n} frame numbers, got {len(frames)}")
    back = np.flatnonzero(np.diff(frames) <= 0)
    if back.size:
        i = back[0]
        raise ValueError(f"key frames: expected ascending frame numbers, got {frames[i]} before {frames[i + 1]}")
    frames.setflags(write=False)
    return frames
