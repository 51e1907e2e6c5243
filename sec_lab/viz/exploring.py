"""What explorers compute at every move: models, noise, segments; nothing here knows of widgets."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.action_model import ActionModel
from sec_lab.event_chain import EventChain
from sec_lab.learning import learn
from sec_lab.noise import DEFAULT_NOISE, LEVELS, Noise, NoisySamples, compare_with_seed, noisy_samples
from sec_lab.noise_studies import noise_study
from sec_lab.observation import Observation
from sec_lab.recording import Recording
from sec_lab.segmentation.potts import PottsParameters, superparamagnetic_clustering
from sec_lab.segmentation.quality import Quality, covering, quality
from sec_lab.segmentation.tracking import TrackingParameters, track_segments
from sec_lab.similarity import compare
from sec_lab.viz.tint import Tint

if TYPE_CHECKING:
    import pandas as pd

Seen: TypeAlias = EventChain | Observation
Report: TypeAlias = Callable[[int, int], None]

MOST_FRAMES = 400
"""Frames of a movie that are followed: their labels are kept, 65 MB of 320×256 pixels."""

_SHOWN_PX = 480


def chain_of(seen: Seen, what: str) -> EventChain:
    """The chain of what was seen.

    Raises
    ------
    TypeError
        If it is neither a chain nor an observation; ``what`` is what the error calls it.
    """
    chain = seen.chain if isinstance(seen, Observation) else seen
    if not isinstance(chain, EventChain):
        raise TypeError(f"{what}: expected an event chain or an observation, got {type(seen).__name__}")
    return chain


@dataclass(frozen=True, eq=False)
class Learned:
    """A model, and its temporal similarity to demonstrations in percent, those it was not learned from too."""

    model: ActionModel
    similarity: Mapping[str, float]


def learn_and_compare(
    demonstrations: Mapping[str, Seen], chosen: Sequence[str], *, report: Report | None = None, **options: Any
) -> Learned:
    """Learn from some demonstrations, and compare the model with all of them (§2.9, Fig. 2.12).

    Parameters
    ----------
    demonstrations : mapping of str to EventChain or Observation
    chosen : sequence of str
        Names of those that are learned from, at least two.
    report : callable, optional
        Is told how many comparisons are done, and of how many.
    options
        Of :func:`~sec_lab.learning.learn`; normaliser and tolerance serve the comparison too.

    Raises
    ------
    TypeError, ValueError
        As in :func:`~sec_lab.learning.learn`.

    Examples
    --------
    >>> put = EventChain([[0, 2, 2, 0], [0, 0, 2, 2]], [(1, 2), (2, 3)])
    >>> learn_and_compare({"a": put, "b": put, "c": put}, ["a", "b"], weight_threshold=0.5).similarity
    {'a': 100.0, 'b': 100.0, 'c': 100.0}
    """
    model = learn({name: demonstrations[name] for name in chosen}, n_threads=1, **options)
    measured = {name: options[name] for name in ("normalizer", "tolerance_percent") if name in options}
    similarity = {}
    for number, (name, seen) in enumerate(demonstrations.items(), start=1):
        similarity[name] = compare(model.chain, chain_of(seen, name), **measured).temporal
        if report is not None:
            report(number, len(demonstrations))
    return Learned(model, similarity)


@dataclass(frozen=True, eq=False)
class NoiseCurves:
    """Means in percent over noise levels and their standard errors, of the similarity ψ and of objects matched."""

    mean: "pd.DataFrame"
    error: "pd.DataFrame"


def noise_curves(
    seed: EventChain, *, noise: Noise = DEFAULT_NOISE, n_samples: int = 100, random_seed: int = 0
) -> NoiseCurves:
    """Similarity of a seed to its noisy samples, and its objects that are matched rightly, at all levels (§3.1).

    Parameters
    ----------
    seed : EventChain
    noise : Noise, optional
    n_samples : int, optional
        Samples a level.
    random_seed : int, optional

    Raises
    ------
    TypeError, ValueError
        As in :func:`~sec_lab.noise_studies.noise_study`.

    Examples
    --------
    >>> from sec_lab.noise_seeds import LIFTING
    >>> noise_curves(LIFTING, n_samples=10).mean.loc[0.0].tolist()
    [100.0, 100.0]
    """
    import pandas as pd

    study = noise_study({"seed": seed}, rng=np.random.default_rng(random_seed), levels=LEVELS, n_samples=n_samples,
                        noise=noise)  # fmt: skip
    names = {"similarity ψ": "similarity", "objects matched": "objects"}
    mean = {name: study.mean(what)["seed"] for name, what in names.items()}  # type: ignore[arg-type]
    error = {name: study.standard_error(what)["seed"] for name, what in names.items()}  # type: ignore[arg-type]
    return NoiseCurves(pd.DataFrame(mean), pd.DataFrame(error))


def noise_example(
    seed: EventChain, p: float, *, noise: Noise = DEFAULT_NOISE, n_samples: int = 100, random_seed: int = 0
) -> tuple[NoisySamples, NDArray[np.float64], NDArray[np.float64]]:
    """Noisy samples of a seed at one level, their similarity to it and their objects matched rightly, in percent.

    Examples
    --------
    >>> from sec_lab.noise_seeds import LIFTING
    >>> samples, similarity, objects = noise_example(LIFTING, 0.0, n_samples=2)
    >>> len(samples), similarity.tolist(), objects.tolist()
    (2, [100.0, 100.0], [100.0, 100.0])
    """
    samples = noisy_samples(seed, p, n_samples=n_samples, rng=np.random.default_rng(random_seed), noise=noise)
    found = compare_with_seed(samples)
    return samples, found.temporal, found.objects_percent


@dataclass(frozen=True, eq=False)
class SegmentedFrame:
    """Segments of one frame, and how well they cover the true ones, 0 to 1; None where the truth is not known."""

    labels: NDArray[np.uint16]
    covering: float | None


def segmented_frame(
    image: ArrayLike, *, parameters: PottsParameters, depth_m: ArrayLike | None = None, truth: ArrayLike | None = None
) -> SegmentedFrame:
    """Segment one frame by itself, and hold it against the truth (§2.2).

    Parameters
    ----------
    image : (height, width, 3) array_like of uint8
        RGB.
    parameters : PottsParameters
    depth_m : (height, width) array_like of float, optional
    truth : (height, width) array_like of int, optional

    Raises
    ------
    ValueError
        As in :func:`~sec_lab.segmentation.potts.superparamagnetic_clustering` and
        :func:`~sec_lab.segmentation.quality.covering`.

    Examples
    --------
    >>> image = np.full((20, 30, 3), 40, dtype=np.uint8)
    >>> image[5:15, 10:20] = (200, 40, 40)
    >>> truth = (image[:, :, 0] > 100).astype(int)
    >>> segmented_frame(image, parameters=PottsParameters(), truth=truth).covering
    1.0
    """
    labels = superparamagnetic_clustering(image, parameters=parameters, depth_m=depth_m)
    return SegmentedFrame(labels, None if truth is None else covering(labels, truth))


@dataclass(frozen=True, eq=False)
class FollowedMovie:
    """Segments of a movie followed from frame to frame.

    Attributes
    ----------
    labels : (n, height, width) uint16
    n_labels : int
        Different ones in all of it.
    quality : Quality or None
        None where the truth is not known.
    """

    labels: NDArray[np.uint16]
    n_labels: int
    quality: Quality | None


def followed_movie(
    recording: Recording, *, parameters: PottsParameters, truth: Iterable[ArrayLike] | None = None,
    most_frames: int = MOST_FRAMES, report: Report | None = None,
) -> FollowedMovie:  # fmt: skip
    """Follow segments through a movie, and hold them against the truth (§2.2).

    Parameters
    ----------
    recording : Recording
    parameters : PottsParameters
        Of the lattice.
    truth : iterable of (height, width) array_like of int, optional
        One a frame.
    most_frames : int, optional
        The rest is left out.
    report : callable, optional
        Is told how many frames are done, and of how many.

    Raises
    ------
    ValueError
        As in :func:`~sec_lab.segmentation.tracking.track_segments` and :func:`~sec_lab.segmentation.quality.quality`.

    Examples
    --------
    >>> frames = np.full((3, 40, 60, 3), 60, dtype=np.uint8)
    >>> frames[:, 10:25, 10:30] = (200, 60, 60)
    >>> found = followed_movie(Recording.from_frames(frames), parameters=PottsParameters(), truth=frames[..., 0] > 100)
    >>> found.labels.shape, found.n_labels, found.quality.covering, found.quality.kept
    ((3, 40, 60), 2, 1.0, 1.0)
    """
    total = most_frames if recording.n_frames is None else min(recording.n_frames, most_frames)
    labels = []
    for image in islice(track_segments(recording, parameters=TrackingParameters(potts=parameters)), total):
        labels.append(np.asarray(image))
        if report is not None:
            report(len(labels), total)
    judged = None if truth is None else quality(labels, islice(truth, len(labels)))
    whole = np.stack(labels)
    return FollowedMovie(whole, len(np.unique(whole)), judged)


def beside_each_other(image: NDArray[np.uint8], *labels: NDArray[np.integer[Any]]) -> NDArray[np.uint8]:
    """A frame, and beside it the same with segments drawn in, as one picture; large ones are made smaller.

    Parameters
    ----------
    image : (height, width, 3) uint8
    labels : (height, width) of int
        Label images of labels up to 65,535, each of which is drawn into the frame.

    Returns
    -------
    (shown_height, (1 + n) · (shown_width + 6) − 6, 3) uint8

    Examples
    --------
    >>> beside_each_other(np.zeros((4, 10, 3), np.uint8), np.ones((4, 10), int)).shape
    (4, 26, 3)
    """
    step = -(-image.shape[1] // _SHOWN_PX)
    few = np.ascontiguousarray(image[::step, ::step])
    pictures = [few]
    for one in labels:
        shown = one[::step, ::step].astype(np.uint16)
        pictures.append(Tint(np.unique(shown).tolist(), background=None).over(few, shown))
    gap = np.full((few.shape[0], 6, 3), 128, np.uint8)
    parts = [pictures[0]]
    for picture in pictures[1:]:
        parts += [gap, picture]
    return np.hstack(parts)
