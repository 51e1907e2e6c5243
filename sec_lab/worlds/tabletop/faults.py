"""What tracker faults do to the tabletop movies: ``python -m sec_lab.worlds.tabletop.faults FOLDER TARGET``.

The true tracks of every movie are broken and observed by the same rules as whole ones. Held against the chains of the
whole tracks: which action is recognised, which roles are found again, and what is learned of an action.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sec_lab.event_chain import EventChain
from sec_lab.files import write_whole
from sec_lab.observation import Observation
from sec_lab.worlds.tabletop.observed import TABLE, names_by_truth, role_names, true_depth_m
from sec_lab.worlds.tabletop.truth import Truth, read_truth
from sec_lab.worlds.tracker_faults import FAULTS, Fault, broken_tracks

if TYPE_CHECKING:
    import pandas as pd

RATES = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Faults of a segment in a hundred frames."""
REPEATS, SEED = 2, 31
TOLERANCE_PERCENT = 0.0


def observe_broken(
    true: Truth, fault: Fault, *, per_hundred_frames: float, rng: np.random.Generator
) -> tuple[Observation, int]:
    """Break the true tracks of a movie and observe them by the rules for whole ones.

    Parameters
    ----------
    true : Truth
    fault, per_hundred_frames, rng
        As in :func:`~sec_lab.worlds.tracker_faults.broken_tracks`.

    Returns
    -------
    observation : Observation
        Each segment has the name of the true one of which it covers most pixels.
    n_faults : int
    """
    from sec_lab.pipeline import observe
    from sec_lab.recording import Recording
    from sec_lab.segmentation import Segmentation

    labels, n_faults = broken_tracks(
        true.labels, fault, per_hundred_frames=per_hundred_frames, rng=rng, background=TABLE
    )
    names = names_by_truth(labels, true.labels, role_names(true.names))
    names.pop(0, None)
    segmentation = Segmentation.from_labels(labels, background=TABLE, names=names)
    pictures = np.zeros((*labels.shape, 3), np.uint8)
    seen = observe(Recording.from_frames(pictures, depth=true_depth_m(true)), segmentation=segmentation)
    # Label images stay behind: hundreds of them would not fit into memory.
    names = {segment: names[segment] for segment in seen.segments.tolist() if segment in names}
    return Observation(seen.graphs, seen.key_frames, names, "px"), n_faults


def judged(broken: Observation, whole: Observation, others: Mapping[str, EventChain]) -> dict[str, Any]:
    """Hold what is seen in broken tracks against what is seen in the whole ones, and against other movies.

    Parameters
    ----------
    broken, whole : Observation
        Of one movie; names say which true thing a segment is.
    others : mapping of str to EventChain
        Of the whole tracks of all other movies, without the table.

    Returns
    -------
    dict of str to float or str
        ``similarity`` with the whole chain in percent; ``roles_percent``: the share of the things in changing rows of
        the whole chain whose counterpart (§2.8) is the same thing, where ties do not count; and the ``nearest`` other
        movie, without the table, with which few of these movies are recognised. If nothing changes any more, both
        numbers are 0 and nothing is nearest.
    """
    from sec_lab.roles import corresponding_segments
    from sec_lab.similarity import compare

    chain, ideal = broken.chain, whole.chain
    if not len(chain.changing_rows):
        return {"similarity": 0.0, "nearest": "", "roles_percent": 0.0}
    own = compare(ideal, chain, tolerance_percent=TOLERANCE_PERCENT)
    things = np.unique(ideal.pairs[ideal.changing_rows]).tolist()
    partners = corresponding_segments(own, on_tie="omit")
    right = sum(broken.names.get(partners.get(thing, -1)) == whole.names.get(thing) for thing in things)
    bare, nearest = chain_without_table(broken), ""
    if bare is not None and others:
        similar = {
            name: compare(other, bare, tolerance_percent=TOLERANCE_PERCENT).temporal
            + compare(bare, other, tolerance_percent=TOLERANCE_PERCENT).temporal
            for name, other in others.items()
        }
        nearest = max(similar, key=lambda name: similar[name])
    return {
        "similarity": round(own.temporal, 2),
        "nearest": nearest,
        "roles_percent": round(100.0 * right / len(things), 2),
    }


