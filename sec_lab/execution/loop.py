"""The closed loop (§2.10.5, §2.10.6): look, plan, move, look again, compare with the model after every move, retry."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sec_lab.codes import LETTER_OF, Relation
from sec_lab.event_chain import EventChain
from sec_lab.execution.corridor import way_home
from sec_lab.execution.motion import Run, UnreachableError
from sec_lab.execution.perception import TABLE, Perceived, Watcher
from sec_lab.execution.planning import Skill, Step, plan, shifted, told
from sec_lab.execution.relative_poses import Hand
from sec_lab.observation import Observation
from sec_lab.recording import Recording
from sec_lab.worlds.katana.records import Fault, Floats, Move, Scene, Truth
from sec_lab.worlds.katana.run import FRAMES_PER_SECOND

_NUDGE_M, _TOUCH_M, _MOST_FURTHER_M, _MOST_NUDGES = 0.003, 0.0005, 0.02, 6
_PUSHED_M = 0.001
"""Who moves by this was touched: the second object's motion proves that the first has reached it."""
_LOOSE_M, _OFF_M = 0.0003, 0.0002
"""How much wider than while the one pushed the other their gap may look in the end; and how far off a gap may look
besides what a pixel hides: twice the step of the range finder."""
_NEAR_M = 0.0005
"""How much wider it may look still while the arm is near, which may hide a part."""
_LET_GO_M = 0.0005
"""The same of what was let go beside it, not pressed on."""
_MOST_ATTEMPTS = 4
_SLOWER = 0.5
"""Share of its speed at which the arm moves among the things after a failure."""
_STILL_M, _LOOK_S, _MOST_LOOKS = 0.0004, 0.25, 8
"""Things rest if they have moved by less than this within the last frames; how long to wait for it, and how often."""
_OVER_M = (0.15, 0.12, 0.10, 0.08)
"""Heights to withdraw to, the best first."""


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
    failed_in, failed_by : int or None
        Number of the attempt in which a planted failure struck, and of the last frame of its rule, for judging only;
        None if none did.
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
    failed_in: int | None = None
    failed_by: int | None = None

    @property
    def chain(self) -> EventChain | None:
        """Chain of the last attempt."""
        return self.perceived.chain


