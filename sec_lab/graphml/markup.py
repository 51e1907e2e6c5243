"""XML at the border: read safely and strictly, piece by piece, and written so that every character survives."""

import math
import re
from collections.abc import Collection, Iterator
from io import BytesIO
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import ParseError, iterparse

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

DEEPEST = 8
"""Nested elements that are read; both kinds of file need four."""

MOST_ELEMENTS = 1 << 20
"""Elements in one key frame; 1,448 segments with a relation for every pair fill it."""

_WHOLE_NUMBER = re.compile(r"-?[0-9]{1,19}")
_DECIMAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def elements(data: bytes) -> "Iterator[Element]":
    """Yield the root of an XML document as soon as it opens, then each of its children as soon as it closes.

    A child is forgotten once the next is asked for, so a document of any length needs the memory of one child.
    Document type declarations are refused altogether: with them go entity bombs and external entities.

    Raises
    ------
    ValueError
        If the document is not well-formed, declares a document type, is nested deeper than ``DEEPEST``, or a child
        has more than ``MOST_ELEMENTS`` elements.

    Examples
    --------
    >>> [element.tag for element in elements(b"<GraphML><KeyFrame ID='4'/><KeyFrame ID='39'/></GraphML>")]
    ['GraphML', 'KeyFrame', 'KeyFrame']
    """
    depth = count = 0
    root: Element | None = None
    last: Element | None = None
    try:
        for event, element in iterparse(BytesIO(data), events=("start", "end"), forbid_dtd=True):
            if event == "start":
                depth += 1
                count += 1
                if depth > DEEPEST:
                    raise ValueError(f"expected elements nested at most {DEEPEST} deep, got deeper ones")
                if count > MOST_ELEMENTS:
                    raise ValueError(f"expected at most {MOST_ELEMENTS} elements in a key frame, got more")
                if root is None:
                    root = element
                    yield root
            else:
                depth -= 1
                if depth == 1 and root is not None:
                    _check_blank(root, root.text if last is None else last.tail)
                    last, count = element, 0
                    yield element
                    root.remove(element)
                elif depth == 0 and root is not None:
                    _check_blank(root, root.text if last is None else last.tail)
    except DefusedXmlException as error:
        raise ValueError(
            "expected no document type declaration and no entities, got one (refused as unsafe)"
        ) from error
    except (ParseError, LookupError) as error:
        raise ValueError(f"expected a whole, well-formed XML document, got: {error}") from error


def check(
    element: "Element",
    *,
    required: Collection[str] = (),
    optional: Collection[str] = (),
    children: Collection[str] = (),
    text: bool = False,
) -> None:
    """Check that an element has what it needs and nothing that would be lost.

    Attributes of another namespace (``xsi:schemaLocation``) belong to other programs and are passed over; any other
    attribute, child or text that is not expected is an error, because reading and writing would silently drop it.

    Raises
    ------
    ValueError
        If an attribute is missing, or there is an unknown attribute, an unknown child, or text where none belongs.
    """
    check_attributes(element, required=required, optional=optional)
    name = local_name(element.tag)
    for child in element:
        if child.tag not in children:
            expected = ", ".join(f"<{local_name(tag)}>" for tag in children) or "nothing"
            raise ValueError(f"<{name}>: expected {expected} inside, got <{local_name(child.tag)}>")
        _check_blank(element, child.tail)
    if not text:
        _check_blank(element, element.text)


def check_attributes(element: "Element", *, required: Collection[str] = (), optional: Collection[str] = ()) -> None:
    """Check only the attributes of an element, which is all that can be checked of a root that is still open.

    Raises
    ------
    ValueError
        If an attribute is missing or unknown.
    """
    name = local_name(element.tag)
    for attribute in required:
        if attribute not in element.attrib:
            raise ValueError(f"<{name}>: expected an attribute {attribute!r}, got {sorted(element.attrib)}")
    for attribute in element.attrib:
        if attribute not in required and attribute not in optional and not attribute.startswith("{"):
            expected = ", ".join([*required, *optional]) or "none"
            raise ValueError(f"<{name}>: expected no attribute but {expected}, got {shown(attribute)}")


def local_name(tag: str) -> str:
    """Name of an element without its namespace."""
    return tag.rpartition("}")[2]


def whole_number(text: str, *, what: str) -> int:
    """Whole number that fits into 64 bits, as written in a file.

    Raises
    ------
    ValueError
        If it is anything else.
    """
    if not _WHOLE_NUMBER.fullmatch(text) or not -(2**63) <= int(text) < 2**63:
        raise ValueError(f"{what}: expected a whole number, got {shown(text)}")
    return int(text)


def finite_number(text: str, *, what: str) -> float:
    """Finite number, as written in a file.

    Raises
    ------
    ValueError
        If it is anything else.
    """
    if not _DECIMAL.fullmatch(text) or not math.isfinite(float(text)):
        raise ValueError(f"{what}: expected a finite number, got {shown(text)}")
    return float(text)


def shown(text: str) -> str:
    """Quotation of what a file says, short enough for an error message."""
    return repr(text if len(text) <= 60 else text[:57] + "...")


def attribute(text: str, *, what: str) -> str:
    """Text as the quoted value of an attribute; line breaks and tabs survive.

    Raises
    ------
    ValueError
        If a character cannot be written in XML.

    Examples
    --------
    >>> attribute("cup & saucer", what="name")
    '"cup &amp; saucer"'
    """
    return quoteattr(writable(text, what=what))


def content(text: str, *, what: str) -> str:
    """Text between tags; carriage returns survive.

    Raises
    ------
    ValueError
        If a character cannot be written in XML.
    """
    return escape(writable(text, what=what), {"\r": "&#13;"})


def writable(text: str, *, what: str) -> str:
    """Return the text itself, once it is known that XML can hold it.

    Raises
    ------
    ValueError
        If a character cannot be written in XML.
    """
    wrong = _NOT_XML.search(text)
    if wrong:
        raise ValueError(f"{what}: expected characters that XML can hold, got {wrong[0]!r} in {shown(text)}")
    return text


def _check_blank(element: "Element", text: str | None) -> None:
    if text is not None and text.strip(" \t\r\n"):
        raise ValueError(f"<{local_name(element.tag)}>: expected no text inside, got {shown(text.strip())}")
