"""Superparamagnetic clustering: the lattice against plain Python, and pictures whose segments are known."""

import dataclasses
import math

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sec_lab.segmentation import PottsParameters, superparamagnetic_clustering
from sec_lab.segmentation._domain_kernels import bond_domains_of, borders_of, domains_of
from sec_lab.segmentation._joining_kernels import merge_domains
from sec_lab.segmentation.potts import (
    colour_channels,
    lattice_energy,
    noise_table,
    picture_couplings,
    swept,
)
from tests.naive_potts import (
    STEPS,
    Bonds,
    naive_bonds,
    naive_borders,
    naive_domains,
    naive_energy,
    naive_merging,
    naive_sweeps,
)

SIZES = st.tuples(st.integers(1, 9), st.integers(1, 9))
SEEDS = st.integers(0, 2**32)
RAW = PottsParameters(alpha=2, colour_space="rgb", blur_sigma_px=0)


def picture(size: tuple[int, int], seed: int, *, n_colours: int = 3) -> NDArray[np.uint8]:
    """Pixels of a few colours with a little noise."""
    rng = np.random.default_rng(seed)
    colours = rng.integers(0, 256, (n_colours, 3))
    noisy = colours[rng.integers(0, n_colours, size)] + rng.integers(-6, 7, (*size, 3))
    return np.clip(noisy, 0, 255).astype(np.uint8)


