"""Long work of a widget in a thread: only what was asked for last is shown, and the notebook is never blocked."""

import asyncio
import logging
import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import traitlets

from sec_lab.viz.widgets.sentences import sentence_of

T = TypeVar("T")

TROUBLES = (TypeError, ValueError, OSError, traitlets.TraitError)
"""Errors that say in a sentence what was expected and what came."""

PATIENCE_S = 0.08
"""So long one waits for a result before the widget is shown at work."""


class StaleError(Exception):
    """Something else was asked for meanwhile."""


class Turn:
    """What a piece of work knows of the widget it works for.

    Parameters
    ----------
    is_stale : callable
        Whether something else was asked for meanwhile.
    report : callable
        Takes how much is done, and of how much.
    hand_over : callable
        Takes a function, and calls it where widgets may be changed.
    """

    def __init__(
        self,
        is_stale: Callable[[], bool],
        report: Callable[[int, int], None],
        hand_over: Callable[[Callable[[], None]], None],
    ) -> None:
        self._is_stale, self._report, self._hand_over = is_stale, report, hand_over

    def report(self, done: int, total: int) -> None:
        """Say how much is done.

        Raises
        ------
        StaleError
            If something else was asked for meanwhile; the work ends with it.
        """
        if self._is_stale():
            raise StaleError
        self._report(done, total)

    def show(self, change: Callable[[], None]) -> None:
        """Let the widget show something before the work is done, unless something else was asked for meanwhile.

        Parameters
        ----------
        change : callable
            Is called where widgets may be changed.
        """

        def unless_stale() -> None:
            if not self._is_stale():
                change()

        self._hand_over(unless_stale)


class _Request(Generic[T]):
    """One piece of work and what became of it."""

    def __init__(self, work: Callable[[Turn], T], number: int, loop: asyncio.AbstractEventLoop | None) -> None:
        self.work, self.number, self.loop = work, number, loop
        self.finished = threading.Event()
        self.is_late = False
        self.result: Any = None
        self.error: str | None = None
        self.is_dropped = False
        self.is_delivered = False


class Latest(Generic[T]):
    """Does in a thread what was asked for last, and shows it; what has become stale is dropped.

    What is done within :data:`PATIENCE_S` is shown before :meth:`ask` returns. What takes longer is shown by the
    kernel's event loop, if there is one, otherwise by the thread.

    Parameters
    ----------
    show : callable
        Takes the result.
    fail : callable
        Takes a sentence that says what went wrong.
    at_work : callable
        Is called while there is work that takes longer; takes how much is done, and of how much.
    at_rest : callable
        Is called when there is none any more.

    Examples
    --------
    >>> shown = []
    >>> latest = Latest(shown.append, fail=shown.append, at_work=lambda done, total: None, at_rest=lambda: None)
    >>> latest.ask(lambda turn: 6 * 7)
    >>> latest.wait()
    >>> shown
    [42]
    """

    def __init__(
        self,
        show: Callable[[T], None],
        *,
        fail: Callable[[str], None],
        at_work: Callable[[int, int], None],
        at_rest: Callable[[], None],
    ) -> None:
        self._show, self._fail, self._at_work, self._at_rest = show, fail, at_work, at_rest
        self._lock = threading.Lock()
        self._number = 0
        self._next: _Request[T] | None = None
        self._late: _Request[T] | None = None
        self._is_running = False
        self._idle = threading.Event()
        self._idle.set()

    def ask(self, work: Callable[[Turn], T], *, patience_s: float = PATIENCE_S) -> None:
        """Let something be done, and forget what was asked for before.

        Parameters
        ----------
        work : callable
            Takes a :class:`Turn` and gives what is shown.
        patience_s : float, optional
            How long to wait for it.
        """
        try:
            loop: asyncio.AbstractEventLoop | None = asyncio.get_running_loop()
        except RuntimeError:
            loop = None
        with self._lock:
            self._number += 1
            request = self._next = _Request(work, self._number, loop)
            self._idle.clear()
            if not self._is_running:
                self._is_running = True
                threading.Thread(target=self._run, name="sec_lab widget", daemon=True).start()
        request.finished.wait(patience_s)
        with self._lock:
            request.is_late = not request.finished.is_set()
        if request.is_late:
            self._at_work(0, 1)
        else:
            self._deliver(request)

    def cancel(self) -> None:
        """Forget what was asked for; nothing more is shown of it."""
        with self._lock:
            self._number += 1
            self._next = None
        self._at_rest()

    def wait(self, timeout_s: float = 60.0) -> None:
        """Wait until nothing is left to do, and what was done is shown.

        Raises
        ------
        TimeoutError
            If it takes longer.
        """
        if not self._idle.wait(timeout_s):
            raise TimeoutError(f"widget: expected to be done in {timeout_s} s")
        if self._late is not None:
            # Whoever waits in the kernel's own thread keeps its event loop from showing it.
            self._deliver(self._late)

    def _run(self) -> None:
        try:
            while (request := self._take()) is not None:
                self._do(request)
        except BaseException:
            self._end()
            raise

    def _take(self) -> _Request[T] | None:
        with self._lock:
            request, self._next = self._next, None
            if request is None:
                # In one step with looking: from here on a new request starts a thread of its own.
                self._end()
            return request

    def _end(self) -> None:
        self._is_running = False
        self._idle.set()

    def _do(self, request: _Request[T]) -> None:
        turn = Turn(
            lambda: request.number != self._number,
            lambda *of: self._report(request, *of),
            lambda change: self._hand_over(request, change),
        )
        try:
            request.result = request.work(turn)
        except StaleError:
            request.is_dropped = True
        except TROUBLES as error:
            request.error = sentence_of(error)
        except Exception as error:
            # A fault of this program: told in the widget, and where it is in the log.
            request.error = sentence_of(error)
            logging.getLogger(__name__).exception("work of a widget")
        finally:
            with self._lock:
                request.finished.set()
                is_late = request.is_late
            if is_late:
                self._late = request
                self._hand_over(request, lambda: self._deliver(request))

    def _report(self, request: _Request[T], done: int, total: int) -> None:
        if request.is_late:
            self._hand_over(request, lambda: self._at_work(done, total))

    def _hand_over(self, request: _Request[T], call: Callable[[], None]) -> None:
        if request.loop is None or request.loop.is_closed():
            call()
        else:
            request.loop.call_soon_threadsafe(call)

    def _deliver(self, request: _Request[T]) -> None:
        if request.number != self._number or request.is_dropped or request.is_delivered:
            return
        request.is_delivered = True
        self._at_rest()
        if request.error is not None:
            self._fail(request.error)
        else:
            self._show(request.result)
