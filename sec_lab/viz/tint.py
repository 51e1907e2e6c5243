"""Frames with their segments drawn in: a tint and a border of the segment's colour (Fig. 2.1 e)."""

import colorsys
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array
from sec_lab.viz.style import segment_colours

# Of 256: how much of the colour a segment, the background and a border get.
_TINT, _BACKGROUND_TINT, _BORDER = 92, 20, 215
_PAPER = 236
# A segment that covers this much of the picture is what the others lie on.
_BACKGROUND_SHARE = 0.3


def strong_colour(label: int) -> tuple[int, int, int]:
    """Colour of a segment that stands out on a photograph: the same hue as in all other pictures.

    Returns
    -------
    tuple of int
        Red, green and blue, 0 to 255.

    Examples
    --------
    >>> strong_colour(3)
    (237, 75, 47)
    """
    hue, saturation, _ = colorsys.rgb_to_hsv(*segment_colours([label])[label])
    # Labels of one hue are told apart by how dark they are.
    value = 0.93 - 0.12 * ((label - 1) // 12 % 4)
    red, green, blue = colorsys.hsv_to_rgb(hue, min(0.8, 0.3 + 1.8 * saturation), value)
    return round(255 * red), round(255 * green), round(255 * blue)


class Tint:
    """Draws segments into frames; a label has the same colour in each.

    Parameters
    ----------
    segments : iterable of int
        All labels that are to be seen.
    background : int or None
        Label that gets hardly any colour, and no border; None: the largest segment of the first picture, if it covers
        a good part of it.
    border_px : int, optional
        Width of borders.

    Examples
    --------
    >>> labels = np.array([[1, 1, 1, 2, 2, 2]])
    >>> Tint([1, 2], background=1).over(np.zeros((1, 6, 3), dtype=np.uint8), labels)[0, :, 1].tolist()
    [18, 18, 18, 150, 64, 64]
    """

    def __init__(self, segments: Iterable[int], *, background: int | None, border_px: int = 1) -> None:
        self._border_px = border_px
        self._colours = np.zeros((1 << 16, 3), dtype=np.uint16)
        for label in segments:
            self._colours[label] = strong_colour(label)
        self._tint = np.full(1 << 16, _TINT, dtype=np.uint16)
        self._background: int | None = None
        self._is_begun = False
        if background is not None:
            self._set_background(background)

    def _set_background(self, label: int) -> None:
        self._background, self._is_begun = label, True
        self._tint[label] = _BACKGROUND_TINT

    def over(self, picture: ArrayLike | None, labels: NDArray[np.integer]) -> NDArray[np.uint8]:
        """Picture with segments drawn in, (height, width, 3) uint8.

        Parameters
        ----------
        picture : (height, width, 3) array_like of uint8 or None
            RGB; None: there is no picture, and segments are drawn on grey paper.
        labels : (height, width) ndarray of int
            Label image.
        """
        if not self._is_begun:
            self._is_begun = True
            areas = np.bincount(labels.ravel())
            if areas.max() > _BACKGROUND_SHARE * labels.size:
                self._set_background(int(areas.argmax()))
        share = self._tint[labels]
        share[self._borders(labels)] = _BORDER
        colours = self._colours[labels]
        if picture is None:
            below = np.full_like(colours, _PAPER)
            share += (share < _BORDER) * np.uint16(90)
        else:
            below = as_array(picture, what="picture", ndim=3).astype(np.uint16)
        colours *= share[..., None]
        below *= (256 - share)[..., None]
        below += colours
        below >>= 8
        tinted: NDArray[np.uint8] = below.astype(np.uint8)
        return tinted

    def _borders(self, labels: NDArray[np.integer]) -> NDArray[np.bool_]:
        border = np.zeros(labels.shape, dtype=np.bool_)
        for step in range(1, self._border_px + 1):
            across, down = labels[:, step:] != labels[:, :-step], labels[step:] != labels[:-step]
            border[:, step:] |= across
            border[:, :-step] |= across
            border[step:] |= down
            border[:-step] |= down
        if self._background is not None:
            border &= labels != self._background
        return border


def centres_of(labels: NDArray[np.integer], *, step: int = 1) -> dict[int, tuple[float, float]]:
    """Centre (column, row) of every segment in a label image, from every ``step``-th pixel.

    Examples
    --------
    >>> centres_of(np.array([[5, 5, 2]]))
    {2: (2.0, 0.0), 5: (0.5, 0.0)}
    """
    few = labels[::step, ::step]
    rows, columns = few.shape
    flat = few.ravel()
    count = np.bincount(flat)
    present = np.flatnonzero(count)
    x = np.bincount(flat, weights=np.tile(np.arange(columns, dtype=float), rows))[present] / count[present]
    y = np.bincount(flat, weights=np.repeat(np.arange(rows, dtype=float), columns))[present] / count[present]
    middle = (step - 1) / 2
    return {
        label: (column, row)
        for label, column, row in zip(
            present.tolist(), (step * x + middle).tolist(), (step * y + middle).tolist(), strict=True
        )
    }
