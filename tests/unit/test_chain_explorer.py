"""The chain explorer without a browser: what it keeps, draws, and does with clicks, keys, names and merging."""

import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sec_lab as sl
from sec_lab import Observation, Recording, SceneGraph, Segmentation
from sec_lab.observation import merge_segments
from sec_lab.recording import Frame
from sec_lab.segmentation.merging import merged_segments
from sec_lab.viz.widgets import chain_explorer, own_movie
from sec_lab.viz.widgets.book import ChainBook
from sec_lab.viz.widgets.chain_table import DARK, ChainTable
from sec_lab.viz.widgets.explorer import ChainExplorer
from sec_lab.viz.widgets.scrubber import FOR_PAGES, SCRUBBER, scrubber_html
from sec_lab.viz.widgets.seen import MOST_FRAMES, KeptFrame, Seen, merged, see


def labels_of_movie(n: int = 12) -> np.ndarray:
    """Two halves of a cup (2 and 3) go to a box (4) on a table (1)."""
    labels = np.ones((n, 40, 60), dtype=np.uint8)
    labels[:, 14:28, 44:56] = 4
    for number, image in enumerate(labels):
        left = min(4 + 3 * number, 32)
        image[16:26, left : left + 6], image[16:26, left + 6 : left + 12] = 2, 3
    return labels


def movie(n: int = 12) -> Recording:
    rng = np.random.default_rng(5)
    return Recording.from_frames(rng.integers(0, 255, (n, 40, 60, 3), dtype=np.uint8), frames_per_second=25)


@pytest.fixture(scope="module")
def seen() -> Seen:
    labels = Segmentation.from_labels(labels_of_movie(), background=1, names={4: "box"})
    return see(labels, recording=movie(), how=(None, "scan lines"))


@pytest.fixture
def book(seen: Seen) -> ChainBook:
    return ChainBook(seen)


def test_labels_and_depth_are_kept_without_loss_and_pictures_nearly() -> None:
    rng = np.random.default_rng(1)
    labels = rng.integers(0, 1 << 16, (30, 50), dtype=np.uint16)
    depth = rng.random((30, 50), dtype=np.float32)
    smooth = np.tile(np.linspace(20, 220, 50).astype(np.uint8)[None, :, None], (30, 1, 3))
    kept = KeptFrame(3, 0.5, smooth, labels, depth)
    assert np.array_equal(kept.labels, labels)
    assert np.array_equal(kept.depth_m, depth)
    assert kept.picture is not None
    assert np.abs(kept.picture.astype(int) - smooth).max() < 12
    large = KeptFrame(0, None, np.zeros((100, 1500, 3), dtype=np.uint8), None, None)
    assert large.picture is not None
    assert large.picture.shape[:2] == (43, 640)


def test_what_is_seen_is_what_observe_says_and_is_read_once() -> None:
    n_read = 0
    frames = movie(20)

    def counted() -> Iterator[Frame]:
        nonlocal n_read
        for frame in frames:
            n_read += 1
            yield frame

    said: list[tuple[int, int | None]] = []
    found = see(replace(frames, read=counted), tell=lambda done, of: said.append((done, of)))
    expected = sl.observe(frames)
    assert n_read == 20
    assert said == [(done, 20) for done in range(1, 21)]
    assert np.array_equal(found.observation.key_frames, expected.key_frames)
    assert np.array_equal(found.observation.segments, expected.segments)
    assert expected.segmentation is not None
    assert all(
        np.array_equal(kept.labels, image) for kept, image in zip(found.frames, expected.segmentation, strict=True)
    )


def test_frames_between_masks_are_kept_and_a_longer_mask_than_movie_is_refused() -> None:
    labels = labels_of_movie()[::3]
    few = Segmentation.from_labels(labels, frames=[0, 3, 6, 9])
    found = see(few, recording=movie())
    assert [frame.number for frame in found.frames] == list(range(12))
    assert [frame.number for frame in found.frames if frame.has_labels] == [0, 3, 6, 9]
    # What is shown between two masks is the last one.
    assert np.array_equal(found.frames[5].shown_labels, labels[1])
    assert found.frames[5].labels is None
    unknown = replace(movie(5), n_frames=None)
    with pytest.raises(ValueError, match="got one of frame 6"):
        see(few, recording=unknown)


def test_a_movie_that_is_too_long_is_refused_before_it_fills_the_memory() -> None:
    endless = Segmentation(lambda: ((n, np.ones((2, 2), np.uint8)) for n in range(MOST_FRAMES + 5)), (2, 2))
    with pytest.raises(ValueError, match=f"at most {MOST_FRAMES} frames"):
        see(endless)


