"""Event chains laid out in flat arrays for the compiled loops of :mod:`sec_lab._similarity_kernels`."""

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sec_lab import _chain_kernels as kernels
from sec_lab.event_chain import EventChain

_CODE_OF_RELATION = np.zeros(10, np.uint8)
_CODE_OF_RELATION[[0, 1, 2, 9]] = 0, 1, 2, 3
N_RELATIONS = 4


class PackedChains:
    """Changing rows of some chains; identical rows and kinds of compressed rows are numbered.

    Parameters
    ----------
    chains : sequence of n EventChain
    names : sequence of n str
        What the chains are called in error messages.
    derived : bool
        Compare the columns of ξ_d instead of those of ξ_o.

    Attributes
    ----------
    n_rows, n_columns : (n,) int64
    row_starts, code_starts, lane_starts : (n + 1,) int64
        Where chains begin in ``first`` and ``kinds``, in ``codes``, and in ``lanes``.
    codes : flat uint8
        Entries, row by row, as codes below ``n_codes``.
    first : (total rows,) int64
        First row of the same chain with the same entries.
    kinds : (total rows,) int64
        Number of the compressed row among all different ones, which lie in ``symbols`` from ``symbol_starts`` on.

    Raises
    ------
    ValueError
        If there is no chain, or one of them has a single column, no change or too many rows.
    """

    def __init__(self, chains: Sequence[EventChain], names: Sequence[str], *, derived: bool) -> None:
        if not len(chains):
            raise ValueError("chains: expected at least one event chain, got none")
        tables = []
        for chain, name in zip(chains, names, strict=True):
            changing = check_comparable(chain, name)
            tables.append(_CODE_OF_RELATION[chain.relations[changing]])
        self._lay_out(tables, derived=derived)

    @classmethod
    def of_tables(cls, tables: Sequence[NDArray[np.uint8]]) -> "PackedChains":
        """Lay out tables of codes, every row of which changes, for the comparison of ξ_o."""
        packed = cls.__new__(cls)
        packed._lay_out(tables, derived=False)
        return packed

    def _lay_out(self, tables: Sequence[NDArray[np.uint8]], *, derived: bool) -> None:
        shapes = np.array([rows.shape for rows in tables], np.int64)
        self.n_rows, n_columns = shapes[:, 0].copy(), shapes[:, 1].copy()
        self.row_starts = _starts(self.n_rows)
        given = np.concatenate([rows.ravel() for rows in tables])
        self.first = np.empty(self.row_starts[-1], np.int64)
        symbols, starts = np.empty(len(given), np.uint8), np.empty(len(self.first) + 1, np.int64)
        kernels.describe_rows(given, self.n_rows, n_columns, N_RELATIONS, self.first, symbols, starts)
        kinds: dict[bytes, int] = {}
        text, ends = symbols.tobytes(), starts.tolist()
        self.kinds = np.array([kinds.setdefault(text[a:b], len(kinds)) for a, b in pairwise(ends)], np.int64)
        self.symbols = np.frombuffer(b"".join(kinds), np.uint8)
        self.symbol_starts = _starts(np.array([len(kind) for kind in kinds]))
        if derived:
            tables = [N_RELATIONS * rows[:, :-1] + rows[:, 1:] for rows in tables]
        self.n_codes = N_RELATIONS**2 if derived else N_RELATIONS
        self.n_columns = n_columns - derived
        self.codes = np.concatenate([rows.ravel() for rows in tables]) if derived else given
        self.code_starts = _starts(self.n_rows * self.n_columns)
        self.lane_starts = _starts(self.n_rows * self.n_codes * -(-self.n_columns // kernels.LANES))
        self.lanes = np.zeros(self.lane_starts[-1], np.uint64)
        kernels.fill_all_lanes(
            self.codes, self.code_starts, self.n_rows, self.n_columns, self.n_codes, self.lanes, self.lane_starts
        )

    def symbols_of(self, row: int) -> NDArray[np.uint8]:
        """Compressed form of a row, counted through all chains."""
        kind = self.kinds[row]
        return self.symbols[self.symbol_starts[kind] : self.symbol_starts[kind + 1]]

    def codes_of(self, i: int) -> NDArray[np.uint8]:
        """Entries of chain i, shape (n_rows, n_columns)."""
        return self.codes[self.code_starts[i] : self.code_starts[i + 1]].reshape(self.n_rows[i], -1)

    def equal_entries(self, partners: Iterable[Sequence[int]]) -> NDArray[np.uint16]:
        """Equal entries of every pair of columns of chains 0 and 1 over corresponding rows: q · θ / 100 (Eq. 2.7)."""
        a, b = self.codes_of(0), self.codes_of(1)
        equal = np.zeros((a.shape[1], b.shape[1]), np.uint16)
        for i, j in partners:
            equal += a[i][:, None] == b[j]
        return equal


def check_comparable(chain: EventChain, name: str) -> NDArray[np.intp]:
    """Numbers of the rows of a chain that change; refuses a chain that nothing can be compared with.

    Parameters
    ----------
    chain : EventChain
    name : str
        What it is called in the error message.

    Raises
    ------
    TypeError
        If it is no event chain.
    ValueError
        If it has a single column, no change or too many rows that change.
    """
    if not isinstance(chain, EventChain):
        raise TypeError(f"{name}: expected an event chain, got {type(chain).__name__}")
    changing = chain.changing_rows
    n_changing = len(changing)
    if chain.relations.shape[1] < 2:
        raise ValueError(f"{name}: expected an event chain of at least two columns, got one")
    if not n_changing:
        raise ValueError(f"{name}: expected an event chain with a change, but no row of it ever changes")
    if n_changing > kernels.MAX_ROWS:
        raise ValueError(f"{name}: expected at most {kernels.MAX_ROWS} changing rows, got {n_changing}")
    return changing


def _starts(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
