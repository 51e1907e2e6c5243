"""Studies of the execution: many random scenes, each once, as a table."""

import csv
import io
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from sec_lab.execution.loop import execute_skill
from sec_lab.execution.perception import perceive
from sec_lab.execution.planning import Demonstrated, Skill, learn_skill
from sec_lab.files import write_whole
from sec_lab.worlds.katana.demonstrations import Demonstration
from sec_lab.worlds.katana.scenes import random_scene


@dataclass(frozen=True)
class Trial:
    """One random scene.

    Parameters
    ----------
    number : int
    shape : str
        Of the red thing.
    n_things : int
    refused : str
        Why nothing was tried; empty if something was.
    accepted : bool
        The arm's own verdict in the end.
    touching : bool
        The truth in the end.
    n_attempts : int
    first_failure : str
        Of the self-check; empty if there was none.
    pushed_away_mm : float
        How far the second object was moved (§2.10.5).
    simulated_s : float
    """

    number: int
    shape: str
    n_things: int
    refused: str
    accepted: bool = False
    touching: bool = False
    n_attempts: int = 0
    first_failure: str = ""
    pushed_away_mm: float = 0.0
    simulated_s: float = 0.0


def skill_of(demonstrations: Iterable[Demonstration]) -> Skill:
    """What is learned from simulated demonstrations, each perceived through its camera.

    Parameters
    ----------
    demonstrations : iterable of Demonstration
        Of their truth, only the path of the tip is used, which the arm knows from its own joints.
    """
    return learn_skill(
        {
            f"demonstration {number}": Demonstrated(
                given.recording,
                given.scene.camera,
                perceive(given.recording, given.scene.camera),
                given.truth.tip_m,
                given.truth.joints_rad,
            )
            for number, given in enumerate(demonstrations, start=1)
        }
    )


def trials(skill: Skill, *, seed: int, numbers: Iterable[int]) -> Iterator[Trial]:
    """Random scenes, one after the other.

    Parameters
    ----------
    skill : Skill
    seed : int
    numbers : iterable of int
        Which scenes of the collection.

    Yields
    ------
    Trial
    """
    for number in numbers:
        scene = random_scene(seed, number=number)
        red, green = scene.things[:2]
        try:
            outcome = execute_skill(scene, skill)
        except ValueError as error:
            yield Trial(number, red.shape, len(scene.things), refused=str(error))
            continue
        poses = outcome.truth.poses[green.name]
        moved = poses[-1][:2, 3] - poses[0][:2, 3]
        failures = [f"{verdict.rule}: {verdict.why}" for verdict in outcome.verdicts if not verdict.agrees]
        yield Trial(
            number,
            red.shape,
            len(scene.things),
            "",
            outcome.success,
            bool(outcome.truth.touching(red.name, green.name)[-1]),
            outcome.n_attempts,
            failures[0] if failures else "",
            round(float(1000 * (moved @ moved) ** 0.5), 1),
            round(outcome.time_s, 2),
        )


def write_trials(path: Path, found: Iterable[Trial]) -> None:
    """Write trials as CSV, whole or not at all.

    Parameters
    ----------
    path : Path
    found : iterable of Trial
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(Trial)], lineterminator="\n")
    writer.writeheader()
    for trial in sorted(found, key=lambda trial: trial.number):
        writer.writerow(asdict(trial))
    write_whole(path, text.getvalue())
