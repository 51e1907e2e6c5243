"""Things on the table: fruit, plates, cups, slices of food, boxes and the parts of a book, each standing on z = 0."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from sec_lab.worlds.tabletop import textures
from sec_lab.worlds.tabletop.plan import pose
from sec_lab.worlds.tabletop.shapes import Floats, Shape, Texture, joined, lathe, moved, rounded_box, tube
from sec_lab.worlds.tabletop.textures import Colour

PLATE_FLOOR_M = 0.0065
"""Height of the flat middle of a plate."""


def orange(radius_m: float, colour: Colour, rng: np.random.Generator) -> Shape:
    """Orange: a slightly flattened ball."""
    return _ball(radius_m, textures.orange_peel(colour, rng), squash=0.94, hollow=0.0)


def apple(radius_m: float, colour: Colour, second: Colour, rng: np.random.Generator) -> Shape:
    """Apple, with a hollow and a stalk on top."""
    ball = _ball(radius_m, textures.apple_peel(colour, second, rng), squash=0.90, hollow=0.22)
    top = 2 * 0.90 * radius_m
    path = np.array([(0.0, 0.0, 0.86 * top), (0.0005, 0.0, 0.95 * top), (0.003, 0.001, 1.06 * top)])
    stalk = tube(path, 0.0016, ball.texture)
    return joined(ball, Shape(stalk.vertices_m, stalk.faces, stalk.uv * (1, 0) + (0, 0.995), ball.texture))


def plate(radius_m: float, height_m: float, colour: Colour, stripe: Colour, rng: np.random.Generator) -> Shape:
    """Plate with a flat middle, a rising rim and a painted stripe."""
    r, h, thick = radius_m, height_m, PLATE_FLOOR_M
    profile = [
        (0.0, 0.0),
        (0.55 * r, 0.0),
        (0.62 * r, 0.12 * h),
        (0.97 * r, h - thick),
        (r, h - 0.4 * thick),
        (0.995 * r, h),
        (0.96 * r, h),
        (0.66 * r, 0.3 * h + thick),
        (0.58 * r, 0.12 * h + thick),
        (0.5 * r, thick),
        (0.0, thick),
    ]
    texture = textures.glaze(colour, stripe, rng, rows=(0.50, 0.555))
    return lathe(_rounded(profile), texture, n_sections=96, roughness=0.36)


def cup(
    radius_m: float,
    height_m: float,
    colour: Colour,
    stripe: Colour,
    rng: np.random.Generator,
    *,
    taper: float = 0.85,
    handle: bool = True,
    wall_m: float = 0.0035,
) -> Shape:
    """Cup, open at the top; its handle, if it has one, points along x."""
    r, h = radius_m, height_m
    profile = [
        (0.0, 0.0),
        (taper * r - 0.003, 0.0),
        (taper * r, 0.003),
        (0.5 * (1 + taper) * r, 0.5 * h),
        (r, h - 0.001),
        (r - wall_m / 2, h),
        (r - wall_m, h - 0.001),
        (0.5 * (1 + taper) * r - wall_m, 0.5 * h),
        (taper * r - wall_m, wall_m + 0.003),
        (taper * r - wall_m - 0.003, wall_m),
        (0.0, wall_m),
    ]
    texture = textures.glaze(colour, stripe, rng, rows=(0.30, 0.40))
    body = lathe(_rounded(profile), texture, n_sections=72, roughness=0.32)
    if not handle:
        return body
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 15)
    out = 0.5 * (1 + taper) * r - 0.001
    path = np.stack([out + 0.30 * h * np.cos(angle), 0 * angle, 0.5 * h + 0.30 * h * np.sin(angle)], axis=-1)
    ring = tube(path, 0.0048, texture)
    # The handle takes the ground colour of the glaze.
    return joined(body, Shape(ring.vertices_m, ring.faces, ring.uv * (1, 0) + (0, 0.2), texture))


def liquid(radius_m: float, colour: Colour, rng: np.random.Generator) -> Shape:
    """Surface of a liquid, z = 0 being its level."""
    profile = [(0.0, -0.002), (radius_m, -0.002), (radius_m, 0.0), (0.0, 0.0)]
    return lathe(profile, textures.plain(colour, rng, mottle=0.015), n_sections=48, roughness=0.25)


def liquid_in(
    cup_m: tuple[float, float],
    level_m: float,
    tilt: float,
    colour: Colour,
    rng: np.random.Generator,
    *,
    towards: float = 0.0,
    taper: float = 0.85,
    wall_m: float = 0.0035,
) -> Shape:
    """Surface of the liquid in a tilted :func:`cup`, in the frame of the cup.

    Parameters
    ----------
    cup_m : tuple of float
        Radius and height of the cup.
    level_m : float
        Height of the surface in the upright cup.
    tilt : float
        Angle in radians, below a right angle, of the surface to the rim. Where the surface would stand higher than the
        lip, it ends at the lip instead: the cup holds less.
    colour : Colour
    rng : numpy.random.Generator
    towards : float, optional
        Direction of the lip in the frame of the cup, an angle in radians about z.
    taper, wall_m : float, optional
        As those of the cup.

    Examples
    --------
    >>> surface = liquid_in((0.04, 0.1), 0.06, 0.3, (200, 100, 50), np.random.default_rng(0))
    >>> bool(surface.vertices_m[:, 2].min() < 0.055), bool(surface.vertices_m[:, 2].max() > 0.065)
    (True, True)
    """
    (outside, height), slope = cup_m, np.tan(tilt)
    lowest, highest = wall_m + 0.001, height - 0.002
    # Fingers round the cup do not touch what is in it, though surfaces that near would count as touching: so it keeps
    # off the wall a little, and more deep in the cup, where nobody looks and fingers press most.
    widening = (1 - taper) * outside / height
    base = taper * outside - wall_m - 0.0008
    middle = min(level_m, highest - slope * (base + widening * highest))
    angle = np.linspace(-np.pi, np.pi, 72, endpoint=False)
    z = (middle + slope * base * np.cos(angle)) / (1 - slope * widening * np.cos(angle))
    z = np.clip(z, lowest, highest)
    radius = base + widening * z - 0.011 * np.clip((0.75 * height - z) / (0.35 * height), 0, 1)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    # Where it would be below the bottom, the surface ends in a straight line.
    dry = z <= lowest
    if dry.any() and slope > 0:
        edge = min((lowest - middle) / slope, radius[dry][0])
        reach = np.sqrt(max(radius[dry][0] ** 2 - edge**2, 0))
        x[dry], y[dry] = edge, np.clip(y[dry], -reach, reach)
        x = np.maximum(x, edge)
    ring = np.stack([x, y, middle + slope * x], axis=-1)
    top = np.concatenate([ring.mean(axis=0)[None], ring])
    following = 1 + (np.arange(len(ring)) + 1) % len(ring)
    faces = np.stack([np.zeros(len(ring), dtype=np.int64), np.arange(1, len(ring) + 1), following], axis=-1)
    uv = 0.5 + 0.5 * top[:, :2] / outside
    surface = Shape(top, faces, uv, textures.plain(colour, rng, mottle=0.015), roughness=0.25)
    return moved(surface, pose((0, 0, 0), yaw=towards))


def jet(path_m: Floats, radius_m: float, colour: Colour, rng: np.random.Generator) -> Shape:
    """Falling liquid along a path."""
    n = len(path_m)
    wobble = 1 + 0.15 * np.sin(np.arange(n) * 1.1 + rng.uniform(0, 6))
    thinning = np.linspace(1.25, 0.75, n)
    return tube(path_m, radius_m * wobble * thinning, textures.plain(colour, rng, mottle=0.03), roughness=0.25)


def bread(radius_m: float, thick_m: float, inside: Colour, crust: Colour, rng: np.random.Generator) -> Shape:
    """Slice of bread, lying."""

    def outline(angle: Floats) -> Floats:
        loaf = _superellipse(angle, 4.0)
        return np.asarray(loaf * (1 + 0.05 * np.cos(2 * angle) + 0.04 * np.sin(3 * angle + 0.4)))

    texture = textures.slice_of(inside, crust, outline, rng, grain=0.07, rim_share=0.94)
    return _slab(radius_m, thick_m, texture, outline=outline)


def salami(radius_m: float, thick_m: float, meat: Colour, rim: Colour, fat: Colour, rng: np.random.Generator) -> Shape:
    """A few slices of salami, lying on each other."""

    def outline(angle: Floats) -> Floats:
        return np.asarray(1 + 0.015 * np.cos(3 * angle + 1))

    texture = textures.slice_of(meat, rim, outline, rng, spots=fat, grain=0.07, rim_share=0.95)
    return _slab(radius_m, thick_m, texture, outline=outline, roughness=0.45)


def cheese(radius_m: float, thick_m: float, colour: Colour, rng: np.random.Generator, *, corners: float = 8.0) -> Shape:
    """Slice of cheese, lying; ``corners`` 2 makes it round, 8 square."""

    def outline(angle: Floats) -> Floats:
        return _superellipse(angle, corners)

    darker = (colour[0] * 0.93, colour[1] * 0.88, colour[2] * 0.75)
    texture = textures.slice_of(colour, darker, outline, rng, grain=0.025, rim_share=0.97)
    return _slab(radius_m, thick_m, texture, outline=outline, roughness=0.5)


def box(size_m: tuple[float, float, float], colour: Colour, ink: Colour, rng: np.random.Generator) -> Shape:
    """Printed cardboard box."""
    return rounded_box(size_m, 0.003, textures.printed(colour, ink, rng), roughness=0.55)


def bottle(radius_m: float, height_m: float, colour: Colour, stripe: Colour, rng: np.random.Generator) -> Shape:
    """Closed bottle or jar with a neck."""
    r, h = radius_m, height_m
    profile = [(0.0, 0.0), (r - 0.003, 0.0), (r, 0.004), (r, 0.6 * h), (0.85 * r, 0.7 * h), (0.42 * r, 0.8 * h)]
    profile += [(0.40 * r, 0.95 * h), (0.44 * r, 0.96 * h), (0.44 * r, h - 0.002), (0.4 * r, h), (0.0, h)]
    texture = textures.glaze(colour, stripe, rng, rows=(0.33, 0.52))
    return lathe(_rounded(profile), texture, n_sections=64, roughness=0.3)


def book_block(width_m: float, length_m: float, thick_m: float, rng: np.random.Generator) -> Shape:
    """Pages of a book: from the spine (x = 0) to x = width, centred in y."""
    block = rounded_box((width_m, length_m, thick_m), 0.002, textures.page(rng), roughness=0.85)
    return moved(block, pose((width_m / 2, 0, 0)))


def book_cover(
    width_m: float, length_m: float, colour: Colour, ink: Colour, rng: np.random.Generator, *, thick_m: float = 0.004
) -> Shape:
    """Board of a book cover: from the spine (x = 0) to x = width, centred in y."""
    board = rounded_box((width_m, length_m, thick_m), 0.0018, textures.printed(colour, ink, rng), roughness=0.6)
    return moved(board, pose((width_m / 2, 0, 0)))


def _ball(radius: float, texture: Texture, *, squash: float, hollow: float) -> Shape:
    polar = np.linspace(-np.pi / 2, np.pi / 2, 33)
    flat = radius * squash
    height = flat + flat * np.sin(polar) - hollow * radius * np.exp(-(((polar - np.pi / 2) / 0.35) ** 2))
    return lathe(np.stack([radius * np.cos(polar), height], axis=-1), texture, n_sections=48, roughness=0.5)


def _slab(
    radius: float,
    thick: float,
    texture: Texture,
    *,
    outline: Callable[[Floats], Floats],
    roughness: float = 0.8,
) -> Shape:
    edge = min(0.003, thick / 3)
    bend = np.linspace(0, np.pi / 2, 4)
    lower = [(radius - edge + edge * np.sin(a), edge - edge * np.cos(a)) for a in bend]
    upper = [(radius - edge + edge * np.cos(a), thick - edge + edge * np.sin(a)) for a in bend]
    profile = [(0.0, 0.0), (0.6 * radius, 0.0), *lower, *upper, (0.6 * radius, thick), (0.0, thick)]
    return lathe(profile, texture, n_sections=96, outline=outline, planar=True, roughness=roughness)


def _superellipse(angle: Floats, power: float) -> Floats:
    return np.asarray((np.abs(np.cos(angle)) ** power + np.abs(np.sin(angle)) ** power) ** (-1 / power))


def _rounded(profile: list[tuple[float, float]]) -> Floats:
    """The profile with points between, so that light bends over its edges and contacts are found along it."""
    points = np.asarray(profile)
    dense = [points[:1]]
    for start, end in pairwise(points):
        n = max(1, int(np.ceil(np.hypot(*(end - start)) / 0.006)))
        dense.append(start + (end - start) * (np.arange(1, n + 1) / n)[:, None])
    return np.concatenate(dense)
