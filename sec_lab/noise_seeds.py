"""Seeds of the statistics of chapter 3: the figures that show the thesis's own are not in its text.

Each is a plausible chain of a real manipulation, of the size that the text names, made up once and not tuned
afterwards. Rows are pairs of things, columns what happens; relations are those of §2.4.
"""

from collections.abc import Mapping
from types import MappingProxyType

from sec_lab.event_chain import EventChain


def _chain(rows: Mapping[tuple[str, str], str]) -> EventChain:
    things = list(dict.fromkeys(thing for pair in rows for thing in pair))
    label = {thing: number for number, thing in enumerate(things, start=1)}
    pairs = [(label[b], label[a]) for a, b in rows]
    return EventChain(
        [[int(code) for code in row.split()] for row in rows.values()], pairs, names=dict(enumerate(things, 1))
    )


LIFTING = _chain(
    {
        # rest, hand at the box, lifted, put back, rest
        ("hand", "table"): "9 0 0 0 9",
        ("hand", "box"): "9 2 2 2 9",
        ("box", "table"): "2 2 0 2 2",
    }
)
"""Seed of 3×5 with hand, table and box, as Fig. 3.1: a box is lifted and put back."""

_PUTTING = _chain(
    {
        # rest, hand at the box, lifted, on the plate, let go, rest
        ("hand", "table"): "9 0 0 0 0 9",
        ("hand", "box"): "9 2 2 2 0 9",
        ("box", "table"): "2 2 0 0 0 0",
        ("box", "plate"): "0 0 0 2 2 2",
    }
)
_POURING = _chain(
    {
        # rest, hand at the jug, lifted, pouring, poured, put back, rest
        ("hand", "table"): "9 0 0 0 0 0 9",
        ("hand", "jug"): "9 2 2 2 2 2 9",
        ("jug", "table"): "2 2 0 0 0 2 2",
        ("jug", "liquid"): "9 9 9 2 0 0 0",
        ("liquid", "cup"): "9 9 9 2 2 2 2",
    }
)
_SANDWICH = _chain(
    {
        # rest, hand at the salami, lifted, on the bread, hand at the cheese, lifted, on the salami, rest
        ("hand", "salami"): "9 2 2 2 0 0 0 9",
        ("hand", "cheese"): "9 0 0 0 2 2 2 9",
        ("salami", "table"): "2 2 0 0 0 0 0 0",
        ("salami", "bread"): "0 0 0 2 2 2 2 2",
        ("cheese", "table"): "2 2 2 2 2 0 0 0",
        ("cheese", "salami"): "0 0 0 0 0 0 2 2",
    }
)
_PACKING = _chain(
    {
        # rest, hand at the lid, lifted, on the table, hand at the ball, lifted, in the box, rest
        ("hand", "table"): "9 0 0 0 0 0 0 9",
        ("hand", "lid"): "9 2 2 2 0 0 0 9",
        ("hand", "ball"): "9 0 0 0 2 2 2 9",
        ("hand", "box"): "9 0 0 0 0 0 1 9",
        ("lid", "box"): "2 2 0 0 0 0 0 0",
        ("lid", "table"): "0 0 0 2 2 2 2 2",
        ("ball", "table"): "2 2 2 2 2 0 0 0",
        ("ball", "box"): "0 0 0 0 0 0 1 1",
    }
)

SEEDS: Mapping[str, EventChain] = MappingProxyType(
    {"4×6": _PUTTING, "5×7": _POURING, "6×8": _SANDWICH, "8×8": _PACKING}
)
"""Four seeds of the sizes of Fig. 3.3, with at most five things: something is put on a plate, a cup is filled, a
sandwich made, and a box opened and filled."""

CLASS_SEEDS: Mapping[str, EventChain] = MappingProxyType(
    {
        "moving": _chain(
            {
                # rest, hand at the apple in the bowl, lifted, on the plate, let go, rest
                ("hand", "table"): "9 0 0 0 0 9",
                ("hand", "apple"): "9 2 2 2 0 9",
                ("hand", "bowl"): "9 1 0 0 0 9",
                ("hand", "plate"): "9 0 0 1 0 9",
                ("apple", "bowl"): "1 1 0 0 0 0",
                ("apple", "plate"): "0 0 0 2 2 2",
            }
        ),
        "pushing": _chain(
            {
                # rest, hand at the first block, it meets the second, that meets the wall, let go, rest
                ("hand", "table"): "9 1 1 1 0 9",
                ("hand", "first block"): "9 2 2 2 0 9",
                ("hand", "second block"): "9 0 0 0 0 9",
                ("hand", "wall"): "9 0 0 1 0 9",
                ("first block", "second block"): "0 0 2 2 2 2",
                ("second block", "wall"): "0 0 0 2 2 2",
            }
        ),
        "pouring": _chain(
            {
                # rest, hand at the jug, over the cup, pouring, put back, rest
                ("hand", "table"): "9 0 0 0 0 9",
                ("hand", "jug"): "9 2 2 2 2 9",
                ("jug", "table"): "2 2 0 0 2 2",
                ("jug", "cup"): "0 0 1 1 0 0",
                ("jug", "liquid"): "9 9 9 2 0 0",
                ("liquid", "cup"): "9 9 9 2 2 2",
            }
        ),
        "cutting": _chain(
            {
                # rest, hand at the knife, lifted, in the bread, a slice falls off, rest
                ("hand", "knife"): "9 2 2 2 2 9",
                ("knife", "board"): "2 2 0 0 0 2",
                ("knife", "bread"): "0 0 0 2 0 0",
                ("knife", "slice"): "9 9 9 9 2 0",
                ("slice", "bread"): "9 9 9 9 2 0",
                ("slice", "board"): "9 9 9 9 2 2",
            }
        ),
    }
)
"""Four seeds of 6×6 for four types of actions (§3.2)."""
