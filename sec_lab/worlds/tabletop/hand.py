"""An articulated hand and its forearm: rounded bones under one skin, in poses from open to closed.

Frame of the hand: the origin is where it holds, between thumb and finger tips; x points from the wrist to the fingers,
z out of the back of the hand, so that the thumb of a right hand is at +y.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sec_lab.worlds.tabletop.shapes import Floats, Shape, Texture

Grip = Literal["top", "wrap", "pinch"]
"""From above round an object; round a cylinder whose axis is y; an edge between thumb and fingers."""

FOREARM_M = 0.62
_LENGTHS_M = np.array([(0.047, 0.028, 0.022), (0.052, 0.032, 0.024), (0.048, 0.030, 0.023), (0.037, 0.022, 0.020)])
_KNUCKLES_M = np.array([(0.094, 0.029, 0.0), (0.098, 0.0085, 0.003), (0.092, -0.0115, 0.002), (0.081, -0.030, -0.003)])
_RADII_M = np.array([0.0086, 0.0088, 0.0084, 0.0073])
_THUMB_BASE_M = np.array([0.028, 0.026, -0.014])
_THUMB_LENGTHS_M = np.array([0.046, 0.034, 0.027])
_WRIST_RADIUS_M = 0.0185


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joints of one hand in one pose, in metres in the frame of the hand.

    Parameters
    ----------
    wrist : (4, 4) float64
        Pose of the wrist; its x axis runs along the palm.
    fingers : (4, 4, 3) float64
        Knuckle, two joints and tip of index, middle, ring and little finger.
    thumb : (4, 3) float64
    elbow : (3,) float64
        Far end of the forearm.
    """

    wrist: Floats
    fingers: Floats
    thumb: Floats
    elbow: Floats


def skeleton(grip: Grip, *, size_m: float, closed: float, rise: float = 0.35, spread: float = 1.0) -> Skeleton:
    """Joints of a right hand that holds, or is about to hold, something.

    Parameters
    ----------
    grip : {"top", "wrap", "pinch"}
    size_m : float
        Radius of what is held (``"top"``, ``"wrap"``) or half its thickness (``"pinch"``).
    closed : float
        0 open, 1 holding.
    rise : float, optional
        Angle in radians by which the forearm rises from the hand.
    spread : float, optional
        How far the fingers are spread; 1 as usual.

    Raises
    ------
    ValueError
        If the grip is unknown.

    Examples
    --------
    >>> held = skeleton("top", size_m=0.04, closed=1.0)
    >>> float(np.linalg.norm(held.fingers[1, 3]).round(4))
    0.0485
    """
    across = _KNUCKLES_M[:, 1]
    fan = 0.45
    if grip == "top":
        wrist = _pose((-0.098, 0.0, size_m + 0.068), pitch=0.42)
        # The little finger is too short to reach as far down as the others.
        angle = np.deg2rad([42.0, 12.0, -16.0, -70.0]) * spread
        height = np.deg2rad([-7.0, -7.0, -7.0, 20.0])
        reach = size_m + 0.0085
        directions = np.stack([np.cos(angle) * np.cos(height), np.sin(angle) * np.cos(height), np.sin(height)], axis=-1)
        tips = reach * directions
        thumb = np.array([-0.78, 0.63, -0.10]) * (size_m + 0.0095)
        forearm = np.array([-np.cos(rise), 0.0, np.sin(rise)])
    elif grip == "wrap":
        wrist = _pose((-0.082, 0.0, size_m + 0.030), pitch=0.12)
        reach = size_m + 0.0095
        angle = np.deg2rad([-28.0, -32.0, -30.0, -18.0])
        tips = np.stack([reach * np.cos(angle), across * 0.95 * spread, reach * np.sin(angle)], axis=-1)
        thumb = np.array([-0.80 * reach, 0.030, -0.60 * reach])
        fan = 0.1
        forearm = np.array([-np.cos(rise), np.sin(rise), 0.05])
    elif grip == "pinch":
        wrist = _pose((-0.135, 0.004, 0.030), pitch=0.10)
        tips = np.stack(
            [(0.018, 0.020, 0.014, 0.004) * np.ones(4), across * 0.9 * spread, np.full(4, -size_m - 0.0085)], -1
        )
        thumb = np.array([0.008, 0.026, size_m + 0.009])
        forearm = np.array([-np.cos(rise), 0.0, np.sin(rise)])
    else:
        raise ValueError(f"grip: expected 'top', 'wrap' or 'pinch', got {grip!r}")
    rotation, origin = wrist[:3, :3], wrist[:3, 3]
    knuckles = origin + (_KNUCKLES_M * (1, 0.9 + 0.1 * spread, 1)) @ rotation.T
    base = origin + rotation @ _THUMB_BASE_M
    relaxed = np.stack(
        [[0.92 * length.sum(), fan * k[1], -0.026] for length, k in zip(_LENGTHS_M, _KNUCKLES_M, strict=True)]
    )
    open_tips = knuckles + relaxed @ rotation.T
    open_thumb = base + rotation @ np.array([0.066, 0.052, -0.030])
    share = closed * closed * (3 - 2 * closed)
    outward = rotation @ np.array([0.35, 0.0, 0.94])
    fingers = np.stack(
        [
            _bent(knuckle, (1 - share) * free + share * tip, lengths, outward)
            for knuckle, free, tip, lengths in zip(knuckles, open_tips, tips, _LENGTHS_M, strict=True)
        ]
    )
    side = rotation @ np.array([-0.1, 0.75, 0.35])
    thumb_joints = _bent(base, (1 - share) * open_thumb + share * thumb, _THUMB_LENGTHS_M, side)
    return Skeleton(wrist, fingers, thumb_joints, origin + FOREARM_M * forearm / np.linalg.norm(forearm))


