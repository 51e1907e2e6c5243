"""What is kept of tabletop movies: observed from pixels and from truth, written and read back."""

import json
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from sec_lab.chain_agreement import same_chain
from sec_lab.files import UnusableFileError
from sec_lab.recording import write_movie
from sec_lab.relations.time_parameters import TimeParameters
from sec_lab.worlds.tabletop.chains import main, movies_in, read_chains
from sec_lab.worlds.tabletop.observed import measures, names_by_truth, observe_movie, role_names
from sec_lab.worlds.tabletop.portraits import portrait, read_portraits, write_portraits
from sec_lab.worlds.tabletop.rules import RULES, all_but_one, one_by_one, rule_table
from sec_lab.worlds.tabletop.truth import Truth, write_truth

N_FRAMES, HEIGHT, WIDTH, SHIFT = 60, 96, 128, 8


def make(folder: Path) -> None:
    """A red box is pushed to a blue one on a speckled table, seen by two eyes at one disparity everywhere."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(3)
    table = (90 + 4 * rng.standard_normal((HEIGHT, WIDTH + SHIFT, 1))).clip(40, 140) * (0.7, 1.0, 0.7)
    labels = np.ones((N_FRAMES, HEIGHT, WIDTH + SHIFT), np.uint8)
    labels[:, 30:66, 90:120] = 3
    pictures = np.repeat(table[None], N_FRAMES, axis=0)
    for frame, image in enumerate(labels):
        left = 20 + min(max(0, 2 * (frame - 12)), 40)
        image[30:66, left : left + 30] = 2
    pictures[labels == 2], pictures[labels == 3] = (190, 40, 40), (40, 60, 190)
    pictures = pictures.astype(np.uint8)
    write_movie(folder / "left.mp4", pictures[:, :, :WIDTH], frames_per_second=25, crf=12)
    write_movie(folder / "right.mp4", pictures[:, :, SHIFT:], frames_per_second=25, crf=12)
    shown = labels[:, :, :WIDTH]
    names = MappingProxyType({1: "table", 2: "right hand", 3: "cup"})
    touching = np.zeros((N_FRAMES, 1), bool)
    write_truth(folder, Truth(shown, np.full(shown.shape, 1000, np.uint16), [(2, 3)], touching, names))
    camera = {"focal_length_px": 80.0, "principal_point_px": [64.0, 48.0], "baseline_m": 0.1}
    (folder / "calibration.json").write_text(json.dumps(camera))


@pytest.fixture(scope="module")
def movies(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One movie of each setting, observed and kept."""
    folder = tmp_path_factory.mktemp("movies")
    for setting in ("laboratory", "kitchen"):
        make(folder / f"moving_object_1_{setting}")
    assert main([str(folder)]) == 0
    return folder


def test_what_is_kept_is_what_is_seen(movies: Path) -> None:
    kept = read_chains(movies, setting="laboratory")
    seen = observe_movie(movies / "moving_object_1_laboratory")
    assert kept.actions == {"moving_object_1": "moving object"}
    for source in ("pixels", "truth"):
        stored, anew = getattr(kept, source)["moving_object_1"], getattr(seen, source)
        assert same_chain(stored.chain, anew.chain)
        assert dict(stored.names) == dict(anew.names)
        assert list(kept.portraits(source)["moving_object_1"]) == anew.segments.tolist()
    assert dict(kept.quality.loc["moving_object_1"]) == measures(seen)
    sums = (movies / "chains" / "SHA256SUMS").read_text().splitlines()
    # Of two movies two chains and two strips each, and the table.
    assert len(sums) == 9
    table = sha256((movies / "chains" / "quality.csv").read_bytes()).hexdigest()
    assert f"{table}  quality.csv" in sums


def test_what_is_true_is_told_by_the_same_rules(movies: Path) -> None:
    seen = observe_movie(movies / "moving_object_1_laboratory")
    chain = seen.truth.chain
    rows = dict(zip(map(frozenset, chain.pairs.tolist()), chain.relations.tolist(), strict=True))
    # What slides counts as lifted; then the box rests beside the other one.
    assert rows[frozenset((1, 2))] == [1, 0, 1]
    assert rows[frozenset((2, 3))] == [0, 0, 2]
    # It moves from frame 13 to 32, and motion is measured over 8 frames.
    assert 13 <= chain.key_frames[1] <= 13 + 8
    assert 32 <= chain.key_frames[2] <= 32 + 8
    assert "table" in seen.pixels.names.values()
    assert set(seen.pixels.names.values()) <= {"table", "first hand", "cup"}
    found = measures(seen)
    assert (found["frames"], found["true_labels"], found["true_rows"]) == (N_FRAMES, 3, len(chain.changing_rows))
    assert 0.5 < found["covering"] <= 1


