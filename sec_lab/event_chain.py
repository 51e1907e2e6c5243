"""Semantic event chains (step 4, §2.5): the table of all relations in the main graphs, and its two compressions."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation, Relations, as_integers, as_relations
from sec_lab.scene_graph import Comparison, MainGraphs, SceneGraph, as_key_frames, main_graphs

if TYPE_CHECKING:
    import pandas as pd

Names = Mapping[int, str | None]
_NO_NAMES: Names = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class EventChain:
    """Original semantic event chain ξ_o: relations of segment pairs (rows) in the main graphs (columns) (§2.5).

    Parameters
    ----------
    relations : (n_pairs, n_key_frames) array_like of {0, 1, 2, 9}
        :class:`~sec_lab.codes.Relation` codes; at least one row and one column.
    pairs : (n_pairs, 2) array_like of int
        Segment labels of each row; each unordered pair once.
    key_frames : (n_key_frames,) array_like of int, optional
        Frame number of each column, ascending; 0, 1, 2, … if left out.
    names : mapping of int to str or None, optional
        Names of segments; None marks a segment that is known to be no object (a fragment).

    Raises
    ------
    ValueError
        If the table is empty or ragged, a code is unknown, a pair is repeated or joins a segment to itself, shapes
        disagree, the key frames are not ascending, or a name is neither text nor None.

    Examples
    --------
    >>> chain = EventChain([[1, 2, 1, 1], [0, 0, 0, 0]], [(2, 1), (3, 2)])
    >>> chain.derived
    array([[12, 21, 11]], dtype=uint8)
    >>> chain.compressed
    (array([12, 21], dtype=uint8),)
    """

    relations: Relations
    pairs: NDArray[np.int64]
    key_frames: NDArray[np.int64]
    names: Names

    def __init__(
        self,
        relations: ArrayLike,
        pairs: ArrayLike,
        key_frames: ArrayLike | None = None,
        names: Names | None = None,
    ) -> None:
        codes = as_relations(relations, ndim=2)
        n_pairs, n_key_frames = codes.shape
        if not codes.size:
            raise ValueError(f"event chain: expected at least one row and one column, got shape {codes.shape}")
        labels = as_integers(pairs, what="pairs", ndim=2)
        if labels.shape != (n_pairs, 2):
            raise ValueError(f"pairs: expected shape ({n_pairs}, 2) for {n_pairs} rows, got {labels.shape}")
        _check_pairs(labels)
        frames = as_key_frames(np.arange(n_key_frames) if key_frames is None else key_frames, n=n_key_frames)
        codes.setflags(write=False)
        labels.setflags(write=False)
        object.__setattr__(self, "relations", codes)
        object.__setattr__(self, "pairs", labels)
        object.__setattr__(self, "key_frames", frames)
        object.__setattr__(self, "names", as_names(names))

    @classmethod
    def unchecked(cls, relations: Relations, pairs: NDArray[np.int64], names: Names) -> "EventChain":
        """Chain of arrays that are known to be right, without a copy and without a look at them; numbered key frames.

        Parameters
        ----------
        relations : (n_pairs, n_key_frames) uint8
        pairs : (n_pairs, 2) int64
            Both belong to the chain from now on.
        names : mapping of int to str or None
            Of another chain.
        """
        chain = object.__new__(cls)
        frames = np.arange(relations.shape[1])
        for name, array in (("relations", relations), ("pairs", pairs), ("key_frames", frames)):
            array.setflags(write=False)
            object.__setattr__(chain, name, array)
        object.__setattr__(chain, "names", names)
        return chain

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.relations, self.pairs, self.key_frames, dict(self.names))

    @property
    def segments(self) -> NDArray[np.int64]:
        """Labels of all segments, ascending, shape (n_segments,)."""
        return np.unique(self.pairs)

    @property
    def changing_rows(self) -> NDArray[np.intp]:
        """Indices of the rows in which something happens; the other rows define no event (§2.5)."""
        return np.flatnonzero((self.relations != self.relations[:, :1]).any(axis=1))

    @property
    def derived(self) -> NDArray[np.uint8]:
        """Derivative ξ_d, shape (n_changing_rows, n_key_frames − 1): 12 is a change from 1 to 2, 11 is none (§2.5)."""
        rows = self.relations[self.changing_rows]
        return 10 * rows[:, :-1] + rows[:, 1:]

    @property
    def compressed(self) -> tuple[NDArray[np.uint8], ...]:
        """Compressed chain ξ_c: the changes of each changing row in their order, without time (§2.5)."""
        return tuple(row[row // 10 != row % 10] for row in self.derived)

    def row_label(self, row: int) -> str:
        """Name of a row: names of its two segments where known, their labels otherwise."""
        return ", ".join(self.names.get(int(label)) or str(label) for label in self.pairs[row])

    def to_frame(self) -> "pd.DataFrame":
        """Table for people: one row a pair, one column a key frame.

        Examples
        --------
        >>> EventChain([[0, 2]], [(2, 1)], [4, 17], {1: "table"}).to_frame().loc["2, table"].tolist()
        [0, 2]
        """
        import pandas as pd

        index = pd.Index([self.row_label(i) for i in range(len(self.pairs))], name="pair")
        return pd.DataFrame(self.relations, index=index, columns=pd.Index(self.key_frames, name="key frame"))


def event_chain(
    graphs: Iterable[SceneGraph],
    *,
    frames: Iterable[int] | None = None,
    names: Names | None = None,
    method: Comparison = "relations",
) -> EventChain:
    """Event chain of a sequence of scene graphs (steps 3 and 4, §2.4, §2.5).

    Parameters
    ----------
    graphs : iterable of SceneGraph, or MainGraphs
        One a frame; of :class:`~sec_lab.scene_graph.MainGraphs` the key frames are kept as they are.
    frames : iterable of int, optional
        Frame numbers of the graphs; 0, 1, 2, … if left out.
    names : mapping of int to str or None, optional
        Names of segments.
    method : {"relations", "spectrum", "eigenvalues"}, optional
        How main graphs are found, see :func:`~sec_lab.scene_graph.main_graphs`.

    Returns
    -------
    EventChain
        All ρ_total = n (n − 1) / 2 pairs of the n segments that ever occur (Eq. 2.1), smaller label last as in
        ρ_{2,1}, in the order of the thesis: (2, 1), (3, 1), …, (3, 2), …

    Raises
    ------
    ValueError
        If there is no graph, fewer than two segments occur, or main graphs are given other frame numbers.

    Examples
    --------
    >>> apart, touching = SceneGraph([1, 2], [[0, 0], [0, 0]]), SceneGraph([1, 2], [[0, 2], [2, 0]])
    >>> event_chain([apart, apart, touching]).relations
    array([[0, 2]], dtype=uint8)
    """
    if isinstance(graphs, MainGraphs) and frames is not None:
        raise ValueError("frames: expected none beside main graphs, which have their key frames")
    main = graphs if isinstance(graphs, MainGraphs) else main_graphs(graphs, frames=frames, method=method)
    labels = np.unique(np.concatenate([graph.segments for graph in main]))
    n = len(labels)
    if n < 2:
        raise ValueError(f"event chain: expected at least two segments, got {n}")
    cube = np.full((len(main), n, n), Relation.ABSENT, dtype=np.uint8)
    for layer, graph in zip(cube, main, strict=True):
        at = np.searchsorted(labels, graph.segments)
        layer[np.ix_(at, at)] = graph.relations
    first, second = np.triu_indices(n, k=1)
    pairs = np.column_stack([labels[second], labels[first]])
    return EventChain(cube[:, first, second].T, pairs, main.key_frames, names)


def as_names(names: Names | None) -> Names:
    """Read-only copy of the names of segments.

    Raises
    ------
    ValueError
        If a label is no whole number, or a name neither text nor None.

    Examples
    --------
    >>> as_names({1: "cup", 2: 3.5})
    Traceback (most recent call last):
    ...
    ValueError: names: expected text or None, got 3.5
    """
    if names is None:
        return _NO_NAMES
    if not isinstance(names, Mapping):
        raise ValueError(f"names: expected a mapping of segments to names, got {type(names).__name__}")
    given = dict(names)
    labels = as_integers(list(given), what="labels of names", ndim=1)
    for name in given.values():
        if not isinstance(name, str | None):
            raise ValueError(f"names: expected text or None, got {name!r}")
    texts = (None if name is None else str(name) for name in given.values())
    return MappingProxyType(dict(zip(labels.tolist(), texts, strict=True)))


def _check_pairs(pairs: NDArray[np.int64]) -> None:
    itself = pairs[:, 0] == pairs[:, 1]
    if itself.any():
        raise ValueError(f"pairs: expected two different segments, got {tuple(pairs[itself][0].tolist())}")
    # Pairs in one order of labels, one below the other: the same pair twice makes two neighbours alike.
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    order = np.lexsort((high, low))
    low, high = low[order], high[order]
    again = np.flatnonzero((low[1:] == low[:-1]) & (high[1:] == high[:-1]))
    if again.size:
        twice = int(low[again[0]]), int(high[again[0]])
        raise ValueError(f"pairs: expected each pair once, got {twice} twice")
