"""Where the camera stands, and which points it sees."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.worlds.katana.records import Camera, Floats

WIDTH_PX, HEIGHT_PX = 320, 256
WORKPLACE_M = (0.29, 0.0, 0.02)
"""What cameras look at."""


def camera_at(
    *,
    azimuth_deg: float = 0.0,
    elevation_deg: float = 50.0,
    distance_m: float = 0.62,
    target_m: ArrayLike = WORKPLACE_M,
    field_of_view_deg: float = 42.0,
    size_px: tuple[int, int] = (WIDTH_PX, HEIGHT_PX),
) -> Camera:
    """A camera that looks at the workplace.

    Parameters
    ----------
    azimuth_deg : float, optional
        Turn about the vertical; at 0 the camera stands opposite the arm.
    elevation_deg : float, optional
        Above the horizon.
    distance_m : float, optional
        From the target.
    target_m : (3,) array_like of float, optional
    field_of_view_deg : float, optional
        Horizontal.
    size_px : tuple of int, optional
        (width, height).

    Returns
    -------
    Camera

    Examples
    --------
    >>> camera_at(elevation_deg=0, distance_m=1).X_WC[:3, 3].round(2).tolist()
    [1.29, 0.0, 0.02]
    """
    azimuth, elevation = np.deg2rad([azimuth_deg, elevation_deg])
    back = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(-back, right), -back], axis=1)
    pose[:3, 3] = np.asarray(target_m, dtype=np.float64) + distance_m * back
    focal = size_px[0] / 2 / np.tan(np.deg2rad(field_of_view_deg) / 2)
    return Camera(size_px[0], size_px[1], float(focal), pose)


def project(camera: Camera, points_m: ArrayLike) -> tuple[Floats, Floats]:
    """Where a camera sees points.

    Parameters
    ----------
    camera : Camera
    points_m : (..., 3) array_like of float
        In the world.

    Returns
    -------
    pixels : (..., 2) float64
        Column and row; whole numbers are middles of pixels.
    depth_m : (...) float64
        Along the axis; pixels mean nothing where it is not above 0.

    Examples
    --------
    >>> pixels, depth = project(camera_at(distance_m=0.5), (0.29, 0.0, 0.02))
    >>> pixels.round(3).tolist(), float(depth.round(3))
    ([159.5, 127.5], 0.5)
    """
    points = np.asarray(points_m, dtype=np.float64)
    local = (points - camera.X_WC[:3, 3]) @ camera.X_WC[:3, :3]
    depth = local[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = camera.focal_px * local[..., :2] / depth[..., None]
    return pixels + np.array([(camera.width - 1) / 2, (camera.height - 1) / 2]), depth


def sees(camera: Camera, points_m: ArrayLike, *, radius_m: float = 0.0) -> NDArray[np.bool_]:
    """Whether a ball about each point may be seen, at least in part.

    Parameters
    ----------
    camera : Camera
    points_m : (..., 3) array_like of float
    radius_m : float, optional

    Returns
    -------
    (...) bool

    Examples
    --------
    >>> sees(camera_at(), [(0.29, 0, 0), (-0.5, 0.5, 0.3)]).tolist()
    [True, False]
    """
    points = np.asarray(points_m, dtype=np.float64)
    local = (points - camera.X_WC[:3, 3]) @ camera.X_WC[:3, :3]
    inside = local[..., 2] > -radius_m
    for axis, size in ((0, camera.width), (1, camera.height)):
        half = size / 2 / camera.focal_px
        # Distance beyond the plane through the camera and the border of the picture.
        beyond = (np.abs(local[..., axis]) - half * local[..., 2]) / np.hypot(1, half)
        inside &= beyond < radius_m
    return inside
