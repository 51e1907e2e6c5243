"""Scene graphs in three dimensions (§2.3): segments where they are, edges as tubes, over time, in PyPI's meshcat.

A page of its own needs neither a server nor a network. The live view of :mod:`sec_lab.viz.graph_3d_server` shows the
same.
"""

import html
import os
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.files import write_whole
from sec_lab.observation import Observation
from sec_lab.viz.packed_page import packed_frame
from sec_lab.viz.style import EDGE_STYLE, RELATION_WORD
from sec_lab.viz.tint import strong_colour

if TYPE_CHECKING:
    import trimesh
    from meshcat import Visualizer

Parts = Mapping[int, "trimesh.Trimesh"]

FRAMES_PER_SECOND = 25.0
"""Speed of the animation where that of the movie is not said."""

_SUBSTEPS = 6
_RADIUS, _VIEW_SIZE = 0.045, 2.0
_TUBE_RADIUS = {Relation.TOUCHING: 0.3, Relation.OVERLAPPING: 0.55}


@dataclass(frozen=True, eq=False)
class Scene3D:
    """Segments in space over time, made by :func:`scene_3d`.

    Attributes
    ----------
    segments : (n,) int64
        Labels, ascending.
    names : tuple of str
    key_frames : (k,) int64
    positions : (k, n, 3) float64
        In the unit of the observation, axes of the camera: right, down, away. Where a segment is absent, it is where
        it was last seen, or will be seen first.
    present : (k, n) bool
    relations : (k, n, n) uint8
        9 where one of both is absent.
    unit : {"px", "m", "unknown"}
    """

    segments: NDArray[np.int64]
    names: tuple[str, ...]
    key_frames: NDArray[np.int64]
    positions: NDArray[np.float64]
    present: NDArray[np.bool_]
    relations: NDArray[np.uint8]
    unit: str

    def __post_init__(self) -> None:
        for name in ("segments", "key_frames", "positions", "present", "relations"):
            array = np.array(getattr(self, name))
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def node_radius(self) -> float:
        """Radius of the spheres, in the unit of the positions."""
        return _RADIUS * _extent(self.positions.reshape(-1, 3))


def scene_3d(observation: Observation) -> Scene3D:
    """Segments of an observation in space over time.

    Parameters
    ----------
    observation : Observation
        Its graphs have positions, in the picture (which then stands upright) or in space.

    Raises
    ------
    ValueError
        If a graph has no positions, or nothing was recorded.

    Examples
    --------
    >>> from sec_lab.scene_graph import SceneGraph
    >>> apart, touching = (SceneGraph([1, 2], [[0, r], [r, 0]], [[0, 0, 1], [0.1, 0, r]]) for r in (0, 2))
    >>> scene = scene_3d(Observation([apart, touching], [0, 10], position_unit="m"))
    >>> scene.positions[:, 1].tolist(), scene.relations[:, 0, 1].tolist()
    ([[0.1, 0.0, 0.0], [0.1, 0.0, 2.0]], [0, 2])
    """
    recorded = observation.recorded
    segments = observation.segments
    n, k = len(segments), len(recorded)
    positions = np.full((k, n, 3), np.nan)
    present = np.zeros((k, n), np.bool_)
    relations = np.full((k, n, n), Relation.ABSENT, np.uint8)
    for step, graph in enumerate(recorded):
        at = np.searchsorted(segments, graph.segments)
        if graph.positions is None and len(at):
            frame = recorded.key_frames[step]
            raise ValueError(f"positions: expected some in every scene graph, got none at key frame {frame}")
        if graph.positions is not None:
            positions[step, at, : graph.positions.shape[1]] = graph.positions
            if graph.positions.shape[1] == 2:
                positions[step, at, 2] = 0.0
        present[step, at] = True
        relations[step][np.ix_(at, at)] = graph.relations
    for segment in range(n):
        positions[:, segment] = _carried(positions[:, segment])
    names = tuple(observation.names.get(int(label)) or f"segment {label}" for label in segments)
    return Scene3D(segments, names, recorded.key_frames, positions, present, relations, observation.position_unit)


