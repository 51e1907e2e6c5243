"""The bench: arm, table and things as a Drake diagram with contact physics and a renderer."""

from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.worlds.katana.kinematics import JOINTS
from sec_lab.worlds.katana.records import ARM, TABLE, Camera, Scene, Thing

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, SceneGraph
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.systems.framework import Diagram

STEP_S = 0.004
FINGERS = ("r_finger", "l_finger")
TIP_BODIES = ("gripper", *FINGERS)
"""What has the colour of the tip."""

_RENDERER = "vtk"
_LIGHTS = (((0.6, -0.5, 1.6), 0.55), ((1.4, 0.9, 0.7), 0.4), ((0.6, -1.5, 0.6), 0.3), ((-1.0, 0.6, 0.8), 0.3))
"""Places and strengths: from all sides, so that no side of a thing is black."""
_NEAR_M, _FAR_M = 0.05, 4.0
_TABLE_SIZE_M, _TABLE_MIDDLE_M = (1.6, 1.7, 0.03), (0.25, 0.0, -0.015)
_TABLE_COLOUR = (0.62, 0.62, 0.60, 1.0)
_BACKGROUND = (0.10, 0.10, 0.11)
_DENSITY_KG_M3 = 450.0
# Of wood on a cloth, of wood on wood or rubber.
_TABLE_FRICTION, _THING_FRICTION = 0.35, 0.5
_GAINS = {"pan": (900.0, 50.0), "lift_2": (1500.0, 90.0), "lift_3": (900.0, 50.0), "lift_4": (400.0, 20.0)}
_ROLL_GAINS, _FINGER_GAINS = (60.0, 3.0), (12.0, 0.6)
_BALL_N_M = 5e3
# What stops a ball that nobody pushes any more: the cloth of the table, which the contact model does not know.
_ROLLING_N_M_S, _LEAST_ROLLING = 4e-3, 1e-6


@dataclass(frozen=True, eq=False)
class Bench:
    """What was built, and how its parts are found again; made by :func:`build`.

    Parameters
    ----------
    diagram : Diagram
    plant : MultibodyPlant
    graph : SceneGraph
    owner_of : dict of int to str
        Name of the thing, the tip or the table that a body belongs to, by body index; other parts of the arm are left
        out.
    arm : MultibodyPlant
        The arm alone, for its inverse dynamics.
    gear : MultibodyConstraintId
        Of the gripper's one motor, which turns both fingers alike.
    """

    diagram: "Diagram"
    plant: "MultibodyPlant"
    graph: "SceneGraph"
    owner_of: dict[int, str]
    arm: "MultibodyPlant"
    gear: Any


def build(scene: Scene, *, meshcat: "Meshcat | None" = None, render: bool = True) -> Bench:
    """The diagram of a scene, every thing and the arm a part of one plant.

    Parameters
    ----------
    scene : Scene
    meshcat : Meshcat, optional
        Shows it in a browser.
    render : bool, optional
        Whether it can be looked at.
    """
    from pydrake.geometry import MeshcatVisualizer
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, DiscreteContactApproximation
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, graph = AddMultibodyPlantSceneGraph(builder, time_step=STEP_S)
    plant.set_contact_model(ContactModel.kHydroelasticWithFallback)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    _add_arm(plant)
    _add_table(plant)
    owner_of = {int(plant.world_body().index()): TABLE}
    owner_of |= {int(plant.GetBodyByName(name).index()): ARM for name in TIP_BODIES}
    for thing in scene.things:
        owner_of[_add_thing(plant, thing)] = thing.name
    gear = plant.AddCouplerConstraint(*(plant.GetJointByName(name) for name in FINGERS), gear_ratio=1.0)
    if render:
        graph.AddRenderer(_RENDERER, _renderer())
    plant.Finalize()
    for name, gains in zip(
        (*JOINTS, *FINGERS), (*_GAINS.values(), _ROLL_GAINS, _FINGER_GAINS, _FINGER_GAINS), strict=True
    ):
        plant.get_joint_actuator(plant.GetJointActuatorByName(name).index()).set_controller_gains(_pd(*gains))
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder, graph, meshcat)
    _let_arm_alone(plant, graph)
    return Bench(builder.Build(), plant, graph, owner_of, arm_alone(), gear)


