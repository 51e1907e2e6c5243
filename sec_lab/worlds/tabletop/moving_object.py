"""*Moving Object*: a hand puts a fruit on a plate while moving the plate along with it (§2.3)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sec_lab.worlds.tabletop import objects, textures
from sec_lab.worlds.tabletop.plan import Actor, carried, pose
from sec_lab.worlds.tabletop.reach import Act, HandStyle, Timeline, behind, frames_at, hand_actor, varied
from sec_lab.worlds.tabletop.settings import Setting
from sec_lab.worlds.tabletop.textures import Colour

Place = tuple[float, float]


@dataclass(frozen=True)
class _Version:
    fruit: Literal["orange", "apple"]
    radius_m: float
    plate_m: tuple[float, float]
    fruit_at: Place
    plate_at: Place
    end_at: Place
    yaw_deg: float
    turn_deg: float
    hand: Literal["left", "right"]
    speed: float
    lift_m: float
    sway_m: float


_VERSIONS = (
    _Version(
        "orange", 0.036, (0.100, 0.016), (-0.15, -0.05), (0.01, 0.06), (0.10, 0.00), 128, 8, "right", 1.0, 0.08, 0.0
    ),
    _Version(
        "apple", 0.041, (0.118, 0.018), (0.17, 0.10), (0.00, 0.02), (-0.10, 0.06), 176, -10, "right", 1.5, 0.12, 0.03
    ),
    _Version(
        "apple", 0.034, (0.086, 0.013), (-0.04, -0.09), (-0.06, 0.12), (0.08, 0.15), 38, 12, "left", 0.72, 0.05, -0.05
    ),
    _Version(
        "orange", 0.029, (0.096, 0.015), (0.13, -0.06), (-0.02, -0.02), (-0.12, -0.06), -62, 10, "left", 1.15, 0.15, 0.0
    ),
)

_LABORATORY: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((240, 132, 26), (240, 240, 236), (50, 80, 170)),
    ((186, 28, 34), (226, 200, 96), (120, 60, 30)),
    ((120, 170, 50), (236, 236, 240), (190, 50, 50)),
    ((244, 150, 30), (60, 110, 180), (230, 230, 230)),
)
_KITCHEN: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((226, 140, 60), (226, 208, 176), (196, 160, 120)),
    ((190, 84, 62), (176, 138, 110), (140, 100, 76)),
    ((222, 168, 108), (230, 214, 190), (206, 176, 140)),
    ((216, 140, 84), (200, 168, 138), (170, 130, 100)),
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
    fruit_colour, plate_colour, stripe = (_LABORATORY if setting == "laboratory" else _KITCHEN)[version - 1]
    radius = v.radius_m * rng.uniform(0.96, 1.04)
    fruit_at, plate_at, end_at = (varied(place, rng) for place in (v.fruit_at, v.plate_at, v.end_at))
    if v.fruit == "orange":
        fruit = objects.orange(radius, fruit_colour, rng)
    else:
        fruit = objects.apple(radius, fruit_colour, (214, 190, 90), rng)
    plate = objects.plate(*v.plate_m, plate_colour, stripe, rng)
    floor = objects.PLATE_FLOOR_M

    yaw = np.deg2rad(v.yaw_deg + rng.uniform(-5, 5))
    turned = yaw + np.deg2rad(v.turn_deg)
    # Small fruit is held above its middle, so that the fingers stay clear of the plate.
    grip = max(0.94 * radius, 0.032)
    speed = v.speed * rng.uniform(0.93, 1.07)
    hand = Timeline(behind(fruit_at, yaw, 0.64, 0.20), yaw=yaw)
    hand.wait(frames_at(8, speed)).approach((*fruit_at, grip), frames_at(28, speed)).close(frames_at(8, speed))
    gripped = hand.frame
    hand.move((*plate_at, grip + floor), frames_at(26, speed), lift_m=v.lift_m, sway_m=v.sway_m, yaw=turned)
    put = hand.frame
    hand.move((*end_at, grip + floor), frames_at(22, speed), sway_m=-0.3 * v.sway_m)
    released = hand.frame
    hand.open(frames_at(7, speed)).retreat(behind(end_at, turned, 0.64, 0.20), frames_at(28, speed))
    hand.wait(frames_at(8, speed))

    X_WH, closed = hand.path()
    rests = np.zeros(len(X_WH), dtype=np.int64)
    X_WF = carried(pose((*fruit_at, 0), yaw=rng.uniform(0, 6)), X_WH, gripped, released)
    X_WP = np.repeat(pose((*plate_at, 0), yaw=rng.uniform(0, 6))[None], len(X_WH), axis=0)
    pushed = X_WH[np.clip(np.arange(len(X_WH)), put, released), :2, 3]
    X_WP[:, :2, 3] += pushed - pushed[0]
    style = HandStyle("top", radius, left=v.hand == "left", rise=0.24, scale=(1.0, 1.08, 0.92, 1.0)[version - 1])
    actors = (
        hand_actor("hand", style, X_WH, closed, textures.skin_palette(skin)),
        Actor("fruit", (fruit,), X_WF, rests),
        Actor("plate", (plate,), X_WP, rests),
    )
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    rim = X_WP[:, None, :2, 3] + v.plate_m[0] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return Act(actors, X_WH[:, :3, 3], (X_WP[:, :3, 3], rim.reshape(-1, 2)))
