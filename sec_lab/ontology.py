"""Manipulations told by rule, as a small tree over touching and letting go (after Wörgötter et al. 2013).

Wörgötter, Aksoy, Krüger, Piater, Ude and Tamosiunaite (IEEE Transactions on Autonomous Mental Development 5, 2013)
order fewer than 30 fundamental manipulations in a tree by when hand, tool and object touch and untouch. Here it is a
decision on one role table, without any training.

# Departure: what the tree tells apart by how things move or lie (pushing or pulling, on top or inside, cutting or
# chopping) is not in a role table and stays in one leaf.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sec_lab.codes import Relation
from sec_lab.role_tables import RoleTable
from sec_lab.role_tables.table import as_role_table

if TYPE_CHECKING:
    import pandas as pd

    from sec_lab.classification import Classes


@dataclass(frozen=True)
class Leaf:
    """One kind of manipulation.

    Attributes
    ----------
    group : str
        What the kind belongs to: hand only, separation, release (something was brought together) or tool.
    what : str
        What happens.
    examples : tuple of str
        Manipulations that end here.
    """

    group: str
    what: str
    examples: tuple[str, ...]


LEAVES: Mapping[str, Leaf] = {
    "move": Leaf("hand only", "the hand moves a thing that touches no other one", ("push", "pull", "lift", "shake")),
    "move together": Leaf("hand only", "the hand moves two things that stay in touch", ("carry on a tray",)),
    "uncover": Leaf("separation", "a thing comes into sight under the one that is taken", ("uncover", "open")),
    "take apart": Leaf("separation", "a thing is taken off another one", ("take down", "take out", "push from")),
    "hide": Leaf("release", "a thing vanishes under the one that is put", ("hide", "cover", "close")),
    "put together": Leaf("release", "a thing is brought to another one and stays", ("put on top", "put in", "push to")),
    "stir": Leaf("tool", "a tool works on a thing that touches a third one all the time", ("stir", "scoop")),
    "cut": Leaf("tool", "a tool works on a thing that is held for as long", ("cut", "chop", "saw", "screw")),
    "poke": Leaf("tool", "a thing touches another one and leaves it", ("poke", "knock", "hit", "draw")),
    "unknown": Leaf("unknown", "something that every decision needs is missing", ()),
}
"""The leaves of the tree by name."""

TREE = """\
hand touches a thing (object 1)?                     no: unknown
object 1 touches another thing (object 2)?           no: move
object 2 comes into sight, and stays?                yes: uncover
object 2 vanishes?                                   yes: hide
1–2 at the beginning and at the end
    touching, apart                                  take apart
    apart, touching                                  put together
    touching, touching                               move together
    apart, apart: what does object 2 touch?
        the same third thing from beginning to end   stir
        a third thing that comes to it or leaves it  cut
        nothing else                                 poke"""
"""The tree, to be printed."""


@dataclass(frozen=True)
class Decision:
    """Where a role table ends in the tree.

    Attributes
    ----------
    leaf : str
        One of :data:`LEAVES`.
    steps : tuple of str
        Question and answer, from the root on.
    """

    leaf: str
    steps: tuple[str, ...]

    def __str__(self) -> str:
        return "\n".join([*self.steps, f"→ {self.leaf}: {LEAVES[self.leaf].what}"])


def decide(table: RoleTable) -> Decision:
    """What kind of manipulation a role table shows, by rule.

    Parameters
    ----------
    table : RoleTable

    Returns
    -------
    Decision
        ``unknown``, with the reason, if there is no hand or it touches nothing.

    Raises
    ------
    ValueError
        If it is no role table.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables import role_table
    >>> seen = EventChain([[9, 0, 2, 2, 0, 9], [9, 0, 0, 0, 0, 9], [2, 2, 2, 0, 0, 0]], [(7, 1), (7, 2), (2, 1)])
    >>> print(decide(role_table(seen)))
    the hand touches object 1
    object 1 touches object 2
    object 2 is there at first and at last
    1–2: touching at the beginning, apart at the end
    → take apart: a thing is taken off another one
    """
    as_role_table(table)
    steps: list[str] = []

    def end(leaf: str, *reasons: str) -> Decision:
        return Decision(leaf, (*steps, *reasons))

    for role in ("hand", "object 1"):
        if role in table.missing:
            return end("unknown", f"there is no {role}: {table.missing[role]}")
    steps.append("the hand touches object 1")
    if "object 2" in table.missing:
        return end("move", table.missing["object 2"])
    steps.append("object 1 touches object 2")
    at_first, at_last = bool(table.present[2, 0]), bool(table.present[2, -1])
    if at_last and not at_first:
        return end("uncover", "object 2 comes into sight and stays")
    if at_first and not at_last:
        return end("hide", "object 2 vanishes")
    where = "there at first and at last" if at_first else "there in between only"
    steps.append(f"object 2 is {where}")
    known = table.relations[1][table.relations[1] != Relation.ABSENT]
    begins, ends = (bool(known[i] == Relation.TOUCHING) for i in (0, -1))
    how = {True: "touching", False: "apart"}
    steps.append(f"1–2: {how[begins]} at the beginning, {how[ends]} at the end")
    if begins or ends:
        return end({(True, False): "take apart", (False, True): "put together"}.get((begins, ends), "move together"))
    if "partner" in table.missing:
        return end("poke", table.missing["partner"])
    partner = table.relations[4]
    if partner[0] == partner[-1] == Relation.TOUCHING:
        return end("stir", "object 2 touches its partner at the beginning and at the end")
    return end("cut", "the partner of object 2 comes to it or leaves it")


def decision_table(tables: Mapping[str, RoleTable], classes: "Classes") -> "pd.DataFrame":
    """What the tree says of many recordings.

    Parameters
    ----------
    tables : mapping of str to RoleTable
        By name of the recording.
    classes : (n,) array_like of str
        What each recording shows.

    Returns
    -------
    pandas.DataFrame
        Counts; a row a class in the order of first appearance, a column a leaf in the order of :data:`LEAVES`.

    Raises
    ------
    ValueError
        If there is no recording, one of them is no role table, or there is not one class for each.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables import role_table
    >>> seen = EventChain([[9, 0, 2, 2, 0, 9], [9, 0, 0, 0, 0, 9], [2, 2, 2, 0, 0, 0]], [(7, 1), (7, 2), (2, 1)])
    >>> decision_table({"one": role_table(seen)}, ["taking"])["take apart"]
    class
    taking    1
    Name: take apart, dtype: int64
    """
    if not isinstance(tables, Mapping) or not tables:
        raise ValueError(f"tables: expected a mapping with at least one role table, got {type(tables).__name__}")
    import pandas as pd

    types = np.asarray(classes)
    if types.shape != (len(tables),):
        raise ValueError(f"classes: expected one for each of {len(tables)} recordings, got shape {types.shape}")
    leaves = [decide(table).leaf for table in tables.values()]
    counts = pd.crosstab(
        pd.Series(types.tolist(), name="class", dtype=object), pd.Series(leaves, name="leaf", dtype=object)
    )
    order = list(dict.fromkeys(types.tolist()))
    return counts.reindex(index=order, columns=list(LEAVES), fill_value=0)
