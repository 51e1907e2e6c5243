"""The two settings: what the table is made of, how it is lit, how its camera sees."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from sec_lab.worlds.tabletop import textures
from sec_lab.worlds.tabletop.camera import Camera, Sensor
from sec_lab.worlds.tabletop.lights import Lighting
from sec_lab.worlds.tabletop.scene import far_table
from sec_lab.worlds.tabletop.shapes import Shape
from sec_lab.worlds.tabletop.textures import Colour

Setting = Literal["laboratory", "kitchen"]
SETTINGS: tuple[Setting, ...] = get_args(Setting)

_CLOTHS: tuple[Colour, ...] = ((62, 98, 74), (84, 92, 104), (58, 84, 122), (112, 112, 108))
_WOODS: tuple[tuple[Colour, Colour], ...] = (
    ((205, 164, 112), (160, 112, 66)),
    ((150, 104, 72), (102, 64, 42)),
    ((222, 190, 146), (184, 142, 96)),
    ((182, 136, 96), (136, 92, 58)),
)
_SKINS: tuple[Colour, ...] = ((226, 176, 146), (206, 152, 120), (234, 190, 164), (186, 130, 98))


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What all movies of a setting and version have alike.

    Parameters
    ----------
    table : Shape
    lighting : Lighting
    sensor : Sensor
    skin : Colour
    """

    table: Shape
    lighting: Lighting
    sensor: Sensor
    skin: Colour


def surroundings(setting: Setting, version: int, rng: np.random.Generator) -> Surroundings:
    """Table, light, sensor and skin of one version (1 to 4) in one of the settings.

    Parameters
    ----------
    setting : {"laboratory", "kitchen"}
    version : int
    rng : numpy.random.Generator
        Varies what one would not notice.
    """
    number = version - 1
    side = (-1.0, 1.0, 1.0, -1.0)[number]
    if setting == "laboratory":
        table = far_table(textures.cloth(_CLOTHS[number], rng), turn=float(rng.uniform(0, 0.5)), roughness=0.95)
        lighting = Lighting(
            centre_m=(0.5 * side + rng.uniform(-0.1, 0.1), -0.2 + rng.uniform(-0.2, 0.2), 1.9),
            ring_m=0.42,
            n_spots=4,
            intensity=2.7,
            colour=(1.0, 0.97, 0.92),
            room=0.72,
        )
    else:
        light, dark = _WOODS[number]
        # The grain runs away from the camera, so it lies across the baseline.
        table = far_table(textures.wood(light, dark, rng), turn=float(rng.uniform(-0.12, 0.12)), roughness=0.5)
        lighting = Lighting(
            centre_m=(0.95 * side, 0.55 + rng.uniform(-0.2, 0.2), 1.35),
            ring_m=0.13,
            n_spots=3,
            intensity=3.4,
            colour=(1.0, 0.93, 0.82),
            room=0.52,
        )
    sensor = Sensor() if setting == "laboratory" else Sensor(vignette=0.14, read_variance=2.0, shot_variance=0.05)
    skin = _SKINS[number if setting == "laboratory" else (number + 1) % 4]
    return Surroundings(table, lighting, sensor, skin)


def camera_of(version: int, rng: np.random.Generator) -> Camera:
    """Where the camera stands in one version (1 to 4), in either setting.

    Parameters
    ----------
    version : int
    rng : numpy.random.Generator
        Moves it a little.
    """
    number = version - 1
    jitter = rng.uniform(-1, 1, 4)
    return Camera(
        target_m=(0.0, (0.02, 0.0, 0.03, 0.01)[number], 0.02),
        distance_m=(0.74, 0.82, 0.78, 0.84)[number] + 0.02 * jitter[0],
        elevation_deg=(50.0, 62.0, 56.0, 44.0)[number] + 2 * jitter[1],
        azimuth_deg=(0.0, 14.0, -18.0, 8.0)[number] + 3 * jitter[2],
        roll_deg=(0.0, 1.5, -1.5, 0.5)[number] + 0.5 * jitter[3],
        baseline_m=(0.12, 0.12, 0.13, 0.14)[number],
    )
