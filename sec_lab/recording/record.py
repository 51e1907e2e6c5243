"""Recordings: streams of frames with their times, the second camera's pictures and depth where there are any."""

import math
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.files import UnusableFileError
from sec_lab.recording.calibration import Calibration, read_calibration
from sec_lab.recording.folders import (
    DepthStream,
    array_pictures,
    depth_pictures,
    depth_stack,
    folder_pictures,
)
from sec_lab.recording.stream import Picture, PictureStream

Stereo = Literal["none", "side by side"]
OnCorrupt = Literal["error", "skip"]


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of a recording.

    Its arrays are not copied, as a stream of them may be long; they are write-protected.

    Parameters
    ----------
    index : int
        Frame number.
    image : (height, width, 3) ndarray of uint8
        RGB; of a stereo pair the left picture.
    time_s : float, optional
        Seconds since the first frame, where times are known.
    right : (height, width, 3) ndarray of uint8, optional
        RGB picture of the right camera.
    depth_m : (height, width) ndarray of float32, optional
        Metres along the optical axis; 0 where nothing was measured.

    Raises
    ------
    ValueError
        If a shape or type is another, the pictures differ in size, or a depth is NaN, infinite or negative.

    Examples
    --------
    >>> Frame(0, np.zeros((2, 3, 3), dtype=np.uint8), depth_m=np.full((2, 3), np.nan, dtype=np.float32))
    Traceback (most recent call last):
    ...
    ValueError: depth: expected finite metres from 0 on (0 where nothing was measured), got nan
    """

    index: int
    image: NDArray[np.uint8]
    time_s: float | None = None
    right: NDArray[np.uint8] | None = None
    depth_m: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        for name, image in (("image", self.image), ("right", self.right)):
            if image is None:
                continue
            if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
                raise ValueError(
                    f"{name}: expected shape (height, width, 3) of type uint8, got {image.shape} of {image.dtype}"
                )
            if image.shape != self.image.shape:
                raise ValueError(f"right: expected a picture of {_told(self.image)} like the left, got {_told(image)}")
        if self.depth_m is not None:
            _check_depth(self.depth_m, self.image)
        for name in ("image", "right", "depth_m"):
            array = getattr(self, name)
            if array is not None:
                protected = array.view()
                protected.setflags(write=False)
                object.__setattr__(self, name, protected)


@dataclass(frozen=True, eq=False)
class Recording:
    """Frames of a movie, one after the other: nothing is kept, and every iteration begins anew.

    Made by :meth:`open` or :meth:`from_frames`.

    Parameters
    ----------
    read : callable
        Gives an iterator over the frames with every call.
    size : tuple of int
        (height, width) of every picture, in pixels.
    n_frames : int or None
        Number of frames, where it is known in advance. What a damaged movie's container promises is more than comes.
    numbers : tuple of int or None
        Numbers of the frames, where files are named by them; 0, 1, 2, … otherwise.
    frames_per_second : float or None
        Where it is known; of a movie with frames of unequal length the mean.
    has_right, has_depth : bool
        Whether frames have a picture of the right camera, and depth.
    calibration : Calibration or None

    Examples
    --------
    >>> recording = Recording.from_frames(np.zeros((2, 4, 5, 3), dtype=np.uint8), frames_per_second=25)
    >>> len(recording), recording.size, [frame.time_s for frame in recording]
    (2, (4, 5), [0.0, 0.04])
    """

    read: Callable[[], Iterator[Frame]]
    size: tuple[int, int]
    n_frames: int | None = None
    numbers: tuple[int, ...] | None = None
    frames_per_second: float | None = None
    has_right: bool = False
    has_depth: bool = False
    calibration: Calibration | None = None

    def __iter__(self) -> Iterator[Frame]:
        return self.read()

    def __len__(self) -> int:
        if self.n_frames is None:
            raise TypeError("recording: the number of frames is not known before the last one was read")
        return self.n_frames

    def __bool__(self) -> bool:
        return True

    @classmethod
    def open(
        cls,
        path: str | os.PathLike[str],
        *,
        right: str | os.PathLike[str] | None = None,
        depth: str | os.PathLike[str] | None = None,
        calibration: str | os.PathLike[str] | Calibration | None = None,
        stereo: Stereo = "none",
        frames_per_second: float | None = None,
        depth_unit_m: float = 0.001,
        on_corrupt: OnCorrupt = "error",
    ) -> "Recording":
        """Open a movie or a folder of pictures; only the first frame is decoded now.

        Parameters
        ----------
        path : path-like
            A movie (any container and codec of FFmpeg) or a folder of pictures (PNG, JPEG, BMP, TIFF, WebP or PPM, of
            8 bits a channel) in natural order. If the file names differ in one number only, that is the frame number;
            frames are numbered from 0 on otherwise.
        right : path-like, optional
            Movie or folder of the right camera.
        depth : path-like, optional
            Folder with a grey PNG of 16 bits or a ``.npy`` for every frame, or one ``.npy`` with all, shape (n, height,
            width). Depth belongs to the frame of the same number where both are numbered, to the frame at the same
            place otherwise.
        calibration : path-like or Calibration, optional
            See :func:`~sec_lab.recording.read_calibration`.
        stereo : {"none", "side by side"}, optional
            Side by side: the left half of every picture is from the left camera, the right half from the right one.
        frames_per_second : float, optional
            Replaces the times of a movie, and gives times to the pictures of a folder, which have none.
        depth_unit_m : float, optional
            Metres that one step of whole-number depth stands for (default: millimetres); floating-point depth is in
            metres already.
        on_corrupt : {"error", "skip"}, optional
            What to do at a frame that cannot be decoded: raise an error that names it, or leave it out and go on; the
            other frames keep their numbers. Frames that a movie's codec derives from a corrupt one may show traces.

        Returns
        -------
        Recording

        Raises
        ------
        UnusableFileError
            If a path does not exist or is no movie, nothing can be decoded, or left, right and depth do not fit. While
            the frames are read: at a corrupt frame, if the size changes, or if left, right or depth end early.
        ValueError
            If an option is unknown or a number is not allowed.

        Examples
        --------
        >>> Recording.open("no/such/movie.mp4")
        Traceback (most recent call last):
        ...
        sec_lab.files.UnusableFileError: no/such/movie.mp4: expected a movie, but there is no such file
        """
        if on_corrupt not in get_args(OnCorrupt):
            raise ValueError(f"on_corrupt: expected one of {get_args(OnCorrupt)}, got {on_corrupt!r}")
        _check_options(stereo, right, frames_per_second)
        if not math.isfinite(depth_unit_m) or depth_unit_m <= 0:
            raise ValueError(f"depth_unit_m: expected a number above 0, got {depth_unit_m}")
        pictures, others = (
            None if place is None else _open(Path(place), frames_per_second, skip_corrupt=on_corrupt == "skip")
            for place in (path, right)
        )
        assert pictures is not None
        depths = None if depth is None else depth_pictures(Path(depth), unit_m=depth_unit_m)
        if calibration is not None and not isinstance(calibration, Calibration):
            calibration = read_calibration(calibration)
        return _joined(pictures, others, depths, stereo, calibration)

    @classmethod
    def from_frames(
        cls,
        frames: ArrayLike,
        *,
        right: ArrayLike | None = None,
        depth: ArrayLike | None = None,
        calibration: Calibration | None = None,
        stereo: Stereo = "none",
        frames_per_second: float | None = None,
    ) -> "Recording":
        """Recording of pictures that are decoded already.

        The arrays are not copied, so that long ones (memory maps, too) need no second place.

        Parameters
        ----------
        frames : (n, height, width, 3) array_like of uint8
            RGB.
        right : (n, height, width, 3) array_like of uint8, optional
            RGB pictures of the right camera.
        depth : (n, height, width) array_like of float, optional
            Metres; 0 where nothing was measured.
        calibration : Calibration, optional
        stereo : {"none", "side by side"}, optional
            See :meth:`open`.
        frames_per_second : float, optional
            Without it frames have no times.

        Returns
        -------
        Recording

        Raises
        ------
        ValueError
            If shapes or types disagree, or there is no frame.

        Examples
        --------
        >>> pair = np.zeros((1, 4, 10, 3), dtype=np.uint8)
        >>> (frame,) = Recording.from_frames(pair, stereo="side by side")
        >>> frame.image.shape, frame.right.shape
        ((4, 5, 3), (4, 5, 3))
        """
        _check_options(stereo, right, frames_per_second)
        pictures = array_pictures(frames, name="frames", frames_per_second=frames_per_second)
        others = None if right is None else array_pictures(right, name="right", frames_per_second=frames_per_second)
        depths = None if depth is None else depth_stack(depth, name="depth", unit_m=1)
        return _joined(pictures, others, depths, stereo, calibration)


def _check_options(stereo: str, right: object, frames_per_second: float | None) -> None:
    if stereo not in get_args(Stereo):
        raise ValueError(f"stereo: expected one of {get_args(Stereo)}, got {stereo!r}")
    if stereo == "side by side" and right is not None:
        raise ValueError("right: expected none beside pictures that hold both sides")
    if frames_per_second is not None and not (math.isfinite(frames_per_second) and frames_per_second > 0):
        raise ValueError(f"frames_per_second: expected a number above 0, got {frames_per_second}")


def _open(path: Path, frames_per_second: float | None, *, skip_corrupt: bool) -> PictureStream:
    if path.is_dir():
        return folder_pictures(path, frames_per_second=frames_per_second, skip_corrupt=skip_corrupt)
    # Imported when it is used: folders and arrays need no movie library.
    from sec_lab.recording.movies import movie_pictures

    return movie_pictures(path, frames_per_second=frames_per_second, skip_corrupt=skip_corrupt)


def _joined(
    pictures: PictureStream,
    others: PictureStream | None,
    depths: DepthStream | None,
    stereo: Stereo,
    calibration: Calibration | None,
) -> Recording:
    size = pictures.size
    if stereo == "side by side":
        if size[1] % 2:
            raise ValueError(f"{pictures.name}: expected an even width for two pictures side by side, got {size[1]}")
        size = size[0], size[1] // 2
    if others is not None:
        _check_stereo(pictures, others)
    if depths is not None:
        _check_depths(pictures, depths)
    return Recording(
        partial(_frames, pictures, others, depths, stereo),
        size,
        pictures.n_frames,
        pictures.numbers,
        pictures.frames_per_second,
        others is not None or stereo == "side by side",
        depths is not None,
        calibration,
    )


def _check_stereo(left: PictureStream, right: PictureStream) -> None:
    if left.size != right.size:
        raise ValueError(f"{right.name}: expected pictures of {_by(left.size)} like the left, got {_by(right.size)}")
    if None not in (left.n_frames, right.n_frames) and left.n_frames != right.n_frames:
        raise ValueError(f"{right.name}: expected {left.n_frames} frames like the left, got {right.n_frames}")
    if left.numbers and right.numbers and left.numbers != right.numbers:
        odd = min(set(left.numbers) ^ set(right.numbers))
        raise ValueError(
            f"{right.name}: expected frames of the same numbers as the left, frame {odd} has one side only"
        )


def _check_depths(pictures: PictureStream, depths: DepthStream) -> None:
    if pictures.numbers and depths.numbers:
        missing = set(pictures.numbers) - set(depths.numbers)
        if missing:
            raise ValueError(f"{depths.name}: expected depth for every frame, frame {min(missing)} has none")
    elif pictures.n_frames is not None and pictures.n_frames != depths.n_frames:
        raise ValueError(f"{depths.name}: expected {pictures.n_frames} depth pictures, got {depths.n_frames}")


def _frames(
    pictures: PictureStream, others: PictureStream | None, depths: DepthStream | None, stereo: Stereo
) -> Iterator[Frame]:
    """Frames put together of what each camera gives; a frame of which one part is corrupt is left out as a whole."""
    place_of = None
    if depths is not None and pictures.numbers and depths.numbers:
        place_of = {number: place for place, number in enumerate(depths.numbers)}
    place = -1
    for place, (left, other) in enumerate(_pairs(pictures, others)):
        index, time, image = left
        right = None if other is None else other[2]
        if depths is not None and place_of is None and place >= depths.n_frames:
            raise ValueError(f"{depths.name}: expected depth for every frame, frame {index} has none")
        if image is None or (others is not None and right is None):
            continue
        _check_size(image, pictures, index)
        if others is not None and right is not None:
            _check_size(right, others, index)
        if stereo == "side by side":
            half = image.shape[1] // 2
            image, right = np.ascontiguousarray(image[:, :half]), np.ascontiguousarray(image[:, half:])
        try:
            depth = None if depths is None else depths.read(place if place_of is None else place_of[index])
            frame = Frame(index, image, time, right, depth)
        except UnusableFileError:
            raise
        except ValueError as error:
            raise ValueError(f"{pictures.name}: frame {index}: {error}") from error
        yield frame
    if depths is not None and place_of is None and place + 1 < depths.n_frames:
        raise ValueError(f"{depths.name}: expected {place + 1} depth pictures, one a frame, got {depths.n_frames}")


def _pairs(left: PictureStream, right: PictureStream | None) -> Iterator[tuple[Picture, Picture | None]]:
    if right is None:
        yield from ((picture, None) for picture in left.read())
        return
    others = right.read()
    n_pairs = 0
    for picture in left.read():
        other = next(others, None)
        if other is None:
            raise ValueError(f"{right.name}: expected as many frames as the left, but it ends after {n_pairs}")
        n_pairs += 1
        yield picture, other
    if next(others, None) is not None:
        raise ValueError(f"{right.name}: expected {n_pairs} frames like the left, got more")


def _check_size(image: NDArray[np.uint8], pictures: PictureStream, index: int) -> None:
    if image.shape[:2] != pictures.size:
        raise ValueError(
            f"{pictures.name}: frame {index}: expected a picture of {_by(pictures.size)} as before, got {_told(image)}"
        )


def _check_depth(depth: NDArray[np.float32], image: NDArray[np.uint8]) -> None:
    if depth.dtype != np.float32 or depth.shape != image.shape[:2]:
        raise ValueError(
            f"depth: expected {_told(image)} like the picture of type float32, got shape {depth.shape} of {depth.dtype}"
        )
    # One pass finds all: NaN fails every comparison.
    if not (depth >= 0).all() or depth.max() == np.inf:
        wrong = depth[~((depth >= 0) & (depth < np.inf))]
        raise ValueError(f"depth: expected finite metres from 0 on (0 where nothing was measured), got {wrong[0]}")


def _told(image: NDArray[np.uint8]) -> str:
    return _by(image.shape[:2])


def _by(size: tuple[int, ...]) -> str:
    return f"{size[0]}×{size[1]}"
