"""Putting, taking and both mixed: what touches what, and when it begins and ends, straight from the geometry."""

from functools import cache

import numpy as np
import pytest

from sec_lab.files import UnusableFileError
from sec_lab.worlds.tabletop.__main__ import main
from sec_lab.worlds.tabletop.actions import ALL_VERSIONS, COLLECTIONS, plan_movie
from sec_lab.worlds.tabletop.camera import project
from sec_lab.worlds.tabletop.chains import movies_in
from sec_lab.worlds.tabletop.contacts import contacts
from sec_lab.worlds.tabletop.deeds import Deed, TimedDeed, read_deeds, timed, write_deeds
from sec_lab.worlds.tabletop.plan import segment_names
from sec_lab.worlds.tabletop.things import thing_of

SEED = 5
MOVIES = [(action, version) for action, versions in COLLECTIONS["put_and_take"].items() for version in versions]


@cache
def _plan(action, version=1, setting="laboratory"):
    return plan_movie(action, version, setting, seed=SEED)


@cache
def _touching(action, version=1):
    """For every pair that ever touches: whether it does, frame by frame."""
    plan = _plan(action, version)
    names = segment_names(plan)
    pairs, touching = contacts(plan)
    return {(names[int(i)], names[int(j)]): row for (i, j), row in zip(pairs, touching.T, strict=True) if row.any()}


@cache
def _seen(action, version=1):
    """Whether something of a body is in the picture of the left eye, frame by frame, from its corners alone."""
    plan = _plan(action, version)
    width, height = plan.camera.size_px
    found = {}
    for actor in plan.actors:
        seen = np.zeros(plan.n_frames, dtype=bool)
        for frame, form in enumerate(actor.form):
            if form >= 0:
                points = actor.forms[form].vertices_m[::7] @ actor.X_WB[frame, :3, :3].T + actor.X_WB[frame, :3, 3]
                column, row = project(plan.camera, points).T
                seen[frame] = ((column > -1) & (column < width) & (row > -1) & (row < height)).any()
        found[actor.name] = seen
    return found


def _changes(row):
    return (np.flatnonzero(np.diff(row.astype(int))) + 1).tolist()


def _times(action, version):
    """Timed deeds, with the corners of bodies in the place of labels."""
    plan = _plan(action, version)
    names = segment_names(plan)
    labels = np.zeros((plan.n_frames, 1, len(names) + 1), dtype=int)
    for label, name in names.items():
        if name != "table":
            labels[_seen(action, version)[name], 0, label] = label
    return timed(plan.deeds, names, *contacts(plan), labels)


def test_there_are_25_movies_in_two_settings() -> None:
    assert {action: len(versions) for action, versions in COLLECTIONS["put_and_take"].items()} == {
        "putting": 10,
        "taking": 10,
        "mixed": 5,
    }
    assert sum(len(versions) for versions in ALL_VERSIONS.values()) == 16 + 25


def _judge_putting(version):
    touching = _touching("putting", version)
    (lifted,) = _changes(touching["table", "object"])
    gripped, released = _changes(touching["hand", "object"])
    (put,) = _changes(touching["object", "plate"])
    assert touching["table", "object"][0]
    assert not touching["object", "plate"][0]
    assert gripped <= lifted < put < released
    assert touching["table", "plate"].all()
    assert ("hand", "plate") not in touching
    assert ("table", "hand") not in touching
    [deed] = _times("putting", version)
    assert (deed.kind, deed.begin, deed.plate_frame, deed.end) == ("putting", gripped, put, released)


def _judge_taking(version):
    touching = _touching("taking", version)
    assert touching["object", "plate"][0]
    (left,) = _changes(touching["object", "plate"])
    gripped, *_ = _changes(touching["hand", "object"])
    assert gripped <= left
    assert touching["table", "plate"].all()
    assert {pair for pair in touching if "aside" not in "".join(pair)} == {
        ("table", "plate"),
        ("hand", "object"),
        ("object", "plate"),
    }
    [deed] = _times("taking", version)
    assert (deed.kind, deed.begin, deed.plate_frame) == ("taking", gripped, left)
    # The thing leaves the picture in the hand.
    seen = _seen("taking", version)["object"]
    assert deed.end == np.flatnonzero(seen)[-1] + 1 < len(seen)
    assert touching["hand", "object"][gripped : deed.end].all()


