"""The arm's table seen from above, with a scale, the arm's reach, what the camera sees, and the things on it."""

from collections.abc import Sequence

import numpy as np
from matplotlib.path import Path
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from sec_lab.viz.svg.paper import SMALL_PX, Paper, words_px
from sec_lab.worlds.katana import Camera, Scene, Thing

_PX_PER_M, _LEFT_PX, _TOP_PX = 760.0, 34.0, 12.0
_X_M, _Y_M = (-0.06, 0.52), (-0.30, 0.30)
_REACH_M = (0.14, 0.47)
"""Distances from the arm's column between which it pushes."""
_STEP_M = 0.1


def table_svg(scene: Scene, *, chosen: int | None = None, afterwards: Sequence[Thing] = ()) -> str:
    """Draw a scene from above; the arm stands at the bottom and looks up.

    Parameters
    ----------
    scene : Scene
    chosen : int, optional
        Number of the thing that has a frame.
    afterwards : sequence of Thing, optional
        Drawn as dashed outlines: where things ended.

    Returns
    -------
    str
        SVG; :func:`place_of` finds places of the table in it.

    Examples
    --------
    >>> from sec_lab.worlds.katana import example_scene
    >>> table_svg(example_scene("f")).count("data-thing")
    3
    """
    width, height = _px(_X_M[0], _Y_M[0])
    paper = Paper(width + 12, height + 44, label="the table from above")
    paper.rect(_LEFT_PX, _TOP_PX, width - _LEFT_PX, height - _TOP_PX, fill="currentColor", opacity="0.05")
    _draw_view(paper, scene.camera)
    _draw_scale(paper)
    for reach in _REACH_M:
        paper.path(
            _circle_way(0.0, 0.0, reach, half=True), stroke_dasharray="5 4", opacity="0.5", data_reach=f"{reach}"
        )
    x, y = _px(*_on_arc(_REACH_M[1], -0.42))
    paper.words(x + 4, y - 8, "reach", size_px=SMALL_PX, soft=True)
    x, y = _px(0.0, 0.0)
    paper.circle(x, y, 0.04 * _PX_PER_M, fill="currentColor", opacity="0.55")
    paper.words(x + 0.04 * _PX_PER_M + 5, y, "arm", size_px=SMALL_PX, soft=True)
    for number, thing in enumerate(scene.things):
        _draw_thing(paper, thing, number, is_chosen=number == chosen)
    for thing in afterwards:
        paper.path(
            _outline_way(thing),
            stroke_dasharray="3 3",
            stroke_width="1.6",
            data_after=thing.name,
            pointer_events="none",
        )
    said = "grey: what the camera sees · dashed arcs: the arm's reach"
    paper.words(
        _LEFT_PX, height + 36, said + (" · dashed: afterwards" if afterwards else ""), size_px=SMALL_PX, soft=True
    )
    return paper.markup()


def place_of(x_px: float, y_px: float) -> tuple[float, float]:
    """The place on the table, in metres, that is drawn at a place of the drawing.

    Parameters
    ----------
    x_px, y_px : float

    Examples
    --------
    >>> [round(value, 6) for value in place_of(*drawn_at(0.3, -0.1))]
    [0.3, -0.1]
    """
    return _X_M[1] - (y_px - _TOP_PX) / _PX_PER_M, _Y_M[1] - (x_px - _LEFT_PX) / _PX_PER_M


def drawn_at(x_m: float, y_m: float) -> tuple[float, float]:
    """Where in the drawing a place on the table is drawn."""
    return _px(x_m, y_m)


def view_corners(camera: Camera) -> NDArray[np.float64]:
    """Where the corners of a camera's picture meet the table.

    Parameters
    ----------
    camera : Camera

    Returns
    -------
    (n, 2) float64
        In metres, in the order of the corners; fewer than four where the camera sees the horizon.
    """
    across = np.array([[0, 0], [camera.width, 0], [camera.width, camera.height], [0, camera.height]]) - 0.5
    middle = np.array([camera.width - 1, camera.height - 1]) / 2
    rays = np.concatenate([(across - middle) / camera.focal_px, np.ones((4, 1))], axis=1) @ camera.X_WC[:3, :3].T
    down = rays[rays[:, 2] < -1e-3]
    eye = camera.X_WC[:3, 3]
    places: NDArray[np.float64] = eye[:2] - eye[2] * down[:, :2] / down[:, 2:]
    return places


def _px(x_m: float, y_m: float) -> tuple[float, float]:
    return _LEFT_PX + (_Y_M[1] - y_m) * _PX_PER_M, _TOP_PX + (_X_M[1] - x_m) * _PX_PER_M


