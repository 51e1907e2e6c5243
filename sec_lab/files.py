"""Files at the borders of the workbench: read with one clear error, written whole or not at all."""

import errno
import os
import secrets
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


class UnusableFileError(OSError, ValueError):
    """A path that cannot be used as asked: missing, a directory, unreadable, damaged or hostile.

    It is both an :class:`OSError` and a :class:`ValueError`, so either way of catching bad input finds it. The message
    is one line that names the path, what was expected and what came.
    """


def read_whole(path: str | os.PathLike[str], *, expected: str, max_bytes: int = 1 << 28) -> bytes:
    """Read a whole file, or say in one line why that cannot be done.

    Parameters
    ----------
    path : path-like
        The file.
    expected : str
        What the caller needs, for the error message, e.g. ``"a GraphML file"``.
    max_bytes : int, optional
        Refuse files larger than this many bytes (default 256 MiB).

    Returns
    -------
    bytes

    Raises
    ------
    UnusableFileError
        If the path does not exist, is a directory, cannot be read or is too large.

    Examples
    --------
    >>> read_whole("no/such/file.graphml", expected="a GraphML file")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/file.graphml: expected a GraphML file, but there is no such file
    """
    file = Path(path)
    try:
        with file.open("rb") as stream:
            content = _read_up_to(stream, max_bytes + 1)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise UnusableFileError(f"{file}: expected {expected}, but there is no such file") from error
    except IsADirectoryError as error:
        raise UnusableFileError(f"{file}: expected {expected}, but this is a directory") from error
    except (OSError, ValueError) as error:
        raise UnusableFileError(f"{file}: expected {expected}, but it cannot be read ({_reason(error)})") from error
    if len(content) > max_bytes:
        raise UnusableFileError(f"{file}: expected {expected} of at most {max_bytes} bytes, but it is larger")
    return content


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file whole or not at all: a temporary neighbour is renamed onto it at the end.

    Parameters
    ----------
    path : path-like
        Where the file goes; its folder must exist. An existing file is replaced.
    content : str or bytes
        Text is written as UTF-8.

    Raises
    ------
    UnusableFileError
        If the folder does not exist, the path is a directory, the text is no UTF-8, or writing fails; nothing is left
        behind then.

    Examples
    --------
    >>> write_whole("no/such/folder/chain.csv", "a,b")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder/chain.csv: cannot be written, there is no folder no/such/folder
    """
    file = Path(path)
    try:
        _replace(file, content.encode() if isinstance(content, str) else content)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise UnusableFileError(f"{file}: cannot be written, there is no folder {file.parent}") from error
    except IsADirectoryError as error:
        raise UnusableFileError(f"{file}: cannot be written, this is a directory") from error
    except (OSError, ValueError) as error:
        raise UnusableFileError(f"{file}: cannot be written ({_reason(error)})") from error


@contextmanager
def written_together(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Several files that are written all or none: each is made beside its place and moved there at the end.

    Parameters
    ----------
    paths : sequence of Path
        Where the files go; their folders must exist. Existing files are replaced.

    Yields
    ------
    list of Path
        Where to write instead, in the same order and with the same endings. Nothing of it is left if an error leaves
        the context, interruption included; the error then names the places that were asked for.

    Raises
    ------
    UnusableFileError
        If a folder does not exist, a path is a directory or named twice, or a file cannot be moved to its place.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     places = [Path(folder) / "a.txt", Path(folder) / "b.txt"]
    ...     with written_together(places) as (a, b):
    ...         write_whole(a, "1")
    ...         write_whole(b, "2")
    ...         before = [place.exists() for place in places]
    ...     before, [place.exists() for place in places]
    ([False, False], [True, True])
    """
    for place, path in enumerate(paths):
        if not path.parent.is_dir():
            raise UnusableFileError(f"{path}: cannot be written, there is no folder {path.parent}")
        if path.is_dir():
            raise UnusableFileError(f"{path}: cannot be written, this is a directory")
        if path.resolve() in [earlier.resolve() for earlier in paths[:place]]:
            raise UnusableFileError(f"{path}: expected every file once, got it for two things")
    neighbours = [path.with_name(f".{path.stem[:40]}-{secrets.token_hex(4)}{path.suffix}") for path in paths]
    try:
        yield neighbours
        for neighbour, path in zip(neighbours, paths, strict=True):
            neighbour.replace(path)
    except OSError as error:
        message = str(error)
        for neighbour, path in zip(neighbours, paths, strict=True):
            message = message.replace(str(neighbour), str(path))
        raise UnusableFileError(message) from error
    finally:
        for neighbour in neighbours:
            neighbour.unlink(missing_ok=True)


def _replace(file: Path, data: bytes) -> None:
    if file.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(file))
    # A name may have 255 bytes, and a character up to four.
    neighbour = file.with_name(f".{file.name[:50]}.{secrets.token_hex(4)}")
    try:
        with neighbour.open("xb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        neighbour.replace(file)
    except BaseException:
        neighbour.unlink(missing_ok=True)
        raise


def _reason(error: Exception) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error)


def _read_up_to(stream: BinaryIO, n: int) -> bytes:
    """Read n bytes or all there are, in pieces: Python sets aside at once whatever it is asked to read."""
    pieces: list[bytes] = []
    while n > 0 and (piece := stream.read(min(n, 1 << 20))):
        pieces.append(piece)
        n -= len(piece)
    return b"".join(pieces)
