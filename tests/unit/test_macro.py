"""The macro of §2.11: relative poses as learned, the eight instructions, and pick-and-place as an instance."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sec_lab.codes import to_letters
from sec_lab.execution.anchors import PrimeMover
from sec_lab.execution.enriched_files import read_enriched_folder
from sec_lab.execution.loop import execute_skill
from sec_lab.execution.macro import (
    INSTRUCTIONS,
    MacroError,
    allotted,
    identify_first_touched,
    identify_prime_mover,
    identify_second_touched,
    macro,
)
from sec_lab.execution.perception import SeenThing, things_in
from sec_lab.execution.planning import Rule, SceneError, Skill, check_scene, learn_skill, plan
from sec_lab.execution.relative_poses import Hand, Handling, agreed_angle, agreed_hand, turn_of
from sec_lab.execution.solids import Solid, gap_between, gap_to_points, raised
from sec_lab.execution.study import skill_of
from sec_lab.worlds.katana import Fault, view
from sec_lab.worlds.katana.placing import placing_pose, placing_scene
from sec_lab.worlds.katana.stored import read_demonstration

FOLDER = Path(__file__).parents[2] / "datasets"
ARM, RED, GREEN, TABLE = "robot arm", "red box", "green box", "table"
SEED = 501


def _rule(column: int, one: str, other: str, change: str) -> Rule:
    return Rule(column, (one, other), change)


PUSHING = (
    _rule(1, RED, ARM, "AN"),
    _rule(2, RED, ARM, "NT"),
    _rule(3, GREEN, RED, "NT"),
    _rule(4, RED, ARM, "TN"),
    _rule(5, RED, ARM, "NA"),
)


@pytest.fixture(scope="module")
def on() -> Skill:
    """Of the movies of two of the five demonstrations, so that it does not take long."""
    folder = FOLDER / "katana_pick_and_place" / "on"
    return skill_of(read_demonstration(folder / f"demonstration_0{number}.npz") for number in (1, 2))


@pytest.fixture(scope="module")
def beside() -> Skill:
    """From GraphML, which takes no time."""
    return learn_skill(read_enriched_folder(FOLDER / "katana_pick_and_place" / "beside"))


@pytest.fixture(scope="module")
def push(on: Skill) -> Skill:
    """As if the fingers had not closed; what is learned of pushing itself is tested beside its execution."""
    return replace(on, rules=PUSHING, hand=Hand(), placed=None)


def _rows(skill: Skill) -> dict[str, str]:
    chain = skill.model.chain
    return {chain.row_label(row): to_letters(codes) for row, codes in enumerate(chain.relations)}


def test_what_is_put_on_leaves_the_table_for_good_and_what_is_put_beside_comes_back(on: Skill, beside: Skill) -> None:
    assert _rows(on) == {"red box, table": "TTTNNNN", "red box, robot arm": "ANTTTNA", "green box, red box": "NNNNTTT"}
    assert _rows(beside) == {
        "red box, table": "TTTNTTTT",
        "red box, robot arm": "ANTTTTNA",
        "green box, red box": "NNNNNTTT",
    }
    for skill in (on, beside):
        assert (skill.prime, skill.first, skill.second) == (ARM, RED, GREEN)


def test_relative_poses_are_those_of_the_program(on: Skill, beside: Skill) -> None:
    """Grasped 15 mm below the top; sides aligned in the end; middle on middle, or side by side."""
    for skill in (on, beside):
        hand, placed = skill.hand, skill.placed
        assert placed is not None
        assert (hand.closes, hand.before, hand.after, hand.frame, hand.level) == (True, "open", "open", "object", "top")
        assert hand.height_m == pytest.approx(-0.015, abs=0.001)
        assert abs(hand.facing_rad) < 0.02
        assert placed.turn_rad == pytest.approx(0.0, abs=0.03)
        assert placed.let_go_m == pytest.approx(0.002, abs=0.001)
    assert on.placed is not None
    assert beside.placed is not None
    assert on.placed.on
    assert np.abs(on.placed.offset_m.points_m).max() < 0.003
    assert not beside.placed.on
    assert beside.placed.frame == "object"
    assert abs(beside.placed.bearing_rad) < 0.03
    assert abs(beside.placed.gap_m) < 0.001
    assert beside.placed.facing_rad == pytest.approx(0.0, abs=0.03)
    assert beside.placed.aside_m == pytest.approx(0.035, abs=0.002)


@pytest.mark.parametrize("placing", ["on", "beside"])
def test_the_plan_takes_and_puts_as_the_program_would(placing: str, request: pytest.FixtureRequest) -> None:
    skill: Skill = request.getfixturevalue(placing)
    scene = placing_scene(placing, SEED)  # type: ignore[arg-type]
    steps = plan(skill, things_in(view(scene), scene.camera), home_m=scene.home_m)
    moves = {move.name: move for step in steps for move in step.moves}
    names = ["over", "down", "grasp", "lift", "carry", "lower", "bring", "stand", "release", "leave", "up", "home"]
    assert list(moves) == (names if placing == "beside" else [name for name in names if name != "bring"])
    assert [step.rule.column for step in steps] == [rule.column for rule in skill.rules if rule.change != "AN"]
    red = scene.thing(RED)
    np.testing.assert_allclose(moves["grasp"].to_m, (*red.p_W_m[:2], red.size_m[2] - 0.015), atol=0.003)
    end, _ = placing_pose(placing, scene)  # type: ignore[arg-type]
    np.testing.assert_allclose(moves["release"].to_m, (*end[:2], end[2] + red.size_m[2] / 2 - 0.015), atol=0.003)
    assert [name for name, move in moves.items() if move.gripper] == ["over", "grasp", "release"]
    facing = moves["down"].facing_rad
    assert facing is not None
    off = (facing - red.yaw_rad + np.pi / 4) % (np.pi / 2) - np.pi / 4
    assert abs(off) < 0.04
    assert moves["home"].to_m == scene.home_m


def test_the_macro_has_the_eight_instructions_of_the_thesis(on: Skill) -> None:
    scene = placing_scene("on", SEED)
    things = things_in(view(scene), scene.camera)
    done = macro(on, *check_scene(on, things), things, home_m=scene.home_m)
    assert [one.text for one in done.instructions] == list(INSTRUCTIONS)
    assert done.instructions[0].result == ARM
    assert all(one.result for one in done.instructions)
    # All rules are reached, and all moves made, by one of the three segments.
    segments = [segment for one in done.instructions for segment in one.segments]
    assert [rule for segment in segments for rule in segment.rules] == list(on.rules)
    assert [segment.moves for segment in segments] == [step.moves for step in done.steps]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({2: _rule(3, GREEN, RED, "TN")}, r"got \{green box, red box\} T→N in column 4"),
        ({2: _rule(3, GREEN, ARM, "NT")}, r"got \{green box, robot arm\} N→T in column 4"),
        ({4: _rule(5, RED, ARM, "NT")}, r"at this time, got \{red box, robot arm\} N→T in column 6"),
        ({1: _rule(2, RED, TABLE, "TN")}, "expected transitions to touch"),
        ({3: _rule(4, RED, TABLE, "TN")}, r"at this time, got \{red box, table\} T→N in column 5"),
        ({0: _rule(1, GREEN, TABLE, "TA")}, r"got \{green box, table\} T→A in column 2"),
        ({3: _rule(4, RED, ARM, "NA")}, "expected transitions to part"),
    ],
)
def test_changes_that_no_instruction_covers_are_refused(push: Skill, changes: dict[int, Rule], message: str) -> None:
    rules = tuple(changes.get(place, rule) for place, rule in enumerate(PUSHING))
    with pytest.raises(MacroError, match=message):
        allotted(replace(push, rules=rules))


def test_what_is_lifted_has_to_be_held(push: Skill) -> None:
    rules = (*PUSHING[:2], _rule(2, RED, TABLE, "TN"), *PUSHING[2:])
    with pytest.raises(MacroError, match="the fingers do not close"):
        allotted(replace(push, rules=rules))


def test_movers_and_touched_objects() -> None:
    arm, box = PrimeMover(ARM, {ARM: 9}), PrimeMover(RED, {RED: 3})
    assert identify_prime_mover([arm, box, arm]) == ARM
    with pytest.raises(ValueError, match="at least, got none"):
        identify_prime_mover([])
    # Meeting the ground again is no second touched object.
    rules = (*PUSHING[:2], _rule(3, RED, TABLE, "NT"), *PUSHING[2:])
    assert identify_first_touched(rules, ARM) == (RED, PUSHING[1])
    assert identify_second_touched(rules, ARM, RED) == (GREEN, PUSHING[2])
    with pytest.raises(MacroError, match="of 'hand', got"):
        identify_first_touched(rules, "hand")
    with pytest.raises(MacroError, match="two transitions from N to T, got 1"):
        identify_second_touched(PUSHING[:2], ARM, RED)
    with pytest.raises(MacroError, match=r"second transition N→T of 'red box', got \{green box, robot arm\}"):
        identify_second_touched((PUSHING[1], _rule(3, GREEN, ARM, "NT")), ARM, RED)


def test_what_is_too_wide_for_the_fingers_is_refused(on: Skill) -> None:
    scene = placing_scene("on", SEED)
    wide = replace(scene.thing(RED), size_m=(0.1, 0.1, 0.05))
    things = things_in(view(replace(scene, things=(wide, scene.thing(GREEN)))), scene.camera)
    with pytest.raises(SceneError, match="the fingers open to"):
        plan(on, things, home_m=scene.home_m)


def test_turn_of_a_footprint() -> None:
    rng = np.random.default_rng(0)
    rectangle = np.array([(-2, -1), (2, -1), (2, 1), (-2, 1)], dtype=float)
    for turn in rng.uniform(0, np.pi / 2, 20):
        rotation = np.array([(np.cos(turn), -np.sin(turn)), (np.sin(turn), np.cos(turn))])
        found = turn_of(rectangle @ rotation.T + rng.uniform(-1, 1, 2))
        assert found == pytest.approx(turn)
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    assert turn_of(np.stack([np.cos(angles), np.sin(angles)], axis=-1)) is None


def test_angles_agree_up_to_their_period() -> None:
    quarter = np.pi / 2
    mean, agreement = agreed_angle(0.3 + quarter * np.array([0, 1, 5, -2]), quarter)
    assert (mean, agreement) == (pytest.approx(0.3), pytest.approx(1.0))
    # A mean within its own uncertainty is none.
    assert agreed_angle([-0.02, 0.021], quarter)[0] == 0.0
    assert agreed_angle([0.019, 0.021], quarter)[0] == pytest.approx(0.02)
    assert agreed_angle([0.0, quarter / 2], quarter)[1] < 0.1
    assert agreed_angle([np.nan, np.nan, 0.1], quarter) == (0.0, 0.0)


def _seen(name: str, x: float) -> SeenThing:
    corners = np.array([(-0.03, -0.03), (0.03, -0.03), (0.03, 0.03), (-0.03, 0.03)]) + np.array([x, 0.0])
    return SeenThing(name, 1, np.c_[corners, np.full(4, 0.06)], corners, np.array([x, 0.0, 0.03]), 0.06, 0.0, 1)


def test_fingers_close_in_all_demonstrations_or_in_none() -> None:
    tip = np.array([0.2, 0.0, 0.04])
    closing, pushing = (
        Handling(_seen(RED, 0.2), _seen(GREEN, 0.4), _seen(RED, 0.3), opening, tip, 0.0, tip, 0.0, None)
        for opening in ((0.28, -0.1, 0.28), (-0.24, -0.24, -0.24))
    )
    assert agreed_hand([closing, closing]).closes
    assert not agreed_hand([pushing]).closes
    with pytest.raises(ValueError, match=r"in all of them or in none, got \[True, False\]"):
        agreed_hand([closing, pushing])


def test_gaps_above_each_other() -> None:
    corners = np.array([(-0.03, -0.03), (0.03, -0.03), (0.03, 0.03), (-0.03, 0.03)])
    low = Solid(np.array([0.2, 0.0]), 0.05, 0.0, corners, np.zeros(3), 0.0)
    beside = replace(low, centre_m=np.array([0.27, 0.0]))
    assert gap_between(low, beside) == pytest.approx(0.01)
    assert gap_between(low, raised(beside, 0.02)) == pytest.approx(0.01)
    over = raised(replace(low, centre_m=np.array([0.21, 0.01])), 0.09)
    # 40 mm of air, of which four count as standing.
    assert gap_between(low, over) == gap_between(over, low) == pytest.approx(0.036)
    assert gap_between(low, raised(low, 0.052)) == 0.0
    assert gap_between(low, raised(beside, 0.084)) == pytest.approx(np.hypot(0.01, 0.03))
    assert gap_to_points(over, np.array([[0.21, 0.01, 0.06]])) == pytest.approx(0.03)
    assert raised(low, 0.0) is low


@pytest.mark.slow
@pytest.mark.parametrize("placing", ["on", "beside"])
def test_the_arm_picks_and_places_and_judges_itself(placing: str, request: pytest.FixtureRequest) -> None:
    scene = placing_scene(placing, SEED, number=1)  # type: ignore[arg-type]
    done = execute_skill(scene, request.getfixturevalue(placing))
    assert done.success
    assert all(verdict.agrees for verdict in done.verdicts if verdict.attempt == done.n_attempts - 1)
    assert done.truth.touching(RED, GREEN)[-1]
    assert done.truth.touching(RED, TABLE)[-1] == (placing == "beside")
    end, _ = placing_pose(placing, scene)  # type: ignore[arg-type]
    np.testing.assert_allclose(done.truth.poses[RED][-1][:3, 3], end, atol=0.005)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "rule"),
    [
        (Fault("drops", "carry", RED, share=0.15), "{green box, red box} N→T"),
        (Fault("missed", "over", offset_m=(0.0, 0.11)), "{red box, robot arm} N→T"),
    ],
)
def test_failures_of_pick_and_place_are_recognised(on: Skill, fault: Fault, rule: str) -> None:
    scene = placing_scene("on", SEED, number=1)
    failed = execute_skill(scene, on, fault=fault, most_attempts=1)
    assert not failed.success
    assert next(verdict.rule for verdict in failed.verdicts if not verdict.agrees) == rule