def _draw_view(paper: Paper, camera: Camera) -> None:
    corners = view_corners(camera)
    if len(corners) < 3:
        return
    on_drawing = Bbox([[_X_M[0], _Y_M[0]], [_X_M[1], _Y_M[1]]])
    seen = np.asarray(Path(corners).clip_to_bbox(on_drawing).vertices)
    if len(seen):
        paper.path(_way(seen), fill="currentColor", fill_opacity="0.08", stroke="none", data_view="1")


def _draw_scale(paper: Paper) -> None:
    for x_m in np.arange(0.0, _X_M[1], _STEP_M):
        (left, y), (right, _) = _px(x_m, _Y_M[1]), _px(x_m, _Y_M[0])
        paper.line(left, y, right, y, opacity="0.12")
        paper.words(left - 5, y, f"{x_m:.1f}", size_px=SMALL_PX, soft=True, anchor="end")
    for y_m in np.arange(-0.2, _Y_M[1], _STEP_M):
        (x, top), (_, bottom) = _px(_X_M[1], y_m), _px(_X_M[0], y_m)
        paper.line(x, top, x, bottom, opacity="0.12")
        read = f"{y_m:.1f}".replace("-0.0", "0.0").replace("-", "−")
        paper.words(x, bottom + 9, read, size_px=SMALL_PX, soft=True, anchor="middle")
    x, y = _px(_X_M[0], 0.0)
    paper.words(x, y + 22, "y in m", size_px=SMALL_PX, soft=True, anchor="middle")
    x, y = _px(0.25, _Y_M[1])
    paper.words(10, y, "x in m", size_px=SMALL_PX, soft=True, anchor="middle", transform=f"rotate(-90 10 {y:.1f})")


def _draw_thing(paper: Paper, thing: Thing, number: int, *, is_chosen: bool) -> None:
    red, green, blue = thing.colour
    fill = f"#{red:02x}{green:02x}{blue:02x}"
    paper.path(_outline_way(thing), fill=fill, stroke=fill, data_thing=str(number))
    x, y = _px(*thing.p_W_m[:2])
    if thing.shape == "cone":
        paper.circle(x, y, 2.5, fill="#ffffff")
    elif thing.shape == "sphere":
        paper.circle(x - 6, y - 6, 4, fill="#ffffff", opacity="0.6")
    if is_chosen:
        # Light and dark, so that it stands out in both themes.
        for stroke, thick in (("#ffffff", "5"), ("#16181c", "2.5")):
            paper.path(_outline_way(thing, wider_m=0.006), stroke=stroke, stroke_width=thick, data_chosen=str(number))
    below = y + _half_m(thing) * _PX_PER_M + 12
    across = min(max(x, _LEFT_PX + words_px([thing.name]) / 2), _px(0, _Y_M[0])[0] - words_px([thing.name]) / 2)
    paper.words(across, below, thing.name, size_px=SMALL_PX, anchor="middle", bold=is_chosen)


def _half_m(thing: Thing) -> float:
    """How far it reaches towards the arm."""
    if thing.shape != "box":
        return thing.size_m[0] / 2
    cosine, sine = abs(np.cos(thing.yaw_rad)), abs(np.sin(thing.yaw_rad))
    return float(thing.size_m[0] * cosine + thing.size_m[1] * sine) / 2


def _outline_way(thing: Thing, *, wider_m: float = 0.0) -> str:
    x, y = thing.p_W_m[:2]
    if thing.shape != "box":
        return _circle_way(x, y, thing.size_m[0] / 2 + wider_m)
    a, b = (side / 2 + wider_m for side in thing.size_m[:2])
    cosine, sine = np.cos(thing.yaw_rad), np.sin(thing.yaw_rad)
    corners = np.array([(a, b), (-a, b), (-a, -b), (a, -b)]) @ np.array([[cosine, sine], [-sine, cosine]])
    return _way(corners + np.array([x, y]))


def _on_arc(radius_m: float, angle_rad: float) -> tuple[float, float]:
    return float(radius_m * np.cos(angle_rad)), float(radius_m * np.sin(angle_rad))


def _circle_way(x_m: float, y_m: float, radius_m: float, *, half: bool = False) -> str:
    reach = np.arcsin(min(1.0, _Y_M[1] / radius_m)) if half else np.pi
    angles = np.linspace(-reach, reach, 49)
    points = np.array([_on_arc(radius_m, angle) for angle in angles]) + np.array([x_m, y_m])
    return _way(points, closed=not half)


def _way(points: NDArray[np.float64], *, closed: bool = True) -> str:
    drawn = ["{:.1f} {:.1f}".format(*_px(float(x), float(y))) for x, y in points]
    return "M" + "L".join(drawn) + ("Z" if closed else "")
