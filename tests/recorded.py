"""Small movies and pictures for tests of recordings."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from sec_lab.recording import Recording

Pictures = NDArray[np.uint8]


def moving_texture(n: int, height: int = 48, width: int = 64, *, seed: int = 0) -> Pictures:
    """Noise that moves on by a pixel a frame, so no frame is like another."""
    texture = np.random.default_rng(seed).integers(0, 256, (height, width + n, 3), dtype=np.uint8)
    return np.stack([texture[:, i : i + width] for i in range(n)])


def movie_of(
    path: Path, frames: Pictures, *, codec: str = "libx264", layout: str = "yuv420p", times: list[int] | None = None
) -> Path:
    """Movie written by PyAV alone, at 25 frames a second unless times (in hundredths of a second) are given."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = frames.shape[2], frames.shape[1], layout  # type: ignore[union-attr]
        if times is not None:
            stream.codec_context.time_base = stream.time_base = Fraction(1, 100)
        for index, image in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            if times is not None:
                frame.pts, frame.time_base = times[index], Fraction(1, 100)
            container.mux(stream.encode(frame))  # type: ignore[union-attr, arg-type]
        container.mux(stream.encode())  # type: ignore[union-attr]
    return path


def pictures_of(recording: Recording) -> Pictures:
    return np.stack([frame.image for frame in recording])


def save(folder: Path, frames: Pictures, *, name: str = "{:05d}.png", first: int = 0, step: int = 1) -> Path:
    folder.mkdir(exist_ok=True)
    for index, image in enumerate(frames):
        Image.fromarray(image).save(folder / name.format(first + step * index))
    return folder


def refused(act: Callable[[], object], *parts: object) -> None:
    """One line, in which all parts occur."""
    with pytest.raises(ValueError) as raised:
        act()
    message = str(raised.value)
    assert "\n" not in message
    for part in parts:
        assert str(part) in message, message
