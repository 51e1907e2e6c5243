"""Files of a folder in their natural order, and the frame numbers in their names."""

import os
import re
from collections.abc import Collection, Sequence
from itertools import pairwise
from pathlib import Path

from sec_lab.files import UnusableFileError

_NUMBER = re.compile(r"(\d+)")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sorting key under which numbers inside of names count as numbers.

    Examples
    --------
    >>> sorted(["10.png", "9.png", "b.png"], key=natural_key)
    ['9.png', '10.png', 'b.png']
    """
    parts = _NUMBER.split(name)
    return tuple((0, int(part), part) if part.isdecimal() else (1, 0, part) for part in parts if part)


def list_files(folder: Path, suffixes: Collection[str], *, expected: str) -> list[Path]:
    """Files of a folder with one of the suffixes, in natural order; hidden files are passed over.

    Parameters
    ----------
    folder : path-like
    suffixes : collection of str
        Lower-case, with the dot; capital letters in the names of files do not matter.
    expected : str
        What the files are, for the error message.

    Returns
    -------
    list of Path
        At least one.

    Raises
    ------
    UnusableFileError
        If there is no such folder, it cannot be read, or it has no such file or such files of several kinds.

    Examples
    --------
    >>> list_files(Path("no/such/folder"), {".png"}, expected="pictures")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder: expected a folder of pictures, but there is no such folder
    """
    try:
        names = [entry.name for entry in os.scandir(folder) if not entry.name.startswith(".") and entry.is_file()]
    except (FileNotFoundError, NotADirectoryError) as error:
        raise UnusableFileError(f"{folder}: expected a folder of {expected}, but there is no such folder") from error
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise UnusableFileError(
            f"{folder}: expected a folder of {expected}, but it cannot be read ({reason})"
        ) from error
    suffix_of = {name: Path(name).suffix.lower() for name in names}
    found = sorted((name for name in names if suffix_of[name] in suffixes), key=natural_key)
    kinds = sorted({suffix_of[name] for name in found})
    if not found:
        raise UnusableFileError(f"{folder}: expected a folder of {expected} ({', '.join(sorted(suffixes))}), got none")
    if len(kinds) > 1:
        raise UnusableFileError(f"{folder}: expected {expected} of one kind, got {' and '.join(kinds)}")
    return [folder / name for name in found]


def frame_numbers(names: Sequence[str]) -> tuple[int, ...] | None:
    """Frame numbers in the names of files: the one number in which all the names differ.

    Parameters
    ----------
    names : sequence of str
        Without their folder.

    Returns
    -------
    tuple of int or None
        In the order of the names; None if the names hold no number, or differ in more than one number or in something
        else. A single name gives its last number.

    Raises
    ------
    ValueError
        If two names have the same number, like ``1.png`` and ``01.png``.

    Examples
    --------
    >>> frame_numbers(["cam2_0009.png", "cam2_0010.png"])
    (9, 10)
    >>> frame_numbers(["apple.png", "pear.png"]) is None
    True
    """
    split = [_NUMBER.split(Path(name).stem) for name in names]
    first = split[0]
    if len(first) < 2 or any(len(parts) != len(first) or parts[::2] != first[::2] for parts in split):
        return None
    varying = [place for place in range(1, len(first), 2) if len({parts[place] for parts in split}) > 1]
    if len(varying) > 1:
        return None
    place = varying[0] if varying else len(first) - 2
    numbers = tuple(int(parts[place]) for parts in split)
    for number, following in pairwise(sorted(numbers)):
        if number == following:
            raise ValueError(f"file names: expected one file a frame, got two with the number {number}")
    return numbers
