"""Executed notebooks as HTML that needs nothing from the network: pictures embedded, formulas as MathML.

There is no script but the one of an explorer that scrubs, which stands beside its pictures.
"""

import html
import os
import re
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import jinja2
import latex2mathml.converter
import nbformat
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath
from nbformat import NotebookNode

# As of sec_lab.viz.widgets.scrubber, which is imported by the kernels that show widgets only.
FOR_PAGES, SCRUBBER = "SEC_LAB_FOR_PAGES", "application/vnd.sec-lab.scrubber+html"
MOST_EXPLORER_BYTES = 5_000_000
"""Of one explorer that scrubs; a page may have several."""
_WIDGET = "application/vnd.jupyter.widget-view+json"
_PICTURES = ("image/png", "image/jpeg", "image/svg+xml")
_WIDGET_NOTE = (
    '<p class="live">Here <code>make lab</code> shows controls; the cell before shows the same with fixed values.</p>'
)
_SERVER_NOTE = '<p class="live">Here <code>make lab</code> shows a live 3D view.</p>'
_SERVER_FRAME = re.compile(
    r"<iframe\b[^>]*\bsrc\s*=\s*[\"']?https?://(?:localhost|127\.|\[::1\]).*?</iframe>", re.I | re.S
)


@dataclass(frozen=True)
class NotebookSummary:
    """What a notebook says of itself, as HTML for a card on the front page.

    Attributes
    ----------
    title : str
        The first heading.
    paragraph : str
        The first paragraph below it, or an empty string.
    picture : str
        The first picture among the outputs as a ``data:`` address, or an empty string.
    """

    title: str
    paragraph: str
    picture: str

    @property
    def plain_title(self) -> str:
        """The title without markup."""
        return html.unescape(re.sub(r"<[^>]*>", "", self.title))


class _Renderer(IPythonRenderer):
    """Markdown with formulas as MathML, which browsers show without a script."""

    def block_math(self, body: str) -> str:
        return _mathml(body, display="block")

    def inline_math(self, body: str) -> str:
        return _mathml(body, display="inline")

    def latex_environment(self, name: str, body: str) -> str:
        return _mathml(f"\\begin{{{name}}}{body}\\end{{{name}}}", display="block")


def _mathml(tex: str, *, display: str) -> str:
    try:
        formula = str(latex2mathml.converter.convert(tex.strip(), display=display))
    except Exception:  # noqa: BLE001 - formulas it cannot read fail in many ways; the reader then gets the source
        return f"<code>{html.escape(tex.strip())}</code>"
    # HTML needs no name space here, and the anchors of headings would turn it into a prefix that browsers do not know.
    return formula.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', "")


def summarise(notebook: NotebookNode, *, name: str) -> NotebookSummary:
    r"""Find the title, the first paragraph and the first picture of a notebook.

    Parameters
    ----------
    notebook : nbformat.NotebookNode
        With its outputs.
    name : str
        Stands for the title if there is no heading.

    Returns
    -------
    NotebookSummary

    Examples
    --------
    >>> cell = nbformat.v4.new_markdown_cell("# Event *chains*\n\nWhat a\nmovie leaves.\n\nMore.")
    >>> summarise(nbformat.v4.new_notebook(cells=[cell]), name="chapter2")
    NotebookSummary(title='Event <em>chains</em>', paragraph='What a\nmovie leaves.', picture='')
    """
    prose = "\n\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    title, paragraph = html.escape(name), ""
    heading = re.search(r"^# +(.+?) *$", prose, re.MULTILINE)
    if heading:
        title = _inline(heading[1])
        blocks = re.split(r"\n\s*\n", prose[heading.end() :].strip())
        paragraph = next((_inline(block) for block in blocks if re.match(r"[^\W_]|\*\S|[_$`\[(“\"]", block)), "")
    return NotebookSummary(title=title, paragraph=paragraph, picture=_first_picture(notebook))


def _inline(markdown: str) -> str:
    """One paragraph of Markdown as HTML that may stand inside a link."""
    rendered = str(MarkdownWithMath(renderer=_Renderer(escape=True)).render(markdown)).strip()
    return re.sub(r"</?(?:p|a)\b[^>]*>", "", rendered)


def _first_picture(notebook: NotebookNode) -> str:
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            for kind in _PICTURES[:2]:
                if kind in output.get("data", {}):
                    return f"data:{kind};base64,{''.join(output.data[kind].split())}"
    return ""


def explorer_bytes(notebook: NotebookNode) -> tuple[int, ...]:
    """Sizes of the explorers that scrub in the page of an executed notebook, in their order.

    Examples
    --------
    >>> explorer_bytes(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("1")]))
    ()
    """
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return tuple(len(output.data[SCRUBBER].encode()) for output in outputs if SCRUBBER in output.get("data", {}))


