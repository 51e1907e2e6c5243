"""Demonstrations (§2.10): the arm, told where to go, pushes a red box to a green box and goes home, in ten setups."""

from dataclasses import dataclass, replace

import numpy as np

from sec_lab.recording import Recording
from sec_lab.worlds.katana.cameras import camera_at
from sec_lab.worlds.katana.records import Camera, Floats, Move, Point, Scene, Truth
from sec_lab.worlds.katana.run import Run
from sec_lab.worlds.katana.scenes import (
    GREEN,
    RED,
    pushable,
    random_rest,
    roomy,
    seen_whole,
    thing,
    unseen,
)

N_DEMONSTRATIONS = 10
SEED = 2012

_HEIGHT_M, _ABOVE_M = 0.03, 0.15
_SIDE_M = (0.055, 0.065)
_HALF_FINGER_M = 0.0125
_PUSH_M_S, _DOWN_M_S, _AWAY_M_S = 0.05, 0.09, 0.30


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One demonstration.

    Parameters
    ----------
    recording : Recording
        With range pictures.
    scene : Scene
        At the beginning.
    truth : Truth
        With label pictures.
    move_ends : tuple of int
        Number of the frame at which each movement had ended.
    """

    recording: Recording
    scene: Scene
    truth: Truth
    move_ends: tuple[int, ...]


def demonstrations(seed: int = SEED, *, n: int = N_DEMONSTRATIONS) -> tuple[Demonstration, ...]:
    """Demonstrations of pushing, each with a camera, a start, a home and places of its own (Fig. 2.15, 2.18).

    Each takes about as long as rendering its 320 frames.

    Parameters
    ----------
    seed : int, optional
    n : int, optional
        How many.

    Returns
    -------
    tuple of Demonstration
    """
    return tuple(demonstration(seed, number) for number in range(n))


def demonstration(seed: int, number: int, *, labels: bool = True) -> Demonstration:
    """One of :func:`demonstrations`.

    Parameters
    ----------
    seed, number : int
    labels : bool, optional
        Whether the truth has label pictures.
    """
    scene = demonstration_scene(seed, number)
    run = Run(scene, labels=labels)
    run.rest(0.5)
    for move in pushing_program(scene):
        run.move(move)
    run.rest(0.5)
    return Demonstration(run.recording, scene, run.truth, tuple(run.move_ends))


def demonstration_scene(seed: int, number: int) -> Scene:
    """The scene of a demonstration: a red and a green box, the camera turned on from one to the next.

    Parameters
    ----------
    seed, number : int
    """
    rng = np.random.default_rng([seed, number, 1])
    while True:
        names = (("red box", RED), ("green box", GREEN))
        things = []
        for name, colour in names:
            side = float(rng.uniform(*_SIDE_M))
            x, y = float(rng.uniform(0.19, 0.38)), float(rng.uniform(-0.14, 0.14))
            things.append(thing(name, "box", colour, x, y, (side, side, side)))
        way = np.array(things[1].p_W_m) - np.array(things[0].p_W_m)
        # Whoever programs a demonstration sets the boxes up nearly square to each other.
        heading = float(np.arctan2(way[1], way[0]))
        things = [replace(one, yaw_rad=heading + float(rng.uniform(-0.25, 0.25))) for one in things]
        camera = _camera(rng, number)
        scene = Scene(tuple(things), camera, random_rest(rng), random_rest(rng))
        apart = float(np.hypot(way[0], way[1]))
        if not (0.14 < apart < 0.24 and roomy(scene) and pushable(*things) and seen_whole(scene)):
            continue
        if unseen(camera, scene.start_m) and unseen(camera, scene.home_m):
            return scene


def pushing_program(scene: Scene) -> tuple[Move, ...]:
    """The hard-coded push of the demonstrations, from true places; nothing of it is used in the execution.

    Parameters
    ----------
    scene : Scene
    """
    red, green = scene.thing("red box"), scene.thing("green box")
    start, end = np.array(red.p_W_m[:2]), np.array(green.p_W_m[:2])
    way = (end - start) / np.linalg.norm(end - start)
    facing = float(np.arctan2(way[1], way[0]))
    back = _half_width(red.size_m[0], red.yaw_rad - facing)
    touch = start - (back + _HALF_FINGER_M) * way
    gap = float(np.linalg.norm(end - start)) - back - _half_width(green.size_m[0], green.yaw_rad - facing)
    behind, done = touch - 0.04 * way, touch + (gap + 0.004) * way
    away = done - 0.05 * way
    return (
        Move(_at(behind, _ABOVE_M), name="approach", facing_rad=facing, speed_m_s=_AWAY_M_S),
        Move(_at(behind, _HEIGHT_M), name="down", speed_m_s=_DOWN_M_S),
        Move(_at(touch, _HEIGHT_M), name="touch", speed_m_s=_PUSH_M_S),
        Move(_at(done, _HEIGHT_M), name="push", speed_m_s=_PUSH_M_S),
        Move(_at(away, _HEIGHT_M), name="leave", speed_m_s=_PUSH_M_S),
        Move(_at(away, _ABOVE_M), name="up", speed_m_s=_DOWN_M_S),
        Move(scene.home_m, name="home", speed_m_s=_AWAY_M_S),
    )


def _camera(rng: np.random.Generator, number: int) -> Camera:
    return camera_at(
        azimuth_deg=-55 + 110 * (number % N_DEMONSTRATIONS) / (N_DEMONSTRATIONS - 1) + float(rng.uniform(-4, 4)),
        elevation_deg=float(rng.uniform(42, 62)),
        distance_m=float(rng.uniform(0.60, 0.70)),
        target_m=(0.28 + rng.uniform(-0.015, 0.015), rng.uniform(-0.015, 0.015), 0.02),
    )


def _half_width(side_m: float, turn_rad: float) -> float:
    """From the middle of a square to its border, in a direction."""
    turn = (turn_rad + np.pi / 4) % (np.pi / 2) - np.pi / 4
    return float(side_m / 2 / np.cos(turn))


def _at(point: Floats, height_m: float) -> Point:
    return float(point[0]), float(point[1]), height_m
