"""Movies with truth for the benches: the kept ones, others of seeds that are asked for, or a drawn one."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sec_lab.recording import Recording
from sec_lab.worlds import tabletop
from sec_lab.worlds.drawn import moving_object
from sec_lab.worlds.tabletop.truth import read_truth

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "datasets" / "tabletop_actions"
RENDERED = ROOT / "build" / "tabletop"

TABLE = 1
"""True label of the table in every tabletop movie."""


@dataclass(frozen=True, eq=False)
class Movie:
    """Decoded frames and what is true in them.

    ``pictures`` (n, height, width, 3) uint8, ``labels`` (n, height, width), ``depth_m`` likewise or None, and the whole
    recording, of both eyes where it has them.
    """

    name: str
    setting: str
    recording: Recording
    pictures: NDArray[np.uint8]
    labels: NDArray[np.uint8]
    depth_m: NDArray[np.float32] | None
    background: int

    @property
    def left(self) -> Recording:
        return Recording.from_frames(self.pictures, frames_per_second=self.recording.frames_per_second)


@dataclass(frozen=True)
class Source:
    """A movie that is read when it is needed, as all of them together may not fit into memory."""

    name: str
    setting: str
    open: Callable[[], Movie]


def in_folder(folder: Path, *, prefix: str = "") -> Source:
    setting = folder.name.rpartition("_")[2]
    return Source(prefix + folder.name, setting, partial(_read, folder, prefix + folder.name, setting))


def _read(folder: Path, name: str, setting: str) -> Movie:
    recording = Recording.open(folder / "left.mp4", right=folder / "right.mp4", calibration=folder / "calibration.json")
    truth = read_truth(folder)
    pictures = np.stack([frame.image for frame in Recording.open(folder / "left.mp4")])
    depth_m = (truth.depth_mm / 1000).astype(np.float32)
    return Movie(name, setting, recording, pictures, truth.labels, depth_m, TABLE)


def is_complete(folder: Path) -> bool:
    """Whether a movie is there; its calibration is written last."""
    return (folder / "calibration.json").is_file() and (folder / "truth.npz").is_file()


def in_order(folders: Iterator[Path]) -> list[Path]:
    """Version by version, so that the first few show every action in both settings."""

    def place(folder: Path) -> tuple[str, str]:
        action, version, setting = folder.name.rsplit("_", 2)
        return version, f"{action} {setting}"

    return sorted(folders, key=place)


def kept(folder: Path) -> list[Source]:
    """Movies that lie in a folder."""
    return [in_folder(one) for one in in_order(one for one in folder.glob("*_*_*") if is_complete(one))]


def of_seed(seed: int, n_movies: int | None, tell: Callable[[str], None]) -> list[Source]:
    """Movies of a seed, rendered now unless they were before by the same generator."""
    from sec_lab.worlds.tabletop.actions import ACTIONS, VERSIONS
    from sec_lab.worlds.tabletop.settings import SETTINGS

    target = folder_of(seed)
    names = (f"{action}_{version}_{setting}" for action in ACTIONS for version in VERSIONS for setting in SETTINGS)
    folders = rendered(seed, in_order(target / name for name in names)[:n_movies], tell)
    return [in_folder(folder, prefix=f"{seed}/") for folder in folders]


def folder_of(seed: int) -> Path:
    return RENDERED / f"seed_{seed}_{generator_digest()}"


def rendered(seed: int, folders: list[Path], tell: Callable[[str], None]) -> list[Path]:
    """Folders of movies of a seed, once all of them are there."""
    from sec_lab.worlds.tabletop.__main__ import main

    for number, folder in enumerate(folders):
        if not is_complete(folder):
            tell(f"rendering {number + 1} of {len(folders)}: {folder.relative_to(ROOT)} (about a minute)")
            action, version, setting = folder.name.rsplit("_", 2)
            options = ["--action", action, "--version", version, "--setting", setting, "--seed", str(seed)]
            assert main([str(folder.parent), *options]) == 0
    return folders


def generator_digest() -> str:
    """Changes with the source of the generator: movies of an older one are not taken for its own."""
    sources = sorted(Path(tabletop.__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:8]


def drawn() -> list[Source]:
    """A short movie of simple shapes with a little noise: enough to see that a bench runs."""
    return [Source(f"drawn {setting}", setting, partial(_draw, setting)) for setting in ("laboratory", "kitchen")]


def _draw(setting: str) -> Movie:
    movie = moving_object(1)
    labels = movie.labels[::6, ::2, ::2]
    rng = np.random.default_rng(7)
    noise = rng.normal(0, 4 if setting == "kitchen" else 2, (*labels.shape, 3))
    pictures = np.clip(movie.frames[::6, ::2, ::2] + noise, 0, 255).astype(np.uint8)
    recording = Recording.from_frames(pictures, frames_per_second=25)
    background = int(np.bincount(labels.ravel()).argmax())
    return Movie(f"drawn {setting}", setting, recording, pictures, labels, None, background)
