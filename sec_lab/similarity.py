"""Similarity of two manipulations (step 5, §2.6): rows by their changes, then columns by their order.

In the spatial step the compressed rows of two chains are compared (Eq. 2.2–2.5, Table 2.1). Row pairs that are mutually
best may correspond; where several are, there are several permutations (Table 2.2). In the temporal step the permutation
is chosen whose columns agree best, in their order (Eq. 2.7–2.9).
"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sec_lab import _chain_kernels as kernels
from sec_lab._one_to_one import one_to_one
from sec_lab._packed_chains import PackedChains
from sec_lab._packed_chains import check_comparable as check_comparable
from sec_lab._pair_kernels import Chains, Pair, room_to_work
from sec_lab._permutation_kernels import best_permutation
from sec_lab._similarity_kernels import compare_with_later
from sec_lab.event_chain import EventChain

if TYPE_CHECKING:
    import pandas as pd

Normalizer = Literal["longer", "shorter"]
TemporalInput = Literal["original", "derived"]
Direction = Literal["mean", "smaller", "larger", "directed"]
Measure = Literal["temporal", "spatial"]

EFFORT = 50_000
"""Pairs of columns that the search for the best permutation looks at before it gives up the proof."""

# Tables of similarities between kinds of rows above this size are not built, so memory stays bounded (3000² × 8 bytes).
_MAX_KINDS = 3000


@dataclass(frozen=True, eq=False)
class Match:
    """How well chain ``a`` (ξ¹, a seed or model) is found again in chain ``b`` (ξ²) (§2.6).

    Attributes
    ----------
    a, b : EventChain
        The chains that were compared.
    spatial, temporal : float
        ψ_spatial (Eq. 2.4) and ψ_temporal (Eq. 2.9) in percent.
    rows : (n_corresponding, 2) int64
        Corresponding rows: index of the row in ``a.relations``, index of the row in ``b.relations``.
    columns : (n_aligned, 2) int64
        Aligned columns of the temporal input of both chains, ascending in both.
    row_similarity : (m, k) float64
        ζ_spatial in percent: row i is ``a.changing_rows[i]``, column j is ``b.changing_rows[j]`` (Table 2.1).
    candidates : (m, k) bool
        Rows that may correspond: mutually best, up to the tolerance (Eq. 2.5).
    exact : bool
        Whether no permutation of candidates has a larger ψ_temporal.
    normalizer, tolerance_percent, temporal_input
        The choices of :func:`compare`.
    """

    a: EventChain
    b: EventChain
    spatial: float
    temporal: float
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    row_similarity: NDArray[np.float64]
    candidates: NDArray[np.bool_]
    exact: bool
    normalizer: Normalizer
    tolerance_percent: float
    temporal_input: TemporalInput

    def __post_init__(self) -> None:
        _protect(self, "rows", "columns", "row_similarity", "candidates")

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    def row_similarity_frame(self) -> "pd.DataFrame":
        """ζ_spatial with the names of its rows and columns, as in Table 2.1."""
        import pandas as pd

        index, columns = ([chain.row_label(i) for i in chain.changing_rows] for chain in (self.a, self.b))
        return pd.DataFrame(self.row_similarity, index=index, columns=columns)


def compare(
    a: EventChain,
    b: EventChain,
    *,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    temporal_input: TemporalInput = "original",
    effort: int = EFFORT,
) -> Match:
    """Compare two event chains in space and time (step 5, §2.6).

    The comparison is directed: ``a`` is ξ¹. Rows of ``b`` without a partner in ``a`` are ignored (§3.1.1), rows of
    ``a`` without a partner in ``b`` lower the similarity (dummy rows, §2.6.2).

    Parameters
    ----------
    a, b : EventChain
        The seed or model, and the chain that is held against it.
    normalizer : {"longer", "shorter"}, optional
        Row of a pair whose length divides in Eq. 2.2: the longer as printed there, or the shorter, which tolerates
        longer rows and leaves more permutations (§2.7).
    tolerance_percent : float, optional
        Similarities that differ by no more than this count as equal when best rows are looked for; 0 as in Eq. 2.5,
        more for real scenes (§2.6.1, §2.7).
    temporal_input : {"original", "derived"}, optional
        Chain whose columns are compared: ξ_o, or ξ_d as in Aksoy et al. (2011a) (§2.6.2).
    effort : int, optional
        Pairs of columns that are looked at before the search gives up the proof of its optimum: u · v for each partial
        permutation. With the default, small chains are solved exactly and large ones quickly.

    Returns
    -------
    Match

    Raises
    ------
    ValueError
        If a chain has a single column or no change at all, or an option is unknown.

    Examples
    --------
    >>> putting = EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)])
    >>> slower = EventChain([[0, 2, 2, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)])
    >>> match = compare(putting, slower)
    >>> round(match.spatial), round(match.temporal), match.columns.tolist()
    (100, 100, [[0, 0], [1, 2], [2, 3]])

    Notes
    -----
    Readings of the text that reproduce all its numbers: a row counts in Eq. 2.4 if *any* of its maxima is also the
    maximum of its column; u in Eq. 2.9 is the smaller number of columns; the maxima of Eq. 2.9 are taken over ordered
    one-to-one alignments (LCS). Rows that never change drop out of the temporal step too (Table 2.2), and rows without
    any similarity (0 %) never correspond, whatever the tolerance.
    """
    check_options(normalizer, tolerance_percent, temporal_input, effort)
    packed = PackedChains([a, b], ["first chain", "second chain"], derived=temporal_input == "derived")
    (m, k), (u, v) = packed.n_rows.tolist(), packed.n_columns.tolist()
    symbols = [packed.symbols_of(row) for row in range(m + k)]
    shorter = int(normalizer == "shorter")
    similarity = np.array([[kernels.row_similarity(x, y, shorter) for y in symbols[m:]] for x in symbols[:m]])
    candidates = np.empty(m * k, np.bool_)
    spatial_sum, _ = kernels.mutual_best(
        similarity.T.ravel(), m, k, float(tolerance_percent), candidates, np.empty(m), np.empty(m, np.bool_)
    )
    assigned = np.empty(m, np.int64)
    pair = Pair(0, packed.code_starts[1], packed.lane_starts[1], 0, packed.row_starts[1], m, k, u, v, packed.n_codes)
    chains = Chains(packed.codes, packed.lanes, packed.first)
    total, exact = best_permutation(
        chains, pair, candidates, effort, assigned, room_to_work(m, k, u, v, packed.n_codes)
    )
    partners = _spread_over_identical_rows(assigned, packed.first[m:])
    matched = np.flatnonzero(partners >= 0)
    equal = packed.equal_entries(np.column_stack([matched, partners[matched]]))
    aligned = kernels.ordered_columns(equal.ravel(), 0, u, v, v)
    return Match(
        a=a,
        b=b,
        spatial=spatial_sum / m,
        temporal=100.0 * total / min(u, v) / m,
        rows=np.column_stack([a.changing_rows[matched], b.changing_rows[partners[matched]]]).astype(np.int64),
        columns=np.column_stack([np.flatnonzero(aligned >= 0), aligned[aligned >= 0]]).astype(np.int64),
        row_similarity=similarity,
        candidates=candidates.reshape(m, k),
        exact=bool(exact),
        normalizer=normalizer,
        tolerance_percent=float(tolerance_percent),
        temporal_input=temporal_input,
    )


@dataclass(frozen=True, eq=False)
class PairwiseSimilarity:
    """All directed similarities of some chains.

    Attributes
    ----------
    spatial, temporal : (n, n) float64
        Percent; row = ξ¹ (seed), column = ξ². A measure that was not asked for has shape (0, 0).
    exact : (n, n) bool
        Pairs whose temporal similarity is proven to be the optimum; shape (0, 0) if temporal was not asked for.
    """

    spatial: NDArray[np.float64]
    temporal: NDArray[np.float64]
    exact: NDArray[np.bool_]


def pairwise_similarity(
    chains: Sequence[EventChain],
    *,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    temporal_input: TemporalInput = "original",
    effort: int = EFFORT,
    measures: Sequence[Measure] = ("spatial", "temporal"),
    n_seeds: int | None = None,
    n_threads: int | None = None,
    progress: bool = False,
) -> PairwiseSimilarity:
    """Both directed similarities of every pair of chains, with the proofs; see :func:`compare` for the options.

    Parameters
    ----------
    chains : sequence of n EventChain
    measures : sequence of {"spatial", "temporal"}, optional
        What is computed.
    n_seeds : int, optional
        Compare only the first ``n_seeds`` chains with the others; all other similarities are NaN.
    n_threads : int, optional
        Threads to use, all cores if left out; the result is the same for any number.
    progress : bool, optional
        Show a progress bar.

    Raises
    ------
    ValueError
        If there is no chain, a chain has a single column or no change, an option is unknown, or ``n_seeds`` is not 1
        to n − 1.

    Examples
    --------
    >>> chain = EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)])
    >>> pairwise_similarity([chain, chain]).temporal
    array([[100., 100.],
           [100., 100.]])
    """
    for measure in measures:
        if measure not in get_args(Measure):
            raise ValueError(f"measures: expected {get_args(Measure)}, got {measure!r}")
    check_options(normalizer, tolerance_percent, temporal_input, effort)
    packed = PackedChains(chains, [f"chain {i}" for i in range(len(chains))], derived=temporal_input == "derived")
    n = len(chains)
    if n_seeds is not None and not 1 <= n_seeds < n:
        raise ValueError(f"n_seeds: expected 1 to {n - 1} of {n} chains, got {n_seeds}")
    spatial, temporal = (np.full((n, n) if name in measures else (0, 0), np.nan) for name in ("spatial", "temporal"))
    exact = np.zeros(temporal.shape, np.bool_)
    _fill(
        packed,
        normalizer,
        tolerance_percent,
        effort,
        "directed",
        spatial,
        temporal,
        exact,
        n_threads,
        n_seeds=n_seeds,
        progress=progress,
    )
    for array in (spatial, temporal, exact):
        array.setflags(write=False)
    return PairwiseSimilarity(spatial, temporal, exact)


def temporal_of_packed(
    packed: PackedChains, *, shorter: bool, tolerance_percent: float, effort: int, n_threads: int | None
) -> NDArray[np.float64]:
    """Directed ψ_temporal of every pair of chains that are laid out already, (n, n) float64."""
    n = len(packed.n_rows)
    temporal = np.empty((n, n))
    normalizer: Normalizer = "shorter" if shorter else "longer"
    exact = np.empty((n, n), np.bool_)
    _fill(
        packed, normalizer, tolerance_percent, effort, "directed", np.empty((0, 0)), temporal, exact, n_threads,
        progress=False,
    )  # fmt: skip
    return temporal


def similarity_table(
    chains: Sequence[EventChain] | Mapping[str, EventChain],
    *,
    direction: Direction = "mean",
    measure: Measure = "temporal",
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    temporal_input: TemporalInput = "original",
    effort: int = EFFORT,
    n_threads: int | None = None,
    progress: bool = False,
) -> "pd.DataFrame":
    """Table of similarities between all chains in percent (Fig. 2.7, 2.10 (a)).

    Parameters
    ----------
    chains : sequence of n EventChain, or mapping of names to them
    direction : {"mean", "smaller", "larger", "directed"}, optional
        The measure is directed (a chain may be contained in a longer one). The table is made symmetric by the mean of
        both directions (default), the smaller or the larger of them; or it stays directed, with ξ¹ = row.
    measure : {"temporal", "spatial"}, optional
        ψ_temporal, which classification should use (§2.6.2), or ψ_spatial.
    normalizer, tolerance_percent, temporal_input, effort
        As in :func:`compare`.
    n_threads, progress
        As in :func:`pairwise_similarity`.

    Returns
    -------
    pandas.DataFrame
        (n, n) float64; ``attrs`` says the direction, the measure and, for the temporal one, the share of pairs that
        are proven optima (``exact_percent``). One search serves both directions of a pair: with proof both are what
        :func:`compare` finds, without proof the direction from the earlier to the later chain is.

    Raises
    ------
    ValueError
        If there is no chain, a chain has a single column or no change (its name is given), or an option is unknown.

    Examples
    --------
    >>> put = EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)])
    >>> take = EventChain([[0, 2, 2], [2, 2, 0]], [(1, 2), (2, 3)])
    >>> similarity_table({"put": put, "take": take}).round()
            put   take
    put   100.0   83.0
    take   83.0  100.0
    """
    import pandas as pd

    if direction not in get_args(Direction):
        raise ValueError(f"direction: expected one of {get_args(Direction)}, got {direction!r}")
    if measure not in get_args(Measure):
        raise ValueError(f"measure: expected one of {get_args(Measure)}, got {measure!r}")
    check_options(normalizer, tolerance_percent, temporal_input, effort)
    names = list(chains) if isinstance(chains, Mapping) else list(range(len(chains)))
    values = list(chains.values()) if isinstance(chains, Mapping) else list(chains)
    packed = PackedChains(values, [f"chain {name}" for name in names], derived=temporal_input == "derived")
    table, none = np.empty((len(names), len(names))), np.empty((0, 0))
    spatial, temporal = (none, table) if measure == "temporal" else (table, none)
    n_exact = _fill(
        packed, normalizer, tolerance_percent, effort, direction, spatial, temporal, none.astype(bool), n_threads,
        progress=progress,
    )  # fmt: skip
    frame = pd.DataFrame(table, index=names, columns=names, copy=False)
    frame.attrs = {"direction": direction, "measure": measure}
    if measure == "temporal":
        n_pairs = len(names) * (len(names) - 1) // 2
        frame.attrs["exact_percent"] = 100.0 * n_exact / n_pairs if n_pairs else 100.0
    return frame


@dataclass(frozen=True, eq=False)
class Permutation:
    """One way to let rows of the second chain correspond to rows of the first (Table 2.2).

    Attributes
    ----------
    rows : (n_corresponding, 2) int64
        Corresponding rows, as in :class:`Match`.
    columns : (n_aligned, 2) int64
        Aligned columns, as in :class:`Match`.
    temporal : float
        ψ_temporal of this permutation in percent.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    temporal: float

    def __post_init__(self) -> None:
        _protect(self, "rows", "columns")


