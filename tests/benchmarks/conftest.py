"""Options of the benches that need movies with truth: which, and how many."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.benchmarks import movies
from tests.benchmarks import put_and_take as put_and_take_movies
from tests.benchmarks.movies import Source


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("tabletop movies")
    group.addoption(
        "--seeds", type=_seeds, help="render tabletop movies of these seeds, such as 11,12, into build/ and take them"
    )
    group.addoption("--tabletop", type=Path, help="take the tabletop movies in this folder")
    group.addoption("--movies", type=_number, help="take only so many of each seed or folder")


def _seeds(text: str) -> list[int]:
    return [int(seed) for seed in text.split(",")]


def _number(text: str) -> int:
    if int(text) < 1:
        raise ValueError("expected at least 1")
    return int(text)


@pytest.fixture(scope="session")
def sources(pytestconfig: pytest.Config) -> list[Source]:
    """The movies that the options name; the kept ones without any; a drawn one where nothing is measured."""
    seeds, folder, n_movies = (pytestconfig.getoption(name, None) for name in ("--seeds", "--tabletop", "--movies"))
    if seeds:
        tell = _teller(pytestconfig)
        return [source for seed in seeds for source in movies.of_seed(seed, n_movies, tell)]
    if folder is None and pytestconfig.getoption("--benchmark-disable"):
        return movies.drawn()
    found = movies.kept(folder or movies.KEPT)[:n_movies]
    if not found:
        pytest.skip(f"{folder or movies.KEPT.relative_to(movies.ROOT)} holds no movies; --seeds 11 renders some")
    return found


@pytest.fixture(scope="session")
def put_and_take(pytestconfig: pytest.Config) -> dict[str, put_and_take_movies.Seen]:
    """What is seen in movies of putting and taking, by their setting and seed; the kept chains without ``--seeds``."""
    seeds, n_movies = (pytestconfig.getoption(name, None) for name in ("--seeds", "--movies"))
    if not seeds:
        return put_and_take_movies.kept()
    return put_and_take_movies.of_seeds(seeds, n_movies, _teller(pytestconfig))


def _teller(config: pytest.Config) -> Callable[[str], None]:
    """Writes a line to the terminal although outputs are captured."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    capture = config.pluginmanager.get_plugin("capturemanager")

    def tell(line: str) -> None:
        with capture.global_and_fixture_disabled():
            reporter.ensure_newline()
            reporter.write_line(line)

    return tell
