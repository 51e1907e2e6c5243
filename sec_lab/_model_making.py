"""From counted rows and columns to a model: what is often enough stays, and every demonstration says what it knows."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sec_lab import _learning_kernels as kernels
from sec_lab._profile import LEAST_COUNT, RELATION_OF_CODE, Options, Packed, most_voted
from sec_lab.action_model import NOT_SEEN, ActionModel
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation, PositionUnit


@dataclass(frozen=True)
class Frame:
    """Rows and columns that chains are aligned with; the weak ones are offered what the strong ones leave over."""

    codes: NDArray[np.uint8]
    strong_rows: NDArray[np.bool_]
    strong_columns: NDArray[np.bool_]


@dataclass(frozen=True)
class Ballot:
    """What n demonstrations have in the rows and columns of a frame.

    Attributes
    ----------
    votes : (m, u, 4) int64
        How often each code was seen.
    initial : (m, u) uint8
        What counts where nobody voted, or in a tie.
    row_counts, column_counts : int64
        Demonstrations that have each row and column.
    n : int
    rows : (n, m) int64
        Partner of each row among the changing rows of each demonstration, or −1.
    columns : (n, u) int64
        Partner of each column, or −1.
    """

    votes: NDArray[np.int64]
    initial: NDArray[np.uint8]
    row_counts: NDArray[np.int64]
    column_counts: NDArray[np.int64]
    n: int
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]


@dataclass(frozen=True)
class Kept:
    """What is left once sub-threshold rows and columns are deleted.

    Attributes
    ----------
    frame : Frame
    rows, columns : int64
        Which rows and columns of the ballot these are.
    row_weights, column_weights : float64
    """

    frame: Frame
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    row_weights: NDArray[np.float64]
    column_weights: NDArray[np.float64]


def often_enough(ballot: Ballot, options: Options) -> Kept:
    """Delete what too few demonstrations have, rows without a change and columns that are no event any more.

    Raises
    ------
    ValueError
        If no row is common to two demonstrations, or the threshold leaves nothing.
    """
    codes = most_voted(ballot.votes, ballot.initial)
    rows = np.flatnonzero(options.often(ballot.row_counts, ballot.n))
    columns = np.flatnonzero(options.often(ballot.column_counts, ballot.n))
    while True:
        kept = codes[rows][:, columns]
        changing = (kept != kept[:, :1]).any(axis=1) if len(columns) else np.zeros(len(rows), np.bool_)
        joined = _columns_without_event(codes, rows, columns, ballot.column_counts)
        if changing.all() and not joined.any():
            break
        rows, columns = rows[changing], columns[~joined]
    if not len(rows) or len(columns) < 2:
        if ballot.row_counts.max(initial=0) < LEAST_COUNT:
            raise ValueError("demonstrations: expected rows that are common to some, got chains without a common row")
        best_row, best_column = (float(c.max(initial=0)) / ballot.n for c in (ballot.row_counts, ballot.column_counts))
        raise ValueError(
            f"weight_threshold: expected one that leaves a row with a change, got {options.threshold:g}, which leaves "
            f"nothing (largest weight of a row {best_row:.2f}, of a column {best_column:.2f})"
        )
    return Kept(
        Frame(kept, np.ones(len(rows), np.bool_), np.ones(len(columns), np.bool_)),
        rows,
        columns,
        ballot.row_counts[rows] / ballot.n,
        ballot.column_counts[columns] / ballot.n,
    )


def make_model(
    packed: Packed,
    given: Sequence[EventChain | Observation],
    kept: Kept,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
) -> ActionModel:
    """Model of what was kept, with the roles, key frames and positions of every demonstration.

    Parameters
    ----------
    packed, given
        The demonstrations.
    kept : Kept
    rows, columns : (n, m), (n, u) int64
        Partners of its rows and columns in each demonstration, or −1.
    """
    pairs = _pairs_of_roles(packed, rows)
    relations = RELATION_OF_CODE[kept.frame.codes]
    roles, segments, known = _roles(packed, pairs, rows)
    chain = EventChain(relations, pairs, names=_names(given, roles, segments, known))
    at = packed.frame_starts[:-1, None] + np.maximum(columns, 0)
    key_frames = np.where(columns >= 0, packed.key_frames[at], NOT_SEEN)
    played = {
        name: dict(zip(roles[knows].tolist(), plays[knows].tolist(), strict=True))
        for name, plays, knows in zip(packed.names, segments, known, strict=True)
    }
    positions, unit = _positions(given, columns, segments, known)
    return ActionModel(
        chain, kept.row_weights, kept.column_weights, list(packed.names), played, key_frames, positions, unit
    )


def _columns_without_event(
    codes: NDArray[np.uint8], rows: NDArray[np.int64], columns: NDArray[np.int64], counts: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Of two neighbours that differ in deleted rows only, the one that fewer demonstrations have."""
    without = np.zeros(len(columns), np.bool_)
    kept, whole = codes[rows][:, columns], codes[:, columns]
    last = 0
    for x in range(1, len(columns)):
        same = (kept[:, x] == kept[:, last]).all()
        if same and (whole[:, x] != whole[:, last]).any():
            if counts[columns[x]] > counts[columns[last]]:
                without[last] = True
                last = x
            else:
                without[x] = True
        else:
            last = x
    return without


