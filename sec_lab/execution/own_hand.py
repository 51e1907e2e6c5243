"""The arm's own hand: where its surface is, from its joints and its description (an arm knows its own hand)."""

from functools import lru_cache
from importlib.resources import files
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from sec_lab.worlds.katana.kinematics import hand_axes, tip_position
from sec_lab.worlds.katana.records import Floats

_SPACING_M = 0.005


def hand_points(joints_rad: ArrayLike) -> Floats:
    """Points on the surface of both fingers and of what carries them, in the world.

    Parameters
    ----------
    joints_rad : (7,) array_like of float
        Of the arm's own sensors, the two fingers last.

    Returns
    -------
    (n, 3) float64
        Metres, some millimetres from each other.

    Examples
    --------
    >>> points = hand_points([0, 0, 0, 0, 0, -0.24, -0.24])
    >>> bool(np.ptp(points[:, 1]) < np.ptp(hand_points([0, 0, 0, 0, 0, 0.28, 0.28])[:, 1]))
    True
    """
    joints = np.asarray(joints_rad, dtype=np.float64)
    along, opens = hand_axes(joints[:5])
    axes = np.stack([along, opens, np.cross(along, opens)])
    finger, palm, hinge = _parts()
    tip = tip_position(joints[:5])
    placed = [palm @ axes]
    for angle, side in zip(joints[5:], (1.0, -1.0), strict=True):
        cosine, sine = np.cos(angle), np.sin(angle)
        turned = finger @ np.array([(cosine, sine, 0.0), (-sine, cosine, 0.0), (0.0, 0.0, 1.0)])
        # The left finger is the right one, turned over about the axis of the hand.
        placed.append((turned * np.array([1.0, side, side]) + np.array([hinge, 0.0, 0.0])) @ axes)
    return np.asarray(tip + np.concatenate(placed))


@lru_cache(maxsize=1)
def _parts() -> tuple[Floats, Floats, float]:
    """Points on a finger about its hinge, and on the palm from the tip, (n, 3); where the hinge is along the hand."""
    robot = ElementTree.fromstring(files("sec_lab.worlds.katana").joinpath("katana.urdf").read_text(encoding="utf-8"))
    link = next(one for one in robot.iter("link") if one.get("name") == "r_finger")
    points = []
    for shape in link.iter("visual"):
        origin, box = shape.find("origin"), shape.find("geometry/box")
        assert origin is not None
        assert box is not None
        turn = _numbers(origin.get("rpy", "0 0 0"))[2]
        cosine, sine = np.cos(turn), np.sin(turn)
        about = np.array([(cosine, sine, 0.0), (-sine, cosine, 0.0), (0.0, 0.0, 1.0)])
        points.append(_surface(_numbers(box.get("size", ""))) @ about + _numbers(origin.get("xyz", "0 0 0")))
    joints = {str(one.get("name")): one.find("origin") for one in robot.findall("joint")}
    origins = {}
    for name in ("gripper", "r_finger"):
        origin = joints[name]
        assert origin is not None
        origins[name] = _numbers(origin.get("xyz", "0 0 0"))
    tool = _numbers(str(next(robot.iter("frame")).get("xyz")))
    # Of the gripper, from the tip: both are turned from the roll axis alike.
    begins = float(tool[2] - origins["gripper"][2])
    gripper = next(one for one in robot.iter("link") if one.get("name") == "gripper")
    cylinder, middle = gripper.find("visual/geometry/cylinder"), gripper.find("visual/origin")
    assert cylinder is not None
    assert middle is not None
    palm = _round(float(cylinder.get("radius", "")), float(cylinder.get("length", "")))
    palm = palm + np.array([begins, 0.0, 0.0]) + _numbers(middle.get("xyz", "0 0 0"))
    return np.concatenate(points), palm, begins + float(origins["r_finger"][0])


def _surface(size: Floats) -> Floats:
    grids = [np.linspace(-half, half, max(2, 1 + round(2 * half / _SPACING_M))) for half in size / 2]
    points = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(points[(np.abs(points) >= size / 2 - 1e-9).any(axis=1)])


def _round(radius: float, length: float) -> Floats:
    """Points on a cylinder along the first axis."""
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    along = np.linspace(-length / 2, length / 2, 9)
    mantle = [(x, radius * np.cos(angle), radius * np.sin(angle)) for x in along for angle in angles]
    ends = [
        (x, out * np.cos(angle), out * np.sin(angle))
        for x in along[[0, -1]]
        for out in (0.0, radius / 3, 2 * radius / 3)
        for angle in angles
    ]
    return np.array([*mantle, *ends])


def _numbers(text: str) -> Floats:
    return np.array([float(part) for part in text.split()])
