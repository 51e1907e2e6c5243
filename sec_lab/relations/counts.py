"""Counters of hints that the scan lines of a label image give, the first half of A.1."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array, as_integers

if TYPE_CHECKING:
    from sec_lab.relations._kernels import Codes, Integers

MAX_SEGMENTS = 4096
"""Most segments of one label image: the two counters of a pair take 16 bytes, so all pairs 256 MiB."""


@dataclass(frozen=True, eq=False)
class ScanLineCounts:
    """Counters of hints that the scan lines of a label image give (A.1).

    Parameters
    ----------
    segments : (n,) array_like of int
        Segment labels, ascending.
    touching : (n, n) array_like of int
        C^t, symmetric: how often i and j follow one right after the other.
    overlapping : (n, n) array_like of int
        C^o, directed: hints that i (row) surrounds j (column), minus the hints that neither surrounds the other;
        entries may be negative.
    lines : (n,) array_like of int
        Number of scan lines (rows and columns) that cross each segment.
    pixels : (n,) array_like of int, optional
        N: pixels of each segment; None if only the sequences of labels are known.
    centres : (n, 2) array_like of float, optional
        Mean (column, row) of the pixels of each segment; None if only the sequences of labels are known.

    Raises
    ------
    ValueError
        If shapes disagree, the segments are not ascending, C^t is not symmetric, a number of lines or pixels is below
        1, or a centre is not finite.

    Examples
    --------
    >>> counts = scan_lines([[1, 1, 1], [1, 4, 1], [1, 1, 1]])
    >>> counts.segments, counts.touching[0, 1], counts.overlapping[0, 1], counts.lines
    (array([1, 4]), np.int64(4), np.int64(2), array([6, 2]))
    """

    segments: NDArray[np.int64]
    touching: NDArray[np.int64]
    overlapping: NDArray[np.int64]
    lines: NDArray[np.int64]
    pixels: NDArray[np.int64] | None = None
    centres: NDArray[np.float64] | None = None

    def __init__(
        self,
        segments: ArrayLike,
        touching: ArrayLike,
        overlapping: ArrayLike,
        lines: ArrayLike,
        pixels: ArrayLike | None = None,
        centres: ArrayLike | None = None,
    ) -> None:
        labels = as_integers(segments, what="segments", ndim=1)
        n = len(labels)
        if (labels[1:] <= labels[:-1]).any():
            raise ValueError(f"segments: expected ascending labels, got {labels.tolist()}")
        arrays: dict[str, NDArray[np.int64] | NDArray[np.float64]] = {
            "segments": labels,
            "touching": as_integers(touching, what="touching", ndim=2),
            "overlapping": as_integers(overlapping, what="overlapping", ndim=2),
            "lines": as_integers(lines, what="lines", ndim=1),
        }
        if pixels is not None:
            arrays["pixels"] = as_integers(pixels, what="pixels", ndim=1)
        if centres is not None:
            arrays["centres"] = as_array(centres, what="centres", ndim=2).astype(np.float64)
        for name, array in arrays.items():
            expected = {"touching": (n, n), "overlapping": (n, n), "centres": (n, 2)}.get(name, (n,))
            if array.shape != expected:
                raise ValueError(f"{name}: expected shape {expected} for {n} segments, got {array.shape}")
            if name in ("lines", "pixels") and n and array.min() < 1:
                raise ValueError(f"{name}: expected at least 1 for every segment, got {array.min()}")
        if centres is not None and not np.isfinite(arrays["centres"]).all():
            raise ValueError("centres: expected finite numbers, got NaN or infinity")
        if (arrays["touching"] != arrays["touching"].T).any():
            raise ValueError("touching: expected a symmetric matrix")
        for name in ("segments", "touching", "overlapping", "lines", "pixels", "centres"):
            if name in arrays:
                arrays[name].setflags(write=False)
            object.__setattr__(self, name, arrays.get(name))

    def __reduce__(self) -> tuple[object, ...]:
        # Arrays come back writable from a pickle; constructing anew protects them.
        return type(self), tuple(getattr(self, field.name) for field in fields(self))


def line_sequences(labels: ArrayLike) -> dict[tuple[int, ...], int]:
    """List L of A.1: on how many scan lines each sequence of segments is observed.

    Parameters
    ----------
    labels : (height, width) array_like of int
        Label image; rows are read from left to right, columns from top to bottom.

    Returns
    -------
    dict
        Number of lines of each sequence of labels, in the order in which they are first seen.

    Raises
    ------
    ValueError
        If the image is not two-dimensional, empty, not of integers, or a label is negative.

    Examples
    --------
    >>> line_sequences([[1, 1, 1], [1, 5, 1], [1, 3, 1]])
    {(1,): 3, (1, 5, 1): 1, (1, 3, 1): 1, (1, 5, 3): 1}
    """
    image = as_label_image(labels)
    sequences: dict[tuple[int, ...], int] = {}
    for line in (*image.tolist(), *image.T.tolist()):
        sequence = tuple(label for label, _ in groupby(line))
        sequences[sequence] = sequences.get(sequence, 0) + 1
    return sequences


def sequence_counts(sequences: Mapping[tuple[int, ...], int]) -> ScanLineCounts:
    """Counters of hints of the list L (A.1); :func:`scan_lines` gives the same of an image, fast.

    Parameters
    ----------
    sequences : mapping of tuple of int to int
        L(S), the number of lines of each sequence S of segment labels.

    Returns
    -------
    ScanLineCounts
        Without ``pixels`` and ``centres``, which the sequences do not tell.

    Raises
    ------
    ValueError
        If a sequence is empty or has a label twice in a row, a label is negative, or a number of lines is below 1.

    Examples
    --------
    Segments 5 and 3 are surrounded by 1, but not one by the other:

    >>> sequence_counts({(1, 5, 3, 1): 40}).overlapping
    array([[  0,  40,  40],
           [  0,   0, -40],
           [  0, -40,   0]])
    """
    for sequence, n_lines in sequences.items():
        path = as_integers(sequence, what="sequence", ndim=1)
        if not path.size or path.min() < 0 or (path[1:] == path[:-1]).any():
            raise ValueError(f"sequence: expected labels, none negative or twice in a row, got {sequence}")
        if as_integers(n_lines, what="number of lines", ndim=0) < 1:
            raise ValueError(f"number of lines: expected at least 1, got {n_lines} for {sequence}")
    segments = sorted({label for sequence in sequences for label in sequence})
    at = {label: index for index, label in enumerate(segments)}
    touching, overlapping = np.zeros((2, len(at), len(at)), dtype=np.int64)
    lines = np.zeros(len(at), dtype=np.int64)
    for sequence, n_lines in sequences.items():
        stack: list[int] = []
        for element in (at[label] for label in sequence):
            if stack:
                touching[stack[-1], element] += n_lines
                touching[element, stack[-1]] += n_lines
            if element not in stack:
                stack.append(element)
                continue
            first = stack.index(element)
            inner = stack[first + 1 :]
            overlapping[element, inner] += n_lines
            overlapping[np.ix_(inner, inner)] -= n_lines * (1 - np.eye(len(inner), dtype=np.int64))
            del stack[first + 1 :]
        lines[sorted({at[label] for label in sequence})] += n_lines
    return ScanLineCounts(segments, touching, overlapping, lines)


def scan_lines(labels: ArrayLike) -> ScanLineCounts:
    """Counters of hints of all rows and columns of a label image (A.1).

    Parameters
    ----------
    labels : (height, width) array_like of int
        Label image; any labels from 0 on (0 is a label like any other). uint8 and uint16 are fastest.

    Returns
    -------
    ScanLineCounts

    Raises
    ------
    ValueError
        If the image is not two-dimensional, empty, not of integers, a label is negative, or there are more than
        ``MAX_SEGMENTS`` segments.

    Notes
    -----
    The counters of the lines add up, so the list L is not built; neighbouring lines that show the same sequence are
    processed together.

    Examples
    --------
    >>> scan_lines([[1, 2, 4, 2, 1]]).overlapping
    array([[0, 1, 0],
           [0, 0, 1],
           [0, 0, 0]])
    """
    codes, width, values = coded_image(as_label_image(labels))
    # Imported when it is used: records of relations are read far more often than images are scanned.
    from sec_lab.relations import _kernels

    words = codes.view(np.uint64)
    starts, first_run, segments = _kernels.find_runs(codes, words, width)
    _check_number(len(segments))
    hints = _kernels.count_hints(codes, words, width, starts, first_run, segments)
    return ScanLineCounts(segments if values is None else values[segments], *hints)


def as_label_image(labels: ArrayLike) -> NDArray[np.integer]:
    """Label image as an array, or one clear error.

    Raises
    ------
    ValueError
        If it is not two-dimensional, empty, not of integers, or a label is negative.

    Examples
    --------
    >>> as_label_image([[1, -1]])
    Traceback (most recent call last):
    ...
    ValueError: label image: expected labels from 0 on, got -1
    """
    image = as_array(labels, what="label image")
    if image.ndim != 2 or not image.size:
        raise ValueError(f"label image: expected shape (height, width), none of them 0, got {image.shape}")
    if image.dtype.kind not in "ui":
        raise ValueError(f"label image: expected labels of an integer type, got {image.dtype}")
    if image.dtype.kind == "i" and image.min() < 0:
        raise ValueError(f"label image: expected labels from 0 on, got {image.min()}")
    return image


def coded_image(image: NDArray[np.integer]) -> tuple["Codes", int, "Integers | None"]:
    """The image as uint8 or uint16, aligned and padded for the kernels; its width; the labels behind the codes."""
    values = None
    largest = int(image.max()) if image.dtype not in (np.uint8, np.uint16) else np.iinfo(image.dtype).max
    if largest >= 1 << 16:
        unique, inverse = np.unique(image, return_inverse=True)
        _check_number(len(unique))
        values, largest = as_integers(unique, what="label image"), len(unique) - 1
        image = inverse.reshape(image.shape)
    code: type[np.uint8 | np.uint16] = np.uint8 if largest < 1 << 8 else np.uint16
    height, width = image.shape
    codes: Codes = np.ascontiguousarray(image, dtype=code)
    padding = -width % (8 // codes.itemsize)
    if padding or not codes.view(np.uint64).flags.aligned:
        codes = np.empty((height, width + padding), dtype=code)
        codes[:, :width] = image
        codes[:, width:] = image[:, -1:]
    # Compiled code for arrays that may be written to is code of its own; a read-only view serves both kinds.
    codes = codes.view()
    codes.setflags(write=False)
    return codes, width, values


def _check_number(n: int) -> None:
    if n > MAX_SEGMENTS:
        raise ValueError(f"label image: expected at most {MAX_SEGMENTS} segments, got {n}")
