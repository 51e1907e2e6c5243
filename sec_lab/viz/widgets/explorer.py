"""The chain explorer: scrub a movie, and see which column of its chain holds (Fig. 2.1 and 2.5, live)."""

import os
from collections.abc import Callable
from functools import partial
from typing import Any

import ipywidgets
import numpy as np
from numpy.typing import NDArray

from sec_lab.event_chain import Names
from sec_lab.observation import Observation
from sec_lab.pipeline import SegmentationMethod
from sec_lab.recording import Recording
from sec_lab.segmentation import Segmentation
from sec_lab.viz.widgets.book import ChainBook
from sec_lab.viz.widgets.chain_table import DARK, LIGHT
from sec_lab.viz.widgets.picture import ClickablePicture
from sec_lab.viz.widgets.scrubber import FOR_PAGES, SCRUBBER, scrubber_html
from sec_lab.viz.widgets.seen import MOST_FRAMES, How, Seen, see
from sec_lab.viz.widgets.sentences import as_alert, sentence_of
from sec_lab.viz.widgets.work import Work

_AT_ONCE_S = 0.8
_LEAST_INTERVAL_MS = 60
_MERGED_AT_ONCE = 100
_KEYS = (
    "← → frame, PageUp PageDown key frame, Home End, ↑ ↓ row, space play, m merge, u undo, Esc let go; "
    "click a cell, a row's name, a key frame or a segment"
)

Source = Observation | Recording | Segmentation | NDArray[Any] | str | os.PathLike[str]
Movie = Recording | NDArray[np.uint8] | str | os.PathLike[str]


def chain_explorer(
    source: Source,
    *,
    recording: Movie | None = None,
    segmentation: SegmentationMethod | Segmentation = "layers",
    how: How | None = None,
    names: Names | None = None,
) -> "ChainExplorer":
    """Scrub a movie: frame with segments, scene graph, depth, and the chain with its column of now lit.

    A click on the chain goes to a key frame and shows the two segments of a row; segments are named, and fragments of
    one object are merged, whereupon the chain is made anew (over-segmentation, §2.11).

    Parameters
    ----------
    source : Observation, Recording, Segmentation, ndarray or path-like
        What was observed, or a movie or label images that are observed now; an array holds frames, (n, height, width,
        3) uint8, or label images, (n, height, width). Work that takes long is done beside the notebook, with a progress
        bar and a button that stops it.
    recording : Recording, (n, height, width, 3) ndarray of uint8 or path-like, optional
        The movie that an observation or label images belong to; without it, segments are drawn on paper.
    segmentation
        As of :func:`~sec_lab.pipeline.observe`, for a movie that is observed now.
    how : tuple, optional
        ``(over_time, relations)`` as of :func:`~sec_lab.pipeline.observe`: how relations are found, or were found, if
        it is neither of the ways that have a name. Needed for merging only.
    names : mapping of int to str or None, optional
        Names of segments; those that the source has if left out.

    Returns
    -------
    ChainExplorer
        A widget. Its ``book`` holds what is shown: ``book.observation`` with names and merged segments. What is wrong
        with what was given is said in it.

    Examples
    --------
    >>> labels = np.ones((3, 20, 30), dtype=np.uint8)
    >>> labels[1:, 5:15, 5:15] = 2
    >>> explorer = chain_explorer(Segmentation.from_labels(labels))
    >>> explorer.wait().book.observation.key_frames
    array([0])
    """
    return ChainExplorer(
        lambda tell: see(
            _as_source(source),
            recording=_as_movie(recording),
            segmentation=segmentation,
            how=how,
            names=names,
            tell=tell,
        )
    )


def _as_source(source: object) -> Observation | Recording | Segmentation | str | os.PathLike[str]:
    """What can be observed; arrays are frames if they have colours, and label images if not."""
    if isinstance(source, np.ndarray):
        return Recording.from_frames(source) if source.ndim == 4 else Segmentation.from_labels(source)
    if isinstance(source, Observation | Recording | Segmentation | str | os.PathLike):
        return source
    kind = type(source).__name__
    raise ValueError(f"source: expected an Observation, a Recording, a Segmentation, an array or a path, got {kind}")


def _as_movie(recording: object) -> Recording | str | os.PathLike[str] | None:
    if isinstance(recording, np.ndarray):
        return Recording.from_frames(recording)
    if not isinstance(recording, Recording | str | os.PathLike | None):
        raise ValueError(f"recording: expected a Recording, frames or a path, got {type(recording).__name__}")
    return recording


