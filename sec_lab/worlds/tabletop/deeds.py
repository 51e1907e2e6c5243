"""What is done in a movie of putting and taking, and when each deed begins and ends."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.files import UnusableFileError, read_whole, write_whole

DEEDS = "actions.json"


@dataclass(frozen=True)
class Deed:
    """A hand puts a thing on a plate, or takes it from there.

    Parameters
    ----------
    kind : str
        ``"putting"`` or ``"taking"``.
    hand, thing, plate : str
        Names of segments.
    what : str
        What the thing is, e.g. ``"orange"``.

    Raises
    ------
    ValueError
        If the kind is unknown.
    """

    kind: str
    hand: str
    thing: str
    plate: str
    what: str = ""

    def __post_init__(self) -> None:
        if self.kind not in ("putting", "taking"):
            raise ValueError(f"kind: expected 'putting' or 'taking', got {self.kind!r}")


@dataclass(frozen=True)
class TimedDeed(Deed):
    """A deed with its frames.

    Parameters
    ----------
    begin : int
        *Taking*: first frame in which the hand touches the thing. *Putting*: the same; but if the hand took the thing
        from another plate just before, without letting go, the frame in which it has left that plate.
    end : int
        *Putting*: first frame in which the hand no longer touches the thing. *Taking*: first frame in which the thing
        is no longer seen, as the hand has left with it; but if the hand goes on to put it on another plate without
        letting go, the frame in which the thing has left the first plate.
    plate_frame : int
        First frame in which the thing touches the plate (*putting*), or no longer touches it (*taking*).
    appears, leaves : int
        First frame in which the hand is seen, and first one in which it is gone for good.
    """

    begin: int = 0
    end: int = 0
    plate_frame: int = 0
    appears: int = 0
    leaves: int = 0


def timed(
    deeds: Sequence[Deed],
    names: Mapping[int, str],
    pairs: NDArray[np.int64],
    touching: NDArray[np.bool_],
    labels: NDArray[np.integer[Any]],
) -> list[TimedDeed]:
    """When deeds begin and end, from contacts in space and from what is seen; see :class:`TimedDeed`.

    Parameters
    ----------
    deeds : sequence of Deed
        A hand holds each thing once.
    names : mapping of int to str
        Of labels.
    pairs : (n_pairs, 2) int64
        Labels, the lower one first.
    touching : (n, n_pairs) bool
    labels : (n, height, width) of int
        Of the left eye.

    Raises
    ------
    ValueError
        If a deed never happens.

    Examples
    --------
    A hand (2) touches a thing (3) in frames 1 to 4; from frame 3 on it is on the plate (4).

    >>> touching = np.zeros((6, 2), dtype=bool)
    >>> touching[1:5, 0], touching[3:, 1] = True, True
    >>> labels = np.full((6, 1, 1), 2)
    >>> names, pairs = {2: "hand", 3: "object", 4: "plate"}, np.array([(2, 3), (3, 4)])
    >>> [deed] = timed([Deed("putting", "hand", "object", "plate")], names, pairs, touching, labels)
    >>> deed.begin, deed.plate_frame, deed.end
    (1, 3, 5)
    """
    label_of = {name: label for label, name in names.items()}
    column = {frozenset(map(int, pair)): touching[:, k] for k, pair in enumerate(pairs)}

    def contact(first: str, second: str) -> NDArray[np.bool_]:
        return column[frozenset((label_of[first], label_of[second]))]

    found = []
    for deed in deeds:
        shown = (labels == label_of[deed.thing]).any(axis=(1, 2))
        held = np.flatnonzero(contact(deed.hand, deed.thing))
        if deed.kind == "taking":
            held = held[held <= max(np.flatnonzero(shown), default=-1)]
        on_plate = contact(deed.thing, deed.plate)
        away = np.flatnonzero(on_plate if deed.kind == "putting" else ~on_plate)
        seen = np.flatnonzero((labels == label_of[deed.hand]).any(axis=(1, 2)))
        if not (len(held) and len(away) and len(seen)):
            raise ValueError(f"deeds: expected what happens in the movie, but {deed} does not")
        found.append((deed, int(held[0]), int(held[-1]) + 1, int(away[0]), int(seen[0]), int(seen[-1]) + 1))
    # From plate to plate in one hold: the thing leaving the first one is where taking ends and putting begins.
    turns = {(deed.hand, deed.thing): plate_frame for deed, _, _, plate_frame, _, _ in found if deed.kind == "taking"}
    both = {key for key in turns if sum((deed.hand, deed.thing) == key for deed in deeds) > 1}
    return [
        TimedDeed(
            **asdict(deed),
            begin=turns[key] if key in both and deed.kind == "putting" else begin,
            end=turns[key] if key in both and deed.kind == "taking" else end,
            plate_frame=plate_frame,
            appears=appears,
            leaves=leaves,
        )
        for deed, begin, end, plate_frame, appears, leaves in found
        for key in [(deed.hand, deed.thing)]
    ]


def write_deeds(folder: Path, deeds: Sequence[TimedDeed]) -> None:
    """Write ``actions.json`` into the folder of a movie.

    Raises
    ------
    UnusableFileError
        If that is not possible.
    """
    write_whole(folder / DEEDS, json.dumps([asdict(deed) for deed in deeds], indent=1) + "\n")


def read_deeds(folder: Path) -> tuple[TimedDeed, ...]:
    """Read what :func:`write_deeds` wrote.

    Raises
    ------
    UnusableFileError
        If the file is missing or damaged.

    Examples
    --------
    >>> read_deeds(Path("no/such/folder"))
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder/actions.json: expected the actions of a movie, but there is no such
    file
    """
    path = folder / DEEDS
    content = read_whole(path, expected="the actions of a movie")
    try:
        return tuple(
            TimedDeed(**{name: _checked(name, value) for name, value in row.items()}) for row in json.loads(content)
        )
    except (ValueError, TypeError, AttributeError) as error:
        raise UnusableFileError(f"{path}: expected the actions of a movie, but it is damaged ({error})") from error


_WORDS = ("kind", "hand", "thing", "plate", "what")


def _checked(name: str, value: object) -> Any:
    expected = str if name in _WORDS else int
    if type(value) is not expected:
        raise ValueError(f"{name}: expected {expected.__name__}, got {value!r}")
    return value
