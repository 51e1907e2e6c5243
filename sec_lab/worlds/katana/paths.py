"""From a move to joint angles at every step of the simulator; what is out of reach is refused before anything moves."""

from dataclasses import dataclass

import numpy as np

from sec_lab.worlds.katana.kinematics import (
    LOWER_RAD,
    SPEED_RAD_S,
    UPPER_RAD,
    UnreachableError,
    hand_axes,
    joint_angles,
    roll_for_facing,
    tip_position,
)
from sec_lab.worlds.katana.records import Floats, Gripper, Move

FINGER_RAD: dict[Gripper, float] = {"open": 0.28, "ajar": -0.24, "closed": -0.44}
LOW_M = 0.12
"""Below this the tip is among the things, and the fingers keep facing as they do."""

_LEAST_S, _GRIPPER_S = 0.3, 0.8
_PEAK = 1.875
"""Of the speed of a minimum-jerk movement, over its mean."""


@dataclass(frozen=True, eq=False)
class Path:
    """Joint angles over time.

    Parameters
    ----------
    q_rad : (n, 7) float64
        Of the arm's five joints and the two fingers, step by step; the first is one step after the start.
    tip_m : (n, 3) float64
        Where the tip is to be.
    n_motion : int
        Steps until the tip arrives; what follows is the gripper's.
    """

    q_rad: Floats
    tip_m: Floats
    n_motion: int


def path_of(q_rad: Floats, move: Move, *, step_s: float) -> Path:
    """Path of the arm for a move.

    Parameters
    ----------
    q_rad : (7,) float64
        Where its joints are to be now.
    move : Move
    step_s : float
        Time between two sets of angles.

    Raises
    ------
    UnreachableError
        With the reason.
    """
    start, end = tip_position(q_rad[:5]), np.asarray(move.to_m)
    angles = _angles(q_rad, start, end, move, np.linspace(0, 1, 65))
    length = float(np.linalg.norm(np.diff(tip_position(angles), axis=0), axis=1).sum())
    # No joint is faster than it can be at the peak of the movement.
    fastest = (np.abs(np.diff(angles, axis=0)) * 64 / SPEED_RAD_S).max()
    duration = max(length / move.speed_m_s, _PEAK * 1.05 * float(fastest), _LEAST_S if length > 1e-6 else 0.0)
    n = int(np.ceil(duration / step_s))
    t = np.arange(1, n + 1) / max(n, 1)
    share = t**3 * (10 - 15 * t + 6 * t**2)
    q = np.empty((n, 7))
    q[:, :5] = _angles(q_rad, start, end, move, share) if n else q_rad[:5]
    q[:, 5:] = q_rad[5:]
    tip = tip_position(q[:, :5])
    if move.gripper is not None and abs(FINGER_RAD[move.gripper] - q_rad[5]) > 1e-9:
        n_gripper = int(_GRIPPER_S / step_s)
        # The last part is for what the fingers hold to come to rest.
        share = np.clip(np.arange(1, n_gripper + 1) / (0.75 * n_gripper), 0, 1)[:, None]
        last = q[-1] if n else q_rad
        grip = np.repeat(last[None], n_gripper, axis=0)
        grip[:, 5:] = (1 - share) * last[5:] + share * FINGER_RAD[move.gripper]
        q, tip = np.concatenate([q, grip]), np.concatenate([tip, np.repeat(end[None], n_gripper, axis=0)])
    return Path(q, tip, n)


def _angles(q_rad: Floats, start: Floats, end: Floats, move: Move, share: Floats) -> Floats:
    points = start + (end - start) * share[:, None]
    # The start is known by the joints, so that a tip at this very height may lie a rounding error below it.
    if min(start[2], end[2]) >= LOW_M - 1e-6:
        points = _round_the_column(start, end, share)
    q = joint_angles(points)
    now = float(q_rad[4])
    if move.facing_rad is not None:
        q[:, 4] = _roll(q_rad, points, share, move.facing_rad)
    elif max(start[2], end[2]) < LOW_M:
        q[:, 4] = _roll(q_rad, points, share, _facing(q_rad))
    else:
        q[:, 4] = now
    low, high = LOWER_RAD[4], UPPER_RAD[4]
    if q[:, 4].min() < low or q[:, 4].max() > high:
        wrong = q[(q[:, 4] < low) | (q[:, 4] > high), 4][0]
        raise UnreachableError(f"joint roll would have to turn to {wrong:.3f} rad, expected {low:.3f} to {high:.3f}")
    return q


def _round_the_column(start: Floats, end: Floats, share: Floats) -> Floats:
    """High up nothing is in the way but the arm itself: distance from its column, height and pan change evenly."""
    radius = np.hypot([start[0], end[0]], [start[1], end[1]])
    pan = np.arctan2([start[1], end[1]], [start[0], end[0]])
    r, angle, z = (a + (b - a) * share for a, b in (radius, pan, (start[2], end[2])))
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1)


def _roll(q_rad: Floats, points: Floats, share: Floats, facing_rad: float) -> Floats:
    """Angles of the wrist from the present one to those at which the fingers face a direction."""
    wanted = np.unwrap(roll_for_facing(points, facing_rad), period=np.pi)
    turned = wanted + np.pi * np.round((q_rad[4] - wanted[0]) / np.pi)
    # Those that start where the wrist is, if they end within its limits; the ones nearest to zero otherwise.
    if np.abs(turned[-1]) > 0.9 * np.pi:
        turned = wanted - np.pi * np.round(wanted[-1] / np.pi)
    turning: Floats = turned + (q_rad[4] - turned[0]) * (1 - share)
    return turning


def _facing(q_rad: Floats) -> float:
    """Direction in the plane that the flat sides of the fingers face."""
    along, opening = hand_axes(q_rad[:5])
    facing = np.cross(opening, along)
    return float(np.arctan2(facing[1], facing[0]))