class ChainExplorer(ipywidgets.VBox):  # type: ignore[misc]
    """The widget that :func:`chain_explorer` makes.

    Parameters
    ----------
    look : callable
        Gives what is to be explored; called in a thread with ``tell=`` a function of (done, of). Without it there is
        nothing to see yet.

    Attributes
    ----------
    book : ChainBook or None
        What is shown; None before the first frame is.
    alert : str
        The sentence that says what went wrong, or nothing.
    on_changed : list of callable
        Called when something else is shown, and when segments were named or merged.
    """

    def __init__(self, look: Callable[..., Seen] | None = None) -> None:
        self.book: ChainBook | None = None
        self.alert = ""
        self.on_changed: list[Callable[[], object]] = []
        self._shown: tuple[Any, ...] = ()
        self._lit: tuple[Any, ...] = ()
        self._is_setting = False
        self._told_of: Observation | None = None
        self._alert = ipywidgets.HTML("")
        self._work = Work(on_done=self._show, on_failed=self.say)
        self._frame = ClickablePicture(description="frame with segments and scene graph", tooltip=_KEYS)
        self._chain = ClickablePicture(description="event chain", tooltip=_KEYS)
        # In the page the key End goes no further than to where a slider ended at first.
        self._place = ipywidgets.IntSlider(
            min=0, max=MOST_FRAMES, readout=False, layout={"flex": "1 1 auto", "min_width": "180px"}
        )
        self._play = ipywidgets.Play(min=0, max=1, interval=_LEAST_INTERVAL_MS)
        self._told = ipywidgets.Label("", layout={"min_width": "220px"})
        self._back = self._button("", "step-backward", "to the key frame before", lambda book: book.step_column(-1))
        self._next = self._button("", "step-forward", "to the next key frame", lambda book: book.step_column(1))
        self._segments = ipywidgets.SelectMultiple(
            rows=5, description="segments", tooltip="or click them in the picture", layout={"width": "300px"}
        )
        self._name = ipywidgets.Text(
            placeholder="name of the chosen segment", continuous_update=False, layout={"width": "230px"}
        )
        self._rename = self._button("name", "tag", "name the chosen segment", self._rename_chosen)
        self._merge = self._button("merge", "compress", "the chosen segments are one object", self._merge_chosen)
        self._undo = self._button("undo", "undo", "take the last name or merging back", lambda book: book.undo())
        self._body = self._laid_out()
        super().__init__([self._work, self._alert, self._body])
        self.add_class("sec-lab-explorer")
        self._listen()
        self._body.layout.display = "none"
        if look is not None:
            self.explore(look)

    def explore(self, look: Callable[..., Seen]) -> None:
        """Show something else, which ``look`` gives; it is called in a thread with ``tell``."""
        self._work.stop()
        self._work.wait()
        self.book = None
        self._body.layout.display = "none"
        self._alert.value = ""
        self._work.start(lambda tell: look(tell=tell))
        self._work.wait(_AT_ONCE_S)

    def wait(self, timeout_s: float | None = None) -> "ChainExplorer":
        """Wait until it is shown, for those who go on in Python."""
        self._work.wait(timeout_s)
        return self

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """What a notebook stores; while the report is made also the explorer as a page without a kernel shows it."""
        return super()._repr_mimebundle_(**options) | self.for_pages()

    def for_pages(self) -> dict[str, str]:
        """While the report is made, what its pages show instead of a live explorer, by kind of output."""
        book = self.wait().book if os.environ.get(FOR_PAGES) else None
        return {} if book is None else {SCRUBBER: scrubber_html(book)}

    def __repr__(self) -> str:
        # Nothing in a stored notebook changes from one execution to the next but the number of the widget.
        return f"{type(self).__name__}()"

    def _laid_out(self) -> ipywidgets.Widget:
        row = partial(ipywidgets.HBox, layout={"flex_flow": "row wrap", "align_items": "center"})
        ways = row([self._play, self._back, self._next, self._place])
        naming = ipywidgets.VBox([row([self._name, self._rename]), row([self._merge, self._undo])])
        # The words have a line of their own, so that nothing moves when they grow.
        return ipywidgets.VBox([self._frame, ways, self._told, self._chain, row([self._segments, naming])])

    def _button(self, words: str, icon: str, tooltip: str, act: Callable[[ChainBook], object]) -> ipywidgets.Button:
        width = "110px" if words else "42px"
        button = ipywidgets.Button(description=words, icon=icon, tooltip=tooltip, layout={"width": width})
        button.on_click(lambda _: self._do(act))
        return button

    def _listen(self) -> None:
        # Joined in the page, so that playing needs no kernel to move the slider.
        ipywidgets.jslink((self._play, "value"), (self._place, "value"))
        self._place.observe(lambda change: self._moved(change["new"]), "value")
        self._segments.observe(lambda change: self._picked(change["new"]), "value")
        # Comes with Enter, or when the field is left.
        self._name.observe(lambda _: self._typed(), "value")
        self._frame.on_click(lambda x, y: self._do(lambda book: book.click_frame(x, y)))
        self._chain.on_click(lambda x, y: self._do(lambda book: book.click_chain(x, y)))
        for picture in (self._frame, self._chain):
            picture.on_key(self._pressed)
            picture.observe(lambda change: self._themed(is_dark=change["new"]), "is_dark")

    def _show(self, seen: Seen) -> None:
        self.book = ChainBook(seen, theme=DARK if self._frame.is_dark else LIGHT)
        self._shown = self._lit = ()
        last = len(self.book.numbers) - 1
        self._is_setting = True
        self._place.max = self._play.max = max(1, last)
        self._place.value = 0
        self._place.disabled = self._play.disabled = last == 0
        self._is_setting = False
        times = [frame.time_s for frame in seen.frames[:2]]
        if len(times) == 2 and None not in times:
            self._play.interval = max(_LEAST_INTERVAL_MS, round(1000 * (times[1] - times[0])))  # type: ignore[operator]
        self._refresh()
        self._body.layout.display = ""
        self._changed(self.book)

    def say(self, sentence: str) -> None:
        """Show a sentence in red, or none."""
        self.alert = sentence
        self._alert.value = as_alert(sentence)

    def _do(self, act: Callable[[ChainBook], object]) -> None:
        """Do something with the book, and show what came of it; what goes wrong is said."""
        if self.book is None:
            return
        self.say("")
        try:
            act(self.book)
            self._refresh()
        except Exception as error:  # noqa: BLE001 - an error in a callback would only reach a log that nobody reads
            self.say(sentence_of(error))
        if self.book.observation is not self._told_of:
            self._changed(self.book)

    def _changed(self, book: ChainBook) -> None:
        """Tell those who want to know that something else is seen now."""
        self._told_of = book.observation
        for changed in self.on_changed:
            changed()

    def _moved(self, place: int) -> None:
        if not self._is_setting:
            self._do(lambda book: book.go_to(place))

    def _picked(self, labels: tuple[int, ...]) -> None:
        if not self._is_setting and self.book is not None:
            # What was chosen first stays first, as its label is the one that remains.
            kept = [label for label in self.book.chosen if label in labels]
            self._do(lambda book: book.choose([*kept, *labels]))

    def _rename_chosen(self, book: ChainBook) -> None:
        if len(book.chosen) != 1:
            raise ValueError("name: choose one segment, by a click in the picture or in the list")
        book.rename(book.chosen[0], self._name.value)

    def _typed(self) -> None:
        if not self._is_setting and self.book is not None and len(self.book.chosen) == 1:
            self._do(self._rename_chosen)

    def _merge_chosen(self, book: ChainBook) -> None:
        if len(book.numbers) <= _MERGED_AT_ONCE:
            book.merge(book.chosen)
            return
        chosen = list(book.chosen)
        self._work.start(lambda tell: book.merging(chosen, tell=tell), on_done=lambda take: self._do(lambda _: take()))

    def _let_go(self, book: ChainBook) -> None:
        book.row = None
        book.choose([])

    def _pressed(self, key: str) -> None:
        ways: dict[str, Callable[[ChainBook], object]] = {
            "ArrowLeft": lambda book: book.go_to(book.place - 1),
            "ArrowRight": lambda book: book.go_to(book.place + 1),
            "PageUp": lambda book: book.step_column(-1),
            "PageDown": lambda book: book.step_column(1),
            "Home": lambda book: book.go_to(0),
            "End": lambda book: book.go_to(len(book.numbers) - 1),
            "ArrowUp": lambda book: book.step_row(-1),
            "ArrowDown": lambda book: book.step_row(1),
            "Escape": self._let_go,
            "m": self._merge_chosen,
            "u": lambda book: book.undo(),
        }
        if key == " ":
            self._play.playing = not self._play.playing
        elif key in ways:
            self._do(ways[key])

    def _themed(self, *, is_dark: bool) -> None:
        self._shown = self._lit = ()
        self._do(lambda book: book.in_theme(DARK if is_dark else LIGHT))

    def _refresh(self) -> None:
        """Send what changed, and nothing else."""
        book = self.book
        assert book is not None
        chosen, pair = tuple(book.chosen), book.pair
        now = (id(book.observation), book.place, chosen, pair)
        if now != self._shown:
            if self._shown[:1] != now[:1]:
                self._list_segments(book)
            self._shown = now
            self._frame.png = book.frame_file()
            lit = (id(book.table), book.column, book.row)
            if lit != self._lit:
                self._lit = lit
                self._chain.width = book.table.width_px
                self._chain.png = book.chain_file()
        self._is_setting = True
        self._place.value = self._play.value = book.place
        self._segments.value = chosen
        self._name.value = (book.observation.names.get(chosen[0]) or "") if len(chosen) == 1 else ""
        self._is_setting = False
        if self._told.value != book.told:
            self._told.value = book.told
        self._undo.disabled = not book.can_undo

    def _list_segments(self, book: ChainBook) -> None:
        self._is_setting = True
        self._segments.value = ()
        self._segments.options = book.segments()
        self._is_setting = False
