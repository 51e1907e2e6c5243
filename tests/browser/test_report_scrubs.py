"""The report without any network: its explorers still scrub."""

from collections.abc import Callable
from pathlib import Path

import nbformat
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser

from sec_lab.report import build_report
from sec_lab.worlds.drawn import moving_object
from tests.browser.conftest import ROOT
from tests.browser.test_chain_explorer import MOVIE


def test_explorers_scrub_on_a_page_without_network(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, screenshot: Callable[..., Path]
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    cells = [nbformat.v4.new_markdown_cell("# Explorer\n\nOne movie."), nbformat.v4.new_code_cell(MOVIE)]
    cells.append(nbformat.v4.new_code_cell("from sec_lab import viz\n\nviz.draw_graph_3d(seen)"))
    (tmp_path / "notebooks").mkdir()
    nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "notebooks" / "chapter.ipynb")
    (tmp_path / "requirements.lock").write_text("")
    summary = build_report(root=tmp_path, progress=False)
    assert summary.errors == ()
    (made,) = summary.pages
    assert made.page.stat().st_size < 5_000_000

    page = browser.new_page(viewport={"width": 1200, "height": 900})
    asked: list[str] = []
    page.route("**/*", lambda route: route.continue_() if route.request.url.startswith("file:") else route.abort())
    page.on("request", lambda request: asked.append(request.url))
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(made.page.as_uri())
    scrubber = page.locator(".scrubber")
    output, image = scrubber.locator("output"), scrubber.locator("img.frame")
    assert output.inner_text() == "frame 0 · column 1 of 5"
    shown = image.get_attribute("src")
    assert image.evaluate("image => image.complete && image.naturalWidth > 300")

    scrubber.locator("input[type=range]").fill("40")
    assert output.inner_text() == "frame 40 · column 3 of 5"
    assert image.get_attribute("src") != shown
    lit = scrubber.locator("td.now")
    assert lit.count() == 5
    assert lit.all_inner_texts() == ["1", "1", "1", "0", "0"]

    scrubber.locator("tbody tr").nth(3).locator("td").nth(1).click()
    assert output.inner_text() == "frame 27 · column 2 of 5"
    assert scrubber.locator("tr.chosen th").inner_text() == "black round object, yellow vessel"
    # Its two segments stand out in the picture and in the graph, where they are in this frame.
    outlines = scrubber.locator("svg.outlines g").first.locator("path")
    assert scrubber.locator("svg.outlines g").count() == 2
    assert [outlines.nth(i).get_attribute("data-segment") for i in range(outlines.count())] == ["4", "4", "2", "2"]
    labels = np.asarray(moving_object(1).labels)[27]
    screenshot(scrubber.locator(".view"), "report_scrubber_row")
    for place, label in ((0, 4), (2, 2)):
        box = outlines.nth(place).evaluate(
            "node => { const b = node.getBBox(); return [b.x, b.y, b.width, b.height]; }"
        )
        rows, columns = np.nonzero(labels == label)
        scale = 1 if labels.shape[1] > 320 else -(-256 // labels.shape[0])
        assert np.allclose(np.array(box) / scale, [columns.min(), rows.min(), np.ptp(columns), np.ptp(rows)], atol=1.5)
    last = outlines.first.get_attribute("d")
    scrubber.locator("input[type=range]").fill("50")
    assert outlines.first.get_attribute("d") != last
    scrubber.locator("tbody tr").nth(3).locator("th").click()
    assert outlines.count() == 0
    scrubber.focus()
    for key, words in (
        ("End", "frame 91 ·"),
        ("PageUp", "frame 64 ·"),
        ("ArrowLeft", "frame 63 ·"),
        ("Home", "frame 0 ·"),
    ):
        page.keyboard.press(key)
        assert output.inner_text().startswith(words)
    scrubber.get_by_role("button", name="play").click()
    page.wait_for_function("document.querySelector('.scrubber output').textContent.startsWith('frame 3 ')")
    screenshot(page, "report_scrubber")

    # The 3D view unpacks itself, and shows spheres and tubes on light paper.
    view = page.locator("iframe[title='scene graph']")
    view.scroll_into_view_if_needed()
    view.content_frame.locator("canvas").first.wait_for(timeout=60_000)
    view.content_frame.get_by_text("yellow vessel").wait_for()
    page.wait_for_timeout(500)
    pixels = np.asarray(Image.open(screenshot(view, "report_graph_3d")).convert("RGB")).astype(int)
    assert (pixels.max(axis=2) - pixels.min(axis=2) > 60).mean() > 0.004
    assert (pixels.min(axis=2) > 230).mean() > 0.3
    assert errors == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    page.close()
