"""Steps 1 to 4 joined, frame by frame: from pictures to the observation of an action (Fig. 2.2)."""

import os
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing
from functools import partial
from importlib import import_module
from itertools import count, tee
from operator import length_hint
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array
from sec_lab.event_chain import Names
from sec_lab.observation import Observation
from sec_lab.recording import Calibration, Frame, Recording
from sec_lab.recording.sharing import DepthOfFrame, ReadAhead, shared, with_depth
from sec_lab.relations import SegmentRelations, edge_count_relations, scan_line_relations
from sec_lab.scene_graph import MainGraphs, main_graphs, scene_graph
from sec_lab.segmentation import Segmentation, check_fit

RelationFunction = Callable[[ArrayLike], SegmentRelations]
RelationMethod = Literal["scan lines", "edge counting"] | RelationFunction

Segmenter = Callable[[Recording], Segmentation]
SegmentationMethod = Literal["layers", "potts"] | Segmenter

LabelledFrame = tuple[int, NDArray[np.uint16], NDArray[np.float32] | None]
"""Frame number, label image, and depth in metres where there is any."""
_LabelledFrames = Generator[LabelledFrame, None, None] | ReadAhead[LabelledFrame]
RelationsOverTime = Callable[[Iterable[LabelledFrame]], Iterable[tuple[int, SegmentRelations]]]

_METHODS: dict[str, RelationFunction] = {
    "scan lines": scan_line_relations,
    "edge counting": edge_count_relations,
}

# Imported when they are used: each brings compiled kernels along.
_SEGMENTERS = {
    "layers": ("sec_lab.segmentation.layers", "layered_segments"),
    "potts": ("sec_lab.segmentation.tracking", "track_segments"),
}
_OVER_TIME = {"steady": ("sec_lab.relations.over_time", "steady_relations")}
_DISPARITY = ("sec_lab.segmentation.disparity_stream", "DisparityEstimator")
_DEPTH = ("sec_lab.segmentation.disparity", "depth_from_disparity")


def observe(
    recording: Recording | Segmentation | str | os.PathLike[str],
    *,
    segmentation: SegmentationMethod | Segmentation = "layers",
    over_time: Literal["steady"] | RelationsOverTime | None = "steady",
    relations: RelationMethod = "scan lines",
    names: Names | None = None,
    progress: bool = False,
) -> Observation:
    """What is seen in a movie: steps 1 to 4 of Fig. 2.2.

    Frames are read one after the other, each once, and only the graphs of key frames are kept, so a movie may be of any
    length. Depth is that of the recording, or comes from the pictures of a calibrated stereo pair; segmentation and
    relations both use it.

    Parameters
    ----------
    recording : Recording, Segmentation or path-like
        A movie, or label images alone. A path is opened by :meth:`Recording.open`.
    segmentation : {"layers", "potts"}, callable or Segmentation, optional
        Step 1 (§2.2): :func:`~sec_lab.segmentation.layers.layered_segments` (default),
        :func:`~sec_lab.segmentation.tracking.track_segments`, any function from a recording to a
        :class:`~sec_lab.segmentation.Segmentation` (``functools.partial`` sets parameters), or what any other tracker
        has found in the movie (:func:`~sec_lab.segmentation.masks.open_masks`). A method works in a thread of its own,
        one frame ahead of the relations.
    over_time : {"steady"}, callable or None, optional
        Step 2 (§2.3): :func:`~sec_lab.relations.over_time.steady_relations` (default), any function from a stream of
        (frame number, label image, depth in metres or None) to a stream of (frame number, relations), or None:
        ``relations`` of each frame by itself.
    relations : {"scan lines", "edge counting"} or callable, optional
        How relations of a frame by itself are found, see :func:`observe_segments`; only with ``over_time=None``.
    names : mapping of int to str or None, optional
        Names of segments; those of the segmentation if left out.
    progress : bool, optional
        Show a progress bar.

    Returns
    -------
    Observation
        With ``segmentation``: iterating over it gives the label images again. Positions are segment centres (column,
        row) in pixels.

    Raises
    ------
    ValueError
        If a method is unknown, label images do not fit the movie, or for the reasons of :meth:`Recording.open` and
        :func:`observe_segments`. What is wrong with a frame is said with its number.

    Examples
    --------
    A red box is pushed to a green one:

    >>> from functools import partial
    >>> from sec_lab.segmentation.colour import NamedColour, colour_segmentation
    >>> movie = np.zeros((3, 8, 24, 3), dtype=np.uint8)
    >>> movie[:, 2:6, 16:22] = 0, 200, 0
    >>> for frame, left in zip(movie, (1, 5, 10), strict=True):
    ...     frame[2:6, left : left + 6] = 200, 0, 0
    >>> colours = [NamedColour("red box", (345, 15), (50, 100)), NamedColour("green box", (90, 150), (50, 100))]
    >>> seen = observe(Recording.from_frames(movie), over_time=None,
    ...                segmentation=partial(colour_segmentation, colours=colours))
    >>> seen.chain.to_frame().loc["green box, red box"].tolist(), seen.key_frames
    ([0, 2], array([0, 2]))
    """
    relations = _relation_function(relations)
    if over_time is not None and relations is not scan_line_relations:
        raise ValueError("relations: expected those of each frame by itself (over_time=None) for a method of their own")
    follow: RelationsOverTime | None = _named(over_time, _OVER_TIME, what="over_time")
    labelled: _LabelledFrames
    if isinstance(recording, Segmentation):
        found, labelled, n_frames = recording, _without_depth(recording), recording.n_frames
    else:
        movie = recording if isinstance(recording, Recording) else Recording.open(recording)
        movie = _with_stereo_depth(movie)
        found, labelled = _segmented(movie, segmentation)
        n_frames = movie.n_frames if found.n_frames is None else found.n_frames
    # An error in one stage stops all of them, wherever they run.
    with closing(labelled):
        coming: Iterable[LabelledFrame] = labelled
        if progress:
            from tqdm import tqdm

            coming = tqdm(labelled, total=n_frames, unit="frame")
        followed: Iterable[tuple[int, SegmentRelations]]
        if follow is None:
            followed = ((number, _found(relations, labels, number)) for number, labels, _ in coming)
        else:
            followed = follow(coming)
        main = _main_graphs(followed)
    return Observation(main.graphs, main.key_frames, found.names if names is None else names, "px", found)


