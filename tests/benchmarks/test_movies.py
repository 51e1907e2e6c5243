"""Which movies the benches take: rendered once for each seed and generator, the first few of every kind."""

from pathlib import Path

import numpy as np
import pytest

from sec_lab.recording import write_movie
from sec_lab.worlds.tabletop import __main__ as generator
from sec_lab.worlds.tabletop.truth import Truth, write_truth
from tests.benchmarks import movies


def put_movie(folder: Path) -> None:
    """The files of a movie of two frames, in which a square moves by two pixels."""
    folder.mkdir(parents=True)
    labels = np.ones((2, 16, 32), dtype=np.uint8)
    labels[0, 4:12, 4:12] = labels[1, 4:12, 6:14] = 2
    pictures = np.repeat(80 * labels[..., None], 3, axis=-1)
    for eye in ("left", "right"):
        write_movie(folder / f"{eye}.mp4", pictures, frames_per_second=25)
    write_truth(folder, Truth(labels, np.full(labels.shape, 1500), [(1, 2)], [[True]] * 2, {1: "table", 2: "box"}))
    (folder / "calibration.json").write_text('{"focal_length_px": 300, "principal_point_px": [16, 8]}')


@pytest.fixture
def rendered(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[list[str]]:
    """What the generator was asked for; it makes the smallest movie instead."""
    asked: list[list[str]] = []

    def main(arguments: list[str]) -> int:
        asked.append(arguments[1:])
        folder, _, action, _, version, _, setting, *_ = arguments
        put_movie(Path(folder) / f"{action}_{version}_{setting}")
        return 0

    monkeypatch.setattr(generator, "main", main)
    monkeypatch.setattr(movies, "ROOT", tmp_path)
    monkeypatch.setattr(movies, "RENDERED", tmp_path / "build")
    return asked


def test_movies_of_a_seed_are_rendered_once(rendered: list[list[str]]) -> None:
    told: list[str] = []
    sources = movies.of_seed(11, 3, told.append)
    assert [source.name for source in sources] == [
        "11/filling_liquid_1_kitchen",
        "11/filling_liquid_1_laboratory",
        "11/making_sandwich_1_kitchen",
    ]
    assert rendered[0] == ["--action", "filling_liquid", "--version", "1", "--setting", "kitchen", "--seed", "11"]
    assert (len(rendered), len(told)) == (3, 3)
    movies.of_seed(11, 4, told.append)
    assert len(rendered) == 4
    movies.of_seed(12, 1, told.append)
    assert rendered[-1][-1] == "12"


def test_another_generator_renders_anew(rendered: list[list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    movies.of_seed(11, 1, print)
    monkeypatch.setattr(movies, "generator_digest", lambda: "another")
    movies.of_seed(11, 1, print)
    assert len(rendered) == 2


def test_movies_that_lie_in_a_folder(tmp_path: Path) -> None:
    for name in ("opening_book_2_kitchen", "opening_book_1_kitchen", "filling_liquid_2_laboratory"):
        put_movie(tmp_path / name)
    (tmp_path / "moving_object_1_kitchen").mkdir()  # not there yet
    sources = movies.kept(tmp_path)
    assert [source.name for source in sources] == [
        "opening_book_1_kitchen",
        "filling_liquid_2_laboratory",
        "opening_book_2_kitchen",
    ]
    movie = sources[1].open()
    assert (movie.setting, movie.recording.has_right, movie.left.has_right) == ("laboratory", True, False)
    assert movie.pictures.shape == (2, 16, 32, 3)
    assert movie.depth_m is not None
    assert movie.depth_m[0, 0, 0] == pytest.approx(1.5)
    assert (movie.labels[:, 8, 5] == [2, 1]).all()
