"""*Filling Liquid*: a cup is filled with liquid from another cup (§2.3).

All liquid is one segment, wherever it is: at first in the full cup, then falling, at last in the cup that was empty. It
is of one colour and moves out of one cup into the other, which is what a viewer sees of this action.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sec_lab.worlds.tabletop import objects, textures
from sec_lab.worlds.tabletop.plan import Actor, carried, pose, still
from sec_lab.worlds.tabletop.reach import Act, HandStyle, Timeline, behind, frames_at, hand_actor, varied
from sec_lab.worlds.tabletop.settings import Setting
from sec_lab.worlds.tabletop.shapes import Floats, Shape
from sec_lab.worlds.tabletop.textures import Colour

Place = tuple[float, float]
_TAPER, _SOURCE_TAPER = 0.95, 0.85
_WALL_M, _SOURCE_WALL_M = 0.0035, 0.0055
_FULL = 0.80
"""Height of the liquid in the full cup, as a share of the cup's."""
_N_LEVELS = 14


@dataclass(frozen=True)
class _Version:
    source_m: tuple[float, float]
    target_m: tuple[float, float]
    source_at: Place
    target_at: Place
    end_at: Place
    yaw_deg: float
    hand: Literal["left", "right"]
    handle_deg: float
    tilt_deg: float
    speed: float
    lift_m: float


_VERSIONS = (
    _Version(
        (0.033, 0.095), (0.043, 0.075), (0.17, 0.00), (-0.06, 0.05), (0.18, 0.03), 122, "right", 200, 96, 1.0, 0.05
    ),
    _Version(
        (0.038, 0.085), (0.050, 0.062), (0.12, 0.10), (0.01, -0.04), (0.15, 0.08), 172, "right", 215, 104, 1.35, 0.09
    ),
    _Version(
        (0.030, 0.110), (0.040, 0.085), (-0.18, 0.02), (0.04, 0.06), (-0.16, 0.06), 56, "left", -20, 92, 0.98, 0.09
    ),
    _Version(
        (0.036, 0.090), (0.056, 0.055), (-0.10, 0.14), (-0.02, -0.02), (-0.15, 0.10), 4, "left", 10, 100, 1.15, 0.12
    ),
)

_LABORATORY: tuple[tuple[Colour, Colour, Colour, Colour, Colour], ...] = (
    ((60, 90, 180), (230, 230, 235), (236, 236, 232), (180, 50, 50), (214, 96, 24)),
    ((200, 170, 60), (140, 90, 30), (190, 60, 60), (240, 230, 220), (244, 240, 230)),
    ((180, 50, 60), (240, 220, 210), (238, 234, 220), (60, 110, 80), (110, 30, 70)),
    ((236, 236, 236), (60, 60, 70), (70, 120, 190), (235, 235, 240), (236, 190, 60)),
)
_KITCHEN: tuple[tuple[Colour, Colour, Colour, Colour, Colour], ...] = (
    ((206, 176, 142), (160, 120, 90), (226, 208, 182), (190, 150, 110), (170, 110, 60)),
    ((170, 124, 96), (120, 84, 60), (206, 170, 136), (150, 104, 74), (232, 214, 186)),
    ((224, 202, 172), (180, 140, 104), (212, 178, 142), (234, 214, 186), (190, 120, 70)),
    ((186, 140, 108), (220, 190, 160), (224, 198, 166), (160, 116, 84), (206, 150, 90)),
)


def act(version: int, setting: Setting, skin: Colour, rng: np.random.Generator) -> Act:
    """One version (1 to 4) of the action.

    Parameters
    ----------
    version : int
    setting : {"laboratory", "kitchen"}
    skin : Colour
    rng : numpy.random.Generator
        Varies places, sizes and times a little.
    """
    v = _VERSIONS[version - 1]
    colours = (_LABORATORY if setting == "laboratory" else _KITCHEN)[version - 1]
    source_at, target_at, end_at = (varied(place, rng) for place in (v.source_at, v.target_at, v.end_at))
    full = {"taper": _SOURCE_TAPER, "wall_m": _SOURCE_WALL_M}
    source = objects.cup(*v.source_m, colours[0], colours[1], rng, handle=False, **full)
    target = objects.cup(*v.target_m, colours[2], colours[3], rng, taper=_TAPER, wall_m=_WALL_M)

    side = -1.0 if v.hand == "left" else 1.0
    yaw = np.deg2rad(v.yaw_deg + rng.uniform(-4, 4))
    upright, tilt = side * np.pi / 2, np.deg2rad(v.tilt_deg)
    grip = 0.58 * v.source_m[1]
    across = side * np.array([-np.sin(yaw), np.cos(yaw)])
    lip = _lip(v.source_m, grip, tilt)
    above = v.target_m[1] + 0.028
    pouring = np.array([*(np.asarray(target_at) - (lip[0] - 0.25 * v.target_m[0]) * across), above - lip[1]])
    speed = v.speed * rng.uniform(0.93, 1.07)

    hand = Timeline(_beside(behind(source_at, yaw, 0.55, 0.14), across), yaw=yaw, roll=upright)
    hand.wait(frames_at(8, speed)).move(_beside((*source_at, grip), across), frames_at(22, speed), lift_m=0.02)
    hand.move((*source_at, grip), frames_at(6, speed)).close(frames_at(8, speed))
    taken = hand.frame
    # Upright, it has to be above the other cup; it comes down as it tilts.
    ready = np.array([pouring[0], pouring[1], max(pouring[2], v.target_m[1] + grip + 0.015)])
    hand.move(ready, frames_at(22, speed), lift_m=v.lift_m).move(
        pouring, frames_at(16, speed), roll=upright - side * tilt
    )
    flows = hand.frame
    hand.wait(frames_at(26, speed))
    stops = hand.frame
    hand.move(ready, frames_at(12, speed), roll=upright).move((*end_at, grip), frames_at(22, speed), lift_m=v.lift_m)
    put = hand.frame
    hand.open(frames_at(7, speed)).move(_beside((*end_at, grip), across), frames_at(6, speed))
    hand.move(_beside(behind(end_at, yaw, 0.6, 0.16), across), frames_at(22, speed)).wait(frames_at(6, speed))

    X_WH, closed = hand.path()
    n = len(X_WH)
    X_WS = carried(pose((*source_at, 0)), X_WH, taken, put)
    start = np.array([*(pouring[:2] + lip[0] * across), pouring[2] + lip[1]])
    bottom = _WALL_M + 0.0045
    pour, surface = _poured(
        start, target_at, across, v.target_m, bottom, colours[4], rng, n=n, flows=flows, stops=stops
    )
    remaining = _remaining(v.source_m, X_WS, across, colours[4], rng, flows=flows, stops=stops)
    radius = max(v.source_m[0] * 0.95, 0.028)
    style = HandStyle("wrap", radius, left=v.hand == "left", rise=0.30, scale=(1.0, 1.06, 0.94, 1.0)[version - 1])
    rests = np.zeros(n, dtype=np.int64)
    actors = (
        hand_actor("hand", style, X_WH, closed, textures.skin_palette(skin)),
        Actor("full cup", (source,), X_WS, rests),
        still("empty cup", target, pose((*target_at, 0), yaw=np.deg2rad(v.handle_deg)), n),
        pour,
        surface,
        remaining,
    )
    return Act(actors, X_WH[:, :3, 3], (X_WS[:, :3, 3], np.array([[*target_at, 0.0]])))


