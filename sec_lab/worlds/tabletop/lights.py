"""Light: a ring of spots whose shadows add up to a soft one, and a room that shines from all sides."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sec_lab.worlds.tabletop.shapes import Floats

if TYPE_CHECKING:
    from pydrake.geometry import LightParameter


@dataclass(frozen=True)
class Lighting:
    """How a scene is lit.

    Parameters
    ----------
    centre_m : tuple of float
        Middle of the ring of spots.
    ring_m : float
        Its radius: the larger, the softer the shadows.
    n_spots : int
    intensity : float
        Of all spots together.
    colour : tuple of float
        RGB between 0 and 1.
    room : float
        Brightness of the room, which fills the shadows.
    """

    centre_m: tuple[float, float, float]
    ring_m: float
    n_spots: int
    intensity: float
    colour: tuple[float, float, float]
    room: float


def spots(lighting: Lighting) -> "list[LightParameter]":
    """The spots of a lighting for Drake's renderer, all pointed at the middle of the table."""
    from pydrake.geometry import LightParameter

    centre = np.asarray(lighting.centre_m)
    towards = -centre / np.linalg.norm(centre)
    first = np.cross(towards, (0.0, 1.0, 0.0))
    first /= np.linalg.norm(first)
    second = np.cross(towards, first)
    found = []
    for angle in 2 * np.pi * (np.arange(lighting.n_spots) + 0.25) / lighting.n_spots:
        # Drake's own types do not know the arrays of numpy 2.
        position: Any = centre + lighting.ring_m * (np.cos(angle) * first + np.sin(angle) * second)
        attenuation: Any = np.array([1.0, 0.0, 0.0])
        light = LightParameter()
        light.type = "spot"
        light.frame = "world"
        light.position = position
        light.direction = -position / np.linalg.norm(position)
        light.intensity = lighting.intensity / lighting.n_spots
        light.color.set(*lighting.colour, 1.0)
        light.attenuation_values = attenuation
        light.cone_angle = 40.0
        found.append(light)
    return found


def write_room(path: Path, lighting: Lighting) -> None:
    """Write the surroundings as a Radiance picture: a bright ceiling with a window, dim walls, a floor."""
    height, width = 64, 128
    elevation = np.linspace(np.pi / 2, -np.pi / 2, height)[:, None]
    azimuth = np.linspace(-np.pi, np.pi, width)[None, :]
    level = 0.55 + 0.5 * np.clip(np.sin(elevation), -0.5, 1) + 0.0 * azimuth
    window = np.exp(-(((azimuth - 0.9) / 0.45) ** 2) - ((elevation - 0.75) / 0.35) ** 2)
    tint = np.asarray(lighting.colour) ** 0.5
    picture = lighting.room * (level[..., None] * tint + 1.6 * window[..., None] * np.array([0.9, 0.96, 1.0]))
    path.write_bytes(radiance(picture))


def radiance(picture: Floats) -> bytes:
    r"""A Radiance (.hdr) file, uncompressed.

    Parameters
    ----------
    picture : (height, width, 3) float64
        Not negative.

    Examples
    --------
    >>> radiance(np.ones((1, 1, 3)))[-4:]
    b'\x80\x80\x80\x81'
    """
    height, width = picture.shape[:2]
    brightest = np.maximum(picture.max(axis=-1), 1e-30)
    mantissa, exponent = np.frexp(brightest)
    scaled = picture * (mantissa * 256 / brightest)[..., None]
    pixels = np.concatenate([np.clip(scaled, 0, 255), (exponent + 128)[..., None]], axis=-1).astype(np.uint8)
    head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    return head.encode() + pixels.tobytes()
