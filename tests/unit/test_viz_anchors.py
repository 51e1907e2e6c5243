"""Anchor points of demonstrations, and their drawings over pictures (Fig. 2.13, 2.14, 2.18, 2.19)."""

import numpy as np
import pytest

from sec_lab.execution.anchors import connection_vector, in_frame, intersections, prime_mover, segment_length
from sec_lab.execution.enriched import Enriched
from sec_lab.execution.enriched_files import read_enriched_folder
from sec_lab.execution.pushing import DEMONSTRATIONS, pushing_skill
from sec_lab.execution.recorded_anchors import NAMES, RecordedAnchors, nearest_points, recorded_anchors
from sec_lab.recording import Recording
from sec_lab.viz.anchors import (
    draw_anchor_spread,
    draw_demonstrated,
    draw_planned,
    draw_prime_mover,
    picture_axes,
)
from sec_lab.viz.watched import draw_seen, frames_at, projected
from sec_lab.worlds.katana import Camera, Move, View, project
from sec_lab.worlds.katana.demonstrations import SEED, demonstration_scene


@pytest.fixture(scope="module")
def demonstrations() -> dict[str, Enriched]:
    return read_enriched_folder(DEMONSTRATIONS)


@pytest.fixture(scope="module")
def anchors(demonstrations: dict[str, Enriched]) -> dict[str, RecordedAnchors]:
    return recorded_anchors(demonstrations, pushing_skill())


@pytest.fixture(scope="module")
def camera() -> Camera:
    return demonstration_scene(SEED, 4).camera


def test_points_of_the_demonstrations_are_those_of_the_thesis(anchors: dict[str, RecordedAnchors]) -> None:
    """§2.10.4: starts and ends anywhere, E₁ behind the first object, S₂ and E₂ roughly on the connection vector."""
    relative = {name: np.array([one.relative()[name] for one in anchors.values()]) for name in NAMES}
    spread = {name: float(np.linalg.norm(points.std(axis=0))) for name, points in relative.items()}
    assert len(anchors) == 10
    assert min(spread["S1"], spread["E3"]) > 5 * spread["E1"]
    assert (np.abs(relative["E1"][:, 1]) < 0.005).all()
    assert (relative["E1"][:, 0] < 0).all()
    # Faces touch anywhere along the side of a box, at most 32.5 mm from its middle.
    assert (np.abs(relative["S2"][:, 1]) < 0.04).all()
    assert (relative["S2"][:, 0] > 0).all()
    assert (relative["E2"][:, 0] > relative["S2"][:, 0]).all()


def test_recorded_and_calculated_length_agree(
    demonstrations: dict[str, Enriched], anchors: dict[str, RecordedAnchors]
) -> None:
    """D6, D7: boxes nearly square to each other, so the calculated Δ is the way that was pushed, to 5 mm."""
    for name, one in anchors.items():
        seen = {thing.name: thing for thing in demonstrations[name].things_at(0)}
        found = intersections(seen["red box"], seen["green box"])
        assert segment_length(found) == pytest.approx(one.delta_m, abs=0.005)


def test_placing_undoes_relating(anchors: dict[str, RecordedAnchors]) -> None:
    one = next(iter(anchors.values()))
    for name, point in one.relative().items():
        np.testing.assert_allclose(one.placed(point), getattr(one, f"{name}_m"), atol=1e-12)


def test_anchors_need_demonstrations_of_the_model(demonstrations: dict[str, Enriched]) -> None:
    with pytest.raises(ValueError, match="expected those of the model"):
        recorded_anchors({"another": demonstrations["demonstration_00"]}, pushing_skill())


def test_nearest_points_against_many_points_of_the_borders() -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        turns = np.sort(rng.uniform(0, 2 * np.pi, (2, 6)), axis=1)
        one, other = (np.c_[np.cos(turn), np.sin(turn)] * rng.uniform(0.5, 1) for turn in turns)
        other = other + np.array([3.0, rng.uniform(-2, 2)])
        a, b = nearest_points(one, other)
        share = np.linspace(0, 1, 101)[:, None, None]
        borders = [
            (corners + share * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2) for corners in (one, other)
        ]
        least = np.linalg.norm(borders[0][:, None] - borders[1][None], axis=2).min()
        assert np.linalg.norm(a - b) <= least + 1e-9
        assert np.linalg.norm(a - b) == pytest.approx(least, abs=0.02)


