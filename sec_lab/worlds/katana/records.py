"""What stands on the arm's table, who looks at it, what the arm is told to do, and what was true meanwhile."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Point = tuple[float, float, float]
Form = Literal["box", "sphere", "cone"]
Gripper = Literal["open", "ajar", "closed"]
FaultKind = Literal["slips", "missed", "wrong object", "removed", "springs back", "drops"]

ARM, TABLE = "robot arm", "table"
"""Names of the segments that every scene has; the arm's is its coloured tip (§2.10.1)."""


@dataclass(frozen=True)
class Thing:
    """A coloured object.

    Parameters
    ----------
    name : str
    shape : {"box", "sphere", "cone"}
    colour : tuple of int
        RGB, 0 to 255.
    size_m : tuple of float
        Along its own axes: of a sphere three times its diameter, of a cone two times that of its base and its height.
    p_W_m : tuple of float
        Its middle (of a cone half its height above its base) in the world.
    yaw_rad : float, optional
        Turn about the vertical.

    Raises
    ------
    ValueError
        If the shape is unknown, a size is not above 0, round things are not round, or a number is not finite.

    Examples
    --------
    >>> Thing("red box", "box", (200, 20, 20), (0.06, 0.06, 0.06), (0.3, 0.0, 0.03)).yaw_rad
    0.0
    """

    name: str
    shape: Form
    colour: tuple[int, int, int]
    size_m: Point
    p_W_m: Point
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name or self.name in (ARM, TABLE):
            raise ValueError(f"name: expected one that is neither empty nor {ARM!r} nor {TABLE!r}, got {self.name!r}")
        if self.shape not in get_args(Form):
            raise ValueError(f"{self.name}: shape: expected one of {get_args(Form)}, got {self.shape!r}")
        colour = tuple(int(part) for part in self.colour)
        if len(colour) != 3 or not all(0 <= part <= 255 for part in colour):
            raise ValueError(f"{self.name}: colour: expected three numbers from 0 to 255, got {self.colour}")
        size = as_point(self.size_m, what=f"{self.name}: size_m")
        if min(size) <= 0:
            raise ValueError(f"{self.name}: size_m: expected numbers above 0, got {size}")
        if (size[0] != size[1] and self.shape != "box") or (size[0] != size[2] and self.shape == "sphere"):
            raise ValueError(f"{self.name}: size_m: expected those of a round {self.shape}, got {size}")
        if not np.isfinite(self.yaw_rad):
            raise ValueError(f"{self.name}: yaw_rad: expected a finite number, got {self.yaw_rad}")
        object.__setattr__(self, "colour", colour)
        object.__setattr__(self, "size_m", size)
        object.__setattr__(self, "p_W_m", as_point(self.p_W_m, what=f"{self.name}: p_W_m"))
        object.__setattr__(self, "yaw_rad", float(self.yaw_rad))


