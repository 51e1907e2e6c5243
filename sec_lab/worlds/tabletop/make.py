"""From a plan to files: two movies, the truth, the calibration."""

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sec_lab.files import write_whole
from sec_lab.recording import write_movie
from sec_lab.worlds.tabletop.camera import calibration, exposed
from sec_lab.worlds.tabletop.contacts import contacts
from sec_lab.worlds.tabletop.plan import Plan, segment_names
from sec_lab.worlds.tabletop.scene import Stage, stage
from sec_lab.worlds.tabletop.truth import Truth, write_truth

FRAMES_PER_SECOND = 25
CRF = 17
"""Compression of the movies: at 18 and below, stereo matching still works on them."""

EYES = ("left", "right")


def make_movie(folder: Path, plan: Plan, *, crf: float = CRF, on_frame: Callable[[], object] = lambda: None) -> Truth:
    """Render a plan and write ``left.mp4``, ``right.mp4``, ``truth.npz``, ``names.json`` and ``calibration.json``.

    Parameters
    ----------
    folder : Path
        Is made if it does not exist; its parent has to.
    plan : Plan
    crf : float, optional
        Constant rate factor of the compression.
    on_frame : callable, optional
        Called after each of the ``2 * plan.n_frames`` pictures.

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
    with stage(plan) as scene:
        movies = [list(_pictures(scene, eye, on_frame, labels=labels, depth=depth)) for eye in range(len(EYES))]
    for name, pictures in zip(EYES, movies, strict=True):
        write_movie(folder / f"{name}.mp4", pictures, frames_per_second=FRAMES_PER_SECOND, crf=crf)
    truth = Truth(np.stack(labels), np.stack(depth), pairs, touching, segment_names(plan))
    write_truth(folder, truth)
    write_whole(folder / "calibration.json", json.dumps(asdict(calibration(plan.camera)), indent=1) + "\n")
    return truth


def _pictures(
    scene: Stage,
    eye: int,
    on_frame: Callable[[], object],
    *,
    labels: list[NDArray[np.uint8]],
    depth: list[NDArray[np.uint16]],
) -> Iterator[NDArray[np.uint8]]:
    """Pictures of one eye; those of the left one add their labels and depth to the lists."""
    rng = np.random.default_rng([scene.plan.seed, eye])
    for frame in range(scene.plan.n_frames):
        scene.pose(frame)
        if eye == 0:
            labels.append(scene.labels())
            depth.append(np.round(1000 * scene.depth()).astype(np.uint16))
        picture = exposed(scene.colour(eye), scene.plan.sensor, rng)
        on_frame()
        yield picture
