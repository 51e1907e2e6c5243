"""Tables of others that come without pictures: relations or boxes of named things, frame by frame.

They are read into an :class:`~sec_lab.observation.Observation`, and from there on nothing is particular to them.
"""

import json
import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.files import UnusableFileError, read_whole
from sec_lab.observation import Observation
from sec_lab.relations.boxes import box_relations
from sec_lab.role_tables.history import held
from sec_lab.scene_graph import SceneGraph, main_graphs

# Codes of a table of distances: touching, near, far.
_TOUCHING, _CODES = "0", frozenset("012")
_MOST_BYTES = 1 << 28


def read_distance_table(path: str | os.PathLike[str], *, least_frames: int = 1) -> Observation:
    r"""Read a table of qualitative distances (as of CAD-120): touching, near or far, of every pair in every frame.

    The first line names the things, each further line a pair and its relation in every frame, as in ``cup,box:1,0,0``
    with 0 touching, 1 near and 2 far; pairs are in the order (1, 2), (1, 3), …, (2, 3), … of the things, of which
    several may have the same name. Near and far are both non-touching. Everything is there all the time.

    Parameters
    ----------
    path : path-like
    least_frames : int, optional
        Frames that a relation has to last to count; shorter ones are taken for what was before.

    Returns
    -------
    Observation
        Segments 1, 2, … in the order of the first line, with their names. No positions.

    Raises
    ------
    UnusableFileError
        If there is no such file, or it is no such table.
    ValueError
        If ``least_frames`` is no whole number of at least 1.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "taking.txt"
    ...     _ = path.write_text("hand,cup,box\nhand,cup:2,1,0,0\nhand,box:2,2,2,2\ncup,box:0,0,0,1\n")
    ...     read_distance_table(path).chain.relations
    array([[0, 2, 2],
           [0, 0, 0],
           [2, 2, 0]], dtype=uint8)
    """
    _check_least(least_frames)
    expected = "a table of distances"
    content = read_whole(Path(path), expected=expected)
    try:
        lines = [line.strip() for line in content.decode("utf-8").splitlines() if line.strip()]
        names, touching = _distances(lines)
    except (UnicodeDecodeError, ValueError) as error:
        raise UnusableFileError(f"{path}: expected {expected}, but it is damaged ({error})") from error
    touching = _steady(touching, least_frames)
    first, second = np.triu_indices(len(names), k=1)
    labels = np.arange(1, len(names) + 1)
    changes = np.flatnonzero(np.append(True, (touching[:, 1:] != touching[:, :-1]).any(axis=0)))
    graphs = []
    for frame in changes.tolist():
        relations = np.zeros((len(names), len(names)), np.uint8)
        relations[first, second] = np.where(touching[:, frame], Relation.TOUCHING, Relation.NON_TOUCHING)
        graphs.append(SceneGraph(labels, relations + relations.T))
    return Observation(graphs, changes, dict(enumerate(names, 1)))


def _check_least(least_frames: int) -> None:
    if not isinstance(least_frames, int | np.integer) or isinstance(least_frames, bool) or least_frames < 1:
        raise ValueError(f"least_frames: expected a whole number of at least 1, got {least_frames!r}")


def _distances(lines: Sequence[str]) -> tuple[list[str], NDArray[np.bool_]]:
    if not lines:
        raise ValueError("it is empty")
    names = [name.strip() for name in lines[0].split(",")]
    pairs = list(combinations(names, 2))
    if not pairs or not all(names):
        raise ValueError(f"expected at least two names in its first line, got {lines[0][:80]!r}")
    if len(lines) - 1 != len(pairs):
        raise ValueError(f"expected {len(pairs)} pairs of {len(names)} things, got {len(lines) - 1}")
    rows = []
    for wanted, line in zip(pairs, lines[1:], strict=True):
        pair, _, codes = line.partition(":")
        if tuple(name.strip() for name in pair.split(",")) != wanted:
            raise ValueError(f"expected the pair {','.join(wanted)!r} in its place, got {pair[:80]!r}")
        values = [code.strip() for code in codes.split(",")]
        if not set(values) <= _CODES:
            raise ValueError(f"expected 0, 1 and 2 for {pair!r}, got {min(set(values) - _CODES)!r}")
        rows.append([code == _TOUCHING for code in values])
    lengths = sorted({len(values) for values in rows})
    if len(lengths) > 1:
        raise ValueError(f"expected rows of the same length, got {lengths}")
    return names, np.array(rows)


def _steady(values: NDArray[np.bool_], least: int) -> NDArray[np.bool_]:
    """Rows in which what does not last is taken for what was before."""
    if least == 1:
        return values
    steady = values.copy()
    for row in steady:
        starts = np.flatnonzero(np.append(True, row[1:] != row[:-1]))
        ends = np.append(starts[1:], len(row))
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            if start > 0 and end - start < least:
                row[start:end] = row[start - 1]
    return steady


@dataclass(frozen=True, eq=False)
class BoxTake:
    """A take of named boxes, and what each hand does in it.

    Attributes
    ----------
    observation : Observation
        Positions in metres, centres of the boxes.
    actions : mapping of str to tuple of (int, int, str, str or None)
        By hand: first frame, end frame (excluded), name of the action, what it is done to; in their order.
    """

    observation: Observation
    actions: Mapping[str, tuple[tuple[int, int, str, str | None], ...]]


ACTIONS = (
    "idle", "approach", "retreat", "lift", "place", "hold", "pour", "cut", "hammer", "saw", "stir", "screw", "drink",
    "wipe",
)  # fmt: skip
"""Names of the actions by number, as of the KIT Bimanual Actions data set."""


