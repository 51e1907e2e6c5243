"""The thesis's own GraphML dialect (A.2): ``<GraphML><KeyFrame ID=…><Node …/><Edge …/>``.

What the dialect says beyond the sample of A.2:

- ``<ReplaceObject><Object id=… obj=…/></ReplaceObject>`` names segments; ``null`` marks one that is no object. Without
  it the types of the nodes are the names.
- A key frame without content was *not recorded*.

Two attributes are ours, written only where the dialect has no word: ``position_unit`` on ``<GraphML>`` when the unit
is known, and ``recorded="true"`` on a key frame that was recorded and in which every segment is absent.
"""

import logging
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, cast

from sec_lab.codes import WORD_OF, Relation
from sec_lab.event_chain import Names
from sec_lab.graphml.assembly import MOST_RELATIONS, UNKNOWN_TYPE, Edge, MissingEdges, Node, assemble, relation_of
from sec_lab.graphml.markup import attribute, check, check_attributes, finite_number, local_name, shown, whole_number
from sec_lab.observation import Observation, PositionUnit
from sec_lab.scene_graph import SceneGraph

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

ROOT = "GraphML"
NO_OBJECT = "null"

_AXES = ("pos_X", "pos_Y", "pos_Z")
_LOG = logging.getLogger(__name__)


def from_elements(
    root: "Element", children: "Iterator[Element]", *, missing_edges: MissingEdges, source: str
) -> Observation:
    """Observation of the elements of a document in the dialect of A.2.

    Parameters
    ----------
    root : Element
        The opened root.
    children : iterator of Element
        Its children, each closed.
    missing_edges : {"error", "non-touching"}
        What a pair of nodes without an edge means.
    source : str
        Short name of the file, for the log.

    Raises
    ------
    ValueError
        If the document says something that the dialect does not know, contradicts itself or is incomplete.
    """
    check_attributes(root, optional=("position_unit",))
    graphs: list[SceneGraph | None] = []
    frames: list[int] = []
    names: Names | None = None
    room = MOST_RELATIONS
    for element in children:
        if element.tag == "KeyFrame":
            check(element, required=("ID",), optional=("recorded",), children=("Node", "Edge"))
            frame = whole_number(element.attrib["ID"], what="key frame ID")
            try:
                graph = _key_frame(element, missing_edges=missing_edges, room=room)
            except ValueError as error:
                raise ValueError(f"key frame {frame}: {error}") from error
            room -= 0 if graph is None else len(graph.segments) ** 2
            graphs.append(graph)
            frames.append(frame)
        elif element.tag == "ReplaceObject":
            if names is not None:
                raise ValueError("expected one <ReplaceObject>, got two")
            names = _object_names(element, source=source)
        else:
            raise ValueError(f"expected <KeyFrame> or <ReplaceObject>, got <{local_name(element.tag)}>")
    unit = cast(PositionUnit, root.get("position_unit", "unknown"))
    return Observation(graphs, frames, names_of_types(graphs) if names is None else names, unit)


def to_text(observation: Observation) -> str:
    """Document in the dialect of A.2: every pair of nodes has an edge, sources ascending, then targets.

    Positions are written with all their digits. ``<ReplaceObject>`` is written when the names are not simply the
    types of the nodes.

    Raises
    ------
    ValueError
        If a segment is really named "null", which means *no object* here, or a name or type has a character that XML
        cannot hold.
    """
    unit = "" if observation.position_unit == "unknown" else f' position_unit="{observation.position_unit}"'
    lines = ["<?xml version='1.0' encoding='UTF-8'?>", f"<{ROOT}{unit}>"]
    if observation.names != names_of_types(observation.graphs):
        lines.append("  <ReplaceObject>")
        lines += [_object_line(segment, name) for segment, name in observation.names.items()]
        lines.append("  </ReplaceObject>")
    for graph, frame in zip(observation.graphs, observation.key_frames.tolist(), strict=True):
        if graph is None:
            lines.append(f'  <KeyFrame ID="{frame}"/>')
        elif not len(graph.segments):
            lines.append(f'  <KeyFrame ID="{frame}" recorded="true"/>')
        else:
            lines += [f'  <KeyFrame ID="{frame}">', *_node_lines(graph), *_edge_lines(graph), "  </KeyFrame>"]
    return "\n".join([*lines, f"</{ROOT}>", ""])


