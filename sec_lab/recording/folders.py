"""Folders of pictures and of depth pictures, and stacks of them in memory or in one file."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array
from sec_lab.files import UnusableFileError
from sec_lab.recording.numbering import frame_numbers, list_files
from sec_lab.recording.pictures import (
    DEPTH_SUFFIXES,
    PICTURE_SUFFIXES,
    depth_in_metres,
    map_array,
    read_depth,
    read_picture,
)
from sec_lab.recording.stream import Picture, PictureStream, first_size


def folder_pictures(folder: Path, *, frames_per_second: float | None, skip_corrupt: bool) -> PictureStream:
    """Pictures of a folder in natural order, of which only the first is decoded now.

    Parameters
    ----------
    folder : path-like
        Pictures of one kind. If their names differ in one number only, that is the frame number.
    frames_per_second : float or None
        Without it frames have no times.
    skip_corrupt : bool
        Leave corrupt pictures out instead of raising an error there.

    Returns
    -------
    PictureStream

    Raises
    ------
    UnusableFileError
        If there is no such folder, it has no pictures, or two have the same number.

    Examples
    --------
    >>> folder_pictures(Path("no/such/folder"), frames_per_second=25, skip_corrupt=False)
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder: expected a folder of pictures, but there is no such folder
    """
    files = list_files(folder, PICTURE_SUFFIXES, expected="pictures")
    numbers = _numbers(folder, files)
    read = partial(_read, files, numbers, rate=frames_per_second, skip_corrupt=skip_corrupt)
    size = first_size(str(folder), read())
    return PictureStream(str(folder), read, size, numbers, len(files), frames_per_second)


def _read(
    files: Sequence[Path], numbers: Sequence[int] | None, *, rate: float | None, skip_corrupt: bool
) -> Iterator[Picture]:
    indices = numbers or range(len(files))
    for index, file in zip(indices, files, strict=True):
        time = (index - indices[0]) / rate if rate else None
        try:
            yield index, time, read_picture(file)
        except UnusableFileError as error:
            if not skip_corrupt:
                raise UnusableFileError(f"{error} (frame {index})") from error
            yield index, time, None


def array_pictures(frames: ArrayLike, *, name: str, frames_per_second: float | None) -> PictureStream:
    """Pictures that are decoded already; the array is not copied.

    Parameters
    ----------
    frames : (n, height, width, 3) array_like of uint8
        RGB; may be a memory map.
    name : str
        What error messages call it.
    frames_per_second : float or None
        Without it frames have no times.

    Returns
    -------
    PictureStream

    Raises
    ------
    ValueError
        If the shape or type is another, or there is no frame or no pixel.

    Examples
    --------
    >>> array_pictures(np.zeros((0, 4, 5, 3), dtype=np.uint8), name="frames", frames_per_second=None)
    Traceback (most recent call last):
    ...
    ValueError: frames: expected at least one frame and one pixel, got shape (0, 4, 5, 3)
    """
    array = as_array(frames, what=name, ndim=4)
    if array.dtype != np.uint8 or array.shape[3] != 3:
        raise ValueError(
            f"{name}: expected shape (n, height, width, 3) of type uint8, got {array.shape} of {array.dtype}"
        )
    if not array.size:
        raise ValueError(f"{name}: expected at least one frame and one pixel, got shape {array.shape}")
    read = partial(_read_array, array, rate=frames_per_second)
    return PictureStream(name, read, array.shape[1:3], None, len(array), frames_per_second)


def _read_array(array: NDArray[np.uint8], *, rate: float | None) -> Iterator[Picture]:
    for index, image in enumerate(array):
        yield index, index / rate if rate else None, image


@dataclass(frozen=True)
class DepthStream:
    """Depth pictures, each of which can be had by its place.

    Parameters
    ----------
    name : str
        What error messages begin with.
    read : callable
        From the place in the order to metres, shape (height, width).
    n_frames : int
    numbers : tuple of int or None
        Frame numbers, where files are named by them.
    """

    name: str
    read: Callable[[int], NDArray[np.float32]]
    n_frames: int
    numbers: tuple[int, ...] | None


def depth_pictures(path: Path, *, unit_m: float) -> DepthStream:
    """Depth pictures of a folder (16-bit PNG or ``.npy``, one a frame), or of one ``.npy`` file with all of them.

    Parameters
    ----------
    path : path-like
    unit_m : float
        Metres that one step of whole numbers stands for; floating-point numbers are metres already.

    Returns
    -------
    DepthStream

    Raises
    ------
    UnusableFileError
        If there is no such folder or file, or nothing in it.

    Examples
    --------
    >>> depth_pictures(Path("no/such/folder"), unit_m=0.001)
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder: expected a folder of depth pictures, but there is no such folder
    """
    if path.suffix.lower() == ".npy" and not path.is_dir():
        return depth_stack(map_array(path, expected="depth pictures"), name=str(path), unit_m=unit_m)
    files = list_files(path, DEPTH_SUFFIXES, expected="depth pictures")
    return DepthStream(str(path), partial(_read_depth, files, unit_m), len(files), _numbers(path, files))


def depth_stack(depth: ArrayLike, *, name: str, unit_m: float) -> DepthStream:
    """Depth pictures in one array, which is not copied.

    Parameters
    ----------
    depth : (n, height, width) array_like
    name : str
        What error messages call it.
    unit_m : float
        Metres that one step of whole numbers stands for; floating-point numbers are metres already.

    Returns
    -------
    DepthStream

    Raises
    ------
    ValueError
        If the array has another number of dimensions.

    Examples
    --------
    >>> depth_stack([[[1500]], [[1600]]], name="depth", unit_m=0.001).read(1)
    array([[1.6]], dtype=float32)
    """
    array = as_array(depth, what=name, ndim=3)
    return DepthStream(name, partial(_slice_depth, array, unit_m), len(array), None)


def _read_depth(files: Sequence[Path], unit_m: float, place: int) -> NDArray[np.float32]:
    return read_depth(files[place], unit_m=unit_m)


def _slice_depth(array: NDArray[Any], unit_m: float, place: int) -> NDArray[np.float32]:
    return depth_in_metres(array[place], unit_m=unit_m)


def _numbers(folder: Path, files: Sequence[Path]) -> tuple[int, ...] | None:
    try:
        return frame_numbers([file.name for file in files])
    except ValueError as error:
        raise UnusableFileError(f"{folder}: {error}") from error