def segmenter(method: SegmentationMethod) -> Segmenter:
    """The function from a recording to its segmentation that a name stands for; a function is given back.

    Raises
    ------
    ValueError
        If the name is unknown.

    Examples
    --------
    >>> segmenter("snake")
    Traceback (most recent call last):
    ...
    ValueError: segmentation: expected one of ('layers', 'potts') or a function, got 'snake'
    """
    return cast(Segmenter, _named(method, _SEGMENTERS, what="segmentation"))


def observe_segments(
    label_images: Iterable[ArrayLike] | Segmentation,
    *,
    relations: RelationMethod = "scan lines",
    names: Names | None = None,
    frames: Iterable[int] | None = None,
    progress: bool = False,
) -> Observation:
    """What is seen in a movie that is already segmented: steps 2 to 4 (§2.3 to §2.5), each frame by itself.

    The images are read one after the other and only the graphs of key frames are kept, so a movie may be of any length.

    Parameters
    ----------
    label_images : iterable of (height, width) array_like of int, or Segmentation
        One a frame, all of one size, with labels that stay with their segments. A segmentation has names and frame
        numbers of its own. Its background is a segment like any other; ``without_segments(observation,
        [segmentation.background])`` leaves it out afterwards.
    relations : {"scan lines", "edge counting"} or callable, optional
        How relations are found: :func:`~sec_lab.relations.scan_line_relations` (A.1),
        :func:`~sec_lab.relations.edge_count_relations` (§2.3), or any function from a label image to
        :class:`~sec_lab.relations.SegmentRelations`.
    names : mapping of int to str or None, optional
        Names of segments; those of the segmentation if left out.
    frames : iterable of int, optional
        Frame numbers, ascending, at least as many as there are images; those of the segmentation if left out, or
        0, 1, 2, …
    progress : bool, optional
        Show a progress bar.

    Returns
    -------
    Observation
        Positions are segment centres (column, row) in pixels.

    Raises
    ------
    ValueError
        If there is no image, the size changes on the way, an image is no label image, the frame numbers are too few or
        not ascending, the method is unknown, or the function gives something else. What is wrong with an image is said
        with its frame number.

    Examples
    --------
    >>> import numpy as np
    >>> apart, inside = np.ones((2, 5, 5), dtype=np.uint8)
    >>> inside[1:4, 1:4] = 2
    >>> observe_segments([apart, apart, inside, inside]).chain.relations
    array([[9, 1]], dtype=uint8)
    """
    relations = _relation_function(relations)
    numbered: Iterable[tuple[int, ArrayLike]]
    found = label_images if isinstance(label_images, Segmentation) else None
    if found is not None:
        names = found.names if names is None else names
        numbered = found.numbered() if frames is None else _renumbered(found, frames)
    else:
        numbered = _renumbered(label_images, count() if frames is None else frames)
    if progress:
        from tqdm import tqdm

        total = label_images.n_frames if isinstance(label_images, Segmentation) else length_hint(label_images) or None
        numbered = tqdm(numbered, total=total, unit="frame")
    main = _main_graphs((number, _found(relations, image, number)) for number, image in _of_one_size(numbered))
    return Observation(main.graphs, main.key_frames, names, "px", found)