def bonds_of(couplings: NDArray[np.int8], size: tuple[int, int]) -> Bonds:
    """Couplings as the twins keep them."""
    bonds = {}
    for direction, (down, right) in enumerate(STEPS):
        for y in range(size[0] - down):
            for x in range(max(0, -right), size[1] - max(0, right)):
                j = couplings[direction, 2 * (y % 2) + x % 2, y // 2 + 1, x // 2 + 1]
                bonds[frozenset(((y, x), (y + down, x + right)))] = int(j)
    return bonds


@given(SIZES, SEEDS, st.sampled_from([0.5, 1, 2, 5]))
def test_couplings_are_those_of_the_equation(size: tuple[int, int], seed: int, alpha: float) -> None:
    image = picture(size, seed)
    parameters = dataclasses.replace(RAW, alpha=alpha)
    couplings, scale = picture_couplings(image, parameters=parameters)
    assert bonds_of(couplings, size) == naive_bonds(np.moveaxis(image, 2, 0), alpha)
    # Given the scale it has, the picture gets the same couplings; nothing lies beyond the picture.
    again, same = picture_couplings(image, parameters=parameters, scale=scale)
    assert (again == couplings).all()
    assert same == scale
    assert np.count_nonzero(couplings) == sum(j != 0 for j in bonds_of(couplings, size).values())


@given(SIZES, SEEDS)
def test_energy(size: tuple[int, int], seed: int) -> None:
    image = picture(size, seed)
    labels = np.random.default_rng(seed).integers(0, 3, size)
    energy = lattice_energy(image, labels, parameters=RAW)
    assert 32 * energy == naive_energy(labels, naive_bonds(np.moveaxis(image, 2, 0), RAW.alpha))


def test_energy_of_two_fields() -> None:
    # Differences are 0 along the fields and 30·√3 across: 2 + 2 bonds inside, 1 + 1 + 2 = 4 across. Δ is α times the
    # mean, 2 · (4 / 6) · 30·√3 (2×2 pixels, 6 bonds of which 2 inside), so J across is 1 − 3/4.
    image = np.zeros((2, 2, 3), dtype=np.uint8)
    image[:, 1] = 30
    assert lattice_energy(image, [[1, 1], [1, 1]], parameters=RAW) == -(2 + 4 * 0.25)
    assert lattice_energy(image, [[1, 2], [1, 2]], parameters=RAW) == -2
    assert lattice_energy(image, [[1, 2], [3, 4]], parameters=RAW) == 0


@settings(max_examples=50)
@given(SIZES, SEEDS, st.lists(st.sampled_from([0.0, 0.1, 1.0]), min_size=1, max_size=4), st.sampled_from([-127, 2]))
def test_sweeps(size: tuple[int, int], seed: int, temperatures: list[float], lowest: int) -> None:
    couplings, _ = picture_couplings(picture(size, seed), parameters=RAW)
    spins = np.random.default_rng(seed).integers(0, 5, size, dtype=np.int16)
    noise = noise_table(tuple(temperatures), couplings.shape[3])
    expected = naive_sweeps(spins, bonds_of(couplings, size), noise, lowest, seed)
    assert (swept(spins, couplings, temperatures, seed=seed, lowest=lowest) == expected).all()


@given(SIZES, SEEDS)
def test_sweeps_without_temperature_never_raise_the_energy(size: tuple[int, int], seed: int) -> None:
    image = picture(size, seed)
    couplings, _ = picture_couplings(image, parameters=RAW)
    spins = np.random.default_rng(seed).integers(0, 5, size, dtype=np.int16)
    for n_sweeps in range(1, 5):
        new = swept(spins, couplings, [0.0], seed=seed + n_sweeps)
        assert lattice_energy(image, new, parameters=RAW) <= lattice_energy(image, spins, parameters=RAW)
        spins = new


@given(SIZES, SEEDS)
def test_domains(size: tuple[int, int], seed: int) -> None:
    labels = np.random.default_rng(seed).integers(0, 3, size)
    domains, sizes, label_of = domains_of(labels)
    assert (domains == naive_domains(labels)).all()
    assert (sizes == np.bincount(domains.ravel())).all()
    assert (label_of[domains] == labels).all()


@given(SIZES, SEEDS, st.sampled_from([0, 8]))
def test_domains_that_bonds_hold_together(size: tuple[int, int], seed: int, least: int) -> None:
    couplings, _ = picture_couplings(picture(size, seed), parameters=RAW)
    labels = np.random.default_rng(seed).integers(0, 2, size, dtype=np.int16)
    domains, sizes, label_of = bond_domains_of(labels, couplings, least)
    assert (domains == naive_domains(labels, bonds_of(couplings, size), least)).all()
    assert (sizes == np.bincount(domains.ravel())).all()
    assert (label_of[domains] == labels).all()


@given(SIZES, SEEDS)
def test_borders(size: tuple[int, int], seed: int) -> None:
    couplings, _ = picture_couplings(picture(size, seed), parameters=RAW)
    domains = naive_domains(np.random.default_rng(seed).integers(0, 4, size)).astype(np.int32)
    pairs, sums, counts = borders_of(domains, couplings, domains.max() + 1)
    expected = naive_borders(domains, bonds_of(couplings, size))
    assert [tuple(pair) for pair in pairs.tolist()] == list(expected)
    assert sums.tolist() == [sum(border) for border in expected.values()]
    assert counts.tolist() == [len(border) for border in expected.values()]


def test_borders_of_very_many_domains() -> None:
    # Every pixel is a domain of its own: more pairs than the first table holds, each with one bond.
    domains = np.arange(60 * 70, dtype=np.int32).reshape(60, 70)
    couplings, _ = picture_couplings(picture((60, 70), 1), parameters=RAW)
    pairs, sums, counts = borders_of(domains, couplings, domains.size)
    assert len(pairs) == 60 * 69 + 59 * 70 + 2 * 59 * 69
    assert (counts == 1).all()
    expected = bonds_of(couplings, (60, 70))
    for (a, b), j in zip(pairs[::97].tolist(), sums[::97].tolist(), strict=True):
        assert expected[frozenset((divmod(a, 70), divmod(b, 70)))] == j


@given(SIZES, SEEDS, st.integers(1, 6), st.integers(0, 3))
def test_merging(size: tuple[int, int], seed: int, minimum: int, thickness: int) -> None:
    couplings, _ = picture_couplings(picture(size, seed), parameters=RAW)
    domains = naive_domains(np.random.default_rng(seed).integers(0, 4, size)).astype(np.int32)
    n = int(domains.max()) + 1
    roots = merge_domains(*borders_of(domains, couplings, n), np.bincount(domains.ravel()), minimum, thickness)
    expected = naive_merging(domains, bonds_of(couplings, size), minimum, thickness)
    assert (roots[domains] == expected).all()


def four_fields(*, noise: float, seed: int = 0) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Picture of two boxes and a disc on a ground, and what belongs to which."""
    truth = np.zeros((128, 160), dtype=np.int64)
    truth[20:60, 20:70] = 1
    truth[50:110, 60:150] = 2
    rows, columns = np.ogrid[:128, :160]
    truth[(rows - 60) ** 2 + (columns - 110) ** 2 < 500] = 3
    colours = np.array([[60, 120, 60], [200, 60, 60], [60, 60, 200], [220, 200, 60]])
    noisy = colours[truth] + np.random.default_rng(seed).normal(0, noise, (128, 160, 3))
    return np.clip(noisy, 0, 255).astype(np.uint8), truth


@pytest.mark.parametrize("alpha", [2, 3, 5])
@pytest.mark.parametrize("blur", [0.7, 1])
@pytest.mark.parametrize("noise", [1, 8])
def test_fields_become_segments(alpha: float, blur: float, noise: float) -> None:
    image, truth = four_fields(noise=noise)
    parameters = PottsParameters(alpha=alpha, blur_sigma_px=blur, colour_space="rgb")
    labels = superparamagnetic_clustering(image, parameters=parameters)
    assert np.unique(labels).tolist() == [1, 2, 3, 4]
    # The largest comes first.
    order = np.argsort(-np.bincount(truth.ravel()))
    assert np.mean(order[labels - 1] == truth) > 0.98


def test_metropolis_alone_leaves_the_picture_in_pieces() -> None:
    image, _ = four_fields(noise=8)
    couplings, _ = picture_couplings(image, parameters=RAW)
    spins = np.random.default_rng(0).integers(1, 257, image.shape[:2], dtype=np.int16)
    spins = swept(spins, couplings, [0.0] * 40, seed=0)
    assert len(domains_of(spins)[1]) > 100


def test_depth_parts_what_has_one_colour() -> None:
    image = np.full((40, 60, 3), 120, dtype=np.uint8)
    depth = np.full((40, 60), 1.0)
    depth[10:30, 20:40] = 0.9
    assert (superparamagnetic_clustering(image) == 1).all()
    labels = superparamagnetic_clustering(image, depth_m=depth)
    assert ((labels == 2) == (depth < 0.95)).mean() > 0.98
    # A jump within the limit, or to where nothing was measured, parts nothing.
    wide = PottsParameters(depth_jump_m=0.2)
    assert (superparamagnetic_clustering(image, depth_m=depth, parameters=wide) == 1).all()
    assert (superparamagnetic_clustering(image, depth_m=np.where(depth < 0.95, 0, depth)) == 1).all()


def test_small_and_thin_segments_are_joined() -> None:
    image = np.full((40, 60, 3), 60, dtype=np.uint8)
    image[10:13, 10:13] = 200
    image[20:22, 5:55] = 200
    image[28:38, 30:50] = 200
    keeping = PottsParameters(minimum_size_px=1, minimum_thickness_px=0, blur_sigma_px=0)
    assert superparamagnetic_clustering(image, parameters=keeping).max() == 4
    joining = dataclasses.replace(keeping, minimum_size_px=12, minimum_thickness_px=3)
    labels = superparamagnetic_clustering(image, parameters=joining)
    assert labels.max() == 2
    assert ((labels == 2).nonzero()[0].min(), (labels == 2).nonzero()[1].max()) == (28, 49)


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (7, 1), (2, 2), (33, 47), (64, 50)])
def test_number_of_threads_changes_nothing(size: tuple[int, int]) -> None:
    image = picture(size, 5)
    before = numba.get_num_threads()
    found = []
    try:
        for n_threads in range(1, numba.config.NUMBA_NUM_THREADS + 1):
            numba.set_num_threads(n_threads)
            found.append(superparamagnetic_clustering(image, seed=3))
    finally:
        numba.set_num_threads(before)
    assert all((labels == found[0]).all() for labels in found)
    assert found[0].dtype == np.uint16
    assert np.unique(found[0]).tolist() == list(range(1, found[0].max() + 1))


def test_grey_has_no_colour_in_lab() -> None:
    image = np.array([[(0, 0, 0), (255, 255, 255), (128, 128, 128)]], dtype=np.uint8)
    channels = colour_channels(image, parameters=PottsParameters(blur_sigma_px=0))
    # L* of 0, 100 and 54, 1.7 fold; 128 is no colour.
    assert channels[0].tolist() == [[0, 170, 91]]
    assert (channels[1:] == 128).all()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"alpha": 0}, "alpha: expected a number above 0 and up to 10, got 0"),
        ({"alpha": math.nan}, "alpha: .* got nan"),
        ({"cooling": 1.5}, "cooling: expected a number above 0 and up to 1, got 1.5"),
        ({"anneal_sweeps": 0}, "anneal_sweeps: expected a whole number from 1 on, got 0"),
        ({"relax_sweeps": 2.5}, "relax_sweeps: expected whole numbers, got 2.5"),
        ({"minimum_size_px": 0}, "minimum_size_px: expected a whole number from 1 on, got 0"),
        ({"temperature": -1}, "temperature: expected a number from 0 on, got -1"),
        ({"blur_sigma_px": math.inf}, "blur_sigma_px: expected a number from 0 on, got inf"),
        ({"depth_jump_m": 0}, "depth_jump_m: expected a number above 0, got 0"),
        ({"colour_space": "hsv"}, "colour_space: expected one of .*, got 'hsv'"),
    ],
)
def test_bad_parameters(values: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PottsParameters(**values)  # type: ignore[arg-type]


IMAGE = np.zeros((4, 6, 3), dtype=np.uint8)


@pytest.mark.parametrize(
    ("image", "options", "message"),
    [
        (IMAGE[:, :, 0], {}, r"image: expected 3 dimensions, got shape \(4, 6\)"),
        (IMAGE.astype(float), {}, "image: expected shape .* of type uint8, got .* of float64"),
        (IMAGE[:0], {}, "image: expected shape"),
        (IMAGE, {"depth_m": np.ones((6, 4))}, "depth: expected 4×6 like the picture, got 6×4"),
        (IMAGE, {"depth_m": np.full((4, 6), np.nan)}, "depth: expected finite metres from 0 on"),
        (IMAGE, {"depth_m": -np.ones((4, 6))}, "depth: expected finite metres from 0 on"),
        (IMAGE, {"seed": -1}, "seed: expected a whole number from 0 on, got -1"),
    ],
)
def test_bad_input(image: NDArray[np.uint8], options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        superparamagnetic_clustering(image, **options)  # type: ignore[arg-type]


def test_labels_of_another_size_have_no_energy() -> None:
    with pytest.raises(ValueError, match=r"labels: expected shape \(4, 6\) like the picture, got \(6, 4\)"):
        lattice_energy(IMAGE, np.ones((6, 4), dtype=int))