class Eye:
    """Looks at a bench through a camera."""

    def __init__(self, bench: Bench, camera: Camera) -> None:
        from pydrake.geometry import ClippingRange, ColorRenderCamera, DepthRange, DepthRenderCamera, RenderCameraCore
        from pydrake.math import RigidTransform
        from pydrake.systems.sensors import CameraInfo

        self._bench = bench
        info = CameraInfo(
            camera.width, camera.height, camera.focal_px, camera.focal_px, camera.width / 2, camera.height / 2
        )
        core = RenderCameraCore(_RENDERER, info, ClippingRange(_NEAR_M, _FAR_M), RigidTransform())
        self._colour = ColorRenderCamera(core, show_window=False)
        self._range = DepthRenderCamera(core, DepthRange(_NEAR_M, _FAR_M - 0.1))
        pose: Any = camera.X_WC
        self._pose = RigidTransform(pose)
        names = sorted(set(bench.owner_of.values()) - {TABLE, ARM})
        label_of = {name: label for label, name in enumerate((TABLE, ARM, *names), start=1)}
        self.names = {0: "background"} | {label: name for name, label in label_of.items()}
        self._label_of_body = np.zeros(1 << 16, dtype=np.uint8)
        for body, name in bench.owner_of.items():
            self._label_of_body[body] = label_of[name]

    def colour(self, context: Any) -> NDArray[np.uint8]:
        """(height, width, 3) uint8."""
        return np.array(self._query(context).RenderColorImage(self._colour, self._world(), self._pose).data[..., :3])

    def depth(self, context: Any) -> NDArray[np.float32]:
        """Metres along the axis, (height, width) float32; 0 where nothing is near enough."""
        data = self._query(context).RenderDepthImage(self._range, self._world(), self._pose).data[..., 0]
        # The range finder counts in tenths of millimetres.
        return np.round(np.where(np.isfinite(data), data, 0) * 10_000).astype(np.float32) / np.float32(10_000)

    def labels(self, context: Any) -> NDArray[np.uint8]:
        """(height, width) uint8; see ``names``."""
        data = self._query(context).RenderLabelImage(self._colour, self._world(), self._pose).data[..., 0]
        return self._label_of_body[np.asarray(data).astype(np.uint16)]

    def _query(self, context: Any) -> Any:
        return self._bench.graph.get_query_output_port().Eval(self._bench.graph.GetMyContextFromRoot(context))

    def _world(self) -> Any:
        return self._bench.graph.world_frame_id()


def _add_arm(plant: "MultibodyPlant") -> None:
    from pydrake.multibody.parsing import Parser

    text = (files("sec_lab.worlds.katana") / "katana.urdf").read_text()
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))


def arm_alone() -> "MultibodyPlant":
    """The arm without table and things."""
    from pydrake.multibody.plant import MultibodyPlant

    arm = MultibodyPlant(time_step=0.0)
    _add_arm(arm)
    arm.Finalize()
    return arm


def _add_table(plant: "MultibodyPlant") -> None:
    from pydrake.geometry import AddContactMaterial, AddRigidHydroelasticProperties, Box, ProximityProperties
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import CoulombFriction

    properties = ProximityProperties()
    AddRigidHydroelasticProperties(resolution_hint=2.0, properties=properties)
    AddContactMaterial(
        dissipation=20.0, friction=CoulombFriction(_TABLE_FRICTION, _TABLE_FRICTION), properties=properties
    )
    world = plant.world_body()
    middle: Any = np.array(_TABLE_MIDDLE_M)
    plant.RegisterCollisionGeometry(world, RigidTransform(middle), Box(*_TABLE_SIZE_M), "table_top", properties)
    colour: Any = np.array(_TABLE_COLOUR)
    plant.RegisterVisualGeometry(world, RigidTransform(middle), Box(*_TABLE_SIZE_M), "table_top", colour)