def _pairs_of_roles(packed: Packed, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Roles in each row of the model: segments of the demonstration that has most rows, then of others by their roles.

    Roles that it does not have get new labels.
    """
    pairs = np.zeros((rows.shape[1], 2), np.int64)
    done = np.zeros(rows.shape[1], np.bool_)
    while not done.all():
        found = ((rows >= 0) & ~done).sum(axis=1)
        demonstration = int(np.argmax(found))
        these = np.flatnonzero((rows[demonstration] >= 0) & ~done)
        label_of: dict[int, int] = {}
        if done.any():
            only = rows[demonstration : demonstration + 1, done]
            roles, segments, known = _roles(packed, pairs[done], only, first=demonstration)
            label_of = dict(zip(segments[0][known[0]].tolist(), roles[known[0]].tolist(), strict=True))
        taken = {frozenset(pair) for pair in pairs[done].tolist()}
        for row in these.tolist():
            seen = packed.pairs[packed.row_starts[demonstration] + rows[demonstration, row]].tolist()
            if not done.any():
                pairs[row] = seen
                continue
            free = int(max(pairs.max(), *label_of.values(), 0)) + 1 if label_of else int(pairs.max()) + 1
            pair = []
            for segment in seen:
                if segment not in label_of:
                    label_of[segment] = free
                    free += 1
                pair.append(label_of[segment])
            if frozenset(pair) in taken:
                # The same two roles have a row already, so somebody else plays one of them here.
                pair[1] = free
            taken.add(frozenset(pair))
            pairs[row] = pair
        done[these] = True
    return pairs


def _roles(
    packed: Packed, pairs: NDArray[np.int64], rows: NDArray[np.int64], *, first: int = 0
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Roles, the segment that plays each of them in each demonstration from ``first`` on, and whether that is clear."""
    roles, ends = np.unique(pairs, return_inverse=True)
    segments = np.full((len(rows), len(roles)), -1, np.int64)
    known = np.zeros(segments.shape, np.bool_)
    kernels.segments_of_roles(
        ends.reshape(pairs.shape).astype(np.int64), len(roles), packed.pairs, packed.row_starts[first:],
        np.ascontiguousarray(rows), segments, known,
    )  # fmt: skip
    return roles, segments, known


def _names(
    given: Sequence[EventChain | Observation],
    roles: NDArray[np.int64],
    segments: NDArray[np.int64],
    known: NDArray[np.bool_],
) -> dict[int, str | None]:
    """Name that most demonstrations give to the segment in each role; the first of several."""
    named = [(i, one.names) for i, one in enumerate(given) if one.names]
    names: dict[int, str | None] = {}
    for r, role in enumerate(roles.tolist()):
        said = Counter(
            of[int(segments[i, r])] for i, of in named if known[i, r] and int(segments[i, r]) in of
        )  # fmt: skip
        if said:
            names[role] = said.most_common(1)[0][0]
    return names


def _positions(
    given: Sequence[EventChain | Observation],
    columns: NDArray[np.int64],
    segments: NDArray[np.int64],
    known: NDArray[np.bool_],
) -> tuple[NDArray[np.float64] | None, PositionUnit]:
    """Where the segment in each role is at the key frame of each column."""
    seen = {i: one for i, one in enumerate(given) if isinstance(one, Observation)}
    located = {
        i: list(one.recorded) for i, one in seen.items() if any(g.positions is not None for g in one.recorded)
    }  # fmt: skip
    if not located:
        return None, "unknown"
    units = {seen[i].position_unit for i in located}
    widths = {g.positions.shape[1] for graphs in located.values() for g in graphs if g.positions is not None}
    if len(units) > 1 or len(widths) > 1:
        raise ValueError(
            f"demonstrations: expected positions in one unit and number of axes, got {sorted(units)} with "
            f"{sorted(widths)} axes"
        )
    positions = np.full((*columns.shape, segments.shape[1], widths.pop()), np.nan)
    for i, graphs in located.items():
        for x in np.flatnonzero(columns[i] >= 0).tolist():
            graph = graphs[columns[i, x]]
            if graph.positions is None:
                continue
            row_of = {label: row for row, label in enumerate(graph.segments.tolist())}
            for r in np.flatnonzero(known[i]).tolist():
                if int(segments[i, r]) in row_of:
                    positions[i, x, r] = graph.positions[row_of[int(segments[i, r])]]
    return positions, units.pop()
