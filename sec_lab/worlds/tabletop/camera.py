"""The stereo camera: where it stands, and what its lenses and sensors do to a picture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sec_lab.recording import Calibration
from sec_lab.worlds.tabletop.shapes import Floats


@dataclass(frozen=True)
class Camera:
    """A rectified stereo pair that looks at the table; the first eye is the left one.

    Parameters
    ----------
    target_m : tuple of float
        What is in the middle between the two pictures.
    distance_m : float
        From there to the middle between the eyes.
    elevation_deg, azimuth_deg : float
        Height above the horizon, and turn about the vertical; at azimuth 0 the camera stands on the negative y axis.
    roll_deg : float
    field_of_view_deg : float
        Horizontal.
    baseline_m : float
    size_px : tuple of int
        (width, height).
    """

    target_m: tuple[float, float, float] = (0.0, 0.0, 0.02)
    distance_m: float = 0.85
    elevation_deg: float = 52.0
    azimuth_deg: float = 0.0
    roll_deg: float = 0.0
    field_of_view_deg: float = 44.0
    baseline_m: float = 0.12
    size_px: tuple[int, int] = (320, 256)


def calibration(camera: Camera) -> Calibration:
    """Calibration of the movies of a camera.

    Examples
    --------
    >>> calibration(Camera(field_of_view_deg=90)).focal_length_px
    160.0
    """
    width, height = camera.size_px
    focal = width / 2 / np.tan(np.deg2rad(camera.field_of_view_deg) / 2)
    return Calibration(round(float(focal), 9), ((width - 1) / 2, (height - 1) / 2), baseline_m=camera.baseline_m)


def eye_poses(camera: Camera) -> tuple[Floats, Floats]:
    """Poses of the left and the right eye in the world: x to the right, y down, z forward.

    Returns
    -------
    tuple of (4, 4) float64
    """
    elevation, azimuth = np.deg2rad([camera.elevation_deg, camera.azimuth_deg])
    back = np.array([np.sin(azimuth) * np.cos(elevation), -np.cos(azimuth) * np.cos(elevation), np.sin(elevation)])
    forward = -back
    right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    down = np.cross(forward, right)
    roll = np.deg2rad(camera.roll_deg)
    right, down = np.cos(roll) * right + np.sin(roll) * down, np.cos(roll) * down - np.sin(roll) * right
    middle = np.asarray(camera.target_m) + camera.distance_m * back
    poses = []
    for side in (-0.5, 0.5):
        pose = np.eye(4)
        pose[:3, :3] = np.stack([right, down, forward], axis=1)
        pose[:3, 3] = middle + side * camera.baseline_m * right
        poses.append(pose)
    return poses[0], poses[1]


def project(camera: Camera, points_m: Floats) -> Floats:
    """Pixels (column, row) at which the left eye sees points of the world.

    Parameters
    ----------
    points_m : (n, 3) float64

    Returns
    -------
    (n, 2) float64
    """
    known = calibration(camera)
    pose = eye_poses(camera)[0]
    local = (np.asarray(points_m) - pose[:3, 3]) @ pose[:3, :3]
    pixels = known.focal_length_px * local[:, :2] / local[:, 2:] + np.asarray(known.principal_point_px)
    return np.asarray(pixels)


@dataclass(frozen=True)
class Sensor:
    """What a camera does to the light that comes in.

    Parameters
    ----------
    blur_px : float
        Standard deviation of the blur of the lens.
    vignette : float
        Loss of light in the corners, as a share.
    flicker : float
        Standard deviation of the gain from frame to frame, as a share.
    read_variance, shot_variance : float
        Variance of the noise of a pixel of grey value I is ``read_variance + shot_variance * I``.
    """

    blur_px: float = 0.55
    vignette: float = 0.10
    flicker: float = 0.004
    read_variance: float = 1.5
    shot_variance: float = 0.035


def exposed(picture: NDArray[np.uint8], sensor: Sensor, rng: np.random.Generator) -> NDArray[np.uint8]:
    """What the sensor makes of a picture that was rendered at twice its size.

    Parameters
    ----------
    picture : (2 height, 2 width, 3) uint8
    sensor : Sensor
    rng : numpy.random.Generator

    Returns
    -------
    (height, width, 3) uint8
    """
    from scipy.ndimage import gaussian_filter

    height, width = picture.shape[0] // 2, picture.shape[1] // 2
    light = picture.reshape(height, 2, width, 2, 3).mean(axis=(1, 3), dtype=np.float32)
    light = gaussian_filter(light, (sensor.blur_px, sensor.blur_px, 0))
    rows, columns = np.ogrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    gain = 1 + sensor.flicker * rng.standard_normal()
    light *= (gain * (1 - sensor.vignette * (rows**2 + columns**2) / 2))[..., None]
    light += np.sqrt(sensor.read_variance + sensor.shot_variance * light) * rng.standard_normal(light.shape)
    return np.asarray(np.clip(np.round(light), 0, 255), dtype=np.uint8)
