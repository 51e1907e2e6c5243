"""Segments followed through drawn movies in which it is known what happens."""

import dataclasses
import threading

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.recording import Recording
from sec_lab.segmentation import (
    PottsParameters,
    SegmentEvent,
    TrackingParameters,
    superparamagnetic_clustering,
    track_segments,
    tracked_frames,
)
from sec_lab.worlds.drawn import moving_object

GROUND, RED, BLUE, WHITE = (60, 110, 70), (190, 60, 50), (60, 70, 190), (230, 230, 225)
Box = tuple[int, int, int, int, tuple[int, int, int]]


def movie(boxes_of_frames: list[list[Box]], *, size: tuple[int, int] = (80, 120), noise: float = 2) -> Recording:
    """Boxes (top, bottom, left, right, colour) on a ground, with noise."""
    rng = np.random.default_rng(0)
    frames = np.empty((len(boxes_of_frames), *size, 3), np.uint8)
    for frame, boxes in zip(frames, boxes_of_frames, strict=True):
        picture = np.full((*size, 3), GROUND, np.float64)
        for top, bottom, left, right, colour in boxes:
            picture[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)] = colour
        frame[:] = np.clip(picture + rng.normal(0, noise, picture.shape), 0, 255)
    return Recording.from_frames(frames)


def followed(recording: Recording, **values: object) -> tuple[list[NDArray[np.uint16]], list[SegmentEvent]]:
    """Label images, and what happened after the first frame."""
    tracked = list(tracked_frames(recording, parameters=TrackingParameters(**values)))  # type: ignore[arg-type]
    return [frame.labels for frame in tracked], [event for frame in tracked[1:] for event in frame.events]


def told(events: list[SegmentEvent]) -> list[tuple[str, tuple[int, ...]]]:
    return [(event.kind, event.labels) for event in events]


def test_the_first_frame_is_annealed() -> None:
    recording = movie([[(20, 40, 20, 50, RED)]])
    (first,) = tracked_frames(recording, seed=4)
    (image,) = (frame.image for frame in recording)
    parameters = TrackingParameters().potts
    assert (first.labels == superparamagnetic_clustering(image, parameters=parameters, seed=4)).all()
    assert first.events == (SegmentEvent(0, "new", (1,)), SegmentEvent(0, "new", (2,)))
    with pytest.raises(ValueError, match="read-only"):
        first.labels[0, 0] = 5


def test_what_moves_keeps_its_label() -> None:
    boxes = [[(20, 40, 10 + 4 * i, 40 + 4 * i, RED), (50, 70, 20, 50, BLUE)] for i in range(12)]
    labels, events = followed(movie(boxes))
    assert events == []
    for i, image in enumerate(labels):
        truth = np.ones((80, 120), int)
        truth[20:40, 10 + 4 * i : 40 + 4 * i] = 2
        truth[50:70, 20:50] = 3
        # Both boxes have 600 pixels in the first frame, give or take: which comes second is left open.
        first = labels[0][30, 20]
        assert first != labels[0][60, 30]
        if first == 3:
            truth = np.array([0, 1, 3, 2])[truth]
        assert (image == truth).mean() > 0.99


def test_what_comes_in_is_new_and_what_goes_is_lost_and_found() -> None:
    inside: Box = (20, 50, 60, 90, RED)
    boxes = [[]] * 2 + [[inside]] * 4 + [[]] * 3 + [[inside]] * 3
    labels, events = followed(movie(boxes))
    assert events == [
        SegmentEvent(2, "new", (2,)),
        SegmentEvent(6, "lost", (2,)),
        SegmentEvent(9, "found", (2,)),
    ]
    assert [int(image[35, 75]) for image in labels] == [1, 1, 2, 2, 2, 2, 1, 1, 1, 2, 2, 2]


def test_another_colour_or_place_is_not_found_again() -> None:
    boxes = [[(20, 50, 60, 90, RED)]] + [[]] * 2 + [[(20, 50, 60, 90, BLUE)]] * 2
    assert told(followed(movie(boxes))[1]) == [("lost", (2,)), ("new", (3,))]
    boxes = [[(5, 25, 5, 25, RED)]] + [[]] * 2 + [[(55, 75, 95, 115, RED)]] * 2
    assert told(followed(movie(boxes))[1]) == [("lost", (2,)), ("new", (3,))]
    assert told(followed(movie(boxes), reach_percent=90)[1]) == [("lost", (2,)), ("found", (2,))]


def test_pieces_keep_one_label_until_they_were_apart_for_long() -> None:
    # A bar passes in front of a box and stands there.
    box: Box = (20, 60, 30, 90, RED)
    boxes = [[box]] * 2 + [[box, (10, 70, 54, 66, WHITE)]] * 12
    labels, events = followed(movie(boxes), apart_frames=6)
    assert events[0] == SegmentEvent(2, "new", (3,))
    # Both pieces have been there for six frames, 2 to 7, when one becomes a segment of its own.
    assert events[1:] == [SegmentEvent(8, "split", (2, 4))]
    assert {int(labels[7][40, 40]), int(labels[7][40, 80])} == {2}
    assert {int(labels[8][40, 40]), int(labels[8][40, 80])} == {2, 4}
    assert told(followed(movie(boxes), apart_frames=50)[1]) == [("new", (3,))]


def test_a_young_label_goes_back_where_it_belongs() -> None:
    # A patch of a box flares up and fades within a few frames.
    box: Box = (10, 70, 20, 100, (150, 60, 50))
    steps = [200, 200, 170, 150, 150, 150]
    boxes = [[box]] * 2 + [[box, (25, 55, 45, 75, (step, 60, 50))] for step in steps]
    labels, events = followed(movie(boxes))
    assert told(events) == [("new", (3,)), ("merged", (3, 2))]
    assert (labels[-1] == labels[0]).mean() > 0.99


