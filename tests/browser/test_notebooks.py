"""Every notebook with widgets is opened whole in the browser; the cells that widgets need are executed."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import nbformat
import pytest

from tests.browser.conftest import ROOT, SCREENS, Lab
from tests.browser.controls import UPLOADED, WORD, Moved, left_out, move_every_control
from tests.browser.slices import needed_cells, needed_places, widget_cells

NOTEBOOKS = {path: nbformat.read(path, as_version=4) for path in sorted((ROOT / "notebooks").glob("*.ipynb"))}
WITH_WIDGETS = [
    path
    for path, notebook in NOTEBOOKS.items()
    if widget_cells(notebook) and (not path.name.startswith("real_recordings_") or os.environ.get("SEC_LAB_DATA"))
]
EXEMPT = {"live 3D view": "says whether the next push is shown live; test_push_explorer.py looks at that"}
"""Controls that nothing on the page need follow, and why."""
ASKED = {
    "None": "expected at least two that are ticked, got 0",
    "name": "name: choose one segment",
    "a file, or a folder of pictures": f"{WORD}: expected a movie",
    "of a tracker, if you have any": WORD,
    "or upload a movie (up to 500 MB):": f"{UPLOADED}.mp4: expected a movie",
    "open": "Stopped; nothing was changed.",
    "compare": "Stopped; nothing was changed.",
    "merge": "Stopped; nothing was changed.",
}
"""Controls of which a move asks for a sentence that something is wrong, and what it says."""
CANCELLED = {
    "chapter2_2_real_actions": {"Cancel (Follow through the movie)"},
    "chapter2_4_execution": {"Cancel (push)"},
    "your_own_movie": {"cancel (open)", "cancel (compare)"},
}
"""Long work, which must have been stopped by its button."""


def test_only_what_a_cell_needs_is_executed() -> None:
    cells = ["import numpy as np", "a = np.ones(2)", "b = 5", "c = {}", "c[1] = b", "print(a)", "a.sum() + len(c)"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in cells])
    notebook.cells[-1].metadata["tags"] = ["nbval-ignore-output"]
    assert widget_cells(notebook) == [6]
    assert needed_cells(notebook, 6) == [*cells[:5], cells[6]]


@pytest.mark.parametrize("path", WITH_WIDGETS, ids=lambda path: path.stem)
def test_a_notebook_is_opened_whole_and_its_widgets_move(lab: Lab, path: Path, screenshot: Callable[..., Path]) -> None:
    """The notebook as it is stored; the cells that its widgets need are executed, all others keep their outputs."""
    notebook = NOTEBOOKS[path]
    places = widget_cells(notebook)
    cancels, tracked = set(), _tracked()
    # So high that each widget is on its picture as a whole.
    page = lab.open_stored(path, needed_places(notebook, places), height=2100)
    assert page.locator(".jp-Notebook .jp-Cell").count() == len(notebook.cells)
    assert page.get_by_text("Error displaying widget").count() == 0
    for place in places:
        cell = page.locator(f".jp-Cell[data-windowed-list-index='{place}']")
        cell.scroll_into_view_if_needed()
        cell.locator(".jp-OutputArea-output").last.wait_for(timeout=60_000)
        if "widget-view" in str(notebook.cells[place].outputs):
            cell.locator(".jupyter-widgets").first.wait_for(timeout=60_000)
            moved = move_every_control(page, cell)
            screenshot(cell, f"notebook_{path.stem}_{notebook.cells[place].id}")
            _tell(path.stem, notebook.cells[place].id, moved)
            assert {one.name for one in moved if not one.n_followed} <= EXEMPT.keys()
            assert left_out(page, cell, moved) == []
            assert [
                (one.name, said) for one in moved for said in one.said if ASKED.get(one.name, "none") not in said
            ] == []
            cancels |= {one.name for one in moved}
    assert page.get_by_text("Error displaying widget").count() == 0
    assert CANCELLED.get(path.stem, set()) <= cancels
    assert _tracked() == tracked


def _tell(notebook: str, cell: str, moved: list[Moved]) -> None:
    """Write what was moved into build/screens, beside the pictures."""
    lines = [f"{'kind':9} {'control':40} moves  followed  slowest ms"]
    for one in moved:
        counted = f"{one.n_tried:5} {one.n_followed:9} {one.slowest_ms:11.0f}"
        lines.append(f"{one.kind:9} {one.name[:40]:40} {counted}  {'; '.join(one.said)}")
    (SCREENS / f"controls_{notebook}_{cell}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _tracked() -> str:
    """What git says of files that are not as they were committed, or that it does not know."""
    return subprocess.run(["git", "-C", ROOT, "status", "--porcelain"], capture_output=True, text=True).stdout
