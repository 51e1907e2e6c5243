"""Table explorer: point at a pair in a table of similarities, and see what a threshold decides (§2.7)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import ipywidgets as widgets
import numpy as np

from sec_lab.classification import threshold_errors
from sec_lab.similarity import EFFORT, Normalizer, check_options, similarity_table
from sec_lab.viz.exploring import Seen, chain_of
from sec_lab.viz.svg.curves import curves_svg
from sec_lab.viz.svg.paper import sentence
from sec_lab.viz.svg.table import cell_at, moved, table_layout, table_svg, table_words
from sec_lab.viz.widgets.base import LABELS, WIDE, Explorer, never_raises, row_of
from sec_lab.viz.widgets.drawing import Drawing
from sec_lab.viz.widgets.match import MatchExplorer, Pictures
from sec_lab.viz.widgets.still import LIVE_ONLY

if TYPE_CHECKING:
    import pandas as pd

Classes: TypeAlias = Sequence[object] | Mapping[object, object]

_STEPS = {"ArrowUp": (-1, 0), "ArrowDown": (1, 0), "ArrowLeft": (0, -1), "ArrowRight": (0, 1)}
TYPE_SIMILAR_PERCENT = 64
"""Threshold of §2.7."""


class TableExplorer(Explorer):
    """A table and its controls; made by :func:`table_explorer`, where the parameters are described.

    Attributes
    ----------
    threshold : ipywidgets.IntSlider
    said, chosen : ipywidgets.HTML
        What the threshold decides, and the pair that is chosen, in a sentence.
    table, errors : Drawing
        The table, which takes clicks and arrow keys, and the wrong decisions over all thresholds.
    pair : ipywidgets.VBox
        The :class:`~sec_lab.viz.widgets.match.MatchExplorer` of the pair that is chosen; empty before.
    """

    def __init__(
        self, table: "pd.DataFrame | Mapping[str, Seen]", classes: Classes | None, *,
        chains: Mapping[str, Seen] | None, pictures: Mapping[str, Pictures], normalizer: Normalizer,
        tolerance_percent: float, threshold_percent: float,
    ) -> None:  # fmt: skip
        super().__init__()
        check_options(normalizer, tolerance_percent, "original", EFFORT)
        if isinstance(table, Mapping):
            chains = table
            compared = {name: chain_of(seen, f"chain {name}") for name, seen in table.items()}
            table = similarity_table(compared, normalizer=normalizer, tolerance_percent=tolerance_percent)
        self._layout = table_layout(table, classes)
        if chains is not None:
            missing = [name for name in self._layout.names if name not in chains]
            if missing:
                raise ValueError(f"chains: expected a chain for every row, got none for {missing[0]!r}")
        self._chains, self._pictures = chains, pictures
        self._options = {"normalizer": normalizer, "tolerance_percent": tolerance_percent}
        self._cell: tuple[int, int] | None = None
        self._match: MatchExplorer | None = None
        self._errors = None
        if self._layout.classes:
            every = np.arange(0, 101)
            self._errors = threshold_errors(self._layout.values, self._layout.classes, thresholds_percent=every)
            self._errors.columns = [str(name).replace("_", " ") for name in self._errors.columns]
        self.threshold = widgets.IntSlider(
            value=round(threshold_percent), min=0, max=100, description="threshold of similarity (%)", style=LABELS,
            layout=WIDE,
        )  # fmt: skip
        self.said, self.chosen = widgets.HTML(), widgets.HTML()
        hint = "click a cell, or move with the arrow keys, to open the pair"
        self.table, self.errors = Drawing(takes_clicks=True, hint=hint), Drawing()
        self.pair = widgets.VBox()
        self.show(self.threshold, self.said, row_of(self.table, self.errors), self.chosen, self.pair)
        # A page without a kernel opens nothing.
        self.chosen.add_class(LIVE_ONLY)
        self.chosen.value = sentence(f"No pair is open: {hint}.")
        self._draw()
        self.on_move([self.threshold], self._draw)
        self.table.on_click(self._click)
        self.table.on_key(self._press)

    def open_pair(self, row: str, column: str) -> None:
        """Open the pair of two rows of the table.

        Raises
        ------
        ValueError
            If the table has no such row.
        """
        for name in (row, column):
            if name not in self._layout.names:
                raise ValueError(f"pair: expected two rows of the table, got {name!r}")
        self._open((self._layout.names.index(row), self._layout.names.index(column)))

    def scrubbed(self) -> tuple[widgets.Widget, Sequence[Any]]:
        """The threshold, and where it can stand on a page without a kernel."""
        return self.threshold, range(0, 101, 5)

    def _click(self, x: float, y: float) -> None:
        cell = cell_at(self._layout, x, y)
        if cell is not None:
            with self.guard():
                self._open(cell)

    def _press(self, key: str) -> None:
        if key in _STEPS:
            down, right = _STEPS[key]
            cell = (int(self._layout.order[0]),) * 2 if self._cell is None else self._cell
            with self.guard():
                self._open(moved(self._layout, cell, down=down, right=right))

    def _open(self, cell: tuple[int, int]) -> None:
        self._cell = cell
        self._draw()
        names = tuple(self._layout.names[at] for at in cell)
        classes = [f" ({self._layout.classes[at]})" if self._layout.classes else "" for at in cell]
        value = self._layout.values[cell]
        said = f"{names[0]}{classes[0]} and {names[1]}{classes[1]}: {value:.0f} % in the table"
        if self._chains is None:
            self.chosen.value = sentence(f"{said}; to see how the rows of both correspond, give the chains too.")
            return
        one, other = (self._chains[name] for name in names)
        titles, pictures = (names[0], names[1]), (self._pictures.get(names[0], {}), self._pictures.get(names[1], {}))
        if self._match is None:
            self._match = MatchExplorer(one, other, titles=titles, pictures=pictures, **self._options)  # type: ignore[arg-type]
            self.pair.children = (self._match,)
        else:
            self._match.set_pair(one, other, titles=titles, pictures=pictures)
        self.chosen.value = sentence(f"{said}; below, {names[0]} as ξ¹ and {names[1]} as ξ².")

    def _draw(self) -> None:
        threshold = self.threshold.value
        self.said.value = sentence(table_words(self._layout, threshold))
        self.table.svg = table_svg(self._layout, threshold_percent=threshold, chosen=self._cell)
        if self._errors is not None:
            self.errors.svg = curves_svg(
                self._errors, x_label="threshold in %", y_label="pairs decided wrongly", marker=threshold
            )


@never_raises
def table_explorer(
    table: "pd.DataFrame | Mapping[str, Seen]",
    classes: Classes | None = None,
    *,
    chains: Mapping[str, Seen] | None = None,
    pictures: Mapping[str, Pictures] | None = None,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    threshold_percent: float = TYPE_SIMILAR_PERCENT,
) -> Explorer:
    """Look at a table of similarities: open pairs, move the threshold, count what it decides wrongly (§2.7).

    Parameters
    ----------
    table : (n, n) pandas.DataFrame, or mapping of names to EventChain or Observation
        Symmetric similarities in percent, e.g. of :func:`~sec_lab.similarity.similarity_table`; or the chains, which
        are then compared.
    classes : sequence or mapping, optional
        Class of each row, in the order of the rows or by row name.
    chains : mapping of names to EventChain or Observation, optional
        Of the rows of the table; a click on a cell then opens the pair.
    pictures : mapping of names to mapping of int to array_like, optional
        Of segments of the chains, see :func:`~sec_lab.viz.widgets.match.match_explorer`.
    normalizer, tolerance_percent : optional
        With which pairs are opened, and chains are compared; see :func:`~sec_lab.similarity.compare`.
    threshold_percent : float, optional
        Where the threshold begins.

    Returns
    -------
    TableExplorer
        Or, if something is wrong with what was given, an explorer that says what.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame([[100, 20, 60], [20, 100, 30], [60, 30, 100]], list("abc"), list("abc"))
    >>> explorer = table_explorer(frame, classes=["put", "take", "put"])
    >>> explorer.threshold.value = 25
    >>> "1 false positive" in explorer.said.value
    True
    """
    return TableExplorer(
        table, classes, chains=chains, pictures=pictures or {}, normalizer=normalizer,
        tolerance_percent=tolerance_percent, threshold_percent=threshold_percent,
    )  # fmt: skip
