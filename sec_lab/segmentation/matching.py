"""OpenCV's semi-global matcher, and the range of disparities that it has to search."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sec_lab.segmentation.stereo import Disparity, checked_pair, grey

Mode = Literal["5way", "8way", "3way"]


@dataclass(frozen=True)
class MatcherOptions:
    """Settings of the semi-global matcher.

    The defaults were chosen on rendered tabletop movies of 320×256: a small penalty against the change of disparity by
    one pixel, as tables and arms are slanted, and a large one against jumps, as cloth and skin have little texture.

    Parameters
    ----------
    block_px : int
        Side of the matched block, odd.
    step_penalty, jump_penalty : int
        Penalties P₁ and P₂ of a change of disparity by one and by more pixels between neighbours, for every pixel of
        the block.
    gradient_cap : int
        Horizontal gradients are clipped to it before they are compared.
    uniqueness_percent : int
        By how much the best match must beat the second best.
    speckle_px : int
        Patches of fewer pixels that differ from all around are removed.
    left_right_px : int
        By how much the disparities of the left and of the right picture, read off the same matching costs, may differ.
    mode : {"3way", "5way", "8way"}
        Number of directions from which costs are summed up. Every one gives the same for any number of threads.

    Raises
    ------
    ValueError
        If a number is not allowed or the mode is unknown.

    Examples
    --------
    >>> MatcherOptions(block_px=4)
    Traceback (most recent call last):
    ...
    ValueError: block_px: expected an odd number from 1 to 11, got 4
    """

    block_px: int = 7
    step_penalty: int = 1
    jump_penalty: int = 24
    gradient_cap: int = 63
    uniqueness_percent: int = 5
    speckle_px: int = 150
    left_right_px: int = 1
    mode: Mode = "3way"

    def __post_init__(self) -> None:
        if self.block_px not in range(1, 12, 2):
            raise ValueError(f"block_px: expected an odd number from 1 to 11, got {self.block_px}")
        if not 0 < self.step_penalty < self.jump_penalty:
            raise ValueError(
                f"step_penalty: expected one above 0 and below jump_penalty, got {self.step_penalty} and "
                f"{self.jump_penalty}"
            )
        if not 1 <= self.gradient_cap <= 127:
            raise ValueError(f"gradient_cap: expected 1 to 127, got {self.gradient_cap}")
        if not 0 <= self.uniqueness_percent < 100:
            raise ValueError(f"uniqueness_percent: expected 0 to 99, got {self.uniqueness_percent}")
        if self.speckle_px < 0 or self.left_right_px < 0:
            raise ValueError(
                f"speckle_px, left_right_px: expected 0 or more, got {self.speckle_px} and {self.left_right_px}"
            )
        if self.mode not in get_args(Mode):
            raise ValueError(f"mode: expected one of {get_args(Mode)}, got {self.mode!r}")


def matched(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    *,
    range_px: tuple[int, int],
    options: MatcherOptions,
) -> Disparity:
    """Disparity by semi-global matching, checked from left to right, nothing filled.

    Parameters
    ----------
    left, right : (height, width) or (height, width, 3) ndarray of uint8
        Rectified pictures (grey or RGB) of one size.
    range_px : (least, most) of int
    options : MatcherOptions

    Returns
    -------
    (height, width) ndarray of float32
        Steps of 1/16 pixel; NaN where there is no match, or it would lie outside of the right picture.
    """
    import cv2

    least, most = range_px
    n = -(-(most - least + 1) // 16) * 16
    height, width = left.shape[:2]
    # OpenCV leaves as many columns empty on the left as the largest disparity. So the right picture is moved by the
    # least one, and both get that margin, which is the cheapest: columns that the right picture cannot show are cut.
    one = cv2.copyMakeBorder(grey(left)[:, least:], 0, 0, n, 0, cv2.BORDER_REPLICATE)
    other = cv2.copyMakeBorder(grey(right)[:, : width - least], 0, 0, n, 0, cv2.BORDER_REPLICATE)
    area = options.block_px**2
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=n,
        blockSize=options.block_px,
        P1=options.step_penalty * area,
        P2=options.jump_penalty * area,
        disp12MaxDiff=options.left_right_px,
        preFilterCap=options.gradient_cap,
        uniquenessRatio=options.uniqueness_percent,
        speckleWindowSize=options.speckle_px,
        speckleRange=1,
        mode={
            "5way": cv2.STEREO_SGBM_MODE_SGBM,
            "8way": cv2.STEREO_SGBM_MODE_HH,
            "3way": cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        }[options.mode],
    )
    sixteenths = matcher.compute(one, other)[:, n:]
    found = np.full((height, width), np.nan, dtype=np.float32)
    inside = found[:, least:]
    np.multiply(sixteenths, np.float32(1 / 16), out=inside)
    inside += least
    columns = np.arange(least, width, dtype=np.float32)
    inside[(sixteenths < 0) | (inside > columns + 0.5)] = np.nan
    return found


def estimate_range(
    left: NDArray[np.uint8], right: NDArray[np.uint8], *, most_columns: int = 160, margin: float = 0.1
) -> tuple[int, int]:
    """Range of the disparities of a rectified pair, from the pair itself.

    Both pictures are shrunk to at most ``most_columns`` columns and matched over the whole range from 0 to half of the
    width. The range holds the 0.5th to the 99.5th percentile of what is found in the columns that are visible in both,
    and a margin on both sides. What comes nearer later on needs more room:
    :class:`~sec_lab.segmentation.disparity_stream.DisparityEstimator` looks at every frame.

    Parameters
    ----------
    left, right : (height, width) or (height, width, 3) ndarray of uint8
        Rectified pictures (grey or RGB) of one size.
    most_columns : int, optional
    margin : float, optional
        Share of the disparity by which the range is widened on either side.

    Returns
    -------
    (least, most) : tuple of int
        In pixels; (0, half of the width) if nothing could be matched.

    Raises
    ------
    ValueError
        If the pictures differ in size, or are of another type or smaller than 32 pixels.

    Examples
    --------
    >>> scene = np.random.default_rng(1).integers(0, 255, (64, 300), dtype=np.uint8)
    >>> least, most = estimate_range(scene[:, :256], scene[:, 30:286])
    >>> least <= 30 <= most
    True
    """
    import cv2

    checked_pair(left, right)
    width = left.shape[1]
    factor = max(1, math.ceil(width / most_columns))
    small = [
        np.asarray(cv2.resize(grey(side), None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA), np.uint8)
        for side in (left, right)
    ]
    widest = width // 2
    # Sparing with matches: one wrong patch would widen the range.
    options = MatcherOptions(
        block_px=5,
        step_penalty=2,
        jump_penalty=32,
        uniqueness_percent=15,
        speckle_px=small[0].shape[1] ** 2 // 256,
        mode="8way",
    )
    found = matched(small[0], small[1], range_px=(0, max(1, widest // factor)), options=options)
    if np.isfinite(found).sum() < 0.02 * found.size:
        return 0, widest
    # Columns that the right picture does not show are matched with anything.
    shown = found[:, round(float(np.nanpercentile(found, 99))) :]
    shown = shown[np.isfinite(shown)]
    if not len(shown):
        return 0, widest
    low, high = factor * np.percentile(shown, (0.5, 99.5))
    room = 2 * factor
    return max(0, math.floor(low * (1 - margin) - room)), min(widest, math.ceil(high * (1 + margin) + room))
