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
from sec_lab.graphml.markup import (
    attribute,
    check,
    check_attributes,
    content,
    finite_number,
    local_name,
    shown,
    whole_number,
    writable,
)
from sec_lab.graphml.standard import NAMESPACE

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MODEL_KEY = "demonstrations"
"""Data that only the document of a model has; its key comes first."""

_KEY, _DATA, _GRAPH, _NODE, _EDGE = (f"{{{NAMESPACE}}}{name}" for name in ("key", "data", "graph", "node", "edge"))
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
    return child.tag == _KEY and child.get("attr.name") == MODEL_KEY


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
    for scope, types in _TYPE_OF.items():
        lines += [
            f'  <key id="{scope}_{name}" for="{scope}" attr.name="{name}" attr.type="{kind}"/>'
            for name, kind in types.items()
        ]
    lines.append(f"  {_data('graphml', MODEL_KEY, json.dumps(said))}")
    if unseen:
        lines.append(f"  {_data('graphml', 'unseen_names', json.dumps(unseen))}")
    columns = zip(chain.key_frames.tolist(), model.column_weights.tolist(), chain.relations.T.tolist(), strict=True)
    for frame, weight, column in columns:
        lines += [
            f'  <graph id="column_{frame}" edgedefault="undirected">',
            f"    {_data('graph', 'key_frame', str(frame))}",
            f"    {_data('graph', 'column_weight', repr(weight))}",
            *(f'    <node id="{segment}">{_name_data(chain, segment)}</node>' for segment in segments),
        ]
        rows = zip(chain.pairs.tolist(), column, model.row_weights.tolist(), strict=True)
        for (source, target), relation, row_weight in rows:
            data = _data("edge", "relation", WORD_OF[Relation(relation)]) + _data(
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
        if element.tag == _KEY:
            reader.declare(element)
        elif element.tag == _DATA:
            reader.read_document_data(element)
        elif element.tag == _GRAPH:
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
    names = {segment: name for segment, name in first.names.items() if name is not _UNNAMED}
    chain = EventChain(
        np.array([column.relations for column in columns]).T,
        first.pairs,
        [column.frame for column in columns],
        cast(dict[int, str | None], names | reader.unseen),
    )
    return reader.model(chain, first.row_weights, [column.weight for column in columns])


_UNNAMED = object()


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

    keys: dict[str, tuple[str, str]] = field(default_factory=dict)
    said: dict[str, Any] | None = None
    unseen: dict[int, str | None] = field(default_factory=dict)

    def declare(self, element: "Element") -> None:
        check(element, required=("id", "for", "attr.name"), optional=("attr.type",))
        key, scope, name = (element.attrib[what] for what in ("id", "for", "attr.name"))
        if name not in _TYPE_OF.get(scope, {}):
            raise ValueError(f"<key>: expected data of a model, got {shown(name)} for {shown(scope)}")
        if key in self.keys:
            raise ValueError(f"<key>: expected each id once, got {shown(key)} twice")
        self.keys[key] = scope, name

    def name_of(self, element: "Element", scope: str) -> str:
        check(element, required=("key",), text=True)
        declared = self.keys.get(element.attrib["key"])
        if declared is None or declared[0] != scope:
            raise ValueError(f"<data>: expected a key declared for {scope!r}, got {shown(element.attrib['key'])}")
        return declared[1]

    def data(self, element: "Element", scope: str) -> dict[str, str]:
        values: dict[str, str] = {}
        for child in element:
            if child.tag == _DATA:
                name = self.name_of(child, scope)
                if name in values:
                    raise ValueError(f"<{scope}>: expected {name!r} once, got it twice")
                values[name] = child.text or ""
        return values

    def read_document_data(self, element: "Element") -> None:
        name, text = self.name_of(element, "graphml"), element.text or ""
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
        check(element, required=("edgedefault",), optional=("id",), children=(_DATA, _NODE, _EDGE))
        if element.attrib["edgedefault"] != "undirected":
            raise ValueError(f"<graph>: expected undirected edges, got {shown(element.attrib['edgedefault'])}")
        data = self.data(element, "graph")
        _expect(data, _TYPE_OF["graph"], what="<graph>")
        names: dict[int, object] = {}
        pairs: list[tuple[int, int]] = []
        relations: list[Relation] = []
        weights: list[float] = []
        for child in element:
            if child.tag == _NODE:
                segment, name = self.node(child)
                if segment in names:
                    raise ValueError(f"node {segment}: expected it once in a column, got it twice")
                names[segment] = name
            elif child.tag == _EDGE:
                check(child, required=("source", "target"), optional=("id",), children=(_DATA,))
                source, target = (whole_number(child.attrib[end], what=f"edge {end}") for end in ("source", "target"))
                values = self.data(child, "edge")
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
        check(element, required=("id",), children=(_DATA,))
        segment = whole_number(element.attrib["id"], what="node id")
        data = self.data(element, "node")
        if "fragment" not in data:
            return segment, data.get("name", _UNNAMED)
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
    return _data("node", "fragment", "true") if name is None else _data("node", "name", name)


def _data(scope: str, name: str, value: str) -> str:
    return f"<data key={attribute(f'{scope}_{name}', what='key')}>{content(value, what=f'{name} of a {scope}')}</data>"
