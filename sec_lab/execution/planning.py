"""Planning (§2.10.4): every transition of the model becomes a rule, and the rules motion in the scene as seen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sec_lab.execution.anchors import (
    PrimeMover,
    border_distance,
    connection_vector,
    end_points,
    in_frame,
    intersections,
    prime_mover,
    segment_length,
    start_points,
    touching_points,
)
from sec_lab.execution.corridor import obstacle, swept
from sec_lab.execution.enriched import Enriched
from sec_lab.execution.grips import over_m
from sec_lab.execution.macro import (
    MacroError,
    identify_first_touched,
    identify_prime_mover,
    identify_second_touched,
    macro,
    pose_of_hand,
    pose_of_objects,
)
from sec_lab.execution.perception import CONTACT_M, TABLE, Perceived, SeenThing, things_in
from sec_lab.execution.relative_poses import Handling, handling
from sec_lab.execution.skill import Rule, SceneError, Skill, Step, rules_of, told
from sec_lab.execution.solids import gap_between
from sec_lab.execution.things import COLOURS, MINIMUM_PX
from sec_lab.learning import learn
from sec_lab.recording import Frame, Recording
from sec_lab.segmentation.colour import colour_segments
from sec_lab.worlds.katana.records import Camera, Floats, Move, Point

__all__ = [
    "Demonstrated",
    "MacroError",
    "Rule",
    "SceneError",
    "Skill",
    "Step",
    "check_scene",
    "learn_skill",
    "plan",
    "rules_of",
    "shifted",
    "told",
]

_LEAST_SEEN = 0.6
"""A thing of which only what is above this share of its height is seen hovers, or stands too well hidden."""


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
    frames = {
        name: model.key_frames[place].tolist()
        for place, name in enumerate(model.demonstrations)
        if name in demonstrations
    }
    first_contact = next((rule for rule in rules if rule.change == "NT" and TABLE not in rule.pair), None)
    if first_contact is None:
        raise MacroError("model: expected two transitions from N to T, got 0")
    n, t = first_contact.column - 1, first_contact.column
    looks = {name: _looks(demonstrations[name], at[n], at[t]) for name, at in frames.items() if min(at[n], at[t]) >= 0}
    prime = identify_prime_mover([change for _, _, change in looks.values()])
    first = identify_first_touched(rules, prime)[0]
    second, meeting = identify_second_touched(rules, prime, first)
    leaving = next((rule.column for rule in rules if rule.change == "TN" and set(rule.pair) == {prime, first}), None)
    if leaving is None:
        raise MacroError(f"model: expected a transition T→N of {prime!r} and {first!r}, got none")
    ground = [rule.column for rule in rules if rule.change == "NT" and set(rule.pair) == {first, TABLE}]
    whole = {name: at for name, at in frames.items() if min(at[n], at[t], at[meeting.column], at[leaving]) >= 0}
    if not whole:
        raise ValueError("demonstrations: expected one with all key frames of the model, got none")
    rows, shown = [], []
    for name, at in whole.items():
        one, seen_at = demonstrations[name], [at[n], at[t], at[meeting.column]]
        before, end, _ = looks[name]
        hand = None
        if one.joints_rad is not None and first in end:
            hand = handling(
                one.joints_rad,
                one.tip_m,
                (before[first], before[second], end[first]),
                touches=at[t],
                contact=at[meeting.column],
                leaves=at[leaving],
                set_down=at[ground[-1]] if ground and at[ground[-1]] >= 0 else None,
            )
            shown.append(hand)
        rows.append(_measured(one, before[first], before[second], seen_at, at[leaving], hand))
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
        pose_of_hand(shown),
        pose_of_objects(shown, rules, first),
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
    steps = macro(skill, first, second, things, home_m=home_m).steps
    _check_way(skill, steps, first, second, things)
    return steps


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
        # Of what stands behind another after a failure, little may be seen.
        if not 0.01 < top < 0.2 or bottom < -0.01 or (bottom > _LEAST_SEEN * top and not again):
            raise SceneError(f"scene: expected {name!r} on the table, got it from {bottom:.3f} to {top:.3f} m above it")
    first, second = seen[skill.first], seen[skill.second]
    if first.solid is None or second.solid is None:
        raise ValueError("things: expected those of a whole look, with outlines, got some without")
    if not again and gap_between(first.solid, second.solid) < CONTACT_M[0]:
        raise SceneError(f"scene: expected {skill.first!r} and {skill.second!r} apart, got them touching already")
    return first, second


def _check_way(
    skill: Skill, steps: Sequence[Step], first: SeenThing, second: SeenThing, things: Sequence[SeenThing]
) -> None:
    """Nothing if the way is free; otherwise a SceneError that names what is in it."""
    others = [
        (thing.name, thing.solid)
        for thing in things
        if thing.solid is not None and thing.name not in (first.name, second.name)
    ]
    moves = [move for step in steps for move in step.moves]
    met = obstacle(moves, others, below_m=over_m(things))
    if met:
        raise SceneError(f"scene: expected a free way for the arm, got {met!r} in it")
    if skill.hand.closes or first.solid is None:
        # What is carried passes over everything.
        return
    length = segment_length(intersections(first, second))
    vector = connection_vector(first, second)[:2]
    met = swept(first.solid, length * vector / np.linalg.norm(vector), others)
    if met:
        raise SceneError(f"scene: expected a free way from {first.name!r} to {second.name!r}, got {met!r} in it")


def _measured(
    one: Demonstrated | Enriched,
    red: SeenThing,
    green: SeenThing,
    frames: Sequence[int],
    leaving: int,
    hand: Handling | None,
) -> tuple[Floats, Floats, Floats, Floats, float, float, Floats, float]:
    """What one demonstration says: where the tip was, and how far from the borders."""
    appears, touches, _ = frames
    vector = connection_vector(red, green)
    tip = one.tip_m[touches] if hand is None else hand.tip_m
    outwards = tip[:2] - red.centre_m[:2]
    outwards = outwards / max(float(np.linalg.norm(outwards)), 1e-9)
    border = border_distance(red.footprint_m, red.centre_m[:2], outwards) if outwards.any() else 0.0
    standoff = float(np.linalg.norm(tip[:2] - red.centre_m[:2]) - border)
    farthest = max(in_frame(point, red.centre_m, vector)[0] for point in one.tip_m[touches:leaving])
    found = intersections(red, green)
    press = farthest - in_frame([*found.E1_m, 0.0], red.centre_m, vector)[0] - segment_length(found)
    moving = one.tip_m[touches:leaving]
    steps = np.linalg.norm(np.diff(moving, axis=0), axis=1)
    speed = float(steps[steps > 1e-4].mean() * one.frames_per_second)
    return one.tip_m[appears], tip, red.centre_m, vector, standoff, float(press), one.tip_m[-1], speed


def _looks(
    one: Demonstrated | Enriched, n: int, t: int
) -> tuple[dict[str, SeenThing], dict[str, SeenThing], PrimeMover]:
    """Things before anything hides them (just before the arm is first seen) and in the end, and what changes (D1)."""
    if isinstance(one, Enriched):
        before, end, change = one.things_at(max(n - 1, 0)), one.things_at(len(one.tip_m) - 1), one.difference(n, t)
    else:
        found: dict[int, Frame] = {}
        for frame in one.recording:
            if frame.index in (max(n - 1, 0), n, t):
                found[frame.index] = frame
            found[-1] = frame
        before, end = (things_in(found[number], one.camera) for number in (max(n - 1, 0), -1))
        segments = [
            colour_segments(found[number].image, COLOURS, minimum_px=MINIMUM_PX, components="all") for number in (n, t)
        ]
        names = {label: colour.name for label, colour in enumerate(COLOURS, start=1)}
        change = prime_mover(segments[0], segments[1], names)
    return {thing.name: thing for thing in before}, {thing.name: thing for thing in end}, change


def shifted(move: Move, by_m: Floats) -> Move:
    """The same move elsewhere."""
    x, y, z = (float(value) for value in np.asarray(move.to_m) + by_m)
    return replace(move, to_m=(x, y, z))
