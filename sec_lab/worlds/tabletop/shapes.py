"""Surfaces: a textured triangle mesh, and the few ways in which all meshes here are made."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Texture = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Shape:
    """A textured surface in the frame of its body.

    Parameters
    ----------
    vertices_m : (n, 3) float64
    faces : (m, 3) int64
        Anticlockwise as seen from outside.
    uv : (n, 2) float64
        Place in the texture, (0, 0) at its lower left.
    texture : (height, width, 3) uint8
        RGB.
    roughness : float
        0 mirror, 1 matt.

    Raises
    ------
    ValueError
        If the shapes of the arrays disagree.
    """

    vertices_m: Floats
    faces: NDArray[np.int64]
    uv: Floats
    texture: Texture
    roughness: float = 0.6

    def __post_init__(self) -> None:
        arrays: dict[str, NDArray[Any]] = {
            "vertices_m": np.array(self.vertices_m, dtype=np.float64),
            "faces": np.array(self.faces, dtype=np.int64),
            "uv": np.array(self.uv, dtype=np.float64),
            "texture": np.array(self.texture, dtype=np.uint8),
        }
        n = len(arrays["vertices_m"])
        for name, expected in (("vertices_m", (n, 3)), ("faces", (len(arrays["faces"]), 3)), ("uv", (n, 2))):
            if arrays[name].shape != expected:
                raise ValueError(f"{name}: expected shape {expected}, got {arrays[name].shape}")
        if arrays["texture"].ndim != 3 or arrays["texture"].shape[2] != 3:
            raise ValueError(f"texture: expected shape (height, width, 3), got {arrays['texture'].shape}")
        for name, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)


def vertex_normals(shape: Shape) -> Floats:
    """Unit normals, smooth also where the texture has a seam (vertices at one place share theirs).

    Returns
    -------
    (n, 3) float64
    """
    corners = shape.vertices_m[shape.faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    _, place = np.unique(np.round(shape.vertices_m, 6), axis=0, return_inverse=True)
    place = place.ravel()
    summed = np.zeros((place.max() + 1, 3))
    for corner in range(3):
        np.add.at(summed, place[shape.faces[:, corner]], face_normals)
    normals = summed[place]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))


def lathe(
    profile_m: Sequence[tuple[float, float]] | Floats,
    texture: Texture,
    *,
    n_sections: int = 64,
    outline: Callable[[Floats], Floats] | None = None,
    planar: bool = False,
    roughness: float = 0.6,
) -> Shape:
    """Surface of revolution about z, or of another outline than the circle.

    Parameters
    ----------
    profile_m : (n, 2) array_like
        (radius, height) from the bottom along the outside upwards.
    texture : (height, width, 3) uint8
        Its columns go round; its rows follow the profile, the first point at the lower border.
    n_sections : int, optional
    outline : callable, optional
        Factor of the radius at every angle in radians.
    planar : bool, optional
        Lay the texture on from above instead.
    roughness : float, optional

    Examples
    --------
    >>> disc = lathe([(0.0, 0.0), (0.1, 0.0), (0.1, 0.01), (0.0, 0.01)], np.zeros((2, 2, 3), np.uint8))
    >>> disc.vertices_m.max(axis=0)
    array([0.1 , 0.1 , 0.01])
    """
    profile = np.asarray(profile_m, dtype=np.float64)
    angles = np.linspace(0, 2 * np.pi, n_sections + 1)
    factor = np.ones_like(angles) if outline is None else outline(angles)
    factor[-1] = factor[0]
    cosine, sine = np.cos(angles), np.sin(angles)
    cosine[-1], sine[-1] = cosine[0], sine[0]
    radius = profile[:, :1] * factor
    height = np.broadcast_to(profile[:, 1:], radius.shape)
    vertices = np.stack([radius * cosine, radius * sine, height], axis=-1)
    if planar:
        reach = np.abs(vertices[..., :2]).max()
        uv = vertices[..., :2] / (2 * reach) + 0.5
    else:
        step = np.linalg.norm(np.diff(profile, axis=0), axis=1)
        along = np.minimum(np.concatenate([[0.0], np.cumsum(step)]) / step.sum(), 1.0)
        uv = np.stack(np.broadcast_arrays(angles / (2 * np.pi), along[:, None]), axis=-1)
    return Shape(
        vertices.reshape(-1, 3), _grid_faces(len(profile), n_sections + 1), uv.reshape(-1, 2), texture, roughness
    )


def tube(path_m: Floats, radius_m: float | Floats, texture: Texture, *, roughness: float = 0.6) -> Shape:
    """Round tube along a path in space.

    Parameters
    ----------
    path_m : (n, 3) float64
    radius_m : float or (n,) float64
    texture : (height, width, 3) uint8
        Only its middle is used.
    """
    path = np.asarray(path_m, dtype=np.float64)
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.cross(tangent, np.eye(3)[np.abs(tangent.mean(axis=0)).argmin()])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    third = np.cross(tangent, across)
    angles = np.linspace(0, 2 * np.pi, 17)
    ring = np.cos(angles)[:, None, None] * across + np.sin(angles)[:, None, None] * third
    radius = np.broadcast_to(np.asarray(radius_m, dtype=np.float64), (len(path),))
    vertices = path + radius[:, None] * ring
    faces = _grid_faces(17, len(path))[:, ::-1]
    return Shape(vertices.reshape(-1, 3), faces, np.full((17 * len(path), 2), 0.5), texture, roughness)


def rounded_box(size_m: Sequence[float], radius_m: float, texture: Texture, *, roughness: float = 0.6) -> Shape:
    """Box standing on z = 0, centred in x and y, with round edges; every face carries the whole texture."""
    half = np.asarray(size_m, dtype=np.float64) / 2
    parts: list[Floats] = []
    uvs: list[Floats] = []
    faces: list[NDArray[np.int64]] = []
    n = 13
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            # Half of the lines lie in the rounding, where the surface bends.
            line = [_edge_line(half[k], radius_m, n) for k in (u, v)]
            grid = np.zeros((n, n, 3))
            grid[..., axis] = sign * half[axis]
            grid[..., u], grid[..., v] = np.meshgrid(*line, indexing="ij")
            core = np.clip(grid, -(half - radius_m), half - radius_m)
            away = grid - core
            rounded = core + radius_m * away / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-12)
            quads = _grid_faces(n, n)
            faces.append((quads[:, ::-1] if sign > 0 else quads) + n * n * len(parts))
            # The texture stands upright on the sides: its rows follow z there, y above and below.
            first, second = (u, v) if axis != 1 else (v, u)
            place = np.stack([grid[..., first] / half[first], grid[..., second] / half[second]], axis=-1) / 2 + 0.5
            parts.append(rounded.reshape(-1, 3))
            uvs.append(place.reshape(-1, 2))
    vertices = np.concatenate(parts) + np.array([0, 0, half[2]])
    return Shape(vertices, np.concatenate(faces), np.concatenate(uvs), texture, roughness)


def moved(shape: Shape, pose: Floats) -> Shape:
    """The shape at a pose ((4, 4) float64) of its frame; a reflection turns the faces over."""
    vertices = shape.vertices_m @ pose[:3, :3].T + pose[:3, 3]
    faces = shape.faces[:, ::-1] if np.linalg.det(pose[:3, :3]) < 0 else shape.faces
    return Shape(vertices, faces, shape.uv, shape.texture, shape.roughness)


def joined(first: Shape, *others: Shape) -> Shape:
    """One shape of several, with the texture and roughness of the first."""
    vertices, faces, uvs, n = [], [], [], 0
    for part in (first, *others):
        vertices.append(part.vertices_m)
        faces.append(part.faces + n)
        uvs.append(part.uv)
        n += len(part.vertices_m)
    return Shape(np.concatenate(vertices), np.concatenate(faces), np.concatenate(uvs), first.texture, first.roughness)


def _edge_line(half: float, radius: float, n: int) -> Floats:
    right = half - radius * np.linspace(1, 0, n // 2) ** 1.5
    return np.concatenate([-right[::-1], [0.0], right])


def _grid_faces(n_rows: int, n_columns: int) -> NDArray[np.int64]:
    index = np.arange(n_rows * n_columns).reshape(n_rows, n_columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    return np.concatenate(
        [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)]
    ).astype(np.int64)
