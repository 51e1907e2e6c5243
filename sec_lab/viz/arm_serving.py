"""The other side of :mod:`sec_lab.viz.arm_process`: ``python -m sec_lab.viz.arm_serving`` looks and pushes when told.

It has one thread, as Drake's viewers must be made and dropped in the same; they listen on loopback only.
"""

import contextlib
import gc
import sys
from collections.abc import Sequence
from multiprocessing.connection import Connection
from typing import Any

from sec_lab.execution.loop import Verdict
from sec_lab.execution.pushing import push, pushing_skill
from sec_lab.execution.skill import Skill, Step
from sec_lab.viz.arm import ArmFilm, ArmRecording, release_viewers
from sec_lab.viz.arm_process import STOP, Pushed
from sec_lab.worlds.katana import Fault, Glance, Move, Scene


class _StoppedError(Exception):
    """Nobody wants it any more."""


def _served(wire: Connection, request: tuple[Any, ...], glance: Glance) -> tuple[Any, ...]:
    """The answer to one request."""
    kind, scene, *more = request
    try:
        if kind == "look":
            return "answer", glance.at(scene)
        return "answer", _pushed(wire, scene, *more)
    except _StoppedError:
        return ("stopped",)
    except ValueError as error:
        return "refused", str(error)


def _pushed(wire: Connection, scene: Scene, fault: Fault | None, skill: Skill | None) -> Pushed:
    n_done = n_planned = n_said = 0

    def before_move(_: Move) -> None:
        nonlocal n_done
        if wire.poll() and wire.recv()[0] == STOP:
            raise _StoppedError
        wire.send(("moves", min(n_done, n_planned), n_planned))
        n_done += 1

    def tell(steps: Sequence[Step], verdicts: Sequence[Verdict]) -> None:
        nonlocal n_planned, n_said
        for verdict in verdicts[n_said:]:
            wire.send(("verdict", verdict))
        if len(verdicts) == n_said:
            # A new plan: what is still to be done is all of it.
            n_planned = n_done + sum(len(step.moves) for step in steps)
        n_said = len(verdicts)

    known = pushing_skill() if skill is None else skill
    film = ArmFilm(scene, fault=fault, before_move=before_move)
    wire.send(("live", film.url))
    outcome = push(scene, skill=known, run=film.run, tell=tell)
    return Pushed(outcome, known.model.chain, ArmRecording(film.page(), "The arm pushes"))


def main() -> None:
    """Serve until the other side ends."""
    wire = Connection(int(sys.argv[1]))
    glance = Glance()
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            request = wire.recv()
            if request[0] != STOP:
                wire.send(_served(wire, request, glance))
                if request[0] != "look":
                    # Drake's diagrams, and with them the viewer and its server, hang in cycles.
                    gc.collect()
                    release_viewers()


if __name__ == "__main__":
    main()