def names_of_types(graphs: Iterable[SceneGraph | None]) -> dict[int, str | None]:
    """Names that the types of the nodes give: a segment is named if it has one known type in all key frames.

    Examples
    --------
    >>> names_of_types([SceneGraph([1, 2], [[0, 0], [0, 0]], types=["Red Box", "Unknown"]), None])
    {1: 'Red Box'}
    """
    types: dict[int, set[str]] = {}
    for graph in graphs:
        if graph is not None and graph.types is not None:
            for segment, name in zip(graph.segments.tolist(), graph.types, strict=True):
                types.setdefault(segment, set()).add(name)
    return {segment: min(seen) for segment, seen in types.items() if len(seen) == 1 and not seen & {"", UNKNOWN_TYPE}}


def _key_frame(element: "Element", *, missing_edges: MissingEdges, room: int) -> SceneGraph | None:
    recorded = element.get("recorded")
    if recorded not in (None, "true", "false"):
        raise ValueError(f"recorded: expected true or false, got {shown(recorded)}")
    if recorded == "false" and len(element):
        raise ValueError("recorded: expected true of a key frame with content, got false")
    if not len(element) and recorded != "true":
        return None
    nodes = [_node(child) for child in element if child.tag == "Node"]
    edges = [_edge(child) for child in element if child.tag == "Edge"]
    return assemble(nodes, edges, missing_edges=missing_edges, room=room)


def _node(element: "Element") -> Node:
    check(element, required=("id",), optional=(*_AXES, "type"))
    segment = whole_number(element.attrib["id"], what="node id")
    axes = tuple(axis for axis in _AXES if axis in element.attrib)
    if axes not in ((), _AXES[:2], _AXES):
        raise ValueError(f"node {segment}: expected pos_X, pos_Y and perhaps pos_Z, got {', '.join(axes)}")
    position = tuple(finite_number(element.attrib[axis], what=f"node {segment}, {axis}") for axis in axes)
    return Node(segment, position, element.get("type"))


def _edge(element: "Element") -> Edge:
    check(element, required=("source", "target", "relation"))
    source, target = (whole_number(element.attrib[end], what=f"edge {end}") for end in ("source", "target"))
    try:
        return Edge(source, target, relation_of(element.attrib["relation"]))
    except ValueError as error:
        raise ValueError(f"edge {(source, target)}: {error}") from error


def _object_names(element: "Element", *, source: str) -> dict[int, str | None]:
    check(element, children=("Object",))
    names: dict[int, str | None] = {}
    for child in element:
        check(child, required=("id", "obj"))
        segment = whole_number(child.attrib["id"], what="object id")
        name = None if child.attrib["obj"] == NO_OBJECT else child.attrib["obj"]
        # Real files name a segment twice; replacements apply in their order, so the last stands, and it is said aloud.
        if names.get(segment, name) != name:
            _LOG.warning("%s: segment %d is named %r, then %r; the last counts", source, segment, names[segment], name)
        names[segment] = name
    return names


def _object_line(segment: int, name: str | None) -> str:
    if name == NO_OBJECT:
        raise ValueError(f"name of segment {segment}: expected any name but 'null', which means no object in a file")
    written = attribute(NO_OBJECT if name is None else name, what=f"name of segment {segment}")
    return f'    <Object id="{segment}" obj={written}/>'


def _node_lines(graph: SceneGraph) -> Iterator[str]:
    for i, segment in enumerate(graph.segments.tolist()):
        words = []
        if graph.positions is not None:
            words += [f'{axis}="{value!r}"' for axis, value in zip(_AXES, graph.positions[i].tolist(), strict=False)]
        if graph.types is not None:
            words.append(f"type={attribute(graph.types[i], what=f'type of segment {segment}')}")
        words.append(f'id="{segment}"')
        yield f"    <Node {' '.join(words)}/>"


def _edge_lines(graph: SceneGraph) -> Iterator[str]:
    segments = graph.segments.tolist()
    for i, row in enumerate(graph.relations.tolist()):
        for j in range(i + 1, len(segments)):
            yield f'    <Edge target="{segments[j]}" relation="{WORD_OF[Relation(row[j])]}" source="{segments[i]}"/>'
