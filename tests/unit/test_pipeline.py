from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.pipeline import observe, observe_segments
from sec_lab.recording import Calibration, Recording
from sec_lab.relations import SegmentRelations, edge_count_relations, scan_line_relations
from sec_lab.scene_graph import scene_graph


def picture(*squares: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    """Background 1 of 20×30 pixels with 4×4 or other squares (label, row, column, size)."""
    labels = np.ones((20, 30), dtype=np.uint8)
    for label, row, column, size in squares:
        labels[row : row + size, column : column + size] = label
    return labels


APART = picture((2, 3, 3, 6), (3, 12, 20, 5))
TOUCHING = picture((2, 3, 3, 6), (3, 3, 9, 5))
INSIDE = picture((2, 2, 2, 12), (3, 5, 5, 5))


def test_steps_two_to_four() -> None:
    seen = observe_segments([APART, APART, TOUCHING, TOUCHING, INSIDE], names={2: "box", 3: "lid"})
    assert seen.key_frames.tolist() == [0, 2, 4]
    assert seen.position_unit == "px"
    assert dict(seen.names) == {2: "box", 3: "lid"}
    assert seen.chain.pairs.tolist() == [[2, 1], [3, 1], [3, 2]]
    assert seen.chain.relations.tolist() == [[1, 1, 1], [1, 1, 0], [0, 2, 1]]
    (first, *_) = seen.recorded
    assert first.positions is not None
    assert first.positions[1].tolist() == [5.5, 5.5]  # columns and rows 3 to 8


def test_absent_segment() -> None:
    seen = observe_segments([picture(), APART])
    assert seen.chain.relations.tolist() == [[9, 1], [9, 1], [9, 0]]


def test_methods_differ() -> None:
    by_lines = observe_segments([TOUCHING], relations="scan lines").chain
    by_edges = observe_segments([TOUCHING], relations="edge counting").chain
    assert by_lines.relations[:, 0].tolist() == [1, 1, 2]
    assert by_edges.relations[:, 0].tolist() == [2, 2, 2]


def nothing_touches(labels: object) -> SegmentRelations:
    segments = np.unique(np.asarray(labels))
    return SegmentRelations(segments, np.zeros((len(segments), len(segments)), dtype=int))


def test_method_of_ones_own() -> None:
    assert not observe_segments([APART, TOUCHING], relations=nothing_touches).chain.relations.any()


def test_method_may_say_what_each_node_is() -> None:
    def named(labels: object) -> SegmentRelations:
        return scene_graph(nothing_touches(labels), types=["table", "box", "lid"])

    (graph,) = observe_segments([APART, APART], relations=named).recorded
    assert graph.types == ("table", "box", "lid")


def test_method_that_gives_something_else() -> None:
    with pytest.raises(ValueError, match="frame 0: relations: expected SegmentRelations from the function, got list"):
        observe_segments([APART], relations=list)  # type: ignore[arg-type]


@pytest.mark.parametrize("method", ["scan lines", "edge counting"])
def test_named_method_is_the_function(method: str) -> None:
    function = {"scan lines": scan_line_relations, "edge counting": edge_count_relations}[method]
    by_name = observe_segments([APART, TOUCHING, INSIDE], relations=method)  # type: ignore[arg-type]
    by_function = observe_segments([APART, TOUCHING, INSIDE], relations=function)
    np.testing.assert_array_equal(by_name.chain.relations, by_function.chain.relations)


def test_frame_numbers() -> None:
    seen = observe_segments([APART, APART, TOUCHING], frames=iter([10, 15, 20, 25]))
    assert seen.key_frames.tolist() == [10, 20]


def test_streams_and_may_reuse_its_buffer() -> None:
    """Images are looked at one by one, so a reader may hand out the same array again and again."""

    def movie() -> Iterator[NDArray[np.uint8]]:
        buffer = np.empty_like(APART)
        for frame in (APART, TOUCHING, INSIDE):
            buffer[:] = frame
            yield buffer

    np.testing.assert_array_equal(
        observe_segments(movie()).chain.relations, observe_segments([APART, TOUCHING, INSIDE]).chain.relations
    )


def test_long_movie_is_not_kept() -> None:
    alive = 0
    most = 0

    class Frame(np.ndarray):
        def __del__(self) -> None:
            nonlocal alive
            alive -= 1

    def movie() -> Iterator[NDArray[np.uint8]]:
        nonlocal alive, most
        for index in range(50):
            frame = (APART if index % 2 else TOUCHING).copy().view(Frame)
            alive += 1
            most = max(most, alive)
            yield frame
            del frame

    assert len(observe_segments(movie()).key_frames) == 50
    assert most <= 3


def test_progress_bar(capsys: pytest.CaptureFixture[str]) -> None:
    observe_segments([APART, TOUCHING], progress=True)
    captured = capsys.readouterr()
    assert "2/2" in captured.err
    observe_segments([APART, TOUCHING])
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


@pytest.mark.parametrize(
    ("movie", "options", "message"),
    [
        ([], {}, "movie: expected at least one label image, got none"),
        ([APART, APART[:, :-1]], {}, r"frame 1: label image: expected shape \(20, 30\) as before, got \(20, 29\)"),
        ([APART, APART[:-1]], {"frames": [4, 7]}, r"frame 7: .* got \(19, 30\)"),
        ([APART, APART * 1.0], {}, "frame 1: label image: expected labels of an integer type, got float64"),
        ([APART[0]], {}, r"frame 0: label image: expected shape \(height, width\)"),
        ([APART, APART], {"frames": [1]}, "frames: expected a number for every label image, got 1 numbers"),
        ([APART, APART], {"frames": [3, 3]}, "frames: expected ascending frame numbers, got 3 after 3"),
        ([APART], {"relations": "lines"}, "relations: expected one of"),
    ],
)
def test_bad_input(movie: list[NDArray[np.uint8]], options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        observe_segments(movie, **options)  # type: ignore[arg-type]


def test_unknown_method_is_said_before_the_movie_is_read() -> None:
    def movie() -> Iterator[NDArray[np.uint8]]:
        raise AssertionError("read")
        yield

    with pytest.raises(ValueError, match="relations: expected one of"):
        observe_segments(movie(), relations="lines")  # type: ignore[arg-type]


class StereoMovie:
    """A red block is taken by a hand and put beside a blue one, seen by two cameras above a table.

    The table is a slanted plane, the blocks are boards that stand upright on it, 1 cm thick, and the hand is one, too,
    8 cm before the table at its lower border. All have textures of their own.
    """

    size = 128, 160
    camera = Calibration(190, (80, 64), baseline_m=0.06)
    start, end = (36.0, 40.0), (84.0, 126.0)
    blue = 84.0, 104.0

    def __init__(self) -> None:
        self.rng = np.random.default_rng(7)
        self.texture = self.rng.normal(0, 9, (256, 320, 1))
        table_m = np.linspace(1.15, 0.8, self.size[0])
        self.table_m = table_m
        pairs = [self._pair(*moment) for moment in self._moments()]
        self.left, self.right = (np.stack(pictures) for pictures in zip(*pairs, strict=True))

    def _moments(self) -> Iterator[tuple[tuple[float, float], tuple[float, float] | None]]:
        """Place of the red block, and of the hand's finger tips or None: (row, column)."""

        def way(one: tuple[float, float], other: tuple[float, float], n: int) -> NDArray[np.float64]:
            return np.linspace(one, other, n)

        at_start, at_end = (36.0, 46.0), (84.0, 132.0)
        for _ in range(12):
            yield self.start, None
        for hand in way((36, 180), at_start, 40):
            yield self.start, tuple(hand)
        for _ in range(15):
            yield self.start, at_start
        for step in np.linspace(0, 1, 25):
            block = np.array(self.start) + step * np.subtract(self.end, self.start)
            yield tuple(block), tuple(np.array(at_start) + step * np.subtract(at_end, at_start))
        for _ in range(15):
            yield self.end, at_end
        for hand in (*way(at_end, (36, 132), 18), *way((36, 132), (36, 185), 18)):
            yield self.end, tuple(hand)
        for _ in range(20):
            yield self.end, None

    def _pair(
        self, block: tuple[float, float], hand: tuple[float, float] | None
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        carried = 0.0 if block in (self.start, self.end) else 0.06
        return self._seen(block, hand, carried, shift=0), self._seen(block, hand, carried, shift=1)

    def _seen(self, block: Any, hand: Any, carried: float, *, shift: int) -> NDArray[np.uint8]:
        height = self.size[0]
        scale = self.camera.focal_length_px * (self.camera.baseline_m or 0) * shift
        rows, columns = np.indices(self.size)
        picture = np.array([150.0, 140, 120]) + self._textured(rows, columns + (scale / self.table_m)[:, None], 0)

        def paint(
            inside: NDArray[np.bool_], colour: tuple[int, int, int], seen_at: Any, place: Any, number: int
        ) -> None:
            there = self._textured(rows[inside] - place[0], seen_at[inside] - place[1], number)
            picture[inside] = np.array(colour, float) + there

        for number, (place, colour, lifted) in enumerate(
            [(self.blue, (40, 70, 180), 0.0), (block, (190, 40, 36), carried)], start=1
        ):
            foot = min(round(place[0]) + 11, height - 1)
            seen_at = columns + scale / (self.table_m[foot] - 0.01 - lifted)
            inside = (abs(rows - place[0]) < 11) & (abs(seen_at - place[1]) < 12)
            paint(inside, colour, seen_at, place, number)
        if hand is not None:
            foot = min(max(round(hand[0]) + 11, 0), height - 1)
            seen_at = columns + scale / (self.table_m[foot] - 0.08 - carried)
            palm = (rows - hand[0]) ** 2 / 13**2 + (seen_at - hand[1] - 16) ** 2 / 15**2 < 1
            arm = (abs(rows - hand[0]) < 9) & (seen_at > hand[1] + 16)
            paint(palm | arm, (206, 120, 98), seen_at, hand, 3)
        return np.clip(picture + self.rng.normal(0, 1.5, picture.shape), 0, 255).astype(np.uint8)

    def _textured(self, rows: Any, columns: Any, number: int) -> NDArray[np.float64]:
        """Texture at broken columns, linear between whole ones."""
        rows = np.asarray(rows + 64 * number).round().astype(int) % 256
        low = np.floor(columns).astype(int)
        share = (columns - low)[..., None]
        return (1 - share) * self.texture[rows, low % 320] + share * self.texture[rows, (low + 1) % 320]


def changes(row: NDArray[np.uint8]) -> list[int]:
    """Relations one after the other, each as often as it begins."""
    return [int(code) for k, code in enumerate(row) if k == 0 or code != row[k - 1]]


def test_stereo_movie_to_chain() -> None:
    movie = StereoMovie()
    recording = Recording.from_frames(movie.left, right=movie.right, calibration=movie.camera, frames_per_second=25)
    seen = observe(recording, names={1: "table", 2: "red", 3: "blue", 4: "hand"})
    apart, on, touching, absent = (int(code) for code in Relation)
    found = {
        tuple(sorted(str(seen.names[int(label)]) for label in pair)): changes(row)
        for pair, row in zip(seen.chain.pairs, seen.chain.relations, strict=True)
    }
    assert found == {
        ("red", "table"): [on, apart, on],  # carried in between
        ("blue", "table"): [on],
        ("blue", "red"): [apart, touching],
        ("hand", "red"): [absent, apart, touching, apart, absent],
        ("hand", "table"): [absent, apart, absent],  # above it all the time
        ("blue", "hand"): [absent, apart, absent],
    }
    # Taken in frame 52 and lifted in 67; as seen, within half a second.
    rows = {tuple(sorted(pair.tolist())): row for pair, row in zip(seen.chain.pairs, seen.chain.relations, strict=True)}
    taken = seen.key_frames[np.flatnonzero(rows[2, 4] == touching)]
    carried = seen.key_frames[np.flatnonzero(rows[1, 2] == apart)]
    assert abs(taken[0] - 52) <= 12
    assert abs(carried[0] - 67) <= 12
