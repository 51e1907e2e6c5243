"""JSON files of unknown origin: read with one clear error, and in bounded memory whatever they hold."""

import json
import os
from typing import Any, NoReturn

from sec_lab.files import UnusableFileError, read_whole

MAX_BYTES = 1 << 28
"""Largest JSON file that is read (256 MiB)."""

MAX_CONTAINERS = 8_000_000
"""Most opening brackets and braces: each may become a list or dictionary of 72 bytes, so half a gigabyte in all."""

MAX_VALUES = 32_000_000
"""Most values in lists and dictionaries together, counted by their commas."""


def read_json(path: str | os.PathLike[str], *, expected: str) -> Any:
    """Read a JSON file, or say in one line why that cannot be done.

    Parameters
    ----------
    path : path-like
        The file.
    expected : str
        What the caller needs, for the error message.

    Returns
    -------
    object
        Dictionaries, lists, text, numbers, booleans and None.

    Raises
    ------
    UnusableFileError
        If there is no such file, it is too large or has too many values, or it is no JSON (NaN and infinity are none).

    Examples
    --------
    >>> read_json("no/such/file.json", expected="masks")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/file.json: expected masks, but there is no such file
    """
    content = read_whole(path, expected=expected, max_bytes=MAX_BYTES)
    # Brackets inside of texts are counted too; the limits leave room for that.
    n_containers = content.count(b"[") + content.count(b"{")
    if n_containers > MAX_CONTAINERS:
        raise UnusableFileError(
            f"{path}: expected {expected} of at most {MAX_CONTAINERS} lists and objects, got {n_containers}"
        )
    n_values = content.count(b",")
    if n_values > MAX_VALUES:
        raise UnusableFileError(f"{path}: expected {expected} of at most {MAX_VALUES} values, got {n_values}")
    try:
        return json.loads(content, parse_constant=_refuse)
    except RecursionError as error:
        raise UnusableFileError(f"{path}: expected {expected}, but it is nested too deeply") from error
    except ValueError as error:
        raise UnusableFileError(f"{path}: expected {expected}, but it is no JSON ({error})") from error


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no number of JSON")
