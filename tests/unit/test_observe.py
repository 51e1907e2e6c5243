"""`observe`: steps 1 to 4 joined, each frame read once, nothing kept."""

import gc
import itertools
import pickle
import tempfile
import threading
import time
import tracemalloc
import weakref
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import sec_lab as sl
from sec_lab import pipeline
from sec_lab.files import UnusableFileError
from sec_lab.pipeline import LabelledFrame, observe, segmenter
from sec_lab.recording import Calibration, Frame, Recording, write_movie
from sec_lab.recording.sharing import ReadAhead, shared, with_depth
from sec_lab.relations import SegmentRelations, scan_line_relations
from sec_lab.segmentation import Segmentation
from sec_lab.segmentation.colour import NamedColour, colour_segmentation
from sec_lab.segmentation.spool import spooled

COLOURS = (NamedColour("red box", (330, 30), (50, 100)), NamedColour("green box", (90, 150), (50, 100)))
by_colour = partial(colour_segmentation, colours=COLOURS)
LEFTS = (2, 6, 10, 14, 14, 8)


def pushed(lefts: Iterable[int] = LEFTS) -> NDArray[np.uint8]:
    """A red box is pushed to a green one and drawn back."""
    movie = np.full((len(tuple(lefts)), 16, 32, 3), 90, dtype=np.uint8)
    movie[:, 4:12, 20:28] = 10, 200, 10
    for frame, left in zip(movie, lefts, strict=True):
        frame[4:12, left : left + 6] = 200, 10, 10
    return movie


class Counted:
    """A recording that counts how often its frames are decoded, and how many are alive."""

    def __init__(self, movie: NDArray[np.uint8], depth: NDArray[np.float32] | None = None) -> None:
        self.read: list[int] = []
        self.movie, self.depth = movie, depth
        self.recording = Recording(
            self._frames, movie.shape[1:3], len(movie), has_depth=depth is not None, frames_per_second=25
        )

    def _frames(self) -> Iterator[Frame]:
        for index, image in enumerate(self.movie):
            self.read.append(index)
            yield Frame(index, image, depth_m=None if self.depth is None else self.depth[index])


def remember(seen: list[LabelledFrame]) -> Any:
    def follow(frames: Iterable[LabelledFrame]) -> Iterator[tuple[int, SegmentRelations]]:
        for number, labels, depth in frames:
            seen.append((number, labels, depth))
            yield number, scan_line_relations(labels)

    return follow


