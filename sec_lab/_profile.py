"""What learning has counted so far: the rows and columns of a growing model, and which relations were seen there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sec_lab import _learning_kernels as kernels
from sec_lab.event_chain import EventChain

LEAST_COUNT = 2
"""Demonstrations that a row or column needs to be common to some."""

RELATION_OF_CODE = np.array([0, 1, 2, 9], np.uint8)

_ROUNDING = 1e-9


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

    def often(self, counts: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
        """Rows or columns that enough of n demonstrations have."""
        return (counts >= self.threshold * n - _ROUNDING) & (counts >= min(LEAST_COUNT, n))


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
            (self.key_frames[self.frame_starts[:-1]] < 0, "expected frame numbers from 0 on, got a negative one"),
        ):
            if wrong.any():
                raise ValueError(f"demonstration {self.names[int(np.argmax(wrong))]}: {what}")

    def codes_of(self, i: int) -> NDArray[np.uint8]:
        """Codes of the changing rows of one chain."""
        return self.codes[self.code_starts[i] : self.code_starts[i + 1]].reshape(self.n_changing[i], -1)

    def chain_of(self, i: int) -> EventChain:
        """The changing rows of one chain as a chain of its own."""
        first, last = self.row_starts[i : i + 2]
        return EventChain(RELATION_OF_CODE[self.codes_of(i)], self.pairs[first:last])


class Profile:
    """A model that grows by every demonstration that is added to it.

    Rows and columns that too few demonstrations have are *weak*: they are kept, because later ones may have them too,
    but are only offered what the strong ones leave over. Their number stays bounded by lossy counting (Manku and
    Motwani, 2002): every ⌈1 / ε⌉ demonstrations, those are forgotten that were seen less than ε-often since they came.
    So no row or column whose share is the threshold is ever forgotten for good, and ω is too small by at most ε.

    Attributes
    ----------
    votes : (n_rows, n_columns, 4) int64
        How often each code was seen where a row and a column of a demonstration both correspond.
    row_counts, column_counts : int64
        Demonstrations that have each.
    n : int
        Demonstrations.
    """

    def __init__(self, codes: NDArray[np.uint8], options: Options) -> None:
        m, u = codes.shape
        self.options = options
        self.n = 1
        self.initial = codes.copy()
        self.votes = np.eye(kernels.N_CODES, dtype=np.int64)[codes]
        self.row_counts, self.column_counts = np.ones(m, np.int64), np.ones(u, np.int64)
        self._row_missed, self._column_missed = np.zeros(m, np.int64), np.zeros(u, np.int64)

    @property
    def codes(self) -> NDArray[np.uint8]:
        """What most demonstrations have in each row and column; see :func:`most_voted`."""
        return most_voted(self.votes, self.initial)

    @property
    def strong(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Rows and columns that enough demonstrations have."""
        return tuple(self.options.often(counts, self.n) for counts in (self.row_counts, self.column_counts))  # type: ignore[return-value]

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
        rows, columns = self._append(codes, alignment)
        self.n += 1
        self.row_counts[rows >= 0] += 1
        self.column_counts[columns >= 0] += 1
        i, x = np.flatnonzero(rows >= 0), np.flatnonzero(columns >= 0)
        self.votes[i[:, None], x, codes[rows[i][:, None], columns[x]]] += 1
        width = int(np.ceil(2 / self.options.threshold)) if self.options.threshold > 0 else self.n + 1
        if self.n % width == 0:
            bucket = self.n // width
            keep_rows = self.row_counts + self._row_missed > bucket
            keep_columns = self.column_counts + self._column_missed > bucket
            if keep_rows.any() and keep_columns.any():
                self._keep(keep_rows, keep_columns)

    def _append(self, codes: NDArray[np.uint8], alignment: Alignment) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Make room for the rows and columns of a chain that the model lacks; returns all partners."""
        u = self.initial.shape[1]
        # Departure: unseen columns are inserted too, so that a first example without some event can be outgrown.
        new_columns = np.setdiff1d(np.arange(codes.shape[1]), alignment.columns)
        aligned = np.flatnonzero(alignment.columns >= 0)
        before = np.searchsorted(alignment.columns[aligned], new_columns)
        at = np.where(before > 0, aligned[before - 1] + 1, 0) if len(aligned) else np.full(len(new_columns), u)
        new_rows = np.setdiff1d(np.arange(len(codes)), alignment.rows)
        columns = np.insert(alignment.columns, at, new_columns)
        rows = np.append(alignment.rows, new_rows)
        # Where nothing was seen yet, a relation lasts until it is seen to change.
        held = np.take(self.codes, np.maximum(at - 1, 0), axis=1)
        self.initial = np.insert(self.initial, at, held, axis=1)
        self.votes = np.insert(self.votes, at, 0, axis=1)
        partner = np.where(columns >= 0, np.arange(len(columns)), -1)
        last = columns[np.maximum(np.maximum.accumulate(partner), 0)]
        appended = codes[new_rows][:, np.where(last >= 0, last, 0)]
        self.initial = np.vstack([self.initial, appended])
        self.votes = np.concatenate([self.votes, np.zeros((len(new_rows), *self.votes.shape[1:]), np.int64)])
        width = int(np.ceil(2 / self.options.threshold)) if self.options.threshold > 0 else self.n + 1
        self.row_counts = np.append(self.row_counts, np.zeros(len(new_rows), np.int64))
        self._row_missed = np.append(self._row_missed, np.full(len(new_rows), self.n // width))
        self.column_counts = np.insert(self.column_counts, at, 0)
        self._column_missed = np.insert(self._column_missed, at, self.n // width)
        return rows, columns

    def _keep(self, rows: NDArray[np.bool_], columns: NDArray[np.bool_]) -> None:
        self.votes, self.initial = self.votes[rows][:, columns], self.initial[rows][:, columns]
        self.row_counts, self._row_missed = self.row_counts[rows], self._row_missed[rows]
        self.column_counts, self._column_missed = self.column_counts[columns], self._column_missed[columns]


def most_voted(votes: NDArray[np.int64], initial: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Code with most votes in every place; of a tie, and where nobody voted, the one that was there first."""
    first = np.eye(kernels.N_CODES, dtype=np.int64)[initial]
    return np.asarray(np.argmax(2 * votes + first, axis=-1), np.uint8)
