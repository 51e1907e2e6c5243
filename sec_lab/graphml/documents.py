"""Whole files: which of the two GraphML kinds they are, read and written."""

import os
from itertools import chain as chained
from pathlib import Path
from typing import Literal, get_args

from sec_lab.action_model import ActionModel
from sec_lab.event_chain import EventChain
from sec_lab.files import UnusableFileError, read_whole, write_whole
from sec_lab.graphml import dialect as thesis_dialect
from sec_lab.graphml import models, standard
from sec_lab.graphml.assembly import MissingEdges
from sec_lab.graphml.markup import elements, local_name
from sec_lab.graphml.tables import chain_of_table
from sec_lab.observation import Observation

Dialect = Literal["thesis", "standard"]

_MOST_CHAIN_ENTRIES = 1 << 24
_XML_BEGINNINGS = (b"<", b"\xef\xbb\xbf<", b"\xff\xfe", b"\xfe\xff", b"<\x00", b"\x00<")


def read(path: str | os.PathLike[str], *, missing_edges: MissingEdges = "error") -> Observation | ActionModel:
    """Read what was seen in one movie, or the model of an action, from a GraphML file.

    Which kind of file it is decides its root element: the thesis's dialect (A.2), or standard GraphML as
    :func:`write` makes it. Nothing that a file says is dropped: an element, attribute or text that the workbench does
    not know is an error; only attributes of another XML namespace are passed over.

    Parameters
    ----------
    path : path-like
        The file.
    missing_edges : {"error", "non-touching"}, optional
        What it means, in the dialect of A.2, when a pair of nodes of a key frame has no edge. Files of the thesis
        have an edge for every pair ("NoConnection" too), so by default it is an error. In standard GraphML such pairs
        do not touch.

    Returns
    -------
    Observation or ActionModel
        A model if the file is one. Of an observation: positions in the unit of the file; types of nodes as
        written. Names come from ``<ReplaceObject>`` (None for
        ``null``), otherwise from types that are known and the same in all key frames. A key frame without content was
        *not recorded*, its graph is None. Of two names for one segment the last counts, and a warning is logged.

    Raises
    ------
    UnusableFileError
        If the file is missing, unreadable, truncated, unsafe, no GraphML, or says something unknown, contradictory
        or incomplete. It is a ValueError as well as an OSError.
    ValueError
        If ``missing_edges`` is unknown.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "GraphML.xml"
    ...     text = "<GraphML><KeyFrame ID='4'/><KeyFrame ID='53'><Node id='76' type='Robot Arm'/></KeyFrame></GraphML>"
    ...     _ = file.write_text(text)
    ...     seen = read(file)
    >>> seen.key_frames, seen.graphs[0], dict(seen.names)
    (array([ 4, 53]), None, {76: 'Robot Arm'})
    """
    if missing_edges not in get_args(MissingEdges):
        raise ValueError(f"missing_edges: expected one of {get_args(MissingEdges)}, got {missing_edges!r}")
    return _content(read_whole(path, expected="a GraphML file"), path, missing_edges=missing_edges)


def read_observation(path: str | os.PathLike[str], *, missing_edges: MissingEdges = "error") -> Observation:
    """Read what was seen in one movie, see :func:`read`.

    Raises
    ------
    UnusableFileError
        If it is the file of a model, or as in :func:`read`.
    """
    seen = read(path, missing_edges=missing_edges)
    if isinstance(seen, ActionModel):
        raise UnusableFileError(f"{Path(path)}: expected what was seen in a movie, got the model of an action")
    return seen


def read_model(path: str | os.PathLike[str]) -> ActionModel:
    """Read the model of an action, see :func:`read`.

    Raises
    ------
    UnusableFileError
        If it is the file of an observation, or as in :func:`read`.
    """
    model = read(path)
    if isinstance(model, Observation):
        raise UnusableFileError(f"{Path(path)}: expected the model of an action, got what was seen in a movie")
    return model


