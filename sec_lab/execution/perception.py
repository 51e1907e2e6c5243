"""Perception (§2.10.1): segments and names by colour, touching in space from the range picture, and the event chain.

Nothing here knows what the simulator knows: pictures, range pictures and where the camera stands are all there is.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import LETTER_OF, Relation
from sec_lab.event_chain import EventChain
from sec_lab.execution.own_hand import hand_points
from sec_lab.execution.solids import Solid, follow, gap_between, gap_to_points, raised
from sec_lab.execution.things import ARM, COLOURS, TABLE, SeenThing, named_things, rays_of, things_in
from sec_lab.observation import Observation
from sec_lab.recording import Frame, Recording
from sec_lab.relations import SegmentRelations
from sec_lab.scene_graph import main_graphs, scene_graph
from sec_lab.segmentation.colour import NamedColour
from sec_lab.worlds.katana.kinematics import UnreachableError, hand_axes, joint_angles
from sec_lab.worlds.katana.records import Camera, Floats, View

__all__ = [
    "ARM",
    "ARM_CONTACT_M",
    "COLOURS",
    "CONTACT_M",
    "FINGER_M",
    "STEADY_S",
    "TABLE",
    "TABLE_CONTACT_M",
    "Perceived",
    "SeenThing",
    "Watcher",
    "decisive_rows",
    "perceive",
    "things_in",
]

CONTACT_M = (0.0007, 0.003)
"""Gap between two things, each completed by its hidden sides, at which touching begins, and at which it ends."""

ARM_CONTACT_M = (0.005, 0.009)
"""The same between a thing and the arm's tip, of whose shape only what is seen is known."""

FINGER_M = 0.025
"""Width of the fingers. An arm knows its own hand: where it stands before what it touches, its far side is hidden. It
is where the joints say; where these are not known, it lies at most so far behind what is seen."""

_OWN_M = 0.01
"""How far what is seen of its hand may be from where the joints say that it is."""

FINGERS_LONG_M = 0.06
"""How long they are."""

TABLE_CONTACT_M = (0.010, 0.014)
"""The same for the table, whose plane is seen everywhere."""

_LAST_SHARE = 0.2
"""What has shrunk to less than this of its pixels, away from the rim of the picture, and is then seen no more, is
hidden behind something; what is gone at once, or over the rim, is absent."""

STEADY_S = 0.2
"""For how long a change must last to count; it is dated to the frame in which it began."""

_RESTING_FRAMES = 5
_FITS_M = 0.001


@dataclass(frozen=True, eq=False)
class Perceived:
    """What was perceived in a movie.

    Parameters
    ----------
    observation : Observation
        Key frames, main graphs with positions in metres, names; the table is a node.
    chain : EventChain or None
        Its rows with a change between N and T (§2.10.1); None if there is none.
    gaps_m : dict of pair of str to (n_frames,) float64
        Gap frame by frame, infinite where one is absent, a little below zero where two that touch look too large;
        names in the order of :data:`COLOURS`.
    moved_m : dict of str to float
        How far each thing lies from where it was seen first.
    drift_m : dict of str to float
        How far it has moved within the last frames.
    unsure_m : dict of pair of str to float, optional
        By how much the gap between two things may be another for the size of a pixel, as they stand last.
    """

    observation: Observation
    chain: EventChain | None
    gaps_m: dict[tuple[str, str], Floats]
    moved_m: dict[str, float]
    drift_m: dict[str, float]
    unsure_m: dict[tuple[str, str], float] = field(default_factory=dict)

    def last_gap_m(self, one: str, other: str) -> float:
        """Gap between two things as it was seen last, the median of a few frames.

        Raises
        ------
        ValueError
            If there is no such pair.
        """
        for pair, gaps in self.gaps_m.items():
            if set(pair) == {one, other}:
                return float(np.median(gaps[-_RESTING_FRAMES:]))
        raise ValueError(f"pair: expected one of {sorted(self.gaps_m)}, got {(one, other)}")

    def last_unsure_m(self, one: str, other: str) -> float:
        """By how much the gap between two things may be another; 0 if nothing is known of it."""
        return max((unsure for pair, unsure in self.unsure_m.items() if set(pair) == {one, other}), default=0.0)


