"""Notebooks read and executed from the first cell to the last."""

import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import nbformat
from jupyter_client.kernelspec import KernelSpec, KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError
from nbformat import NotebookNode

from sec_lab.files import read_whole

CELL_TIMEOUT_S = 600


class NotebookFailure(RuntimeError):
    """A notebook that could not be executed to its end; the message is one line that names the cell and its error."""


class _ThisInterpreter(KernelSpecManager):
    """Knows one kernel: the interpreter that is running, whatever is registered for the user."""

    def get_kernel_spec(self, kernel_name: str) -> KernelSpec:
        return KernelSpec(
            argv=[sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"],
            display_name=kernel_name,
            language="python",
        )


def read_notebook(path: Path) -> NotebookNode:
    """Read a notebook of format 4.

    Parameters
    ----------
    path : Path
        The ``.ipynb`` file.

    Returns
    -------
    nbformat.NotebookNode

    Raises
    ------
    ValueError
        If the file is missing, a directory, or not a notebook.

    Examples
    --------
    >>> read_notebook(Path("no/such/notebook.ipynb"))
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/notebook.ipynb: expected a Jupyter notebook, but there is no such file
    """
    content = read_whole(path, expected="a Jupyter notebook")
    try:
        notebook: NotebookNode = nbformat.reads(content.decode("utf-8"), as_version=4)
        nbformat.validate(notebook)
    except (ValueError, KeyError, TypeError, AttributeError, nbformat.ValidationError) as error:
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise ValueError(
            f"{path}: expected a Jupyter notebook, but it cannot be read as one ({reason[:120]})"
        ) from error
    return notebook


def code_cells(notebook: NotebookNode) -> list[NotebookNode]:
    """Return the cells that are executed: code, and not empty.

    Examples
    --------
    >>> notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("1"), nbformat.v4.new_code_cell(" ")])
    >>> [cell.source for cell in code_cells(notebook)]
    ['1']
    """
    return [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]


def execute(
    notebook: NotebookNode,
    *,
    folder: Path,
    on_cell: Callable[[], object] = lambda: None,
    variables: Mapping[str, str] | None = None,
) -> NotebookNode:
    """Execute a notebook in order, in a fresh kernel of this very interpreter.

    Parameters
    ----------
    notebook : nbformat.NotebookNode
        Left as it is.
    folder : Path
        Where the kernel works, as a rule the notebook's own folder.
    on_cell : callable, optional
        Called after every executed cell, for progress.
    variables : mapping of str to str, optional
        Environment variables of the kernel, beside those of this process.

    Returns
    -------
    nbformat.NotebookNode
        A copy with new outputs and without wall times or the state of widgets.

    Raises
    ------
    NotebookFailure
        If a cell raises, takes longer than `CELL_TIMEOUT_S` seconds, or the kernel dies.

    Examples
    --------
    >>> notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("6 * 7")])
    >>> execute(notebook, folder=Path()).cells[0].outputs[0].data["text/plain"]
    '42'
    """
    fresh: NotebookNode = nbformat.from_dict(notebook)
    for cell in fresh.cells:
        cell.metadata.pop("execution", None)
    fresh.metadata.pop("widgets", None)
    # The notebooks' own backend draws their figures, whatever this process was told to use.
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    environment |= variables or {}
    running: list[NotebookNode] = []

    def started(cell: NotebookNode, **_: Any) -> None:
        running.append(cell)

    def executed(**_: Any) -> None:
        on_cell()

    with tempfile.TemporaryDirectory() as sockets:
        manager = AsyncKernelManager(
            kernel_name="python3",
            kernel_spec_manager=_ThisInterpreter(),
            connection_file=str(Path(sockets) / "kernel.json"),
            transport="ipc" if os.name == "posix" else "tcp",
        )
        client = NotebookClient(
            fresh,
            km=manager,
            timeout=CELL_TIMEOUT_S,
            record_timing=False,
            store_widget_state=False,
            resources={"metadata": {"path": str(folder)}},
            on_cell_execute=started,
            on_cell_executed=executed,
        )
        try:
            client.execute(env=environment, cleanup_kc=True)
        except (CellExecutionError, CellTimeoutError, DeadKernelError) as error:
            number = [cell is running[-1] for cell in code_cells(fresh)].index(True) + 1 if running else 0
            raise NotebookFailure(f"code cell {number}: {_in_one_line(error)}") from error
    return fresh


def _in_one_line(error: Exception) -> str:
    if isinstance(error, CellExecutionError):
        message = f"{error.ename}: {error.evalue}"
    elif isinstance(error, CellTimeoutError):
        message = f"took longer than {CELL_TIMEOUT_S} s"
    else:
        message = "the kernel died"
    return " ".join(message.split())
