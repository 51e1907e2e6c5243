"""Every explorer in JupyterLab: all controls are moved, and the page shows what they changed."""

import re
from collections.abc import Callable
from pathlib import Path

import nbformat
from playwright.sync_api import Locator, Page, expect

from tests.browser.conftest import Lab
from tests.browser.slices import needed_cells

CHAINS = """
import numpy as np
from sec_lab.noise import Noise, noisy_samples
from sec_lab.noise_seeds import CLASS_SEEDS
from sec_lab.viz import widgets

rng = np.random.default_rng(7)
chains, classes = {}, []
for kind in ("moving", "pouring"):
    for i, chain in enumerate(noisy_samples(CLASS_SEEDS[kind], 0.08, n_samples=3, rng=rng, noise=Noise("flip only"))):
        chains[f"{kind} {i + 1}"] = chain
        classes.append(kind)
one, other = chains["moving 1"], chains["moving 2"]
"""
SCENE = """
import numpy as np
from sec_lab.viz import widgets

rng = np.random.default_rng(0)
truth = np.ones((4, 256, 320), np.uint8)
for i in range(4):
    truth[i, 60:140, 40 + 20 * i : 140 + 20 * i] = 2
    truth[i, 170:230, 200:300] = 3
colours = np.array([[0, 0, 0], [90, 90, 90], [200, 60, 50], [60, 90, 200]])
frames = np.clip(colours[truth] + rng.normal(0, 4, (*truth.shape, 3)), 0, 255).astype(np.uint8)
"""
EXPLORER = """
import ipywidgets

explorer, told = widgets.segmentation_explorer(frames, truth), ipywidgets.Label()
for control in vars(explorer).values():
    if isinstance(control, ipywidgets.ValueWidget):
        control.observe(lambda _: setattr(told, "value", repr(explorer.parameters)), "value")
ipywidgets.VBox([explorer, told])
"""


def slider(page: Page, label: str) -> Locator:
    return page.locator(".widget-slider").filter(has_text=re.compile(f"^{re.escape(label)}"))


def step(page: Page, label: str, key: str = "ArrowRight") -> str:
    """Move a slider by a key; what it then reads."""
    one = slider(page, label)
    before = one.locator(".widget-readout").inner_text()
    one.locator(".noUi-handle").focus()
    page.keyboard.press(key)
    expect(one.locator(".widget-readout")).not_to_have_text(before)
    return one.locator(".widget-readout").inner_text()


def slide(page: Page, label: str, share: float) -> str:
    """Move a slider to a share of its way with the mouse; what it then reads."""
    one = slider(page, label)
    before = one.locator(".widget-readout").inner_text()
    box = one.locator(".noUi-base").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + share * box["width"], box["y"] + box["height"] / 2)
    expect(one.locator(".widget-readout")).not_to_have_text(before)
    return one.locator(".widget-readout").inner_text()


def choose(page: Page, label: str, option: str) -> None:
    """Press one of some toggle buttons."""
    group = page.locator(".widget-toggle-buttons").filter(has_text=re.compile(f"^{re.escape(label)}"))
    group.get_by_role("button", name=option, exact=True).click()
    expect(group.locator("button.mod-active")).to_have_text(option)


def drawing(page: Page, label: str) -> Locator:
    return page.locator(f"svg[aria-label*='{label}']")


def changes(page: Page, shown: Locator, move: Callable[[], object]) -> None:
    """A move must change what is shown."""
    before = shown.first.inner_html()
    move()
    expect(shown.first).not_to_be_empty()
    page.wait_for_function("([node, before]) => node.innerHTML !== before", arg=[_handle(shown), before])


def _handle(shown: Locator) -> object:
    # The host of a drawing stays while the drawing in it is replaced.
    return shown.first.element_handle()


def host(page: Page, label: str) -> Locator:
    return page.locator(".sec-lab-drawing").filter(has=drawing(page, label))


def says(page: Page, text: str | re.Pattern[str]) -> None:
    expect(page.locator(".widget-html-content").filter(has_text=text).first).to_be_visible()


