"""Scenes: the six of Fig. 2.20, random ones with a seed, and bad ones."""

from typing import Literal, get_args

import numpy as np

from sec_lab.worlds.katana.cameras import camera_at, sees
from sec_lab.worlds.katana.kinematics import joint_angles
from sec_lab.worlds.katana.records import Camera, Form, Point, Scene, Thing

Example = Literal["a", "b", "c", "d", "e", "f"]
RED, GREEN, BLUE = (205, 25, 25), (30, 160, 45), (35, 70, 205)
START_M: Point = (-0.10, 0.33, 0.30)
HOME_M: Point = (-0.10, -0.33, 0.30)

HAND_RADIUS_M = 0.13
"""Of a ball about the tip that holds all that has its colour."""

_BOX_M = 0.06
_X_M, _Y_M = (0.17, 0.40), (-0.16, 0.16)
"""Where things are put."""


def thing(
    name: str, shape: Form, colour: tuple[int, int, int], x_m: float, y_m: float, size_m: Point, yaw_rad: float = 0.0
) -> Thing:
    """A thing that stands on the table."""
    return Thing(name, shape, colour, size_m, (x_m, y_m, size_m[2] / 2), yaw_rad)


def example_scene(which: Example) -> Scene:
    """A scene like those of Fig. 2.20.

    (a–c) other places, (d) a red sphere, (e) a bigger red box, (f) a red cone, a bigger green box and one more blue
    sphere.

    Parameters
    ----------
    which : {"a", "b", "c", "d", "e", "f"}

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        If there is no such scene.

    Examples
    --------
    >>> [thing.name for thing in example_scene("f").things]
    ['red cone', 'green box', 'blue sphere']
    """
    if which not in get_args(Example):
        raise ValueError(f"which: expected one of {get_args(Example)}, got {which!r}")
    cube = (_BOX_M, _BOX_M, _BOX_M)
    places = {
        "a": ((0.24, -0.09, 0.2), (0.33, 0.07, 0.9)),
        "b": ((0.36, 0.08, -0.3), (0.24, -0.06, 0.1)),
        "c": ((0.26, 0.12, 0.5), (0.34, -0.05, -0.2)),
        "d": ((0.24, 0.08, 0.0), (0.35, -0.03, 0.3)),
        "e": ((0.25, -0.07, 0.4), (0.36, 0.07, 0.0)),
        "f": ((0.25, 0.08, 0.0), (0.33, -0.08, 0.4)),
    }
    (x, y, yaw), (green_x, green_y, green_yaw) = places[which]
    green = thing("green box", "box", GREEN, green_x, green_y, cube, green_yaw)
    things = [thing("red box", "box", RED, x, y, cube, yaw), green]
    azimuth = 10.0
    if which == "d":
        things = [thing("red sphere", "sphere", RED, x, y, (0.06, 0.06, 0.06)), green]
    elif which == "e":
        things = [thing("red box", "box", RED, x, y, (0.085, 0.085, 0.07), yaw), green]
    elif which == "f":
        bigger = thing("green box", "box", GREEN, green_x, green_y, (0.085, 0.085, 0.07), green_yaw)
        ball = thing("blue sphere", "sphere", BLUE, 0.41, 0.06, (0.05, 0.05, 0.05))
        things = [thing("red cone", "cone", RED, x, y, (0.07, 0.07, 0.08)), bigger, ball]
    return Scene(tuple(things), camera_at(azimuth_deg=azimuth), HOME_M, START_M)


def random_scene(seed: int, *, number: int = 0) -> Scene:
    """A red thing and a green box in other places, sometimes a blue sphere; the same for the same seed and number.

    Parameters
    ----------
    seed, number : int
        Of the collection, and in it.

    Returns
    -------
    Scene
        The arm reaches all that a straight push needs, and the camera sees both things whole.

    Examples
    --------
    >>> random_scene(1).things == random_scene(1).things, random_scene(1).things == random_scene(2).things
    (True, False)
    """
    rng = np.random.default_rng([seed, number])
    while True:
        shape: Form = ("box", "box", "sphere", "cone")[rng.integers(4)]
        side = float(rng.uniform(0.05, 0.08))
        size = {"box": (side, side, side), "sphere": (0.06, 0.06, 0.06), "cone": (0.07, 0.07, 0.08)}[shape]
        red_at, green_at = _place(rng), _place(rng)
        green_side = float(rng.uniform(0.05, 0.08))
        red = thing(f"red {shape}", shape, RED, *red_at, size, float(rng.uniform(-np.pi / 4, np.pi / 4)))
        green = thing(
            "green box", "box", GREEN, *green_at, (green_side,) * 3, float(rng.uniform(-np.pi / 4, np.pi / 4))
        )
        things = [red, green]
        if rng.random() < 0.3:
            things.append(thing("blue sphere", "sphere", BLUE, *_place(rng), (0.05, 0.05, 0.05)))
        camera = random_camera(rng)
        start, home = random_rest(rng), random_rest(rng)
        scene = Scene(tuple(things), camera, home, start)
        if (
            roomy(scene)
            and pushable(red, green)
            and seen_whole(scene)
            and unseen(camera, start)
            and unseen(camera, home)
        ):
            return scene


