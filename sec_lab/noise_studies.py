"""Statistics of chapter 3: many samples of many seeds at many noise levels, and models learned from them.

Blocks of samples are tasks of joblib, each with a generator of its own, so that the numbers do not depend on threads,
processes or machines.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab._packed_chains import check_comparable
from sec_lab.event_chain import EventChain
from sec_lab.noise import BLOCK, DEFAULT_NOISE, LEVELS, Noise, as_count, as_level, compare_with_seed, noisy_samples
from sec_lab.similarity import EFFORT, Normalizer, check_options

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class NoiseStudy:
    """Similarity and objects of many samples of some seeds at some noise levels (Fig. 3.2, 3.4, 3.5).

    Attributes
    ----------
    seeds : tuple of str
    levels : (n_levels,) float64
    similarity, objects : (n_seeds, n_levels, n_samples) float64
        Temporal similarity, and share of the objects that are matched rightly, in percent.
    tied : (n_seeds, n_levels, n_samples) float64
        Share of the objects that are left between several counterparts, in percent.
    exact_percent : float
        Share of the comparisons whose optimum is proven.
    """

    seeds: tuple[str, ...]
    levels: NDArray[np.float64]
    similarity: NDArray[np.float64]
    objects: NDArray[np.float64]
    tied: NDArray[np.float64]
    exact_percent: float

    def __post_init__(self) -> None:
        for name in ("levels", "similarity", "objects", "tied"):
            array = np.array(getattr(self, name), np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def mean(self, measure: Literal["similarity", "objects", "tied"] = "similarity") -> "pd.DataFrame":
        """Means in percent, one row a level, one column a seed."""
        return _table(self._values(measure).mean(axis=2), self)

    def standard_error(self, measure: Literal["similarity", "objects", "tied"] = "similarity") -> "pd.DataFrame":
        """Standard errors of the means in percentage points; not a number where there is a single sample."""
        return _table(_standard_errors(self._values(measure)), self)

    def _values(self, measure: str) -> NDArray[np.float64]:
        if measure not in ("similarity", "objects", "tied"):
            raise ValueError(f"measure: expected 'similarity', 'objects' or 'tied', got {measure!r}")
        values: NDArray[np.float64] = getattr(self, measure)
        return values


def _standard_errors(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the means over the last axis; not a number where there is a single value."""
    n = values.shape[2]
    spread = values.std(axis=2, ddof=1) if n > 1 else np.full(values.shape[:2], np.nan)
    errors: NDArray[np.float64] = spread / np.sqrt(n)
    return errors


def _table(values: NDArray[np.float64], study: "NoiseStudy | ModelStudy") -> "pd.DataFrame":
    import pandas as pd

    return pd.DataFrame(values.T, index=pd.Index(study.levels, name="noise level p"), columns=list(study.seeds))


def noise_study(
    seeds: Mapping[str, EventChain],
    *,
    rng: np.random.Generator,
    levels: ArrayLike = LEVELS,
    n_samples: int = 100,
    noise: Noise = DEFAULT_NOISE,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    n_jobs: int | None = None,
    progress: bool = False,
) -> NoiseStudy:
    """Compare seeds with noisy samples at all levels (Fig. 3.2, 3.4, 3.5).

    Parameters
    ----------
    seeds : mapping of names to EventChain
    rng : numpy.random.Generator
        Every block of 1000 samples gets a generator spawned from it.
    levels : (n_levels,) array_like, optional
        Noise levels, 0 to 1.
    n_samples : int, optional
        Samples a seed and level.
    noise : Noise, optional
    normalizer, tolerance_percent
        As in :func:`~sec_lab.similarity.compare`.
    n_jobs : int, optional
        As in :class:`joblib.Parallel`; threads, unless :func:`joblib.parallel_config` says otherwise. With its Dask
        backend the same call runs on many machines, with the same result.
    progress : bool, optional
        Show a progress bar.

    Raises
    ------
    TypeError, ValueError
        If there is no seed or level, or as in :func:`noisy_samples`.

    Examples
    --------
    >>> seed = EventChain([[0, 2, 2], [0, 0, 2], [2, 0, 0]], [(1, 2), (2, 3), (1, 3)])
    >>> study = noise_study({"putting": seed}, levels=[0, 0.5], rng=np.random.default_rng(1))
    >>> study.mean()["putting"].round().tolist()[0]
    100.0
    """
    names, points = _checked(seeds, levels)
    check_options(normalizer, tolerance_percent, "original", EFFORT)
    n = as_count(n_samples, "n_samples")
    sizes = [min(BLOCK, n - start) for start in range(0, n, BLOCK)]
    jobs = [(seeds[name], level, size) for name in names for level in points.tolist() for size in sizes]
    options = {"normalizer": normalizer, "tolerance_percent": tolerance_percent}
    tasks = [
        (_study_block, (*job, child, noise, options)) for job, child in zip(jobs, rng.spawn(len(jobs)), strict=True)
    ]
    blocks = _run(tasks, n_jobs, prefer="threads", progress=progress, what="comparing")
    values = np.concatenate(blocks, axis=1).reshape(4, len(names), len(points), n)
    return NoiseStudy(names, points, values[0], values[1], values[2], float(100.0 * values[3].mean()))


def _study_block(
    seed: EventChain, level: float, n: int, rng: np.random.Generator, noise: Noise, options: dict[str, Any]
) -> NDArray[np.float64]:
    found = compare_with_seed(noisy_samples(seed, level, n_samples=n, rng=rng, noise=noise), **options)
    tied = 100.0 * found.objects_tied / found.n_objects
    return np.stack([found.temporal, found.objects_percent, tied, found.exact.astype(float)])


