"""Closed form of the arm: where the tip is, and the joint angles that bring it somewhere (no simulator needed)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.worlds.katana.records import Floats, as_point

SHOULDER_M, UPPER_M, FORE_M, HAND_M = 0.2015, 0.190, 0.139, 0.3028
"""Height of the shoulder; lengths of upper arm, forearm, and from the wrist to the tip."""

JOINTS = ("pan", "lift_2", "lift_3", "lift_4", "roll")
LOWER_RAD = np.array([-3.025528, -0.135228, -2.221804, -2.033309, -2.993240])
UPPER_RAD = np.array([2.891097, 2.168572, 2.054223, 1.876133, 2.870985])
SPEED_RAD_S = np.array([2.208932, 1.190799, 1.190799, 2.208932, 2.208932])

_STRETCH_M = 0.312
"""The hand is as steep as it can be with the wrist so near to the shoulder; fully stretched it is at 0.329."""
_SPARE_RAD = 0.02
_LEAST_HEIGHT_M = 0.018
"""The fingers reach beyond the tip: below this they would meet the table."""
_COLUMN_M = 0.10


class UnreachableError(ValueError):
    """The arm cannot get there; the message says why."""


def tip_position(q_rad: ArrayLike) -> Floats:
    """Where the tip is: r = .190 cos a₂ + .139 cos a₃ + .3028 cos a₄ and z alike, turned by q₁.

    Parameters
    ----------
    q_rad : (..., 5) array_like of float
        Joint angles; a₂ = q₂, a₃ = q₂ + q₃, a₄ = q₂ + q₃ − q₄.

    Returns
    -------
    (..., 3) float64
        Metres, in the world.

    Examples
    --------
    >>> tip_position([0, 0, 0, 0, 0]).round(4).tolist()
    [0.6318, 0.0, 0.2015]
    """
    q = np.asarray(q_rad, dtype=np.float64)
    a2, a3, a4 = q[..., 1], q[..., 1] + q[..., 2], q[..., 1] + q[..., 2] - q[..., 3]
    r = UPPER_M * np.cos(a2) + FORE_M * np.cos(a3) + HAND_M * np.cos(a4)
    z = SHOULDER_M + UPPER_M * np.sin(a2) + FORE_M * np.sin(a3) + HAND_M * np.sin(a4)
    return np.stack([r * np.cos(q[..., 0]), r * np.sin(q[..., 0]), z], axis=-1)


def hand_axes(q_rad: ArrayLike) -> tuple[Floats, Floats]:
    """Unit vectors along which the hand points, and along which its fingers open.

    Parameters
    ----------
    q_rad : (..., 5) array_like of float

    Returns
    -------
    tuple of (..., 3) float64

    Examples
    --------
    >>> [axis.round(3).tolist() for axis in hand_axes([0, 0, 0, 0, 0])]
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    q = np.asarray(q_rad, dtype=np.float64)
    pitch = q[..., 1] + q[..., 2] - q[..., 3]
    along, side, across = _axes(q[..., 0], pitch)
    roll = q[..., 4, None]
    return along, np.cos(roll) * side + np.sin(roll) * across


def joint_angles(p_WT_m: ArrayLike, *, pitch_rad: ArrayLike | None = None, roll_rad: ArrayLike = 0.0) -> Floats:
    """Joint angles that bring the tip to points, elbow up: planar two-link arm once the pitch of the hand is chosen.

    Parameters
    ----------
    p_WT_m : (..., 3) array_like of float
        In the world.
    pitch_rad : (...) array_like of float, optional
        Of the hand; −π/2 points down. The steepest possible if left out.
    roll_rad : (...) array_like of float, optional
        Of the wrist.

    Returns
    -------
    (..., 5) float64

    Raises
    ------
    UnreachableError
        If a point is too far, too near, too low, or asks too much of a joint.

    Examples
    --------
    >>> tip_position(joint_angles([0.3, 0.1, 0.03])).round(6).tolist()
    [0.3, 0.1, 0.03]
    >>> joint_angles([0.9, 0, 0.1])
    Traceback (most recent call last):
    ...
    sec_lab.worlds.katana.kinematics.UnreachableError: (0.900, 0.000, 0.100) m: 0.906 m from the shoulder, the arm \
reaches 0.615 m
    """
    p = np.asarray(p_WT_m, dtype=np.float64)
    if p.shape[-1:] != (3,) or not np.isfinite(p).all():
        raise ValueError(f"p_WT_m: expected finite points of shape (..., 3), got {p.shape}")
    r = np.hypot(p[..., 0], p[..., 1])
    _refuse(
        p, p[..., 2] < _LEAST_HEIGHT_M, lambda _: f"the fingers would meet the table, expected z ≥ {_LEAST_HEIGHT_M} m"
    )
    _refuse(p, r < _COLUMN_M, lambda at: f"{r[at]:.3f} m from the arm's own column, expected at least {_COLUMN_M} m")
    distance = np.hypot(r, p[..., 2] - SHOULDER_M)
    most = _STRETCH_M + HAND_M
    _refuse(p, distance > most, lambda at: f"{distance[at]:.3f} m from the shoulder, the arm reaches {most:.3f} m")
    pitch = steepest_pitch(p) if pitch_rad is None else np.broadcast_to(np.asarray(pitch_rad, np.float64), r.shape)
    wrist_r, wrist_z = r - HAND_M * np.cos(pitch), p[..., 2] - SHOULDER_M - HAND_M * np.sin(pitch)
    squared = wrist_r**2 + wrist_z**2
    cosine = (squared - UPPER_M**2 - FORE_M**2) / (2 * UPPER_M * FORE_M)
    _refuse(
        p,
        np.abs(cosine) > 1,
        lambda at: (
            f"with the hand at {np.rad2deg(pitch[at]):.0f}° the wrist would have to be {np.sqrt(squared[at]):.3f} m "
            f"from the shoulder, expected {UPPER_M - FORE_M:.3f} to {UPPER_M + FORE_M:.3f} m"
        ),
    )
    q3 = -np.arccos(np.clip(cosine, -1, 1))
    q2 = np.arctan2(wrist_z, wrist_r) - np.arctan2(FORE_M * np.sin(q3), UPPER_M + FORE_M * np.cos(q3))
    # The arm points along +x; behind the seam at −x the pan joint has a gap of its own.
    q = np.stack(
        [np.arctan2(p[..., 1], p[..., 0]), q2, q3, q2 + q3 - pitch, np.broadcast_to(roll_rad, r.shape)], axis=-1
    )
    for joint, name in enumerate(JOINTS):
        low, high = LOWER_RAD[joint], UPPER_RAD[joint]
        _refuse(
            p,
            (q[..., joint] < low) | (q[..., joint] > high),
            lambda at, joint=joint, name=name, low=low, high=high: (
                f"joint {name} would have to turn to "  # type: ignore[misc]
                f"{q[at][joint]:.3f} rad, expected {low:.3f} to {high:.3f}"
            ),
        )
    return q


