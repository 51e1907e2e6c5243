"""The way home, and whether the way of a plan is free of everything else that is seen (D8)."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from sec_lab.execution.solids import Solid, gap_between, gap_to_points
from sec_lab.worlds.katana.kinematics import UnreachableError, hand_axes, joint_angles
from sec_lab.worlds.katana.records import Floats, Move, Point

HAND_M, HAND_LONG_M = 0.036, 0.20
"""Radius and length of the hand with its fingers ajar."""

FREE_M_S = 0.3
"""Speed high up, where nothing is in the way."""

_NEAR_COLUMN_M, _OUT_M = 0.20, 0.26
_MARGIN_M = 0.006
_PLACES = 9


def obstacle(moves: Sequence[Move], others: Sequence[tuple[str, Solid]], *, below_m: float) -> str:
    """Name of the first thing that the hand would meet on its way; empty if there is none.

    Parameters
    ----------
    moves : sequence of Move
        One after the other; those that begin and end high up pass over everything, and the first brings the tip to
        where the others start.
    others : sequence of (str, Solid)
    below_m : float
        What is low.
    """
    for before, move in pairwise(moves):
        start, end = np.array(before.to_m), np.array(move.to_m)
        if min(start[2], end[2]) >= below_m:
            continue
        for share in np.linspace(0, 1, _PLACES):
            hand = _hand(start + share * (end - start))
            for name, solid in others:
                if gap_to_points(solid, hand) < HAND_M + _MARGIN_M:
                    return name
    return ""


def swept(moving: Solid, by_m: Floats, others: Sequence[tuple[str, Solid]]) -> str:
    """Name of the first thing that another would meet while it is moved straight; empty if there is none.

    Parameters
    ----------
    moving : Solid
    by_m : (2,) float64
    others : sequence of (str, Solid)
    """
    for there in _places(moving, by_m):
        for name, solid in others:
            if gap_between(there, solid) < _MARGIN_M:
                return name
    return ""


def _places(moving: Solid, by_m: Floats) -> Iterator[Solid]:
    n = max(2, int(np.linalg.norm(by_m) / _MARGIN_M))
    for share in np.linspace(0, 1, n):
        yield replace(moving, centre_m=moving.centre_m + share * by_m)


def _hand(tip_m: Floats) -> Floats:
    """Points on the middle line of the hand; what is out of reach is no matter of corridors."""
    try:
        along, _ = hand_axes(joint_angles(tip_m))
    except UnreachableError:
        return tip_m[None]
    return np.asarray(tip_m - np.linspace(0, HAND_LONG_M, 21)[:, None] * along)


def way_home(from_m: ArrayLike, home_m: Point) -> tuple[Move, ...]:
    """Moves from a place high up to a home (D8); near its own column the arm cannot rise, so it goes outwards first.

    Parameters
    ----------
    from_m : (3,) array_like of float
    home_m : tuple of float

    Examples
    --------
    >>> [move.name for move in way_home((0.3, 0.0, 0.15), (-0.1, 0.3, 0.3))]
    ['home']
    >>> [move.name for move in way_home((0.12, 0.0, 0.15), (-0.1, 0.3, 0.3))]
    ['out', 'home']
    """
    place = np.asarray(from_m, dtype=np.float64)
    away = float(np.hypot(place[0], place[1]))
    home = Move(home_m, name="home", speed_m_s=FREE_M_S)
    if away >= _NEAR_COLUMN_M:
        return (home,)
    x, y = (_OUT_M / away * place[:2]).tolist()
    return Move((x, y, float(place[2])), name="out", speed_m_s=FREE_M_S), home
