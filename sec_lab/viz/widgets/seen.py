"""A movie and what was seen in it, kept so that any frame is at hand at once and the chain can be made anew."""

import os
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sec_lab.event_chain import Names
from sec_lab.observation import Observation, merge_segments
from sec_lab.pipeline import RelationMethod, RelationsOverTime, SegmentationMethod, observe, segmenter
from sec_lab.recording import Frame, Recording
from sec_lab.segmentation import Segmentation, check_fit
from sec_lab.segmentation.merging import Groups, as_groups, merged_segments

MOST_FRAMES = 5000
"""Of a longer movie an explorer would fill the memory."""
_MOST_PX, _JPEG_QUALITY = 640, 92

Labels = NDArray[np.uint16]
How = tuple[Literal["steady"] | RelationsOverTime | None, RelationMethod]
_WAYS: tuple[How, ...] = (("steady", "scan lines"), (None, "scan lines"), (None, "edge counting"))

Tell = Callable[[int, int | None], object]
"""Called with the number of frames that were seen so far, and of all where that is known; may raise to stop."""


class KeptFrame:
    """A frame in a few kilobytes: the picture as JPEG (lossy), label image and depth without loss.

    Parameters
    ----------
    number : int
    time_s : float or None
    picture : (height, width, 3) ndarray of uint8 or None
        RGB; kept at most 640 pixels wide and high.
    labels : (height, width) ndarray of uint16 or None
    depth_m : (height, width) ndarray of float32 or None

    Examples
    --------
    >>> kept = KeptFrame(4, None, None, np.array([[1, 300]], dtype=np.uint16), None)
    >>> kept.labels, kept.picture is None
    (array([[  1, 300]], dtype=uint16), True)
    """

    __slots__ = ("_depth", "_held", "_labels", "_picture", "_size", "number", "time_s")

    def __init__(
        self,
        number: int,
        time_s: float | None,
        picture: NDArray[np.uint8] | None,
        labels: Labels | None,
        depth_m: NDArray[np.float32] | None,
    ) -> None:
        self.number, self.time_s = number, time_s
        self._picture = None if picture is None else _jpeg(picture)
        self._labels = None if labels is None else _png(labels)
        self._held = self._labels
        self._depth = None if depth_m is None else zlib.compress(depth_m.astype(np.float32).tobytes(), 1)
        self._size = None if depth_m is None else depth_m.shape

    @property
    def has_labels(self) -> bool:
        """Whether there is a label image."""
        return self._labels is not None

    @property
    def has_depth(self) -> bool:
        """Whether there is depth."""
        return self._depth is not None

    @property
    def picture(self) -> NDArray[np.uint8] | None:
        """RGB."""
        import cv2

        if self._picture is None:
            return None
        decoded = cv2.imdecode(self._picture, cv2.IMREAD_COLOR)
        assert decoded is not None
        return np.ascontiguousarray(decoded[..., ::-1])

    @property
    def labels(self) -> Labels | None:
        """Label image."""
        return None if self._labels is None else _decoded(self._labels)

    @property
    def shown_labels(self) -> Labels | None:
        """Label image, or the last one before this frame, if it has none of its own."""
        return None if self._held is None else _decoded(self._held)

    def follow(self, before: "KeptFrame") -> None:
        """Hold the label image of the frame before, if there is none of its own."""
        if self._labels is None:
            self._held = before._held

    @property
    def depth_m(self) -> NDArray[np.float32] | None:
        """Depth in metres, 0 where it is unknown."""
        if self._depth is None or self._size is None:
            return None
        return np.frombuffer(zlib.decompress(self._depth), dtype=np.float32).reshape(self._size)


