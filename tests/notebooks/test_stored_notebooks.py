"""The notebooks as they are committed: executed in order, whole, small and thin."""

import ast
import json
from pathlib import Path

import nbformat
import pytest
from nbformat import NotebookNode

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
LONGEST_CELL = 14
LARGEST_BYTES = 5 * 1024**2
WIDGET = "application/vnd.jupyter.widget-view+json"


def problems_of(notebook: NotebookNode) -> list[str]:
    """Everything about a stored notebook that a reader, or the comparison of outputs, would stumble over."""
    found = []
    cells = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]
    if not cells:
        found.append("no code cell")
    if not notebook.cells or not notebook.cells[0].source.startswith("# "):
        found.append("does not begin with a title")
    for number, cell in enumerate(cells, start=1):
        if cell.execution_count != number:
            found.append(f"code cell {number} has execution count {cell.execution_count}: not executed in order")
        if len(cell.source.splitlines()) > LONGEST_CELL:
            found.append(f"code cell {number} has more than {LONGEST_CELL} lines")
        if any(output.output_type == "error" for output in cell.outputs):
            found.append(f"code cell {number} stores an error")
        if any(output.get("name") == "stderr" for output in cell.outputs):
            found.append(f"code cell {number} stores a warning or a log")
        if any(isinstance(node, ast.ClassDef) for node in ast.walk(ast.parse(_without_magics(cell.source)))):
            found.append(f"code cell {number} defines a class")
        found += [f"code cell {number}: {problem}" for problem in _unchecked(cell)]
    return found


def _without_magics(source: str) -> str:
    return "\n".join("pass" if line.startswith(("%", "!")) else line for line in source.splitlines())


def _unchecked(cell: NotebookNode) -> list[str]:
    """Only live widgets and addresses of servers may escape the comparison of outputs."""
    ignored = "nbval-ignore-output" in cell.metadata.get("tags", []) or "NBVAL_IGNORE_OUTPUT" in cell.source
    text = json.dumps(cell.outputs)
    live = WIDGET in text or "http://localhost" in text or "http://127.0.0.1" in text
    problems = []
    if ignored and not live:
        problems.append("ignores its outputs, but shows no live widget")
    if live and not ignored:
        problems.append("shows a live widget without the tag nbval-ignore-output")
    if "nbval-skip" in cell.metadata.get("tags", []) or "NBVAL_SKIP" in cell.source:
        problems.append("is skipped")
    return problems


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_stored_notebook(path: Path) -> None:
    assert problems_of(nbformat.read(path, as_version=4)) == []
    assert path.stat().st_size <= LARGEST_BYTES


def code(source: str, count: int, *outputs: NotebookNode, tags: tuple[str, ...] = ()) -> NotebookNode:
    return nbformat.v4.new_code_cell(
        source, execution_count=count, outputs=list(outputs), metadata={"tags": list(tags)}
    )


def notebook_of(*cells: NotebookNode) -> NotebookNode:
    return nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("# Title"), *cells])


def widget() -> NotebookNode:
    return nbformat.v4.new_output("display_data", data={WIDGET: {"model_id": "1"}})


def test_a_thin_executed_notebook_passes() -> None:
    assert problems_of(notebook_of(code("1 + 1", 1), code("slider", 2, widget(), tags=("nbval-ignore-output",)))) == []


@pytest.mark.parametrize(
    ("cell", "problem"),
    [
        (code("1", 2), "not executed in order"),
        (code("\n".join(["1"] * 15), 1), "more than 14 lines"),
        (code("class A:\n    pass", 1), "defines a class"),
        (code("1", 1, nbformat.v4.new_output("error", ename="E", evalue="")), "stores an error"),
        (code("1", 1, nbformat.v4.new_output("stream", name="stderr", text="!")), "stores a warning"),
        (code("1", 1, tags=("nbval-ignore-output",)), "shows no live widget"),
        (code("slider", 1, widget()), "without the tag"),
        (code("1", 1, tags=("nbval-skip",)), "is skipped"),
    ],
)
def test_each_problem_is_named(cell: NotebookNode, problem: str) -> None:
    found = problems_of(notebook_of(cell))
    assert len(found) == 1
    assert problem in found[0]
