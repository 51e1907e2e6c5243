"""Planning (§2.10.4): every transition of the model becomes a rule, and the rules motion in the scene as seen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from sec_lab.action_model import ActionModel
from sec_lab.codes import LETTER_OF, Relation
from sec_lab.execution.anchors import (
    Points,
    border_distance,
    connection_vector,
    end_points,
    in_frame,
    intersections,
    segment_length,
    start_points,
    touching_points,
)
from sec_lab.execution.corridor import obstacle, swept
from sec_lab.execution.enriched import Enriched
from sec_lab.execution.perception import CONTACT_M, Perceived, SeenThing, things_in
from sec_lab.execution.solids import gap_between
from sec_lab.learning import learn
from sec_lab.recording import Recording
from sec_lab.worlds.katana.records import Camera, Floats, Move, Point

_CLEARANCE_M = 0.045
"""Between the tip and what it goes past: half a hand, and what perception may be off."""
_OVER_M = 0.12
"""Least height at which the tip passes over things."""
_LEAST_HEIGHT_M = 0.022
"""Lower the fingers come too near to the table."""
_FREE_M_S = 0.3
_NEAR_COLUMN_M, _OUT_M = 0.20, 0.26
_LEAST_SEEN = 0.6
"""A thing of which only what is above this share of its height is seen hovers, or stands too well hidden."""


class SceneError(ValueError):
    """Nothing can be done in the scene as it is seen; the message says why."""


@dataclass(frozen=True)
class Rule:
    """A transition of the model (§2.10.5).

    Parameters
    ----------
    column : int
        In which it is reached.
    pair : tuple of str
        Whose relation changes.
    change : str
        Such as "NT".
    """

    column: int
    pair: tuple[str, str]
    change: str


@dataclass(frozen=True, eq=False)
class Skill:
    """What was learned of a dual-object manipulation: the model, and the anchor points of its demonstrations.

    Parameters
    ----------
    model : ActionModel
    rules : tuple of Rule
    prime, first, second : str
        Prime mover, first and second touched object.
    starts, touches, ends : Points
        D2, D3 (relative, along the connection vector) and D8.
    standoff_m : float
        From the border of the first object to the tip as it touches: the lower quartile of the demonstrations, as
        touching is perceived a little early where it is seen well.
    press_m : float
        By which the tip went beyond E₁ + Δ at the end of the second segment, mostly negative: the tip has a size (D7).
    side_rad : float
        Direction from the origin in which the tip touches, from the connection vector.
    speed_m_s : float
        Mean speed of the tip on the second segment.
    contact_gap_m : float
        Widest gap that was seen between first and second object while they stood touching in the end.
    """

    model: ActionModel
    rules: tuple[Rule, ...]
    prime: str
    first: str
    second: str
    starts: Points
    touches: Points
    ends: Points
    standoff_m: float
    press_m: float
    side_rad: float
    speed_m_s: float
    contact_gap_m: float


@dataclass(frozen=True, eq=False)
class Demonstrated:
    """One demonstration as it is learned from.

    Parameters
    ----------
    recording : Recording
    camera : Camera
    perceived : Perceived
    tip_m : (n, 3) float64
        Of the arm, from its own joints.
    joints_rad : (n, 7) float64, optional
        Angles of these joints, the two fingers last. Without them nothing is known of the hand: it then faces along the
        connection vector, and its fingers stay as they are.
    """

    recording: Recording
    camera: Camera
    perceived: Perceived
    tip_m: Floats
    joints_rad: Floats | None = None

    @property
    def frames_per_second(self) -> float:
        """Of the recording."""
        return self.recording.frames_per_second or 20.0

    def things_at(self, number: int) -> tuple[SeenThing, ...]:
        """Things as they are seen in a frame.

        Raises
        ------
        ValueError
            If there is no such frame.
        """
        for frame in self.recording:
            if frame.index == number:
                return things_in(frame, self.camera)
        raise ValueError(f"frame: expected one of the movie, got {number}")


@dataclass(frozen=True)
class Step:
    """Moves of the arm that follow one rule.

    Parameters
    ----------
    rule : Rule
    moves : tuple of Move
    heading_rad : float
        Of the connection vector.
    column_is_last : bool
        Whether the model ends there.
    """

    rule: Rule
    moves: tuple[Move, ...]
    heading_rad: float
    column_is_last: bool


def rules_of(model: ActionModel) -> tuple[Rule, ...]:
    """Rules of a model: its transitions between N, T and A, column after column.

    Parameters
    ----------
    model : ActionModel
    """
    chain = model.chain
    rules = []
    for column in range(1, chain.relations.shape[1]):
        for row, (one, other) in enumerate(chain.pairs):
            before, after = (LETTER_OF[Relation(int(chain.relations[row, at]))] for at in (column - 1, column))
            if before != after:
                pair = (str(chain.names[int(one)]), str(chain.names[int(other)]))
                rules.append(Rule(column, pair, before + after))
    return tuple(rules)


def learn_skill(demonstrations: Mapping[str, Demonstrated | Enriched]) -> Skill:
    """Learn the model (step 7) and read the anchor points off the key frames of all demonstrations (§2.10.3).

    Parameters
    ----------
    demonstrations : mapping of str to Demonstrated or Enriched
        Enriched ones come from files (A.2).

    Returns
    -------
    Skill

    Raises
    ------
    ValueError
        If the model has no two transitions from N to T that follow each other in one object.
    """
    chains = {name: one.perceived.chain for name, one in demonstrations.items() if one.perceived.chain is not None}
    model = learn(chains)
    rules = rules_of(model)
    contacts = [rule for rule in rules if rule.change == "NT"]
    if len(contacts) < 2:
        raise ValueError(f"model: expected two transitions from N to T, got {len(contacts)}")
    shared = set(contacts[0].pair) & set(contacts[1].pair)
    if len(shared) != 1:
        raise ValueError(f"model: expected one object in both transitions from N to T, got {sorted(shared)}")
    (first,) = shared
    (prime,) = set(contacts[0].pair) - shared
    (second,) = set(contacts[1].pair) - shared
    leaving = next(rule.column for rule in rules if rule.change == "TN" and prime in rule.pair)
    rows = []
    for name in chains:
        one = demonstrations[name]
        frames = dict(enumerate(model.key_frames[model.demonstrations.index(name)].tolist()))
        seen_at = [frames[contacts[0].column - 1], frames[contacts[0].column], frames[contacts[1].column]]
        if min(seen_at) < 0 or frames[leaving] < 0:
            continue
        rows.append(_measured(one, seen_at, frames[leaving], first, second))
    if not rows:
        raise ValueError("demonstrations: expected one with all key frames of the model, got none")
    starts, tips, origins, vectors, standoffs, presses, ends, speeds = (
        list(column) for column in zip(*rows, strict=True)
    )
    touches = touching_points(np.array(tips), np.array(origins), np.array(vectors))
    middle = np.median(touches.points_m, axis=0)
    return Skill(
        model,
        rules,
        prime,
        first,
        second,
        start_points(np.array(starts)),
        touches,
        end_points(np.array(ends)),
        float(np.percentile(standoffs, 25)),
        float(np.median(presses)),
        float(np.arctan2(middle[1], middle[0])),
        float(np.median(speeds)),
        max(one.perceived.last_gap_m(first, second) for one in demonstrations.values()),
    )


def plan(skill: Skill, things: Sequence[SeenThing], *, home_m: Point, again: bool = False) -> tuple[Step, ...]:
    """Motion for a scene: the rules of the model, one after the other, by vector addition (§2.10.5).

    Parameters
    ----------
    skill : Skill
    things : sequence of SeenThing
        As the camera sees them.
    home_m : tuple of float
        Where the tip goes in the end.
    again : bool, optional
        After a failure: the objects may look as if they touched.

    Returns
    -------
    tuple of Step

    Raises
    ------
    SceneError
        If an object is missing, or they touch already, or something is in the way.
    """
    first, second = check_scene(skill, things, again=again)
    found = intersections(first, second)
    vector = connection_vector(first, second)
    way = vector[:2] / np.linalg.norm(vector[:2])
    facing = float(np.arctan2(way[1], way[0]))
    # The tip stands off the border where the demonstrations touched: seen from the origin, on this side of it.
    side = facing + skill.side_rad
    outwards = np.array([np.cos(side), np.sin(side)])
    height = max(_LEAST_HEIGHT_M, float(np.median(skill.touches.points_m[:, 2] + first.top_m / 2)))
    # What is narrower above is touched where the tip is, not at its base.
    at_height = first.footprint_m if first.solid is None else first.solid.section_m(height)
    border = border_distance(at_height, first.centre_m[:2], outwards)
    touch = first.centre_m[:2] + (border + skill.standoff_m) * outwards
    over = max(_OVER_M, *(thing.top_m + 0.05 for thing in things))
    at, steps = touch, []
    for rule in skill.rules:
        moves: tuple[Move, ...]
        if rule.change == "NT" and set(rule.pair) == {skill.prime, skill.first}:
            outside = touch + _CLEARANCE_M * outwards
            moves = (
                Move(_at(outside, over), name="over", facing_rad=facing, speed_m_s=_FREE_M_S),
                Move(_at(outside, height), name="down", speed_m_s=0.1),
                Move(_at(touch, height), name="reach", speed_m_s=skill.speed_m_s),
            )
        elif rule.change == "NT" and set(rule.pair) == {skill.first, skill.second}:
            back = first.centre_m[:2] - border_distance(at_height, first.centre_m[:2], -way) * way
            at = back + (segment_length(found) + skill.press_m) * way
            moves = (Move(_at(at, height), name="bring", speed_m_s=skill.speed_m_s),)
        elif rule.change == "TN" and skill.prime in rule.pair:
            away = at + (_CLEARANCE_M + 0.01) * outwards
            moves = (Move(_at(away, height), name="leave", speed_m_s=skill.speed_m_s),)
            at = away
        elif rule.change == "NA" and skill.prime in rule.pair:
            moves = (Move(_at(at, over), name="up", speed_m_s=0.1), *way_home((*at, over), home_m))
        elif rule.change == "AN" and skill.prime in rule.pair:
            # The prime mover comes into view on its way to the first object.
            continue
        else:
            raise ValueError(f"rule: expected one that moves follow from, got {told(rule)} in column {rule.column}")
        steps.append(Step(rule, moves, facing, rule.column == skill.rules[-1].column))
    _check_way(steps, first, second, things, over_m=over)
    return tuple(steps)


def way_home(from_m: ArrayLike, home_m: Point) -> tuple[Move, ...]:
    """Moves from a place high up to a home (D8); near its own column the arm cannot rise, so it goes outwards first.

    Parameters
    ----------
    from_m : (3,) array_like of float
    home_m : tuple of float

    Examples
    --------
    >>> [move.name for move in way_home((0.3, 0.0, 0.15), (-0.1, 0.3, 0.3))]
    ['home']
    >>> [move.name for move in way_home((0.12, 0.0, 0.15), (-0.1, 0.3, 0.3))]
    ['out', 'home']
    """
    place = np.asarray(from_m, dtype=np.float64)
    away = float(np.hypot(place[0], place[1]))
    home = Move(home_m, name="home", speed_m_s=_FREE_M_S)
    if away >= _NEAR_COLUMN_M:
        return (home,)
    return Move(_at(_OUT_M / away * place[:2], float(place[2])), name="out", speed_m_s=_FREE_M_S), home


def told(rule: Rule) -> str:
    """A rule in words, such as "{red box, robot arm} N→T"."""
    return "{" + ", ".join(sorted(rule.pair)) + "} " + "→".join(rule.change)


def check_scene(skill: Skill, things: Sequence[SeenThing], *, again: bool = False) -> tuple[SeenThing, SeenThing]:
    """First and second object of a scene, or one clear error.

    Parameters
    ----------
    skill : Skill
    things : sequence of SeenThing
    again : bool, optional
        See :func:`plan`.

    Raises
    ------
    SceneError
        If one is missing, there are two candidates, one is not on the table, or they touch already.
    """
    seen = {thing.name: thing for thing in things}
    for name in (skill.first, skill.second):
        if name not in seen:
            raise SceneError(f"scene: expected something that looks like {name!r}, got {sorted(seen)}")
        if seen[name].n_parts > 1:
            raise SceneError(f"scene: expected one candidate for {name!r}, got {seen[name].n_parts}")
        top, bottom = seen[name].top_m, seen[name].bottom_m
        if not 0.01 < top < 0.2 or not -0.01 < bottom < _LEAST_SEEN * top:
            raise SceneError(f"scene: expected {name!r} on the table, got it from {bottom:.3f} to {top:.3f} m above it")
    first, second = seen[skill.first], seen[skill.second]
    if first.solid is None or second.solid is None:
        raise ValueError("things: expected those of a whole look, with outlines, got some without")
    if not again and gap_between(first.solid, second.solid) < CONTACT_M[0]:
        raise SceneError(f"scene: expected {skill.first!r} and {skill.second!r} apart, got them touching already")
    return first, second


def _check_way(
    steps: Sequence[Step], first: SeenThing, second: SeenThing, things: Sequence[SeenThing], *, over_m: float
) -> None:
    """Nothing if the way is free; otherwise a SceneError that names what is in it."""
    others = [
        (thing.name, thing.solid)
        for thing in things
        if thing.solid is not None and thing.name not in (first.name, second.name)
    ]
    moves = [move for step in steps for move in step.moves]
    met = obstacle(moves, others, below_m=over_m)
    if met:
        raise SceneError(f"scene: expected a free way for the arm, got {met!r} in it")
    length = segment_length(intersections(first, second))
    vector = connection_vector(first, second)[:2]
    met = swept(first.solid, length * vector / np.linalg.norm(vector), others) if first.solid is not None else ""
    if met:
        raise SceneError(f"scene: expected a free way from {first.name!r} to {second.name!r}, got {met!r} in it")


def _measured(
    one: Demonstrated | Enriched, frames: Sequence[int], leaving: int, first: str, second: str
) -> tuple[Floats, Floats, Floats, Floats, float, float, Floats, float]:
    """What one demonstration says: where the tip was, and how far from the borders."""
    appears, touches, _ = frames
    # The objects are measured where nothing hides them yet: just before the arm is first seen.
    before = {thing.name: thing for thing in one.things_at(max(appears - 1, 0))}
    red, green = before[first], before[second]
    vector = connection_vector(red, green)
    tip = one.tip_m[touches]
    outwards = tip[:2] - red.centre_m[:2]
    outwards = outwards / np.linalg.norm(outwards)
    border = border_distance(red.footprint_m, red.centre_m[:2], outwards)
    standoff = float(np.linalg.norm(tip[:2] - red.centre_m[:2]) - border)
    farthest = max(in_frame(point, red.centre_m, vector)[0] for point in one.tip_m[touches:leaving])
    found = intersections(red, green)
    press = farthest - in_frame([*found.E1_m, 0.0], red.centre_m, vector)[0] - segment_length(found)
    moving = one.tip_m[touches:leaving]
    steps = np.linalg.norm(np.diff(moving, axis=0), axis=1)
    speed = float(steps[steps > 1e-4].mean() * one.frames_per_second)
    return one.tip_m[appears], tip, red.centre_m, vector, standoff, float(press), one.tip_m[-1], speed


def shifted(move: Move, by_m: Floats) -> Move:
    """The same move elsewhere."""
    x, y, z = (float(value) for value in np.asarray(move.to_m) + by_m)
    return replace(move, to_m=(x, y, z))


def _at(point: Floats, height_m: float) -> Point:
    return float(point[0]), float(point[1]), height_m
