"""What is observed in a tabletop movie, from its pixels and from its truth, and how far the two agree."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sec_lab.chain_agreement import chain_agreement
from sec_lab.observation import Observation
from sec_lab.pipeline import LabelledFrame, observe
from sec_lab.recording import Recording
from sec_lab.relations import SegmentRelations
from sec_lab.segmentation import Segmentation
from sec_lab.segmentation.quality import quality
from sec_lab.worlds.tabletop.hardness import hardness_of
from sec_lab.worlds.tabletop.truth import Truth, read_truth

TABLE = 1
"""True label of the table."""


@dataclass(frozen=True, eq=False)
class ObservedMovie:
    """A movie, what was seen in it and what is true.

    Parameters
    ----------
    folder : Path
    pictures : (n, height, width, 3) uint8
        Of the left eye.
    labels : (n, height, width) uint16
        Segments found in them.
    depth_m : (n, height, width) float32
        Found in the stereo pair; 0 where it is unknown.
    true : Truth
    pixels : Observation
        From the movie alone. Each segment has the name of the true object of which it covers most pixels, found when
        everything was over.
    truth : Observation
        By the same rules from true labels and true depth.
    """

    folder: Path
    pictures: NDArray[np.uint8]
    labels: NDArray[np.uint16]
    depth_m: NDArray[np.float32]
    true: Truth
    pixels: Observation
    truth: Observation

    @property
    def found_recording(self) -> Recording:
        """The decoded movie with the depth that was found."""
        return Recording.from_frames(self.pictures, depth=self.depth_m)

    @property
    def true_recording(self) -> Recording:
        """The decoded movie with the true depth."""
        return Recording.from_frames(self.pictures, depth=true_depth_m(self.true))


def open_movie(folder: Path) -> Recording:
    """The stereo movie in a folder that :func:`~sec_lab.worlds.tabletop.make.make_movie` made."""
    return Recording.open(folder / "left.mp4", right=folder / "right.mp4", calibration=folder / "calibration.json")


def film_strip(folder: Path, *, n_frames: int) -> list[NDArray[np.uint8]]:
    """Frames of the left eye, evenly spaced over the time in which a hand is seen (Fig. 2.9, 2.11).

    Parameters
    ----------
    folder : Path
    n_frames : int
        At least 2.

    Returns
    -------
    list of (height, width, 3) uint8

    Raises
    ------
    UnusableFileError
        If a file is missing or damaged.
    ValueError
        If fewer than 2 are wanted, or no hand is ever seen.
    """
    if n_frames < 2:
        raise ValueError(f"n_frames: expected at least 2, got {n_frames}")
    true = read_truth(folder)
    hands = [label for label, name in true.names.items() if name.endswith("hand")]
    seen = np.flatnonzero(np.isin(true.labels, hands).any(axis=(1, 2)))
    if not seen.size:
        raise ValueError(f"folder: expected a movie in which a hand is seen, got {folder}")
    wanted = np.linspace(seen[0], seen[-1], n_frames).round().astype(int).tolist()
    pictures = {number: frame.image for number, frame in enumerate(Recording.open(folder / "left.mp4"))}
    return [pictures[number] for number in wanted]


def true_depth_m(true: Truth) -> NDArray[np.float32]:
    """True depth in metres, 0 where there is nothing."""
    return (true.depth_mm / np.float32(1000)).astype(np.float32)


def observe_movie(folder: Path) -> ObservedMovie:
    """Observe a rendered movie with all defaults, once from its pixels and once from its truth.

    Parameters
    ----------
    folder : Path
        With ``left.mp4``, ``right.mp4``, ``calibration.json``, ``truth.npz`` and ``names.json``.

    Raises
    ------
    UnusableFileError
        If a file is missing or damaged.

    Examples
    --------
    >>> observe_movie(Path("no/such/folder"))
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder/truth.npz: expected the truth of a movie, but there is no such file
    """
    from sec_lab.relations.over_time import steady_relations

    true = read_truth(folder)
    labels, depth_m = np.zeros(true.labels.shape, np.uint16), np.zeros(true.labels.shape, np.float32)

    def kept(frames: Iterable[LabelledFrame]) -> Iterator[LabelledFrame]:
        for number, image, depth in frames:
            labels[number] = image
            if depth is not None:
                depth_m[number] = depth
            yield number, image, depth

    def steady(frames: Iterable[LabelledFrame]) -> Iterator[tuple[int, SegmentRelations]]:
        return steady_relations(kept(frames))

    seen = observe(open_movie(folder), over_time=steady)
    pictures = np.stack([frame.image for frame in Recording.open(folder / "left.mp4")])
    names = names_by_truth(labels, true.labels, role_names(true.names))
    names = {segment: names[segment] for segment in seen.segments.tolist()}
    pixels = Observation(seen.graphs, seen.key_frames, names, "px", Segmentation.from_labels(labels, names=names))
    return ObservedMovie(folder, pictures, labels, depth_m, true, pixels, observe_truth(true, pictures))


def observe_truth(true: Truth, pictures: NDArray[np.uint8]) -> Observation:
    """What the same rules make of true labels and true depth, named by roles.

    Parameters
    ----------
    true : Truth
    pictures : (n, height, width, 3) uint8
        Not looked at, but a recording has some.
    """
    segmentation = Segmentation.from_labels(true.labels, background=TABLE, names=role_names(true.names))
    recording = Recording.from_frames(pictures, depth=true_depth_m(true))
    return observe(recording, segmentation=segmentation)


def role_names(names: Mapping[int, str]) -> dict[int, str]:
    """Names that say which part a thing plays: of two hands the first and the second one, be they left or right.

    Examples
    --------
    >>> role_names({1: "table", 2: "right hand", 3: "left hand", 4: "bread"})
    {1: 'table', 2: 'first hand', 3: 'second hand', 4: 'bread'}
    """
    hands = [label for label, name in sorted(names.items()) if name.endswith(" hand")]
    ordinals = dict(zip(hands, ("first hand", "second hand"), strict=False))
    return {label: ordinals.get(label, name) for label, name in names.items()}


def names_by_truth(
    labels: NDArray[np.integer[Any]], true_labels: NDArray[np.integer[Any]], names: Mapping[int, str]
) -> dict[int, str]:
    """Name every found segment after the true one with which it shares most pixels over all frames.

    Parameters
    ----------
    labels, true_labels : (n, height, width) of int
    names : mapping of int to str
        Of true labels.

    Examples
    --------
    >>> names_by_truth(np.array([[[7, 7, 9]]]), np.array([[[1, 2, 2]]]), {1: "table", 2: "cup"})
    {7: 'table', 9: 'cup'}
    """
    codes = labels.astype(np.uint32) << np.uint32(16) | true_labels.astype(np.uint32)
    shared: dict[int, Counter[int]] = {}
    for code, count in zip(*(part.tolist() for part in np.unique(codes, return_counts=True)), strict=True):
        shared.setdefault(code >> 16, Counter())[code & 0xFFFF] = count
    best = {label: min(counts, key=lambda true: (-counts[true], true)) for label, counts in shared.items()}
    return {label: names.get(true, str(true)) for label, true in best.items()}


def measures(movie: ObservedMovie) -> dict[str, float | int]:
    """How good the segments are, how far the chains agree, and how hard the movie is.

    Returns
    -------
    dict of str to number
        ``frames``; ``covering``, ``kept`` and ``labels`` of :func:`~sec_lab.segmentation.quality.quality`, and the
        number of ``true_labels``; ``found_again``, ``to_the_point`` and their mean ``agreement`` of
        :func:`~sec_lab.chain_agreement.chain_agreement` in percent; columns and changing rows of both chains; and
        ``noise``, ``gradient``, ``plain_segments``, ``plain_covering`` of
        :func:`~sec_lab.worlds.tabletop.hardness.hardness_of`.
    """
    found = quality(movie.labels, movie.true.labels, background=TABLE)
    agreement = chain_agreement(movie.pixels, movie.truth)
    hard = hardness_of(movie.folder)
    rows, columns = chain_size(movie.pixels)
    true_rows, true_columns = chain_size(movie.truth)
    return {
        "frames": len(movie.labels),
        "covering": round(found.covering, 3),
        "kept": round(found.kept, 3),
        "labels": found.n_labels,
        "true_labels": len(np.unique(movie.true.labels)),
        "found_again": round(agreement.found_again, 1),
        "to_the_point": round(agreement.to_the_point, 1),
        "agreement": round(agreement.mean, 1),
        "columns": columns,
        "true_columns": true_columns,
        "rows": rows,
        "true_rows": true_rows,
        "noise": round(hard.noise_grey, 2),
        "gradient": round(hard.gradient_grey_per_px, 2),
        "plain_segments": round(hard.n_segments, 1),
        "plain_covering": round(hard.covering, 3),
    }


def chain_size(seen: Observation) -> tuple[int, int]:
    """Number of rows that change, and of columns, of the chain of an observation.

    Examples
    --------
    >>> from sec_lab.scene_graph import SceneGraph
    >>> chain_size(Observation([SceneGraph([4], [[0]])], [0]))
    (0, 1)
    """
    if len(seen.segments) < 2:
        return 0, len(seen.recorded)
    chain = seen.chain
    return len(chain.changing_rows), chain.relations.shape[1]
