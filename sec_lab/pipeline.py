"""Steps 1 to 4 joined, frame by frame: from pictures to the observation of an action (Fig. 2.2)."""

from collections.abc import Callable, Iterable, Iterator
from itertools import count, tee
from typing import Literal

from numpy.typing import ArrayLike

from sec_lab.codes import as_array
from sec_lab.event_chain import Names
from sec_lab.observation import Observation
from sec_lab.relations import SegmentRelations, edge_count_relations, scan_line_relations
from sec_lab.scene_graph import SceneGraph, main_graphs, scene_graph
from sec_lab.segmentation import Segmentation

RelationFunction = Callable[[ArrayLike], SegmentRelations]
RelationMethod = Literal["scan lines", "edge counting"] | RelationFunction

_METHODS: dict[str, RelationFunction] = {
    "scan lines": scan_line_relations,
    "edge counting": edge_count_relations,
}


def observe_segments(
    label_images: Iterable[ArrayLike] | Segmentation,
    *,
    relations: RelationMethod = "scan lines",
    names: Names | None = None,
    frames: Iterable[int] | None = None,
    progress: bool = False,
) -> Observation:
    """What is seen in a movie that is already segmented: steps 2 to 4 (§2.3 to §2.5).

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
    if isinstance(relations, str):
        if relations not in _METHODS:
            raise ValueError(f"relations: expected one of {tuple(_METHODS)} or a function, got {relations!r}")
        relations = _METHODS[relations]
    images: Iterable[ArrayLike] = label_images
    if isinstance(label_images, Segmentation):
        names = label_images.names if names is None else names
        if frames is None:
            numbered, numbered_again = tee(label_images.numbered())
            images, frames = (image for _, image in numbered), (number for number, _ in numbered_again)
    if progress:
        from tqdm import tqdm

        total = label_images.n_frames if isinstance(label_images, Segmentation) else None
        images = tqdm(images, total=total, unit="frame")
    numbers, numbers_again = tee(count() if frames is None else _ascending(frames))
    graphs = _scene_graphs(images, relations, numbers)
    main = main_graphs(graphs, frames=numbers_again)
    return Observation(main.graphs, main.key_frames, names, "px")


def _scene_graphs(
    label_images: Iterable[ArrayLike], relations: RelationFunction, numbers: Iterator[int]
) -> Iterator[SceneGraph]:
    shape: tuple[int, ...] | None = None
    for index, label_image in enumerate(label_images):
        number = next(numbers, None)
        if number is None:
            raise ValueError(f"frames: expected a number for every label image, got {index} numbers")
        try:
            labels = as_array(label_image, what="label image")
            shape = shape or labels.shape
            if labels.shape != shape:
                raise ValueError(f"label image: expected shape {shape} as before, got {labels.shape}")
            found = relations(labels)
            if not isinstance(found, SegmentRelations):
                raise ValueError(f"relations: expected SegmentRelations from the function, got {type(found).__name__}")
        except ValueError as error:
            raise ValueError(f"frame {number}: {error}") from error
        yield scene_graph(found)
    if shape is None:
        raise ValueError("movie: expected at least one label image, got none")


def _ascending(frames: Iterable[int]) -> Iterator[int]:
    last: int | None = None
    for number in frames:
        if last is not None and number <= last:
            raise ValueError(f"frames: expected ascending frame numbers, got {number} after {last}")
        yield number
        last = number
