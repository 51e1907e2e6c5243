"""The overlay movie and the page: that they show what was seen, in the place where it was seen, and stay small."""

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.pipeline import observe, observe_segments
from sec_lab.recording import Recording
from sec_lab.scene_graph import SceneGraph
from sec_lab.segmentation import Segmentation
from sec_lab.viz.chain_panel import ChainPanel
from sec_lab.viz.lettering import badge, fitted, font, paste
from sec_lab.viz.overlay import overlay_frames
from sec_lab.viz.page import observation_page
from sec_lab.viz.style import EDGE_STYLE, RELATION_COLOUR, rgb
from sec_lab.viz.tint import Tint, centres_of, strong_colour

BLUE, RED = ((255 * rgb(EDGE_STYLE[one].colour)).round() for one in (Relation.OVERLAPPING, Relation.TOUCHING))


def labels_of(n: int = 4) -> NDArray[np.uint8]:
    """On a table (1) two boxes (2, 3) that touch from frame 2 on."""
    labels = np.ones((n, 120, 160), dtype=np.uint8)
    labels[:, 16:56, 90:130] = 3
    for number, image in enumerate(labels):
        image[16:56, 50 if number >= 2 else 30 :][:, :40] = 2
        image[16:56, 90:130] = 3
    return labels


def seen_in(n: int = 4, **options: object) -> Observation:
    masks = Segmentation.from_labels(labels_of(n), background=1, names={2: "cup", 3: "box"}, **options)  # type: ignore[arg-type]
    return observe_segments(masks)


