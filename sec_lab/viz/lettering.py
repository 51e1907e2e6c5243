"""Text in pictures that are drawn by the thousand, where matplotlib would be too slow."""

from bisect import bisect_right
from functools import cache

import numpy as np
from matplotlib.font_manager import FontProperties, findfont
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from sec_lab.viz.style import INK, PAPER


@cache
def font(size_px: float, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """The font of all figures, for Pillow."""
    properties = FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")
    return ImageFont.truetype(findfont(properties), size_px)


def fitted(text: str, width_px: float, *, size_px: float, bold: bool = False) -> str:
    """Text that is not wider than asked, shortened by an ellipsis if need be.

    Examples
    --------
    >>> fitted("green box, robot arm", 100, size_px=13)
    'green box, ro…'
    """
    letters = font(size_px, bold=bold)
    if letters.getlength(text) <= width_px:
        return text
    n = bisect_right(range(1, len(text)), width_px, key=lambda n: letters.getlength(text[:n] + "…"))
    return text[:n] + "…"


def badge(text: str, colour: tuple[int, int, int], *, size_px: float) -> NDArray[np.uint8]:
    """Small label on paper with a border of a colour, shape (height, width, 4): red, green, blue and how opaque.

    Examples
    --------
    >>> badge("hand", (255, 0, 0), size_px=13).shape[2]
    4
    """
    letters = font(size_px, bold=True)
    # Drawn larger and shrunk, so that the round corners are smooth.
    width, height = round(letters.getlength(text) + 0.9 * size_px), round(1.5 * size_px)
    image = Image.new("RGBA", (2 * width, 2 * height))
    box = (1, 1, 2 * width - 2, 2 * height - 2)
    ImageDraw.Draw(image).rounded_rectangle(box, radius=0.6 * size_px, fill=PAPER, outline=colour, width=4)
    image = image.resize((width, height), Image.Resampling.BOX)
    ImageDraw.Draw(image).text((width / 2, height / 2), text, font=letters, fill=INK, anchor="mm")
    return np.asarray(image)


def paste(picture: NDArray[np.uint8], patch: NDArray[np.uint8], column: float, row: float) -> None:
    """Put a patch with opacity into a picture, its centre at a place; what reaches over the rim is cut off.

    Examples
    --------
    >>> picture = np.zeros((2, 2, 3), dtype=np.uint8)
    >>> paste(picture, np.full((1, 1, 4), 255, dtype=np.uint8), 1, 0)
    >>> picture[..., 0].tolist()
    [[0, 255], [0, 0]]
    """
    height, width = patch.shape[:2]
    top, left = round(row - (height - 1) / 2), round(column - (width - 1) / 2)
    rows = slice(max(0, top), min(picture.shape[0], top + height))
    columns = slice(max(0, left), min(picture.shape[1], left + width))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return
    part = patch[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left].astype(np.uint16)
    below = picture[rows, columns]
    share = part[..., 3:]
    below[:] = (below * (255 - share) + part[..., :3] * share + 127) // 255
