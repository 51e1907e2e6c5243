"""The four actions: what touches what, and when, straight from the geometry."""

from functools import cache

import numpy as np
import pytest

from sec_lab.worlds.tabletop.actions import ACTIONS, VERSIONS, plan_movie
from sec_lab.worlds.tabletop.camera import project
from sec_lab.worlds.tabletop.contacts import contacts, surface_points
from sec_lab.worlds.tabletop.objects import liquid_in
from sec_lab.worlds.tabletop.plan import Actor, Plan, carried, eased, pose, segment_names, still
from sec_lab.worlds.tabletop.reach import Timeline
from sec_lab.worlds.tabletop.shapes import rounded_box

SEED = 5
GREY = np.full((4, 4, 3), 128, dtype=np.uint8)


@cache
def _plan(action, version=1, setting="laboratory"):
    return plan_movie(action, version, setting, seed=SEED)


@cache
def _changes(action, version=1):
    """For every pair that ever touches: whether it does at first, and the frames at which that changes."""
    plan = _plan(action, version)
    names = segment_names(plan)
    pairs, touching = contacts(plan)
    return {
        (names[int(i)], names[int(j)]): (bool(row[0]), (np.flatnonzero(np.diff(row.astype(int))) + 1).tolist())
        for (i, j), row in zip(pairs, touching.T, strict=True)
        if row.any()
    }


def test_an_orange_is_put_on_a_plate_that_moves_with_it() -> None:
    seen = _changes("moving_object")
    assert seen["table", "plate"] == (True, [])
    before, (lifted,) = seen["table", "fruit"]
    assert before
    before, (gripped, released) = seen["hand", "fruit"]
    assert not before
    before, (put,) = seen["fruit", "plate"]
    assert not before
    assert gripped <= lifted < put < released
    assert ("hand", "plate") not in seen
    assert ("table", "hand") not in seen
    plan = _plan("moving_object")
    plate, fruit = plan.actors[2].X_WB[:, :2, 3], plan.actors[1].X_WB[:, :2, 3]
    assert np.ptp(plate[: put - 3], axis=0).max() == 0
    assert np.linalg.norm(plate[-1] - plate[0]) > 0.06
    moved = slice(put, released)
    assert np.abs((fruit - plate)[moved] - (fruit - plate)[put]).max() < 0.01


@pytest.mark.slow
def test_a_sandwich_grows_upwards_by_two_hands() -> None:
    seen = _changes("making_sandwich")
    _, (took, left) = seen["right hand", "salami"]
    _, (took_2, left_2) = seen["left hand", "cheese"]
    _, (salami_put,) = seen["bread", "salami"]
    _, (cheese_put,) = seen["salami", "cheese"]
    assert took < salami_put <= left
    assert took_2 < cheese_put <= left_2
    assert salami_put < cheese_put
    assert ("bread", "cheese") not in seen
    assert ("right hand", "left hand") not in seen


@pytest.mark.slow
def test_a_cup_is_filled_from_another() -> None:
    seen = _changes("filling_liquid")
    _, (lifted, put) = seen["table", "full cup"]
    _, (gripped, released) = seen["hand", "full cup"]
    before, (stops,) = seen["full cup", "liquid"]
    assert before
    before, (arrives,) = seen["empty cup", "liquid"]
    assert not before
    assert gripped <= lifted < arrives < stops < put <= released
    assert ("full cup", "empty cup") not in seen
    assert ("hand", "liquid") not in seen
    assert ("table", "liquid") not in seen
    jet, surface, remaining = (actor for actor in _plan("filling_liquid").actors if actor.name == "liquid")
    level = surface.X_WB[surface.form >= 0, 2, 3]
    assert (np.diff(level) >= 0).all()
    assert level[-1] > level[0] + 0.02
    # What is left in the full cup only sinks, and is gone when no more falls.
    lowest = [remaining.forms[form].vertices_m[:, 2].min() for form in remaining.form if form >= 0]
    assert (np.diff(lowest) < 1e-9).all()
    assert lowest[0] > lowest[-1] + 0.05
    assert len(lowest) == np.flatnonzero(jet.form == 5)[0] == stops


