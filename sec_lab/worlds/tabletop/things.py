"""Things that are put on plates and taken from them, with what a hand has to know of each."""

from dataclasses import dataclass

import numpy as np

from sec_lab.worlds.tabletop import objects
from sec_lab.worlds.tabletop.settings import Setting
from sec_lab.worlds.tabletop.shapes import Shape
from sec_lab.worlds.tabletop.textures import Colour

_COLOURS: dict[Setting, dict[str, tuple[Colour, Colour]]] = {
    "laboratory": {
        "orange": ((240, 132, 26), (240, 132, 26)),
        "lemon": ((244, 214, 40), (244, 214, 40)),
        "red apple": ((186, 28, 34), (214, 190, 90)),
        "green apple": ((120, 176, 44), (214, 210, 90)),
        "rye bread": ((122, 80, 46), (70, 42, 24)),
        "cheese": ((246, 206, 70), (246, 206, 70)),
        "salami": ((160, 36, 44), (224, 176, 168)),
        "box": ((160, 40, 130), (244, 230, 90)),
        "cup": ((200, 50, 60), (240, 236, 220)),
    },
    "kitchen": {
        "orange": ((226, 140, 60), (226, 140, 60)),
        "lemon": ((224, 186, 96), (224, 186, 96)),
        "red apple": ((190, 84, 62), (216, 176, 110)),
        "green apple": ((184, 168, 92), (214, 190, 120)),
        "rye bread": ((150, 108, 70), (104, 68, 42)),
        "cheese": ((230, 196, 130), (230, 196, 130)),
        "salami": ((184, 100, 84), (222, 168, 146)),
        "box": ((190, 150, 116), (120, 84, 60)),
        "cup": ((212, 178, 142), (150, 104, 74)),
    },
}
_PLATES: dict[Setting, tuple[tuple[Colour, Colour], ...]] = {
    "laboratory": (
        ((240, 240, 236), (50, 80, 170)),
        ((236, 230, 206), (120, 60, 30)),
        ((238, 238, 240), (190, 50, 50)),
        ((226, 236, 240), (40, 120, 90)),
    ),
    "kitchen": (
        ((226, 208, 176), (196, 160, 120)),
        ((196, 160, 130), (140, 100, 76)),
        ((230, 214, 190), (206, 176, 140)),
        ((206, 176, 146), (170, 130, 100)),
    ),
}


@dataclass(frozen=True, eq=False)
class Thing:
    """A thing that a hand holds from above.

    Parameters
    ----------
    kind : str
    shape : Shape
    grip_m : float
        Radius of the ring of finger tips round it.
    height_m : float
        How high the grip is above what the thing stands on.
    turns : tuple of float
        From which to which angle, in radians, it may be turned.
    """

    kind: str
    shape: Shape
    grip_m: float
    height_m: float
    turns: tuple[float, float] = (0.0, 6.0)


def thing_of(kind: str, size_m: tuple[float, float], setting: Setting, rng: np.random.Generator) -> Thing:
    """Make a thing.

    Parameters
    ----------
    kind : str
        ``"orange"``, ``"lemon"``, ``"red apple"``, ``"green apple"``, ``"rye bread"``, ``"cheese"``, ``"salami"``,
        ``"box"`` or ``"cup"``.
    size_m : tuple of float
        Radius (of a box: the side), and height where that does not follow from it.
    setting : {"laboratory", "kitchen"}
    rng : numpy.random.Generator
        Varies the size by up to 4 % and the texture.

    Raises
    ------
    ValueError
        If the kind is unknown.

    Examples
    --------
    >>> thing_of("anvil", (0.1, 0.1), "kitchen", np.random.default_rng(0))
    Traceback (most recent call last):
    ...
    ValueError: kind: expected one of orange, lemon, red apple, green apple, rye bread, cheese, salami, box, cup, got
    'anvil'
    """
    colours = _COLOURS[setting]
    if kind not in colours:
        raise ValueError(f"kind: expected one of {', '.join(colours)}, got {kind!r}")
    colour, second = colours[kind]
    scale = float(rng.uniform(0.96, 1.04))
    radius, height = size_m[0] * scale, size_m[1]
    # Small round things are held above their middle, flat ones above their upper side, so that fingers stay clear.
    if kind in ("orange", "lemon"):
        return Thing(kind, objects.orange(radius, colour, rng), radius, max(0.94 * radius, 0.032))
    if kind.endswith("apple"):
        return Thing(kind, objects.apple(radius, colour, second, rng), radius, max(0.94 * radius, 0.032))
    if kind == "box":
        shape = objects.box((radius, radius, height), colour, second, rng)
        return Thing(kind, shape, 0.68 * radius, 0.85 * height, (0.0, 0.0))
    if kind == "cup":
        return Thing(kind, objects.cup(radius, height, colour, second, rng, handle=False), radius, 0.75 * height)
    if kind == "rye bread":
        shape = objects.bread(radius, height, colour, second, rng)
    elif kind == "cheese":
        shape = objects.cheese(radius, height, colour, rng, corners=4.0)
    else:
        rim = (colour[0] * 0.75, colour[1] * 0.6, colour[2] * 0.6)
        shape = objects.salami(radius, height, colour, rim, second, rng)
    return Thing(kind, shape, radius, max(height + 0.006, 0.019))


def plate_of(size_m: tuple[float, float], colours: int, setting: Setting, rng: np.random.Generator) -> Shape:
    """Make a plate of a radius and a height, in one of four colours (any number: they repeat)."""
    colour, stripe = _PLATES[setting][(colours - 1) % 4]
    return objects.plate(*size_m, colour, stripe, rng)
