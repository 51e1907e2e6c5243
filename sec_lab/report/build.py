"""From notebooks to the pages of the report; only what changed is executed again.

Beside the pages, ``.executed`` holds the executed copy of each notebook with a digest of all that it was made from:
its source cells, the files beside it, the library, the data sets and the lock file.
"""

import hashlib
import os
import platform
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import nbformat
from nbformat import NotebookNode
from tqdm import tqdm

from sec_lab.files import write_whole
from sec_lab.report.execution import NotebookFailure, code_cells, execute, read_notebook
from sec_lab.report.pages import (
    FOR_PAGES,
    MOST_EXPLORER_BYTES,
    NotebookSummary,
    explorer_bytes,
    network_loads,
    notebook_html,
    sections_of,
    summarise,
    template,
)

Status = Literal["executed", "unchanged", "outdated", "stored", "failed", "absent"]

_KEY = "sec_lab_report"
_IGNORED = {"__pycache__", ".ipynb_checkpoints"}


@dataclass(frozen=True)
class ReportPage:
    """One notebook of the report.

    Attributes
    ----------
    notebook, page : Path
        The notebook and its page.
    status : {"executed", "unchanged", "outdated", "stored", "failed", "absent"}
        Executed now; executed before and unchanged since; changed since, but not asked for; shown from its stored
        outputs because the recordings are not here; failed; never executed and not asked for.
    error : str
        One line that names the notebook, the cell and the error; empty if nothing failed.
    explorer_bytes : tuple of int
        Sizes of its explorers that scrub; each is below 5 MB, or the page is not written.
    """

    notebook: Path
    page: Path
    status: Status
    error: str = ""
    explorer_bytes: tuple[int, ...] = ()


@dataclass(frozen=True)
class ReportSummary:
    """What `build_report` made.

    Attributes
    ----------
    index : Path
        The front page.
    pages : tuple of ReportPage
        Every notebook of the report, in reading order.
    """

    index: Path
    pages: tuple[ReportPage, ...]

    @property
    def errors(self) -> tuple[str, ...]:
        """One line for every notebook that failed."""
        return tuple(page.error for page in self.pages if page.error)


@dataclass(frozen=True, eq=False)
class _Entry:
    """A notebook on its way into the report; `shown` is what its page shows, if there is anything to show."""

    path: Path
    source: NotebookNode
    key: str
    shown: NotebookNode | None
    status: Status
    error: str = ""

    @property
    def name(self) -> str:
        return f"{self.path.stem}.html"

    @property
    def summary(self) -> NotebookSummary:
        return summarise(self.shown or self.source, name=self.path.stem)


def build_report(
    notebooks: Sequence[str | os.PathLike[str]] | None = None,
    *,
    root: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    progress: bool = True,
) -> ReportSummary:
    """Execute notebooks and write them as linked, self-contained HTML.

    Notebooks named ``real_recordings_*`` are executed only if the environment variable ``SEC_LAB_DATA`` names a
    folder; otherwise their stored outputs are shown. A notebook that fails does not keep the others from being built.

    Parameters
    ----------
    notebooks : sequence of path-like, optional
        What to bring up to date; all of ``root/notebooks`` if left out. The front page lists the others too.
    root : path-like
        The folder of the project, with ``notebooks``, ``sec_lab``, ``datasets`` and ``requirements.lock``.
    output : path-like, optional
        Folder of the pages (default ``root/build/report``).
    force : bool, optional
        Execute also what did not change.
    progress : bool, optional
        Show a progress bar on standard error.

    Returns
    -------
    ReportSummary
        Its ``errors`` are empty if every notebook went well.

    Raises
    ------
    ValueError
        If there is no notebook, one is missing or unreadable, or two share a name.

    Examples
    --------
    >>> build_report(root="no/such/project")
    Traceback (most recent call last):
    ...
    ValueError: no/such/project/notebooks: expected notebooks (*.ipynb), but found none
    """
    root = Path(root)
    output = root / "build" / "report" if output is None else Path(output)
    asked = None if notebooks is None else [Path(notebook) for notebook in notebooks]
    paths = _in_reading_order(root, asked or [])
    sources = {path: read_notebook(path) for path in paths}
    copies = output / ".executed"
    copies.mkdir(parents=True, exist_ok=True)

    project = _digest_of_project(root)
    wanted = paths if asked is None else [path.resolve() for path in asked]
    entries = [
        _entry(path, sources[path], copies, project=project, wanted=path in wanted, force=force) for path in paths
    ]
    due = [entry for entry in entries if entry.status == "executed"]
    with tqdm(
        total=sum(len(code_cells(entry.source)) for entry in due), unit="cell", disable=not (progress and due)
    ) as bar:
        for entry in due:
            bar.set_description(entry.path.stem)
            entries[entries.index(entry)] = _executed(entry, copies, on_cell=bar.update)

    entries = list(_write_pages(entries, output))
    pages = tuple(
        ReportPage(
            entry.path, output / entry.name, entry.status, entry.error,
            () if entry.shown is None else explorer_bytes(entry.shown),
        )
        for entry in entries
    )  # fmt: skip
    cards = [{"entry": entry, "summary": entry.summary} for entry in entries]
    write_whole(output / "index.html", template().render(cards=cards))
    return ReportSummary(output / "index.html", pages)