class Watcher:
    """Perceives a movie frame by frame, and says at any time what has been seen so far.

    Parameters
    ----------
    camera : Camera
    frames_per_second : float
    colours : sequence of NamedColour, optional
    known : mapping of str to Solid, optional
        Shapes of things that were seen whole before; others are known from where they are seen first.
    touching : collection of pair of str, optional
        What touched when it was seen last: it does so until its gap is wide enough to end that.
    """

    def __init__(
        self,
        camera: Camera,
        *,
        frames_per_second: float,
        colours: Sequence[NamedColour] = COLOURS,
        known: Mapping[str, Solid] | None = None,
        touching: Collection[tuple[str, str]] = (),
    ) -> None:
        self.camera = camera
        self.colours = tuple(colours)
        self.frames_per_second = frames_per_second
        self._rays = rays_of(camera)
        self._heights: dict[str, list[float]] = {}
        self._pairs = list(combinations([colour.name for colour in self.colours], 2))
        self._gaps: list[list[float]] = []
        self._centres: list[dict[str, Floats]] = []
        self._solids: dict[str, Solid] = dict(known or {})
        self._last: dict[str, SeenThing] = {}
        self._most_px: dict[str, int] = {}
        self._fingers: Floats | None = None
        self._hand: Floats | None = None
        self._touched = frozenset(touching)

    def __len__(self) -> int:
        return len(self._centres)

    def add(
        self, frame: Frame | View, *, tip_m: ArrayLike | None = None, joints_rad: ArrayLike | None = None
    ) -> tuple[SeenThing, ...]:
        """Perceive one more frame.

        Parameters
        ----------
        frame : Frame or View
            With range.
        tip_m : (3,) array_like of float, optional
            Where the arm's own joints say that its tip is: it may be hidden.
        joints_rad : (7,) array_like of float, optional
            What these joints say, the two fingers last: then the hidden side of the hand is where they say that there
            is one, and not wherever it might be.

        Returns
        -------
        tuple of SeenThing
            With their hidden sides, as they are known from where they were seen first.

        Raises
        ------
        ValueError
            If the frame has no range.
        """
        self._fingers = None if tip_m is None else _fingers(tip_m)
        self._hand = None if joints_rad is None else hand_points(joints_rad)
        found = [self._own(thing) for thing in named_things(frame, self.camera, self.colours, self._rays, self._is_new)]
        seen = {thing.name: self._followed(thing) for thing in found}
        for name, thing in self._last.items():
            if name not in seen and self._is_hidden(thing):
                seen[name] = replace(thing, points_m=thing.points_m[:0])
        for name, thing in seen.items():
            heights = self._heights.setdefault(name, [])
            if len(heights) < _RESTING_FRAMES:
                heights.append(thing.top_m)
        before = self._gaps[-1] if self._gaps else [np.inf] * len(self._pairs)
        self._gaps.append(
            [
                self._gap(seen.get(one), seen.get(other), last)
                for (one, other), last in zip(self._pairs, before, strict=True)
            ]
        )
        self._centres.append({name: thing.centre_m for name, thing in seen.items()})
        self._last = seen
        return tuple(seen[colour.name] for colour in self.colours if colour.name in seen)

    def perceived(self) -> Perceived:
        """What has been perceived so far.

        Raises
        ------
        ValueError
            If there was no frame yet.
        """
        if not self._centres:
            raise ValueError("movie: expected at least one frame, got none")
        steady = max(1, round(STEADY_S * self.frames_per_second))
        names = [colour.name for colour in self.colours]
        gaps = np.array(self._gaps).reshape(len(self), len(self._pairs))
        there = np.stack([_steady(np.array([name in seen for seen in self._centres]), steady) for name in names])
        touching = {
            pair: _steady(self._touching(pair, gaps[:, place]), steady) for place, pair in enumerate(self._pairs)
        }
        last: dict[str, Floats] = {}
        graphs = []
        for number, centres in enumerate(self._centres):
            last.update(centres)
            present = [place for place, name in enumerate(names) if there[place, number] and name in last]
            relations = np.zeros((len(present), len(present)), dtype=np.uint8)
            for i, j in combinations(range(len(present)), 2):
                if touching[names[present[i]], names[present[j]]][number]:
                    relations[i, j] = relations[j, i] = Relation.TOUCHING
            labels = [place + 1 for place in present]
            positions = np.array([last[names[place]] for place in present]).reshape(-1, 3)
            types = [names[place] for place in present]
            graphs.append(scene_graph(SegmentRelations(labels, relations, positions), types=types))
        main = main_graphs(graphs)
        named = {label: name for label, name in enumerate(names, start=1) if there[label - 1].any()}
        observation = Observation(main.graphs, main.key_frames, named, "m")
        return Perceived(
            observation,
            decisive_rows(observation),
            {pair: gaps[:, place] for place, pair in enumerate(self._pairs)},
            {name: self._moved(name) for name in last},
            {name: self._drift(name) for name in last},
            {pair: self._unsure(pair) for pair in self._pairs},
        )

    def touching(self) -> frozenset[tuple[str, str]]:
        """Pairs of things that touch as they are seen now, without the arm and the table."""
        gaps = np.array(self._gaps).reshape(len(self), len(self._pairs))
        return frozenset(
            pair
            for place, pair in enumerate(self._pairs)
            if not {ARM, TABLE} & set(pair) and len(gaps) and self._touching(pair, gaps[:, place])[-1]
        )

    def _touching(self, pair: tuple[str, str], gaps: Floats) -> NDArray[np.bool_]:
        return _touching(gaps, _limits(pair), state=pair in self._touched)

    def _unsure(self, pair: tuple[str, str]) -> float:
        one, other = (self._solids.get(name) for name in pair)
        if one is None or other is None:
            return 0.0
        return one.unsure_towards_m(other.centre_m) + other.unsure_towards_m(one.centre_m)

    def _moved(self, name: str) -> float:
        places = [centres[name] for centres in self._centres if name in centres]
        start, now = (np.median(some, axis=0) for some in (places[:_RESTING_FRAMES], places[-_RESTING_FRAMES:]))
        return float(np.linalg.norm(now - start))

    def _drift(self, name: str) -> float:
        places = [centres[name] for centres in self._centres[-_RESTING_FRAMES:] if name in centres]
        return float(np.linalg.norm(places[-1] - places[0])) if places else 0.0

    @property
    def known(self) -> dict[str, Solid]:
        """Shapes that still fit what was seen of them last."""
        return {name: solid for name, solid in self._solids.items() if solid.error_m <= _FITS_M}

    def _own(self, thing: SeenThing) -> SeenThing:
        """Of what has the arm's colour, what is its hand: between red and green, pixels look yellow."""
        if thing.name != ARM or self._hand is None:
            return thing
        from scipy.spatial import KDTree

        away, _ = KDTree(self._hand).query(thing.points_m, distance_upper_bound=_OWN_M)
        return replace(thing, points_m=thing.points_m[np.isfinite(away)])

    def _is_new(self, name: str) -> bool:
        return name != ARM and name not in self._solids

    def _followed(self, thing: SeenThing) -> SeenThing:
        """With its solid where it is now; a thing that was never seen before brings its own."""
        self._most_px[thing.name] = max(self._most_px.get(thing.name, 0), len(thing.points_m))
        if thing.name in (ARM, TABLE):
            return thing
        last = self._last.get(thing.name)
        if thing.solid is None:
            solid = self._solids[thing.name]
            # What has not changed in the picture has not moved.
            lift = self._lift(thing)
            if last is None or not np.array_equal(last.points_m, thing.points_m):
                solid = follow(solid, thing.points_m - np.array([0.0, 0.0, lift]))
            self._solids[thing.name] = solid
            middle = thing.top_m - solid.top_m / 2 if lift else thing.top_m / 2
            centre = np.array([*solid.centre_m, middle])
            return replace(thing, solid=raised(solid, lift), centre_m=centre, footprint_m=solid.section_m())
        self._solids[thing.name] = thing.solid
        return thing

    def _lift(self, thing: SeenThing) -> float:
        """How much higher than at first its top is; nothing as long as it counts as touching the table."""
        before = self._heights.get(thing.name) or [self._solids[thing.name].top_m]
        lift = thing.top_m - float(np.median(before))
        return lift if lift > TABLE_CONTACT_M[0] else 0.0

    def _is_hidden(self, last: SeenThing) -> bool:
        n = len(last.points_m)
        return last.name != TABLE and not last.at_rim and n < _LAST_SHARE * self._most_px[last.name]

    def _gap(self, one: SeenThing | None, other: SeenThing | None, before: float) -> float:
        if one is None or other is None:
            return np.inf
        arm = one if one.name == ARM else other
        if arm.name == ARM and not len(arm.points_m) and (self._fingers is None or TABLE in (one.name, other.name)):
            return before
        if TABLE in (one.name, other.name):
            thing = other if one.name == TABLE else one
            # The lower rim of a thing may be hidden, its top seldom is: it rests while it is as high as it was.
            if thing.name == ARM:
                return float(thing.points_m[:, 2].min())
            return max(0.0, thing.top_m - float(np.median(self._heights[thing.name])))
        if arm.name == ARM:
            solid = other.solid if one is arm else one.solid
            assert solid is not None
            gap = gap_to_points(solid, self._whole(arm))
            if self._fingers is None or self._hand is not None:
                return gap
            # An arm feels where its fingers are, be they hidden.
            return min(gap, max(0.0, gap_to_points(solid, self._fingers) - FINGER_M / 2))
        assert one.solid is not None
        assert other.solid is not None
        return gap_between(one.solid, other.solid)

    def _whole(self, thing: SeenThing) -> Floats:
        """Its surface; of the arm's own fingers the hidden side, too."""
        if thing.name != ARM:
            return thing.points_m
        if self._hand is not None:
            return np.concatenate([thing.points_m, self._hand])
        way = thing.points_m[:, :2] - self.camera.X_WC[:2, 3]
        behind = thing.points_m.copy()
        behind[:, :2] += FINGER_M * way / np.linalg.norm(way, axis=1, keepdims=True)
        return np.concatenate([thing.points_m, behind])


