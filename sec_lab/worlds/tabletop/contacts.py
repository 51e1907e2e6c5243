"""Which segments touch: distances between surfaces, straight from the geometry."""

import numpy as np
from numpy.typing import NDArray

from sec_lab.worlds.tabletop.plan import TABLE, Actor, Plan, segment_names
from sec_lab.worlds.tabletop.shapes import Floats, Shape

TOUCHING_M = 0.004
"""Surfaces nearer than this touch; fingers and slices are soft."""

_SPACING_M = 0.0025


def contacts(plan: Plan, *, touching_m: float = TOUCHING_M) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Which segments touch at every frame.

    Surfaces are sampled every 2.5 mm, so a distance comes out too long by well below 1 mm at the threshold.

    Parameters
    ----------
    plan : Plan
    touching_m : float, optional
        Largest distance of surfaces that touch.

    Returns
    -------
    pairs : (n_pairs, 2) int64
        Labels, the lower one first, in ascending order.
    touching : (n_frames, n_pairs) bool
    """
    names = segment_names(plan)
    label_of = {name: label for label, name in names.items()}
    pairs = np.array([(i, j) for i in names for j in names if i < j], dtype=np.int64)
    column = {(int(i), int(j)): place for place, (i, j) in enumerate(pairs)}
    touching = np.zeros((plan.n_frames, len(pairs)), dtype=bool)
    clouds = [[_Cloud(form) for form in actor.forms] for actor in plan.actors]
    for a, actor in enumerate(plan.actors):
        touching[:, column[TABLE, label_of[actor.name]]] |= _above_table(actor, clouds[a], touching_m)
        for b in range(a):
            other = plan.actors[b]
            if actor.name == other.name:
                continue
            low, high = sorted((label_of[actor.name], label_of[other.name]))
            touching[:, column[low, high]] |= _meet(actor, clouds[a], other, clouds[b], touching_m)
    return pairs, touching


class _Cloud:
    """Points on a surface, with what is needed to search them."""

    def __init__(self, shape: Shape) -> None:
        from scipy.spatial import cKDTree

        self.points: Floats = surface_points(shape, spacing_m=_SPACING_M)
        self.tree = cKDTree(self.points)
        self.low: Floats = self.points.min(axis=0)
        self.high: Floats = self.points.max(axis=0)


def surface_points(shape: Shape, *, spacing_m: float) -> Floats:
    """Points spread over a surface, at most about 1.5 ``spacing_m`` apart.

    Parameters
    ----------
    shape : Shape
    spacing_m : float

    Returns
    -------
    (n, 3) float64

    Examples
    --------
    >>> from sec_lab.worlds.tabletop.scene import far_table
    >>> table = far_table(np.zeros((2, 2, 3), np.uint8), half_m=0.05)
    >>> len(surface_points(table, spacing_m=0.01)) > 100
    True
    """
    corners = shape.vertices_m[shape.faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.maximum(1, np.ceil(edges / spacing_m).astype(np.int64))
    found = [shape.vertices_m]
    for n in np.unique(steps[steps > 1]):
        share = np.array([(i / n, j / n, (n - i - j) / n) for i in range(n + 1) for j in range(n + 1 - i)])
        found.append(np.einsum("pk,fkd->fpd", share, corners[steps == n]).reshape(-1, 3))
    points = np.concatenate(found)
    # Slender triangles get far more points than needed: one in a cell is enough.
    cells = np.floor((points - points.min(axis=0)) / (0.4 * spacing_m)).astype(np.int64)
    size = cells.max(axis=0) + 1
    _, first = np.unique((cells[:, 0] * size[1] + cells[:, 1]) * size[2] + cells[:, 2], return_index=True)
    return np.asarray(points[first])


def _above_table(actor: Actor, clouds: list[_Cloud], touching_m: float) -> NDArray[np.bool_]:
    found = np.zeros(len(actor.form), dtype=bool)
    for frame, form in enumerate(actor.form):
        if form >= 0:
            pose = actor.X_WB[frame]
            found[frame] = (clouds[form].points @ pose[2, :3]).min() + pose[2, 3] < touching_m
    return found


def _meet(
    actor: Actor, clouds: list[_Cloud], other: Actor, other_clouds: list[_Cloud], touching_m: float
) -> NDArray[np.bool_]:
    found = np.zeros(len(actor.form), dtype=bool)
    known: dict[tuple[object, ...], bool] = {}
    for frame in range(len(found)):
        i, j = int(actor.form[frame]), int(other.form[frame])
        if i < 0 or j < 0:
            continue
        X_OB = np.linalg.inv(other.X_WB[frame]) @ actor.X_WB[frame]
        key = (i, j, np.round(X_OB, 6).tobytes())
        if key not in known:
            known[key] = _near(clouds[i], other_clouds[j], X_OB, touching_m)
        found[frame] = known[key]
    return found


def _near(cloud: _Cloud, other: _Cloud, X_OB: Floats, touching_m: float) -> bool:
    points = cloud.points @ X_OB[:3, :3].T + X_OB[:3, 3]
    inside = ((points > other.low - touching_m) & (points < other.high + touching_m)).all(axis=1)
    if not inside.any():
        return False
    distance, _ = other.tree.query(points[inside], distance_upper_bound=touching_m)
    return bool(np.isfinite(distance).any())
