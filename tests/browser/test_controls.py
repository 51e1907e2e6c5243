"""The walk over all controls notices those that do nothing, of every kind."""

from tests.browser.conftest import Lab
from tests.browser.controls import left_out, move_every_control

DEAD = {"slider", "range", "toggles", "dropdown", "list", "box", "number", "text", "button", "picture", "drawing"}
PAGE = """
import cv2
import ipywidgets as w
import numpy as np
from sec_lab.viz.widgets import ClickablePicture
from sec_lab.viz.widgets.drawing import Drawing

options, png = ["a", "b"], cv2.imencode(".png", np.zeros((40, 60, 3), np.uint8))[1].tobytes()
svg = "<svg aria-label='drawing' width='60' height='40'><rect width='60' height='40'/></svg>"
dead = [
    w.IntSlider(description="slider"), w.IntRangeSlider(description="range"), w.Checkbox(description="box"),
    w.ToggleButtons(options=options, description="toggles"), w.Dropdown(options=options, description="dropdown"),
    w.SelectMultiple(options=options, description="list"), w.BoundedIntText(description="number"),
    w.Text(description="text", continuous_update=False), w.Button(description="button"),
    ClickablePicture(png=png, description="picture"), Drawing(svg=svg, takes_clicks=True),
]
alive = w.IntSlider(description="alive")
told = w.Label()
alive.observe(lambda change: setattr(told, "value", str(change["new"])), "value")
w.VBox([*dead, alive, told, w.IntSlider(description="locked", disabled=True)])
"""


def test_a_control_that_does_nothing_is_found(lab: Lab) -> None:
    page = lab.open(PAGE, height=1200)
    cell = page.locator(".jp-CodeCell").first
    moved = move_every_control(page, cell)
    assert {one.name for one in moved if one.n_tried and not one.n_followed} == DEAD
    assert {one.name for one in moved if one.n_followed} == {"alive"}
    assert left_out(page, cell, moved) == ["locked"]


LATER = """
import threading
import ipywidgets as w
from sec_lab.viz.widgets.work import Work

told = w.HTML()
work = Work(on_done=lambda given: setattr(told, "value", given), on_failed=lambda said: setattr(told, "value", said))
deaf, heedful = w.Button(description="deaf"), w.Button(description="heedful")

def count(tell, is_heedful):
    for place in range(30):
        threading.Event().wait(0.1)
        if is_heedful:
            tell(place, 30)
    return "done"
deaf.on_click(lambda _: work.start(lambda tell: count(tell, False)))
heedful.on_click(lambda _: work.start(lambda tell: count(tell, True)))
w.VBox([deaf, heedful, work, told])
"""


def test_work_that_cannot_be_cancelled_is_found(lab: Lab) -> None:
    page = lab.open(LATER)
    moved = move_every_control(page, page.locator(".jp-CodeCell").first)
    assert {one.name for one in moved} == {"deaf", "heedful", "cancel (heedful)"}
