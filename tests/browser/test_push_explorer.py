"""The push explorer in JupyterLab: things are placed by hand, the arm pushes live, and the page shows the outcome."""

import io
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.browser.conftest import Lab

WIDGET = "from sec_lab.viz import widgets\nexplorer = widgets.push_explorer()\nexplorer"
PUSH_MS = 180_000


def button(page: Page, name: str) -> Locator:
    # An icon is part of the name, too.
    return page.locator(".sec-lab-controls").get_by_role("button", name=re.compile(rf"\b{name}$"))


def is_a_picture(shown: Locator) -> bool:
    pixels = np.asarray(Image.open(io.BytesIO(shown.screenshot())).convert("RGB"))
    return len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50


def test_a_push_by_hand(lab: Lab, screenshot: Callable[..., Path]) -> None:
    page = lab.open(WIDGET, "print(6 * 7)", height=1500)
    table = page.locator("svg[aria-label='the table from above']")
    camera = page.get_by_role("img", name="what the camera sees")
    expect(camera).to_have_attribute("data-drawn", re.compile(r"\d+"), timeout=60_000)
    # A second red thing: two candidates, nothing moves.
    page.get_by_label("third thing").select_option("another red box")
    expect(table.locator("[data-thing]")).to_have_count(3)
    button(page, "push").click()
    expect(page.locator(".sec-lab-alert")).to_contain_text(
        "expected one candidate for ‘red box’, got 2", timeout=60_000
    )
    page.get_by_label("third thing").select_option("none")
    expect(table.locator("[data-thing]")).to_have_count(2)
    expect(page.locator(".sec-lab-alert")).to_have_count(0)
    # The green box is chosen by a click, and moved by one beside it; the red one becomes a sphere.
    table.locator("[data-thing='1']").click()
    expect(table.locator("[data-chosen='1']")).to_have_count(2)
    before = table.locator("[data-thing='1']").get_attribute("d")
    # The host of the drawing stays while the drawing in it is replaced.
    box = page.locator(".sec-lab-clickable").filter(has=table).bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 130, box["y"] + 210)
    page.wait_for_function("(d) => document.querySelector(\"[data-thing='1']\").getAttribute('d') !== d", arg=before)
    moved = page.locator(".widget-slider").filter(has_text="x (m)").locator(".widget-readout")
    expect(moved).to_have_text(re.compile(r"0\.2[56]\d"))
    table.locator("[data-thing='0']").click()
    button(page, "sphere").click()
    expect(table.get_by_text("red sphere")).to_be_visible()
    # Live while it pushes, stopped, and pushed to the end.
    button(page, "push").click()
    live = page.locator("iframe[title='live 3D view']")
    expect(live).to_be_visible(timeout=60_000)
    assert (live.get_attribute("src") or "").startswith("http://127.0.0.1:")
    button(page, "Cancel").click()
    expect(page.get_by_text("Stopped between two moves")).to_be_visible()
    button(page, "push").click()
    expect(live).to_be_visible(timeout=60_000)
    expect(page.locator("[data-agrees]")).not_to_have_count(0, timeout=PUSH_MS)
    assert is_a_picture(live)
    screenshot(page, "push_explorer_live")
    chains = page.locator("svg[aria-label='the executed chain beside the model']")
    expect(chains.locator("[data-standing='agrees'], [data-standing^='agrees with']")).to_have_count(2, timeout=PUSH_MS)
    expect(page.locator("[data-agrees='True']")).to_have_count(4)
    expect(page.get_by_text("in the simulator red sphere and green box touch")).to_be_visible()
    expect(page.locator("[data-moment]")).to_have_count(5)
    expect(table.locator("[data-after]")).to_have_count(2)
    screenshot(page, "push_explorer")
    recording = page.locator("iframe[title='The arm pushes']")
    recording.evaluate("(node) => node.scrollIntoView()")
    expect(recording.content_frame.locator("canvas").first).to_be_attached(timeout=60_000)
    expect(live).to_have_count(0)
    expect(page.locator(".jp-RenderedText pre").get_by_text("42", exact=True)).to_be_visible()
