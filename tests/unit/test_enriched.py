"""GraphML that is enough to execute (A.2): written from movies, read back, learned from, planned with."""

from pathlib import Path

import numpy as np
import pytest

from sec_lab import graphml
from sec_lab.codes import to_letters
from sec_lab.execution.anchors import prime_mover
from sec_lab.execution.enriched import Enriched, enrich
from sec_lab.execution.enriched_files import read_enriched, read_enriched_folder, write_enriched
from sec_lab.execution.perception import perceive
from sec_lab.execution.planning import Demonstrated, Skill, learn_skill, plan
from sec_lab.execution.pushing import DEMONSTRATIONS, main, pushing_skill
from sec_lab.execution.things import COLOURS, things_in
from sec_lab.files import UnusableFileError
from sec_lab.viz.watched import colour_labels, frames_at
from sec_lab.worlds.katana import example_scene, view
from sec_lab.worlds.katana.stored import read_demonstration

ROUNDING_M = 2e-5
"""A file has micrometres; the objects are measured at its key frame, in a movie just before the arm is seen."""


@pytest.fixture(scope="module")
def movies() -> dict[str, Demonstrated]:
    """The two shortest demonstrations."""
    found = {}
    for number in (3, 6):
        given = read_demonstration(DEMONSTRATIONS / f"demonstration_0{number}.npz")
        seen = perceive(given.recording, given.scene.camera, tip_m=given.truth.tip_m)
        truth = given.truth
        found[f"demonstration_0{number}"] = Demonstrated(
            given.recording, given.scene.camera, seen, truth.tip_m, truth.joints_rad
        )
    return found


