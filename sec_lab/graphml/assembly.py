"""From the nodes and edges that a file lists to a scene graph: the checks that both kinds of file share."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from sec_lab.codes import WORD_OF, Relation
from sec_lab.graphml.markup import shown
from sec_lab.scene_graph import SceneGraph

MissingEdges = Literal["error", "non-touching"]

UNKNOWN_TYPE = "Unknown"
"""What A.2's dialect writes as the type of a node of which nothing is known."""

MOST_RELATIONS = 1 << 24
"""Entries of all relation matrices of one file: a small file must not ask for all memory."""

_RELATION_OF = {word: relation for relation, word in WORD_OF.items() if relation != Relation.ABSENT}


@dataclass(frozen=True, slots=True)
class Node:
    """Node as listed in a file: its segment, and the position and type that stand beside it."""

    segment: int
    position: tuple[float, ...]
    type: str | None


@dataclass(frozen=True, slots=True)
class Edge:
    """Edge as listed in a file."""

    source: int
    target: int
    relation: Relation


def relation_of(word: str) -> Relation:
    """Relation that the word of an edge stands for (A.2).

    Raises
    ------
    ValueError
        If the word is unknown, or it is "Absence": an absent segment has no node, so it can have no edge.

    Examples
    --------
    >>> relation_of("Touching")
    <Relation.TOUCHING: 2>
    """
    if word not in _RELATION_OF:
        why = " (an absent segment has no node)" if word == WORD_OF[Relation.ABSENT] else ""
        raise ValueError(f"relation: expected {', '.join(_RELATION_OF)}, got {shown(word)}{why}")
    return _RELATION_OF[word]


def assemble(nodes: Sequence[Node], edges: Sequence[Edge], *, missing_edges: MissingEdges, room: int) -> SceneGraph:
    """Scene graph of the nodes and edges of one key frame.

    Parameters
    ----------
    nodes : sequence of Node
    edges : sequence of Edge
    missing_edges : {"error", "non-touching"}
        What a pair of nodes without an edge means.
    room : int
        Largest number of entries that the relation matrix may have.

    Raises
    ------
    ValueError
        If a node or an edge is listed twice, an edge joins a node to itself or to none, a pair has no edge although
        it should, only some nodes have positions or types, positions differ in dimension, or there is no room.
    """
    at: dict[int, int] = {}
    for index, node in enumerate(nodes):
        if at.setdefault(node.segment, index) != index:
            raise ValueError(f"nodes: expected each segment once, got {node.segment} twice")
    relations: dict[tuple[int, int], Relation] = {}
    for edge in edges:
        pair = min(edge.source, edge.target), max(edge.source, edge.target)
        for segment in pair:
            if segment not in at:
                raise ValueError(f"edge {pair}: expected nodes of this key frame, got {segment}, which is none")
        if edge.source == edge.target:
            raise ValueError(f"edge {pair}: expected two different nodes, got one and the same")
        if pair in relations:
            raise ValueError(f"edge {pair}: expected each pair once, got it twice")
        relations[pair] = edge.relation
    n = len(nodes)
    if missing_edges == "error" and len(relations) < n * (n - 1) // 2:
        lacking = next(pair for pair in combinations(sorted(at), 2) if pair not in relations)
        raise ValueError(f"edges: expected a relation for every pair of nodes, got none for {lacking}")
    if n * n > room:
        raise ValueError(f"nodes: expected at most {MOST_RELATIONS} relations in one file, got more")
    codes = np.zeros((n, n), dtype=np.uint8)
    for (i, j), relation in relations.items():
        codes[at[i], at[j]] = codes[at[j], at[i]] = relation
    return SceneGraph(list(at), codes, _positions(nodes), _types(nodes))


def _positions(nodes: Sequence[Node]) -> list[tuple[float, ...]] | None:
    dimensions = {len(node.position) for node in nodes}
    if len(dimensions) > 1:
        odd = next(node for node in nodes if len(node.position) != len(nodes[0].position))
        raise ValueError(
            "positions: expected as many coordinates for each node, "
            f"got {len(nodes[0].position)} for {nodes[0].segment} and {len(odd.position)} for {odd.segment}"
        )
    return [node.position for node in nodes] if dimensions - {0} else None


def _types(nodes: Sequence[Node]) -> list[str] | None:
    types = [node.type for node in nodes if node.type is not None]
    if types and len(types) < len(nodes):
        lacking = next(node.segment for node in nodes if node.type is None)
        raise ValueError(f"types: expected one for each node, got none for {lacking}")
    return types or None
