"""Standard GraphML (Brandes et al., 2010): one undirected ``<graph>`` a key frame, for graph programs.

Nodes are segments, edges the pairs that touch or overlap. Data of a graph: ``key_frame``, ``recorded`` (false: not
known what was seen) and ``position_unit``; of a node: ``name``, ``fragment`` (true: known to be no object), ``type``,
``x``, ``y``, ``z``; of an edge: ``relation``. Names of segments that are in no graph stand as a JSON object in the data
``unseen_names`` of the document. What is read back is what was written; other GraphML is refused.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from sec_lab.codes import WORD_OF
from sec_lab.graphml.assembly import MOST_RELATIONS, Edge, Node, assemble, relation_of
from sec_lab.graphml.keyed import DATA, EDGE, GRAPH, KEY, NAMESPACE, NODE, UNNAMED, Keys, data_text, key_lines
from sec_lab.graphml.markup import (
    check,
    check_attributes,
    finite_number,
    local_name,
    shown,
    whole_number,
    writable,
)
from sec_lab.observation import Observation, PositionUnit
from sec_lab.scene_graph import SceneGraph

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

ROOT = f"{{{NAMESPACE}}}graphml"

_AXES = ("x", "y", "z")
_TYPE_OF: Mapping[str, Mapping[str, str]] = {
    "graphml": {"unseen_names": "string"},
    "graph": {"key_frame": "long", "recorded": "boolean", "position_unit": "string"},
    "node": {"name": "string", "fragment": "boolean", "type": "string", "x": "double", "y": "double", "z": "double"},
    "edge": {"relation": "string"},
}


def from_elements(root: "Element", children: "Iterator[Element]") -> Observation:
    """Observation of the elements of a standard GraphML document that :func:`to_text` made.

    Raises
    ------
    ValueError
        If the document says something that would be lost, contradicts itself or is incomplete.
    """
    check_attributes(root)
    reader = _Reader(room=MOST_RELATIONS)
    graphs: list[SceneGraph | None] = []
    frames: list[int] = []
    units: set[str] = set()
    for element in children:
        if element.tag == KEY:
            reader.keys.declare(element)
        elif element.tag == DATA:
            reader.read_unseen_names(element)
        elif element.tag == GRAPH:
            frame, unit, graph = reader.graph(element)
            frames.append(frame)
            units.add(unit)
            graphs.append(graph)
        else:
            raise ValueError(f"expected <key>, <data> or <graph>, got <{local_name(element.tag)}>")
    if len(units) > 1:
        raise ValueError(f"position_unit: expected the same in every graph, got {' and '.join(sorted(units))}")
    return Observation(graphs, frames, reader.names(), cast(PositionUnit, units.pop() if units else "unknown"))


def to_text(observation: Observation) -> str:
    """Standard GraphML document.

    Raises
    ------
    ValueError
        If a name or type has a character that XML cannot hold.
    """
    seen = {segment for graph in observation.graphs if graph is not None for segment in graph.segments.tolist()}
    unseen = {str(segment): name for segment, name in observation.names.items() if segment not in seen}
    lines = ["<?xml version='1.0' encoding='UTF-8'?>", f'<graphml xmlns="{NAMESPACE}">']
    lines += key_lines(_TYPE_OF)
    if unseen:
        for segment, name in unseen.items():
            writable(name or "", what=f"name of segment {segment}")
        lines.append(f"  {data_text('graphml', 'unseen_names', json.dumps(unseen))}")
    for graph, frame in zip(observation.graphs, observation.key_frames.tolist(), strict=True):
        lines += [
            f'  <graph id="key_frame_{frame}" edgedefault="undirected">',
            f"    {data_text('graph', 'key_frame', str(frame))}",
            f"    {data_text('graph', 'recorded', 'false' if graph is None else 'true')}",
            f"    {data_text('graph', 'position_unit', observation.position_unit)}",
        ]
        if graph is not None:
            lines += [*_node_lines(graph, observation), *_edge_lines(graph)]
        lines.append("  </graph>")
    return "\n".join([*lines, "</graphml>", ""])


@dataclass
class _Reader:
    """What has been read so far of one document."""

    room: int
    keys: Keys = field(default_factory=lambda: Keys(_TYPE_OF, "an event chain"))
    stated: dict[int, object] = field(default_factory=dict)
    unseen: dict[int, str | None] = field(default_factory=dict)

    def read_unseen_names(self, element: "Element") -> None:
        self.keys.name_of(element, scope="graphml")
        try:
            pairs = json.loads(element.text or "", object_pairs_hook=tuple)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"unseen_names: expected a JSON object, got {shown(element.text or '')}") from error
        if not isinstance(pairs, tuple) or not all(isinstance(name, str | None) for _, name in pairs):
            raise ValueError(f"unseen_names: expected a JSON object of names, got {shown(element.text or '')}")
        for label, name in pairs:
            segment = whole_number(label, what="unseen_names")
            if segment in self.unseen:
                raise ValueError(f"unseen_names: expected each segment once, got {segment} twice")
            self.unseen[segment] = name

    def graph(self, element: "Element") -> tuple[int, str, SceneGraph | None]:
        """Key frame, position unit and scene graph of a ``<graph>``."""
        check(element, required=("edgedefault",), optional=("id",), children=(DATA, NODE, EDGE))
        if element.attrib["edgedefault"] != "undirected":
            raise ValueError(f"<graph>: expected undirected edges, got {shown(element.attrib['edgedefault'])}")
        data = self.keys.data(element, scope="graph")
        for name in _TYPE_OF["graph"]:
            if name not in data:
                raise ValueError(f"<graph>: expected data {name!r}, got {sorted(data)}")
        frame = whole_number(data["key_frame"], what="key_frame")
        try:
            nodes = [self.node(child) for child in element if child.tag == NODE]
            edges = [self.edge(child) for child in element if child.tag == EDGE]
            if not _truth(data["recorded"], what="recorded"):
                if nodes or edges:
                    raise ValueError("recorded: expected true of a graph with nodes or edges, got false")
                return frame, data["position_unit"], None
            graph = assemble(nodes, edges, missing_edges="non-touching", room=self.room)
        except ValueError as error:
            raise ValueError(f"key frame {frame}: {error}") from error
        self.room -= len(nodes) ** 2
        return frame, data["position_unit"], graph

    def node(self, element: "Element") -> Node:
        check(element, required=("id",), children=(DATA,))
        segment = whole_number(element.attrib["id"], what="node id")
        data = self.keys.data(element, scope="node")
        axes = tuple(axis for axis in _AXES if axis in data)
        if axes not in ((), _AXES[:2], _AXES):
            raise ValueError(f"node {segment}: expected x, y and perhaps z, got {', '.join(axes)}")
        name: object = data.get("name", UNNAMED)
        if "fragment" in data and _truth(data["fragment"], what=f"node {segment}, fragment"):
            if name is not UNNAMED:
                raise ValueError(f"node {segment}: expected no name of a fragment, got {shown(data['name'])}")
            name = None
        if self.stated.setdefault(segment, name) != name:
            raise ValueError(f"node {segment}: expected the same name in every graph, got another")
        position = tuple(finite_number(data[axis], what=f"node {segment}, {axis}") for axis in axes)
        return Node(segment, position, data.get("type"))

    def edge(self, element: "Element") -> Edge:
        check(element, required=("source", "target"), optional=("id",), children=(DATA,))
        source, target = (whole_number(element.attrib[end], what=f"edge {end}") for end in ("source", "target"))
        data = self.keys.data(element, scope="edge")
        if "relation" not in data:
            raise ValueError(f"edge {(source, target)}: expected data 'relation', got none")
        return Edge(source, target, relation_of(data["relation"]))

    def names(self) -> dict[int, str | None]:
        """Names of all segments, seen and unseen."""
        twice = self.unseen.keys() & self.stated.keys()
        if twice:
            raise ValueError(f"unseen_names: expected segments that are in no graph, got {min(twice)}")
        seen = {segment: cast(str | None, name) for segment, name in self.stated.items() if name is not UNNAMED}
        return seen | self.unseen


def _node_lines(graph: SceneGraph, observation: Observation) -> Iterator[str]:
    for i, segment in enumerate(graph.segments.tolist()):
        data = []
        if segment in observation.names:
            name = observation.names[segment]
            data.append(data_text("node", "fragment", "true") if name is None else data_text("node", "name", name))
        if graph.types is not None:
            data.append(data_text("node", "type", graph.types[i]))
        if graph.positions is not None:
            position = zip(_AXES, graph.positions[i].tolist(), strict=False)
            data += [data_text("node", axis, repr(value)) for axis, value in position]
        yield f'    <node id="{segment}">{"".join(data)}</node>'


def _edge_lines(graph: SceneGraph) -> Iterator[str]:
    for source, target, relation in graph.edges():
        data = data_text("edge", "relation", WORD_OF[relation])
        yield f'    <edge source="{source}" target="{target}">{data}</edge>'


def _truth(text: str, *, what: str) -> bool:
    if text not in ("true", "false"):
        raise ValueError(f"{what}: expected true or false, got {shown(text)}")
    return text == "true"
