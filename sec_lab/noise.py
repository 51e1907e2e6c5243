"""How much noise event chains stand (§3.1): noisy samples of a seed, and what becomes of similarity and roles.

A sample is the seed with relations flipped, and with rows and columns added between those that are there. All samples
of a call are drawn together and compared in compiled loops. Every block of samples has a generator of its own, so the
numbers do not depend on threads, processes or machines.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args, overload

import numpy as np
from numpy.typing import NDArray

from sec_lab import _noise_kernels as kernels
from sec_lab._packed_chains import check_comparable
from sec_lab.codes import Relations, as_relations
from sec_lab.event_chain import EventChain
from sec_lab.similarity import EFFORT, Normalizer, check_options

if TYPE_CHECKING:
    pass

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
        return EventChain.unchecked(self.relations[i][rows][:, columns], self.pairs[i][rows], self.seed.names)


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
    level = as_level(p)
    n = as_count(n_samples, "n_samples")
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


def as_level(p: float) -> float:
    """A noise level, checked."""
    if not isinstance(p, int | float | np.number) or not 0 <= p <= 1:
        raise ValueError(f"p: expected a probability from 0 to 1, got {p!r}")
    return float(p)


def as_count(n: int, name: str, *, least: int = 1) -> int:
    """A number of things, checked; ``name`` is what the error calls it."""
    if not isinstance(n, int | np.integer) or isinstance(n, bool) or n < least:
        raise ValueError(f"{name}: expected a whole number of at least {least}, got {n!r}")
    return int(n)
