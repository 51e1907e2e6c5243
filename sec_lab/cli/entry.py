"""Which command is run, and how it ends."""

import io
import os
import sys
from collections.abc import Sequence

from sec_lab.cli.chains import add_chain_commands
from sec_lab.cli.learning import add_learning_commands
from sec_lab.cli.observe import add_observe_command
from sec_lab.cli.report import add_report_command
from sec_lab.cli.speaking import Parser, say


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the command line if left out.

    Returns
    -------
    int
        Exit code: 0, or 1 if a notebook of the report failed, or 2 for bad input, which is explained in one line.
    """
    options = _parser().parse_args(arguments)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal that knows no ≈ shows something else
    try:
        code: int = options.run(options)
        sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read the output has left; nobody is there to be told.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ValueError, OSError) as error:
        say(f"sec-lab {options.command}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        say(f"sec-lab {options.command}: interrupted", file=sys.stderr)
        return 130
    return code


def _parser() -> Parser:
    parser = Parser(
        prog="sec-lab", description="Semantic event chains: compare, classify and understand manipulations."
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    add_observe_command(commands)
    add_chain_commands(commands)
    add_learning_commands(commands)
    add_report_command(commands)
    return parser
