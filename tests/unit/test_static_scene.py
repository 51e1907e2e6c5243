"""What stands on the background of a first picture, by its colour and by its height."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.segmentation.static_parts import MAX_OBJECTS, tidied
from sec_lab.segmentation.static_scene import _confirmed, rise_above_plane, static_segments
from tests.drawn_scenes import BLUE, GREEN, HEIGHT, RED, TABLE, WIDTH, Block, Moment, drawn, plane


class TestRise:
    block = np.s_[34:62, 46:76]

    def test_rise_is_counted_in_units_of_the_noise(self) -> None:
        rng = np.random.default_rng(1)
        inverse = 1 / plane()
        inverse[self.block] += 0.06
        inverse += rng.normal(0, 0.01, inverse.shape)
        depth = (1 / inverse).astype(np.float32)
        depth[:, :10] = 0
        rise = rise_above_plane(depth)
        assert rise.dtype == np.float32
        assert np.isnan(rise[:, :10]).all()
        assert np.isfinite(rise[:, 10:]).all()
        flat = np.isfinite(rise)
        flat[self.block] = False
        assert abs(float(np.median(rise[flat]))) < 0.2
        assert float(rise[flat].std()) == pytest.approx(1, abs=0.15)
        assert float(np.median(rise[self.block])) == pytest.approx(6, abs=1)

    def test_no_plane(self) -> None:
        assert np.isnan(rise_above_plane(np.zeros((HEIGHT, WIDTH), np.float32))).all()
        little = np.zeros((HEIGHT, WIDTH), np.float32)
        little[:10] = 1
        assert np.isnan(rise_above_plane(little)).all()

    def test_a_plane_without_noise(self) -> None:
        rise = rise_above_plane(plane().astype(np.float32))
        assert np.isfinite(rise).all()


class TestStaticSegments:
    def segments(self, blocks: Sequence[Block], **options: Any) -> NDArray[np.uint8]:
        picture, _ = drawn(Moment(blocks), np.random.default_rng(5).normal(0, 2, (HEIGHT, WIDTH, 3)))
        return static_segments(picture, **options)

    def test_objects_from_left_to_right(self) -> None:
        found = self.segments([Block((30, 90), RED), Block((50, 60), GREEN), Block((70, 24), BLUE)])
        assert (found[70, 24], found[50, 60], found[30, 90]) == (2, 3, 4)

    @pytest.mark.parametrize("side", [10, 18, 40])
    def test_objects_are_as_large_as_they_are(self, side: int) -> None:
        found = self.segments([Block((50, 60), RED, side, side)])
        # Mixed pixels at the rim may belong to either.
        assert (side - 2) ** 2 <= (found == 2).sum() <= (side + 2) ** 2

    def test_nothing_there(self) -> None:
        assert (self.segments([]) == 1).all()

    def test_what_is_too_small_is_background(self) -> None:
        small = Block((50, 60), RED, 10, 10)
        assert set(np.unique(self.segments([small], least_px=60))) == {1, 2}
        assert (self.segments([small], least_px=200) == 1).all()

    def test_two_things_joined_by_a_neck(self) -> None:
        """A red and a blue block, and between them a bridge, half red and half blue."""
        found = self.segments(
            [
                Block((50, 34), RED, 24, 24),
                Block((50, 76), BLUE, 24, 24),
                Block((50, 51), RED, 8, 10),
                Block((50, 60), BLUE, 8, 10),
            ]
        )
        assert set(np.unique(found)) == {1, 2, 3}
        red, blue = found[40:60, 24:45], found[40:60, 66:87]
        assert len(np.unique(red)) == len(np.unique(blue)) == 1
        assert red[0, 0] != blue[0, 0]

    def test_two_things_with_middles_of_one_colour_joined_by_a_narrow_neck(self) -> None:
        white = (228, 224, 210)
        found = self.segments(
            [
                *(Block((50, column), colour, 30, 30) for column, colour in ((34, RED), (80, BLUE))),
                *(Block((50, column), white, 20, 20) for column in (34, 80)),
                Block((50, 53), RED, 7, 10),
                Block((50, 61), BLUE, 7, 10),
            ]
        )
        assert found[50, 34] != found[50, 80]
        assert min(found[50, 34], found[50, 80]) > 1

    def test_one_thing_with_a_neck_stays_one(self) -> None:
        found = self.segments([Block((50, 34), RED, 24, 24), Block((50, 76), RED, 24, 24), Block((50, 55), RED, 8, 24)])
        assert set(np.unique(found)) == {1, 2}

    def test_two_things_grown_from_one_place_are_two(self) -> None:
        """Each connected region is a thing: none is lost, however small it is beside the other."""
        labels = np.ones((HEIGHT, WIDTH), np.uint8)
        labels[10:50, 10:50] = labels[10:30, 60:80] = labels[70:74, 60:64] = 2
        found = tidied(labels, 40)
        assert sorted(np.bincount(found.ravel())[1:].tolist()) == [400, 1600, HEIGHT * WIDTH - 2000]
        assert found[72, 62] == 1

    def test_of_more_than_there_are_numbers_for_the_largest_stay(self) -> None:
        labels = np.ones((130, 130), np.uint8)
        for row in range(12):
            for column in range(12):
                labels[10 * row + 2 : 10 * row + 9, 10 * column + 2 : 10 * column + 9] = 2
        labels[100:128, 100:128] = 3
        found = tidied(labels, 40)
        assert found.max() == 1 + MAX_OBJECTS
        assert (found == found[110, 110]).sum() == 28 * 28

    def test_a_hole_is_filled(self) -> None:
        found = self.segments([Block((50, 60), RED, 40, 40), Block((50, 60), TABLE, 10, 10)])
        assert found[50, 60] == found[35, 45] == 2


class TestThingsOnThings:
    """A plate that covers most of what is seen, and something small of another colour on it."""

    plate = Block((48, 60), (225, 225, 220), 46, 58)

    def segments(
        self,
        colour: tuple[int, int, int],
        height: float,
        *,
        place: tuple[int, int] = (48, 60),
        size: tuple[int, int] = (14, 14),
    ) -> Any:
        """``height``: how far the small thing stands out of the plate, in units of the noise of depth."""
        small = Block(place, colour, *size)
        rng = np.random.default_rng(3)
        picture, truth = drawn(Moment([self.plate, small]), rng.normal(0, 2, (HEIGHT, WIDTH, 3)))
        inverse = 1 / plane() + rng.normal(0, 0.01, (HEIGHT, WIDTH))
        inverse += 0.05 * (truth == 1) + (0.05 + 0.01 * height) * (truth == 2)
        return static_segments(picture, depth_m=(1 / inverse).astype(np.float32)), truth

    def test_what_rises_from_a_plate_is_a_thing(self) -> None:
        found, truth = self.segments(RED, 9)
        assert set(np.unique(found)) == {1, 2, 3}
        thing, plate = found[48, 60], found[30, 36]
        assert thing != plate
        assert ((found == thing) & (truth == 2)).sum() > 0.8 * (found == thing).sum()
        assert ((found == thing) & (truth == 2)).sum() > 0.8 * (truth == 2).sum()

    def test_a_painted_mark_stays_with_the_plate(self) -> None:
        found, _ = self.segments(RED, 0)
        assert set(np.unique(found)) == {1, 2}

    def test_a_bulge_of_the_same_colour_stays_with_the_plate(self) -> None:
        found, _ = self.segments(self.plate.colour, 9)
        assert set(np.unique(found)) == {1, 2}

    def test_a_long_thing_is_one_and_a_highlight_is_none(self) -> None:
        """A knife on a plate; and a gleam on it, which is of one hue with the plate."""
        found, _ = self.segments(RED, 9, size=(6, 34))
        assert set(np.unique(found)) == {1, 2, 3}
        found, _ = self.segments((150, 150, 147), 9, size=(6, 34))
        assert set(np.unique(found)) == {1, 2}

    def test_what_rises_near_the_border_is_a_band(self) -> None:
        found, _ = self.segments(RED, 9, place=(34, 60), size=(12, 12))
        assert set(np.unique(found)) == {1, 2}

    def test_the_cap_of_a_bottle_stays_with_it(self) -> None:
        """It rises and has its own colour, but lies at the border of its region."""
        found, _ = self.segments(RED, 9, place=(33, 60))
        assert set(np.unique(found)) == {1, 2}

    def test_a_like_thing_beside_a_plate_is_told_from_it_by_what_lies_on_it(self) -> None:
        """An orange on a plate, and one that seems to hang together with the plate: a neck between like colours."""
        blocks = [
            Block((48, 44), (225, 225, 220), 44, 44),
            Block((48, 44), RED, 20, 20),
            Block((48, 90), RED, 14, 14),
            Block((48, 74), (225, 225, 220), 7, 18),
        ]
        rng = np.random.default_rng(3)
        picture, truth = drawn(Moment(blocks), rng.normal(0, 2, (HEIGHT, WIDTH, 3)))
        inverse = 1 / plane() + rng.normal(0, 0.01, (HEIGHT, WIDTH)) + 0.06 * (truth > 0) + 0.1 * (truth == 2)
        found = static_segments(picture, depth_m=(1 / inverse).astype(np.float32))
        assert len({int(found[48, 44]), int(found[30, 30]), int(found[48, 90]), 1}) == 4


class TestGround:
    """What has the colours of the table."""

    def segments(self, height: float, *, known: bool = True) -> NDArray[np.uint8]:
        rng = np.random.default_rng(3)
        picture, _ = drawn(Moment([Block((48, 60), TABLE, 20, 20)]), rng.normal(0, 2, (HEIGHT, WIDTH, 3)))
        inverse = 1 / plane() + rng.normal(0, 0.01, (HEIGHT, WIDTH))
        inverse[38:58, 50:70] += 0.01 * height
        depth = (1 / inverse).astype(np.float32)
        if not known:
            depth[30:66, 42:78] = 0
        return static_segments(picture, depth_m=depth)

    def test_it_must_rise_twice_as_much_to_be_a_thing(self) -> None:
        assert set(np.unique(self.segments(12))) == {1, 2}
        assert set(np.unique(self.segments(4.5))) == {1}
        assert set(np.unique(self.segments(12, known=False))) == {1}

    @pytest.mark.parametrize(
        ("strangeness", "height", "thing"),
        [
            (0.0, 7.0, True),
            (0.0, 5.0, False),
            (1.0, 5.0, True),
            (1.0, 2.0, False),
            (2.5, 0.0, True),
            (2.5, None, False),
            (3.5, None, True),
        ],
    )
    def test_what_confirms_a_thing(self, strangeness: float, height: float | None, thing: bool) -> None:
        """How unusual its colours are, in nats, and how far it rises, in units of the noise of depth; None: unknown."""
        labels = np.ones((40, 60), np.uint8)
        labels[10:20, 20:40] = 2
        unusual = np.where(labels == 2, 8 + strangeness, 8).astype(np.float32)
        rise = np.where(labels == 2, np.nan if height is None else height, 0).astype(np.float32)
        assert (_confirmed(labels, unusual, rise) == 2).any() == thing

    def test_a_little_that_is_known_to_rise_speaks_for_a_thing(self) -> None:
        labels = np.ones((40, 60), np.uint8)
        labels[10:20, 20:40] = 2
        unusual = np.where(labels == 2, 10.5, 8).astype(np.float32)
        rise = np.where(labels == 2, np.nan, 0).astype(np.float32)
        rise[10:20, 20:24] = 4
        assert (_confirmed(labels, unusual, rise) == 2).any()
        rise[10:20, 20:24] = 1
        assert not (_confirmed(labels, unusual, rise) == 2).any()


class TestPartsOfAnotherHue:
    """A red thing with something white in it, as pages or milk."""

    WHITE = (228, 224, 210)

    def segments(self, part: Block, *, lower: float = 0, around: Sequence[Block] = ()) -> tuple[Any, Any]:
        """``lower``: how far the part lies below the thing, in units of the noise of depth."""
        rng = np.random.default_rng(3)
        picture, truth = drawn(
            Moment([Block((48, 60), RED, 52, 52), part, *around]), rng.normal(0, 2, (HEIGHT, WIDTH, 3))
        )
        inverse = 1 / plane() + rng.normal(0, 0.01, (HEIGHT, WIDTH))
        inverse += 0.12 * (truth == 1) + (0.12 - 0.01 * lower) * (truth == 2)
        return static_segments(picture, depth_m=(1 / inverse).astype(np.float32)), truth

    def test_the_pages_of_a_closed_book_are_a_part(self) -> None:
        found, truth = self.segments(Block((66, 60), self.WHITE, 8, 46))
        pages, cover = found[66, 60], found[40, 60]
        assert len({int(pages), int(cover), 1}) == 3
        assert ((found == pages) & (truth == 2)).sum() > 0.75 * (truth == 2).sum()

    def test_a_title_amid_the_cover_is_none(self) -> None:
        found, _ = self.segments(Block((44, 60), self.WHITE, 6, 32))
        assert set(np.unique(found)) == {1, 2}

    def test_a_band_that_runs_across_is_none(self) -> None:
        found, _ = self.segments(Block((48, 60), self.WHITE, 9, 52))
        assert set(np.unique(found)) == {1, 2}

    @pytest.mark.parametrize(("lower", "parts"), [(6, {1, 2, 3}), (0, {1, 2})])
    def test_what_a_cup_holds_lies_lower_than_its_rim_and_a_painted_mark_does_not(
        self, lower: float, parts: set[int]
    ) -> None:
        found, _ = self.segments(Block((48, 60), self.WHITE, 16, 18), lower=lower)
        assert set(np.unique(found)) == parts

    @pytest.mark.parametrize(("width", "parts"), [(20, {1, 2, 3}), (36, {1, 2})])
    def test_what_is_large_near_the_border_is_a_part_if_it_is_thicker_than_a_band(
        self, width: int, parts: set[int]
    ) -> None:
        found, _ = self.segments(Block((61, 60), self.WHITE, 20, width))
        assert set(np.unique(found)) == parts

    def test_what_is_lower_near_the_border_is_the_band_of_a_bottle(self) -> None:
        found, _ = self.segments(Block((63, 60), self.WHITE, 16, 18), lower=6)
        assert set(np.unique(found)) == {1, 2}

    @pytest.mark.parametrize("shade", [0.8, 0.6, 0.4])
    def test_a_shade_of_the_same_hue_is_no_part(self, shade: float) -> None:
        dark = tuple(round(shade * value) for value in RED)
        found, _ = self.segments(Block((66, 60), dark, 8, 46))
        assert set(np.unique(found)) == {1, 2}
