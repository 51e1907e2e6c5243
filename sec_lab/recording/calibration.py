"""What is known of the camera: enough to turn disparities into metres."""

import os
import sys
from dataclasses import dataclass, fields
from typing import Any

from sec_lab.files import UnusableFileError
from sec_lab.recording.json_files import read_json


@dataclass(frozen=True)
class Calibration:
    """Pinhole camera, and the second one beside it.

    The cameras of a stereo pair are taken to be rectified: rows correspond, and both have the same focal length.

    Parameters
    ----------
    focal_length_px : float
        Distance of the picture plane, in pixels.
    principal_point_px : tuple of float
        (column, row) at which the optical axis meets the picture.
    baseline_m : float, optional
        Distance between the two cameras of a stereo pair, in metres.

    Raises
    ------
    ValueError
        If a number is missing or not finite, or the focal length or the baseline is not positive.

    Examples
    --------
    A point at disparity d pixels is f b / d metres away:

    >>> camera = Calibration(400, (160, 128), baseline_m=0.12)
    >>> camera.focal_length_px * camera.baseline_m / 24
    2.0
    """

    focal_length_px: float
    principal_point_px: tuple[float, float]
    baseline_m: float | None = None

    def __post_init__(self) -> None:
        _set(self, "focal_length_px", _positive(self.focal_length_px, what="focal_length_px"))
        try:
            column, row = self.principal_point_px
        except (TypeError, ValueError) as error:
            raise ValueError(f"principal_point_px: expected (column, row), got {self.principal_point_px!r}") from error
        point = (_finite(column, what="principal_point_px"), _finite(row, what="principal_point_px"))
        _set(self, "principal_point_px", point)
        if self.baseline_m is not None:
            _set(self, "baseline_m", _positive(self.baseline_m, what="baseline_m"))


def read_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a calibration from a JSON file whose keys are the parameters of :class:`Calibration`.

    Parameters
    ----------
    path : path-like
        E.g. ``{"focal_length_px": 400, "principal_point_px": [160, 128], "baseline_m": 0.12}``.

    Returns
    -------
    Calibration

    Raises
    ------
    UnusableFileError
        If there is no such file, it is no JSON, a key is missing or unknown, or a number is not allowed.

    Examples
    --------
    >>> read_calibration("no/such/camera.json")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/camera.json: expected a calibration (JSON), but there is no such file
    """
    known = [field.name for field in fields(Calibration)]
    given = read_json(path, expected="a calibration (JSON)")
    if not isinstance(given, dict):
        raise UnusableFileError(f"{path}: expected an object with {', '.join(known)}, got a {type(given).__name__}")
    unknown = [key for key in given if key not in known]
    if unknown:
        raise UnusableFileError(f"{path}: expected only {', '.join(known)}, got {unknown[0]!r}")
    missing = [key for key in known if key not in given and key != "baseline_m"]
    if missing:
        raise UnusableFileError(f"{path}: expected {missing[0]}, but it is missing")
    try:
        return Calibration(**given)
    except ValueError as error:
        raise UnusableFileError(f"{path}: {error}") from error


def _finite(value: Any, *, what: str) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) <= sys.float_info.max:
        raise ValueError(f"{what}: expected a finite number, got {str(value)[:40]!r}")
    return float(value)


def _positive(value: Any, *, what: str) -> float:
    number = _finite(value, what=what)
    if number <= 0:
        raise ValueError(f"{what}: expected a number above 0, got {value!r}")
    return number


def _set(calibration: Calibration, name: str, value: object) -> None:
    object.__setattr__(calibration, name, value)
