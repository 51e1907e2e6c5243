"""What learning has counted so far: the rows and columns of a growing model, and which relations were seen there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sec_lab import _learning_kernels as kernels
from sec_lab import _profile_kernels as growing
from sec_lab._chain_kernels import MAX_ROWS
from sec_lab.event_chain import EventChain

LEAST_COUNT = growing.LEAST_COUNT
"""Demonstrations that a row or column needs to be common to some."""

RELATION_OF_CODE = np.array([0, 1, 2, 9], np.uint8)


@dataclass(frozen=True)
class Alignment:
    """How a chain is aligned with a model.

    Attributes
    ----------
    rows, columns : int64
        For each row and column of the model its partner among the changing rows and the columns of the chain, or −1.
    similarity : float
        ψ_temporal of the chain with the strong part of the model, in percent.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    similarity: float


@dataclass(frozen=True)
class Options:
    """How chains are compared, see :func:`~sec_lab.similarity.compare`; and how often is often enough."""

    shorter: bool
    tolerance_percent: float
    effort: int
    threshold: float

    @property
    def threshold_so_far(self) -> float:
        """While a model grows, what half of those so far have is not weak: it is deleted at the end (§2.9)."""
        return min(self.threshold, 0.5)

    def often(self, counts: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
        """Rows or columns that enough of all n demonstrations have."""
        return np.asarray(growing.often(counts, n, self.threshold), np.bool_)

    def often_so_far(self, counts: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
        """Rows or columns that enough of the first n demonstrations have."""
        return np.asarray(growing.often(counts, n, self.threshold_so_far), np.bool_)


class Packed:
    """The changing rows of demonstrations, laid out for the compiled loops.

    Raises
    ------
    TypeError, ValueError
        If one is no chain, has a single column, no change or a negative key frame; its name is given.
    """

    def __init__(self, chains: Sequence[EventChain], names: Sequence[str]) -> None:
        for chain, name in zip(chains, names, strict=True):
            if not isinstance(chain, EventChain):
                raise TypeError(
                    f"demonstration {name}: expected an event chain or an observation, got {type(chain).__name__}"
                )
        self.names = names
        relations = [chain.relations for chain in chains]
        shapes = np.array([table.shape for table in relations], np.int64)
        self.n_columns = shapes[:, 1].copy()
        flat = np.concatenate([table.ravel() for table in relations])
        codes, rows = np.empty(len(flat), np.uint8), np.empty(shapes[:, 0].sum(), np.int64)
        self.n_changing = np.empty(len(chains), np.int64)
        used = kernels.pack_changing_rows(flat, shapes[:, 0].copy(), self.n_columns, codes, rows, self.n_changing)
        self.codes = codes[:used]
        self.code_starts = np.concatenate([[0], np.cumsum(self.n_changing * self.n_columns)])
        self.row_starts = np.concatenate([[0], np.cumsum(self.n_changing)])
        self.rows = rows[: self.row_starts[-1]]
        first_row = np.repeat(np.cumsum(shapes[:, 0]) - shapes[:, 0], self.n_changing)
        self.pairs = np.concatenate([chain.pairs for chain in chains])[first_row + self.rows]
        self.frame_starts = np.concatenate([[0], np.cumsum(self.n_columns)])
        self.key_frames = np.concatenate([chain.key_frames for chain in chains])
        self._check()

    def _check(self) -> None:
        for wrong, what in (
            (self.n_columns < 2, "expected an event chain of at least two columns, got one"),
            (self.n_changing == 0, "expected an event chain with a change, but no row of it ever changes"),
            (
                self.n_changing > MAX_ROWS,
                f"expected at most {MAX_ROWS} changing rows, got {self.n_changing.max(initial=0)}",
            ),
            (self.key_frames[self.frame_starts[:-1]] < 0, "expected frame numbers from 0 on, got a negative one"),
        ):
            if wrong.any():
                raise ValueError(f"demonstration {self.names[int(np.argmax(wrong))]}: {what}")

    def codes_of(self, i: int) -> NDArray[np.uint8]:
        """Codes of the changing rows of one chain."""
        return self.codes[self.code_starts[i] : self.code_starts[i + 1]].reshape(self.n_changing[i], -1)


class Profile:
    """A model that grows by every demonstration that is added to it.

    Rows and columns that too few demonstrations have are *weak*: they are kept, because later ones may have them too,
    but are only offered what the strong ones leave over. Their number stays bounded by lossy counting (Manku and
    Motwani, 2002): every ⌈1 / ε⌉ demonstrations, those are forgotten that were seen less than ε-often since they came.
    So no row or column whose share is that threshold is ever forgotten for good, and ω is too small by at most ε.

    Attributes
    ----------
    votes : (n_rows, n_columns, 4) int64
        How often each code was seen where a row and a column of a demonstration both correspond.
    initial : (n_rows, n_columns) uint8
        What counts where nobody voted, or in a tie.
    row_counts, column_counts : int64
        Demonstrations that have each.
    n : int
        Demonstrations.
    """

    def __init__(self, codes: NDArray[np.uint8], options: Options) -> None:
        m, u = codes.shape
        self.options = options
        self.n = 1
        self._state: growing.State = (
            np.eye(kernels.N_CODES, dtype=np.int64)[codes], codes.copy(), np.ones(m, np.int64), np.zeros(m, np.int64),
            np.ones(u, np.int64), np.zeros(u, np.int64),
        )  # fmt: skip

    @property
    def votes(self) -> NDArray[np.int64]:
        return self._state[0]

    @property
    def initial(self) -> NDArray[np.uint8]:
        return self._state[1]

    @property
    def row_counts(self) -> NDArray[np.int64]:
        return self._state[2]

    @property
    def column_counts(self) -> NDArray[np.int64]:
        return self._state[4]

    @property
    def codes(self) -> NDArray[np.uint8]:
        """What most demonstrations have in each row and column; see :func:`most_voted`."""
        return most_voted(self.votes, self.initial)

    @property
    def strong(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Rows and columns that enough demonstrations have."""
        often = self.options.often_so_far
        return often(self.row_counts, self.n), often(self.column_counts, self.n)

    def align(self, codes: NDArray[np.uint8]) -> Alignment:
        """Rows and columns of the model in a chain."""
        model = self.codes
        rows, columns = np.empty(model.shape[0], np.int64), np.empty(model.shape[1], np.int64)
        options = self.options
        similarity = kernels.align(
            model, *self.strong, codes, int(options.shorter), options.tolerance_percent, options.effort, rows, columns
        )
        return Alignment(rows, columns, float(similarity))

    def add(self, codes: NDArray[np.uint8], alignment: Alignment) -> None:
        """Raise the weights of what the chain has too, and append what it has besides."""
        # Departure: unseen columns are inserted too, so that a first example without some event can be outgrown.
        threshold = self.options.threshold_so_far
        self._state = growing.add(self._state, self.n, codes, alignment.rows, alignment.columns, threshold)
        self.n += 1

    def add_all(self, packed: Packed, order: NDArray[np.int64]) -> None:
        """Align and add demonstrations, one after the other."""
        options = self.options
        self._state = growing.grow(
            self._state, self.n, order, packed.codes, packed.code_starts, packed.n_changing, packed.n_columns,
            options.threshold_so_far, int(options.shorter), options.tolerance_percent, options.effort,
        )  # fmt: skip
        self.n += len(order)


def most_voted(votes: NDArray[np.int64], initial: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Code with most votes in every place; of a tie, and where nobody voted, the one that was there first."""
    return np.asarray(growing.most_voted(votes, initial), np.uint8)
