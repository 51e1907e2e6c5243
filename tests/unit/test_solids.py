"""Completed shapes: fitted to what is seen, followed, and how far they are apart."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sec_lab.execution.corridor import obstacle, swept
from sec_lab.execution.solids import Solid, complete, follow, gap_between, gap_to_points
from sec_lab.worlds.katana import Move
from tests import naive_solids

BALL = np.array([-1.0, 0.06, 0.0])
CONE = np.array([(0.035 / 0.08) ** 2, -2 * 0.035**2 / 0.08, 0.035**2])
NOTHING = np.zeros((0, 2))


def _round(x: float, y: float, profile: np.ndarray, top: float) -> Solid:
    return Solid(np.array([x, y]), top, 0.0, NOTHING, profile, 0.0)


def _box(x: float, y: float, side: float, yaw: float = 0.0) -> Solid:
    corners = side / 2 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=float)
    return Solid(np.array([x, y]), side, yaw, corners, np.zeros(3), 0.0)


def _seen(solid: Solid, from_rad: float, n: int = 4000, seed: int = 0) -> np.ndarray:
    """Points on top and on the sides that look into a direction."""
    rng = np.random.default_rng(seed)
    way = np.array([np.cos(from_rad), np.sin(from_rad)])
    if solid.is_round:
        z, angle = rng.uniform(0, solid.top_m, n), rng.uniform(0, 2 * np.pi, n)
        out = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        points = np.c_[solid.centre_m + solid.radius_m(z)[:, None] * out, z]
        return points[out @ way > 0.1]
    half = solid.corners_m.max(axis=0)
    turn = np.array([(np.cos(solid.yaw_rad), -np.sin(solid.yaw_rad)), (np.sin(solid.yaw_rad), np.cos(solid.yaw_rad))])
    top = np.c_[rng.uniform(-half, half, (n, 2)) @ turn.T + solid.centre_m, np.full(n, solid.top_m)]
    found = [top]
    for axis in (0, 1):
        for sign in (-1, 1):
            normal = np.zeros(2)
            normal[axis] = sign
            if (turn @ normal) @ way > 0.05:
                own = rng.uniform(-half, half, (n // 2, 2))
                own[:, axis] = sign * half[axis]
                found.append(np.c_[own @ turn.T + solid.centre_m, rng.uniform(0, solid.top_m, n // 2)])
    return np.concatenate(found)


@pytest.mark.parametrize("from_rad", [0.0, 0.7, 2.5])
@pytest.mark.parametrize("solid", [_round(0.3, -0.05, BALL, 0.06), _round(0.25, 0.1, CONE, 0.08)])
def test_a_round_thing_is_completed_from_the_half_that_is_seen(solid: Solid, from_rad: float) -> None:
    found = complete(_seen(solid, from_rad))
    assert found.is_round
    np.testing.assert_allclose(found.centre_m, solid.centre_m, atol=1e-6)
    heights = np.linspace(0.01, 0.05, 5)
    np.testing.assert_allclose(found.radius_m(heights), solid.radius_m(heights), atol=1e-5)


@pytest.mark.parametrize("yaw", [0.0, 0.3, -0.7])
def test_a_box_is_completed_from_its_top_and_two_sides(yaw: float) -> None:
    solid = _box(0.3, 0.02, 0.06, yaw)
    found = complete(_seen(solid, 0.4))
    assert not found.is_round
    np.testing.assert_allclose(found.centre_m, solid.centre_m, atol=5e-4)
    np.testing.assert_allclose(np.ptp(found.corners_m, axis=0), 0.06, atol=8e-4)


@pytest.mark.parametrize(
    "solid", [_round(0.3, -0.05, BALL, 0.06), _round(0.25, 0.1, CONE, 0.08), _box(0.3, 0.02, 0.06, 0.3)]
)
def test_it_is_followed_when_half_of_what_was_seen_is_hidden(solid: Solid) -> None:
    by, turn = np.array([0.004, -0.003]), 0.05
    moved = Solid(solid.centre_m + by, solid.top_m, solid.yaw_rad + turn, solid.corners_m, solid.profile, 0.0)
    # Two sides of the box are in sight; along a single one it could slide unseen.
    points = _seen(moved, 1.0)
    half = points[points[:, 1] > moved.centre_m[1]]
    found = follow(solid, half)
    np.testing.assert_allclose(found.centre_m, moved.centre_m, atol=3e-4)
    if not solid.is_round:
        assert found.yaw_rad == pytest.approx(moved.yaw_rad, abs=0.01)


def test_it_is_found_again_after_a_jump_and_stays_where_nothing_is_seen_of_it() -> None:
    solid = _box(0.3, 0.02, 0.06)
    moved = _box(0.36, -0.05, 0.06, 0.5)
    found = follow(solid, _seen(moved, 0.4))
    np.testing.assert_allclose(found.centre_m, moved.centre_m, atol=5e-4)
    assert follow(solid, np.zeros((3, 3))) is solid


def test_gaps_in_closed_form() -> None:
    ball, cone = _round(0.3, 0.0, BALL, 0.06), _round(0.3, 0.2, CONE, 0.08)
    assert gap_between(ball, _round(0.3, 0.1, BALL, 0.06)) == pytest.approx(0.04, abs=1e-4)
    assert gap_between(ball, _box(0.4, 0.0, 0.08)) == pytest.approx(0.03, abs=1e-4)
    assert gap_between(ball, _box(0.4, 0.0, 0.08, np.pi / 4)) == pytest.approx(0.07 - 0.04 * np.sqrt(2), abs=1e-4)
    assert gap_between(cone, _box(0.3, 0.3, 0.06)) == pytest.approx(0.035, abs=1e-4)
    assert gap_between(_box(0.3, 0.0, 0.06), _box(0.37, 0.0, 0.06)) == pytest.approx(0.01)
    assert gap_between(_box(0.3, 0.0, 0.06), _box(0.35, 0.0, 0.06)) == pytest.approx(-0.01)


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(*[st.sampled_from(["ball", "cone", "box"])] * 2),
    st.floats(0, 2 * np.pi),
    st.floats(0.09, 0.2),
    st.floats(-1, 1),
    st.floats(-1, 1),
)
def test_gaps_are_those_of_the_slow_way(
    kinds: tuple[str, str], way: float, apart: float, yaw: float, other_yaw: float
) -> None:
    make = {
        "ball": lambda x, y, _: _round(x, y, BALL, 0.06),
        "cone": lambda x, y, _: _round(x, y, CONE, 0.08),
        "box": lambda x, y, turn: _box(x, y, 0.06, turn),
    }
    one = make[kinds[0]](0.3, 0.0, yaw)
    other = make[kinds[1]](0.3 + apart * np.cos(way), apart * np.sin(way), other_yaw)
    assert gap_between(one, other) == pytest.approx(naive_solids.gap_between(one, other), abs=1.2e-3)
    assert gap_between(one, other) == pytest.approx(gap_between(other, one), abs=1e-12)


def test_gap_to_points_is_least_distance_and_at_most_zero_inside() -> None:
    box, ball = _box(0.3, 0.0, 0.06), _round(0.3, 0.0, BALL, 0.06)
    points = np.array([(0.35, 0.0, 0.03), (0.5, 0.0, 0.03)])
    assert gap_to_points(box, points) == pytest.approx(0.02)
    assert gap_to_points(ball, points) == pytest.approx(0.02)
    assert gap_to_points(box, np.array([(0.3, 0.0, 0.07)])) == pytest.approx(0.01)
    assert gap_to_points(box, np.array([(0.3, 0.0, 0.03)])) == 0
    assert gap_to_points(box, np.zeros((0, 3))) == np.inf


def test_what_is_in_the_way_of_the_hand_or_of_what_it_pushes_is_named() -> None:
    moves = Move((0.2, 0.0, 0.15)), Move((0.2, 0.0, 0.03)), Move((0.3, 0.0, 0.03)), Move((0.3, 0.0, 0.15))
    far, near = ("blue sphere", _round(0.25, 0.12, BALL, 0.06)), ("blue sphere", _round(0.25, 0.06, BALL, 0.06))
    assert obstacle(moves, [far], below_m=0.12) == ""
    assert obstacle(moves, [near], below_m=0.12) == "blue sphere"
    over = Move((0.2, 0.0, 0.15)), Move((0.3, 0.0, 0.15))
    assert obstacle(over, [near], below_m=0.12) == ""
    red = _box(0.2, 0.0, 0.06)
    assert swept(red, np.array([0.1, 0.0]), [far]) == ""
    assert swept(red, np.array([0.1, 0.0]), [("blue sphere", _round(0.3, 0.055, BALL, 0.06))]) == "blue sphere"
