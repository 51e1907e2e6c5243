"""What a role table says, in words."""

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from sec_lab.role_tables.table import POSITIONS, ROLES, ROWS, RoleTable, as_role_table

if TYPE_CHECKING:
    import pandas as pd


def in_words(table: RoleTable) -> str:
    """Tell what happens between the roles, one sentence a moment.

    Only what begins or ends is told, with the frame at which it was first seen so; what is missing is said at the end.

    Parameters
    ----------
    table : RoleTable

    Returns
    -------
    str
        Lines.

    Raises
    ------
    ValueError
        If it is no role table.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.table import role_table
    >>> names = {1: "cup", 2: "box", 7: "arm"}
    >>> seen = EventChain(
    ...     [[9, 0, 2, 2, 0, 9], [9, 0, 0, 0, 0, 9], [2, 2, 2, 0, 0, 0]], [(7, 1), (7, 2), (2, 1)], names=names
    ... )
    >>> print(in_words(role_table(seen)))
    At first object 1 (cup) touches object 2 (box).
    1: the hand (arm) comes.
    2: the hand touches object 1.
    3: object 1 leaves object 2.
    4: the hand leaves object 1.
    5: the hand goes.
    There is no object 3: object 1 touches nothing else.
    There is no partner: object 2 touches nothing else.
    There are no positions: not all segments have a recorded one.
    """
    as_role_table(table)
    lines = []
    named: set[str] = set()

    def call(role: int) -> str:
        name = ROLES[role] if role in (1, 2, 3) else f"the {ROLES[role]}"
        if ROLES[role] in named or not table.segments[ROLES[role]]:
            return name
        named.add(ROLES[role])
        return f"{name} ({table.name_of(ROLES[role])})"

    touching = table.relations == 2
    first = [f"{call(a)} touches {call(b)}" for row, (a, b) in enumerate(ROWS) if touching[row, 0]]
    if first:
        lines.append(f"At first {_joined(first)}.")
    changed = (table.rows[:, 1:] != table.rows[:, :-1]).any(axis=0)
    for k in (np.flatnonzero(changed) + 1).tolist():
        told = [
            f"{call(role)} {'comes' if table.present[role, k] else 'goes'}"
            for role in range(len(ROLES))
            if table.present[role, k] != table.present[role, k - 1]
        ]
        for row, (a, b) in enumerate(ROWS):
            if touching[row, k] != touching[row, k - 1] and (touching[row, k] or (table.present[[a, b], k]).all()):
                told.append(f"{call(a)} {'touches' if touching[row, k] else 'leaves'} {call(b)}")
        if told:
            lines.append(f"{table.key_frames[k]}: {_joined(told)}.")
    for what, why in table.missing.items():
        if what == POSITIONS or not why.startswith("there is no"):
            lines.append(f"There {'are' if what == POSITIONS else 'is'} no {what}: {why}.")
    return "\n".join(lines)


def played_by(tables: Mapping[Hashable, RoleTable]) -> "pd.DataFrame":
    """Who plays each role in many recordings: the names of the segments, or their labels.

    Parameters
    ----------
    tables : mapping of any key to RoleTable
        By name of the recording; tuples of the same length make several levels.

    Returns
    -------
    pandas.DataFrame
        A row a recording, a column a role; "–" where a role is missing.

    Raises
    ------
    ValueError
        If there is no table, or one of them is something else.

    Examples
    --------
    >>> from sec_lab.event_chain import EventChain
    >>> from sec_lab.role_tables.table import role_table
    >>> seen = EventChain([[9, 2, 9], [9, 0, 9], [0, 0, 0]], [(7, 1), (7, 2), (1, 2)], names={7: "arm"})
    >>> played_by({"one": role_table(seen)}).loc["one"].tolist()
    ['arm', '1', '–', '–', '–']
    """
    import pandas as pd

    if not isinstance(tables, Mapping):
        raise ValueError(f"tables: expected a mapping of names to role tables, got {type(tables).__name__}")
    if not tables:
        raise ValueError("tables: expected at least one role table, got none")
    for table in tables.values():
        as_role_table(table)
    rows = [[table.name_of(role) for role in ROLES] for table in tables.values()]
    return pd.DataFrame(rows, index=pd.Index(list(tables)), columns=list(ROLES))


def _joined(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
