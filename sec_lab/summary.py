"""What a collection of observations holds: sizes of the chains, and of what their rows tell."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation

if TYPE_CHECKING:
    import pandas as pd

RowKind = Literal["fragment", "comes or goes", "touching"]


def summary(observations: Mapping[str, Observation]) -> "pd.DataFrame":
    """Sizes of observations and of their event chains.

    Parameters
    ----------
    observations : mapping of str to Observation
        By name.

    Returns
    -------
    pandas.DataFrame
        One row an observation. ``key_frames`` that were recorded, ``segments``, ``fragments`` among them (recorded as
        no object), ``changing_rows`` of the chain, ``duration_frames`` from the first key frame to the last, and
        ``depth``: whether any position has a third coordinate other than 0.

    Raises
    ------
    ValueError
        If there is none, or nothing was recorded in one of them, or fewer than two segments.

    Examples
    --------
    >>> from sec_lab.scene_graph import SceneGraph
    >>> apart, touching = SceneGraph([1, 2], [[0, 0], [0, 0]]), SceneGraph([1, 2], [[0, 2], [2, 0]])
    >>> summary({"put": Observation([apart, touching], [4, 9], {1: "cup", 2: None})}).loc["put"].to_dict()
    {'key_frames': 2, 'segments': 2, 'fragments': 1, 'changing_rows': 1, 'duration_frames': 5, 'depth': False}
    """
    import pandas as pd

    if not observations:
        raise ValueError("summary: expected at least one observation, got none")
    rows = []
    for seen in observations.values():
        chain, segments, frames = seen.chain, seen.segments.tolist(), seen.recorded.key_frames
        rows.append(
            {
                "key_frames": len(frames),
                "segments": len(segments),
                "fragments": sum(_is_fragment(chain, segment) for segment in segments),
                "changing_rows": len(chain.changing_rows),
                "duration_frames": int(frames[-1] - frames[0]),
                "depth": _has_depth(seen),
            }
        )
    return pd.DataFrame(rows, index=pd.Index(observations))


def kinds_of_rows(chain: EventChain) -> list[RowKind]:
    """What each row of a chain that changes tells.

    Returns
    -------
    list of {"fragment", "comes or goes", "touching"}
        One for each of ``chain.changing_rows``: ``"fragment"`` if one of its segments is recorded as no object; else
        ``"comes or goes"`` if its two segments are always in the same relation while both are there, so that the row
        tells only when one of them is absent; else ``"touching"``, for their relation changes.

    Examples
    --------
    >>> chain = EventChain([[0, 2, 0], [0, 0, 9], [9, 2, 2]], [(1, 2), (1, 3), (2, 4)], names={4: None})
    >>> kinds_of_rows(chain)
    ['touching', 'comes or goes', 'fragment']
    """
    kinds: list[RowKind] = []
    for row in chain.changing_rows.tolist():
        relations = np.unique(chain.relations[row])
        if any(_is_fragment(chain, segment) for segment in chain.pairs[row].tolist()):
            kinds.append("fragment")
        elif len(relations[relations != Relation.ABSENT]) == 1:
            kinds.append("comes or goes")
        else:
            kinds.append("touching")
    return kinds


def row_kind_table(chains: Mapping[str, EventChain], classes: Mapping[str, str]) -> "pd.DataFrame":
    """Number of changing rows of each kind, for each type of manipulation.

    Parameters
    ----------
    chains : mapping of str to EventChain
        By name of the demonstration.
    classes : mapping of str to str
        Type of the manipulation that each of them shows.

    Returns
    -------
    pandas.DataFrame
        Row: type, and ``all``; columns ``"fragment"``, ``"comes or goes"``, ``"touching"`` as in :func:`kinds_of_rows`.

    Raises
    ------
    ValueError
        If there is no chain, or one has no class.

    Examples
    --------
    >>> chain = EventChain([[0, 2, 0], [0, 0, 9]], [(1, 2), (1, 3)])
    >>> row_kind_table({"x": chain, "y": chain}, {"x": "put", "y": "put"}).loc["put"].to_dict()
    {'fragment': 0, 'comes or goes': 2, 'touching': 2}
    """
    import pandas as pd

    if not chains:
        raise ValueError("chains: expected at least one, got none")
    missing = [name for name in chains if name not in classes]
    if missing:
        raise ValueError(f"classes: expected a type for every chain, got none for {missing[0]!r}")
    kinds = {name: kinds_of_rows(chain) for name, chain in chains.items()}
    counts = pd.DataFrame([[kinds[name].count(kind) for kind in get_args(RowKind)] for name in chains])
    counts.columns = pd.Index(get_args(RowKind))
    table = counts.groupby([classes[name] for name in chains], sort=False).sum()
    table.loc["all"] = counts.sum()
    return table


def _is_fragment(chain: EventChain, segment: int) -> bool:
    return chain.names.get(segment, "") is None


def _has_depth(observation: Observation) -> bool:
    positions = [graph.positions for graph in observation.recorded if graph.positions is not None]
    return any(bool(one.shape[1] > 2 and one[:, 2].any()) for one in positions)
