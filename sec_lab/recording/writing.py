"""Movies written frame by frame, whole or not at all."""

import os
import secrets
from collections.abc import Iterable
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array
from sec_lab.files import UnusableFileError

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream

Preset = Literal["veryfast", "medium", "slow"]

# The same frames give the same bytes anywhere, so nothing of the machine may leave traces in what x264 writes: neither
# its number of threads nor its instructions. With AVX-512, x264's macroblock tree even differs from run to run.
_THREADS = 4
_SAME_EVERYWHERE = {"x264-params": "cpu-independent=1"}


def write_movie(
    path: str | os.PathLike[str],
    frames: Iterable[ArrayLike],
    *,
    frames_per_second: float | Fraction,
    crf: float = 18,
    lossless: bool = False,
    preset: Preset = "medium",
) -> None:
    """Write a movie (H.264), whole or not at all.

    Frames are encoded as they come, so they may be many. They go to a temporary neighbour, which is renamed at the end:
    whatever goes wrong before, interruption included, leaves nothing behind, and an older file as it was.

    Parameters
    ----------
    path : path-like
        E.g. ``movie.mp4`` or ``movie.mkv``; the ending tells the container. An existing file is replaced.
    frames : iterable of (height, width, 3) array_like of uint8
        RGB, all of one size.
    frames_per_second : float or Fraction
        A fraction of whole numbers up to 1001 keeps odd rates exact; 29.97 becomes 2997/100.
    crf : float, optional
        Constant rate factor of x264: from 0 (best) to 51 (worst); 18 (default) looks like the original.
    lossless : bool, optional
        Keep every value of every pixel; ``crf`` does not matter then. Such movies are large, and not every player
        shows them.
    preset : {"veryfast", "medium", "slow"}, optional
        How much time x264 spends on making the file small.

    Raises
    ------
    ValueError
        If there is no frame, a frame is no RGB picture or has another size than the first, or a number is not allowed.
    UnusableFileError
        If the folder does not exist, the path is a directory, no container for H.264 has this ending, or writing fails.

    Examples
    --------
    >>> write_movie("no/such/folder/movie.mp4", [np.zeros((4, 4, 3), dtype=np.uint8)], frames_per_second=25)
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder/movie.mp4: cannot be written, there is no folder no/such/folder
    """
    # Imported when it is used: who only reads label images needs no movie library.
    import av

    file = Path(path)
    rate = _as_rate(frames_per_second)
    if not 0 <= crf <= 51:
        raise ValueError(f"crf: expected a number from 0 to 51, got {crf}")
    if preset not in get_args(Preset):
        raise ValueError(f"preset: expected one of {get_args(Preset)}, got {preset!r}")
    if not file.parent.is_dir():
        raise UnusableFileError(f"{file}: cannot be written, there is no folder {file.parent}")
    if file.is_dir():
        raise UnusableFileError(f"{file}: cannot be written, this is a directory")
    neighbour = file.with_name(f".{file.stem[:50]}-{secrets.token_hex(4)}{file.suffix}")
    try:
        _encode(neighbour, frames, rate=rate, crf=crf, lossless=lossless, preset=preset)
        with neighbour.open("rb+") as stream:
            os.fsync(stream.fileno())
        neighbour.replace(file)
    except UnusableFileError:
        raise
    except (av.error.FFmpegError, OSError) as error:
        raise UnusableFileError(f"{file}: cannot be written ({error.strerror or error})") from error
    finally:
        neighbour.unlink(missing_ok=True)


def _as_rate(frames_per_second: float | Fraction) -> Fraction:
    try:
        rate = Fraction(frames_per_second).limit_denominator(1001)
    except (OverflowError, ValueError, TypeError) as error:
        raise ValueError(f"frames_per_second: expected a number above 0, got {frames_per_second!r}") from error
    if not 0 < rate <= 100_000:
        raise ValueError(f"frames_per_second: expected a number above 0 and up to 100000, got {frames_per_second!r}")
    return rate


def _encode(
    file: Path, frames: Iterable[ArrayLike], *, rate: Fraction, crf: float, lossless: bool, preset: Preset
) -> None:
    import av

    with ExitStack() as stack:
        container: OutputContainer | None = None
        stream: VideoStream | None = None
        shape: tuple[int, ...] | None = None
        for index, values in enumerate(frames):
            image = _as_picture(values, index, shape)
            shape = image.shape
            if container is None or stream is None:
                container, stream = _opened(file, image, rate, crf=crf, lossless=lossless, preset=preset)
                stack.callback(container.close)
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts = index
            container.mux(stream.encode(frame))
        if container is None or stream is None:
            raise ValueError("movie: expected at least one frame, got none")
        container.mux(stream.encode())


def _as_picture(values: ArrayLike, index: int, shape: tuple[int, ...] | None) -> NDArray[np.uint8]:
    image = as_array(values, what=f"frame {index}", ndim=3)
    if image.dtype != np.uint8 or image.shape[2] != 3 or not image.size:
        raise ValueError(
            f"frame {index}: expected shape (height, width, 3) of type uint8, got {image.shape} of {image.dtype}"
        )
    if shape is not None and image.shape != shape:
        raise ValueError(f"frame {index}: expected shape {shape} as before, got {image.shape}")
    return np.ascontiguousarray(image)


def _opened(
    file: Path, image: NDArray[np.uint8], rate: Fraction, *, crf: float, lossless: bool, preset: Preset
) -> "tuple[OutputContainer, VideoStream]":
    import av
    from av.video.stream import VideoStream

    height, width = image.shape[:2]
    if lossless:
        codec, layout, options = "libx264rgb", "rgb24", {"qp": "0"}
    else:
        # Colours at half the resolution, as every player wants it, need even sides.
        codec, layout, options = "libx264", "yuv420p" if not (height % 2 or width % 2) else "yuv444p", {"crf": str(crf)}
    try:
        container = av.open(str(file.absolute()), "w")
        stream = container.add_stream(codec, rate=rate, options={**options, **_SAME_EVERYWHERE, "preset": preset})
    except av.error.FFmpegError:
        raise
    except ValueError as error:
        raise OSError(f"no movie of this codec has the ending {file.suffix!r}") from error
    assert isinstance(stream, VideoStream)
    stream.width, stream.height, stream.pix_fmt = width, height, layout
    stream.codec_context.thread_count = _THREADS
    return container, stream
