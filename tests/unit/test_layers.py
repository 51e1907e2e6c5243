"""What the layered segmentation is for, on drawn colour movies: what rests, moves, is carried, covered or put down.

The pictures are small, with noise, a table whose light falls off to one side, and a hand that comes in from the right
with its arm. What is to be seen where is known, and labels are asked for there.
"""

import dataclasses
from collections.abc import Iterator, Sequence

import cv2
import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.recording import Frame, Recording
from sec_lab.segmentation.layer_parameters import LayerParameters
from sec_lab.segmentation.layers import layered_segments
from tests.drawn_scenes import (
    BLUE,
    GREEN,
    HAND_NUMBER,
    HEIGHT,
    RED,
    TABLE_NUMBER,
    WIDTH,
    Block,
    Moment,
    Place,
    drawn,
    plane,
)

BACKGROUND = 1
Labels = NDArray[np.uint16]


class Movie:
    """Frames and truth of moments, each with noise of its own."""

    def __init__(self, moments: Sequence[Moment], *, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        pairs = [drawn(moment, rng.normal(0, 2, (HEIGHT, WIDTH, 3))) for moment in moments]
        self.frames = np.stack([picture for picture, _ in pairs])
        self.truth = np.stack([truth for _, truth in pairs])
        self.recording = Recording.from_frames(self.frames)
        self.labels: list[Labels] = list(layered_segments(self.recording))

    def label(self, frame: int, number: int, *, share: float = 0.8) -> int:
        """The label of what the truth knows by a number; it has to have most of it."""
        inside = self.truth[frame] == number
        assert inside.sum() > 40, "drawn too small to ask for"
        found, counts = np.unique(self.labels[frame][inside], return_counts=True)
        assert counts.max() >= share * inside.sum(), (
            f"frame {frame}: expected one label for {number}, got {dict(zip(found, counts, strict=True))}"
        )
        return int(found[counts.argmax()])

    def seen(self, frame: int, *, least_px: int = 20) -> set[int]:
        """Labels that have some pixels."""
        found, counts = np.unique(self.labels[frame], return_counts=True)
        return {int(label) for label, n in zip(found, counts, strict=True) if n >= least_px}


def path(start: Place, end: Place, *, step_px: float = 4) -> list[Place]:
    """Places from start to end, so many pixels apart."""
    n = max(1, round(float(np.hypot(end[0] - start[0], end[1] - start[1])) / step_px))
    return [(start[0] + (end[0] - start[0]) * k / n, start[1] + (end[1] - start[1]) * k / n) for k in range(n + 1)]


RED_BLOCK, BLUE_BLOCK = Block((24, 30), RED), Block((74, 40), BLUE)
STILL = [Moment((RED_BLOCK, BLUE_BLOCK))] * 8
OUTSIDE = WIDTH + 2
FAR_IN = 62


def visit(row: float, blocks: Sequence[Block], *, stay: int = 6, to: float = FAR_IN) -> list[Moment]:
    """The hand comes in, stays and goes, and takes nothing."""
    way = path((row, OUTSIDE), (row, to))
    return [Moment(blocks, hand) for hand in (*way, *[way[-1]] * stay, *way[::-1])]


class TestHand:
    def test_it_is_one_segment_while_it_is_there(self) -> None:
        movie = Movie([*STILL, *visit(48, (RED_BLOCK, BLUE_BLOCK)), *STILL])
        assert movie.seen(0) == {1, 2, 3}
        there = [k for k, truth in enumerate(movie.truth) if (truth == HAND_NUMBER).sum() > 300]
        assert len(there) > 20
        (hand,) = {movie.label(k, HAND_NUMBER) for k in there}
        assert hand not in {1, 2, 3}
        assert all(movie.seen(k) == {1, 2, 3, hand} for k in there)
        assert movie.seen(-1) == {1, 2, 3}

    def test_what_rests_keeps_its_label(self) -> None:
        movie = Movie([*STILL, *visit(48, (RED_BLOCK, BLUE_BLOCK)), *STILL])
        red, blue = movie.label(0, 1), movie.label(0, 2)
        assert {red, blue} == {2, 3}
        for k in range(len(movie.labels)):
            assert (movie.label(k, TABLE_NUMBER, share=0.95), movie.label(k, 1), movie.label(k, 2)) == (1, red, blue)

    def test_it_comes_again_under_the_same_label(self) -> None:
        once = visit(48, (RED_BLOCK, BLUE_BLOCK))
        movie = Movie([*STILL, *once, *STILL, *once, *STILL])
        first, second = len(STILL) + len(once) // 2, 2 * len(STILL) + len(once) + len(once) // 2
        hand = movie.label(first, HAND_NUMBER)
        assert movie.seen(first + len(once) // 2 + 4) == {1, 2, 3}
        assert movie.label(second, HAND_NUMBER) == hand

    def test_it_may_rest_for_long(self) -> None:
        movie = Movie([*STILL, *visit(48, (RED_BLOCK, BLUE_BLOCK), stay=100), *STILL])
        hand = movie.label(30, HAND_NUMBER)
        assert all(movie.label(k, HAND_NUMBER, share=0.9) == hand for k in range(30, 120, 10))
        assert movie.seen(-1) == {1, 2, 3}

    def test_it_may_be_there_from_the_beginning(self) -> None:
        way = path((48, FAR_IN), (48, OUTSIDE))
        there = [Moment((RED_BLOCK, BLUE_BLOCK), hand) for hand in (*[way[0]] * 8, *way)]
        movie = Movie([*there, *STILL, *STILL])
        hand = movie.label(0, HAND_NUMBER)
        assert movie.seen(0) == {1, 2, 3, 4}
        assert all(movie.label(k, HAND_NUMBER) == hand for k in range(8 + 10))
        assert movie.seen(-1) == {1, 2, 3}
        assert (movie.label(-1, 1), movie.label(-1, 2)) == (movie.label(0, 1), movie.label(0, 2))

    @pytest.mark.parametrize("later_by", [0, 1, 12])
    def test_two_hands_are_two_segments(self, later_by: int) -> None:
        """The second one comes in from the left, a little below, at the same time or later."""
        blocks = (Block((14, 60), RED), Block((80, 60), BLUE))
        right = [*path((36, OUTSIDE), (36, 78)), *[(36.0, 78.0)] * (later_by + 8)]
        left = [*[None] * later_by, *path((62, OUTSIDE), (62, 78)), *[(62.0, 78.0)] * 8]
        movie = Movie([Moment(blocks)] * (8 + len(right)))
        rng = np.random.default_rng(2)
        for k, (one, other) in enumerate(zip(right, left, strict=True), start=8):
            movie.frames[k], movie.truth[k] = drawn(Moment(blocks, one), rng.normal(0, 2, (HEIGHT, WIDTH, 3)))
            picture, truth = drawn(Moment(hand=other), rng.normal(0, 2, (HEIGHT, WIDTH, 3)))
            inside = truth[:, ::-1] == HAND_NUMBER
            movie.frames[k][inside], movie.truth[k][inside] = picture[:, ::-1][inside], HAND_NUMBER + 1
        movie.labels = list(layered_segments(Recording.from_frames(movie.frames)))
        hands = movie.label(-1, HAND_NUMBER), movie.label(-1, HAND_NUMBER + 1)
        assert len({1, 2, 3, *hands}) == 5
        assert movie.seen(-1) == {1, 2, 3, *hands}

    def test_another_one_is_another_segment(self) -> None:
        # A green block is pushed in, over the border, where the hand was before.
        once = visit(48, (RED_BLOCK, BLUE_BLOCK))
        blocks = [Block((48, column), GREEN, 24, 50) for _, column in path((48, WIDTH + 24), (48, 90))]
        movie = Movie([*STILL, *once, *STILL, *(Moment((RED_BLOCK, BLUE_BLOCK, block)) for block in blocks)])
        hand = movie.label(len(STILL) + len(once) // 2, HAND_NUMBER)
        assert movie.label(-1, 3) not in {1, 2, 3, hand}


def carrying(first: Place, last: Place, others: Sequence[Block] = ()) -> list[Moment]:
    """The hand fetches a red block from one place to another and goes; the finger tips hide its right side."""

    def held(place: Place) -> Place:
        return place[0], place[1] + 4

    approach = path((first[0], OUTSIDE), held(first))
    way = path(first, last)
    leave = path(held(last), (last[0], OUTSIDE))
    return [
        *[Moment((Block(first, RED), *others))] * 8,
        *(Moment((Block(first, RED), *others), hand) for hand in approach),
        *[Moment((Block(first, RED), *others), held(first))] * 4,
        *(Moment((Block(place, RED), *others), held(place)) for place in way),
        *[Moment((Block(last, RED), *others), held(last))] * 4,
        *(Moment((Block(last, RED), *others), hand) for hand in leave),
        *[Moment((Block(last, RED), *others))] * 16,
    ]


class TestLid:
    """A red lid on a green box, of which a strip is to be seen: one thing, as long as nobody lifts the lid."""

    BOX, ON, BESIDE = Block((50, 30), GREEN, 26, 22), (47.0, 30.0), (47.0, 76.0)

    def lid(self, place: Place) -> Block:
        return Block(place, RED, 22, 22)

    def opened(self) -> Movie:
        def moment(place: Place, hand: Place | None = None) -> Moment:
            return Moment((self.BOX, self.lid(place)), hand)

        def held(place: Place) -> Place:
            return place[0], place[1] + 6

        return Movie(
            [
                *[moment(self.ON)] * 8,
                *(moment(self.ON, hand) for hand in path((47, OUTSIDE), held(self.ON))),
                *(moment(place, held(place)) for place in path(self.ON, self.BESIDE)),
                *(moment(self.BESIDE, hand) for hand in path(held(self.BESIDE), (47, OUTSIDE))),
                *[moment(self.BESIDE)] * 16,
            ]
        )

    def test_what_comes_to_light_below_it_is_a_segment_of_its_own(self) -> None:
        movie = self.opened()
        assert movie.seen(0) == {1, 2}
        lid, box = movie.label(-1, 2), movie.label(-1, 1, share=0.7)
        assert lid == movie.label(0, 2) == 2
        assert box not in {1, lid, movie.label(30, HAND_NUMBER)}
        assert movie.seen(-1) == {1, lid, box}


class TestBook:
    """A red book of whose pages a strip is to be seen, in the shade, until a hand takes the upper cover off them."""

    LOWER, PAGES = Block((50, 30), RED, 52, 46), Block((49, 30), (228, 224, 210), 42, 38)
    SIDE = Block((67, 30), (160, 157, 147), 7, 38)

    def test_what_comes_to_light_below_the_cover_is_of_the_pages(self) -> None:
        def moment(place: Place, hand: Place | None = None) -> Moment:
            return Moment((self.LOWER, self.PAGES, self.SIDE, Block(place, RED, 36, 46)), hand)

        closed, aside = (46.0, 30.0), (46.0, 80.0)
        movie = Movie(
            [
                *[moment(closed)] * 8,
                *(moment(closed, hand) for hand in path((47, OUTSIDE), (47, 38))),
                *(moment(place, (47, place[1] + 8)) for place in path(closed, aside)),
                *(moment(aside, hand) for hand in path((47, 88), (47, OUTSIDE))),
                *[moment(aside)] * 16,
            ]
        )
        assert movie.seen(0) == {1, 2, 3}
        pages = movie.label(0, 3)
        assert pages != movie.label(0, 4)
        assert movie.label(-1, 2) == pages


class TestCarriedObject:
    @pytest.mark.parametrize(("first", "last"), [((24, 30), (24, 66)), ((24, 66), (24, 30)), ((20, 44), (74, 44))])
    def test_it_keeps_its_label_and_leaves_the_background(self, first: Place, last: Place) -> None:
        movie = Movie(carrying(first, last))
        block = movie.label(0, 1)
        assert block == 2
        for k in range(len(movie.labels)):
            if (movie.truth[k] == 1).sum() > 150:
                assert movie.label(k, 1, share=0.6) == block
        assert movie.label(-1, 1) == block
        assert movie.seen(-1) == {1, block}
        left = (movie.truth[0] == 1) & (movie.truth[-1] == 0)
        assert (movie.labels[-1][left] == BACKGROUND).mean() > 0.95

    def test_it_is_put_beside_another_one(self) -> None:
        other = Block((74, 62), BLUE)
        movie = Movie(carrying((20, 44), (74, 44), [other]))
        red, blue = movie.label(0, 1), movie.label(0, 2)
        assert (movie.label(-1, 1), movie.label(-1, 2)) == (red, blue)
        assert movie.seen(-1) == {1, red, blue}

    def test_it_is_carried_over_another_one(self) -> None:
        other = Block((48, 44), BLUE)
        movie = Movie([dataclasses.replace(m, blocks=m.blocks[::-1]) for m in carrying((20, 44), (78, 44), [other])])
        red, blue = movie.label(0, 2), movie.label(0, 1)
        assert (movie.label(-1, 2), movie.label(-1, 1)) == (red, blue)
        assert movie.seen(-1) == {1, red, blue}

    def test_it_is_carried_out_of_the_picture(self) -> None:
        # Block and hand go out together; nothing is left where the block was.
        moments = carrying((24, 30), (24, WIDTH + 12))
        movie = Movie([*moments, *[Moment(())] * 10])
        assert movie.seen(-1) == {1}


class TestPutDown:
    """Things that are seen for the first time in the hand."""

    def brought(self, colour: tuple[int, int, int] = GREEN) -> list[Moment]:
        last = (48.0, 50.0)
        way = path((48, OUTSIDE + 8), last)
        return [
            *STILL,
            *(Moment((RED_BLOCK, BLUE_BLOCK, Block(place, colour)), (place[0], place[1] + 4)) for place in way),
            *[Moment((RED_BLOCK, BLUE_BLOCK, Block(last, colour)), (last[0], last[1] + 4))] * 4,
            *(
                Moment((RED_BLOCK, BLUE_BLOCK, Block(last, colour)), hand)
                for hand in path((48, 54), (48, OUTSIDE), step_px=3)
            ),
            *[Moment((RED_BLOCK, BLUE_BLOCK, Block(last, colour)))] * 30,
        ]

    def test_what_is_left_behind_is_a_segment_of_its_own(self) -> None:
        movie = Movie(self.brought())
        # All of it but a rim of one pixel, 16×16 of 18×18.
        new = movie.label(-1, 3, share=0.75)
        assert new not in {1, 2, 3}
        assert movie.seen(-1) == {1, 2, 3, new}

    def test_even_if_it_looks_like_another_one(self) -> None:
        movie = Movie(self.brought(RED))
        assert movie.label(-1, 3, share=0.75) not in {1, 2, 3}
        assert movie.label(-1, 1) == movie.label(0, 1)

    def test_and_is_not_the_hand(self) -> None:
        brought = self.brought()
        movie = Movie([*brought, *visit(48, (RED_BLOCK, BLUE_BLOCK, Block((48, 50), GREEN)), to=72)])
        middle, before = len(brought) + 15, len(brought) - 1
        assert movie.label(middle, HAND_NUMBER) != movie.label(middle, 3, share=0.75)
        assert movie.label(-1, 3, share=0.75) == movie.label(before, 3, share=0.75)


class TestCovered:
    def test_an_object_has_its_label_again(self) -> None:
        hidden = Block((48, 80), BLUE, 10, 10)
        movie = Movie(
            [
                *[Moment((RED_BLOCK, hidden))] * 8,
                *visit(48, (RED_BLOCK, hidden), stay=20),
                *[Moment((RED_BLOCK, hidden))] * 4,
            ]
        )
        red, blue = movie.label(0, 1), movie.label(0, 2)
        middle = 8 + 15 + 10
        assert not (movie.truth[middle] == 2).any()
        assert movie.seen(middle) == {1, red, movie.label(middle, HAND_NUMBER)}
        assert movie.label(-1, 2) == blue
        assert movie.seen(-1) == {1, red, blue}


class TestLight:
    def test_a_shadow_that_stays_is_no_segment(self) -> None:
        movie = Movie([*STILL, *[dataclasses.replace(STILL[0], shadow=(48, 80))] * 40, *STILL])
        assert movie.frames[20, 48, 80].mean() < 0.8 * movie.frames[0, 48, 80].mean()
        assert all(movie.seen(k) == {1, 2, 3} for k in range(len(movie.labels)))

    def test_nor_is_the_shadow_of_a_hand(self) -> None:
        moments = [
            dataclasses.replace(m, shadow=None if m.hand is None else (m.hand[0] + 20, m.hand[1] + 20))
            for m in visit(40, (RED_BLOCK, BLUE_BLOCK), stay=25)
        ]
        movie = Movie([*STILL, *moments, *STILL])
        for k in range(len(STILL), len(STILL) + len(moments)):
            # Where the hand's own blurred rim is not.
            away = (movie.truth[k] == 0) & ~cv2.dilate(
                (movie.truth[k] == HAND_NUMBER).astype(np.uint8), np.ones((5, 5), np.uint8)
            ).astype(bool)
            assert (movie.labels[k][away] == BACKGROUND).mean() > 0.95
            assert len(movie.seen(k) - {1, 2, 3}) <= 1
        assert movie.seen(-1) == {1, 2, 3}

    @pytest.mark.parametrize("gain", [0.7, 0.9, 1.1, 1.4])
    @pytest.mark.parametrize("n_frames", [1, 12])
    def test_a_change_of_exposure_changes_no_label(self, gain: float, n_frames: int) -> None:
        """At once, or within half a second."""
        gains = [*[1.0] * 8, *np.linspace(1, gain, n_frames + 1)[1:], *[gain] * 25]
        movie = Movie([dataclasses.replace(STILL[0], gain=value) for value in gains])
        for image in movie.labels:
            assert set(np.unique(image)) == {1, 2, 3}
            assert (image == movie.labels[0]).mean() > 0.99

    def test_a_hand_comes_while_the_exposure_changes(self) -> None:
        moments = visit(48, (RED_BLOCK, BLUE_BLOCK), stay=10)
        gains = np.interp(np.arange(len(moments)), [8, 20], [1, 0.9])
        changed = [dataclasses.replace(m, gain=float(g)) for m, g in zip(moments, gains, strict=True)]
        movie = Movie([*STILL, *changed, *[dataclasses.replace(m, gain=0.9) for m in STILL]])
        middle = len(STILL) + len(moments) // 2
        assert movie.seen(middle) == {1, 2, 3, movie.label(middle, HAND_NUMBER)}
        assert movie.seen(-1) == {1, 2, 3}


class TestReading:
    @staticmethod
    def watched(recording: Recording, reads: list[int]) -> Recording:
        def read() -> Iterator[Frame]:
            for frame in recording:
                reads.append(frame.index)
                yield frame

        return dataclasses.replace(recording, read=read)

    def test_it_is_lazy_and_begins_anew(self) -> None:
        movie = Movie([*STILL, *visit(48, (RED_BLOCK, BLUE_BLOCK))])
        reads: list[int] = []
        segmentation = layered_segments(self.watched(movie.recording, reads))
        assert reads == []
        images = iter(segmentation)
        next(images)
        assert len(reads) == LayerParameters().opening_frames
        list(zip(range(8), images, strict=False))
        assert len(reads) <= 10
        assert segmentation.background == BACKGROUND
        assert segmentation.size == (HEIGHT, WIDTH)
        for _ in range(2):
            np.testing.assert_array_equal(np.stack(list(segmentation)), np.stack(movie.labels))

    @pytest.mark.parametrize("size", [(1, 1), (1, 40), (3, 2), (9, 14), (24, 33)])
    def test_pictures_of_any_size_and_content(self, size: tuple[int, int]) -> None:
        rng = np.random.default_rng(0)
        frames = rng.integers(0, 256, (9, *size, 3)).astype(np.uint8)
        depth = rng.uniform(0.5, 2, (9, *size))
        for recording in (Recording.from_frames(frames), Recording.from_frames(frames, depth=depth)):
            labels = np.stack(list(layered_segments(recording)))
            assert labels.shape == (9, *size)
            assert labels.dtype == np.uint16
            assert labels.min() >= 1

    @pytest.mark.parametrize("n_frames", [1, 3])
    def test_movies_shorter_than_the_opening(self, n_frames: int) -> None:
        movie = Movie(STILL[:n_frames])
        assert len(movie.labels) == n_frames
        assert all(set(np.unique(image)) == {1, 2, 3} for image in movie.labels)

    def test_frame_numbers_are_those_of_the_recording(self) -> None:
        numbered = [(frame.index, frame.image) for frame in Movie(STILL).recording]

        def read() -> Iterator[Frame]:
            return (Frame(3 * index + 4, image) for index, image in numbered)

        recording = dataclasses.replace(Movie(STILL).recording, read=read)
        assert [number for number, _ in layered_segments(recording).numbered()] == [3 * k + 4 for k in range(8)]

    def test_number_of_threads_changes_nothing(self) -> None:
        recording = Movie(carrying((24, 30), (24, 66))).recording
        threads = numba.get_num_threads(), cv2.getNumThreads()
        found = []
        try:
            for n_threads in (1, 2):
                numba.set_num_threads(min(n_threads, numba.config.NUMBA_NUM_THREADS))
                cv2.setNumThreads(n_threads)
                found.append(np.stack(list(layered_segments(recording))))
        finally:
            numba.set_num_threads(threads[0])
            cv2.setNumThreads(threads[1])
        np.testing.assert_array_equal(found[0], found[1])


class TestDepth:
    block = np.s_[34:62, 46:76]

    def recording(self, *, depth: bool) -> Recording:
        """A block of the table's own colour, 8 cm high."""
        rng = np.random.default_rng(3)
        # Its sides are told by a thin dark line, as by a shadow.
        frames = np.stack([drawn(Moment(), rng.normal(0, 2, (HEIGHT, WIDTH, 3)))[0] for _ in range(8)]).astype(int)
        rows, columns = self.block
        frames[:, rows.start - 1 : rows.stop + 1, columns.start - 1 : columns.stop + 1] -= 25
        frames[:, rows, columns] += 25
        metres = np.broadcast_to(plane(), (8, HEIGHT, WIDTH)).copy()
        metres[:, rows, columns] -= 0.08
        metres = 1 / (1 / metres + rng.normal(0, 0.004, metres.shape))
        metres[rng.random(metres.shape) < 0.1] = 0
        return Recording.from_frames(frames.astype(np.uint8), depth=metres if depth else None)

    def test_what_rises_above_the_table_is_a_segment_although_it_has_its_colour(self) -> None:
        image = next(iter(layered_segments(self.recording(depth=True))))
        truth = np.ones((HEIGHT, WIDTH), int)
        truth[self.block] = 2
        assert set(np.unique(image)) == {1, 2}
        assert (image == truth)[self.block].mean() > 0.9
        assert (image == truth).mean() > 0.97

    def test_without_depth_it_is_not(self) -> None:
        image = next(iter(layered_segments(self.recording(depth=False))))
        assert (image[self.block] == BACKGROUND).mean() > 0.9


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"lightness_sigma": 0}, "lightness_sigma: expected a number above 0, got 0"),
        ({"unknown_cost": -1}, "unknown_cost: expected a number from 0 on, got -1"),
        ({"bond": float("nan")}, "bond: expected a finite number, got nan"),
        ({"far_cost": "5"}, "far_cost: expected a finite number, got '5'"),
        ({"memory": 1.01}, "memory: expected a share from 0 to 1, got 1.01"),
        ({"sweeps": 1.5}, "sweeps: expected whole numbers, got 1.5"),
        ({"opening_frames": 0}, "opening_frames: expected a whole number from 1 on, got 0"),
        # Counted in 8 bits: more would never be reached.
        ({"settle_frames": 251}, "settle_frames: expected a whole number from 1 to 250, got 251"),
    ],
)
def test_bad_parameters(values: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        LayerParameters(**values)  # type: ignore[arg-type]
