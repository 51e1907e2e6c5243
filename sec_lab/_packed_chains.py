"""Event chains laid out in flat arrays for the compiled loops of :mod:`sec_lab._similarity_kernels`."""

from collections.abc import Iterable, Sequence

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
        codes: list[NDArray[np.uint8]] = []
        first: list[int] = []
        kinds: dict[bytes, int] = {}
        kind_of_row: list[int] = []
        for chain, name in zip(chains, names, strict=True):
            check_comparable(chain, name)
            rows = _CODE_OF_RELATION[chain.relations[chain.changing_rows]]
            codes.append(N_RELATIONS * rows[:, :-1] + rows[:, 1:] if derived else rows)
            seen: dict[bytes, int] = {}
            first += [seen.setdefault(row.tobytes(), i) for i, row in enumerate(rows)]
            kind_of_row += [kinds.setdefault(row.tobytes(), len(kinds)) for row in chain.compressed]
        self.n_codes = N_RELATIONS**2 if derived else N_RELATIONS
        self.n_rows = np.array([rows.shape[0] for rows in codes], np.int64)
        self.n_columns = np.array([rows.shape[1] for rows in codes], np.int64)
        self.row_starts = _starts(self.n_rows)
        self.code_starts = _starts(self.n_rows * self.n_columns)
        self.lane_starts = _starts(self.n_rows * self.n_codes * -(-self.n_columns // kernels.LANES))
        self.codes = np.concatenate([rows.ravel() for rows in codes])
        self.first = np.array(first, np.int64)
        self.kinds = np.array(kind_of_row, np.int64)
        self.symbols = np.frombuffer(b"".join(kinds), np.uint8)
        self.symbol_starts = _starts(np.array([len(kind) for kind in kinds]))
        self.lanes = np.zeros(self.lane_starts[-1], np.uint64)
        for i, rows in enumerate(codes):
            kernels.fill_lanes(rows.ravel(), *rows.shape, self.n_codes, self.lanes, self.lane_starts[i])

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


def check_comparable(chain: EventChain, name: str) -> None:
    """Refuse a chain that nothing can be compared with.

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
    n_changing = len(chain.changing_rows)
    if chain.relations.shape[1] < 2:
        raise ValueError(f"{name}: expected an event chain of at least two columns, got one")
    if not n_changing:
        raise ValueError(f"{name}: expected an event chain with a change, but no row of it ever changes")
    if n_changing > kernels.MAX_ROWS:
        raise ValueError(f"{name}: expected at most {kernels.MAX_ROWS} changing rows, got {n_changing}")


def _starts(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
