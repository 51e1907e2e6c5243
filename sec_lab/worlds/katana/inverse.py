"""Inverse kinematics by Drake's general solver, which knows the arm from its description only."""

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sec_lab.worlds.katana.kinematics import JOINTS, UnreachableError
from sec_lab.worlds.katana.records import Floats, as_point

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant

_TOLERANCE_M, _AXIS_M = 1e-6, 0.2


def solved_joint_angles(p_WT_m: ArrayLike, along: ArrayLike, opening: ArrayLike, *, guess_rad: ArrayLike) -> Floats:
    """Joint angles within their limits that bring the tip to a point and the hand into a direction.

    Parameters
    ----------
    p_WT_m : (3,) array_like of float
        Of the tip, in the world.
    along, opening : (3,) array_like of float
        Unit vectors along which the hand points and its fingers open.
    guess_rad : (5,) array_like of float
        Where the solver starts.

    Returns
    -------
    (5,) float64

    Raises
    ------
    UnreachableError
        If the solver finds none.

    Examples
    --------
    >>> from sec_lab.worlds.katana.kinematics import hand_axes, joint_angles
    >>> goal = joint_angles([0.3, 0.1, 0.03], roll_rad=0.2)
    >>> found = solved_joint_angles([0.3, 0.1, 0.03], *hand_axes(goal), guess_rad=goal + 0.2)
    >>> bool(abs(found - goal).max() < 1e-4)
    True
    """
    from pydrake.multibody.inverse_kinematics import InverseKinematics
    from pydrake.solvers import Solve

    point: Any = np.array(as_point(p_WT_m, what="p_WT_m"))
    guess = np.asarray(guess_rad, dtype=np.float64)
    if guess.shape != (len(JOINTS),) or not np.isfinite(guess).all():
        raise ValueError(f"guess_rad: expected {len(JOINTS)} finite numbers, got {guess}")
    arm = _arm()
    problem = InverseKinematics(arm, with_joint_limits=True)
    tool, world = arm.GetFrameByName("tool"), arm.world_frame()
    # Points on the axes of the tool: angles between axes, given by their cosines, would be known too roughly near zero.
    axes = np.stack([np.zeros(3), np.asarray(along, dtype=np.float64), np.asarray(opening, dtype=np.float64)])
    for own, in_world in zip(np.eye(3)[[0, 0, 1]] * [[0], [1], [1]], axes, strict=True):
        place: Any = _AXIS_M * own
        goal: Any = point + _AXIS_M * in_world
        problem.AddPositionConstraint(tool, place, world, goal - _TOLERANCE_M, goal + _TOLERANCE_M)
    program = problem.get_mutable_prog()
    start: Any = np.concatenate([guess, np.zeros(arm.num_positions() - len(JOINTS))])
    weights: Any = np.eye(len(start))
    program.AddQuadraticErrorCost(weights, start, problem.q())
    result = Solve(program, start)
    if not result.is_success():
        where = ", ".join(f"{value:.3f}" for value in as_point(point, what="p_WT_m"))
        raise UnreachableError(f"({where}) m: the solver found no joint angles within their limits")
    return np.asarray(result.GetSolution(problem.q()))[: len(JOINTS)]


@lru_cache(maxsize=1)
def _arm() -> "MultibodyPlant":
    from sec_lab.worlds.katana.bench import arm_alone

    return arm_alone()
