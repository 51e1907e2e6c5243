"""Timelines of hands: reach, close, carry, open, leave, one after the other."""

from dataclasses import dataclass

import numpy as np

from sec_lab.worlds.tabletop.deeds import Deed
from sec_lab.worlds.tabletop.hand import Grip, hand_shape, skeleton
from sec_lab.worlds.tabletop.plan import Actor, eased, pose
from sec_lab.worlds.tabletop.shapes import Floats, Texture

N_FORMS = 6
"""Forms of a hand between open and closed."""


@dataclass(frozen=True, eq=False)
class Act:
    """Who acts, and which places have to stay free of clutter.

    Parameters
    ----------
    actors : tuple of Actor
    path_m : (n, 3) float64
        Where the hands go.
    places_m : tuple of (n, 2 or 3) float64
        Where the things go.
    deeds : tuple of Deed, optional
        What is put on plates and taken from them.
    """

    actors: tuple[Actor, ...]
    path_m: Floats
    places_m: tuple[Floats, ...]
    deeds: tuple[Deed, ...] = ()


@dataclass(frozen=True)
class HandStyle:
    """What one person's hand is like, and how it grips.

    Parameters
    ----------
    grip : {"top", "wrap", "pinch"}
    size_m : float
        See :func:`sec_lab.worlds.tabletop.hand.skeleton`.
    left : bool, optional
    rise : float, optional
        Angle of the forearm.
    scale : float, optional
        Thickness.
    spread : float, optional
    """

    grip: Grip
    size_m: float
    left: bool = False
    rise: float = 0.35
    scale: float = 1.0
    spread: float = 1.0


