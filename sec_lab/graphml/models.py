"""Models of actions in standard GraphML: one undirected ``<graph>`` a column, for graph programs.

Nodes are roles, edges the rows of the model, each with its relation ("Absence" too, as a row may be absent while its
roles are there) and its weight ω^r. Data of a graph: ``key_frame`` and ``column_weight`` ω^c. What the demonstrations
say stands as a JSON object in the data ``demonstrations`` of the document, names of other segments in ``unseen_names``.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from sec_lab.action_model import ActionModel
from sec_lab.codes import WORD_OF, Relation
from sec_lab.event_chain import EventChain
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

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MODEL_KEY = "demonstrations"
"""Data that only the document of a model has; its key comes first."""

_TYPE_OF: Mapping[str, Mapping[str, str]] = {
    "graphml": {MODEL_KEY: "string", "unseen_names": "string"},
    "graph": {"key_frame": "long", "column_weight": "double"},
    "node": {"name": "string", "fragment": "boolean"},
    "edge": {"relation": "string", "row_weight": "double"},
}
_RELATION_OF = {word: relation for relation, word in WORD_OF.items()}
_PARTS = ("names", "roles", "key_frames", "positions", "position_unit")


def is_model(child: "Element") -> bool:
    """Whether the first child of a standard GraphML document shows that it is a model."""
    return child.tag == KEY and child.get("attr.name") == MODEL_KEY


def to_text(model: ActionModel) -> str:
    """Standard GraphML document of a model.

    Raises
    ------
    ValueError
        If a name has a character that XML cannot hold.
    """
    chain = model.chain
    segments = chain.segments.tolist()
    said = {
        "names": list(model.demonstrations),
        "roles": [list(map(list, model.roles[name].items())) for name in model.demonstrations],
        "key_frames": model.key_frames.tolist(),
        "positions": None if model.positions is None else _without_nan(model.positions.tolist()),
        "position_unit": model.position_unit,
    }
    unseen = {str(segment): name for segment, name in chain.names.items() if segment not in segments}
    for name in (*model.demonstrations, *(name or "" for name in unseen.values())):
        writable(name, what="name")
    lines = ["<?xml version='1.0' encoding='UTF-8'?>", f'<graphml xmlns="{NAMESPACE}">']
    lines += key_lines(_TYPE_OF)
    lines.append(f"  {data_text('graphml', MODEL_KEY, json.dumps(said))}")
    if unseen:
        lines.append(f"  {data_text('graphml', 'unseen_names', json.dumps(unseen))}")
    columns = zip(chain.key_frames.tolist(), model.column_weights.tolist(), chain.relations.T.tolist(), strict=True)
    for frame, weight, column in columns:
        lines += [
            f'  <graph id="column_{frame}" edgedefault="undirected">',
            f"    {data_text('graph', 'key_frame', str(frame))}",
            f"    {data_text('graph', 'column_weight', repr(weight))}",
            *(f'    <node id="{segment}">{_name_data(chain, segment)}</node>' for segment in segments),
        ]
        rows = zip(chain.pairs.tolist(), column, model.row_weights.tolist(), strict=True)
        for (source, target), relation, row_weight in rows:
            data = data_text("edge", "relation", WORD_OF[Relation(relation)]) + data_text(
                "edge", "row_weight", repr(row_weight)
            )
            lines.append(f'    <edge source="{source}" target="{target}">{data}</edge>')
        lines.append("  </graph>")
    return "\n".join([*lines, "</graphml>", ""])


def from_elements(root: "Element", children: "Iterator[Element]") -> ActionModel:
    """Model of the elements of a document that :func:`to_text` made.

    Raises
    ------
    ValueError
        If the document says something that would be lost, contradicts itself or is incomplete.
    """
    check_attributes(root)
    reader = _Reader()
    columns: list[_Column] = []
    for element in children:
        if element.tag == KEY:
            reader.keys.declare(element)
        elif element.tag == DATA:
            reader.read_document_data(element)
        elif element.tag == GRAPH:
            columns.append(reader.column(element))
        else:
            raise ValueError(f"expected <key>, <data> or <graph>, got <{local_name(element.tag)}>")
    if not columns:
        raise ValueError("expected a <graph> for every column of the model, got none")
    first = columns[0]
    for column in columns[1:]:
        if (column.names, column.pairs, column.row_weights) != (first.names, first.pairs, first.row_weights):
            raise ValueError(
                f"column {column.frame}: expected the nodes, pairs and row weights of the first, got others"
            )
    used = {segment for pair in first.pairs for segment in pair}
    if used != first.names.keys():
        raise ValueError(f"expected edges at every node, got none at {min(first.names.keys() ^ used)}")
    names = {segment: name for segment, name in first.names.items() if name is not UNNAMED}
    chain = EventChain(
        np.array([column.relations for column in columns]).T,
        first.pairs,
        [column.frame for column in columns],
        cast(dict[int, str | None], names | reader.unseen),
    )
    return reader.model(chain, first.row_weights, [column.weight for column in columns])


@dataclass(frozen=True)
class _Column:
    frame: int
    weight: float
    names: dict[int, object]
    pairs: list[tuple[int, int]]
    relations: list[Relation]
    row_weights: list[float]


@dataclass
class _Reader:
    """What has been read so far of one document."""

    keys: Keys = field(default_factory=lambda: Keys(_TYPE_OF, "a model"))
    said: dict[str, Any] | None = None
    unseen: dict[int, str | None] = field(default_factory=dict)

    def read_document_data(self, element: "Element") -> None:
        name, text = self.keys.name_of(element, scope="graphml"), element.text or ""
        try:
            value = json.loads(text, parse_constant=_refuse)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"{name}: expected a JSON object, got {shown(text)}") from error
        if not isinstance(value, dict):
            raise ValueError(f"{name}: expected a JSON object, got {shown(text)}")
        if name == MODEL_KEY:
            if self.said is not None:
                raise ValueError(f"{name}: expected it once, got it twice")
            self.said = value
        else:
            self.unseen = {whole_number(label, what=name): said for label, said in value.items()}

    def column(self, element: "Element") -> _Column:
        check(element, required=("edgedefault",), optional=("id",), children=(DATA, NODE, EDGE))
        if element.attrib["edgedefault"] != "undirected":
            raise ValueError(f"<graph>: expected undirected edges, got {shown(element.attrib['edgedefault'])}")
        data = self.keys.data(element, scope="graph")
        _expect(data, _TYPE_OF["graph"], what="<graph>")
        names: dict[int, object] = {}
        pairs: list[tuple[int, int]] = []
        relations: list[Relation] = []
        weights: list[float] = []
        for child in element:
            if child.tag == NODE:
                segment, name = self.node(child)
                if segment in names:
                    raise ValueError(f"node {segment}: expected it once in a column, got it twice")
                names[segment] = name
            elif child.tag == EDGE:
                check(child, required=("source", "target"), optional=("id",), children=(DATA,))
                source, target = (whole_number(child.attrib[end], what=f"edge {end}") for end in ("source", "target"))
                values = self.keys.data(child, scope="edge")
                _expect(values, _TYPE_OF["edge"], what=f"edge {(source, target)}")
                word = values["relation"]
                if word not in _RELATION_OF:
                    raise ValueError(
                        f"edge {(source, target)}: expected one of {list(_RELATION_OF)}, got {shown(word)}"
                    )
                pairs.append((source, target))
                relations.append(_RELATION_OF[word])
                weights.append(finite_number(values["row_weight"], what="row_weight"))
        frame = whole_number(data["key_frame"], what="key_frame")
        weight = finite_number(data["column_weight"], what="column_weight")
        return _Column(frame, weight, names, pairs, relations, weights)

    def node(self, element: "Element") -> tuple[int, object]:
        check(element, required=("id",), children=(DATA,))
        segment = whole_number(element.attrib["id"], what="node id")
        data = self.keys.data(element, scope="node")
        if "fragment" not in data:
            return segment, data.get("name", UNNAMED)
        if data["fragment"] != "true" or "name" in data:
            raise ValueError(f"node {segment}: expected a fragment that is true and has no name, got {data}")
        return segment, None

    def model(self, chain: EventChain, row_weights: list[float], column_weights: list[float]) -> ActionModel:
        if self.said is None:
            raise ValueError(f"expected data {MODEL_KEY!r} of the document, got none")
        said = self.said
        _expect(said, _PARTS, what=MODEL_KEY)
        names, roles, positions = said["names"], said["roles"], said["positions"]
        if not isinstance(names, list) or not isinstance(roles, list) or len(names) != len(roles):
            raise ValueError(f"{MODEL_KEY}: expected as many roles as names")
        try:
            played = {
                name: {int(role): int(segment) for role, segment in one} for name, one in zip(names, roles, strict=True)
            }
            located = None if positions is None else np.array(positions, np.float64)
            frames = np.array(said["key_frames"], np.int64).reshape(len(names), -1)
        except (TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"{MODEL_KEY}: expected tables of numbers, got {error}") from error
        return ActionModel(chain, row_weights, column_weights, names, played, frames, located, said["position_unit"])


def _expect(values: Mapping[str, object], wanted: "Mapping[str, str] | tuple[str, ...]", *, what: str) -> None:
    if set(values) != set(wanted):
        raise ValueError(f"{what}: expected data {', '.join(wanted)}, got {', '.join(values) or 'none'}")


def _without_nan(values: Any) -> Any:
    if isinstance(values, list):
        return [_without_nan(value) for value in values]
    return None if np.isnan(values) else values


def _refuse(constant: str) -> None:
    raise ValueError(f"expected finite numbers, got {constant}")


def _name_data(chain: EventChain, segment: int) -> str:
    if segment not in chain.names:
        return ""
    name = chain.names[segment]
    return data_text("node", "fragment", "true") if name is None else data_text("node", "name", name)
