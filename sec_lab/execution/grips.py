"""Where the hand takes hold of a thing and where it brings it: by its side, or in its grip (§2.10.4, §2.11)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sec_lab.execution.anchors import (
    border_distance,
    connection_vector,
    coordinate_origin,
    intersections,
    segment_length,
)
from sec_lab.execution.perception import ARM, SeenThing
from sec_lab.execution.relative_poses import HALF_RAD, QUARTER_RAD, Placed, turn_of
from sec_lab.execution.skill import SceneError, Skill
from sec_lab.worlds.katana.kinematics import UnreachableError, roll_for_facing
from sec_lab.worlds.katana.records import TABLE, Floats

CLEARANCE_M = 0.045
"""Between the tip and what it goes past: half a hand, and what perception may be off."""
OVER_M = 0.12
"""Least height at which the tip passes over things."""

_LEAST_HEIGHT_M = 0.026
"""Lower the fingers, which reach beyond the tip and stand askew, come too near to the table."""
FINGERS_BEYOND_M = 0.012
"""How far the fingers reach beyond the tip (table of facts)."""
_FINGER_M = 0.025
"""How wide they are."""
_WIDEST_M, _SPREAD_M = 0.085, 0.08
"""What goes between the open fingers, and how far out their outer sides are."""
_FACING_OFF_RAD = 0.3


@dataclass(frozen=True, eq=False)
class System:
    """Coordinate system of a scene (instructions 2 and 5).

    Parameters
    ----------
    first, second : SeenThing
    origin_m : (3,) float64
        Centre of the first touched object (D4).
    way : (2,) float64
        Unit vector along the connection vector (D5).
    others : tuple of SeenThing
        What else stands there.
    """

    first: SeenThing
    second: SeenThing
    origin_m: Floats
    way: Floats
    others: tuple[SeenThing, ...] = ()

    @property
    def heading_rad(self) -> float:
        """Direction of the connection vector in the plane."""
        return float(np.arctan2(self.way[1], self.way[0]))


@dataclass(frozen=True, eq=False)
class Grip:
    """Where the tip is, and how it is turned, at both ends of the second segment of what is carried.

    Parameters
    ----------
    take_m, put_m : (3,) float64
    take_facing_rad, put_facing_rad : float
    outwards : (2,) float64
        From the second object to where the first is put; zeros if it is put on it.
    """

    take_m: Floats
    put_m: Floats
    take_facing_rad: float
    put_facing_rad: float
    outwards: Floats


def coordinate_system(first: SeenThing, second: SeenThing, things: Sequence[SeenThing] = ()) -> System:
    """Origin and connection vector (instructions 2 and 5) of a scene.

    Parameters
    ----------
    first, second : SeenThing
    things : sequence of SeenThing, optional
        All that is seen.
    """
    vector = connection_vector(first, second)[:2]
    others = tuple(one for one in things if one.name not in (first.name, second.name, ARM, TABLE))
    return System(first, second, coordinate_origin(first), vector / np.linalg.norm(vector), others)


def grip_of(skill: Skill, system: System) -> Grip:
    """Where and how the fingers take the first object, and where they put it (instructions 4 and 7 in a scene).

    Parameters
    ----------
    skill : Skill
    system : System

    Raises
    ------
    SceneError
        If the object is too wide for the fingers, something is in their way, or they cannot be turned so.
    """
    hand, placed = skill.hand, skill.placed
    assert placed is not None
    first, second = system.first, system.second
    own_turn, second_turn = turn_of(first.footprint_m), turn_of(second.footprint_m)
    along = np.median(skill.touches.points_m, axis=0)
    left = np.array([-system.way[1], system.way[0]])
    take = system.origin_m[:2] + along[0] * system.way + along[1] * left
    base = {"table": 0.0, "middle": first.top_m / 2, "top": first.top_m}[hand.level]
    height = base + hand.height_m
    put_middle, outwards = _put(placed, system, second_turn)
    put_height = height + (second.top_m if placed.on else 0.0) + placed.let_go_m
    if hand.frame == "object" and own_turn is not None:
        takes = [own_turn + hand.facing_rad + quarter * QUARTER_RAD for quarter in range(2)]
    else:
        takes = [system.heading_rad + hand.facing_rad]
    if placed.turn_rad is not None and own_turn is not None and second_turn is not None:
        turns = [second_turn + placed.turn_rad - own_turn + quarter * QUARTER_RAD for quarter in range(4)]
    else:
        turns = list(np.arange(8) * QUARTER_RAD / 2)
    grips, reasons = [], []
    for facing in takes:
        reason = _in_the_way(facing, take, height, system)
        if reason:
            reasons.append(reason)
            continue
        for turn in turns:
            put_facing = facing + turn
            if placed.facing_rad is not None:
                wanted = float(np.arctan2(outwards[1], outwards[0])) + placed.facing_rad
                off = (put_facing - wanted + HALF_RAD / 2) % HALF_RAD - HALF_RAD / 2
                if abs(off) > _FACING_OFF_RAD:
                    continue
            offset = take - system.origin_m[:2]
            turned = np.array(
                [
                    np.cos(turn) * offset[0] - np.sin(turn) * offset[1],
                    np.sin(turn) * offset[0] + np.cos(turn) * offset[1],
                ]
            )
            put = np.array([*(put_middle + turned), put_height])
            grips.append(Grip(np.array([*take, height]), put, facing, put_facing, outwards))
    if not grips:
        raise SceneError(
            f"scene: expected room for the fingers at {first.name!r}, got {reasons[0]}"
            if reasons
            else f"scene: expected a grip that fits both ends of the way of {first.name!r}, got none"
        )
    return min(grips, key=_effort)


def over_m(things: Sequence[SeenThing]) -> float:
    """Height at which the tip passes over things.

    Parameters
    ----------
    things : sequence of SeenThing
    """
    return max(OVER_M, *(thing.top_m + 0.05 for thing in things))


def pushing_touch(skill: Skill, system: System) -> tuple[Floats, Floats, float]:
    """Where the tip touches what it pushes, the way out from there, and the height.

    Parameters
    ----------
    skill : Skill
    system : System

    Returns
    -------
    touch_m, outwards : (2,) float64
    height_m : float
    """
    # The tip stands off the border where the demonstrations touched: seen from the origin, on this side of it.
    side = system.heading_rad + skill.side_rad
    outwards = np.array([np.cos(side), np.sin(side)])
    centre, height = system.first.centre_m[:2], _push_height(skill, system)
    border = border_distance(_border(system.first, height), centre, outwards)
    return centre + (border + skill.standoff_m) * outwards, outwards, height


def pushed_to(skill: Skill, system: System) -> Floats:
    """Where the tip is after a push: Δ and what the tip takes itself along the connection vector (D6, D7).

    Parameters
    ----------
    skill : Skill
    system : System

    Returns
    -------
    (2,) float64
    """
    centre, border = system.first.centre_m[:2], _border(system.first, _push_height(skill, system))
    back = centre - border_distance(border, centre, -system.way) * system.way
    length = segment_length(intersections(system.first, system.second))
    pushed: Floats = back + (length + skill.press_m) * system.way
    return pushed


def _push_height(skill: Skill, system: System) -> float:
    """Of the tip: as far above the middle of what is pushed as in the demonstrations; above it things tip over."""
    first = system.first
    middle = first.top_m / 2 if first.solid is None else first.solid.middle_m
    return max(_LEAST_HEIGHT_M, float(np.median(skill.touches.points_m[:, 2])) + middle)


def _border(thing: SeenThing, height_m: float) -> Floats:
    """What is narrower above is touched where the tip is, not at its base."""
    return thing.footprint_m if thing.solid is None else thing.solid.section_m(height_m)


def _put(placed: Placed, system: System, second_turn: float | None) -> tuple[Floats, Floats]:
    """Middle of the first object where it is put, and the direction from the second to it."""
    first, second = system.first, system.second
    left = np.array([-system.way[1], system.way[0]])
    if placed.on:
        x, y = np.median(placed.offset_m.points_m[:, :2], axis=0)
        return second.centre_m[:2] + x * system.way + y * left, np.zeros(2)
    back = system.heading_rad + np.pi
    if placed.frame == "object" and second_turn is not None:
        side = second_turn + placed.bearing_rad
        bearing = side + QUARTER_RAD * np.round((back - side) / QUARTER_RAD)
    else:
        bearing = back + placed.bearing_rad
    outwards = np.array([np.cos(bearing), np.sin(bearing)])
    return second.centre_m[:2] + (
        border_distance(second.footprint_m, second.centre_m[:2], outwards)
        + _half_width(first, second_turn, bearing, placed)
        + placed.gap_m
    ) * outwards, outwards


def _half_width(first: SeenThing, second_turn: float | None, bearing: float, placed: Placed) -> float:
    """From the middle of the first object to its border towards the second, turned as it will be."""
    turn = turn_of(first.footprint_m)
    inwards = bearing + np.pi
    if turn is not None and placed.turn_rad is not None and second_turn is not None:
        inwards -= second_turn + placed.turn_rad - turn
    return border_distance(first.footprint_m, first.centre_m[:2], (np.cos(inwards), np.sin(inwards)))


def _in_the_way(facing: float, take: Floats, height: float, system: System) -> str:
    """Why open fingers that face a direction cannot come down at a place; empty if they can."""
    along = np.array([np.cos(facing), np.sin(facing)])
    across = np.array([-along[1], along[0]])
    width = float(np.ptp(system.first.footprint_m @ across))
    if width > _WIDEST_M:
        return f"{width:.3f} m between its sides, the fingers open to {_WIDEST_M} m"
    for thing in (system.second, *system.others):
        beside = thing.points_m[thing.points_m[:, 2] > height - 2 * FINGERS_BEYOND_M, :2] - take
        near = (np.abs(beside @ along) < _FINGER_M) & (np.abs(beside @ across) < _SPREAD_M)
        if near.any():
            return f"{thing.name!r} in their way"
    return ""


def _effort(grip: Grip) -> float:
    """How far the wrist has to turn at both ends."""
    try:
        return float(
            abs(roll_for_facing(grip.take_m, grip.take_facing_rad))
            + abs(roll_for_facing(grip.put_m, grip.put_facing_rad))
        )
    except UnreachableError:
        return np.inf
