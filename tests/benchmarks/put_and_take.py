"""What is learned from movies of putting and taking, and found in those that mix them: the figures of §2.9."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

import sec_lab as sl
from sec_lab.classification import unsupervised_classes
from sec_lab.finding import find_actions, has_contact
from sec_lab.learning import learn
from sec_lab.worlds.tabletop.chains import SOURCES, read_chains
from sec_lab.worlds.tabletop.deeds import TimedDeed, read_deeds
from sec_lab.worlds.tabletop.observed import observe_movie
from sec_lab.worlds.tabletop.put_and_take import N_VERSIONS
from sec_lab.worlds.tabletop.settings import SETTINGS
from sec_lab.worlds.tabletop.timing import timing_errors
from tests.benchmarks import movies

KINDS = ("putting", "taking")
TYPE_THRESHOLD_PERCENT = 64
READING: dict[str, Any] = {"normalizer": "shorter", "tolerance_percent": 10}
KEPT = movies.ROOT / "datasets" / "put_and_take"


@dataclass(frozen=True)
class Figures:
    """Numbers of movies or actions, the first out of the second; medians in frames."""

    classes: int
    with_their_type: tuple[int, int]
    right_model_wins: tuple[int, int]
    both_models: tuple[int, int]
    found: tuple[int, int]
    median_begin_error: float
    median_end_error: float
    superfluous: int

    def __str__(self) -> str:
        of = "{} of {}".format
        return (
            f"{self.classes} classes, {of(*self.with_their_type)} movies with their type; right model wins for "
            f"{of(*self.right_model_wins)}; both models ≥ {TYPE_THRESHOLD_PERCENT} % in {of(*self.both_models)} mixed; "
            f"found {of(*self.found)} actions, {self.superfluous} superfluous, median error of begin "
            f"{self.median_begin_error:g} and end {self.median_end_error:g} frames"
        )


def figures(chains: Mapping[str, sl.EventChain], deeds: Mapping[str, Sequence[TimedDeed]]) -> Figures:
    """Learn from the movies that show one action, and judge with all; keys are such as ``putting_3`` or ``mixed_1``."""
    shown = {name: name.partition("_")[0] for name in chains}
    alone = {kind: {name: one for name, one in chains.items() if shown[name] == kind} for kind in KINDS}
    single = {name: one for some in alone.values() for name, one in some.items()}
    classes = pd.Series(unsupervised_classes(sl.similarity_table(single, **READING)), index=list(single))
    sizes = pd.crosstab(classes, pd.Series(shown)[classes.index]).max()
    models = {kind: learn(some, **READING) for kind, some in alone.items()}
    like = pd.DataFrame(
        {
            kind: {name: sl.compare(model.chain, one, **READING).temporal for name, one in chains.items()}
            for kind, model in models.items()
        }
    )
    wins = [like.loc[name, shown[name]] > like.loc[name].drop(shown[name]).max() for name in single]
    mixed = like.drop(index=list(single))
    findable = {kind: model for kind, model in models.items() if has_contact(model)}
    errors = []
    for name, chain in chains.items():
        hits = find_actions(findable, chain) if findable else []
        found = [(one.model, one.begin, one.end) for one in hits if one.end is not None]
        errors.append(timing_errors(found, deeds[name]))
    every = pd.concat(errors)
    return Figures(
        classes=int(classes.max()) + 1,
        with_their_type=(int(sizes.sum()), len(single)),
        right_model_wins=(int(np.sum(wins)), len(single)),
        both_models=(int((mixed >= TYPE_THRESHOLD_PERCENT).all(axis=1).sum()), len(mixed)),
        found=(int(every["found_begin"].notna().sum()), len(every)),
        median_begin_error=float(every["begin_error"].abs().median()),
        median_end_error=float(every["end_error"].abs().median()),
        superfluous=sum(int(one.attrs["superfluous"]) for one in errors),
    )


@dataclass(frozen=True, eq=False)
class Seen:
    """Chains of movies of one setting, from ``pixels`` and from the ``truth``, and what happens in them."""

    chains: dict[str, dict[str, sl.EventChain]]
    deeds: dict[str, Sequence[TimedDeed]]


def kept() -> dict[str, Seen]:
    """What is kept beside the movies in ``datasets``."""
    found = {}
    for setting in SETTINGS:
        of = read_chains(KEPT, setting=setting)
        chains = {source: {name: one.chain for name, one in getattr(of, source).items()} for source in SOURCES}
        found[setting] = Seen(chains, {name: read_deeds(KEPT / f"{name}_{setting}") for name in of.actions})
    return found


def of_seeds(seeds: Sequence[int], n_movies: int | None, tell: Callable[[str], None]) -> dict[str, Seen]:
    """Rendered and observed now; the first ``n_movies`` of each seed, those of the laboratory first."""
    versions = range(1, 1 + max(N_VERSIONS.values()))
    names = [
        f"{action}_{version}_{setting}"
        for setting in SETTINGS
        for version in versions
        for action, n in N_VERSIONS.items()
        if version <= n
    ]
    found: dict[str, Seen] = {}
    for seed in seeds:
        folders = [movies.folder_of(seed) / name for name in names[:n_movies]]
        for folder in movies.rendered(seed, folders, tell):
            name, _, setting = folder.name.rpartition("_")
            seen = found.setdefault(f"{setting}, seed {seed}", Seen({source: {} for source in SOURCES}, {}))
            movie = observe_movie(folder)
            for source in SOURCES:
                seen.chains[source][name] = getattr(movie, source).chain
            seen.deeds[name] = read_deeds(folder)
    return found
