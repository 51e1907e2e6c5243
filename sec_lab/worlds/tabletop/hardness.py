"""How hard movies are to segment, in three numbers that need no segmenter of ours: noise, texture, a plain baseline.

``python -m sec_lab.worlds.tabletop.hardness MOVIE...`` prints them, rendered and recorded movies side by side.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.recording import Recording
from sec_lab.worlds.tabletop.truth import read_truth

N_FRAMES = 5
"""Frames of a movie that are looked at, spread evenly."""

_QUIETEST = 0.878
"""What pure noise of standard deviation 1 shows in the quietest quarter of its windows."""


@dataclass(frozen=True)
class Hardness:
    """How hard a movie is to segment: means over some of its frames.

    Parameters
    ----------
    noise_grey : float
        Standard deviation of the noise, in grey values from 0 to 255.
    gradient_grey_per_px : float
        Mean size of the gradient after the noise was smoothed away: edges and texture.
    n_segments : float
        How many segments felzenszwalb finds in a frame.
    covering : float
        Covering of the truth by them, NaN where there is no truth.
    """

    noise_grey: float
    gradient_grey_per_px: float
    n_segments: float
    covering: float


def noise_of(image: ArrayLike) -> float:
    """Standard deviation of the noise in a picture, from its smooth parts.

    A difference operator that is blind to planes (Immerkær 1996) is taken in windows of 8 by 8 pixels. The quietest
    quarter of the windows tells the noise, as if the rest were edges and texture.

    Parameters
    ----------
    image : (height, width) or (height, width, 3) array_like
        At least 16 pixels high and wide.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the picture is smaller.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> round(noise_of(100 + 3 * rng.standard_normal((256, 256))), 1)
    3.0
    """
    from scipy.ndimage import correlate

    grey = _grey(image)
    if min(grey.shape) < 16:
        raise ValueError(f"image: expected at least 16 pixels a side, got shape {grey.shape}")
    operator = np.array([(1, -2, 1), (-2, 4, -2), (1, -2, 1)])
    # The operator's weights have a norm of 6.
    residual = correlate(grey, operator)[1:-1, 1:-1] / 6
    rows, columns = (8 * (n // 8) for n in residual.shape)
    windows = residual[:rows, :columns].reshape(rows // 8, 8, columns // 8, 8)
    spread = np.sqrt((windows**2).mean(axis=(1, 3))).ravel()
    return float(np.quantile(spread, 0.25)) / _QUIETEST


def gradient_of(image: ArrayLike, *, sigma_px: float = 1.0) -> float:
    """Mean size of the gradient of a picture, in grey values a pixel.

    Parameters
    ----------
    image : (height, width) or (height, width, 3) array_like
    sigma_px : float, optional
        Of the smoothing before, against noise.

    Examples
    --------
    >>> round(gradient_of(np.tile(3.0 * np.arange(50), (50, 1))), 1)
    2.9
    """
    from scipy.ndimage import gaussian_filter

    rows, columns = np.gradient(gaussian_filter(_grey(image), sigma_px))
    return float(np.hypot(rows, columns).mean())


def covering_of(truth: ArrayLike, found: ArrayLike) -> float:
    """Covering of a true label image by another one: the best intersection over union of every true segment, by area.

    Parameters
    ----------
    truth, found : (height, width) array_like of int
        Not negative.

    Returns
    -------
    float
        From 0 to 1.

    Raises
    ------
    ValueError
        If the shapes differ.

    Examples
    --------
    >>> covering_of([[1, 1, 2, 2]], [[5, 5, 5, 6]])
    0.5833333333333333
    """
    true, other = np.asarray(truth), np.asarray(found)
    if true.shape != other.shape:
        raise ValueError(f"found: expected shape {true.shape} as the truth, got {other.shape}")
    _, true = np.unique(true, return_inverse=True)
    _, other = np.unique(other, return_inverse=True)
    shared = np.zeros((true.max() + 1, other.max() + 1))
    np.add.at(shared, (true.ravel(), other.ravel()), 1)
    areas, found_areas = shared.sum(axis=1), shared.sum(axis=0)
    best = (shared / (areas[:, None] + found_areas[None] - shared)).max(axis=1)
    return float((areas * best).sum() / areas.sum())


def hardness(images: Sequence[ArrayLike], labels: Sequence[ArrayLike] | None = None) -> Hardness:
    """How hard some frames of a movie are to segment.

    Parameters
    ----------
    images : sequence of (height, width, 3) array_like of uint8
    labels : sequence of (height, width) array_like of int, optional
        The truth of each of them.

    Raises
    ------
    ValueError
        If there is no image, or the labels do not fit.

    Examples
    --------
    >>> flat = np.full((32, 32, 3), 90, dtype=np.uint8)
    >>> hardness([flat], [np.ones((32, 32), dtype=int)])
    Hardness(noise_grey=0.0, gradient_grey_per_px=0.0, n_segments=1.0, covering=1.0)
    """
    from skimage.segmentation import felzenszwalb

    if not len(images):
        raise ValueError("images: expected at least one, got none")
    if labels is not None and len(labels) != len(images):
        raise ValueError(f"labels: expected {len(images)}, one for every image, got {len(labels)}")
    # The scale and least size that scikit-image's gallery uses.
    found = [felzenszwalb(np.asarray(image), scale=100, sigma=0.5, min_size=50) for image in images]
    coverings = [] if labels is None else [covering_of(true, ours) for true, ours in zip(labels, found, strict=True)]
    return Hardness(
        noise_grey=float(np.mean([noise_of(image) for image in images])),
        gradient_grey_per_px=float(np.mean([gradient_of(image) for image in images])),
        n_segments=float(np.mean([len(np.unique(segments)) for segments in found])),
        covering=float(np.mean(coverings)) if coverings else math.nan,
    )


def hardness_of(path: Path, *, n_frames: int = N_FRAMES) -> Hardness:
    """How hard a movie is to segment; against its truth, if it is a folder made by :func:`make_movie`.

    Parameters
    ----------
    path : Path
        A movie, or a folder with ``left.mp4`` and ``truth.npz``.
    n_frames : int, optional
        How many frames are looked at.

    Raises
    ------
    UnusableFileError
        If it cannot be read.
    """
    truth = read_truth(path) if path.is_dir() else None
    movie = path / "left.mp4" if path.is_dir() else path
    total = len(truth.labels) if truth is not None else sum(1 for _ in Recording.open(movie))
    wanted = set(np.linspace(0, total - 1, min(n_frames, total)).round().astype(int).tolist())
    images = [frame.image for number, frame in enumerate(Recording.open(movie)) if number in wanted]
    return hardness(images, None if truth is None else [truth.labels[number] for number in sorted(wanted)])


def _grey(image: ArrayLike) -> NDArray[np.float64]:
    values = np.asarray(image, dtype=np.float64)
    return values if values.ndim == 2 else values @ np.array([0.299, 0.587, 0.114])


def main(arguments: Sequence[str] | None = None) -> int:
    """Print how hard movies are.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process if left out.

    Returns
    -------
    int
        Exit code: 0, or 2 for bad input.
    """
    parser = argparse.ArgumentParser(
        prog="python -m sec_lab.worlds.tabletop.hardness",
        description="Print how hard movies are to segment: noise, gradients, and what felzenszwalb makes of them.",
        epilog="example: python -m sec_lab.worlds.tabletop.hardness datasets/tabletop_actions/*_kitchen bottles.mp4",
    )
    parser.add_argument("movies", type=Path, nargs="+", help="a movie, or the folder of a rendered one with its truth")
    given = parser.parse_args(arguments)
    width = max(5, *(len(path.name) for path in given.movies))
    lines = [f"{'movie':{width}}  noise  gradient  segments  covering"]
    try:
        for path in given.movies:
            hard = hardness_of(path)
            covering = "no truth" if math.isnan(hard.covering) else f"{hard.covering:8.3f}"
            numbers = f"{hard.noise_grey:5.2f}  {hard.gradient_grey_per_px:8.2f}  {hard.n_segments:8.1f}"
            lines.append(f"{path.name:{width}}  {numbers}  {covering}")
    except (ValueError, OSError) as problem:
        parser.exit(2, f"error: {problem}\n")
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
