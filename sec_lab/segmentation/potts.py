"""Superparamagnetic clustering of one picture: a Potts lattice whose spins settle into segments (step 1, §2.2).

Every pixel carries a spin σ, its label. The energy of the lattice is E = −Σ J_ij δ(σ_i, σ_j) over all pairs of
neighbours (8 a pixel), with couplings J_ij = 1 − ‖g_i − g_j‖ / Δ that fall with the difference of the colours g; Δ is α
times its mean over all pairs. So neighbours of like colour gain by having one label. Metropolis sweeps with a falling
temperature bring the energy down; they leave the lattice broken into many domains, which cluster moves then join: two
domains become one where their whole common border attracts.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array, as_integers
from sec_lab.segmentation.record import Labels

ColourSpace = Literal["rgb", "lab"]
Couplings = NDArray[np.int8]
Channels = NDArray[np.uint8]

MAX_SPIN = (1 << 15) - 1
"""Largest label in a lattice: spins are kept in 16 bits with a sign."""

N_SPINS = 256
"""Number q of spin values with which a lattice without labels begins."""

LOWEST = -127
"""Lowest coupling of all, in the kernels' whole numbers (32 is J = 1)."""

SOFT = 2
"""Lowest coupling in sweeps that smooth, in the same numbers."""

_FIRM = 8
"""A coupling that holds a domain together, in the kernels' whole numbers (32 is J = 1)."""

_MIN_SCALE = 1.0
_NOISE_SEED, _NOISE_LENGTH = 2009, 8192