def steepest_pitch(p_WT_m: ArrayLike) -> Floats:
    """Pitch of the hand, as near to straight down as the reach of the wrist and joint 4 allow.

    Parameters
    ----------
    p_WT_m : (..., 3) array_like of float
        Not farther than the arm reaches.

    Returns
    -------
    (...) float64
        Radians.

    Examples
    --------
    >>> np.rad2deg(steepest_pitch([[0.2, 0, 0.03], [0.4, 0, 0.03]])).round().tolist()
    [-90.0, -69.0]
    """
    p = np.asarray(p_WT_m, dtype=np.float64)
    r, z = np.hypot(p[..., 0], p[..., 1]), p[..., 2] - SHOULDER_M
    grid = np.deg2rad(np.arange(-90.0, 31.0, 2.0))
    fine = _comfortable(r[..., None], z[..., None], grid)
    first = fine.argmax(axis=-1)
    low, high = grid[np.maximum(first - 1, 0)], grid[first]
    for _ in range(40):
        middle = (low + high) / 2
        good = _comfortable(r, z, middle)
        low, high = np.where(good, low, middle), np.where(good, middle, high)
    found: Floats = np.where(fine.any(axis=-1), high, np.arctan2(z, r))
    return found


def _comfortable(r: Floats, z: Floats, pitch: Floats) -> NDArray[np.bool_]:
    """Whether the wrist is near enough to the shoulder, and far enough, and joint 4 within its limits."""
    wrist_r, wrist_z = r - HAND_M * np.cos(pitch), z - HAND_M * np.sin(pitch)
    squared = wrist_r**2 + wrist_z**2
    cosine = (squared - UPPER_M**2 - FORE_M**2) / (2 * UPPER_M * FORE_M)
    q3 = -np.arccos(np.clip(cosine, -1, 1))
    q2 = np.arctan2(wrist_z, wrist_r) - np.arctan2(FORE_M * np.sin(q3), UPPER_M + FORE_M * np.cos(q3))
    fine: NDArray[np.bool_] = (squared <= _STRETCH_M**2) & (q3 >= LOWER_RAD[2])
    fine &= q2 + q3 - pitch <= UPPER_RAD[3] - _SPARE_RAD
    return fine


def roll_for_facing(p_WT_m: ArrayLike, facing_rad: ArrayLike) -> Floats:
    """Angle of the wrist at which the flat sides of the fingers face a direction in the plane; π more does as well.

    Parameters
    ----------
    p_WT_m : (..., 3) array_like of float
        Of the tip, its hand at :func:`steepest_pitch`.
    facing_rad : (...) array_like of float
        0 along x of the world.

    Returns
    -------
    (...) float64
        Within ± π/2.

    Examples
    --------
    >>> float(roll_for_facing([0.2, 0, 0.03], 0.0))
    0.0
    """
    p = np.asarray(p_WT_m, dtype=np.float64)
    along, side, across = _axes(np.arctan2(p[..., 1], p[..., 0]), steepest_pitch(p))
    facing = np.asarray(facing_rad, dtype=np.float64)
    forward = np.stack([np.cos(facing), np.sin(facing), np.zeros_like(facing)], axis=-1)
    opening = np.cross(along, forward)
    roll = np.arctan2((opening * across).sum(-1), (opening * side).sum(-1))
    folded: Floats = (roll + np.pi / 2) % np.pi - np.pi / 2
    return folded


def check_reachable(p_WT_m: ArrayLike) -> None:
    """Nothing, or :class:`UnreachableError` with the reason.

    Parameters
    ----------
    p_WT_m : (3,) array_like of float
    """
    joint_angles(as_point(p_WT_m, what="p_WT_m"))


def _axes(pan: Floats, pitch: Floats) -> tuple[Floats, Floats, Floats]:
    """Where the hand points, the axis of the lifting joints, and what is across to both."""
    along = np.stack([np.cos(pitch) * np.cos(pan), np.cos(pitch) * np.sin(pan), np.sin(pitch)], axis=-1)
    side = np.stack([-np.sin(pan), np.cos(pan), np.zeros_like(pan)], axis=-1)
    return along, side, np.cross(side, along)


def _refuse(points: Floats, wrong: NDArray[np.bool_], why: Callable[[tuple[int, ...]], str]) -> None:
    if np.any(wrong):
        at = tuple(np.argwhere(wrong)[0])
        where = ", ".join(f"{value:.3f}" for value in points[at])
        raise UnreachableError(f"({where}) m: {why(at)}")