def write(path: str | os.PathLike[str], content: Observation | ActionModel, *, dialect: Dialect | None = None) -> None:
    """Write what was seen in one movie, or a model, whole or not at all; :func:`read` gives it back unchanged.

    Parameters
    ----------
    path : path-like
        Where the file goes; its folder must exist.
    content : Observation or ActionModel
    dialect : {"thesis", "standard"}, optional
        The dialect of A.2 (default for an observation; it knows no models), or standard GraphML (always for a
        model), one graph a key frame, which graph programs open. Of several
        graphs ``networkx.read_graphml`` gives the first; ``networkx.GraphMLReader()(path)`` goes through all of them.

    Raises
    ------
    TypeError
        If it is neither.
    ValueError
        If the dialect is unknown or knows no models, or a name cannot be written: it has control characters, or it is
        "null", which
        means *no object* in the dialect of A.2.
    UnusableFileError
        If the file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from sec_lab.scene_graph import SceneGraph
    >>> seen = Observation([SceneGraph([1, 2], [[0, 2], [2, 0]])], [53])
    >>> with TemporaryDirectory() as folder:
    ...     write(Path(folder) / "chain.graphml", seen)
    ...     read(Path(folder) / "chain.graphml").graphs[0].edges()
    [(1, 2, <Relation.TOUCHING: 2>)]
    """
    if dialect is not None and dialect not in get_args(Dialect):
        raise ValueError(f"dialect: expected one of {get_args(Dialect)}, got {dialect!r}")
    if isinstance(content, ActionModel):
        if dialect == "thesis":
            raise ValueError("dialect: expected 'standard' for a model, whose weights A.2 cannot say, got 'thesis'")
        text = models.to_text(content)
    elif isinstance(content, Observation):
        text = standard.to_text(content) if dialect == "standard" else thesis_dialect.to_text(content)
    else:
        raise TypeError(f"expected an Observation or an ActionModel, got {type(content).__name__}")
    write_whole(path, text)


def read_chain(path: str | os.PathLike[str]) -> EventChain:
    r"""Read an event chain from a GraphML file of either kind or from a table of relations.

    What begins with ``<`` is read as by :func:`read`, anything else as by :func:`~sec_lab.graphml.read_table`.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    EventChain
        Of a model, its chain.

    Raises
    ------
    UnusableFileError
        If it is neither, or the key frames make no chain: none recorded, or fewer than two segments.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "SEC.dat").write_text("1\t2\t0\t1\t9\n")
    ...     read_chain(Path(folder) / "SEC.dat").relations
    array([[0, 2, 9]], dtype=uint8)
    """
    data = read_whole(path, expected="a GraphML file or a table of relations")
    if not data.lstrip().startswith(_XML_BEGINNINGS):
        return chain_of_table(data, path)
    observation = _content(data, path, missing_edges="error")
    if isinstance(observation, ActionModel):
        return observation.chain
    try:
        segments = len(observation.segments)
        if segments**2 * len(observation.graphs) > _MOST_CHAIN_ENTRIES:
            raise ValueError(f"event chain: expected at most {_MOST_CHAIN_ENTRIES} entries, got {segments} segments")
        return observation.chain
    except ValueError as error:
        raise UnusableFileError(f"{Path(path)}: {error}") from error


def _content(data: bytes, path: str | os.PathLike[str], *, missing_edges: MissingEdges) -> Observation | ActionModel:
    file = Path(path)
    if not data:
        raise UnusableFileError(f"{file}: expected a GraphML file, but it is empty")
    try:
        children = elements(data)
        root = next(children)
        if root.tag == thesis_dialect.ROOT:
            source = "/".join(file.parts[-2:])
            return thesis_dialect.from_elements(root, children, missing_edges=missing_edges, source=source)
        if root.tag == standard.ROOT:
            first = next(children, None)
            if first is None:
                return standard.from_elements(root, children)
            reader = models.from_elements if models.is_model(first) else standard.from_elements
            return reader(root, chained([first], children))
        raise ValueError(
            "expected <GraphML> (A.2) or <graphml> of standard GraphML as the root, "
            f"got <{local_name(root.tag)}>{'' if '}' in root.tag else ' of no namespace'}"
        )
    except ValueError as error:
        raise UnusableFileError(f"{file}: {error}") from error
