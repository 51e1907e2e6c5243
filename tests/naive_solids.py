"""Distances between upright solids the slow way: many points on both, every pair of them."""

import numpy as np

from sec_lab.execution.solids import Solid


def surface(solid: Solid, n_levels: int = 31, n_rim: int = 120) -> np.ndarray:
    """Points on the side of a solid, level by level: (n_levels, n, 2)."""
    levels = np.linspace(0, solid.top_m, n_levels)
    if solid.is_round:
        angles = np.linspace(0, 2 * np.pi, n_rim, endpoint=False)
        rim = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return np.array([solid.centre_m + float(solid.radius_m(level)) * rim for level in levels])
    corners = solid.section_m()
    shares = np.linspace(0, 1, n_rim // len(corners), endpoint=False)[:, None]
    rim = np.concatenate(
        [a + shares * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)], axis=0
    )
    return np.array([rim for _ in levels])


def gap_between(one: Solid, other: Solid) -> float:
    """Least horizontal distance of any two points at one height."""
    lower = min(one.top_m, other.top_m)
    ones, others = (surface(cut(solid, lower)) for solid in (one, other))
    return min(float(np.linalg.norm(a[:, None] - b[None], axis=-1).min()) for a, b in zip(ones, others, strict=True))


def cut(solid: Solid, top_m: float) -> Solid:
    """The part below a height."""
    return Solid(solid.centre_m, top_m, solid.yaw_rad, solid.corners_m, solid.profile, 0.0)
