"""Run-length encoded masks of COCO, which YouTube-VIS, SA-V and MOTS use as well.

A mask is read column by column from top to bottom, beginning with the number of pixels outside (which may be 0), then
inside, and so on in turns. Uncompressed, the runs are a list of numbers. Compressed, they are a text: from the fourth
on each run is replaced by its difference to the run two before; each number becomes groups of five bits, least
significant first, two's complement; each group, with the sixth bit set if another one follows, becomes the character
of code 48 + group. (``maskApi`` of the COCO API.)
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_integers
from sec_lab.segmentation.masks.objects import Mask

_MAX_GROUPS = 7
"""Groups of five bits of one number: 35 bits are more than any picture needs."""


def decode(encoded: Any, size: tuple[int, int]) -> Mask:
    """Mask of a run-length encoding as it stands in JSON.

    Parameters
    ----------
    encoded : mapping
        ``{"size": [height, width], "counts": text or list of numbers}``.
    size : tuple of int
        (height, width) that is expected. No more memory is used, whatever the encoding says.

    Returns
    -------
    (height, width) ndarray of bool

    Raises
    ------
    ValueError
        If the encoding is malformed, of another size, or its runs do not add up to the picture.

    Examples
    --------
    >>> decode({"size": [2, 3], "counts": [1, 2, 3]}, (2, 3)).astype(int)
    array([[0, 1, 0],
           [1, 0, 0]])
    """
    if not isinstance(encoded, Mapping) or "counts" not in encoded or "size" not in encoded:
        raise ValueError('expected a run-length encoding with "size" and "counts"')
    told = encoded["size"]
    if not isinstance(told, list) or len(told) != 2 or [*size] != told:
        raise ValueError(f"expected a mask of {size[0]}×{size[1]}, got size {_short(told)}")
    return decode_runs(encoded["counts"], size)


def decode_runs(counts: str | ArrayLike, size: tuple[int, int]) -> Mask:
    """Mask of its runs, compressed or not.

    Parameters
    ----------
    counts : str or array_like of int
    size : tuple of int
        (height, width).

    Returns
    -------
    (height, width) ndarray of bool

    Raises
    ------
    ValueError
        If the runs are malformed or do not add up to the picture.

    Examples
    --------
    >>> decode_runs("123", (2, 3)).astype(int)
    array([[0, 1, 0],
           [1, 0, 0]])
    """
    runs = runs_of_text(counts) if isinstance(counts, str) else as_integers(counts, what="runs", ndim=1)
    height, width = size
    if runs.size and runs.min() < 0:
        raise ValueError(f"runs: expected lengths from 0 on, got {runs.min()}")
    n_pixels = height * width
    # Looked at one by one first, as the sum of huge lengths may go round.
    if runs.size and runs.max() > n_pixels:
        raise ValueError(f"runs: expected {n_pixels} pixels in all, got a run of {runs.max()}")
    if runs.sum() != n_pixels:
        raise ValueError(f"runs: expected {n_pixels} pixels in all, got {runs.sum()}")
    inside = np.arange(runs.size) % 2 == 1
    return np.repeat(inside, runs).reshape(width, height).T


def runs_of_text(text: str) -> NDArray[np.int64]:
    """Lengths of runs of their compressed form.

    Parameters
    ----------
    text : str

    Returns
    -------
    (n,) int64 ndarray
        May be negative in malformed texts.

    Raises
    ------
    ValueError
        If a character does not occur in such texts, the text ends within a number, or a number has too many digits.

    Examples
    --------
    >>> runs_of_text("061M")
    array([0, 6, 1, 3])
    """
    codes = np.frombuffer(text.encode("utf-8", errors="surrogatepass"), dtype=np.uint8).astype(np.int64) - 48
    if not codes.size:
        return codes
    if codes.min() < 0 or codes.max() > 63:
        raise ValueError("runs: expected characters from '0' to 'o'")
    is_last = codes & 0x20 == 0
    if not is_last[-1]:
        raise ValueError("runs: expected a whole number at the end, got a part of one")
    ends = np.flatnonzero(is_last)
    starts = np.r_[0, ends[:-1] + 1]
    n_groups = ends - starts + 1
    if n_groups.max() > _MAX_GROUPS:
        raise ValueError(f"runs: expected numbers of at most {_MAX_GROUPS} characters, got one of {n_groups.max()}")
    place = np.arange(codes.size) - np.repeat(starts, n_groups)
    numbers = np.add.reduceat((codes & 0x1F) << (5 * place), starts)
    numbers -= (codes[ends] >> 4 & 1) << (5 * n_groups)
    # From the fourth number on, each is a difference to the one two before: two sums that take turns.
    numbers[1::2] = np.cumsum(numbers[1::2])
    numbers[2::2] = np.cumsum(numbers[2::2])
    return numbers


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) < 60 else f"{text[:57]}…"
