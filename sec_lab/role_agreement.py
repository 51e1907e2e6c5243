"""Whether segments that play the same role carry the same name (step 6B, §2.8, held against recorded names).

Roles are found from relations alone. Where somebody wrote down what each segment is, the names can be held against
them. This is no measure of right and wrong: in two demonstrations of one manipulation the same role may be played by
different objects (§2.8 makes a point of it), and two hands have one name. So the share of equal names is given beside
what chance gives and what no assignment could surpass.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from sec_lab.event_chain import EventChain
from sec_lab.roles import AmbiguousRoleError, corresponding_segments
from sec_lab.similarity import EFFORT, Match, Normalizer, compare

if TYPE_CHECKING:
    import pandas as pd

Matches = Mapping[tuple[str, str], Match]

NO_OBJECT = "no object"
"""Stands for the name of a segment that is recorded as no object (a fragment), or of which no name is known."""


@dataclass(frozen=True)
class RoleCounts:
    """How the roles of one match agree with the names.

    Attributes
    ----------
    n_segments : int
        Segments of the first chain.
    n_found : int
        Those with one clear counterpart in the second chain.
    n_ambiguous : int
        Those with several equally good counterparts.
    n_named : int
        Those with a clear counterpart where both have a name: only these are judged.
    n_same : int
        Those of them where both names are the same.
    by_chance : float
        Expected ``n_same`` if the same segments were given counterparts at random, each its own, out of all segments of
        the second chain that have a name.
    at_best : int
        Largest ``n_same`` that any such assignment reaches.
    """

    n_segments: int
    n_found: int
    n_ambiguous: int
    n_named: int
    n_same: int
    by_chance: float
    at_best: int


def role_counts(match: Match, *, not_judged: Collection[str] = ()) -> RoleCounts:
    """Hold the corresponding segments of a match against the names of the segments.

    Parameters
    ----------
    match : Match
        Of two chains with names.
    not_judged : collection of str, optional
        Names that count as if no name had been recorded, in both chains: with ``{"Hand", "Arm"}`` only things are
        judged.

    Returns
    -------
    RoleCounts

    Examples
    --------
    >>> rows = [[0, 2, 2], [0, 0, 2], [2, 0, 0]]
    >>> a = EventChain(rows, [(1, 2), (2, 3), (1, 3)], names={1: "cup", 2: "hand", 3: "box"})
    >>> b = EventChain(rows, [(4, 5), (5, 6), (4, 6)], names={4: "cup", 5: "hand", 6: "bowl"})
    >>> counts = role_counts(compare(a, b))
    >>> counts.n_named, counts.n_same, round(counts.by_chance, 2), counts.at_best
    (3, 2, 0.67, 2)
    """
    partner, n_ambiguous = _clear_roles(match)
    passed_over = {None, *not_judged}
    named = [(x, y) for x, y in _names_of(match, partner) if x not in passed_over and y not in passed_over]
    all_b = Counter(name for name in map(match.b.names.get, match.b.segments.tolist()) if name not in passed_over)
    named_a = Counter(x for x, _ in named)
    return RoleCounts(
        n_segments=len(match.a.segments),
        n_found=len(partner),
        n_ambiguous=n_ambiguous,
        n_named=len(named),
        n_same=sum(x == y for x, y in named),
        by_chance=sum(all_b[x] for x, _ in named) / all_b.total() if named else 0.0,
        at_best=(named_a & all_b).total(),
    )


def matches_within(
    chains: Mapping[str, EventChain],
    classes: Mapping[str, str],
    *,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    effort: int = EFFORT,
) -> dict[tuple[str, str], Match]:
    """Compare all manipulations of the same type with each other, in both directions.

    Parameters
    ----------
    chains : mapping of str to EventChain
        By name of the demonstration.
    classes : mapping of str to str
        Type of the manipulation that each of them shows.
    normalizer, tolerance_percent, effort
        As in :func:`~sec_lab.similarity.compare`.

    Returns
    -------
    dict of (str, str) to Match
        By the names of ξ¹ and ξ².

    Raises
    ------
    ValueError
        If a demonstration has no class, or as in :func:`~sec_lab.similarity.compare`.

    Examples
    --------
    >>> chain = EventChain([[0, 2]], [(1, 2)])
    >>> list(matches_within({"x": chain, "y": chain, "z": chain}, {"x": "put", "y": "put", "z": "take"}))
    [('x', 'y'), ('y', 'x')]
    """
    missing = [name for name in chains if name not in classes]
    if missing:
        raise ValueError(f"classes: expected a type for every demonstration, got none for {missing[0]!r}")
    return {
        (a, b): compare(chains[a], chains[b], normalizer=normalizer, tolerance_percent=tolerance_percent, effort=effort)
        for a, b in permutations(chains, 2)
        if classes[a] == classes[b]
    }


def agreement_table(
    matches: Matches, classes: Mapping[str, str], *, not_judged: Collection[str] = ()
) -> "pd.DataFrame":
    """Sum :func:`role_counts` over the matches of each type of manipulation.

    Parameters
    ----------
    matches : mapping of (str, str) to Match
        Of :func:`matches_within`.
    classes : mapping of str to str
        Type of the manipulation of each demonstration; that of ξ¹ counts.
    not_judged : collection of str, optional
        As in :func:`role_counts`.

    Returns
    -------
    pandas.DataFrame
        One row a type, and ``all``. Numbers: ``pairs`` of demonstrations, ``segments`` of ξ¹ in them, and ``named``
        (those that are judged). Shares in percent: ``ambiguous_pairs`` of the pairs; ``found`` and ``ambiguous``
        of the segments; of the named ones ``same`` name, the same ``by_chance`` and ``at_best`` (NaN if none is named).

    Raises
    ------
    ValueError
        If there is no match.

    Examples
    --------
    >>> chain = EventChain([[0, 2], [0, 2]], [(1, 2), (1, 3)], names={1: "hand", 2: "cup", 3: "box"})
    >>> table = agreement_table({("x", "y"): compare(chain, chain)}, {"x": "put"})
    >>> table.loc["put", ["found", "same"]].round().tolist()
    [33.0, 100.0]
    """
    import pandas as pd

    if not matches:
        raise ValueError("roles: expected at least one match, got none")
    counts = pd.DataFrame([asdict(role_counts(match, not_judged=not_judged)) for match in matches.values()])
    counts["ambiguous_pairs"] = counts["n_ambiguous"] > 0
    counts["pairs"] = 1
    of_a = [classes[a] for a, _ in matches]
    sums = counts.groupby(of_a, sort=False).sum()
    sums.loc["all"] = counts.sum()
    named = sums["n_named"].replace(0, np.nan)
    return pd.DataFrame(
        {
            "pairs": sums["pairs"].astype(int),
            "ambiguous_pairs": 100.0 * sums["ambiguous_pairs"] / sums["pairs"],
            "segments": sums["n_segments"].astype(int),
            "found": 100.0 * sums["n_found"] / sums["n_segments"],
            "ambiguous": 100.0 * sums["n_ambiguous"] / sums["n_segments"],
            "named": sums["n_named"].astype(int),
            "same": 100.0 * sums["n_same"] / named,
            "by_chance": 100.0 * sums["by_chance"] / named,
            "at_best": 100.0 * sums["at_best"] / named,
        }
    )


def name_table(matches: Matches | Sequence[Match]) -> "pd.DataFrame":
    """How often a segment of each name plays the role of a segment of each name.

    Parameters
    ----------
    matches : mapping or sequence of Match

    Returns
    -------
    pandas.DataFrame
        Row: name in ξ¹, column: name in ξ², both in the order of their frequency, segments that are no object last;
        counts over all matches.

    Raises
    ------
    ValueError
        If no segment has a clear counterpart.

    Examples
    --------
    >>> a = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (1, 3)], names={1: "hand", 2: "cup", 3: "box"})
    >>> b = EventChain([[0, 2, 2], [0, 0, 2]], [(4, 5), (4, 6)], names={4: "hand", 5: "box"})
    >>> name_table([compare(a, b)])
    ξ²         hand  box  cup  no object
    ξ¹
    hand          1    0    0          0
    box           0    0    0          1
    cup           0    1    0          0
    no object     0    0    0          0
    """
    import pandas as pd

    listed = matches.values() if isinstance(matches, Mapping) else matches
    pairs = Counter(
        (x or NO_OBJECT, y or NO_OBJECT) for match in listed for x, y in _names_of(match, _clear_roles(match)[0])
    )
    if not pairs:
        raise ValueError("roles: expected a segment with a clear counterpart, got none")
    frequency: Counter[str] = Counter()
    for (x, y), count in pairs.items():
        frequency[x] += count
        frequency[y] += count
    order = sorted(frequency, key=lambda name: (name == NO_OBJECT, -frequency[name]))
    counts = [[pairs[x, y] for y in order] for x in order]
    return pd.DataFrame(counts, index=pd.Index(order, name="ξ¹"), columns=pd.Index(order, name="ξ²"))


def _clear_roles(match: Match) -> tuple[dict[int, int], int]:
    """Counterparts of the segments that have one, and the number of those with several equally good ones."""
    try:
        return corresponding_segments(match), 0
    except AmbiguousRoleError as error:
        return error.solved, len(error.ambiguous)


def _names_of(match: Match, partner: Mapping[int, int]) -> list[tuple[str | None, str | None]]:
    return [(match.a.names.get(a), match.b.names.get(b)) for a, b in partner.items()]
