"""Study of pick-and-place (§2.11): what was learned from demonstrations, carried out in many random scenes."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from sec_lab.execution.loop import Outcome, execute_skill
from sec_lab.execution.planning import Skill
from sec_lab.worlds.katana.placing import Placing, placing_pose, placing_scene
from sec_lab.worlds.katana.records import TABLE

if TYPE_CHECKING:
    import pandas as pd

PLACING_SCENES_SEED, N_PLACING_SCENES = 2016, 10


@dataclass(frozen=True)
class PlacingTrial:
    """Pick-and-place in one random scene.

    Parameters
    ----------
    placing : str
        Where the first object is put, from the second.
    number : int
        Of the scene.
    n_things : int
    refused : str
        Why nothing was tried; empty if something was.
    accepted : bool
        The arm's own verdict in the end.
    placed : bool
        The truth: the objects touch, and the first stands on the table if and only if it was to be put beside.
    n_attempts : int
    first_failure : str
        Of the self-check; empty if there was none.
    gave_up : str
        Why there was no further attempt; empty after success.
    off_mm : float
        Of the middle of the first object, in the end, from where the program of the demonstrations would have put it
        (truth); the second object is taken where it stood.
    turned_off_deg : float
        Of its sides from those of the second (truth).
    simulated_s : float
    """

    placing: Placing
    number: int
    n_things: int
    refused: str
    accepted: bool = False
    placed: bool = False
    n_attempts: int = 0
    first_failure: str = ""
    gave_up: str = ""
    off_mm: float = np.nan
    turned_off_deg: float = np.nan
    simulated_s: float = 0.0


def placing_trial(skill: Skill, placing: Placing, *, seed: int = PLACING_SCENES_SEED, number: int) -> PlacingTrial:
    """Pick-and-place in one random scene, sometimes with a blue sphere beside.

    Parameters
    ----------
    skill : Skill
    placing : {"on", "beside"}
        What was demonstrated: for the truth, and for the sizes of things; the plan knows nothing of it.
    seed, number : int
        Of the scene.
    """
    scene = placing_scene(placing, seed, number=number, more=True)
    try:
        done = execute_skill(scene, skill)
    except ValueError as error:
        return PlacingTrial(placing, number, len(scene.things), str(error))
    red, green = (done.truth.poses[name][-1] for name in ("red box", "green box"))
    off = red[:3, 3] - placing_pose(placing, scene)[0]
    yaw = float(np.arctan2(red[1, 0], red[0, 0]) - np.arctan2(green[1, 0], green[0, 0]))
    turned = (yaw + np.pi / 4) % (np.pi / 2) - np.pi / 4
    failures = [f"{verdict.rule}: {verdict.why}" for verdict in done.verdicts if not verdict.agrees]
    return PlacingTrial(
        placing,
        number,
        len(scene.things),
        "",
        accepted=done.success,
        placed=is_placed(done, placing),
        n_attempts=done.n_attempts,
        first_failure=failures[0] if failures else "",
        gave_up=done.gave_up,
        off_mm=round(1000 * float(np.linalg.norm(off)), 1),
        turned_off_deg=round(float(np.rad2deg(turned)), 1),
        simulated_s=round(done.time_s, 2),
    )


def is_placed(done: Outcome, placing: str) -> bool:
    """Whether the objects touch in the end, and the first stands on the table if and only if it should (truth).

    Parameters
    ----------
    done : Outcome
    placing : {"on", "beside"}
    """
    on_table = bool(done.truth.touching("red box", TABLE)[-1])
    return bool(done.truth.touching("red box", "green box")[-1]) and on_table == (placing == "beside")


def placing_trials(
    skills: dict[Placing, Skill], *, seed: int = PLACING_SCENES_SEED, numbers: Iterable[int] = range(N_PLACING_SCENES)
) -> "pd.DataFrame":
    """A table of trials.

    Parameters
    ----------
    skills : dict of {"on", "beside"} to Skill
    seed : int, optional
    numbers : iterable of int, optional
        Of the scenes, the same for each skill.
    """
    import pandas as pd
    from tqdm import tqdm

    tasks = [(placing, skill, number) for placing, skill in skills.items() for number in numbers]
    found = [
        placing_trial(skill, placing, seed=seed, number=number)
        for placing, skill, number in tqdm(tasks, unit="scene", disable=None)
    ]
    return pd.DataFrame([asdict(one) for one in found])
