import hashlib
import pickle
import re
import subprocess
import sys
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from scipy import ndimage

from sec_lab.pipeline import observe_segments
from sec_lab.relations import edge_count_relations
from sec_lab.worlds.drawn import DrawnMovie, moving_object, scene_of_figure_a1

FOLDER = Path(__file__).parents[2] / "datasets" / "moving_object"
SAMPLES: tuple[Literal[1, 2], ...] = (1, 2)

# Fig. 2.5 (d) and 2.6 (d) as they follow from Table 2.2 (b) and 2.2 (a).
CHANGING = {
    1: {(2, 1): "12111", (3, 1): "11121", (4, 1): "02120", (4, 2): "12000", (4, 3): "00021"},
    2: {(2, 1): "11121", (6, 1): "12111", (3, 1): "02120", (6, 3): "12000", (3, 2): "00021"},
}
# Whatever else lies on the background stays surrounded by it.
CONSTANT_OVERLAPPING = {1: set(), 2: {(4, 1), (5, 1)}}


def rows(chain: object) -> dict[tuple[int, ...], str]:
    return {
        tuple(pair): "".join(map(str, row))
        for pair, row in zip(chain.pairs.tolist(), chain.relations.tolist(), strict=True)  # type: ignore[attr-defined]
    }


@pytest.mark.parametrize("sample", SAMPLES)
class TestMovingObject:
    @pytest.mark.parametrize("touching_threshold", [None, 0.005, 0.05])
    def test_chain_of_the_thesis(self, sample: Literal[1, 2], touching_threshold: float | None) -> None:
        movie = moving_object(sample)
        seen = observe_segments(
            movie.labels,
            relations=lambda labels: edge_count_relations(labels, touching_threshold=touching_threshold),
        )
        n = len(movie.names)
        found = rows(seen.chain)
        assert len(seen.key_frames) == 5
        assert len(found) == n * (n - 1) // 2
        expected = dict.fromkeys(found, "00000")
        expected |= dict.fromkeys(CONSTANT_OVERLAPPING[sample], "11111") | CHANGING[sample]
        assert found == expected

    def test_small_picture_gives_the_same_chain(self, sample: Literal[1, 2]) -> None:
        labels = moving_object(sample).labels
        large = observe_segments(labels, relations="edge counting").chain
        small = observe_segments(labels[:, ::2, ::2], relations="edge counting").chain
        assert rows(small) == rows(large)

    def test_scan_lines_see_the_vessels_overlapped_throughout(self, sample: Literal[1, 2]) -> None:
        found = rows(observe_segments(moving_object(sample).labels, relations="scan lines").chain)
        vessels = {1: [(2, 1), (3, 1)], 2: [(2, 1), (6, 1)]}[sample]
        assert [set(found[pair]) for pair in vessels] == [{"1"}, {"1"}]
        moving = {1: (4, 1), 2: (3, 1)}[sample]
        assert re.fullmatch("0+2+1+2+0+", found[moving])

    def test_scan_lines_as_the_readme_says(self, sample: Literal[1, 2]) -> None:
        chain = observe_segments(moving_object(sample).labels, relations="scan lines").chain
        assert len(chain.key_frames) == 7
        if sample == 1:
            found = rows(chain)
            assert (found[4, 1], found[4, 2], found[4, 3]) == ("0211120", "1120000", "0000211")

    def test_segments_are_whole_and_keep_their_size(self, sample: Literal[1, 2]) -> None:
        """One piece, but for a rim's tip cut off for a moment; what moves is never covered, only rounded."""
        movie = moving_object(sample)
        for frame in movie.labels:
            for label in movie.names:
                pieces, _ = ndimage.label(frame == label)
                sizes = np.bincount(pieces.ravel())[1:]
                assert sizes.max() >= 0.99 * sizes.sum()
        moving = {1: [4], 2: [3, 4, 5]}[sample]
        for label in moving:
            pixels = (movie.labels == label).sum(axis=(1, 2))
            assert np.ptp(pixels) <= 0.05 * pixels.max()

    def test_colours_follow_the_labels(self, sample: Literal[1, 2]) -> None:
        movie = moving_object(sample)
        for label, name in movie.names.items():
            shown = movie.frames[movie.labels == label]
            assert (shown == shown[0]).all()
            red, green, blue = shown[0].tolist()
            matches = {
                "green": green > max(red, blue),
                "yellow": min(red, green) > 2 * blue,
                "red": red > 2 * max(green, blue),
                "blue": blue > max(red, green),
                "black": max(red, green, blue) < 50,
            }
            assert matches[name.split()[0]]

    def test_stored_labels_are_what_is_drawn(self, sample: Literal[1, 2]) -> None:
        with np.load(FOLDER / f"sample_{sample}.npz", allow_pickle=False) as stored:
            assert stored.files == ["labels"]
            assert stored["labels"].dtype == np.uint8
            np.testing.assert_array_equal(stored["labels"], moving_object(sample).labels)

    @pytest.mark.parametrize("ending", ["npz", "graphml"])
    def test_readme_names_the_checksum(self, sample: Literal[1, 2], ending: str) -> None:
        name = f"sample_{sample}.{ending}"
        (row,) = [line for line in (FOLDER / "README.md").read_text().splitlines() if f"`{name}`" in line]
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() in row


