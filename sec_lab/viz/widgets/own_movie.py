"""One's own movie in five minutes: open or upload it, see its chain, name and merge, compare, save."""

import html
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ipywidgets

from sec_lab.files import write_whole
from sec_lab.graphml import write
from sec_lab.observation import Observation
from sec_lab.recording import Recording
from sec_lab.segmentation.masks import open_masks
from sec_lab.viz.page import observation_page
from sec_lab.viz.widgets.explorer import ChainExplorer
from sec_lab.viz.widgets.nearest import nearest, repository_chains
from sec_lab.viz.widgets.seen import Seen, see
from sec_lab.viz.widgets.sentences import as_alert, sentence_of
from sec_lab.viz.widgets.upload import MOST_MB, Upload
from sec_lab.viz.widgets.work import Tell, Work

if TYPE_CHECKING:
    import pandas as pd

_N_SHOWN = 10
_SHOWN = {"temporal": "ψ temporal in %", "spatial": "ψ spatial in %"}


def own_movie(
    path: str | os.PathLike[str] = "", *, masks: str | os.PathLike[str] = "", folder: str | os.PathLike[str] = "."
) -> "OwnMovie":
    """Open a movie of your own: its segments, graphs and chain, names, comparison with the repository's movies, files.

    Parameters
    ----------
    path : path-like, optional
        Movie or folder of pictures; can be typed, or a movie uploaded (up to 500 MB), in the widget.
    masks : path-like, optional
        Label masks of any tracker (:func:`~sec_lab.segmentation.masks.open_masks`), with the movie or alone.
    folder : path-like, optional
        Where files are saved; made if it is not there.

    Returns
    -------
    OwnMovie
        A widget; ``explorer.book.observation`` is what was seen, with names and merged segments.

    Examples
    --------
    >>> widget = own_movie("no/such/movie.mp4").wait()
    >>> "there is no such file" in widget.explorer.alert
    True
    """
    options: dict[str, object] = {"path": path, "masks": masks, "folder": folder}
    for name, given in options.items():
        if not isinstance(given, str | os.PathLike):
            widget = OwnMovie("", masks="", folder=".")
            widget.explorer.say(f"{name}: expected a path, got {type(given).__name__}; chain_explorer takes arrays.")
            return widget
    return OwnMovie(path, masks=masks, folder=folder)


def look_at(path: str, masks: str, tell: Tell) -> tuple[Seen, Recording | None]:
    """Open a movie, label masks or both, and observe them.

    Parameters
    ----------
    path, masks : str
        Empty: there is none.
    tell : callable
        Called with the number of frames so far and of all.

    Returns
    -------
    Seen
    Recording or None

    Raises
    ------
    ValueError
        If nothing is given or it cannot be used, pictures and masks do not fit, or there are fewer than two frames.

    Examples
    --------
    >>> look_at("", "", lambda done, of: None)
    Traceback (most recent call last):
    ...
    ValueError: movie: expected the path of a movie, of a folder of pictures or of masks, got none
    """
    if not path and not masks:
        raise ValueError("movie: expected the path of a movie, of a folder of pictures or of masks, got none")
    movie = Recording.open(Path(path).expanduser()) if path else None
    found = open_masks(Path(masks).expanduser()) if masks else None
    for frames in (movie, found):
        if frames is not None and frames.n_frames is not None and frames.n_frames < 2:
            raise ValueError("movie: expected at least two frames, got 1; one picture has relations, but no event")
    if found is not None:
        seen = see(found, recording=movie, tell=tell)
    else:
        assert movie is not None
        seen = see(movie, tell=tell)
    if len(seen.frames) < 2:
        raise ValueError(f"movie: expected at least two frames, got {len(seen.frames)}")
    return seen, movie


def save(observation: Observation, recording: Recording | None, *, folder: Path, name: str) -> tuple[Path, Path]:
    """Write what was seen as GraphML (A.2) and as a page for any browser.

    Parameters
    ----------
    observation : Observation
    recording : Recording or None
        The movie, for the pictures of the page.
    folder : Path
        Must exist.
    name : str
        Of both files, without an ending.

    Returns
    -------
    tuple of Path
        The GraphML file and the page.

    Raises
    ------
    ValueError
        If the name is empty or leads out of the folder, or a file cannot be written.

    Examples
    --------
    >>> from sec_lab.scene_graph import SceneGraph
    >>> save(Observation([SceneGraph([1], [[0]])], [0]), None, folder=Path("."), name="../x")
    Traceback (most recent call last):
    ...
    ValueError: name: expected a name for the files, without slashes, got '../x'
    """
    if not name.strip() or name != Path(name).name or name.startswith("."):
        raise ValueError(f"name: expected a name for the files, without slashes, got {name!r}")
    chain, page = folder / f"{name}.graphml", folder / f"{name}.html"
    text = observation_page(observation, recording, title=name.replace("_", " "))
    write(chain, observation)
    write_whole(page, text)
    return chain, page


