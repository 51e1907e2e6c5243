"""Models of actions in GraphML, there and back."""

import numpy as np
import pytest
from networkx.readwrite.graphml import GraphMLReader

import sec_lab as sl
from sec_lab.action_model import ActionModel
from sec_lab.files import UnusableFileError
from sec_lab.graphml import read_chain, read_model, read_observation
from sec_lab.observation import Observation
from sec_lab.scene_graph import SceneGraph

CHAIN = sl.EventChain(
    [[9, 0, 2, 1], [0, 2, 2, 0]], [(7, 2), (2, -3)], [0, 1, 2, 5], {7: 'hand & "glove" <1>', 2: None, 40: "of nobody"}
)
POSITIONS = np.random.default_rng(0).normal(size=(2, 4, 3, 2))
POSITIONS[0, 1, 2] = np.nan
MODEL = ActionModel(
    CHAIN, [1, 1 / 3], [1, 0.1 + 0.2, 1, 0.5], ["one ", "zwei ä"], {"one ": {7: 1, 2: 2, -3: 9}},
    [[0, 3, 9, 12], [5, -1, 7, -1]], POSITIONS, "px",
)  # fmt: skip


def same(a: ActionModel, b: ActionModel) -> None:
    for name in ("row_weights", "column_weights", "key_frames"):
        assert getattr(a, name).tolist() == getattr(b, name).tolist()
    assert (a.positions is None) == (b.positions is None)
    if a.positions is not None:
        assert np.array_equal(a.positions, b.positions, equal_nan=True)
    assert (a.demonstrations, a.roles, a.position_unit) == (b.demonstrations, b.roles, b.position_unit)
    for name in ("relations", "pairs", "key_frames"):
        assert getattr(a.chain, name).tolist() == getattr(b.chain, name).tolist()
    assert a.chain.names == b.chain.names


@pytest.fixture
def file(tmp_path):
    return tmp_path / "model.graphml"


def test_a_model_comes_back_unchanged(file):
    sl.graphml.write(file, MODEL)
    same(sl.graphml.read(file), MODEL)
    same(read_model(file), MODEL)
    assert read_chain(file).relations.tolist() == CHAIN.relations.tolist()


def test_a_learned_model_comes_back_unchanged(file):
    graphs = [SceneGraph([1, 2], [[0, code], [code, 0]], [[0, 1], [2, 3.5]]) for code in (0, 2, 1)]
    model = sl.learn([Observation(graphs, [0, 3, 9], {1: "hand"}, "m"), Observation(graphs, [1, 2, 4], {}, "m")])
    assert model.position_unit == "m"
    sl.graphml.write(file, model)
    same(sl.graphml.read(file), model)


def test_graph_programs_open_it(file):
    sl.graphml.write(file, MODEL)
    graphs = list(GraphMLReader()(str(file)))
    assert len(graphs) == 4
    assert graphs[0].edges["7", "2"]["row_weight"] == 1
    assert graphs[1].graph["column_weight"] == 0.1 + 0.2
    assert graphs[2].edges["7", "2"]["relation"] == "Touching"


def test_the_dialect_of_the_thesis_knows_no_models(file):
    with pytest.raises(ValueError, match=r"expected 'standard' for a model, whose weights A\.2 cannot say"):
        sl.graphml.write(file, MODEL, dialect="thesis")
    assert not file.exists()


def test_a_model_is_no_observation_and_the_other_way_round(file):
    sl.graphml.write(file, MODEL)
    with pytest.raises(UnusableFileError, match="expected what was seen in a movie, got the model of an action"):
        read_observation(file)
    sl.graphml.write(file, Observation([SceneGraph([1, 2], [[0, 2], [2, 0]])], [4]))
    with pytest.raises(UnusableFileError, match="expected the model of an action, got what was seen in a movie"):
        read_model(file)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<data key="graph_column_weight">1.0</data>', "", "<graph>: expected data key_frame, column_weight"),
        (">Touching<", ">Kissing<", "expected one of .*got 'Kissing'"),
        ('"position_unit": "px"', '"position_unit": "mile"', "position_unit: expected one of"),
        ("0.3333333333333333", "1.5", "expected the nodes, pairs and row weights of the first|row_weights"),
        ('"roles": [[', '"roles": [[[7, 7, 7],', "expected tables of numbers"),
        ('<node id="7">', '<node id="8">', "expected the nodes, pairs and row weights|expected edges at every node"),
        ("</graphml>", "", "whole, well-formed XML"),
        ("<graphml ", "<!DOCTYPE graphml><graphml ", "no document type declaration"),
    ],
)
def test_damaged_files_are_refused(file, old, new, message):
    sl.graphml.write(file, MODEL)
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(UnusableFileError, match=message):
        sl.graphml.read(file)


def test_records_are_protected_and_checked():
    with pytest.raises(ValueError, match="read-only"):
        MODEL.row_weights[0] = 0.5
    for arguments, message in [
        ((CHAIN, [1, 0], [1] * 4, ["a"], {}, [[0, 1, 2, 3]]), "row_weights: expected shares above 0 up to 1, got 0"),
        ((CHAIN, [1, 1], [1] * 3, ["a"], {}, [[0, 1, 2, 3]]), r"column_weights: expected shape \(4,\), got \(3,\)"),
        ((CHAIN, [1, 1], [1] * 4, ["a", "a"], {}, [[0, 1, 2, 3]] * 2), "demonstrations: expected at least one name"),
        ((CHAIN, [1, 1], [1] * 4, ["a"], {"b": {}}, [[0, 1, 2, 3]]), "roles: expected names of demonstrations"),
        (
            (CHAIN, [1, 1], [1] * 4, ["a"], {"a": {5: 1}}, [[0, 1, 2, 3]]),
            "roles: expected segments of the chain, got 5",
        ),
        ((CHAIN, [1, 1], [1] * 4, ["a"], {"a": {7: 1, 2: 1}}, [[0, 1, 2, 3]]), "expected another segment for each"),
        ((CHAIN, [1, 1], [1] * 4, ["a"], {}, [[0, 1, 2, -3]]), "key_frames: expected -1 or frame numbers from 0 on"),
        ((CHAIN, [1, 1], [1] * 4, ["a"], {}, [[0, 1, 2, 3]], np.zeros((1, 4, 2, 2))), "positions: expected shape"),
    ]:
        with pytest.raises(ValueError, match=message):
            ActionModel(*arguments)
