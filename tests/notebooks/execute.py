"""Execute notebooks in place and store their outputs: ``python tests/notebooks/execute.py NOTEBOOK...``."""

import os
import sys
from pathlib import Path

import nbformat
from tqdm import tqdm

from sec_lab.files import write_whole
from sec_lab.report.execution import NotebookFailure, code_cells, execute, read_notebook


def store_outputs(path: Path) -> None:
    notebook = read_notebook(path)
    with tqdm(total=len(code_cells(notebook)), unit="cell", desc=path.stem) as bar:
        done = execute(notebook, folder=path.parent, on_cell=bar.update)
    # The same on every machine and Python.
    done.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    done.metadata["language_info"] = {"name": "python"}
    write_whole(path, nbformat.writes(done) + "\n")


def main(arguments: list[str]) -> int:
    failed = 0
    for path in map(Path, arguments):
        recordings = os.environ.get("SEC_LAB_DATA")
        if path.name.startswith("real_recordings_") and not (recordings and Path(recordings).is_dir()):
            print(f"{path}: left as it is, SEC_LAB_DATA is not set to the folder of the recordings", file=sys.stderr)
            continue
        try:
            store_outputs(path)
        except (NotebookFailure, ValueError) as error:
            print(f"{path}: left as it is, {error}", file=sys.stderr)
            failed += 1
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
