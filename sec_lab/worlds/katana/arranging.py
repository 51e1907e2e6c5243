"""Scenes by hand: things put elsewhere, turned, of another size or shape, one more or less, seen from elsewhere."""

from dataclasses import replace
from itertools import product
from typing import Literal, get_args

import numpy as np

from sec_lab.worlds.katana.cameras import camera_at
from sec_lab.worlds.katana.records import Camera, Form, Point, Scene, Thing
from sec_lab.worlds.katana.scenes import BLUE, HOME_M, RED, START_M, reach_of, roomy, thing, unseen

Third = Literal["none", "blue sphere", "another red box"]
"""What may stand there besides the red and the green thing: nothing, something else, or a second candidate."""

_HEIGHT_SHARE = {"box": 1.0, "sphere": 1.0, "cone": 8 / 7}
_GRID_X_M, _GRID_Y_M = np.arange(0.20, 0.41, 0.03), np.arange(-0.15, 0.16, 0.03)


def rearranged(
    scene: Scene,
    number: int,
    *,
    shape: Form | None = None,
    at_m: tuple[float, float] | None = None,
    size_m: float | None = None,
    yaw_rad: float | None = None,
) -> Scene:
    """A scene with one of its things changed; it stands on the table again.

    Parameters
    ----------
    scene : Scene
    number : int
        Of the thing, from 0 on.
    shape : {"box", "sphere", "cone"}, optional
        The name says the new shape, if it said the old one.
    at_m : tuple of float, optional
        Where it stands in the plane.
    size_m : float, optional
        Length of a side, or diameter; the height changes with it.
    yaw_rad : float, optional

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        If there is no such thing, the shape is unknown, or a number is not finite or not above 0.

    Examples
    --------
    >>> from sec_lab.worlds.katana import example_scene
    >>> moved = rearranged(example_scene("a"), 0, shape="sphere", at_m=(0.3, 0.1), size_m=0.05)
    >>> moved.things[0].name, moved.things[0].p_W_m
    ('red sphere', (0.3, 0.1, 0.025))
    """
    if not 0 <= number < len(scene.things):
        raise ValueError(f"number: expected a thing from 0 to {len(scene.things) - 1}, got {number}")
    old = scene.things[number]
    form = old.shape if shape is None else shape
    if form not in get_args(Form):
        raise ValueError(f"shape: expected one of {get_args(Form)}, got {form!r}")
    side = old.size_m[0] if size_m is None else float(size_m)
    share = old.size_m[2] / old.size_m[0] if form == old.shape else _HEIGHT_SHARE[form]
    size: Point = (side, side * old.size_m[1] / old.size_m[0] if form == "box" else side, share * side)
    x, y = old.p_W_m[:2] if at_m is None else at_m
    name = f"{old.name.removesuffix(old.shape)}{form}" if old.name.endswith(old.shape) else old.name
    yaw = old.yaw_rad if yaw_rad is None else yaw_rad
    changed = Thing(name, form, old.colour, size, (float(x), float(y), size[2] / 2), yaw)
    things = list(scene.things)
    things[number] = changed
    return replace(scene, things=tuple(things))


def with_third(scene: Scene, kind: Third) -> Scene:
    """A scene with its first two things and, if wanted, a third that stands as far from them as there is room.

    Parameters
    ----------
    scene : Scene
        With two things at least.
    kind : {"none", "blue sphere", "another red box"}
        With a second red thing there are two candidates.

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        If there are fewer than two things, or the kind is unknown.

    Examples
    --------
    >>> from sec_lab.worlds.katana import example_scene
    >>> [one.name for one in with_third(example_scene("a"), "blue sphere").things]
    ['red box', 'green box', 'blue sphere']
    """
    if len(scene.things) < 2:
        raise ValueError(f"scene: expected two things at least, got {len(scene.things)}")
    if kind not in get_args(Third):
        raise ValueError(f"third: expected one of {get_args(Third)}, got {kind!r}")
    two = scene.things[:2]
    if kind == "none":
        return replace(scene, things=two)
    made = [_third(kind, float(x), float(y)) for x, y in product(_GRID_X_M, _GRID_Y_M)]
    tried = [replace(scene, things=(*two, one)) for one in made]
    # Out of the way of the push, if there is such a place.
    return max([one for one in tried if roomy(one)] or tried, key=_free_m)


