"""The command line as a user meets it: what it prints, what it writes, and what it says of bad input."""

import csv
import os
import re
import subprocess
import sys

import numpy as np
import pytest

from sec_lab import Observation, SceneGraph, graphml
from sec_lab.cli import main


def observation(rows, names, labels=(1, 2, 3)):
    """Observation of three segments whose pairs (1, 2), (2, 3), (1, 3) have the given rows."""
    pairs = [(0, 1), (1, 2), (0, 2)]
    graphs = []
    for column in np.transpose(rows):
        present = sorted({i for pair, code in zip(pairs, column, strict=True) if code != 9 for i in pair})
        matrix = np.zeros((3, 3), int)
        for (i, j), code in zip(pairs, column, strict=True):
            if code != 9:
                matrix[i, j] = matrix[j, i] = code
        graphs.append(SceneGraph([labels[i] for i in present], matrix[np.ix_(present, present)]))
    return Observation(graphs, range(0, 10 * len(graphs), 10), names)


@pytest.fixture
def files(tmp_path):
    """Two manipulations that do the same with other segments, and one that undoes it."""
    rows = np.array([[0, 0, 2, 2, 0, 0], [0, 0, 0, 2, 2, 2], [0, 2, 2, 2, 2, 0]])
    made = {
        "put": observation(rows, {1: "hand", 2: "apple", 3: "plate"}),
        "place": observation(rows, {4: "hand", 5: "cup", 6: "saucer"}, labels=(4, 5, 6)),
        "take": observation(rows[:, ::-1], {1: "hand", 2: "apple", 3: "plate"}),
        "fetch": observation(rows[:, ::-1], {7: "hand", 8: "cup", 9: "saucer"}, labels=(7, 8, 9)),
    }
    for name, seen in made.items():
        graphml.write(tmp_path / f"{name}.graphml", seen)
    return tmp_path


def test_compare_prints_similarity_rows_and_segments(files, capsys):
    assert main(["compare", str(files / "put.graphml"), str(files / "place.graphml")]) == 0
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert lines[:2] == ["spatial similarity 100.00 %", "temporal similarity 100.00 %"]
    assert "2 apple, 1 hand ≈ 5 cup, 4 hand (100 %)" in lines
    assert lines[lines.index("segments") + 1 :] == ["1 hand ≈ 4 hand", "2 apple ≈ 5 cup", "3 plate ≈ 6 saucer"]


def test_compare_says_which_segments_are_ambiguous(tmp_path, capsys):
    touching = [SceneGraph([1, 2], [[0, code], [code, 0]]) for code in (0, 2)]
    graphml.write(tmp_path / "a.graphml", Observation(touching, [0, 1]))
    assert main(["compare", str(tmp_path / "a.graphml"), str(tmp_path / "a.graphml")]) == 0
    assert "1  ≈  1 or 2  (ambiguous)" in capsys.readouterr().out


def test_table_prints_and_writes_the_table_and_finds_the_classes(files, capsys):
    paths = [str(files / f"{name}.graphml") for name in ("put", "take", "place", "fetch")]
    assert main(["table", *paths, "-o", str(files / "table.csv")]) == 0
    out = capsys.readouterr().out
    assert "class 1: put, place" in out
    assert "class 2: take, fetch" in out
    with (files / "table.csv").open() as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == ["", "put", "take", "place", "fetch"]
    assert [row[0] for row in rows[1:]] == rows[0][1:]
    values = np.array([row[1:] for row in rows[1:]], float)
    np.testing.assert_array_equal(values, values.T)
    assert values[0].tolist() == [100.0, values[0, 1], 100.0, values[0, 1]]
    assert values[0, 1] < 100


def test_chains_that_are_all_alike_are_one_class(files, capsys):
    for name in ("again", "once_more"):
        (files / f"{name}.graphml").write_bytes((files / "put.graphml").read_bytes())
    assert main(["table", *(str(files / f"{name}.graphml") for name in ("put", "again", "once_more"))]) == 0
    assert "class 1: put, again, once_more" in capsys.readouterr().out


