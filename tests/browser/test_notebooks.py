"""Every notebook with widgets: its widget cells are opened in the browser, with the cells that they need."""

import os
from collections.abc import Callable
from pathlib import Path

import nbformat
import pytest

from tests.browser.conftest import ROOT, Lab
from tests.browser.slices import needed_cells, widget_cells

NOTEBOOKS = {path: nbformat.read(path, as_version=4) for path in sorted((ROOT / "notebooks").glob("*.ipynb"))}
CELLS = [
    pytest.param(path, place, id=f"{path.stem}-{notebook.cells[place].id}")
    for path, notebook in NOTEBOOKS.items()
    for place in widget_cells(notebook)
    if not path.name.startswith("real_recordings_") or os.environ.get("SEC_LAB_DATA")
]


def test_only_what_a_cell_needs_is_executed() -> None:
    cells = ["import numpy as np", "a = np.ones(2)", "b = 5", "c = {}", "c[1] = b", "print(a)", "a.sum() + len(c)"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in cells])
    notebook.cells[-1].metadata["tags"] = ["nbval-ignore-output"]
    assert widget_cells(notebook) == [6]
    assert needed_cells(notebook, 6) == [*cells[:5], cells[6]]


@pytest.mark.parametrize(("path", "place"), CELLS)
def test_widgets_of_a_notebook_are_there(lab: Lab, path: Path, place: int, screenshot: Callable[..., Path]) -> None:
    notebook = NOTEBOOKS[path]
    page = lab.open(f"%cd -q {path.parent}", *needed_cells(notebook, place))
    shown = page.locator(".jp-CodeCell").last.locator(".jp-OutputArea-output").last
    shown.wait_for(timeout=60_000)
    if "widget-view" not in str(notebook.cells[place].outputs):
        return
    page.locator(".jp-CodeCell").last.locator(".jupyter-widgets").first.wait_for(timeout=60_000)
    assert page.get_by_text("Error displaying widget").count() == 0
    # Pictures that are to be seen are drawn.
    page.wait_for_function(
        "[...document.querySelectorAll('canvas.sec-lab-picture')].every((c) => !c.offsetParent || c.dataset.drawn)"
    )
    if page.locator(".sec-lab-explorer").count():
        page.locator("canvas.sec-lab-picture").first.wait_for(timeout=60_000)
    screenshot(page, f"notebook_{path.stem}_{notebook.cells[place].id}")
