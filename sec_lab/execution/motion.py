"""Motion of the arm: straight segments of the tip, checked as a whole before anything moves, then made and filmed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sec_lab.recording import Recording
from sec_lab.worlds.katana.bench import STEP_S
from sec_lab.worlds.katana.kinematics import UnreachableError, joint_angles
from sec_lab.worlds.katana.paths import FINGER_RAD, path_of
from sec_lab.worlds.katana.records import Fault, Gripper, Move, Scene, Truth
from sec_lab.worlds.katana.run import Run

__all__ = ["Execution", "Fault", "Move", "Run", "UnreachableError", "check_plan", "execute"]


@dataclass(frozen=True, eq=False)
class Execution:
    """What came of a plan.

    Parameters
    ----------
    recording : Recording
        With range pictures and times.
    scene : Scene
        With every thing where it ended (truth).
    truth : Truth
        For judging only.
    move_ends : tuple of int
        Number of the frame at which each move had ended.
    """

    recording: Recording
    scene: Scene
    truth: Truth
    move_ends: tuple[int, ...]


def check_plan(scene: Scene, plan: Sequence[Move], *, gripper: Gripper = "ajar") -> None:
    """Nothing if the arm can make all moves of a plan, one after the other; the reason otherwise.

    Parameters
    ----------
    scene : Scene
    plan : sequence of Move
    gripper : {"open", "ajar", "closed"}, optional
        At the start.

    Raises
    ------
    UnreachableError
        It names the move.

    Examples
    --------
    >>> from sec_lab.worlds.katana import example_scene
    >>> check_plan(example_scene("a"), [Move((0.7, 0.0, 0.03), name="push")])
    Traceback (most recent call last):
    ...
    sec_lab.worlds.katana.kinematics.UnreachableError: move 0 (push): ... the arm reaches 0.615 m
    """
    q = np.concatenate([joint_angles(scene.start_m), np.full(2, FINGER_RAD[gripper])])
    for number, move in enumerate(plan):
        try:
            path = path_of(q, move, step_s=STEP_S).q_rad
        except UnreachableError as error:
            raise UnreachableError(f"move {number} ({move.name}): {error}") from error
        q = path[-1] if len(path) else q


def execute(
    scene: Scene,
    plan: Sequence[Move],
    *,
    fault: Fault | None = None,
    labels: bool = False,
    gripper: Gripper = "ajar",
) -> Execution:
    """Let the arm make the moves of a plan; for one move at a time, see :class:`Run`.

    Parameters
    ----------
    scene : Scene
    plan : sequence of Move
    fault : Fault, optional
        What goes wrong.
    labels : bool, optional
        Whether the truth has label pictures.
    gripper : {"open", "ajar", "closed"}, optional
        At the start.

    Returns
    -------
    Execution

    Raises
    ------
    UnreachableError
        Before anything moves.
    ValueError
        If a fault is that of a thing or a move that is not there.
    """
    if fault is not None and fault.move not in [move.name for move in plan]:
        raise ValueError(f"fault: expected a move of {[move.name for move in plan]}, got {fault.move!r}")
    check_plan(scene, plan, gripper=gripper)
    run = Run(scene, fault=fault, labels=labels, gripper=gripper)
    for move in plan:
        run.move(move)
    return Execution(run.recording, run.scene, run.truth, tuple(run.move_ends))
