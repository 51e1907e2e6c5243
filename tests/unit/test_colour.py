"""Colour segmentation: what belongs to a colour, what is kept of it, and what it is called."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sec_lab.pipeline import observe_segments
from sec_lab.recording import Recording
from sec_lab.segmentation.colour import NamedColour, colour_segmentation, colour_segments, names_by_colour
from tests import naive_colour as naive

RED = NamedColour("red box", (345, 15), (50, 100), (20, 100))
GREEN = NamedColour("green box", (90, 150), (50, 100), (20, 100))
GREY = NamedColour("robot arm", (0, 360), (0, 20), (30, 80))

RED_RGB, GREEN_RGB, GREY_RGB, BLUE_RGB = (200, 10, 10), (10, 180, 20), (120, 120, 120), (20, 20, 200)


def painted(*boxes: tuple[slice, slice, tuple[int, int, int]], size: tuple[int, int] = (20, 30)) -> NDArray[np.uint8]:
    picture = np.full((*size, 3), BLUE_RGB, dtype=np.uint8)
    for rows, columns, colour in boxes:
        picture[rows, columns] = colour
    return picture


def test_label_is_the_place_of_the_colour() -> None:
    picture = painted(
        (slice(2, 8), slice(2, 8), GREEN_RGB),
        (slice(10, 18), slice(2, 8), RED_RGB),
        (slice(10, 18), slice(20, 30), GREY_RGB),
    )
    labels = colour_segments(picture, [RED, GREEN, GREY])
    assert labels.dtype == np.uint16
    assert (labels[10:18, 2:8] == 1).all()
    assert (labels[2:8, 2:8] == 2).all()
    assert (labels[10:18, 20:30] == 3).all()
    assert np.bincount(labels.ravel()).tolist() == [600 - 48 - 36 - 80, 48, 36, 80]


@pytest.mark.parametrize("colour", [(200, 10, 10), (200, 10, 30), (200, 30, 10)])
def test_red_goes_through_zero(colour: tuple[int, int, int]) -> None:
    """Hues 0, 354 and 6 degrees."""
    labels = colour_segments(painted((slice(0, 5), slice(0, 5), colour)), [RED])
    assert (labels[:5, :5] == 1).all()
    assert not labels[5:].any()


def test_a_range_holds_its_lower_end_alone() -> None:
    yellow = [[[200, 200, 0]]]  # 60 degrees, all of the saturation
    for hues, label in (((60, 90), 1), ((30, 60), 0), ((62, 90), 0), ((30, 62), 1)):
        assert colour_segments(yellow, [NamedColour("lemon", hues)], minimum_px=1) == label
    for saturations, label in (((100, 100), None), ((50, 100), 1), ((50, 99), 0)):
        if label is None:
            with pytest.raises(ValueError, match="lemon: saturation_percent: expected a range that is not empty"):
                NamedColour("lemon", (0, 360), saturations)
        else:
            assert colour_segments(yellow, [NamedColour("lemon", (0, 360), saturations)], minimum_px=1) == label


def test_ranges_that_follow_one_another_share_nothing() -> None:
    parts = [NamedColour(f"part {low}", (low, low + 60)) for low in range(0, 360, 60)]
    image = np.random.default_rng(3).integers(0, 256, (40, 40, 3), dtype=np.uint8)
    assert colour_segments(image, parts, minimum_px=1, components="all").all()


def test_largest_part_or_all_of_them() -> None:
    picture = painted(
        (slice(0, 5), slice(0, 5), RED_RGB),
        (slice(0, 6), slice(20, 26), RED_RGB),
        (slice(15, 17), slice(0, 2), RED_RGB),
    )
    largest = colour_segments(picture, [RED])
    assert np.argwhere(largest)[:, 1].min() == 20
    assert np.count_nonzero(largest) == 36
    assert np.count_nonzero(colour_segments(picture, [RED], components="all")) == 36 + 25
    assert np.count_nonzero(colour_segments(picture, [RED], components="all", minimum_px=4)) == 36 + 25 + 4
    assert not colour_segments(picture, [RED], minimum_px=37).any()


def test_of_equal_parts_the_uppermost_is_kept() -> None:
    picture = painted((slice(8, 12), slice(0, 5), RED_RGB), (slice(2, 6), slice(20, 25), RED_RGB))
    assert np.argwhere(colour_segments(picture, [RED]))[0].tolist() == [2, 20]


def test_movie_is_tracked_and_named() -> None:
    """A red box is pushed to a green one, as in §2.10."""
    movie = np.stack(
        [
            painted((slice(5, 12), slice(left, left + 6), RED_RGB), (slice(5, 12), slice(20, 28), GREEN_RGB))
            for left in (2, 6, 10, 14, 14)
        ]
    )
    found = colour_segmentation(Recording.from_frames(movie), [RED, GREEN])
    assert dict(found.names) == {0: "background", 1: "red box", 2: "green box"}
    assert len(list(found)) == len(list(found)) == 5
    seen = observe_segments(pickle.loads(pickle.dumps(found)))
    row = [seen.chain.row_label(i) for i in range(3)].index("green box, red box")
    assert seen.chain.relations[row].tolist() == [0, 2]
    assert seen.key_frames.tolist() == [0, 3]


def test_names_of_segments_that_were_found_otherwise() -> None:
    picture = painted((slice(0, 10), slice(0, 10), RED_RGB), (slice(0, 10), slice(10, 20), GREEN_RGB))
    labels = np.full((20, 30), 5)
    labels[:10, :10], labels[:10, 10:20], labels[:4, 10:13] = 70, 80, 70  # 12 of 112 pixels are green
    assert names_by_colour(picture, labels, [GREEN, RED]) == {70: "red box", 80: "green box"}
    assert names_by_colour(picture, labels, [GREEN, RED], minimum_percent=95) == {80: "green box"}
    assert names_by_colour(picture, labels, [GREEN], minimum_percent=0) == {70: "green box", 80: "green box"}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: NamedColour("", (0, 10)), "name: expected the name of an object, got ''"),
        (lambda: NamedColour("a", (0, 361)), r"a: hue_degrees: expected numbers from 0 to 360, got \(0, 361\)"),
        (lambda: NamedColour("a", (float("nan"), 10)), "a: hue_degrees: expected numbers"),
        (lambda: NamedColour("a", (10, 10)), r"a: hue_degrees: expected a range that is not empty, got \(10, 10\)"),
        (lambda: NamedColour("a", (0, 10), (60, 40)), "a: saturation_percent: expected a range that is not empty"),
        (lambda: NamedColour("a", (0, 10), value_percent=(0, 101)), "a: value_percent: expected numbers from 0 to 100"),
        (lambda: NamedColour("a", 10), r"a: hue_degrees: expected \(from, to\), got 10"),  # type: ignore[arg-type]
        (lambda: colour_segments(painted(), []), "colours: expected at least one, got none"),
        (lambda: colour_segments(painted(), [RED, RED]), "colours: expected every name once, got 'red box' twice"),
        (
            lambda: colour_segments(painted(), [RED, NamedColour("pink", (300, 350), (50, 100), (90, 100))]),
            "colours: expected ranges apart, got 'red box' and 'pink' overlapping",
        ),
        (lambda: colour_segments(painted(), [RED], background=1), "background: expected a label that no colour has"),
        (lambda: colour_segments(painted(), [RED], minimum_px=0), "minimum_px: expected at least 1, got 0"),
        (lambda: colour_segments(painted(), [RED], components="some"), "components: expected one of"),  # type: ignore[arg-type]
        (lambda: colour_segments(painted() * 1.0, [RED]), "image: expected shape .* of float64"),
        (lambda: colour_segments(painted()[..., 0], [RED]), "image: expected 3 dimensions"),
        (lambda: colour_segments([[[0, 0, 256]]], [RED]), "image: expected values from 0 to 255, got 0 to 256"),
        (lambda: names_by_colour(painted(), np.zeros((2, 2), int), [RED]), "label image: expected whole numbers of"),
        (lambda: names_by_colour(painted(), np.zeros((20, 30), int), [RED], minimum_percent=101), "expected 0 to 100"),
    ],
)
def test_bad_input(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]


def test_ranges_that_share_hues_alone_are_apart() -> None:
    dark = NamedColour("dark red", (345, 15), (50, 100), (0, 20))
    assert colour_segments(painted(), [RED, dark]).shape == (20, 30)


# Few levels a channel, so that neighbours are often alike and hues meet the ends of ranges.
images = st.integers(0, 2**32 - 1).map(
    lambda seed: np.random.default_rng(seed).choice(np.array([0, 60, 120, 180, 240, 255], np.uint8), (6, 7, 3))
)


@given(
    images,
    st.tuples(st.integers(0, 359), st.integers(1, 359)),
    st.lists(st.integers(0, 100), min_size=2, max_size=2, unique=True).map(sorted),
    st.integers(1, 5),
    st.sampled_from(["largest", "all"]),
)
def test_as_the_slow_twin(
    image: NDArray[np.uint8], hues: tuple[int, int], saturations: list[int], minimum_px: int, components: str
) -> None:
    start, extent = hues
    one = NamedColour("one", (start, (start + extent) % 360 or 360), tuple(saturations))  # type: ignore[arg-type]
    rest = NamedColour("rest", ((start + extent) % 360, start or 360), (0, 70), (10, 100))
    options = {"minimum_px": minimum_px, "components": components}
    np.testing.assert_array_equal(
        colour_segments(image, [one, rest], **options),  # type: ignore[arg-type]
        naive.colour_segments(image, [one, rest], **options),  # type: ignore[arg-type]
    )
