"""How notebooks are collected: on this interpreter's kernel, and recordings of others only where they lie."""

import os
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("JUPYTER_PREFER_ENV_PATH", "1")


class RecordingsMissing(pytest.Item):
    """Stands for a whole notebook whose recordings are not on this machine."""

    def runtest(self) -> None:
        pytest.skip(f"{self.name}: SEC_LAB_DATA is not set to the folder of the recordings")

    def reportinfo(self) -> tuple[Path, None, str]:
        return self.path, None, self.name


class SkippedNotebook(pytest.File):
    """A notebook that is passed over as a whole."""

    def collect(self) -> Iterator[pytest.Item]:
        yield RecordingsMissing.from_parent(self, name=self.path.name)


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> Generator[None, Any, Any]:
    collected = yield
    needs_recordings = file_path.suffix == ".ipynb" and file_path.name.startswith("real_recordings_")
    if collected and needs_recordings and not Path(os.environ.get("SEC_LAB_DATA") or "/dev/null").is_dir():
        return [SkippedNotebook.from_parent(parent, path=file_path)]
    return collected
