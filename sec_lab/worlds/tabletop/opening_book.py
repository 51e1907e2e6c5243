"""*Opening Book*: a hand opens a book (§2.3)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sec_lab.worlds.tabletop import objects, textures
from sec_lab.worlds.tabletop.plan import Actor, eased, pose, still
from sec_lab.worlds.tabletop.reach import Act, HandStyle, Timeline, frames_at, hand_actor, varied
from sec_lab.worlds.tabletop.settings import Setting
from sec_lab.worlds.tabletop.shapes import Floats, joined, moved
from sec_lab.worlds.tabletop.textures import Colour

Place = tuple[float, float]
_BOARD_M = 0.0055


@dataclass(frozen=True)
class _Version:
    size_m: tuple[float, float, float]
    spine_at: Place
    turn_deg: float
    swing_deg: float
    hand: Literal["left", "right"]
    grip_at: float
    speed: float


_VERSIONS = (
    _Version((0.130, 0.190, 0.026), (-0.01, 0.04), 0, -18, "right", -0.3, 1.0),
    _Version((0.110, 0.160, 0.038), (0.00, 0.02), 24, 8, "right", 0.1, 1.5),
    _Version((0.150, 0.170, 0.018), (0.02, 0.05), 176, 20, "left", -0.2, 0.75),
    _Version((0.120, 0.200, 0.030), (0.00, 0.05), -22, -10, "right", 0.2, 1.2),
)

_LABORATORY: tuple[tuple[Colour, Colour], ...] = (
    ((150, 40, 46), (236, 214, 150)),
    ((214, 170, 60), (70, 50, 40)),
    ((176, 60, 40), (240, 230, 220)),
    ((46, 92, 150), (236, 236, 226)),
)
_KITCHEN: tuple[tuple[Colour, Colour], ...] = (
    ((184, 128, 92), (226, 196, 150)),
    ((130, 86, 62), (190, 150, 110)),
    ((206, 164, 126), (150, 100, 70)),
    ((170, 124, 100), (214, 186, 150)),
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
    colour, ink = (_LABORATORY if setting == "laboratory" else _KITCHEN)[version - 1]
    width, length, thick = (size * rng.uniform(0.97, 1.03) for size in v.size_m)
    spine_at = varied(v.spine_at, rng)
    X_WBook = pose((*spine_at, 0), yaw=np.deg2rad(v.turn_deg + rng.uniform(-4, 4)))
    back = objects.book_cover(width, length, colour, ink, rng, thick_m=_BOARD_M)
    hinge = _BOARD_M + thick
    spine = moved(
        objects.book_cover(hinge, length, colour, ink, rng, thick_m=_BOARD_M), pose((0, 0, 0), pitch=-np.pi / 2)
    )
    block = moved(objects.book_block(width - 0.005, length - 0.008, thick, rng), pose((0, 0, _BOARD_M)))
    front = objects.book_cover(width, length, colour, ink, rng, thick_m=_BOARD_M)

    speed = v.speed * rng.uniform(0.93, 1.07)
    beside = v.grip_at * length
    swing = np.deg2rad(v.swing_deg)
    open_angle = np.pi + np.arcsin(min(1.0, (hinge - _BOARD_M) / width))
    angles = open_angle * eased(np.arange(1, frames_at(46, speed) + 1) / frames_at(46, speed))

    def states(turned: Floats) -> Floats:
        """Hand that pushes the cover at these angles, in the world: position, yaw, pitch, roll."""
        share = turned / open_angle
        # At first the fingers are under the edge; then they slide onto the inner side.
        along = width + 0.007 - 0.025 * eased(share * 3)
        under = 0.0065
        x = along * np.cos(turned) + under * np.sin(turned)
        z = hinge + along * np.sin(turned) - under * np.cos(turned)
        pitch = 0.12 + 0.62 * eased(share)
        heading = np.pi + swing
        # The grip lies behind the tips of the fingers.
        tip = np.array([0.020, 0.0, -0.0105])
        found = []
        for place_x, place_z, nose in zip(x, z, pitch, strict=True):
            local = pose((0, 0, 0), yaw=heading, pitch=nose)
            origin = np.array([place_x, beside, place_z]) - local[:3, :3] @ tip
            world = X_WBook @ np.array([*origin, 1.0])
            found.append([*world[:3], heading + np.arctan2(X_WBook[1, 0], X_WBook[0, 0]), nose, 0.0])
        return np.array(found)

    first, last = states(np.zeros(1))[0], states(np.array([open_angle]))[0]
    yaw = first[3]
    backwards = -np.array([np.cos(yaw), np.sin(yaw), 0.0])
    hand = Timeline(tuple(first[:3] + 0.5 * backwards + (0, 0, 0.12)), yaw=yaw, pitch=first[4])
    hand.wait(frames_at(4, speed)).close(frames_at(5, speed))
    hand.move(first[:3] + 0.05 * backwards, frames_at(24, speed), lift_m=0.03).move(first[:3], frames_at(10, speed))
    starts = hand.frame
    hand.follow(states(angles))
    hand.wait(frames_at(5, speed)).move(last[:3] + 0.06 * backwards + (0, 0, 0.07), frames_at(10, speed))
    hand.open(4).move(first[:3] + 0.55 * backwards + (0, 0, 0.16), frames_at(22, speed), pitch=0.1).wait(
        frames_at(8, speed)
    )

    X_WH, closed = hand.path()
    n = len(X_WH)
    angle = np.zeros(n)
    angle[starts + 1 : starts + 1 + len(angles)] = angles
    angle[starts + 1 + len(angles) :] = open_angle
    X_WC = np.stack([X_WBook @ pose((0, 0, hinge), pitch=-a) for a in angle])
    style = HandStyle("pinch", 0.002, left=v.hand == "left", rise=0.26, scale=(1.0, 1.06, 0.95, 1.0)[version - 1])
    actors = (
        hand_actor("hand", style, X_WH, closed, textures.skin_palette(skin)),
        Actor("cover", (front,), X_WC, np.zeros(n, dtype=np.int64)),
        still("cover", joined(back, spine), X_WBook, n),
        still("pages", block, X_WBook, n),
    )
    edge = np.array([(x, y, 0.0, 1.0) for x in np.linspace(-width, width, 5) for y in (-length / 2, 0, length / 2)])
    return Act(actors, X_WH[:, :3, 3], ((edge @ X_WBook.T)[:, :3],))