@pytest.fixture(scope="module")
def folder(movies: dict[str, Demonstrated], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("graphml")
    for name, one in movies.items():
        write_enriched(path / f"{name}.graphml", one)
    return path


def same_numbers(one: Skill, other: Skill, *, atol: float) -> None:
    for what in ("starts", "touches", "ends"):
        np.testing.assert_allclose(getattr(one, what).points_m, getattr(other, what).points_m, atol=atol)
    for what in ("press_m", "contact_gap_m"):
        assert getattr(one, what) == pytest.approx(getattr(other, what), abs=3 * atol)
    assert one.speed_m_s == pytest.approx(other.speed_m_s, rel=1e-3)
    # Fingers that take hold in the middle stand in no direction from it, and at no distance from the border in it.
    if not one.hand.closes:
        assert one.standoff_m == pytest.approx(other.standoff_m, abs=3 * atol)
        assert one.side_rad == pytest.approx(other.side_rad, abs=atol / 0.05)


def test_a_skill_from_files_is_that_from_movies(movies: dict[str, Demonstrated], folder: Path) -> None:
    told, seen = learn_skill(read_enriched_folder(folder)), learn_skill(movies)
    np.testing.assert_array_equal(told.model.chain.relations, seen.model.chain.relations)
    np.testing.assert_array_equal(told.model.key_frames, seen.model.key_frames)
    assert (told.rules, told.prime, told.first, told.second) == (seen.rules, seen.prime, seen.first, seen.second)
    same_numbers(told, seen, atol=ROUNDING_M)
    scene = example_scene("a")
    things = things_in(view(scene), scene.camera)
    one, other = (plan(skill, things, home_m=scene.home_m) for skill in (told, seen))
    assert [[move.name for move in step.moves] for step in one] == [
        [move.name for move in step.moves] for step in other
    ]
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(
            [move.to_m for move in a.moves], [move.to_m for move in b.moves], atol=2 * ROUNDING_M
        )


@pytest.mark.slow
def test_pick_and_place_from_files_is_that_from_movies() -> None:
    """Grip and placing too: they need the joints and the footprints in the end."""
    folder = DEMONSTRATIONS.parent / "katana_pick_and_place" / "on"
    movies = {}
    for name in ("demonstration_01", "demonstration_04"):
        given = read_demonstration(folder / f"{name}.npz")
        seen = perceive(given.recording, given.scene.camera, tip_m=given.truth.tip_m)
        truth = given.truth
        movies[name] = Demonstrated(given.recording, given.scene.camera, seen, truth.tip_m, truth.joints_rad)
    told = learn_skill({name: read_enriched(folder / f"{name}.graphml") for name in movies})
    seen_skill = learn_skill(movies)
    assert told.rules == seen_skill.rules
    same_numbers(told, seen_skill, atol=ROUNDING_M)
    assert told.hand.closes
    assert (told.hand.before, told.hand.after) == (seen_skill.hand.before, seen_skill.hand.after)
    assert told.hand.height_m == pytest.approx(seen_skill.hand.height_m, abs=ROUNDING_M)
    assert told.hand.facing_rad == pytest.approx(seen_skill.hand.facing_rad, abs=1e-3)
    assert told.placed is not None
    assert seen_skill.placed is not None
    np.testing.assert_allclose(told.placed.offset_m.points_m, seen_skill.placed.offset_m.points_m, atol=1e-4)


def test_stored_files_are_what_is_perceived_today(folder: Path) -> None:
    now = read_enriched_folder(folder)
    stored = {name: read_enriched(DEMONSTRATIONS / f"{name}.graphml") for name in now}
    for name in now:
        np.testing.assert_array_equal(
            stored[name].perceived.observation.key_frames, now[name].perceived.observation.key_frames
        )
        np.testing.assert_allclose(stored[name].tip_m, now[name].tip_m, atol=2e-6)
        np.testing.assert_allclose(stored[name].joints_rad, now[name].joints_rad, atol=2e-4)
        assert stored[name].changed_px == now[name].changed_px
    same_numbers(learn_skill(stored), learn_skill(now), atol=ROUNDING_M)


def test_writing_what_was_read_gives_the_same_file(folder: Path, tmp_path: Path) -> None:
    first = folder / "demonstration_06.graphml"
    write_enriched(tmp_path / "again.graphml", read_enriched(first))
    assert (tmp_path / "again.graphml").read_bytes() == first.read_bytes()


def test_the_file_is_the_dialect_of_the_thesis(movies: dict[str, Demonstrated], folder: Path) -> None:
    """A.2: key frames, nodes with positions and names, an edge for every pair; other readers lose nothing of it."""
    read = graphml.read_observation(folder / "demonstration_06.graphml")
    seen = movies["demonstration_06"].perceived.observation
    np.testing.assert_array_equal(read.chain.relations, seen.chain.relations)
    assert (read.position_unit, dict(read.names)) == ("m", dict(seen.names))
    for one, other in zip(read.graphs, seen.graphs, strict=True):
        assert one is not None
        assert other is not None
        np.testing.assert_array_equal(one.positions, other.positions)


def test_the_stored_skill_has_the_model_of_the_thesis() -> None:
    """Fig. 2.17 with all ten demonstrations: every row and column in each."""
    model = pushing_skill().model
    rows = {model.chain.row_label(row): to_letters(codes) for row, codes in enumerate(model.chain.relations)}
    assert rows == {"red box, robot arm": "ANTTNA", "green box, red box": "NNNTTT"}
    assert len(model.demonstrations) == 10
    assert model.row_weights.tolist() == [1.0, 1.0]


def test_things_are_those_of_the_chunk_of_time() -> None:
    told = read_enriched(DEMONSTRATIONS / "demonstration_06.graphml")
    frames = sorted(told.things)
    assert told.things_at(frames[1] - 1) is told.things[frames[0]]
    assert told.things_at(frames[1]) is told.things[frames[1]]
    with pytest.raises(ValueError, match="frame: expected 0 or later, got -1"):
        told.things_at(-1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('execution:frames_per_second="20.0"', "", "expected what execution needs"),
        ('execution:frames_per_second="20.0"', 'execution:frames_per_second="nan"', "expected a finite number"),
        ('execution:frames_per_second="20.0"', 'execution:frames_per_second="0"', "expected a number above 0"),
        ('position_unit="m"', 'position_unit="px"', "position_unit: expected 'm', got 'px'"),
        ("execution:tip_path_m", "execution:path", "expected no attribute of execution but"),
        ('execution:tip_path_m="', 'execution:tip_path_m="1 2, ', "tip_path_m: expected 3 numbers between commas"),
        ('execution:tip_path_m="', 'execution:tip_path_m="1 2 3, ', "expected a path of the tip up to it"),
        ('execution:footprint_m="', 'execution:footprint_m="a b, ', "footprint_m: expected a finite number, got 'a'"),
        ('execution:parts="1"', 'execution:parts="one"', "parts: expected a whole number"),
        (' execution:height_m="', ' execution:parts_m="', "expected no attribute of execution but"),
        ('execution:joint_path_rad="', 'execution:joint_path_rad="1 2, ', "expected 7 numbers between commas"),
        ('execution:changed_px="', 'execution:changed_px="-', "changed_px: expected"),
        ("</GraphML>", "", "well-formed"),
        ("<GraphML", "<!DOCTYPE a><GraphML", "refused as unsafe"),
    ],
)
def test_bad_files_get_one_clear_error(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = (DEMONSTRATIONS / "demonstration_06.graphml").read_text()
    assert old in text
    path = tmp_path / "bad.graphml"
    path.write_text(text.replace(old, new))
    with pytest.raises(UnusableFileError, match=r"bad\.graphml") as caught:
        read_enriched(path)
    assert message in str(caught.value)


def test_a_plain_observation_is_not_enough(tmp_path: Path) -> None:
    told = read_enriched(DEMONSTRATIONS / "demonstration_06.graphml")
    graphml.write(tmp_path / "plain.graphml", told.perceived.observation)
    with pytest.raises(UnusableFileError, match="expected what execution needs"):
        read_enriched(tmp_path / "plain.graphml")
    with pytest.raises(UnusableFileError, match=r"expected files of demonstrations \(\*.graphml\), got none"):
        read_enriched_folder(DEMONSTRATIONS / "nothing")


def test_nothing_is_left_of_what_cannot_be_written(tmp_path: Path) -> None:
    told = read_enriched(DEMONSTRATIONS / "demonstration_06.graphml")
    with pytest.raises(UnusableFileError, match="there is no folder"):
        write_enriched(tmp_path / "no" / "a.graphml", told)
    assert list(tmp_path.iterdir()) == []


def test_records_say_what_is_wrong() -> None:
    told = read_enriched(DEMONSTRATIONS / "demonstration_06.graphml")
    with pytest.raises(ValueError, match="tip_m: expected finite numbers of shape"):
        Enriched(told.perceived, told.tip_m[:4], 20.0, told.things, told.changed_px)
    with pytest.raises(ValueError, match="things: expected those of the key frames"):
        Enriched(told.perceived, told.tip_m, 20.0, {0: ()}, told.changed_px)
    with pytest.raises(ValueError, match="joints_rad: expected finite numbers of shape"):
        Enriched(told.perceived, told.tip_m, 20.0, told.things, told.changed_px, np.zeros((4, 7)))
    with pytest.raises(ValueError, match="expected one of the key frames"):
        told.difference(0, 1)


def test_a_movie_is_left_for_what_was_seen_at_its_key_frames(movies: dict[str, Demonstrated]) -> None:
    one = movies["demonstration_06"]
    kept = enrich(one)
    for frame in one.perceived.observation.key_frames.tolist():
        for mine, direct in zip(kept.things[frame], one.things_at(frame), strict=True):
            assert mine.name == direct.name
            np.testing.assert_array_equal(mine.footprint_m, direct.footprint_m)
    frames = one.perceived.observation.key_frames.tolist()
    looks = frames_at(one.recording, frames[1:3])
    names = {label: colour.name for label, colour in enumerate(COLOURS, start=1)}
    direct = prime_mover(*(colour_labels(look) for look in looks), names)
    assert kept.difference(*frames[1:3]).changed_px == {name: n for name, n in direct.changed_px.items() if n}
    assert direct.name == "robot arm"
    with pytest.raises(ValueError, match="frame: expected one of the movie, got 9999"):
        one.things_at(9999)


def test_the_command_refuses_an_empty_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main([str(tmp_path)])
    assert left.value.code == 2
    assert "expected files of demonstrations, got none" in capsys.readouterr().err