def test_files_of_one_name_are_told_apart_by_their_folders(files, capsys):
    for name in ("put", "take", "place"):
        (files / name).mkdir()
        (files / f"{name}.graphml").rename(files / name / "GraphML.xml")
    assert main(["table", *(str(files / name / "GraphML.xml") for name in ("put", "take", "place"))]) == 0
    assert capsys.readouterr().out.split()[:3] == ["put", "take", "place"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["compare", "{}/none.graphml", "{}/put.graphml"], "none.graphml: expected .*there is no such file"),
        (["compare", "{}", "{}/put.graphml"], "this is a directory"),
        (["compare", "{}/cut.graphml", "{}/put.graphml"], "cut.graphml: "),
        (
            ["compare", "{}/put.graphml", "{}/still.graphml"],
            "still.graphml: expected an event chain of at least two columns, got one",
        ),
        (
            ["compare", "{}/put.graphml", "{}/take.graphml", "--tolerance", "101"],
            "tolerance_percent: expected 0 to 100",
        ),
        (["table", "{}/put.graphml", "{}/put.graphml"], "put.graphml: expected every chain once"),
        (["table", "{}/put.graphml", "{}/take.graphml", "-o", "{}/no/table.csv"], "there is no folder"),
        (["table", "{}/put.graphml", "."], r"\.: expected .*this is a directory"),
        (["report", "{}/none.ipynb"], "none.ipynb"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(files, capsys, arguments, message):
    (files / "cut.graphml").write_bytes((files / "put.graphml").read_bytes()[:200])
    graphml.write(files / "still.graphml", Observation([SceneGraph([1, 2], [[0, 2], [2, 0]])], [0]))
    before = sorted(files.iterdir())
    assert main([argument.format(files) for argument in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert err.startswith(f"sec-lab {arguments[0]}: ")
    assert re.search(message, err)
    assert sorted(files.iterdir()) == before


@pytest.mark.parametrize("command", ["observe", "compare", "table", "report"])
def test_every_command_explains_itself_with_an_example(command, capsys):
    with pytest.raises(SystemExit) as exit_:
        main([command, "--help"])
    assert exit_.value.code == 0
    assert f"example:\n  sec-lab {command} " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "COMMAND"),
        (["dance"], "dance"),
        (["compare", "a.graphml"], "B"),
        (["compare", "a.graphml", "b.graphml", "--tolerance", "much"], "much"),
        (["table", "a.graphml", "--direction", "up"], "up"),
    ],
)
def test_a_wrong_call_is_one_line_and_exit_code_2(arguments, message, capsys):
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    assert exit_.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_classes_that_are_not_defined_are_no_failure(tmp_path, capsys):
    # The one change of the first chain is found in all others: its column is 100 % everywhere.
    rows = {
        "short": [[0, 2], [0, 0]],
        "there": [[0, 2, 2], [0, 0, 2]],
        "back": [[0, 2, 2], [2, 2, 0]],
    }
    for name, table in rows.items():
        graphs = [
            SceneGraph([1, 2, 3], [[0, c[0], 0], [c[0], 0, c[-1]], [0, c[-1], 0]]) for c in np.transpose(table).tolist()
        ]
        graphml.write(tmp_path / f"{name}.graphml", Observation(graphs, range(len(graphs))))
    paths = [str(tmp_path / f"{name}.graphml") for name in rows]
    assert main(["table", *paths, "--direction", "larger", "-o", str(tmp_path / "table.csv")]) == 0
    assert "no classes: table: expected different values in every column" in capsys.readouterr().out
    assert (tmp_path / "table.csv").exists()


def test_a_terminal_without_the_signs_gets_others(files):
    code = "import sys; from sec_lab.cli import main; sys.exit(main(sys.argv[1:]))"
    paths = [str(files / f"{name}.graphml") for name in ("put", "place")]
    done = subprocess.run(
        [sys.executable, "-c", code, "compare", *paths],
        capture_output=True,
        check=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert b"1 hand  ?  4 hand" in done.stdout


def test_a_reader_that_leaves_early_is_no_error(files):
    paths = [str(files / f"{name}.graphml") for name in ("put", "take", "place", "fetch")]
    code = "import sys; from sec_lab.cli import main; sys.exit(main(sys.argv[1:]))"
    with subprocess.Popen(
        [sys.executable, "-c", code, "table", *paths], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 1
