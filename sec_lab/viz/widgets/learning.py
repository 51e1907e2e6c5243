"""Learning explorer: add and remove demonstrations, move the weight threshold, watch the model (§2.9)."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, get_args

import ipywidgets as widgets

from sec_lab.action_model import ActionModel
from sec_lab.learning import WEIGHT_THRESHOLD, Mode
from sec_lab.similarity import EFFORT, Normalizer, check_options
from sec_lab.viz.exploring import Learned, Seen, chain_of, learn_and_compare
from sec_lab.viz.svg.model import model_svg
from sec_lab.viz.svg.paper import sentence
from sec_lab.viz.widgets.base import INSET, LABELS, TOGGLES, WIDE, Explorer, never_raises, row_of
from sec_lab.viz.widgets.drawing import Drawing

Demonstrations: TypeAlias = Sequence[Seen] | Mapping[str, Seen]

_LEAST = 2


class LearningExplorer(Explorer):
    """Demonstrations and the model of those that are ticked; made by :func:`learning_explorer`.

    Attributes
    ----------
    ticks : dict of str to ipywidgets.Checkbox
        By demonstration.
    everything, nothing : ipywidgets.Button
    weight_threshold, mode, normalizer, tolerance : ipywidgets widgets
        The other controls.
    said : ipywidgets.HTML
        Size of the model and what was learned from, in a sentence.
    drawing : Drawing
        The model.
    model : ActionModel or None
        None where nothing could be learned.
    """

    def __init__(
        self, demonstrations: Demonstrations, *, weight_threshold: float, normalizer: Normalizer,
        tolerance_percent: float, title: str,
    ) -> None:  # fmt: skip
        super().__init__()
        check_options(normalizer, tolerance_percent, "original", EFFORT)
        self._given = _named(demonstrations)
        self._title = title
        self.model: ActionModel | None = None
        self.ticks = {
            name: widgets.Checkbox(value=True, description=name, indent=False, layout={"width": "auto"})
            for name in self._given
        }
        self._likes = {name: widgets.Label(layout={"margin": "0 14px 0 2px"}) for name in self._given}
        self.everything = widgets.Button(description="All", tooltip="learn from all demonstrations")
        self.nothing = widgets.Button(description="None", tooltip="learn from none")
        self.weight_threshold = widgets.FloatSlider(
            value=weight_threshold, min=0, max=1, step=0.01, description="weight threshold (share)", style=LABELS,
            readout_format=".2f", layout=WIDE,
        )  # fmt: skip
        self.mode = widgets.ToggleButtons(options=list(get_args(Mode)), description="mode", style=TOGGLES, layout=INSET)
        self.normalizer = widgets.ToggleButtons(
            options=[(f"{word} row", word) for word in get_args(Normalizer)], value=normalizer,
            description="divide by the", style=TOGGLES, layout=INSET,
        )  # fmt: skip
        self.tolerance = widgets.IntSlider(
            value=round(tolerance_percent), min=0, max=100, description="tolerance (%)", style=LABELS, layout=WIDE
        )
        self.said, self.drawing = widgets.HTML(), Drawing()
        ticks = [
            widgets.HBox([self.ticks[name], self._likes[name]], layout={"align_items": "center"})
            for name in self._given
        ]
        controls = row_of(self.weight_threshold, self.mode, self.normalizer, self.tolerance)
        self.show(row_of(self.everything, self.nothing, *ticks), controls, self.work_bar, self.said, self.drawing)
        self._worker = self.latest(self._show)
        self._is_ticking = False
        self._learn()
        self.on_move(
            [*self.ticks.values(), self.weight_threshold, self.mode, self.normalizer, self.tolerance], self._learn
        )
        self.everything.on_click(lambda _: self._tick_all(value=True))
        self.nothing.on_click(lambda _: self._tick_all(value=False))

    @property
    def chosen(self) -> list[str]:
        """Names of the demonstrations that are ticked."""
        return [name for name, tick in self.ticks.items() if tick.value]

    def wait(self) -> None:
        """Wait until the model is shown."""
        self._worker.wait()

    def scrubbed(self) -> tuple[widgets.Widget, Sequence[Any]]:
        """The weight threshold, and where it can stand on a page without a kernel."""
        return self.weight_threshold, [step / 10 for step in range(11)]

    def _tick_all(self, *, value: bool) -> None:
        self._is_ticking = True
        for tick in self.ticks.values():
            tick.value = value
        self._is_ticking = False
        with self.guard():
            self._learn()

    def _learn(self) -> None:
        if self._is_ticking:
            return
        chosen = self.chosen
        if len(chosen) < _LEAST:
            self._worker.cancel()
            self._clear()
            raise ValueError(f"demonstrations: expected at least two that are ticked, got {len(chosen)}")
        options = {
            "weight_threshold": self.weight_threshold.value, "mode": self.mode.value,
            "normalizer": self.normalizer.value, "tolerance_percent": self.tolerance.value,
        }  # fmt: skip
        self._worker.ask(lambda turn: learn_and_compare(self._given, chosen, report=turn.report, **options))

    def _clear(self) -> None:
        self.model, self.drawing.svg, self.said.value = None, "", ""
        for like in self._likes.values():
            like.value = ""

    def say_trouble(self, text: str) -> None:
        """Show a sentence that says what went wrong; the model, which is not that of the controls, goes."""
        super().say_trouble(text)
        if text:
            self._clear()

    def _show(self, learned: Learned) -> None:
        model = self.model = learned.model
        n_rows, n_columns = model.chain.relations.shape
        said = f"learned from {len(model.demonstrations)} of {len(self._given)} demonstrations: "
        said += f"{n_rows} rows, {n_columns} columns, {len(model.chain.segments)} roles"
        passed_over = [name for name in self.chosen if name not in model.demonstrations]
        if passed_over:
            said += f"; not type-similar, so passed over: {', '.join(passed_over)}"
        said += "; percent: temporal similarity of the model and each demonstration"
        self.said.value = sentence(said)
        self.drawing.svg = model_svg(model, title=self._title)
        for name, like in self._likes.items():
            like.value = f"{learned.similarity[name]:.0f} %"


@never_raises
def learning_explorer(
    chains: Demonstrations,
    *,
    weight_threshold: float = WEIGHT_THRESHOLD,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    title: str = "model",
) -> Explorer:
    """Watch a model while demonstrations are added and removed and the weight threshold moves (§2.9).

    Parameters
    ----------
    chains : sequence of EventChain or Observation, or mapping of names to them
        At least two.
    weight_threshold, normalizer, tolerance_percent : optional
        Where the controls begin; see :func:`~sec_lab.learning.learn`.
    title : str, optional
        Of the model.

    Returns
    -------
    LearningExplorer
        Or, if something is wrong with what was given, an explorer that says what.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> put = EventChain([[0, 2, 2, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)])
    >>> explorer = learning_explorer({"first": put, "second": put, "third": put})
    >>> explorer.ticks["third"].value = False
    >>> explorer.wait()
    >>> explorer.model.demonstrations
    ('first', 'second')
    """
    return LearningExplorer(
        chains, weight_threshold=weight_threshold, normalizer=normalizer, tolerance_percent=tolerance_percent,
        title=title,
    )  # fmt: skip


def _named(demonstrations: Demonstrations) -> dict[str, Seen]:
    if isinstance(demonstrations, Mapping):
        given = {str(name): seen for name, seen in demonstrations.items()}
    elif isinstance(demonstrations, Sequence):
        given = {str(number): seen for number, seen in enumerate(demonstrations, start=1)}
    else:
        raise TypeError(f"chains: expected event chains or observations, got {type(demonstrations).__name__}")
    for name, seen in given.items():
        chain_of(seen, f"chain {name}")
    if len(given) < _LEAST:
        raise ValueError(f"chains: expected at least two demonstrations, got {len(given)}")
    return given
