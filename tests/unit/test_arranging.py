"""Scenes by hand, and what came of a push in sentences and rows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sec_lab.event_chain import EventChain
from sec_lab.execution.account import compared_rows, outcome_sentence, refusal_sentence, verdict_sentence
from sec_lab.execution.loop import Verdict
from sec_lab.worlds.katana import camera_at, example_scene, project, random_scene
from sec_lab.worlds.katana.arranging import (
    angles_of,
    check_apart,
    rearranged,
    seen_from,
    table_place,
    thing_at,
    third_of,
    with_third,
)
from sec_lab.worlds.katana.scenes import roomy, unseen

NAMES = {1: "arm", 2: "box", 3: "ball"}


@given(
    number=st.integers(0, 2),
    shape=st.sampled_from(["box", "sphere", "cone"]),
    x=st.floats(0.05, 0.5),
    y=st.floats(-0.28, 0.28),
    size=st.floats(0.03, 0.1),
    yaw=st.floats(-2, 2),
)
def test_what_is_changed_stands_on_the_table_and_all_else_stays(
    number: int, shape: str, x: float, y: float, size: float, yaw: float
) -> None:
    before = example_scene("f")
    after = rearranged(before, number, shape=shape, at_m=(x, y), size_m=size, yaw_rad=yaw)  # type: ignore[arg-type]
    one = after.things[number]
    assert (one.shape, one.p_W_m[:2], one.size_m[0], one.yaw_rad) == (shape, (x, y), size, yaw)
    assert one.p_W_m[2] == one.size_m[2] / 2
    assert one.name.split()[0] == before.things[number].name.split()[0]
    assert one.name.endswith(shape)
    assert one.colour == before.things[number].colour
    others = [place for place in range(3) if place != number]
    assert [after.things[place] for place in others] == [before.things[place] for place in others]
    assert after.camera is before.camera


def test_a_shape_there_and_back_is_the_same() -> None:
    scene = example_scene("a")
    assert rearranged(rearranged(scene, 0, shape="cone"), 0, shape="box").things == scene.things
    # The bigger box of (e) is flatter than a cube, and stays so.
    flat = rearranged(example_scene("e"), 0, size_m=0.0425).things[0].size_m
    assert flat == pytest.approx((0.0425, 0.0425, 0.035))


@pytest.mark.parametrize("which", ["a", "b", "c", "d", "e"])
def test_a_third_thing_is_out_of_the_way(which: str) -> None:
    scene = example_scene(which)  # type: ignore[arg-type]
    for kind in ("blue sphere", "another red box"):
        three = with_third(scene, kind)  # type: ignore[arg-type]
        assert third_of(three) == kind
        assert roomy(three)
        assert three.things[:2] == scene.things
        assert with_third(three, "none").things == scene.things


def test_the_arm_at_rest_is_in_no_camera_that_can_be_chosen() -> None:
    for scene in (example_scene("a"), random_scene(3)):
        for azimuth in range(-55, 56, 11):
            for elevation in (42, 47, 52, 57, 62):
                seen = seen_from(scene, azimuth_deg=azimuth, elevation_deg=elevation)
                assert angles_of(seen.camera) == pytest.approx((azimuth, elevation))
                assert unseen(seen.camera, seen.start_m)
                assert unseen(seen.camera, seen.home_m)


@given(azimuth=st.floats(-55, 55), elevation=st.floats(30, 70), x=st.floats(0.1, 0.45), y=st.floats(-0.2, 0.2))
def test_a_pixel_looks_where_the_camera_projects_from(azimuth: float, elevation: float, x: float, y: float) -> None:
    camera = camera_at(azimuth_deg=azimuth, elevation_deg=elevation)
    (column, row), _ = project(camera, (x, y, 0.0))
    assert table_place(camera, float(column), float(row)) == pytest.approx((x, y), abs=1e-9)


def test_a_pixel_above_the_horizon_is_an_error() -> None:
    with pytest.raises(ValueError, match="expected one below the horizon, got column 5, row 0"):
        table_place(camera_at(elevation_deg=2), 5, 0)


def test_things_are_found_where_they_stand_and_may_not_stand_inside_each_other() -> None:
    scene = example_scene("a")
    assert [thing_at(scene, *one.p_W_m[:2]) for one in scene.things] == [0, 1]
    assert thing_at(scene, 0.1, -0.2) is None
    check_apart(scene)
    x, y, _ = scene.things[1].p_W_m
    # Sides of 0.06: from 0.06 on they may only touch.
    check_apart(rearranged(scene, 0, at_m=(x - 0.06, y)))
    with pytest.raises(ValueError, match="expected things apart, got 'red box' and 'green box' inside each other"):
        check_apart(rearranged(scene, 0, at_m=(x - 0.05, y)))


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ({"number": 2}, "number: expected a thing from 0 to 1, got 2"),
        ({"number": 0, "shape": "cube"}, "shape: expected one of"),
        ({"number": 0, "size_m": 0.0}, "size_m: expected numbers above 0"),
        ({"number": 0, "at_m": (np.nan, 0.1)}, "p_W_m: expected three finite numbers"),
    ],
)
def test_bad_changes_are_errors(what: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        rearranged(example_scene("a"), **what)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="third: expected one of"):
        with_third(example_scene("a"), "a cat")  # type: ignore[arg-type]


def test_rows_are_compared_as_the_self_check_does() -> None:
    model = EventChain([[0, 2, 0, 9], [0, 0, 2, 2]], [(1, 2), (2, 3)], names=NAMES)
    same = EventChain([[0, 0, 2, 2], [0, 2, 0, 9]], [(3, 2), (2, 1)], names=NAMES)
    assert [row.standing for row in compared_rows(model, same)] == ["agrees", "agrees"]
    # The contact with the arm is lost and found again, that with the ball in the end lost.
    other = EventChain(
        [[0, 2, 0, 2, 0, 9], [0, 0, 2, 0, 0, 0], [0, 2, 2, 2, 2, 2]], [(1, 2), (2, 3), (1, 3)], names=NAMES
    )
    rows = {row.names: (row.model, row.executed, row.standing) for row in compared_rows(model, other)}
    assert rows == {
        "arm, box": ("NTNA", "NTNTNA", "agrees with more between"),
        "ball, box": ("NT", "NTN", "differs"),
        "arm, ball": ("", "NT", "not in the model"),
    }
    assert {row.standing for row in compared_rows(model, None)} == {"missing"}


def test_sentences() -> None:
    bad = Verdict(1, "{red box, robot arm} N→T", 12, False, "{red box, robot arm}: expected ANT, got AN")
    assert verdict_sentence(bad) == (
        "Attempt 2, frame 12, after {red box, robot arm} N→T: recognised as a failure: "
        "{red box, robot arm}: expected ANT, got AN."
    )
    assert refusal_sentence("scene: expected 'a' and 'b' apart, got them touching already") == (
        "Refused, the arm has not moved: expected ‘a’ and ‘b’ apart, got them touching already."
    )
    assert refusal_sentence("the arm's end") == "Refused, the arm has not moved: the arm's end."


@pytest.mark.slow
def test_the_end_is_told_with_the_truth() -> None:
    from sec_lab.execution.account import moments
    from sec_lab.execution.pushing import push
    from sec_lab.viz.watched import start_of_last_attempt
    from sec_lab.worlds.katana import Fault

    heard: list[tuple[int, int]] = []
    outcome = push(
        example_scene("c"), fault=Fault("missed", "over", offset_m=(0.0, 0.09)),
        tell=lambda steps, verdicts: heard.append((len(steps), len(verdicts))),
    )  # fmt: skip
    # A plan, a failure at the first rule, a new plan, and its four rules.
    assert heard == [(4, 0), (4, 1), (4, 1), (4, 2), (4, 3), (4, 4), (4, 5)]
    assert outcome_sentence(outcome).startswith("The arm says that it is done (2 attempts, ")
    assert outcome_sentence(outcome).endswith("in the simulator red box and green box touch.")
    frames = [frame for frame, _ in moments(outcome)]
    assert frames[0] == 0
    assert frames == sorted(frames)
    assert frames[1] > start_of_last_attempt(outcome)
    assert frames[-1] == len(outcome.recording) - 1
