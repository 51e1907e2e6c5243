"""The arm in three dimensions: recordings that play inside a page with all they need in it, and a live view."""

import atexit
import gc
import logging
import threading
import time
import weakref
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from itertools import product
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from sec_lab.viz.packed_page import packed_frame
from sec_lab.worlds.katana import Fault, Move, Run, Scene

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat
    from pydrake.systems.framework import Diagram

_Answer = TypeVar("_Answer")
_FRAMES_PER_SECOND = 20.0
_EYE_M, _TARGET_M = (0.66, -0.40, 0.36), (0.18, 0.0, 0.10)
_LIGHTS = (("AmbientLight", 1.6), ("FillLight", 1.2))
_ARM_COLOUR = (0.07, 0.075, 0.09, 1.0)
"""Of the arm without its tip: were it as black as the real one, its shapes could not be told apart."""
_LINKS = ("base", "pan", "upper_arm", "forearm", "wrist", "roll")
_HEIGHT_PX = 460
_LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class ArmRecording:
    """A recording that shows itself in a notebook, to be played, scrubbed and looked at from all sides.

    Parameters
    ----------
    page : str
        HTML without any address in need of a network.
    title : str
    """

    page: str
    title: str

    def __repr__(self) -> str:
        return f"3D recording: {self.title}"

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {_HEIGHT_PX}px; border: 1px solid #d9dce1"
        return packed_frame(self.page, title=self.title, style=style)


class LiveArm:
    """A live view of the arm; only programs on this machine can open it.

    Drake ends the process if a viewer is used or dropped in another thread than it was made in. So it lives in a thread
    of its own, which ends with this object, wherever that is dropped.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    UnreachableError
        If the arm cannot be at the start.
    """

    def __init__(self, scene: Scene) -> None:
        self._wishes: SimpleQueue[Callable[[_Shown], object] | None] = SimpleQueue()
        made: Future[str] = Future()
        # Neither knows this object: it can be dropped while they are there.
        self._thread = threading.Thread(target=_live, args=(scene, self._wishes, made), name="live arm", daemon=True)
        _LIVING[self._thread] = self._wishes
        self._thread.start()
        self._end = weakref.finalize(self, self._wishes.put, None)
        self._url = made.result()

    @property
    def url(self) -> str:
        """Where the view is, on this machine."""
        return self._url

    def move(self, *moves: Move) -> "LiveArm":
        """Let the arm make moves, at the speed of the simulation.

        Parameters
        ----------
        moves : Move

        Raises
        ------
        UnreachableError
            If a move is out of reach; those before it are made.
        ValueError
            If the view is closed.
        """

        def make(shown: _Shown) -> None:
            for move in moves:
                shown.run.move(move)
            shown.meshcat.Flush()

        self._asked(make)
        return self

    @property
    def scene(self) -> Scene:
        """The scene as it is now."""
        return self._asked(lambda shown: shown.run.scene)

    def close(self) -> None:
        """End the view; once is enough, and dropping it does the same."""
        self._end()
        self._thread.join()

    def _asked(self, what: "Callable[[_Shown], _Answer]") -> _Answer:
        if not self._end.alive:
            raise ValueError("live view: expected an open one, got one that is closed")
        answer: Future[_Answer] = Future()

        def answered(shown: _Shown) -> None:
            try:
                answer.set_result(what(shown))
            except BaseException as error:  # noqa: BLE001 - it is raised where it was asked
                answer.set_exception(error)

        self._wishes.put(answered)
        return answer.result()

    def __repr__(self) -> str:
        return f"live 3D view at {self.url}"

    def _repr_html_(self) -> str:
        return live_frame(self.url)


class _Shown:
    """What only the thread that made it may touch."""

    def __init__(self, scene: Scene) -> None:
        self.meshcat = _meshcat()
        self.run = Run(scene, film=False, meshcat=self.meshcat)
        _brighten(self.meshcat)


_LIVING: "dict[threading.Thread, SimpleQueue[Callable[[_Shown], object] | None]]" = {}
_PATIENCE = 500


def _live(scene: Scene, wishes: "SimpleQueue[Callable[[_Shown], object] | None]", made: "Future[str]") -> None:
    """Make a view, do what is wished, and drop it, all in this thread."""
    shown = meshcat = left = None
    try:
        shown = _Shown(scene)
        meshcat, left = shown.meshcat, weakref.ref(shown.run.diagram)
        made.set_result(_url(meshcat))
        while (wish := wishes.get()) is not None:
            wish(shown)
            del wish
    except BaseException as error:  # noqa: BLE001 - it is raised where the view was asked for
        made.set_exception(error.with_traceback(None))
    # Drake's diagrams hang in cycles, which any thread may find. The viewer, which is part of them, outlives them here.
    del shown
    for _ in range(_PATIENCE):
        gc.collect()
        if left is None or left() is None:
            break
        # Another thread is collecting; only one at a time can.
        time.sleep(0.01)
    del meshcat
    _LIVING.pop(threading.current_thread(), None)


