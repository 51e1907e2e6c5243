"""GraphML of demonstrations (A.2): enriched event chains in files, which are enough to learn from and to execute.

A file is the thesis's dialect (A.2) with node positions in metres; :func:`sec_lab.graphml.read` reads it as the
observation that it is. What execution needs besides stands in attributes of a namespace of its own:

=====================  ============  ================================================================================
attribute              of            what
=====================  ============  ================================================================================
``frames_per_second``  the document  of the movie
``tip_path_m``         a key frame   x y z of the arm's tip, frame by frame, from this key frame to the next
``joint_path_rad``     a key frame   the same of the angles of its five joints and two fingers, where they are known
``changed_px``         a node        pixels of its segment that differ from the key frame before (D1)
``footprint_m``        a node        corners of the thing seen from above, x y, anticlockwise
``centre_m``           a node        middle of the footprint, at half the height
``height_m``           a node        lowest and highest that is seen of the thing, above the table
``parts``              a node        parts in the picture that are not much smaller than the largest
``gap_m``              an edge       of the last key frame: gap between the two as it was seen last
=====================  ============  ================================================================================

All lengths are in the world's metres, whatever camera saw them, and are written to a micrometre, angles to a tenth
of a milliradian.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
from defusedxml.ElementTree import fromstring

from sec_lab.execution.enriched import Enriched, Filmed, enrich
from sec_lab.execution.perception import Perceived, decisive_rows
from sec_lab.execution.things import TABLE, SeenThing
from sec_lab.files import UnusableFileError, read_whole, write_whole
from sec_lab.graphml import read_observation
from sec_lab.graphml.dialect import to_text
from sec_lab.graphml.markup import elements, finite_number, shown, whole_number
from sec_lab.observation import Observation
from sec_lab.worlds.katana.records import Floats

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

NAMESPACE = "urn:sec-lab:execution"
"""Of the attributes that A.2 does not know; a name, no address."""

_PREFIX = "execution"
_EXPECTED = "a demonstration in GraphML"
_ALLOWED: Mapping[str, frozenset[str]] = {
    "GraphML": frozenset({"frames_per_second"}),
    "KeyFrame": frozenset({"tip_path_m", "joint_path_rad"}),
    "Node": frozenset({"changed_px", "footprint_m", "centre_m", "height_m", "parts"}),
    "Edge": frozenset({"gap_m"}),
}


def write_enriched(path: str | os.PathLike[str], demonstration: Filmed | Enriched) -> None:
    """Write a demonstration as GraphML (A.2) with what execution needs, whole or not at all.

    Parameters
    ----------
    path : path-like
        Its folder must exist.
    demonstration : Demonstrated or Enriched

    Raises
    ------
    UnusableFileError
        If it cannot be written.
    ValueError
        If the positions of what was seen are not in metres.
    """
    given = demonstration if isinstance(demonstration, Enriched) else enrich(demonstration)
    observation = given.perceived.observation
    if observation.position_unit != "m":
        raise ValueError(f"demonstration: expected positions in metres, got {observation.position_unit!r}")
    root = fromstring(to_text(observation).encode())
    root.set(_name("frames_per_second"), repr(float(given.frames_per_second)))
    keys = root.findall("KeyFrame")
    frames = observation.key_frames.tolist()
    for key, begin, end in zip(keys, frames, [*frames[1:], len(given.tip_m)], strict=True):
        key.set(_name("tip_path_m"), _told(given.tip_m[begin:end]))
        if given.joints_rad is not None:
            key.set(_name("joint_path_rad"), _told(given.joints_rad[begin:end], digits=4))
        seen = {thing.label: thing for thing in given.things[begin]}
        changed = given.changed_px[begin]
        for node in key.findall("Node"):
            if changed.get(node.attrib["type"]):
                node.set(_name("changed_px"), str(changed[node.attrib["type"]]))
            if int(node.attrib["id"]) in seen:
                _describe(node, seen[int(node.attrib["id"])])
    names = {str(segment): str(name) for segment, name in observation.names.items()}
    for edge in keys[-1].findall("Edge"):
        gap = given.perceived.last_gap_m(names[edge.attrib["source"]], names[edge.attrib["target"]])
        if np.isfinite(gap):
            edge.set(_name("gap_m"), _told(np.array([[gap]])))
    ElementTree.register_namespace(_PREFIX, NAMESPACE)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    write_whole(path, f"<?xml version='1.0' encoding='UTF-8'?>\n{text}\n")


def read_enriched(path: str | os.PathLike[str]) -> Enriched:
    """Read what :func:`write_enriched` wrote.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Enriched
        Things have no points of their surface but the corners of their footprints, below and above.

    Raises
    ------
    UnusableFileError
        If the file is missing, no GraphML, an observation without what execution needs, or contradicts itself. It is
        a ValueError as well as an OSError.
    """
    file = Path(path)
    observation = read_observation(file)
    data = read_whole(file, expected=_EXPECTED)
    try:
        return _enriched(observation, data)
    except ValueError as error:
        raise UnusableFileError(f"{file}: {error}") from error


def read_enriched_folder(folder: str | os.PathLike[str]) -> dict[str, Enriched]:
    """All demonstrations of a folder (``*.graphml``), by the names of their files, in the order of these.

    Parameters
    ----------
    folder : path-like

    Raises
    ------
    UnusableFileError
        If there is none, or one cannot be read.
    """
    paths = sorted(Path(folder).glob("*.graphml"))
    if not paths:
        raise UnusableFileError(f"{Path(folder)}: expected files of demonstrations (*.graphml), got none")
    return {path.stem: read_enriched(path) for path in paths}


def _enriched(observation: Observation, data: bytes) -> Enriched:
    if observation.position_unit != "m":
        raise ValueError(f"position_unit: expected 'm', got {observation.position_unit!r}")
    children = elements(data)
    root = next(children)
    _check_ours(root)
    fps = finite_number(_needed(root, "frames_per_second"), what="frames_per_second")
    path: list[Floats] = []
    joints: list[Floats] = []
    changed: dict[int, dict[str, int]] = {}
    things: dict[int, tuple[SeenThing, ...]] = {}
    gaps: dict[tuple[str, str], Floats] = {}
    for element in children:
        if element.tag != "KeyFrame":
            continue
        for one in element.iter():
            _check_ours(one)
        frame = whole_number(element.attrib["ID"], what="key frame ID")
        if frame != sum(map(len, path)):
            raise ValueError(
                f"key frame {frame}: expected a path of the tip up to it, got one of {sum(map(len, path))}"
            )
        try:
            path.append(_numbers(_needed(element, "tip_path_m"), 3, what="tip_path_m"))
            angles = element.get(_name("joint_path_rad"))
            if angles is not None:
                joints.append(_numbers(angles, 7, what="joint_path_rad"))
            things[frame] = tuple(_thing(node) for node in element.findall("Node") if node.get(_name("centre_m")))
            changed[frame] = _changed(element)
        except ValueError as error:
            raise ValueError(f"key frame {frame}: {error}") from error
        gaps = {}
        names = {node.attrib["id"]: node.get("type", "") for node in element.findall("Node")}
        for edge in element.findall("Edge"):
            gap = edge.get(_name("gap_m"))
            pair = names[edge.attrib["source"]], names[edge.attrib["target"]]
            gaps[pair] = _numbers(gap, 1, what=f"gap_m of {pair}")[0] if gap else np.array([np.inf])
    moved = _moved(list(things.values()))
    # In the end everything rests.
    perceived = Perceived(observation, decisive_rows(observation), gaps, moved, dict.fromkeys(moved, 0.0))
    known = np.concatenate(joints) if joints else None
    return Enriched(perceived, np.concatenate(path), fps, things, changed, known)


def _changed(key_frame: "Element") -> dict[str, int]:
    changed = {}
    for node in key_frame.findall("Node"):
        text = node.get(_name("changed_px"))
        if text is not None:
            changed[node.get("type", "")] = whole_number(text, what="changed_px")
    if min(changed.values(), default=1) < 1:
        raise ValueError(f"changed_px: expected numbers of pixels above 0, got {min(changed.values())}")
    return changed


def _thing(node: "Element") -> SeenThing:
    name = node.get("type")
    segment = whole_number(node.attrib["id"], what="node id")
    if not name:
        raise ValueError(f"node {segment}: expected a type, got none")
    centre = _numbers(_needed(node, "centre_m"), 3, what=f"{name}: centre_m")
    if len(centre) != 1:
        raise ValueError(f"{name}: centre_m: expected one point, got {len(centre)}")
    nothing = np.zeros((0, 3))
    if name == TABLE:
        return SeenThing(name, segment, nothing, nothing[:, :2], centre[0], 0.0, 0.0, 1)
    corners = _numbers(_needed(node, "footprint_m"), 2, what=f"{name}: footprint_m")
    if len(corners) < 3:
        raise ValueError(f"{name}: footprint_m: expected at least three corners, got {len(corners)}")
    low, high = _numbers(_needed(node, "height_m"), 2, what=f"{name}: height_m")[0].tolist()
    n_parts = whole_number(_needed(node, "parts"), what=f"{name}: parts")
    points = np.concatenate([np.c_[corners, np.full(len(corners), height)] for height in (low, high)])
    return SeenThing(name, segment, points, corners, centre[0], high, low, n_parts)


def _describe(node: "Element", thing: SeenThing) -> None:
    node.set(_name("centre_m"), _told(thing.centre_m[None]))
    if thing.name == TABLE:
        return
    node.set(_name("footprint_m"), _told(thing.footprint_m))
    node.set(_name("height_m"), _told(np.array([[thing.bottom_m, thing.top_m]])))
    node.set(_name("parts"), str(thing.n_parts))


def _moved(seen: Sequence[tuple[SeenThing, ...]]) -> dict[str, float]:
    """How far each thing lies at the last key frame at which it was seen from where it was at the first."""
    first: dict[str, Floats] = {}
    last: dict[str, Floats] = {}
    for things in seen:
        for thing in things:
            first.setdefault(thing.name, thing.centre_m)
            last[thing.name] = thing.centre_m
    return {name: float(np.linalg.norm(last[name] - first[name])) for name in first}


def _name(attribute: str) -> str:
    return f"{{{NAMESPACE}}}{attribute}"


def _needed(element: "Element", attribute: str) -> str:
    value = element.get(_name(attribute))
    if value is None:
        raise ValueError(f"<{element.tag}>: expected what execution needs ({attribute}), got an observation without it")
    return value


def _check_ours(element: "Element") -> None:
    known = {_name(attribute) for attribute in _ALLOWED.get(element.tag, frozenset())}
    for attribute in element.attrib:
        if attribute.startswith(f"{{{NAMESPACE}}}") and attribute not in known:
            raise ValueError(
                f"<{element.tag}>: expected no attribute of execution but {sorted(known)}, got {attribute}"
            )


def _told(points: Floats, *, digits: int = 6) -> str:
    """Rows of numbers, with commas between them."""
    # Adding 0 turns -0 into 0.
    return ", ".join(" ".join(f"{value + 0.0:.{digits}f}" for value in np.round(row, digits)) for row in points)


def _numbers(text: str, width: int, *, what: str) -> Floats:
    rows = [row.split() for row in text.split(",")]
    wrong = next((row for row in rows if len(row) != width), None)
    if wrong is not None:
        raise ValueError(f"{what}: expected {width} numbers between commas, got {shown(' '.join(wrong))}")
    return np.array([[finite_number(value, what=what) for value in row] for row in rows])