def near(picture: NDArray[np.uint8], colour: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray((np.abs(picture.astype(int) - colour) < 30).all(axis=2))


GREY = np.full((4, 120, 160, 3), 128, dtype=np.uint8)


class TestOverlay:
    def test_frames_are_enlarged_and_even(self) -> None:
        frames = list(overlay_frames(seen_in(), Recording.from_frames(GREY, frames_per_second=25)))
        assert len(frames) == 4
        assert {frame.shape for frame in frames} == {frames[0].shape}
        height, width, _ = frames[0].shape
        assert (height, height % 2, width % 2) == (480, 0, 0)
        assert width > 640

    def test_segments_are_tinted_where_they_are(self) -> None:
        first = next(overlay_frames(seen_in(), Recording.from_frames(GREY)))
        for label, row, column in ((2, 23, 35), (3, 23, 125)):
            expected = 128 + (np.array(strong_colour(label)) - 128) * 92 / 256
            np.testing.assert_allclose(first[4 * row, 4 * column], expected, atol=2)
        np.testing.assert_allclose(first[400, 100], 128 + (np.array(strong_colour(1)) - 128) * 20 / 256, atol=2)

    def test_edges_have_the_colours_of_the_thesis(self) -> None:
        frames = [frame[:, :640] for frame in overlay_frames(seen_in(), Recording.from_frames(GREY))]
        counts = [(near(frame, BLUE).sum(), near(frame, RED).sum()) for frame in frames]
        assert min(blue for blue, _ in counts) > 100, "both boxes lie on the table"
        assert max(red for _, red in counts[:2]) == 0
        assert min(red for _, red in counts[2:]) > 40

    def test_column_of_now_is_lit(self) -> None:
        panels = [frame[:, 640:] for frame in overlay_frames(seen_in())]
        np.testing.assert_array_equal(panels[0], panels[1])
        np.testing.assert_array_equal(panels[2], panels[3])
        touching = (255 * rgb(RELATION_COLOUR[Relation.TOUCHING])).round()
        # The legend shows the colour once more.
        assert near(panels[2], touching).sum() > near(panels[0], touching).sum() + 100

    def test_frames_without_masks_keep_the_last_ones(self) -> None:
        masks = Segmentation.from_labels(labels_of()[1::2], frames=[1, 3], background=1)
        seen = observe(masks, over_time=None)
        frames = list(overlay_frames(seen, Recording.from_frames(GREY)))
        assert len(frames) == 4
        assert (frames[0][200, :640] == 128).all(), "before the first mask there is nothing to draw"
        np.testing.assert_array_equal(frames[1][50:, :640], frames[2][50:, :640])

    def test_is_lazy(self) -> None:
        n_read = 0

        def read() -> Iterator[tuple[int, NDArray[np.uint8]]]:
            nonlocal n_read
            for number, image in enumerate(labels_of(50)):
                n_read += 1
                yield number, image

        seen = observe_segments(Segmentation(read, (120, 160)))
        n_read = 0
        next(overlay_frames(seen))
        assert n_read <= 2

    def test_segment_that_is_held_through_an_occlusion_is_still_named(self) -> None:
        labels = labels_of()
        labels[1:][labels[1:] == 2] = 1
        graph = SceneGraph([1, 2, 3], np.zeros((3, 3)), [[80, 66], [50, 36], [110, 36]])
        seen = Observation([graph], [0], {}, "px", Segmentation.from_labels(labels, background=1))
        first, second, *_ = (frame[:, :640] for frame in overlay_frames(seen))
        patch = (slice(4 * 36 - 8, 4 * 36 + 8), slice(4 * 50 - 8, 4 * 50 + 8))
        paper = second[300, 100]
        assert (np.abs(second[patch].astype(int) - paper) > 60).any()
        assert (np.abs(first[patch].astype(int) - second[patch]) > 60).any()

    def test_what_does_not_fit(self) -> None:
        with pytest.raises(ValueError, match="overlay: expected an observation with its segmentation"):
            overlay_frames(Observation([SceneGraph([1], [[0]])], [0]))
        with pytest.raises(
            ValueError, match=r"overlay: expected pictures of \(120, 160\) like the masks, got \(10, 10\)"
        ):
            overlay_frames(seen_in(), Recording.from_frames(GREY[:, :10, :10]))
        with pytest.raises(
            ValueError, match="masks: expected masks of frames that the recording has, got one of frame 3"
        ):
            list(overlay_frames(seen_in(), Recording.from_frames(GREY[:3])))

    def test_one_segment_alone_has_no_chain(self) -> None:
        seen = observe_segments(Segmentation.from_labels(np.ones((2, 60, 80), np.uint8)))
        assert len(list(overlay_frames(seen))) == 2


class TestTint:
    def test_colours_are_told_apart(self) -> None:
        colours = np.array([strong_colour(label) for label in range(1, 25)])
        apart = np.abs(colours[:, None] - colours[None]).sum(axis=2) + 999 * np.eye(24, dtype=int)
        assert apart.min() > 12

    def test_borders_are_inside_of_segments(self) -> None:
        labels = np.ones((8, 8), dtype=np.uint16)
        labels[2:6, 2:6] = 2
        drawn = Tint([1, 2], background=1).over(np.zeros((8, 8, 3), np.uint8), labels)
        border = drawn.astype(int).sum(axis=2) > 300
        expected = labels == 2
        expected[3:5, 3:5] = False
        np.testing.assert_array_equal(border, expected)

    def test_picture_is_left_as_it_was(self) -> None:
        picture = GREY[0].copy()
        Tint([1, 2, 3], background=None).over(picture, labels_of()[0])
        assert (picture == 128).all()

    def test_background_that_nobody_names_is_the_large_segment(self) -> None:
        picture, labels = GREY[0], labels_of()[0]
        named = Tint([1, 2, 3], background=1).over(picture, labels)
        found = Tint([1, 2, 3], background=None)
        np.testing.assert_array_equal(found.over(picture, labels), named)
        np.testing.assert_array_equal(found.over(picture, np.full_like(labels, 2))[0, 0], named[20, 35])
        halves = np.repeat([[1, 2, 3, 4]], 4, axis=0).astype(np.uint16)
        quarter = Tint([1, 2, 3, 4], background=None).over(picture[:4, :4], halves)
        assert (np.abs(quarter.astype(int) - 128).max(axis=2) > 40).all()

    def test_centres(self) -> None:
        centres = centres_of(labels_of()[0])
        assert centres[3] == (109.5, 35.5)
        assert centres_of(labels_of()[0], step=2)[3] == (109.5, 35.5)


class TestPanel:
    def test_rows_that_find_no_room_are_said(self) -> None:
        chain = EventChain(np.tile([[0, 2]], (300, 1)), [(i, 0) for i in range(1, 301)])
        few = ChainPanel(chain, height_px=480, width_px=300)
        assert few.at(1).shape == (480, 300, 3)
        assert few._n_hidden > 0

    def test_columns_around_the_lit_one_are_shown(self) -> None:
        codes = np.arange(2000)[None] % 3
        panel = ChainPanel(EventChain(codes, [(2, 1)]), height_px=480, width_px=300)
        for column in (0, 1000, 1999):
            assert (panel.at(column) < 60).any(), "the lit column has a dark frame"

    def test_chain_without_changes(self) -> None:
        assert ChainPanel(EventChain([[2, 2]], [(2, 1)]), height_px=480, width_px=300).at(0).shape == (480, 300, 3)


class TestLettering:
    def test_fitted(self) -> None:
        assert fitted("cup", 500, size_px=12) == "cup"
        short = fitted("a very long name", 60, size_px=12)
        assert short.endswith("…")
        assert font(12).getlength(short) <= 60

    @pytest.mark.parametrize(("column", "row"), [(0, 0), (39, 19), (-30, 5), (200, 200), (20, 10)])
    def test_what_reaches_over_the_rim_is_cut_off(self, column: int, row: int) -> None:
        picture = np.zeros((20, 40, 3), dtype=np.uint8)
        patch = badge("cup", (255, 0, 0), size_px=12)
        paste(picture, patch, column, row)
        assert picture.any() == (abs(column - 20) < 40 and row < 40)


class Parsed(HTMLParser):
    """Tags that are open, and all addresses."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.ids: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src"):
                self.addresses.append(value or "")
            if name == "id":
                self.ids.append(value or "")
        if tag not in ("meta", "image", "line", "rect"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if self.open and self.open[-1] == tag:
            self.open.pop()


class TestPage:
    def test_shows_chain_and_key_frames(self) -> None:
        page = observation_page(seen_in(), Recording.from_frames(GREY, frames_per_second=25), title="push <1>")
        parsed = Parsed(page)
        assert parsed.open == []
        assert "push &lt;1&gt;" in page
        assert parsed.ids == ["chain", "frames", "frame-0", "frame-2"]
        assert [address for address in parsed.addresses if address.startswith("#")] == ["#frame-0", "#frame-2"]
        assert all(address.startswith(("#", "data:image/jpeg;base64,")) for address in parsed.addresses)
        assert re.search(r'title="box, cup">box, cup</th><td class="r0">0</td><td class="r2">2</td>', page)
        assert "box and cup: touching" in page
        assert "0.08 s" in page
        assert 'class="e2"' in page

    def test_names_are_escaped_everywhere(self) -> None:
        evil = "\"'><script>alert(1)</script>&"
        masks = Segmentation.from_labels(labels_of(), names={2: evil})
        page = observation_page(observe_segments(masks), title=evil)
        assert "<script" not in page
        assert Parsed(page).open == []

    def test_without_label_images_there_are_graphs_alone(self) -> None:
        seen = seen_in()
        page = observation_page(Observation(seen.graphs, seen.key_frames, seen.names, "px"), title="graphs")
        assert "data:" not in page
        assert page.count("no picture of this frame") == 2
        assert page.count('class="node"') == 6

    def test_long_and_wild_movies_stay_below_5_mb(self) -> None:
        rng = np.random.default_rng(5)
        n, segments = 60, 30
        labels = rng.integers(1, segments + 1, (n, 16, 20)).astype(np.uint8).repeat(30, axis=1).repeat(32, axis=2)
        pictures = rng.integers(0, 256, (n, 480, 640, 3), dtype=np.uint8)
        masks = Segmentation.from_labels(labels, names={label: f"segment {label} <&>" * 9 for label in range(1, 31)})
        page = observation_page(observe(masks, over_time=None), Recording.from_frames(pictures), title="wild")
        assert len(page.encode()) < 5_000_000
        shown = [int(one) for one in re.findall(r'id="frame-(\d+)"', page)]
        assert shown == list(range(len(shown)))
        assert f"The first {len(shown)} of 60 key frames are shown." in page
        assert "more rows change" in page

    def test_sizes_that_differ(self) -> None:
        with pytest.raises(ValueError, match="page: expected pictures of"):
            observation_page(seen_in(), Recording.from_frames(GREY[:, :9, :9]), title="no")

    def test_changes_in_words(self) -> None:
        labels = labels_of()
        labels[3:][labels[3:] == 2] = 1
        page = observation_page(observe_segments(Segmentation.from_labels(labels, names={2: "cup"})), title="gone")
        assert "cup leaves" in page
        assert [a < b for a, b in pairwise(map(int, re.findall(r'id="frame-(\d+)"', page)))] == [True, True]
