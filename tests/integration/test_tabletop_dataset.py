"""The rendered movies that are kept: whole, of the size and length that their README says, and as they were hashed."""

import hashlib
from pathlib import Path

import pytest

from sec_lab.recording import Recording, read_calibration
from sec_lab.worlds.tabletop.actions import COLLECTIONS
from sec_lab.worlds.tabletop.deeds import read_deeds
from sec_lab.worlds.tabletop.settings import SETTINGS
from sec_lab.worlds.tabletop.truth import read_truth

DATASETS = Path("datasets")
MOVIES = [
    (collection, f"{action}_{version}_{setting}")
    for collection, actions in COLLECTIONS.items()
    for action, versions in actions.items()
    for setting in SETTINGS
    for version in versions
]
N_FILES = {"tabletop_actions": 5, "put_and_take": 6}
"""In the folder of a movie: both eyes, calibration, truth and names; and when something is put or taken."""


@pytest.mark.parametrize("collection", COLLECTIONS)
def test_every_file_is_as_it_was_hashed(collection: str) -> None:
    folder, movies = DATASETS / collection, [movie for where, movie in MOVIES if where == collection]
    lines = (folder / "sha256sums.txt").read_text(encoding="ascii").splitlines()
    listed = {name: digest for digest, name in (line.split(maxsplit=1) for line in lines)}
    there = {f"{movie}/{path.name}" for movie in movies for path in (folder / movie).iterdir()}
    assert set(listed) == there
    assert len(there) == N_FILES[collection] * len(movies)
    for name, digest in listed.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest, name


@pytest.mark.parametrize("collection", COLLECTIONS)
def test_all_together_are_below_80_megabytes(collection: str) -> None:
    assert sum(path.stat().st_size for path in (DATASETS / collection).rglob("*") if path.is_file()) < 80_000_000


@pytest.mark.parametrize(("collection", "movie"), MOVIES)
def test_movies_are_short_stereo_pairs_with_their_truth(collection: str, movie: str) -> None:
    folder = DATASETS / collection / movie
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
    if collection == "put_and_take":
        deeds = read_deeds(folder)
        action = movie.partition("_")[0]
        assert sorted(deed.kind for deed in deeds) == (["putting", "taking"] if action == "mixed" else [action])
        for deed in deeds:
            assert {deed.hand, deed.thing, deed.plate} <= set(truth.names.values())
            assert 0 < deed.appears < deed.begin < deed.end <= deed.leaves < recording.n_frames
