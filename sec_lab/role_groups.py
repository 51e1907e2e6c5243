"""Segments of several demonstrations grouped by the role that they play in the action (step 6B, Fig. 2.8)."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from sec_lab.event_chain import EventChain
from sec_lab.roles import corresponding_segments
from sec_lab.similarity import EFFORT, Normalizer, compare


@dataclass(frozen=True, eq=False)
class RoleGroups:
    """Groups of segments with one role each.

    Attributes
    ----------
    reference : str
        The demonstration to which the others were compared; each of its segments opens a group.
    members : mapping of int to mapping of str to int
        By segment of the reference: demonstration → the segment there that plays the same role, where one clearly
        does.
    """

    reference: str
    members: Mapping[int, Mapping[str, int]]

    def __post_init__(self) -> None:
        frozen = {segment: MappingProxyType(dict(group)) for segment, group in self.members.items()}
        object.__setattr__(self, "members", MappingProxyType(frozen))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.reference, {segment: dict(group) for segment, group in self.members.items()})


def role_groups(
    chains: Mapping[str, EventChain],
    *,
    reference: str | None = None,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    effort: int = EFFORT,
) -> RoleGroups:
    """Group the segments of demonstrations of one action by role (§2.8).

    Departure: §2.8 shows groups of four demonstrations but compares two. Here all are compared to one of them.

    Parameters
    ----------
    chains : mapping of str to EventChain
        By name of the demonstration; at least two.
    reference : str, optional
        The demonstration that the others are compared to, as ξ¹. If left out, the one that is most similar to the
        others on average, the first of several.
    normalizer, tolerance_percent, effort
        As in :func:`~sec_lab.similarity.compare`.

    Raises
    ------
    ValueError
        If there are fewer than two, the reference is none of them, or as in :func:`~sec_lab.similarity.compare`.

    Examples
    --------
    >>> rows = [[0, 2, 2], [0, 0, 2], [2, 0, 0]]
    >>> a, b = EventChain(rows, [(1, 2), (2, 3), (1, 3)]), EventChain(rows, [(4, 5), (5, 6), (4, 6)])
    >>> groups = role_groups({"one": a, "two": b})
    >>> groups.reference, [dict(group) for group in groups.members.values()]
    ('one', [{'one': 1, 'two': 4}, {'one': 2, 'two': 5}, {'one': 3, 'two': 6}])
    """
    names = list(chains)
    if len(names) < 2:
        raise ValueError(f"chains: expected at least two demonstrations, got {len(names)}")
    if reference is not None and reference not in chains:
        raise ValueError(f"reference: expected one of {names}, got {reference!r}")
    options: list[str] = names if reference is None else [reference]
    matches = {
        (a, b): compare(chains[a], chains[b], normalizer=normalizer, tolerance_percent=tolerance_percent, effort=effort)
        for a in options
        for b in names
        if a != b
    }
    similar = [float(np.mean([matches[a, b].temporal for b in names if a != b])) for a in options]
    chosen = options[int(np.argmax(similar))]
    members: dict[int, dict[str, int]] = {segment: {} for segment in chains[chosen].segments.tolist()}
    for name in names:
        roles = (
            {segment: segment for segment in members}
            if name == chosen
            else corresponding_segments(matches[chosen, name], on_tie="omit")
        )
        for segment, other in roles.items():
            members[segment][name] = other
    return RoleGroups(chosen, members)


def landed(
    groups: RoleGroups, chains: Mapping[str, EventChain], *, roles: Collection[str]
) -> dict[str, tuple[int, int]]:
    """How many segments with a known role land in the group of that role.

    Parameters
    ----------
    groups : RoleGroups
    chains : mapping of str to EventChain
        The same as in :func:`role_groups`; the names of their segments are the known roles.
    roles : collection of str
        Names that are looked for, in every demonstration but the reference.

    Returns
    -------
    dict of str to (int, int)
        By role: demonstrations in which a segment of this name is in a group that a segment of this name opened, and
        all demonstrations but the reference. A role without a segment has not landed.

    Examples
    --------
    >>> rows = [[0, 2, 2], [0, 0, 2]]
    >>> a = EventChain(rows, [(1, 2), (1, 3)], names={1: "table", 2: "cup", 3: "box"})
    >>> b = EventChain(rows, [(1, 2), (1, 3)], names={1: "table", 2: "cup", 3: "bowl"})
    >>> landed(role_groups({"one": a, "two": b}), {"one": a, "two": b}, roles=["cup", "box"])
    {'cup': (1, 1), 'box': (0, 1)}
    """
    names = chains[groups.reference].names
    others = [name for name in chains if name != groups.reference]
    found = {
        role: [
            any(
                chains[other].names.get(group[other]) == role
                for segment, group in groups.members.items()
                if names.get(segment) == role and other in group
            )
            for other in others
        ]
        for role in roles
    }
    return {role: (sum(hits), len(hits)) for role, hits in found.items()}