class OwnMovie(ipywidgets.VBox):  # type: ignore[misc]
    """The widget that :func:`own_movie` makes.

    Attributes
    ----------
    explorer : ChainExplorer
        Shows what was seen.
    nearest : pandas.DataFrame or None
        The last comparison, see :func:`~sec_lab.viz.widgets.nearest.nearest`.
    saved : tuple of Path
        Files that were written last.
    """

    def __init__(
        self, path: str | os.PathLike[str], *, masks: str | os.PathLike[str], folder: str | os.PathLike[str]
    ) -> None:
        self.nearest: pd.DataFrame | None = None
        self.saved: tuple[Path, ...] = ()
        self._folder = Path(folder)
        self._recording: Recording | None = None
        self.explorer = ChainExplorer()
        wide = {"width": "440px"}
        labelled = {"description_width": "60px"}
        self._path = ipywidgets.Text(
            os.fspath(path), description="movie", placeholder="a file, or a folder of pictures", layout=wide,
            style=labelled,
        )  # fmt: skip
        self._masks = ipywidgets.Text(
            os.fspath(masks), description="masks", placeholder="of a tracker, if you have any", layout=wide,
            style=labelled,
        )  # fmt: skip
        self._open = _button("open", "folder-open", "observe the movie", self.observe_now)
        self._upload = Upload(f"or upload a movie (up to {MOST_MB} MB):")
        self._upload.on_file(self._uploaded)
        self._upload.on_problem(self.explorer.say)
        self._compare = _button("compare", "search", "with the movies of the repository", self.compare)
        self._work = Work(on_done=self._compared, on_failed=self._say)
        self._table = ipywidgets.HTML("")
        self._name = ipywidgets.Text("my_movie", description="save as", layout={"width": "300px"}, style=labelled)
        self._save = _button("save", "save", "as GraphML and as a page to share", self.save)
        self._said = ipywidgets.HTML("")
        self._below = ipywidgets.VBox(
            [_row([self._compare, self._name, self._save]), self._work, self._said, self._table],
            layout={"display": "none"},
        )
        super().__init__(
            [_row([self._path, self._open]), _row([self._masks, self._upload]), self.explorer, self._below]
        )
        self.add_class("sec-lab-own-movie")
        self.explorer.on_changed.append(self._changed)
        if os.fspath(path) or os.fspath(masks):
            self.observe_now()

    def __repr__(self) -> str:
        return "OwnMovie()"

    def _repr_mimebundle_(self, **options: Any) -> Any:
        return super()._repr_mimebundle_(**options) | self.explorer.for_pages()

    def observe_now(self) -> None:
        """Observe what the fields name, in a thread."""
        self._below.layout.display = "none"
        self.explorer.explore(partial(self._look, self._path.value.strip(), self._masks.value.strip()))

    def wait(self, timeout_s: float | None = None) -> "OwnMovie":
        """Wait until the work is done, for those who go on in Python."""
        self.explorer.wait(timeout_s)
        self._work.wait(timeout_s)
        return self

    def compare(self) -> None:
        """Compare the chain as it is now with those of the repository, in a thread."""
        self._say("")
        book = self.explorer.book
        chain = None if book is None else book.chain
        if chain is None:
            self._say("compare: a chain needs at least two segments.")
            return
        self._work.start(lambda tell: nearest(chain, repository_chains(), tell=tell), unit="movies")

    def save(self) -> None:
        """Write the GraphML file and the page."""
        self._say("")
        if self.explorer.book is None:
            return
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            observation = self.explorer.book.observation
            self.saved = save(observation, self._recording, folder=self._folder, name=self._name.value.strip())
        except Exception as error:  # noqa: BLE001 - an error in a callback would only reach a log that nobody reads
            self._say(sentence_of(error))
            return
        self._said.value = "written: " + " and ".join(f"<code>{html.escape(str(path))}</code>" for path in self.saved)

    def _look(self, path: str, masks: str, *, tell: Tell) -> Seen:
        seen, self._recording = look_at(path, masks, tell)
        return seen

    def _uploaded(self, path: Path) -> None:
        self._path.value, self._masks.value = str(path), ""
        self._name.value = path.stem
        self.observe_now()

    def _changed(self) -> None:
        self._table.value = self._said.value = ""
        self._below.layout.display = ""

    def _compared(self, table: "pd.DataFrame") -> None:
        self.nearest = table
        self._table.value = _as_table(table)

    def _say(self, sentence: str) -> None:
        self._said.value = as_alert(sentence)


def _row(children: list[Any]) -> ipywidgets.HBox:
    return ipywidgets.HBox(children, layout={"flex_flow": "row wrap", "align_items": "center"})


def _button(words: str, icon: str, tooltip: str, act: Callable[[], object]) -> ipywidgets.Button:
    button = ipywidgets.Button(description=words, icon=icon, tooltip=tooltip, layout={"width": "120px"})
    button.on_click(lambda _: act())
    return button


def _as_table(table: "pd.DataFrame") -> str:
    """The most similar movies as an HTML table."""
    shown = table.head(_N_SHOWN)
    cell = '<td style="padding: 0 0.8em; text-align: {}">{}</td>'
    rows = [
        cell.format("left", html.escape(str(name)))
        + "".join(cell.format("right", f"{row[what]:.1f}") for what in _SHOWN)
        for name, row in shown.iterrows()
    ]
    heads = "".join(f'<th style="padding: 0 0.8em">{head}</th>' for head in ("movie", *_SHOWN.values()))
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return (
        f'<table style="line-height: 1.5"><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>'
        f"the first {len(shown)} of {len(table)} movies"
    )
