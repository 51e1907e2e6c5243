"""How the command line speaks: its parser, and lines on its outputs."""

import argparse
import sys
from typing import NoReturn, TextIO, TypeAlias


class Parser(argparse.ArgumentParser):
    """A parser that says in one line what is wrong with a call."""

    def error(self, message: str) -> NoReturn:
        """Leave with exit code 2 and one line."""
        self.exit(2, f"{self.prog}: {message} ({self.prog} --help explains)\n")


Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


def add_command(commands: Commands, name: str, what: str, example: str, *, description: str | None = None) -> Parser:
    """Add a command that explains itself with an example.

    Parameters
    ----------
    commands : subparsers
    name : str
    what : str
        What it shows or does, in one line.
    example : str
        A call.
    description : str, optional
        What its help begins with; "Show …" if left out.

    Returns
    -------
    Parser
    """
    return commands.add_parser(
        name,
        help=what,
        description=description or f"Show {what}.",
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def say(line: str, *, file: TextIO | None = None) -> None:
    """Write a line to the standard output, or to a file."""
    (file or sys.stdout).write(f"{line}\n")
