"""The rendered movies that are kept: whole, of the size and length that their README says, and as they were hashed."""

import hashlib
from pathlib import Path

import pytest

from sec_lab.recording import Recording, read_calibration
from sec_lab.worlds.tabletop.actions import ACTIONS, VERSIONS
from sec_lab.worlds.tabletop.settings import SETTINGS
from sec_lab.worlds.tabletop.truth import read_truth

FOLDER = Path("datasets/tabletop_actions")
MOVIES = [f"{action}_{version}_{setting}" for action in ACTIONS for version in VERSIONS for setting in SETTINGS]


def test_every_file_is_as_it_was_hashed() -> None:
    lines = (FOLDER / "sha256sums.txt").read_text(encoding="ascii").splitlines()
    listed = {name: digest for digest, name in (line.split(maxsplit=1) for line in lines)}
    there = {f"{movie}/{path.name}" for movie in MOVIES for path in (FOLDER / movie).iterdir()}
    assert set(listed) == there
    assert len(there) == 5 * len(MOVIES)
    for name, digest in listed.items():
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == digest, name


def test_all_together_are_below_80_megabytes() -> None:
    assert sum(path.stat().st_size for path in FOLDER.rglob("*") if path.is_file()) < 80_000_000


@pytest.mark.parametrize("movie", MOVIES)
def test_movies_are_short_stereo_pairs_with_their_truth(movie: str) -> None:
    folder = FOLDER / movie
    recording = Recording.open(folder / "left.mp4", right=folder / "right.mp4", calibration=folder / "calibration.json")
    assert recording.size == (256, 320)
    assert recording.frames_per_second == 25
    assert recording.n_frames is not None
    assert 80 <= recording.n_frames <= 200
    baseline = read_calibration(folder / "calibration.json").baseline_m
    assert baseline is not None
    assert 0.12 <= baseline <= 0.14
    truth = read_truth(folder)
    assert truth.labels.shape == (recording.n_frames, 256, 320)
    assert truth.names[1] == "table"
    assert any("hand" in name for name in truth.names.values())
