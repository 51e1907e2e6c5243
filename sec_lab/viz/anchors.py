"""Anchor points of a manipulation drawn over pictures of it (Fig. 2.18, 2.19), projected as the camera sees them."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from numpy.typing import ArrayLike, NDArray

from sec_lab.viz.scene import draw_segments
from sec_lab.viz.style import INK, PAGE_WIDTH_IN, PAPER, SMALL_PT, SOFT, TEXT_PT, axes_at, bare, new_figure, tidy
from sec_lab.worlds.katana import Camera, Move, View, project

if TYPE_CHECKING:
    from sec_lab.execution.anchors import Intersections, PrimeMover
    from sec_lab.execution.recorded_anchors import RecordedAnchors

POINT_COLOUR: Mapping[str, str] = {
    "S1": "#d62718",
    "E1": "#2f9e44",
    "S2": "#e377c2",
    "E2": "#2459ad",
    "E3": "#22262c",
}
"""As in Fig. 2.18."""

NAMES = tuple(POINT_COLOUR)

_TOLD = {
    "S1": "S₁ where the arm is first seen (D2)",
    "E1": "E₁ where it touches the first object (D3)",
    "S2": "S₂ where the objects touch, on the first (D6)",
    "E2": "E₂ the same on the second (D6)",
    "E3": "E₃ where the arm ends (D8)",
}
_GAP_IN, _TITLE_IN, _LEGEND_IN = 0.12, 0.26, 0.62
_MARGIN_PX, _BELOW_PX = 84, 16
"""Above and beside a picture, and below it: hands come from and go to places that the camera does not see."""
_CHANGED = "#e2553f"
_WAYS = {"V1": "#d62718", "V2": "#8a5fbf", "V3": "#22262c"}
_HALO = [withStroke(linewidth=2.2, foreground=PAPER)]


def draw_prime_mover(
    before: ArrayLike, after: ArrayLike, found: "PrimeMover", *, key_frames: tuple[int, int] | None = None
) -> Figure:
    """Draw the subtraction that finds the prime mover (D1): segments at two key frames, and where they differ.

    Parameters
    ----------
    before, after : (height, width) array_like of int
        Label images at the key frames of N and of T.
    found : PrimeMover
    key_frames : tuple of int, optional
        Their numbers.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If the images differ in shape.

    Examples
    --------
    >>> from sec_lab.execution.anchors import PrimeMover
    >>> figure = draw_prime_mover([[1, 1]], [[1, 2]], PrimeMover("robot arm", {"robot arm": 1}))
    >>> figure.axes[2].get_title(loc="left")
    'difference: robot arm 1 px'
    """
    one, other = np.asarray(before), np.asarray(after)
    if one.shape != other.shape:
        raise ValueError(f"after: expected shape {one.shape} as before, got {other.shape}")
    said = f"{found.name} {found.changed_px[found.name]} px"
    first, second = ("", "") if key_frames is None else (f", frame {frame}" for frame in key_frames)
    axes, figure = _row_of_pictures(3, one.shape)
    draw_segments(one, ax=axes[0], legend=False)
    draw_segments(other, ax=axes[1], legend=False)
    pale = np.full((*one.shape, 3), 238, dtype=np.uint8)
    pale[one != other] = (np.array([0xE2, 0x55, 0x3F])).astype(np.uint8)
    draw_segments(pale, ax=axes[2], legend=False)
    for ax, title in zip(axes, (f"N{first}", f"T{second}", f"difference: {said}"), strict=True):
        ax.set_title(title, loc="left", fontsize=TEXT_PT, color=INK, pad=4)
    return figure


def draw_anchor_spread(
    image: ArrayLike, camera: Camera, anchors: "Mapping[str, RecordedAnchors]", *, shown: str
) -> Figure:
    """Draw start and end points of all demonstrations over the start of one of them (Fig. 2.18), and seen from above.

    Points of the others are placed relative to the centre of the first object and the connection vector of the one that
    is shown; stars are averages.

    Parameters
    ----------
    image : (height, width, 3) array_like of uint8
        First frame of the demonstration that is shown.
    camera : Camera
        Of that demonstration.
    anchors : mapping of str to RecordedAnchors
    shown : str
        Which one is shown.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If the demonstration has no anchor points, or the picture is not the camera's.
    """
    if shown not in anchors:
        raise ValueError(f"shown: expected one of {list(anchors)}, got {shown!r}")
    picture = _picture_of(image, camera)
    here = anchors[shown]
    points = {name: np.array([one.relative()[name] for one in anchors.values()]) for name in NAMES}
    height, width = picture.shape[:2]
    left_in = 4.6
    high_in = left_in * (height + _MARGIN_PX + _BELOW_PX) / (width + 2 * _MARGIN_PX)
    figure = new_figure(PAGE_WIDTH_IN, _TITLE_IN + high_in + _LEGEND_IN)
    ax = axes_at(figure, left_in=0.0, top_in=_TITLE_IN, width_in=left_in, height_in=high_in)
    ax.imshow(_paler(picture), extent=(-0.5, width - 0.5, height - 0.5, -0.5))
    ax.set(xlim=(-_MARGIN_PX, width + _MARGIN_PX), ylim=(height + _BELOW_PX, -_MARGIN_PX), facecolor="#f4f5f6")
    bare(ax, title=None)
    _connect(ax, camera, here.origin_m, here.origin_m + here.connection_m)
    for name in NAMES:
        _scatter(ax, _seen(camera, here.placed(points[name])), name)
    means = {name: points[name].mean(axis=0) for name in NAMES}
    _path(ax, {name: _seen(camera, here.placed(mean)) for name, mean in means.items()})
    ax.set_title(f"over the start of {shown.replace('_', ' ')}", loc="left", fontsize=TEXT_PT, color=INK, pad=4)

    above = axes_at(
        figure, left_in=left_in + 0.72, top_in=_TITLE_IN, width_in=PAGE_WIDTH_IN - left_in - 0.8,
        height_in=high_in - 0.36,
    )  # fmt: skip
    for name in NAMES:
        _scatter(above, 1000 * points[name][:, :2], name)
    _path(above, {name: 1000 * mean[:2] for name, mean in means.items()})
    above.axhline(0, color=SOFT, linewidth=0.6, zorder=0)
    above.plot(0, 0, marker="+", color=INK, markersize=9, zorder=5)
    above.set_aspect("equal", adjustable="datalim")
    above.set_xlabel("along the connection vector, mm", fontsize=SMALL_PT, color=INK)
    above.set_ylabel("across it, mm", fontsize=SMALL_PT, color=INK, labelpad=2)
    tidy(above)
    above.set_title("from above, origin at +", loc="left", fontsize=TEXT_PT, color=INK, pad=4)
    handles = [_marker(name) for name in NAMES]
    handles.append(Line2D([], [], marker="*", linestyle="", color=SOFT, markersize=10, label="stars: averages"))
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.0, 0.0), ncols=2, frameon=False, fontsize=SMALL_PT,
        labelcolor=INK, handletextpad=0.4, columnspacing=1.6, borderaxespad=0.1,
    )  # fmt: skip
    return figure


def draw_demonstrated(
    image: ArrayLike, camera: Camera, recorded: "RecordedAnchors", *, ax: Axes | None = None, title: str | None = None
) -> Axes:
    """Draw the start and end points of one demonstration over its start (Fig. 2.19 A).

    Parameters
    ----------
    image : (height, width, 3) array_like of uint8
    camera : Camera
    recorded : RecordedAnchors
    ax : matplotlib.axes.Axes, optional
    title : str, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = _over_picture(image, camera, ax=ax, title=title)
    points = {name: getattr(recorded, f"{name}_m") for name in NAMES}
    _connect(ax, camera, recorded.origin_m, recorded.origin_m + recorded.connection_m)
    _mark_points(ax, camera, points, delta_m=recorded.delta_m)
    return ax


