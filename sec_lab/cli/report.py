"""``sec-lab report``: the notebooks as linked pages."""

import argparse
import sys
from pathlib import Path

from sec_lab.cli.speaking import Commands, add_command, say


def add_report_command(commands: Commands) -> None:
    """Add ``report`` to the command line."""
    report = add_command(
        commands,
        "report",
        "execute the notebooks that changed and write build/report/index.html",
        "sec-lab report notebooks/chapter2_1_event_chains.ipynb",
        description="Execute the notebooks that changed and write build/report/index.html.",
    )
    report.add_argument("notebooks", type=Path, nargs="*", metavar="NOTEBOOK", help="only these (default: all)")
    report.add_argument("--force", action="store_true", help="execute them even if nothing changed")
    report.set_defaults(run=_report)


def _report(options: argparse.Namespace) -> int:
    from sec_lab.report import build_report

    summary = build_report(options.notebooks or None, root=Path.cwd(), force=options.force)
    for line in summary.errors:
        say(line, file=sys.stderr)
    for page in summary.pages:
        if page.explorer_bytes:
            sizes = ", ".join(f"{size / 1e6:.2f}" for size in page.explorer_bytes)
            say(f"{page.page.name}: explorers of {sizes} MB (at most 5 each)")
    say(str(summary.index))
    return 1 if summary.errors else 0
