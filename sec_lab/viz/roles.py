"""Segments grouped by their role in an action, as strips of pictures (Fig. 2.8)."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.role_groups import RoleGroups
from sec_lab.viz.style import (
    INK,
    LINE,
    PAGE_WIDTH_IN,
    RELATION_COLOUR,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    TITLE_PT,
    axes_at,
    bare,
    new_figure,
)

_WRONG = RELATION_COLOUR[Relation.TOUCHING]
_TITLE_IN, _HEAD_IN, _CELL_IN, _GAP_IN, _NAME_IN, _FOOT_IN = 0.28, 0.22, 0.6, 0.05, 0.95, 0.26


@dataclass(frozen=True, eq=False)
class RoleStrip:
    """Groups of the segments of some demonstrations, and how these segments look.

    Parameters
    ----------
    groups : RoleGroups
    chains : mapping of str to EventChain
        Of the demonstrations; the names of segments are their known roles.
    portraits : mapping of str to mapping of int to (height, width, 4) uint8
        By demonstration and segment.
    """

    groups: RoleGroups
    chains: Mapping[str, EventChain]
    portraits: Mapping[str, Mapping[int, NDArray[np.uint8]]]


def draw_roles(
    strips: Mapping[str, RoleStrip],
    *,
    title: str | None = None,
    left_out: Collection[str] = (),
    order: Sequence[str] = (),
) -> Figure:
    """Draw role groups, one row a group and one column a demonstration, strips side by side.

    A group is called by the known role of the segment that opened it. A member with another known role has a red frame.

    Parameters
    ----------
    strips : mapping of str to RoleStrip
        One or two, by what stands above them.
    title : str, optional
    left_out : collection of str, optional
        Groups of these roles are not drawn (the background in Fig. 2.8).
    order : sequence of str, optional
        Roles in the order in which their groups are drawn; the others come after them.

    Raises
    ------
    ValueError
        If there is no strip, there are more than two, or all groups are left out.

    Examples
    --------
    >>> from sec_lab.role_groups import role_groups
    >>> chain = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (1, 3)], names={1: "table", 2: "cup", 3: "box"})
    >>> chains = {"one": chain, "two": chain}
    >>> strip = RoleStrip(role_groups(chains), chains, {name: {} for name in chains})
    >>> [text.get_text() for text in draw_roles({"truth": strip}, left_out=["table"]).texts][:4]
    ['truth', 'one*', 'two', 'cup']
    """
    if not 1 <= len(strips) <= 2:
        raise ValueError(f"strips: expected one or two, got {len(strips)}")
    shown = {
        what: [s for s in strip.groups.members if _role(strip, strip.groups.reference, s) not in left_out]
        for what, strip in strips.items()
    }
    place = {role: number for number, role in enumerate(order)}
    for what, segments in shown.items():
        strip = strips[what]
        segments.sort(key=lambda s: place.get(_role(strip, strip.groups.reference, s), len(place)))
    n_rows = max(map(len, shown.values()))
    if not n_rows:
        raise ValueError("strips: expected at least one group that is not left out, got none")
    n_columns = max(len(strip.chains) for strip in strips.values())
    half_in = PAGE_WIDTH_IN / 2
    cell_in = min(_CELL_IN, (half_in - _NAME_IN - 0.1) / n_columns - _GAP_IN)
    above_in = _HEAD_IN + 0.2 + (0.0 if title is None else _TITLE_IN)
    figure = new_figure(half_in * len(strips), above_in + n_rows * (cell_in + _GAP_IN) + _FOOT_IN)
    if title is not None:
        _text(figure, 0.0, 0.0, title, bold=True)
    wrong = False
    for number, (what, strip) in enumerate(strips.items()):
        left_in = number * half_in
        _text(figure, left_in, above_in - 0.2 - _HEAD_IN, what, size_pt=TEXT_PT)
        for column, name in enumerate(strip.chains):
            mark = f"{name}*" if name == strip.groups.reference else name
            place_in = left_in + _NAME_IN + column * (cell_in + _GAP_IN)
            _text(figure, place_in, above_in - 0.2, mark, colour=SOFT, size_pt=SMALL_PT)
        for row, segment in enumerate(shown[what]):
            top_in = above_in + row * (cell_in + _GAP_IN)
            role = _role(strip, strip.groups.reference, segment)
            _text(figure, left_in, top_in + cell_in / 2 - 0.08, role, size_pt=SMALL_PT)
            for column, name in enumerate(strip.chains):
                place_in = left_in + _NAME_IN + column * (cell_in + _GAP_IN)
                ax = axes_at(figure, left_in=place_in, top_in=top_in, width_in=cell_in, height_in=cell_in)
                bare(ax)
                ax.set(xlim=(0, 1), ylim=(0, 1))
                member = strip.groups.members[segment].get(name)
                if member is None:
                    ax.text(0.5, 0.5, "–", ha="center", va="center", fontsize=TEXT_PT, color=SOFT)
                    continue
                is_wrong = _role(strip, name, member) != role
                wrong |= is_wrong
                picture = strip.portraits[name].get(member)
                if picture is not None:
                    ax.imshow(picture, extent=(0.02, 0.98, 0.02, 0.98), interpolation="antialiased")
                    ax.set(xlim=(0, 1), ylim=(0, 1))
                colour, width = (_WRONG, 2.0) if is_wrong else (LINE, 0.6)
                ax.add_patch(Rectangle((0.01, 0.01), 0.98, 0.98, fill=False, edgecolor=colour, linewidth=width))
    note = "* the others are compared to it;  – no segment clearly plays this role"
    note += ";  red frame: known to be something else" if wrong else ""
    foot_in = figure.get_figheight() - _FOOT_IN + 0.06
    _text(figure, 0.0, foot_in, note, colour=SOFT, size_pt=SMALL_PT)
    return figure


def _role(strip: RoleStrip, demonstration: str, segment: int) -> str:
    return strip.chains[demonstration].names.get(segment) or f"segment {segment}"


def _text(
    figure: Figure, left_in: float, top_in: float, text: str, *, colour: str = INK, size_pt: float = TITLE_PT,
    bold: bool = False,
) -> None:  # fmt: skip
    width, height = figure.get_size_inches().tolist()
    figure.text(
        (left_in + 0.03) / width, 1 - (top_in + 0.02) / height, text, ha="left", va="top", fontsize=size_pt,
        color=colour, fontweight="bold" if bold else "normal",
    )  # fmt: skip