def chain_without_table(seen: Observation) -> EventChain | None:
    """Chain without the table, or None where nothing changes in it."""
    from sec_lab.observation import without_segments

    if len(np.setdiff1d(seen.segments, [TABLE])) < 2:
        return None
    chain = without_segments(seen, [TABLE]).chain
    return chain if len(chain.changing_rows) else None


def model_similarity(broken: Sequence[EventChain], whole: Sequence[EventChain]) -> float:
    """Similarity, in percent, of what is learned from broken tracks of an action with what is learned from whole ones.

    0 where nothing can be learned from the broken ones.
    """
    from sec_lab.learning import learn
    from sec_lab.similarity import compare

    ideal = learn(list(whole), normalizer="longer", tolerance_percent=TOLERANCE_PERCENT).chain
    try:
        learned = learn(list(broken), normalizer="longer", tolerance_percent=TOLERANCE_PERCENT).chain
        return round(compare(ideal, learned).temporal, 2)
    except ValueError:
        return 0.0


def fault_study(
    folder: Path,
    *,
    movies: Sequence[str],
    rates: Sequence[float],
    repeats: int,
    seed: int,
    faults: Sequence[Fault] = FAULTS,
    n_jobs: int | None = None,
    progress: bool | None = None,
) -> tuple["pd.DataFrame", "pd.DataFrame"]:
    """Break all movies at all rates in all ways.

    Parameters
    ----------
    folder : Path
        Of the movies.
    movies : sequence of str
        Names of their folders; at least two of each action.
    rates : sequence of float
        Faults of a segment in a hundred frames; rate 0 is added as the reference.
    repeats, seed : int
        How often, and the seed of all random numbers.
    faults : sequence of str, optional
        Kinds of faults.
    n_jobs : int, optional
        As in :class:`joblib.Parallel`.
    progress : bool, optional
        Show a progress bar; where somebody watches if left out.

    Returns
    -------
    movies, models : pandas.DataFrame
        One row a broken movie, and one row a model.

    Raises
    ------
    ValueError
        If there is no rate or repeat, a fault is unknown, a rate is out of range, a movie is none of the tabletop
        movies, or there are fewer than two of an action.
    sec_lab.files.UnusableFileError
        If there is no such movie in the folder.

    Examples
    --------
    >>> movies = ["opening_book_1_laboratory", "opening_book_2_laboratory"]
    >>> broken, models = fault_study(
    ...     Path("datasets/tabletop_actions"), movies=movies, rates=[2.0], repeats=1, seed=1, faults=["vanish"]
    ... )
    >>> broken["fault"].tolist(), models["fault"].tolist()
    (['none', 'vanish', 'none', 'vanish'], ['vanish'])
    """
    import pandas as pd
    from joblib import Parallel, delayed
    from tqdm import tqdm

    if not movies:
        raise ValueError("movies: expected at least one, got none")
    if not len(rates) or not all(0 <= rate <= 100 for rate in rates):
        raise ValueError(f"rates: expected faults in a hundred frames, 0 to 100, got {list(rates)}")
    if not isinstance(repeats, int) or repeats < 1:
        raise ValueError(f"repeats: expected a whole number of at least 1, got {repeats!r}")
    for fault in faults:
        if fault not in FAULTS:
            raise ValueError(f"faults: expected some of {FAULTS}, got {fault!r}")
    actions = [action_of(name) for name in movies]
    numbers = [[seed, _number_of(name)] for name in movies]
    alone = [action for action in dict.fromkeys(actions) if actions.count(action) < 2]
    if alone:
        raise ValueError(f"movies: expected at least two of each action, got one of {alone[0]!r}")
    # Random numbers of its own for every movie, rate and repeat: leaving some out leaves the others as they are.
    tasks = [
        (folder / name, tuple(faults), tuple(rates), repeats, number)
        for name, number in zip(movies, numbers, strict=True)
    ]
    shown = sys.stderr.isatty() if progress is None else progress
    run = Parallel(n_jobs=n_jobs, return_as="generator")(delayed(_broken_chains)(*task) for task in tasks)
    found = dict(zip(movies, tqdm(run, total=len(tasks), unit="movie", disable=not shown), strict=True))
    whole = {name: chains.pop(("none", 0.0, 0))[0] for name, chains in found.items()}
    bare = {name: chain_without_table(seen) for name, seen in whole.items()}
    rows = []
    for name, chains in found.items():
        others = {other: chain for other, chain in bare.items() if other != name and chain is not None}
        for (fault, rate, repeat), (seen, n_faults) in {("none", 0.0, 0): (whole[name], 0), **chains}.items():
            chain = seen.chain
            row = {"movie": name, "fault": fault, "rate": rate, "repeat": repeat, "n_faults": n_faults}
            measured = judged(seen, whole[name], others)
            measured["recognised"] = int(
                measured["nearest"] != "" and action_of(measured["nearest"]) == action_of(name)
            )
            size = {"rows": len(chain.changing_rows), "columns": chain.relations.shape[1]}
            rows.append({**row, **size, **measured})
    models = []
    for action in dict.fromkeys(map(action_of, movies)):
        of_action = [name for name in movies if action_of(name) == action]
        for key in next(iter(found.values())):
            similarity = model_similarity(
                [found[name][key][0].chain for name in of_action], [whole[name].chain for name in of_action]
            )
            models.append(
                {"action": action, **dict(zip(("fault", "rate", "repeat"), key, strict=True)), "similarity": similarity}
            )
    return pd.DataFrame(rows), pd.DataFrame(models)


