"""Demonstrations of pick-and-place (§2.11): the arm grasps a red box and puts it on a green one, or beside it."""

from typing import Literal, get_args

import numpy as np

from sec_lab.worlds.katana.bench import STEP_S
from sec_lab.worlds.katana.cameras import camera_at
from sec_lab.worlds.katana.demonstrations import Demonstration
from sec_lab.worlds.katana.kinematics import UnreachableError, joint_angles, roll_for_facing
from sec_lab.worlds.katana.paths import FINGER_RAD, LOW_M, path_of
from sec_lab.worlds.katana.records import Floats, Move, Point, Scene
from sec_lab.worlds.katana.run import Run
from sec_lab.worlds.katana.scenes import BLUE, GREEN, RED, random_rest, reach_of, roomy, seen_whole, thing, unseen

Placing = Literal["on", "beside"]

N_PLACING = 5
PLACING_SEED = 2013

_TARGET_M = (0.22, 0.0, 0.03)
_RADIUS_M = {"on": (0.16, 0.25), "beside": (0.16, 0.26)}
_SIDES_M = {
    # Red and green: side and height. What is put beside is the taller one, so that the hand stays above the other.
    "on": (((0.045, 0.06), None), ((0.055, 0.075), None)),
    "beside": (((0.045, 0.058), (0.068, 0.078)), ((0.055, 0.08), (0.021, 0.025))),
}
_BELOW_TOP_M = 0.015
"""How far below its top a box is gripped."""
_OVER_M, _CLEAR_M, _ASIDE_M = 0.05, 0.035, 0.035
_LET_FALL_M = 0.002
_FREE_M_S, _DOWN_M_S, _CARRY_M_S, _PUT_M_S = 0.30, 0.12, 0.15, 0.05


def placing_demonstration(placing: Placing, seed: int, number: int, *, labels: bool = False) -> Demonstration:
    """A demonstration of pick-and-place.

    Parameters
    ----------
    placing : {"on", "beside"}
        Where the red box is put, from the green one.
    seed, number : int
    labels : bool, optional
        Whether the truth has label pictures.
    """
    scene = placing_scene(placing, seed, number=number)
    run = Run(scene, labels=labels)
    run.rest(0.5)
    for move in placing_program(placing, scene):
        run.move(move)
    run.rest(0.5)
    return Demonstration(run.recording, scene, run.truth, tuple(run.move_ends))


def placing_scene(placing: Placing, seed: int, *, number: int = 0, more: bool = False) -> Scene:
    """A red and a green box for pick-and-place, turned anyhow, with a camera, a start and a home of their own.

    Parameters
    ----------
    placing : {"on", "beside"}
    seed, number : int
        Of the collection, and in it.
    more : bool, optional
        Whether a blue sphere may stand there, too; demonstrations have none.

    Raises
    ------
    ValueError
        If it is another placing.

    Examples
    --------
    >>> [thing.name for thing in placing_scene("on", 1).things]
    ['red box', 'green box']
    """
    if placing not in get_args(Placing):
        raise ValueError(f"placing: expected one of {get_args(Placing)}, got {placing!r}")
    rng = np.random.default_rng([seed, number, 2 + get_args(Placing).index(placing)])
    while True:
        things = []
        for name, colour, (sides, heights) in zip(
            ("red box", "green box"), (RED, GREEN), _SIDES_M[placing], strict=True
        ):
            side = float(rng.uniform(*sides))
            height = side if heights is None else float(rng.uniform(*heights))
            x, y = _place(rng, placing)
            things.append(thing(name, "box", colour, x, y, (side, side, height), float(rng.uniform(-0.78, 0.78))))
        if more and rng.random() < 0.3:
            things.append(thing("blue sphere", "sphere", BLUE, *_place(rng, placing), (0.04, 0.04, 0.04)))
        camera = camera_at(
            azimuth_deg=float(rng.uniform(-50, 50)),
            elevation_deg=float(rng.uniform(42, 60)),
            distance_m=float(rng.uniform(0.58, 0.66)),
            target_m=_TARGET_M,
        )
        scene = Scene(tuple(things), camera, random_rest(rng), random_rest(rng))
        if not (roomy(scene) and seen_whole(scene) and _clear_of_others(scene)):
            continue
        end = placing_pose(placing, scene)[0]
        if not 0.15 < float(np.hypot(end[0], end[1])) < _RADIUS_M[placing][1] or end[0] < 0.06:
            continue
        if unseen(camera, scene.start_m) and unseen(camera, scene.home_m) and _reachable(placing, scene):
            return scene


