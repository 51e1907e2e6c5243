"""Which of the repository's movies is most like a chain."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import sec_lab
from sec_lab.event_chain import EventChain
from sec_lab.graphml import read_chain
from sec_lab.similarity import compare

if TYPE_CHECKING:
    import pandas as pd

_FOLDERS = {
    "moving_object": "drawn",
    "tabletop_actions/chains/truth": "tabletop",
    "put_and_take/chains/truth": "put and take",
}


def repository_chains(root: Path | None = None) -> dict[str, EventChain]:
    """Chains of the movies in the repository, from their true segments, by what the movie is called.

    Parameters
    ----------
    root : Path, optional
        Folder ``datasets``; that of the checkout if left out.

    Returns
    -------
    dict of str to EventChain

    Raises
    ------
    ValueError
        If there is no such folder, or no chain in it.

    Examples
    --------
    >>> len([name for name in repository_chains() if "making sandwich" in name])
    8
    """
    folder = Path(sec_lab.__file__).parents[1] / "datasets" if root is None else root
    chains = {
        f"{path.stem.replace('_', ' ')} ({kind})": read_chain(path)
        for place, kind in _FOLDERS.items()
        for path in sorted((folder / place).glob("*.graphml"))
    }
    if not chains:
        raise ValueError(f"{folder}: expected the data sets of a checkout, but found no chain")
    return chains


def nearest(
    chain: EventChain, chains: Mapping[str, EventChain], *, tell: Callable[[int, int | None], object] | None = None
) -> "pd.DataFrame":
    """Similarity of a chain to others in percent, highest first.

    Parameters
    ----------
    chain : EventChain
        ξ¹ of each comparison (§2.6): its rows look for partners.
    chains : mapping of str to EventChain
        Others by name.
    tell : callable, optional
        Called before each comparison with how many are done, and how many there are; may raise to stop.

    Returns
    -------
    pandas.DataFrame
        Rows by name; ``temporal`` and ``spatial`` in percent, ``exact`` whether no permutation is better.

    Examples
    --------
    >>> one, other = EventChain([[0, 2, 1]], [(2, 1)]), EventChain([[0, 2]], [(2, 1)])
    >>> nearest(one, {"other": other, "same": one}).index.tolist()
    ['same', 'other']
    """
    import pandas as pd

    rows = {}
    for done, (name, other) in enumerate(chains.items()):
        if tell is not None:
            tell(done, len(chains))
        match = compare(chain, other)
        rows[name] = {"temporal": match.temporal, "spatial": match.spatial, "exact": match.exact}
    table = pd.DataFrame.from_dict(rows, orient="index")
    return table.sort_values(["temporal", "spatial"], ascending=False, kind="stable").rename_axis(index="movie")