def random_camera(rng: np.random.Generator) -> Camera:
    """A camera that looks at the workplace from in front of the arm, up to 55° aside (Fig. 2.15)."""
    return camera_at(
        azimuth_deg=float(rng.uniform(-55, 55)),
        elevation_deg=float(rng.uniform(42, 62)),
        distance_m=float(rng.uniform(0.60, 0.70)),
        target_m=(0.28 + rng.uniform(-0.01, 0.01), rng.uniform(-0.01, 0.01), 0.02),
    )


def random_rest(rng: np.random.Generator) -> Point:
    """A place of the tip behind the arm's column, to its left or right."""
    side = -1.0 if rng.random() < 0.5 else 1.0
    return float(rng.uniform(-0.20, -0.08)), side * float(rng.uniform(0.26, 0.36)), float(rng.uniform(0.24, 0.34))


def unseen(camera: Camera, tip_m: Point) -> bool:
    """Whether the tip at rest is outside the camera's view, with the hand that has its colour."""
    q = joint_angles(tip_m)
    # The hand points away from the column: the middle of the coloured part lies behind the tip.
    middle = np.asarray(tip_m) - 0.05 * _along(q)
    return not bool(sees(camera, middle, radius_m=HAND_RADIUS_M))


def seen_whole(scene: Scene) -> bool:
    """Whether the camera sees every thing whole."""
    return all(_whole(scene.camera, one) for one in scene.things)


def roomy(scene: Scene, *, gap_m: float = 0.055) -> bool:
    """Whether any two things are apart by more than a gap, whatever their turns."""
    for place, one in enumerate(scene.things):
        for other in scene.things[place + 1 :]:
            distance = np.hypot(one.p_W_m[0] - other.p_W_m[0], one.p_W_m[1] - other.p_W_m[1])
            if distance < reach_of(one) + reach_of(other) + gap_m:
                return False
    if len(scene.things) < 3:
        return True
    # What else stands there is out of the way of the push.
    red, green, other = scene.things
    start, end, point = (np.array(one.p_W_m[:2]) for one in (red, green, other))
    way = end - start
    behind = start - 0.12 * way / np.linalg.norm(way)
    share = np.clip((point - behind) @ (end - behind) / ((end - behind) @ (end - behind)), 0, 1)
    return bool(np.linalg.norm(behind + share * (end - behind) - point) > 0.11)


def pushable(red: Thing, green: Thing) -> bool:
    """Whether the arm reaches from behind the one to the other, on the straight line through both."""
    start, end = np.array(red.p_W_m[:2]), np.array(green.p_W_m[:2])
    way = (end - start) / np.linalg.norm(end - start)
    for at in (start - (reach_of(red) + 0.06) * way, end):
        r = float(np.hypot(*at))
        if not 0.14 <= r <= 0.47 or at[0] < 0.05:
            return False
    return True


def reach_of(one: Thing) -> float:
    """Radius of the circle round a thing, seen from above."""
    return float(np.hypot(one.size_m[0], one.size_m[1]) / 2 if one.shape == "box" else one.size_m[0] / 2)


def _place(rng: np.random.Generator) -> tuple[float, float]:
    return float(rng.uniform(*_X_M)), float(rng.uniform(*_Y_M))


def _along(
    q_rad: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]",
) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    from sec_lab.worlds.katana.kinematics import hand_axes

    return hand_axes(q_rad)[0]


def _whole(camera: Camera, one: Thing) -> bool:
    from sec_lab.worlds.katana.cameras import project

    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    half = np.array([2 * reach_of(one), 2 * reach_of(one), one.size_m[2]])
    pixels, depth = project(camera, np.asarray(one.p_W_m) + corners * half)
    inside = (pixels > 2) & (pixels < np.array([camera.width - 3, camera.height - 3]))
    return bool(inside.all() and (depth > 0).all())
