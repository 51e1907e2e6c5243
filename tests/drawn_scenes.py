"""Small drawn pictures of blocks on a table, and of a hand that comes in from the right with its arm."""

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

HEIGHT, WIDTH = 96, 120
TABLE, SKIN = (172, 150, 122), (206, 120, 98)
RED, BLUE, GREEN = (190, 40, 36), (40, 70, 180), (50, 150, 60)

Place = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Block:
    """A box with its middle at (row, column)."""

    place: Place
    colour: tuple[int, int, int]
    rows: int = 18
    columns: int = 18


@dataclasses.dataclass(frozen=True)
class Moment:
    """What there is in one frame, from the back to the front; the hand by the place of its finger tips."""

    blocks: Sequence[Block] = ()
    hand: Place | None = None
    shadow: Place | None = None
    gain: float = 1.0


TABLE_NUMBER, HAND_NUMBER = 0, 100


def drawn(moment: Moment, noise: NDArray[np.float64]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Picture and, for every pixel, what is seen: 0 the table, 1, 2, … the blocks, 100 the hand."""
    fall_off = np.linspace(1.05, 0.9, WIDTH)[None, :, None]
    picture = np.ones((HEIGHT, WIDTH, 3)) * TABLE
    if moment.shadow is not None:
        rows, columns = np.indices((HEIGHT, WIDTH))
        far = (rows - moment.shadow[0]) ** 2 / 14**2 + (columns - moment.shadow[1]) ** 2 / 20**2
        picture *= (1 - 0.3 * np.exp(-(far**2)))[..., None]
    truth = np.zeros((HEIGHT, WIDTH), np.uint8)
    for number, block in enumerate(moment.blocks, start=1):
        top, left = round(block.place[0] - block.rows / 2), round(block.place[1] - block.columns / 2)
        inside = np.s_[max(top, 0) : max(top + block.rows, 0), max(left, 0) : max(left + block.columns, 0)]
        picture[inside] = block.colour
        truth[inside] = number
    if moment.hand is not None:
        hand = np.zeros((HEIGHT, WIDTH), np.uint8)
        row, column = (round(value) for value in moment.hand)
        # Two fingers, the palm and the arm, which reaches to the border of the picture.
        for shift in (-6, 6):
            cv2.line(hand, (column + 3, row + shift), (column + 16, row + shift), 1, thickness=6)
        cv2.ellipse(hand, (column + 20, row), (11, 12), 0, 0, 360, 1, cv2.FILLED)
        cv2.rectangle(hand, (column + 20, row - 8), (WIDTH + 40, row + 8), 1, cv2.FILLED)
        picture[hand > 0] = SKIN
        truth[hand > 0] = HAND_NUMBER
    picture = cv2.GaussianBlur(picture * fall_off * moment.gain, (3, 3), 0.6)
    return np.clip(picture + noise, 0, 255).round().astype(np.uint8), truth


def plane(*, far_m: float = 1.4, near_m: float = 0.9) -> NDArray[np.float64]:
    """Depth of a table seen aslant: inverse depth is linear over the rows."""
    inverse = np.linspace(1 / far_m, 1 / near_m, HEIGHT)[:, None] * np.ones((1, WIDTH))
    return np.asarray(1 / inverse)
