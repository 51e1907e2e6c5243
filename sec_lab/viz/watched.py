"""What the arm's camera saw: pictures, range, segments and main graphs (Fig. 2.13, 2.14), and strips (Fig. 2.20)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sec_lab.execution.things import COLOURS, MINIMUM_PX
from sec_lab.observation import Observation
from sec_lab.recording import Frame, Recording
from sec_lab.scene_graph import SceneGraph
from sec_lab.segmentation.colour import colour_segments
from sec_lab.viz.gallery import Panel, draw_gallery, graph_at
from sec_lab.worlds.katana import Camera, project

if TYPE_CHECKING:
    from sec_lab.execution.loop import Outcome
    from sec_lab.execution.perception import Perceived


def draw_seen(perceived: "Perceived", recording: Recording, camera: Camera, frames: Sequence[int]) -> Figure:
    """Draw moments of a movie as Fig. 2.13 and 2.14 do: pictures, range, segments with the scene graph.

    Parameters
    ----------
    perceived : Perceived
        Of this movie.
    recording : Recording
        Read once more.
    camera : Camera
    frames : sequence of int
        Numbers of the frames; of the key frames for Fig. 2.14.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If a frame does not exist, or has no range.
    """
    observation = projected(perceived.observation, camera)
    moments = frames_at(recording, frames)
    if any(frame.depth_m is None for frame in moments):
        raise ValueError("recording: expected one with range pictures, got none")
    labels = [colour_labels(frame) for frame in moments]
    rows = [
        [Panel(frame.image) for frame in moments],
        [Panel(_known(frame)) for frame in moments],
        [Panel(label, graph_at(observation, frame.index, label)) for frame, label in zip(moments, labels, strict=True)],
    ]
    columns = [f"frame {frame.index}" for frame in moments]
    return draw_gallery(rows, columns=columns, names=["picture", "range", "segments"], measure="range in m")


def draw_strips(outcomes: "Mapping[str, Outcome]") -> Figure:
    """Draw executions as strips (Fig. 2.20): the camera at the start, and after each rule of the last attempt.

    Parameters
    ----------
    outcomes : mapping of str to Outcome
        By the name of the scene; in the last attempt of each as many rules were followed.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If there is no outcome, or they differ in how many rules were followed.
    """
    rows, columns = [], ["start"]
    for outcome in outcomes.values():
        verdicts = [one for one in outcome.verdicts if one.attempt == outcome.verdicts[-1].attempt]
        # The look after a rule is the last of that many frames, counted from the first of the attempt.
        looks = [start_of_last_attempt(outcome) + one.frame - 1 for one in verdicts]
        moments = frames_at(outcome.recording, [0, *looks])
        rows.append([Panel(frame.image) for frame in moments])
        columns = ["start", *(f"after {one.rule[-3:]}" for one in verdicts)]
    return draw_gallery(rows, columns=columns, names=list(outcomes))


def start_of_last_attempt(outcome: "Outcome") -> int:
    """Number of the frame, in the recording of everything, at which the last attempt's chain begins.

    Parameters
    ----------
    outcome : Outcome
    """
    n_watched = len(next(iter(outcome.perceived.gaps_m.values())))
    return len(outcome.recording) - n_watched


def frames_at(recording: Recording, numbers: Sequence[int]) -> list[Frame]:
    """Frames of a recording by their numbers, in the order of these.

    Parameters
    ----------
    recording : Recording
        Read once, as far as needed.
    numbers : sequence of int

    Raises
    ------
    ValueError
        If a frame does not exist.
    """
    wanted, found = set(numbers), {}
    for frame in recording:
        if frame.index in wanted:
            found[frame.index] = frame
            if len(found) == len(wanted):
                break
    missing = sorted(wanted - found.keys())
    if missing:
        raise ValueError(f"frames: expected frames of the recording, got {missing[0]}")
    return [found[number] for number in numbers]


def colour_labels(frame: Frame) -> NDArray[np.uint16]:
    """Segments of a frame by their colours, as perception finds them; labels count :data:`COLOURS` from 1.

    Parameters
    ----------
    frame : Frame
    """
    return colour_segments(frame.image, COLOURS, minimum_px=MINIMUM_PX, components="all")


def projected(observation: Observation, camera: Camera) -> Observation:
    """An observation in metres as a camera sees it: positions of its nodes in pixels.

    Parameters
    ----------
    observation : Observation
    camera : Camera

    Raises
    ------
    ValueError
        If the positions are not in metres.
    """
    if observation.position_unit != "m":
        raise ValueError(f"observation: expected positions in metres, got {observation.position_unit!r}")
    graphs = [None if graph is None else _projected(graph, camera) for graph in observation.graphs]
    return Observation(graphs, observation.key_frames, observation.names, "px")


def _projected(graph: SceneGraph, camera: Camera) -> SceneGraph:
    positions = None if graph.positions is None else project(camera, graph.positions)[0]
    return SceneGraph(graph.segments, graph.relations, positions, graph.types)


def _known(frame: Frame) -> NDArray[np.float64]:
    depth = np.asarray(frame.depth_m, dtype=np.float64)
    return np.where(depth > 0, depth, np.nan)
