"""The chain explorer in a real browser: every control is moved, and what the page then shows is looked at."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from playwright.sync_api import Locator, Page

from tests.browser.conftest import Lab

MOVIE = """
import sec_lab as sl
from sec_lab.worlds.drawn import moving_object
from sec_lab.viz.widgets import chain_explorer

one = moving_object(1)
seen = sl.observe_segments(sl.Segmentation.from_labels(one.labels, names=one.names), relations="edge counting")
chain_explorer(seen, recording=one.frames)
"""
# Filmed, with depth, so that no two frames are the same picture.
FILMED = """
import os
from pathlib import Path
import numpy as np
import sec_lab as sl
from sec_lab.viz.widgets import chain_explorer
from sec_lab.worlds.tabletop.truth import read_truth

folder = Path(os.environ["SEC_LAB_ROOT"]) / "datasets" / "tabletop_actions" / "moving_object_1_laboratory"
true = read_truth(folder)
frames = np.stack([frame.image for frame in sl.Recording.open(folder / "left.mp4")])
movie = sl.Recording.from_frames(frames, depth=true.depth_mm / 1000, frames_per_second=25)
segments = sl.Segmentation.from_labels(true.labels, background=1, names=true.names)
chain_explorer(segments, recording=movie)
"""
PIXEL = "(canvas, [x, y]) => Array.from(canvas.getContext('2d').getImageData(x, y, 1, 1).data.slice(0, 3))"
SAYS = "([where, words]) => [...document.querySelectorAll(where)].some((e) => e.textContent.includes(words))"


def says(page: Page, words: str) -> None:
    page.wait_for_function(SAYS, arg=[".sec-lab-explorer .widget-label", words])


def listed(page: Page) -> list[str]:
    """Segments of the list; its spaces do not break."""
    texts = page.locator(".sec-lab-explorer select option").all_inner_texts()
    return [text.replace("\xa0", " ") for text in texts]


def drawn(picture: Locator) -> int:
    return int(picture.get_attribute("data-drawn") or 0)


def wait_drawn(page: Page, picture: Locator, before: int) -> None:
    page.wait_for_function("([c, n]) => Number(c.dataset.drawn) > n", arg=[picture.element_handle(), before])


def click_pixel(picture: Locator, x: float, y: float) -> None:
    scale = picture.evaluate("canvas => canvas.getBoundingClientRect().width / canvas.width")
    picture.click(position={"x": x * scale, "y": y * scale})


def move_slider(page: Page, slider: Locator, share: float) -> None:
    box = slider.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + share * box["width"], box["y"] + box["height"] / 2)


def test_every_control_does_what_it_says(lab: Lab, screenshot: Callable[..., Path]) -> None:
    page = lab.open(MOVIE)
    frame, chain = page.get_by_role("img", name="frame with"), page.get_by_role("img", name="event chain")
    says(page, "frame 0 · column 1 of 5")

    # The slider.
    before = drawn(frame)
    slider = page.locator(".sec-lab-explorer .widget-slider .noUi-base")
    move_slider(page, slider, 0.5)
    wait_drawn(page, frame, before)
    says(page, "column 3 of 5")
    screenshot(page, "chain_explorer_lab")

    # Keys: frames, key frames, the ends.
    frame.focus()
    for key, words in (
        ("Home", "frame 0 ·"),
        ("ArrowRight", "frame 1 ·"),
        ("PageDown", "frame 27 ·"),
        ("End", "frame 91 ·"),
    ):
        page.keyboard.press(key)
        says(page, words)
    page.keyboard.press("PageUp")
    says(page, "frame 64 ·")

    # Buttons to the key frames.
    page.get_by_title("to the key frame before").click()
    says(page, "frame 54 ·")
    page.get_by_title("to the next key frame").click()
    says(page, "frame 64 ·")

    # A cell of the chain: its column, and its row's two segments; the present column is lit in green.
    width = chain.evaluate("canvas => canvas.width")
    assert isinstance(width, int)
    top = 48
    lit = np.array(chain.evaluate(PIXEL, [chain_column(chain, 5), 5]))
    before = drawn(chain)
    click_pixel(chain, chain_column(chain, 2), top + 24)
    says(page, "frame 27 ·")
    says(page, "yellow vessel, green background: touching")
    wait_drawn(page, chain, before)
    assert np.abs(np.array(chain.evaluate(PIXEL, [chain_column(chain, 2), 5])) - lit).max() < 12
    screenshot(page.locator(".sec-lab-explorer"), "chain_explorer_row")
    page.keyboard.press("Escape")

    # Playing.
    page.keyboard.press("Home")
    says(page, "frame 0 ·")
    page.keyboard.press(" ")
    says(page, "column 2 of 5")
    page.keyboard.press(" ")
    # Only then no frame is under way any more.
    page.locator(".widget-play .fa-play").wait_for()

    # A segment is chosen in the picture, and named.
    page.keyboard.press("Home")
    says(page, "frame 0 ·")
    click_pixel(frame, 45, 110)
    name = page.get_by_placeholder("name of the chosen segment")
    page.wait_for_function("([e, v]) => e.value === v", arg=[name.element_handle(), "yellow vessel"])
    before = drawn(chain)
    name.fill("bowl")
    name.press("Enter")
    wait_drawn(page, chain, before)
    assert "2 bowl" in listed(page)

    # Two segments become one, and the chain changes; undo brings it back.
    before = drawn(frame)
    page.locator(".sec-lab-explorer select").select_option(index=[1, 2])
    wait_drawn(page, frame, before)
    page.get_by_role("button", name="merge").click()
    page.wait_for_function("document.querySelectorAll('.sec-lab-explorer select option').length === 3")
    page.get_by_role("button", name="undo").click()
    page.wait_for_function("document.querySelectorAll('.sec-lab-explorer select option').length === 4")

    # What cannot be done is said in a sentence, and everything lives on.
    page.locator(".sec-lab-explorer select").select_option(index=[2])
    page.get_by_role("button", name="merge").click()
    alert = page.locator(".sec-lab-alert")
    alert.wait_for()
    assert alert.inner_text() == "merge: choose at least two segments that are parts of one object."
    frame.focus()
    page.keyboard.press("End")
    says(page, "frame 91 ·")
    alert.wait_for(state="detached")


def chain_column(chain: Locator, column: int) -> int:
    """Middle of a column in pixels of the picture of the drawn movie: five columns of 68 before a margin."""
    widths = chain.evaluate("canvas => canvas.width")
    assert isinstance(widths, int)
    return widths - 12 - 68 * (5 - column) - 34
