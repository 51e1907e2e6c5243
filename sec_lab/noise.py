"""How much noise event chains stand (§3.1): noisy samples of a seed, and what becomes of similarity and roles.

A sample is the seed with relations flipped, and with rows and columns added between those that are there. All samples
of a call are drawn together and compared in compiled loops. Every block of samples has a generator of its own, so the
numbers do not depend on threads, processes or machines.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_args, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab import _noise_kernels as kernels
from sec_lab._packed_chains import check_comparable
from sec_lab.codes import Relations, as_relations
from sec_lab.event_chain import EventChain
from sec_lab.similarity import EFFORT, Normalizer, check_options

if TYPE_CHECKING:
    import pandas as pd

Mode = Literal["flip and add", "add only", "flip only"]
AddedValues = Literal["uniform", "lasting"]
AddedPair = Literal["fragment", "one object", "two fragments"]

LEVELS = tuple(round(0.1 * step, 1) for step in range(11))
"""Noise levels of chapter 3."""

RELATIONS = (0, 1, 2, 9)

_CODE = np.zeros(10, np.uint8)
_CODE[list(RELATIONS)] = range(4)
BLOCK = 1000
"""Samples that are drawn with one generator."""


@dataclass(frozen=True)
class Noise:
    """What noise does to a chain.

    Parameters
    ----------
    mode : {"flip and add", "add only", "flip only"}, optional
        The two cases of §3.1, and that of §3.2, where networks need chains of one size.
    added_values : {"uniform", "lasting"}, optional
        What an added row or column says, which the thesis leaves open. ``"uniform"``: any relation, entry by entry.
        ``"lasting"``: with even chance what was there one column before, otherwise any relation.
    added_pair : {"fragment", "one object", "two fragments"}, optional
        What an added row is a pair of, which the thesis leaves open too: a new segment and any one of the seed; a new
        segment and always the same one of the seed, drawn once a sample; or two new segments.
    relations : sequence of at least two of {0, 1, 2, 9}, optional
        Relations that noise may write.

    Raises
    ------
    ValueError
        If an option is unknown, or there are fewer than two relations.

    Examples
    --------
    >>> Noise(mode="add only").added_values
    'uniform'
    """

    mode: Mode = "flip and add"
    added_values: AddedValues = "uniform"
    added_pair: AddedPair = "fragment"
    relations: tuple[int, ...] = RELATIONS

    def __post_init__(self) -> None:
        for name, options in (("mode", Mode), ("added_values", AddedValues), ("added_pair", AddedPair)):
            if getattr(self, name) not in get_args(options):
                raise ValueError(f"{name}: expected one of {get_args(options)}, got {getattr(self, name)!r}")
        given = np.unique(as_relations(np.asarray(self.relations), ndim=1)).tolist()
        if len(given) < 2 or len(given) != len(self.relations):
            raise ValueError(f"relations: expected at least two different ones, got {tuple(self.relations)}")
        object.__setattr__(self, "relations", tuple(int(code) for code in self.relations))


DEFAULT_NOISE = Noise()


@dataclass(frozen=True, eq=False)
class NoisySamples(Sequence[EventChain]):
    """Noisy samples of a seed with m rows and k columns; each is an event chain.

    Places alternate: seed, gap, seed, …; gaps are filled where noise has added something.

    Attributes
    ----------
    seed : EventChain
    relations : (n, 2 m − 1, 2 k − 1) uint8
        Relations at all places.
    rows : (n, 2 m − 1) bool
    columns : (n, 2 k − 1) bool
        Rows and columns that are there.
    pairs : (n, 2 m − 1, 2) int64
        Segments of all rows; those of the seed keep their labels.
    """

    seed: EventChain
    relations: Relations
    rows: NDArray[np.bool_]
    columns: NDArray[np.bool_]
    pairs: NDArray[np.int64]

    def __post_init__(self) -> None:
        for name in ("relations", "rows", "columns", "pairs"):
            array = np.array(getattr(self, name))
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.relations)

    @overload
    def __getitem__(self, i: int) -> EventChain: ...
    @overload
    def __getitem__(self, i: slice) -> "NoisySamples": ...
    def __getitem__(self, i: int | slice) -> "EventChain | NoisySamples":
        if isinstance(i, slice):
            return NoisySamples(self.seed, self.relations[i], self.rows[i], self.columns[i], self.pairs[i])
        rows, columns = self.rows[i], self.columns[i]
        return EventChain(self.relations[i][rows][:, columns], self.pairs[i][rows], names=self.seed.names)


def noisy_samples(
    seed: EventChain, p: float, *, n_samples: int = 100, rng: np.random.Generator, noise: Noise = DEFAULT_NOISE
) -> NoisySamples:
    """Draw noisy samples of a seed (§3.1, Fig. 3.1).

    Every element is flipped to another relation with probability p; every gap between two rows, and between two
    columns, gets one more with probability p.

    Parameters
    ----------
    seed : EventChain
        The manipulation, (m, k); at least two columns and a row that changes.
    p : float
        Noise level, 0 to 1.
    n_samples : int, optional
    rng : numpy.random.Generator
    noise : Noise, optional
        What noise does.

    Raises
    ------
    TypeError
        If the seed is no event chain.
    ValueError
        If p is outside [0, 1], there is no sample, nothing changes in the seed, or it has relations that noise lacks.

    Examples
    --------
    >>> seed = EventChain([[0, 2, 0], [0, 0, 2]], [(1, 2), (2, 3)])
    >>> samples = noisy_samples(seed, 1.0, n_samples=5, rng=np.random.default_rng(0))
    >>> len(samples), samples[0].relations.shape, bool((samples.relations[:, ::2, ::2] != seed.relations).all())
    (5, (3, 5), True)
    """
    check_comparable(seed, "seed")
    level = _as_level(p)
    n = _as_count(n_samples, "n_samples")
    alphabet = np.array(noise.relations, np.uint8)
    unknown = np.setdiff1d(seed.relations, alphabet)
    if unknown.size:
        raise ValueError(f"seed: expected relations out of {noise.relations}, got {int(unknown[0])} too")
    (m, k), add = seed.relations.shape, noise.mode != "flip only"
    relations = alphabet[rng.integers(len(alphabet), size=(n, 2 * m - 1, 2 * k - 1), dtype=np.uint8)]
    relations[:, ::2, ::2] = seed.relations
    if noise.mode != "add only":
        flipped = rng.random((n, m, k), dtype=np.float32) < np.float32(level)
        # A step of 1 to n − 1 around the relations never comes back to the one it left.
        place = np.searchsorted(np.sort(alphabet), seed.relations)
        step = rng.integers(1, len(alphabet), size=(n, m, k), dtype=np.uint8)
        others = np.sort(alphabet)[(place + step) % len(alphabet)]
        relations[:, ::2, ::2] = np.where(flipped, others, seed.relations)
    rows, columns = np.zeros((n, 2 * m - 1), bool), np.zeros((n, 2 * k - 1), bool)
    rows[:, ::2] = columns[:, ::2] = True
    if add:
        rows[:, 1::2] = rng.random((n, m - 1)) < level
        columns[:, 1::2] = rng.random((n, k - 1)) < level
        if noise.added_values == "lasting":
            _hold(relations, rng)
    return NoisySamples(seed, relations, rows, columns, _added_pairs(seed, n, rng, noise.added_pair))


def _hold(relations: Relations, rng: np.random.Generator) -> None:
    """Let what is added hold on to what was there before, with even chance."""
    n, n_rows, n_columns = relations.shape
    holds = rng.random((n, n_rows, n_columns), dtype=np.float32) < 0.5
    for x in range(1, n_columns):
        added = slice(1, None, 2) if x % 2 == 0 else slice(None)
        before, now = relations[:, added, x - 1], relations[:, added, x]
        relations[:, added, x] = np.where(holds[:, added, x], before, now)


def _added_pairs(seed: EventChain, n: int, rng: np.random.Generator, kind: AddedPair) -> NDArray[np.int64]:
    m, segments = len(seed.pairs), seed.segments
    pairs = np.empty((n, 2 * m - 1, 2), np.int64)
    pairs[:, ::2] = seed.pairs
    fresh = segments.max() + 1 + np.arange(2 * (m - 1)).reshape(2, m - 1)
    pairs[:, 1::2, 0] = fresh[0]
    if kind == "two fragments":
        pairs[:, 1::2, 1] = fresh[1]
    else:
        size = (n, m - 1) if kind == "fragment" else (n, 1)
        pairs[:, 1::2, 1] = segments[rng.integers(len(segments), size=size)]
    return pairs


@dataclass(frozen=True, eq=False)
class SeedComparison:
    """How far a seed is found again in its samples.

    Attributes
    ----------
    spatial, temporal : (n,) float64
        Similarity in percent; 0 where nothing changes in a sample.
    exact : (n,) bool
        Whether the temporal similarity is proven to be the optimum.
    n_objects : int
        Segments in rows of the seed that change.
    objects_right, objects_tied, objects_wrong : (n,) int64
        How many of them have themselves as counterpart (§2.8), are left between several equally good ones, and have
        another segment. The others have no counterpart at all.
    """

    spatial: NDArray[np.float64]
    temporal: NDArray[np.float64]
    exact: NDArray[np.bool_]
    n_objects: int
    objects_right: NDArray[np.int64]
    objects_tied: NDArray[np.int64]
    objects_wrong: NDArray[np.int64]

    def __post_init__(self) -> None:
        for name in ("spatial", "temporal", "exact", "objects_right", "objects_tied", "objects_wrong"):
            array = np.array(getattr(self, name))
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def objects_percent(self) -> NDArray[np.float64]:
        """Share of the objects that are matched rightly, (n,) in percent; ties do not count."""
        return 100.0 * self.objects_right / self.n_objects


def compare_with_seed(
    samples: NoisySamples,
    *,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    effort: int = EFFORT,
) -> SeedComparison:
    """Compare a seed, as ξ¹, with all its samples, and count the objects that are matched (§3.1.1, §3.1.2).

    Gives what :func:`~sec_lab.similarity.compare` and :func:`~sec_lab.roles.corresponding_segments` give, sample by
    sample.

    Parameters
    ----------
    samples : NoisySamples
    normalizer, tolerance_percent, effort
        As in :func:`~sec_lab.similarity.compare`.

    Raises
    ------
    ValueError
        If an option is unknown.

    Examples
    --------
    >>> seed = EventChain([[0, 2, 2], [0, 0, 2], [2, 0, 0]], [(1, 2), (2, 3), (1, 3)])
    >>> found = compare_with_seed(noisy_samples(seed, 0.0, n_samples=2, rng=np.random.default_rng(0)))
    >>> found.temporal, found.objects_percent
    (array([100., 100.]), array([100., 100.]))
    """
    check_options(normalizer, tolerance_percent, "original", effort)
    seed, n = samples.seed, len(samples)
    changing = seed.changing_rows
    first = np.unique(seed.pairs[changing])
    # Objects of the seed are numbered first, so that each has one number in the seed and in the samples.
    order = np.concatenate([first, np.setdiff1d(samples.pairs, first)])
    sorter = np.argsort(order)
    number = sorter[np.searchsorted(order, samples.pairs, sorter=sorter)].astype(np.int64)
    spatial, temporal, exact = np.empty(n), np.empty(n), np.empty(n, np.bool_)
    objects = np.empty((n, 3), np.int64)
    kernels.compare_with_samples(
        _CODE[seed.relations[changing]], sorter[np.searchsorted(order, seed.pairs[changing], sorter=sorter)],
        len(first), len(order), _CODE[samples.relations], samples.rows, samples.columns, number,
        int(normalizer == "shorter"), float(tolerance_percent), effort, spatial, temporal, exact, objects,
    )  # fmt: skip
    return SeedComparison(spatial, temporal, exact, len(first), *objects.T)


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
        return _table(getattr(self, measure).mean(axis=2), self)

    def standard_error(self, measure: Literal["similarity", "objects", "tied"] = "similarity") -> "pd.DataFrame":
        """Standard errors of the means in percentage points; not a number where there is a single sample."""
        values = getattr(self, measure)
        n = values.shape[2]
        spread = values.std(axis=2, ddof=1) if n > 1 else np.full(values.shape[:2], np.nan)
        return _table(spread / np.sqrt(n), self)


def _table(values: NDArray[np.float64], study: NoiseStudy) -> "pd.DataFrame":
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
    n = _as_count(n_samples, "n_samples")
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
        import pandas as pd

        index = pd.Index(self.levels, name="noise level p")
        return pd.DataFrame(self.similarity.mean(axis=2).T, index=index, columns=list(self.seeds))


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
    n = _as_count(n_samples, "n_samples", least=2)
    count = _as_count(n_models, "n_models")
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


def shuffled_rows(samples: NoisySamples, *, rng: np.random.Generator) -> list[EventChain]:
    """The samples as chains whose rows stand in any order, as they do in recordings (§3.3).

    Examples
    --------
    >>> seed = EventChain([[0, 2, 0], [0, 0, 2]], [(1, 2), (2, 3)])
    >>> samples = noisy_samples(seed, 0.0, n_samples=1, rng=np.random.default_rng(0))
    >>> sorted(shuffled_rows(samples, rng=np.random.default_rng(0))[0].relations.tolist())
    [[0, 0, 2], [0, 2, 0]]
    """
    chains = []
    for chain in samples:
        order = rng.permutation(len(chain.pairs))
        chains.append(EventChain(chain.relations[order], chain.pairs[order], chain.key_frames, chain.names))
    return chains


def added_only(noise: Noise) -> Noise:
    """The same noise without flips.

    Examples
    --------
    >>> added_only(Noise(relations=(0, 2))).mode
    'add only'
    """
    return replace(noise, mode="add only")


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
        _as_level(level)
    return tuple(map(str, seeds)), points


def _as_level(p: float) -> float:
    if not isinstance(p, int | float | np.number) or not 0 <= p <= 1:
        raise ValueError(f"p: expected a probability from 0 to 1, got {p!r}")
    return float(p)


def _as_count(n: int, name: str, *, least: int = 1) -> int:
    if not isinstance(n, int | np.integer) or isinstance(n, bool) or n < least:
        raise ValueError(f"{name}: expected a whole number of at least {least}, got {n!r}")
    return int(n)