def placing_pose(placing: Placing, scene: Scene) -> tuple[Point, float]:
    """Where the red box is to end, from the true place of the green one: its middle, and its turn up to quarters.

    On it: middle over middle. Beside it: in the middle of that side which faces where the red box was. The sides are
    aligned.

    Parameters
    ----------
    placing : {"on", "beside"}
    scene : Scene
    """
    red, green = scene.thing("red box"), scene.thing("green box")
    half = red.size_m[2] / 2
    if placing == "on":
        return (green.p_W_m[0], green.p_W_m[1], green.size_m[2] + half), green.yaw_rad
    outwards = _side_towards(scene)
    apart = (red.size_m[0] + green.size_m[0]) / 2
    x, y = np.array(green.p_W_m[:2]) + apart * np.array([np.cos(outwards), np.sin(outwards)])
    return (float(x), float(y), half), green.yaw_rad


def placing_program(placing: Placing, scene: Scene) -> tuple[Move, ...]:
    """The hard-coded pick-and-place of the demonstrations, from true places; the execution uses nothing of it.

    Parameters
    ----------
    placing : {"on", "beside"}
    scene : Scene
    """
    red, green = scene.thing("red box"), scene.thing("green box")
    (end_x, end_y, end_z), end_yaw = placing_pose(placing, scene)
    start, end = np.array(red.p_W_m[:2]), np.array([end_x, end_y])
    # The fingers close on the two sides that ask for the lesser turn of the wrist.
    quarters = red.yaw_rad + np.array([0, np.pi / 2])
    grasp_facing = float(min(quarters, key=lambda facing: abs(roll_for_facing([*start, 0.06], facing))))
    grip = red.size_m[2] - _BELOW_TOP_M
    rise = max(red.size_m[2], green.size_m[2]) + _CLEAR_M
    put = end_z - red.size_m[2] / 2 + grip + _LET_FALL_M
    if placing == "on":
        put_facing = end_yaw + (grasp_facing - red.yaw_rad)
        before = end
    else:
        # The fingers are beside the red box, not between it and the green one.
        put_facing = _side_towards(scene)
        before = end + _ASIDE_M * np.array([np.cos(put_facing), np.sin(put_facing)])
    clear = max(grip + green.size_m[2] + _CLEAR_M, LOW_M)
    moves = [
        Move(_at(start, rise + _OVER_M), "open", "approach", grasp_facing, _FREE_M_S),
        Move(_at(start, grip), None, "down", grasp_facing, _DOWN_M_S),
        Move(_at(start, grip), "closed", "grasp"),
        Move(_at(start, clear), None, "lift", None, _DOWN_M_S),
        Move(_at(before, clear), None, "carry", put_facing, _CARRY_M_S),
        Move(_at(before, put), None, "lower", put_facing, _PUT_M_S),
    ]
    if placing == "beside":
        moves.append(Move(_at(end, put), None, "bring", put_facing, _PUT_M_S))
    return (
        *moves,
        Move(_at(end, put), "open", "release"),
        Move(_at(end, put + _OVER_M), None, "up", None, _DOWN_M_S),
        Move(scene.home_m, None, "home", None, _FREE_M_S),
    )


def _side_towards(scene: Scene) -> float:
    """Direction in the plane from the middle of the green box to its side that faces the red one best."""
    red, green = scene.thing("red box"), scene.thing("green box")
    way = np.subtract(red.p_W_m, green.p_W_m)
    towards = float(np.arctan2(way[1], way[0]))
    quarter = np.pi / 2
    return float(green.yaw_rad + quarter * np.round((towards - green.yaw_rad) / quarter))


def _place(rng: np.random.Generator, placing: Placing) -> tuple[float, float]:
    radius, angle = float(rng.uniform(*_RADIUS_M[placing])), float(rng.uniform(-1.1, 1.1))
    return radius * float(np.cos(angle)), radius * float(np.sin(angle))


def _clear_of_others(scene: Scene) -> bool:
    """Whether what else stands there is out of the way of the hand at both ends."""
    red, green, *others = scene.things
    return all(
        np.hypot(one.p_W_m[0] - other.p_W_m[0], one.p_W_m[1] - other.p_W_m[1]) > 0.13 + reach_of(other)
        for one in (red, green)
        for other in others
    )


def _reachable(placing: Placing, scene: Scene) -> bool:
    """Whether the arm can make all moves of the program."""
    q = np.concatenate([joint_angles(scene.start_m), np.full(2, FINGER_RAD["ajar"])])
    try:
        for move in placing_program(placing, scene):
            q = path_of(q, move, step_s=STEP_S).q_rad[-1]
    except UnreachableError:
        return False
    return True


def _at(point: Floats, height_m: float) -> Point:
    return float(point[0]), float(point[1]), height_m