def perceive(
    recording: Recording,
    camera: Camera,
    *,
    tip_m: ArrayLike | None = None,
    colours: Sequence[NamedColour] = COLOURS,
) -> Perceived:
    """Perceive a whole movie: segments by colour, touching in space, main graphs, event chain (steps 1 to 4).

    Parameters
    ----------
    recording : Recording
        With range.
    camera : Camera
    tip_m : (n_frames, 3) array_like of float, optional
        Where the arm's own joints say that its tip was.
    colours : sequence of NamedColour, optional

    Returns
    -------
    Perceived

    Raises
    ------
    ValueError
        If the recording has no range or another size than the camera, or there are not as many places of the tip.
    """
    if not recording.has_depth:
        raise ValueError("recording: expected one with range pictures, got none")
    watcher = Watcher(camera, frames_per_second=recording.frames_per_second or 20.0, colours=colours)
    if tip_m is None:
        for frame in recording:
            watcher.add(frame)
        return watcher.perceived()
    for frame, tip in zip(recording, np.asarray(tip_m), strict=True):
        watcher.add(frame, tip_m=tip)
    return watcher.perceived()


def decisive_rows(observation: Observation) -> EventChain | None:
    """Chain of the rows with a change from N to T or from T to N; others tell nothing of a manipulation (§2.10.1).

    Parameters
    ----------
    observation : Observation

    Returns
    -------
    EventChain or None
        None if there is no such row.
    """
    chain = observation.chain
    rows = [place for place, row in enumerate(chain.relations) if _has_contact_change(row)]
    if not rows:
        return None
    relations = chain.relations[rows]
    kept = np.concatenate([[True], (relations[:, 1:] != relations[:, :-1]).any(axis=0)])
    return EventChain(relations[:, kept], chain.pairs[rows], chain.key_frames[kept], chain.names)


