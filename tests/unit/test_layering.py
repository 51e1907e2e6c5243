"""The contracts between the rooms: that they are kept, and that they would notice if they were not."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def broken_contracts(project: Path) -> list[str]:
    """Names of the contracts of pyproject.toml that a project breaks."""
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-logo", "--no-cache"]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
    broken = [line.removesuffix(" BROKEN") for line in done.stdout.splitlines() if line.endswith(" BROKEN")]
    assert (done.returncode == 0) == (not broken), done.stdout + done.stderr
    return broken


def project_with(folder: Path, modules: dict[str, str]) -> Path:
    """Make a small sec_lab with some rooms under the project's own contracts."""
    (folder / "pyproject.toml").write_bytes((ROOT / "pyproject.toml").read_bytes())
    for name, source in {"__init__": "", **modules}.items():
        module = folder / "sec_lab" / f"{name}.py"
        module.parent.mkdir(parents=True, exist_ok=True)
        module.write_text(source)
    for package in (folder / "sec_lab").rglob("*/"):
        (package / "__init__.py").touch()
    return folder


def test_the_project_keeps_its_contracts() -> None:
    assert broken_contracts(ROOT) == []


def test_what_is_allowed_is_kept(tmp_path: Path) -> None:
    modules = {
        "codes": "",
        "similarity": "import sec_lab._similarity_kernels\nimport sec_lab.codes\n",
        "_similarity_kernels": "",
        "execution/motion": "import pydrake\n",
        "worlds/arms": "import pydrake.all\nfrom pydrake.multibody.plant import MultibodyPlant\n",
        "viz/widgets": "import ipywidgets\nimport matplotlib.pyplot\nimport sec_lab.similarity\n",
        "cli": "import sec_lab.viz.widgets\nimport sec_lab.execution.motion\n",
    }
    assert broken_contracts(project_with(tmp_path, modules)) == []


ROOMS = "A room imports only the rooms below it"
SIMULATOR = "Drake only in worlds, execution.motion and viz"
PICTURES = "matplotlib and ipywidgets only in viz"


@pytest.mark.parametrize(
    ("modules", "contract"),
    [
        ({"codes": "import sec_lab.similarity\n", "similarity": ""}, ROOMS),
        ({"pipeline": "import sec_lab.viz.figures\n", "viz/figures": ""}, ROOMS),
        ({"classification": "import sec_lab.roles\n", "roles": ""}, ROOMS),
        ({"utils": ""}, ROOMS),
        ({"pipeline": "def observe():\n    import pydrake.all\n"}, SIMULATOR),
        ({"execution/loop": "from pydrake.math import RigidTransform\n"}, SIMULATOR),
        ({"similarity": "from matplotlib import pyplot\n"}, PICTURES),
        ({"cli": "import ipywidgets\n"}, PICTURES),
    ],
)
def test_what_is_not_allowed_is_noticed(tmp_path: Path, modules: dict[str, str], contract: str) -> None:
    assert broken_contracts(project_with(tmp_path, modules)) == [contract]


def test_every_room_of_the_design_has_its_place() -> None:
    config = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    (layers,) = (contract["layers"] for contract in config["contracts"] if contract["type"] == "layers")
    places = {
        room.strip(" ()"): place for place, layer in enumerate(layers) for room in layer.replace("|", ":").split(":")
    }
    order = ["cli", "viz", "plants", "execution", "worlds", "pipeline", "graphml", "noise", "estimators", "learning"]
    order += ["roles", "similarity", "observation", "event_chain", "scene_graph", "relations", "segmentation"]
    order += ["recording", "codes"]
    assert [places[room] for room in order] == sorted(places[room] for room in order)
    assert places["classification"] == places["roles"]
    assert places["baselines"] == places["noise"]
