"""The action types of §2.3 and §2.9 in their versions: everything that is needed to render one movie."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Literal, cast, get_args

import numpy as np

from sec_lab.worlds.tabletop import filling_liquid, making_sandwich, moving_object, opening_book, put_and_take
from sec_lab.worlds.tabletop.clutter import clutter
from sec_lab.worlds.tabletop.plan import Plan
from sec_lab.worlds.tabletop.put_and_take import PutOrTake
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

COLLECTIONS: Mapping[str, Mapping[str, tuple[int, ...]]] = MappingProxyType(
    {
        "tabletop_actions": MappingProxyType(dict.fromkeys(ACTIONS, VERSIONS)),
        "put_and_take": MappingProxyType(
            {action: tuple(range(1, 1 + n)) for action, n in put_and_take.N_VERSIONS.items()}
        ),
    }
)
"""The versions of every action, in two collections: the four types of §2.3, and putting and taking of §2.9."""

ALL_VERSIONS: Mapping[str, tuple[int, ...]] = MappingProxyType(
    {action: versions for actions in COLLECTIONS.values() for action, versions in actions.items()}
)


def plan_movie(
    action: Action | PutOrTake, version: int, setting: Setting, *, seed: int, size_px: tuple[int, int] = (320, 256)
) -> Plan:
    """Plan one movie; both settings of a version show the same movements from the same place.

    Parameters
    ----------
    action : str
        Of §2.3: ``"moving_object"``, ``"making_sandwich"``, ``"filling_liquid"`` or ``"opening_book"``; of §2.9:
        ``"putting"``, ``"taking"`` or ``"mixed"``.
    version : int
        1 to 4; 1 to 10 of putting and of taking, 1 to 5 of the mixed movies.
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
    >>> plan_movie("mixed", 6, "kitchen", seed=0)
    Traceback (most recent call last):
    ...
    ValueError: version: expected one of 1, 2, 3, 4, 5, got 6
    """
    _known("action", action, tuple(ALL_VERSIONS))
    _known("version", version, ALL_VERSIONS[action])
    _known("setting", setting, SETTINGS)
    if seed < 0:
        raise ValueError(f"seed: expected a number of at least 0, got {seed}")
    key = [seed, tuple(ALL_VERSIONS).index(action), version]
    # Movements and camera do not depend on the setting; what is seen besides does.
    eye_rng, act_rng = (np.random.default_rng([*key, part]) for part in (0, 2))
    look_rng, rng = (np.random.default_rng([*key, part, SETTINGS.index(setting)]) for part in (1, 3))
    if action in _ACTS:
        look, n_aside = version, version
        camera = camera_of(version, eye_rng)
        around = surroundings(setting, look, look_rng)
        act = _ACTS[action](version, setting, around.skin, act_rng)
    else:
        shown = cast(PutOrTake, action)
        look = put_and_take.look_of(shown, version)
        n_aside = put_and_take.n_aside_of(shown, version)
        camera = put_and_take.view_of(shown, version, eye_rng)
        around = surroundings(setting, look, look_rng)
        act = put_and_take.act(shown, version, setting, around.skin, act_rng)
    camera = replace(camera, size_px=size_px)
    n_frames = len(act.actors[0].form)
    aside = clutter(act, camera, n_aside, setting, rng, n_frames=n_frames)
    return Plan(
        name=f"{action}_{version}_{setting}",
        actors=(*act.actors, *aside),
        table=around.table,
        camera=camera,
        lighting=around.lighting,
        sensor=around.sensor,
        seed=int(rng.integers(2**31)),
        deeds=act.deeds,
    )


def _known(what: str, value: object, known: tuple[object, ...]) -> None:
    if value not in known:
        raise ValueError(f"{what}: expected one of {', '.join(map(str, known))}, got {value!r}")
