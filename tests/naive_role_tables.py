"""Slow, obvious reference of role tables: dictionaries and loops over key frames, one step after the other.

A recording is, for each key frame, its number, the places of the segments that are there, and the codes of the pairs
that touch (2) or overlap (1).
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise

Place = tuple[float, ...]


@dataclass
class Moment:
    number: int
    places: dict[int, Place]
    touch: dict[frozenset[int], int] = field(default_factory=dict)

    def code(self, a: int, b: int) -> int:
        return self.touch.get(frozenset((a, b)), 0)


Movie = list[Moment]


def lasting(movie: Movie) -> list[float]:
    if len(movie) == 1:
        return [1.0]
    times = [float(b.number - a.number) for a, b in pairwise(movie)]
    ordered = sorted(times)
    middle = (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2
    times.append(middle)
    return [time / math.fsum(times) for time in times]


def segments(movie: Movie) -> list[int]:
    return sorted({label for moment in movie for label in moment.places})


def present(movie: Movie, label: int) -> list[bool]:
    return [label in moment.places for moment in movie]


def life(movie: Movie, label: int) -> float:
    return math.fsum(share for share, there in zip(lasting(movie), present(movie, label), strict=True) if there)


def path(movie: Movie, label: int) -> float:
    way = [moment.places[label] for moment in movie if label in moment.places]
    return math.fsum(math.dist(a, b) for a, b in pairwise(way))


def hand(movie: Movie) -> int | None:
    labels = segments(movie)
    touching = [a for a in labels if any(moment.code(a, b) == 2 for moment in movie for b in labels if b != a)]
    away = {a: (a not in movie[0].places, a not in movie[-1].places) for a in touching}
    for wanted in (all, any):
        candidates = [a for a in touching if wanted(away[a]) and (wanted is all or acts(movie, a))]
        if len(labels) > 1 and candidates:
            return max(candidates, key=lambda a: (path(movie, a), -a))
    return None


def acts(movie: Movie, label: int) -> bool:
    """Whether a touch begins or ends between two moments in which both are there."""
    return any(
        (before.code(label, other) == 2) != (after.code(label, other) == 2)
        for before, after in pairwise(movie)
        for other in before.places
        if other != label and {label, other} <= before.places.keys() & after.places.keys()
    )


def bridge(movie: Movie) -> Movie:
    """Every absence between two presences, moment by moment and pair by pair."""
    labels = segments(movie)
    alive = {label: [k for k, yes in enumerate(present(movie, label)) if yes] for label in labels}
    found = []
    for k, moment in enumerate(movie):
        seen = {
            label: max(at for at in alive[label] if at <= k)
            for label in labels
            if alive[label][0] <= k <= alive[label][-1]
        }
        places = {label: movie[at].places[label] for label, at in seen.items()}
        codes = {frozenset((a, b)): movie[min(seen[a], seen[b])].code(a, b) for a in seen for b in seen if a < b}
        found.append(Moment(moment.number, places, {pair: code for pair, code in codes.items() if code}))
    return found


def merged(movie: Movie, groups: list[list[int]]) -> Movie:
    """Each group under the label of its first member."""
    leader = {label: group[0] for group in groups for label in group}
    found = []
    for moment in movie:
        places: dict[int, Place] = {}
        for group in groups:
            here = [label for label in group if label in moment.places]
            if here:
                places[group[0]] = moment.places[here[0]]
        touch: dict[frozenset[int], int] = {}
        for pair, code in moment.touch.items():
            a, b = (leader[label] for label in pair)
            if a != b:
                touch[frozenset((a, b))] = max(code, touch.get(frozenset((a, b)), 0))
        found.append(Moment(moment.number, places, touch))
    return found


def without(movie: Movie, dropped: set[int]) -> Movie:
    return [
        Moment(
            moment.number,
            {label: place for label, place in moment.places.items() if label not in dropped},
            {pair: code for pair, code in moment.touch.items() if not pair & dropped},
        )
        for moment in movie
    ]


def untouched(movie: Movie) -> set[int]:
    touched = {label for moment in movie for pair in moment.touch for label in pair}
    return {label for label in segments(movie) if label not in touched}


def with_hand(movie: Movie, of: int, tolerance: float) -> list[int]:
    """The hand and what joins it."""
    return [of, *(label for joining in with_hand_by_rounds(movie, of, tolerance) for label in joining)]


def with_hand_by_rounds(movie: Movie, of: int, tolerance: float) -> list[list[int]]:
    """What joins the hand, round by round."""
    shares = lasting(movie)
    since = [math.fsum(shares[:k]) for k in range(len(shares) + 1)]
    group, rounds = [of], []
    while True:
        joining = []
        for label in segments(movie):
            there = present(movie, label)
            if label in group or there[0] or there[-1]:
                continue
            grouped = [any(one in moment.places for one in group) for moment in movie]
            ends = [(there.index(True), len(there) - 1 - there[::-1].index(True))]
            ends.append((grouped.index(True), len(grouped) - 1 - grouped[::-1].index(True)))
            together = any(abs(since[a] - since[b]) <= tolerance for a, b in zip(*ends, strict=True))
            both = math.fsum(share for share, a, b in zip(shares, there, grouped, strict=True) if a and b)
            shorter = min(life(movie, label), math.fsum(s for s, yes in zip(shares, grouped, strict=True) if yes))
            touches = any(moment.code(label, one) == 2 for moment in movie for one in group)
            if together or (both >= 0.8 * shorter - 1e-12 and touches):
                joining.append(label)
        if not joining:
            return rounds
        rounds.append(joining)
        group += joining


def worked_on(movie: Movie, of: int, others: set[int]) -> int | None:
    """What a segment touches: most changes, then most of them by coming or going, then longest, then last in order."""
    best: tuple[int, int, float, int] | None = None
    for order, label in enumerate(segments(movie)):
        touching = [moment.code(of, label) > 0 for moment in movie]
        if label in others or not any(touching):
            continue
        both = [of in moment.places and label in moment.places for moment in movie]
        changes = [k for k in range(1, len(movie)) if touching[k] != touching[k - 1]]
        coming = sum(not (both[k] and both[k - 1]) for k in changes)
        time = math.fsum(share for share, yes in zip(lasting(movie), touching, strict=True) if yes)
        best = max(best or (-1, -1, -1.0, -1), (len(changes), coming, time, order))
    return None if best is None else segments(movie)[best[3]]


def common_subsequence(a: tuple[int, ...], b: tuple[int, ...]) -> int:
    if not a or not b:
        return 0
    if a[0] == b[0]:
        return 1 + common_subsequence(a[1:], b[1:])
    return max(common_subsequence(a[1:], b), common_subsequence(a, b[1:]))