def execute_skill(
    scene: Scene,
    skill: Skill,
    *,
    fault: Fault | None = None,
    most_attempts: int = _MOST_ATTEMPTS,
    run: Run | None = None,
    tell: Callable[[Sequence[Step], Sequence[Verdict]], object] | None = None,
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
    run : Run, optional
        Of this scene, watched, in which nothing has moved yet; for those who show it meanwhile. It has its own fault.
    tell : callable, optional
        Is told the plan of the attempt and all verdicts so far, whenever there is a new plan or verdict.

    Returns
    -------
    Outcome

    Raises
    ------
    SceneError, UnreachableError
        At the first look, before anything moves: nothing can be done, or not by this arm.
    """
    run = Run(scene, fault=fault, watched=True) if run is None else run
    watcher = Watcher(scene.camera, frames_per_second=FRAMES_PER_SECOND)
    steps = _planned(run, watcher, scene, skill, again=False)
    verdicts: list[Verdict] = []
    attempt, gave_up = 0, ""
    failed_in: int | None = None
    failed_by: int | None = None
    while True:
        if tell is not None:
            tell(steps, tuple(verdicts))
        seen = _seen_from(run, watcher, run.n_frames)
        agrees, pressed, further = True, None, np.zeros(3)
        for planned in steps:
            # What is held is let go where it has been brought, not where it was to be brought.
            step = _shifted(planned, further) if skill.hand.closes else planned
            why, further = _do(run, step, watcher, seen, skill)
            if failed_in is None and run.has_failed:
                failed_in, failed_by = attempt, run.n_frames - 1
            perceived = watcher.perceived()
            if not why and frozenset(step.rule.pair) == {skill.first, skill.second}:
                pressed = 0.0 if skill.hand.closes else _pressed(perceived, skill)
            has_parted = step.rule.change == "TN" and set(step.rule.pair) == {skill.prime, skill.first}
            if not why and (has_parted or step.column_is_last):
                why = loose(perceived, skill, pressed_m=pressed, spare_m=0.0 if step.column_is_last else _NEAR_M)
            verdicts.append(Verdict(attempt, told(step.rule), len(watcher), not why, why))
            if tell is not None:
                tell(steps, tuple(verdicts))
            if why:
                agrees = False
                break
        if agrees:
            break
        _withdraw(run, scene, seen, skill.hand)
        attempt += 1
        if attempt >= most_attempts:
            gave_up = f"{attempt} attempts failed"
            break
        # What has been seen whole stays known, though it may be half hidden now.
        renewed = Watcher(
            scene.camera, frames_per_second=FRAMES_PER_SECOND, known=watcher.known, touching=watcher.touching()
        )
        try:
            steps = _planned(run, renewed, scene, skill, again=True)
        except ValueError as error:
            gave_up = str(error)
            break
        watcher = renewed
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
        failed_in,
        failed_by,
    )


def agreement(observation: Observation, skill: Skill, column: int) -> str:
    """What is different between what was seen so far and the model up to a column; empty if nothing.

    Each row of the model is compared by its changes in their order: what was seen has to contain them all and to end
    as they do; a contact that is lost and found again between is no failure. Relations of the prime mover and the first
    object with things that the model does not know are differences, too. Only touching the table is passed over.

    Parameters
    ----------
    observation : Observation
    skill : Skill
    column : int
        Of the model.
    """
    seen = _letters(observation.chain)
    wanted = {
        frozenset((str(skill.model.chain.names[int(a)]), str(skill.model.chain.names[int(b)]))): "".join(
            LETTER_OF[Relation(int(code))] for code in row
        )
        for (a, b), row in zip(skill.model.chain.pairs, skill.model.chain.relations, strict=True)
    }
    for pair, row in wanted.items():
        got, letters = seen.get(pair, "A"), _compressed(row[: column + 1])
        # On its way home the prime mover may be out of view a little early.
        if skill.prime in pair and got.endswith("A") and _compressed(row) == letters + "A":
            letters += "A"
        # What looks as if it touched when a further attempt begins cannot be seen to begin it.
        if pair == {skill.first, skill.second} and got.startswith("T"):
            letters = got[0] if letters[-1] == "T" or got[-1] == "A" else got
        if got[-1] != letters[-1] or not _contains(got, letters):
            return f"{_told(pair)}: expected {letters}, got {got}"
    for pair, letters in seen.items():
        if pair not in wanted and TABLE not in pair and "T" in letters and pair & {skill.prime, skill.first}:
            return f"{_told(pair)}: expected no touching, got {letters}"
    return ""


def loose(perceived: Perceived, skill: Skill, *, pressed_m: float | None = None, spare_m: float = 0.0) -> str:
    """What is wrong with the final contact of first and second object as it looks with the arm off; empty if nothing.

    Parameters
    ----------
    perceived : Perceived
    skill : Skill
    pressed_m : float, optional
        How wide the gap looked while the one pushed the other, so that there was none: it may look as wide again. What
        is left out is known from the demonstrations.
    spare_m : float, optional
        How much wider it may look for another reason.
    """
    gap = perceived.last_gap_m(skill.first, skill.second)
    none = skill.contact_gap_m
    if pressed_m is not None:
        # How far off a gap looks is at most what the pixels leave open. What is seen while the one presses on the other
        # cannot say more: they give way, and spring back.
        unsure = perceived.last_unsure_m(skill.first, skill.second)
        none = float(np.clip(pressed_m, -unsure, unsure + _OFF_M))
    most = none + (_LET_GO_M if skill.hand.closes else _LOOSE_M)
    most += spare_m
    if gap <= most:
        return ""
    pair = _told(frozenset((skill.first, skill.second)))
    return f"{pair}: expected a gap of at most {1000 * most:.1f} mm, got {1000 * gap:.1f} mm"


def _planned(run: Run, watcher: Watcher, scene: Scene, skill: Skill, *, again: bool) -> tuple[Step, ...]:
    """A plan for what is seen now, all of it within the arm's reach from where it is."""
    things = watcher.add(run.view(), tip_m=run.tip_m)
    steps = plan(skill, things, home_m=scene.home_m, again=again)
    if again:
        steps = tuple(replace(step, moves=tuple(_slower(move, skill) for move in step.moves)) for step in steps)
    run.check(*(move for step in steps for move in step.moves))
    return steps


def _slower(move: Move, skill: Skill) -> Move:
    return replace(move, speed_m_s=_SLOWER * move.speed_m_s) if move.speed_m_s <= skill.speed_m_s else move


def _shifted(step: Step, by_m: Floats) -> Step:
    return replace(step, moves=tuple(shifted(move, by_m) for move in step.moves)) if by_m.any() else step


def _do(run: Run, step: Step, watcher: Watcher, seen: Callable[[], None], skill: Skill) -> tuple[str, Floats]:
    """Make the moves of a rule and look; go on a little as long as only the touching is missing that it asks for.

    What is different from the model then is returned (empty if nothing), and by how much it went on.
    """
    moves: Sequence[Move] = step.moves
    pair, further_m = frozenset(step.rule.pair), 0.0
    way = np.array(step.onward or (np.cos(step.heading_rad), np.sin(step.heading_rad), 0.0))
    for nudge in range(_MOST_NUDGES + 1):
        for move in moves:
            try:
                run.move(move)
            except UnreachableError as error:
                seen()
                return f"{move.name}: {error}", further_m * way
        perceived = _once_still(run, watcher, seen, skill)
        why = agreement(perceived.observation, skill, step.rule.column)
        missing = why.startswith(_told(pair) + ":")
        gap = perceived.last_gap_m(*step.rule.pair)
        # A gap that looks like none may be one of half a millimetre; what moves was touched. What is held is not
        # pressed on, as it would spring back when it is let go: it comes as close as in the demonstrations.
        apart = gap > skill.contact_gap_m if skill.hand.closes else _pressed(perceived, skill) is None
        unsure = not why and pair == {skill.first, skill.second} and apart
        may_go_on = nudge < _MOST_NUDGES and step.rule.change == "NT" and way.any()
        if not may_go_on or not (missing or unsure):
            break
        further_m += (_TOUCH_M if skill.hand.closes else _NUDGE_M) + (
            max(0.0, min(gap, _MOST_FURTHER_M)) if skill.prime not in pair else 0.0
        )
        moves = (shifted(step.moves[-1], further_m * way),)
    return why, further_m * way


def _pressed(perceived: Perceived, skill: Skill) -> float | None:
    """How wide the gap between first and second object looks if the one has pushed the other; None if it has not."""
    if perceived.moved_m.get(skill.second, 0.0) < _PUSHED_M:
        return None
    return perceived.last_gap_m(skill.first, skill.second)


def _once_still(run: Run, watcher: Watcher, seen: Callable[[], None], skill: Skill) -> Perceived:
    """What is perceived once the things that matter rest, or have had time enough to."""
    seen()
    perceived = watcher.perceived()
    for _ in range(_MOST_LOOKS):
        if all(perceived.drift_m.get(name, 0.0) < _STILL_M for name in (skill.first, skill.second)):
            break
        run.rest(_LOOK_S)
        seen()
        perceived = watcher.perceived()
    return perceived


def _withdraw(run: Run, scene: Scene, seen: Callable[[], None], hand: Hand) -> None:
    """Up and home with empty hands, whatever has happened."""
    x, y, z = run.tip_m
    if hand.closes:
        run.move(Move((x, y, z), hand.after, "let go"))
    for height in _OVER_M:
        ways = Move((x, y, max(z, height)), name="up", speed_m_s=0.1), *way_home((x, y, max(z, height)), scene.home_m)
        if _reaches(run, *ways):
            break
    else:
        ways = (Move(scene.home_m, name="home", speed_m_s=0.3),)
    for move in ways:
        run.move(move)
    seen()


def _reaches(run: Run, *moves: Move) -> bool:
    try:
        run.check(*moves)
    except UnreachableError:
        return False
    return True


def _seen_from(run: Run, watcher: Watcher, start: int) -> Callable[[], None]:
    """A function that shows the watcher all frames that are new, from a number on."""
    taken = start

    def look() -> None:
        nonlocal taken
        news = zip(run.frames_since(taken), run.tips_since(taken), run.joints_since(taken), strict=True)
        for frame, tip, joints in news:
            watcher.add(frame, tip_m=tip, joints_rad=joints)
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


def _contains(got: str, wanted: str) -> bool:
    """Whether all letters occur in their order."""
    letters = iter(got)
    return all(letter in letters for letter in wanted)


def _told(pair: frozenset[str]) -> str:
    return "{" + ", ".join(sorted(pair)) + "}"
