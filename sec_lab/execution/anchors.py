"""Spatial anchor points (§2.10.3, §2.10.4): constraints D1 to D8 from what was perceived of the demonstrations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.execution.perception import SeenThing
from sec_lab.worlds.katana.records import Floats


@dataclass(frozen=True)
class PrimeMover:
    """D1: the segment in which two key frames differ.

    Parameters
    ----------
    name : str
    changed_px : mapping of str to int
        Changed pixels of the difference image, by the segment that was there or came.
    """

    name: str
    changed_px: Mapping[str, int]


@dataclass(frozen=True, eq=False)
class Points:
    """Points of all demonstrations, and how widely they are spread.

    Parameters
    ----------
    points_m : (n, 3) float64
    mean_m : (3,) float64
    spread_m : float
        Root mean square distance from the mean.
    """

    points_m: Floats
    mean_m: Floats
    spread_m: float


@dataclass(frozen=True, eq=False)
class Intersections:
    """D6: where the connection vector meets the borders of the objects, in the plane.

    Parameters
    ----------
    E1_m, S2_m : (2,) float64
        On the first object, on the side away from the second and towards it.
    E2_m : (2,) float64
        On the second object, on the side of the first.
    """

    E1_m: Floats
    S2_m: Floats
    E2_m: Floats


def prime_mover(before: ArrayLike, after: ArrayLike, names: Mapping[int, str], *, ground: str = "table") -> PrimeMover:
    """D1: subtract the segments at one key frame from those at the next; what has changed belongs to the prime mover.

    Parameters
    ----------
    before, after : (height, width) array_like of int
        Label images at the key frames of N and of T.
    names : mapping of int to str
        Of the labels; others do not count.
    ground : str, optional
        What lies behind everything and changes wherever something else does.

    Returns
    -------
    PrimeMover

    Raises
    ------
    ValueError
        If the images differ in shape, or in no named segment.

    Examples
    --------
    >>> prime_mover([[1, 1, 3]], [[1, 2, 3]], {1: "table", 2: "robot arm", 3: "red box"}).name
    'robot arm'
    """
    one, other = np.asarray(before), np.asarray(after)
    if one.shape != other.shape:
        raise ValueError(f"after: expected shape {one.shape} as before, got {other.shape}")
    changed = one != other
    counts = {
        name: int(np.count_nonzero(changed & ((one == label) | (other == label))))
        for label, name in names.items()
        if name != ground
    }
    if not any(counts.values()):
        raise ValueError("after: expected a change of a named segment, got none")
    return PrimeMover(max(counts, key=lambda name: counts[name]), counts)


def start_points(points_m: ArrayLike) -> Points:
    """D2: where the prime mover was when it was first seen; widely spread, so nothing is asked of a start.

    Parameters
    ----------
    points_m : (n, 3) array_like of float
    """
    return _points(points_m)


def touching_points(tips_m: ArrayLike, origins_m: ArrayLike, connections_m: ArrayLike) -> Points:
    """D3: where the prime mover was when it first touched, the ends E₁ of the first motion segment.

    Parameters
    ----------
    tips_m, origins_m, connections_m : (n, 3) array_like of float
        Places of the tip; of the first touched object (D4); connection vectors (D5).

    Returns
    -------
    Points
        Relative to the origin, the x axis along the connection vector.
    """
    tips, origins = np.asarray(tips_m, dtype=np.float64), np.asarray(origins_m, dtype=np.float64)
    return _points([in_frame(t, o, c) for t, o, c in zip(tips, origins, np.asarray(connections_m), strict=True)])


def coordinate_origin(first: SeenThing) -> Floats:
    """D4: the centre of the first touched object; (3,) float64."""
    return first.centre_m


def connection_vector(first: SeenThing, second: SeenThing) -> Floats:
    """D5: from the centre of the first to that of the second touched object; (3,) float64, in the plane.

    Raises
    ------
    ValueError
        If both are at one place.
    """
    vector = second.centre_m - first.centre_m
    vector = np.array([vector[0], vector[1], 0.0])
    if np.linalg.norm(vector) < 1e-6:
        raise ValueError(f"connection vector: expected {first.name} and {second.name} at two places, got one")
    return vector


def intersections(first: SeenThing, second: SeenThing) -> Intersections:
    """D6: E₁, S₂ and E₂ from the connection vector and the borders of the objects (Fig. 2.19 B).

    Parameters
    ----------
    first, second : SeenThing

    Raises
    ------
    ValueError
        If the vector misses a border.
    """
    vector = connection_vector(first, second)[:2]
    way = vector / np.linalg.norm(vector)
    origin, end = first.centre_m[:2], second.centre_m[:2]
    return Intersections(
        origin - border_distance(first.footprint_m, origin, -way) * way,
        origin + border_distance(first.footprint_m, origin, way) * way,
        end - border_distance(second.footprint_m, end, -way) * way,
    )


def segment_length(found: Intersections) -> float:
    """D7: Δ = |E₂ − S₂|, the length of the second motion segment, in metres."""
    return float(np.linalg.norm(found.E2_m - found.S2_m))


def end_points(points_m: ArrayLike) -> Points:
    """D8: where the prime mover was last seen; widely spread, so any way home will do that collides with nothing.

    Parameters
    ----------
    points_m : (n, 3) array_like of float
    """
    return _points(points_m)


def border_distance(corners_m: ArrayLike, origin_m: ArrayLike, way: ArrayLike) -> float:
    """From a point inside a convex footprint along a direction to its border, in metres.

    Parameters
    ----------
    corners_m : (k, 2) array_like of float
    origin_m, way : (2,) array_like of float
        The direction is a unit vector.

    Raises
    ------
    ValueError
        If the ray meets no border.

    Examples
    --------
    >>> border_distance([(-1, -1), (1, -1), (1, 1), (-1, 1)], (0, 0), (1, 0))
    1.0
    """
    corners, direction = np.asarray(corners_m, dtype=np.float64), np.asarray(way, dtype=np.float64)
    starts = corners - np.asarray(origin_m, dtype=np.float64)
    edges = np.roll(corners, -1, axis=0) - corners
    # origin + t way = start + s edge
    cross = direction[0] * edges[:, 1] - direction[1] * edges[:, 0]
    parallel = np.abs(cross) < 1e-15
    safe = np.where(parallel, 1.0, cross)
    t = (starts[:, 0] * edges[:, 1] - starts[:, 1] * edges[:, 0]) / safe
    s = (starts[:, 0] * direction[1] - starts[:, 1] * direction[0]) / safe
    met = ~parallel & (t >= 0) & (s >= -1e-9) & (s <= 1 + 1e-9)
    if not met.any():
        raise ValueError("footprint: expected the point inside it, got one outside")
    return float(t[met].max())


def in_frame(point_m: ArrayLike, origin_m: ArrayLike, connection_m: ArrayLike) -> Floats:
    """A point relative to an origin, the x axis along the connection vector, z up; (3,) float64."""
    vector = np.asarray(connection_m, dtype=np.float64)
    x = np.array([vector[0], vector[1], 0.0]) / np.hypot(vector[0], vector[1])
    y = np.array([-x[1], x[0], 0.0])
    moved = np.asarray(point_m, dtype=np.float64) - np.asarray(origin_m, dtype=np.float64)
    return np.array([moved @ x, moved @ y, moved[2]])


def _points(points_m: ArrayLike | Sequence[NDArray[np.float64]]) -> Points:
    points = np.array(points_m, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
        raise ValueError(f"points_m: expected finite numbers of shape (n, 3), got {points.shape}")
    mean = points.mean(axis=0)
    return Points(points, mean, float(np.sqrt(((points - mean) ** 2).sum(axis=1).mean())))
