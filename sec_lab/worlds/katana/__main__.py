"""Command line: ``python -m sec_lab.worlds.katana FOLDER``."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from sec_lab.worlds.katana.demonstrations import N_DEMONSTRATIONS, SEED
from sec_lab.worlds.katana.stored import make_demonstrations


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the demonstrations of pushing.

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
        description="Simulate demonstrations of pushing a red box to a green box: colour, range, labels, contacts.",
        epilog="example: python -m sec_lab.worlds.katana demonstrations --seed 7 --number 3",
    )
    parser.add_argument("folder", type=Path, help="where the files go")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of everything that is random (default {SEED})")
    parser.add_argument(
        "--number", type=int, default=N_DEMONSTRATIONS, help=f"of demonstrations (default {N_DEMONSTRATIONS})"
    )
    given = parser.parse_args(arguments)
    if given.seed < 0 or given.number < 1:
        parser.error(f"expected a seed of at least 0 and a number of at least 1, got {given.seed} and {given.number}")
    try:
        given.folder.mkdir(parents=True, exist_ok=True)
        make_demonstrations(given.folder, seed=given.seed, n=given.number)
    except (ValueError, OSError) as problem:
        parser.exit(2, f"error: {problem}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
