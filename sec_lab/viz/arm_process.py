"""The arm in a process of its own, for widgets: nothing it does holds up or stops a notebook.

Drake's viewers must be made and dropped in one thread, and a push is long work; in another process, that of
:mod:`sec_lab.viz.arm_serving`, it can be stopped at once, and gives back all its memory with its end.
"""

import contextlib
import io
import os
import socket
import subprocess
import sys
import tempfile
import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO, Any

from sec_lab.event_chain import EventChain
from sec_lab.execution.loop import Outcome, Verdict
from sec_lab.execution.skill import Skill
from sec_lab.viz.arm import ArmRecording
from sec_lab.worlds.katana import Fault, Scene, View

_LOOK_S = 0.1
_PATIENCE_S = 2.0
"""So long a push that was stopped may go on to the end of its move, before its process is ended."""
STOP = "stop"


@dataclass(frozen=True, eq=False)
class Pushed:
    """A push with all there is to see of it.

    Parameters
    ----------
    outcome : Outcome
    model : EventChain
        Of the skill.
    recording : ArmRecording
        To be played and scrubbed.
    """

    outcome: Outcome
    model: EventChain
    recording: ArmRecording


class RefusedError(ValueError):
    """Nothing can be done in a scene, or not by this arm; the message says why."""


def _ignored(*_: object) -> None:
    pass


class ArmProcess:
    """A process in which the arm looks and pushes; it is started when it is needed, and ends with this object.

    Parameters
    ----------
    skill : Skill, optional
        That of :func:`~sec_lab.execution.pushing.pushing_skill` if left out.

    Examples
    --------
    >>> from sec_lab.worlds.katana import example_scene
    >>> with ArmProcess() as arm:
    ...     arm.look(example_scene("a")).image.shape
    (256, 320, 3)
    """

    def __init__(self, skill: Skill | None = None) -> None:
        self._skill = skill
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._wire: Connection | None = None
        self._words: IO[bytes] = io.BytesIO()
        self._end: Callable[[], object] = lambda: None

    @property
    def pid(self) -> int | None:
        """Number of the process; None while there is none."""
        return None if self._process is None else self._process.pid

    def look(self, scene: Scene) -> View:
        """What the camera of a scene sees with the arm at home.

        Parameters
        ----------
        scene : Scene

        Raises
        ------
        RefusedError
            If the arm cannot be at home.
        OSError
            If the process ends.
        """
        seen: View = self._asked(("look", scene), _ignored)
        return seen

    def push(
        self,
        scene: Scene,
        *,
        fault: Fault | None = None,
        report: Callable[[int, int], object] = _ignored,
        on_live: Callable[[str], object] = _ignored,
        on_verdict: Callable[[Verdict], object] = _ignored,
    ) -> Pushed:
        """Let the arm push, see :func:`~sec_lab.execution.pushing.push`.

        Parameters
        ----------
        scene : Scene
        fault : Fault, optional
            What goes wrong.
        report : callable, optional
            Is told several times a second how many moves are made, and of how many; what it raises stops the push
            between two moves.
        on_live : callable, optional
            Is told where the live view is, before anything moves.
        on_verdict : callable, optional
            Is told every verdict as soon as the arm has said it.

        Raises
        ------
        RefusedError
            If nothing can be done in the scene, or not by this arm.
        OSError
            If the process ends.
        """
        done, total = 0, 1

        def hear(kind: str, *told: Any) -> None:
            nonlocal done, total
            if kind == "live":
                on_live(*told)
            elif kind == "verdict":
                on_verdict(*told)
            elif kind == "moves":
                done, total = told
            report(done, total)

        made: Pushed = self._asked(("push", scene, fault, self._skill), hear)
        return made

    def close(self) -> None:
        """End the process; what runs in it ends, too."""
        self._end()
        self._process, self._wire = None, None

    def __enter__(self) -> "ArmProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _asked(self, request: tuple[Any, ...], hear: Callable[..., None]) -> Any:
        with self._lock:
            wire = self._started()
            try:
                wire.send(request)
                return self._answer(wire, hear)
            except (EOFError, ConnectionError) as error:
                why = self._last_words()
                self.close()
                raise OSError(f"arm: expected its process to answer, but it has ended{why}; press again") from error
            except KeyboardInterrupt:
                self.close()
                raise

    def _answer(self, wire: Connection, hear: Callable[..., None]) -> Any:
        while True:
            kind, *told = wire.recv() if wire.poll(_LOOK_S) else ("waiting",)
            if kind == "answer":
                return told[0]
            if kind == "refused":
                raise RefusedError(told[0])
            try:
                hear(kind, *told)
            except BaseException:
                self._stop(wire)
                raise

    def _last_words(self) -> str:
        """The last line that the process wrote; it says why it ended, if it had the time."""
        self._words.seek(0)
        lines = self._words.read().decode(errors="replace").strip().splitlines()
        return f" ({lines[-1]})" if lines else ""

    def _stop(self, wire: Connection) -> None:
        """Let it stop after its move; if that takes long, end it."""
        with contextlib.suppress(EOFError, ConnectionError):
            wire.send((STOP,))
            while wire.poll(_PATIENCE_S):
                if wire.recv()[0] in ("answer", "refused", "stopped"):
                    return
        self.close()

    def _started(self) -> Connection:
        if self._wire is not None and self._process is not None and self._process.poll() is None:
            return self._wire
        self.close()
        ours, theirs = socket.socketpair()
        root = str(Path(__file__).parents[2])
        paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._words = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "sec_lab.viz.arm_serving", str(theirs.fileno())], pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=self._words, start_new_session=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            )  # fmt: skip
        self._wire = Connection(ours.detach())
        self._end = weakref.finalize(self, _ended, self._process, self._wire, self._words)
        return self._wire


def _ended(process: "subprocess.Popen[bytes]", wire: Connection, words: IO[bytes]) -> None:
    wire.close()
    words.close()
    process.kill()
    process.wait(timeout=10)
