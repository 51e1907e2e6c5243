"""Drawn label movies: the artificial *Moving Object* action (Fig. 2.5, 2.6) and the picture of A.1 (Fig. A.1).

``python -m sec_lab.worlds.drawn FOLDER`` writes the labels of both samples (``sample_1.npz``, ``sample_2.npz``) and
what is observed in them (``sample_1.graphml``, ``sample_2.graphml``).
"""

import io
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array
from sec_lab.files import write_whole
from sec_lab.graphml import write
from sec_lab.pipeline import observe_segments

SEED = 2012
"""Seed of the random path in sample action 2."""

_HEIGHT, _WIDTH = 256, 320
_N_FRAMES = 92

_GREEN, _YELLOW, _RED, _BLUE, _BLACK = (70, 150, 70), (240, 210, 60), (205, 45, 45), (60, 90, 200), (20, 20, 20)

Labels = NDArray[np.uint8]
Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class DrawnMovie:
    """A movie with its true segments.

    Parameters
    ----------
    labels : (n, height, width) array_like of uint8
        Segment label of every pixel.
    frames : (n, height, width, 3) array_like of uint8
        RGB pictures.
    names : mapping of int to str
        What each label stands for.

    Raises
    ------
    ValueError
        If an array is not of type uint8 or the shapes disagree.
    """

    labels: Labels
    frames: NDArray[np.uint8]
    names: Mapping[int, str]

    def __init__(self, labels: ArrayLike, frames: ArrayLike, names: Mapping[int, str]) -> None:
        for name, values, ndim in (("labels", labels, 3), ("frames", frames, 4)):
            array = as_array(values, what=name, ndim=ndim).copy()
            if array.dtype != np.uint8:
                raise ValueError(f"{name}: expected type uint8, got {array.dtype}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.frames.shape != (*self.labels.shape, 3):
            raise ValueError(f"frames: expected shape {(*self.labels.shape, 3)}, got {self.frames.shape}")
        object.__setattr__(self, "names", MappingProxyType({int(label): str(name) for label, name in names.items()}))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.labels, self.frames, dict(self.names))


def moving_object(sample: Literal[1, 2], *, rng: np.random.Generator | None = None) -> DrawnMovie:
    """One of the two artificial *Moving Object* actions (§2.4, §2.6), seen from above.

    In sample action 1 (Fig. 2.5) a black round object 4 moves straight from a yellow vessel 2 into a red vessel 3 on a
    green background 1. In sample action 2 (Fig. 2.6) a red rectangular object 3 moves on an arc, and faster, from a
    blue vessel 6 into a yellow vessel 2; a red round object 4 stands still, a black round object 5 moves at random.

    Parameters
    ----------
    sample : {1, 2}
    rng : numpy.random.Generator, optional
        Draws the random path of sample action 2; seeded with ``SEED`` if left out.

    Returns
    -------
    DrawnMovie
        92 frames of 320×256 pixels.

    Raises
    ------
    ValueError
        If the sample is neither 1 nor 2.

    Examples
    --------
    >>> movie = moving_object(1)
    >>> movie.frames.shape, movie.names[4]
    ((92, 256, 320, 3), 'black round object')
    """
    if sample == 1:
        return _first_sample()
    if sample == 2:
        return _second_sample(np.random.default_rng(SEED) if rng is None else rng)
    raise ValueError(f"sample: expected 1 or 2, got {sample!r}")


def scene_of_figure_a1() -> Labels:
    """Label image with the sequences that A.1 counts in its Fig. A.1; what else is in the picture is ours.

    Background 1, vessels 2 and 3, content 4 inside vessel 2, and content 5 that stands in vessel 3 and sticks out.

    Returns
    -------
    (256, 320) uint8
        Sequence (1) is on 225 lines, (1, 2, 1, 3, 1) on 40 and (1, 5, 3, 1) on 40.

    Examples
    --------
    >>> from sec_lab.relations import line_sequences
    >>> sequences = line_sequences(scene_of_figure_a1())
    >>> sequences[(1,)], sequences[1, 2, 1, 3, 1], sequences[1, 5, 3, 1]
    (225, 40, 40)
    """
    scene = _background()
    scene[111:201, 40:140] = 2
    scene[111:201, 180:280] = 3
    _draw_disc(scene, (89.5, 138.5), 22, 4)
    scene[50:141, 210:250] = 5
    return scene


