"""The closed loop (§2.10.5, §2.10.6): look, plan, move, look again, compare with the model after every move, retry."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sec_lab.codes import LETTER_OF, Relation
from sec_lab.event_chain import EventChain
from sec_lab.execution.motion import Run, check_plan
from sec_lab.execution.perception import CONTACT_M, TABLE, Perceived, Watcher, things_in
from sec_lab.execution.planning import Skill, Step, plan, shifted
from sec_lab.execution.relative_poses import Hand
from sec_lab.observation import Observation
from sec_lab.recording import Recording
from sec_lab.worlds.katana.records import Fault, Move, Scene, Truth

_NUDGE_M, _MOST_FURTHER_M, _MOST_NUDGES = 0.005, 0.02, 4
_MOVED_M = 0.006
_LOOSE = 2.5
"""How much wider than in the demonstrations the gap between things that touch may look."""
_MOST_ATTEMPTS = 3
_REST_S = 0.5
_OVER_M = 0.15


@dataclass(frozen=True)
class Verdict:
    """What the arm says of itself after a rule.

    Parameters
    ----------
    attempt : int
        From 0 on.
    rule : str
        Such as "{red box, robot arm} N→T".
    frame : int
        Of the look.
    agrees : bool
        Whether the chain so far is the model's.
    why : str
        What is different, if anything.
    """

    attempt: int
    rule: str
    frame: int
    agrees: bool
    why: str


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of an execution.

    Parameters
    ----------
    success : bool
        By the self-check, at the very end.
    verdicts : tuple of Verdict
    perceived : Perceived
        Of the last attempt.
    recording : Recording
        Of everything.
    truth : Truth
        For judging only.
    scene : Scene
        Afterwards (truth).
    n_attempts : int
    gave_up : str
        Why there was no further attempt; empty after success.
    time_s : float
        Simulated.
    """

    success: bool
    verdicts: tuple[Verdict, ...]
    perceived: Perceived
    recording: Recording
    truth: Truth
    scene: Scene
    n_attempts: int
    gave_up: str
    time_s: float

    @property
    def chain(self) -> EventChain | None:
        """Chain of the last attempt."""
        return self.perceived.chain


def execute_skill(
    scene: Scene, skill: Skill, *, fault: Fault | None = None, most_attempts: int = _MOST_ATTEMPTS
) -> Outcome:
    """Let the arm do what it has learned, in a scene as the camera sees it.

    Parameters
    ----------
    scene : Scene
        Where things are is used by the simulator alone.
    skill : Skill
    fault : Fault, optional
        What goes wrong.
    most_attempts : int, optional

    Returns
    -------
    Outcome

    Raises
    ------
    SceneError, UnreachableError
        At the first look, before anything moves: nothing can be done, or not by this arm.
    """
    run = Run(scene, fault=fault, watched=True)
    things = things_in(run.view(), scene.camera)
    steps = plan(skill, things, home_m=scene.home_m)
    check_plan(scene, [move for step in steps for move in step.moves])
    verdicts: list[Verdict] = []
    attempt, gave_up = 0, ""
    while True:
        watcher = Watcher(scene.camera, frames_per_second=20.0)
        watcher.add(run.view())
        seen = _seen_from(run, watcher, run.n_frames)
        agrees = True
        for step in steps:
            verdict = _do(run, step, watcher, seen, skill, attempt)
            verdicts.append(verdict)
            if not verdict.agrees:
                agrees = False
                break
        if agrees:
            break
        _withdraw(run, scene, seen, skill.hand)
        attempt += 1
        if attempt >= most_attempts:
            gave_up = f"{attempt} attempts failed"
            break
        try:
            things = things_in(run.view(), scene.camera)
            steps = plan(skill, things, home_m=scene.home_m)
            for step in steps[:1]:
                run.check(step.moves[0])
        except ValueError as error:
            gave_up = str(error)
            break
    return Outcome(
        agrees,
        tuple(verdicts),
        watcher.perceived(),
        run.recording,
        run.truth,
        run.scene,
        attempt + (0 if gave_up else 1),
        gave_up,
        run.time_s,
    )