def third_of(scene: Scene) -> Third:
    """What third thing a scene has, as :func:`with_third` calls it.

    Parameters
    ----------
    scene : Scene
    """
    if len(scene.things) < 3:
        return "none"
    return "another red box" if scene.things[2].colour == RED else "blue sphere"


def seen_from(scene: Scene, *, azimuth_deg: float, elevation_deg: float) -> Scene:
    """A scene before another camera, which looks at the workplace; see :func:`~.cameras.camera_at`.

    Parameters
    ----------
    scene : Scene
    azimuth_deg, elevation_deg : float

    Returns
    -------
    Scene
        Where the camera would see the tip at rest, it starts and ends where the examples do.
    """
    camera = camera_at(azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    start, home = (
        own if unseen(camera, own) else usual for own, usual in ((scene.start_m, START_M), (scene.home_m, HOME_M))
    )
    return replace(scene, camera=camera, start_m=start, home_m=home)


def angles_of(camera: Camera) -> tuple[float, float]:
    """Azimuth and elevation of a camera in degrees, as :func:`~.cameras.camera_at` takes them.

    Parameters
    ----------
    camera : Camera

    Examples
    --------
    >>> [round(angle, 6) for angle in angles_of(camera_at(azimuth_deg=-20, elevation_deg=45))]
    [-20.0, 45.0]
    """
    x, y, z = -camera.X_WC[:3, 2]
    return float(np.rad2deg(np.arctan2(y, x))), float(np.rad2deg(np.arcsin(np.clip(z, -1, 1))))


def check_apart(scene: Scene) -> None:
    """Nothing if no thing stands inside another; contact physics would throw them apart.

    Things that may just touch are left to the arm, which sees them.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    ValueError
        It names the two.
    """
    for place, one in enumerate(scene.things):
        for other in scene.things[place + 1 :]:
            if _apart_m(one, other) < (min(one.size_m[:2]) + min(other.size_m[:2])) / 2 - 0.002:
                raise ValueError(f"scene: expected things apart, got {one.name!r} and {other.name!r} inside each other")


def thing_at(scene: Scene, x_m: float, y_m: float) -> int | None:
    """Number of the thing that covers a place of the table, about; None if there is none.

    Parameters
    ----------
    scene : Scene
    x_m, y_m : float
    """
    away = [float(np.hypot(one.p_W_m[0] - x_m, one.p_W_m[1] - y_m)) - reach_of(one) for one in scene.things]
    nearest = int(np.argmin(away)) if away else 0
    return nearest if away and away[nearest] <= 0 else None


def table_place(camera: Camera, column: float, row: float) -> tuple[float, float]:
    """Where on the table a pixel of a camera looks.

    Parameters
    ----------
    camera : Camera
    column, row : float
        Whole numbers are middles of pixels.

    Returns
    -------
    tuple of float
        In metres.

    Raises
    ------
    ValueError
        If it looks above the horizon.

    Examples
    --------
    >>> from sec_lab.worlds.katana.cameras import project
    >>> camera = camera_at(azimuth_deg=20)
    >>> pixel, _ = project(camera, (0.3, -0.1, 0.0))
    >>> [round(value, 6) for value in table_place(camera, *pixel)]
    [0.3, -0.1]
    """
    middle = (camera.width - 1) / 2, (camera.height - 1) / 2
    ray = camera.X_WC[:3, :3] @ [(column - middle[0]) / camera.focal_px, (row - middle[1]) / camera.focal_px, 1.0]
    eye = camera.X_WC[:3, 3]
    if ray[2] >= 0:
        raise ValueError(f"pixel: expected one below the horizon, got column {column}, row {row}")
    x, y = eye[:2] - eye[2] / ray[2] * ray[:2]
    return float(x), float(y)


def _third(kind: Third, x_m: float, y_m: float) -> Thing:
    if kind == "blue sphere":
        return thing(kind, "sphere", BLUE, x_m, y_m, (0.05, 0.05, 0.05))
    return thing(kind, "box", RED, x_m, y_m, (0.06, 0.06, 0.06))


def _apart_m(one: Thing, other: Thing) -> float:
    return float(np.hypot(one.p_W_m[0] - other.p_W_m[0], one.p_W_m[1] - other.p_W_m[1]))


def _free_m(scene: Scene) -> float:
    *others, last = scene.things
    return min(_apart_m(last, other) - reach_of(other) for other in others)
