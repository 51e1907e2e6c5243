"""The four action types of §2.3 in four versions each: everything that is needed to render one movie."""

from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from sec_lab.worlds.tabletop import filling_liquid, making_sandwich, moving_object, opening_book
from sec_lab.worlds.tabletop.camera import Camera
from sec_lab.worlds.tabletop.clutter import clutter
from sec_lab.worlds.tabletop.plan import Plan
from sec_lab.worlds.tabletop.settings import SETTINGS, Setting, camera_of, surroundings

Action = Literal["moving_object", "making_sandwich", "filling_liquid", "opening_book"]
ACTIONS: tuple[Action, ...] = get_args(Action)
VERSIONS = (1, 2, 3, 4)

_ACTS = {
    "moving_object": moving_object.act,
    "making_sandwich": making_sandwich.act,
    "filling_liquid": filling_liquid.act,
    "opening_book": opening_book.act,
}


def plan_movie(
    action: Action, version: int, setting: Setting, *, seed: int, size_px: tuple[int, int] = (320, 256)
) -> Plan:
    """Plan one movie; both settings of a version show the same movements from the same place.

    Parameters
    ----------
    action : {"moving_object", "making_sandwich", "filling_liquid", "opening_book"}
    version : {1, 2, 3, 4}
    setting : {"laboratory", "kitchen"}
    seed : int
        Not negative.
    size_px : tuple of int, optional
        (width, height) of the movie.

    Returns
    -------
    Plan

    Raises
    ------
    ValueError
        If the action, version, setting or seed is none of these.

    Examples
    --------
    >>> plan_movie("juggling", 1, "kitchen", seed=0)
    Traceback (most recent call last):
    ...
    ValueError: action: expected one of moving_object, making_sandwich, filling_liquid, opening_book, got 'juggling'
    """
    for what, value, known in (
        ("action", action, ACTIONS),
        ("version", version, VERSIONS),
        ("setting", setting, SETTINGS),
    ):
        if value not in known:
            raise ValueError(f"{what}: expected one of {', '.join(map(str, known))}, got {value!r}")
    if seed < 0:
        raise ValueError(f"seed: expected a number of at least 0, got {seed}")
    key = [seed, ACTIONS.index(action), version]
    # Movements and camera do not depend on the setting; what is seen besides does.
    camera = _resized(camera_of(version, np.random.default_rng([*key, 0])), size_px)
    around = surroundings(setting, version, np.random.default_rng([*key, 1, SETTINGS.index(setting)]))
    act = _ACTS[action](version, setting, around.skin, np.random.default_rng([*key, 2]))
    n_frames = len(act.actors[0].form)
    rng = np.random.default_rng([*key, 3, SETTINGS.index(setting)])
    aside = clutter(act, camera, version, setting, rng, n_frames=n_frames)
    return Plan(
        name=f"{action}_{version}_{setting}",
        actors=(*act.actors, *aside),
        table=around.table,
        camera=camera,
        lighting=around.lighting,
        sensor=around.sensor,
        seed=int(rng.integers(2**31)),
    )


def _resized(camera: Camera, size_px: tuple[int, int]) -> Camera:
    return replace(camera, size_px=size_px)
