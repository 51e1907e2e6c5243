"""The state of a chain explorer, without any widget: where one is, what is chosen, named and merged."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.segmentation.merging import as_groups, merged_names
from sec_lab.segmentation.record import MAX_LABEL
from sec_lab.viz.style import RELATION_WORD
from sec_lab.viz.widgets.chain_table import LIGHT, ChainTable, Theme
from sec_lab.viz.widgets.panels import FramePanels, jpeg_bytes, told_segment
from sec_lab.viz.widgets.seen import KeptFrame, Seen, Tell, merged

_WIDTH_PX = 980


class ChainBook:
    """A movie with its chain, opened at a place: what an explorer shows and changes.

    Parameters
    ----------
    seen : Seen
    width_px : int, optional
        Width of the chain on the page.

    Attributes
    ----------
    place : int
        Index of the frame that is shown; of observations without frames, of the key frame.
    row : int or None
        Row of the chain that is chosen.
    chosen : list of int
        Segments that are chosen, in the order of the clicks.
    groups : tuple of tuple of int
        Segments that were merged.
    observation : Observation
        With names and merged segments as they are now.

    Examples
    --------
    >>> from sec_lab.segmentation import Segmentation
    >>> from sec_lab.viz.widgets.seen import see
    >>> labels = np.ones((4, 20, 30), dtype=np.uint8)
    >>> labels[2:, 5:15, 5:15], labels[3:, 5:15, 15:25] = 2, 3
    >>> book = ChainBook(see(Segmentation.from_labels(labels), how=(None, "scan lines")))
    >>> book.go_to_column(1)
    >>> book.place, book.told
    (2, 'frame 2 · column 2 of 3')
    >>> book.rename(2, "cup")
    >>> book.merge([2, 3])
    >>> book.observation.chain.to_frame().index.tolist(), book.observation.key_frames
    (['cup, 1'], array([0, 2]))
    """

    def __init__(self, seen: Seen, *, width_px: int = _WIDTH_PX, theme: Theme = LIGHT) -> None:
        self.seen = seen
        self._width, self._theme = width_px, theme
        self._before: list[tuple[tuple[tuple[int, ...], ...], Observation]] = []
        self.place = 0
        self.row: int | None = None
        self.chosen: list[int] = []
        self.groups: tuple[tuple[int, ...], ...] = ()
        self.observation = seen.observation
        self.numbers = [frame.number for frame in seen.frames] or seen.observation.recorded.key_frames.tolist()
        self._begin()

    def _begin(self) -> None:
        """Everything that is drawn once for all frames."""
        new_labels = None
        if self.groups:
            new_labels = np.arange(MAX_LABEL + 1, dtype=np.uint16)
            for group in self.groups:
                new_labels[list(group)] = group[0]
        background = self.seen.background
        if background is not None and new_labels is not None:
            background = int(new_labels[background])
        self.panels = FramePanels(
            self.observation,
            next((frame for frame in self.seen.frames if frame.has_labels), None) or next(iter(self.seen.frames), None),
            background=background,
            has_depth=self.seen.has_depth,
            new_labels=new_labels,
        )
        self.table = ChainTable(self.chain, width_px=self._width, theme=self._theme)
        self._key_frames = self.observation.recorded.key_frames

    @property
    def chain(self) -> EventChain | None:
        """The chain as it is now; None with fewer than two segments."""
        return self.observation.chain if len(self.observation.segments) > 1 else None

    @property
    def frame(self) -> KeptFrame | None:
        """The frame that is shown."""
        return self.seen.frames[self.place] if self.seen.frames else None

    @property
    def column(self) -> int:
        """Column of the chain that holds now."""
        return max(0, int(np.searchsorted(self._key_frames, self.numbers[self.place], side="right")) - 1)

    @property
    def pair(self) -> tuple[int, ...]:
        """The two segments of the row that is chosen, or none."""
        if self.row is None or self.chain is None:
            return ()
        return tuple(self.chain.pairs[self.row].tolist())

    @property
    def told(self) -> str:
        """Where one is, in words."""
        frame = self.frame
        time = "" if frame is None or frame.time_s is None else f" · {frame.time_s:.2f} s"
        words = f"frame {self.numbers[self.place]}{time} · column {self.column + 1} of {len(self._key_frames)}"
        if self.row is not None and self.chain is not None:
            relation = self.chain.relations[self.row, self.column]
            word = next(word for code, word in RELATION_WORD.items() if code == relation)
            words += f" · {self.chain.row_label(self.row)}: {word}"
        return words

    def segments(self) -> list[tuple[str, int]]:
        """Segments as they are called, and their labels."""
        return [(told_segment(label, self.observation.names), label) for label in self.observation.segments.tolist()]

    def frame_file(self) -> bytes:
        """The panels of this frame as a JPEG file."""
        return self.panels.encoded(self.frame, column=self.column, pair=self.pair, chosen=self.chosen)

    def chain_file(self) -> bytes:
        """The chain with column and row lit as a JPEG file."""
        return jpeg_bytes(self.table.draw(column=self.column, row=self.row), quality=92)

    def go_to(self, place: int) -> None:
        """Show a frame by its index; beyond the ends the first or the last."""
        self.place = int(np.clip(place, 0, len(self.numbers) - 1))

    def go_to_column(self, column: int) -> None:
        """Show the key frame of a column."""
        number = self._key_frames[int(np.clip(column, 0, len(self._key_frames) - 1))]
        self.go_to(int(np.searchsorted(self.numbers, number)))

    def step_column(self, step: int) -> None:
        """Go to the next key frame, or to the one before; from inside a column back to where it began."""
        begins = self.numbers[self.place] == self._key_frames[self.column]
        self.go_to_column(self.column + (step if step > 0 or begins else 0))

    def click_chain(self, x: int, y: int) -> None:
        """Go to the key frame of a column, and show the segments of a row; a second click on a row lets it go."""
        row, column = self.table.cell_at(x, y)
        if column is not None:
            self.go_to_column(column)
        if row is not None:
            self.row = None if row == self.row and column is None else row
        elif column is None:
            self.row = None

    def step_row(self, step: int) -> None:
        """Choose the next row that is shown, or the one before."""
        rows = self.table.rows.tolist()
        if rows:
            at = rows.index(self.row) + step if self.row in rows else (0 if step > 0 else len(rows) - 1)
            self.row = rows[at % len(rows)]

    def click_frame(self, x: int, y: int) -> None:
        """Choose the segment at a place, or let it go."""
        label = self.panels.segment_at(self.frame, x, y)
        if label is None or label not in self.observation.segments:
            return
        self.chosen = (
            [other for other in self.chosen if other != label] if label in self.chosen else [*self.chosen, label]
        )

    def choose(self, labels: Iterable[int]) -> None:
        """Choose segments by their labels; those that were not seen are passed over."""
        known = set(self.observation.segments.tolist())
        self.chosen = [label for label in dict.fromkeys(labels) if label in known]

    def rename(self, label: int, name: str) -> None:
        """Give a segment a name; an empty one takes the name away.

        Raises
        ------
        ValueError
            If the segment was not seen.
        """
        if label not in self.observation.segments:
            raise ValueError(f"segment: expected one that was seen, got {label}")
        names = dict(self.observation.names)
        names.pop(label, None)
        if name.strip():
            names[label] = name.strip()
        if names == dict(self.observation.names):
            return
        self._remember()
        self._set(_named(self.observation, names))

    def merge(self, labels: Sequence[int], *, tell: Tell | None = None) -> None:
        """Take segments together as one (over-segmentation, §2.11), and make the chain anew; the first stays.

        Nothing is changed if ``tell``, which is called with the number of frames done and of all, raises.

        Raises
        ------
        ValueError
            If there are fewer than two, one was not seen, or the chain would have fewer than two segments.
        """
        self.merging(labels, tell=tell)()

    def merging(self, labels: Sequence[int], *, tell: Tell | None = None) -> Callable[[], None]:
        """Find what :meth:`merge` would make, and change nothing before the function that is given is called.

        So work that is stopped at the last moment has changed nothing.

        Raises
        ------
        ValueError
            As :meth:`merge` does.
        """
        if len(labels) < 2:
            raise ValueError("merge: choose at least two segments that are parts of one object")
        unknown = [label for label in labels if label not in self.observation.segments]
        if unknown:
            raise ValueError(f"merge: expected segments that were seen, got {unknown[0]}")
        if len(self.observation.segments) - len(set(labels)) + 1 < 2:
            raise ValueError("merge: a chain needs two segments, and only one would be left")
        members = {group[0]: group for group in self.groups}
        parts = [member for label in labels for member in members.pop(label, (label,))]
        groups = as_groups([*members.values(), parts])
        names = merged_names(self.observation.names, [labels])
        found = _named(merged(self.seen, groups, tell=tell), names)

        def take() -> None:
            self._remember()
            self.groups = groups
            self._set(found)
            self.choose([labels[0]])

        return take

    def undo(self) -> None:
        """Take back the last name or the last merging; nothing if there was none."""
        if self._before:
            self.groups, observation = self._before.pop()
            self._set(observation)

    @property
    def can_undo(self) -> bool:
        """Whether there is something to take back."""
        return bool(self._before)

    def in_theme(self, theme: Theme) -> None:
        """Draw the chain in other colours of paper and ink."""
        if theme != self._theme:
            self._theme = theme
            self._begin()

    def _remember(self) -> None:
        self._before.append((self.groups, self.observation))

    def _set(self, observation: Observation) -> None:
        self.observation = observation
        self.row = None
        self.choose(self.chosen)
        self._begin()


def _named(observation: Observation, names: dict[int, str | None]) -> Observation:
    segmentation = observation.segmentation
    if segmentation is not None:
        segmentation = replace(segmentation, names=names)
    return Observation(observation.graphs, observation.key_frames, names, observation.position_unit, segmentation)
