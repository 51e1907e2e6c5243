"""*Putting an object on a plate*, *Taking an object from a plate*, and movies that mix both (§2.9, Fig. 2.9, 2.11).

In *Putting* a hand comes, puts a thing that lay on the table on a plate, and leaves; in *Taking* it comes, takes a
thing from a plate, and leaves with it. Otherwise the versions have little in common. The mixed movies are those of Fig.
2.11 (a) to (e). Were what is taken from the plate laid on the table, both actions would be one to an event chain: a
thing leaves one of two others and gets to the other one, and the table is a segment like the plate.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from sec_lab.worlds.tabletop import objects, textures
from sec_lab.worlds.tabletop.camera import Camera
from sec_lab.worlds.tabletop.deeds import Deed
from sec_lab.worlds.tabletop.plan import Actor, carried, pose, still
from sec_lab.worlds.tabletop.reach import Act, HandStyle, Timeline, behind, frames_at, hand_actor, varied
from sec_lab.worlds.tabletop.settings import Setting, camera_of
from sec_lab.worlds.tabletop.shapes import Floats
from sec_lab.worlds.tabletop.things import Thing, plate_of, thing_of

PutOrTake = Literal["putting", "taking", "mixed"]
Place = tuple[float, float]
Side = Literal["left", "right"]
_FLOOR_M = objects.PLATE_FLOOR_M


@dataclass(frozen=True)
class _Single:
    """One thing, one plate, one hand.

    In *Putting* ``place`` is where the thing lies at first, in *Taking* a place over which the hand leaves with it.
    """

    thing: str
    size_m: tuple[float, float]
    plate_m: tuple[float, float]
    place: Place
    plate_at: Place
    yaw_deg: float
    turn_deg: float
    hand: Side
    speed: float
    lift_m: float
    sway_m: float
    look: int
    turned_deg: float


@dataclass(frozen=True)
class _View:
    """From where a mixed movie is seen, and what it looks like."""

    look: int
    turned_deg: float
    distance_m: float


_PUTTING = (
    _Single("orange", (0.036, 0), (0.100, 0.016), (0.16, -0.05), (-0.05, 0.06),
            158, 8, "right", 1.0, 0.08, 0.0, 1, 0),
    _Single("red apple", (0.041, 0), (0.115, 0.018), (0.16, 0.08), (-0.05, 0.02),
            172, -8, "right", 1.3, 0.12, 0.03, 2, 4),
    _Single("rye bread", (0.046, 0.022), (0.118, 0.014), (-0.14, -0.05), (0.07, 0.05),
            20, 8, "left", 0.9, 0.06, -0.03, 3, -6),
    _Single("cheese", (0.038, 0.020), (0.106, 0.015), (0.14, -0.04), (-0.06, 0.03),
            -62, 8, "left", 1.15, 0.14, 0.0, 4, 2),
    _Single("green apple", (0.038, 0), (0.112, 0.017), (-0.14, 0.10), (0.07, 0.01),
            6, 10, "left", 1.2, 0.06, 0.04, 1, 14),
    _Single("box", (0.054, 0.044), (0.120, 0.014), (-0.08, -0.08), (0.03, 0.10),
            -6, -8, "left", 0.85, 0.10, -0.05, 2, -14),
    _Single("cup", (0.034, 0.060), (0.110, 0.016), (0.00, 0.15), (0.02, -0.05),
            176, -6, "right", 1.1, 0.09, 0.06, 3, 8),
    _Single("salami", (0.042, 0.018), (0.114, 0.015), (0.17, -0.02), (-0.04, 0.05),
            150, 10, "right", 1.35, 0.05, 0.0, 4, -10),
    _Single("lemon", (0.034, 0), (0.104, 0.016), (-0.13, 0.11), (0.06, 0.02),
            -36, 12, "left", 0.95, 0.11, -0.04, 1, -8),
    _Single("red apple", (0.037, 0), (0.108, 0.018), (0.15, 0.12), (-0.05, 0.03),
            -142, -9, "right", 1.05, 0.16, 0.02, 3, 10),
)  # fmt: skip
_TAKING = (
    _Single("red apple", (0.040, 0), (0.110, 0.016), (0.16, -0.05), (-0.05, 0.05),
            166, -8, "right", 1.1, 0.10, 0.02, 2, -4),
    _Single("cheese", (0.040, 0.019), (0.112, 0.015), (0.17, 0.07), (-0.04, 0.03),
            168, 6, "right", 0.9, 0.07, 0.0, 1, 8),
    _Single("orange", (0.037, 0), (0.104, 0.017), (-0.12, 0.11), (0.06, 0.04),
            14, -6, "left", 1.2, 0.13, -0.04, 3, 0),
    _Single("cup", (0.035, 0.056), (0.114, 0.015), (-0.13, 0.10), (0.06, 0.02),
            12, -10, "left", 1.0, 0.08, 0.05, 4, 6),
    _Single("rye bread", (0.044, 0.023), (0.120, 0.014), (0.02, 0.16), (0.00, -0.04),
            178, -7, "right", 1.2, 0.10, 0.03, 1, -12),
    _Single("lemon", (0.035, 0), (0.106, 0.016), (-0.03, 0.16), (0.03, -0.04),
            -34, 9, "left", 0.85, 0.12, 0.0, 2, 10),
    _Single("green apple", (0.039, 0), (0.116, 0.018), (0.04, -0.10), (0.00, 0.10),
            172, 9, "right", 1.2, 0.15, -0.03, 3, -9),
    _Single("box", (0.046, 0.044), (0.118, 0.014), (0.16, 0.10), (-0.05, 0.02),
            -150, -8, "right", 1.05, 0.09, 0.04, 4, -3),
    _Single("orange", (0.034, 0), (0.108, 0.015), (-0.09, -0.08), (0.02, 0.10),
            -4, 7, "left", 0.95, 0.06, -0.06, 2, 12),
    _Single("salami", (0.041, 0.020), (0.112, 0.016), (-0.14, 0.12), (0.06, 0.03),
            -30, -9, "left", 1.15, 0.11, 0.02, 1, 3),
)  # fmt: skip
_MIXED = (
    _View(1, 6, 0.88),
    _View(3, -8, 0.90),
    _View(2, 4, 0.86),
    _View(4, -4, 0.94),
    _View(1, 0, 0.96),
)
N_VERSIONS: dict[PutOrTake, int] = {"putting": len(_PUTTING), "taking": len(_TAKING), "mixed": len(_MIXED)}


def look_of(action: PutOrTake, version: int) -> int:
    """Which of the four looks of :func:`~sec_lab.worlds.tabletop.settings.surroundings` a version has."""
    return _MIXED[version - 1].look if action == "mixed" else _singles(action)[version - 1].look


def n_aside_of(action: PutOrTake, version: int) -> int:
    """Which of the four amounts of :func:`~sec_lab.worlds.tabletop.clutter.clutter` stands about: little."""
    return 1 if action == "mixed" else 1 + (version - 1) % 2


def view_of(action: PutOrTake, version: int, rng: np.random.Generator) -> Camera:
    """Where the camera stands in one version."""
    camera = camera_of(look_of(action, version), rng)
    if action == "mixed":
        view = _MIXED[version - 1]
        return replace(camera, distance_m=view.distance_m, azimuth_deg=view.turned_deg)
    return replace(camera, azimuth_deg=_singles(action)[version - 1].turned_deg + float(rng.uniform(-2, 2)))


def act(action: PutOrTake, version: int, setting: Setting, skin: textures.Colour, rng: np.random.Generator) -> Act:
    """One version of *putting* or *taking* (1 to 10), or a mixed movie (1 to 5, Fig. 2.11 (a) to (e)).

    Parameters
    ----------
    action : {"putting", "taking", "mixed"}
    version : int
    setting : {"laboratory", "kitchen"}
    skin : Colour
    rng : numpy.random.Generator
        Varies places, sizes and times a little.
    """
    stage = _Tabletop(setting, skin, rng)
    if action == "mixed":
        (_one_bread, _another_bread, _orange_replaced, _orange_then_bread, _both_hands)[version - 1](stage)
        return stage.act()
    v = _singles(action)[version - 1]
    plate = stage.plate("plate", v.plate_m, v.plate_at, version)
    thing = stage.thing("object", v.thing, v.size_m, plate if action == "taking" else v.place)
    hand = stage.hand("hand", v.hand, thing, v.yaw_deg, v.speed, scale=(1.0, 1.08, 0.94, 1.02)[v.look - 1])
    hand.take(thing)
    if action == "putting":
        hand.put(plate, lift_m=v.lift_m, sway_m=v.sway_m, turn_deg=v.turn_deg).leave()
    else:
        hand.carry_off(v.place, lift_m=v.lift_m, sway_m=v.sway_m, turn_deg=v.turn_deg)
    return stage.act()


def _singles(action: PutOrTake) -> tuple[_Single, ...]:
    return _PUTTING if action == "putting" else _TAKING


def _one_bread(stage: "_Tabletop") -> None:
    """(a) A hand takes a piece of bread from a plate and then puts it on a different plate."""
    first = stage.plate("first plate", (0.112, 0.015), (0.12, 0.00), 1)
    second = stage.plate("second plate", (0.116, 0.014), (-0.13, 0.06), 3)
    bread = stage.thing("object", "rye bread", (0.044, 0.022), first)
    hand = stage.hand("hand", "right", bread, 160, 0.95)
    hand.take(bread).put(second, lift_m=0.08, turn_deg=14).leave()


def _another_bread(stage: "_Tabletop") -> None:
    """(b) Another piece of bread goes from one plate to another on a different path."""
    first = stage.plate("first plate", (0.118, 0.016), (-0.12, 0.00), 4)
    second = stage.plate("second plate", (0.108, 0.015), (0.11, 0.09), 2)
    bread = stage.thing("object", "rye bread", (0.040, 0.025), first)
    hand = stage.hand("hand", "left", bread, 20, 1.1)
    hand.take(bread).put(second, lift_m=0.15, sway_m=0.07, turn_deg=-12).leave()


def _orange_replaced(stage: "_Tabletop") -> None:
    """(c) A hand replaces an orange: takes one from a plate, and puts another one there."""
    plate = stage.plate("first plate", (0.114, 0.017), (0.01, 0.06), 2)
    old = stage.thing("first object", "orange", (0.035, 0), plate)
    new = stage.thing("second object", "orange", (0.038, 0), (-0.15, 0.00))
    hand = stage.hand("hand", "right", old, 166, 1.2)
    hand.take(old).carry_off((0.12, 0.02), lift_m=0.05, turn_deg=-6)
    hand.take(new, yaw_deg=170).put(plate, lift_m=0.09, turn_deg=8).leave()


def _orange_then_bread(stage: "_Tabletop") -> None:
    """(d) A hand puts an orange on a plate and then takes a piece of bread from another plate."""
    first = stage.plate("first plate", (0.104, 0.016), (0.08, 0.15), 1)
    second = stage.plate("second plate", (0.112, 0.014), (-0.13, -0.02), 4)
    orange = stage.thing("first object", "orange", (0.036, 0), (0.17, 0.00))
    bread = stage.thing("second object", "rye bread", (0.042, 0.022), second)
    hand = stage.hand("hand", "right", orange, 156, 1.15)
    hand.take(orange).put(first, lift_m=0.10, sway_m=-0.02, turn_deg=8)
    hand.take(bread, yaw_deg=170).carry_off((0.04, -0.04), lift_m=0.06, turn_deg=-10)


def _both_hands(stage: "_Tabletop") -> None:
    """(e) A hand puts an orange on a plate while the other hand takes an apple from the second plate."""
    first = stage.plate("first plate", (0.104, 0.016), (0.10, 0.10), 3)
    second = stage.plate("second plate", (0.108, 0.016), (-0.13, 0.08), 1)
    orange = stage.thing("first object", "orange", (0.036, 0), (0.16, -0.08))
    apple = stage.thing("second object", "green apple", (0.038, 0), second)
    right = stage.hand("right hand", "right", orange, 160, 0.95)
    right.take(orange).put(first, lift_m=0.10, turn_deg=6).leave()
    left = stage.hand("left hand", "left", apple, 18, 0.9)
    left.take(apple).carry_off((-0.16, -0.02), lift_m=0.06, turn_deg=-4)


@dataclass(frozen=True)
class _Plate:
    name: str
    at: Place


@dataclass(eq=False)
class _Laid:
    """A thing, where it lies by now, and the holds that move it: hand, frames of gripping and letting go."""

    name: str
    thing: Thing
    at: Place
    plate: _Plate | None
    start: Floats
    holds: "list[tuple[_Hand, int, int]]"
    gone: int | None = None


class _Tabletop:
    """What lies on the table, and whose hands come; built step by step."""

    def __init__(self, setting: Setting, skin: textures.Colour, rng: np.random.Generator) -> None:
        self.setting, self.skin, self.rng = setting, skin, rng
        self.hands: list[_Hand] = []
        self.laid: list[_Laid] = []
        self.deeds: list[Deed] = []
        self._plates: list[tuple[_Plate, Actor]] = []
        self._places: list[Floats] = []

    def plate(self, name: str, size_m: tuple[float, float], at: Place, colours: int) -> _Plate:
        """Lay a plate, which stays where it is."""
        placed = _Plate(name, varied(at, self.rng))
        shape = plate_of(size_m, colours, self.setting, self.rng)
        angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
        rim = np.asarray(placed.at) + size_m[0] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        self._places += [rim, np.asarray(placed.at)[None]]
        self._plates.append((placed, still(name, shape, pose((*placed.at, 0), yaw=self.rng.uniform(0, 6)), 1)))
        return placed

    def thing(self, name: str, kind: str, size_m: tuple[float, float], at: "_Plate | Place") -> _Laid:
        """Lay a thing on the table or on a plate."""
        thing = thing_of(kind, size_m, self.setting, self.rng)
        plate = at if isinstance(at, _Plate) else None
        place = plate.at if plate else varied(at, self.rng)  # type: ignore[arg-type]
        start = pose((*place, _FLOOR_M if plate else 0.0), yaw=self.rng.uniform(*thing.turns))
        laid = _Laid(name, thing, place, plate, start, [])
        self.laid.append(laid)
        return laid

    def hand(self, name: str, side: Side, first: _Laid, yaw_deg: float, speed: float, *, scale: float = 1.0) -> "_Hand":
        """Let a hand come that will reach for a thing first."""
        hand = _Hand(self, name, side, first, yaw_deg, speed * float(self.rng.uniform(0.93, 1.07)), scale)
        self.hands.append(hand)
        return hand

    def act(self) -> Act:
        """Who acts, and which places have to stay free."""
        last = max(hand.timeline.frame for hand in self.hands)
        palette = textures.skin_palette(self.skin)
        actors, paths = [], {}
        for hand in self.hands:
            X_WH, closed = hand.timeline.until(last).path()
            paths[hand.name] = X_WH
            actors.append(hand_actor(hand.name, hand.style, X_WH, closed, palette))
        rests = np.zeros(last + 1, dtype=np.int64)
        places = list(self._places)
        for laid in self.laid:
            path = np.repeat(laid.start[None], last + 1, axis=0)
            for hand, gripped, released in laid.holds:
                path[gripped:] = carried(path[gripped], paths[hand.name], gripped, released)[gripped:]
            there = rests if laid.gone is None else np.where(np.arange(last + 1) < laid.gone, 0, -1)
            actors.append(Actor(laid.name, (laid.thing.shape,), path, there))
            places.append(path[:, :3, 3])
        actors += [still(plate.name, actor.forms[0], actor.X_WB[0], last + 1) for plate, actor in self._plates]
        path_m = np.concatenate([X_WH[:, :3, 3] for X_WH in paths.values()])
        return Act(tuple(actors), path_m, tuple(places), deeds=tuple(self.deeds))


class _Hand:
    """A hand that takes and puts things, and leaves."""

    def __init__(
        self, stage: _Tabletop, name: str, side: Side, first: _Laid, yaw_deg: float, speed: float, scale: float
    ) -> None:
        self.name, self._stage, self._speed = name, stage, speed
        self._yaw = float(np.deg2rad(yaw_deg + stage.rng.uniform(-5, 5)))
        size = first.thing.grip_m
        self.style = HandStyle("top", size, left=side == "left", rise=0.24, scale=scale)
        self.timeline = Timeline(behind(first.at, self._yaw, 0.64, 0.20), yaw=self._yaw)
        self.timeline.wait(frames_at(10, speed))
        self._held: tuple[_Laid, int] | None = None
        self._left: _Laid | None = None

    def take(self, laid: _Laid, *, yaw_deg: float | None = None) -> "_Hand":
        """Reach for a thing and close the fingers round it."""
        height = laid.thing.height_m + (_FLOOR_M if laid.plate else 0.0)
        at = (*laid.at, height)
        self._yaw = self._yaw if yaw_deg is None else float(np.deg2rad(yaw_deg))
        if self._left is None or self._left.gone is not None:
            self.timeline.approach(at, frames_at(28, self._speed))
        else:
            # It stays over the table between two things.
            up, above = np.add(self.timeline.position_m, (0, 0, 0.09)), np.add(at, (0, 0, 0.09))
            self.timeline.move(up, frames_at(9, self._speed))
            self.timeline.move(above, frames_at(20, self._speed), lift_m=0.02, yaw=self._yaw)
            self.timeline.move(at, frames_at(9, self._speed))
        self.timeline.close(frames_at(7, self._speed))
        self._held = (laid, self.timeline.frame)
        return self

    def put(self, plate: _Plate, *, lift_m: float, sway_m: float = 0.0, turn_deg: float = 0.0) -> "_Hand":
        """Carry what is held to a plate, and let go."""
        laid, gripped = self._holding()
        self._carry(
            plate.at, laid.thing.height_m + _FLOOR_M, frames=30, lift_m=lift_m, sway_m=sway_m, turn_deg=turn_deg
        )
        laid.holds.append((self, gripped, self.timeline.frame))
        if laid.plate:
            self._did("taking", laid, laid.plate)
        self._did("putting", laid, plate)
        laid.at, laid.plate = plate.at, plate
        self.timeline.open(frames_at(7, self._speed))
        self._held, self._left = None, laid
        return self

    def carry_off(self, by: Place, *, lift_m: float, sway_m: float = 0.0, turn_deg: float = 0.0) -> "_Hand":
        """Carry what is held away, by way of a place, until it is out of view."""
        laid, gripped = self._holding()
        if not laid.plate:
            raise RuntimeError("only what lies on a plate is carried off")
        place = varied(by, self._stage.rng)
        self._carry(place, 0.07 + laid.thing.height_m, frames=24, lift_m=lift_m, sway_m=sway_m, turn_deg=turn_deg)
        self.timeline.move(behind(place, self._yaw, 0.70, 0.20), frames_at(24, self._speed), lift_m=0.02)
        self._did("taking", laid, laid.plate)
        laid.gone = self.timeline.frame
        laid.holds.append((self, gripped, laid.gone))
        self.timeline.wait(frames_at(4, self._speed)).open(frames_at(7, self._speed))
        self._held, self._left = None, laid
        return self

    def leave(self) -> None:
        """Go where it came from."""
        at = self._left.at if self._left else (0.0, 0.0)
        self.timeline.retreat(behind(at, self._yaw, 0.64, 0.20), frames_at(28, self._speed))
        self.timeline.wait(frames_at(10, self._speed))

    def _holding(self) -> tuple[_Laid, int]:
        if self._held is None:
            raise RuntimeError("a hand carries only what it has taken")
        return self._held

    def _carry(
        self, place: Place, height_m: float, *, frames: int, lift_m: float, sway_m: float, turn_deg: float
    ) -> None:
        self._yaw += float(np.deg2rad(turn_deg))
        n_frames = frames_at(frames, self._speed)
        self.timeline.move((*place, height_m), n_frames, lift_m=lift_m, sway_m=sway_m, yaw=self._yaw)

    def _did(self, kind: str, laid: _Laid, plate: _Plate) -> None:
        self._stage.deeds.append(Deed(kind, self.name, laid.name, plate.name, laid.thing.kind))
