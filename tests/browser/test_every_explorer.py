"""All seven explorers on one page: how fast their pictures follow, in a dark theme, and in Notebook 7."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Locator, Page

from tests.browser.conftest import SCREENS, Lab
from tests.browser.test_chain_explorer import FILMED, PIXEL
from tests.browser.test_explorers import CHAINS

N_MOVES = 20


@dataclass(frozen=True)
class Move:
    """A slider, two keys that move it in turn, and the picture that follows."""

    slider: str
    picture: str
    keys: tuple[str, str]


RIGHT, TO_AND_FRO, ENDS = ("ArrowRight",) * 2, ("ArrowRight", "ArrowLeft"), ("End", "Home")
FRAME = "canvas[aria-label='frame with segments and scene graph']"
SEGMENTS = "canvas[aria-label^='a frame, and its segments']"
EXPLORERS: dict[str, tuple[str, tuple[Move, ...]]] = {
    "chain": (FILMED, (Move(".sec-lab-explorer", FRAME, RIGHT),)),
    "match": (
        "widgets.match_explorer(one, other, titles=('first', 'second'))",
        (Move("tolerance", "similarity of rows", ENDS),),
    ),
    "table": (
        "widgets.table_explorer(chains, classes, normalizer='shorter')",
        (Move("threshold", "pairs decided wrongly", ("ArrowLeft",) * 2),),
    ),
    "learning": (
        "widgets.learning_explorer(chains, title='a model')",
        (Move("weight threshold", "a model with its weights", ENDS),),
    ),
    "noise": ("widgets.noise_explorer(p=0.2, n_samples=100)", (Move("noise level p", "sample ", ENDS),)),
    "segmentation": (
        "widgets.segmentation_explorer(movie, true.labels)",
        (Move("frame", SEGMENTS, RIGHT), Move("α", SEGMENTS, ENDS)),
    ),
    "push": (
        "widgets.push_explorer()",
        (
            Move("x (m)", "the table from above", TO_AND_FRO),
            Move("x (m)", "canvas[aria-label='what the camera sees']", TO_AND_FRO),
        ),
    ),
}
STOPWATCH = """
(node) => {
  globalThis.times = [];
  let begin = null;
  globalThis.begin = () => { begin = performance.now(); };
  const seen = () => requestAnimationFrame(() => {
    if (begin === null) return;
    globalThis.times.push(performance.now() - begin);
    begin = null;
  });
  if (node.tagName === "CANVAS") node.addEventListener("drawn", seen);
  else new MutationObserver(seen).observe(node, { childList: true });
}
"""


def cell(page: Page, place: int) -> Locator:
    return page.locator(".jp-CodeCell").nth(place)


def slider(shown: Locator, name: str) -> Locator:
    if name.startswith("."):
        return shown.locator(f"{name} .widget-slider").first
    return shown.locator(".widget-slider").filter(has_text=re.compile(f"^{re.escape(name)}")).first


def picture(shown: Locator, name: str) -> Locator:
    """A canvas, or the host of a drawing, which stays while the drawing in it is replaced."""
    if name.startswith("canvas"):
        return shown.locator(name).first
    return shown.locator(".sec-lab-drawing").filter(has=shown.page.locator(f"svg[aria-label*='{name}']")).first


def latencies_ms(page: Page, shown: Locator, move: Move, n_moves: int) -> list[float]:
    """From each key on a slider to the page's next frame after the picture has changed."""
    picture(shown, move.picture).evaluate(STOPWATCH)
    slider(shown, move.slider).locator(".noUi-handle").focus()
    for place in range(n_moves):
        page.keyboard.press(move.keys[place % 2])
        page.wait_for_function("n => globalThis.times.length >= n", arg=place + 1)
    times: list[float] = page.evaluate("globalThis.times")
    return times


def test_pictures_follow_in_lab_and_in_notebook(
    lab: Lab, capsys: pytest.CaptureFixture[str], screenshot: Callable[..., Path]
) -> None:
    page = lab.open(CHAINS, *(source for source, _ in EXPLORERS.values()), dark=True, height=1400)
    page.evaluate("document.addEventListener('keydown', () => globalThis.begin?.(), true)")
    table = [f"{'explorer':13} {'slider':17} {'picture':29} moves  median ms  95th percentile ms"]
    for place, (name, (_, moves)) in enumerate(EXPLORERS.items(), start=1):
        shown = page.locator(".jp-CodeCell").nth(place)
        shown.scroll_into_view_if_needed()
        for move in moves:
            picture(shown, move.picture).wait_for(timeout=60_000)
            if move.picture.startswith("canvas"):
                page.wait_for_function("c => c.dataset.drawn", arg=picture(shown, move.picture).element_handle())
            times = latencies_ms(page, shown, move, N_MOVES)
            assert len(times) == N_MOVES
            median, late = np.percentile(times, (50, 95))
            told = move.slider.removeprefix(".sec-lab-explorer") or "frame", move.picture.partition("='")[2].strip("']")
            table.append(
                f"{name:13} {told[0]:17} {(told[1] or move.picture)[:29]:29} {N_MOVES:5} {median:10.0f} {late:19.0f}"
            )
        screenshot(shown, f"{name}_dark")
    chain = page.get_by_role("img", name="event chain")
    assert max(chain.evaluate(PIXEL, [3, 100])) < 60
    SCREENS.mkdir(parents=True, exist_ok=True)
    (SCREENS / "latency.txt").write_text("\n".join(table) + "\n", encoding="utf-8")
    with capsys.disabled():
        print("\nfrom a key on a slider to the picture, measured in the page:", *table, sep="\n")

    # The same kernel, seen from Notebook 7 in its light theme: everything is there, and still moves.
    page.evaluate("() => jupyterapp.commands.execute('docmanager:save')")
    page = lab.beside(page, front="notebook", height=1400)
    page.evaluate("() => jupyterapp.commands.execute('apputils:change-theme', {theme: 'JupyterLab Light'})")
    page.wait_for_selector("body[data-jp-theme-light=true]", state="attached")
    page.evaluate("document.addEventListener('keydown', () => globalThis.begin?.(), true)")
    for place, (name, (_, moves)) in enumerate(EXPLORERS.items(), start=1):
        shown = page.locator(".jp-CodeCell").nth(place)
        shown.scroll_into_view_if_needed()
        picture(shown, moves[0].picture).wait_for()
        assert latencies_ms(page, shown, moves[0], 2)
        screenshot(shown, f"{name}_notebook7")
        if name == "chain":
            assert min(shown.get_by_role("img", name="event chain").evaluate(PIXEL, [3, 100])) > 200
            page.get_by_role("img", name="event chain").press("ArrowUp")
            page.locator(".sec-lab-explorer .widget-label", has_text="plate, ").wait_for()
            screenshot(shown.locator(".sec-lab-explorer"), "chain_explorer_filmed")
