"""Movies, decoded one frame at a time: frame numbers, frame times, and which frames are corrupt."""

import re
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.container import InputContainer
from av.packet import Packet
from av.video.frame import VideoFrame
from av.video.stream import VideoStream
from numpy.typing import NDArray

from sec_lab.files import UnusableFileError
from sec_lab.recording.pictures import MAX_PIXELS, check_pixels
from sec_lab.recording.stream import Picture, PictureStream, first_size


def movie_pictures(path: Path, *, frames_per_second: float | None, skip_corrupt: bool) -> PictureStream:
    """Pictures of a movie, of which only the first is decoded now.

    Parameters
    ----------
    path : path-like
        Any container and codec that FFmpeg knows.
    frames_per_second : float or None
        Replaces the times of the container, if given.
    skip_corrupt : bool
        Leave corrupt frames out instead of raising an error there.

    Returns
    -------
    PictureStream
        Times count from the first frame on.

    Raises
    ------
    UnusableFileError
        If there is no such file, it is no movie, or has no frame.

    Examples
    --------
    >>> movie_pictures(Path("no/such/movie.mp4"), frames_per_second=None, skip_corrupt=False)
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/movie.mp4: expected a movie, but there is no such file
    """
    with _opened(path, threads="AUTO") as (_, stream):
        n_frames = stream.frames or None
        told = stream.average_rate or stream.guessed_rate
    rate = frames_per_second or (float(told) if told else None)
    read = partial(_read, path, rate=rate, is_rate_given=frames_per_second is not None, skip_corrupt=skip_corrupt)
    with closing(read()) as pictures:
        size = first_size(str(path), pictures)
    return PictureStream(str(path), read, size, None, n_frames, rate)


@contextmanager
def _opened(path: Path, *, threads: str) -> Iterator[tuple[InputContainer, VideoStream]]:
    if path.is_dir():
        raise UnusableFileError(f"{path}: expected a movie, but this is a directory")
    try:
        # A movie may be a playlist: it may name local files only, and a path is never taken for an address.
        container = av.open(str(path.absolute()), options={"protocol_whitelist": "file"}, metadata_errors="replace")
    except FileNotFoundError as error:
        raise UnusableFileError(f"{path}: expected a movie, but there is no such file") from error
    except (av.error.FFmpegError, OSError, ValueError) as error:
        raise UnusableFileError(f"{path}: expected a movie, but it cannot be read as one ({_reason(error)})") from error
    with container:
        if not container.streams.video:
            raise UnusableFileError(f"{path}: expected a movie, but it has no pictures")
        stream = container.streams.video[0]
        try:
            check_pixels((stream.codec_context.height, stream.codec_context.width))
        except ValueError as error:
            raise UnusableFileError(f"{path}: {error} a frame") from error
        options = {"max_pixels": str(MAX_PIXELS)}
        if stream.codec_context.name == "mjpeg":
            # Other decoders mark the frames that they patched up; this one does not, unless it is told to stop there.
            options["err_detect"] = "explode"
        stream.codec_context.options = options
        stream.thread_type = threads
        yield container, stream


def _read(path: Path, *, rate: float | None, is_rate_given: bool, skip_corrupt: bool) -> Generator[Picture, None, None]:
    start: float | None = None
    for index, frame in enumerate(_frames(path, skip_corrupt=skip_corrupt)):
        if frame is None:
            if not skip_corrupt:
                raise UnusableFileError(f"{path}: frame {index}: expected an intact picture, but it is corrupt")
            yield index, None, None
            continue
        by_rate = index / rate if rate else None
        if is_rate_given or frame.time is None:
            time = by_rate
        else:
            start = frame.time - (by_rate or 0) if start is None else start
            time = frame.time - start
        yield index, time, _as_rgb(frame)


