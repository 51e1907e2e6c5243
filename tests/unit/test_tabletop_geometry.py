"""Shapes, hands and light of the tabletop movies: what has to hold of the geometry."""

import numpy as np
import pytest

from sec_lab.worlds.tabletop import objects, textures
from sec_lab.worlds.tabletop.camera import Camera, Sensor, calibration, exposed, eye_poses, project
from sec_lab.worlds.tabletop.hand import hand_shape, skeleton
from sec_lab.worlds.tabletop.lights import radiance
from sec_lab.worlds.tabletop.shapes import Shape, lathe, moved, rounded_box, tube, vertex_normals

GREY = np.full((4, 4, 3), 128, dtype=np.uint8)


def _rng():
    return np.random.default_rng(0)


def _volume(shape):
    a, b, c = (shape.vertices_m[shape.faces[:, k]] for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


def _closed(profile):
    return lathe(profile, GREY, n_sections=256)


def test_volumes_show_that_faces_look_outwards() -> None:
    cylinder = _closed([(0, 0), (0.1, 0), (0.1, 0.3), (0, 0.3)])
    assert _volume(cylinder) == pytest.approx(np.pi * 0.1**2 * 0.3, rel=1e-3)
    box = rounded_box((0.2, 0.3, 0.1), 0.002, GREY)
    assert _volume(box) == pytest.approx(0.2 * 0.3 * 0.1, rel=0.01)
    straight = np.stack([np.zeros(9), np.zeros(9), np.linspace(0, 1, 9)], axis=-1)
    # A tube has no ends: seen from the middle of its axis, only its side counts, which is two thirds of the volume.
    pipe = tube(straight - (0, 0, 0.5), 0.1, GREY)
    assert _volume(pipe) == pytest.approx(2 / 3 * np.pi * 0.1**2, rel=0.05)


@pytest.mark.parametrize(
    "shape",
    [
        objects.orange(0.036, (240, 130, 30), _rng()),
        objects.apple(0.04, (190, 30, 30), (220, 200, 90), _rng()),
        objects.plate(0.1, 0.02, (240, 240, 240), (60, 60, 200), _rng()),
        objects.cup(0.04, 0.08, (240, 240, 240), (200, 60, 60), _rng()),
        objects.bread(0.06, 0.016, (220, 190, 140), (140, 90, 40), _rng()),
        objects.salami(0.04, 0.01, (170, 40, 40), (120, 30, 30), (240, 200, 180), _rng()),
        objects.cheese(0.03, 0.01, (240, 200, 70), _rng()),
        objects.box((0.09, 0.06, 0.04), (230, 200, 60), (40, 40, 40), _rng()),
        objects.bottle(0.027, 0.11, (200, 60, 110), (240, 240, 240), _rng()),
        objects.book_block(0.12, 0.18, 0.03, _rng()),
        objects.book_cover(0.12, 0.18, (150, 40, 40), (230, 210, 150), _rng()),
    ],
    ids=["orange", "apple", "plate", "cup", "bread", "salami", "cheese", "box", "bottle", "pages", "cover"],
)
def test_things_stand_on_the_table_and_are_right_way_out(shape) -> None:
    assert shape.vertices_m[:, 2].min() == pytest.approx(0, abs=1e-3)
    assert _volume(shape) > 0
    assert shape.uv.min() >= 0
    assert shape.uv.max() <= 1
    assert np.linalg.norm(vertex_normals(shape), axis=1) == pytest.approx(1)


def test_a_mirrored_shape_stays_right_way_out() -> None:
    box = rounded_box((0.2, 0.3, 0.1), 0.01, GREY)
    assert _volume(moved(box, np.diag([1.0, -1.0, 1.0, 1.0]))) == pytest.approx(_volume(box))


def test_shapes_refuse_arrays_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match="uv"):
        Shape(np.zeros((3, 3)), np.array([(0, 1, 2)]), np.zeros((2, 2)), GREY)
    with pytest.raises(ValueError, match="texture"):
        Shape(np.zeros((3, 3)), np.array([(0, 1, 2)]), np.zeros((3, 2)), np.zeros((4, 4), np.uint8))


@pytest.mark.parametrize("grip", ["top", "wrap", "pinch"])
@pytest.mark.parametrize("closed", [0.0, 0.5, 1.0])
def test_bones_keep_their_lengths(grip, closed) -> None:
    bones = skeleton(grip, size_m=0.033 if grip != "pinch" else 0.002, closed=closed)
    straight = skeleton("top", size_m=0.05, closed=0.0)
    for chain, other in ((bones.fingers, straight.fingers), (bones.thumb[None], straight.thumb[None])):
        length, known = (np.linalg.norm(np.diff(joints, axis=1), axis=2) for joints in (chain, other))
        assert length == pytest.approx(known, abs=1e-4)