def _segmented(
    movie: Recording, segmentation: SegmentationMethod | Segmentation
) -> tuple[Segmentation, _LabelledFrames]:
    """The segmentation of a movie, and its label images with the depth of their frames."""
    if isinstance(segmentation, Segmentation):
        check_fit(segmentation, movie)
        # Pictures are not looked at, so they need not be decoded where they bring no depth.
        frames = iter(movie) if movie.has_depth else None
        return segmentation, _with_depth_of(frames, segmentation, n_frames=movie.n_frames)
    segment = segmenter(segmentation)
    movie, frames = shared(movie) if movie.has_depth else (movie, None)
    found = segment(movie)
    if not isinstance(found, Segmentation):
        raise ValueError(f"segmentation: expected a Segmentation from the function, got {type(found).__name__}")
    labelled = _with_depth_of(frames, found, n_frames=movie.n_frames)
    # While the relations of a frame are found, the next one is segmented; its labels may be in the same memory.
    return found, ReadAhead((number, np.array(labels), depth) for number, labels, depth in labelled)


def _with_stereo_depth(movie: Recording) -> Recording:
    """The recording with depth from its stereo pictures, where it has none and they can give it."""
    camera = movie.calibration
    if movie.has_depth or not movie.has_right or camera is None or camera.baseline_m is None:
        return movie
    return with_depth(movie, partial(_depth_from_stereo, camera))


def _depth_from_stereo(camera: Calibration) -> DepthOfFrame:
    # Holes stay: what lies there is for the segments to say.
    estimator, to_depth = _imported(_DISPARITY)(fill=False), _imported(_DEPTH)

    def depth_of(frame: Frame) -> NDArray[np.float32]:
        return cast("NDArray[np.float32]", to_depth(estimator(frame.image, frame.right), camera))

    return depth_of


def _without_depth(segmentation: Segmentation) -> Generator[LabelledFrame, None, None]:
    return ((number, labels, None) for number, labels in segmentation.numbered())


def _with_depth_of(
    frames: Iterator[Frame] | None, segmentation: Segmentation, *, n_frames: int | None
) -> Generator[LabelledFrame, None, None]:
    if frames is None:
        yield from _without_depth(segmentation)
        return
    frame: Frame | None = None
    for number, labels in segmentation.numbered():
        while frame is None or frame.index < number:
            frame = next(frames, None)
            if frame is None:
                # The last frames may be corrupt ones that were left out on request.
                if n_frames is None or number >= n_frames:
                    raise ValueError(
                        f"masks: expected masks of frames that the recording has, got one of frame {number}"
                    )
                break
        yield number, labels, frame.depth_m if frame is not None and frame.index == number else None


def _main_graphs(followed: Iterable[tuple[int, SegmentRelations]]) -> MainGraphs:
    graphs, numbers = tee(_at_least_one(followed))
    return main_graphs((scene_graph(found) for _, found in graphs), frames=(number for number, _ in numbers))


def _at_least_one(followed: Iterable[tuple[int, SegmentRelations]]) -> Iterator[tuple[int, SegmentRelations]]:
    is_empty = True
    for number, found in followed:
        is_empty = False
        yield number, found
    if is_empty:
        raise ValueError("movie: expected at least one label image, got none")


def _relation_function(method: RelationMethod) -> RelationFunction:
    if not isinstance(method, str):
        return method
    if method not in _METHODS:
        raise ValueError(f"relations: expected one of {tuple(_METHODS)} or a function, got {method!r}")
    return _METHODS[method]


def _named(method: Any, functions: dict[str, tuple[str, str]], *, what: str) -> Any:
    if not isinstance(method, str):
        return method
    if method not in functions:
        raise ValueError(f"{what}: expected one of {tuple(functions)} or a function, got {method!r}")
    return _imported(functions[method])


def _imported(place: tuple[str, str]) -> Any:
    room, name = place
    return getattr(import_module(room), name)


def _renumbered(images: Iterable[ArrayLike], frames: Iterable[int]) -> Iterator[tuple[int, ArrayLike]]:
    numbers = iter(frames)
    last: int | None = None
    for index, image in enumerate(images):
        number = next(numbers, None)
        if number is None:
            raise ValueError(f"frames: expected a number for every label image, got {index} numbers")
        if last is not None and number <= last:
            raise ValueError(f"frames: expected ascending frame numbers, got {number} after {last}")
        yield number, image
        last = number


def _of_one_size(numbered: Iterable[tuple[int, ArrayLike]]) -> Iterator[tuple[int, NDArray[Any]]]:
    shape: tuple[int, ...] | None = None
    for number, image in numbered:
        try:
            labels = as_array(image, what="label image")
            shape = shape or labels.shape
            if labels.shape != shape:
                raise ValueError(f"label image: expected shape {shape} as before, got {labels.shape}")
        except ValueError as error:
            raise ValueError(f"frame {number}: {error}") from error
        yield number, labels


def _found(relations: RelationFunction, labels: ArrayLike, number: int) -> SegmentRelations:
    try:
        found = relations(labels)
        if not isinstance(found, SegmentRelations):
            raise ValueError(f"relations: expected SegmentRelations from the function, got {type(found).__name__}")
    except ValueError as error:
        raise ValueError(f"frame {number}: {error}") from error
    return found
