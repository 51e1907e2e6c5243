"""Perception (§2.10.1): segments and names by colour, touching in space from the range picture, and the event chain.

Nothing here knows what the simulator knows: pictures, range pictures and where the camera stands are all there is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import LETTER_OF, Relation
from sec_lab.event_chain import EventChain
from sec_lab.execution.solids import Solid, complete, follow, gap_between, gap_to_points, raised
from sec_lab.observation import Observation
from sec_lab.recording import Frame, Recording
from sec_lab.relations import SegmentRelations
from sec_lab.scene_graph import main_graphs, scene_graph
from sec_lab.segmentation.colour import NamedColour, colour_segments
from sec_lab.worlds.katana.kinematics import UnreachableError, hand_axes, joint_angles
from sec_lab.worlds.katana.records import Camera, Floats, View

ARM, TABLE = "robot arm", "table"

COLOURS = (
    NamedColour(TABLE, (0, 360), (0, 20), (40, 90)),
    NamedColour(ARM, (36, 66), (60, 100), (12, 100)),
    NamedColour("red box", (340, 20), (50, 100), (10, 100)),
    NamedColour("green box", (90, 160), (50, 100), (10, 100)),
    NamedColour("blue sphere", (200, 250), (50, 100), (10, 100)),
)
"""What things are called by their colour, as in §2.10.1: a red cone is a "red box", too (Fig. 2.21)."""

CONTACT_M = (0.0007, 0.003)
"""Gap between two things, each completed by its hidden sides, at which touching begins, and at which it ends."""

ARM_CONTACT_M = (0.005, 0.009)
"""The same between a thing and the arm's tip, of whose shape only what is seen is known."""

FINGER_M = 0.025
"""Width of the fingers. An arm knows its own hand: where it stands before what it touches, its far side is hidden, and
lies so far behind what is seen of it."""

FINGERS_LONG_M = 0.06
"""How long they are."""

TABLE_CONTACT_M = (0.010, 0.014)
"""The same for the table, whose plane is seen everywhere."""

MINIMUM_PX = 20
_LAST_SHARE = 0.2
"""What has shrunk to less than this of its pixels, away from the rim of the picture, and is then seen no more, is
hidden behind something; what is gone at once, or over the rim, is absent."""

STEADY_S = 0.2
"""For how long a change must last to count; it is dated to the frame in which it began."""

_PART_SHARE = 0.3
_JUMP_M = 0.02
_RESTING_FRAMES = 5