@dataclass(frozen=True, eq=False)
class ModelStudy:
    """Similarity of learned models with the seeds of their demonstrations (Fig. 3.6).

    Attributes
    ----------
    seeds : tuple of str
    levels : (n_levels,) float64
    similarity : (n_seeds, n_levels, n_models) float64
        Temporal similarity of seed (ξ¹) and model in percent; 0 where nothing could be learned.
    rows, columns : (n_seeds, n_levels, n_models) int64
        Size of the models; 0 where nothing could be learned.
    """

    seeds: tuple[str, ...]
    levels: NDArray[np.float64]
    similarity: NDArray[np.float64]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]

    def __post_init__(self) -> None:
        for name in ("levels", "similarity", "rows", "columns"):
            array = np.array(getattr(self, name))
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def mean(self) -> "pd.DataFrame":
        """Mean similarity in percent, one row a level, one column a seed."""
        return _table(self.similarity.mean(axis=2), self)

    def standard_error(self) -> "pd.DataFrame":
        """Standard errors of the means in percentage points; not a number where there is a single model."""
        return _table(_standard_errors(self.similarity), self)


def model_study(
    seeds: Mapping[str, EventChain],
    *,
    rng: np.random.Generator,
    levels: ArrayLike = LEVELS,
    n_samples: int = 100,
    n_models: int = 1,
    noise: Noise = DEFAULT_NOISE,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    weight_threshold: float = 0.5,
    n_jobs: int | None = None,
    progress: bool = False,
) -> ModelStudy:
    """Learn models from noisy samples and compare them with the seeds (§3.1.3, Fig. 3.6).

    Parameters
    ----------
    seeds, rng, levels, noise, normalizer, tolerance_percent, progress
        As in :func:`noise_study`; learning and the comparison use the same normaliser and tolerance.
    n_samples, n_models : int, optional
        Demonstrations of each model, at least two, and models a seed and level.
    weight_threshold : float, optional
        As in :func:`~sec_lab.learning.learn`.
    n_jobs : int, optional
        As in :class:`joblib.Parallel`; processes, unless :func:`joblib.parallel_config` says otherwise.

    Raises
    ------
    TypeError, ValueError
        As in :func:`noise_study`, or if there are fewer than two samples.

    Examples
    --------
    >>> seed = EventChain([[0, 2, 2], [0, 0, 2], [2, 0, 0]], [(1, 2), (2, 3), (1, 3)])
    >>> study = model_study({"putting": seed}, levels=[0], n_samples=4, rng=np.random.default_rng(1))
    >>> study.similarity.ravel(), study.rows.ravel()
    (array([100.]), array([3]))
    """
    names, points = _checked(seeds, levels)
    check_options(normalizer, tolerance_percent, "original", EFFORT)
    n = as_count(n_samples, "n_samples", least=2)
    count = as_count(n_models, "n_models")
    if not 0 <= weight_threshold <= 1:
        raise ValueError(f"weight_threshold: expected 0 to 1, got {weight_threshold}")
    jobs = [(seeds[name], level, n) for name in names for level in points.tolist() for _ in range(count)]
    options = {
        "normalizer": normalizer, "tolerance_percent": tolerance_percent, "weight_threshold": weight_threshold
    }  # fmt: skip
    tasks = [(_model_of, (*job, child, noise, options)) for job, child in zip(jobs, rng.spawn(len(jobs)), strict=True)]
    found = np.array(_run(tasks, n_jobs, prefer="processes", progress=progress, what="learning"))
    similarity, rows, columns = found.T.reshape(3, len(names), len(points), count)
    return ModelStudy(names, points, similarity, rows.astype(np.int64), columns.astype(np.int64))


def _model_of(
    seed: EventChain, level: float, n: int, rng: np.random.Generator, noise: Noise, options: dict[str, Any]
) -> tuple[float, int, int]:
    from sec_lab.learning import learn
    from sec_lab.similarity import compare

    samples = noisy_samples(seed, level, n_samples=n, rng=rng, noise=noise)
    demonstrations = [chain for chain in samples if len(chain.changing_rows)]
    try:
        model = learn(demonstrations, n_threads=1, **options).chain
        check_comparable(model, "model")
    except ValueError:
        # Noise has left nothing that enough of the samples share: that is the result.
        return 0.0, 0, 0
    measured = {name: options[name] for name in ("normalizer", "tolerance_percent")}
    return compare(seed, model, **measured).temporal, *model.relations.shape


def _run(
    tasks: Sequence[tuple[Any, tuple[Any, ...]]], n_jobs: int | None, *, prefer: str, progress: bool, what: str
) -> list[Any]:
    """Run the tasks where joblib is told to, and give their results in order."""
    from joblib import Parallel, delayed
    from tqdm import tqdm

    done = Parallel(n_jobs=n_jobs, prefer=prefer, return_as="generator")(delayed(task)(*given) for task, given in tasks)
    return list(tqdm(done, total=len(tasks), unit="block", desc=what, disable=not progress))


def _checked(seeds: Mapping[str, EventChain], levels: ArrayLike) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    if not isinstance(seeds, Mapping):
        raise TypeError(f"seeds: expected a mapping of names to event chains, got {type(seeds).__name__}")
    if not seeds:
        raise ValueError("seeds: expected at least one, got none")
    for name, seed in seeds.items():
        check_comparable(seed, f"seed {name}")
    points = np.atleast_1d(np.asarray(levels, np.float64))
    if points.ndim != 1 or not points.size:
        raise ValueError(f"levels: expected at least one noise level, got shape {points.shape}")
    for level in points.tolist():
        as_level(level)
    return tuple(map(str, seeds)), points