@pytest.mark.parametrize("radius_m", [0.028, 0.036, 0.042])
def test_closed_fingers_lie_on_what_they_hold(radius_m) -> None:
    held = skeleton("top", size_m=radius_m, closed=1.0)
    tips = np.concatenate([held.fingers[:, 3], held.thumb[3:]])
    distance = np.linalg.norm(tips, axis=1) - radius_m
    # Tips are the ends of bones, which the flesh surrounds by 6 to 10 mm.
    assert distance.min() > 0.005
    assert distance.max() < 0.012
    opened = skeleton("top", size_m=radius_m, closed=0.0)
    assert np.linalg.norm(opened.fingers[:, 3], axis=1).min() > radius_m + 0.012


def test_an_unknown_grip_is_refused() -> None:
    with pytest.raises(ValueError, match="grip"):
        skeleton("paw", size_m=0.03, closed=1.0)


def test_left_hand_mirrors_the_right_one() -> None:
    bones = skeleton("top", size_m=0.035, closed=1.0)
    palette = textures.skin_palette((220, 170, 140))
    right, left = (hand_shape(bones, palette, left=side, cell_m=0.006) for side in (False, True))
    np.testing.assert_allclose(left.vertices_m, right.vertices_m * (1, -1, 1))
    assert _volume(left) == pytest.approx(_volume(right))
    assert _volume(right) > 0
    thumb = np.linalg.norm(right.vertices_m - bones.thumb[3], axis=1).min()
    assert 0.004 < thumb < 0.012


def test_disparity_of_the_stereo_pair_is_that_of_its_calibration() -> None:
    camera = Camera(roll_deg=2.0, azimuth_deg=15.0)
    point = np.array([[0.05, 0.04, 0.02]])
    left, right = eye_poses(camera)
    known = calibration(camera)
    local = (point - left[:3, 3]) @ left[:3, :3]
    other = (point - right[:3, 3]) @ right[:3, :3]
    assert other[0, 1:] == pytest.approx(local[0, 1:])
    disparity = known.focal_length_px * (local[0, 0] - other[0, 0]) / local[0, 2]
    assert disparity == pytest.approx(known.focal_length_px * camera.baseline_m / local[0, 2])
    middle = project(camera, np.array([camera.target_m]))[0]
    # The eyes look past the target by half the baseline, to its right and left.
    half = known.focal_length_px * camera.baseline_m / 2 / camera.distance_m
    assert middle == pytest.approx(np.add(known.principal_point_px, (half, 0)))


def test_noise_of_the_sensor_has_the_variance_it_says() -> None:
    sensor = Sensor(vignette=0.0, flicker=0.0)
    flat = np.full((400, 400, 3), 100, dtype=np.uint8)
    seen = exposed(flat, sensor, np.random.default_rng(3))
    assert seen.shape == (200, 200, 3)
    # Rounding to whole numbers adds 1/12.
    assert seen.astype(float).var() == pytest.approx(1.5 + 0.035 * 100 + 1 / 12, rel=0.03)
    assert seen.mean() == pytest.approx(100, abs=0.1)


def test_radiance_pictures_keep_values_to_one_part_in_128() -> None:
    picture = np.random.default_rng(0).uniform(0.05, 9, (3, 5, 3))
    content = radiance(picture)
    head, _, pixels = content.partition(b"-Y 3 +X 5\n")
    assert head.startswith(b"#?RADIANCE\n")
    rgbe = np.frombuffer(pixels, dtype=np.uint8).reshape(3, 5, 4).astype(float)
    back = rgbe[..., :3] / 256 * 2 ** (rgbe[..., 3:] - 128)
    assert np.abs(back - picture).max() < 9 / 64
    brightest = picture.max(axis=-1)
    assert np.abs(back.max(axis=-1) / brightest - 1).max() < 1 / 127


def test_textures_come_from_their_seed() -> None:
    first, second, other = (textures.cloth((80, 90, 100), np.random.default_rng(s), size=64) for s in (1, 1, 2))
    assert (first == second).all()
    assert (first != other).any()
    field = textures.noise((64, 64), (9, 9), np.random.default_rng(0))
    assert (field.mean(), field.std()) == pytest.approx((0, 1), abs=1e-9)