def _add_thing(plant: "MultibodyPlant", thing: Thing) -> int:
    from pydrake.geometry import AddCompliantHydroelasticProperties, AddContactMaterial, ProximityProperties
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import CoulombFriction
    from pydrake.multibody.tree import QuaternionFloatingJoint, default_model_instance

    shape, inertia = _shape_and_inertia(thing)
    body = plant.AddRigidBody(thing.name, default_model_instance(), inertia)
    properties = ProximityProperties()
    friction = CoulombFriction(_THING_FRICTION, _THING_FRICTION)
    if thing.shape == "sphere":
        # The mesh of an elastic ball has flat sides, on which it would come to rest; contact at a point keeps it round.
        AddContactMaterial(dissipation=20.0, point_stiffness=_BALL_N_M, friction=friction, properties=properties)
    else:
        AddCompliantHydroelasticProperties(
            resolution_hint=thing.size_m[0] / 3, hydroelastic_modulus=1e7, properties=properties
        )
        AddContactMaterial(dissipation=20.0, friction=friction, properties=properties)
    plant.RegisterCollisionGeometry(body, RigidTransform(), shape, thing.name, properties)
    colour: Any = np.array([*(part / 255 for part in thing.colour), 1.0])
    plant.RegisterVisualGeometry(body, RigidTransform(), shape, thing.name, colour)
    damping = _ROLLING_N_M_S if thing.shape == "sphere" else _LEAST_ROLLING
    plant.AddJoint(
        QuaternionFloatingJoint(f"{thing.name} floats", plant.world_frame(), body.body_frame(), damping, 0.0)
    )
    return int(body.index())


def _shape_and_inertia(thing: Thing) -> tuple[Any, Any]:
    from pydrake.common import MemoryFile
    from pydrake.geometry import Box, Convex, InMemoryMesh, Sphere
    from pydrake.multibody.tree import SpatialInertia, UnitInertia

    width, depth, height = thing.size_m
    if thing.shape == "box":
        return Box(width, depth, height), SpatialInertia.SolidBoxWithDensity(_DENSITY_KG_M3, width, depth, height)
    if thing.shape == "sphere":
        return Sphere(width / 2), SpatialInertia.SolidSphereWithDensity(_DENSITY_KG_M3, width / 2)
    import trimesh

    # trimesh's cone stands on the origin; ours has its middle there. Its mass lies a quarter of the height up.
    cone = trimesh.creation.cone(radius=width / 2, height=height, sections=32)
    cone.apply_translation((0, 0, -height / 2))
    mesh = Convex(InMemoryMesh(mesh_file=MemoryFile(str(cone.export(file_type="obj")), ".obj", "cone")))
    mass = _DENSITY_KG_M3 * np.pi * (width / 2) ** 2 * height / 3
    low: Any = np.array([0.0, 0.0, -height / 4])
    across, along = 3 / 80 * (width**2 + height**2), 3 / 40 * width**2
    # Moments about the origin: those about the middle of the mass and what its distance adds.
    moments = across + (height / 4) ** 2
    return mesh, SpatialInertia(mass, low, UnitInertia(moments, moments, along))


def _let_arm_alone(plant: "MultibodyPlant", graph: "SceneGraph") -> None:
    """Parts of the arm never touch each other: its joints' limits see to that, not its contacts."""
    from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

    parts = [
        geometry
        for body in map(plant.get_body, plant.GetBodyIndices(plant.GetModelInstanceByName("katana")))
        for geometry in plant.GetCollisionGeometriesForBody(body)
        if body.name() not in FINGERS
    ]
    fingers = [[*plant.GetCollisionGeometriesForBody(plant.GetBodyByName(name))] for name in FINGERS]
    manager = graph.collision_filter_manager()
    manager.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet([*parts, *fingers[0]])))
    manager.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet([*parts, *fingers[1]])))
    manager.Apply(CollisionFilterDeclaration().ExcludeBetween(GeometrySet(fingers[0]), GeometrySet(fingers[1])))


def _pd(p: float, d: float) -> Any:
    from pydrake.multibody.tree import PdControllerGains

    return PdControllerGains(p=p, d=d)


def _renderer() -> Any:
    from pydrake.geometry import LightParameter, MakeRenderEngineVtk, RenderEngineVtkParams, Rgba

    lights = []
    for position, intensity in _LIGHTS:
        light = LightParameter()
        light.type = "directional"
        light.frame = "world"
        light.color = Rgba(1, 1, 1)
        light.intensity = intensity
        where: Any = np.array(position)
        towards: Any = (np.array((0.3, 0, 0)) - where) / np.linalg.norm(np.array((0.3, 0, 0)) - where)
        light.position, light.direction = where, towards
        lights.append(light)
    clear: Any = np.array(_BACKGROUND)
    return MakeRenderEngineVtk(RenderEngineVtkParams(default_clear_color=clear, lights=lights, cast_shadows=False))
