from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.pipeline import observe_segments
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