def test_merging_is_done_again_from_the_label_images(seen: Seen) -> None:
    whole = merged_segments(Segmentation.from_labels(labels_of_movie(), background=1), [[2, 3]])
    expected = sl.observe_segments(whole)
    found = merged(seen, [[2, 3]])
    assert np.array_equal(found.chain.relations, expected.chain.relations)
    assert np.array_equal(found.chain.key_frames, expected.chain.key_frames)
    assert found.segmentation is not None
    assert all(np.array_equal(a, b) for a, b in zip(found.segmentation, whole, strict=True))


def test_how_relations_were_found_is_tried_out() -> None:
    segmentation = Segmentation.from_labels(labels_of_movie())
    steady, counted = sl.observe(segmentation), sl.observe_segments(segmentation, relations="edge counting")
    assert see(steady).found == ("steady", "scan lines")
    assert see(counted).found == (None, "edge counting")
    # Of another movie's chain no way leads to it; then the graphs alone are merged.
    others = Observation([SceneGraph([2, 3, 4], np.zeros((3, 3)))], [0], segmentation=segmentation)
    assert see(others).found is None
    assert merged(see(others), [[2, 3]]).chain.pairs.tolist() == [[4, 2]]


def test_depth_takes_part_when_segments_are_merged() -> None:
    labels = labels_of_movie()
    depth = np.where(labels == 1, 1.0, 0.7).astype(np.float32)
    frames = Recording.from_frames(np.zeros((*labels.shape, 3), dtype=np.uint8), depth=depth)
    found = see(Segmentation.from_labels(labels), recording=frames)
    whole = merged_segments(Segmentation.from_labels(labels), [[2, 3]])
    expected = sl.observe(frames, segmentation=whole)
    assert found.has_depth
    assert np.array_equal(merged(found, [[2, 3]]).chain.relations, expected.chain.relations)