def hand_shape(
    bones: Skeleton, palette: Texture, *, left: bool = False, cell_m: float = 0.0040, scale: float = 1.0
) -> Shape:
    """Skin over the bones: the zero level of a smooth minimum of their signed distances.

    Parameters
    ----------
    bones : Skeleton
    palette : (height, width, 3) uint8
        Skin tones, see :func:`sec_lab.worlds.tabletop.textures.skin_palette`.
    left : bool, optional
        Mirror it.
    cell_m : float, optional
        Size of the cells of marching cubes.
    scale : float, optional
        Thickness of the fingers and the arm.
    """
    from skimage.measure import marching_cubes

    points = np.concatenate([bones.fingers.reshape(-1, 3), bones.thumb, bones.elbow[None], bones.wrist[None, :3, 3]])
    low, high = points.min(axis=0) - 0.062, points.max(axis=0) + 0.062
    axes = [np.arange(a, b, cell_m) for a, b in zip(low, high, strict=True)]
    field = _distance([axis.astype(np.float32) for axis in axes], bones, scale)
    vertices, faces, _, _ = marching_cubes(field, 0.0, spacing=(cell_m,) * 3)
    vertices = vertices.astype(np.float64) + low
    uv = _tones(vertices, bones)
    faces = faces.astype(np.int64)[:, ::-1]
    if _volume(vertices, faces) < 0:
        faces = faces[:, ::-1]
    if left:
        vertices, faces = vertices * (1, -1, 1), faces[:, ::-1]
    return Shape(vertices, faces, uv, palette, roughness=0.62)


def _distance(axes: list[NDArray[np.float32]], bones: Skeleton, scale: float) -> NDArray[np.float32]:
    """Signed distance near the hand; far from it only its sign holds."""
    field = np.full([len(axis) for axis in axes], 1.0, dtype=np.float32)
    for bone in _bones(bones, scale):
        reach = max(bone.first_m, bone.last_m) + bone.blend_m + 0.01
        low, high = np.minimum(bone.start, bone.end) - reach, np.maximum(bone.start, bone.end) + reach
        box = tuple(slice(*np.searchsorted(axis, (a, b)).tolist()) for axis, a, b in zip(axes, low, high, strict=True))
        grid = np.stack(
            np.meshgrid(*(axis[part] for axis, part in zip(axes, box, strict=True)), indexing="ij"), axis=-1
        )
        field[box] = _smooth_minimum(field[box], _capsule(grid, bone), bone.blend_m)
    return field


@dataclass(frozen=True, eq=False)
class _Bone:
    start: Floats
    end: Floats
    first_m: float
    last_m: float
    blend_m: float


