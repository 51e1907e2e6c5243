"""How hard movies are: each number is right where one can know it."""

import math

import numpy as np
import pytest

from sec_lab.recording import write_movie
from sec_lab.worlds.tabletop.hardness import covering_of, gradient_of, hardness, hardness_of, main, noise_of
from sec_lab.worlds.tabletop.truth import Truth, write_truth


def _halves(sigma: float = 0.0, seed: int = 0):
    """Red on the left, blue on the right, with noise; and its labels."""
    rng = np.random.default_rng(seed)
    labels = np.repeat([1, 2], 24)[None, :].repeat(48, axis=0)
    colours = np.array([(0, 0, 0), (200, 40, 40), (40, 60, 200)], dtype=np.float64)
    picture = colours[labels] + sigma * rng.standard_normal((48, 48, 3))
    return np.clip(np.round(picture), 0, 255).astype(np.uint8), labels


@pytest.mark.parametrize("sigma", [1.0, 4.0])
def test_noise_is_found_beside_edges_and_slopes(sigma) -> None:
    rng = np.random.default_rng(1)
    slope = np.add.outer(0.3 * np.arange(200), 0.2 * np.arange(240)) + 60
    slope[:, 100:] += 50
    assert noise_of(slope) == pytest.approx(0, abs=1e-9)
    assert noise_of(slope + sigma * rng.standard_normal(slope.shape)) == pytest.approx(sigma, rel=0.04)


def test_gradient_of_an_edge() -> None:
    # Whatever the smoothing, a step of 90 grey values a row is shared out among its pixels: 90 in a row of 60.
    step = np.where(np.arange(60) < 30, 40.0, 130.0)[None, :].repeat(50, axis=0)
    assert gradient_of(step) == pytest.approx(90 / 60)


def test_covering_by_hand() -> None:
    truth = np.array([[1, 1, 1, 1], [2, 2, 3, 3]])
    assert covering_of(truth, truth + 7) == 1
    # One segment over everything: 4/8 for the first, 2/8 for each of the others.
    assert covering_of(truth, np.zeros_like(truth)) == pytest.approx((4 * 4 / 8 + 2 * 2 / 8 + 2 * 2 / 8) / 8)
    with pytest.raises(ValueError, match="found"):
        covering_of(truth, truth[:, :3])


def test_two_halves_are_easy_and_noise_makes_them_harder() -> None:
    clean, labels = _halves()
    easy = hardness([clean], [labels])
    assert (easy.noise_grey, easy.n_segments, easy.covering) == (0, 2, 1)
    noisy, _ = _halves(sigma=30)
    hard = hardness([noisy], [labels])
    assert hard.noise_grey > 10
    assert hard.covering < easy.covering
    assert math.isnan(hardness([clean]).covering)


def test_frames_and_labels_that_do_not_fit_are_refused() -> None:
    clean, labels = _halves()
    with pytest.raises(ValueError, match="images"):
        hardness([])
    with pytest.raises(ValueError, match="labels"):
        hardness([clean], [labels, labels])
    with pytest.raises(ValueError, match="16 pixels"):
        noise_of(clean[:12])


def test_movies_with_and_without_truth_are_printed_side_by_side(tmp_path, capsys) -> None:
    clean, labels = _halves()
    folder = tmp_path / "rendered"
    folder.mkdir()
    write_movie(folder / "left.mp4", [clean] * 7, frames_per_second=25, lossless=True)
    write_truth(folder, Truth([labels] * 7, [1000 * labels] * 7, [(1, 2)], [[True]] * 7, {1: "table", 2: "box"}))
    assert hardness_of(folder).covering == 1
    assert main([str(folder), str(folder / "left.mp4")]) == 0
    head, with_truth, without = capsys.readouterr().out.splitlines()
    assert head.split() == ["movie", "noise", "gradient", "segments", "covering"]
    assert with_truth.split()[::4] == ["rendered", "1.000"]
    assert without.split()[0] == "left.mp4"
    assert without.endswith("no truth")


def test_a_movie_that_is_not_there_ends_with_code_2(tmp_path, capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path / "no.mp4")])
    assert ended.value.code == 2
    assert "no.mp4" in capsys.readouterr().err
