"""What all explorers have: controls above what they show, a line for what went wrong, and a bar while they work."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import ipywidgets as widgets

from sec_lab.viz.widgets.latest import TROUBLES, Latest
from sec_lab.viz.widgets.scrubber import FOR_PAGES, SCRUBBER
from sec_lab.viz.widgets.sentences import as_alert, sentence_of
from sec_lab.viz.widgets.still import still_html

T = TypeVar("T")
Given = ParamSpec("Given")

LABELS = {"description_width": "initial"}
"""Style of controls whose label is as long as it has to be."""

WIDE = {"width": "420px"}
"""Layout of sliders: room for the label and for the slider."""


TOGGLES = {**LABELS, "button_width": "auto"}
"""Style of toggle buttons."""

INSET = {"padding": "0 0 3px 3px"}
"""Layout of toggle buttons, whose label and shadow would else reach out of their row, which cuts them off."""


class Explorer(widgets.VBox):  # type: ignore[misc]  # ipywidgets is untyped
    """Controls and what they change; nothing that goes wrong leaves the widget.

    Attributes
    ----------
    trouble : ipywidgets.HTML
        What went wrong, as a sentence; empty if nothing did.
    work_bar : ipywidgets.HBox
        Progress and a button to cancel; seen only while something takes longer.
    """

    def __init__(self) -> None:
        super().__init__()
        self.trouble = widgets.HTML()
        self.progress = widgets.IntProgress(description="computing", max=1, style=LABELS)
        self.cancel = widgets.Button(description="Cancel", tooltip="stop what is being computed")
        self.work_bar = widgets.HBox([self.progress, self.cancel], layout={"visibility": "hidden"})
        self.add_class("sec-lab-controls")

    def __repr__(self) -> str:
        # Not all the drawings that are in it: notebooks store it.
        return f"{type(self).__name__}()"

    def show(self, *rows: widgets.Widget) -> None:
        """Put widgets below each other, the line for troubles first."""
        self.children = (self.trouble, *rows)

    def say_trouble(self, text: str) -> None:
        """Show a sentence that says what went wrong, or nothing."""
        self.trouble.value = as_alert(text)

    def wait(self) -> None:
        """Wait until everything that was asked for is shown."""

    def scrubbed(self) -> tuple[widgets.Widget, Sequence[Any]] | None:
        """The slider that still moves on a page without a kernel, and where it can stand there; None: there is none."""
        return None

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """The live widget; while the report is made, also what scrubs in its page."""
        bundle = super()._repr_mimebundle_(**options)
        scrubbed = self.scrubbed() if os.environ.get(FOR_PAGES) else None
        if isinstance(bundle, dict) and scrubbed is not None:
            bundle[SCRUBBER] = still_html(self, *scrubbed, wait=self.wait)
        return bundle

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Show what goes wrong within as a sentence."""
        # At the beginning, as a worker may say what went wrong before the end.
        self.say_trouble("")
        try:
            yield
        except TROUBLES as error:
            self.say_trouble(sentence_of(error))

    def on_move(self, controls: Sequence[widgets.Widget], update: Callable[[], object]) -> None:
        """Call a function whenever one of some controls has another value; what goes wrong becomes a sentence."""

        def guarded(_: Any) -> None:
            with self.guard():
                update()

        for control in controls:
            control.observe(guarded, "value")

    def latest(self, show: Callable[[T], None]) -> Latest[T]:
        """Work in a thread for this widget, with its bar and its button to cancel."""

        def shown(result: T) -> None:
            with self.guard():
                show(result)

        worker = Latest(shown, fail=self.say_trouble, at_work=self._at_work, at_rest=self._at_rest)
        self.cancel.on_click(lambda _: worker.cancel())
        return worker

    def _at_work(self, done: int, total: int) -> None:
        self.progress.max = max(total, 1)
        self.progress.value = done
        self.work_bar.layout.visibility = "visible"

    def _at_rest(self) -> None:
        self.work_bar.layout.visibility = "hidden"


def never_raises(make: Callable[Given, Explorer]) -> Callable[Given, Explorer]:
    """Let a function that makes an explorer give one that says what was wrong, instead of raising it."""

    @wraps(make)
    def made(*given: Given.args, **options: Given.kwargs) -> Explorer:
        try:
            return make(*given, **options)
        except TROUBLES as error:
            explorer = Explorer()
            explorer.show()
            explorer.say_trouble(sentence_of(error))
            return explorer

    return made


def row_of(*controls: widgets.Widget) -> widgets.HBox:
    """Controls beside each other, in several lines where there is no room."""
    return widgets.HBox(controls, layout={"flex_flow": "row wrap"})