def _frames(path: Path, *, skip_corrupt: bool) -> Iterator[VideoFrame | None]:
    """Frames in the order in which they are shown; None where one should be and none could be decoded."""
    n_frames = 0
    with _opened(path, threads="AUTO") as (container, stream):
        for frame in _decoded(path, container, stream, skip_corrupt=skip_corrupt):
            if frame is None:
                break
            n_frames += 1
            yield frame
        else:
            return
    # Threads report errors late; without them an error belongs to the packet that was just given.
    with _opened(path, threads="NONE") as (container, stream):
        stream.codec_context.thread_count = 1
        yield from islice(_decoded(path, container, stream, skip_corrupt=skip_corrupt), n_frames, None)


def _decoded(
    path: Path, container: InputContainer, stream: VideoStream, *, skip_corrupt: bool
) -> Iterator[VideoFrame | None]:
    """Frames, and None for corrupt ones; with several threads nothing of worth any more after the first of these."""
    has_threads = stream.thread_type.name != "NONE"
    lost: set[int] = set()
    n_packets = n_frames = 0
    last_packet = last_frame = end = 0
    for packet in _packets(path, container, skip_corrupt=skip_corrupt):
        if packet is not None:
            n_packets += 1
            last_packet = max(last_packet, packet.pts or 0)
            end = max(end, (packet.pts or 0) + (packet.duration or 0))
        decoded: list[VideoFrame | None] = []
        try:
            decoded.extend(stream.codec_context.decode(packet))
        except av.error.FFmpegError:
            if has_threads or packet is None or packet.pts is None:
                decoded.append(None)
            elif not packet.is_discard:
                lost.add(packet.pts)
        for frame in decoded:
            if frame is None or frame.pts is None:
                yield frame
            else:
                # Frames come in the order of their times: what was to be shown before and is not there is lost.
                earlier = {time for time in lost if time < frame.pts}
                yield from [None] * len(earlier)
                n_frames += len(earlier)
                # What a decoder gives at the end has no unit of time.
                frame.time_base = stream.time_base
                yield None if frame.is_corrupt or frame.pts in lost else frame
                lost -= {*earlier, frame.pts}
                last_frame = frame.pts
            n_frames += 1
    yield from [None] * len(lost)
    if has_threads and last_frame < last_packet:
        # At the end of a movie threads keep errors to themselves.
        yield None
    elif not skip_corrupt:
        _check_end(path, container, stream, n_packets=n_packets, end=end, n_frames=n_frames)


def _check_end(
    path: Path, container: InputContainer, stream: VideoStream, *, n_packets: int, end: int, n_frames: int
) -> None:
    """Refuse a movie that ends before its header says so: by the number of frames (MP4) or by the time (Matroska)."""
    promised = stream.frames if container.format.name.startswith("mov") else 0
    if n_packets < promised:
        raise UnusableFileError(f"{path}: expected {promised} frames as its header says, but it ends after {n_frames}")
    told = re.fullmatch(r"(\d+):(\d+):(\d+(?:\.\d+)?)", stream.metadata.get("DURATION", ""))
    if told is not None and stream.time_base and stream.average_rate:
        hours, minutes, seconds = (float(part) for part in told.groups())
        promised_s = 3600 * hours + 60 * minutes + seconds
        if end * stream.time_base < promised_s - 1.5 / stream.average_rate:
            raise UnusableFileError(
                f"{path}: expected {promised_s:g} seconds as its header says, but it ends after {n_frames} frames"
            )


def _packets(path: Path, container: InputContainer, *, skip_corrupt: bool) -> Iterator["Packet[VideoStream] | None"]:
    """Packets of a movie; at the end None, upon which a decoder gives what it still holds."""
    try:
        for packet in container.demux(container.streams.video[0]):
            if packet.size:
                yield packet
    except av.error.FFmpegError as error:
        yield None
        if not skip_corrupt:
            raise UnusableFileError(f"{path}: it cannot be read to its end ({_reason(error)})") from error
    else:
        yield None


def _as_rgb(frame: VideoFrame) -> NDArray[np.uint8]:
    image: NDArray[Any] = frame.to_ndarray(format="rgb24")
    quarters = round(frame.rotation / 90)
    return np.ascontiguousarray(np.rot90(image, quarters)) if quarters else image


def _reason(error: Exception) -> str:
    return (isinstance(error, OSError | av.error.FFmpegError) and error.strerror) or str(error)
