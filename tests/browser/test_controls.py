"""The walk over all controls notices those that do nothing, of every kind, and those that do something."""

from tests.browser.conftest import Lab
from tests.browser.controls import left_out, move_every_control

PAGE = """
import cv2
import ipywidgets as w
import numpy as np
from sec_lab.viz.widgets import ClickablePicture
from sec_lab.viz.widgets.drawing import Drawing

told = w.Label("0")

def tell(*_):
    told.value = str(int(told.value) + 1)

def controls(which):
    options, png = ["a", "b"], cv2.imencode(".png", np.zeros((40, 60, 3), np.uint8))[1].tobytes()
    drawn = f"<svg aria-label='{which} drawing' width='60' height='40'><rect width='60' height='40'/></svg>"
    return [
        w.IntSlider(description=f"{which} slider"), w.IntRangeSlider(description=f"{which} range"),
        w.ToggleButtons(options=options, description=f"{which} toggles"),
        w.Dropdown(options=options, description=f"{which} dropdown"),
        w.SelectMultiple(options=options, description=f"{which} list"),
        w.Checkbox(description=f"{which} box"), w.BoundedIntText(description=f"{which} number"),
        w.Text(description=f"{which} text", continuous_update=False), w.Button(description=f"{which} button"),
        ClickablePicture(png=png, description=f"{which} picture"), Drawing(svg=drawn, takes_clicks=True),
    ]

dead, alive = controls("dead"), controls("alive")
for control in alive:
    if isinstance(control, w.Button):
        control.on_click(tell)
    else:
        control.observe(tell, ["clicked"] if control.has_trait("clicked") else ["value"])
w.VBox([told, *dead, *alive, w.IntSlider(description="locked", disabled=True)])
"""
KINDS = {"slider", "range", "toggles", "dropdown", "list", "box", "number", "text", "button", "picture", "drawing"}


def test_a_control_that_does_nothing_is_found(lab: Lab) -> None:
    page = lab.open(PAGE, height=1600)
    cell = page.locator(".jp-CodeCell").first
    moved = move_every_control(page, cell)
    assert {one.name for one in moved if not one.n_followed} == {f"dead {kind}" for kind in KINDS}
    assert {one.name for one in moved if one.n_followed} == {f"alive {kind}" for kind in KINDS}
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
