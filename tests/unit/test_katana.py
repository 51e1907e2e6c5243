"""The arm and its table: closed form against Drake, tracking, contact, faults, scenes."""

from dataclasses import replace

import numpy as np
import pytest

from sec_lab.worlds.katana import (
    Camera,
    Fault,
    Glance,
    Move,
    Run,
    Scene,
    Thing,
    UnreachableError,
    camera_at,
    example_scene,
    hand_axes,
    joint_angles,
    project,
    random_scene,
    tip_position,
    view,
)
from sec_lab.worlds.katana.bench import arm_alone
from sec_lab.worlds.katana.demonstrations import SEED, demonstration_scene, pushing_program
from sec_lab.worlds.katana.film import Film
from sec_lab.worlds.katana.inverse import solved_joint_angles
from sec_lab.worlds.katana.kinematics import LOWER_RAD, UPPER_RAD, roll_for_facing, steepest_pitch
from sec_lab.worlds.katana.scenes import GREEN, HOME_M, RED, START_M, pushable, roomy, seen_whole, thing, unseen


def _random_angles(n: int) -> np.ndarray:
    return np.random.default_rng(7).uniform(LOWER_RAD, UPPER_RAD, (n, 5))


def test_closed_form_is_that_of_the_description() -> None:
    arm = arm_alone()
    context = arm.CreateDefaultContext()
    for q in _random_angles(50):
        arm.SetPositions(context, np.concatenate([q, np.zeros(2)]))
        pose = arm.GetFrameByName("tool").CalcPoseInWorld(context)
        along, opening = hand_axes(q)
        np.testing.assert_allclose(tip_position(q), pose.translation(), atol=1e-14)
        np.testing.assert_allclose(along, pose.rotation().matrix()[:, 0], atol=1e-14)
        np.testing.assert_allclose(opening, pose.rotation().matrix()[:, 1], atol=1e-14)


def test_limits_speeds_and_masses_are_those_of_the_table_of_facts() -> None:
    arm = arm_alone()
    np.testing.assert_array_equal(arm.GetPositionLowerLimits()[:5], LOWER_RAD)
    np.testing.assert_array_equal(arm.GetPositionUpperLimits()[:5], UPPER_RAD)
    np.testing.assert_array_equal(
        arm.GetVelocityUpperLimits(), [2.208932, 1.190799, 1.190799, 2.208932, 2.208932, 0.718834, 0.718834]
    )
    masses = 1.4048, 0.7479, 0.8017, 0.7924, 0.6915, 0.2562, 0.0552, 0.0252, 0.0252
    context = arm.CreateDefaultContext()
    assert arm.CalcTotalMass(context) == pytest.approx(sum(masses), abs=1e-12)


def test_inverse_is_that_of_the_solver() -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        point = rng.uniform((0.15, -0.2, 0.02), (0.4, 0.2, 0.15))
        q = joint_angles(point, roll_rad=rng.uniform(-1.5, 1.5))
        np.testing.assert_allclose(tip_position(q), point, atol=1e-12)
        solved = solved_joint_angles(point, *hand_axes(q), guess_rad=joint_angles((0.25, 0.0, 0.15)))
        np.testing.assert_allclose(solved, q, atol=1e-3)


@pytest.mark.parametrize(
    ("radius_m", "pitch_deg"), [(0.540, -45), (0.468, -60), (0.386, -75), (0.302, -90), (0.28, -60), (0.18, -75)]
)
def test_reach_at_pushing_height_as_in_the_facts(radius_m: float, pitch_deg: float) -> None:
    """Facts 1: with the tool at 25 mm, −45° reaches .540 m and so on; a millimetre of rounding either way."""
    joint_angles((radius_m + (-0.001 if radius_m > 0.3 else 0.001), 0, 0.025), pitch_rad=np.deg2rad(pitch_deg))
    with pytest.raises(UnreachableError):
        joint_angles((radius_m + (0.002 if radius_m > 0.3 else -0.008), 0, 0.025), pitch_rad=np.deg2rad(pitch_deg))


@pytest.mark.parametrize(
    ("point", "reason"),
    [
        ((0.9, 0.0, 0.1), "reaches 0.615 m"),
        ((0.05, 0.0, 0.1), "column"),
        ((0.3, 0.0, 0.0), "fingers would meet the table"),
        ((0.15, 0.0, 0.30), "joint lift_2"),
        ((-0.3, -0.02, 0.1), "joint pan"),
    ],
)
def test_what_is_out_of_reach_is_refused_with_a_reason(point: tuple[float, ...], reason: str) -> None:
    with pytest.raises(UnreachableError, match=reason):
        joint_angles(point)