def draw_planned(
    sight: View,
    found: "Intersections",
    moves: Sequence[Move],
    *,
    origin_m: ArrayLike,
    connection_m: ArrayLike,
    start_m: ArrayLike,
    ax: Axes | None = None,
    title: str | None = None,
) -> Axes:
    """Draw the points calculated for a new scene, and the path of the tip, over what the camera sees (Fig. 2.19 B).

    Parameters
    ----------
    sight : View
        What the camera sees before anything moves.
    found : Intersections
        D6.
    moves : sequence of Move
        Of the plan.
    origin_m, connection_m, start_m : (3,) array_like of float
        D4, D5, and where the tip is now (S₁). Points in the plane are drawn at the height of the origin.
    ax : matplotlib.axes.Axes, optional
    title : str, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    camera = sight.camera
    ax = _over_picture(sight.image, camera, ax=ax, title=title)
    path = np.array([start_m, *(move.to_m for move in moves)], dtype=np.float64)
    pixels = _seen(camera, path)
    ax.plot(*pixels.T, color=_WAYS["V1"], linewidth=1.1, linestyle=(0, (4, 2)), zorder=3, path_effects=_HALO)
    ax.plot(*pixels.T, color=_WAYS["V1"], marker="o", markersize=2.5, linestyle="", zorder=3)
    origin = np.asarray(origin_m, dtype=np.float64)
    _connect(ax, camera, origin, origin + np.asarray(connection_m, dtype=np.float64))
    points = {name: np.array([*getattr(found, f"{name}_m"), origin[2]]) for name in ("E1", "S2", "E2")}
    points |= {"S1": np.asarray(start_m, dtype=np.float64), "E3": np.asarray(moves[-1].to_m)}
    _mark_points(ax, camera, points, delta_m=float(np.linalg.norm(found.E2_m - found.S2_m)))
    return ax


def picture_axes(n: int, camera: Camera) -> list[Axes]:
    """Axes for pictures of a camera side by side, as wide as the page, each with the margin of Fig. 2.19.

    Parameters
    ----------
    n : int
    camera : Camera
    """
    margin = _MARGIN_PX // 2
    return _row_of_pictures(n, (camera.height + margin + _BELOW_PX, camera.width + 2 * margin))[0]


def _over_picture(image: ArrayLike, camera: Camera, *, ax: Axes | None, title: str | None) -> Axes:
    picture = _picture_of(image, camera)
    height, width = picture.shape[:2]
    ax = picture_axes(1, camera)[0] if ax is None else ax
    ax.imshow(_paler(picture), extent=(-0.5, width - 0.5, height - 0.5, -0.5))
    margin = _MARGIN_PX // 2
    ax.set(xlim=(-margin, width + margin), ylim=(height + _BELOW_PX, -margin), facecolor="#f4f5f6")
    bare(ax)
    if title is not None:
        ax.set_title(title, loc="left", fontsize=TEXT_PT, color=INK, pad=4)
    return ax


def _connect(ax: Axes, camera: Camera, origin: NDArray[np.float64], end: NDArray[np.float64]) -> None:
    """The connection vector, from red to green (D5), beginning at the origin (D4)."""
    a, b = _seen(camera, np.array([origin, end]))
    steps = np.linspace(0, 1, 25)[:, None]
    line = a + (b - a) * steps
    for share, (one, other) in zip(steps[:-1, 0], pairwise(line), strict=True):
        colour = (0.84 * (1 - share) + 0.10 * share, 0.15 * (1 - share) + 0.55 * share, 0.12)
        ax.plot(*np.array([one, other]).T, color=colour, linewidth=2.4, solid_capstyle="butt", zorder=4)
    ax.annotate("", b, line[-3], arrowprops={"arrowstyle": "-|>", "color": (0.10, 0.55, 0.12), "lw": 1.6}, zorder=4)
    ax.plot(*a, marker="o", markersize=5, color=PAPER, markeredgecolor=INK, zorder=5)


def _mark_points(ax: Axes, camera: Camera, points: Mapping[str, NDArray[np.float64]], *, delta_m: float) -> None:
    beside = {"S1": (9, -4), "E1": (-4, 10), "S2": (-8, -13), "E2": (8, 12), "E3": (9, -4)}
    (left, right), (bottom, top) = sorted(ax.get_xlim()), ax.get_ylim()
    for name, point in points.items():
        x, y = _seen(camera, point[None])[0]
        outside = not (left <= x <= right and top <= y <= bottom)
        x, y = float(np.clip(x, left + 8, right - 8)), float(np.clip(y, top + 8, bottom - 8))
        ax.plot(
            x, y, marker="D" if outside else "o", markersize=6, color=POINT_COLOUR[name], markeredgecolor=PAPER,
            zorder=6, clip_on=False,
        )  # fmt: skip
        flip = name in ("S1", "E3") and x > (left + right) / 2
        dx, dy = beside[name]
        ax.annotate(
            f"{_subscript(name)}{' (outside)' if outside else ''}", (x, y), (-dx if flip else dx, dy),
            textcoords="offset points", fontsize=TEXT_PT, color=POINT_COLOUR[name], fontweight="bold", zorder=7,
            path_effects=_HALO, ha="center" if name not in ("S1", "E3") else ("right" if flip else "left"),
        )  # fmt: skip
    one, other = _seen(camera, np.array([points["S2"], points["E2"]]))
    along = (other - one) / max(float(np.linalg.norm(other - one)), 1e-9)
    # Across the vector, downwards in the picture.
    across = np.array([-along[1], along[0]]) * (1 if along[0] > 0 else -1)
    ax.annotate(
        f"Δ {1000 * delta_m:.0f} mm", tuple((one + other) / 2 + 26 * across), fontsize=TEXT_PT, color=INK, ha="center",
        va="center", zorder=7, path_effects=_HALO,
    )  # fmt: skip


def _path(ax: Axes, means: Mapping[str, NDArray[np.float64]]) -> None:
    """Averages as stars, and the motion segments between them."""
    for name, (start, end) in {"V1": ("S1", "E1"), "V2": ("S2", "E2"), "V3": ("E2", "E3")}.items():
        ax.annotate(
            "", tuple(means[end]), tuple(means[start]), zorder=4,
            arrowprops={"arrowstyle": "-|>", "color": _WAYS[name], "lw": 1.4, "shrinkA": 4, "shrinkB": 4},
        )  # fmt: skip
        middle = (means[start] + means[end]) / 2
        ax.annotate(
            _subscript(name), tuple(middle), (5, 5), textcoords="offset points", fontsize=SMALL_PT,
            color=_WAYS[name], zorder=7, path_effects=_HALO,
        )  # fmt: skip
    for name, (x, y) in means.items():
        ax.plot(x, y, marker="*", markersize=13, color=POINT_COLOUR[name], markeredgecolor=PAPER, zorder=6)


def _scatter(ax: Axes, points: NDArray[np.float64], name: str) -> None:
    ax.plot(
        *points.T, marker="o", linestyle="", markersize=4.2, color=POINT_COLOUR[name], markeredgecolor=PAPER,
        markeredgewidth=0.5, zorder=5, gid=name,
    )  # fmt: skip


def _marker(name: str) -> Line2D:
    return Line2D([], [], marker="o", linestyle="", color=POINT_COLOUR[name], markersize=6, label=_TOLD[name])


def _row_of_pictures(n: int, size_px: tuple[int, ...]) -> tuple[list[Axes], Figure]:
    wide_in = (PAGE_WIDTH_IN - _GAP_IN * (n - 1)) / n if n > 1 else 4.6
    high_in = wide_in * size_px[0] / size_px[1]
    figure = new_figure(PAGE_WIDTH_IN if n > 1 else wide_in, _TITLE_IN + high_in)
    places = [number * (wide_in + _GAP_IN) for number in range(n)]
    return [
        axes_at(figure, left_in=left, top_in=_TITLE_IN, width_in=wide_in, height_in=high_in) for left in places
    ], figure


def _picture_of(image: ArrayLike, camera: Camera) -> NDArray[np.uint8]:
    picture: NDArray[Any] = np.asarray(image)
    if picture.shape != (camera.height, camera.width, 3) or picture.dtype != np.uint8:
        raise ValueError(
            f"image: expected shape {(camera.height, camera.width, 3)} of uint8, got {picture.shape} of {picture.dtype}"
        )
    return picture


def _paler(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray((255.0 - 0.6 * (255.0 - picture)).round(), dtype=np.uint8)


def _seen(camera: Camera, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels; points behind the camera are nowhere."""
    pixels, depth = project(camera, points_m)
    return np.where((depth > 0.02)[..., None], pixels, np.nan)


def _subscript(name: str) -> str:
    return f"{name[0]}{'₀₁₂₃'[int(name[1])]}"
