"""Pictures kept without loss in little room: of each frame only what changed since the one before."""

import zlib
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.recording import Frame, Recording

_TENTHS_MM = 10_000


class Film:
    """Colour, range and (if wanted) label pictures of one camera.

    Parameters
    ----------
    size : tuple of int
        (height, width).
    frames_per_second : float
    level : int, optional
        Of compression, 1 (fast) to 9 (small).
    keep : bool, optional
        Keep pictures as they are until :meth:`latest` hands them out.

    Examples
    --------
    >>> film = Film((2, 3), 20.0)
    >>> film.add(np.full((2, 3, 3), 7, dtype=np.uint8), np.ones((2, 3), dtype=np.float32))
    >>> [(frame.time_s, int(frame.image[0, 0, 0]), float(frame.depth_m[0, 0])) for frame in film.recording()]
    [(0.0, 7, 1.0)]
    """

    def __init__(self, size: tuple[int, int], frames_per_second: float, *, level: int = 2, keep: bool = False) -> None:
        self.size = size
        self.frames_per_second = frames_per_second
        self.level, self.keep = level, keep
        self._kept: list[Frame] = []
        self._kept_from = 0
        self.packed: list[bytes] = []
        self.packed_labels: list[bytes] = []
        self._last = np.zeros(0, dtype=np.uint8)
        self._last_labels = np.zeros(0, dtype=np.uint8)

    def __len__(self) -> int:
        return len(self.packed)

    def add(
        self, image: NDArray[np.uint8], depth_m: NDArray[np.float32], labels: NDArray[np.uint8] | None = None
    ) -> None:
        """Append a frame.

        Parameters
        ----------
        image : (height, width, 3) uint8
        depth_m : (height, width) float32
            Kept in tenths of millimetres.
        labels : (height, width) uint8, optional
        """
        tenths = np.round(depth_m * _TENTHS_MM).astype("<u2")
        flat = np.concatenate([image.ravel(), np.ascontiguousarray(tenths).view(np.uint8).ravel()])
        self.packed.append(_packed(flat, self._last, level=self.level))
        self._last = flat
        if self.keep:
            number = len(self.packed) - 1
            depth = tenths.astype(np.float32) / np.float32(_TENTHS_MM)
            self._kept.append(Frame(number, image, number / self.frames_per_second, depth_m=depth))
        if labels is not None:
            flat = labels.ravel()
            self.packed_labels.append(_packed(flat, self._last_labels, level=self.level))
            self._last_labels = flat

    def latest(self, first: int) -> tuple[Frame, ...]:
        """Frames from a number on; those before it are not to be asked for again.

        Parameters
        ----------
        first : int

        Raises
        ------
        ValueError
            If they were asked for before.
        """
        if first < self._kept_from:
            raise ValueError(f"first: expected at least {self._kept_from}, got {first}")
        frames = tuple(self._kept[first - self._kept_from :])
        self._kept, self._kept_from = [], len(self.packed)
        return frames

    def recording(self) -> Recording:
        """The frames so far, with range and times."""
        return Recording(
            partial(_frames, tuple(self.packed), self.size, self.frames_per_second),
            self.size,
            len(self.packed),
            frames_per_second=self.frames_per_second,
            has_depth=True,
        )

    def labels(self) -> NDArray[np.uint8] | None:
        """(n, height, width) uint8 if there are any."""
        if not self.packed_labels:
            return None
        return np.stack([flat.reshape(self.size) for flat in _unpacked(self.packed_labels)])


def film_arrays(film: Film) -> dict[str, NDArray[Any]]:
    """All of a film, as it goes into a file of numpy; :func:`film_of` reads it."""
    packed, lengths = _joined(film.packed)
    labels, label_lengths = _joined(film.packed_labels)
    return {
        "film": packed,
        "film_lengths": lengths,
        "film_labels": labels,
        "film_label_lengths": label_lengths,
        "size": np.array(film.size),
        "frames_per_second": np.array(film.frames_per_second),
    }


def film_of(path: Path) -> Film:
    """The film in a file of numpy (``.npz``).

    Parameters
    ----------
    path : Path
    """
    with np.load(path, allow_pickle=False) as stored:
        height, width = (int(side) for side in stored["size"])
        film = Film((height, width), float(stored["frames_per_second"]))
        film.packed = _split(stored["film"], stored["film_lengths"])
        film.packed_labels = _split(stored["film_labels"], stored["film_label_lengths"])
    return film


def _frames(packed: tuple[bytes, ...], size: tuple[int, int], frames_per_second: float) -> Iterator[Frame]:
    height, width = size
    n = height * width
    for index, flat in enumerate(_unpacked(packed)):
        depth = flat[3 * n :].view("<u2").reshape(size).astype(np.float32) / np.float32(_TENTHS_MM)
        yield Frame(index, flat[: 3 * n].reshape(height, width, 3), index / frames_per_second, depth_m=depth)


def _packed(flat: NDArray[np.uint8], last: NDArray[np.uint8], *, level: int) -> bytes:
    return zlib.compress((flat - last if last.size else flat).tobytes(), level)


def _unpacked(packed: tuple[bytes, ...] | list[bytes]) -> Iterator[NDArray[np.uint8]]:
    last = None
    for part in packed:
        change = np.frombuffer(zlib.decompress(part), dtype=np.uint8)
        last = change.copy() if last is None else last + change
        yield last


def _joined(parts: list[bytes]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    return np.frombuffer(b"".join(parts), dtype=np.uint8), np.array([len(part) for part in parts], dtype=np.int64)


def _split(joined: NDArray[np.uint8], lengths: NDArray[np.int64]) -> list[bytes]:
    ends = np.cumsum(lengths)
    return [joined[end - length : end].tobytes() for end, length in zip(ends, lengths, strict=True)]