@dataclass(frozen=True, eq=False)
class SeenThing:
    """A thing in one picture, in space.

    Parameters
    ----------
    name : str
        By its colour.
    label : int
    points_m : (n, 3) float64
        What is seen of its surface, in the world.
    footprint_m : (k, 2) float64
        Corners of the convex hull of these points, seen from above, anticlockwise.
    centre_m : (3,) float64
        Middle of the footprint, at half the height.
    top_m, bottom_m : float
        Highest and lowest that is seen of it, above the table.
    n_parts : int
        Parts in the picture that are not much smaller than the largest: more than one where several things have the
        colour, or something hides the middle.
    solid : Solid or None
        With its hidden sides; None for arm and table, and where it was not asked for.
    at_rim : bool
        Whether it reaches the rim of the picture.
    """

    name: str
    label: int
    points_m: Floats
    footprint_m: Floats
    centre_m: Floats
    top_m: float
    bottom_m: float
    n_parts: int
    solid: Solid | None = None
    at_rim: bool = False

    def __post_init__(self) -> None:
        for array in (self.points_m, self.footprint_m, self.centre_m):
            array.setflags(write=False)


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
    """

    observation: Observation
    chain: EventChain | None
    gaps_m: dict[tuple[str, str], Floats]
    moved_m: dict[str, float]
    drift_m: dict[str, float]

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


class Watcher:
    """Perceives a movie frame by frame, and says at any time what has been seen so far.

    Parameters
    ----------
    camera : Camera
    frames_per_second : float
    colours : sequence of NamedColour, optional
    """

    def __init__(self, camera: Camera, *, frames_per_second: float, colours: Sequence[NamedColour] = COLOURS) -> None:
        self.camera = camera
        self.colours = tuple(colours)
        self.frames_per_second = frames_per_second
        self._rays = _rays(camera)
        self._heights: dict[str, list[float]] = {}
        self._pairs = list(combinations([colour.name for colour in self.colours], 2))
        self._gaps: list[list[float]] = []
        self._centres: list[dict[str, Floats]] = []
        self._solids: dict[str, Solid] = {}
        self._last: dict[str, SeenThing] = {}
        self._most_px: dict[str, int] = {}
        self._fingers: Floats | None = None

    def __len__(self) -> int:
        return len(self._centres)

    def add(self, frame: Frame | View, *, tip_m: ArrayLike | None = None) -> tuple[SeenThing, ...]:
        """Perceive one more frame.

        Parameters
        ----------
        frame : Frame or View
            With range.
        tip_m : (3,) array_like of float, optional
            Where the arm's own joints say that its tip is: it may be hidden.

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
        found = _things(frame, self.camera, self.colours, self._rays, lambda name: name not in self._solids)
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
            pair: _steady(_touching(gaps[:, place], _limits(pair)), steady) for place, pair in enumerate(self._pairs)
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
        )

    def _moved(self, name: str) -> float:
        places = [centres[name] for centres in self._centres if name in centres]
        start, now = (np.median(some, axis=0) for some in (places[:_RESTING_FRAMES], places[-_RESTING_FRAMES:]))
        return float(np.linalg.norm(now - start))

    def _drift(self, name: str) -> float:
        places = [centres[name] for centres in self._centres[-_RESTING_FRAMES:] if name in centres]
        return float(np.linalg.norm(places[-1] - places[0])) if places else 0.0

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
            return replace(thing, solid=raised(solid, lift), centre_m=np.array([*solid.centre_m, middle]))
        self._solids[thing.name] = thing.solid
        return thing

    def _lift(self, thing: SeenThing) -> float:
        """How much higher than at first its top is; nothing as long as it counts as touching the table."""
        lift = thing.top_m - float(np.median(self._heights[thing.name]))
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
            if self._fingers is None:
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


def things_in(
    frame: Frame | View,
    camera: Camera,
    *,
    colours: Sequence[NamedColour] = COLOURS,
    rays: Floats | None = None,
    outlines: bool = True,
) -> tuple[SeenThing, ...]:
    """Things in one picture: segments by colour, put into space by their range.

    Parameters
    ----------
    frame : Frame or View
    camera : Camera
    colours : sequence of NamedColour, optional
    rays : (height, width, 3) float64, optional
        Of the camera's pixels in the world, if they are known already.
    outlines : bool, optional
        Whether to find footprints and parts, which takes a while and only planning needs; without them a footprint is
        empty, and the centre that of the smallest upright box.

    Returns
    -------
    tuple of SeenThing
        In the order of the colours.

    Raises
    ------
    ValueError
        If there is no range, or the size is not the camera's.
    """
    return _things(frame, camera, colours, _rays(camera) if rays is None else rays, lambda _: outlines)


def _things(
    frame: Frame | View,
    camera: Camera,
    colours: Sequence[NamedColour],
    rays: Floats,
    outlined: Callable[[str], bool],
) -> tuple[SeenThing, ...]:
    if frame.depth_m is None:
        raise ValueError("frame: expected one with range, got none")
    if frame.depth_m.shape != (camera.height, camera.width):
        raise ValueError(f"frame: expected {(camera.height, camera.width)} pixels, got {frame.depth_m.shape}")
    labels = colour_segments(frame.image, colours, minimum_px=MINIMUM_PX, components="all")
    labels[_on_the_rim(labels, frame.depth_m) | (frame.depth_m <= 0)] = 0
    counts = np.bincount(labels.ravel(), minlength=len(colours) + 1)
    found = []
    for label, colour in enumerate(colours, start=1):
        if counts[label] < MINIMUM_PX:
            continue
        if colour.name == TABLE:
            found.append(
                SeenThing(TABLE, label, np.zeros((0, 3)), np.zeros((0, 2)), _middle_of_table(camera), 0.0, 0.0, 1)
            )
            continue
        where = np.nonzero(labels == label)
        points = rays[where] * frame.depth_m[where][:, None].astype(np.float64) + camera.X_WC[:3, 3]
        mask = labels == label if outlined(colour.name) else None
        thing = replace(_seen(colour.name, label, points, mask), at_rim=_at_rim(where, labels.shape))
        if mask is not None and colour.name != ARM:
            thing = _completed(thing, _beside(mask, labels, rays, camera, thing.top_m))
        found.append(thing)
    return tuple(found)


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