def test_match_explorer(lab: Lab, screenshot: Callable[..., Path]) -> None:
    page = lab.open(CHAINS, "widgets.match_explorer(one, other, titles=('first', 'second'))")
    both, rows = host(page, "first and second"), host(page, "similarity of rows")
    says(page, re.compile(r"ψ_spatial \d+ %, ψ_temporal \d+ %"))
    changes(page, rows, lambda: choose(page, "divide by the", "shorter row"))
    before = page.locator("[data-candidate]").count()
    slider(page, "tolerance").locator(".noUi-handle").focus()
    page.keyboard.press("End")
    expect(slider(page, "tolerance").locator(".widget-readout")).to_have_text("100")
    page.wait_for_function(f"() => document.querySelectorAll('[data-candidate]').length > {before}")
    changes(page, both, lambda: step(page, "permutation"))
    says(page, re.compile("permutation 2 of"))
    changes(page, both, lambda: choose(page, "rows as", "names"))
    assert "hand" in both.inner_text()
    changes(page, both, lambda: choose(page, "columns of", "ξ_d"))
    assert drawing(page, "segments that play the same role").locator("[data-role]").count() > 0
    screenshot(page, "match_explorer")


def test_table_explorer(lab: Lab, screenshot: Callable[..., Path]) -> None:
    page = lab.open(CHAINS, "widgets.table_explorer(chains, classes, normalizer='shorter')", height=1500)
    page.evaluate("() => void jupyterapp.commands.execute('apputils:change-theme', {theme: 'JupyterLab Dark'})")
    page.wait_for_selector("body[data-jp-theme-light=false]", state="attached")
    table = host(page, "similarities of all pairs")
    says(page, re.compile(r"threshold 64 %: \d+ of 15 pairs are similar; \d+ false negative"))
    slider(page, "threshold").locator(".noUi-handle").press("End")
    says(page, "threshold 100 %: 0 of 15 pairs are similar; 6 false negatives (of 6 pairs of one class)")
    expect(table.locator("[data-decision='false negative']")).to_have_count(12)
    expect(host(page, "pairs decided wrongly").locator("[data-marker='100']")).to_have_count(1)
    table.locator("[data-cell='moving 2|pouring 1']").click()
    says(page, "moving 2 (moving) and pouring 1 (pouring)")
    expect(drawing(page, "moving 2 and pouring 1")).to_be_visible()
    page.keyboard.press("ArrowRight")
    expect(drawing(page, "moving 2 and pouring 2")).to_be_visible()
    page.keyboard.press("ArrowUp")
    expect(drawing(page, "moving 1 and pouring 2")).to_be_visible()
    expect(table.locator("[data-chosen]")).to_have_count(1)
    # None of the keys was a command of the notebook.
    assert page.locator(".jp-CodeCell").count() == 2
    screenshot(page, "table_explorer")


def test_learning_explorer(lab: Lab, screenshot: Callable[..., Path]) -> None:
    page = lab.open(CHAINS, "widgets.learning_explorer(chains, title='a model')")
    model = host(page, "a model with its weights")
    says(page, "learned from 6 of 6 demonstrations")
    changes(page, model, lambda: page.get_by_label("pouring 1").uncheck())
    says(page, "learned from 5 of 6 demonstrations")
    for name in ("pouring 2", "pouring 3"):
        page.get_by_label(name).uncheck()
    says(page, "learned from 3 of 6 demonstrations")
    changes(page, model, lambda: step(page, "weight threshold", "End"))
    step(page, "weight threshold", "Home")
    page.get_by_role("button", name="All", exact=True).click()
    choose(page, "mode", "online")
    says(page, re.compile("not type-similar, so passed over: .*pouring 1"))
    choose(page, "divide by the", "shorter row")
    step(page, "tolerance")
    page.get_by_role("button", name="None", exact=True).click()
    expect(page.locator(".sec-lab-alert")).to_contain_text("expected at least two that are ticked, got 0")
    page.get_by_role("button", name="All", exact=True).click()
    expect(page.locator(".sec-lab-alert")).to_have_count(0)
    expect(model).to_be_visible()
    screenshot(page, "learning_explorer")