def test_spread_is_drawn_where_the_camera_sees_it(anchors: dict[str, RecordedAnchors], camera: Camera) -> None:
    picture = np.full((camera.height, camera.width, 3), 120, dtype=np.uint8)
    figure = draw_anchor_spread(picture, camera, anchors, shown="demonstration_04")
    drawn = {line.get_gid(): line for line in figure.axes[0].lines if line.get_gid()}
    here = anchors["demonstration_04"]
    place = list(anchors).index("demonstration_04")
    for name in ("S1", "E1", "S2", "E2"):
        expected = project(camera, getattr(here, f"{name}_m"))[0]
        np.testing.assert_allclose(drawn[name].get_xydata()[place], expected, atol=1e-6)
    above = {line.get_gid(): line for line in figure.axes[1].lines if line.get_gid()}
    np.testing.assert_allclose(above["E2"].get_xydata()[place], 1000 * here.relative()["E2"][:2], atol=1e-9)
    with pytest.raises(ValueError, match="shown: expected one of"):
        draw_anchor_spread(picture, camera, anchors, shown="none")
    with pytest.raises(ValueError, match="image: expected shape"):
        draw_anchor_spread(picture[1:], camera, anchors, shown="demonstration_04")


def test_motion_is_drawn_over_demonstration_and_scene(
    demonstrations: dict[str, Enriched], anchors: dict[str, RecordedAnchors], camera: Camera
) -> None:
    picture = np.full((camera.height, camera.width, 3), 120, dtype=np.uint8)
    left, right = picture_axes(2, camera)
    recorded = anchors["demonstration_04"]
    draw_demonstrated(picture, camera, recorded, ax=left, title="A")
    seen = demonstrations["demonstration_04"].things_at(0)
    red, green = (next(thing for thing in seen if thing.name == name) for name in ("red box", "green box"))
    moves = [Move((*red.centre_m[:2], 0.15)), Move((*green.centre_m[:2], 0.03)), Move((-0.1, -0.33, 0.3))]
    found = intersections(red, green)
    sight = View(picture, np.ones(picture.shape[:2], dtype=np.float32), camera)
    draw_planned(
        sight, found, moves, origin_m=red.centre_m, connection_m=connection_vector(red, green),
        start_m=(-0.1, 0.33, 0.3), ax=right, title="B",
    )  # fmt: skip
    said = [[text.get_text() for text in ax.texts if text.get_text()] for ax in (left, right)]
    assert f"Δ {1000 * recorded.delta_m:.0f} mm" in said[0]
    assert f"Δ {1000 * segment_length(found):.0f} mm" in said[1]
    assert {"E₁", "S₂", "E₂"} <= set(said[0]) & set(said[1])
    assert in_frame(recorded.E1_m, recorded.origin_m, recorded.connection_m)[0] < 0


def test_the_difference_says_how_much_changed() -> None:
    before = np.ones((40, 50), dtype=np.uint8)
    after = before.copy()
    after[5:9, 5:10] = 2
    found = prime_mover(before, after, {1: "table", 2: "robot arm"})
    figure = draw_prime_mover(before, after, found, key_frames=(3, 9))
    assert [ax.get_title(loc="left") for ax in figure.axes] == [
        "N, frame 3",
        "T, frame 9",
        "difference: robot arm 20 px",
    ]
    with pytest.raises(ValueError, match="expected shape"):
        draw_prime_mover(before[1:], after, found)


def test_graphs_are_projected_into_the_picture(demonstrations: dict[str, Enriched], camera: Camera) -> None:
    observation = demonstrations["demonstration_04"].perceived.observation
    seen = projected(observation, camera)
    first, metres = seen.graphs[0], observation.graphs[0]
    assert first is not None
    assert metres is not None
    assert metres.positions is not None
    np.testing.assert_allclose(first.positions, project(camera, metres.positions)[0])
    with pytest.raises(ValueError, match="expected positions in metres, got 'px'"):
        projected(seen, camera)


def test_moments_need_range_and_frames_that_exist(demonstrations: dict[str, Enriched], camera: Camera) -> None:
    movie = Recording.from_frames(np.zeros((3, camera.height, camera.width, 3), dtype=np.uint8))
    assert [frame.index for frame in frames_at(movie, [2, 0, 2])] == [2, 0, 2]
    with pytest.raises(ValueError, match="frames: expected frames of the recording, got 7"):
        frames_at(movie, [1, 7])
    with pytest.raises(ValueError, match="expected one with range"):
        draw_seen(demonstrations["demonstration_04"].perceived, movie, camera, [0])