def test_a_segment_falls_apart_where_no_bond_holds_it_together() -> None:
    # Over many frames, too slowly for a residual, half of a box takes another colour.
    boxes = []
    for step in range(24):
        colour = (190 - 5 * step, 60 + 5 * step, 50)
        boxes.append([(20, 60, 20, 60, RED), (20, 60, 60, 100, colour)])
    labels, events = followed(movie(boxes))
    assert len(np.unique(labels[0])) == 2
    assert ("split", (2, 3)) in told(events)
    assert len({int(labels[-1][40, 30]), int(labels[-1][40, 90])}) == 2


def test_depth_parts_what_has_one_colour() -> None:
    frames = np.full((3, 60, 80, 3), 120, np.uint8)
    depth = np.ones((3, 60, 80))
    depth[:, 20:40, 30:60] = 0.9
    (labels, *_) = track_segments(Recording.from_frames(frames, depth=depth))
    assert ((labels == 2) == (depth[0] < 0.95)).mean() > 0.98
    assert all(image.max() == 1 for image in track_segments(Recording.from_frames(frames)))


def test_at_half_the_size() -> None:
    boxes = [[(20, 41, 11 + 2 * i, 41 + 2 * i, RED)] for i in range(4)]
    recording = movie(boxes, size=(81, 121))
    fine, _ = followed(recording)
    coarse, events = followed(recording, lattice_step_px=2)
    assert events == []
    assert all(image.shape == (81, 121) for image in coarse)
    assert all((a == b).mean() > 0.98 for a, b in zip(fine, coarse, strict=True))


def test_segmentation_is_lazy_and_begins_anew() -> None:
    reads = []

    def read() -> object:
        for frame in recording:
            reads.append(frame.index)
            yield frame

    recording = movie([[(20, 40, 10, 40, RED)]] * 6)
    watched = dataclasses.replace(recording, read=read)
    segmentation = track_segments(watched)
    assert reads == []
    images = iter(segmentation)
    next(images)
    # One frame is prepared ahead.
    assert len(reads) <= 2
    images.close()  # type: ignore[attr-defined]
    first, second = list(segmentation), list(segmentation)
    assert len(first) == 6
    assert all((a == b).all() for a, b in zip(first, second, strict=True))
    assert [thread.name for thread in threading.enumerate() if "sec_lab" in thread.name] == []


def test_a_corrupt_frame_is_told_after_the_frames_before_it() -> None:
    recording = movie([[(20, 40, 10, 40, RED)]] * 4)

    def read() -> object:
        for frame in recording:
            if frame.index == 2:
                raise ValueError("frame 2: corrupt")
            yield frame

    numbered = track_segments(dataclasses.replace(recording, read=read)).numbered()
    assert [next(numbered)[0], next(numbered)[0]] == [0, 1]
    with pytest.raises(ValueError, match="frame 2: corrupt"):
        next(numbered)


def test_number_of_threads_changes_nothing() -> None:
    import cv2

    recording = Recording.from_frames(moving_object(2).frames[20:40])
    threads = numba.get_num_threads(), cv2.getNumThreads()
    found = []
    try:
        for n_threads in (1, 2):
            numba.set_num_threads(min(n_threads, numba.config.NUMBA_NUM_THREADS))
            cv2.setNumThreads(n_threads)
            found.append(np.stack(list(track_segments(recording, seed=1))))
    finally:
        numba.set_num_threads(threads[0])
        cv2.setNumThreads(threads[1])
    assert (found[0] == found[1]).all()


def test_the_artificial_action() -> None:
    drawn = moving_object(1)
    labels, events = followed(Recording.from_frames(drawn.frames))
    assert events == []
    assert len(np.unique(labels[0])) == 4
    found = np.array([0, *(np.bincount(labels[0][drawn.labels[0] == label]).argmax() for label in (1, 2, 3, 4))])
    for truth, image in zip(drawn.labels, labels, strict=True):
        assert (found[truth] == image).mean() > 0.99


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"potts": None}, "potts: expected PottsParameters, got NoneType"),
        ({"lattice_step_px": 3}, "lattice_step_px: expected 1 or 2, got 3"),
        ({"residual_limit": -1}, "residual_limit: expected a number from 0 on, got -1"),
        ({"colour_limit": np.inf}, "colour_limit: expected a number from 0 on, got inf"),
        ({"young_frames": 0.5}, "young_frames: expected whole numbers"),
        ({"bonds_every_frames": 0}, "bonds_every_frames: expected a whole number from 1 on, got 0"),
    ],
)
def test_bad_parameters(values: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TrackingParameters(**values)  # type: ignore[arg-type]


def test_bad_seed() -> None:
    with pytest.raises(ValueError, match="seed: expected a whole number from 0 on, got -1"):
        track_segments(movie([[]]), seed=-1)


def test_too_many_segments() -> None:
    # Every pixel of this picture is a segment, and there are more than a lattice can name.
    frames = np.random.default_rng(0).integers(0, 256, (1, 250, 250, 3), np.uint8)
    potts = PottsParameters(alpha=0.3, blur_sigma_px=0, minimum_size_px=1, minimum_thickness_px=0, anneal_sweeps=1)
    segmentation = track_segments(Recording.from_frames(frames), parameters=TrackingParameters(potts=potts))
    with pytest.raises(ValueError, match="segments: expected at most 32767 in a recording"):
        next(iter(segmentation))