def test_noise_explorer(lab: Lab, screenshot: Callable[..., Path]) -> None:
    page = lab.open("from sec_lab.viz import widgets\nwidgets.noise_explorer(p=0.2, n_samples=30)", front="notebook")
    curves, sample = host(page, "noise level p"), host(page, "sample ")
    expect(curves.locator("[data-curve]")).to_have_count(2)
    changes(page, sample, lambda: slide(page, "noise level p", 0.6))
    expect(curves.locator("[data-marker='0.6']")).to_have_count(1)
    changes(page, sample, lambda: slide(page, "sample", 0.9))
    says(page, re.compile(r"sample 2\d:"))
    changes(page, sample, lambda: page.get_by_label("seed chain").select_option("6×8"))
    changes(page, sample, lambda: choose(page, "mode", "flip only"))
    changes(page, sample, lambda: page.get_by_label("samples a level").select_option("1000"))
    says(page, "mean of 1000 samples")
    number = page.get_by_label("random seed")
    changes(page, sample, lambda: [number.fill("5"), number.press("Enter")])
    expect(curves.locator("[data-curve]")).to_have_count(2)
    screenshot(page, "noise_explorer")


def test_segmentation_explorer(lab: Lab, screenshot: Callable[..., Path]) -> None:
    page = lab.open(SCENE, EXPLORER, height=1200)
    says(page, "frame 0: 3 segments; 3 true ones are covered by 1.000")
    for label, name, value in (
        ("α", "alpha", 6.1), ("sweeps of annealing", "anneal_sweeps", 21), ("sweeps of smoothing", "smooth_sweeps", 3),
        ("blur σ", "blur_sigma_px", 0.1), ("minimum size", "minimum_size_px", 61),
        ("minimum thickness", "minimum_thickness_px", 4),
    ):  # fmt: skip
        assert float(step(page, label)) == value
        expect(page.locator(".widget-label").filter(has_text=f"{name}={value},")).to_be_visible()
    choose(page, "colours in", "rgb")
    expect(page.locator(".widget-label").filter(has_text="colour_space='rgb'")).to_be_visible()
    slider(page, "minimum size").locator(".noUi-handle").focus()
    page.keyboard.press("End")
    says(page, "frame 0: 3 segments")
    slider(page, "α").locator(".noUi-handle").focus()
    page.keyboard.press("Home")
    says(page, re.compile(r"frame 0: ([124-9]|\d\d+) segments?; 3 true ones are covered by 0"))
    page.keyboard.press("End")
    says(page, "frame 0: 3 segments; 3 true ones are covered by 1.000")
    picture = page.get_by_role("img", name="a frame, and its segments beside it")
    picture.click(position={"x": 5, "y": 5})
    says(page, re.compile(r"column 5 px, row 5 px: segment 1, 67920 px \(82.9 %\)"))
    screenshot(page, "segmentation_explorer")


def test_bad_input_is_a_sentence_and_the_notebook_lives_on(lab: Lab) -> None:
    page = lab.open(
        CHAINS, "widgets.match_explorer(one, 3)", "widgets.segmentation_explorer('no/such/movie.mp4')", "print(6 * 7)"
    )
    expect(page.locator(".sec-lab-alert").nth(0)).to_contain_text(
        "other: expected an event chain or an observation, got int"
    )  # fmt: skip
    expect(page.locator(".sec-lab-alert").nth(1)).to_contain_text("no/such/movie.mp4: expected a movie")
    expect(page.locator(".jp-OutputArea-output").filter(has_text="42")).to_be_visible()


def test_names_that_a_comprehension_binds_need_no_other_cell() -> None:
    sources = ["for name in 'ab':\n    print(name)", "names = {name: 1 for name in 'ab'}", "[name for name in names]"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in sources])
    assert needed_cells(notebook, 2) == sources[1:]
