"""Relative poses (§2.11): of the hand and what it holds, and of two objects, as the demonstrations have them.

A pose is a constraint only if the demonstrations agree in it; and it is told in that frame in which they agree best.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from sec_lab.execution.anchors import Points, border_distance, connection_vector, in_frame
from sec_lab.execution.perception import SeenThing
from sec_lab.worlds.katana.kinematics import hand_axes
from sec_lab.worlds.katana.paths import FINGER_RAD
from sec_lab.worlds.katana.records import Floats, Gripper

Frame = Literal["connection", "object"]
Level = Literal["table", "middle", "top"]

QUARTER_RAD, HALF_RAD = np.pi / 2, np.pi

_AGREED = 0.9
"""Least length of the mean of unit vectors for angles to be a constraint: five at random reach it in 2 of 100 cases."""
_CLOSING_RAD = 0.05
_SETTLED_RAD = 0.02
_ROUND = 0.88
"""Share of the smallest rectangle that a footprint fills, below which it has no direction; a disc fills π/4."""


@dataclass(frozen=True, eq=False)
class Hand:
    """Relative pose between prime mover and first object as the one gets hold of the other (instruction 4).

    Parameters
    ----------
    closes : bool, optional
        Whether the fingers close on the first object, which is carried from then on; they push it otherwise.
    before, after : {"open", "ajar", "closed"}, optional
        What the gripper is as it comes and as it leaves; as it is at the start if left out.
    frame : {"connection", "object"}, optional
        Whether the direction of the fingers is told from the connection vector or from the sides of the object.
    facing_rad : float, optional
        Direction that the flat sides of the fingers face, in that frame.
    level : {"table", "middle", "top"}, optional
        From where the height of the tip is told.
    height_m : float, optional
    """

    closes: bool = False
    before: Gripper | None = None
    after: Gripper | None = None
    frame: Frame = "connection"
    facing_rad: float = 0.0
    level: Level = "middle"
    height_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Placed:
    """Relative pose between two objects after the one has been put to the other (instruction 7).

    Parameters
    ----------
    on : bool
        Whether the second object carries the first, which has left the ground for good.
    offset_m : Points
        Middle of the first from that of the second, the x axis along the connection vector, z above what carries it.
    frame : {"connection", "object"}
        Whether the bearing of the first from the second object is told from the way back along the connection vector,
        or from the nearest side of the second.
    bearing_rad, gap_m : float
        In that frame, and between the borders along it.
    turn_rad : float or None
        Of the first from the second, up to quarters; None if the demonstrations do not agree.
    facing_rad : float or None
        Of the hand from the bearing, up to halves, as it lets go; None if they do not agree.
    aside_m : float
        How far out it is set down before it is brought to the second.
    let_go_m : float
        How much higher the tip is as it lets go than it was over the ground as it took hold.
    """

    on: bool
    offset_m: Points
    frame: Frame
    bearing_rad: float
    gap_m: float
    turn_rad: float | None
    facing_rad: float | None
    aside_m: float
    let_go_m: float


@dataclass(frozen=True, eq=False)
class Handling:
    """What one demonstration shows of hand and objects.

    Parameters
    ----------
    first, second : SeenThing
        Before anything is touched.
    first_end : SeenThing
        After the arm has gone. The second object is taken to stand where it stood: what is put on it hides it.
    opening_rad : tuple of float
        Of the fingers as they come, hold, and leave; from the joints' own sensors.
    tip_m : (3,) float64
        As the fingers have closed, or as they touch if they do not close.
    facing_rad : float
        Of the flat sides of the fingers, at the same moment.
    let_go_tip_m, let_go_facing_rad
        As the fingers open, or the arm leaves.
    set_down_tip_m : (3,) float64 or None
        As the first object touches the ground again, if it does.
    """

    first: SeenThing
    second: SeenThing
    first_end: SeenThing
    opening_rad: tuple[float, float, float]
    tip_m: Floats
    facing_rad: float
    let_go_tip_m: Floats
    let_go_facing_rad: float
    set_down_tip_m: Floats | None

    @property
    def closes(self) -> bool:
        """Whether the fingers closed on the first object."""
        return self.opening_rad[1] < self.opening_rad[0] - _CLOSING_RAD


def handling(
    joints_rad: Floats,
    tip_m: Floats,
    seen: tuple[SeenThing, SeenThing, SeenThing],
    *,
    touches: int,
    contact: int,
    leaves: int,
    set_down: int | None,
) -> Handling:
    """Read one demonstration at its key frames.

    Parameters
    ----------
    joints_rad : (n, 7) float64
        From the arm's own sensors.
    tip_m : (n, 3) float64
    seen : tuple of 3 SeenThing
        First and second object before, and the first in the end.
    touches, contact, leaves : int
        Key frames at which prime mover and first, first and second object touch, and prime mover and first part.
    set_down : int or None
        Key frame at which the first object touches the ground again.
    """
    opening = joints_rad[:, 5:7].mean(axis=1)
    held = float(opening[contact])
    leaving = float(opening[contact : leaves + 10].max())
    took = touches
    if held < opening[max(touches - 1, 0)] - _CLOSING_RAD:
        took = touches + int((opening[touches:] <= held + _SETTLED_RAD).argmax())
    let_go = contact + int(np.flatnonzero(opening[contact : leaves + 1] <= held + _SETTLED_RAD)[-1])
    return Handling(
        *seen,
        (float(opening[max(touches - 1, 0)]), held, leaving),
        tip_m[took],
        facing_of(joints_rad[took]),
        tip_m[let_go],
        facing_of(joints_rad[let_go]),
        None if set_down is None else tip_m[set_down],
    )


def agreed_hand(shown: Sequence[Handling]) -> Hand:
    """What the demonstrations agree in of the hand at the first object.

    Parameters
    ----------
    shown : sequence of Handling

    Raises
    ------
    ValueError
        If the fingers close in some of them only.
    """
    closing = [one.closes for one in shown]
    if any(closing) and not all(closing):
        raise ValueError(f"demonstrations: expected fingers that close in all of them or in none, got {closing}")
    facings: dict[Frame, tuple[float, float]] = {
        "connection": agreed_angle([one.facing_rad - _heading(one.first, one.second) for one in shown], HALF_RAD),
        "object": agreed_angle([_from_side(one.facing_rad, one.first) for one in shown], QUARTER_RAD),
    }
    frame = max(facings, key=lambda name: facings[name][1])
    level, height = _level(shown)
    if not closing[0]:
        return Hand(frame=frame, facing_rad=facings[frame][0])
    before, _, after = (
        _state(float(np.median(values))) for values in zip(*(o.opening_rad for o in shown), strict=True)
    )
    return Hand(
        closes=True, before=before, after=after, frame=frame, facing_rad=facings[frame][0], level=level, height_m=height
    )


def agreed_placing(shown: Sequence[Handling], *, on: bool) -> Placed:
    """What the demonstrations agree in of the two objects in the end.

    Parameters
    ----------
    shown : sequence of Handling
    on : bool
        Whether the second object carries the first, by the model.
    """
    ways = [one.first_end.centre_m[:2] - one.second.centre_m[:2] for one in shown]
    bearings = [float(np.arctan2(way[1], way[0])) for way in ways]
    back = [_heading(one.first, one.second) + np.pi for one in shown]
    frames: dict[Frame, tuple[float, float]] = {
        "connection": agreed_angle(np.subtract(bearings, back), 2 * np.pi),
        "object": agreed_angle(
            [_from_side(b, one.second) for b, one in zip(bearings, shown, strict=True)], QUARTER_RAD
        ),
    }
    frame = max(frames, key=lambda name: frames[name][1])
    turns = [turn_of(one.first_end.footprint_m) for one in shown]
    turn = agreed_angle(
        [np.nan if t is None else _from_side(t, one.second) for t, one in zip(turns, shown, strict=True)], QUARTER_RAD
    )
    facing = agreed_angle([one.let_go_facing_rad - b for one, b in zip(shown, bearings, strict=True)], HALF_RAD)
    offsets = []
    for one in shown:
        carried_by = one.second.top_m if on else 0.0
        middle = np.array([*one.second.centre_m[:2], carried_by])
        base = np.array([*one.first_end.centre_m[:2], one.first_end.top_m - one.first.top_m])
        offsets.append(in_frame(base, middle, connection_vector(one.first, one.second)))
    points = np.array(offsets)
    return Placed(
        on,
        Points(points, points.mean(axis=0), float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))),
        frame,
        frames[frame][0],
        float(np.median([_gap(one, way) for one, way in zip(shown, ways, strict=True)])),
        turn[0] if turn[1] >= _AGREED else None,
        facing[0] if facing[1] >= _AGREED and not on else None,
        float(np.median([np.linalg.norm((_set_down(one) - one.let_go_tip_m)[:2]) for one in shown])),
        float(np.median([one.let_go_tip_m[2] - one.tip_m[2] - (one.second.top_m if on else 0) for one in shown])),
    )


def turn_of(footprint_m: ArrayLike) -> float | None:
    """Turn of the smallest rectangle about a footprint, up to quarters; None if it is round.

    Parameters
    ----------
    footprint_m : (k, 2) array_like of float
        Corners of a convex outline.

    Examples
    --------
    >>> turn_of([(0, 0), (2, 0), (2, 1), (0, 1)])
    0.0
    >>> turn_of([(1, 0), (2, 1), (1, 2), (0, 1)]) == np.pi / 4
    True
    """
    corners = np.asarray(footprint_m, dtype=np.float64)
    edges = np.roll(corners, -1, axis=0) - corners
    turns = np.arctan2(edges[:, 1], edges[:, 0]) % QUARTER_RAD
    x = corners @ np.stack([np.cos(turns), np.sin(turns)])
    y = corners @ np.stack([-np.sin(turns), np.cos(turns)])
    rectangles = np.ptp(x, axis=0) * np.ptp(y, axis=0)
    area = (
        abs(float((corners[:, 0] * np.roll(corners[:, 1], -1) - corners[:, 1] * np.roll(corners[:, 0], -1)).sum())) / 2
    )
    if area < _ROUND * rectangles.min():
        return None
    return float(turns[rectangles.argmin()])


def agreed_angle(angles_rad: ArrayLike, period_rad: float) -> tuple[float, float]:
    """Mean of angles that are told up to a period, and how far they agree.

    A mean that is no farther from zero than it is uncertain (twice its standard error) is zero.

    Parameters
    ----------
    angles_rad : (n,) array_like of float
        Those that are not known are NaN.
    period_rad : float

    Returns
    -------
    mean_rad : float
        From minus to plus half a period.
    agreement : float
        Length of the mean of unit vectors, 0 to 1; 0 if less than half of the angles are known.

    Examples
    --------
    >>> agreed_angle([0.1, 0.1 + np.pi / 2], np.pi / 2)
    (0.1, 1.0)
    """
    angles = np.asarray(angles_rad, dtype=np.float64)
    known = angles[np.isfinite(angles)]
    if len(known) == 0 or 2 * len(known) < len(angles):
        return 0.0, 0.0
    share = 2 * np.pi / period_rad
    mean_vector = np.exp(1j * share * known).mean()
    agreement = min(float(abs(mean_vector)), 1.0)
    mean = float(np.angle(mean_vector)) / share
    rest = (known - mean + period_rad / 2) % period_rad - period_rad / 2
    uncertain = 2 * float(np.sqrt((rest**2).mean() / len(known)))
    return (0.0 if abs(mean) <= uncertain else round(mean, 12)), agreement


def facing_of(joints_rad: Floats) -> float:
    """Direction in the plane that the flat sides of the fingers face, for (7,) joint angles."""
    along, opening = hand_axes(joints_rad[:5])
    facing = np.cross(opening, along)
    return float(np.arctan2(facing[1], facing[0]))


def _from_side(direction_rad: float, thing: SeenThing) -> float:
    turn = turn_of(thing.footprint_m)
    return np.nan if turn is None else direction_rad - turn


def _heading(first: SeenThing, second: SeenThing) -> float:
    vector = connection_vector(first, second)
    return float(np.arctan2(vector[1], vector[0]))


def _level(shown: Sequence[Handling]) -> tuple[Level, float]:
    heights: dict[Level, Floats] = {
        "top": np.array([one.tip_m[2] - one.first.top_m for one in shown]),
        "middle": np.array([one.tip_m[2] - one.first.top_m / 2 for one in shown]),
        "table": np.array([one.tip_m[2] for one in shown]),
    }
    level = min(heights, key=lambda name: float(heights[name].std()))
    return level, float(np.median(heights[level]))


def _state(opening_rad: float) -> Gripper:
    return min(FINGER_RAD, key=lambda state: abs(FINGER_RAD[state] - opening_rad))


def _gap(one: Handling, way: Floats) -> float:
    length = float(np.linalg.norm(way))
    if length < 1e-6:
        return 0.0
    first, second = one.first_end, one.second
    return length - sum(
        border_distance(thing.footprint_m, thing.centre_m[:2], sign * way / length)
        for thing, sign in ((second, 1), (first, -1))
    )


def _set_down(one: Handling) -> Floats:
    return one.let_go_tip_m if one.set_down_tip_m is None else one.set_down_tip_m
