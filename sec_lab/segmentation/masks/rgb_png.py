"""Label images as RGB pictures, one a frame: the id of a pixel is R + 256 G + 65536 B.

So in COCO's panoptic format, and in Cutie when it writes long ids. Black is the background there. Ids up to
65,535 are kept as labels; larger ones get the labels 65535, 65534, … in the order in which they appear (those of one
frame in the order of their ids), with the id as their name.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.masks.label_png import numbered_pngs, read_mask
from sec_lab.segmentation.masks.options import MaskOptions
from sec_lab.segmentation.record import MAX_LABEL, FoundNames, Labels, Names, Segmentation

_ID_BITS = 24


def open_rgb_pngs(path: Path, options: MaskOptions) -> Segmentation:
    """Label images in a folder of RGB pictures, or in a single one.

    Parameters
    ----------
    path : path-like
    options : MaskOptions
        Background and names are ids, which may have 24 bits.

    Returns
    -------
    Segmentation

    Raises
    ------
    UnusableFileError
        If there is no such folder, it has no PNG, or the first is of another kind.
    ValueError
        If masks are missing in the middle or of another size than asked for; while label images are read, if there are
        more ids than labels.

    Examples
    --------
    >>> open_rgb_pngs(Path("no/such/folder"), MaskOptions())
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder: expected a folder of masks, but there is no such folder
    """
    files, frames, size = numbered_pngs(path, options, "RGB PNG")
    for number in (*(options.names or {}), options.background or 0):
        if not 0 <= number < 1 << _ID_BITS:
            raise ValueError(f"ids: expected numbers of {_ID_BITS} bits, got {number}")
    masks = _RgbMasks(files, frames.tolist(), size, options.background)
    names = FoundNames(partial(_names, masks, options.names, options.background))
    background = None if options.background is None else masks.new_labels()[options.background]
    return Segmentation(masks.read, size, frames, background, names)


class _RgbMasks:
    """Label images, and the label of every id once all were read."""

    def __init__(
        self, files: Sequence[Path], frames: Sequence[int], size: tuple[int, int], background: int | None
    ) -> None:
        self._files, self._frames, self._size, self._background = files, frames, size, background
        self.labels: dict[int, int] | None = None

    def new_labels(self) -> dict[int, int]:
        """Labels before the first frame is read: only that of the background is known."""
        labels: dict[int, int] = {}
        if self._background is not None:
            _add_labels(labels, [self._background])
        return labels

    def read(self) -> Iterator[tuple[int, Labels]]:
        labels = self.new_labels()
        table = np.zeros(1 << _ID_BITS, dtype=np.uint16)
        for number, file in zip(self._frames, self._files, strict=True):
            ids = _ids_of_colours(read_mask(file, "RGB PNG", self._size))
            try:
                _add_labels(labels, _different(ids))
            except ValueError as error:
                raise ValueError(f"frame {number}: {error}") from error
            table[list(labels)] = list(labels.values())
            yield number, table[ids]
        self.labels = labels


def _names(masks: _RgbMasks, given: Names | None, background: int | None) -> Names:
    if masks.labels is None:
        for _ in masks.read():
            pass
    labels = masks.labels or {}
    names: dict[int, str | None] = {label: str(number) for number, label in labels.items() if label != number}
    if background is not None:
        names[labels[background]] = "background"
    return {**names, **{labels[number]: name for number, name in (given or {}).items() if number in labels}}


def _ids_of_colours(colours: NDArray[Any]) -> NDArray[np.uint32]:
    if colours.shape[2] == 4 and colours[..., 3].min() < 255:
        raise ValueError("mask: expected opaque colours, got transparent ones")
    red, green, blue = (colours[..., channel].astype(np.uint32) for channel in range(3))
    return (red | green << 8 | blue << 16).astype(np.uint32, copy=False)


def _different(ids: NDArray[np.uint32]) -> list[int]:
    """Ids of an image, ascending; where rows do not change nothing is looked at twice."""
    line = ids.ravel()
    changes = np.flatnonzero(line[1:] != line[:-1]) + 1
    found: list[int] = np.unique(line[np.r_[0, changes]]).tolist()
    return found


def _add_labels(labels: dict[int, int], ids: Sequence[int]) -> None:
    new = [number for number in ids if number not in labels]
    if not new:
        return
    taken = set(labels.values())
    free = MAX_LABEL
    for number in new:
        if len(labels) > MAX_LABEL:
            raise ValueError(f"ids: expected at most {MAX_LABEL + 1} different ids, got more")
        while number > MAX_LABEL and free in taken:
            free -= 1
        label = free if number > MAX_LABEL else number
        if label in taken:
            raise ValueError(f"ids: {number} is the label that a larger id was given; write the masks with smaller ids")
        labels[number] = label
        taken.add(label)