def agreement(observation: Observation, skill: Skill, column: int) -> str:
    """What is different between what was seen so far and the model up to a column; empty if nothing.

    Each row of the model is compared by its changes in their order; relations of the prime mover and the first object
    with things that the model does not know are differences, too. Only touching the table is passed over.

    Parameters
    ----------
    observation : Observation
    skill : Skill
    column : int
        Of the model.
    """
    seen = _letters(observation.chain)
    wanted = {
        frozenset((str(skill.model.chain.names[int(a)]), str(skill.model.chain.names[int(b)]))): _compressed(
            "".join(LETTER_OF[Relation(int(code))] for code in row[: column + 1])
        )
        for (a, b), row in zip(skill.model.chain.pairs, skill.model.chain.relations, strict=True)
    }
    for pair, letters in wanted.items():
        got = seen.get(pair, "A")
        if got != letters:
            return f"{_told(pair)}: expected {letters}, got {got}"
    for pair, letters in seen.items():
        if pair not in wanted and TABLE not in pair and "T" in letters and pair & {skill.prime, skill.first}:
            return f"{_told(pair)}: expected no touching, got {letters}"
    return ""


def loose(perceived: Perceived, skill: Skill) -> str:
    """What is wrong with the final contact of first and second object as it looks with the arm away; empty if nothing.

    Parameters
    ----------
    perceived : Perceived
    skill : Skill
    """
    gap, most = perceived.last_gap_m(skill.first, skill.second), _LOOSE * skill.contact_gap_m
    # What touches may hide where; then it is the other's having been moved that tells.
    if gap <= most or (gap <= CONTACT_M[0] and perceived.moved_m[skill.second] >= _MOVED_M):
        return ""
    return f"{_told(frozenset((skill.first, skill.second)))}: expected a gap of at most {most:.4f} m, got {gap:.4f} m"


def _do(run: Run, step: Step, watcher: Watcher, seen: Callable[[], None], skill: Skill, attempt: int) -> Verdict:
    """Make the moves of a rule and look; go on a little where the transition alone is missing."""
    moves: Sequence[Move] = step.moves
    why = ""
    pair, further_m = frozenset(step.rule.pair), 0.0
    for nudge in range(_MOST_NUDGES + 1):
        for move in moves:
            run.move(move)
        seen()
        perceived = watcher.perceived()
        why = agreement(perceived.observation, skill, step.rule.column)
        if not why and step.column_is_last:
            why = loose(perceived, skill)
        onward = step.onward or (np.cos(step.heading_rad), np.sin(step.heading_rad), 0.0)
        if (
            step.rule.change != "NT"
            or not any(onward)
            or nudge == _MOST_NUDGES
            or (why and not why.startswith(_told(pair) + ":"))
        ):
            break
        # The model asks for touching; how close that looks, the demonstrations have shown.
        gap = perceived.last_gap_m(*step.rule.pair)
        firm = gap <= skill.contact_gap_m or perceived.moved_m.get(skill.second, 0.0) >= _MOVED_M
        if not why and (skill.prime in pair or firm):
            break
        further_m += max(_NUDGE_M, min(gap, _MOST_FURTHER_M)) if skill.prime not in pair else _NUDGE_M
        moves = (shifted(step.moves[-1], further_m * np.array(onward)),)
    rule = f"{_told(frozenset(step.rule.pair))} {step.rule.change[0]}→{step.rule.change[1]}"
    return Verdict(attempt, rule, len(watcher), not why, why)


def _withdraw(run: Run, scene: Scene, seen: Callable[[], None], hand: Hand) -> None:
    """Up and home with empty hands, whatever has happened."""
    x, y, z = run.tip_m
    if hand.closes:
        run.move(Move((x, y, z), hand.after, "let go"))
    if z < _OVER_M:
        run.move(Move((x, y, _OVER_M), name="up", speed_m_s=0.1))
    run.move(Move(scene.home_m, name="home", speed_m_s=0.3))
    seen()


def _seen_from(run: Run, watcher: Watcher, start: int) -> Callable[[], None]:
    """A function that shows the watcher all frames that are new, from a number on."""
    taken = start

    def look() -> None:
        nonlocal taken
        for frame in run.frames_since(taken):
            watcher.add(frame)
        taken = run.n_frames

    return look


def _letters(chain: EventChain) -> Mapping[frozenset[str], str]:
    return {
        frozenset((str(chain.names[int(a)]), str(chain.names[int(b)]))): _compressed(
            "".join(LETTER_OF[Relation(int(code))] for code in row)
        )
        for (a, b), row in zip(chain.pairs, chain.relations, strict=True)
    }


def _compressed(letters: str) -> str:
    return "".join(letter for place, letter in enumerate(letters) if place == 0 or letters[place - 1] != letter)


def _told(pair: frozenset[str]) -> str:
    return "{" + ", ".join(sorted(pair)) + "}"
