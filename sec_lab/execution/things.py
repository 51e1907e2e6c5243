"""Things in one picture: segments and names by colour, put into space by their range, with their hidden sides."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sec_lab.execution.solids import Solid, complete
from sec_lab.recording import Frame
from sec_lab.segmentation.colour import NamedColour, colour_segments
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

MINIMUM_PX = 20
_PART_SHARE = 0.3
_JUMP_M = 0.02


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
    return named_things(frame, camera, colours, rays_of(camera) if rays is None else rays, lambda _: outlines)


def named_things(
    frame: Frame | View,
    camera: Camera,
    colours: Sequence[NamedColour],
    rays: Floats,
    outlined: Callable[[str], bool],
) -> tuple[SeenThing, ...]:
    """As :func:`things_in`, for rays that are known, and with outlines of those names alone for which it is asked."""
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


def rays_of(camera: Camera) -> Floats:
    """Lines of sight of all pixels, in the world, one metre along the axis: (height, width, 3) float64."""
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