def notebook_html(notebook: NotebookNode, *, source: Path, folder: Path, pages: dict[Path, str]) -> str:
    r"""Return the cells of a notebook as HTML, without the page around it.

    Parameters
    ----------
    notebook : nbformat.NotebookNode
        With its outputs; left as it is.
    source : Path
        The notebook file, from which its relative links and pictures start.
    folder : Path
        Where the page will lie.
    pages : dict
        Resolved paths of other notebooks of the report, and the names of their pages.

    Returns
    -------
    str

    Examples
    --------
    >>> notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("$\\psi$")])
    >>> page = notebook_html(notebook, source=Path("a.ipynb"), folder=Path("build"), pages={})
    >>> "<mi>ψ</mi>" in page or "&#x003C8;" in page
    True
    """
    still = nbformat.from_dict(notebook)
    still.metadata.pop("widgets", None)
    section = ""
    for cell in still.cells:
        if cell.cell_type == "markdown":
            headings = re.findall(r"^#+ +(.+?) *$", cell.source, re.MULTILINE)
            section = re.sub(r"[*_`$\\]", "", headings[-1]) if headings else section
        for output in cell.get("outputs", []):
            _make_still(output, alternative=f"Figure: {section}" if section else "Figure")
    exporter = HTMLExporter(
        template_name="basic",
        embed_images=True,
        exclude_input_prompt=True,
        exclude_output_prompt=True,
        require_js_url="",
        jquery_url="",
        mathjax_url="",
        mermaid_js_url="",
        mermaid_layout_elk_js_url="",
        jupyter_widgets_base_url="",
        filters={"markdown2html": _markdown_filter},
    )
    body, _ = exporter.from_notebook_node(still, resources={"metadata": {"path": str(source.parent)}})
    return _with_links(str(body), start=source.parent, folder=folder, pages=pages)


@jinja2.pass_context
def _markdown_filter(context: jinja2.runtime.Context, markdown: str) -> str:
    attachments = (context.get("cell") or {}).get("attachments", {})
    path = context["resources"]["metadata"]["path"]
    renderer = _Renderer(escape=False, embed_images=True, attachments=attachments, path=path)
    return str(MarkdownWithMath(renderer=renderer).render(markdown))


def _make_still(output: NotebookNode, *, alternative: str) -> None:
    """What a page without scripts and servers can show of an output."""
    data: dict[str, Any] = output.get("data", {})
    data.pop("application/javascript", None)
    if _WIDGET in data:
        scrubber = data.get(SCRUBBER, "")
        data.clear()
        data["text/html"] = scrubber or _WIDGET_NOTE
    if "text/latex" in data and "text/html" not in data:
        tex = data.pop("text/latex").strip().strip("$").removeprefix(r"\displaystyle")
        data["text/html"] = _mathml(tex, display="block")
    if "text/html" in data:
        data["text/html"] = _SERVER_FRAME.sub(_SERVER_NOTE, data["text/html"])
    for kind in _PICTURES[:2]:
        if kind in data:
            output.metadata.setdefault(kind, {}).setdefault("alt", alternative)


def _with_links(page: str, *, start: Path, folder: Path, pages: dict[Path, str]) -> str:
    """Let relative links of a notebook lead to the right place from the folder of the page."""

    def moved(match: re.Match[str]) -> str:
        target, mark, fragment = html.unescape(match["target"]).partition("#")
        if not target or re.match(r"[a-z][a-z0-9+.-]*:|/", target, re.IGNORECASE):
            return match[0]
        there = (start / unquote(target)).resolve()
        if there in pages:
            where = pages[there]
        elif there.exists():
            where = Path(os.path.relpath(there, folder.resolve())).as_posix()
        else:
            return match[0]
        return f'{match["before"]}"{html.escape(where + mark + fragment)}"'

    return re.sub(r"""(?P<before><a\b[^>]*?\bhref=)(?P<quote>["'])(?P<target>.*?)(?P=quote)""", moved, page)


def sections_of(page: str) -> list[tuple[str, str]]:
    """Return the identifier and the HTML of every second-level heading.

    Examples
    --------
    >>> sections_of('<h2 id="One">One<a class="anchor-link" href="#One">¶</a></h2>')
    [('One', 'One')]
    """
    found = re.findall(r'<h2\b[^>]*\bid="([^"]+)"[^>]*>(.*?)</h2>', page, re.DOTALL)
    return [(name, re.sub(r'<a class="anchor-link".*?</a>', "", title)) for name, title in found]


class _Loads(HTMLParser):
    """Collects what a browser would fetch by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self._in_style = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._in_style = tag == "style"
        for name, value in attrs:
            if value is None:
                continue
            if name in {"src", "srcset", "poster", "data", "background"} or (
                name == "href" and tag in {"link", "image", "use"}
            ):
                self.addresses += re.findall(r"^\s*((?:https?:)?//\S+)", value)
            if name == "srcdoc":
                self.addresses += network_loads(value)
            if name == "style":
                self._style(value)

    def handle_endtag(self, tag: str) -> None:  # noqa: ARG002
        self._in_style = False

    def handle_data(self, data: str) -> None:
        if self._in_style:
            self._style(data)

    def _style(self, sheet: str) -> None:
        self.addresses += re.findall(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')\s]+)", sheet)


def network_loads(page: str) -> list[str]:
    """Return the addresses that a browser would load by itself to show a page; links to follow do not count.

    Examples
    --------
    >>> network_loads('<a href="https://example.org">there</a> <script src="https://example.org/x.js"></script>')
    ['https://example.org/x.js']
    """
    parser = _Loads()
    parser.feed(page)
    parser.close()
    return parser.addresses


def template() -> jinja2.Template:
    """Return the page around a notebook, and the front page: ``page.html`` beside this module."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(Path(__file__).with_name("page.html").read_text(encoding="utf-8"))
