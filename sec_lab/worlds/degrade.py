"""Recordings made worse in known ways, to see where a segmentation breaks: texture, contrast, noise, motion, JPEG."""

import io
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array
from sec_lab.recording import Frame, Recording

Picture = NDArray[np.uint8]

MIDDLE_GREY = 128
"""Grey value that a loss of contrast leaves as it is."""

GRAIN_PX = (0.7, 1.5, 3.0, 6.0)
"""Standard deviations of the blur of the patterns that a grain is the sum of."""


@dataclass(frozen=True)
class Degradation:
    """What is done to the frames of a recording, in the order in which it happens to real ones.

    Parameters
    ----------
    frame_step : int, optional
        Only every so many frames are kept: movements become so many times faster.
    texture : float, optional
        Standard deviation of a pattern that is painted on, as a share of the brightness. It rests in the picture.
    contrast : float, optional
        Share of the contrast that is left, from 0 (all is grey) to 1.
    noise_sigma : float, optional
        Standard deviation, in grey values, of noise that is added to every channel of every pixel on its own.
    jpeg_quality : int, optional
        Compression of every frame as a JPEG picture, from 1 (worst) to 100; None (default) leaves it out.

    Raises
    ------
    ValueError
        If a number is not allowed.

    Examples
    --------
    >>> Degradation(contrast=2)
    Traceback (most recent call last):
    ...
    ValueError: contrast: expected a share from 0 to 1, got 2
    """

    frame_step: int = 1
    texture: float = 0.0
    contrast: float = 1.0
    noise_sigma: float = 0.0
    jpeg_quality: int | None = None

    def __post_init__(self) -> None:
        if self.frame_step < 1:
            raise ValueError(f"frame_step: expected at least 1, got {self.frame_step}")
        if not 0 <= self.contrast <= 1:
            raise ValueError(f"contrast: expected a share from 0 to 1, got {self.contrast}")
        for name in ("texture", "noise_sigma"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise ValueError(f"{name}: expected a finite number from 0 on, got {value}")
        if self.jpeg_quality is not None and not 1 <= self.jpeg_quality <= 100:
            raise ValueError(f"jpeg_quality: expected a number from 1 to 100, got {self.jpeg_quality}")


def degraded(
    recording: Recording, degradation: Degradation, *, seed: int = 0, where: ArrayLike | None = None
) -> Recording:
    """The same recording, but worse; frames are changed as they are read.

    Parameters
    ----------
    recording : Recording
    degradation : Degradation
    seed : int, optional
        Of texture and noise: the same seed gives the same recording, whenever and however often it is read.
    where : (n_frames, height, width) array_like of bool, optional
        Where the texture is painted, for every frame of the recording before any is left out; everywhere if left out.
        With the true places of the table, texture stays off the things that move.

    Returns
    -------
    Recording
        Frames keep their numbers and times; depth stays as it is.

    Raises
    ------
    ValueError
        If texture is asked for in a recording with pictures of a right camera, in which it would have to be painted at
        other places, ``where`` has another shape, or, while frames are read, ends early.

    Examples
    --------
    >>> recording = Recording.from_frames(np.full((5, 4, 4, 3), 28, dtype=np.uint8), frames_per_second=25)
    >>> worse = degraded(recording, Degradation(frame_step=2, contrast=0.5))
    >>> len(worse), worse.frames_per_second, [(frame.index, int(frame.image.max())) for frame in worse]
    (3, 12.5, [(0, 78), (2, 78), (4, 78)])
    """
    if degradation.texture and recording.has_right:
        raise ValueError("texture: expected a recording of one camera, got one with pictures of a right camera")
    mask = None if where is None else as_array(where, what="where", ndim=3)
    if mask is not None:
        if mask.dtype != np.bool_:
            raise ValueError(f"where: expected truth values, got values of {mask.dtype}")
        known = (len(mask) if recording.n_frames is None else recording.n_frames, *recording.size)
        if mask.shape != known:
            raise ValueError(f"where: expected shape {known} like the recording, got {mask.shape}")
    step = degradation.frame_step
    numbers, n_frames, rate = recording.numbers, recording.n_frames, recording.frames_per_second
    if step > 1:
        numbers = numbers or (None if n_frames is None else tuple(range(n_frames)))
    return replace(
        recording,
        read=partial(_frames, recording, degradation, seed, mask),
        numbers=None if numbers is None else numbers[::step],
        n_frames=None if n_frames is None else -(-n_frames // step),
        frames_per_second=None if rate is None else rate / step,
    )


def grain(size: tuple[int, int], rng: np.random.Generator) -> NDArray[np.float32]:
    """A pattern without direction, coarse and fine at once, like stone or felt.

    Parameters
    ----------
    size : tuple of int
        (height, width) in pixels.
    rng : numpy.random.Generator

    Returns
    -------
    (height, width) float32
        Mean 0, standard deviation 1.

    Examples
    --------
    >>> pattern = grain((20, 30), np.random.default_rng(0))
    >>> pattern.shape, round(float(pattern.std()), 3)
    ((20, 30), 1.0)
    """
    from scipy.ndimage import gaussian_filter

    pattern = np.zeros(size)
    for sigma in GRAIN_PX:
        layer = gaussian_filter(rng.standard_normal(size), sigma, mode="wrap")
        pattern += layer / layer.std()
    return np.asarray((pattern - pattern.mean()) / pattern.std(), dtype=np.float32)


def _frames(
    recording: Recording, degradation: Degradation, seed: int, mask: NDArray[np.bool_] | None
) -> Iterator[Frame]:
    # Another stream of random numbers than any frame has: frame numbers are not negative, so they are counted from 1.
    pattern = grain(recording.size, np.random.default_rng([seed, 0])) if degradation.texture else None
    for place, frame in islice(enumerate(recording), 0, None, degradation.frame_step):
        gain = None
        if pattern is not None:
            if mask is not None and place >= len(mask):
                raise ValueError(f"where: expected a mask for every frame, got {len(mask)}")
            gain = 1 + degradation.texture * (pattern if mask is None else pattern * mask[place])
        rng = np.random.default_rng([seed, 1 + frame.index])
        image = _worse(frame.image, gain, degradation, rng)
        right = None if frame.right is None else _worse(frame.right, None, degradation, rng)
        yield replace(frame, image=image, right=right)


def _worse(
    picture: Picture, gain: NDArray[np.float32] | None, degradation: Degradation, rng: np.random.Generator
) -> Picture:
    light = picture.astype(np.float32)
    if gain is not None:
        light = np.clip(light * gain[..., None], 0, 255)
    light = MIDDLE_GREY + np.float32(degradation.contrast) * (light - MIDDLE_GREY)
    if degradation.noise_sigma:
        light += np.float32(degradation.noise_sigma) * rng.standard_normal(light.shape, dtype=np.float32)
    worse: Picture = np.clip(np.round(light), 0, 255).astype(np.uint8)
    return worse if degradation.jpeg_quality is None else _as_jpeg(worse, degradation.jpeg_quality)


def _as_jpeg(picture: Picture, quality: int) -> Picture:
    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(picture).save(content, format="JPEG", quality=quality)
    with Image.open(content) as image:
        return np.asarray(image.convert("RGB"))
