"""Pushing as one function: what was learned from the stored demonstrations, done in a new scene.

``python -m sec_lab.execution.pushing FOLDER`` writes what is perceived in demonstrations, of this or another
manipulation, beside them as GraphML (A.2).
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

from sec_lab.execution.enriched_files import read_enriched_folder, write_enriched
from sec_lab.execution.loop import Outcome, Verdict, execute_skill
from sec_lab.execution.motion import Run
from sec_lab.execution.perception import perceive
from sec_lab.execution.planning import Demonstrated, Skill, Step, learn_skill
from sec_lab.worlds.katana.records import Fault, Scene
from sec_lab.worlds.katana.stored import read_demonstration

DEMONSTRATIONS = Path(__file__).parents[2] / "datasets" / "katana_pushing"
"""The ten demonstrations of the repository."""


def push(
    scene: Scene,
    *,
    skill: Skill | None = None,
    fault: Fault | None = None,
    run: Run | None = None,
    tell: Callable[[Sequence[Step], Sequence[Verdict]], object] | None = None,
) -> Outcome:
    """Let the arm push the red thing to the green box, watch itself, and judge.

    Parameters
    ----------
    scene : Scene
        A new one; the arm sees it through its camera only.
    skill : Skill, optional
        What it has learned; :func:`pushing_skill` if left out.
    fault : Fault, optional
        What goes wrong.
    run : Run, optional
    tell : callable, optional
        For those who look on; see :func:`~sec_lab.execution.loop.execute_skill`.

    Returns
    -------
    Outcome
        The movie, what was perceived in it, and the arm's verdict after every move.

    Raises
    ------
    SceneError, UnreachableError
        If nothing can be done in the scene, or not by this arm; nothing has moved then. Both are ValueErrors.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from sec_lab.worlds.katana import example_scene
    >>> scene = example_scene("a")
    >>> push(replace(scene, things=scene.things[1:]))
    Traceback (most recent call last):
    ...
    sec_lab.execution.skill.SceneError: scene: expected something that looks like 'red box', got [...]
    """
    return execute_skill(scene, pushing_skill() if skill is None else skill, fault=fault, run=run, tell=tell)


@lru_cache(maxsize=1)
def pushing_skill() -> Skill:
    """What is learned from the GraphML files (A.2) of the stored demonstrations; no movie is read.

    Raises
    ------
    UnusableFileError
        If they are not where the repository has them.
    """
    return learn_skill(read_enriched_folder(DEMONSTRATIONS))


def write_graphml(folder: Path, *, jobs: int = 1) -> tuple[Path, ...]:
    """Perceive every demonstration of a folder, and write what was seen beside it as GraphML (A.2).

    Parameters
    ----------
    folder : Path
        With files that :func:`~sec_lab.worlds.katana.stored.write_demonstration` wrote.
    jobs : int, optional
        Demonstrations at a time.

    Returns
    -------
    tuple of Path

    Raises
    ------
    ValueError
        If there is no demonstration.
    UnusableFileError
        If a file cannot be written.
    """
    from joblib import Parallel, delayed

    paths = sorted(folder.glob("demonstration_*.npz"))
    if not paths:
        raise ValueError(f"{folder}: expected files of demonstrations, got none")
    return tuple(Parallel(n_jobs=jobs)(delayed(_perceived_beside)(path) for path in paths))


def _perceived_beside(path: Path) -> Path:
    given = read_demonstration(path)
    camera = given.scene.camera
    # Of the truth, only the path of the tip and the angles of the joints are used, which the arm itself knows.
    seen = perceive(given.recording, camera, tip_m=given.truth.tip_m)
    one = Demonstrated(given.recording, camera, seen, given.truth.tip_m, given.truth.joints_rad)
    write_enriched(path.with_suffix(".graphml"), one)
    return path.with_suffix(".graphml")


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the GraphML of demonstrations.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process if left out.

    Returns
    -------
    int
        Exit code: 0, or 2 for bad input.
    """
    parser = argparse.ArgumentParser(
        prog="python -m sec_lab.execution.pushing",
        description="Perceive demonstrations and write what was seen as GraphML beside them.",
        epilog="example: python -m sec_lab.execution.pushing datasets/katana_pushing --jobs 2",
    )
    parser.add_argument("folder", type=Path, help="where the demonstrations are")
    parser.add_argument("--jobs", type=int, default=1, help="demonstrations at a time (default 1)")
    given = parser.parse_args(arguments)
    if given.jobs < 1:
        parser.error(f"expected at least one job, got {given.jobs}")
    try:
        write_graphml(given.folder, jobs=given.jobs)
    except (ValueError, OSError) as problem:
        parser.exit(2, f"error: {problem}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