def action_of(movie: str) -> str:
    """What a movie shows, by the name of its folder.

    Examples
    --------
    >>> action_of("making_sandwich_1_laboratory")
    'making_sandwich'
    """
    return movie.rsplit("_", 2)[0]


def _number_of(movie: str) -> int:
    """Place of a movie among those of its setting."""
    from sec_lab.worlds.tabletop.actions import ACTIONS, VERSIONS

    known = [f"{action}_{version}" for action in ACTIONS for version in VERSIONS]
    if movie.rpartition("_")[0] not in known:
        raise ValueError(f"movies: expected names as {known[0]}_laboratory, got {movie!r}")
    return known.index(movie.rpartition("_")[0])


def _broken_chains(
    folder: Path, faults: Sequence[Fault], rates: Sequence[float], repeats: int, seed: list[int]
) -> dict[tuple[str, float, int], tuple[Observation, int]]:
    true = read_truth(folder)
    none = np.random.default_rng(0)
    seen, _ = observe_broken(true, "split", per_hundred_frames=0.0, rng=none)
    seen_in = {("none", 0.0, 0): (seen, 0)}
    for fault in faults:
        for rate in rates:
            for repeat in range(repeats):
                rng = np.random.default_rng([*seed, FAULTS.index(fault), round(100 * rate), repeat])
                broken, n_faults = observe_broken(true, fault, per_hundred_frames=rate, rng=rng)
                seen_in[fault, rate, repeat] = broken, n_faults
    return seen_in


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the tables ``movies.csv`` and ``models.csv`` in a folder.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process if left out.

    Returns
    -------
    int
        Exit code: 0, or 2 for bad input.
    """
    from sec_lab.worlds.tabletop.chains import movies_in

    parser = argparse.ArgumentParser(
        prog="python -m sec_lab.worlds.tabletop.faults",
        description="Break the true tracks of all tabletop movies of the laboratory, and measure what it does.",
        epilog="example: python -m sec_lab.worlds.tabletop.faults datasets/tabletop_actions datasets/tracker_faults",
    )
    parser.add_argument("folder", type=Path, help="where the movies are")
    parser.add_argument("target", type=Path, help="folder of the tables; it has to exist")
    parser.add_argument("--jobs", type=int, default=1, help="how many movies are observed at a time (default 1)")
    given = parser.parse_args(arguments)
    if given.jobs < 1:
        parser.error(f"argument --jobs: expected a number of at least 1, got {given.jobs}")
    try:
        movies = [path.name for path in movies_in(given.folder) if path.name.endswith("_laboratory")]
        tables = fault_study(given.folder, movies=movies, rates=RATES, repeats=REPEATS, seed=SEED, n_jobs=given.jobs)
        for name, table in zip(("movies", "models"), tables, strict=True):
            write_whole(given.target / f"{name}.csv", table.to_csv(index=False, lineterminator="\n"))
    except (ValueError, OSError) as problem:
        parser.exit(2, f"error: {problem}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
