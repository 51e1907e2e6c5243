"""Data of standard GraphML: what keys declare, and what elements say under them; models and observations share it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from sec_lab.graphml.markup import attribute, check, content, shown

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

NAMESPACE = "http://graphml.graphdrawing.org/xmlns"

KEY, DATA, GRAPH, NODE, EDGE = (f"{{{NAMESPACE}}}{name}" for name in ("key", "data", "graph", "node", "edge"))

UNNAMED = object()
"""Stands for the name of a segment of which a file says none; None is that of a fragment."""


@dataclass
class Keys:
    """Keys that a document has declared so far.

    Parameters
    ----------
    type_of : mapping of str to mapping of str to str
        Types of the data that the document may have, by name, by kind of element.
    what : str
        Whose data these are, for messages.
    """

    type_of: Mapping[str, Mapping[str, str]]
    what: str
    declared: dict[str, tuple[str, str]] = field(default_factory=dict)

    def declare(self, element: "Element") -> None:
        """Take a ``<key>``.

        Raises
        ------
        ValueError
            If it is for other data, or its id was there before.
        """
        check(element, required=("id", "for", "attr.name"), optional=("attr.type",))
        key, scope, name = (element.attrib[what] for what in ("id", "for", "attr.name"))
        if name not in self.type_of.get(scope, {}):
            raise ValueError(f"<key>: expected data of {self.what}, got {shown(name)} for {shown(scope)}")
        if key in self.declared:
            raise ValueError(f"<key>: expected each id once, got {shown(key)} twice")
        self.declared[key] = scope, name

    def name_of(self, element: "Element", *, scope: str) -> str:
        """Name of the data that a ``<data>`` of a kind of element holds.

        Raises
        ------
        ValueError
            If its key was not declared for this kind.
        """
        check(element, required=("key",), text=True)
        declared = self.declared.get(element.attrib["key"])
        if declared is None or declared[0] != scope:
            raise ValueError(f"<data>: expected a key declared for {scope!r}, got {shown(element.attrib['key'])}")
        return declared[1]

    def data(self, element: "Element", *, scope: str) -> dict[str, str]:
        """Data of one element by name.

        Raises
        ------
        ValueError
            If one stands there twice, or under no key.
        """
        values: dict[str, str] = {}
        for child in element:
            if child.tag == DATA:
                name = self.name_of(child, scope=scope)
                if name in values:
                    raise ValueError(f"<{scope}>: expected {name!r} once, got it twice")
                values[name] = child.text or ""
        return values


def key_lines(type_of: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Lines that declare all data."""
    return [
        f'  <key id="{scope}_{name}" for="{scope}" attr.name="{name}" attr.type="{kind}"/>'
        for scope, types in type_of.items()
        for name, kind in types.items()
    ]


def data_text(scope: str, name: str, value: str) -> str:
    """A ``<data>`` element."""
    return f"<data key={attribute(f'{scope}_{name}', what='key')}>{content(value, what=f'{name} of a {scope}')}</data>"
