"""Roles on recordings of others: hands, recognition, and the same code on tables of another kind.

The limits are those that were set before anything was built, so they are no copies of what came out.
"""

import os
import re
from pathlib import Path

import numpy as np
import pytest

import sec_lab as sl
from sec_lab.observation import Observation
from sec_lab.recognition import recognition_rate
from sec_lab.role_evaluation import nested_classifier, nested_neighbours
from sec_lab.role_tables import Cleaning, RoleTable
from sec_lab.scene_graph import SceneGraph
from sec_lab.tracks import read_box_take, read_distance_table

DATA = Path(os.environ.get("SEC_LAB_DATA") or "/nonexistent")
if not DATA.is_dir():
    pytest.skip("SEC_LAB_DATA is not set to the folder of the recordings", allow_module_level=True)

CLEANINGS = {name: Cleaning(together_percent=name) for name in (5.0, 10.0, 20.0)}


@pytest.fixture(scope="module")
def recordings() -> dict[str, Observation]:
    return sl.graphml.read_collection(DATA / "maniac")


@pytest.fixture(scope="module")
def tables(recordings: dict[str, Observation]) -> dict[float, list[RoleTable]]:
    return {
        name: [sl.role_table(seen, cleaning=cleaning) for seen in recordings.values()]
        for name, cleaning in CLEANINGS.items()
    }


def test_hand_is_found_and_told_why(recordings: dict[str, Observation]) -> None:
    found = [sl.role_table(seen) for seen in recordings.values()]
    hands = [table.names.get(table.segments["hand"][0]) for table in found if "hand" not in table.missing]
    assert sum(name in ("Hand", "Arm") for name in hands) >= 0.97 * len(recordings)
    # Without any position, by presence and touch alone. The limit is the same.
    chains = [sl.role_table(seen.chain) for seen in recordings.values()]
    names = [table.names.get(table.segments["hand"][0]) for table in chains if "hand" not in table.missing]
    assert sum(name in ("Hand", "Arm") for name in names) >= 0.97 * len(recordings)


def renamed(seen: Observation, new: dict[int, int]) -> Observation:
    graphs = []
    for graph in seen.recorded.graphs:
        labels = np.array([new[label] for label in graph.segments.tolist()])
        order = np.argsort(labels)
        places = None if graph.positions is None else graph.positions[order]
        graphs.append(SceneGraph(labels[order], graph.relations[np.ix_(order, order)], places))
    return Observation(graphs, seen.recorded.key_frames, None, seen.position_unit)


def test_roles_do_not_depend_on_labels(
    recordings: dict[str, Observation], tables: dict[float, list[RoleTable]]
) -> None:
    rng = np.random.default_rng(6)
    for seen, table in zip(recordings.values(), tables[10.0], strict=True):
        labels = np.unique(np.concatenate([graph.segments for graph in seen.recorded.graphs])).tolist()
        for _ in range(3):
            new = dict(zip(labels, (rng.permutation(len(labels)) + 100).tolist(), strict=True))
            other = sl.role_table(renamed(seen, new))
            np.testing.assert_array_equal(other.rows, table.rows)
            for role, played in table.segments.items():
                assert set(other.segments[role]) == {new[label] for label in played}


def test_nested_recognition_reaches_what_was_asked_for(
    recordings: dict[str, Observation], tables: dict[float, list[RoleTable]]
) -> None:
    types = [sl.graphml.manipulation(name) for name in recordings]
    similarities = {str(name): sl.role_similarity_table(some) for name, some in tables.items()}
    nearest = recognition_rate(types, nested_neighbours(similarities, types).predicted)
    assert nearest.percent >= 82
    options = {f"{C}": (sl.RoleTableClassifier(C=C), tables[10.0]) for C in (0.3, 1.0)}
    classified = recognition_rate(types, nested_classifier(options, types, n_folds=3).predicted)
    assert classified.percent >= 88


def test_names_of_segments_play_no_part(recordings: dict[str, Observation]) -> None:
    for name in ("Cutting_01", "Pushing_04", "Uncover_06"):
        seen = recordings[name]
        nameless = Observation(seen.graphs, seen.key_frames, None, seen.position_unit)
        np.testing.assert_array_equal(sl.role_table(nameless).rows, sl.role_table(seen).rows)


def test_persons_left_out_are_recognised_above_a_naive_similarity() -> None:
    paths = sorted((DATA / "tracks" / "cad120").glob("*/*.txt"))
    tables = [sl.role_table(read_distance_table(path), hands=["RH", "LH"]) for path in paths]
    types = [re.sub(r"_\d+$", "", path.stem) for path in paths]
    persons = [path.parent.name for path in paths]
    found = nested_classifier({"default": (sl.RoleTableClassifier(), tables)}, types, groups=persons)
    assert recognition_rate(types, found.predicted).percent > 47


def test_each_hand_holds_what_it_is_said_to_hold() -> None:
    paths = sorted((DATA / "tracks" / "bimanual_pouring").glob("*.json.gz"))
    held = {"right hand_1": "whisk_1", "left hand_1": "bottel_1"}
    right = 0
    for path in paths:
        seen = read_box_take(path).observation
        assert sl.role_table(seen).missing["hand"] == "no segment comes or goes"
        right += sum(sl.role_table(seen, hands=[hand]).name_of("object 1") == thing for hand, thing in held.items())
    assert right >= 0.9 * 2 * len(paths)
