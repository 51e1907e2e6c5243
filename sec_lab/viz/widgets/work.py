"""Long work of a widget: in a thread of its own, with a progress bar and a button that stops it."""

import threading
from collections.abc import Callable
from typing import Any

import ipywidgets

from sec_lab.viz.widgets.sentences import sentence_of

Tell = Callable[[int, int | None], None]


class Stopped(Exception):
    """Raised inside the work when somebody does not want it any more."""


class Work(ipywidgets.HBox):  # type: ignore[misc]
    """Runs a function beside the notebook, shows how far it is, and can be stopped.

    The function is given ``tell(done, of)``, which it calls often: it moves the bar, and raises :class:`Stopped` when
    the work is to end.

    Parameters
    ----------
    on_done : callable
        Called with what the function gives, in the thread of the work.
    on_failed : callable
        Called with one sentence if the function raises, or if it was stopped.

    Examples
    --------
    >>> given, said = [], []
    >>> work = Work(on_done=given.append, on_failed=said.append)
    >>> work.start(lambda tell: sum(range(4)))
    >>> work.wait(10), given
    (True, [6])
    >>> work.start(lambda tell: 1 / 0)
    >>> work.wait(10), said
    (True, ['ZeroDivisionError: division by zero.'])
    """

    def __init__(self, *, on_done: Callable[[Any], object], on_failed: Callable[[str], object]) -> None:
        self._on_done, self._on_failed = on_done, on_failed
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._bar = ipywidgets.IntProgress(value=0, max=1000, layout={"width": "320px"})
        self._said = ipywidgets.Label("")
        self._button = ipywidgets.Button(description="cancel", icon="stop", tooltip="stop this work")
        self._button.on_click(lambda _: self.stop())
        super().__init__([self._bar, self._button, self._said])
        self.layout.display = "none"

    @property
    def is_running(self) -> bool:
        """Whether there is work going on."""
        return self._thread is not None and self._thread.is_alive()

    def start(
        self,
        function: Callable[[Tell], Any],
        *,
        unit: str = "frames",
        on_done: Callable[[Any], object] | None = None,
    ) -> None:
        """Begin; what still runs is stopped first.

        Parameters
        ----------
        function : callable
        unit : str, optional
            What is counted.
        on_done : callable, optional
            Called this time instead of the usual one.
        """
        self.stop()
        self.wait(None)
        self._stop = threading.Event()
        self._bar.value, self._said.value, self.layout.display = 0, "", ""
        self._button.disabled = False
        # Daemonic, so that a kernel that is shut down need not wait for it.
        self._thread = threading.Thread(
            target=self._run, args=(function, unit, self._stop, on_done or self._on_done), daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Ask the work to end; it does so when it tells next how far it is."""
        self._stop.set()
        if self.is_running:
            self._said.value = "stopping …"

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for the end; whether it came in time."""
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout_s)
        return not self.is_running

    def _run(
        self,
        function: Callable[[Tell], Any],
        unit: str,
        stop: threading.Event,
        on_done: Callable[[Any], object],
    ) -> None:
        shown = -1

        def tell(done: int, of: int | None) -> None:
            nonlocal shown
            if stop.is_set():
                raise Stopped
            part = round(1000 * done / of) if of else 0
            # A hundred messages are enough, however long the movie is.
            if part // 10 != shown // 10 or (of is None and done % 20 == 0):
                shown = part
                self._bar.value = min(part, 1000)
                self._said.value = f"{done} of {of} {unit}" if of else f"{done} {unit}"

        try:
            given = function(tell)
            if stop.is_set():
                raise Stopped
        except Stopped:
            self.layout.display = "none"
            self._on_failed("Stopped; nothing was changed.")
            return
        except Exception as error:  # noqa: BLE001 - whatever is wrong with a user's file, the notebook lives on
            self.layout.display = "none"
            self._on_failed(sentence_of(error))
            return
        self.layout.display = "none"
        on_done(given)
