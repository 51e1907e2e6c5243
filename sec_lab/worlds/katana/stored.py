"""Demonstrations in files: one each, pictures without loss, truth beside them."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from sec_lab.files import write_whole
from sec_lab.worlds.katana.demonstrations import (
    N_DEMONSTRATIONS,
    Demonstration,
    demonstration,
    demonstration_scene,
)
from sec_lab.worlds.katana.film import Film, film_arrays, film_of
from sec_lab.worlds.katana.placing import placing_demonstration, placing_scene
from sec_lab.worlds.katana.records import Scene, Truth

Action = Literal["push", "put on", "put beside"]
"""What is demonstrated."""

_SUFFIX = "demonstration_{:02d}.npz"


def write_demonstration(path: Path, given: Demonstration, *, seed: int, number: int, action: Action = "push") -> None:
    """Write a demonstration into one file of numpy, whole or not at all.

    Parameters
    ----------
    path : Path
    given : Demonstration
    seed, number : int
        With which it was made; its scene follows from them.
    action : {"push", "put on", "put beside"}, optional
        What is demonstrated.

    Raises
    ------
    UnusableFileError
        If it cannot be written.
    ValueError
        If it is another action.
    """
    _scene_of(action)
    height, width = given.recording.size
    film = Film((height, width), float(given.recording.frames_per_second or 1.0), level=9)
    labels = given.truth.labels
    for place, frame in enumerate(given.recording):
        assert frame.depth_m is not None
        film.add(frame.image, frame.depth_m, None if labels is None else labels[place])
    pairs = sorted(given.truth.contacts)
    things = sorted(given.truth.poses)
    file = io.BytesIO()
    arrays: dict[str, Any] = dict(
        **film_arrays(film),
        seed=np.array([seed, number]),
        action=np.array(action),
        pairs=np.array(pairs),
        contacts=np.stack([given.truth.contacts[pair] for pair in pairs]),
        tip_m=given.truth.tip_m,
        wanted_tip_m=given.truth.wanted_tip_m,
        things=np.array(things),
        poses=np.stack([given.truth.poses[thing] for thing in things]),
        labels=np.array(sorted(given.truth.names)),
        names=np.array([given.truth.names[label] for label in sorted(given.truth.names)]),
        move_ends=np.array(given.move_ends),
    )
    if given.truth.joints_rad is not None:
        # A tenth of a milliradian is what such joints' sensors tell.
        arrays["joints_rad"] = np.round(given.truth.joints_rad, 4).astype(np.float32)
    np.savez_compressed(file, **arrays)
    write_whole(path, file.getvalue())


def read_demonstration(path: Path) -> Demonstration:
    """Read what :func:`write_demonstration` wrote; pictures are unpacked when they are iterated over.

    Parameters
    ----------
    path : Path

    Raises
    ------
    OSError, KeyError, ValueError
        If the file is missing or another one.
    """
    film = film_of(path)
    with np.load(path, allow_pickle=False) as stored:
        seed, number = (int(value) for value in stored["seed"])
        truth = Truth(
            {
                (str(one), str(other)): row
                for (one, other), row in zip(stored["pairs"], stored["contacts"], strict=True)
            },
            stored["tip_m"],
            stored["wanted_tip_m"],
            {str(name): poses for name, poses in zip(stored["things"], stored["poses"], strict=True)},
            film.labels(),
            {int(label): str(name) for label, name in zip(stored["labels"], stored["names"], strict=True)},
            stored["joints_rad"].astype(np.float64) if "joints_rad" in stored else None,
        )
        scene_of = _scene_of(str(stored["action"]) if "action" in stored else "push")
        ends = tuple(int(frame) for frame in stored["move_ends"])
    return Demonstration(film.recording(), scene_of(seed, number), truth, ends)


def read_demonstrations(folder: Path) -> tuple[Demonstration, ...]:
    """All demonstrations of a folder, in their order.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    ValueError
        If there is none.
    """
    paths = sorted(folder.glob("demonstration_*.npz"))
    if not paths:
        raise ValueError(f"{folder}: expected files of demonstrations, got none")
    return tuple(read_demonstration(path) for path in paths)


def make_demonstrations(
    folder: Path, *, seed: int, n: int = N_DEMONSTRATIONS, action: Action = "push"
) -> tuple[Path, ...]:
    """Simulate and write demonstrations.

    Parameters
    ----------
    folder : Path
    seed : int
    n : int, optional
    action : {"push", "put on", "put beside"}, optional

    Returns
    -------
    tuple of Path
    """
    from tqdm import tqdm

    _scene_of(action)
    paths = []
    for number in tqdm(range(n), unit="demonstration", disable=None):
        if action == "push":
            made = demonstration(seed, number)
        else:
            made = placing_demonstration("on" if action == "put on" else "beside", seed, number)
        paths.append(folder / _SUFFIX.format(number))
        write_demonstration(paths[-1], made, seed=seed, number=number, action=action)
    return tuple(paths)


def _scene_of(action: str) -> Callable[[int, int], Scene]:
    """The scene of a demonstration from seed and number."""
    if action not in get_args(Action):
        raise ValueError(f"action: expected one of {get_args(Action)}, got {action!r}")
    if action == "push":
        return demonstration_scene
    return lambda seed, number: placing_scene("on" if action == "put on" else "beside", seed, number=number)
