"""The macro for all dual-object manipulations (§2.11, p. 46): eight instructions, from a model to motion.

    1. Identify prime mover.
    2. Identify first touched object by first N-T transition and set coordinate origin.
    3. Define first motion segment.
    4. (Extract relative poses between prime mover and first object, if needed).
    5. Identify second touched object and fix connection vector and coordinate system.
    6. Define second motion segment for second N-T transition relative to this coordinate system. (For pushing do this
       by cross-sectioning with object borders).
    7. (Extract relative poses between objects involved, if needed).
    8. Define third motion segment (home).

Pushing and pick-and-place are two instances. Nothing here knows their names: what differs follows from the model (does
the first object leave the ground, and does it come back?) and from the arm's own joints (do the fingers close?).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from sec_lab.execution.anchors import PrimeMover, connection_vector, intersections, segment_length
from sec_lab.execution.corridor import FREE_M_S, way_home
from sec_lab.execution.grips import (
    CLEARANCE_M,
    FINGERS_BEYOND_M,
    OVER_M,
    Grip,
    System,
    coordinate_system,
    grip_of,
    over_m,
    pushed_to,
    pushing_touch,
)
from sec_lab.execution.perception import SeenThing
from sec_lab.execution.relative_poses import Hand, Handling, Placed, agreed_hand, agreed_placing
from sec_lab.execution.skill import Rule, Skill, Step, told
from sec_lab.worlds.katana.records import TABLE, Floats, Move, Point

INSTRUCTIONS = (
    "Identify prime mover.",
    "Identify first touched object by first N-T transition and set coordinate origin.",
    "Define first motion segment.",
    "(Extract relative poses between prime mover and first object, if needed).",
    "Identify second touched object and fix connection vector and coordinate system.",
    "Define second motion segment for second N-T transition relative to this coordinate system.",
    "(Extract relative poses between objects involved, if needed).",
    "Define third motion segment (home).",
)
"""As the thesis has them; with the sixth goes: "(For pushing do this by cross-sectioning with object borders)."."""

_ABOVE_M = 0.03
"""Between the fingers and the top of what they have let go of."""

_CARRY_M_S, _DOWN_M_S, _STAND_M_S = 0.15, 0.1, 0.02


class MacroError(ValueError):
    """The model asks for something that none of the eight instructions covers; the message says what."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of the motion, and the rules that it reaches.

    Parameters
    ----------
    rules : tuple of Rule
        Reached one after the other, or together.
    moves : tuple of Move
    onward : tuple of float, optional
        See :class:`~sec_lab.execution.skill.Step`.
    """

    rules: tuple[Rule, ...]
    moves: tuple[Move, ...]
    onward: Point | None = None


@dataclass(frozen=True, eq=False)
class Instruction:
    """What came of one of the eight instructions in a scene.

    Parameters
    ----------
    number : int
        From 1.
    text : str
        In the thesis's words.
    result : str
        In ours.
    segments : tuple of Segment
    """

    number: int
    text: str
    result: str
    segments: tuple[Segment, ...] = ()


@dataclass(frozen=True, eq=False)
class Macro:
    """The macro as carried out for a scene.

    Parameters
    ----------
    instructions : tuple of 8 Instruction
    steps : tuple of Step
        What the arm does.
    """

    instructions: tuple[Instruction, ...]
    steps: tuple[Step, ...]


def identify_prime_mover(changes: Sequence[PrimeMover]) -> str:
    """1. "Identify prime mover": the segment in which the key frames of the first N–T transition differ (D1).

    Parameters
    ----------
    changes : sequence of PrimeMover
        Of all demonstrations; most of them decide.

    Raises
    ------
    ValueError
        If there is none.
    """
    if not changes:
        raise ValueError("changes: expected one difference image at least, got none")
    names = [change.name for change in changes]
    return max(sorted(set(names)), key=names.count)


def identify_first_touched(rules: Sequence[Rule], prime: str, *, ground: str = TABLE) -> tuple[str, Rule]:
    """2. "Identify first touched object by first N-T transition and set coordinate origin".

    The origin is the centre of this object in whatever scene it is seen (D4).

    Parameters
    ----------
    rules : sequence of Rule
    prime : str
    ground : str, optional
        Whose touching does not count.

    Returns
    -------
    name : str
    rule : Rule

    Raises
    ------
    MacroError
        If the first transition from N to T is not the prime mover's.
    """
    contact = next((rule for rule in rules if rule.change == "NT" and ground not in rule.pair), None)
    if contact is None or prime not in contact.pair:
        got = "none" if contact is None else _told(contact)
        raise MacroError(f"model: expected a first transition N→T of {prime!r}, got {got}")
    (first,) = set(contact.pair) - {prime}
    return first, contact


def first_segment(skill: Skill, system: System, rules: Sequence[Rule], grip: Grip | None) -> Segment:
    """3. "Define first motion segment": from wherever the arm is to the first object, by a way that is free (D2, D3).

    The fingers come from above where they close on it, and down beside it and up to it where they do not.

    Parameters
    ----------
    skill : Skill
    system : System
    rules : sequence of Rule
        Prime mover comes into view, and touches.
    grip : Grip or None
        Of what will be carried.
    """
    over = over_m((system.first, system.second, *system.others))
    if grip is None:
        touch, outwards, height = pushing_touch(skill, system)
        outside = touch + CLEARANCE_M * outwards
        facing = system.heading_rad + skill.hand.facing_rad
        return Segment(
            tuple(rules),
            (
                Move(_at(outside, over), skill.hand.before, "over", facing, FREE_M_S),
                Move(_at(outside, height), name="down", speed_m_s=0.1),
                Move(_at(touch, height), name="reach", speed_m_s=skill.speed_m_s),
            ),
        )
    above = max(over, float(grip.take_m[2]) + CLEARANCE_M)
    return Segment(
        tuple(rules),
        (
            Move(_at(grip.take_m, above), skill.hand.before, "over", grip.take_facing_rad, FREE_M_S),
            Move(_at(grip.take_m, grip.take_m[2]), None, "down", grip.take_facing_rad, _DOWN_M_S),
            Move(_at(grip.take_m, grip.take_m[2]), "closed", "grasp"),
        ),
        (0.0, 0.0, 0.0),
    )


def pose_of_hand(shown: Sequence[Handling]) -> Hand:
    """4. "Extract relative poses between prime mover and first object, if needed".

    Parameters
    ----------
    shown : sequence of Handling
        Of the demonstrations whose joints are known; without any, the hand faces along the connection vector.
    """
    return agreed_hand(shown) if shown else Hand()


def identify_second_touched(rules: Sequence[Rule], prime: str, first: str, *, ground: str = TABLE) -> tuple[str, Rule]:
    """5. "Identify second touched object and fix connection vector and coordinate system".

    The vector is that between the centres of both in whatever scene they are seen (D5).

    Parameters
    ----------
    rules : sequence of Rule
    prime, first : str
    ground : str, optional
        Whose touching does not count.

    Returns
    -------
    name : str
    rule : Rule

    Raises
    ------
    MacroError
        If the second transition from N to T is not one of the first object with another.
    """
    contacts = [rule for rule in rules if rule.change == "NT" and ground not in rule.pair]
    if len(contacts) < 2:
        raise MacroError(f"model: expected two transitions from N to T, got {len(contacts)}")
    if first not in contacts[1].pair or prime in contacts[1].pair:
        raise MacroError(f"model: expected a second transition N→T of {first!r}, got {_told(contacts[1])}")
    (second,) = set(contacts[1].pair) - {first}
    return second, contacts[1]


def second_segment(skill: Skill, system: System, rules: Sequence[Rule], grip: Grip | None) -> tuple[Segment, ...]:
    """6. "Define second motion segment for second N-T transition relative to this coordinate system".

    What is pushed goes Δ along the connection vector, by cross-sectioning with object borders (D6, D7). What is carried
    is lifted, brought over its place and lowered; if it meets the ground before the second object, it is set down aside
    and brought up to it.

    Parameters
    ----------
    skill : Skill
    system : System
    rules : sequence of Rule
        First object leaves the ground and meets it again, as far as it does, and touches the second.
    grip : Grip or None
        Of what is carried.
    """
    if grip is None:
        _, _, height = pushing_touch(skill, system)
        return (
            Segment(
                tuple(rules), (Move(_at(pushed_to(skill, system), height), name="bring", speed_m_s=skill.speed_m_s),)
            ),
        )
    assert skill.placed is not None
    lift = [rule for rule in rules if rule.change == "TN"]
    down = [rule for rule in rules if rule.change == "NT" and skill.ground in rule.pair]
    (contact,) = [rule for rule in rules if rule.change == "NT" and skill.ground not in rule.pair]
    base = float(grip.take_m[2])
    tops = [thing.top_m for thing in (system.second, *system.others)]
    high = max(OVER_M, base + max(tops) + CLEARANCE_M)
    aside_first = bool(down) and down[0].column < contact.column
    before = grip.put_m[:2] + (max(skill.placed.aside_m, CLEARANCE_M / 2) * grip.outwards if aside_first else 0.0)
    facing = grip.put_facing_rad
    carry = (
        Move(_at(before, high), None, "carry", facing, _CARRY_M_S),
        Move(_at(before, grip.put_m[2]), None, "lower", facing, skill.speed_m_s),
    )
    segments = [Segment(tuple(lift), (Move(_at(grip.take_m, high), None, "lift", None, _DOWN_M_S),))] if lift else []
    if aside_first:
        x, y = (float(part) for part in -grip.outwards)
        bring = Move(_at(grip.put_m, grip.put_m[2]), None, "bring", facing, skill.speed_m_s)
        return (*segments, Segment(tuple(down), carry, (0.0, 0.0, 0.0)), Segment((contact,), (bring,), (x, y, 0.0)))
    return (*segments, Segment((*down, contact), carry, (0.0, 0.0, 0.0)))


def pose_of_objects(
    shown: Sequence[Handling], rules: Sequence[Rule], first: str, *, ground: str = TABLE
) -> Placed | None:
    """7. "Extract relative poses between objects involved, if needed".

    They are needed for what is carried. It stands on the second object if it does not meet the ground again.

    Parameters
    ----------
    shown : sequence of Handling
    rules : sequence of Rule
    first : str
    ground : str, optional
    """
    if not shown or not shown[0].closes:
        return None
    changes = [rule.change for rule in rules if set(rule.pair) == {first, ground}]
    return agreed_placing(shown, on=bool(changes) and changes[-1] == "TN")


def third_segment(
    skill: Skill, system: System, parting: Sequence[Rule], leaving: Sequence[Rule], grip: Grip | None, *, home_m: Point
) -> tuple[Segment, ...]:
    """8. "Define third motion segment (home)": away from the first object as the arm came to it, and home (D8).

    Parameters
    ----------
    skill : Skill
    system : System
    parting, leaving : sequence of Rule
        Prime mover and first object part; the prime mover goes out of view.
    grip : Grip or None
        Of what was carried.
    home_m : tuple of float
    """
    over = over_m((system.first, system.second, *system.others))
    if grip is None:
        _, outwards, height = pushing_touch(skill, system)
        away = pushed_to(skill, system) + (CLEARANCE_M + 0.01) * outwards
        leave: tuple[Move, ...] = (Move(_at(away, height), skill.hand.after, "leave", None, skill.speed_m_s),)
    else:
        away = grip.put_m[:2]
        clear = float(grip.put_m[2] - grip.take_m[2]) + system.first.top_m + FINGERS_BEYOND_M + _ABOVE_M
        over = max(over, clear)
        # What is let fall, be it by a millimetre, ends elsewhere: first it is made to stand.
        stands = float(grip.put_m[2]) - (0.0 if skill.placed is None else skill.placed.let_go_m)
        leave = (
            Move(_at(away, stands), None, "stand", None, _STAND_M_S),
            Move(_at(away, stands), skill.hand.after, "release"),
            Move(_at(away, clear), name="leave", speed_m_s=_DOWN_M_S),
        )
    home = (Move(_at(away, over), name="up", speed_m_s=0.1), *way_home((*away, over), home_m))
    return Segment(tuple(parting), leave), Segment(tuple(leaving), home)


def macro(
    skill: Skill, first: SeenThing, second: SeenThing, things: Sequence[SeenThing] = (), *, home_m: Point
) -> Macro:
    """Carry the eight instructions out for a scene.

    Parameters
    ----------
    skill : Skill
    first, second : SeenThing
        As the camera sees them.
    things : sequence of SeenThing, optional
        All that it sees.
    home_m : tuple of float
        Where the tip goes in the end.

    Returns
    -------
    Macro

    Raises
    ------
    MacroError
        If the model has a change of relation that no instruction covers.
    SceneError
        If the fingers have no way to hold the first object in this scene.
    """
    parts = allotted(skill)
    system = coordinate_system(first, second, things)
    grip = grip_of(skill, system) if skill.hand.closes else None
    one = first_segment(skill, system, (*parts["appear"], *parts["touch"]), grip)
    two = second_segment(skill, system, (*parts["lift"], *parts["ground"], *parts["bring"]), grip)
    three = third_segment(skill, system, parts["part"], parts["leave"], grip, home_m=home_m)
    last = skill.rules[-1].column
    steps = tuple(
        Step(_reached(segment, skill), segment.moves, system.heading_rad, _last_column(segment) == last, segment.onward)
        for segment in (one, *two, *three)
        if segment.rules
    )
    results = _results(skill, system, grip)
    segments = {3: (one,), 6: two, 8: three}
    return Macro(
        tuple(
            Instruction(number, text, results[number], segments.get(number, ()))
            for number, text in enumerate(INSTRUCTIONS, start=1)
        ),
        steps,
    )


Part = Literal["appear", "touch", "lift", "ground", "bring", "part", "leave"]
_ORDER: tuple[Part, ...] = ("appear", "touch", "lift", "ground", "bring", "part", "leave")


def allotted(skill: Skill) -> dict[Part, tuple[Rule, ...]]:
    """Rules of a model by the motion that reaches them; none is left over.

    Parameters
    ----------
    skill : Skill

    Raises
    ------
    MacroError
        If no instruction covers one, or it comes at another time.
    """
    held = {skill.prime, skill.first}
    found: dict[Part, list[Rule]] = {part: [] for part in _ORDER}
    reached = 0
    for rule in skill.rules:
        pair = set(rule.pair)
        part: Part | None = None
        if rule.change == "AN" and skill.prime in pair:
            part = "appear"
        elif rule.change == "NA" and skill.prime in pair:
            part = "leave"
        elif pair == held and rule.change in ("NT", "TN"):
            part = "touch" if rule.change == "NT" else "part"
        elif pair == {skill.first, skill.second} and rule.change == "NT":
            part = "bring"
        elif pair == {skill.first, skill.ground} and rule.change in ("NT", "TN"):
            part = "lift" if rule.change == "TN" else "ground"
        if part is None:
            raise MacroError(f"rule: expected one that moves follow from, got {_told(rule)}")
        # Whether what is put down meets the ground or the second object first is open.
        place = _ORDER.index("ground" if part == "bring" else part)
        if place < reached or (found[part] and part not in ("appear", "leave")):
            raise MacroError(f"rule: expected one that moves follow from at this time, got {_told(rule)}")
        reached = place
        found[part].append(rule)
    missing = [part for part in ("touch", "bring", "part") if not found[part]]
    if missing:
        raise MacroError(f"model: expected transitions to {', '.join(missing)}, got none")
    if found["lift"] and not skill.hand.closes:
        raise MacroError(f"model: {_told(found['lift'][0])}, but the fingers do not close in the demonstrations")
    return {part: tuple(rules) for part, rules in found.items()}


def _reached(segment: Segment, skill: Skill) -> Rule:
    """The rule by which a segment is told: that of the objects where there are several."""
    told = [rule for rule in segment.rules if rule.change != "AN" and skill.ground not in rule.pair] or segment.rules
    return replace(told[-1], column=_last_column(segment))


def _last_column(segment: Segment) -> int:
    return max(rule.column for rule in segment.rules)


def _results(skill: Skill, system: System, grip: Grip | None) -> dict[int, str]:
    x, y, z = system.origin_m
    hand, placed = skill.hand, skill.placed
    facing = np.rad2deg(hand.facing_rad)
    length = float(np.linalg.norm(connection_vector(system.first, system.second)))
    where = {"connection": "the connection vector", "object": "its sides"}[hand.frame]
    if grip is None or placed is None:
        delta = 1000 * segment_length(intersections(system.first, system.second))
        second = f"Δ = {delta:.0f} mm along the connection vector"
        pose = "not needed: the fingers do not close"
    else:
        move = grip.put_m - grip.take_m
        second = f"carried by ({move[0]:.3f}, {move[1]:.3f}, {move[2]:.3f}) m"
        pose = f"on {skill.second}" if placed.on else f"beside {skill.second}, {1000 * placed.gap_m:.0f} mm apart"
        pose += "" if placed.turn_rad is None else f", turned {np.rad2deg(placed.turn_rad):.0f}° from its sides"
    return {
        1: skill.prime,
        2: f"{skill.first}, its centre ({x:.3f}, {y:.3f}, {z:.3f}) m",
        3: "from above, fingers "
        + (f"{hand.before}, then closed" if hand.closes else "as they are, then up to its side"),
        4: f"fingers face {facing:.0f}° from {where}",
        5: f"{skill.second}, {1000 * length:.0f} mm at {np.rad2deg(system.heading_rad):.0f}°",
        6: second,
        7: pose,
        8: "back as it came, up, home",
    }


def _told(rule: Rule) -> str:
    return f"{told(rule)} in column {rule.column + 1}"


def _at(point: Floats, height_m: float) -> Point:
    return float(point[0]), float(point[1]), float(height_m)