def pose_of(thing: Thing) -> Floats:
    """Pose of a thing in the world, (4, 4) float64.

    Parameters
    ----------
    thing : Thing

    Examples
    --------
    >>> pose_of(Thing("ball", "sphere", (200, 20, 20), (0.06, 0.06, 0.06), (0.3, 0.0, 0.03)))[:3, 3].tolist()
    [0.3, 0.0, 0.03]
    """
    pose = np.eye(4)
    cosine, sine = np.cos(thing.yaw_rad), np.sin(thing.yaw_rad)
    pose[:2, :2] = (cosine, -sine), (sine, cosine)
    pose[:3, 3] = thing.p_W_m
    return pose


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera with a range finder; pixel centres have whole coordinates, the axis meets the middle of the picture.

    Parameters
    ----------
    width, height : int
        In pixels.
    focal_px : float
    X_WC : (4, 4) array_like of float
        Pose in the world: x to the right of the picture, y down, z into it.

    Raises
    ------
    ValueError
        If a size is below 16 pixels, the focal length not above 0, or the pose is none.
    """

    width: int
    height: int
    focal_px: float
    X_WC: Floats

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 16:
            raise ValueError(f"camera: expected at least 16 × 16 pixels, got {self.width} × {self.height}")
        if not (np.isfinite(self.focal_px) and self.focal_px > 0):
            raise ValueError(f"focal_px: expected a number above 0, got {self.focal_px}")
        object.__setattr__(self, "X_WC", as_pose(self.X_WC, what="X_WC"))


@dataclass(frozen=True, eq=False)
class Scene:
    """Things on the table plane z = 0, the camera, and where the tip of the arm starts and ends.

    The base of the arm stands at the origin and looks along x.

    Parameters
    ----------
    things : tuple of Thing
    camera : Camera
    home_m, start_m : tuple of float
        Of the tip, in the world.

    Raises
    ------
    ValueError
        If a name occurs twice.
    """

    things: tuple[Thing, ...]
    camera: Camera
    home_m: Point
    start_m: Point

    def __post_init__(self) -> None:
        object.__setattr__(self, "things", tuple(self.things))
        names = [thing.name for thing in self.things]
        if len(set(names)) < len(names):
            raise ValueError(f"things: expected every name once, got {sorted(names)}")
        for name in ("home_m", "start_m"):
            object.__setattr__(self, name, as_point(getattr(self, name), what=name))

    def thing(self, name: str) -> Thing:
        """The thing of a name.

        Raises
        ------
        ValueError
            If there is none.
        """
        for thing in self.things:
            if thing.name == name:
                return thing
        raise ValueError(f"thing: expected one of {[thing.name for thing in self.things]}, got {name!r}")


@dataclass(frozen=True, eq=False)
class View:
    """What a camera sees at one moment.

    Parameters
    ----------
    image : (height, width, 3) uint8
        RGB.
    depth_m : (height, width) float32
        Along the optical axis; 0 where unknown.
    camera : Camera
    """

    image: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    camera: Camera

    def __post_init__(self) -> None:
        shape = self.camera.height, self.camera.width
        image, depth = np.array(self.image), np.array(self.depth_m)
        if image.shape != (*shape, 3) or image.dtype != np.uint8:
            raise ValueError(f"image: expected shape {(*shape, 3)} of type uint8, got {image.shape} of {image.dtype}")
        if depth.shape != shape or depth.dtype != np.float32:
            raise ValueError(f"depth_m: expected shape {shape} of type float32, got {depth.shape} of {depth.dtype}")
        for name, array in (("image", image), ("depth_m", depth)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)


@dataclass(frozen=True)
class Move:
    """A straight segment of the tip, and what the gripper does once it is there.

    Parameters
    ----------
    to_m : tuple of float
        Where the tip goes, in the world.
    gripper : {"open", "ajar", "closed"}, optional
        Left as it is if left out. Ajar: the fingers a little apart, for pushing with both.
    name : str, optional
    facing_rad : float, optional
        Direction in the plane towards which the flat sides of the fingers face (they open across it); if left out, the
        fingers keep facing as they do while the tip stays low, and the wrist stays as it is otherwise.
    speed_m_s : float, optional
        Mean speed of the tip.

    Raises
    ------
    ValueError
        If the gripper state is unknown, the speed not above 0, or a number is not finite.

    Examples
    --------
    >>> Move((0.3, 0, 0.03), name="push", facing_rad=0.0)
    Move(to_m=(0.3, 0.0, 0.03), gripper=None, name='push', facing_rad=0.0, speed_m_s=0.1)
    """

    to_m: Point
    gripper: Gripper | None = None
    name: str = ""
    facing_rad: float | None = None
    speed_m_s: float = 0.1

    def __post_init__(self) -> None:
        object.__setattr__(self, "to_m", as_point(self.to_m, what="to_m"))
        if self.gripper is not None and self.gripper not in get_args(Gripper):
            raise ValueError(f"gripper: expected one of {get_args(Gripper)} or None, got {self.gripper!r}")
        if self.facing_rad is not None and not np.isfinite(self.facing_rad):
            raise ValueError(f"facing_rad: expected a finite number, got {self.facing_rad}")
        if not (np.isfinite(self.speed_m_s) and 0 < self.speed_m_s <= 0.5):
            raise ValueError(f"speed_m_s: expected a number above 0 and at most 0.5, got {self.speed_m_s}")


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong, once.

    Parameters
    ----------
    kind : {"slips", "missed", "wrong object", "removed", "springs back", "drops"}
        The thing is drawn sideways out of the arm's way by a short force; the arm goes ``offset_m`` beside where it
        should; it goes to the thing instead of where it should (``instead_of``); somebody takes the thing away; it
        stands ``offset_m`` from where it was; the fingers lose their hold of it.
    move : str
        Name of the move in which it happens. The arm's own errors begin there and end once it is high up again.
    thing : str, optional
        Whom it happens to; for a wrong object, the one that the arm goes to.
    instead_of : str, optional
        For a wrong object: the right one.
    share : float, optional
        Of the move, after which it happens.
    offset_m : tuple of float, optional
        Of an arm that misses, or of a thing that springs back, in the plane.

    Raises
    ------
    ValueError
        If the kind is unknown, the share not from 0 to 1, or a thing is missing.
    """

    kind: FaultKind
    move: str
    thing: str | None = None
    instead_of: str | None = None
    share: float = 0.5
    offset_m: tuple[float, float] = (0.0, 0.08)

    def __post_init__(self) -> None:
        if self.kind not in get_args(FaultKind):
            raise ValueError(f"kind: expected one of {get_args(FaultKind)}, got {self.kind!r}")
        if not 0 <= self.share <= 1:
            raise ValueError(f"share: expected a number from 0 to 1, got {self.share}")
        if self.kind != "missed" and self.thing is None:
            raise ValueError(f"thing: expected the name of the one that is {self.kind}, got None")
        if self.kind == "wrong object" and self.instead_of is None:
            raise ValueError("instead_of: expected the name of the right object, got None")
        if not np.isfinite(self.offset_m).all():
            raise ValueError(f"offset_m: expected finite numbers, got {self.offset_m}")