class Timeline:
    """Path of one hand, built step by step; every step begins where the one before has ended.

    Parameters
    ----------
    position_m : tuple of float
        Where its grip is at first.
    yaw, pitch, roll : float, optional
        Direction of its fingers, see :func:`sec_lab.worlds.tabletop.plan.pose`.

    Examples
    --------
    >>> hand = Timeline((0.4, 0.0, 0.2))
    >>> hand.move((0.0, 0.0, 0.03), 20).close(6).frame
    26
    """

    def __init__(
        self, position_m: tuple[float, float, float], *, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0
    ) -> None:
        self._state: list[Floats] = [np.array([*position_m, yaw, pitch, roll, 0.0])]

    @property
    def frame(self) -> int:
        """Frame that the path has come to."""
        return len(self._state) - 1

    @property
    def position_m(self) -> Floats:
        """Where the grip is by now."""
        return self._state[-1][:3].copy()

    def move(
        self,
        position_m: tuple[float, float, float] | Floats,
        n_frames: int,
        *,
        lift_m: float = 0.0,
        sway_m: float = 0.0,
        yaw: float | None = None,
        pitch: float | None = None,
        roll: float | None = None,
    ) -> "Timeline":
        """Move the grip on an arc that rises by ``lift_m`` and swings out to the left by ``sway_m``."""
        start = self._state[-1]
        end = start.copy()
        end[:3] = position_m
        for place, angle in ((3, yaw), (4, pitch), (5, roll)):
            if angle is not None:
                end[place] = angle
        share = eased(np.arange(1, n_frames + 1) / n_frames)
        arc = np.sin(np.pi * share)
        away = end[:2] - start[:2]
        length = np.hypot(*away)
        for s, height in zip(share, arc, strict=True):
            state = start + s * (end - start)
            state[2] += lift_m * height
            if length > 1e-9:
                state[:2] += sway_m * height * np.array([-away[1], away[0]]) / length
            self._state.append(state)
        return self

    def approach(
        self, position_m: tuple[float, float, float] | Floats, n_frames: int, *, from_m: float = 0.075
    ) -> "Timeline":
        """Move to a point above, then down, so that nothing is brushed on the way."""
        above = np.add(position_m, (0.0, 0.0, from_m))
        down = max(2, round(0.36 * n_frames))
        return self.move(above, n_frames - down, lift_m=0.02).move(position_m, down)

    def retreat(
        self, position_m: tuple[float, float, float] | Floats, n_frames: int, *, to_m: float = 0.075
    ) -> "Timeline":
        """Move up, then away."""
        up = max(2, round(0.36 * n_frames))
        return self.move(np.add(self.position_m, (0.0, 0.0, to_m)), up).move(position_m, n_frames - up, lift_m=0.02)

    def close(self, n_frames: int) -> "Timeline":
        """Close the fingers."""
        return self._bend(1.0, n_frames)

    def open(self, n_frames: int) -> "Timeline":
        """Open the fingers."""
        return self._bend(0.0, n_frames)

    def wait(self, n_frames: int) -> "Timeline":
        """Stay as it is."""
        self._state += [self._state[-1].copy() for _ in range(n_frames)]
        return self

    def until(self, frame: int) -> "Timeline":
        """Stay as it is up to a frame."""
        return self.wait(max(0, frame - self.frame))

    def follow(self, states: Floats) -> "Timeline":
        """Go through given states ((n, 6): position, yaw, pitch, roll) with the fingers as they are."""
        closed = self._state[-1][6]
        self._state += [np.array([*state, closed]) for state in states]
        return self

    def path(self, *, tremor_m: float = 0.0, rng: np.random.Generator | None = None) -> tuple[Floats, Floats]:
        """Poses of the hand and how far it is closed, at every frame.

        Parameters
        ----------
        tremor_m : float, optional
            Standard deviation of a slow unrest while it moves.
        rng : numpy.random.Generator, optional
            Needed for the unrest.

        Returns
        -------
        X_WH : (n, 4, 4) float64
        closed : (n,) float64
        """
        states = np.stack(self._state)
        if tremor_m and rng is not None:
            speed = np.linalg.norm(np.gradient(states[:, :3], axis=0), axis=1)
            ease = np.minimum(speed / 0.012, 1)
            phase = rng.uniform(0, 2 * np.pi, (3, 2))
            time = np.arange(len(states))[:, None]
            unrest = np.sin(time * 0.23 + phase[:, 0]) + 0.6 * np.sin(time * 0.51 + phase[:, 1])
            states[:, :3] += tremor_m * ease[:, None] * unrest
        return np.stack([pose(s[:3], yaw=s[3], pitch=s[4], roll=s[5]) for s in states]), states[:, 6]

    def _bend(self, closed: float, n_frames: int) -> "Timeline":
        start = self._state[-1]
        for share in eased(np.arange(1, n_frames + 1) / n_frames):
            state = start.copy()
            state[6] += share * (closed - start[6])
            self._state.append(state)
        return self


def hand_actor(name: str, style: HandStyle, X_WH: Floats, closed: Floats, palette: Texture) -> Actor:
    """The hand that goes along a path, in as many forms as it takes.

    Parameters
    ----------
    name : str
    style : HandStyle
    X_WH : (n, 4, 4) float64
    closed : (n,) float64
    palette : Texture
    """
    levels = np.linspace(0, 1, N_FORMS)
    forms = tuple(
        hand_shape(
            skeleton(style.grip, size_m=style.size_m, closed=float(level), rise=style.rise, spread=style.spread),
            palette,
            left=style.left,
            scale=style.scale,
        )
        for level in levels
    )
    return Actor(name, forms, X_WH, np.abs(closed[:, None] - levels).argmin(axis=1))


def behind(place_m: tuple[float, float], yaw: float, distance_m: float, height_m: float) -> tuple[float, float, float]:
    """The point from which a hand comes that reaches for a place in the direction ``yaw``."""
    x, y = place_m
    return (x - distance_m * float(np.cos(yaw)), y - distance_m * float(np.sin(yaw)), height_m)


def frames_at(n_frames: float, speed: float) -> int:
    """Frames that a step takes at another speed; at least 3."""
    return max(3, round(n_frames / speed))


def varied(place_m: tuple[float, float], rng: np.random.Generator, *, by_m: float = 0.012) -> tuple[float, float]:
    """A place up to ``by_m`` away in x and y."""
    x, y = np.asarray(place_m) + rng.uniform(-by_m, by_m, 2)
    return float(x), float(y)