def permutations(match: Match, *, limit: int = 10_000) -> list[Permutation]:
    """All permutations that the spatial step leaves, with their temporal similarity (Table 2.2).

    Every row of the first chain gets one of its candidates, each row of the second chain at most once; a row stays
    alone only where all its candidates are taken.

    Parameters
    ----------
    match : Match
    limit : int, optional
        More permutations than this are refused instead of listed.

    Raises
    ------
    ValueError
        If there are more than ``limit``.

    Examples
    --------
    >>> twice = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (2, 3)])
    >>> [round(one.temporal) for one in permutations(compare(twice, twice))]
    [100, 67]
    """
    derived = match.temporal_input == "derived"
    packed = PackedChains([match.a, match.b], ["first chain", "second chain"], derived=derived)
    u, v = packed.n_columns.tolist()
    rows_a, rows_b = match.a.changing_rows, match.b.changing_rows
    found: list[Permutation] = []
    for partners in one_to_one(match.candidates):
        if len(found) == limit:
            raise ValueError(f"permutations: expected at most {limit}, there are more")
        equal = packed.equal_entries(partners)
        aligned = kernels.ordered_columns(equal.ravel(), 0, u, v, v)
        rows = [(rows_a[i], rows_b[j]) for i, j in partners]
        columns = np.column_stack([np.flatnonzero(aligned >= 0), aligned[aligned >= 0]])
        temporal = 100.0 * equal[*columns.T].sum() / min(u, v) / len(match.candidates)
        found.append(Permutation(np.array(rows, np.int64).reshape(-1, 2), columns, temporal))
    return found