def test_sizes() -> None:
    assert moving_object(1).labels.shape == moving_object(2).labels.shape == (92, 256, 320)


def test_only_the_random_path_is_random() -> None:
    one, other = (moving_object(2, rng=np.random.default_rng(seed)).labels for seed in (1, 2))
    assert (one != other).any()
    black = (one == 5) | (other == 5)
    np.testing.assert_array_equal(one[~black], other[~black])
    np.testing.assert_array_equal(one, moving_object(2, rng=np.random.default_rng(1)).labels)


@pytest.mark.parametrize("seed", range(5))
def test_any_random_path_keeps_the_chain(seed: int) -> None:
    labels = moving_object(2, rng=np.random.default_rng(seed)).labels
    chain = observe_segments(labels, relations="edge counting").chain
    assert {pair: row for pair, row in rows(chain).items() if len(set(row)) > 1} == CHANGING[2]


def test_unknown_sample() -> None:
    with pytest.raises(ValueError, match="sample: expected 1 or 2, got 3"):
        moving_object(3)  # type: ignore[arg-type]


def test_movie_is_protected() -> None:
    movie = moving_object(1)
    for array in (movie.labels, movie.frames):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0, 0] = 0
    with pytest.raises(TypeError):
        movie.names[1] = "other"  # type: ignore[index]


def test_movie_survives_a_pickle() -> None:
    movie = DrawnMovie(np.ones((2, 3, 4), np.uint8), np.zeros((2, 3, 4, 3), np.uint8), {1: "green background"})
    again = pickle.loads(pickle.dumps(movie))
    np.testing.assert_array_equal(again.labels, movie.labels)
    assert dict(again.names) == {1: "green background"}
    assert not again.frames.flags.writeable


@pytest.mark.parametrize(
    ("labels", "frames", "message"),
    [
        (np.zeros((2, 3, 4), dtype=int), np.zeros((2, 3, 4, 3), dtype=np.uint8), "labels: expected type uint8"),
        (np.zeros((2, 3, 4), dtype=np.uint8), np.zeros((2, 3, 4, 3)), "frames: expected type uint8"),
        (np.zeros((2, 3, 4), dtype=np.uint8), np.zeros((2, 3, 5, 3), dtype=np.uint8), r"frames: expected shape"),
        (np.zeros((3, 4), dtype=np.uint8), np.zeros((2, 3, 4, 3), dtype=np.uint8), "labels: expected 3 dimensions"),
    ],
)
def test_bad_movie(labels: object, frames: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DrawnMovie(labels, frames, {})  # type: ignore[arg-type]


def test_figure_a1_has_its_five_segments() -> None:
    scene = scene_of_figure_a1()
    assert scene.dtype == np.uint8
    assert np.unique(scene).tolist() == [1, 2, 3, 4, 5]


class TestCommand:
    @staticmethod
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "sec_lab.worlds.drawn", *arguments], capture_output=True, text=True, check=False
        )

    def test_writes_what_is_stored(self, tmp_path: Path) -> None:
        assert self.run(str(tmp_path)).returncode == 0
        written_names = sorted(path.name for path in tmp_path.iterdir())
        assert written_names == ["sample_1.graphml", "sample_1.npz", "sample_2.graphml", "sample_2.npz"]
        for name in ("sample_1.graphml", "sample_2.graphml"):
            assert (tmp_path / name).read_bytes() == (FOLDER / name).read_bytes()
        for name in ("sample_1.npz", "sample_2.npz"):
            with np.load(tmp_path / name) as written, np.load(FOLDER / name) as stored:
                np.testing.assert_array_equal(written["labels"], stored["labels"])

    @pytest.mark.parametrize("arguments", [(), ("no/such/folder",)])
    def test_bad_call_is_one_line(self, arguments: tuple[str, ...]) -> None:
        done = self.run(*arguments)
        assert done.returncode != 0
        assert len(done.stderr.strip().splitlines()) == 1
