"""Command line: ``python -m sec_lab.execution DEMONSTRATIONS FOLDER``."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from sec_lab.execution.enriched_files import read_enriched_folder
from sec_lab.execution.planning import learn_skill
from sec_lab.execution.planted import N_PLANTED, planted_trials
from sec_lab.execution.study import N_SCENES, SEED, trials
from sec_lab.files import write_whole


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the tables ``scenes.csv`` and ``planted.csv`` of the execution.

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
        prog="python -m sec_lab.execution",
        description="Learn pushing from demonstrations, push in random scenes and with planted failures, write tables.",
        epilog="example: python -m sec_lab.execution datasets/katana_pushing datasets/katana_scenes --jobs 2",
    )
    parser.add_argument("demonstrations", type=Path, help="folder of the demonstrations' GraphML")
    parser.add_argument("folder", type=Path, help="where the tables go")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of the scenes (default {SEED})")
    parser.add_argument("--number", type=int, default=N_SCENES, help=f"of scenes (default {N_SCENES})")
    parser.add_argument(
        "--planted", type=int, default=N_PLANTED, help=f"scenes with planted failures (default {N_PLANTED})"
    )
    parser.add_argument("--jobs", type=int, default=1, help="how many scenes at a time (default 1)")
    given = parser.parse_args(arguments)
    if given.seed < 0 or min(given.number, given.planted, given.jobs) < 1:
        parser.error(
            "expected a seed of at least 0 and numbers of at least 1, got "
            f"{given.seed}, {given.number}, {given.planted} and {given.jobs}"
        )
    try:
        skill = learn_skill(read_enriched_folder(given.demonstrations))
        given.folder.mkdir(parents=True, exist_ok=True)
        scenes = trials(skill, seed=given.seed, n=given.number, n_jobs=given.jobs)
        write_whole(given.folder / "scenes.csv", scenes.to_csv(index=False, lineterminator="\n"))
        planted = planted_trials(skill, seed=given.seed, n=given.planted, n_jobs=given.jobs)
        write_whole(given.folder / "planted.csv", planted.to_csv(index=False, lineterminator="\n"))
    except (ValueError, OSError) as problem:
        parser.exit(2, f"error: {problem}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
