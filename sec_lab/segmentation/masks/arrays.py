"""Label images as NumPy arrays: ``.npy`` of shape (n, height, width), ``.npz`` with one such array or one a frame.

In a ``.npz`` with several three-dimensional arrays the one called ``labels`` or ``masks`` is taken. Two-dimensional
arrays, as ``np.savez(path, *images)`` writes them, are frames in the natural order of their names.
"""

import zipfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.files import UnusableFileError
from sec_lab.recording.numbering import natural_key
from sec_lab.recording.pictures import check_pixels
from sec_lab.segmentation.masks.options import MaskOptions, check_size, number_frames
from sec_lab.segmentation.record import Segmentation

_PREFERRED = ("labels", "masks")
_DAMAGE = (
    OSError,
    ValueError,
    SyntaxError,
    EOFError,
    RuntimeError,
    NotImplementedError,
    zipfile.BadZipFile,
    zlib.error,
)


@dataclass(frozen=True)
class _Member:
    """One array: its place in the ``.npz`` (None: the file itself), its name, shape and type."""

    member: str | None
    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]


def open_arrays(path: Path, options: MaskOptions) -> Segmentation:
    """Label images of a ``.npy`` or ``.npz`` file, of which only the heads are read now.

    Parameters
    ----------
    path : path-like
    options : MaskOptions

    Returns
    -------
    Segmentation

    Raises
    ------
    UnusableFileError
        If there is no such file, it is damaged, or it holds Python objects.
    ValueError
        If it holds no label images, several arrays that may be meant, or images of another size than asked for.

    Examples
    --------
    >>> open_arrays(Path("no/such/labels.npz"), MaskOptions())
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/labels.npz: expected masks (.npy or .npz), but there is no such file
    """
    members = _members(path)
    stacks = [member for member in members if len(member.shape) == 3]
    if len(stacks) > 1:
        stacks = [member for member in stacks if member.name in _PREFERRED] or stacks
    if len(stacks) > 1:
        raise ValueError(f"expected one array of label images, got {' and '.join(member.name for member in stacks)}")
    chosen = stacks or sorted((m for m in members if len(m.shape) == 2), key=lambda member: natural_key(member.name))
    if not chosen:
        found = ", ".join(f"{member.name} {member.shape}" for member in members[:5])
        raise ValueError(f"expected label images of shape (n, height, width), got {found or 'nothing'}")
    size = _checked_size(chosen)
    check_size(size, options)
    n_images = chosen[0].shape[0] if stacks else len(chosen)
    frames = number_frames(None, n_images, options=options)
    return Segmentation(partial(_read, path, chosen, frames.tolist()), size, frames, options.background, options.names)


def _checked_size(members: Sequence[_Member]) -> tuple[int, int]:
    size = members[0].shape[-2], members[0].shape[-1]
    check_pixels(size)
    for member in members:
        if member.shape[-2:] != size:
            raise ValueError(f"{member.name}: expected {size[0]}×{size[1]} as before, got {member.shape}")
        if member.dtype.kind not in "bui":
            raise ValueError(f"{member.name}: expected whole numbers, got values of type {member.dtype}")
    return size


def _members(path: Path) -> list[_Member]:
    try:
        with path.open("rb") as stream:
            if path.suffix.lower() == ".npy":
                return [_Member(None, path.stem, *_head(stream))]
            with zipfile.ZipFile(stream) as archive:
                return [_member_of(archive, name) for name in archive.namelist() if name.endswith(".npy")]
    except FileNotFoundError as error:
        raise UnusableFileError(f"{path}: expected masks (.npy or .npz), but there is no such file") from error
    except _DAMAGE as error:
        raise _unreadable(path, error) from error


def _member_of(archive: zipfile.ZipFile, name: str) -> _Member:
    with archive.open(name) as stream:
        return _Member(name, name.removesuffix(".npy"), *_head(stream))


def _head(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, is_fortran, dtype = np.lib.format.read_array_header_2_0(stream)
    else:
        raise ValueError(f"version {version} of the format is for tables, not for pictures")
    if dtype.hasobject:
        raise ValueError("it holds Python objects")
    if is_fortran and len(shape) > 1:
        raise ValueError("frames do not follow one another; save np.ascontiguousarray(labels)")
    return shape, dtype


def _read(path: Path, members: Sequence[_Member], frames: Sequence[int]) -> Iterator[tuple[int, NDArray[Any]]]:
    numbers = iter(frames)
    try:
        with path.open("rb") as stream:
            if members[0].member is None:
                yield from zip(numbers, _images(stream, members[0]), strict=True)
                return
            with zipfile.ZipFile(stream) as archive:
                for member in members:
                    with archive.open(member.member or "") as inner:
                        for image in _images(inner, member):
                            yield next(numbers), image
    except _DAMAGE as error:
        raise _unreadable(path, error) from error


def _images(stream: IO[bytes], member: _Member) -> Iterator[NDArray[Any]]:
    _head(stream)
    n_images = member.shape[0] if len(member.shape) == 3 else 1
    shape = member.shape[-2:]
    n_bytes = shape[0] * shape[1] * member.dtype.itemsize
    for place in range(n_images):
        content = stream.read(n_bytes)
        if len(content) < n_bytes:
            raise ValueError(f"{member.name} ends within image {place} of {n_images}")
        image = np.frombuffer(content, dtype=member.dtype).reshape(shape)
        yield image.astype(np.uint8) if image.dtype == np.bool_ else image


def _unreadable(path: Path, error: BaseException) -> UnusableFileError:
    reason = " ".join(str(error).split()) or type(error).__name__
    return UnusableFileError(f"{path}: expected masks (.npy or .npz), but they cannot be read ({reason})")