def _seen(name: str, label: int, points: Floats, mask: NDArray[np.bool_] | None) -> SeenThing:
    if mask is None:
        footprint, n_parts = np.zeros((0, 2)), 1
        middle = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2
    else:
        footprint, n_parts = _hull(points[:, :2]), _n_parts(mask)
        middle = _centroid(footprint)
    # Single pixels on the rim may show what lies behind.
    bottom, top = (float(height) for height in np.percentile(points[:, 2], (1, 99)))
    centre = np.array([middle[0], middle[1], top / 2])
    return SeenThing(name, label, points, footprint, centre, top, bottom, n_parts)


def _at_rim(where: Sequence[NDArray[np.intp]], shape: Sequence[int]) -> bool:
    return any(place.min() == 0 or place.max() == size - 1 for place, size in zip(where, shape, strict=True))


def _completed(thing: SeenThing, beside_m: Floats) -> SeenThing:
    solid = complete(thing.points_m, beside_m=beside_m)
    centre = np.array([*solid.centre_m, thing.top_m / 2])
    return replace(thing, footprint_m=solid.section_m(), centre_m=centre, solid=solid)


def _beside(
    mask: NDArray[np.bool_], labels: NDArray[np.uint16], rays: Floats, camera: Camera, height_m: float
) -> Floats:
    """Where lines of sight through pixels next to a thing pass at a height, if nothing else is seen along them."""
    from scipy.ndimage import binary_dilation

    rim = binary_dilation(mask, structure=np.ones((3, 3))) & ~mask & (labels <= 1)
    ways = rays[rim]
    return np.asarray(camera.X_WC[:2, 3] + ways[:, :2] * ((height_m - camera.X_WC[2, 3]) / ways[:, 2])[:, None])


def _n_parts(mask: NDArray[np.bool_]) -> int:
    from scipy.ndimage import find_objects, label

    (box,) = find_objects(mask.astype(np.uint8))
    parts, n = label(mask[box], structure=np.ones((3, 3)))
    if n == 1:
        return 1
    sizes = np.bincount(parts.ravel())[1:]
    return int(np.count_nonzero(sizes >= _PART_SHARE * sizes.max()))


def _on_the_rim(labels: NDArray[np.uint16], depth_m: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels that may have the colour of one thing and the range of another: far from one beside of the same label."""
    rim = np.zeros(labels.shape, dtype=np.bool_)
    height, width = labels.shape
    # All eight neighbours, as a segment may hang together over corners.
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        one = np.s_[down:, max(right, 0) : width + min(right, 0)]
        other = np.s_[: height - down, max(-right, 0) : width + min(-right, 0)]
        torn = (labels[one] == labels[other]) & (np.abs(depth_m[one] - depth_m[other]) > _JUMP_M)
        rim[one] |= torn
        rim[other] |= torn
    return rim


def _middle_of_table(camera: Camera) -> Floats:
    """Where the camera's axis meets the table plane."""
    axis, place = camera.X_WC[:3, 2], camera.X_WC[:3, 3]
    return np.asarray(place - axis * place[2] / axis[2]) if axis[2] < 0 else np.zeros(3)


def _hull(points: Floats) -> Floats:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return np.asarray(points[:3])


def _centroid(corners: Floats) -> Floats:
    x, y = corners.T
    nx, ny = np.roll(corners, -1, axis=0).T
    cross = x * ny - nx * y
    area = cross.sum()
    if abs(area) < 1e-12:
        return np.asarray(corners.mean(axis=0))
    middle: Floats = np.array([((x + nx) * cross).sum(), ((y + ny) * cross).sum()]) / (3 * area)
    return middle


def _rays(camera: Camera) -> Floats:
    rows, columns = np.mgrid[: camera.height, : camera.width]
    rays = np.stack(
        [
            (columns - (camera.width - 1) / 2) / camera.focal_px,
            (rows - (camera.height - 1) / 2) / camera.focal_px,
            np.ones(rows.shape),
        ],
        axis=-1,
    )
    return np.asarray(rays @ camera.X_WC[:3, :3].T)


def _touching(gaps: Floats, limits_m: tuple[float, float]) -> NDArray[np.bool_]:
    begin, end = limits_m
    state = False
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
