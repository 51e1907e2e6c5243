"""*Making Sandwich*: two hands put salami and cheese on bread, on top of each other (§2.3)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sec_lab.worlds.tabletop import objects, textures
from sec_lab.worlds.tabletop.plan import Actor, carried, pose, still
from sec_lab.worlds.tabletop.reach import Act, HandStyle, Timeline, behind, frames_at, hand_actor, varied
from sec_lab.worlds.tabletop.settings import Setting
from sec_lab.worlds.tabletop.textures import Colour

Place = tuple[float, float]


@dataclass(frozen=True)
class _Version:
    bread_m: tuple[float, float]
    salami_m: tuple[float, float]
    cheese_m: tuple[float, float]
    cheese_corners: float
    bread_at: Place
    salami_at: Place
    cheese_at: Place
    yaws_deg: tuple[float, float]
    first: Literal["left", "right"]
    overlap: float
    speed: float
    lift_m: float


_VERSIONS = (
    _Version(
        (0.064, 0.016),
        (0.043, 0.012),
        (0.033, 0.011),
        8.0,
        (0.0, 0.02),
        (0.16, 0.02),
        (-0.16, 0.05),
        (130, 48),
        "right",
        0.3,
        1.1,
        0.07,
    ),
    _Version(
        (0.072, 0.020),
        (0.047, 0.011),
        (0.038, 0.012),
        2.0,
        (0.03, 0.06),
        (0.15, -0.07),
        (-0.13, 0.12),
        (178, 6),
        "right",
        0.55,
        1.45,
        0.11,
    ),
    _Version(
        (0.060, 0.014),
        (0.040, 0.014),
        (0.030, 0.013),
        8.0,
        (-0.04, 0.0),
        (-0.16, 0.10),
        (0.12, 0.08),
        (64, 116),
        "left",
        0.0,
        0.95,
        0.05,
    ),
    _Version(
        (0.068, 0.024),
        (0.044, 0.012),
        (0.036, 0.014),
        5.0,
        (0.0, 0.04),
        (0.15, 0.10),
        (-0.16, -0.02),
        (-118, -58),
        "left",
        0.4,
        1.25,
        0.14,
    ),
)

_LABORATORY: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    ((222, 190, 140), (140, 86, 40), (168, 44, 44), (246, 206, 70)),
    ((202, 160, 108), (110, 66, 34), (150, 36, 46), (250, 224, 120)),
    ((232, 212, 172), (160, 104, 52), (186, 62, 58), (240, 180, 50)),
    ((190, 142, 92), (96, 58, 32), (160, 40, 40), (244, 214, 96)),
)
_KITCHEN: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    ((216, 184, 138), (164, 116, 70), (196, 112, 92), (230, 200, 140)),
    ((184, 144, 104), (124, 84, 54), (178, 92, 78), (222, 184, 130)),
    ((228, 204, 166), (190, 146, 100), (206, 130, 108), (234, 206, 152)),
    ((192, 152, 110), (140, 96, 60), (186, 104, 88), (224, 190, 136)),
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
    crumb, crust, meat, yellow = (_LABORATORY if setting == "laboratory" else _KITCHEN)[version - 1]
    bread_at, salami_at, cheese_at = (varied(place, rng) for place in (v.bread_at, v.salami_at, v.cheese_at))
    fat = (232, 186, 172) if setting == "laboratory" else (222, 168, 146)
    bread = objects.bread(*v.bread_m, crumb, crust, rng)
    salami = objects.salami(*v.salami_m, meat, (meat[0] * 0.75, meat[1] * 0.6, meat[2] * 0.6), fat, rng)
    cheese = objects.cheese(*v.cheese_m, yellow, rng, corners=v.cheese_corners)

    speed = v.speed * rng.uniform(0.93, 1.07)
    base = v.bread_m[1]
    first, (took, put) = _serve(
        salami_at, bread_at, v.yaws_deg[0], speed, start=6, height=base, thick=v.salami_m[1], lift=v.lift_m, rng=rng
    )
    # The second hand puts its slice down only after the first has let go.
    begin = round(put - (0.35 + 0.5 * v.overlap) * 40 / speed)
    second, (took_2, put_2) = _serve(
        cheese_at,
        bread_at,
        v.yaws_deg[1],
        speed,
        start=max(6, begin),
        height=base + v.salami_m[1],
        thick=v.cheese_m[1],
        lift=v.lift_m,
        rng=rng,
    )
    end = max(first.frame, second.frame) + 6
    first.until(end), second.until(end)
    (X_WF, closed), (X_WS, closed_2) = first.path(), second.path()
    n = len(X_WF)
    rests = np.zeros(n, dtype=np.int64)
    palette = textures.skin_palette(skin)
    names = ("left hand", "right hand") if v.first == "left" else ("right hand", "left hand")
    scale = (1.0, 0.94, 1.06, 1.0)[version - 1]
    styles = [
        HandStyle("top", size, left=name == "left hand", rise=0.26, scale=scale, spread=1.1)
        for size, name in zip((v.salami_m[0], v.cheese_m[0] * 1.02), names, strict=True)
    ]
    X_WSalami = carried(pose((*salami_at, 0), yaw=rng.uniform(0, 6)), X_WF, took, put)
    X_WCheese = carried(pose((*cheese_at, 0), yaw=rng.uniform(-0.4, 0.4)), X_WS, took_2, put_2)
    actors = (
        hand_actor(names[0], styles[0], X_WF, closed, palette),
        hand_actor(names[1], styles[1], X_WS, closed_2, palette),
        still("bread", bread, pose((*bread_at, 0), yaw=rng.uniform(-0.5, 0.5)), n),
        Actor("salami", (salami,), X_WSalami, rests),
        Actor("cheese", (cheese,), X_WCheese, rests),
    )
    return Act(actors, np.concatenate([X_WF[:, :3, 3], X_WS[:, :3, 3]]), (X_WSalami[:, :3, 3], X_WCheese[:, :3, 3]))


def _serve(
    start_at: Place,
    end_at: Place,
    yaw_deg: float,
    speed: float,
    *,
    start: int,
    height: float,
    thick: float,
    lift: float,
    rng: np.random.Generator,
) -> tuple[Timeline, tuple[int, int]]:
    """A hand that takes a slice from the table and puts it on top of what is there."""
    yaw = np.deg2rad(yaw_deg + rng.uniform(-5, 5))
    grip = max(thick + 0.006, 0.019)
    hand = Timeline(behind(start_at, yaw, 0.55, 0.18), yaw=yaw)
    hand.wait(start).approach((*start_at, grip), frames_at(28, speed)).close(frames_at(8, speed))
    took = hand.frame
    hand.move((*end_at, height + grip), frames_at(26, speed), lift_m=lift, yaw=yaw + rng.uniform(-0.1, 0.1))
    put = hand.frame
    hand.open(frames_at(7, speed)).retreat(behind(end_at, yaw, 0.6, 0.22), frames_at(28, speed))
    return hand, (took, put)
