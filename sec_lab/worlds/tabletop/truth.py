"""What is true in a movie: labels, depth and contacts, in one file beside it.

``truth.npz`` holds ``labels`` and ``depth_mm`` as differences from frame to frame (in the arithmetic of their type, so
nothing is lost): what rests costs nothing.
"""

import io
import json
import lzma
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import Relation, Relations
from sec_lab.files import UnusableFileError, read_whole, write_whole

_DAMAGE = (ValueError, KeyError, OSError, EOFError, AttributeError, NotImplementedError, MemoryError)
_ARRAYS = ("labels", "depth_mm", "pairs", "touching")


@dataclass(frozen=True, eq=False)
class Truth:
    """What is true in a movie, seen from its left eye.

    Parameters
    ----------
    labels : (n, height, width) uint8
        Segment of every pixel; 0 where there is nothing.
    depth_mm : (n, height, width) uint16
        Millimetres along the optical axis; 0 where there is nothing.
    pairs : (n_pairs, 2) int64
        Labels of two segments, the lower first.
    touching : (n, n_pairs) bool
        Whether their surfaces touch, by geometry.
    names : mapping of int to str
        What each label stands for.

    Raises
    ------
    ValueError
        If the shapes disagree.
    """

    labels: NDArray[np.uint8]
    depth_mm: NDArray[np.uint16]
    pairs: NDArray[np.int64]
    touching: NDArray[np.bool_]
    names: Mapping[int, str]

    def __post_init__(self) -> None:
        arrays: dict[str, NDArray[Any]] = {
            "labels": np.array(self.labels, dtype=np.uint8),
            "depth_mm": np.array(self.depth_mm, dtype=np.uint16),
            "pairs": np.array(self.pairs, dtype=np.int64),
            "touching": np.array(self.touching, dtype=bool),
        }
        labels = arrays["labels"]
        if labels.ndim != 3:
            raise ValueError(f"labels: expected shape (n, height, width), got {labels.shape}")
        n_pairs = len(arrays["pairs"])
        for name, shape in (("depth_mm", labels.shape), ("pairs", (n_pairs, 2)), ("touching", (len(labels), n_pairs))):
            if arrays[name].shape != shape:
                raise ValueError(f"{name}: expected shape {shape}, got {arrays[name].shape}")
        for name, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "names", MappingProxyType({int(k): str(v) for k, v in self.names.items()}))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.labels, self.depth_mm, self.pairs, self.touching, dict(self.names))


def contact_relations(truth: Truth) -> Relations:
    """Relation of every pair at every frame, by contact in space.

    Segments without a pixel in a frame are absent there. Contact in space says nothing of surroundings in the picture:
    overlapping does not occur, it is touching here.

    Returns
    -------
    (n, n_pairs) uint8

    Examples
    --------
    >>> seen = np.array([[[1, 2]], [[1, 1]]])
    >>> truth = Truth(seen, np.ones_like(seen), [(1, 2)], [[True], [True]], {1: "table", 2: "hand"})
    >>> contact_relations(truth)
    array([[2],
           [9]], dtype=uint8)
    """
    visible = np.stack([np.bincount(frame.ravel(), minlength=256) > 0 for frame in truth.labels])
    there = visible[:, truth.pairs[:, 0]] & visible[:, truth.pairs[:, 1]]
    codes = np.where(truth.touching, Relation.TOUCHING, Relation.NON_TOUCHING)
    return np.where(there, codes, Relation.ABSENT).astype(np.uint8)


def write_truth(folder: Path, truth: Truth) -> None:
    """Write ``truth.npz`` and ``names.json`` into a folder that exists.

    Raises
    ------
    UnusableFileError
        If that is not possible.
    """
    arrays: dict[str, ArrayLike] = {
        "labels": _differences(truth.labels),
        "depth_mm": _differences(truth.depth_mm),
        "pairs": truth.pairs.astype(np.uint8),
        "touching": truth.touching,
    }
    buffer = io.BytesIO()
    # A fixed date: the same truth gives the same bytes.
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_LZMA) as archive:
        for name, array in arrays.items():
            content = io.BytesIO()
            np.save(content, np.asarray(array))
            entry = zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_LZMA
            archive.writestr(entry, content.getvalue())
    write_whole(folder / "truth.npz", buffer.getvalue())
    write_whole(folder / "names.json", json.dumps(dict(truth.names), indent=1) + "\n")


def read_truth(folder: Path) -> Truth:
    """Read what :func:`write_truth` has written.

    Raises
    ------
    UnusableFileError
        If the files are missing or damaged.

    Examples
    --------
    >>> read_truth(Path("no/such/folder"))
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder/truth.npz: expected the truth of a movie, but there is no such file
    """
    path = folder / "truth.npz"
    content = read_whole(path, expected="the truth of a movie")
    words = read_whole(folder / "names.json", expected="the names of segments")
    try:
        with np.load(io.BytesIO(content)) as archive:
            stored = {name: archive[name] for name in _ARRAYS}
        names = {int(label): name for label, name in json.loads(words).items()}
        return Truth(
            np.cumsum(stored["labels"], axis=0, dtype=np.uint8),
            np.cumsum(stored["depth_mm"], axis=0, dtype=np.uint16),
            stored["pairs"],
            stored["touching"],
            names,
        )
    except (*_DAMAGE, lzma.LZMAError, zipfile.BadZipFile) as error:
        raise UnusableFileError(f"{path}: expected the truth of a movie, but it is damaged ({error})") from error


def _differences(frames: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.uint8] | NDArray[np.uint16]:
    first = np.zeros_like(frames[:1])
    return np.diff(frames, axis=0, prepend=first)
