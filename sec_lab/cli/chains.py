"""Commands that compare chains: ``sec-lab compare`` and ``sec-lab table``."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sec_lab.cli.speaking import Commands, add_command, say
from sec_lab.files import UnusableFileError

if TYPE_CHECKING:
    from sec_lab.event_chain import EventChain
    from sec_lab.similarity import Match


def add_chain_commands(commands: Commands) -> None:
    """Add ``compare`` and ``table`` to the command line."""
    compare = add_command(
        commands,
        "compare",
        "how similar two manipulations are, which rows and which segments correspond",
        "sec-lab compare seed.graphml other.graphml --normalizer shorter --tolerance 20",
    )
    compare.add_argument("a", type=Path, metavar="A", help="seed or model (ξ¹): GraphML or SEC.dat table")
    compare.add_argument("b", type=Path, metavar="B", help="what is held against it (ξ²)")
    add_similarity_options(compare)
    compare.set_defaults(run=_compare)

    table = add_command(
        commands,
        "table",
        "the similarities of all pairs of chains, and their unsupervised classes",
        "sec-lab table recordings/*/GraphML.xml -o table.csv",
    )
    table.add_argument("chains", type=Path, nargs="+", metavar="CHAIN", help="GraphML file or SEC.dat table")
    table.add_argument("-o", "--output", type=Path, metavar="FILE", help="also write the table as CSV")
    table.add_argument("--measure", choices=("temporal", "spatial"), default="temporal", help="default: temporal")
    table.add_argument(
        "--direction",
        choices=("mean", "smaller", "larger", "directed"),
        default="mean",
        help="how both directions of a pair become one number (default: mean; directed: row = seed)",
    )
    add_similarity_options(table)
    table.set_defaults(run=_table)


def add_similarity_options(command: argparse.ArgumentParser) -> None:
    """Add the choices of :func:`~sec_lab.similarity.compare` to a command."""
    command.add_argument(
        "--normalizer",
        choices=("longer", "shorter"),
        default="longer",
        help="row whose length divides in Eq. 2.2 (default: longer)",
    )
    command.add_argument(
        "--tolerance",
        type=float,
        default=0.0,
        metavar="PERCENT",
        help="row similarities this close count as equal (default: 0)",
    )


def _compare(options: argparse.Namespace) -> int:
    from sec_lab.similarity import compare

    match = compare(
        _read_comparable(options.a),
        _read_comparable(options.b),
        normalizer=options.normalizer,
        tolerance_percent=options.tolerance,
    )
    proof = "" if match.exact else "  (at least; the search was cut short)"
    say(f"spatial similarity   {match.spatial:6.2f} %")
    say(f"temporal similarity  {match.temporal:6.2f} %{proof}")
    say("\nrows")
    row_number = {int(row): i for i, row in enumerate(match.a.changing_rows)}
    column_number = {int(row): j for j, row in enumerate(match.b.changing_rows)}
    lines = [
        (_row(match.a, i), _row(match.b, j), match.row_similarity[row_number[i], column_number[j]])
        for i, j in match.rows.tolist()
    ]
    width = max((len(label) for label, _, _ in lines), default=0)
    for label_a, label_b, similarity in lines:
        say(f"  {label_a:<{width}}  ≈  {label_b}  ({similarity:.0f} %)")
    _say_segments(match)
    return 0


def _say_segments(match: "Match") -> None:
    from sec_lab.roles import AmbiguousRoleError, corresponding_segments

    try:
        solved, ambiguous = corresponding_segments(match), {}
    except AmbiguousRoleError as error:
        solved, ambiguous = error.solved, error.ambiguous

    say("\nsegments")
    for a, b in solved.items():
        say(f"  {_segment(match.a, a)}  ≈  {_segment(match.b, b)}")
    for a, options in ambiguous.items():
        say(f"  {_segment(match.a, a)}  ≈  {' or '.join(_segment(match.b, b) for b in options)}  (ambiguous)")


def _segment(chain: "EventChain", segment: int) -> str:
    name = chain.names.get(segment)
    return f"{segment} {name}" if name else str(segment)


def _row(chain: "EventChain", row: int) -> str:
    return ", ".join(_segment(chain, segment) for segment in chain.pairs[row].tolist())


def _table(options: argparse.Namespace) -> int:
    from sec_lab.classification import unsupervised_classes
    from sec_lab.files import write_whole
    from sec_lab.similarity import similarity_table

    read = [_read_comparable(path) for path in options.chains]
    names = short_names(options.chains)
    chains = dict(zip(names, read, strict=True))
    table = similarity_table(
        chains,
        direction=options.direction,
        measure=options.measure,
        normalizer=options.normalizer,
        tolerance_percent=options.tolerance,
        progress=sys.stderr.isatty(),
    )
    try:
        classes = unsupervised_classes(table)
        lines = [
            f"class {number + 1}: {', '.join(n for n, c in zip(names, classes, strict=True) if c == number)}"
            for number in range(classes.max() + 1)
        ]
    except ValueError as error:
        lines = [f"no classes: {error}"]
    if options.output is not None:
        write_whole(options.output, table.round(6).to_csv())
    say(table.round(1).to_string())
    if "exact_percent" in table.attrs:
        say(f"\n{table.attrs['exact_percent']:.1f} % of the pairs are proven optima")
    for line in lines:
        say(line)
    return 0


def _read_comparable(path: Path) -> "EventChain":
    """The chain in a file, or one line with the path that says why it cannot be compared."""
    from sec_lab.graphml import read_chain
    from sec_lab.similarity import check_comparable

    try:
        chain = read_chain(path)
    except UnusableFileError:
        raise
    except ValueError as error:
        raise UnusableFileError(f"{path}: {error}") from error
    check_comparable(chain, str(path))
    return chain


def short_names(paths: Sequence[Path]) -> list[str]:
    """As few trailing parts of each path as tell all of them apart, without the ending."""
    twice = next((path for i, path in enumerate(paths) if path in paths[:i]), None)
    if twice is not None:
        raise ValueError(f"{twice}: expected every chain once, got it twice")
    for depth in range(1, max(len(path.parts) for path in paths) + 1):
        names = ["/".join((*path.parts[:-1], path.stem)[-depth:]) for path in paths]
        if len(set(names)) == len(names):
            break
    else:
        names = [str(path) for path in paths]
    # Files that all have the same name are told apart by their folders alone.
    last = {path.name for path in paths}
    return [name.rpartition("/")[0] for name in names] if depth > 1 and len(last) == 1 else names