def test_an_orange_is_put_on_a_plate() -> None:
    _judge_putting(1)


def test_an_apple_is_taken_from_a_plate() -> None:
    _judge_taking(1)


@pytest.mark.slow
@pytest.mark.parametrize("version", range(2, 11))
def test_versions_have_the_same_events(version) -> None:
    _judge_putting(version)
    _judge_taking(version)


def _what(deeds):
    return [(deed.kind, deed.what, deed.plate, deed.hand) for deed in sorted(deeds, key=lambda deed: deed.end)]


@pytest.mark.slow
@pytest.mark.parametrize("version", [1, 2])
def test_bread_goes_from_one_plate_to_another(version) -> None:
    """Fig. 2.11 (a) and (b): in one hold, so that taking ends where putting begins."""
    taking, putting = _times("mixed", version)
    assert _what([taking, putting]) == [
        ("taking", "rye bread", "first plate", "hand"),
        ("putting", "rye bread", "second plate", "hand"),
    ]
    assert taking.begin < taking.end == taking.plate_frame == putting.begin < putting.plate_frame < putting.end
    paths = [plan.actors[1].X_WB[:, 2, 3].max() for plan in (_plan("mixed", 1), _plan("mixed", 2))]
    assert paths[1] > paths[0] + 0.05


@pytest.mark.slow
def test_an_orange_is_replaced() -> None:
    """Fig. 2.11 (c): another one comes to the same plate after it has been taken away."""
    taking, putting = _times("mixed", 3)
    assert _what([taking, putting]) == [
        ("taking", "orange", "first plate", "hand"),
        ("putting", "orange", "first plate", "hand"),
    ]
    assert taking.thing != putting.thing
    assert taking.end < putting.begin


@pytest.mark.slow
def test_an_orange_is_put_and_then_bread_taken_from_another_plate() -> None:
    """Fig. 2.11 (d)."""
    putting, taking = _times("mixed", 4)
    assert _what([putting, taking]) == [
        ("putting", "orange", "first plate", "hand"),
        ("taking", "rye bread", "second plate", "hand"),
    ]
    assert putting.end < taking.begin
    # The hand does not leave in between.
    assert _seen("mixed", 4)["hand"][putting.begin : taking.end].all()


@pytest.mark.slow
def test_two_hands_put_and_take_at_the_same_time() -> None:
    """Fig. 2.11 (e)."""
    putting, taking = sorted(_times("mixed", 5), key=lambda deed: deed.kind)
    assert _what([putting]) == [("putting", "orange", "first plate", "right hand")]
    assert _what([taking]) == [("taking", "green apple", "second plate", "left hand")]
    assert min(putting.end, taking.end) - max(putting.begin, taking.begin) > 20
    assert ("right hand", "left hand") not in _touching("mixed", 5)


@pytest.mark.slow
@pytest.mark.parametrize(("action", "version"), MOVIES)
def test_hands_come_from_outside_and_leave_again(action, version) -> None:
    plan = _plan(action, version)
    assert 80 <= plan.n_frames <= 200
    for name, seen in _seen(action, version).items():
        if "hand" in name:
            assert seen.any()
            assert not seen[[0, -1]].any()


@pytest.mark.slow
@pytest.mark.parametrize(("action", "version"), [("putting", 4), ("taking", 8), ("mixed", 5)])
def test_both_settings_show_the_same_movements(action, version) -> None:
    laboratory, kitchen = _plan(action, version), _plan(action, version, "kitchen")
    assert laboratory.camera == kitchen.camera
    assert laboratory.deeds == kitchen.deeds
    acting = [[actor for actor in plan.actors if "aside" not in actor.name] for plan in (laboratory, kitchen)]
    for first, second in zip(*acting, strict=True):
        assert first.name == second.name
        assert (first.X_WB == second.X_WB).all()
        assert (first.form == second.form).all()