@dataclass(frozen=True, eq=False)
class Seen:
    """An observation with the frames that it comes from.

    Attributes
    ----------
    observation : Observation
    frames : tuple of KeptFrame
        All frames that have a picture or a label image; empty if there are neither, as of a GraphML file.
    how : tuple or None
        How relations were found: ``over_time`` and ``relations`` of :func:`~sec_lab.pipeline.observe`; None where
        that is not known.
    background : int or None
    """

    observation: Observation
    frames: tuple[KeptFrame, ...]
    how: How | None = None
    background: int | None = None

    @property
    def has_labels(self) -> bool:
        """Whether label images are at hand."""
        return any(frame.has_labels for frame in self.frames)

    @property
    def has_depth(self) -> bool:
        """Whether depth is at hand."""
        return any(frame.has_depth for frame in self.frames)

    @cached_property
    def found(self) -> How | None:
        """How relations were found, tried out if it is not known; None if no way leads to the same chain."""
        if self.how is not None or not self.has_labels:
            return self.how if self.has_labels else None
        expected = self.observation
        for how in _WAYS:
            again = _again(self, (), expected.names, how)
            if again.key_frames.tolist() == expected.key_frames.tolist() and all(
                one is not None and other is not None and one.same_relations(other)
                for one, other in zip(again.graphs, expected.graphs, strict=True)
            ):
                return how
        return None


def see(
    source: Recording | Segmentation | Observation | str | os.PathLike[str],
    *,
    recording: Recording | str | os.PathLike[str] | None = None,
    segmentation: SegmentationMethod | Segmentation = "layers",
    how: How | None = None,
    names: Names | None = None,
    tell: Tell | None = None,
) -> Seen:
    """Observe a movie, and keep its frames on the way.

    Parameters
    ----------
    source : Recording, Segmentation, Observation or path-like
        What is to be seen: a movie, label images, or what was already observed.
    recording : Recording or path-like, optional
        The movie that label images or an observation belong to.
    segmentation
        As of :func:`~sec_lab.pipeline.observe`.
    how : tuple, optional
        ``over_time`` and ``relations`` as of :func:`~sec_lab.pipeline.observe`, whose defaults stand if left out. Of an
        observation: how its relations were found, if it was neither of the ways that have a name.
    names : mapping of int to str or None, optional
        Names of segments; those that the source has if left out.
    tell : callable, optional
        Called after each frame with the number of frames so far and, where it is known, of all.

    Returns
    -------
    Seen

    Raises
    ------
    ValueError
        For the reasons of :func:`~sec_lab.pipeline.observe`, or if there are more than 5,000 frames.

    Examples
    --------
    >>> labels = np.ones((3, 8, 8), dtype=np.uint8)
    >>> labels[1:, 2:6, 2:6] = 2
    >>> seen = see(Segmentation.from_labels(labels), how=(None, "scan lines"))
    >>> seen.observation.key_frames, [frame.number for frame in seen.frames]
    (array([0, 1]), [0, 1, 2])
    """
    movie = Recording.open(recording) if recording is not None and not isinstance(recording, Recording) else recording
    if isinstance(source, Observation):
        frames = _followed(_kept(movie, source.segmentation, tell))
        background = None if source.segmentation is None else source.segmentation.background
        if names is not None:
            source = Observation(source.graphs, source.key_frames, names, source.position_unit, source.segmentation)
        return Seen(source, frames, how, background)
    if not isinstance(source, Segmentation):
        movie = source if isinstance(source, Recording) else Recording.open(source)
    labelled = source if isinstance(source, Segmentation) else segmentation
    how = how or _WAYS[0]
    keeper = _Keeper(tell)
    if movie is None:
        assert isinstance(labelled, Segmentation)
        found = observe(keeper.tapped(labelled), over_time=how[0], relations=how[1], names=names)
    else:
        if isinstance(labelled, Segmentation):
            check_fit(labelled, movie)
            method: Callable[[Recording], Segmentation] = partial(_beside, labelled)
        else:
            method = segmenter(labelled)
        segment = partial(keeper.segment, method)
        found = observe(movie, segmentation=segment, over_time=how[0], relations=how[1], names=names)
    kept = _followed(keeper.frames)
    assert found.segmentation is not None
    background = found.segmentation.background
    again = replace_segmentation(found, _segmentation_of(kept, background, found.names))
    return Seen(again, kept, how, background)


