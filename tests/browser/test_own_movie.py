"""A movie of one's own: by path and by upload, stopped, compared, saved, and everything that can be wrong with it."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from playwright.sync_api import Locator, Page

from sec_lab.graphml import read_observation
from sec_lab.viz.widgets.nearest import nearest, repository_chains
from tests.browser.conftest import ROOT, Lab

WIDGET = """
from sec_lab.viz.widgets import own_movie
widget = own_movie()
widget
"""
MOVIE = ROOT / "datasets" / "tabletop_actions" / "moving_object_1_laboratory" / "left.mp4"


def alert(page: Page, words: str) -> None:
    page.locator(".sec-lab-alert", has_text=words).wait_for()


def open_path(page: Page, path: object, masks: object = "") -> None:
    page.get_by_placeholder("a file, or a folder").fill(str(path))
    page.get_by_placeholder("of a tracker").fill(str(masks))
    button(page, "open").click()


def button(page: Page, words: str) -> Locator:
    return page.locator(".sec-lab-own-movie").get_by_role("button", name=words)


def pictures(folder: Path, n: int) -> Path:
    folder.mkdir()
    for number in range(n):
        picture = np.full((48, 64, 3), 60, dtype=np.uint8)
        picture[16:32, 6 + 4 * number : 22 + 4 * number] = 30, 60, 220
        cv2.imwrite(str(folder / f"{number}.png"), picture)
    return folder


def masks_of(folder: Path, n: int, width: int) -> Path:
    folder.mkdir()
    for number in range(n):
        labels = np.zeros((48, width), dtype=np.uint8)
        labels[16:32, 6 + 4 * number : 22 + 4 * number] = 1
        labels[20:30, 44:60] = 2
        cv2.imwrite(str(folder / f"{number}.png"), labels)
    return folder


def test_bad_input_is_said_and_the_notebook_lives_on(lab: Lab, tmp_path: Path, screenshot: Callable[..., Path]) -> None:
    page = lab.open(WIDGET)
    open_path(page, "")
    alert(page, "movie: expected the path of a movie")
    open_path(page, tmp_path / "none.mp4")
    alert(page, "there is no such file")
    open_path(page, pictures(tmp_path / "one", 1))
    alert(page, "expected at least two frames, got 1")
    movie = pictures(tmp_path / "movie", 6)
    open_path(page, movie, masks_of(tmp_path / "other", 6, 80))
    alert(page, "expected masks of 48×64 like the pictures, got 48×80")
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(MOVIE.read_bytes()[:3000])
    page.locator(".sec-lab-upload input").set_input_files(broken)
    alert(page, "broken.mp4: expected a movie")
    screenshot(page.locator(".sec-lab-own-movie"), "own_movie_broken")

    # The same widget then opens what is right: pictures with masks that fit.
    open_path(page, movie, masks_of(tmp_path / "masks", 6, 64))
    page.get_by_role("img", name="event chain").wait_for()
    page.wait_for_function("document.querySelectorAll('.sec-lab-explorer select option').length === 3")
    assert page.locator(".sec-lab-alert").count() == 0


def test_upload_stop_explore_compare_and_save(lab: Lab, screenshot: Callable[..., Path]) -> None:
    page = lab.open(WIDGET)
    page.locator(".sec-lab-upload input").set_input_files(MOVIE)
    button(page, "cancel").click()
    alert(page, "Stopped; nothing was changed.")
    assert not page.get_by_role("img", name="event chain").is_visible()

    button(page, "open").click()
    page.locator(".sec-lab-explorer .widget-label", has_text="frame 0 ·").wait_for(timeout=60_000)
    page.get_by_role("img", name="frame with").focus()
    page.keyboard.press("PageDown")
    page.locator(".sec-lab-explorer .widget-label", has_text="frame 16 ·").wait_for()

    # Two marks at the rim are parts of the table; merging runs beside the notebook.
    frame = page.get_by_role("img", name="frame with")
    before = frame.get_attribute("data-drawn")
    page.locator(".sec-lab-explorer select").select_option(index=[0, 1, 2])
    page.wait_for_function("([c, n]) => c.dataset.drawn !== n", arg=[frame.element_handle(), before])
    button(page, "merge").click()
    page.wait_for_function("document.querySelectorAll('.sec-lab-explorer select option').length === 4")

    button(page, "compare").click()
    page.locator(".sec-lab-own-movie table").wait_for(timeout=60_000)
    first = page.locator(".sec-lab-own-movie table tbody tr").first.inner_text()
    page.locator(".sec-lab-own-movie input[type=text]").nth(3).fill("seen_by_hand")
    button(page, "save").click()
    # The list of files beside the notebook shows it, too, as soon as it looks anew.
    page.locator("code", has_text="seen_by_hand.graphml").wait_for()
    screenshot(page.locator(".sec-lab-own-movie"), "own_movie")
    saved = read_observation(lab.folder / "seen_by_hand.graphml")
    assert saved.segments.tolist() == [1, 4, 5, 6]
    likest = nearest(saved.chain, repository_chains()).iloc[0]
    assert first.split("\t")[:2] == [likest.name, f"{likest.temporal:.1f}"]
    assert (lab.folder / "seen_by_hand.html").stat().st_size < 5_000_000