def _first_sample() -> DrawnMovie:
    yellow, red = (64.0, 140.0), (256.0, 140.0)
    vessels = _background()
    _draw_disc(vessels, yellow, 46, 2)
    _draw_disc(vessels, red, 46, 3)
    progress = _eased(_N_FRAMES, first=8, last=82)
    frames = []
    for share in progress:
        frame = vessels.copy()
        _draw_disc(frame, (yellow[0] + share * (red[0] - yellow[0]), 140.0), 16, 4)
        frames.append(frame)
    names = {1: "green background", 2: "yellow vessel", 3: "red vessel", 4: "black round object"}
    return _coloured(frames, names, {1: _GREEN, 2: _YELLOW, 3: _RED, 4: _BLACK})


def _second_sample(rng: np.random.Generator) -> DrawnMovie:
    blue, yellow = (74.0, 178.0), (250.0, 178.0)
    still = _background()
    _draw_disc(still, blue, 50, 6)
    _draw_disc(still, yellow, 50, 2)
    _draw_disc(still, (272.0, 50.0), 18, 4)
    # The random path stays in this box, clear of everything else.
    wander = _random_path(_N_FRAMES, low=(24.0, 24.0), high=(70.0, 70.0), rng=rng)
    progress = _eased(_N_FRAMES, first=24, last=68)
    frames = []
    for share, black in zip(progress, wander, strict=True):
        frame = still.copy()
        _draw_disc(frame, black, 15, 5)
        angle = np.pi * (1 - share)
        column = (blue[0] + yellow[0]) / 2 + (yellow[0] - blue[0]) / 2 * np.cos(angle)
        row = blue[1] - 70.0 * np.sin(angle)
        _draw_box(frame, (column, row), (32, 22), 3)
        frames.append(frame)
    names = {
        1: "green background",
        2: "yellow vessel",
        3: "red rectangular object",
        4: "red round object",
        5: "black round object",
        6: "blue vessel",
    }
    return _coloured(frames, names, {1: _GREEN, 2: _YELLOW, 3: _RED, 4: _RED, 5: _BLACK, 6: _BLUE})


def _background() -> Labels:
    return np.ones((_HEIGHT, _WIDTH), dtype=np.uint8)


def _draw_disc(labels: Labels, centre: Point, radius: float, label: int) -> None:
    rows, columns = np.ogrid[: labels.shape[0], : labels.shape[1]]
    labels[(columns - centre[0]) ** 2 + (rows - centre[1]) ** 2 <= radius**2] = label


def _draw_box(labels: Labels, centre: Point, size: tuple[int, int], label: int) -> None:
    left, top = (round(centre[axis] - size[axis] / 2) for axis in (0, 1))
    labels[top : top + size[1], left : left + size[0]] = label


def _eased(n_frames: int, *, first: int, last: int) -> NDArray[np.float64]:
    """Share of a path that is covered at each frame: at rest until ``first`` and from ``last`` on, smooth between."""
    time = np.clip((np.arange(n_frames) - first) / (last - first), 0, 1)
    return time * time * (3 - 2 * time)


def _random_path(n_frames: int, *, low: Point, high: Point, rng: np.random.Generator) -> list[Point]:
    """Path through random points of a box, a new one every ten frames."""
    stops = np.arange(0, n_frames + 10, 10)
    points = rng.uniform(low, high, size=(len(stops), 2))
    columns, rows = (np.interp(np.arange(n_frames), stops, points[:, axis]) for axis in (0, 1))
    return list(zip(columns.tolist(), rows.tolist(), strict=True))


def _coloured(
    frames: list[Labels], names: Mapping[int, str], colours: Mapping[int, tuple[int, int, int]]
) -> DrawnMovie:
    labels = np.stack(frames)
    palette = np.zeros((256, 3), dtype=np.uint8)
    for label, colour in colours.items():
        palette[label] = colour
    return DrawnMovie(labels, palette[labels], names)


def _write_samples(folder: Path) -> None:
    samples: tuple[Literal[1], Literal[2]] = (1, 2)
    for sample in samples:
        movie = moving_object(sample)
        buffer = io.BytesIO()
        np.savez_compressed(buffer, labels=movie.labels)
        write_whole(folder / f"sample_{sample}.npz", buffer.getvalue())
        seen = observe_segments(movie.labels, relations="edge counting", names=movie.names)
        write(folder / f"sample_{sample}.graphml", seen)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m sec_lab.worlds.drawn FOLDER")
    try:
        _write_samples(Path(sys.argv[1]))
    except ValueError as problem:
        sys.exit(f"error: {problem}")
