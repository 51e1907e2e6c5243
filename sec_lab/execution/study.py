"""Study of the execution: many random scenes as a table; for planted failures see :mod:`sec_lab.execution.planted`."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from sec_lab.execution.loop import Outcome, execute_skill
from sec_lab.execution.perception import perceive
from sec_lab.execution.planning import Demonstrated, Skill, learn_skill
from sec_lab.recognition import rate
from sec_lab.worlds.katana.demonstrations import Demonstration
from sec_lab.worlds.katana.records import Scene, Thing
from sec_lab.worlds.katana.scenes import random_scene

if TYPE_CHECKING:
    import pandas as pd

SEED, N_SCENES = 2018, 100

_BINS_DEG = (0.0, 15.0, 30.0, 45.0)


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
    gave_up : str
        Why there was no further attempt; empty after success.
    gap_mm : float
        Between the completed shapes, as it was seen in the end.
    first_diagonal_deg, second_diagonal_deg : float
        Between the connection vector and the nearest side of the first and of the second object, 45° along a diagonal;
        0 for round things (truth).
    pushed_away_mm : float
        How far the second object was moved (§2.10.5; truth).
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
    gave_up: str = ""
    gap_mm: float = 0.0
    first_diagonal_deg: float = 0.0
    second_diagonal_deg: float = 0.0
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
                perceive(given.recording, given.scene.camera, tip_m=given.truth.tip_m),
                given.truth.tip_m,
                given.truth.joints_rad,
            )
            for number, given in enumerate(demonstrations, start=1)
        }
    )


def trial(skill: Skill, *, seed: int, number: int) -> Trial:
    """A push in one random scene.

    Parameters
    ----------
    skill : Skill
    seed, number : int
        Of the scene.
    """
    scene = random_scene(seed, number=number)
    red, green = scene.things[:2]
    first_deg, second_deg = (_diagonal_deg(scene, one) for one in (red, green))
    try:
        done = execute_skill(scene, skill)
    except ValueError as error:
        return Trial(
            number,
            red.shape,
            len(scene.things),
            refused=str(error),
            first_diagonal_deg=first_deg,
            second_diagonal_deg=second_deg,
        )
    poses = done.truth.poses[green.name]
    moved = poses[-1][:2, 3] - poses[0][:2, 3]
    failures = [f"{verdict.rule}: {verdict.why}" for verdict in done.verdicts if not verdict.agrees]
    return Trial(
        number,
        red.shape,
        len(scene.things),
        "",
        accepted=done.success,
        touching=end_touching(done, red, green),
        n_attempts=done.n_attempts,
        first_failure=failures[0] if failures else "",
        gave_up=done.gave_up,
        gap_mm=round(1000 * done.perceived.last_gap_m(skill.first, skill.second), 2),
        first_diagonal_deg=first_deg,
        second_diagonal_deg=second_deg,
        pushed_away_mm=round(float(1000 * np.hypot(*moved)), 1),
        simulated_s=round(done.time_s, 2),
    )


def trials(skill: Skill, *, seed: int = SEED, n: int = N_SCENES, n_jobs: int = 1) -> "pd.DataFrame":
    """Pushes in random scenes, one row each; see :class:`Trial`.

    Parameters
    ----------
    skill : Skill
    seed : int, optional
    n : int, optional
        How many scenes.
    n_jobs : int, optional
        How many at a time, as in :class:`joblib.Parallel`; the table does not depend on it.
    """
    return table_of([partial(trial, skill, seed=seed, number=number) for number in range(n)], n_jobs=n_jobs)


def scene_rates(table: "pd.DataFrame") -> "pd.DataFrame":
    """Counts of :func:`trials`, each with its Wilson interval of 95 %.

    Parameters
    ----------
    table : pandas.DataFrame
        As it is made, or read by ``pandas.read_csv(..., keep_default_na=False)``.

    Returns
    -------
    pandas.DataFrame
        A row each: end touching (refused ones count as not), the same by shape, refused, failed and recognised as such,
        and among the executed ones a right verdict, accepted though apart, rejected though touching, one attempt.
    """
    done = table[table["refused"] == ""]
    touching, accepted = done["touching"].astype(bool), done["accepted"].astype(bool)
    counts = {
        "touching in the end": (int(touching.sum()), len(table)),
        **{
            f"touching in the end: {shape}": (
                int(touching[done["shape"] == shape].sum()),
                int((table["shape"] == shape).sum()),
            )
            for shape in sorted(set(table["shape"]))
        },
        "refused": (len(table) - len(done), len(table)),
        "touching, refused or recognised as a failure": (
            len(table) - int((~touching & accepted).sum()),
            len(table),
        ),
        "verdict right": (int((touching == accepted).sum()), len(done)),
        "accepted though apart": (int((~touching & accepted).sum()), len(done)),
        "rejected though touching": (int((touching & ~accepted).sum()), len(done)),
        "in the first attempt": (int((touching & (done["n_attempts"] == 1)).sum()), len(table)),
    }
    return rates_of(counts)


def pushed_away(table: "pd.DataFrame") -> "pd.DataFrame":
    """How far the second object is pushed away, by how diagonally it is met (§2.10.5).

    Parameters
    ----------
    table : pandas.DataFrame
        See :func:`scene_rates`; only what ended in the first attempt counts, as further ones push again.

    Returns
    -------
    pandas.DataFrame
        A row for each range of the angle: number, median and largest way in mm.
    """
    import pandas as pd

    once = table[(table["refused"] == "") & (table["n_attempts"] == 1) & table["touching"].astype(bool)]
    rows = []
    for low, high in pairwise(_BINS_DEG):
        angle = once["second_diagonal_deg"]
        way = once["pushed_away_mm"][(angle >= low) & ((angle < high) | (high == _BINS_DEG[-1]))]
        rows.append(
            {
                "from_deg": low,
                "to_deg": high,
                "n": len(way),
                "median_mm": round(float(way.median()), 1) if len(way) else float("nan"),
                "largest_mm": round(float(way.max()), 1) if len(way) else float("nan"),
            }
        )
    return pd.DataFrame(rows)


def rates_of(counts: dict[str, tuple[int, int]]) -> "pd.DataFrame":
    """Counts as a table, each with its Wilson interval of 95 %; those of nothing are left out.

    Parameters
    ----------
    counts : dict of str to (int, int)
        How many, of how many.
    """
    import pandas as pd

    rows = []
    for what, (n_right, n) in counts.items():
        if n:
            found = rate(n_right, n)
            rows.append(
                {
                    "what": what,
                    "n": n_right,
                    "of": n,
                    "percent": round(found.percent, 1),
                    "low_percent": round(found.low_percent, 1),
                    "high_percent": round(found.high_percent, 1),
                }
            )
    return pd.DataFrame(rows).set_index("what")


def table_of(tasks: "list[partial[Any]]", *, n_jobs: int) -> "pd.DataFrame":
    """A row for each task, which gives a record; the same for any number of jobs.

    Parameters
    ----------
    tasks : list of functools.partial
    n_jobs : int
        As in :class:`joblib.Parallel`.
    """
    import sys

    import pandas as pd
    from joblib import Parallel, delayed
    from tqdm import tqdm

    run = Parallel(n_jobs=n_jobs, return_as="generator")(delayed(task)() for task in tasks)
    return pd.DataFrame(
        [asdict(one) for one in tqdm(run, total=len(tasks), unit="scene", disable=not sys.stderr.isatty())]
    )


def end_touching(done: Outcome, red: Thing, green: Thing) -> bool:
    """Whether two things touch in the end (truth).

    Parameters
    ----------
    done : Outcome
    red, green : Thing
    """
    return bool(done.truth.touching(red.name, green.name)[-1])


def _diagonal_deg(scene: Scene, thing: Thing) -> float:
    """Angle between the way from the first to the second thing and the nearest side of a box; 0 for round things."""
    if thing.shape != "box":
        return 0.0
    way = np.array(scene.things[1].p_W_m[:2]) - np.array(scene.things[0].p_W_m[:2])
    turn = np.rad2deg(np.arctan2(way[1], way[0]) - thing.yaw_rad)
    return round(float(abs((turn + 45) % 90 - 45)), 1)