def test_the_rules_one_by_one(movies: Path) -> None:
    steps, missing = one_by_one(), all_but_one()
    assert list(steps) == list(missing) == ["none", *RULES]
    assert [*steps.values()][-1] == missing["none"] == TimeParameters()
    assert len(set(steps.values())) == len(steps)
    assert len(set(missing.values())) == len(missing)
    movie = observe_movie(movies / "moving_object_1_laboratory")
    table = rule_table(movie, source="truth")
    # All rules at the end of the first part and at the beginning of the second: the chain from the truth itself.
    assert table.iloc[-1]["with it and those above"].to_dict() == table.iloc[0]["all but it"].to_dict()
    assert table.loc["none", ("all but it", "agreement")] == 100
    with pytest.raises(ValueError, match="source: expected 'pixels' or 'truth', got 'both'"):
        rule_table(movie, source="both")


def test_every_parameter_belongs_to_one_rule_or_says_how_to_measure() -> None:
    ruled = [name for names in RULES.values() for name in names]
    assert len(set(ruled)) == len(ruled)
    others = set(TimeParameters.__dataclass_fields__) - set(ruled)
    # A rule that is added there has to be shown, or named here.
    assert others == {"skip_px", "motion_frames", "freeze"}


def test_names_by_most_pixels() -> None:
    labels = np.array([[[1, 1, 2, 2]], [[1, 2, 2, 2]]])
    true = np.array([[[1, 1, 1, 3]], [[1, 3, 3, 3]]])
    assert names_by_truth(labels, true, {1: "table", 3: "cup"}) == {1: "table", 2: "cup"}
    assert names_by_truth(labels, true, {})[2] == "3"


def test_roles_do_not_tell_left_from_right() -> None:
    assert role_names({2: "left hand", 3: "right hand"}) == {2: "first hand", 3: "second hand"}
    assert role_names({2: "hand", 3: "cup"}) == {2: "hand", 3: "cup"}


def test_portraits_come_back(tmp_path: Path) -> None:
    labels = np.zeros((2, 40, 60), np.uint8)
    labels[:, 10:20, 5:45] = 7
    pictures = np.full((2, 40, 60, 3), 80, np.uint8)
    pictures[labels == 7] = 200, 10, 10
    made = portrait(7, labels, pictures, side_px=20)
    # 40 columns become 20, and 10 rows 5, in the middle.
    shown = np.argwhere(made[:, :, 3])
    assert (shown.min(axis=0).tolist(), shown.max(axis=0).tolist()) == ([7, 0], [11, 19])
    assert made[9, 9].tolist() == [200, 10, 10, 255]
    write_portraits(tmp_path / "strip.png", [made, np.zeros_like(made)])
    found = read_portraits(tmp_path / "strip.png", [7, 9])
    assert np.array_equal(found[7], made)
    assert not found[9].any()
    with pytest.raises(UnusableFileError, match="expected 3 portraits beside each other, got 2"):
        read_portraits(tmp_path / "strip.png", [7, 8, 9])
    with pytest.raises(ValueError, match="segment: expected one of the label images, got 8"):
        portrait(8, labels, pictures)
    with pytest.raises(ValueError, match="portraits: expected at least one"):
        write_portraits(tmp_path / "none.png", [])
    (tmp_path / "strip.png").write_bytes(b"no picture")
    with pytest.raises(UnusableFileError, match="it is damaged"):
        read_portraits(tmp_path / "strip.png", [7])


def test_bad_input_is_named(movies: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(UnusableFileError, match="expected folders of movies, got none"):
        movies_in(tmp_path)
    with pytest.raises(SystemExit) as stopped:
        main([str(tmp_path)])
    assert stopped.value.code == 2
    with pytest.raises(SystemExit):
        main([str(movies), "--jobs", "0"])
    assert "expected a number of at least 1, got 0" in capsys.readouterr().err
    with pytest.raises(UnusableFileError, match="expected movies of the setting 'attic'"):
        read_chains(movies, setting="attic")
    (tmp_path / "chains").mkdir()
    (tmp_path / "chains" / "quality.csv").write_text("no,table\n")
    with pytest.raises(UnusableFileError, match="it is damaged"):
        read_chains(tmp_path, setting="kitchen")
