"""The README shows what its commands print."""

import re
import shlex
from pathlib import Path

from sec_lab.cli import main

README = Path(__file__).parents[2] / "README.md"


def test_commands_print_what_the_readme_shows(capsys, monkeypatch):
    monkeypatch.chdir(README.parent)
    Path("build").mkdir(exist_ok=True)
    blocks = re.findall(
        r"^    \$ \.venv/bin/sec-lab (.+)\n((?:    .*\n|\n(?=    ))+)", README.read_text(), re.MULTILINE
    )
    assert blocks
    for command, shown in blocks:
        assert main(shlex.split(command)) == 0
        assert capsys.readouterr().out == re.sub(r"^    ", "", shown, flags=re.MULTILINE)


def test_modules_and_notebooks_of_the_map_exist():
    text = README.read_text()
    modules = set(re.findall(r"`sec_lab\.(\w+)`", text))
    notebooks = set(re.findall(r"`((?:chapter|real_recordings)_?\w*[a-z])`", text))
    assert modules
    assert notebooks
    for module in modules:
        path = README.parent / "sec_lab" / module
        assert path.is_dir() or path.with_suffix(".py").is_file(), module
    for notebook in notebooks:
        assert (README.parent / "notebooks" / f"{notebook}.ipynb").is_file(), notebook