@dataclass(frozen=True)
class PottsParameters:
    """How a Potts lattice is made and relaxed.

    Parameters
    ----------
    alpha : float, optional
        Δ in multiples of the mean colour difference of neighbours: the larger, the fewer segments. Above 0, up to 10.
    colour_space : {"lab", "rgb"}, optional
        Of the colours g. Lab is CIE L*a*b* with L* from 0 to 170 instead of 100: shadows weigh less than in RGB.
    blur_sigma_px : float, optional
        Standard deviation of the Gaussian blur before couplings are computed; 0 for none.
    anneal_sweeps : int, optional
        Metropolis sweeps over a picture that has no labels yet.
    relax_sweeps : int, optional
        Metropolis sweeps from labels that are given.
    smooth_sweeps : int, optional
        Sweeps at the end without temperature, in which no bond repels; they straighten borders across pixels of mixed
        colour.
    temperature : float, optional
        At which annealing begins, in units of J.
    cooling : float, optional
        By which the temperature is multiplied after every sweep of annealing.
    relax_temperature : float, optional
        At which labels that are given are relaxed, in units of J.
    minimum_size_px : int, optional
        Segments of fewer pixels are joined to the neighbour with the highest mean coupling along the border.
    minimum_thickness_px : int, optional
        The same of segments that are thinner: blur and mixed pixels make such rims around objects. 0 keeps them.
    depth_jump_m : float, optional
        Bonds are cut where depth, if there is any, jumps by more, in metres.

    Raises
    ------
    ValueError
        If a value is not allowed.

    Examples
    --------
    >>> PottsParameters(alpha=12)
    Traceback (most recent call last):
    ...
    ValueError: alpha: expected a number above 0 and up to 10, got 12
    """

    alpha: float = 6.0
    colour_space: ColourSpace = "lab"
    blur_sigma_px: float = 0.0
    anneal_sweeps: int = 20
    relax_sweeps: int = 4
    smooth_sweeps: int = 2
    temperature: float = 1.0
    cooling: float = 0.7
    relax_temperature: float = 0.1
    minimum_size_px: int = 60
    minimum_thickness_px: int = 3
    depth_jump_m: float = 0.02

    def __post_init__(self) -> None:
        for name, high in (("alpha", 10), ("cooling", 1)):
            value = getattr(self, name)
            if not 0 < value <= high:
                raise ValueError(f"{name}: expected a number above 0 and up to {high}, got {value}")
        least = {"anneal_sweeps": 1, "relax_sweeps": 0, "smooth_sweeps": 0, "minimum_size_px": 1}
        for name, low in (least | {"minimum_thickness_px": 0}).items():
            whole = int(as_integers(getattr(self, name), what=name, ndim=0))
            if whole < low:
                raise ValueError(f"{name}: expected a whole number from {low} on, got {whole}")
            object.__setattr__(self, name, whole)
        for name in ("temperature", "relax_temperature", "blur_sigma_px"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise ValueError(f"{name}: expected a number from 0 on, got {value}")
        if not 0 < self.depth_jump_m < math.inf:
            raise ValueError(f"depth_jump_m: expected a number above 0, got {self.depth_jump_m}")
        if self.colour_space not in get_args(ColourSpace):
            raise ValueError(f"colour_space: expected one of {get_args(ColourSpace)}, got {self.colour_space!r}")


DEFAULT = PottsParameters()
"""Parameters where none are said."""


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
    picture, depth, start = as_picture(image), _as_depth(depth_m, image), as_seed(seed)
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
    values = as_integers(labels, what="labels", ndim=2)
    if values.shape != picture.shape[:2]:
        raise ValueError(f"labels: expected shape {picture.shape[:2]} like the picture, got {values.shape}")
    couplings, _ = picture_couplings(picture, parameters=parameters, depth_m=_as_depth(depth_m, picture))
    return -float(_potts_kernels.bond_sum(couplings, values)) / _potts_kernels.UNIT


def picture_couplings(
    image: NDArray[np.uint8],
    *,
    parameters: PottsParameters,
    depth_m: NDArray[np.float32] | None = None,
    scale: float | None = None,
) -> tuple[Couplings, float]:
    """Couplings of all pairs of neighbours, in the kernels' arrangement and whole numbers.

    Parameters
    ----------
    image : (height, width, 3) uint8
        RGB.
    parameters : PottsParameters
    depth_m : (height, width) float32, optional
    scale : float, optional
        Δ; of this picture if left out, which takes another pass over it.

    Returns
    -------
    couplings : (4, 4, ⌈height / 2⌉ + 2, ⌈width / 2⌉ + 2) int8
        See :mod:`sec_lab.segmentation._potts_kernels`.
    scale : float
        Δ of this picture, in units of colour.
    """
    height, width = image.shape[:2]
    couplings = np.zeros((4, 4, (height + 1) // 2 + 2, (width + 1) // 2 + 2), np.int8)
    channels = colour_channels(image, parameters=parameters)
    own = channel_couplings(couplings, channels, parameters=parameters, depth_m=depth_m, scale=scale)
    return couplings, own


def channel_couplings(
    couplings: Couplings,
    channels: Channels,
    *,
    parameters: PottsParameters,
    depth_m: NDArray[np.float32] | None = None,
    scale: float | None = None,
) -> float:
    """Fill in the couplings of a picture of which the channels are there already; see :func:`picture_couplings`.

    Returns
    -------
    float
        Δ of this picture, in units of colour.
    """
    from sec_lab.segmentation import _potts_kernels

    height, width = channels.shape[1:]
    n_bonds = height * (width - 1) + width * (height - 1) + 2 * (height - 1) * (width - 1)

    def scale_of(sixteenths: int) -> float:
        return float(max(parameters.alpha * sixteenths / 16 / max(n_bonds, 1), _MIN_SCALE))

    if scale is None:
        scale = scale_of(_potts_kernels.difference_sum(channels))
    total = _potts_kernels.fill_couplings(couplings, channels, scale)
    if depth_m is not None:
        # Departure: a bond that is cut repels, or the pixels of a border where depth is unsure outvoted the others.
        _potts_kernels.cut_bonds(couplings, depth_m, parameters.depth_jump_m)
    return scale_of(total)


def colour_channels(image: NDArray[np.uint8], *, parameters: PottsParameters) -> Channels:
    """Blurred picture in the parameters' colour space, one channel after the other.

    Parameters
    ----------
    image : (height, width, 3) uint8
        RGB.
    parameters : PottsParameters

    Returns
    -------
    (3, height, width) uint8

    Examples
    --------
    >>> red = np.full((1, 1, 3), (255, 0, 0), dtype=np.uint8)
    >>> colour_channels(red, parameters=PottsParameters(colour_space="lab")).ravel()
    array([ 91, 208, 195], dtype=uint8)
    """
    import cv2

    values: NDArray[np.uint8] = image
    lab = parameters.colour_space == "lab"
    if lab:
        values = np.asarray(cv2.cvtColor(values, cv2.COLOR_RGB2LAB), np.uint8)
    if parameters.blur_sigma_px > 0:
        values = np.asarray(cv2.GaussianBlur(values, (0, 0), parameters.blur_sigma_px), np.uint8)
    channels = np.empty((3, *image.shape[:2]), np.uint8)
    for i in range(3):
        cv2.extractChannel(values, i, channels[i])
    if lab:
        cv2.convertScaleAbs(channels[0], channels[0], 2 / 3)
    return channels


def swept(
    spins: NDArray[np.int16], couplings: Couplings, temperatures: list[float], *, seed: int, lowest: int = LOWEST
) -> NDArray[np.int16]:
    """Label image after Metropolis sweeps, one for every temperature.

    Parameters
    ----------
    spins : (height, width) int16
        Labels from 0 on.
    couplings
        See :func:`picture_couplings`.
    temperatures : list of float
        In units of J.
    seed : int
    lowest : int, optional
        Couplings below count as this.

    Returns
    -------
    (height, width) int16
    """
    from sec_lab.segmentation import _potts_kernels

    planes = np.empty(couplings.shape[1:], np.int16)
    _potts_kernels.to_planes(planes, spins)
    noise = noise_table(tuple(temperatures), couplings.shape[3])
    bounds = np.full(len(noise), lowest, np.int16)
    _potts_kernels.sweep(planes, couplings, noise, bounds, np.uint64(seed))
    new = np.empty_like(spins)
    _potts_kernels.from_planes(new, planes)
    return new


def joined(
    spins: NDArray[np.int16] | NDArray[np.int32], couplings: Couplings, *, parameters: PottsParameters
) -> NDArray[np.int32]:
    """Label image after cluster moves: domains are joined while they attract each other, slight ones in any case.

    Parameters
    ----------
    spins : (height, width) int16 or int32
    couplings
        See :func:`picture_couplings`.
    parameters : PottsParameters

    Returns
    -------
    (height, width) int32
        Connected segments with labels from 1 on, the largest first, of equal ones the one that is met first.
    """
    from sec_lab.segmentation import _domain_kernels, _joining_kernels

    # Pixels of mixed colour between two domains may have the spin of one of them with hardly a bond to it.
    domains, sizes, _ = _domain_kernels.bond_domains_of(spins, couplings, _FIRM)
    borders = _domain_kernels.borders_of(domains, couplings, len(sizes))
    roots = _joining_kernels.merge_domains(*borders, sizes, parameters.minimum_size_px, parameters.minimum_thickness_px)
    totals = np.bincount(roots, weights=sizes, minlength=len(sizes))
    heads = np.flatnonzero(totals)
    label_of = np.zeros(len(sizes), np.int32)
    label_of[heads[np.argsort(-totals[heads], kind="stable")]] = np.arange(1, len(heads) + 1)
    return np.asarray(label_of[roots][domains])


@lru_cache(maxsize=64)
def noise_table(temperatures: tuple[float, ...], width: int) -> NDArray[np.int16]:
    """Energies that a change may cost at a temperature: T times draws from the exponential distribution.

    A change that costs ΔE is accepted with probability exp(−ΔE / T), that is, if T times such a draw is above ΔE.
    """
    from sec_lab.segmentation._potts_kernels import UNIT

    draws = np.random.default_rng(_NOISE_SEED).exponential(size=_NOISE_LENGTH + width)
    energies: NDArray[np.int16] = np.minimum(np.outer(temperatures, UNIT * draws), 1 << 13).astype(np.int16)
    return energies


def as_picture(image: ArrayLike) -> NDArray[np.uint8]:
    """Picture with its pixels side by side in memory, or one clear error.

    Raises
    ------
    ValueError
        If it is not of shape (height, width, 3) and type uint8.

    Examples
    --------
    >>> as_picture(np.zeros((4, 5)))
    Traceback (most recent call last):
    ...
    ValueError: image: expected 3 dimensions, got shape (4, 5)
    """
    array = as_array(image, what="image", ndim=3)
    if array.dtype != np.uint8 or array.shape[2] != 3 or not array.size:
        raise ValueError(f"image: expected shape (height, width, 3) of type uint8, got {array.shape} of {array.dtype}")
    return np.ascontiguousarray(array)


def as_seed(seed: int) -> int:
    """Seed, or one clear error.

    Raises
    ------
    ValueError
        If it is no whole number from 0 to 2⁶³ − 1.
    """
    value = int(as_integers(seed, what="seed", ndim=0))
    if value < 0:
        raise ValueError(f"seed: expected a whole number from 0 on, got {value}")
    return value


def _as_depth(depth_m: ArrayLike | None, image: ArrayLike) -> NDArray[np.float32] | None:
    if depth_m is None:
        return None
    depth = as_array(depth_m, what="depth", ndim=2)
    size = np.shape(image)[:2]
    if depth.shape != size:
        raise ValueError(f"depth: expected {size[0]}×{size[1]} like the picture, got {depth.shape[0]}×{depth.shape[1]}")
    if depth.dtype.kind not in "fiu" or not (np.isfinite(depth) & (depth >= 0)).all():
        raise ValueError("depth: expected finite metres from 0 on (0 where nothing was measured)")
    return np.ascontiguousarray(depth, np.float32)
