"""Upright solids: what is seen of a thing, completed by the sides that are hidden, followed as the thing moves.

The camera sees less than half of a thing. Two kinds of shape are tried, as neither needs to know what the thing is: one
that is round about a vertical axis (balls, cones, cylinders: the squared radius is a polynomial of the height), and one
that is an upright prism over a convex base (boxes).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sec_lab.worlds.katana.records import Floats

_FIT_POINTS, _FOLLOW_POINTS = 1200, 300
_FACE_M = 0.002
_TURNS = 180
_SIDES = ((1, -1), (0, 1), (1, 1), (0, -1))
"""Axis and direction of the sides of a rectangle, in the order of its corners."""
_RANGE_M, _PIXEL_M, _CORNER_M, _LEAST_ON_FACE, _FEW = 0.0003, 0.004, 0.004, 6, 3
"""What the range of points in one plane may differ by; what a pixel covers of a level plane, at most, and as much again
at the corners, where it may be another side that it passes; least number of points to say where a side is."""

_STEPS = 12
_STILL_M = 2e-5
_WEAK = 1e-2
_ROBUST_M = 0.001
_LOST_M = 0.0015
_LEAST_POINTS = 25
_HEIGHTS = 24
STANDING_M = 0.004
"""Tops are known to a few millimetres; and so near above something a thing is let go."""

_RIM = 48


@dataclass(frozen=True, eq=False)
class Solid:
    """An upright thing with its hidden sides.

    Parameters
    ----------
    centre_m : (2,) float64
        In the plane.
    top_m : float
        Above the table.
    yaw_rad : float
    corners_m : (k, 2) float64
        Of the base of a prism about its centre, unturned, anticlockwise; empty if the thing is round.
    profile : (3,) float64
        Of a round thing: squared radius in m² as polynomial of the height in m, the highest power first; zeros if it is
        a prism.
    error_m : float
        Root mean square distance of what was seen from this.
    base_m : float, optional
        How high above the table it ends below; above 0 if it is held, or stands on something.
    unsure_m : (k,) float64, optional
        By how much each side of a prism, from its corner on, may lie elsewhere: half of what a pixel covers there if it
        is hidden and runs along the rows of pixels.
    """

    centre_m: Floats
    top_m: float
    yaw_rad: float
    corners_m: Floats
    profile: Floats
    error_m: float
    base_m: float = 0.0
    unsure_m: Floats = field(default_factory=lambda: np.zeros(0))
    _normals: Floats = field(init=False, repr=False)
    _offsets: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        edges = np.roll(self.corners_m, -1, axis=0) - self.corners_m
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        object.__setattr__(self, "_normals", normals)
        object.__setattr__(self, "_offsets", (normals * self.corners_m).sum(axis=1))
        for array in (self.centre_m, self.corners_m, self.profile, self.unsure_m, self._normals, self._offsets):
            array.setflags(write=False)

    @property
    def is_round(self) -> bool:
        """Whether it is round about a vertical axis."""
        return len(self.corners_m) == 0

    def radius_m(self, height_m: float | Floats) -> Floats:
        """Radius of a round thing at a height.

        Parameters
        ----------
        height_m : float or array of float64
        """
        return np.asarray(np.sqrt(np.maximum(np.polyval(self.profile, height_m), 0.0)))

    @property
    def middle_m(self) -> float:
        """Height of the middle of its volume above where it stands."""
        if not self.is_round:
            return (self.top_m - self.base_m) / 2
        heights = np.linspace(0, self.top_m - self.base_m, _HEIGHTS)
        area = self.radius_m(heights) ** 2
        return float((heights * area).sum() / area.sum())

    def unsure_towards_m(self, point_m: Floats) -> float:
        """By how much the side that faces a point may lie elsewhere.

        Parameters
        ----------
        point_m : (2,) float64
            In the plane.
        """
        if not len(self.unsure_m):
            return 0.0
        own = (point_m - self.centre_m) @ _turn(self.yaw_rad)
        return float(self.unsure_m[(self._normals @ own - self._offsets).argmax()])

    def section_m(self, height_m: float | None = None) -> Floats:
        """Border at a height, or of all heights seen from above: (k, 2) float64, anticlockwise.

        Parameters
        ----------
        height_m : float, optional
        """
        if not self.is_round:
            return self.centre_m + self.corners_m @ _turn(self.yaw_rad).T
        heights = np.linspace(0, self.top_m, _HEIGHTS) if height_m is None else np.array([min(height_m, self.top_m)])
        angles = np.linspace(0, 2 * np.pi, _RIM, endpoint=False)
        rim = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return np.asarray(self.centre_m + float(self.radius_m(heights).max()) * rim)


def complete(points_m: Floats, *, beside_m: Floats | None = None) -> Solid:
    """The solid that fits best what is seen of a thing that nothing hides.

    Parameters
    ----------
    points_m : (n, 3) float64
        Of its surface, in the world, the table at z = 0.
    beside_m : (m, 2) float64, optional
        Where the lines of sight just beside it pass at the height of its top: where it ends, its last pixel does not
        say to the half of one.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> ball = rng.normal(size=(500, 3))
    >>> ball = 0.03 * ball / np.linalg.norm(ball, axis=1, keepdims=True) + np.array([0.3, 0.1, 0.03])
    >>> found = complete(ball[ball[:, 0] > 0.31])
    >>> found.is_round, found.centre_m.round(3).tolist()
    (True, [0.3, 0.1])
    """
    points = _some(points_m, _FIT_POINTS)
    prism = _prism(points_m, points, np.zeros((0, 2)) if beside_m is None else beside_m)
    round_ = _round(points)
    return round_ if round_ is not None and round_.error_m < prism.error_m else prism


def follow(solid: Solid, points_m: Floats) -> Solid:
    """The same solid where it is seen now, also if a part of what was seen before is hidden.

    Parameters
    ----------
    solid : Solid
        As it was.
    points_m : (n, 3) float64
    """
    if len(points_m) < _LEAST_POINTS:
        return solid
    points = _some(points_m, _FOLLOW_POINTS)
    found = _settled(solid, points)
    if found.error_m > max(_LOST_M, 2 * solid.error_m):
        # It was lost: start again from where the middle of what is seen lies, for several turns.
        middle = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2
        tries = [replace(solid, centre_m=middle, yaw_rad=solid.yaw_rad + turn) for turn in np.arange(-0.8, 0.81, 0.2)]
        found = min([found, *(_settled(one, points) for one in tries)], key=lambda one: one.error_m)
    return _holding(found, points_m) if len(found.corners_m) == len(_SIDES) and found.error_m < _RANGE_M else found


def _holding(solid: Solid, points: Floats) -> Solid:
    """Moved so that all of what is seen lies in it.

    Where something hides the side that says where it is, its top's outline still does: a few points, which the fit to
    all of them does not heed. What stands askew is left as it is.
    """
    own = (points[:, :2] - solid.centre_m) @ _turn(solid.yaw_rad)
    beyond = own @ solid._normals.T - solid._offsets
    out = np.partition(beyond, -_FEW, axis=0)[-_FEW]
    step = np.zeros(2)
    for side in (0, 1):
        one, other = out[side], out[side + 2]
        if max(one, other) > 0:
            # Towards what is outside, but not so far that as much is outside opposite.
            by = (one - other) / 2 if one + other > 0 else max(one, 0.0) - max(other, 0.0)
            step += by * solid._normals[side]
    return replace(solid, centre_m=solid.centre_m + _turn(solid.yaw_rad) @ step)


def raised(solid: Solid, by_m: float) -> Solid:
    """The same solid, higher above the table.

    Parameters
    ----------
    solid : Solid
    by_m : float
    """
    return replace(solid, top_m=solid.top_m + by_m, base_m=solid.base_m + by_m) if by_m else solid


def gap_between(one: Solid, other: Solid) -> float:
    """Distance between two solids, in metres; below zero if they overlap.

    Of two that stand on the table it is the horizontal one at the height where it is least. If one is above the other,
    the vertical one adds to it; what hangs less than :data:`STANDING_M` above another counts as standing on it.

    Parameters
    ----------
    one, other : Solid
    """
    level = _level_gap(_grounded(one), _grounded(other))
    above = max(one.base_m - other.top_m, other.base_m - one.top_m)
    if above <= -STANDING_M:
        return level
    return float(np.hypot(max(level, 0.0), max(above - STANDING_M, 0.0)))


def _grounded(solid: Solid) -> Solid:
    return raised(solid, -solid.base_m)


def _level_gap(one: Solid, other: Solid) -> float:
    top = min(one.top_m, other.top_m)
    heights = np.linspace(0, top, _HEIGHTS)
    if one.is_round and other.is_round:
        apart = float(np.linalg.norm(one.centre_m - other.centre_m))
        return float((apart - one.radius_m(heights) - other.radius_m(heights)).min())
    if not one.is_round and not other.is_round:
        return _polygon_distance(one.section_m(), other.section_m())
    disc, prism = (one, other) if one.is_round else (other, one)
    return float(_outside(prism.section_m(), disc.centre_m[None])[0] - disc.radius_m(heights).max())


def gap_to_points(solid: Solid, points_m: Floats) -> float:
    """Distance of the nearest of some points from a solid, in metres; at most zero if one is inside.

    Parameters
    ----------
    solid : Solid
    points_m : (n, 3) float64
    """
    if not len(points_m):
        return float(np.inf)
    above = np.maximum(np.maximum(points_m[:, 2] - solid.top_m, solid.base_m - points_m[:, 2]), 0.0)
    if solid.is_round:
        away = np.linalg.norm(points_m[:, :2] - solid.centre_m, axis=1)
        level = away - solid.radius_m(np.clip(points_m[:, 2], solid.base_m, solid.top_m) - solid.base_m)
    else:
        reach = np.linalg.norm(solid.corners_m, axis=1).max()
        rough = np.linalg.norm(points_m[:, :2] - solid.centre_m, axis=1) - reach
        near = rough <= rough.min() + 2 * reach
        points_m, above = points_m[near], above[near]
        level = _outside(solid.section_m(), points_m[:, :2])
    return float(np.hypot(np.maximum(level, 0.0), above).min())


def _round(points: Floats) -> Solid | None:
    """x² + y² = 2 cx x + 2 cy y + a z² + b z + c, by least squares."""
    middle = points[:, :2].mean(axis=0)
    x, y = (points[:, :2] - middle).T
    z = points[:, 2]
    columns = np.stack([2 * x, 2 * y, z**2, z, np.ones(len(z))], axis=-1)
    scale = np.abs(columns).max(axis=0)
    scale[scale == 0] = 1.0
    found, _, rank, _ = np.linalg.lstsq(columns / scale, x**2 + y**2, rcond=1e-9)
    if rank < columns.shape[1]:
        return None
    cx, cy, a, b, c = found / scale
    solid = Solid(
        middle + np.array([cx, cy]),
        float(points[:, 2].max()),
        0.0,
        np.zeros((0, 2)),
        np.array([a, b, c + cx**2 + cy**2]),
        0.0,
    )
    return replace(solid, error_m=_error(solid, points))


def _prism(all_points: Floats, points: Floats, beside: Floats) -> Solid:
    """Over the rectangle about what is seen from above, or over its convex hull where that fits better."""
    from scipy.spatial import ConvexHull, QhullError

    top = float(np.percentile(all_points[:, 2], 99))
    try:
        hull = all_points[ConvexHull(all_points[:, :2]).vertices, :2]
    except QhullError:
        hull = all_points[:3, :2]
    profile = np.zeros(3)
    middle = (hull.min(axis=0) + hull.max(axis=0)) / 2
    as_seen = Solid(middle, top, 0.0, hull - middle, profile, 0.0)
    as_seen = replace(as_seen, error_m=_error(as_seen, points))
    rectangle = _rectangle(all_points, hull, top, beside)
    return rectangle if rectangle.error_m <= 1.5 * as_seen.error_m + 1e-4 else as_seen


def _rectangle(points: Floats, hull: Floats, top: float, beside: Floats) -> Solid:
    turns = np.linspace(0, np.pi / 2, _TURNS, endpoint=False)
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    across = np.stack([-ways[:, 1], ways[:, 0]], axis=-1)
    areas = np.ptp(hull @ ways.T, axis=0) * np.ptp(hull @ across.T, axis=0)
    yaw = float(turns[areas.argmin()])
    sides = points[points[:, 2] < top - _FACE_M, :2]
    # The sides that are seen say more exactly how it is turned, and where they are, than its outline does.
    for _ in range(2):
        own, low, high = _in_box(sides, hull, yaw)
        turned = weight = 0.0
        for axis, border, _ in _faces(low, high):
            near = _of_face(own, axis, border, high - low)
            if near.any():
                along, off = own[near, 1 - axis], own[near, axis]
                spread = float(((along - along.mean()) ** 2).sum())
                slope = float(((along - along.mean()) * off).sum()) / max(spread, 1e-12)
                turned += spread * np.arctan(slope) * (1.0 if axis == 1 else -1.0)
                weight += spread
        yaw += turned / weight if weight else 0.0
    own, low, high = _in_box(sides, hull, yaw)
    outside = beside @ _turn(yaw)
    first_low, first_high = low.copy(), high.copy()
    unsure = np.zeros(4)
    for axis, border, sign in _faces(first_low, first_high):
        other = 1 - axis
        ends = low if sign < 0 else high
        seen = _on_face(own, axis, border, sign)
        if seen is not None:
            ends[axis] = seen
            continue
        # The side is hidden: its edge lies between the last line of sight that meets the top and the first that does
        # not. At the corners that may be for the other side.
        beyond = sign * (outside[:, axis] - border)
        facing = (outside[:, other] > first_low[other] + _CORNER_M) & (
            outside[:, other] < first_high[other] - _CORNER_M
        )
        facing &= (beyond > -_RANGE_M) & (beyond < _PIXEL_M)
        if facing.any():
            half_way = max(float(beyond[facing].min()), 0.0) / 2
            ends[axis] = border + sign * half_way
            unsure[_SIDES.index((axis, sign))] = half_way
    half = (high - low) / 2
    corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=np.float64)
    solid = Solid(_turn(yaw) @ ((low + high) / 2), top, yaw, corners, np.zeros(3), 0.0, unsure_m=unsure)
    return replace(solid, error_m=_error(solid, _some(points, _FIT_POINTS)))


def _in_box(sides: Floats, hull: Floats, yaw: float) -> tuple[Floats, Floats, Floats]:
    turn = _turn(yaw)
    own = hull @ turn
    return sides @ turn, own.min(axis=0), own.max(axis=0)


def _on_face(own: Floats, axis: int, border: float, sign: int) -> float | None:
    """Where a side is of which something is seen: what is seen of it is farthest out, in one plane; None if nothing."""
    out = sign * own[:, axis]
    if not len(out) or out.max() < sign * border - _PIXEL_M:
        return None
    near = out > out.max() - _RANGE_M
    # What lies farthest out of a hidden side is the end of the one beside it: a line, not a plane.
    if np.count_nonzero(near) < _LEAST_ON_FACE or np.ptp(own[near, 1 - axis]) < _PIXEL_M:
        return None
    return float(sign * np.median(out[near]))


def _of_face(own: Floats, axis: int, border: float, size: Floats) -> NDArray[np.bool_]:
    """Which points lie on a side; none if they are but the last column of another side."""
    near = np.abs(own[:, axis] - border) < _FACE_M
    along = own[near, 1 - axis]
    if len(along) < _LEAST_POINTS or np.subtract(*np.percentile(along, (75, 25))) < size[1 - axis] / 4:
        near[:] = False
    return near


def _faces(low: Floats, high: Floats) -> Sequence[tuple[int, float, int]]:
    return [(axis, float(ends[axis]), sign) for axis in (0, 1) for ends, sign in ((low, -1), (high, 1))]


def _settled(solid: Solid, points: Floats) -> Solid:
    """Moved and turned until the points lie on its surface (Gauss–Newton, far points counting less)."""
    centre, yaw = solid.centre_m.copy(), solid.yaw_rad
    for _ in range(_STEPS):
        distance, slope = _distance(solid, centre, yaw, points)
        weight = 1 / (1 + (distance / _ROBUST_M) ** 2)
        normal = (slope * weight[:, None]).T @ slope
        # What is not seen, such as the turn of a ball, stays as it was.
        normal[np.diag_indices(3)] += _WEAK
        step = np.linalg.solve(normal, -(slope * weight[:, None]).T @ distance)
        centre += step[:2]
        yaw += step[2] / _ARM_M
        if np.abs(step).max() < _STILL_M:
            break
    moved = replace(solid, centre_m=centre, yaw_rad=float(yaw))
    distance, _ = _distance(moved, centre, yaw, points)
    return replace(moved, error_m=float(np.sqrt((distance**2).mean())))


_ARM_M = 0.03
"""Turns count as the way of a point this far out."""


def _distance(solid: Solid, centre: Floats, yaw: float, points: Floats) -> tuple[Floats, Floats]:
    """Distance of points from the surface, and how it changes with x, y and (times an arm) the turn of the solid."""
    away = points[:, :2] - centre
    slope = np.zeros((len(points), 3))
    if solid.is_round:
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
        distance = length - solid.radius_m(points[:, 2])
        slope[:, :2] = -away / length[:, None]
        return distance, slope
    turn = _turn(yaw)
    own = away @ turn
    reach = own @ solid._normals.T - solid._offsets
    edge = reach.argmax(axis=1)
    distance = reach[np.arange(len(own)), edge]
    level = points[:, 2] - solid.top_m
    on_side = distance > level
    normal = solid._normals[edge]
    slope[:, :2] = -(normal @ turn.T)
    slope[:, 2] = (normal[:, 0] * own[:, 1] - normal[:, 1] * own[:, 0]) / _ARM_M
    slope[~on_side] = 0.0
    return np.where(on_side, distance, level), slope


def _error(solid: Solid, points: Floats) -> float:
    distance, _ = _distance(solid, solid.centre_m, solid.yaw_rad, points)
    return float(np.sqrt((distance**2).mean()))


def _outside(corners: Floats, points: Floats) -> Floats:
    """Distance of points from a convex polygon; below zero inside, by the way to the nearest edge."""
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(edges, axis=1)
    ways = edges / lengths[:, None]
    away = points[:, None] - corners
    beyond = away[..., 0] * ways[:, 1] - away[..., 1] * ways[:, 0]
    along = (away * ways).sum(axis=-1)
    off = away - np.clip(along, 0, lengths)[..., None] * ways
    nearest = np.linalg.norm(off, axis=-1).min(axis=1)
    deepest = beyond.max(axis=1)
    return np.asarray(np.where(deepest <= 0, deepest, nearest))


def _polygon_distance(one: Floats, other: Floats) -> float:
    corners = float(min(_outside(one, other).min(), _outside(other, one).min()))
    # Two that cross without a corner inside the other: the widest gap along any edge's normal is below zero.
    apart = max(_separation(one, other), _separation(other, one))
    return apart if apart <= 0 else corners


def _separation(one: Floats, other: Floats) -> float:
    edges = np.roll(one, -1, axis=0) - one
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1) / np.linalg.norm(edges, axis=1, keepdims=True)
    return float(((other @ normals.T).min(axis=0) - (one * normals).sum(axis=1)).max())


def _some(points: Floats, most: int) -> NDArray[np.float64]:
    return np.asarray(points[:: max(1, -(-len(points) // most))])


def _turn(yaw: float) -> Floats:
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([(cosine, -sine), (sine, cosine)])
