"""Segments cut out of their movie, so that it can be seen what plays which role (Fig. 2.8)."""

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.files import UnusableFileError, read_whole, write_whole

SIDE_PX = 72
"""Height and width of a portrait."""

Portrait = NDArray[np.uint8]


def portrait(
    segment: int, labels: NDArray[np.integer[Any]], pictures: NDArray[np.uint8], *, side_px: int = SIDE_PX
) -> Portrait:
    """A segment as it looks in one of the frames in which much of it is seen; what is around it is transparent.

    Parameters
    ----------
    segment : int
    labels : (n, height, width) of int
    pictures : (n, height, width, 3) uint8
    side_px : int, optional

    Returns
    -------
    (side_px, side_px, 4) uint8
        RGB and opacity.

    Raises
    ------
    ValueError
        If the segment is in no frame.

    Examples
    --------
    >>> labels = np.array([[[1, 2, 2], [1, 2, 2]]])
    >>> portrait(2, labels, np.full((1, 2, 3, 3), 90, np.uint8), side_px=4)[:, :, 3].tolist()
    [[0, 0, 0, 0], [0, 255, 255, 0], [0, 255, 255, 0], [0, 0, 0, 0]]
    """
    from PIL import Image

    areas = np.array([np.count_nonzero(image == segment) for image in labels])
    seen = np.flatnonzero(areas)
    if not seen.size:
        raise ValueError(f"segment: expected one of the label images, got {segment}")
    # Not where most is seen: that may be the one frame in which it is joined with something else.
    frame = int(seen[np.argmin(np.abs(areas[seen] - np.quantile(areas[seen], 0.75)))])
    mask = labels[frame] == segment
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    cut = np.dstack([pictures[frame][box], np.where(mask[box], 255, 0).astype(np.uint8)])
    image = Image.fromarray(cut)
    image.thumbnail((side_px, side_px), Image.Resampling.BOX)
    whole = np.zeros((side_px, side_px, 4), np.uint8)
    top, left = (side_px - image.height) // 2, (side_px - image.width) // 2
    whole[top : top + image.height, left : left + image.width] = np.asarray(image)
    whole[whole[:, :, 3] == 0] = 0
    return whole


def write_portraits(path: Path, portraits: Iterable[Portrait]) -> None:
    """Write portraits beside each other into one PNG file.

    Raises
    ------
    ValueError
        If there is none.
    UnusableFileError
        If that is not possible.
    """
    from PIL import Image

    listed = list(portraits)
    if not listed:
        raise ValueError("portraits: expected at least one, got none")
    buffer = io.BytesIO()
    Image.fromarray(np.concatenate(listed, axis=1)).save(buffer, format="PNG", optimize=True)
    write_whole(path, buffer.getvalue())


def read_portraits(path: Path, segments: Iterable[int]) -> dict[int, Portrait]:
    """Read what :func:`write_portraits` wrote of these segments, in this order.

    Raises
    ------
    UnusableFileError
        If the file is missing or damaged, or holds another number of portraits.

    Examples
    --------
    >>> read_portraits(Path("no/such/file.png"), [1])
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/file.png: expected portraits of segments, but there is no such file
    """
    from PIL import Image

    content = read_whole(path, expected="portraits of segments")
    try:
        with Image.open(io.BytesIO(content)) as image:
            strip = np.asarray(image.convert("RGBA"))
    except (OSError, ValueError, SyntaxError) as error:
        raise UnusableFileError(f"{path}: expected portraits of segments, but it is damaged ({error})") from error
    listed = list(segments)
    side_px = len(strip)
    if strip.shape[1] != side_px * len(listed):
        found = strip.shape[1] / side_px
        raise UnusableFileError(f"{path}: expected {len(listed)} portraits beside each other, got {found:g}")
    return {segment: strip[:, k * side_px : (k + 1) * side_px] for k, segment in enumerate(listed)}