def test_solver_refuses_what_is_out_of_reach() -> None:
    with pytest.raises(UnreachableError, match="no joint angles"):
        solved_joint_angles((0.9, 0, 0.1), (1, 0, 0), (0, 1, 0), guess_rad=np.zeros(5))


def test_the_hand_is_as_steep_as_it_can_be() -> None:
    points = np.random.default_rng(5).uniform((0.15, -0.2, 0.02), (0.42, 0.2, 0.2), (200, 3))
    pitch = steepest_pitch(points)
    joint_angles(points)
    assert pitch.min() >= -np.pi / 2
    assert (pitch == -np.pi / 2).any()
    assert (pitch > -np.pi / 2).any()


def test_fingers_face_where_they_should() -> None:
    rng = np.random.default_rng(6)
    for facing in rng.uniform(-np.pi, np.pi, 20):
        point = rng.uniform((0.2, -0.15, 0.03), (0.4, 0.15, 0.03))
        opening = hand_axes(joint_angles(point, roll_rad=roll_for_facing(point, facing)))[1]
        assert abs(opening @ (np.cos(facing), np.sin(facing), 0)) < 1e-12


def _pushed(scene: Scene, *, fault: Fault | None = None, film: bool = False) -> Run:
    run = Run(scene, fault=fault, film=film)
    for move in pushing_program(scene):
        run.move(move)
    return run


def test_a_demonstration_pushes_until_they_touch_and_tracks_to_two_millimetres() -> None:
    scene = demonstration_scene(SEED, 5)
    run = _pushed(scene)
    truth = run.truth
    low = truth.tip_m[:, 2] < 0.06
    assert np.linalg.norm(truth.tip_m - truth.wanted_tip_m, axis=1)[low].max() < 0.002
    red_green, red_arm = truth.touching("red box", "green box"), truth.touching("red box", "robot arm")
    assert not red_green[0]
    assert red_green[-1]
    # One stretch of touching each, and the arm's begins first and ends last but before the end.
    assert np.abs(np.diff(red_green.astype(int))).sum() == 1
    assert np.abs(np.diff(red_arm.astype(int))).sum() == 2
    assert not truth.touching("green box", "robot arm").any()
    assert not truth.touching("table", "robot arm").any()
    assert red_arm.argmax() < red_green.argmax() < np.flatnonzero(red_arm)[-1] < len(red_arm) - 1
    # Nothing jumps: pushed, not put.
    steps = np.linalg.norm(np.diff(truth.poses["red box"][:, :3, 3], axis=0), axis=1)
    assert steps.max() < 0.2 / 20
    # And again, to the bit.
    again = _pushed(scene).truth
    np.testing.assert_array_equal(truth.poses["red box"], again.poses["red box"])
    np.testing.assert_array_equal(truth.tip_m, again.tip_m)


@pytest.mark.parametrize(
    ("fault", "red_moves"),
    [
        (Fault("slips", "push", "red box"), True),
        (Fault("missed", "approach", offset_m=(0.0, -0.1)), False),
        (Fault("wrong object", "approach", "green box", "red box"), False),
        (Fault("removed", "push", "red box"), None),
    ],
)
def test_planted_failures_fail(fault: Fault, red_moves: bool | None) -> None:
    scene = demonstration_scene(SEED, 0)
    run = _pushed(scene, fault=fault)
    assert not run.truth.touching("red box", "green box").any()
    if red_moves is None:
        assert [one.name for one in run.scene.things] == ["green box"]
        return
    moved = np.subtract(run.scene.thing("red box").p_W_m, scene.thing("red box").p_W_m)
    assert (np.linalg.norm(moved) > 0.02) == red_moves
    assert run.truth.touching("green box", "robot arm").any() == (fault.kind == "wrong object")


def test_the_gripper_carries_by_contact() -> None:
    cube, flat = (0.05, 0.05, 0.05), (0.08, 0.08, 0.04)
    things = thing("red box", "box", RED, 0.24, -0.09, cube, 0.3), thing("green box", "box", GREEN, 0.33, 0.07, flat)
    run = Run(Scene(things, camera_at(), HOME_M, START_M), film=False)
    for move in (
        Move((0.24, -0.09, 0.15), "open", facing_rad=0.3, speed_m_s=0.4),
        Move((0.24, -0.09, 0.025), "closed"),
        Move((0.24, -0.09, 0.15)),
    ):
        run.move(move)
    assert run.scene.thing("red box").p_W_m[2] > 0.13
    for move in (
        Move((0.33, 0.07, 0.15), facing_rad=0.2, speed_m_s=0.15),
        Move((0.33, 0.07, 0.068), "open", speed_m_s=0.05),
        Move((0.33, 0.07, 0.15)),
    ):
        run.move(move)
    red = np.array(run.scene.thing("red box").p_W_m)
    np.testing.assert_allclose(red, (0.33, 0.07, 0.065), atol=0.01)
    assert run.truth.touching("red box", "green box")[-1]
    assert not run.truth.touching("red box", "robot arm")[-1]