def read_box_take(path: str | os.PathLike[str], *, gap_m: float = 0.0, least_frames: int = 1) -> BoxTake:
    """Read a take of boxes in space, frame by frame (as repacked from a KIT Bimanual Actions recording).

    Boxes whose gap is at most ``gap_m`` touch. A name stands for one thing in all frames.

    Parameters
    ----------
    path : path-like
        A gzip-compressed JSON file with ``frames`` (number → ``objects``: name, x0, x1, y0, y1, z0, z1 in metres) and
        ``gt`` (hand → frame, action, frame, …).
    gap_m : float, optional
    least_frames : int, optional
        Frames that a relation, a presence or an absence has to last to count.

    Raises
    ------
    UnusableFileError
        If there is no such file, or it is no such take.
    ValueError
        If the gap is negative or not finite, or ``least_frames`` is below 1.

    Examples
    --------
    >>> import gzip
    >>> from tempfile import TemporaryDirectory
    >>> hand, cup = ["hand_1", 0, 1, 0, 1, 0, 1], ["cup_1", 3, 4, 0, 1, 0, 1]
    >>> near = ["hand_1", 2, 3, 0, 1, 0, 1]
    >>> frames = {"0": {"objects": [hand, cup]}, "1": {"objects": [near, cup]}}
    >>> truth = {"right_hand": [0, [1, None, "cup_1"], 2]}
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "take.json.gz"
    ...     _ = path.write_bytes(gzip.compress(json.dumps({"frames": frames, "gt": truth}).encode()))
    ...     take = read_box_take(path)
    >>> take.observation.chain.relations, take.actions["right hand"]
    (array([[0, 2]], dtype=uint8), ((0, 2, 'approach', 'cup_1'),))
    """
    _check_least(least_frames)
    if not 0 <= gap_m < np.inf:
        raise ValueError(f"gap_m: expected a finite distance of at least 0, got {gap_m}")
    expected = "a take of boxes"
    packed = read_whole(Path(path), expected=expected)
    try:
        content = json.loads(_unpacked(packed))
        frames = {int(number): frame["objects"] for number, frame in content["frames"].items()}
        return _take(frames, content["gt"], gap_m=gap_m, least_frames=least_frames)
    except (OSError, EOFError, zlib.error, ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        raise UnusableFileError(f"{path}: expected {expected}, but it is damaged ({error})") from error


def _unpacked(packed: bytes) -> bytes:
    decoder = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
    content = decoder.decompress(packed, _MOST_BYTES)
    if decoder.unconsumed_tail:
        raise ValueError(f"it holds more than {_MOST_BYTES} bytes")
    if not decoder.eof:
        raise EOFError("it ends too early")
    return content


def _take(frames: Mapping[int, Any], truth: Mapping[str, Any], *, gap_m: float, least_frames: int) -> BoxTake:
    names = list(dict.fromkeys(str(box[0]) for number in sorted(frames) for box in frames[number]))
    numbers = sorted(frames)
    n = len(names)
    boxes = np.full((len(numbers), n, 2, 3), np.nan)
    for k, number in enumerate(numbers):
        shown_names = [str(box[0]) for box in frames[number]]
        twice = [name for name in dict.fromkeys(shown_names) if shown_names.count(name) > 1]
        if twice:
            raise ValueError(f"expected each name once in a frame, got {twice[0]!r} again in frame {number}")
        for name, x0, x1, y0, y1, z0, z1 in frames[number]:
            boxes[k, names.index(str(name))] = [[x0, y0, z0], [x1, y1, z1]]
    there = ~np.isnan(boxes[:, :, 0, 0])
    shown = _steady(there.T.copy(), least_frames).T
    boxes = held(boxes.swapaxes(0, 1), there.T).swapaxes(0, 1)
    first, second = np.triu_indices(n, k=1)
    found = [box_relations(boxes[k], segments=np.arange(1, n + 1), gap_m=gap_m) for k in range(len(numbers))]
    touching = np.array([one.relations[first, second] > 0 for one in found]).T
    touching = _steady(touching, least_frames)
    graphs = []
    for k, one in enumerate(found):
        relations = np.zeros((n, n), np.uint8)
        relations[first, second] = np.where(touching[:, k], Relation.TOUCHING, Relation.NON_TOUCHING)
        seen = np.flatnonzero(shown[k])
        places = None if one.positions is None else one.positions[seen]
        graphs.append(SceneGraph(seen + 1, (relations + relations.T)[np.ix_(seen, seen)], places))
    main = main_graphs(graphs, frames=numbers)
    observation = Observation(main.graphs, main.key_frames, dict(enumerate(names, 1)), "m")
    return BoxTake(observation, {hand.replace("_", " "): _actions(line) for hand, line in truth.items()})


def _action(number: int | None) -> str:
    if number is None:
        return "none"
    if not 0 <= int(number) < len(ACTIONS):
        raise ValueError(f"expected actions 0 to {len(ACTIONS) - 1}, got {number}")
    return ACTIONS[int(number)]


def _actions(line: Sequence[Any]) -> tuple[tuple[int, int, str, str | None], ...]:
    """The list frame, action, frame, action, …, frame as stretches."""
    starts, kinds = line[0::2], line[1::2]
    if len(starts) != len(kinds) + 1:
        raise ValueError(f"expected a list frame, action, …, frame, got {len(line)} entries")
    return tuple(
        (
            int(start),
            int(end),
            _action(kind[0]),
            None if kind[2] is None else str(kind[2]),
        )
        for start, end, kind in zip(starts, starts[1:], kinds, strict=False)
    )
