"""How much of a motion goes up and down."""

import numpy as np
from numpy.typing import NDArray

from sec_lab.role_tables.history import SegmentHistory

# A thing stands still if its places lie within this share of the whole scene.
_STILL = 0.1
# Things that stand still span a plane if they are not on one line, and no cloud.
_LEAST_SPREAD, _MOST_DEPTH = 0.05, 0.75


def up_direction(history: SegmentHistory) -> NDArray[np.float64] | None:
    """Direction that is up: the normal of the plane through what stands still.

    In pictures (places in pixels) the axis of the rows takes its place, as there is no plane to be seen; then a motion
    away from the camera counts as one upwards. The sign of the direction is not determined.

    Parameters
    ----------
    history : SegmentHistory
        As recorded: what nobody touches stands still best.

    Returns
    -------
    (2,) or (3,) float64 of length 1, or None
        None without places, or if fewer than three things stand still, or these are on one line or span no plane.

    Examples
    --------
    >>> still = np.repeat([[[0.0, 0, 0]], [[1, 0, 0]], [[0, 1, 0]]], 2, axis=1)
    >>> history = SegmentHistory(
    ...     ((1,), (2,), (3,)), np.ones((3, 2), bool), np.zeros((3, 3, 2), np.uint8), still, np.array([0, 5])
    ... )
    >>> np.abs(up_direction(history))
    array([0., 0., 1.])
    """
    places = history.places
    if places is None:
        return None
    if places.shape[2] == 2:
        return np.array([0.0, 1.0])
    seen = history.present.sum(axis=1) > 0
    low = np.min(np.where(history.present[..., None], places, np.inf), axis=1)[seen]
    high = np.max(np.where(history.present[..., None], places, -np.inf), axis=1)[seen]
    extents = np.linalg.norm(high - low, axis=1)
    still = (extents < _STILL * np.linalg.norm(high.max(axis=0) - low.min(axis=0))) & (
        history.present.sum(axis=1)[seen] > 1
    )
    if still.sum() < 3:
        return None
    centres = ((low + high) / 2)[still]
    _, spread, axes = np.linalg.svd(centres - centres.mean(axis=0))
    if spread[1] <= _LEAST_SPREAD * spread[0] or spread[2] > _MOST_DEPTH * spread[1]:
        return None
    normal: NDArray[np.float64] = axes[2]
    return normal


def vertical_share(places: NDArray[np.float64], up: NDArray[np.float64] | None) -> float:
    """Share of a path that goes up or down, 0 to 1; NaN if what is up is not known or nothing moves.

    Parameters
    ----------
    places : (n, 2) or (n, 3) float64
        One after the other.
    up : (2,) or (3,) float64 of length 1, or None

    Examples
    --------
    >>> vertical_share(np.array([[0.0, 0], [0, 3], [1, 3]]), np.array([0.0, 1]))
    0.75
    """
    if up is None or len(places) < 2:
        return float("nan")
    steps = np.diff(places, axis=0)
    length = float(np.linalg.norm(steps, axis=1).sum())
    return float(np.abs(steps @ up).sum()) / length if length > 0 else float("nan")
