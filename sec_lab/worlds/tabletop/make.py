"""From a plan to files: two movies, the truth, the calibration."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sec_lab.files import write_whole
from sec_lab.recording import write_movie
from sec_lab.worlds.tabletop.actions import Action, plan_movie
from sec_lab.worlds.tabletop.camera import calibration, exposed
from sec_lab.worlds.tabletop.contacts import contacts
from sec_lab.worlds.tabletop.deeds import timed, write_deeds
from sec_lab.worlds.tabletop.plan import Plan, segment_names
from sec_lab.worlds.tabletop.put_and_take import PutOrTake
from sec_lab.worlds.tabletop.scene import stage
from sec_lab.worlds.tabletop.settings import Setting
from sec_lab.worlds.tabletop.truth import Truth, write_truth

FRAMES_PER_SECOND = 25
CRF = 17
"""Compression of the movies: at 18 and below, stereo matching still works on them."""

EYES = ("left", "right")


def make_movie(folder: Path, plan: Plan, *, crf: float = CRF) -> Truth:
    """Render a plan and write ``left.mp4``, ``right.mp4``, ``truth.npz``, ``names.json`` and ``calibration.json``.

    Where things are put on plates or taken from them, ``actions.json`` tells when.

    Parameters
    ----------
    folder : Path
        Is made if it does not exist; its parent has to.
    plan : Plan
    crf : float, optional
        Constant rate factor of the compression.

    Returns
    -------
    Truth

    Raises
    ------
    UnusableFileError
        If a file cannot be written.
    """
    folder.mkdir(exist_ok=True)
    pairs, touching = contacts(plan)
    labels: list[NDArray[np.uint8]] = []
    depth: list[NDArray[np.uint16]] = []
    movies: tuple[list[NDArray[np.uint8]], ...] = tuple([] for _ in EYES)
    noise = [np.random.default_rng([plan.seed, eye]) for eye in range(len(EYES))]
    with stage(plan) as scene:
        for frame in range(plan.n_frames):
            scene.pose(frame)
            # Both eyes at one pose share what is most of the work, the shadows.
            for eye, pictures in enumerate(movies):
                pictures.append(exposed(scene.colour(eye), plan.sensor, noise[eye]))
            labels.append(scene.labels())
            depth.append(np.round(1000 * scene.depth()).astype(np.uint16))
    for name, pictures in zip(EYES, movies, strict=True):
        write_movie(folder / f"{name}.mp4", pictures, frames_per_second=FRAMES_PER_SECOND, crf=crf)
    truth = Truth(np.stack(labels), np.stack(depth), pairs, touching, segment_names(plan))
    write_truth(folder, truth)
    if plan.deeds:
        write_deeds(folder, timed(plan.deeds, truth.names, pairs, touching, truth.labels))
    write_whole(folder / "calibration.json", json.dumps(asdict(calibration(plan.camera)), indent=1) + "\n")
    return truth


def make_movie_of(
    folder: Path,
    action: Action | PutOrTake,
    version: int,
    setting: Setting,
    *,
    seed: int,
    size_px: tuple[int, int] = (320, 256),
) -> Path:
    """Plan and render one movie into a folder of its own; see :func:`plan_movie` and :func:`make_movie`.

    Returns
    -------
    Path
        Of its folder, inside the one that is given.

    Raises
    ------
    ValueError
        If the action, version, setting or seed is unknown.
    UnusableFileError
        If a file cannot be written.
    """
    plan = plan_movie(action, version, setting, seed=seed, size_px=size_px)
    make_movie(folder / plan.name, plan)
    return folder / plan.name
