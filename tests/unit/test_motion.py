"""Plans: checked whole before anything moves, then made and filmed."""

import numpy as np
import pytest

from sec_lab.execution.motion import Fault, Move, UnreachableError, check_plan, execute
from sec_lab.worlds.katana import example_scene


def test_what_comes_of_a_plan() -> None:
    scene = example_scene("a")
    plan = Move((0.2, -0.1, 0.15), name="above", speed_m_s=0.4), Move(scene.home_m, name="home", speed_m_s=0.4)
    done = execute(scene, plan)
    assert len(done.recording) == len(done.truth.tip_m) == done.move_ends[-1] + 1
    np.testing.assert_allclose(done.truth.tip_m[list(done.move_ends)], [move.to_m for move in plan], atol=1e-3)
    assert done.recording.has_depth
    assert [one.name for one in done.scene.things] == ["red box", "green box"]


def test_a_plan_out_of_reach_is_refused_before_anything_moves() -> None:
    plan = Move((0.2, -0.1, 0.15), name="above"), Move((0.7, 0.0, 0.03), name="far")
    with pytest.raises(UnreachableError, match=r"move 1 \(far\): .* the arm reaches 0.615 m"):
        execute(example_scene("a"), plan)
    with pytest.raises(UnreachableError, match="move 1"):
        check_plan(example_scene("a"), plan)


def test_a_fault_needs_its_move_and_its_thing() -> None:
    plan = (Move((0.2, -0.1, 0.15), name="above"),)
    with pytest.raises(ValueError, match="fault: expected a move of"):
        execute(example_scene("a"), plan, fault=Fault("slips", "push", "red box"))
    with pytest.raises(ValueError, match="thing: expected one of"):
        execute(example_scene("a"), plan, fault=Fault("slips", "above", "teapot"))
