"""The chains that are kept beside the tabletop movies are what is seen in them now: a sample, observed anew."""

from pathlib import Path

import pytest

from sec_lab.chain_agreement import same_chain
from sec_lab.worlds.tabletop.actions import ACTIONS, VERSIONS
from sec_lab.worlds.tabletop.chains import CHAINS, movies_in, read_chains
from sec_lab.worlds.tabletop.observed import measures, observe_movie
from sec_lab.worlds.tabletop.settings import SETTINGS

FOLDER = Path(__file__).parents[2] / "datasets" / "tabletop_actions"
SAMPLE = ("making_sandwich_4_laboratory", "filling_liquid_2_kitchen")
"""Others than those that the notebook observes."""


def test_every_movie_has_its_chains() -> None:
    assert [movie.name for movie in movies_in(FOLDER)] == [
        f"{action}_{version}_{setting}" for setting in SETTINGS for action in ACTIONS for version in VERSIONS
    ]
    for setting in SETTINGS:
        kept = read_chains(FOLDER, setting=setting)
        assert list(kept.actions) == [f"{action}_{version}" for action in ACTIONS for version in VERSIONS]


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLE)
def test_a_sample_is_as_kept(name: str) -> None:
    """If this fails because the segmentation has changed: ``make chains``."""
    short, _, setting = name.rpartition("_")
    kept, seen = read_chains(FOLDER, setting=setting), observe_movie(FOLDER / name)
    assert same_chain(kept.truth[short].chain, seen.truth.chain)
    assert same_chain(kept.pixels[short].chain, seen.pixels.chain)
    assert dict(kept.pixels[short].names) == dict(seen.pixels.names)
    assert dict(kept.quality.loc[short]) == pytest.approx(measures(seen))
    assert (FOLDER / CHAINS / "pixels" / f"{name}.png").is_file()
