"""Enriched event chains (A.2, §2.10.3): a demonstration without its movie, with all that execution needs of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sec_lab.execution.anchors import PrimeMover, prime_mover
from sec_lab.execution.perception import Perceived
from sec_lab.execution.things import COLOURS, MINIMUM_PX, SeenThing, things_in
from sec_lab.recording import Recording
from sec_lab.segmentation.colour import colour_segments
from sec_lab.worlds.katana.records import Camera, Floats


class Filmed(Protocol):
    """A demonstration of which there is a movie: :class:`~sec_lab.execution.planning.Demonstrated`."""

    @property
    def recording(self) -> Recording:
        """With range."""

    @property
    def camera(self) -> Camera:
        """Which filmed it."""

    @property
    def perceived(self) -> Perceived:
        """What was perceived in it."""

    @property
    def tip_m(self) -> Floats:
        """(n, 3) float64: of the arm, from its own joints."""

    @property
    def joints_rad(self) -> Floats | None:
        """(n, 7) float64: angles of these joints, the two fingers last, where they are known."""


@dataclass(frozen=True, eq=False)
class Enriched:
    """A demonstration without its movie: the event chain, and what execution needs at its key frames (§2.10.3).

    Parameters
    ----------
    perceived : Perceived
        One that was read from a file knows of gaps only those that were seen last.
    tip_m : (n, 3) float64
        Of the arm, from its own joints, frame by frame.
    frames_per_second : float
    things : mapping of int to tuple of SeenThing
        By key frame.
    changed_px : mapping of int to mapping of str to int
        By key frame, changed pixels of the difference image with the key frame before, by segment (D1).
    joints_rad : (n, 7) float64, optional
        Angles of the arm's joints, the two fingers last.

    Raises
    ------
    ValueError
        If there is no path of the tip from the first frame on, or things are those of other key frames.
    """

    perceived: Perceived
    tip_m: Floats
    frames_per_second: float
    things: Mapping[int, tuple[SeenThing, ...]]
    changed_px: Mapping[int, Mapping[str, int]]
    joints_rad: Floats | None = None

    def __post_init__(self) -> None:
        tip = np.array(self.tip_m, dtype=np.float64)
        frames = self.perceived.observation.key_frames.tolist()
        if tip.ndim != 2 or tip.shape[1] != 3 or not np.isfinite(tip).all() or len(tip) <= frames[-1]:
            raise ValueError(f"tip_m: expected finite numbers of shape (more than {frames[-1]}, 3), got {tip.shape}")
        if not (np.isfinite(self.frames_per_second) and self.frames_per_second > 0):
            raise ValueError(f"frames_per_second: expected a number above 0, got {self.frames_per_second}")
        for what in ("things", "changed_px"):
            if sorted(getattr(self, what)) != frames:
                raise ValueError(
                    f"{what}: expected those of the key frames {frames}, got {sorted(getattr(self, what))}"
                )
        tip.setflags(write=False)
        object.__setattr__(self, "tip_m", tip)
        if self.joints_rad is not None:
            joints = np.array(self.joints_rad, dtype=np.float64)
            if joints.shape != (len(tip), 7) or not np.isfinite(joints).all():
                raise ValueError(f"joints_rad: expected finite numbers of shape {(len(tip), 7)}, got {joints.shape}")
            joints.setflags(write=False)
            object.__setattr__(self, "joints_rad", joints)

    def things_at(self, frame: int) -> tuple[SeenThing, ...]:
        """Things as they were seen at the key frame whose chunk of time a frame belongs to.

        Parameters
        ----------
        frame : int

        Raises
        ------
        ValueError
            If the frame is before the first key frame.
        """
        begun = [key for key in self.things if key <= frame]
        if not begun:
            raise ValueError(f"frame: expected {min(self.things)} or later, got {frame}")
        return self.things[max(begun)]

    def difference(self, before: int, after: int) -> PrimeMover:
        """D1: in which segment two key frames differ; over key frames between them, pixels that change are added up.

        Parameters
        ----------
        before, after : int
            Key frames.

        Raises
        ------
        ValueError
            If they are none, or nothing changed.
        """
        for frame in (before, after):
            if frame not in self.changed_px:
                raise ValueError(f"frame: expected one of the key frames {sorted(self.changed_px)}, got {frame}")
        total: dict[str, int] = {}
        for frame, changed in self.changed_px.items():
            if before < frame <= after:
                for name, n in changed.items():
                    total[name] = total.get(name, 0) + n
        if not any(total.values()):
            raise ValueError(f"key frames {before} and {after}: expected a change of a named segment, got none")
        return PrimeMover(max(total, key=lambda name: total[name]), total)


def enrich(demonstrated: Filmed) -> Enriched:
    """Leave the movie of a demonstration, and keep what was seen at its key frames.

    Parameters
    ----------
    demonstrated : Demonstrated

    Returns
    -------
    Enriched
    """
    frames = set(demonstrated.perceived.observation.key_frames.tolist())
    names = {label: colour.name for label, colour in enumerate(COLOURS, start=1)}
    things: dict[int, tuple[SeenThing, ...]] = {}
    changed: dict[int, Mapping[str, int]] = {}
    last = None
    for frame in demonstrated.recording:
        if frame.index not in frames:
            continue
        labels = colour_segments(frame.image, COLOURS, minimum_px=MINIMUM_PX, components="all")
        things[frame.index] = things_in(frame, demonstrated.camera)
        counts: Mapping[str, int] = {}
        if last is not None and not np.array_equal(last, labels):
            counts = prime_mover(last, labels, names).changed_px
        changed[frame.index] = {name: n for name, n in counts.items() if n}
        last = labels
    fps = demonstrated.recording.frames_per_second or 20.0
    return Enriched(demonstrated.perceived, demonstrated.tip_m, fps, things, changed, demonstrated.joints_rad)