@atexit.register
def _end_all() -> None:
    for thread, wishes in [*_LIVING.items()]:
        wishes.put(None)
        thread.join()


def live_frame(url: str) -> str:
    """A live view as part of a page."""
    return f'<iframe src="{url}" style="width: 100%; height: {_HEIGHT_PX}px; border: 0" title="live 3D view"></iframe>'


class ArmFilm:
    """A run of the arm that can be seen live and is recorded meanwhile.

    To be used in the thread that made it.

    Parameters
    ----------
    scene : Scene
    fault : Fault, optional
        What goes wrong.
    is_watched : bool, optional
        Whether the camera films and the live view moves; without it only the recording is made.
    before_move : callable, optional
        See :class:`~sec_lab.worlds.katana.Run`.

    Attributes
    ----------
    run : Run

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
        is_watched: bool = True,
        before_move: Callable[[Move], object] | None = None,
    ) -> None:
        self._meshcat = _meshcat()
        self.run = Run(
            scene, fault=fault, film=is_watched, watched=is_watched, meshcat=self._meshcat, before_move=before_move
        )
        _keep(self._meshcat, self.run)
        _brighten(self._meshcat)
        self._meshcat.StartRecording(
            frames_per_second=_FRAMES_PER_SECOND, set_visualizations_while_recording=is_watched
        )

    @property
    def url(self) -> str:
        """Where the live view is, on this machine."""
        return _url(self._meshcat)

    def page(self) -> str:
        """End the recording; a page in which it can be played and scrubbed."""
        self._meshcat.StopRecording()
        self._meshcat.PublishRecording()
        bar = files("sec_lab.viz").joinpath("arm.html").read_text(encoding="utf-8")
        return str(self._meshcat.StaticHtml()).replace("</body>", f"{bar}</body>")


def arm_page(scene: Scene, moves: Sequence[Move]) -> str:
    """A page of its own in which the moves of the arm can be played and scrubbed.

    Parameters
    ----------
    scene : Scene
    moves : sequence of Move

    Returns
    -------
    str
        HTML without any address in need of a network; less than 3 MB for a push. Equal moves give equal pages.

    Raises
    ------
    UnreachableError
        If a move is out of reach.
    """
    film = ArmFilm(scene, is_watched=False)
    for move in moves:
        film.run.move(move)
    return film.page()


def arm_recording(scene: Scene, moves: Sequence[Move], *, title: str) -> ArmRecording:
    """The moves of the arm for a notebook, see :func:`arm_page`.

    Parameters
    ----------
    scene : Scene
    moves : sequence of Move
    title : str
        What is shown, for those who cannot see it.

    Raises
    ------
    UnreachableError
        If a move is out of reach.
    """
    return ArmRecording(arm_page(scene, moves), title)


_KEEPING = threading.Lock()
_KEPT: list[tuple[int, "weakref.ref[Diagram]", "Meshcat"]] = []


def _keep(meshcat: "Meshcat", run: Run) -> None:
    """Let a viewer outlive its diagram, which may be dropped in any thread: it must not be."""
    release_viewers()
    with _KEEPING:
        _KEPT.append((threading.get_ident(), weakref.ref(run.diagram), meshcat))


def release_viewers() -> None:
    """Drop the viewers of films that were made in this thread and are no more."""
    mine = threading.get_ident()
    with _KEEPING:
        over = [kept for kept in _KEPT if kept[0] == mine and kept[1]() is None]
        for kept in over:
            _KEPT.remove(kept)


def _url(meshcat: "Meshcat") -> str:
    return f"http://{_LOOPBACK}:{meshcat.port()}"


def _meshcat() -> "Meshcat":
    """A viewer that looks at the workplace and listens on this machine only."""
    from pydrake.geometry import Meshcat, MeshcatParams

    with _quiet():
        # An empty port lets the system choose one.
        meshcat = Meshcat(MeshcatParams(host=_LOOPBACK, show_stats_plot=False))
    for path in ("/Background", "/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", value=False)
    for light, strength in _LIGHTS:
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", value=strength)
    eye: Any = np.array(_EYE_M)
    target: Any = np.array(_TARGET_M)
    meshcat.SetCameraPose(eye, target)
    return meshcat


def _brighten(meshcat: "Meshcat") -> None:
    shapes = [f"{shape}{number}" for shape in ("Box", "Cylinder") for number in ("", *(f"_{n}" for n in range(1, 6)))]
    for link, shape in product(_LINKS, shapes):
        path = f"/drake/visualizer/katana/{link}/katana/{shape}"
        if meshcat.HasPath(path):
            meshcat.SetProperty(path, "color", list(_ARM_COLOUR))


@contextmanager
def _quiet() -> Iterator[None]:
    """Without Drake's message of where it listens, which is another one each time."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.WARNING)
    try:
        yield
    finally:
        log.setLevel(level)
