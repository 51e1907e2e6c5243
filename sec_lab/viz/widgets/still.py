"""Explorers on a page without a kernel: what they show at some places of one slider, made beforehand."""

import base64
import gzip
import hashlib
import html
import json
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import ipywidgets as widgets

from sec_lab.viz.widgets.drawing import Drawing
from sec_lab.viz.widgets.picture import ClickablePicture
from sec_lab.viz.widgets.scrubber import MOST_BYTES

LIVE_ONLY = "sec-lab-live-only"
"""Class of widgets that a page without a kernel does not show."""

_PAGE = """<div class="sec-lab-still" id="KEY">
<style>
.sec-lab-still { margin: 0.6rem 0 1.4rem; padding: 0.8rem; border-radius: 10px; font-size: 0.9rem;
  border: 1px solid color-mix(in srgb, currentColor 22%, transparent); overflow-x: auto; }
.sec-lab-still svg, .sec-lab-still img { display: block; max-width: 100%; height: auto; margin: 0.4rem 0; padding: 0; }
.sec-lab-still label { display: flex; gap: 0.8rem; align-items: center; max-width: 40rem; }
.sec-lab-still input { flex: 1 1 12rem; }
.sec-lab-still output { min-width: 3rem; font-variant-numeric: tabular-nums; }
</style>
<label><span>NAME</span><input type="range" min="0" max="LAST" value="BEGIN"><output>VALUE</output></label>
<div class="shown">SHOWN</div>
<script>
(async () => {
  const all = document.getElementById("KEY");
  const [slider, output, shown] = ["input", "output", ".shown"].map((what) => all.querySelector(what));
  const packed = Uint8Array.from(atob("DATA"), (letter) => letter.charCodeAt(0));
  const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const { values, pieces, steps } = await new Response(unpacked).json();
  const show = () => {
    output.textContent = values[slider.value];
    shown.innerHTML = steps[slider.value].map((piece) => pieces[piece]).join("");
  };
  slider.addEventListener("input", show);
  // It may have been moved before.
  if (slider.value !== "BEGIN") show();
})();
</script>
</div>
"""


def shown_html(widget: widgets.Widget) -> str:
    """What a widget shows, without its controls: sentences, drawings and pictures as HTML.

    Examples
    --------
    >>> shown_html(widgets.VBox([widgets.IntSlider(), widgets.HTML("<b>said</b>")]))
    '<div><b>said</b></div>'
    """
    return "".join(_pieces(widget))


def still_html(
    explorer: widgets.Widget,
    control: widgets.Widget,
    values: Sequence[Any],
    *,
    wait: Callable[[], None] = lambda: None,
    most_bytes: int = MOST_BYTES,
) -> str:
    """What an explorer shows at each of some values of one control, as HTML with a slider.

    Parameters
    ----------
    explorer : ipywidgets.Widget
        Is left as it is.
    control : ipywidgets.Widget
        A slider of it.
    values : sequence
        Where the control is put; the nearest to where it stands is shown first.
    wait : callable, optional
        Waits until what was asked for is shown.
    most_bytes : int, optional
        Every second value is left out until all fit.

    Returns
    -------
    str
        A piece of HTML with its style and its script; it needs neither kernel nor network.

    Raises
    ------
    ValueError
        If there is no value, or not even one fits.
    """
    begin = control.value
    steps = []
    for value in values:
        control.value = value
        wait()
        steps.append((float(value), list(_pieces(explorer))))
    control.value = begin
    wait()
    while steps and len(_packed(steps)) > most_bytes:
        steps = steps[::2] if len(steps) > 1 else []
    if not steps:
        raise ValueError(f"values: expected one that is shown within {most_bytes} bytes, got none")
    first = min(range(len(steps)), key=lambda i: abs(steps[i][0] - begin))
    data = _packed(steps)
    parts = {
        "KEY": f"still-{hashlib.sha256(data.encode()).hexdigest()[:12]}", "NAME": html.escape(str(control.description)),
        "LAST": str(len(steps) - 1), "BEGIN": str(first), "VALUE": f"{steps[first][0]:g}",
    }  # fmt: skip
    page = _PAGE
    for name, text in parts.items():
        page = page.replace(name, text)
    return page.replace("DATA", data, 1).replace("SHOWN", "".join(steps[first][1]), 1)


def _packed(steps: Sequence[tuple[float, list[str]]]) -> str:
    """Values and what is shown at each; what is shown at several is there once, and all of it is compressed."""
    pieces = list(dict.fromkeys(piece for _, shown in steps for piece in shown))
    place = {piece: number for number, piece in enumerate(pieces)}
    whole = {
        "values": [f"{value:g}" for value, _ in steps],
        "pieces": pieces,
        "steps": [[place[piece] for piece in shown] for _, shown in steps],
    }
    # Without a date, so that the same explorer is the same page.
    return base64.b64encode(gzip.compress(json.dumps(whole).encode(), mtime=0)).decode("ascii")


def _pieces(widget: widgets.Widget) -> Iterator[str]:
    if LIVE_ONLY in getattr(widget, "_dom_classes", ()):
        return
    if isinstance(widget, Drawing):
        yield f"<div>{widget.svg}</div>"
    elif isinstance(widget, ClickablePicture):
        data = base64.b64encode(widget.png).decode("ascii")
        yield f'<img alt="{html.escape(widget.description)}" src="data:image/jpeg;base64,{data}">'
    elif isinstance(widget, widgets.HTML) and widget.value:
        yield f"<div>{widget.value}</div>"
    for child in getattr(widget, "children", ()):
        yield from _pieces(child)
