"""Collections: folders of recordings, and the manipulations that their names stand for."""

import os
import re
from pathlib import Path

from sec_lab.files import UnusableFileError
from sec_lab.graphml.assembly import MissingEdges
from sec_lab.graphml.documents import read_observation
from sec_lab.observation import Observation

_PLAIN_NAME = "GraphML.xml"


def read_collection(folder: str | os.PathLike[str], *, missing_edges: MissingEdges = "error") -> dict[str, Observation]:
    """Read every recording below a folder.

    A recording is a file ``GraphML.xml``, named after the folder it lies in, or a file ``*.graphml``, named by
    itself.

    Parameters
    ----------
    folder : path-like
        Where to look, at any depth.
    missing_edges : {"error", "non-touching"}, optional
        As in :func:`~sec_lab.graphml.read`.

    Returns
    -------
    dict of str to Observation
        By name, in the order of the paths.

    Raises
    ------
    UnusableFileError
        If it is no folder, holds no recording, two recordings have the same name, or one of them cannot be read.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     for name in ("Cutting_01", "Cutting_02"):
    ...         (Path(folder) / name).mkdir()
    ...         _ = (Path(folder) / name / "GraphML.xml").write_text("<GraphML><KeyFrame ID='4'/></GraphML>")
    ...     list(read_collection(folder))
    ['Cutting_01', 'Cutting_02']
    """
    top = Path(folder)
    if not top.is_dir():
        why = "this is a file" if top.exists() else "there is no such folder"
        raise UnusableFileError(f"{top}: expected a folder of recordings, but {why}")
    found = sorted({*top.rglob(_PLAIN_NAME), *top.rglob("*.graphml")})
    path_of: dict[str, Path] = {}
    for path in (path for path in found if path.is_file()):
        name = path.parent.resolve().name if path.name == _PLAIN_NAME else path.stem
        if name in path_of:
            raise UnusableFileError(f"{path}: expected recordings of different names, but {path_of[name]} has it too")
        path_of[name] = path
    if not path_of:
        raise UnusableFileError(f"{top}: expected files named {_PLAIN_NAME} or *.graphml below it, but there is none")
    return {name: read_observation(path, missing_edges=missing_edges) for name, path in path_of.items()}


def manipulation(name: str) -> str:
    """Manipulation that a recording shows, by its name: the name without its number.

    Raises
    ------
    ValueError
        If the name is but a number.

    Examples
    --------
    >>> manipulation("Put_on_Top_06")
    'Put on Top'
    """
    shown = re.sub(r"[\s_-]*[0-9]*$", "", name).replace("_", " ").strip()
    if not shown:
        raise ValueError(f"expected a name such as 'Cutting_01', got {name!r}")
    return shown
