"""What is planned before anything is rendered: who is in the scene, and where at every frame."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from sec_lab.worlds.tabletop.camera import Camera, Sensor
from sec_lab.worlds.tabletop.deeds import Deed
from sec_lab.worlds.tabletop.lights import Lighting
from sec_lab.worlds.tabletop.shapes import Floats, Shape

TABLE = 1
"""Label of the table, the background of every movie."""


@dataclass(frozen=True, eq=False)
class Actor:
    """A rigid body, or one that changes between a few forms, and its path.

    Parameters
    ----------
    name : str
        Bodies of one name are one segment.
    forms : tuple of Shape
        E.g. a hand from open to closed.
    X_WB : (n_frames, 4, 4) float64
        Pose in the world at every frame.
    form : (n_frames,) int64
        Which of the forms it has; -1 where it is not in the scene.

    Raises
    ------
    ValueError
        If the shapes disagree or a form is none of the forms.
    """

    name: str
    forms: tuple[Shape, ...]
    X_WB: Floats
    form: NDArray[np.int64]

    def __post_init__(self) -> None:
        poses, form = np.array(self.X_WB, dtype=np.float64), np.array(self.form, dtype=np.int64)
        if poses.shape != (len(form), 4, 4):
            raise ValueError(f"X_WB: expected shape ({len(form)}, 4, 4), got {poses.shape}")
        if not ((form >= -1) & (form < len(self.forms))).all():
            raise ValueError(
                f"form: expected numbers from -1 to {len(self.forms) - 1}, got {form.min()} to {form.max()}"
            )
        for name, array in (("X_WB", poses), ("form", form)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)


@dataclass(frozen=True, eq=False)
class Plan:
    """A movie before it is rendered.

    Parameters
    ----------
    name : str
        E.g. ``"moving_object_1_laboratory"``.
    actors : tuple of Actor
    table : Shape
        Its upper side is the plane z = 0.
    camera : Camera
    lighting : Lighting
    sensor : Sensor
    seed : int
        Of the sensor's noise.
    deeds : tuple of Deed, optional
        What is put on plates and taken from them.

    Raises
    ------
    ValueError
        If there is no actor, or the actors' paths differ in length.
    """

    name: str
    actors: tuple[Actor, ...]
    table: Shape
    camera: Camera
    lighting: Lighting
    sensor: Sensor
    seed: int
    deeds: tuple[Deed, ...] = ()

    def __post_init__(self) -> None:
        lengths = {len(actor.form) for actor in self.actors}
        if len(lengths) != 1:
            raise ValueError(f"actors: expected paths of one length, got lengths {sorted(lengths)}")

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.actors[0].form)


def segment_names(plan: Plan) -> Mapping[int, str]:
    """Name of every label: the table is 1, the others follow in the order of the actors."""
    names = {TABLE: "table"}
    for actor in plan.actors:
        if actor.name not in names.values():
            names[len(names) + 1] = actor.name
    return MappingProxyType(names)


def still(name: str, shape: Shape, pose: Floats, n_frames: int) -> Actor:
    """An actor that rests at a pose ((4, 4) float64)."""
    return Actor(name, (shape,), np.repeat(pose[None], n_frames, axis=0), np.zeros(n_frames, dtype=np.int64))


def pose(
    position_m: tuple[float, float, float] | Floats, *, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0
) -> Floats:
    """Pose from a position and three turns in radians: about x, then y, then z of the world.

    Returns
    -------
    (4, 4) float64

    Examples
    --------
    >>> pose((1, 2, 3), yaw=np.pi / 2)[:3, :3] @ (1, 0, 0)
    array([6.123234e-17, 1.000000e+00, 0.000000e+00])
    """
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    result = np.eye(4)
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    result[:3, :3] = about_z @ about_y @ about_x
    result[:3, 3] = position_m
    return result


def eased(share: Floats | float) -> Floats:
    """Minimum-jerk progress: at rest at 0 and at 1, as hands move.

    Examples
    --------
    >>> eased(np.array([0.0, 0.5, 1.0]))
    array([0. , 0.5, 1. ])
    """
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def carried(X_WB: Floats, X_WH: Floats, first: int, last: int) -> Floats:
    """Path of a body that rests, is moved rigidly with a hand from one frame to another, and rests again.

    Parameters
    ----------
    X_WB : (4, 4) float64
        Where it rests at first.
    X_WH : (n, 4, 4) float64
        Path of the hand.
    first, last : int
        Frames at which it is gripped and released.

    Returns
    -------
    (n, 4, 4) float64
    """
    X_HB = np.linalg.inv(X_WH[first]) @ X_WB
    held = np.clip(np.arange(len(X_WH)), first, last)
    path = X_WH[held] @ X_HB
    path[:first] = X_WB
    return np.asarray(path)
