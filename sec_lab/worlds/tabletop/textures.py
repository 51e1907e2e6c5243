"""Textures: cloth, wood, skin, fruit, food, glazed and printed surfaces, all from seeded noise."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from sec_lab.worlds.tabletop.shapes import Floats, Texture

Colour = tuple[float, float, float]
"""RGB between 0 and 255."""


def noise(size: tuple[int, int], cell_px: tuple[float, float], rng: np.random.Generator, *, octaves: int = 3) -> Floats:
    """Smooth random field of mean 0 and standard deviation 1.

    Parameters
    ----------
    size : (height, width)
    cell_px : (float, float)
        Size of the coarsest features in rows and columns.
    rng : numpy.random.Generator
    octaves : int, optional
        Each has features half as large and half as strong as the one before.

    Returns
    -------
    (height, width) float64
    """
    total = np.zeros(size)
    for octave in range(octaves):
        coarse = tuple(max(2, int(np.ceil(n * 2**octave / cell)) + 1) for n, cell in zip(size, cell_px, strict=True))
        grid = Image.fromarray(rng.standard_normal(coarse).astype(np.float32))
        total += np.asarray(grid.resize(size[::-1], Image.Resampling.BICUBIC), dtype=np.float64) / 2**octave
    spread = total.std()
    return np.asarray((total - total.mean()) / (spread if spread > 0 else 1))


def plain(colour: Colour, rng: np.random.Generator, *, size: int = 256, mottle: float = 0.02) -> Texture:
    """One colour, slightly uneven, as paint, glaze or plastic is."""
    return _coloured(colour, 1 + mottle * noise((size, size), (size / 5, size / 5), rng))


def cloth(colour: Colour, rng: np.random.Generator, *, size: int = 1536, contrast: float = 1.0) -> Texture:
    """Matt woven cloth: threads, uneven dye, soft folds."""
    rows, columns = np.ogrid[:size, :size]
    weave = np.sin(rows * 2 * np.pi / 5.0) * np.sin(columns * 2 * np.pi / 5.0)
    shade = 0.025 * weave + 0.03 * noise((size, size), (6, 6), rng, octaves=2)
    shade += 0.02 * noise((size, size), (3, 90), rng, octaves=1) + 0.02 * noise((size, size), (90, 3), rng, octaves=1)
    shade += 0.025 * noise((size, size), (size / 8, size / 8), rng)
    return _coloured(colour, 1 + contrast * shade)


def wood(light: Colour, dark: Colour, rng: np.random.Generator, *, size: int = 1536, n_planks: int = 14) -> Texture:
    """Planks whose grain runs along the columns of the texture."""
    warp = noise((size, size), (size / 3, size / 14), rng, octaves=3)
    columns = np.arange(size)[None, :]
    plank = (columns * n_planks // size).ravel()
    shift = rng.uniform(0, 40, n_planks)[plank]
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (columns / (size / 90) + shift + 1.6 * warp))
    fibre = noise((size, size), (size / 6, 2.5), rng, octaves=2)
    pores = np.clip(noise((size, size), (size / 30, 1.6), rng, octaves=1) - 1.4, 0, 2)
    share = np.clip(0.12 + 0.5 * rings**2 + 0.10 * fibre + 0.28 * pores, 0, 1)[..., None]
    tone = (1 + 0.07 * rng.standard_normal(n_planks))[plank][None, :, None]
    edge = np.abs((columns * n_planks / size) % 1 - 0.5) > 0.5 - 0.0011 * n_planks
    picture = (np.asarray(light) * (1 - share) + np.asarray(dark) * share) * tone
    return _bytes(picture * np.where(edge, 0.55, 1.0)[..., None])


def orange_peel(colour: Colour, rng: np.random.Generator, *, size: int = 256) -> Texture:
    """Peel with pores, and a green scar at the upper pole."""
    pores = np.clip(noise((size, 2 * size), (4, 4), rng, octaves=1), -2, 2)
    picture = _coloured(colour, 1 + 0.035 * pores + 0.03 * noise((size, 2 * size), (60, 60), rng)).astype(np.float64)
    picture[: size // 24] = (110, 120, 50)
    return _bytes(picture)


def apple_peel(colour: Colour, second: Colour, rng: np.random.Generator, *, size: int = 256) -> Texture:
    """Streaked peel whose second colour shows near the poles, with a brown hollow on top."""
    streaks = noise((size, 2 * size), (size, 7), rng, octaves=2) + 0.7 * noise(
        (size, 2 * size), (size / 3, size / 2), rng
    )
    pole = np.abs(np.linspace(-1, 1, size))[:, None] ** 3
    share = np.clip(0.12 + 0.25 * streaks * 0.5 + 0.75 * pole, 0, 1)[..., None]
    picture = np.asarray(colour) * (1 - share) + np.asarray(second) * share
    picture[: size // 18] = (80, 60, 30)
    return _bytes(picture)


def glaze(
    colour: Colour, stripe: Colour, rng: np.random.Generator, *, rows: tuple[float, float], size: int = 256
) -> Texture:
    """Glaze of one colour with a painted stripe between two shares of the profile (0 bottom, 1 end)."""
    picture = plain(colour, rng, size=size, mottle=0.012).astype(np.float64)
    first, last = (size - round(share * size) for share in rows)
    picture[last:first] = picture[last:first] / np.asarray(colour) * np.asarray(stripe)
    return _bytes(picture)


def slice_of(
    inside: Colour,
    rim: Colour,
    outline: Callable[[Floats], Floats],
    rng: np.random.Generator,
    *,
    rim_share: float = 0.93,
    spots: Colour | None = None,
    grain: float = 0.05,
    size: int = 256,
) -> Texture:
    """Slice of bread, salami or cheese seen from above: inside, rim and spots.

    Parameters
    ----------
    inside, rim, spots : Colour
    outline : callable
        Factor of the radius at every angle.
    rng : numpy.random.Generator
    rim_share : float, optional
        Share of the radius where the rim begins.
    grain : float, optional
        Strength of the mottling.
    """
    axis = np.linspace(-1, 1, size)
    x, y = np.meshgrid(axis, -axis)
    angle = np.arctan2(y, x) % (2 * np.pi)
    ring = np.linspace(0, 2 * np.pi, 721)
    reach = max(np.abs(outline(ring) * np.cos(ring)).max(), np.abs(outline(ring) * np.sin(ring)).max())
    share = np.hypot(x, y) * reach / outline(angle)
    mottled = 1 + grain * noise((size, size), (9, 9), rng, octaves=2)
    picture = np.asarray(inside) * mottled[..., None]
    if spots is not None:
        blobs = noise((size, size), (17, 17), rng, octaves=2) > 1.0
        picture[blobs] = np.asarray(spots) * mottled[blobs][:, None]
    blend = np.clip((share - rim_share) / 0.03, 0, 1)[..., None]
    return _bytes(picture * (1 - blend) + np.asarray(rim) * mottled[..., None] * blend)


def printed(colour: Colour, ink: Colour, rng: np.random.Generator, *, size: int = 256) -> Texture:
    """Printed cover: a ground, a band and two lines of lettering."""
    picture = plain(colour, rng, size=size, mottle=0.015).astype(np.float64)
    picture[size // 10 : size // 10 + size // 24, size // 10 : -size // 10] = ink
    for row, height in ((0.28, 0.07), (0.40, 0.05)):
        top, bottom = int(row * size), int((row + height) * size)
        left = int(size * 0.22)
        while left < size * 0.76:
            width = int(rng.integers(size // 40, size // 14))
            picture[top:bottom, left : left + width] = ink
            left += width + size // 50
    return _bytes(picture)


def page(rng: np.random.Generator, *, size: int = 256, paper: Colour = (236, 232, 220)) -> Texture:
    """Page of a book with grey lines of text."""
    picture = plain(paper, rng, size=size, mottle=0.008).astype(np.float64)
    line = size // 22
    for number, top in enumerate(range(size // 8, size - size // 8, line)):
        end = size - size // 8 - (int(rng.integers(0, size // 3)) if number % 6 == 5 else 0)
        words = 1 - 0.22 * (noise((line // 2, end - size // 8), (line, 5), rng, octaves=1) > -0.4)
        picture[top : top + line // 2, size // 8 : end] *= words[..., None]
    return _bytes(picture)


def skin_palette(colour: Colour, *, size: int = 64) -> Texture:
    """Skin tones: from pale to red along the columns, from dark to light along the rows upwards."""
    red = np.linspace(0, 1, size)[None, :, None]
    light = np.linspace(1.25, 0.65, size)[:, None, None]
    tone = np.asarray(colour) * (1 - red) + np.asarray(colour) * (1.03, 0.78, 0.74) * red
    return _bytes(tone * light)


def _coloured(colour: Colour, shade: ArrayLike) -> Texture:
    return _bytes(np.asarray(colour) * np.asarray(shade)[..., None])


def _bytes(picture: NDArray[np.float64]) -> Texture:
    return np.clip(np.round(picture), 0, 255).astype(np.uint8)
