"""Pictures in rows, and strips of roles."""

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.role_groups import role_groups
from sec_lab.scene_graph import SceneGraph
from sec_lab.viz import Panel, RoleStrip, draw_gallery, draw_roles, graph_at
from sec_lab.viz.style import png_bytes

LABELS = np.repeat([[1, 1, 2, 2]], 4, axis=0)
GRAPH = SceneGraph([1, 2], [[0, 2], [2, 0]], [[0.5, 1.5], [2.5, 1.5]])


def test_maps_share_colours_and_others_need_no_bar() -> None:
    small, large = np.full((4, 4), 2.0), np.full((4, 4), 8.0)
    large[0, 0] = np.nan
    figure = draw_gallery([[Panel(LABELS), Panel(small), Panel(large)]], columns=["a", "b", "c"])
    maps = [image for ax in figure.axes for image in ax.images if image.get_gid() == "disparity"]
    assert [image.get_clim() for image in maps] == [(2.0, 8.0)] * 2
    assert figure.axes[-1].get_ylabel() == "disparity in pixels"
    assert len(draw_gallery([[Panel(LABELS)]], columns=["a"]).axes) == 1


def test_graphs_are_drawn_and_explained() -> None:
    figure = draw_gallery([[Panel(LABELS)], [Panel(LABELS, GRAPH)]], columns=["x"], names=["above", "below"])
    assert [text.get_text() for text in figure.axes[1].texts] == ["1", "2"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["touching"]
    assert [text.get_text() for text in figure.texts] == ["above", "below"]
    assert png_bytes(figure)[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("rows", "columns", "names", "message"),
    [
        ([], [], [], "rows: expected as many pictures in each"),
        ([[Panel(LABELS)], []], ["a"], [], "rows: expected as many pictures in each"),
        ([[Panel(LABELS)]], ["a", "b"], [], "columns: expected 1 titles, got 2"),
        ([[Panel(LABELS)]], ["a"], ["x", "y"], "names: expected 1, got 2"),
    ],
)
def test_galleries_that_do_not_fit_are_refused(rows, columns, names, message) -> None:
    with pytest.raises(ValueError, match=message):
        draw_gallery(rows, columns=columns, names=names)


def test_the_graph_that_holds_in_a_frame() -> None:
    apart = SceneGraph([1, 2], np.zeros((2, 2)), [[0.0, 0.0], [3.0, 3.0]])
    seen = Observation([apart, GRAPH], [2, 5], position_unit="px")
    assert graph_at(seen, 4, LABELS).edges() == []
    found = graph_at(seen, 5, np.where(LABELS == 2, 1, 1))
    assert [edge[:2] for edge in found.edges()] == [(1, 2)]
    # Segment 2 is not in this picture: its node stays where it was.
    assert found.positions is not None
    assert found.positions.tolist() == [[1.5, 1.5], [2.5, 1.5]]
    with pytest.raises(ValueError, match="frame: expected 2 or later, got 1"):
        graph_at(seen, 1, LABELS)


def strip() -> RoleStrip:
    rows = [[0, 2, 2], [0, 0, 2], [2, 0, 0]]
    pairs = [(1, 2), (2, 3), (1, 3)]
    one = EventChain(rows, pairs, names={1: "table", 2: "cup", 3: "box"})
    two = EventChain(rows, pairs, names={1: "table", 2: "cup", 3: "lid"})
    chains = {"one": one, "two": two}
    picture = np.full((6, 6, 4), 255, np.uint8)
    looks = {name: dict.fromkeys((1, 2, 3), picture) for name in chains}
    return RoleStrip(role_groups(chains), chains, looks)


def red_frames(figure) -> int:
    frames = [patch for ax in figure.axes for patch in ax.patches if isinstance(patch, Rectangle)]
    return sum(patch.get_linewidth() > 1 for patch in frames)


def test_members_of_another_role_have_a_red_frame() -> None:
    figure = draw_roles({"truth": strip()}, title="Roles", left_out=["table"], order=["box", "cup"])
    assert red_frames(figure) == 1
    words = [text.get_text() for text in figure.texts]
    assert words[:6] == ["Roles", "truth", "one*", "two", "box", "cup"]
    assert "red frame" in words[-1]
    assert len(figure.axes) == 4


def test_a_role_that_nothing_plays_is_a_dash() -> None:
    twins = EventChain([[0, 2], [0, 2]], [(1, 2), (1, 3)], names={1: "table", 2: "cup", 3: "cup"})
    chains = {"one": twins, "two": twins}
    figure = draw_roles({"a": RoleStrip(role_groups(chains), chains, {name: {} for name in chains})})
    # Of three groups two have no clear member in the other demonstration.
    assert [text.get_text() for ax in figure.axes for text in ax.texts] == ["–", "–"]


def test_strips_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="strips: expected one or two, got 0"):
        draw_roles({})
    with pytest.raises(ValueError, match="strips: expected at least one group"):
        draw_roles({"truth": strip()}, left_out=["table", "cup", "box"])