def _in_reading_order(root: Path, asked: Sequence[Path]) -> list[Path]:
    """All notebooks: the chapters by number, then the recordings."""

    def place(path: Path) -> tuple[bool, list[tuple[int, str]]]:
        parts = re.findall(r"\d+|\D+", path.stem)
        return _needs_recordings(path), [(int(part), "") if part.isdigit() else (-1, part) for part in parts]

    found = {path.resolve() for path in [*(root / "notebooks").glob("*.ipynb"), *asked]}
    if not found:
        raise ValueError(f"{root / 'notebooks'}: expected notebooks (*.ipynb), but found none")
    ordered = sorted(found, key=place)
    for one, other in pairwise(ordered):
        if one.stem == other.stem:
            raise ValueError(f"{other}: expected a name of its own, but {one} has the same")
    return ordered


def _needs_recordings(path: Path) -> bool:
    return path.name.startswith("real_recordings_")


def _recordings_here() -> bool:
    folder = os.environ.get("SEC_LAB_DATA")
    return bool(folder) and Path(str(folder)).is_dir()


def _entry(path: Path, source: NotebookNode, copies: Path, *, project: bytes, wanted: bool, force: bool) -> _Entry:
    """What is to be done with a notebook: its status says it, ``"executed"`` being still to come."""
    if _needs_recordings(path) and not _recordings_here():
        return _Entry(path, source, "", source, "stored")
    key = _digest_of_notebook(path, source, project)
    copy = copies / path.name
    last = read_notebook(copy) if copy.exists() else None
    unchanged = last is not None and last.metadata.get(_KEY) == key
    if wanted and (force or not unchanged):
        return _Entry(path, source, key, last, "executed")
    return _Entry(path, source, key, last, "absent" if last is None else "unchanged" if unchanged else "outdated")


def _executed(entry: _Entry, copies: Path, *, on_cell: Callable[[], object]) -> _Entry:
    """Execute a notebook and keep the copy; a failure leaves what was shown before."""
    try:
        # Explorers then leave behind what scrubs on a page without a kernel.
        done = execute(entry.source, folder=entry.path.parent, on_cell=on_cell, variables={FOR_PAGES: "1"})
    except NotebookFailure as failure:
        return replace(entry, status="failed", error=f"{entry.path.name}, {failure}")
    done.metadata[_KEY] = entry.key
    write_whole(copies / entry.path.name, nbformat.writes(done))
    return replace(entry, shown=done)


def _write_pages(entries: Sequence[_Entry], output: Path) -> Iterator[_Entry]:
    """Write the page of every notebook that has something to show."""
    present = [entry for entry in entries if entry.shown is not None]
    names = {entry.path: entry.name for entry in present}
    around = template()
    for entry in entries:
        if entry.shown is None:
            yield entry
            continue
        place = present.index(entry)
        body = notebook_html(entry.shown, source=entry.path, folder=output, pages=names)
        page = around.render(
            cards=None,
            entry=entry,
            body=body,
            sections=sections_of(body),
            before=present[place - 1] if place else None,
            after=present[place + 1] if place + 1 < len(present) else None,
        )
        loads, largest = network_loads(page), max(explorer_bytes(entry.shown), default=0)
        if largest > MOST_EXPLORER_BYTES:
            most = f"{MOST_EXPLORER_BYTES / 1e6:.0f} MB"
            problem = f"{entry.path.name}: expected explorers of at most {most} each, got {largest / 1e6:.1f} MB"
            yield replace(entry, status="failed", error=entry.error or problem)
        elif loads:
            problem = f"{entry.path.name}: expected a page that stands alone, but it would load {loads[0]}"
            yield replace(entry, status="failed", error=entry.error or problem)
        else:
            write_whole(output / entry.name, page)
            yield entry


def _digest_of_project(root: Path) -> bytes:
    """What every notebook depends on: the library, the data sets, the lock file and Python itself."""
    digest = hashlib.sha256(platform.python_version().encode())
    for folder in (root / "sec_lab", root / "datasets"):
        _add_files(digest, folder, sorted(folder.rglob("*")))
    _add_files(digest, root, [root / "requirements.lock"])
    return digest.digest()


def _digest_of_notebook(path: Path, source: NotebookNode, project: bytes) -> str:
    """The project, the source cells in order, and the files beside the notebook."""
    digest = hashlib.sha256(project)
    for cell in source.cells:
        digest.update(repr((cell.cell_type, cell.source)).encode())
    _add_files(digest, path.parent, sorted(file for file in path.parent.iterdir() if file.suffix != ".ipynb"))
    return digest.hexdigest()


def _add_files(digest: "hashlib._Hash", folder: Path, files: Sequence[Path]) -> None:
    for file in files:
        if file.is_file() and not _IGNORED & set(file.parts):
            with file.open("rb") as stream:
                content = hashlib.file_digest(stream, "sha256").hexdigest()
            digest.update(repr((file.relative_to(folder).as_posix(), content)).encode())