def put_graph(
    visualizer: "Visualizer", scene: Scene3D, *, parts: Parts | None = None,
    frames_per_second: float = FRAMES_PER_SECOND,
) -> None:  # fmt: skip
    """Put the graph of a scene into a meshcat visualizer, as an animation over the key frames.

    Parameters
    ----------
    visualizer : meshcat.Visualizer
    scene : Scene3D
    parts : mapping of int to trimesh.Trimesh, optional
        Shapes of segments, in the unit and axes of the positions, around their position; spheres for the others.
    frames_per_second : float, optional

    Raises
    ------
    ValueError
        If a part is of no segment, or the speed is not above 0.
    """
    from meshcat.animation import Animation
    from meshcat.geometry import Cylinder, Sphere, TriangularMeshGeometry

    if not frames_per_second > 0:
        raise ValueError(f"frames_per_second: expected a number above 0, got {frames_per_second}")
    shapes = dict(parts or {})
    unknown = sorted(set(shapes) - set(scene.segments.tolist()))
    if unknown:
        raise ValueError(f"parts: expected segments out of {scene.segments.tolist()}, got {unknown[0]}")
    visualizer["graph"].delete()
    _set_stage(visualizer)
    visualizer["graph"].set_transform(_view(_corners(scene, shapes)))
    animation = Animation(default_framerate=frames_per_second)
    times = _times(scene)
    radius = scene.node_radius
    for i, label in enumerate(scene.segments.tolist()):
        node = visualizer["graph"][f"segment {label}"]
        shape = shapes.get(label)
        geometry = Sphere(radius) if shape is None else TriangularMeshGeometry(shape.vertices, shape.faces)
        _set_object(node, geometry, _colour(strong_colour(label)))
        node.set_transform(_moved_to(scene.positions[0, i]))
        clip = _clip(animation, node, frames_per_second)
        for step, time in enumerate(times):
            clip.set_property(time, "position", "vector3", scene.positions[step, i].tolist())
        _show_while(clip, times, scene.present[:, i])
    first, second = np.triu_indices(len(scene.segments), 1)
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        for relation, share in _TUBE_RADIUS.items():
            held = scene.relations[:, i, j] == relation
            if held.any():
                name = f"{RELATION_WORD[relation]} {scene.segments[i]} {scene.segments[j]}"
                tube = visualizer["graph"][name]
                _set_object(tube, Cylinder(1.0, 1.0), _hex(EDGE_STYLE[relation].colour))
                clip = _clip(animation, tube, frames_per_second)
                _join(tube, clip, scene, (i, j), radius=share * radius)
                _show_while(clip, times, held)
    if len(scene.key_frames) > 1:
        visualizer.set_animation(animation, play=True, repetitions=1)


