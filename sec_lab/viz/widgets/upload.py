"""A file that is brought to the kernel from the page, piece by piece, whatever messages the server lets through."""

import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import anywidget
import traitlets

MOST_MB = 500
_PIECE_BYTES = 1 << 20

# The next piece is sent when the last one has arrived, so nothing piles up; a new file breaks an old one off.
_SCRIPT = """
function render({ model, el }) {
  const box = document.createElement("label");
  box.className = "sec-lab-upload";
  const words = document.createElement("span");
  const input = document.createElement("input");
  input.type = "file";
  box.append(words, input);
  el.appendChild(box);
  let sending = 0;
  const arrived = (n, turn) => new Promise((done) => {
    const look = () => {
      if (model.get("n_bytes") < n && turn === sending) return;
      model.off("change:n_bytes", look);
      done();
    };
    model.on("change:n_bytes", look);
    look();
  });
  async function send() {
    const turn = ++sending;
    const file = input.files[0];
    if (!file) return;
    if (file.size > model.get("most_bytes")) {
      model.send({ kind: "too large", size: file.size, turn });
      return;
    }
    model.set("n_bytes", 0);
    model.save_changes();
    model.send({ kind: "begin", name: file.name, size: file.size, turn });
    const piece = model.get("piece_bytes");
    for (let at = 0; at < file.size; at += piece) {
      const bytes = await file.slice(at, at + piece).arrayBuffer();
      if (turn !== sending) return;
      model.send({ kind: "piece", turn }, undefined, [bytes]);
      await arrived(Math.min(at + piece, file.size), turn);
      if (turn !== sending) return;
    }
    model.send({ kind: "end", turn });
    input.value = "";
  }
  const tell = () => { words.textContent = model.get("description"); };
  input.addEventListener("change", send);
  model.on("change:description", tell);
  tell();
  return () => { sending++; model.off("change:description", tell); };
}
export default { render };
"""

_STYLE = """
.sec-lab-upload {
  display: inline-flex; gap: 0.7em; align-items: center; padding: 0.4em 0.8em; border-radius: 6px;
  border: 1px dashed var(--jp-border-color1, #b6bac1); color: var(--jp-ui-font-color1, inherit);
}
.sec-lab-upload:focus-within { border-color: var(--jp-brand-color1, #1f5fbf); }
.sec-lab-upload input { color: inherit; }
"""


class Upload(anywidget.AnyWidget):
    """A button that brings a file of the visitor's machine into a folder of the kernel's machine.

    Parameters
    ----------
    description : str
        What is asked for.
    most_mb : int, optional
        Larger files are refused before anything is sent.

    Attributes
    ----------
    path : Path or None
        The last file that arrived whole; its folder goes when the widget does.

    Examples
    --------
    >>> upload = Upload("a movie")
    >>> upload.hear({"kind": "begin", "name": "../../my movie.MP4", "size": 3, "turn": 1}, [])
    >>> upload.hear({"kind": "piece", "turn": 1}, [b"abc"])
    >>> upload.hear({"kind": "end", "turn": 1}, [])
    >>> upload.path.name, upload.path.read_bytes()
    ('my_movie.mp4', b'abc')
    """

    _esm = _SCRIPT
    _css = _STYLE

    description = traitlets.Unicode("").tag(sync=True)
    most_bytes = traitlets.Int(0).tag(sync=True)
    piece_bytes = traitlets.Int(_PIECE_BYTES).tag(sync=True)
    n_bytes = traitlets.Int(0).tag(sync=True)

    def __init__(self, description: str, *, most_mb: int = MOST_MB) -> None:
        super().__init__(description=description, most_bytes=most_mb * 1_000_000)
        self.path: Path | None = None
        self._folder = tempfile.TemporaryDirectory(prefix="sec_lab_upload_", ignore_cleanup_errors=True)
        self._file: BinaryIO | None = None
        self._partial: Path | None = None
        self._size = self._turn = 0
        self._on_file: list[Callable[[Path], object]] = []
        self._on_problem: list[Callable[[str], object]] = []
        self.on_msg(lambda _, content, buffers: self.hear(content, buffers))

    def on_file(self, callback: Callable[[Path], object]) -> None:
        """Call a function with the path of every file that has arrived."""
        self._on_file.append(callback)

    def on_problem(self, callback: Callable[[str], object]) -> None:
        """Call a function with one sentence when a file does not arrive."""
        self._on_problem.append(callback)

    def hear(self, content: dict[str, Any], buffers: list[Any]) -> None:
        """Take what the page sends: the beginning of a file, a piece of it, or its end."""
        kind, turn = content.get("kind"), content.get("turn")
        if kind == "too large":
            size, most = content.get("size", 0) / 1e6, self.most_bytes / 1e6
            self._refuse(f"upload: expected a file of at most {most:.0f} MB, got one of {size:.0f} MB; give its path")
        elif kind == "begin":
            self._break_off()
            self._turn, self._size = int(turn or 0), int(content.get("size", 0))
            self._partial = Path(self._folder.name) / _safe_name(str(content.get("name", "")))
            self._file = self._partial.open("wb")
            self.n_bytes = 0
        elif turn != self._turn or self._file is None:
            return
        elif kind == "piece":
            piece = b"".join(bytes(buffer) for buffer in buffers)
            if self._file.tell() + len(piece) > min(self._size, self.most_bytes):
                self._refuse(f"upload: expected {self._size} bytes, got more")
                return
            self._file.write(piece)
            self.n_bytes = self._file.tell()
        elif kind == "end":
            self._finish()

    def _finish(self) -> None:
        assert self._file is not None
        assert self._partial is not None
        n_bytes, path = self._file.tell(), self._partial
        self._file.close()
        self._file = None
        if n_bytes != self._size or not n_bytes:
            self._refuse(f"upload: expected {self._size} bytes, got {n_bytes}; try again")
            return
        self.path = path
        for callback in self._on_file:
            callback(path)

    def _refuse(self, sentence: str) -> None:
        self._break_off()
        for callback in self._on_problem:
            callback(sentence)

    def _break_off(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
        if self._partial is not None and self._partial != self.path:
            self._partial.unlink(missing_ok=True)

    def close(self) -> None:
        """Throw away what was brought."""
        self._break_off()
        self._folder.cleanup()
        super().close()


def _safe_name(name: str) -> str:
    r"""A name of letters, digits and underscores, with the ending of the file; nothing that leads elsewhere.

    Examples
    --------
    >>> _safe_name("C:\\movies\\cut ψ.webm"), _safe_name("..")
    ('cut.webm', 'movie')
    """
    last = re.split(r"[/\\]", name)[-1]
    stem, dot, ending = last.rpartition(".")
    stem = re.sub(r"\W+", "_", stem if dot else last, flags=re.ASCII).strip("_") or "movie"
    ending = re.sub(r"\W", "", ending, flags=re.ASCII).lower()[:8] if dot else ""
    return f"{stem[:60]}.{ending}" if ending else stem[:60]
