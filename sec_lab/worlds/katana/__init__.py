"""The Katana's table (§2.10): an arm, coloured things, a camera with range finder, under real contact physics.

Scenes and kinematics need no simulator; :class:`Run`, :class:`Glance` and :func:`view` do, and load it when
they are used.
"""

from sec_lab.worlds.katana.cameras import camera_at, project
from sec_lab.worlds.katana.glance import Glance, view
from sec_lab.worlds.katana.kinematics import UnreachableError, check_reachable, hand_axes, joint_angles, tip_position
from sec_lab.worlds.katana.records import ARM, TABLE, Camera, Fault, Move, Scene, Thing, Truth, View
from sec_lab.worlds.katana.run import Run
from sec_lab.worlds.katana.scenes import example_scene, random_scene

__all__ = [
    "ARM",
    "TABLE",
    "Camera",
    "Fault",
    "Glance",
    "Move",
    "Run",
    "Scene",
    "Thing",
    "Truth",
    "UnreachableError",
    "View",
    "camera_at",
    "check_reachable",
    "example_scene",
    "hand_axes",
    "joint_angles",
    "project",
    "random_scene",
    "tip_position",
    "view",
]