class TestObserve:
    def test_from_movie_to_chain(self) -> None:
        seen = sl.observe(Recording.from_frames(pushed()), segmentation=by_colour, over_time=None)
        table = seen.chain.to_frame()
        assert table.loc["green box, red box"].tolist() == [0, 2, 0]
        assert seen.key_frames.tolist() == [0, 3, 5]
        assert seen.position_unit == "px"
        assert seen.names[2] == "green box"

    def test_a_path_is_opened(self, tmp_path: Path) -> None:
        write_movie(tmp_path / "a.mkv", pushed(), frames_per_second=25, lossless=True)
        seen = observe(str(tmp_path / "a.mkv"), segmentation=by_colour, over_time=None)
        assert seen.key_frames.tolist() == [0, 3, 5]
        with pytest.raises(UnusableFileError, match="expected a movie, but there is no such file"):
            observe(tmp_path / "none.mp4", segmentation=by_colour, over_time=None)

    def test_segmentation_iterates_over_label_images_again(self) -> None:
        seen = observe(Recording.from_frames(pushed()), segmentation=by_colour, over_time=None)
        assert seen.segmentation is not None
        for _ in range(2):
            images = list(seen.segmentation)
            assert len(images) == 6
            assert np.unique(images[0]).tolist() == [0, 1, 2]
        for copied in (pickle.loads(pickle.dumps(seen)), sl.Observation([seen.graphs[0]], [0])):
            assert copied.segmentation is None

    def test_masks_alone(self) -> None:
        masks = by_colour(Recording.from_frames(pushed()))
        seen = observe(masks, over_time=None)
        assert seen.segmentation is masks
        assert seen.key_frames.tolist() == [0, 3, 5]

    def test_masks_of_another_tracker_with_a_stride(self) -> None:
        labels = list(by_colour(Recording.from_frames(pushed())))
        masks = Segmentation.from_labels(labels[::2], frames=[0, 2, 4], names={1: "box"})
        counted = Counted(pushed())
        seen = observe(counted.recording, segmentation=masks, over_time=None)
        assert seen.key_frames.tolist() == [0, 4]
        assert seen.names[1] == "box"
        assert counted.read == []  # without depth the pictures are not needed
        assert observe(counted.recording, segmentation=masks, over_time=None, names={2: "goal"}).names == {2: "goal"}

    def test_relations_over_time_get_frames_and_depth(self) -> None:
        depth = np.arange(6, dtype=np.float32)[:, None, None] * np.ones((16, 32), np.float32)
        counted, given = Counted(pushed(), depth), []  # type: ignore[var-annotated]
        seen = observe(counted.recording, segmentation=by_colour, over_time=remember(given))
        assert seen.key_frames.tolist() == [0, 3, 5]
        assert [number for number, _, _ in given] == list(range(6))
        assert [image.max() for _, _, image in given] == list(range(6))
        assert counted.read == list(range(6)), "each frame is decoded once, for segmentation and depth"
        assert seen.segmentation is not None
        assert len(list(seen.segmentation)) == 6

    def test_depth_of_masks_frames(self) -> None:
        depth = np.arange(6, dtype=np.float32)[:, None, None] * np.ones((16, 32), np.float32)
        masks = Segmentation.from_labels(list(by_colour(Recording.from_frames(pushed())))[1::2], frames=[1, 3, 5])
        given: list[LabelledFrame] = []
        observe(Counted(pushed(), depth).recording, segmentation=masks, over_time=remember(given))
        assert [image.max() for _, _, image in given if image is not None] == [1, 3, 5]

    def test_frames_that_were_left_out_have_no_depth(self) -> None:
        def read() -> Iterator[Frame]:
            for index in (0, 2):  # the second and the last are corrupt
                yield Frame(index, pushed()[index], depth_m=np.ones((16, 32), np.float32))

        masks = Segmentation.from_labels(list(by_colour(Recording.from_frames(pushed())))[:4])
        given: list[LabelledFrame] = []
        observe(Recording(read, (16, 32), 4, has_depth=True), segmentation=masks, over_time=remember(given))
        assert [depth is None for _, _, depth in given] == [False, True, False, True]
        with pytest.raises(
            ValueError, match="masks: expected masks of frames that the recording has, got one of frame 3"
        ):
            observe(Recording(read, (16, 32), None, has_depth=True), segmentation=masks, over_time=remember([]))

    def test_progress_bar(self, capsys: pytest.CaptureFixture[str]) -> None:
        observe(Recording.from_frames(pushed()), segmentation=by_colour, over_time=None, progress=True)
        assert "6/6" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            (
                {"segmentation": "snakes", "over_time": None},
                "segmentation: expected one of .'layers', 'potts'. or a function, got 'snakes'",
            ),
            ({"over_time": "never"}, "over_time: expected one of .'steady',. or a function, got 'never'"),
            ({"relations": "boxes"}, "relations: expected one of"),
            ({"relations": "edge counting", "over_time": remember([])}, "relations: expected those of each frame"),
            ({"segmentation": lambda _: [], "over_time": None}, "expected a Segmentation from the function, got list"),
            ({"relations": lambda _: 3, "over_time": None}, "frame 0: relations: expected SegmentRelations"),
        ],
    )
    def test_bad_options(self, options: dict[str, Any], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            observe(Recording.from_frames(pushed()), **{"segmentation": by_colour, **options})

    def test_masks_that_do_not_fit(self) -> None:
        movie = Recording.from_frames(pushed())
        with pytest.raises(ValueError, match="masks: expected masks of 16×32 like the pictures, got 4×5"):
            observe(movie, over_time=None, segmentation=Segmentation.from_labels(np.ones((1, 4, 5), int)))
        with pytest.raises(ValueError, match="masks: expected masks of frames that the recording has"):
            observe(movie, over_time=None, segmentation=Segmentation.from_labels(np.ones((7, 16, 32), int)))

    def test_no_frame_at_all(self) -> None:
        nothing = Segmentation(lambda: iter([]), (4, 5))
        with pytest.raises(ValueError, match="movie: expected at least one label image, got none"):
            observe(nothing, over_time=None)

    def test_names_of_methods(self) -> None:
        assert segmenter(by_colour) is by_colour


def test_long_movies_need_no_more_memory() -> None:
    """Pictures and depth of 40 frames would take 40 MB, and label images 6 MB."""

    def read(n: int) -> Iterator[Frame]:
        for index in range(n):
            image = np.full((256, 320, 3), 90, dtype=np.uint8)
            image[50:90, 100 + index % 2 * 40 :][:, :60] = 200, 10, 10
            yield Frame(index, image, depth_m=np.ones((256, 320), np.float32))

    def peak(n: int) -> int:
        gc.collect()
        tracemalloc.start()
        recording = Recording(partial(read, n), (256, 320), n, has_depth=True)
        observe(
            recording,
            segmentation=by_colour,
            over_time=lambda frames: ((i, scan_line_relations(x)) for i, x, _ in frames),
        )
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(3)
    # Which stage is ahead of which is chance: one frame of 0.9 MB more may be alive.
    assert peak(48) < peak(8) + 1_500_000


class TestShared:
    def test_whoever_reads_again_begins_anew(self) -> None:
        counted = Counted(pushed())
        recording, beside = shared(counted.recording)
        assert [frame.index for frame in recording] == [frame.index for frame in beside] == list(range(6))
        assert counted.read == list(range(6))
        assert [frame.index for frame in recording] == list(range(6))
        assert len(counted.read) == 12

    def test_a_look_at_the_first_frame_takes_none_away(self) -> None:
        recording, beside = shared(Counted(pushed()).recording)
        next(iter(recording))
        assert [frame.index for frame in recording] == [frame.index for frame in beside] == list(range(6))

    def test_nothing_is_kept_for_a_reader_that_never_comes(self) -> None:
        counted = Counted(pushed())
        recording, beside = shared(counted.recording)
        assert len(list(beside)) == 6
        assert [frame.index for frame in recording] == list(range(6))
        assert len(counted.read) == 12

    @given(st.lists(st.booleans(), max_size=14))
    def test_either_may_be_ahead(self, turns: list[bool]) -> None:
        counted = Counted(pushed())
        recording, beside = shared(counted.recording)
        readers = {True: iter(recording), False: beside}
        seen: dict[bool, list[int]] = {True: [], False: []}
        next(readers[True])
        for turn in turns:
            frame = next(readers[turn], None)
            if frame is not None:
                seen[turn].append(frame.index)
        assert seen[True] == list(range(1, 1 + len(seen[True])))
        assert seen[False] == list(range(len(seen[False])))
        assert len(counted.read) == max(len(seen[True]) + 1, len(seen[False]))

    def test_depth_begins_anew_with_every_reading(self) -> None:
        def start() -> Any:
            n = 0

            def depth_of(frame: Frame) -> NDArray[np.float32]:
                nonlocal n
                n += 1
                return np.full(frame.image.shape[:2], n, dtype=np.float32)

            return depth_of

        recording = with_depth(Recording.from_frames(pushed()), start)
        assert recording.has_depth
        for _ in range(2):
            assert [frame.depth_m.max() for frame in recording if frame.depth_m is not None] == [1, 2, 3, 4, 5, 6]

    def test_depth_that_cannot_be_found_is_said_with_its_frame(self) -> None:
        def start() -> Any:
            return lambda frame: np.full((1, 1) if frame.index == 4 else (16, 32), 1, dtype=np.float32)

        with pytest.raises(ValueError, match="frame 4: depth: expected 16×32 like the picture"):
            list(with_depth(Recording.from_frames(pushed()), start))


class TestStereo:
    """Depth from the pictures of two cameras, whatever finds the disparity."""

    @pytest.fixture
    def found(self, monkeypatch: pytest.MonkeyPatch) -> list[int]:
        """Numbers of the pairs that were matched, one list for all readings."""
        pairs: list[int] = []

        class Estimator:
            def __init__(self, *, fill: bool) -> None:
                assert not fill, "what lies in holes is for the segments to say"

            def __call__(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
                pairs.append(int(right[0, 0, 0]))
                return np.full(left.shape[:2], 1 + right[0, 0, 0], dtype=np.float32)

        def to_depth(disparity: NDArray[np.float32], camera: Calibration) -> NDArray[np.float32]:
            assert camera.baseline_m is not None
            return (camera.focal_length_px * camera.baseline_m / disparity).astype(np.float32)

        known = {pipeline._DISPARITY: Estimator, pipeline._DEPTH: to_depth}
        monkeypatch.setattr(pipeline, "_imported", known.__getitem__)
        return pairs

    @staticmethod
    def pair(camera: Calibration | None) -> Recording:
        right = np.zeros((6, 16, 32, 3), np.uint8)
        right[:] = np.arange(6)[:, None, None, None]
        return Recording.from_frames(pushed(), right=right, calibration=camera)

    def test_segmentation_and_relations_get_the_same_depth(self, found: list[int]) -> None:
        deep: list[float] = []

        def segment(recording: Recording) -> Segmentation:
            assert recording.has_depth

            def read() -> Iterator[tuple[int, Any]]:
                for frame, item in zip(recording, by_colour(self.pair(None)).numbered(), strict=True):
                    assert frame.depth_m is not None
                    deep.append(float(frame.depth_m.max()))
                    yield item

            return Segmentation(read, recording.size)

        given: list[LabelledFrame] = []
        observe(self.pair(Calibration(200, (16, 8), baseline_m=0.3)), segmentation=segment, over_time=remember(given))
        assert deep == pytest.approx([60, 30, 20, 15, 12, 10])
        assert [depth.max() for _, _, depth in given if depth is not None] == pytest.approx(deep)
        assert found == [0, 1, 2, 3, 4, 5], "each pair is matched once"

    @pytest.mark.parametrize("camera", [None, Calibration(200, (16, 8))])
    def test_without_a_baseline_there_is_no_depth(self, found: list[int], camera: Calibration | None) -> None:
        given: list[LabelledFrame] = []
        observe(self.pair(camera), segmentation=by_colour, over_time=remember(given))
        assert [depth for _, _, depth in given] == [None] * 6
        assert found == []


class TestSpool:
    def test_is_computed_once(self) -> None:
        counted = Counted(pushed())
        plain = by_colour(counted.recording)
        with tempfile.TemporaryFile() as file:
            kept = spooled(plain, file)
            once, again = list(kept.numbered()), list(kept.numbered())
            assert len(counted.read) == 6
            for (number, image), (other, copy), truth in zip(once, again, plain, strict=True):
                assert number == other
                np.testing.assert_array_equal(image, truth)
                np.testing.assert_array_equal(copy, truth)
            assert kept.names == plain.names
            assert kept.size == plain.size

    def test_what_was_broken_off_is_computed_anew(self) -> None:
        with tempfile.TemporaryFile() as file:
            kept = spooled(by_colour(Recording.from_frames(pushed())), file)
            next(iter(kept))
            assert len(list(kept)) == len(list(kept)) == 6


def test_what_is_read_ahead_is_the_same_and_one_item_ahead() -> None:
    made: list[int] = []
    is_ahead = threading.Event()

    def items() -> Iterator[int]:
        for k in range(5):
            made.append(k)
            if k == 1:
                is_ahead.set()
            yield k

    reading = ReadAhead(items())
    assert made == []
    assert next(reading) == 0
    assert is_ahead.wait(10)  # while the first item is in use
    for k in range(1, 5):
        assert next(reading) == k
        assert max(made) <= k + 1
    assert list(reading) == []


def test_an_error_ahead_comes_in_its_place_and_keeps_nothing_alive() -> None:
    class Large:
        pass

    def items() -> Iterator[int]:
        large = Large()
        alive.append(weakref.ref(large))
        yield 0
        raise ValueError("frame 1: broken")

    alive: list[weakref.ref[Large]] = []
    reading = ReadAhead(items())
    assert next(reading) == 0
    gc.disable()
    try:
        with pytest.raises(ValueError, match="frame 1: broken") as raised:
            next(reading)
        del raised
        assert alive[0]() is None
    finally:
        gc.enable()
    assert list(reading) == []


def test_who_closes_a_reading_leaves_no_thread_behind() -> None:
    before = threading.active_count()
    inner = ReadAhead(itertools.count())
    outer = ReadAhead(iter(inner))
    assert next(outer) == 0
    assert threading.active_count() == before + 2
    outer.close()
    inner.close()
    assert threading.active_count() == before
    assert list(outer) == list(inner) == []


def test_a_reading_that_is_dropped_ends_by_itself() -> None:
    before = set(threading.enumerate())
    reading = ReadAhead(itertools.count())
    assert next(reading) == 0
    (worker,) = set(threading.enumerate()) - before
    del reading
    worker.join(10)
    assert not worker.is_alive()


def test_an_error_in_the_relations_stops_the_segmentation() -> None:
    def broken(labelled: Iterable[LabelledFrame]) -> Iterator[tuple[int, SegmentRelations]]:
        for number, labels, _ in labelled:
            if number == 2:
                raise RuntimeError("no relations today")
            yield number, scan_line_relations(labels)

    before = threading.active_count()
    with pytest.raises(RuntimeError, match="no relations today") as raised:
        observe(Recording.from_frames(pushed()), over_time=broken, segmentation=by_colour)
    assert raised.tb is not None  # what it has seen is still there, but nobody works on
    assert threading.active_count() == before


def test_a_method_may_use_the_memory_of_its_labels_again() -> None:
    frames = pushed()
    given = [np.asarray(image) for image in by_colour(Recording.from_frames(frames))]

    def reusing(recording: Recording) -> Segmentation:
        def read() -> Iterator[tuple[int, NDArray[np.uint16]]]:
            buffer = np.empty(recording.size, np.uint16)
            for number, labels in enumerate(given):
                buffer[:] = labels
                yield number, buffer

        return Segmentation(read, recording.size, background=0)

    def slow(labelled: Iterable[LabelledFrame]) -> Iterator[tuple[int, SegmentRelations]]:
        for number, labels, _ in labelled:
            time.sleep(0.01)  # the method has gone on by now
            np.testing.assert_array_equal(labels, given[number])
            yield number, scan_line_relations(labels)

    observe(Recording.from_frames(frames), over_time=slow, segmentation=reusing)


def test_two_readers_in_threads_of_their_own_get_the_same_frames() -> None:
    def slow() -> Iterator[Frame]:
        for number in range(50):
            time.sleep(0.001)  # lets the other thread go on in the middle of a frame
            yield Frame(number, np.zeros((1, 1, 3), np.uint8))

    movie = replace(Recording.from_frames(np.zeros((50, 1, 1, 3), np.uint8)), read=slow)
    again, beside = shared(movie)
    with ThreadPoolExecutor(2) as pool:
        results = [pool.submit(list, frames) for frames in (iter(again), beside)]
    one, other = (result.result() for result in results)
    assert [frame.index for frame in one] == [frame.index for frame in other] == list(range(50))
    assert all(a is b for a, b in zip(one, other, strict=True))
