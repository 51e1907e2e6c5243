"""Planted failures of pushing and of pick-and-place: recognised at the move in which they happen (§2.10.5)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from sec_lab.execution.loop import Verdict, execute_skill
from sec_lab.execution.placing_study import PLACING_SCENES_SEED, is_placed
from sec_lab.execution.skill import Skill, Step, told
from sec_lab.execution.study import SEED, end_touching, rates_of, table_of
from sec_lab.worlds.katana.placing import Placing, placing_scene
from sec_lab.worlds.katana.records import Fault, Scene
from sec_lab.worlds.katana.scenes import random_scene, reach_of

if TYPE_CHECKING:
    import pandas as pd

Failure = Literal["slips", "missed", "wrong object", "removed", "second removed", "springs back"]
PlacingFailure = Literal["drops", "missed", "wrong object", "removed", "second removed"]
N_PLANTED, N_PLACING_PLANTED = 6, 3

_MISSES_BY_M = 0.07
"""Between the rim of a thing and the tip of an arm that misses it: more than half a hand."""
_SPRINGS_BACK_M = (0.0015, 0.002, 0.003, 0.004, 0.005)
_REACH_M = (0.15, 0.42)


@dataclass(frozen=True)
class PlantedTrial:
    """One failure planted in a random scene.

    Parameters
    ----------
    skill : str
        "pushing", or where the first object is put: "on" or "beside".
    number : int
        Of the scene.
    kind : str
    thing : str
        Whom it happens to.
    attempt : int
        From 1 on: the one in which it came to pass. It is the first that gets as far as the move in which the failure
        is planted, as the arm may fail by itself before; 0 if none did, or if what slipped slid to where it was to be.
    move : str
        In which it happens.
    rule : str
        That the move is to reach.
    recognised_at : str
        Rule of the first verdict of that attempt that disagrees; empty if there was none.
    why : str
        What that verdict said.
    n_attempts : int
    gave_up : str
    accepted, reached : bool
        The arm's own verdict and the truth after all attempts.
    """

    skill: str
    number: int
    kind: str
    thing: str
    attempt: int
    move: str
    rule: str
    recognised_at: str
    why: str
    n_attempts: int
    gave_up: str
    accepted: bool
    reached: bool


def pushing_fault(kind: Failure, scene: Scene, *, number: int) -> Fault:
    """A failure of pushing.

    Parameters
    ----------
    kind : {"slips", "missed", "wrong object", "removed", "second removed", "springs back"}
        The first object slips away half-way; the arm comes down beside it; it goes to the second object instead of the
        first; somebody takes the first or the second object away; the first springs back by 1.5 to 5 mm as the arm
        leaves.
    scene : Scene
    number : int
        Varies the side and the size.

    Raises
    ------
    ValueError
        If the kind is unknown.
    """
    _check(kind, get_args(Failure))
    red, green = scene.things[:2]
    way = np.array(green.p_W_m[:2]) - np.array(red.p_W_m[:2])
    way = way / np.linalg.norm(way)
    if kind == "springs back":
        x, y = (float(part) for part in -_SPRINGS_BACK_M[number % len(_SPRINGS_BACK_M)] * way)
        return Fault("springs back", "leave", red.name, offset_m=(x, y))
    if kind == "slips":
        return Fault("slips", "bring", red.name)
    return _fault(kind, scene, "bring", number=number)


def placing_fault(kind: PlacingFailure, scene: Scene, *, number: int) -> Fault:
    """A failure of pick-and-place.

    Parameters
    ----------
    kind : {"drops", "missed", "wrong object", "removed", "second removed"}
        The first object slips out of the fingers on its way; for the others see :func:`pushing_fault`.
    scene : Scene
    number : int
        Varies the side.

    Raises
    ------
    ValueError
        If the kind is unknown.
    """
    _check(kind, get_args(PlacingFailure))
    if kind == "drops":
        # Early on its way: later it may fall where it is to be.
        return Fault("drops", "carry", scene.things[0].name, share=0.15)
    return _fault(kind, scene, "carry", number=number)


def planted_trial(skill: Skill, kind: Failure, *, seed: int = SEED, number: int) -> PlantedTrial:
    """A push in one random scene in which something goes wrong.

    Parameters
    ----------
    skill : Skill
    kind : {"slips", "missed", "wrong object", "removed", "second removed", "springs back"}
        See :func:`pushing_fault`.
    seed, number : int
        Of the scene.

    Raises
    ------
    ValueError
        If the kind is unknown, or the scene is refused.
    """
    scene = random_scene(seed, number=number)
    return _tried("pushing", kind, scene, skill, pushing_fault(kind, scene, number=number), number=number)


def placing_planted_trial(
    skill: Skill, placing: Placing, kind: PlacingFailure, *, seed: int = PLACING_SCENES_SEED, number: int
) -> PlantedTrial:
    """Pick-and-place in one random scene in which something goes wrong.

    Parameters
    ----------
    skill : Skill
    placing : {"on", "beside"}
    kind : {"drops", "missed", "wrong object", "removed", "second removed"}
        See :func:`placing_fault`.
    seed, number : int
        Of the scene.

    Raises
    ------
    ValueError
        If the kind is unknown, or the scene is refused.
    """
    scene = placing_scene(placing, seed, number=number, more=True)
    return _tried(placing, kind, scene, skill, placing_fault(kind, scene, number=number), number=number)


def planted_trials(skill: Skill, *, seed: int = SEED, n: int = N_PLANTED, n_jobs: int = 1) -> "pd.DataFrame":
    """All kinds of failures of pushing in the first random scenes, one row each; see :class:`PlantedTrial`.

    Parameters
    ----------
    skill : Skill
    seed : int, optional
    n : int, optional
        In how many scenes.
    n_jobs : int, optional
        How many at a time; the table does not depend on it.
    """
    kinds: tuple[Failure, ...] = get_args(Failure)
    return table_of(
        [partial(planted_trial, skill, kind, seed=seed, number=number) for number in range(n) for kind in kinds],
        n_jobs=n_jobs,
    )


def placing_planted_trials(
    skills: Mapping[Placing, Skill], *, seed: int = PLACING_SCENES_SEED, n: int = N_PLACING_PLANTED, n_jobs: int = 1
) -> "pd.DataFrame":
    """All kinds of failures of pick-and-place in the first random scenes; see :func:`planted_trials`.

    Parameters
    ----------
    skills : mapping of {"on", "beside"} to Skill
    seed : int, optional
    n : int, optional
        In how many scenes of each.
    n_jobs : int, optional
    """
    kinds: tuple[PlacingFailure, ...] = get_args(PlacingFailure)
    return table_of(
        [
            partial(placing_planted_trial, skill, placing, kind, seed=seed, number=number)
            for placing, skill in skills.items()
            for number in range(n)
            for kind in kinds
        ],
        n_jobs=n_jobs,
    )


def planted_rates(table: "pd.DataFrame") -> "pd.DataFrame":
    """Counts of planted failures for each kind, with their Wilson intervals of 95 %.

    Parameters
    ----------
    table : pandas.DataFrame
        As it is made, or read by ``pandas.read_csv(..., keep_default_na=False)``.

    Returns
    -------
    pandas.DataFrame
        A row each: came to pass; of these, recognised at their move, by kind and in all; reached after further attempts
        (of those in which nothing was taken away); verdict right in the end.
    """
    came = table[table["attempt"] > 0]
    right = came["recognised_at"] == came["rule"]
    there = came[~came["kind"].str.endswith("removed")]
    counts = {
        "came to pass": (len(came), len(table)),
        **{
            f"recognised at its move: {kind}": (int(right[came["kind"] == kind].sum()), n)
            for kind, n in came["kind"].value_counts(sort=False).items()
        },
        "recognised at its move": (int(right.sum()), len(came)),
        "reached after further attempts": (int(there["reached"].astype(bool).sum()), len(there)),
        "verdict right in the end": (
            int((table["reached"].astype(bool) == table["accepted"].astype(bool)).sum()),
            len(table),
        ),
    }
    return rates_of(counts)


def _check(kind: str, kinds: tuple[str, ...]) -> None:
    if kind not in kinds:
        raise ValueError(f"kind: expected one of {kinds}, got {kind!r}")


def _fault(kind: str, scene: Scene, move: str, *, number: int) -> Fault:
    red, green = scene.things[:2]
    if kind == "wrong object":
        return Fault("wrong object", "over", green.name, red.name)
    if kind == "missed":
        way = np.array(green.p_W_m[:2]) - np.array(red.p_W_m[:2])
        aside = (reach_of(red) + _MISSES_BY_M) * np.array([-way[1], way[0]]) / np.linalg.norm(way)
        # To the side that the arm reaches; where both are, in turn.
        sides = [side for side in (1.0, -1.0) if _REACH_M[0] < np.hypot(*(red.p_W_m[:2] + side * aside)) < _REACH_M[1]]
        x, y = (float(part) for part in (sides or [1.0])[number % max(len(sides), 1)] * aside)
        return Fault("missed", "over", red.name, offset_m=(x, y))
    return Fault("removed", move, (green if kind == "second removed" else red).name)


def _tried(name: str, kind: str, scene: Scene, skill: Skill, fault: Fault, *, number: int) -> PlantedTrial:
    plans: list[Sequence[Step]] = []

    def tell(steps: Sequence[Step], _: Sequence[Verdict]) -> None:
        plans.append(steps)

    done = execute_skill(scene, skill, fault=fault, tell=tell)
    red, green = scene.things[:2]
    rule = next(told(step.rule) for step in plans[0] if fault.move in [move.name for move in step.moves])
    came_in = done.failed_in
    if kind in ("slips", "drops") and done.truth.touching(red.name, green.name)[done.failed_by or -1]:
        came_in = None
    wrong = [one for one in done.verdicts if one.attempt == came_in and not one.agrees]
    return PlantedTrial(
        name,
        number,
        kind,
        str(fault.thing),
        0 if came_in is None else came_in + 1,
        fault.move,
        rule,
        wrong[0].rule if wrong else "",
        wrong[0].why if wrong else "",
        done.n_attempts,
        done.gave_up,
        done.success,
        end_touching(done, red, green) if name == "pushing" else is_placed(done, name),
    )