def _protect(record: object, *names: str) -> None:
    """Replace arrays of a record by copies that cannot be written to."""
    for name in names:
        array = np.array(getattr(record, name))
        array.setflags(write=False)
        object.__setattr__(record, name, array)


def _fill(
    packed: PackedChains,
    normalizer: Normalizer,
    tolerance_percent: float,
    effort: int,
    direction: Direction,
    spatial: NDArray[np.float64],
    temporal: NDArray[np.float64],
    exact: NDArray[np.bool_],
    n_threads: int | None,
    *,
    n_seeds: int | None = None,
    progress: bool,
) -> int:
    """Fill the tables, one task a chain; returns the number of pairs solved exactly."""
    from tqdm import tqdm

    shorter = int(normalizer == "shorter")
    mode = ("directed", "mean", "smaller", "larger").index(direction)
    n, n_kinds = len(packed.n_rows), len(packed.symbol_starts) - 1
    kind_table = np.empty((n_kinds, n_kinds) if n_kinds <= _MAX_KINDS else (0, 0))

    def tabulate(kinds: tuple[int, int]) -> None:
        kernels.row_similarities_of_kinds(packed.symbols, packed.symbol_starts, *kinds, shorter, kind_table)

    def task(i: int) -> int:
        begin = i if n_seeds is None else n_seeds
        n_exact: int = compare_with_later(
            i, begin, packed.row_starts, packed.n_columns, packed.codes, packed.code_starts, packed.lanes,
            packed.lane_starts, packed.n_codes, packed.first, packed.kinds, kind_table, packed.symbols,
            packed.symbol_starts, shorter, float(tolerance_percent), effort, mode, temporal, spatial, exact,
        )  # fmt: skip
        return n_exact

    n_workers = n_threads or len(os.sched_getaffinity(0))
    if n_workers == 1 and not progress:
        if kind_table.size:
            tabulate((0, n_kinds))
        return sum(map(task, range(n_seeds or n)))
    with ThreadPoolExecutor(n_workers) as pool:
        try:
            if kind_table.size:
                edges = np.unique(np.linspace(0, n_kinds, 65).astype(int)).tolist()
                list(pool.map(tabulate, pairwise(edges)))
            done = pool.map(task, range(n_seeds or n))
            return sum(tqdm(done, total=n_seeds or n, unit="chain", desc="comparing", disable=not progress))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _spread_over_identical_rows(classes: NDArray[np.int64], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """Give every row its own partner out of its class of identical rows, in their order; −1 stays −1."""
    members = {int(c): iter(np.flatnonzero(first == c).tolist()) for c in np.unique(first)}
    return np.array([next(members[c]) if c >= 0 else -1 for c in classes.tolist()], np.int64)


def check_options(normalizer: str, tolerance_percent: float, temporal_input: str, effort: int) -> None:
    """Refuse options of :func:`compare` that are unknown or out of range.

    Raises
    ------
    ValueError
    """
    if normalizer not in get_args(Normalizer):
        raise ValueError(f"normalizer: expected one of {get_args(Normalizer)}, got {normalizer!r}")
    if temporal_input not in get_args(TemporalInput):
        raise ValueError(f"temporal_input: expected one of {get_args(TemporalInput)}, got {temporal_input!r}")
    if not 0 <= tolerance_percent <= 100:
        raise ValueError(f"tolerance_percent: expected 0 to 100, got {tolerance_percent}")
    if effort < 1:
        raise ValueError(f"effort: expected at least 1, got {effort}")
