"""What environment.md, requirements.in, requirements.lock, pyproject.toml and .venv say of each other."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[2]
CARD = {
    "jupyterlab",
    "ipywidgets",
    "numpy",
    "opencv-python-headless",
    "matplotlib",
    "pandas",
    "meshcat",
    "drake",
    "trimesh",
}


def asked_for() -> set[str]:
    lines = (ROOT / "requirements.in").read_text().splitlines()
    return {canonicalize_name(line) for line in lines if line and not line.startswith("#")}


def locked() -> dict[str, list[Requirement]]:
    """Every pin of the lock; a package may have one for each of several Pythons."""
    pins: dict[str, list[Requirement]] = {}
    for entry in re.split(r"\n(?=\S)", (ROOT / "requirements.lock").read_text()):
        if not entry.startswith("#"):
            pin = Requirement(entry.split("\\")[0])
            pins.setdefault(canonicalize_name(pin.name), []).append(pin)
    return pins


def version_of(pin: Requirement) -> str:
    (clause,) = pin.specifier
    assert clause.operator == "=="
    return clause.version


def table() -> dict[str, list[str]]:
    """Package and versions of every row of environment.md; every cell of a row must say something."""
    rows = re.findall(r"^\| (.+?) \| (.+?) \| (.+?) \| (.+?) \|$", (ROOT / "environment.md").read_text(), re.MULTILINE)
    named = [row for row in rows if row[0] != "package"]
    assert len(named) == len({row[0] for row in named}), "a package stands in two rows"
    return {canonicalize_name(package): versions.split(", ") for package, versions, *_ in named}


def test_table_lists_exactly_what_is_asked_for() -> None:
    assert set(table()) == asked_for()


def test_table_gives_every_locked_version() -> None:
    pins = {package: sorted((version_of(pin) for pin in locked()[package]), key=Version) for package in asked_for()}
    assert table() == pins


def test_installed_is_what_the_lock_pins_for_this_python() -> None:
    here = {
        package: [version_of(pin) for pin in pins if pin.marker is None or pin.marker.evaluate()]
        for package, pins in locked().items()
    }
    wanted = {package: versions for package, versions in here.items() if versions}
    assert set(wanted) >= asked_for()
    assert {package: [metadata.version(package)] for package in wanted} == wanted


def test_lock_has_hashes_for_every_package_and_no_address() -> None:
    text = (ROOT / "requirements.lock").read_text()
    for entry in re.split(r"\n(?=\S)", text):
        assert entry.startswith("#") or re.search(r"--hash=sha256:[0-9a-f]{64}", entry), entry
    assert "://" not in text
    assert "index-url" not in text.replace("--no-emit-index-url", "")


def test_card_is_in_the_lock_and_accelerators_are_not() -> None:
    assert set(locked()) >= CARD
    assert not [name for name in locked() if name.startswith(("torch", "nvidia", "cuda", "jax", "tensorflow"))]


def test_project_needs_what_is_asked_for_and_pins_nothing() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed = [Requirement(line) for line in project["dependencies"]]
    assert {canonicalize_name(need.name) for need in needed} >= CARD
    assert {canonicalize_name(need.name) for need in needed} <= asked_for()
    assert not [need for need in needed if "==" in str(need.specifier)]