def merged(seen: Seen, groups: Groups, *, tell: Tell | None = None) -> Observation:
    """What would have been seen if the fragments of each group had been one segment (§2.11).

    Label images are relabelled and steps 2 to 4 are done again on them; without any, the scene graphs alone decide
    (:func:`~sec_lab.observation.merge_segments`). Without groups the observation is as it was.

    Parameters
    ----------
    seen : Seen
    groups : iterable of iterable of int
    tell : callable, optional
        As of :func:`see`.

    Returns
    -------
    Observation

    Raises
    ------
    ValueError
        If a label was not seen, a group has fewer than two, or a label is in two groups.

    Examples
    --------
    >>> labels = np.ones((2, 6, 12), dtype=np.uint8)
    >>> labels[:, 2:4, 2:6], labels[:, 2:4, 6:9] = 2, 3
    >>> seen = see(Segmentation.from_labels(labels), how=(None, "scan lines"))
    >>> merged(seen, [[2, 3]]).chain.pairs
    array([[2, 1]])
    """
    checked = as_groups(groups)
    if not checked:
        return seen.observation
    by_graphs = merge_segments(seen.observation, checked)
    if seen.found is None:
        return by_graphs
    return _again(seen, checked, by_graphs.names, seen.found, tell)


def _again(
    seen: Seen, groups: tuple[tuple[int, ...], ...], names: Names, how: How, tell: Tell | None = None
) -> Observation:
    """Steps 2 to 4 once more, on the label images that were kept."""
    kept = tuple(frame for frame in seen.frames if frame.has_labels)
    whole = merged_segments(_segmentation_of(kept, seen.background, names), groups)
    told = replace(whole, read=partial(_telling, whole, tell))
    if not seen.has_depth:
        found = observe(told, over_time=how[0], relations=how[1], names=names)
    else:
        movie = Recording(partial(_with_depth_only, kept), whole.size, len(kept), has_depth=True)
        found = observe(movie, segmentation=told, over_time=how[0], relations=how[1], names=names)
    return replace_segmentation(found, whole)


def _telling(segmentation: Segmentation, tell: Tell | None) -> Iterator[tuple[int, Labels]]:
    for done, labelled in enumerate(segmentation.numbered(), start=1):
        yield labelled
        if tell is not None:
            tell(done, segmentation.n_frames)


def replace_segmentation(observation: Observation, segmentation: Segmentation | None) -> Observation:
    """The same observation with other label images.

    Examples
    --------
    >>> from sec_lab.scene_graph import SceneGraph
    >>> replace_segmentation(Observation([SceneGraph([1], [[0]])], [0]), None).segmentation is None
    True
    """
    return Observation(
        observation.graphs, observation.key_frames, observation.names, observation.position_unit, segmentation
    )


class _Keeper:
    """Keeps the frames of a movie while it is segmented, each with its label image."""

    def __init__(self, tell: Tell | None) -> None:
        self.frames: list[KeptFrame] = []
        self._tell = tell
        self._n_frames: int | None = None
        # Filled in one thread while another one takes from it.
        self._ahead: dict[int, Frame] = {}

    def segment(self, method: Callable[[Recording], Segmentation], movie: Recording) -> Segmentation:
        """Segment a movie by a method, and keep what both read."""
        self._n_frames = movie.n_frames
        return self.tapped(method(replace(movie, read=partial(self._read, movie))))

    def tapped(self, found: Segmentation) -> Segmentation:
        """The same label images, which are kept when they are read."""
        self._n_frames = self._n_frames or found.n_frames
        return replace(found, read=partial(self._label, found))

    def _read(self, movie: Recording) -> Iterator[Frame]:
        for frame in movie:
            self._ahead[frame.index] = frame
            yield frame

    def _label(self, found: Segmentation) -> Iterator[tuple[int, Labels]]:
        self.frames.clear()
        for number, labels in found.numbered():
            for index in sorted(index for index in list(self._ahead) if index < number):
                self._keep(_joined(index, self._ahead.pop(index), None))
            self._keep(_joined(number, self._ahead.pop(number, None), labels))
            yield number, labels
        for index in sorted(self._ahead):
            self._keep(_joined(index, self._ahead.pop(index), None))

    def _keep(self, frame: KeptFrame) -> None:
        self.frames.append(frame)
        _say(self._tell, len(self.frames), self._n_frames)


