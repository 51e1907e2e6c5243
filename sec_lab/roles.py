"""Segments that play the same role in two manipulations (step 6B, §2.8).

Corresponding rows say which pairs of segments correspond; counting which label occurs with which other label in them
says which segments do.
"""

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sec_lab.similarity import Match

OnTie = Literal["raise", "omit"]
Votes = NDArray[np.float64]


class AmbiguousRoleError(ValueError):
    """Some segments play the same role as several others, and nothing tells these apart.

    Attributes
    ----------
    solved : dict of int to int
        Segments of the first chain whose role is clear, and their counterparts.
    ambiguous : dict of int to tuple of int
        The other segments of the first chain, and the counterparts that are equally good.
    """

    def __init__(self, solved: Mapping[int, int], ambiguous: Mapping[int, tuple[int, ...]]) -> None:
        self.solved = dict(solved)
        self.ambiguous = dict(ambiguous)
        ties = "; ".join(f"{a} ≈ {' or '.join(map(str, options))}" for a, options in self.ambiguous.items())
        super().__init__(f"roles: expected one counterpart a segment, got {ties}")

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.solved, self.ambiguous)


def corresponding_segments(match: Match, *, on_tie: OnTie = "raise") -> dict[int, int]:
    """Segments of the first chain and those that play the same role in the second (§2.8).

    Parameters
    ----------
    match : Match
        Of :func:`~sec_lab.similarity.compare`; its corresponding rows are counted.
    on_tie : {"raise", "omit"}, optional
        What happens to segments with several equally good counterparts.

    Returns
    -------
    dict of int to int
        Segment of ``match.a`` → segment of ``match.b``; one to one. Segments in no corresponding row are left out.

    Raises
    ------
    AmbiguousRoleError
        If ties remain and are not to be left out; it carries what was solved.
    ValueError
        If ``on_tie`` is unknown.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.similarity import compare
    >>> a = EventChain([[0, 2, 2], [0, 0, 2], [2, 0, 0]], [(1, 2), (2, 3), (1, 3)])
    >>> b = EventChain([[0, 0, 2], [2, 0, 0], [0, 2, 2]], [(5, 6), (4, 6), (4, 5)])
    >>> corresponding_segments(compare(a, b))
    {1: 4, 2: 5, 3: 6}
    """
    if on_tie not in get_args(OnTie):
        raise ValueError(f"on_tie: expected one of {get_args(OnTie)}, got {on_tie!r}")
    segments_a, segments_b = match.a.segments, match.b.segments
    votes = role_votes(match)
    tie_break = _second_highest_votes(match)
    partner = np.full(len(segments_a), -1)
    _settle(votes, votes, partner)
    # The thesis's remedy for a tie: count again over the second highest similarities.
    _settle(votes, np.where(votes > 0, tie_break, -1.0), partner)
    _settle(votes, votes, partner)
    solved = {int(segments_a[i]): int(segments_b[j]) for i, j in enumerate(partner) if j >= 0}
    ambiguous = {
        int(segments_a[i]): tuple(segments_b[options].tolist()) for i, options in _best_options(votes, partner).items()
    }
    if ambiguous and on_tie == "raise":
        raise AmbiguousRoleError(solved, ambiguous)
    return solved


def role_votes(match: Match) -> Votes:
    """How often each segment of the first chain meets each segment of the second in corresponding rows (§2.8).

    Rows of a chain that are identical could be exchanged without any loss, so they share their votes: a count that
    rests on the choice between them would be a guess.

    Parameters
    ----------
    match : Match

    Returns
    -------
    (n_segments of a, n_segments of b) float64
        In the order of ``match.a.segments`` and ``match.b.segments``.
    """
    shared_a, shared_b = (_share_of_identical_rows(chain.relations) for chain in (match.a, match.b))
    rows_a, rows_b = match.rows.T
    correspondence = np.zeros((len(match.a.pairs), len(match.b.pairs)))
    correspondence[rows_a, rows_b] = 1.0
    return _count(match, shared_a @ correspondence @ shared_b)


def _second_highest_votes(match: Match) -> Votes:
    """The same count over the second highest similarities of each corresponding row (§2.8)."""
    correspondence = np.zeros((len(match.a.pairs), len(match.b.pairs)))
    changing = {int(row): i for i, row in enumerate(match.a.changing_rows)}
    for row in match.rows[:, 0].tolist():
        similarity = match.row_similarity[changing[row]]
        lower = similarity[similarity < similarity.max()]
        if lower.size and lower.max() > 0:
            second = np.flatnonzero(similarity == lower.max())
            correspondence[row, match.b.changing_rows[second]] = 1.0 / len(second)
    return _count(match, correspondence)


def _count(match: Match, correspondence: NDArray[np.float64]) -> Votes:
    """Votes of segment pairs out of (fractional) correspondences of all rows."""
    incident_a, incident_b = (
        (chain.segments[:, None, None] == chain.pairs).any(axis=2).astype(float) for chain in (match.a, match.b)
    )
    votes: Votes = incident_a @ correspondence @ incident_b.T
    # Shares like 1/3 + 1/3 + 1/3 must tie with 1.
    return np.round(votes, 9)


def _share_of_identical_rows(relations: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Matrix that spreads what a row has evenly over all rows identical to it."""
    _, kind = np.unique(relations, axis=0, return_inverse=True)
    same = kind[:, None] == kind
    shares: NDArray[np.float64] = same / same.sum(axis=1)
    return shares


def _settle(votes: Votes, ranking: Votes, partner: NDArray[np.int64]) -> None:
    """Fix all partners that are clear, those with most votes first, until nothing is clear any more.

    Departure: a role is played once, so a counterpart that is clearly taken by another segment is no option any more
    (§2.8 does not say so). Without this the two ends of a single row could never be told apart.
    """
    while True:
        options = _best_options(votes, partner, ranking)
        clear = {i: int(best[0]) for i, best in options.items() if len(best) == 1}
        fixed = False
        for i, j in clear.items():
            rivals = [other for other, best in options.items() if other != i and j in best]
            if all((votes[other, j], ranking[other, j]) < (votes[i, j], ranking[i, j]) for other in rivals):
                partner[i] = j
                fixed = True
        if not fixed:
            return


def _best_options(
    votes: Votes, partner: NDArray[np.int64], ranking: Votes | None = None
) -> dict[int, NDArray[np.intp]]:
    """For every segment without a partner the free counterparts with most votes, then highest in the ranking."""
    free = ~np.isin(np.arange(votes.shape[1]), partner[partner >= 0])
    options: dict[int, NDArray[np.intp]] = {}
    for i in np.flatnonzero(partner < 0):
        open_votes = np.where(free, votes[i], 0.0)
        if open_votes.max(initial=0.0) > 0:
            best = np.flatnonzero(open_votes == open_votes.max())
            if ranking is not None:
                best = best[ranking[i, best] == ranking[i, best].max()]
            options[int(i)] = best
    return options