@dataclass(frozen=True, eq=False)
class Truth:
    """What was true in a recording: straight from the simulator, for judging only.

    Parameters
    ----------
    contacts : mapping of pair of str to (n,) bool array
        Whether two named things or the arm's tip pressed on each other or were nearer than half a millimetre, or one
        pressed on the table, frame by frame; names in the order of the alphabet.
    tip_m : (n, 3) float64
        Of the tip, in the world.
    wanted_tip_m : (n, 3) float64
        Where it was to be.
    poses : mapping of str to (n, 4, 4) float64
        X_WB of every thing.
    labels : (n, height, width) uint8, optional
        Label of each pixel; None if it was not asked for.
    names : mapping of int to str, optional
        Names of the labels.
    joints_rad : (n, 7) float64, optional
        Of the arm's five joints and the two fingers, from their own sensors; None in recordings that lack it.
    """

    contacts: Mapping[tuple[str, str], NDArray[np.bool_]]
    tip_m: Floats
    wanted_tip_m: Floats
    poses: Mapping[str, Floats]
    labels: NDArray[np.uint8] | None = None
    names: Mapping[int, str] = field(default_factory=dict)
    joints_rad: Floats | None = None

    def __post_init__(self) -> None:
        n = len(self.tip_m)
        arrays: list[tuple[str, NDArray[Any], tuple[int, ...]]] = [
            ("tip_m", self.tip_m, (n, 3)),
            ("wanted_tip_m", self.wanted_tip_m, (n, 3)),
            *((f"contacts: {pair}", array, (n,)) for pair, array in self.contacts.items()),
            *((f"poses: {name}", array, (n, 4, 4)) for name, array in self.poses.items()),
        ]
        if self.labels is not None:
            arrays.append(("labels", self.labels, (n, *self.labels.shape[1:])))
        if self.joints_rad is not None:
            arrays.append(("joints_rad", self.joints_rad, (n, 7)))
        for name, array, expected in arrays:
            if array.shape != expected:
                raise ValueError(f"{name}: expected shape {expected}, got {array.shape}")
            array.setflags(write=False)

    def touching(self, one: str, other: str) -> NDArray[np.bool_]:
        """Whether two touched, frame by frame; (n,) bool.

        Raises
        ------
        ValueError
            If there is no such pair.
        """
        pair = (one, other) if one <= other else (other, one)
        if pair not in self.contacts:
            raise ValueError(f"pair: expected one of {sorted(self.contacts)}, got {pair}")
        return self.contacts[pair]


def as_point(values: Any, *, what: str) -> Point:
    """Three finite numbers, or one clear error."""
    point = np.asarray(values, dtype=np.float64)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise ValueError(f"{what}: expected three finite numbers, got {values}")
    return float(point[0]), float(point[1]), float(point[2])


def as_pose(values: Any, *, what: str) -> Floats:
    """A rigid pose, copied and write-protected, or one clear error."""
    pose = np.array(values, dtype=np.float64)
    if pose.shape != (4, 4) or not np.isfinite(pose).all() or (pose[3] != (0, 0, 0, 1)).any():
        raise ValueError(f"{what}: expected a pose of shape (4, 4) with last row 0 0 0 1, got shape {pose.shape}")
    if not np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-6) or np.linalg.det(pose[:3, :3]) < 0:
        raise ValueError(f"{what}: expected a rotation, got\n{pose[:3, :3]}")
    pose.setflags(write=False)
    return pose
