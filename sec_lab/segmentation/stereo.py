"""What all ways to disparity share: checks of the pair of pictures and of the range that is searched."""

import math

import numpy as np
from numpy.typing import NDArray

Disparity = NDArray[np.float32]

LEAST_SIDE_PX = 32


def checked_pair(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> None:
    """Raise ValueError unless left and right are pictures of 8 bits, of one size, that can be matched."""
    for name, picture in (("left", left), ("right", right)):
        if not isinstance(picture, np.ndarray) or picture.dtype != np.uint8:
            told = picture.dtype if isinstance(picture, np.ndarray) else type(picture).__name__
            raise ValueError(f"{name}: expected a picture of type uint8, got {told}")
        if picture.ndim not in (2, 3) or (picture.ndim == 3 and picture.shape[2] != 3):
            raise ValueError(f"{name}: expected shape (height, width) or (height, width, 3), got {picture.shape}")
        if min(picture.shape[:2]) < LEAST_SIDE_PX:
            raise ValueError(f"{name}: expected at least {LEAST_SIDE_PX} rows and columns, got {picture.shape}")
    if left.shape[:2] != right.shape[:2]:
        raise ValueError(f"right: expected the size of left, {left.shape[:2]}, got {right.shape[:2]}")


def as_range(range_px: tuple[float, float], width: int) -> tuple[int, int]:
    """Range in whole pixels; ValueError unless 0 ≤ least < most < width."""
    least, most = range_px
    if not (math.isfinite(least) and math.isfinite(most) and 0 <= least < most < width):
        raise ValueError(f"range_px: expected 0 <= least < most < {width}, got {range_px}")
    return math.floor(least), math.ceil(most)


def grey(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Luminance of a picture."""
    import cv2

    if picture.ndim == 2:
        return np.ascontiguousarray(picture)
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
