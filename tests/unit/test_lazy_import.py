import subprocess
import sys

import pytest

import sec_lab

HEAVY = ("pandas", "numba", "scipy", "sklearn", "matplotlib", "networkx", "cv2", "pydrake")


def loaded_by(statement: str) -> list[str]:
    """Heavy packages that a fresh interpreter has loaded after a statement."""
    code = f"{statement}\nimport sys\nprint(*sorted({set(HEAVY)!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_importing_the_package_loads_nothing_heavy() -> None:
    assert loaded_by("import sec_lab") == []


def test_the_check_above_sees_what_is_loaded() -> None:
    assert "pandas" in loaded_by("import pandas")


@pytest.mark.parametrize("name", ["Relation", "EventChain", "event_chain"])
def test_records_need_nothing_heavy(name: str) -> None:
    assert loaded_by(f"from sec_lab import {name}") == []


@pytest.mark.parametrize("name", sec_lab.__all__)
def test_every_public_name_is_there(name: str) -> None:
    kind = type(getattr(sec_lab, name)).__name__
    assert kind == "module" if name in sec_lab._ROOMS else kind != "module"
    assert name in dir(sec_lab)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match=r"^module 'sec_lab' has no attribute 'no_such_name'$"):
        _ = sec_lab.no_such_name


@pytest.mark.parametrize("name", ["EventChain", "compare", "graphml", "observe_segments"])
def test_event_chain_is_the_function_whatever_was_used_before(name: str) -> None:
    # The room has the same name; importing it must not put the room in the place of the function.
    code = f"import sec_lab as s; s.{name}; import sec_lab.event_chain; print(type(s.event_chain).__name__)"
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "function\n"
    )
