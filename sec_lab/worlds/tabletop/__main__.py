"""Command line: ``python -m sec_lab.worlds.tabletop FOLDER``."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from sec_lab.worlds.tabletop.actions import ACTIONS, VERSIONS, plan_movie
from sec_lab.worlds.tabletop.make import make_movie
from sec_lab.worlds.tabletop.settings import SETTINGS

SEED = 2011
"""Seed of the movies that are kept."""


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
    parser.add_argument("--action", choices=ACTIONS, action="append", help="may be repeated; all if left out")
    parser.add_argument("--version", choices=VERSIONS, type=int, action="append", help="likewise")
    parser.add_argument("--setting", choices=SETTINGS, action="append", help="likewise")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of everything that is random (default {SEED})")
    parser.add_argument("--size", type=int, nargs=2, default=(320, 256), metavar=("WIDTH", "HEIGHT"), help="in pixels")
    given = parser.parse_args(arguments)
    if min(given.size) < 16 or any(side % 2 for side in given.size):
        parser.error(f"argument --size: expected even numbers of at least 16, got {given.size[0]} {given.size[1]}")
    try:
        given.folder.mkdir(parents=True, exist_ok=True)
        for action in given.action or ACTIONS:
            for version in given.version or VERSIONS:
                for setting in given.setting or SETTINGS:
                    _make(given.folder, action, version, setting, given.seed, tuple(given.size))
    except (ValueError, OSError) as problem:
        parser.exit(2, f"error: {problem}\n")
    return 0


def _make(folder: Path, action: str, version: int, setting: str, seed: int, size: tuple[int, int]) -> None:
    from tqdm import tqdm

    plan = plan_movie(action, version, setting, seed=seed, size_px=size)  # type: ignore[arg-type]
    with tqdm(total=2 * plan.n_frames, desc=plan.name, unit="picture", disable=not sys.stderr.isatty()) as bar:
        make_movie(folder / plan.name, plan, on_frame=bar.update)


if __name__ == "__main__":
    sys.exit(main())
