"""Streams of pictures as movies, folders and arrays give them, before they are put together to a recording."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sec_lab.files import UnusableFileError

Picture = tuple[int, float | None, NDArray[np.uint8] | None]
"""Frame number, time in seconds where known, and RGB picture; None instead of a corrupt one that is left out."""


@dataclass(frozen=True)
class PictureStream:
    """Pictures of one camera, in their order.

    Parameters
    ----------
    name : str
        What error messages begin with.
    read : callable
        Begins anew with every call.
    size : tuple of int
        (height, width) in pixels, of the first picture; whoever reads on checks the others.
    numbers : tuple of int or None
        Frame numbers, where files are named by them; 0, 1, 2, … otherwise.
    n_frames : int or None
        Number of pictures, where it is known in advance.
    frames_per_second : float or None
    """

    name: str
    read: Callable[[], Iterator[Picture]]
    size: tuple[int, int]
    numbers: tuple[int, ...] | None
    n_frames: int | None
    frames_per_second: float | None


def first_size(name: str, pictures: Iterator[Picture]) -> tuple[int, int]:
    """(height, width) of the first intact picture.

    Raises
    ------
    UnusableFileError
        If there is none.

    Examples
    --------
    >>> first_size("movie.mp4", iter([(0, 0.0, None), (1, 0.04, np.zeros((2, 3, 3), dtype=np.uint8))]))
    (2, 3)
    """
    for _, _, image in pictures:
        if image is not None:
            return image.shape[0], image.shape[1]
    raise UnusableFileError(f"{name}: expected a movie, but it has no frame that can be decoded")
