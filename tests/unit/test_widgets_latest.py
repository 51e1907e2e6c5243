"""Work in a thread: what was asked for last is shown, nothing else."""

import asyncio
import threading
import time

import pytest

from sec_lab.viz.widgets.latest import Latest, StaleError, Turn


class Watch:
    """Writes down what a worker tells."""

    def __init__(self) -> None:
        self.shown: list[object] = []
        self.failed: list[str] = []
        self.states: list[object] = []
        self.latest: Latest[object] = Latest(
            self.shown.append,
            fail=self.failed.append,
            at_work=lambda done, total: self.states.append((done, total)),
            at_rest=lambda: self.states.append("rest"),
        )


def test_quick_work_is_shown_at_once_without_a_bar() -> None:
    watch = Watch()
    watch.latest.ask(lambda _: 3, patience_s=30)
    assert (watch.shown, watch.states) == ([3], ["rest"])


def test_slow_work_shows_its_progress_and_then_its_result() -> None:
    watch, go_on = Watch(), threading.Event()

    def work(turn: Turn) -> int:
        go_on.wait(30)
        turn.report(1, 2)
        return 5

    watch.latest.ask(work, patience_s=0)
    assert watch.states == [(0, 1)]
    go_on.set()
    watch.latest.wait(30)
    assert watch.states == [(0, 1), (1, 2), "rest"]
    assert watch.shown == [5]


def test_only_the_last_of_many_is_shown_and_those_between_are_never_begun() -> None:
    watch, go_on, begun = Watch(), threading.Event(), []

    def work(number: int) -> object:
        begun.append(number)
        go_on.wait(30)
        return number

    for number in range(20):
        watch.latest.ask(lambda _, number=number: work(number), patience_s=0.05 if number == 0 else 0)
    go_on.set()
    watch.latest.wait(30)
    assert watch.shown == [19]
    assert begun == [0, 19]


def test_stale_work_ends_at_its_next_report() -> None:
    watch, go_on, ended = Watch(), threading.Event(), []

    def work(turn: Turn) -> None:
        go_on.wait(30)
        try:
            turn.report(1, 10)
        except StaleError:
            ended.append("stale")
            raise

    watch.latest.ask(work, patience_s=0.05)
    watch.latest.cancel()
    go_on.set()
    watch.latest.wait(30)
    assert ended == ["stale"]
    assert watch.shown == []
    assert watch.states[-1] == "rest"


def test_what_goes_wrong_is_a_sentence_and_the_next_work_is_done() -> None:
    watch = Watch()

    def wrong(turn: Turn) -> None:
        raise ValueError("p: expected 0 to 1, got 2")

    watch.latest.ask(wrong, patience_s=30)
    watch.latest.ask(lambda _: 1, patience_s=30)
    assert watch.failed == ["p: expected 0 to 1, got 2."]
    assert watch.shown == [1]


def test_an_error_nobody_expected_is_told_too_and_nothing_hangs(caplog: pytest.LogCaptureFixture) -> None:
    watch = Watch()
    watch.latest.ask(lambda _: 1 / 0, patience_s=30)
    assert watch.failed == ["ZeroDivisionError: division by zero."]
    assert "ZeroDivisionError" in caplog.text
    watch.latest.wait(30)
    watch.latest.ask(lambda _: 2, patience_s=30)
    assert watch.shown == [2]


def test_in_a_kernel_the_event_loop_shows_what_came_late() -> None:
    watch = Watch()
    threads: list[object] = []
    latest: Latest[object] = Latest(
        lambda _: threads.append(threading.current_thread()),
        fail=watch.failed.append,
        at_work=lambda *_: None,
        at_rest=lambda: None,
    )

    async def kernel() -> None:
        latest.ask(lambda _: time.sleep(0.05), patience_s=0)
        while not threads:
            await asyncio.sleep(0.01)

    asyncio.run(asyncio.wait_for(kernel(), 30))
    assert threads == [threading.main_thread()]


def test_who_waits_in_the_kernel_sees_the_result_and_it_is_shown_once() -> None:
    watch = Watch()

    async def kernel() -> None:
        watch.latest.ask(lambda _: time.sleep(0.05) or 7, patience_s=0)
        watch.latest.wait(30)
        assert watch.shown == [7]
        await asyncio.sleep(0.05)

    asyncio.run(asyncio.wait_for(kernel(), 30))
    assert watch.shown == [7]


def test_waiting_too_long_is_an_error() -> None:
    watch, go_on = Watch(), threading.Event()
    watch.latest.ask(lambda _: go_on.wait(30), patience_s=0)
    with pytest.raises(TimeoutError, match="expected to be done"):
        watch.latest.wait(0.01)
    go_on.set()
    watch.latest.wait(30)
