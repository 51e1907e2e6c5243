"""A picture that takes clicks and keys."""

from collections.abc import Callable

import anywidget
import traitlets

from sec_lab.viz.widgets.keys import ARROWS

# The picture is decoded beside the page and drawn at once, so there is no flicker, and nothing of it is kept.
# Shortcuts of JupyterLab and Notebook are off while the picture has the focus; Tab and keys with Ctrl pass through.
_SCRIPT = """
function render({ model, el }) {
  const canvas = document.createElement("canvas");
  canvas.className = "sec-lab-picture";
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.dataset.lmSuppressShortcuts = "true";
  el.appendChild(canvas);
  let latest = 0;
  let isGone = false;

  async function draw() {
    const turn = ++latest;
    const bytes = model.get("png");
    if (!bytes || !bytes.byteLength) return;
    let bitmap;
    try {
      bitmap = await createImageBitmap(new Blob([bytes]));
    } catch (error) {
      if (turn === latest) canvas.dataset.error = String(error);
      return;
    }
    if (turn === latest && !isGone) {
      if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
        canvas.width = bitmap.width;
        canvas.height = bitmap.height;
      }
      canvas.getContext("2d").drawImage(bitmap, 0, 0);
      canvas.dataset.drawn = String(turn);
      canvas.dispatchEvent(new CustomEvent("drawn"));
    }
    bitmap.close();
  }
  function fit() {
    const width = model.get("width");
    canvas.style.width = width ? width + "px" : "";
  }
  function tell() {
    canvas.setAttribute("aria-label", model.get("description"));
    canvas.title = model.get("tooltip");
  }
  function next(name) {
    const before = model.get(name);
    return (before.length ? before[before.length - 1] : 0) + 1;
  }
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    const box = canvas.getBoundingClientRect();
    const place = (at, from, size, n) => Math.min(n - 1, Math.max(0, Math.floor(((at - from) / size) * n)));
    const x = place(event.clientX, box.left, box.width, canvas.width);
    const y = place(event.clientY, box.top, box.height, canvas.height);
    model.set("clicked", [x, y, next("clicked")]);
    model.save_changes();
  });
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.key === "Tab" || event.key === "Shift") return;
    event.preventDefault();
    event.stopPropagation();
    model.set("key", [event.key, next("key")]);
    model.save_changes();
  });
  function see() {
    const isDark = document.body.dataset.jpThemeLight === "false";
    if (model.get("is_dark") === isDark) return;
    model.set("is_dark", isDark);
    model.save_changes();
  }
  const themes = new MutationObserver(see);
  themes.observe(document.body, { attributes: true, attributeFilter: ["data-jp-theme-light"] });
  const heard = { "change:png": draw, "change:width": fit, "change:description": tell, "change:tooltip": tell };
  for (const [name, hear] of Object.entries(heard)) model.on(name, hear);
  fit();
  tell();
  draw();
  see();
  return () => {
    isGone = true;
    themes.disconnect();
    for (const [name, hear] of Object.entries(heard)) model.off(name, hear);
  };
}
export default { render };
"""

_STYLE = """
.sec-lab-picture {
  display: block; max-width: 100%; height: auto; border-radius: 4px; cursor: pointer; touch-action: manipulation;
}
.sec-lab-picture:focus { outline: 2px solid var(--jp-brand-color1, #1f5fbf); outline-offset: 1px; }
"""


class ClickablePicture(anywidget.AnyWidget):
    """A picture that takes clicks and keys.

    It is focused by a click or with Tab, and then takes every key but Tab and those held with Ctrl, Alt or Meta.

    Parameters
    ----------
    png : bytes, optional
        The picture as a file: PNG, or anything else that browsers show (JPEG, WebP). Setting it shows another one.
    width : int, optional
        Width on the page in CSS pixels; 0 (default): as wide as it is. Never wider than the page leaves room for.
    description : str, optional
        What is to be seen, for those who do not see it.
    tooltip : str, optional
        Shown when the mouse rests on the picture.

    Attributes
    ----------
    clicked : list of int
        ``[x, y, n]``: column and row of the last click in pixels of the picture, whatever its size on the page, and
        how many clicks there were. Empty before the first.
    is_dark : bool
        Whether the page has a dark theme, as far as a page has said so.
    key : list
        ``[name, n]``: the last key by its name in browsers (``"ArrowLeft"``, ``" "``, ``"a"``), and how many there
        were.

    Examples
    --------
    >>> picture = ClickablePicture(width=320)
    >>> clicks = []
    >>> picture.on_click(lambda x, y: clicks.append((x, y)))
    >>> picture.clicked = [12, 7, 1]
    >>> clicks
    [(12, 7)]
    """

    _esm = ARROWS + _SCRIPT
    _css = _STYLE

    png = traitlets.Bytes(b"").tag(sync=True)
    width = traitlets.Int(0, min=0).tag(sync=True)
    description = traitlets.Unicode("").tag(sync=True)
    tooltip = traitlets.Unicode("").tag(sync=True)
    is_dark = traitlets.Bool(default_value=False).tag(sync=True)
    clicked: traitlets.List[int] = traitlets.List().tag(sync=True)
    key: traitlets.List[str | int] = traitlets.List().tag(sync=True)

    def on_click(self, callback: Callable[[int, int], object]) -> None:
        """Call a function with column and row, in pixels of the picture, at every click."""
        self.observe(lambda change: callback(int(change["new"][0]), int(change["new"][1])), "clicked")

    def on_key(self, callback: Callable[[str], object]) -> None:
        """Call a function with the name of the key, at every key."""
        self.observe(lambda change: callback(str(change["new"][0])), "key")
