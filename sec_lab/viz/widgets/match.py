"""Match explorer: two chains side by side, and what the readings of §2.6 make of them."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, get_args

import ipywidgets as widgets
from numpy.typing import ArrayLike

from sec_lab.similarity import EFFORT, Match, Normalizer, Permutation, TemporalInput, check_options, compare
from sec_lab.viz.cells import RowNames
from sec_lab.viz.exploring import Seen, chain_of
from sec_lab.viz.svg.match import (
    listed_permutations,
    match_svg,
    match_words,
    roles_svg,
    row_similarity_svg,
    with_permutation,
)
from sec_lab.viz.svg.paper import data_address, sentence
from sec_lab.viz.widgets.base import INSET, LABELS, TOGGLES, WIDE, Explorer, never_raises, row_of
from sec_lab.viz.widgets.drawing import Drawing

Pictures: TypeAlias = Mapping[int, ArrayLike]


class MatchExplorer(Explorer):
    """Two chains and their controls; made by :func:`match_explorer`, where the parameters are described.

    Attributes
    ----------
    normalizer, tolerance, temporal_input, permutation, names : ipywidgets widgets
        The controls.
    said : ipywidgets.HTML
        ψ_spatial, ψ_temporal and the permutation, in a sentence.
    chains, rows, roles : Drawing
        What is shown.
    """

    def __init__(
        self, one: Seen, other: Seen, *, titles: tuple[str, str], pictures: tuple[Pictures, Pictures],
        normalizer: Normalizer, tolerance_percent: float, row_names: RowNames = "relations",
    ) -> None:  # fmt: skip
        super().__init__()
        check_options(normalizer, tolerance_percent, "original", EFFORT)
        if row_names not in get_args(RowNames):
            raise ValueError(f"row_names: expected one of {get_args(RowNames)}, got {row_names!r}")
        self.normalizer = widgets.ToggleButtons(
            options=[(f"{word} row", word) for word in get_args(Normalizer)], value=normalizer,
            description="divide by the", style=TOGGLES, layout=INSET,
        )  # fmt: skip
        self.tolerance = widgets.IntSlider(
            value=round(tolerance_percent), min=0, max=100, description="tolerance (%)", style=LABELS, layout=WIDE
        )
        self.temporal_input = widgets.ToggleButtons(
            options=[("ξ_o", "original"), ("ξ_d", "derived")], description="columns of",
            style=TOGGLES, layout=INSET,
        )  # fmt: skip
        self.permutation = widgets.IntSlider(
            value=1, min=1, max=1, description="permutation (no.)", style=LABELS, layout=WIDE
        )
        self.names = widgets.ToggleButtons(
            options=[("ρ", "relations"), ("names", "names")], value=row_names, description="rows as",
            style=TOGGLES, layout=INSET,
        )  # fmt: skip
        self.said = widgets.HTML()
        self.chains, self.rows, self.roles = Drawing(), Drawing(), Drawing()
        controls = row_of(self.normalizer, self.tolerance, self.temporal_input, self.names, self.permutation)
        self.show(controls, self.said, self.chains, row_of(self.rows, self.roles))
        self._is_moving = False
        self.set_pair(one, other, titles=titles, pictures=pictures)
        self.on_move([self.normalizer, self.tolerance, self.temporal_input], self._compare_pair)
        self.on_move([self.permutation, self.names], self._draw)

    def set_pair(
        self, one: Seen, other: Seen, *, titles: tuple[str, str] = ("ξ¹", "ξ²"),
        pictures: tuple[Pictures, Pictures] = ({}, {}),
    ) -> None:  # fmt: skip
        """Show another pair; parameters and errors are those of :func:`match_explorer`."""
        if isinstance(titles, str) or not isinstance(titles, Sequence) or len(titles) != 2:
            raise ValueError(f"titles: expected two, got {titles!r}")
        self._pair = chain_of(one, "one"), chain_of(other, "other")
        self._titles = titles
        self._pictures = _addresses(pictures)
        self._compare_pair()

    @property
    def match(self) -> Match:
        """The match, with the permutation that is shown."""
        return self._shown

    def scrubbed(self) -> tuple[widgets.Widget, Sequence[Any]]:
        """The tolerance, and where it can stand on a page without a kernel."""
        return self.tolerance, range(0, 101, 10)

    def _compare_pair(self) -> None:
        normalizer: Normalizer = self.normalizer.value
        temporal_input: TemporalInput = self.temporal_input.value
        self._match = compare(
            *self._pair, normalizer=normalizer, tolerance_percent=self.tolerance.value, temporal_input=temporal_input
        )
        self._listed, self._are_all = listed_permutations(self._match)
        self._is_moving = True
        self.permutation.value = 1
        self.permutation.max = len(self._listed)
        self.permutation.disabled = len(self._listed) == 1
        self._is_moving = False
        self._draw()

    def _draw(self) -> None:
        if self._is_moving:
            return
        place = self.permutation.value - 1
        chosen: Permutation = self._listed[place]
        self._shown = with_permutation(self._match, chosen)
        words = match_words(self._shown, self._listed, place=place, are_all=self._are_all)
        names: Any = self.names.value
        self.said.value = sentence(words)
        self.chains.svg = match_svg(self._shown, row_names=names, titles=self._titles)
        self.rows.svg = row_similarity_svg(self._shown, row_names=names)
        self.roles.svg = roles_svg(self._shown, pictures=self._pictures)


@never_raises
def match_explorer(
    one: Seen,
    other: Seen,
    *,
    titles: tuple[str, str] = ("ξ¹", "ξ²"),
    pictures: tuple[Pictures, Pictures] = ({}, {}),
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    row_names: RowNames = "relations",
) -> Explorer:
    """Look at two chains side by side: corresponding rows, aligned columns, similarities of rows, roles (§2.6, §2.8).

    Normaliser, tolerance and the chain whose columns are compared can be changed, and every permutation that the
    spatial step leaves can be looked at; ψ changes with them.

    Parameters
    ----------
    one, other : EventChain or Observation
        ξ¹ and ξ².
    titles : tuple of two str, optional
    pictures : tuple of two mapping of int to (height, width, 3 or 4) array_like of uint8, optional
        Of segments of either chain; segments of one role are then shown as pairs of pictures.
    normalizer, tolerance_percent : optional
        Where the controls begin; see :func:`~sec_lab.similarity.compare`.
    row_names : {"relations", "names"}, optional
        Rows are called ρ2,1 at first, or by the names of their segments.

    Returns
    -------
    MatchExplorer
        Or, if something is wrong with what was given, an explorer that says what.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> chain = EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)])
    >>> explorer = match_explorer(chain, chain)
    >>> explorer.tolerance.value = 20
    >>> round(explorer.match.temporal)
    100
    """
    return MatchExplorer(
        one, other, titles=titles, pictures=pictures, normalizer=normalizer, tolerance_percent=tolerance_percent,
        row_names=row_names,
    )  # fmt: skip


def _addresses(pictures: tuple[Pictures, Pictures]) -> tuple[dict[int, str], dict[int, str]]:
    if not isinstance(pictures, Sequence) or len(pictures) != 2 or not all(isinstance(of, Mapping) for of in pictures):
        raise TypeError(f"pictures: expected two mappings of segments to pictures, got {type(pictures).__name__}")
    one, other = ({int(segment): data_address(picture) for segment, picture in of.items()} for of in pictures)
    return one, other
