"""The chains that are kept beside the tabletop movies are what is seen in them now: a sample, observed anew."""

from pathlib import Path

import pytest

from sec_lab.chain_agreement import same_chain
from sec_lab.worlds.tabletop.actions import COLLECTIONS
from sec_lab.worlds.tabletop.chains import CHAINS, movies_in, read_chains
from sec_lab.worlds.tabletop.observed import measures, observe_movie
from sec_lab.worlds.tabletop.settings import SETTINGS

DATASETS = Path(__file__).parents[2] / "datasets"
SAMPLE = (
    ("tabletop_actions", "making_sandwich_4_laboratory"),
    ("tabletop_actions", "filling_liquid_2_kitchen"),
    ("put_and_take", "taking_7_laboratory"),
)
"""Others than those that the notebooks observe."""


@pytest.mark.parametrize("collection", COLLECTIONS)
def test_every_movie_has_its_chains(collection: str) -> None:
    folder = DATASETS / collection
    kept = {
        setting: [f"{action}_{version}" for action, versions in COLLECTIONS[collection].items() for version in versions]
        for setting in SETTINGS
    }
    assert [movie.name for movie in movies_in(folder)] == [
        f"{movie}_{setting}" for setting, movies in kept.items() for movie in movies
    ]
    for setting, movies in kept.items():
        assert list(read_chains(folder, setting=setting).actions) == movies


@pytest.mark.slow
@pytest.mark.parametrize(("collection", "name"), SAMPLE)
def test_a_sample_is_as_kept(collection: str, name: str) -> None:
    """If this fails because the segmentation has changed: ``make chains``."""
    folder = DATASETS / collection
    short, _, setting = name.rpartition("_")
    kept, seen = read_chains(folder, setting=setting), observe_movie(folder / name)
    assert same_chain(kept.truth[short].chain, seen.truth.chain)
    assert same_chain(kept.pixels[short].chain, seen.pixels.chain)
    assert dict(kept.pixels[short].names) == dict(seen.pixels.names)
    assert dict(kept.quality.loc[short]) == pytest.approx(measures(seen))
    assert (folder / CHAINS / "pixels" / f"{name}.png").is_file()