def _beside(labelled: Segmentation, movie: Recording) -> Segmentation:
    """Label images that are given, while the movie is read beside them."""
    return replace(labelled, read=partial(_side_by_side, labelled, movie))


def _side_by_side(labelled: Segmentation, movie: Recording) -> Iterator[tuple[int, Labels]]:
    frames = iter(movie)
    last = -1
    for number, labels in labelled.numbered():
        while last < number:
            frame = next(frames, None)
            if frame is None:
                raise ValueError(f"masks: expected masks of frames that the recording has, got one of frame {number}")
            last = frame.index
        yield number, labels
    for _ in frames:
        pass


def _kept(movie: Recording | None, segmentation: Segmentation | None, tell: Tell | None) -> Iterator[KeptFrame]:
    """Frames of a movie with their label images, of what is there of both."""
    if movie is None and segmentation is None:
        return
    if movie is not None and segmentation is not None:
        check_fit(segmentation, movie)
    images = iter(()) if segmentation is None else segmentation.numbered()
    n_frames = movie.n_frames if movie is not None else segmentation.n_frames if segmentation is not None else None
    ahead = next(images, None)
    n_kept = 0
    for frame in movie if movie is not None else ():
        labels = None
        if ahead is not None and ahead[0] == frame.index:
            labels, ahead = ahead[1], next(images, None)
        yield _joined(frame.index, frame, labels)
        n_kept += 1
        _say(tell, n_kept, n_frames)
    while movie is None and ahead is not None:
        yield _joined(ahead[0], None, ahead[1])
        n_kept += 1
        _say(tell, n_kept, n_frames)
        ahead = next(images, None)


def _joined(number: int, frame: Frame | None, labels: Labels | None) -> KeptFrame:
    if frame is None:
        return KeptFrame(number, None, None, labels, None)
    return KeptFrame(number, frame.time_s, frame.image, labels, frame.depth_m)


def _say(tell: Tell | None, n: int, n_frames: int | None) -> None:
    if n > MOST_FRAMES:
        raise ValueError(f"movie: expected at most {MOST_FRAMES} frames to explore, got more; cut it into pieces")
    if tell is not None:
        tell(n, n_frames)


def _segmentation_of(frames: tuple[KeptFrame, ...], background: int | None, names: Names) -> Segmentation:
    labelled = tuple(frame for frame in frames if frame.has_labels)
    labels = labelled[0].labels
    assert labels is not None
    height, width = labels.shape
    numbers = [frame.number for frame in labelled]
    return Segmentation(partial(_labels_of, labelled), (height, width), numbers, background, names)


def _labels_of(frames: tuple[KeptFrame, ...]) -> Iterator[tuple[int, Labels]]:
    for frame in frames:
        labels = frame.labels
        assert labels is not None
        yield frame.number, labels


def _with_depth_only(frames: tuple[KeptFrame, ...]) -> Iterator[Frame]:
    for frame in frames:
        depth = frame.depth_m
        assert depth is not None
        yield Frame(frame.number, np.zeros((*depth.shape, 3), dtype=np.uint8), depth_m=depth)


def _jpeg(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    import cv2

    scale = _MOST_PX / max(picture.shape[:2])
    if scale < 1:
        size = (max(1, round(scale * picture.shape[1])), max(1, round(scale * picture.shape[0])))
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    done, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    assert done
    return np.asarray(data, dtype=np.uint8)


def _decoded(labels: NDArray[np.uint8]) -> Labels:
    import cv2

    return np.asarray(cv2.imdecode(labels, cv2.IMREAD_UNCHANGED))


def _followed(frames: Iterable[KeptFrame]) -> tuple[KeptFrame, ...]:
    kept = tuple(frames)
    for before, frame in pairwise(kept):
        frame.follow(before)
    return kept


def _png(labels: Labels) -> NDArray[np.uint8]:
    import cv2

    done, data = cv2.imencode(".png", labels.astype(np.uint16, copy=False), [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert done
    return np.asarray(data, dtype=np.uint8)
