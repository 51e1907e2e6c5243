"""The house around the library: the system check, the set-up, continuous integration, the Makefile."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHECK = ROOT / ".ci" / "check_system.sh"
LIBRARIES = "libglib-2.0.so.0 libX11.so.6 libEGL.so.1 libGL.so.1"

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the scripts are written for Debian")


def script(path: Path, body: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A folder of programs that stands for a machine with everything it needs."""
    programs = tmp_path / "programs"
    for name in ("sh", "id", "uname", "cat"):
        script(programs / name, f'exec {shutil.which(name)} "$@"')
    script(programs / "git", "true")
    script(programs / "python3", f'exec {sys.executable} "$@"')
    script(programs / "ldconfig", "\n".join(f"echo '\t{name} (libc6) => /lib/{name}'" for name in LIBRARIES.split()))
    return programs


def check(machine: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    # A shell that is named by its path, as PATH knows the programs of the machine only.
    return subprocess.run(
        [str(shutil.which("sh")), str(CHECK), *arguments],
        env={"PATH": str(machine)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_machine_with_everything_passes_in_silence(machine: Path) -> None:
    done = check(machine)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_everything_missing_is_named_in_one_line_with_the_command(machine: Path) -> None:
    for name in ("git", "python3", "ldconfig"):
        (machine / name).unlink()
    script(machine / "ldconfig", "echo 'libGL.so.1 (libc6,x86-64) => /lib/libGL.so.1'")
    done = check(machine)
    assert done.returncode == 1
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    for missing in ("Python 3.11 or newer", "git", "libglib-2.0.so.0", "libX11.so.6", "libEGL.so.1"):
        assert missing in done.stderr
    packages = "python3 python3-venv git libglib2.0-0 libx11-6 libegl1"
    assert done.stderr.rstrip().endswith(f"apt-get install -y {packages}")
    assert check(machine, "--packages").stdout.split() == packages.split()


@pytest.mark.parametrize(
    ("python", "says", "package"),
    [
        # Debian's python3 without python3-venv has venv but not ensurepip.
        ('case "$2" in *ensurepip*) exit 1 ;; esac', "venv module with ensurepip", "python3-venv"),
        ('case "$2" in *"(3, 11)"*) exit 1 ;; *python_version*) echo 3.9.2 ;; esac', "python3 is 3.9.2", "python3.11"),
        ("exit 1", "python3 is unusable", "python3.11"),
    ],
)
def test_an_unfit_python_is_named(machine: Path, python: str, says: str, package: str) -> None:
    script(machine / "python3", python)
    done = check(machine)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert says in done.stderr
    assert package in check(machine, "--packages").stdout.split()


def test_a_chosen_python_gets_its_own_packages(machine: Path) -> None:
    assert check(machine, "--packages", "python3.13").stdout.split() == ["python3.13", "python3.13-venv"]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout whose Python only notes what it is asked to do."""
    folder = tmp_path / "checkout"
    shutil.copytree(ROOT / ".ci", folder / ".ci")
    (folder / "sec_lab").mkdir()
    for name in ("requirements.lock", "pyproject.toml", "sec_lab/__init__.py"):
        (folder / name).write_text(f"# {name}\n")
    body = f"""
    if [ "$1" = -m ]; then
        echo "$*" >>"{tmp_path}/asked"
        [ "$2" != venv ] || {{ mkdir -p .venv/bin && cp "$0" .venv/bin/python && rm -f .venv/built-* .venv/*-for; }}
    else
        exec {sys.executable} "$@"
    fi"""
    script(tmp_path / "python3", body)
    return folder


def set_up(checkout: Path, *arguments: str) -> list[str]:
    """Run the set-up; give what it asked Python modules for."""
    asked = checkout.parent / "asked"
    asked.write_text("")
    environment = {**os.environ, "PATH": f"{checkout.parent}:{os.environ['PATH']}"}
    command = [str(checkout / ".ci" / "set_up.sh"), *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    if not asked.read_text():
        assert done.stdout + done.stderr == ""
    return [" ".join(line.split()[:2]) for line in asked.read_text().splitlines()]


PACKAGES, WARM = "-m pip", "-m sec_lab.warm"


def test_set_up_does_only_what_a_change_asks_for(checkout: Path) -> None:
    assert set_up(checkout) == ["-m venv", PACKAGES, PACKAGES, WARM]
    assert set_up(checkout) == []
    for name in ("requirements.lock", "pyproject.toml"):
        os.utime(checkout / name)
    assert set_up(checkout) == []

    (checkout / "sec_lab" / "__init__.py").write_text("'''Changed.'''\n")
    assert set_up(checkout) == [WARM]
    (checkout / "pyproject.toml").write_text("# changed\n")
    assert set_up(checkout) == [PACKAGES]
    (checkout / "requirements.lock").write_text("# changed\n")
    assert set_up(checkout) == ["-m venv", PACKAGES, PACKAGES, WARM]


def test_set_up_empties_the_cache_of_kernels_when_a_source_changes(checkout: Path) -> None:
    set_up(checkout)
    cache = checkout / "sec_lab" / "room" / "__pycache__"
    cache.mkdir(parents=True)
    compiled = [cache / "kernels.loop-1.py311.nbi", cache / "kernels.loop-1.py311.1.nbc"]
    for file in compiled:
        file.touch()
    assert set_up(checkout) == []
    assert all(file.exists() for file in compiled)
    (checkout / "sec_lab" / "__init__.py").write_text("'''Changed.'''\n")
    assert set_up(checkout) == [WARM]
    assert not any(file.exists() for file in compiled)


def test_set_up_goes_on_where_it_was_interrupted(checkout: Path) -> None:
    set_up(checkout)
    for note in ("built-in", "built-from", "installed-for", "warmed-for"):
        (checkout / ".venv" / note).unlink()
    assert set_up(checkout) == [PACKAGES, PACKAGES, WARM]


def test_set_up_builds_anew_after_a_move_or_for_another_python(checkout: Path) -> None:
    set_up(checkout)
    moved = checkout.rename(checkout.with_name("moved"))
    assert set_up(moved)[0] == "-m venv"
    assert set_up(moved, "python3") == []
    script(moved.parent / "python3.99", f'[ "$1" != -m ] || exec "{moved.parent}/python3" "$@"\necho cpython 3 99')
    assert set_up(moved, "python3.99")[0] == "-m venv"


def run_ci(checkout: Path, **variables: str) -> str:
    """Run .ci/run with a make that tells where it thinks the recordings are."""
    script(checkout.parent / "make", 'cat; echo "$*: ${SEC_LAB_DATA-unset}"')
    environment = {name: value for name, value in os.environ.items() if name != "SEC_LAB_DATA"}
    environment |= {"PATH": f"{checkout.parent}:{os.environ['PATH']}", **variables}
    done = subprocess.run(
        [str(checkout / ".ci" / "run")],
        env=environment,
        input="not read",
        cwd=checkout.parent,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()[-1].rpartition("test: ")[2]


def test_ci_finds_recordings_beside_the_checkout(checkout: Path) -> None:
    # Nothing is installed from here: the check finds nothing missing.
    script(checkout / ".ci" / "check_system.sh", "true")
    assert run_ci(checkout) == "unset"
    data = checkout.parent / "shared" / "data"
    data.mkdir(parents=True)
    assert run_ci(checkout) == str(data)
    assert run_ci(checkout, SEC_LAB_DATA="/somewhere") == "/somewhere"


@pytest.mark.parametrize(("has_chromium", "can_install"), [(True, False), (False, True), (False, False)])
def test_ci_installs_a_browser_where_there_is_none(checkout: Path, *, has_chromium: bool, can_install: bool) -> None:
    script(checkout / ".ci" / "check_system.sh", "true")
    programs = checkout.parent / "programs"
    programs.mkdir()
    for name in ("bash", "sh", "dirname", "cat"):
        (programs / name).symlink_to(str(shutil.which(name)))
    script(programs / "id", "echo 0")
    script(programs / "make", 'echo "make $*"')
    script(programs / "apt-get", f'echo "$*" >>"{checkout.parent}/asked"; [ "$1" = update ] || exit {1 - can_install}')
    chromium = programs / "chromium"
    if has_chromium:
        script(chromium, "true")
    environment = {"PATH": str(programs), "SEC_LAB_CHROMIUM": str(chromium)}
    done = subprocess.run([str(checkout / ".ci" / "run")], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "make --no-print-directory test\n"
    asked = checkout.parent / "asked"
    assert ("chromium" in asked.read_text() if asked.exists() else False) == (not has_chromium)
    assert ("browser tests will skip" in done.stderr) == (not has_chromium and not can_install)


def make(*arguments: str) -> list[str]:
    # As if it were not called from make itself.
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    done = subprocess.run(["make", *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def test_make_lists_its_targets() -> None:
    targets = {line.split()[1] for line in make()}
    assert targets >= {"setup", "test", "check", "report", "lab", "bench", "notebooks", "clean"}


def test_make_test_ends_with_pytest() -> None:
    commands = make("--dry-run", "test")
    tools = ["ruff check", "ruff format --check", "mypy", "lint-imports", "pytest"]
    places = [next(place for place, command in enumerate(commands) if tool in command) for tool in tools]
    assert places == sorted(places)
    assert "pytest" in commands[-1]
    for option in (
        "--doctest-modules",
        "--nbval ",
        "--nbval-current-env",
        "--benchmark-disable",
        "tests/unit",
        "tests/browser",
    ):
        assert option in commands[-1]
