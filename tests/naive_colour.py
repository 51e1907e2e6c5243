"""Slow, obvious colour segmentation: pixel by pixel, in whole numbers as OpenCV's 8-bit HSV is defined."""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.colour import NamedColour


def hsv(red: int, green: int, blue: int) -> tuple[Fraction, Fraction, Fraction]:
    """Hue in degrees, saturation and value in percent, from tables of twelve bits after the point."""
    value = max(red, green, blue)
    spread = value - min(red, green, blue)
    saturation = (spread * round(Fraction(255 << 12, value)) + (1 << 11)) >> 12 if value else 0
    if value == red:
        hue = green - blue
    elif value == green:
        hue = blue - red + 2 * spread
    else:
        hue = red - green + 4 * spread
    half_degrees = (hue * round(Fraction(180 << 12, 6 * spread)) + (1 << 11)) >> 12 if spread else 0
    return Fraction(2 * (half_degrees % 180)), Fraction(100 * saturation, 255), Fraction(100 * value, 255)


def belongs(pixel: Sequence[int], colour: NamedColour) -> bool:
    hue, saturation, value = hsv(*pixel)
    low, high = colour.hue_degrees
    if not (low <= hue < high if low < high else hue >= low or hue < high):
        return False
    return all(
        low <= share < high or share == high == 100
        for share, (low, high) in ((saturation, colour.saturation_percent), (value, colour.value_percent))
    )


def colour_segments(
    image: NDArray[np.uint8], colours: Sequence[NamedColour], *, minimum_px: int, components: str
) -> NDArray[np.uint16]:
    height, width = image.shape[:2]
    labels = np.zeros((height, width), np.uint16)
    for label, colour in enumerate(colours, start=1):
        left = {
            (row, column)
            for row in range(height)
            for column in range(width)
            if belongs(image[row, column].tolist(), colour)
        }
        parts = []
        while left:
            reached = [min(left)]
            left.remove(reached[0])
            for row, column in reached:
                near = {(row + down, column + right) for down in (-1, 0, 1) for right in (-1, 0, 1)} & left
                left -= near
                reached.extend(sorted(near))
            parts.append(reached)
        if components == "largest" and parts:
            parts = [min(parts, key=lambda part: (-len(part), min(part)))]
        for part in parts:
            if len(part) >= minimum_px:
                labels[tuple(np.transpose(part))] = label
    return labels
