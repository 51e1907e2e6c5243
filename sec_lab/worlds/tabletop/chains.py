"""Chains of the tabletop movies, kept beside them: ``python -m sec_lab.worlds.tabletop.chains FOLDER``.

To observe all movies takes minutes; what is seen in them is small. So it is kept: the observations from pixels and from
the truth as GraphML, portraits of their segments, and a table of how good they are.
"""

import argparse
import io
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from sec_lab.files import UnusableFileError, read_whole, write_whole
from sec_lab.graphml import documents
from sec_lab.observation import Observation
from sec_lab.worlds.tabletop.observed import ObservedMovie, measures, observe_movie
from sec_lab.worlds.tabletop.portraits import Portrait, portrait, read_portraits, write_portraits

if TYPE_CHECKING:
    import pandas as pd

CHAINS, QUALITY, SUMS = "chains", "quality.csv", "SHA256SUMS"
SOURCES = ("pixels", "truth")


@dataclass(frozen=True, eq=False)
class StoredChains:
    """What is kept of all movies of one setting; the keys are names of movies without their setting.

    Attributes
    ----------
    pixels, truth : dict of str to Observation
        With names of roles.
    actions : dict of str to str
        What each movie shows.
    quality : pandas.DataFrame
        One row a movie, see :func:`~sec_lab.worlds.tabletop.observed.measures`.
    folder : Path
        Where they are.
    setting : str
    """

    pixels: dict[str, Observation]
    truth: dict[str, Observation]
    actions: dict[str, str]
    quality: "pd.DataFrame"
    folder: Path
    setting: str

    def portraits(self, source: str) -> dict[str, dict[int, Portrait]]:
        """Portraits of the segments of every movie, from ``"pixels"`` or from the ``"truth"``."""
        return {
            name: read_portraits(self.folder / source / f"{name}_{self.setting}.png", seen.segments.tolist())
            for name, seen in getattr(self, source).items()
        }


def store_movie(folder: Path) -> dict[str, float | int | str]:
    """Observe a movie and write its chains and portraits; its row of the table is returned.

    Parameters
    ----------
    folder : Path
        Of the movie; the chains go into the folder ``chains`` beside it.
    """
    movie = observe_movie(folder)
    _write(folder.parent / CHAINS, movie)
    return {"movie": folder.name, **measures(movie)}


def _write(target: Path, movie: ObservedMovie) -> None:
    for source, labels in (("pixels", movie.labels), ("truth", movie.true.labels)):
        seen: Observation = getattr(movie, source)
        (target / source).mkdir(parents=True, exist_ok=True)
        documents.write(target / source / f"{movie.folder.name}.graphml", seen, dialect="standard")
        portraits = [portrait(segment, labels, movie.pictures) for segment in seen.segments.tolist()]
        write_portraits(target / source / f"{movie.folder.name}.png", portraits)


def read_chains(folder: Path, *, setting: str) -> StoredChains:
    """Read the chains of all movies of one setting.

    Parameters
    ----------
    folder : Path
        Of the movies.
    setting : {"laboratory", "kitchen"}

    Raises
    ------
    UnusableFileError
        If something is missing or damaged, or there is nothing of this setting.

    Examples
    --------
    >>> read_chains(Path("no/such/folder"), setting="kitchen")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder/chains/quality.csv: expected a table of movies, but there is no such
    file
    """
    import pandas as pd

    target = folder / CHAINS
    path = target / QUALITY
    content = read_whole(path, expected="a table of movies")
    try:
        table = pd.read_csv(io.BytesIO(content)).set_index("movie")
    except (ValueError, KeyError) as error:
        raise UnusableFileError(f"{path}: expected a table of movies, but it is damaged ({error})") from error
    names = [str(name).rpartition("_")[0] for name in table.index if str(name).endswith(f"_{setting}")]
    if not names:
        raise UnusableFileError(f"{path}: expected movies of the setting {setting!r}, got none")
    quality = table.loc[[f"{name}_{setting}" for name in names]].set_axis(names, axis=0).rename_axis("movie")
    pixels, truth = (
        {name: documents.read_observation(target / source / f"{name}_{setting}.graphml") for name in names}
        for source in SOURCES
    )
    actions = {name: name.rpartition("_")[0].replace("_", " ") for name in names}
    return StoredChains(pixels, truth, actions, quality, target, setting)


def main(arguments: Sequence[str] | None = None) -> int:
    """Observe movies and keep what is seen.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process if left out.

    Returns
    -------
    int
        Exit code: 0, or 2 for bad input.
    """
    parser = argparse.ArgumentParser(
        prog="python -m sec_lab.worlds.tabletop.chains",
        description="Observe all tabletop movies of a folder; chains, portraits and the table go into its folder "
        "chains.",
        epilog="example: python -m sec_lab.worlds.tabletop.chains datasets/tabletop_actions --jobs 2",
    )
    parser.add_argument("folder", type=Path, help="where the movies are, each in a folder of its own")
    parser.add_argument("--jobs", type=int, default=1, help="how many movies are observed at a time (default 1)")
    given = parser.parse_args(arguments)
    if given.jobs < 1:
        parser.error(f"argument --jobs: expected a number of at least 1, got {given.jobs}")
    try:
        _store(given.folder, jobs=given.jobs)
    except (ValueError, OSError) as problem:
        parser.exit(2, f"error: {problem}\n")
    return 0


def movies_in(folder: Path) -> list[Path]:
    """Folders of complete movies, in the order of the thesis.

    Raises
    ------
    UnusableFileError
        If there is none.
    """
    from sec_lab.worlds.tabletop.actions import ALL_VERSIONS
    from sec_lab.worlds.tabletop.settings import SETTINGS

    names = [
        f"{action}_{version}_{setting}"
        for setting in SETTINGS
        for action, versions in ALL_VERSIONS.items()
        for version in versions
    ]
    found = [folder / name for name in names if (folder / name / "calibration.json").is_file()]
    if not found:
        raise UnusableFileError(f"{folder}: expected folders of movies, got none")
    return found


def _store(folder: Path, *, jobs: int) -> None:
    import pandas as pd
    from joblib import Parallel, delayed
    from tqdm import tqdm

    movies = movies_in(folder)
    done = Parallel(n_jobs=min(jobs, len(movies)), return_as="generator")(
        delayed(store_movie)(movie) for movie in movies
    )
    rows = list(tqdm(done, total=len(movies), unit="movie", disable=not sys.stderr.isatty()))
    write_whole(folder / CHAINS / QUALITY, pd.DataFrame(rows).to_csv(index=False, lineterminator="\n"))
    write_sums(folder / CHAINS)


def write_sums(target: Path) -> None:
    """Write the sha256 of all files below a folder into one beside them, as ``sha256sum --check`` reads it."""
    files = sorted(path for path in target.rglob("*") if path.is_file() and path.name != SUMS)
    lines = [f"{sha256(path.read_bytes()).hexdigest()}  {path.relative_to(target).as_posix()}\n" for path in files]
    write_whole(target / SUMS, "".join(lines))


if __name__ == "__main__":
    sys.exit(main())
