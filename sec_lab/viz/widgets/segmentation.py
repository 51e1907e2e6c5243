"""Segmentation explorer: what the parameters of superparamagnetic clustering make of a frame (§2.2)."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, get_args

import ipywidgets as widgets
import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.recording import Recording
from sec_lab.segmentation import Segmentation
from sec_lab.segmentation.potts import DEFAULT, ColourSpace, PottsParameters
from sec_lab.segmentation.quality import covering
from sec_lab.viz.exploring import FollowedMovie, SegmentedFrame, beside_each_other, followed_movie, segmented_frame
from sec_lab.viz.frame_shelf import FrameShelf
from sec_lab.viz.svg.paper import jpeg, sentence
from sec_lab.viz.widgets.base import INSET, LABELS, TOGGLES, WIDE, Explorer, never_raises, row_of
from sec_lab.viz.widgets.latest import Turn
from sec_lab.viz.widgets.picture import ClickablePicture

Movie: TypeAlias = Recording | str | os.PathLike[str] | ArrayLike
Truth: TypeAlias = Segmentation | ArrayLike


@dataclass(frozen=True, eq=False)
class _Shown:
    """One frame, its segments and the picture of both."""

    place: int
    number: int
    found: SegmentedFrame
    truth: NDArray[np.integer[Any]] | None
    picture: bytes
    shown_step_px: int


class SegmentationExplorer(Explorer):
    """Controls of the clustering and a frame; made by :func:`segmentation_explorer`.

    Attributes
    ----------
    frame, alpha, anneal_sweeps, smooth_sweeps, blur_sigma_px, minimum_size_px, minimum_thickness_px, colour_space
        The controls, ipywidgets.
    follow : ipywidgets.Button
        Follows segments through the movie, with these parameters.
    said, movie_said, pointed : ipywidgets.HTML
        Number of segments and covering of the frame, the same of the movie once it was followed, and the segment that
        was clicked, in a sentence.
    picture : ClickablePicture
        The frame; beside it the segments, and the true ones where they are known.
    """

    def __init__(self, recording: Movie, truth: Truth | None, *, frame: int, parameters: PottsParameters) -> None:
        super().__init__()
        if not isinstance(parameters, PottsParameters):
            raise TypeError(f"parameters: expected PottsParameters, got {type(parameters).__name__}")
        if isinstance(frame, bool) or not isinstance(frame, int | np.integer):
            raise TypeError(f"frame: expected a whole number, got {frame!r}")
        movie = _as_recording(recording)
        n_frames = _count(movie)
        if not 0 <= frame < n_frames:
            raise ValueError(f"frame: expected one from 0 to {n_frames - 1}, got {frame}")
        self._frames = FrameShelf(movie)
        self._movie, self._true = movie, None if truth is None else _as_labels(truth)
        self._truth = None if self._true is None else FrameShelf(self._true)
        self._kept = parameters
        self.frame = widgets.IntSlider(
            value=frame, min=0, max=n_frames - 1, description=f"frame (no. of {n_frames})", style=LABELS,
            disabled=n_frames == 1, layout=WIDE,
        )  # fmt: skip
        self.alpha = widgets.FloatSlider(
            value=parameters.alpha, min=0.1, max=10, step=0.1, description="α (of the mean colour difference)",
            style=LABELS, layout=WIDE, readout_format=".1f",
        )  # fmt: skip
        self.anneal_sweeps = _whole("sweeps of annealing (number)", parameters.anneal_sweeps, 1, 60)
        self.smooth_sweeps = _whole("sweeps of smoothing (number)", parameters.smooth_sweeps, 0, 12)
        self.blur_sigma_px = widgets.FloatSlider(
            value=parameters.blur_sigma_px, min=0, max=3, step=0.1, description="blur σ (px)", style=LABELS,
            layout=WIDE, readout_format=".1f",
        )  # fmt: skip
        self.minimum_size_px = _whole("minimum size (px)", parameters.minimum_size_px, 1, 1000)
        self.minimum_thickness_px = _whole("minimum thickness (px)", parameters.minimum_thickness_px, 0, 12)
        self.colour_space = widgets.ToggleButtons(
            options=list(get_args(ColourSpace)), value=parameters.colour_space, description="colours in",
            style=TOGGLES, layout=INSET,
        )  # fmt: skip
        self.follow = widgets.Button(
            description="Follow through the movie", disabled=n_frames == 1, layout={"width": "auto"},
            tooltip="segments keep their labels from frame to frame; until a parameter changes, frames show these",
        )  # fmt: skip
        self.said, self.movie_said, self.pointed = widgets.HTML(), widgets.HTML(), widgets.HTML()
        self.picture = ClickablePicture(
            description="a frame, and its segments beside it", tooltip="click a segment to see how large it is"
        )
        controls = [
            self.alpha, self.anneal_sweeps, self.smooth_sweeps, self.blur_sigma_px, self.minimum_size_px,
            self.minimum_thickness_px, self.colour_space,
        ]  # fmt: skip
        self.show(
            row_of(self.frame, self.follow), row_of(*controls), self.work_bar, self.said, self.movie_said, self.picture,
            self.pointed,
        )  # fmt: skip
        self._shown: _Shown | None = None
        self._followed: FollowedMovie | None = None
        self._worker = self.latest(self._show)
        self._follower = self.latest(self._show_followed)
        self.picture.on_click(self._click)
        self.follow.on_click(lambda _: self._follow())
        self.on_move([self.frame], self._segment)
        self.on_move(controls, self._segment_anew)
        with self.guard():
            self._segment()

    @property
    def parameters(self) -> PottsParameters:
        """What the controls say."""
        return PottsParameters(
            alpha=self.alpha.value, colour_space=self.colour_space.value, blur_sigma_px=self.blur_sigma_px.value,
            anneal_sweeps=self.anneal_sweeps.value, relax_sweeps=self._kept.relax_sweeps,
            smooth_sweeps=self.smooth_sweeps.value, temperature=self._kept.temperature, cooling=self._kept.cooling,
            relax_temperature=self._kept.relax_temperature, minimum_size_px=self.minimum_size_px.value,
            minimum_thickness_px=self.minimum_thickness_px.value, depth_jump_m=self._kept.depth_jump_m,
        )  # fmt: skip

    @property
    def labels(self) -> NDArray[np.uint16] | None:
        """Label image that is shown, (height, width); None as long as there is none."""
        return None if self._shown is None else self._shown.found.labels

    def wait(self) -> None:
        """Wait until the segments are shown."""
        self._follower.wait()
        self._worker.wait()

    def scrubbed(self) -> tuple[widgets.Widget, Sequence[Any]]:
        """The α, and where it can stand on a page without a kernel."""
        return self.alpha, [float(step) for step in range(1, 11)]

    def _segment(self) -> None:
        place, parameters, followed = self.frame.value, self.parameters, self._followed
        self._worker.ask(lambda turn: self._work(place, parameters, followed, turn))

    def _segment_anew(self) -> None:
        # What was followed was followed with other parameters.
        self._followed, self.movie_said.value = None, ""
        self._follower.cancel()
        self._segment()

    def _follow(self) -> None:
        with self.guard():
            parameters = self.parameters
            self._follower.ask(
                lambda turn: followed_movie(
                    self._movie, parameters=parameters, truth=self._true, report=turn.report
                )
            )  # fmt: skip

    def _show_followed(self, followed: FollowedMovie) -> None:
        self._followed = followed
        said = f"followed through {len(followed.labels)} frames: {followed.n_labels} labels"
        if followed.quality is not None:
            judged = followed.quality
            said += f", covering {judged.covering:.3f}, labels kept {judged.kept:.3f} (1 is best)"
        self.movie_said.value = sentence(f"{said}.")
        self._segment()

    def _work(
        self, place: int, parameters: PottsParameters, followed: FollowedMovie | None, turn: Turn
    ) -> _Shown:  # fmt: skip
        frame = self._frames.at(place, report=turn.report)
        truth = None if self._truth is None else self._true_labels(place, frame.image.shape[:2], turn)
        if followed is not None and place < len(followed.labels):
            labels_here = followed.labels[place]
            found = SegmentedFrame(labels_here, None if truth is None else covering(labels_here, truth))
        else:
            found = segmented_frame(frame.image, parameters=parameters, depth_m=frame.depth_m, truth=truth)
        labels = [found.labels] if truth is None else [found.labels, truth]
        picture = beside_each_other(frame.image, *labels)
        step = -(-frame.image.shape[0] // picture.shape[0])
        return _Shown(place, frame.index, found, truth, jpeg(picture), step)

    def _true_labels(self, place: int, size: tuple[int, ...], turn: Turn) -> NDArray[np.integer[Any]]:
        assert self._truth is not None
        try:
            labels = np.asarray(self._truth.at(place, report=turn.report))
        except ValueError:
            raise ValueError(f"truth: expected a label image for every frame, got none for frame {place}") from None
        if labels.shape != size:
            expected, came = ("×".join(map(str, shape)) for shape in (size, labels.shape))
            raise ValueError(f"truth: expected label images of {expected} like the frames, got {came}")
        return labels

    def _show(self, shown: _Shown) -> None:
        self._shown = shown
        n_segments = len(np.unique(shown.found.labels))
        said = f"frame {shown.number}: {n_segments} segment{'s' if n_segments != 1 else ''}"
        if shown.found.covering is not None and shown.truth is not None:
            said += f"; {len(np.unique(shown.truth))} true ones are covered by {shown.found.covering:.3f} (1 is best)"
        columns = "left: frame; right: segments" if shown.truth is None else "left to right: frame, segments, truth"
        self.said.value = sentence(f"{said}. {columns.capitalize()}.")
        self.picture.png = shown.picture
        self.pointed.value = ""

    def _click(self, x: int, y: int) -> None:
        shown = self._shown
        if shown is None:
            return
        height, width = shown.found.labels.shape
        wide = -(-width // shown.shown_step_px) + 6
        column, row = (x % wide) * shown.shown_step_px, y * shown.shown_step_px
        if column < width and row < height:
            label = int(shown.found.labels[row, column])
            area = int((shown.found.labels == label).sum())
            self.pointed.value = sentence(
                f"column {column} px, row {row} px: segment {label}, {area} px ({100 * area / (height * width):.1f} %)"
            )


@never_raises
def segmentation_explorer(
    recording: Movie, truth: Truth | None = None, *, frame: int = 0, parameters: PottsParameters = DEFAULT
) -> Explorer:
    """Turn the knobs of superparamagnetic clustering on any frame of a movie (§2.2).

    Every frame is segmented by itself, unless segments are followed through the movie, at the press of a button.

    Parameters
    ----------
    recording : Recording, path-like, (n, height, width, 3) or (height, width, 3) array_like of uint8
        A movie, where to find one, or a single picture.
    truth : Segmentation, (n, height, width) or (height, width) array_like of int, optional
        True segments; the covering is then told.
    frame : int, optional
        Place of the frame that is shown first, from 0 on.
    parameters : PottsParameters, optional
        Where the controls begin.

    Returns
    -------
    SegmentationExplorer
        Or, if something is wrong with what was given, an explorer that says what.

    Examples
    --------
    >>> image = np.full((20, 30, 3), 40, dtype=np.uint8)
    >>> image[5:15, 10:20] = (200, 40, 40)
    >>> explorer = segmentation_explorer(image, truth=image[:, :, 0] > 100)
    >>> explorer.wait()
    >>> explorer.labels.max()
    np.uint16(2)
    """
    return SegmentationExplorer(recording, truth, frame=frame, parameters=parameters)


def _whole(description: str, value: int, low: int, high: int) -> widgets.IntSlider:
    return widgets.IntSlider(
        value=value, min=low, max=max(high, value), description=description, style=LABELS, layout=WIDE
    )


def _as_recording(recording: Movie) -> Recording:
    if isinstance(recording, Recording):
        return recording
    if isinstance(recording, str | os.PathLike):
        return Recording.open(recording)
    array = np.asarray(recording)
    return Recording.from_frames(array[np.newaxis] if array.ndim == 3 else array)


def _count(movie: Recording) -> int:
    return movie.n_frames if movie.n_frames is not None else sum(1 for _ in movie)


def _as_labels(truth: Truth) -> Iterable[ArrayLike]:
    if isinstance(truth, Segmentation):
        return truth
    if isinstance(truth, Sequence) and not isinstance(truth, str):
        return truth
    array = np.asarray(truth)
    if array.ndim not in (2, 3) or array.dtype.kind not in "uib":
        raise ValueError(
            "truth: expected label images, shape (n, height, width) or (height, width), of whole numbers, got shape "
            f"{array.shape} of {array.dtype}"
        )
    whole = array.astype(np.uint8) if array.dtype.kind == "b" else array
    return whole[np.newaxis] if array.ndim == 2 else whole
