"""The picture that takes clicks and keys, which are none of the notebook's."""

from tests.browser.conftest import Lab

PICTURE = """
import cv2, ipywidgets, numpy as np
from sec_lab.viz.widgets import ClickablePicture

def png(blue):
    image = np.full((20, 30, 3), (blue, 0, 0), dtype=np.uint8)
    return cv2.imencode(".png", image)[1].tobytes()

picture = ClickablePicture(png=png(50), width=600, description="a blue field")
told = ipywidgets.Label("nothing")

def clicked(x, y):
    told.value = f"click {x} {y}"
    picture.png = png(250)

picture.on_click(clicked)
picture.on_key(lambda name: setattr(told, "value", f"key {name}."))
ipywidgets.VBox([picture, told])
"""


def test_clicks_and_keys_reach_the_kernel_and_the_picture_changes(lab: Lab) -> None:
    page = lab.open(PICTURE)
    picture = page.get_by_role("img", name="a blue field")
    told = page.locator(".widget-label")
    blue = "canvas => canvas.getContext('2d').getImageData(3, 3, 1, 1).data[2]"
    page.wait_for_selector("canvas[data-drawn='1']")
    assert picture.evaluate(blue) == 50
    # 20 pixels of the page are one of the picture.
    picture.click(position={"x": 610 - 20, "y": 30})
    page.wait_for_selector("canvas[data-drawn='2']")
    assert picture.evaluate(blue) == 250
    assert told.inner_text() == "click 29 1"
    for key, name in (("ArrowLeft", "ArrowLeft"), ("a", "a"), ("d", "d"), ("Space", " ")):
        page.keyboard.press(key)
        page.get_by_text(f"key {name}.", exact=True).wait_for()
    # None of the keys was a command of the notebook.
    assert page.locator(".jp-CodeCell").count() == 1


MANY = """
import time
noise = np.random.default_rng(0).integers(0, 255, (100, 100, 3), dtype=np.uint8)
for number in range(1000):
    noise[0, 0], noise[0, 1] = number // 4, number % 4
    picture.png = cv2.imencode(".png", noise)[1].tobytes()
    # As fast as a hand can, rather than all at once.
    time.sleep(0.002)
told.value = "all sent"
"""


def test_a_thousand_pictures_leave_nothing_behind_in_the_page(lab: Lab) -> None:
    page = lab.open(PICTURE)
    page.wait_for_selector("canvas[data-drawn]")
    devtools = page.context.new_cdp_session(page)

    def in_use() -> float:
        devtools.send("HeapProfiler.collectGarbage")
        usage = devtools.send("Runtime.getHeapUsage")
        return float(sum(usage[part] for part in ("usedSize", "embedderHeapUsedSize", "backingStorageSize")))

    before = in_use()
    lab.execute(page, MANY)
    page.get_by_text("all sent", exact=True).wait_for(timeout=60_000)
    page.wait_for_function(
        "document.querySelector('canvas').getContext('2d').getImageData(0, 0, 1, 1).data[0] === 999 >> 2"
    )
    # Each of them is a file of 30 kB and a picture of 40 kB.
    assert in_use() - before < 10_000_000
