"""Tables of relations, as the recordings made after the thesis keep them in ``SEC.dat``."""

import os
import re
from itertools import combinations
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from sec_lab.codes import from_binary
from sec_lab.event_chain import EventChain
from sec_lab.files import UnusableFileError, read_whole
from sec_lab.graphml.markup import shown, whole_number

MissingPairs = Literal["error", "omit"]

_EXPECTED = "a table of relations"
_ROW = re.compile(r"[^\t]*\t[^\t]*(?:\t[^\t]*)+")


def read_table(path: str | os.PathLike[str], *, missing_pairs: MissingPairs = "error") -> EventChain:
    r"""Read an event chain from a table of 0, 1 and 9.

    One line a pair: two segment labels and one code a key frame, each followed by a tab; 1 means touching (as in the
    tables of §4.2.1), 0 non-touching, 9 that one of the two is absent. Such a table knows neither frame numbers nor
    names nor overlapping.

    Parameters
    ----------
    path : path-like
        The file.
    missing_pairs : {"error", "omit"}, optional
        What to do when two of the segments have no line: these tables hold every pair, so by default the file is
        taken to be truncated.

    Returns
    -------
    EventChain
        Rows in the order of the file; key frames 0, 1, 2, …

    Raises
    ------
    UnusableFileError
        If the file cannot be read, or a line is ragged, has another code, repeats a pair or joins a segment to
        itself, or a pair is missing. The message names the line. It is a ValueError as well as an OSError.
    ValueError
        If ``missing_pairs`` is unknown.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "SEC.dat").write_text("2\t3\t0\t1\t\n2\t6\t9\t0\t\n3\t6\t9\t9\t\n")
    ...     read_table(Path(folder) / "SEC.dat").to_frame()
    key frame  0  1
    pair
    2, 3       0  2
    2, 6       9  0
    3, 6       9  9
    """
    if missing_pairs not in get_args(MissingPairs):
        raise ValueError(f"missing_pairs: expected one of {get_args(MissingPairs)}, got {missing_pairs!r}")
    return chain_of_table(read_whole(path, expected=_EXPECTED, max_bytes=1 << 26), path, missing_pairs=missing_pairs)


def chain_of_table(data: bytes, path: str | os.PathLike[str], *, missing_pairs: MissingPairs = "error") -> EventChain:
    """Event chain of the content of a table, see :func:`read_table`."""
    file = Path(path)
    if not data.strip():
        raise UnusableFileError(f"{file}: expected {_EXPECTED}, but it is empty")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UnusableFileError(f"{file}: expected {_EXPECTED}, but it is no text") from error
    rows: dict[tuple[int, int], bytes] = {}
    lines = text.rstrip("\r\n").split("\n")
    for number, line in enumerate(lines, start=1):
        try:
            _add_row(rows, line)
        except ValueError as error:
            raise UnusableFileError(f"{file}, line {number}: {error}") from error
    if len(lines) == 1 and not text.endswith("\n"):
        # The length of a row shows that it is whole only beside another row.
        raise UnusableFileError(f"{file}, line 1: expected a line break behind a single row, got none (truncated?)")
    if missing_pairs == "error":
        _check_complete(rows, file)
    table = np.frombuffer(b"".join(rows.values()), dtype=np.uint8).reshape(len(rows), -1) - ord("0")
    return EventChain(from_binary(table), list(rows))


def _add_row(rows: dict[tuple[int, int], bytes], line: str) -> None:
    row = line.removesuffix("\r").removesuffix("\t")
    if not _ROW.fullmatch(row):
        raise ValueError(f"expected two segments and relations, separated by tabs, got {shown(row)}")
    first, second, *cells = row.split("\t")
    pair = whole_number(first, what="segment"), whole_number(second, what="segment")
    wrong = next((cell for cell in cells if cell not in ("0", "1", "9")), None)
    if wrong is not None:
        raise ValueError(f"relation of {pair}: expected 0, 1 or 9, got {shown(wrong)}")
    if pair[0] == pair[1]:
        raise ValueError(f"expected two different segments, got {pair}")
    if pair in rows or pair[::-1] in rows:
        raise ValueError(f"expected each pair once, got {pair} again")
    width = len(next(iter(rows.values()), cells))
    if len(cells) != width:
        raise ValueError(f"relations of {pair}: expected {width} as in the lines above, got {len(cells)}")
    rows[pair] = "".join(cells).encode()


def _check_complete(rows: dict[tuple[int, int], bytes], file: Path) -> None:
    segments = sorted({segment for pair in rows for segment in pair})
    if len(rows) < len(segments) * (len(segments) - 1) // 2:
        lacking = next(pair for pair in combinations(segments, 2) if pair not in rows and pair[::-1] not in rows)
        raise UnusableFileError(
            f"{file}: expected a row for every pair of {len(segments)} segments, got none for {lacking} (truncated?)"
        )