def test_the_surface_in_a_tilted_cup_is_flat_and_inside() -> None:
    rng = np.random.default_rng(0)
    for tilt in (0.0, 0.3, 0.8, 1.3):
        surface = liquid_in((0.04, 0.1), 0.08, tilt, (200, 100, 50), rng, towards=np.pi / 2)
        x, y, z = surface.vertices_m.T
        slope = np.tan(tilt)
        assert z == pytest.approx(z[0] + slope * (y - y[0]), abs=1e-9)
        assert z.min() > 0.004
        assert z.max() < 0.0985
        assert np.hypot(x, y).max() < 0.04
        assert np.hypot(x, y)[1:].max() > 0.033
    # Level with a rim 2 cm above it, 0.4 radians are the last at which nothing is lost.
    assert liquid_in((0.04, 0.1), 0.08, 0.4, (200, 100, 50), rng).vertices_m[0, 2] == pytest.approx(0.08, abs=0.001)


@pytest.mark.slow
def test_a_book_is_opened() -> None:
    seen = _changes("opening_book")
    _, (gripped, released) = seen["hand", "cover"]
    assert seen["cover", "pages"] == (True, [])
    assert ("table", "hand") not in seen
    front = _plan("opening_book").actors[1]
    upwards = front.X_WB[:, 2, 2]
    assert upwards[gripped - 1] == pytest.approx(1)
    assert upwards[released] < -0.95


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("action", ACTIONS)
def test_versions_of_an_action_have_the_same_events(action, version) -> None:
    aside = {name for name in segment_names(_plan(action, version)).values() if name.endswith("aside")}

    def events(of):
        roles = {"left hand": "hand", "right hand": "hand"}
        found = {}
        for pair, (before, changes) in _changes(action, of).items():
            if not aside.union(n for n in pair if n.endswith("aside")).intersection(pair):
                found[tuple(roles.get(name, name) for name in pair)] = (before, len(changes))
        return found

    assert events(version) == events(1)


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("action", ACTIONS)
def test_hands_come_from_outside_and_leave_again(action, version) -> None:
    plan = _plan(action, version)
    assert 80 <= plan.n_frames <= 200
    width, height = plan.camera.size_px
    for actor in plan.actors:
        if "hand" not in actor.name:
            continue
        for frame in (0, -1):
            shape = actor.forms[actor.form[frame]]
            points = shape.vertices_m[::7] @ actor.X_WB[frame, :3, :3].T + actor.X_WB[frame, :3, 3]
            column, row = project(plan.camera, points).T
            assert not ((column > -1) & (column < width) & (row > -1) & (row < height)).any()


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("action", ACTIONS)
def test_both_settings_show_the_same_movements(action, version) -> None:
    laboratory, kitchen = _plan(action, version), _plan(action, version, "kitchen")
    assert laboratory.camera == kitchen.camera
    for first, second in zip(laboratory.actors, kitchen.actors, strict=False):
        if first.name.endswith("aside") or second.name.endswith("aside"):
            break
        assert first.name == second.name
        assert (first.X_WB == second.X_WB).all()
    assert len(kitchen.actors) > len(laboratory.actors)


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("action", ACTIONS)
def test_what_stands_aside_touches_only_the_table(action, version) -> None:
    plan = plan_movie(action, version, "kitchen", seed=2011)
    names = segment_names(plan)
    pairs, touching = contacts(plan)
    seen = [(names[int(i)], names[int(j)]) for i, j in pairs[touching.any(axis=0)]]
    aside = [pair for pair in seen if any(name.endswith("aside") for name in pair)]
    assert aside
    assert {first for first, _ in aside} == {"table"}


def test_another_seed_moves_otherwise() -> None:
    other = plan_movie("moving_object", 1, "laboratory", seed=SEED + 1)
    assert (other.actors[2].X_WB[0] != _plan("moving_object").actors[2].X_WB[0]).any()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"action": "juggling"}, "action"),
        ({"version": 5}, "version"),
        ({"setting": "moon"}, "setting"),
        ({"seed": -1}, "seed"),
    ],
)
def test_unknown_movies_are_refused(changed, message) -> None:
    wanted = {"action": "moving_object", "version": 1, "setting": "kitchen", "seed": 0} | changed
    with pytest.raises(ValueError, match=message):
        plan_movie(wanted["action"], wanted["version"], wanted["setting"], seed=wanted["seed"])


