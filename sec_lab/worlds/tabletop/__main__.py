"""Command line: ``python -m sec_lab.worlds.tabletop FOLDER``."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from sec_lab.worlds.tabletop.actions import ALL_VERSIONS, COLLECTIONS
from sec_lab.worlds.tabletop.make import make_movie_of
from sec_lab.worlds.tabletop.settings import SETTINGS

SEEDS = {"tabletop_actions": 2011, "put_and_take": 2012}
"""Seeds of the movies that are kept."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Make movies; each goes into a folder of its own.

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
        prog="python -m sec_lab.worlds.tabletop",
        description="Render tabletop actions: stereo movies with labels, depth and contacts.",
        epilog="example: python -m sec_lab.worlds.tabletop movies --action filling_liquid --version 2 --seed 7",
    )
    parser.add_argument("folder", type=Path, help="where the movies go, each into a folder of its own")
    parser.add_argument(
        "--collection", choices=COLLECTIONS, default="tabletop_actions", help="which movies (default tabletop_actions)"
    )
    parser.add_argument("--action", choices=ALL_VERSIONS, action="append", help="may be repeated; all if left out")
    parser.add_argument("--version", type=int, action="append", help="likewise; 1 is the first")
    parser.add_argument("--setting", choices=SETTINGS, action="append", help="likewise")
    seeds = ", ".join(f"{seed} of {name}" for name, seed in SEEDS.items())
    parser.add_argument("--seed", type=int, help=f"of everything that is random (default {seeds})")
    parser.add_argument("--size", type=int, nargs=2, default=(320, 256), metavar=("WIDTH", "HEIGHT"), help="in pixels")
    parser.add_argument("--jobs", type=int, default=1, help="how many movies are made at a time (default 1)")
    given = parser.parse_args(arguments)
    if min(given.size) < 16 or any(side % 2 for side in given.size):
        parser.error(f"argument --size: expected even numbers of at least 16, got {given.size[0]} {given.size[1]}")
    if given.jobs < 1:
        parser.error(f"argument --jobs: expected a number of at least 1, got {given.jobs}")
    wanted = [
        (action, version, setting)
        for action in given.action or COLLECTIONS[given.collection]
        for version in given.version or ALL_VERSIONS[action]
        for setting in given.setting or SETTINGS
    ]
    for action, version, _ in wanted:
        if version not in ALL_VERSIONS[action]:
            known = ALL_VERSIONS[action][-1]
            parser.error(f"argument --version: expected numbers from 1 to {known} for {action}, got {version}")
    try:
        given.folder.mkdir(parents=True, exist_ok=True)
        _make(given.folder, wanted, seed=given.seed, size_px=tuple(given.size), jobs=given.jobs)
    except (ValueError, OSError) as problem:
        parser.exit(2, f"error: {problem}\n")
    return 0


def _make(
    folder: Path, wanted: Sequence[tuple[str, int, str]], *, seed: int | None, size_px: tuple[int, int], jobs: int
) -> None:
    from joblib import Parallel, delayed
    from tqdm import tqdm

    if jobs > 1:
        # The software renderer's own threads help less than movies side by side.
        os.environ.setdefault("LP_NUM_THREADS", "1")
    made = Parallel(n_jobs=min(jobs, len(wanted)), return_as="generator_unordered")(
        delayed(make_movie_of)(folder, *which, seed=_seed_of(which[0]) if seed is None else seed, size_px=size_px)
        for which in wanted
    )
    for _ in tqdm(made, total=len(wanted), unit="movie", disable=not sys.stderr.isatty()):
        pass


def _seed_of(action: str) -> int:
    return next(seed for name, seed in SEEDS.items() if action in COLLECTIONS[name])


if __name__ == "__main__":
    sys.exit(main())
