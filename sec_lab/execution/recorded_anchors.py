"""What demonstrations recorded at their key frames (§2.10.4): S₁, E₁, S₂, E₂, E₃ of each, comparable with others."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sec_lab.execution.anchors import connection_vector, coordinate_origin, in_frame
from sec_lab.execution.enriched import Enriched
from sec_lab.execution.planning import Skill
from sec_lab.execution.things import SeenThing
from sec_lab.worlds.katana.records import Floats

NAMES = ("S1", "E1", "S2", "E2", "E3")


@dataclass(frozen=True, eq=False)
class RecordedAnchors:
    """Start and end points of the motion segments of one demonstration, in the world.

    Parameters
    ----------
    S1_m, E1_m : (3,) float64
        Tip of the arm where it was first seen, and where it first touched the first object (D2, D3).
    S2_m, E2_m : (3,) float64
        Where first and second object touch each other, on the one and on the other, both moved back to where the
        objects were at the start.
    E3_m : (3,) float64
        Tip of the arm at the end (D8).
    origin_m, connection_m : (3,) float64
        Centre of the first object at the start, and from there to that of the second (D4, D5).
    """

    S1_m: Floats
    E1_m: Floats
    S2_m: Floats
    E2_m: Floats
    E3_m: Floats
    origin_m: Floats
    connection_m: Floats

    @property
    def delta_m(self) -> float:
        """D7: Δ = |E₂ − S₂| as it was recorded."""
        return float(np.linalg.norm(self.E2_m - self.S2_m))

    def relative(self) -> dict[str, Floats]:
        """The five points relative to the origin, x along the connection vector, by name."""
        return {name: in_frame(getattr(self, f"{name}_m"), self.origin_m, self.connection_m) for name in NAMES}

    def placed(self, relative_m: ArrayLike) -> Floats:
        """Points of another demonstration (relative) where they would be in this one.

        Parameters
        ----------
        relative_m : (..., 3) array_like of float

        Returns
        -------
        (..., 3) float64
        """
        way = self.connection_m[:2] / np.hypot(*self.connection_m[:2])
        turn = np.array([[way[0], -way[1], 0.0], [way[1], way[0], 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(np.asarray(relative_m, dtype=np.float64) @ turn.T + self.origin_m)


def recorded_anchors(demonstrations: Mapping[str, Enriched], skill: Skill) -> dict[str, RecordedAnchors]:
    """Anchor points of demonstrations at the key frames of the model.

    Parameters
    ----------
    demonstrations : mapping of str to Enriched
        Those that the skill was learned from.
    skill : Skill

    Returns
    -------
    dict of str to RecordedAnchors
        Demonstrations that lack a key frame of the model are left out.

    Raises
    ------
    ValueError
        If a demonstration is none of the model's, or an object was not seen at its key frame.
    """
    model = skill.model
    contacts = [rule.column for rule in skill.rules if rule.change == "NT"]
    found = {}
    for name, one in demonstrations.items():
        if name not in model.demonstrations:
            raise ValueError(f"demonstrations: expected those of the model {list(model.demonstrations)}, got {name!r}")
        frames = model.key_frames[model.demonstrations.index(name)].tolist()
        needed = [frames[contacts[0] - 1], frames[contacts[0]], frames[contacts[1]]]
        if min(needed) < 0:
            continue
        appears, touches, _ = needed
        before = {thing.name: thing for thing in one.things_at(max(appears - 1, 0))}
        # With the arm away nothing hides where the two touch, and they touch until the end.
        after = {thing.name: thing for thing in one.things_at(len(one.tip_m) - 1)}
        pairs = [[some.get(what) for what in (skill.first, skill.second)] for some in (before, after)]
        if any(thing is None for pair in pairs for thing in pair):
            raise ValueError(f"{name}: expected {skill.first!r} and {skill.second!r} at start and end, got another")
        found[name] = _recorded(one, appears, touches, pairs)  # type: ignore[arg-type]
    return found


def nearest_points(one_m: ArrayLike, other_m: ArrayLike) -> tuple[Floats, Floats]:
    """Where two convex footprints are nearest to each other.

    Parameters
    ----------
    one_m, other_m : (k, 2) array_like of float
        Corners in the order of the border.

    Returns
    -------
    point_of_one, point_of_other : (2,) float64

    Examples
    --------
    >>> square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> [point.tolist() for point in nearest_points(square, [(3.0, 0.5), (4.0, 0.0), (4.0, 1.0)])]
    [[1.0, 0.5], [3.0, 0.5]]
    """
    one, other = (np.asarray(corners, dtype=np.float64) for corners in (one_m, other_m))
    forth, back = _to_border(one, other), _to_border(other, one)
    if np.linalg.norm(forth[0] - forth[1]) <= np.linalg.norm(back[0] - back[1]):
        return forth
    return back[1], back[0]


def _recorded(one: Enriched, appears: int, touches: int, pairs: list[tuple[SeenThing, SeenThing]]) -> RecordedAnchors:
    (red, green), (red_after, green_after) = pairs
    on_red, on_green = nearest_points(red_after.footprint_m, green_after.footprint_m)
    height = min(red.top_m, green.top_m) / 2
    S2 = on_red - red_after.centre_m[:2] + red.centre_m[:2]
    E2 = on_green - green_after.centre_m[:2] + green.centre_m[:2]
    return RecordedAnchors(
        one.tip_m[appears],
        one.tip_m[touches],
        np.array([*S2, height]),
        np.array([*E2, height]),
        one.tip_m[-1],
        coordinate_origin(red),
        connection_vector(red, green),
    )


def _to_border(corners: Floats, border: Floats) -> tuple[Floats, Floats]:
    """The corner that is nearest to a border, and the point of the border that is nearest to it."""
    edges = np.roll(border, -1, axis=0) - border
    length = np.maximum((edges**2).sum(axis=1), 1e-18)
    beside = corners[:, None] - border[None]
    share = np.clip((beside * edges).sum(axis=2) / length, 0, 1)
    points = border[None] + share[..., None] * edges[None]
    distance = np.linalg.norm(corners[:, None] - points, axis=2)
    corner, edge = np.unravel_index(int(distance.argmin()), distance.shape)
    return np.asarray(corners[corner]), np.asarray(points[corner, edge])