def _has_contact_change(row: NDArray[np.uint8]) -> bool:
    letters = [LETTER_OF[Relation(int(code))] for code in row]
    return any({a, b} == {"N", "T"} for a, b in pairwise(letters))


def _fingers(tip_m: ArrayLike) -> Floats:
    """Points on the middle line of the fingers, from the tip back."""
    tip = np.asarray(tip_m, dtype=np.float64)
    try:
        along, _ = hand_axes(joint_angles(tip))
    except UnreachableError:
        # At the very end of its reach a hair is too much; the tip itself is where it is.
        return tip[None]
    return np.asarray(tip - np.linspace(0, FINGERS_LONG_M, 13)[:, None] * along)


def _limits(pair: tuple[str, str]) -> tuple[float, float]:
    return TABLE_CONTACT_M if TABLE in pair else ARM_CONTACT_M if ARM in pair else CONTACT_M


def _touching(gaps: Floats, limits_m: tuple[float, float], *, state: bool = False) -> NDArray[np.bool_]:
    begin, end = limits_m
    states = np.zeros(len(gaps), dtype=np.bool_)
    for number, gap in enumerate(gaps):
        state = bool(gap < (end if state else begin))
        states[number] = state
    return states


def _steady(states: NDArray[np.bool_], n: int) -> NDArray[np.bool_]:
    """Changes that last for n frames, dated to their beginning; the last ones as far as they go."""
    steady = states.copy()
    state, start = bool(states[0]), 0
    edges = [*np.flatnonzero(states[1:] != states[:-1]) + 1, len(states)]
    for first, after in pairwise(edges):
        if after - first >= n or after == len(states):
            steady[start:first] = state
            state, start = bool(states[first]), int(first)
    steady[start:] = state
    return steady