def _bones(bones: Skeleton, scale: float) -> list[_Bone]:
    """Bones with their radii at both ends and the width over which their skin blends into what came before."""
    rotation, origin = bones.wrist[:3, :3], bones.wrist[:3, 3]
    heel = [origin + rotation @ np.array((0.004, side, -0.002)) for side in (0.013, -0.013)]
    sideways = rotation @ np.array([0.0, 0.011, 0.0])
    found = [_Bone(heel[i // 2], bones.fingers[i, 0], 0.0150 * scale, 0.0105 * scale, 0.010) for i in range(4)]
    for sign in (-1, 1):
        # No bulge along the forearm: it would throw ragged shadows on the arm itself.
        start, end = origin + sign * sideways, bones.elbow + 0.6 * sign * sideways
        found.append(_Bone(start, end, _WRIST_RADIUS_M * scale, 0.036 * scale, 0.016))
    found.append(_Bone(bones.thumb[0], bones.thumb[1], 0.0175 * scale, 0.0125 * scale, 0.014))
    thumb_radii = np.array([0.0110, 0.0098, 0.0082]) * scale
    found += _chain(bones.thumb[1:], thumb_radii)
    for i in range(4):
        found += _chain(bones.fingers[i], _RADII_M[i] * scale * np.array([1.08, 1.0, 0.92, 0.80]))
    return found


def _chain(joints: Floats, radii: Floats) -> list[_Bone]:
    return [_Bone(joints[k], joints[k + 1], radii[k], radii[k + 1], 0.0045) for k in range(len(joints) - 1)]


def _capsule(grid: NDArray[np.float32], bone: _Bone) -> NDArray[np.float32]:
    """Distance from a bone whose radius changes evenly along it."""
    axis = (bone.end - bone.start).astype(np.float32)
    relative = grid - bone.start.astype(np.float32)
    share = np.clip(relative @ axis / np.float32(axis @ axis), 0, 1)
    relative -= share[..., None] * axis
    distance = np.sqrt(np.einsum("...k,...k->...", relative, relative))
    return np.asarray(distance - (bone.first_m + share * np.float32(bone.last_m - bone.first_m)), dtype=np.float32)


def _smooth_minimum(a: NDArray[np.float32], b: NDArray[np.float32], width: float) -> NDArray[np.float32]:
    near = np.maximum(width - np.abs(a - b), 0) / np.float32(width)
    return np.asarray(np.minimum(a, b) - near * near * np.float32(width / 4), dtype=np.float32)


def _tones(vertices: Floats, bones: Skeleton) -> Floats:
    """Place of every vertex in the palette: knuckles and tips redder, nails pale, the inside of the palm lighter."""
    rotation = bones.wrist[:3, :3]
    back = (vertices - bones.wrist[:3, 3]) @ rotation[:, 2]
    along = (vertices - bones.wrist[:3, 3]) @ rotation[:, 0]
    red = 0.22 + 0.14 * np.sin(55 * vertices[:, 0] + 3 * np.sin(40 * vertices[:, 1]))
    light = 0.5 + 0.05 * np.sin(70 * vertices[:, 1] + 50 * vertices[:, 2])
    light += np.where((along > 0.0) & (back < -0.004), 0.06, 0.0)
    chains = [*bones.fingers, bones.thumb]
    for number, joints in enumerate(chains):
        for place, amount in ((0, 0.35), (1, 0.4), (3, 0.5)):
            distance = np.linalg.norm(vertices - joints[place], axis=1)
            red += amount * np.exp(-((distance / 0.013) ** 2))
        last = joints[3] - joints[2]
        last = last / np.linalg.norm(last)
        previous = (joints[2] - joints[1]) / np.linalg.norm(joints[2] - joints[1])
        normal = previous - last * (previous @ last)
        length = np.linalg.norm(normal)
        dorsal = normal / length if length > 0.05 else rotation[:, 2]
        nail = joints[3] + (0.011 if number == 4 else 0.0085) * dorsal + 0.001 * last
        inside = np.exp(-((np.linalg.norm(vertices - nail, axis=1) / 0.0065) ** 4))
        red = red * (1 - inside) + 0.42 * inside
        light = light * (1 - inside) + 0.86 * inside
    return np.asarray(np.clip(np.stack([red, light], axis=-1), 0.03, 0.97))


def _bent(base: Floats, tip: Floats, lengths: Floats, outward: Floats) -> Floats:
    """Joints of a finger from its base to its tip, bent alike at both joints and bulging outwards."""
    target = np.linalg.norm(tip - base)
    direction = (tip - base) / target
    normal = outward - direction * (outward @ direction)
    normal /= np.linalg.norm(normal)
    low, high = 0.0, 2.2
    for _ in range(40):
        bend = (low + high) / 2
        chain = _planar(lengths, bend)
        low, high = (bend, high) if np.hypot(*chain[-1]) > target else (low, bend)
    chain = _planar(lengths, (low + high) / 2)
    end = chain[-1] / np.hypot(*chain[-1])
    # In the plane the chain bends to the right of its first bone, so the bulge is on its left.
    along = chain @ end
    bulge = chain @ np.array([-end[1], end[0]])
    return np.asarray(base + along[:, None] * direction + bulge[:, None] * normal)


def _planar(lengths: Floats, bend: float) -> Floats:
    heading = -np.arange(len(lengths)) * bend
    steps = lengths[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def _pose(position: tuple[float, float, float], *, pitch: float) -> Floats:
    pose = np.eye(4)
    cosine, sine = np.cos(pitch), np.sin(pitch)
    pose[:3, :3] = ((cosine, 0.0, sine), (0.0, 1.0, 0.0), (-sine, 0.0, cosine))
    pose[:3, 3] = position
    return pose


def _volume(vertices: Floats, faces: NDArray[np.int64]) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)
