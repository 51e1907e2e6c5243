"""Every notebook with widgets is opened whole in the browser; the cells that widgets need are executed."""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

import nbformat
import pytest
from playwright.sync_api import Locator, Page
from playwright.sync_api import TimeoutError as PlaywrightTimeout

from tests.browser.conftest import ROOT, Lab
from tests.browser.slices import needed_cells, needed_places, widget_cells

NOTEBOOKS = {path: nbformat.read(path, as_version=4) for path in sorted((ROOT / "notebooks").glob("*.ipynb"))}
WITH_WIDGETS = [
    path
    for path, notebook in NOTEBOOKS.items()
    if widget_cells(notebook) and (not path.name.startswith("real_recordings_") or os.environ.get("SEC_LAB_DATA"))
]
SHOWN = """(cell) => [
  ...[...cell.querySelectorAll("canvas.sec-lab-picture")].map((one) => one.toDataURL()),
  ...[...cell.querySelectorAll(".sec-lab-drawing")].map((one) => one.innerHTML),
].join()"""


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
    page = lab.open_stored(path, needed_places(notebook, places))
    assert page.locator(".jp-Notebook .jp-Cell").count() == len(notebook.cells)
    assert page.get_by_text("Error displaying widget").count() == 0
    for place in places:
        cell = page.locator(f".jp-Cell[data-windowed-list-index='{place}']")
        cell.scroll_into_view_if_needed()
        cell.locator(".jp-OutputArea-output").last.wait_for(timeout=60_000)
        if "widget-view" in str(notebook.cells[place].outputs):
            cell.locator(".jupyter-widgets").first.wait_for(timeout=60_000)
            _move(page, cell)
            screenshot(cell, f"notebook_{path.stem}_{notebook.cells[place].id}")


def _move(page: Page, cell: Locator) -> None:
    """Move the first slider that is shown; another picture or drawing must follow."""
    drawn = "(cell) => [...cell.querySelectorAll('[data-drawn]')].some((e) => e.offsetParent)"
    page.wait_for_function(drawn, arg=cell.element_handle(), timeout=60_000)
    before = cell.evaluate(SHOWN)
    handle = cell.locator(".widget-slider .noUi-handle:visible").first
    # One that stands at an end already moves by the other key; JupyterLab may still take the focus once.
    for key in ("End", "Home", "End", "Home"):
        handle.press(key)
        with contextlib.suppress(PlaywrightTimeout):
            page.wait_for_function(
                f"([c, was]) => ({SHOWN})(c) !== was", arg=[cell.element_handle(), before], timeout=8_000
            )
            return
    pytest.fail("no picture follows the slider")
