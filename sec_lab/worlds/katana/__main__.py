"""Command line: ``python -m sec_lab.worlds.katana FOLDER``."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from sec_lab.worlds.katana.demonstrations import N_DEMONSTRATIONS, SEED
from sec_lab.worlds.katana.stored import Action, make_demonstrations


def main(arguments: Sequence[str] | None = None) -> int:
    """Make demonstrations of pushing, or of pick-and-place.

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
        prog="python -m sec_lab.worlds.katana",
        description="Simulate demonstrations of pushing a red box to a green box, or of putting it there.",
        epilog="example: python -m sec_lab.worlds.katana demonstrations --action 'put on' --seed 7 --number 3",
    )
    parser.add_argument("folder", type=Path, help="where the files go")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of everything that is random (default {SEED})")
    parser.add_argument(
        "--number", type=int, default=N_DEMONSTRATIONS, help=f"of demonstrations (default {N_DEMONSTRATIONS})"
    )
    parser.add_argument("--action", choices=get_args(Action), default="push", help="what is shown (default push)")
    given = parser.parse_args(arguments)
    if given.seed < 0 or given.number < 1:
        parser.error(f"expected a seed of at least 0 and a number of at least 1, got {given.seed} and {given.number}")
    try:
        given.folder.mkdir(parents=True, exist_ok=True)
        make_demonstrations(given.folder, seed=given.seed, n=given.number, action=given.action)
    except (ValueError, OSError) as problem:
        parser.exit(2, f"error: {problem}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