@given(st.integers(1, 9), st.integers(1, 90), st.integers(200, 1200))
def test_every_cell_is_found_where_it_is_drawn(n_rows: int, n_columns: int, width_px: int) -> None:
    codes = np.zeros((n_rows, n_columns), dtype=np.uint8)
    codes[:, n_columns // 2 :] = 2
    codes[0] = 1
    pairs = [(row + 2, 1) for row in range(n_rows)]
    table = ChainTable(sl.EventChain(codes, pairs), width_px=width_px)
    assert table.rows.tolist() == (list(range(1, n_rows)) if n_columns > 1 else [])
    for row in table.rows.tolist():
        for column in {0, n_columns // 2, n_columns - 1}:
            assert table.cell_at(*table.centre_of(row, column)) == (row, column)
    picture = table.draw(column=n_columns - 1, row=n_rows - 1)
    assert picture.shape[1] <= 2 * max(width_px, 500)
    assert table.cell_at(picture.shape[1] + 500, 10_000) == (None, None)


def test_the_lit_column_is_where_the_hit_test_says() -> None:
    table = ChainTable(sl.EventChain([[0, 2, 1, 0]], [(2, 1)]), width_px=500)
    plain = table.draw()
    for column in range(4):
        changed = np.argwhere((table.draw(column=column) != plain).any(axis=(0, 2))).ravel()
        middle = table.centre_of(0, column)[0]
        assert abs((changed.min() + changed.max()) / 2 - middle) <= 4
    assert (ChainTable(None, width_px=300, theme=DARK).draw() < 60).any()


def test_clicks_on_the_chain_and_in_the_picture(book: ChainBook) -> None:
    assert book.chain is not None
    row = book.table.rows.tolist()[-1]
    last = len(book.chain.key_frames) - 1
    book.click_chain(*book.table.centre_of(row, last))
    assert (book.row, book.column) == (row, last)
    assert book.numbers[book.place] == book.chain.key_frames[last]
    assert book.chain.row_label(row) in book.told
    with_pair = book.panels.draw(book.frame, column=book.column, pair=book.pair)
    without = book.panels.draw(book.frame, column=book.column)
    labels = book.panels.labels_of(book.frame)
    assert labels is not None
    scale = book.panels.scale
    others = np.argwhere(~np.isin(labels, book.pair))
    y, x = others[len(others) // 2]
    assert with_pair[y * scale, x * scale].sum() < 0.6 * without[y * scale, x * scale].sum()

    book.go_to(0)
    book.click_frame(7 * scale, 20 * scale)
    book.click_frame(50 * scale, 20 * scale)
    assert book.chosen == [2, 4]
    book.click_frame(7 * scale, 20 * scale)
    assert book.chosen == [4]


def test_steps(book: ChainBook) -> None:
    keys = book.observation.key_frames.tolist()
    book.go_to(500)
    assert book.place == 11
    book.go_to(keys[1] + 1)
    book.step_column(-1)
    assert book.numbers[book.place] == keys[1]
    book.step_column(-1)
    assert book.numbers[book.place] == keys[0]
    book.step_column(-1)
    assert book.place == 0
    rows = book.table.rows.tolist()
    book.step_row(-1)
    assert book.row == rows[-1]
    book.step_row(1)
    assert book.row == rows[0]


def test_merging_changes_nothing_until_it_is_taken(book: ChainBook) -> None:
    before = book.observation, book.groups, book.can_undo
    take = book.merging([3, 2])
    assert (book.observation, book.groups, book.can_undo) == before
    take()
    assert book.groups == ((3, 2),)
    assert book.can_undo


def test_names_merging_and_taking_back(book: ChainBook) -> None:
    before = book.observation
    book.rename(2, " cup ")
    book.merge([3, 2])
    assert ("3 cup", 3) in book.segments()
    assert book.groups == ((3, 2),)
    book.merge([4, 3])
    assert book.groups == ((4, 3, 2),)
    assert book.observation.names[4] == "box"
    assert book.observation.segments.tolist() == [1, 4]
    labels = book.panels.labels_of(book.frame)
    assert set(np.unique(labels)) == {1, 4}
    with pytest.raises(ValueError, match="only one would be left"):
        book.merge([1, 4])
    for _ in range(3):
        book.undo()
    assert book.observation is before
    assert not book.can_undo
    for wrong in ([2], [2, 77]):
        with pytest.raises(ValueError, match="merge: "):
            book.merge(wrong)


def test_graphs_without_pictures_have_an_explorer_too() -> None:
    graphs = [SceneGraph([1, 2, 3], np.array([[0, a, 2], [a, 0, 0], [2, 0, 0]])) for a in (0, 2, 1)]
    book = ChainBook(see(Observation(graphs, [3, 8, 20])))
    assert (book.numbers, book.told) == ([3, 8, 20], "frame 3 · column 1 of 3")
    first = book.frame_file()
    book.go_to_column(1)
    assert book.frame_file() != first
    book.merge([2, 3])
    assert np.array_equal(
        book.observation.chain.relations, merge_segments(Observation(graphs, [3, 8, 20]), [[2, 3]]).chain.relations
    )
    assert "3 frames" not in scrubber_html(book)
    with_movie = ChainBook(see(Observation(graphs, [3, 8, 20]), recording=movie(25)))
    assert with_movie.panels.draw(with_movie.frame, column=0).shape[1] == 2 * 7 * 60 + 6


def test_pictures_larger_than_those_that_are_kept() -> None:
    labels = np.ones((3, 300, 900), dtype=np.uint8)
    labels[1:, 100:200, 300:600] = 2
    frames = Recording.from_frames(np.full((3, 300, 900, 3), 90, dtype=np.uint8))
    book = ChainBook(see(Segmentation.from_labels(labels), recording=frames, how=(None, "scan lines")))
    book.go_to(1)
    picture = cv2.imdecode(np.frombuffer(book.frame_file(), dtype=np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    assert picture.shape == (213, 2 * 640 + 6, 3)
    assert book.panels.segment_at(book.frame, 320, 106) == 2


def test_the_widget_follows_slider_keys_and_clicks(seen: Seen) -> None:
    explorer = ChainExplorer(lambda **_: seen).wait()
    book = explorer.book
    assert book is not None
    explorer._place.value = 5
    assert book.place == 5
    explorer._frame.key = ["ArrowRight", 1]
    assert (book.place, explorer._place.value, explorer._play.value) == (6, 6, 6)
    assert explorer._told.value == book.told
    explorer._chain.clicked = [*book.table.centre_of(book.table.rows[0], 0), 1]
    assert book.row == book.table.rows[0]
    explorer._segments.value = (2, 3)
    assert book.chosen == [2, 3]
    calls: list[int] = []
    explorer.on_changed.append(lambda: calls.append(1))
    explorer._frame.key = ["m", 2]
    assert [label for _, label in explorer._segments.options] == [1, 2, 4]
    explorer._frame.key = ["u", 3]
    assert [label for _, label in explorer._segments.options] == [1, 2, 3, 4]
    assert calls == [1, 1]
    explorer._segments.value = (4,)
    explorer._name.value = "crate"
    assert book.observation.names[4] == "crate"
    explorer._frame.is_dark = True
    decoded = cv2.imdecode(np.frombuffer(explorer._chain.png, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert np.median(decoded[:, :20]) < 60


def test_errors_are_sentences_and_the_widget_lives_on(seen: Seen, tmp_path: Path) -> None:
    explorer = ChainExplorer(lambda **_: seen).wait()
    explorer._segments.value = (2,)
    explorer._frame.key = ["m", 1]
    assert explorer.alert == "merge: choose at least two segments that are parts of one object."
    explorer._frame.key = ["End", 2]
    assert (explorer.alert, explorer.book is not None and explorer.book.place) == ("", 11)
    broken = chain_explorer(tmp_path / "none.mp4").wait()
    assert "there is no such file" in broken.alert
    assert broken.book is None
    mismatch = chain_explorer(Segmentation.from_labels(labels_of_movie()), recording=np.zeros((12, 8, 8, 3), np.uint8))
    assert mismatch.wait().alert.startswith("masks: expected masks of 8×8")
    for wrong in ({"source": 7}, {"source": tmp_path, "recording": 7}):
        assert "expected a" in chain_explorer(**wrong).wait().alert  # type: ignore[arg-type]


def test_work_that_takes_long_shows_how_far_it_is_and_can_be_stopped(seen: Seen) -> None:
    def slowly(tell: object) -> Seen:
        for done in range(10_000):
            tell(done, 10_000)  # type: ignore[operator]
            time.sleep(0.002)
        return seen

    begun = time.monotonic()
    explorer = ChainExplorer(slowly)
    assert time.monotonic() - begun < 5
    assert explorer._work.is_running
    assert "of 10000 frames" in explorer._work._said.value
    explorer._work.stop()
    assert explorer.wait(10).alert == "Stopped; nothing was changed."
    explorer.explore(lambda **_: seen)
    assert explorer.wait().book is not None


def test_nothing_is_left_behind_by_a_thousand_moves(seen: Seen) -> None:
    explorer = ChainExplorer(lambda **_: seen).wait()

    def move(n: int) -> None:
        for number in range(n):
            explorer._place.value = number % 12

    move(60)
    tracemalloc.start()
    try:
        move(24)
        before = tracemalloc.get_traced_memory()[0]
        move(1000)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    # One picture that stayed behind each time would be some 20 MB.
    assert grown < 500_000


def test_the_report_is_given_what_scrubs(seen: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    from sec_lab.report import pages

    assert (pages.FOR_PAGES, pages.SCRUBBER) == (FOR_PAGES, SCRUBBER)
    explorer = ChainExplorer(lambda **_: seen).wait()
    monkeypatch.delenv(FOR_PAGES, raising=False)
    assert SCRUBBER not in explorer._repr_mimebundle_()
    monkeypatch.setenv(FOR_PAGES, "1")
    page = explorer._repr_mimebundle_()[SCRUBBER]
    assert page.count("data:image/webp") == 12 + 1
    assert pages.network_loads(page) == []
    assert explorer.book is not None
    assert explorer.book.place == 0


def test_a_scrubber_stays_within_its_bytes_and_keeps_key_frames(book: ChainBook) -> None:
    whole = scrubber_html(book)
    small = scrubber_html(book, most_bytes=len(whole) // 2)
    assert len(small) < 0.6 * len(whole)
    with pytest.raises(ValueError, match="two frames within 1000 bytes"):
        scrubber_html(book, most_bytes=1000)


def test_names_are_text_on_the_page(book: ChainBook) -> None:
    book.rename(4, "</script><b>cup</b>")
    book.step_row(1)
    page = scrubber_html(book)
    assert "<b>cup" not in page
    assert "&lt;b&gt;cup" in page


def test_arrays_are_explored_in_one_line_and_what_is_wrong_is_said() -> None:
    labels = np.ones((3, 20, 30), dtype=np.uint8)
    labels[1:, 5:15, 5:15] = 2
    frames = np.repeat(40 * labels[..., np.newaxis], 3, axis=3)
    for explorer in (chain_explorer(labels), chain_explorer(labels, recording=frames), chain_explorer(frames)):
        book = explorer.wait().book
        assert book is not None
        assert len(book.numbers) == 3
    wrong: dict[str, Any] = {
        "source: expected an Observation": [],
        "frames: expected at least one frame": frames[:0],
        "frames: expected": frames.astype(float),
    }
    for said, source in wrong.items():
        explorer = chain_explorer(source).wait()
        assert explorer.book is None
        assert said in explorer.alert
    assert "recording: expected a Recording" in chain_explorer(labels, recording=3).wait().alert
    assert "path: expected a path, got ndarray" in own_movie(frames).explorer.alert
