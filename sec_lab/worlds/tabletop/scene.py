"""Rendering with Drake: colour for both eyes, labels and depth for the left one."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.worlds.tabletop.camera import calibration, eye_poses
from sec_lab.worlds.tabletop.gltf import write_gltf
from sec_lab.worlds.tabletop.lights import spots, write_room
from sec_lab.worlds.tabletop.plan import TABLE, Plan, segment_names
from sec_lab.worlds.tabletop.shapes import Floats, Shape

if TYPE_CHECKING:
    from pydrake.geometry import (
        ColorRenderCamera,
        FrameId,
        GeometryId,
        PerceptionProperties,
        RenderCameraCore,
    )

_RENDERER = "vtk"
_NEAR_M, _FAR_M = 0.05, 6.0


@dataclass
class _Form:
    frame: "FrameId"
    geometry: "GeometryId"
    properties: "PerceptionProperties"
    shown: bool = False


class Stage:
    """The scene of a plan, ready to be looked at; made by :func:`stage`.

    Parameters
    ----------
    plan : Plan
    folder : Path
        Where the renderer finds the shapes.
    """

    def __init__(self, plan: Plan, folder: Path) -> None:
        from pydrake.geometry import (
            EnvironmentMap,
            EquirectangularMap,
            GeometryFrame,
            MakeRenderEngineVtk,
            RenderEngineVtkParams,
            SceneGraph,
        )

        self.plan = plan
        room = folder / "room.hdr"
        write_room(room, plan.lighting)
        surroundings = EnvironmentMap()
        surroundings.skybox = False
        surroundings.texture = EquirectangularMap(path=str(room))
        parameters = RenderEngineVtkParams(
            default_clear_color=[0.2, 0.2, 0.2],
            lights=spots(plan.lighting),
            environment_map=surroundings,
            exposure=1.0,
            cast_shadows=True,
            shadow_map_size=1024,
            force_to_pbr=True,
        )
        self._graph: SceneGraph = SceneGraph()
        self._graph.AddRenderer(_RENDERER, MakeRenderEngineVtk(parameters))
        self._source = self._graph.RegisterSource("tabletop")
        label_of = {name: label for label, name in segment_names(plan).items()}
        self._add(folder, "table", plan.table, TABLE, self._graph.world_frame_id())
        # The range of depths in the shadow maps follows from the box round all bodies. Without something high up it
        # ends below an arm that comes in from above, whose skin then gets patches of shadow.
        self._add(folder, "height", _marker(plan.table), TABLE, self._graph.world_frame_id())
        self._forms: list[list[_Form]] = []
        for number, actor in enumerate(plan.actors):
            forms = []
            for form, shape in enumerate(actor.forms):
                name = f"actor_{number}_{form}"
                frame = self._graph.RegisterFrame(self._source, GeometryFrame(name))
                forms.append(_Form(frame, *self._add(folder, name, shape, label_of[actor.name], frame)))
            self._forms.append(forms)
        self._context = self._graph.CreateDefaultContext()
        self._eyes = eye_poses(plan.camera)

    def pose(self, frame: int) -> None:
        """Put everything where it is at a frame."""
        from pydrake.geometry import FramePoseVector, Role
        from pydrake.math import RigidTransform

        poses = FramePoseVector()
        for actor, forms in zip(self.plan.actors, self._forms, strict=True):
            for number, form in enumerate(forms):
                wanted = bool(actor.form[frame] == number)
                # What is not there is not drawn: parked elsewhere it would cost time in every shadow map.
                if wanted and not form.shown:
                    self._graph.AssignRole(self._context, self._source, form.geometry, form.properties)
                elif form.shown and not wanted:
                    self._graph.RemoveRole(self._context, self._source, form.frame, Role.kPerception)
                form.shown = wanted
                poses.set_value(form.frame, RigidTransform(actor.X_WB[frame]))
        self._graph.get_source_pose_port(self._source).FixValue(self._context, poses)

    def colour(self, eye: int) -> NDArray[np.uint8]:
        """Picture of the left (0) or right (1) eye at twice its size: (2 height, 2 width, 3) uint8."""
        image = self._query().RenderColorImage(self._colour_camera(2), self._parent(), self._eye(eye))
        return np.array(image.data[..., :3])

    def labels(self) -> NDArray[np.uint8]:
        """Label of every pixel of the left eye: (height, width) uint8; 0 where there is nothing."""
        data = self._query().RenderLabelImage(self._colour_camera(1), self._parent(), self._eye(0)).data[..., 0]
        # The renderer's own labels (empty space) are the highest ones.
        return np.where(data < 256, data, 0).astype(np.uint8)

    def depth(self) -> NDArray[np.float32]:
        """Metres along the optical axis of the left eye: (height, width) float32; 0 where there is nothing."""
        from pydrake.geometry import DepthRange, DepthRenderCamera

        camera = DepthRenderCamera(self._core(1), DepthRange(_NEAR_M, _FAR_M))
        data = self._query().RenderDepthImage(camera, self._parent(), self._eye(0)).data[..., 0]
        return np.where(np.isfinite(data), data, 0).astype(np.float32)

    def _add(
        self, folder: Path, name: str, shape: Shape, label: int, frame: "FrameId"
    ) -> "tuple[GeometryId, PerceptionProperties]":
        from pydrake.geometry import GeometryInstance, Mesh, PerceptionProperties, RenderLabel
        from pydrake.math import RigidTransform

        instance = GeometryInstance(RigidTransform(), Mesh(write_gltf(folder, name, shape)), name)
        properties = PerceptionProperties()
        properties.AddProperty("label", "id", RenderLabel(label))
        if frame == self._graph.world_frame_id():
            instance.set_perception_properties(properties)
            return self._graph.RegisterAnchoredGeometry(self._source, instance), properties
        return self._graph.RegisterGeometry(self._source, frame, instance), properties

    def _query(self) -> Any:
        return self._graph.get_query_output_port().Eval(self._context)

    def _parent(self) -> "FrameId":
        return self._graph.world_frame_id()

    def _eye(self, eye: int) -> Any:
        from pydrake.math import RigidTransform

        pose: Any = self._eyes[eye]
        return RigidTransform(pose)

    def _core(self, scale: int) -> "RenderCameraCore":
        from pydrake.geometry import ClippingRange, RenderCameraCore
        from pydrake.math import RigidTransform
        from pydrake.systems.sensors import CameraInfo

        known = calibration(self.plan.camera)
        width, height = (scale * n for n in self.plan.camera.size_px)
        focal = scale * known.focal_length_px
        # Here pixel centres have whole coordinates; the renderer counts from the corner of the first pixel.
        column, row = (scale * (place + 0.5) for place in known.principal_point_px)
        info = CameraInfo(width=width, height=height, focal_x=focal, focal_y=focal, center_x=column, center_y=row)
        return RenderCameraCore(_RENDERER, info, ClippingRange(_NEAR_M, _FAR_M + 1), RigidTransform())

    def _colour_camera(self, scale: int) -> "ColorRenderCamera":
        from pydrake.geometry import ColorRenderCamera

        return ColorRenderCamera(self._core(scale), show_window=False)


@contextmanager
def stage(plan: Plan) -> Iterator[Stage]:
    """The scene of a plan while it is being rendered.

    Parameters
    ----------
    plan : Plan
    """
    with tempfile.TemporaryDirectory(prefix="sec_lab_") as folder:
        yield Stage(plan, Path(folder))


def _marker(table: Shape) -> Shape:
    """A crumb that no camera sees, behind it and above it."""
    corners = np.array([(0.0, -1.05, 1.0), (0.01, -1.05, 1.0), (0.0, -1.04, 1.0)])
    return Shape(corners, np.array([(0, 1, 2)]), np.zeros((3, 2)), table.texture, table.roughness)


def far_table(texture: NDArray[np.uint8], *, half_m: float = 1.1, turn: float = 0.0, roughness: float = 0.9) -> Shape:
    """Table top, larger than what the camera sees; the columns of the texture run along y if it is not turned."""
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    cosine, sine = np.cos(turn), np.sin(turn)
    turned: Floats = half_m * corners @ np.array([[cosine, sine], [-sine, cosine]])
    vertices = np.concatenate([turned, np.zeros((4, 1))], axis=1)
    return Shape(vertices, np.array([(0, 1, 2), (0, 2, 3)]), (corners + 1) / 2, texture, roughness)
