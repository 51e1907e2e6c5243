"""Things that stand about and have no part in the action."""

import numpy as np

from sec_lab.worlds.tabletop import objects
from sec_lab.worlds.tabletop.camera import Camera, project
from sec_lab.worlds.tabletop.plan import Actor, pose, still
from sec_lab.worlds.tabletop.reach import Act
from sec_lab.worlds.tabletop.settings import Setting
from sec_lab.worlds.tabletop.shapes import Floats, Shape
from sec_lab.worlds.tabletop.textures import Colour

_COUNTS: dict[Setting, tuple[int, ...]] = {"laboratory": (0, 1, 1, 2), "kitchen": (2, 3, 2, 3)}
_CLEAR_M, _GAP_M = 0.105, 0.005
_LABORATORY: tuple[Colour, ...] = ((232, 206, 60), (60, 110, 200), (200, 60, 110), (240, 240, 240), (40, 40, 46))
_KITCHEN: tuple[Colour, ...] = ((190, 150, 116), (214, 186, 152), (150, 108, 80), (226, 206, 178), (120, 110, 100))


def clutter(
    act: Act, camera: Camera, version: int, setting: Setting, rng: np.random.Generator, *, n_frames: int
) -> list[Actor]:
    """Boxes, bottles and fruit where nothing else goes and the camera sees them.

    Parameters
    ----------
    act : Act
    camera : Camera
    version : int
    setting : {"laboratory", "kitchen"}
    rng : numpy.random.Generator
    n_frames : int

    Returns
    -------
    list of Actor
        Fewer than planned where there is no room, or a thing would touch something.
    """
    colours = _LABORATORY if setting == "laboratory" else _KITCHEN
    taken = np.concatenate([act.path_m[:, :2], *(place[:, :2] for place in act.places_m)])
    kinds = rng.permutation(["box", "bottle", "fruit", "mug"])
    order = rng.permutation(len(colours))
    found: list[Actor] = []
    for number in range(_COUNTS[setting][version - 1]):
        spot = _free_spot(taken, camera, rng)
        if spot is None:
            break
        taken = np.concatenate([taken, spot[None]])
        kind = str(kinds[number % 4])
        colour, second = colours[order[number]], colours[order[(number + 2) % len(colours)]]
        turned = pose((*spot, 0.0), yaw=rng.uniform(0, 6))
        thing = still(f"{kind} aside", _thing(kind, colour, second, rng), turned, n_frames)
        if all(_apart(thing, actor) for actor in (*act.actors, *found) if "hand" not in actor.name):
            found.append(thing)
    return found


def _apart(thing: Actor, actor: Actor) -> bool:
    """Whether the circles round two bodies, seen from above, never come near each other."""
    (middle, radius), (other_middle, other_radius) = (_circle(body.forms[0]) for body in (thing, actor))
    place = (thing.X_WB[0] @ middle)[:2]
    path = (actor.X_WB @ other_middle)[:, :2]
    return bool(np.hypot(*(path - place).T).min() > radius + other_radius + _GAP_M)


def _circle(shape: Shape) -> tuple[Floats, float]:
    low, high = shape.vertices_m.min(axis=0), shape.vertices_m.max(axis=0)
    middle = (low + high) / 2
    return np.append(middle, 1.0), float(np.linalg.norm((shape.vertices_m - middle)[:, :2], axis=1).max())


def _free_spot(taken: Floats, camera: Camera, rng: np.random.Generator) -> Floats | None:
    width, height = camera.size_px
    for _ in range(400):
        spot = rng.uniform((-0.36, -0.26), (0.36, 0.40))
        column, row = project(camera, np.array([[*spot, 0.03]]))[0]
        seen = 0.09 * width < column < 0.91 * width and 0.10 * height < row < 0.92 * height
        if seen and np.hypot(*(taken - spot).T).min() > _CLEAR_M:
            return spot
    return None


def _thing(kind: str, colour: Colour, second: Colour, rng: np.random.Generator) -> Shape:
    size = float(rng.uniform(0.85, 1.15))
    if kind == "box":
        return objects.box((0.09 * size, 0.06 * size, 0.045 * size), colour, second, rng)
    if kind == "bottle":
        return objects.bottle(0.027 * size, 0.11 * size, colour, second, rng)
    if kind == "mug":
        return objects.cup(0.036 * size, 0.075 * size, colour, second, rng)
    return objects.orange(0.032 * size, colour, rng)