def _beside(point: tuple[float, float, float], across: Floats) -> tuple[float, float, float]:
    """A little to the side of the palm, from where an open hand closes in."""
    return (point[0] - 0.055 * float(across[0]), point[1] - 0.055 * float(across[1]), point[2])


def _lip(size_m: tuple[float, float], grip: float, tilt: float) -> tuple[float, float]:
    """Lip of a tilted cup as seen from its grip: how far to the side, how far up."""
    radius, height = size_m
    over = height - grip
    return (
        float(over * np.sin(tilt) + radius * np.cos(tilt)),
        float(over * np.cos(tilt) - radius * np.sin(tilt)),
    )


def _remaining(
    source_m: tuple[float, float],
    X_WS: Floats,
    across: Floats,
    colour: Colour,
    rng: np.random.Generator,
    *,
    flows: int,
    stops: int,
) -> Actor:
    """The liquid in the full cup: level until it reaches the lip, then running out over it."""
    radius, height = source_m
    inner = radius - _SOURCE_WALL_M
    brim = np.arctan2((1 - _FULL) * height, inner)
    last = np.arctan2(height - _SOURCE_WALL_M, 0.6 * inner)
    frames = np.arange(len(X_WS))
    tilt = np.arccos(np.clip(X_WS[:, 2, 2], -1, 1))
    share = np.clip((frames - flows) / (stops - flows), 0, 1)
    # It lags behind a quick tilt, but not by more than this.
    held = np.maximum(np.minimum(tilt, brim), tilt - np.deg2rad(50))
    angle = np.where(frames < flows, held, held[flows] + share * (last - held[flows]))
    steps = np.linspace(0, last, _N_LEVELS)
    towards = float(np.arctan2(across[1], across[0]))
    forms = tuple(
        objects.liquid_in(
            source_m, _FULL * height, step, colour, rng, towards=towards, taper=_SOURCE_TAPER, wall_m=_SOURCE_WALL_M
        )
        for step in steps
    )
    form = np.abs(angle[:, None] - steps).argmin(axis=1)
    return Actor("liquid", forms, X_WS, np.where(frames < stops, form, -1))


def _poured(
    start: Floats,
    target_at: Place,
    across: Floats,
    target_m: tuple[float, float],
    bottom: float,
    colour: Colour,
    rng: np.random.Generator,
    *,
    n: int,
    flows: int,
    stops: int,
) -> tuple[Actor, Actor]:
    """The falling liquid and the surface that rises below it; both are the segment *liquid*."""
    ground = np.array([*target_at, bottom])
    reach = float((ground[:2] - start[:2]) @ across)
    share = np.linspace(0, 1, 15)
    path = start + np.stack(
        [across[0] * reach * share, across[1] * reach * share, (bottom - start[2]) * share**2], axis=-1
    )
    parts = [path[:6], path[:11], *[path] * 3, path[5:], path[10:]]
    forms: tuple[Shape, ...] = tuple(objects.jet(part, 0.0042, colour, rng) for part in parts)
    form = np.full(n, -1)
    form[flows:stops] = 2 + np.arange(stops - flows) % 3
    form[flows : flows + 2] = (0, 1)
    form[stops : stops + 2] = (5, 6)
    poses = np.repeat(np.eye(4)[None], n, axis=0)

    radius, height = target_m
    inner = 0.5 * (1 + _TAPER) * radius - _WALL_M + 0.0012
    full = 0.78 * height
    level = np.repeat(pose((*target_at, bottom))[None], n, axis=0)
    rise = np.clip((np.arange(n) - flows - 2) / (stops - flows), 0, 1)
    level[:, 2, 3] = bottom + (full - bottom) * rise
    shown = np.where(np.arange(n) >= flows + 2, 0, -1)
    surface = Actor("liquid", (objects.liquid(inner, colour, rng),), level, shown)
    return Actor("liquid", forms, poses, form), surface
