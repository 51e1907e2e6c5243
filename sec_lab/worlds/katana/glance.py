"""What a camera sees of a scene before anything moves; of scenes that differ in poses only, at once."""

import gc
from dataclasses import replace
from typing import Any

import numpy as np

from sec_lab.worlds.katana.bench import Bench, Eye, build
from sec_lab.worlds.katana.kinematics import joint_angles
from sec_lab.worlds.katana.paths import FINGER_RAD
from sec_lab.worlds.katana.records import Scene, View, pose_of


class Glance:
    """Keeps what was built for the last scene, and uses it again as long as only places, turns and cameras change.

    Examples
    --------
    >>> from sec_lab.worlds.katana import example_scene
    >>> Glance().at(example_scene("a")).image.shape
    (256, 320, 3)
    """

    def __init__(self) -> None:
        self._things: tuple[Any, ...] = ()
        self._built: tuple[Bench, Any, Any] | None = None

    def at(self, scene: Scene) -> View:
        """What the camera of a scene sees with the arm at home.

        Parameters
        ----------
        scene : Scene

        Raises
        ------
        UnreachableError
            If the arm cannot be at home.
        """
        from pydrake.math import RigidTransform

        q: Any = np.concatenate([joint_angles(scene.home_m), np.full(2, FINGER_RAD["ajar"])])
        bench, context, plant_context = self._bench_of(scene)
        for thing in scene.things:
            pose: Any = pose_of(thing)
            bench.plant.SetFreeBodyPose(plant_context, bench.plant.GetBodyByName(thing.name), RigidTransform(pose))
        bench.plant.SetPositions(plant_context, bench.plant.GetModelInstanceByName("katana"), q)
        eye = Eye(bench, scene.camera)
        return View(eye.colour(context), eye.depth(context), scene.camera)

    def _bench_of(self, scene: Scene) -> tuple[Bench, Any, Any]:
        things = tuple(replace(thing, p_W_m=(0.0, 0.0, 0.0), yaw_rad=0.0) for thing in scene.things)
        if self._built is None or things != self._things:
            if self._built is not None:
                # Drake's diagrams hang in cycles, and a renderer is large.
                self._built = None
                gc.collect()
            bench = build(scene)
            context = bench.diagram.CreateDefaultContext()
            self._things = things
            self._built = bench, context, bench.plant.GetMyMutableContextFromRoot(context)
        return self._built


def view(scene: Scene) -> View:
    """What the camera of a scene sees with the arm at home.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    UnreachableError
        If the arm cannot be at home.
    """
    return Glance().at(scene)