def test_pictures_show_what_is_there() -> None:
    scene = example_scene("f")
    run = Run(scene, labels=True)
    truth = run.truth
    (frame,) = run.recording
    label_of = {name: label for label, name in truth.names.items()}
    assert truth.labels is not None
    for one in scene.things:
        mask = truth.labels[0] == label_of[one.name]
        (column, row), depth = project(scene.camera, one.p_W_m)
        assert mask[round(float(row)), round(float(column))]
        # The surface lies nearer than the middle, by no more than the thing is large.
        assert 0 < depth - frame.depth_m[mask].min() < np.linalg.norm(one.size_m)
        np.testing.assert_array_equal(frame.image[mask].mean(0).argmax(), np.argmax(one.colour))
    assert not (truth.labels == label_of["robot arm"]).any()
    # The table is where the camera's own geometry has it.
    rows, columns = np.nonzero(truth.labels[0] == label_of["table"])
    rays = np.stack([columns - 159.5, rows - 127.5, np.full(len(rows), scene.camera.focal_px)]) / scene.camera.focal_px
    height = (scene.camera.X_WC[:3, :3] @ (rays * frame.depth_m[rows, columns]))[2] + scene.camera.X_WC[2, 3]
    assert np.abs(height).max() < 0.001
    seen = view(scene)
    np.testing.assert_array_equal(seen.image, frame.image)


def test_film_loses_nothing() -> None:
    rng = np.random.default_rng(0)
    film, kept = Film((5, 7), 20.0), []
    for _ in range(4):
        depth = np.round(rng.uniform(0, 3, (5, 7)) * 1e4).astype(np.float32) / np.float32(1e4)
        kept.append(
            (rng.integers(0, 256, (5, 7, 3), dtype=np.uint8), depth, rng.integers(0, 9, (5, 7), dtype=np.uint8))
        )
        film.add(*kept[-1])
    for frame, (image, depth, _) in zip(film.recording(), kept, strict=True):
        np.testing.assert_array_equal(frame.image, image)
        np.testing.assert_array_equal(frame.depth_m, depth)
    np.testing.assert_array_equal(film.labels(), [labels for _, _, labels in kept])


def test_scenes_are_as_promised() -> None:
    scenes = [random_scene(11, number=number) for number in range(20)]
    scenes += [demonstration_scene(SEED, number) for number in range(10)] + [example_scene(which) for which in "abcdef"]
    for scene in scenes:
        assert roomy(scene)
        assert pushable(*scene.things[:2])
        assert seen_whole(scene)
        assert unseen(scene.camera, scene.start_m)
        assert unseen(scene.camera, scene.home_m)
    assert {one.shape for scene in scenes for one in scene.things} == {"box", "sphere", "cone"}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Thing("", "box", RED, (1, 1, 1), (0, 0, 0)), "name: expected"),
        (lambda: Thing("a", "ball", RED, (1, 1, 1), (0, 0, 0)), "shape: expected one of"),
        (lambda: Thing("a", "sphere", RED, (1, 1, 2), (0, 0, 0)), "round sphere"),
        (lambda: Thing("a", "box", (1, 2, 256), (1, 1, 1), (0, 0, 0)), "0 to 255"),
        (lambda: Thing("a", "box", RED, (1, 1, np.nan), (0, 0, 0)), "three finite numbers"),
        (lambda: Camera(320, 256, 400.0, np.diag([2, 1, 1, 1])), "expected a rotation"),
        (lambda: Camera(320, 256, 0.0, np.eye(4)), "focal_px"),
        (lambda: Move((0, 0, 0), "shut"), "gripper: expected one of"),
        (lambda: Move((0, 0, 0), speed_m_s=9), "speed_m_s"),
        (lambda: Fault("explodes", "push"), "kind: expected one of"),
        (lambda: Fault("slips", "push"), "thing: expected"),
        (lambda: example_scene("g"), "which: expected one of"),
    ],
)
def test_bad_input_gets_one_clear_error(make, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_a_glance_at_a_changed_scene_sees_what_a_new_run_would_see() -> None:
    glance, first = Glance(), example_scene("a")
    for scene in (
        first,
        replace(first, things=(replace(first.things[0], p_W_m=(0.3, 0.05, 0.03), yaw_rad=0.4), *first.things[1:])),
        replace(first, camera=camera_at(azimuth_deg=20, elevation_deg=55)),
        example_scene("f"),
    ):
        seen, built = glance.at(scene), Run(replace(scene, start_m=scene.home_m)).view()
        assert np.array_equal(seen.image, built.image)
        assert np.array_equal(seen.depth_m, built.depth_m)
