"""A drawing (SVG) that takes clicks and keys."""

from collections.abc import Callable
from typing import Any

import anywidget
import traitlets

from sec_lab.viz.widgets.keys import ARROWS

# Shortcuts of JupyterLab and Notebook are off while the drawing has the focus; Tab and keys with Ctrl pass through.
_SCRIPT = """
function render({ model, el }) {
  const host = document.createElement("div");
  host.className = "sec-lab-drawing";
  el.appendChild(host);
  function draw() {
    host.innerHTML = model.get("svg");
    host.dataset.drawn = String(Number(host.dataset.drawn || 0) + 1);
  }
  function fit() {
    const takes = model.get("takes_clicks");
    host.classList.toggle("sec-lab-clickable", takes);
    if (takes) {
      host.tabIndex = 0;
      host.dataset.lmSuppressShortcuts = "true";
    }
    host.title = model.get("hint");
  }
  function next(name) {
    const before = model.get(name);
    return (before.length ? before[before.length - 1] : 0) + 1;
  }
  host.addEventListener("click", (event) => {
    const drawn = host.querySelector("svg");
    if (!model.get("takes_clicks") || !drawn) return;
    const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(drawn.getScreenCTM().inverse());
    model.set("clicked", [place.x, place.y, next("clicked")]);
    model.save_changes();
  });
  host.addEventListener("keydown", (event) => {
    if (!model.get("takes_clicks")) return;
    if (event.ctrlKey || event.metaKey || event.altKey || event.key === "Tab" || event.key === "Shift") return;
    event.preventDefault();
    event.stopPropagation();
    model.set("key", [event.key, next("key")]);
    model.save_changes();
  });
  const heard = { "change:svg": draw, "change:takes_clicks": fit, "change:hint": fit };
  for (const [name, hear] of Object.entries(heard)) model.on(name, hear);
  fit();
  draw();
  return () => {
    for (const [name, hear] of Object.entries(heard)) model.off(name, hear);
  };
}
export default { render };
"""

_STYLE = """
.sec-lab-drawing { color: var(--jp-ui-font-color1, inherit); overflow-x: auto; }
.sec-lab-drawing text { pointer-events: none; }
.sec-lab-clickable { cursor: pointer; touch-action: manipulation; width: fit-content; max-width: 100%; }
.sec-lab-clickable:focus { outline: 2px solid var(--jp-brand-color1, #1f5fbf); outline-offset: -2px; }
"""


class Drawing(anywidget.AnyWidget):
    """A drawing that takes clicks and keys; it is drawn by the page, so it fits its theme and is sharp at any size.

    Parameters
    ----------
    svg : str, optional
        Markup of the drawing, e.g. of :mod:`sec_lab.viz.svg`. Setting it shows another one.
    takes_clicks : bool, optional
        Whether clicks and keys are told; the drawing can then have the focus.
    hint : str, optional
        Shown when the mouse rests on the drawing.

    Attributes
    ----------
    clicked : list
        ``[x, y, n]``: place of the last click in units of the drawing, whatever its size on the page, and how many
        clicks there were. Empty before the first.
    key : list
        ``[name, n]``: the last key by its name in browsers (``"ArrowLeft"``), and how many there were.

    Examples
    --------
    >>> drawing = Drawing(takes_clicks=True)
    >>> clicks = []
    >>> drawing.on_click(lambda x, y: clicks.append((x, y)))
    >>> drawing.clicked = [12.5, 7.0, 1]
    >>> clicks
    [(12.5, 7.0)]
    """

    _esm = ARROWS + _SCRIPT
    _css = _STYLE

    svg = traitlets.Unicode("").tag(sync=True)
    takes_clicks = traitlets.Bool(default_value=False).tag(sync=True)
    hint = traitlets.Unicode("").tag(sync=True)
    clicked: traitlets.List[Any] = traitlets.List().tag(sync=True)
    key: traitlets.List[Any] = traitlets.List().tag(sync=True)

    def on_click(self, callback: Callable[[float, float], object]) -> None:
        """Call a function with the place, in units of the drawing, at every click."""
        self.observe(lambda change: callback(float(change["new"][0]), float(change["new"][1])), "clicked")

    def on_key(self, callback: Callable[[str], object]) -> None:
        """Call a function with the name of the key, at every key."""
        self.observe(lambda change: callback(str(change["new"][0])), "key")