def _two_boxes(gaps_m):
    box = rounded_box((0.04, 0.04, 0.04), 0.002, GREY)
    n = len(gaps_m)
    moving = np.stack([pose((0.04 + gap, 0.003, 0.0)) for gap in gaps_m])
    base = _plan("moving_object")
    actors = (still("box", box, pose((0, 0, 0)), n), Actor("other", (box,), moving, np.zeros(n, dtype=int)))
    return Plan("boxes", actors, base.table, base.camera, base.lighting, base.sensor, 0)


def test_contact_is_a_matter_of_distance() -> None:
    gaps = np.array([-0.002, 0.0, 0.002, 0.003, 0.0045, 0.006, 0.02])
    pairs, touching = contacts(_two_boxes(gaps), touching_m=0.004)
    assert pairs.tolist() == [[1, 2], [1, 3], [2, 3]]
    assert touching[:, :2].all()
    assert touching[:, 2].tolist() == [True, True, True, True, False, False, False]


def test_what_is_not_in_the_scene_touches_nothing() -> None:
    plan = _two_boxes(np.zeros(2))
    gone = Actor("other", plan.actors[1].forms, plan.actors[1].X_WB, np.array([0, -1]))
    _, touching = contacts(Plan("p", (plan.actors[0], gone), plan.table, plan.camera, plan.lighting, plan.sensor, 0))
    assert touching.tolist() == [[True, True, True], [True, False, False]]


def test_surface_points_leave_no_gap() -> None:
    from scipy.spatial import cKDTree

    box = rounded_box((0.05, 0.03, 0.02), 0.002, GREY)
    points = surface_points(box, spacing_m=0.0025)
    rng = np.random.default_rng(0)
    corners = box.vertices_m[box.faces[rng.integers(len(box.faces), size=3000)]]
    anywhere = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(3), 3000), corners)
    assert cKDTree(points).query(anywhere)[0].max() < 0.0025


def test_a_carried_body_keeps_its_place_in_the_hand() -> None:
    hand = Timeline((0.3, 0.0, 0.1)).move((0, 0, 0), 5).close(2).move((0.1, 0.2, 0.1), 6, yaw=0.5, lift_m=0.1).open(3)
    X_WH, closed = hand.path()
    assert len(X_WH) == hand.frame + 1 == 17
    start = pose((0.01, 0.0, 0.0), yaw=0.3)
    path = carried(start, X_WH, 7, 13)
    assert (path[:7] == start).all()
    for frame in range(7, 14):
        np.testing.assert_allclose(np.linalg.inv(X_WH[frame]) @ path[frame], np.linalg.inv(X_WH[7]) @ start, atol=1e-12)
    assert (path[13:] == path[13]).all()
    assert closed[[0, 7, 13, 16]].tolist() == [0, 1, 1, 0]


def test_movements_begin_and_end_at_rest() -> None:
    share = eased(np.linspace(0, 1, 1001))
    assert share[[0, 500, 1000]] == pytest.approx([0, 0.5, 1])
    assert np.diff(share).min() >= 0
    assert np.diff(share)[[0, -1]] == pytest.approx(0, abs=1e-7)


def test_actors_and_plans_refuse_what_does_not_fit() -> None:
    box = rounded_box((0.04, 0.04, 0.04), 0.002, GREY)
    with pytest.raises(ValueError, match="X_WB"):
        Actor("box", (box,), np.eye(4)[None], np.zeros(2, dtype=int))
    with pytest.raises(ValueError, match="form"):
        Actor("box", (box,), np.eye(4)[None], np.ones(1, dtype=int))
    base = _plan("moving_object")
    two = (still("a", box, np.eye(4), 2), still("b", box, np.eye(4), 3))
    with pytest.raises(ValueError, match="one length"):
        Plan("p", two, base.table, base.camera, base.lighting, base.sensor, 0)