@dataclass(frozen=True)
class Page3D:
    """A page in three dimensions that needs nothing else; it shows itself in a notebook.

    Attributes
    ----------
    html : str
        The whole page, about 1 MB; in a notebook it is packed to a third of that.
    title : str
    height_px : int
        In a notebook.
    """

    html: str
    title: str = "scene graph"
    height_px: int = 420

    def __repr__(self) -> str:
        return f"3D view: {self.title}"

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self.height_px}px; border: 0"
        return packed_frame(self.html, title=self.title, style=style)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page into a file, whole or not at all."""
        write_whole(Path(path), self.html)


def draw_graph_3d(
    observation: Observation | Scene3D, *, parts: Parts | None = None,
    frames_per_second: float = FRAMES_PER_SECOND, title: str = "scene graph", height_px: int = 420,
) -> Page3D:  # fmt: skip
    """Draw scene graphs in three dimensions, over time, as a page that can be turned, played and scrubbed (§2.3).

    Segments are spheres at their positions, or have the shapes that are given; touching is a red tube, overlapping a
    thicker blue one. Between key frames relations hold, and segments move evenly.

    Parameters
    ----------
    observation : Observation or Scene3D
    parts, frames_per_second : optional
        As in :func:`put_graph`.
    title : str, optional
    height_px : int, optional
        In a notebook.

    Returns
    -------
    Page3D

    Raises
    ------
    ValueError
        As in :func:`scene_3d` and :func:`put_graph`.

    Examples
    --------
    >>> from sec_lab.scene_graph import SceneGraph
    >>> seen = Observation([SceneGraph([1, 2], [[0, 2], [2, 0]], [[0, 0, 1], [0.1, 0, 1]])], [0], position_unit="m")
    >>> page = draw_graph_3d(seen)
    >>> "http" in page.html.partition("<script>")[0]
    False
    """
    from meshcat import Visualizer
    from meshcat.servers.zmqserver import create_command

    scene = scene_3d(observation) if isinstance(observation, Observation) else observation
    record = Record()
    put_graph(Visualizer(window=record), scene, parts=parts, frames_per_second=frames_per_second)
    commands = "".join(create_command(data) for data in record.packed())
    said = "".join(
        f'<span><i style="background:{_css(strong_colour(label))}"></i>{html.escape(name)}</span>'
        for label, name in zip(scene.segments.tolist(), scene.names, strict=True)
    )
    for relation in _TUBE_RADIUS:
        if (scene.relations == relation).any():
            said += f'<span><b style="background:{EDGE_STYLE[relation].colour}"></b>{RELATION_WORD[relation]}</span>'
    page = _PAGE.replace("TITLE", html.escape(title)).replace("LEGEND", said)
    return Page3D(page.replace("VIEWER", _viewer()).replace("COMMANDS", commands), title, height_px)


class Record:
    """Takes the place of the window of a meshcat visualizer: keeps its commands, and needs no server.

    Attributes
    ----------
    commands : list of dict
        In their order.
    """

    def __init__(self) -> None:
        self.commands: list[dict[str, Any]] = []

    def send(self, command: Any) -> None:
        """Keep a command of meshcat."""
        self.commands.append(command.lower())

    def packed(self) -> list[bytes]:
        """All commands as meshcat sends them."""
        return [packed(command) for command in self.commands]


def packed(command: dict[str, Any]) -> bytes:
    """A command as meshcat sends it."""
    import umsgpack  # type: ignore[import-untyped]

    return bytes(umsgpack.packb(command))


def _set_stage(visualizer: "Visualizer") -> None:
    """Light paper behind the scene, no axes, a camera in front of it."""
    for end in ("top_color", "bottom_color"):
        visualizer["/Background"].set_property(end, [0.97, 0.975, 0.98])
    for helper in ("/Axes", "/Grid"):
        visualizer[helper].set_property(key="visible", value=False)
    visualizer["/Cameras/default/rotated/<object>"].set_property("position", [0.9, 0.9, 2.1])


def _set_object(node: "Visualizer", geometry: Any, colour: int) -> None:
    from meshcat.geometry import Mesh, MeshLambertMaterial

    mesh = Mesh(geometry, MeshLambertMaterial(color=colour, reflectivity=0.4))
    # The same scene is the same page, to the bit.
    for part, kind in ((mesh, "mesh"), (mesh.geometry, "geometry"), (mesh.material, "material")):
        part.uuid = str(uuid.uuid5(uuid.NAMESPACE_OID, f"{node.path.lower()} {kind}"))
    node.set_object(mesh)


def _clip(animation: Any, node: "Visualizer", frames_per_second: float) -> Any:
    from meshcat.animation import AnimationClip

    clip = animation.clips[node.path] = AnimationClip(fps=frames_per_second, name=node.path.entries[-1])
    return clip


def _show_while(clip: Any, times: list[float], holds: NDArray[np.bool_]) -> None:
    for time, is_shown in zip(times, holds.tolist(), strict=True):
        clip.set_property(time, "visible", "boolean", is_shown)


def _join(tube: "Visualizer", clip: Any, scene: Scene3D, pair: tuple[int, int], *, radius: float) -> None:
    """A tube between two segments, wherever they go."""
    times = np.array(_times(scene))
    fine = times[:1]
    if len(times) > 1:
        parts = [np.linspace(a, b, _SUBSTEPS, endpoint=False) for a, b in pairwise(times)]
        fine = np.append(np.concatenate(parts), times[-1])
    ends = [
        np.column_stack([np.interp(fine, times, scene.positions[:, one, axis]) for axis in range(3)]) for one in pair
    ]  # fmt: skip
    for step, (time, a, b) in enumerate(zip(fine.tolist(), *ends, strict=True)):
        length = float(np.linalg.norm(b - a))
        quaternion = _turn_from_y(b - a)
        scale = [radius, max(length, 1e-9), radius]
        if not step:
            tube.set_transform(_matrix((a + b) / 2, quaternion, scale))
        clip.set_property(time, "position", "vector3", ((a + b) / 2).tolist())
        clip.set_property(time, "quaternion", "quaternion", quaternion)
        clip.set_property(time, "scale", "vector3", scale)


def _turn_from_y(way: NDArray[np.float64]) -> list[float]:
    """Quaternion x, y, z, w that turns the y axis, along which tubes lie, to a direction."""
    length = float(np.linalg.norm(way))
    if length < 1e-12:
        return [0.0, 0.0, 0.0, 1.0]
    x, y, z = (way / length).tolist()
    if y < -1 + 1e-9:
        return [1.0, 0.0, 0.0, 0.0]
    # Half way between y and the direction: cross product and one plus the dot product.
    values = np.array([z, 0.0, -x, 1.0 + y])
    return [float(value) for value in values / np.linalg.norm(values)]


def _matrix(place: NDArray[np.float64], quaternion: list[float], scale: list[float]) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(quaternion).as_matrix() * np.array(scale)
    matrix[:3, 3] = place
    return matrix


def _moved_to(place: NDArray[np.float64]) -> NDArray[np.float64]:
    return _matrix(place, [0.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0])


def _times(scene: Scene3D) -> list[float]:
    return [float(frame - scene.key_frames[0]) for frame in scene.key_frames]


def _corners(scene: Scene3D, shapes: Parts) -> NDArray[np.float64]:
    """Positions of all segments at all times, and the corners of the boxes around their shapes, (n, 3)."""
    places = [scene.positions.reshape(-1, 3)]
    for i, label in enumerate(scene.segments.tolist()):
        if label in shapes:
            places += [scene.positions[:, i] + corner for corner in np.asarray(shapes[label].bounds)]
    return np.concatenate(places)


def _extent(places: NDArray[np.float64]) -> float:
    """Largest side of the box around some places."""
    side = float((places.max(axis=0) - places.min(axis=0)).max()) if len(places) else 0.0
    return side if side > 0 else 1.0


def _view(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """From right, down, away to meshcat's right, away, up, around the middle, at a size that fits the view."""
    middle = (places.max(axis=0) + places.min(axis=0)) / 2
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    scale = _VIEW_SIZE / _extent(places)
    matrix = np.eye(4)
    matrix[:3, :3] = scale * turn
    matrix[:3, 3] = -scale * turn @ middle
    return matrix