def test_versions_differ_strongly() -> None:
    for action in ("putting", "taking"):
        plans = [_plan(action, version) for version in ALL_VERSIONS[action]]
        assert len({plan.deeds[0].what for plan in plans}) >= 7
        assert np.ptp([plan.n_frames for plan in plans]) > 30
        assert np.ptp([plan.camera.azimuth_deg for plan in plans]) > 15
        yaws = [np.arctan2(plan.actors[0].X_WB[0, 1, 0], plan.actors[0].X_WB[0, 0, 0]) for plan in plans]
        # Hands come from the left, from the right and from behind.
        assert np.ptp(np.rad2deg(np.unwrap(np.sort(yaws)))) > 200


def test_another_seed_moves_otherwise() -> None:
    other = plan_movie("taking", 1, "laboratory", seed=SEED + 1)
    assert (other.actors[1].X_WB[0] != _plan("taking").actors[1].X_WB[0]).any()


def test_what_never_happens_has_no_time() -> None:
    names, pairs = {2: "hand", 3: "object", 4: "plate"}, np.array([(2, 3), (3, 4)])
    with pytest.raises(ValueError, match="deeds: expected what happens in the movie"):
        timed([Deed("putting", "hand", "object", "plate")], names, pairs, np.zeros((5, 2), bool), np.full((5, 1, 1), 2))
    with pytest.raises(ValueError, match="kind: expected 'putting' or 'taking', got 'pushing'"):
        Deed("pushing", "hand", "object", "plate")
    with pytest.raises(ValueError, match="kind: expected one of orange"):
        thing_of("anvil", (0.1, 0.1), "kitchen", np.random.default_rng(0))


def test_one_hold_from_plate_to_plate_is_parted_where_the_first_is_left() -> None:
    names = {2: "hand", 3: "object", 4: "first plate", 5: "second plate"}
    pairs = np.array([(2, 3), (3, 4), (3, 5)])
    touching = np.zeros((12, 3), dtype=bool)
    touching[2:9, 0] = touching[:4, 1] = touching[7:, 2] = True
    labels = np.zeros((12, 1, 2), dtype=int)
    labels[1:11, 0, 0], labels[:, 0, 1] = 2, 3
    deeds = [Deed("taking", "hand", "object", "first plate"), Deed("putting", "hand", "object", "second plate")]
    taking, putting = timed(deeds, names, pairs, touching, labels)
    assert (taking.begin, taking.plate_frame, taking.end) == (2, 4, 4)
    assert (putting.begin, putting.plate_frame, putting.end) == (4, 7, 9)
    assert (taking.appears, taking.leaves) == (1, 11)


def test_times_come_back(tmp_path) -> None:
    deeds = (TimedDeed("taking", "hand", "object", "plate", "orange", 3, 9, 5, 1, 12),)
    write_deeds(tmp_path, deeds)
    assert read_deeds(tmp_path) == deeds
    for damaged in ("{", "[3]", '[{"kind": "taking"}]', (tmp_path / "actions.json").read_text().replace("9", '"9"')):
        (tmp_path / "actions.json").write_text(damaged)
        with pytest.raises(UnusableFileError, match="it is damaged"):
            read_deeds(tmp_path)


def test_movies_are_found_in_the_order_of_the_thesis(tmp_path) -> None:
    for name in ("mixed_1_kitchen", "taking_10_laboratory", "putting_2_laboratory"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "calibration.json").write_text("{}")
    assert [path.name for path in movies_in(tmp_path)] == [
        "putting_2_laboratory",
        "taking_10_laboratory",
        "mixed_1_kitchen",
    ]


def test_versions_that_an_action_lacks_are_refused(tmp_path, capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path), "--action", "mixed", "--version", "6"])
    assert ended.value.code == 2
    assert "expected numbers from 1 to 5 for mixed, got 6" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_line_tells_when_actions_begin_and_end(tmp_path) -> None:
    wanted = ["--action", "taking", "--version", "3", "--setting", "kitchen", "--seed", "3", "--size", "64", "48"]
    assert main([str(tmp_path), *wanted]) == 0
    [deed] = read_deeds(tmp_path / "taking_3_kitchen")
    assert deed.what == "orange"
    assert deed.appears < deed.begin < deed.plate_frame < deed.end <= deed.leaves
