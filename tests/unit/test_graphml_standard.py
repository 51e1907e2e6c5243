"""GraphML as the standard has it, written by hand."""

from pathlib import Path

import pytest

import sec_lab as sl
from sec_lab.codes import Relation
from tests.written_graphml import assert_refused

N, O, T = Relation.NON_TOUCHING, Relation.OVERLAPPING, Relation.TOUCHING  # noqa: E741


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "chain.graphml"


STANDARD_KEYS = "".join(
    f'<key id="{scope}_{name}" for="{scope}" attr.name="{name}" attr.type="string"/>'
    for scope, name in [
        ("graphml", "unseen_names"),
        ("graph", "key_frame"),
        ("graph", "recorded"),
        ("graph", "position_unit"),
        ("node", "name"),
        ("node", "fragment"),
        ("node", "x"),
        ("node", "z"),
        ("edge", "relation"),
    ]
)


def data(scope: str, name: str, value: str) -> str:
    return f'<data key="{scope}_{name}">{value}</data>'


def graph(number: int, *content: str, recorded: str = "true", unit: str = "px", direction: str = "undirected") -> str:
    about = data("graph", "key_frame", str(number)) + data("graph", "recorded", recorded)
    about += data("graph", "position_unit", unit)
    return f'<graph edgedefault="{direction}">{about}{"".join(content)}</graph>'


def standard(*content: str) -> str:
    return f'<graphml xmlns="http://graphml.graphdrawing.org/xmlns">{STANDARD_KEYS}{"".join(content)}</graphml>'


def test_standard_graphml_written_by_hand(file: Path) -> None:
    touching = f'<edge source="2" target="1">{data("edge", "relation", "Touching")}</edge>'
    named = f'<node id="1">{data("node", "name", "cup")}</node>'
    file.write_text(
        standard(
            data("graphml", "unseen_names", '{"7": null}'),
            graph(1, recorded="false"),
            graph(4, named, '<node id="2"/>', '<node id="3"/>', touching),
        )
    )
    seen = sl.graphml.read(file)
    assert seen.names == {1: "cup", 7: None}
    assert seen.graphs[0] is None
    assert seen.chain.relations.tolist() == [[T], [N], [N]]


NAMED = f'<node id="1">{data("node", "name", "cup")}</node>'

BAD_STANDARD = {
    "no graph": (standard(), "at least one key frame"),
    "directed": (standard(graph(1, direction="directed")), "'directed'"),
    "no key frame": (standard('<graph edgedefault="undirected"/>'), "'key_frame'"),
    "key frames descend": (standard(graph(2), graph(1)), "2 before 1"),
    "units differ": (standard(graph(1), graph(2, unit="m")), "m and px"),
    "unit unknown": (standard(graph(1, unit="mm")), "'mm'"),
    "recorded": (standard(graph(1, recorded="maybe")), "key frame 1: recorded", "'maybe'"),
    "content not recorded": (standard(graph(1, NAMED, recorded="false")), "key frame 1: recorded"),
    "undeclared key": (standard(graph(1, '<data key="d0">3</data>')), "'d0'"),
    "key of another kind": (standard(graph(1, data("node", "name", "3"))), "'node_name'"),
    "data twice": (standard(graph(1, data("graph", "recorded", "true"))), "'recorded' once"),
    "unknown key": (standard('<key id="d0" for="node" attr.name="colour"/>'), "'colour' for 'node'"),
    "key twice": (standard('<key id="node_x" for="node" attr.name="y"/>'), "'node_x' twice"),
    "names differ": (standard(graph(1, NAMED), graph(2, NAMED.replace("cup", "box"))), "key frame 2: node 1"),
    "name lost": (standard(graph(1, NAMED), graph(2, '<node id="1"/>')), "key frame 2: node 1"),
    "named fragment": (
        standard(graph(1, NAMED.replace("</node>", f"{data('node', 'fragment', 'true')}</node>"))),
        "key frame 1: node 1",
        "'cup'",
    ),
    "edge without relation": (
        standard(graph(1, NAMED, '<node id="2"/>', '<edge source="1" target="2"/>')),
        "key frame 1: edge (1, 2)",
    ),
    "x alone": (standard(graph(1, f'<node id="1">{data("node", "x", "1")}</node>')), "key frame 1: node 1", "got x"),
    "label no number": (standard(graph(1, '<node id="n0"/>')), "key frame 1: node id", "'n0'"),
    "ports": (standard(graph(1, '<node id="1"><port name="a"/></node>')), "<node>", "<port>"),
    "hyperedge": (standard("<hyperedge/>"), "<hyperedge>"),
    "unseen names no JSON": (standard(data("graphml", "unseen_names", "{7}"), graph(1)), "unseen_names", "'{7}'"),
    "unseen names a list": (standard(data("graphml", "unseen_names", "[7]"), graph(1)), "unseen_names", "'[7]'"),
    "unseen names deep": (standard(data("graphml", "unseen_names", "[" * 99999), graph(1)), "unseen_names"),
    "unseen name a number": (standard(data("graphml", "unseen_names", '{"7": 7}'), graph(1)), "unseen_names"),
    "unseen label": (standard(data("graphml", "unseen_names", '{"a": "b"}'), graph(1)), "unseen_names", "'a'"),
    "unseen twice": (standard(data("graphml", "unseen_names", '{"7": "b", "7": "c"}'), graph(1)), "got 7 twice"),
    "unseen, yet seen": (standard(data("graphml", "unseen_names", '{"1": "b"}'), graph(1, NAMED)), "got 1"),
}


@pytest.mark.parametrize(
    ("text", "said"), [(text, said) for text, *said in BAD_STANDARD.values()], ids=list(BAD_STANDARD)
)
def test_bad_standard_graphml_is_one_clear_error(file: Path, text: str, said: list[str]) -> None:
    file.write_text(text)
    assert_refused(file, *said)


# Writing