def _carried(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions of one segment, those that are not known filled with the last or else the next that is."""
    known = np.flatnonzero(np.isfinite(places).all(axis=1))
    if not len(known):
        return np.zeros_like(places)
    last = np.searchsorted(known, np.arange(len(places)), side="right") - 1
    filled: NDArray[np.float64] = places[known[np.maximum(last, 0)]]
    return filled


def _colour(rgb: tuple[int, int, int]) -> int:
    return (rgb[0] << 16) + (rgb[1] << 8) + rgb[2]


def _hex(colour: str) -> int:
    return int(colour.removeprefix("#"), 16)


def _css(rgb: tuple[int, int, int]) -> str:
    return f"#{_colour(rgb):06x}"


def _viewer() -> str:
    """The program of meshcat's page."""
    import meshcat

    return (Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>TITLE</title>
<style>
body { margin: 0; font: 13px system-ui, sans-serif; color: #22262c; background: #f7f9fa; }
#meshcat-pane { width: 100vw; height: 100vh; overflow: hidden; }
#legend { position: fixed; left: 0; bottom: 0; padding: 6px 10px; background: #ffffffcc; }
#legend span { margin-right: 14px; white-space: nowrap; }
#legend i, #legend b { display: inline-block; width: 11px; height: 11px; border-radius: 6px; margin-right: 5px; }
#legend b { width: 18px; height: 5px; border-radius: 2px; vertical-align: middle; }
</style>
</head>
<body>
<div id="meshcat-pane"></div>
<div id="legend">LEGEND</div>
<script>
VIEWER
</script>
<script>
var viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
COMMANDS
</script>
</body>
</html>
"""
