"""A scene in motion: the arm makes one move after another while the camera films."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.recording import Frame, Recording
from sec_lab.worlds.katana.bench import STEP_S, Bench, Eye, build
from sec_lab.worlds.katana.film import Film
from sec_lab.worlds.katana.inverse import solved_joint_angles
from sec_lab.worlds.katana.kinematics import UnreachableError, hand_axes, joint_angles, tip_position
from sec_lab.worlds.katana.paths import FINGER_RAD, LOW_M, Path, path_of
from sec_lab.worlds.katana.records import ARM, TABLE, Fault, Floats, Gripper, Move, Scene, Truth, View, pose_of

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat
    from pydrake.systems.framework import Diagram

FRAMES_PER_SECOND = 20.0
_STEPS_A_FRAME = round(1 / FRAMES_PER_SECOND / STEP_S)
_REST_S = 0.4
_AGREEMENT_RAD = 1e-3
_HAIR_M = 0.0005
_FAR_AWAY_M = (3.0, 0.0, -2.0)
_SLIP_M, _SLIP_WEIGHTS = 0.06, 2.0
"""How far, and with how many times its weight, a thing is drawn aside; it slides on from there."""
_LOSES_HOLD_STEPS = 50


@dataclass(frozen=True, eq=False)
class _Moment:
    contacts: frozenset[tuple[str, str]]
    joints: Floats
    tip: Floats
    wanted: Floats
    poses: dict[str, Floats]


class Run:
    """A scene with its arm at the start; :meth:`move` moves it.

    Same scene, same moves: the same frames.

    Parameters
    ----------
    scene : Scene
    fault : Fault, optional
        What goes wrong.
    labels : bool, optional
        Whether the truth has label pictures.
    gripper : {"open", "ajar", "closed"}, optional
        At the start.
    film : bool, optional
        Without it nothing is rendered, and there is truth only.
    watched : bool, optional
        Whether somebody takes the frames while it runs, by :meth:`frames_since`.
    meshcat : Meshcat, optional
        Shows and records it.
    before_move : callable, optional
        Is told every move before it is made; what it raises ends the run between two moves.

    Raises
    ------
    UnreachableError
        If the arm cannot be at the start.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        fault: Fault | None = None,
        labels: bool = False,
        gripper: Gripper = "ajar",
        film: bool = True,
        watched: bool = False,
        meshcat: "Meshcat | None" = None,
        before_move: Callable[[Move], object] | None = None,
    ) -> None:
        from pydrake.systems.analysis import Simulator

        self._start = scene
        self._q = np.concatenate([joint_angles(scene.start_m), np.full(2, FINGER_RAD[gripper])])
        if fault is not None:
            for name in (fault.thing, fault.instead_of):
                if name is not None:
                    scene.thing(name)
        self._bench: Bench = build(scene, meshcat=meshcat, render=film)
        self._context = self._bench.diagram.CreateDefaultContext()
        self._arm_context = self._bench.arm.CreateDefaultContext()
        plant = self._bench.plant
        self._plant_context = plant.GetMyMutableContextFromRoot(self._context)
        self._katana = plant.GetModelInstanceByName("katana")
        for thing in scene.things:
            self._place(thing.name, pose_of(thing))
        q: Any = self._q
        plant.SetPositions(self._plant_context, self._katana, q)
        # Until the gripper is told to move, each finger is held where it is: by what holds it, not by the gear.
        plant.SetConstraintActiveStatus(self._plant_context, self._bench.gear, status=False)
        self._simulator = Simulator(self._bench.diagram, self._context)
        self._eye = Eye(self._bench, scene.camera) if film else None
        self._film = Film((scene.camera.height, scene.camera.width), FRAMES_PER_SECOND, keep=watched)
        self._labels = labels and film
        self._owner_of_geometry = _owners(self._bench)
        inspector = self._bench.graph.model_inspector()
        parts = [
            (geometry, name)
            for geometry, name in self._owner_of_geometry.items()
            # The fingers' pads lie on the fingers: what touches them presses on them.
            if name != TABLE and "pad_" not in inspector.GetName(geometry)
        ]
        self._pairs = [
            (one, other)
            for place, (one, name) in enumerate(parts)
            for other, other_name in parts[place + 1 :]
            if name != other_name
        ]
        self._fault: Fault | None = fault
        self._has_failed = False
        self._before_move = before_move
        self._drawn: tuple[str, Floats] | None = None
        self._wanted: Floats | None = None
        self._offset = np.zeros(3)
        self._was_low = False
        self._moments: list[_Moment] = []
        self._steps = 0
        self.move_ends: list[int] = []
        self._command(self._q, np.zeros(7), np.zeros(7))
        self._simulator.Initialize()
        self._look()

    @property
    def recording(self) -> Recording:
        """What was filmed so far."""
        return self._film.recording()

    @property
    def tip_m(self) -> tuple[float, float, float]:
        """Where the tip is, from the joints' own sensors."""
        x, y, z = tip_position(self._measured()[:5])
        return float(x), float(y), float(z)

    @property
    def time_s(self) -> float:
        """Simulated time so far."""
        return self._steps * STEP_S

    @property
    def scene(self) -> Scene:
        """The scene with every thing where it is now (truth); a thing that was taken away is left out."""
        poses = self._poses()
        things = []
        for thing in self._start.things:
            pose = poses[thing.name]
            if pose[2, 3] > -1:
                x, y, z = (float(value) for value in pose[:3, 3])
                yaw = float(np.arctan2(pose[1, 0], pose[0, 0]))
                things.append(replace(thing, p_W_m=(x, y, z), yaw_rad=yaw))
        return replace(self._start, things=tuple(things))

    @property
    def truth(self) -> Truth:
        """What was true in the recording so far."""
        names = sorted([ARM, TABLE, *(thing.name for thing in self._start.things)])
        pairs = [(one, other) for place, one in enumerate(names) for other in names[place + 1 :]]
        return Truth(
            {pair: np.array([pair in moment.contacts for moment in self._moments]) for pair in pairs},
            np.array([moment.tip for moment in self._moments]),
            np.array([moment.wanted for moment in self._moments]),
            {
                thing.name: np.array([moment.poses[thing.name] for moment in self._moments])
                for thing in self._start.things
            },
            self._film.labels() if self._labels else None,
            {} if self._eye is None else self._eye.names,
            np.array([moment.joints for moment in self._moments]),
        )

    @property
    def n_frames(self) -> int:
        """Frames so far."""
        return len(self._film)

    def frames_since(self, first: int) -> tuple[Frame, ...]:
        """Frames from a number on, without unpacking those before.

        Parameters
        ----------
        first : int
            Not below that of the last call: each picture is handed out once.
        """
        return self._film.latest(first)

    def view(self) -> View:
        """What the camera sees now."""
        if self._eye is None:
            raise ValueError("film: expected a run with one, got none")
        return View(self._eye.colour(self._context), self._eye.depth(self._context), self._start.camera)

    def check(self, *moves: Move) -> None:
        """Nothing if the arm can make all moves, one after the other, from where it is now; the reason otherwise.

        Parameters
        ----------
        *moves : Move

        Raises
        ------
        UnreachableError
            It names the move.
        """
        q = self._q
        for number, move in enumerate(moves):
            try:
                path = path_of(q, move, step_s=STEP_S).q_rad
            except UnreachableError as error:
                raise UnreachableError(f"move {number} ({move.name}): {error}") from error
            q = path[-1] if len(path) else q

    def tips_since(self, first: int) -> tuple[Floats, ...]:
        """Where the joints' own sensors said that the tip was, frame by frame from a number on; (3,) float64 each.

        Parameters
        ----------
        first : int
        """
        return tuple(moment.tip for moment in self._moments[first:])

    def joints_since(self, first: int) -> tuple[Floats, ...]:
        """What the joints' own sensors said, frame by frame from a number on; (7,) float64 each, the fingers last.

        Parameters
        ----------
        first : int
        """
        return tuple(moment.joints for moment in self._moments[first:])

    @property
    def diagram(self) -> "Diagram":
        """What is simulated."""
        return self._bench.diagram

    @property
    def has_failed(self) -> bool:
        """Whether what goes wrong has begun to (truth)."""
        return self._fault is not None and self._has_failed

    def move(self, move: Move) -> None:
        """Make one move, filming, and rest a little.

        Parameters
        ----------
        move : Move

        Raises
        ------
        UnreachableError
            Before anything moves.
        """
        if self._before_move is not None:
            self._before_move(move)
        armed = self._fault is not None and not self._has_failed
        fault = self._fault if armed and self._fault is not None and self._fault.move == move.name else None
        offset = self._offset if fault is None else self._offset + self._error(fault)
        # The arm's own errors are those of one visit to the table.
        if offset.any() and self._was_low and move.to_m[2] >= LOW_M:
            offset = np.zeros(3)
        x, y, z = (float(value) for value in np.asarray(move.to_m) + offset)
        path = self._path(replace(move, to_m=(x, y, z)))
        self._offset = offset
        self._was_low = move.to_m[2] < LOW_M and bool(offset.any())
        if move.gripper is not None:
            self._bench.plant.SetConstraintActiveStatus(self._plant_context, self._bench.gear, status=True)
        if fault is not None:
            self._has_failed = True
        self._follow(path, fault)
        self.move_ends.append(len(self._moments) - 1)

    def rest(self, seconds: float) -> None:
        """Stand still for a while, filming."""
        n = max(round(seconds / STEP_S), 0)
        tip = tip_position(self._q[:5])
        self._follow(Path(np.repeat(self._q[None], n, axis=0), np.repeat(tip[None], n, axis=0), 0), None)

    def _path(self, move: Move) -> Path:
        """Path in closed form, its end confirmed by the solver, which knows the arm from its description only."""
        path = path_of(self._q, move, step_s=STEP_S)
        if path.n_motion:
            end = path.q_rad[path.n_motion - 1, :5]
            near = path.q_rad[3 * path.n_motion // 4, :5]
            solved = solved_joint_angles(path.tip_m[path.n_motion - 1], *hand_axes(end), guess_rad=near)
            if np.abs(solved - end).max() > _AGREEMENT_RAD:
                raise UnreachableError(f"{move.to_m} m: closed form and solver disagree: {end} and {solved} rad")
        return path

    def _follow(self, path: Path, fault: Fault | None) -> None:
        n = len(path.q_rad)
        if n == 0:
            return
        rest = round(_REST_S / STEP_S) if path.n_motion else 0
        # Frames come at even steps, so a move ends on one.
        rest += -(self._steps + n + rest) % _STEPS_A_FRAME
        q = np.concatenate([self._q[None], path.q_rad, np.repeat(path.q_rad[-1:], rest, axis=0)])
        tips = np.concatenate([path.tip_m, np.repeat(path.tip_m[-1:], rest, axis=0)])
        v = np.gradient(q, STEP_S, axis=0)
        a = np.gradient(v, STEP_S, axis=0)
        at = -1 if fault is None else int(fault.share * max(path.n_motion - 1, 0))
        if fault is not None and fault.kind == "drops":
            # The gear does not hold them either.
            self._bench.plant.SetConstraintActiveStatus(self._plant_context, self._bench.gear, status=True)
            share = np.clip(np.arange(len(q) - at - 1) / _LOSES_HOLD_STEPS, 0, 1)[:, None]
            q[at + 1 :, 5:] = (1 - share) * q[at, 5:] + share * FINGER_RAD["open"]
            path.q_rad[at:, 5:] = q[at + 1 :][: len(path.q_rad) - at, 5:]
        for step in range(1, len(q)):
            if step - 1 == at:
                assert fault is not None
                self._strike(fault, path)
            self._command(q[step], v[step], a[step])
            self._steps += 1
            self._simulator.AdvanceTo(self._steps * STEP_S)
            if self._drawn is not None:
                name, place = self._drawn
                if np.linalg.norm(self._poses()[name][:2, 3] - place) > _SLIP_M:
                    self._push_thing(None, np.zeros(3))
            if self._steps % _STEPS_A_FRAME == 0:
                self._wanted = tips[step - 1]
                self._look()
        self._q = path.q_rad[-1].copy()

    def _command(self, q: Any, v: Any, a: Any) -> None:
        """Wanted angles for the joints' own control, and the torques that carry the arm and make it move."""
        arm, context = self._bench.arm, self._arm_context
        arm.SetPositions(context, q)
        arm.SetVelocities(context, v)
        from pydrake.multibody.tree import MultibodyForces

        forces = MultibodyForces(arm)
        arm.CalcForceElementsContribution(context, forces)
        torque = arm.CalcInverseDynamics(context, a, forces)
        # The fingers hold what they hold with what their motors have; nothing is known of its weight.
        torque[5:] = 0
        plant = self._bench.plant
        plant.get_desired_state_input_port(self._katana).FixValue(self._plant_context, np.concatenate([q, v]))
        plant.get_actuation_input_port().FixValue(self._plant_context, torque)

    def _measured(self) -> Floats:
        return np.array(self._bench.plant.GetPositions(self._plant_context, self._katana))

    def _look(self) -> None:
        if self._eye is not None:
            labels = self._eye.labels(self._context) if self._labels else None
            self._film.add(self._eye.colour(self._context), self._eye.depth(self._context), labels)
        joints = self._measured()
        tip = tip_position(joints[:5])
        wanted = tip_position(self._q[:5]) if self._wanted is None else self._wanted
        self._moments.append(_Moment(self._touching(), joints, tip, wanted, self._poses()))

    def _poses(self) -> dict[str, Floats]:
        plant = self._bench.plant
        return {
            thing.name: np.asarray(
                plant.EvalBodyPoseInWorld(self._plant_context, plant.GetBodyByName(thing.name)).GetAsMatrix4()
            )
            for thing in self._start.things
        }

    def _touching(self) -> frozenset[tuple[str, str]]:
        results: Any = self._bench.plant.get_contact_results_output_port().Eval(self._plant_context)
        geometries = []
        for number in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(number).point_pair()
            geometries.append((pair.id_A, pair.id_B))
        for number in range(results.num_hydroelastic_contacts()):
            surface = results.hydroelastic_contact_info(number).contact_surface()
            geometries.append((surface.id_M(), surface.id_N()))
        owner = self._owner_of_geometry
        graph = self._bench.graph
        query: Any = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(self._context))
        # What a thing was pushed against springs back by less than a hair, and still touches.
        for one, other in self._pairs:
            if query.ComputeSignedDistancePairClosestPoints(one, other).distance <= _HAIR_M:
                geometries.append((one, other))
        found = set()
        for one, other in geometries:
            if one in owner and other in owner and owner[one] != owner[other]:
                low, high = sorted((owner[one], owner[other]))
                found.add((low, high))
        return frozenset(found)

    def _error(self, fault: Fault) -> Floats:
        if fault.kind == "missed":
            return np.array([*fault.offset_m, 0.0])
        if fault.kind == "wrong object":
            poses = self._poses()
            error = poses[str(fault.thing)][:3, 3] - poses[str(fault.instead_of)][:3, 3]
            return np.array([error[0], error[1], 0.0])
        return np.zeros(3)

    def _strike(self, fault: Fault, path: Path) -> None:
        if fault.kind == "removed":
            away = np.eye(4)
            away[:3, 3] = _FAR_AWAY_M
            self._place(str(fault.thing), away)
            # Nothing holds it there; nobody looks where it falls.
        elif fault.kind == "springs back":
            pose = self._poses()[str(fault.thing)].copy()
            pose[:2, 3] += fault.offset_m
            self._place(str(fault.thing), pose)
        elif fault.kind == "slips":
            way = path.tip_m[-1] - path.tip_m[0]
            length = np.hypot(way[0], way[1])
            aside = np.array([-way[1], way[0], 0.0]) / length if length > 0 else np.array([0.0, 1.0, 0.0])
            body = self._bench.plant.GetBodyByName(str(fault.thing))
            weight = 9.81 * body.default_mass()
            self._push_thing(str(fault.thing), _SLIP_WEIGHTS * weight * aside)
            self._drawn = str(fault.thing), self._poses()[str(fault.thing)][:2, 3].copy()

    def _push_thing(self, name: str | None, force_n: NDArray[np.float64]) -> None:
        from pydrake.multibody.math import SpatialForce
        from pydrake.multibody.plant import ExternallyAppliedSpatialForce

        self._drawn = None
        forces = []
        if name is not None:
            applied = ExternallyAppliedSpatialForce()
            applied.body_index = self._bench.plant.GetBodyByName(name).index()
            nothing: Any = np.zeros(3)
            force: Any = force_n
            applied.p_BoBq_B = nothing
            applied.F_Bq_W = SpatialForce(tau=nothing, f=force)
            forces.append(applied)
        port: Any = self._bench.plant.get_applied_spatial_force_input_port()
        port.FixValue(self._plant_context, forces)

    def _place(self, name: str, pose: Floats) -> None:
        from pydrake.math import RigidTransform
        from pydrake.multibody.math import SpatialVelocity

        body = self._bench.plant.GetBodyByName(name)
        X_WB: Any = pose
        self._bench.plant.SetFreeBodyPose(self._plant_context, body, RigidTransform(X_WB))
        nothing: Any = np.zeros(6)
        self._bench.plant.SetFreeBodySpatialVelocity(self._plant_context, body, SpatialVelocity(nothing))


def _owners(bench: Bench) -> dict[Any, str]:
    return {
        geometry: name
        for body, name in bench.owner_of.items()
        for geometry in bench.plant.GetCollisionGeometriesForBody(bench.plant.get_body(_index(body)))
    }


def _index(body: int) -> Any:
    from pydrake.multibody.tree import BodyIndex

    return BodyIndex(body)
