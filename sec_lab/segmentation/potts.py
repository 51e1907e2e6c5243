"""Superparamagnetic clustering of one picture: a Potts lattice whose spins settle into segments (step 1, §2.2).

Every pixel carries a spin σ, its label. The energy of the lattice is E = −Σ J_ij δ(σ_i, σ_j) over all pairs of
neighbours (8 a pixel), with couplings J_ij = 1 − ‖g_i − g_j‖ / Δ that fall with the difference of the colours g; Δ is α
times its mean over all pairs. So neighbours of like colour gain by having one label. Metropolis sweeps with a falling
temperature bring the energy down; they leave the lattice broken into many domains, which cluster moves then join: two
domains become one where their whole common border attracts.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.segmentation.lattice import (
    DEFAULT,
    MAX_SPIN,
    N_SPINS,
    SOFT,
    Couplings,
    PottsParameters,
    as_depth,
    as_labels,
    as_picture,
    as_seed,
    joined,
    picture_couplings,
    swept,
)
from sec_lab.segmentation.record import Labels


def superparamagnetic_clustering(
    image: ArrayLike,
    *,
    parameters: PottsParameters = DEFAULT,
    depth_m: ArrayLike | None = None,
    seed: int = 0,
) -> Labels:
    """Segments of one picture, found without any labels to begin with (step 1, §2.2).

    Random spins are annealed, the domains that result joined as long as they attract each other, and the borders
    smoothed.

    Parameters
    ----------
    image : (height, width, 3) array_like of uint8
        RGB.
    parameters : PottsParameters, optional
    depth_m : (height, width) array_like of float, optional
        Metres along the optical axis; 0 where nothing was measured.
    seed : int, optional
        Same seed, same labels.

    Returns
    -------
    (height, width) uint16
        Connected segments (8 neighbours) with labels from 1 on, the largest first.

    Raises
    ------
    ValueError
        If the picture, the depth or the seed is not what is expected.

    Examples
    --------
    >>> image = np.full((20, 30, 3), 40, dtype=np.uint8)
    >>> image[5:15, 10:20] = (200, 40, 40)
    >>> labels = superparamagnetic_clustering(image)
    >>> labels.max(), labels[0, 0], labels[10, 15]
    (np.uint16(2), np.uint16(1), np.uint16(2))
    """
    picture, depth, start = as_picture(image), as_depth(depth_m, image), as_seed(seed)
    couplings, _ = picture_couplings(picture, parameters=parameters, depth_m=depth)
    spins = np.random.default_rng(start).integers(1, N_SPINS + 1, picture.shape[:2], dtype=np.int16)
    temperatures = parameters.temperature * parameters.cooling ** np.arange(parameters.anneal_sweeps)
    spins = swept(spins, couplings, temperatures.tolist(), seed=start)
    labels = joined(spins, couplings, parameters=parameters)
    if parameters.smooth_sweeps and labels.max() <= MAX_SPIN:
        spins = swept(labels.astype(np.int16), couplings, [0.0] * parameters.smooth_sweeps, seed=start, lowest=SOFT)
        labels = joined(spins, couplings, parameters=parameters)
    if labels.max() >= 1 << 16:
        raise ValueError(
            f"image: expected a picture that settles into less than {1 << 16} segments, got {labels.max()}: "
            "alpha or minimum_size_px is too small"
        )
    return labels.astype(np.uint16)


def relax(
    image: ArrayLike,
    labels: ArrayLike,
    *,
    parameters: PottsParameters = DEFAULT,
    depth_m: ArrayLike | None = None,
    seed: int = 0,
) -> Labels:
    """Labels that are nearly right, settled on a picture: a warm start instead of annealing (step 1, §2.2).

    Borders that are off by a pixel or so move to where colours change (they need several sweeps for it), and a vacant
    place goes to the neighbour that attracts it. One that repels its neighbours stays vacant: something new is there.

    Parameters
    ----------
    image : (height, width, 3) array_like of uint8
        RGB.
    labels : (height, width) array_like of int
        From 1 to 32,767; 0 is vacant.
    parameters : PottsParameters, optional
    depth_m : (height, width) array_like of float, optional
        Metres along the optical axis; 0 where nothing was measured.
    seed : int, optional

    Returns
    -------
    (height, width) uint16

    Raises
    ------
    ValueError
        If picture, labels, depth or seed are not what is expected.

    Examples
    --------
    >>> image = np.full((20, 30, 3), 40, dtype=np.uint8)
    >>> image[5:15, 10:20] = (200, 40, 40)
    >>> labels = np.full((20, 30), 7)
    >>> labels[6:15, 11:21] = 9
    >>> labels[0:3, 0:2] = 0
    >>> relaxed = relax(image, labels, parameters=PottsParameters(relax_sweeps=20))
    >>> bool((relaxed == np.where(image[..., 0] == 200, 9, 7)).all())
    True
    """
    picture = as_picture(image)
    values = as_labels(labels, picture)
    if values.min() < 0 or values.max() > MAX_SPIN:
        raise ValueError(f"labels: expected 0 to {MAX_SPIN}, got {values.min()} to {values.max()}")
    couplings, _ = picture_couplings(picture, parameters=parameters, depth_m=as_depth(depth_m, picture))
    start = as_seed(seed)
    temperatures = [parameters.relax_temperature] * parameters.relax_sweeps
    spins = swept(values.astype(np.int16), couplings, temperatures, seed=start)
    spins = swept(spins, couplings, [0.0] * parameters.smooth_sweeps, seed=start + 1, lowest=SOFT)
    return _filled(spins, couplings)


def lattice_energy(
    image: ArrayLike,
    labels: ArrayLike,
    *,
    parameters: PottsParameters = DEFAULT,
    depth_m: ArrayLike | None = None,
) -> float:
    """Energy E = −Σ J_ij δ(σ_i, σ_j) of a picture's lattice with given labels (§2.2).

    Parameters
    ----------
    image : (height, width, 3) array_like of uint8
        RGB.
    labels : (height, width) array_like of int
    parameters : PottsParameters, optional
    depth_m : (height, width) array_like of float, optional
        Metres along the optical axis; 0 where nothing was measured.

    Returns
    -------
    float
        In units of J.

    Raises
    ------
    ValueError
        If picture, labels or depth are not what is expected.

    Examples
    --------
    A grey picture of 2×2 pixels has 6 pairs of neighbours, 2 of them with one label here:

    >>> lattice_energy(np.zeros((2, 2, 3), dtype=np.uint8), [[1, 1], [2, 2]])
    -2.0
    """
    from sec_lab.segmentation import _potts_kernels

    picture = as_picture(image)
    values = as_labels(labels, picture)
    couplings, _ = picture_couplings(picture, parameters=parameters, depth_m=as_depth(depth_m, picture))
    return -float(_potts_kernels.bond_sum(couplings, values)) / _potts_kernels.UNIT


def _filled(spins: NDArray[np.int16], couplings: Couplings) -> Labels:
    """Labels in which a vacant domain has gone to the neighbour that attracts it most, if any does."""
    from sec_lab.segmentation import _domain_kernels

    domains, sizes, label_of = _domain_kernels.domains_of(spins)
    pairs, sums, counts = _domain_kernels.borders_of(domains, couplings, len(sizes))
    most = np.zeros(len(sizes))
    taken = label_of.copy()
    for (a, b), mean in zip(pairs.tolist(), (sums / np.maximum(counts, 1)).tolist(), strict=True):
        for domain, other in ((a, b), (b, a)):
            if label_of[domain] == 0 and label_of[other] > 0 and mean > most[domain]:
                taken[domain], most[domain] = label_of[other], mean
    filled: Labels = taken.astype(np.uint16)[domains]
    return filled
