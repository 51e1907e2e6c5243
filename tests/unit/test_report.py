"""The report: what is executed again, what the pages hold, and what happens when something fails."""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import nbformat
import pytest
from nbformat import NotebookNode

from sec_lab.report import ReportSummary, build, build_report, pages
from sec_lab.report.execution import NotebookFailure, execute, read_notebook
from sec_lab.report.pages import network_loads, notebook_html, summarise

DOT = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
SHOW_DOT = f"from IPython.display import Image\nimport base64\nImage(base64.b64decode('{DOT}'))"


def notebook(*sources: str) -> NotebookNode:
    """Make a notebook; sources that begin with # and a space are Markdown."""
    cells = [
        nbformat.v4.new_markdown_cell(source) if source.startswith("# ") else nbformat.v4.new_code_cell(source)
        for source in sources
    ]
    return nbformat.v4.new_notebook(cells=cells)


def write(path: Path, *sources: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook(*sources), path)
    return path


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with two chapters and a notebook on recordings that are not here."""
    monkeypatch.delenv("SEC_LAB_DATA", raising=False)
    write(tmp_path / "notebooks" / "chapter10_last.ipynb", "# Ten\n\nThe end.", "10")
    write(tmp_path / "notebooks" / "chapter2_first.ipynb", "# Two\n\nThe start.", "2")
    write(tmp_path / "notebooks" / "real_recordings_hands.ipynb", "# Hands", "1 / 0")
    for name in ("sec_lab/codes.py", "datasets/table.csv", "requirements.lock", "notebooks/picture.svg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(f"{name}\n")
    return tmp_path


@pytest.fixture
def kernels(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Stands for the kernel: notes which notebooks it executed, by the source of their last cell."""
    executed: list[str] = []

    def stand_in(source: NotebookNode, **_: Any) -> NotebookNode:
        last = source.cells[-1].source
        executed.append(last)
        if last.startswith("raise"):
            raise NotebookFailure(f"code cell 1: {last}")
        done = nbformat.from_dict(source)
        done.cells[-1].outputs = [nbformat.v4.new_output("stream", text=f"output of {last}")]
        return done

    monkeypatch.setattr(build, "execute", stand_in)
    return executed


def statuses(summary: ReportSummary) -> dict[str, str]:
    return {page.notebook.stem.rpartition("_")[2]: page.status for page in summary.pages}


def test_only_what_changed_is_executed_again(project: Path, kernels: list[str]) -> None:
    first = build_report(root=project, progress=False)
    assert kernels == ["2", "10"]
    assert statuses(first) == {"first": "executed", "last": "executed", "hands": "stored"}
    again = build_report(root=project, progress=False)
    assert statuses(again) == {"first": "unchanged", "last": "unchanged", "hands": "stored"}
    assert kernels == ["2", "10"]

    # Outputs stored in the notebook are not part of what its page is made from; its cells are.
    changed = notebook("# Ten", "10")
    changed.cells[-1].outputs = [nbformat.v4.new_output("stream", text="stored")]
    nbformat.write(changed, project / "notebooks" / "chapter10_last.ipynb")
    build_report(root=project, progress=False)
    assert kernels == ["2", "10", "10"]
    changed.cells[-1].outputs = []
    nbformat.write(changed, project / "notebooks" / "chapter10_last.ipynb")
    build_report(root=project, progress=False)
    assert kernels == ["2", "10", "10"]


def test_the_size_of_explorers_is_told_and_one_that_is_too_large_is_a_failure(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stand_in(source: NotebookNode, **_: Any) -> NotebookNode:
        done = nbformat.from_dict(source)
        n = 4_999_000 if source.cells[-1].source == "2" else 5_001_000
        data = {pages.SCRUBBER: "a" * n, "application/vnd.jupyter.widget-view+json": {}}
        done.cells[-1].outputs = [nbformat.v4.new_output("display_data", data) for _ in range(2)]
        return done

    monkeypatch.setattr(build, "execute", stand_in)
    first, last, _ = build_report(root=project, progress=False).pages
    assert (first.explorer_bytes, first.error) == ((4_999_000, 4_999_000), "")
    assert last.error == "chapter10_last.ipynb: expected explorers of at most 5 MB each, got 5.0 MB"
    assert not last.page.exists()


@pytest.mark.parametrize(
    "name",
    [
        "sec_lab/codes.py",
        "sec_lab/viz/new.py",
        "datasets/table.csv",
        "datasets/movie/new.csv",
        "requirements.lock",
        "notebooks/picture.svg",
    ],
)
def test_what_every_notebook_depends_on(project: Path, kernels: list[str], name: str) -> None:
    build_report(root=project, progress=False)
    kernels.clear()
    (project / name).parent.mkdir(exist_ok=True)
    (project / name).write_text("changed\n")
    build_report(root=project, progress=False)
    assert kernels == ["2", "10"]


def test_caches_are_nothing_to_depend_on(project: Path, kernels: list[str]) -> None:
    build_report(root=project, progress=False)
    (project / "sec_lab" / "__pycache__").mkdir()
    (project / "sec_lab" / "__pycache__" / "codes.pyc").write_text("compiled")
    assert "executed" not in statuses(build_report(root=project, progress=False)).values()


def test_force_executes_what_did_not_change(project: Path, kernels: list[str]) -> None:
    build_report(root=project, progress=False)
    build_report([project / "notebooks" / "chapter2_first.ipynb"], root=project, progress=False, force=True)
    assert kernels == ["2", "10", "2"]


def test_recordings_are_executed_where_they_lie(
    project: Path, kernels: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = build_report(root=project, progress=False)
    assert "SEC_LAB_DATA" in stored.pages[-1].page.read_text()
    monkeypatch.setenv("SEC_LAB_DATA", str(project / "nowhere"))
    assert statuses(build_report(root=project, progress=False))["hands"] == "stored"
    monkeypatch.setenv("SEC_LAB_DATA", str(project))
    assert statuses(build_report(root=project, progress=False))["hands"] == "executed"
    assert kernels == ["2", "10", "1 / 0"]
    assert statuses(build_report(root=project, progress=False))["hands"] == "unchanged"
    monkeypatch.delenv("SEC_LAB_DATA")
    assert statuses(build_report(root=project, progress=False))["hands"] == "stored"


def test_others_are_listed_when_one_is_asked_for(project: Path, kernels: list[str]) -> None:
    path = project / "notebooks" / "chapter10_last.ipynb"
    one = build_report([path], root=project, progress=False)
    assert kernels == ["10"]
    assert statuses(one) == {"first": "absent", "last": "executed", "hands": "stored"}
    assert not one.pages[0].page.exists()
    assert "chapter2_first.html" not in one.index.read_text()
    build_report(root=project, progress=False)
    (project / "requirements.lock").write_text("changed")
    assert statuses(build_report([path], root=project, progress=False))["first"] == "outdated"


def test_a_failure_keeps_the_others_and_the_last_good_page(project: Path, kernels: list[str]) -> None:
    page = build_report(root=project, progress=False).pages[0].page
    write(project / "notebooks" / "chapter2_first.ipynb", "# Two", "raise ValueError('no')")
    write(project / "notebooks" / "chapter10_last.ipynb", "# Ten", "11")
    summary = build_report(root=project, progress=False)
    assert statuses(summary) == {"first": "failed", "last": "executed", "hands": "stored"}
    assert summary.errors == ("chapter2_first.ipynb, code cell 1: raise ValueError('no')",)
    assert "output of 2" in page.read_text()
    assert "raise ValueError" in summary.index.read_text()
    # It is tried again until it goes well.
    kernels.clear()
    build_report(root=project, progress=False)
    assert kernels == ["raise ValueError('no')"]


def test_a_page_that_would_load_from_the_network_is_a_failure(project: Path, kernels: list[str]) -> None:
    path = write(
        project / "notebooks" / "chapter2_first.ipynb", '# Two\n\n<img src="https://example.org/a.png" alt="a">', "2"
    )
    summary = build_report(root=project, progress=False)
    assert summary.pages[0].notebook == path
    assert summary.pages[0].status == "failed"
    assert "https://example.org/a.png" in summary.errors[0]
    assert kernels == ["2", "10"]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "there is no such file"),
        ("folder", "directory"),
        ("not json", "expected a Jupyter notebook"),
        ("[]", "expected a Jupyter notebook"),
        ('{"nbformat": 4, "nbformat_minor": 5, "metadata": {}}', "expected a Jupyter notebook"),
        (
            '{"nbformat": 4, "nbformat_minor": 5, "metadata": {}, "cells": [{"cell_type": "code"}]}',
            "expected a Jupyter",
        ),
    ],
)
def test_unusable_notebooks_are_refused_in_one_line(project: Path, content: str | None, says: str) -> None:
    path = project / "other.ipynb"
    if content == "folder":
        path.mkdir()
    elif content is not None:
        path.write_text(content)
    with pytest.raises(ValueError, match=says) as caught:
        build_report([path], root=project, progress=False)
    assert str(path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_two_notebooks_of_one_name_are_refused(project: Path) -> None:
    other = write(project / "elsewhere" / "chapter2_first.ipynb", "# Another", "3")
    with pytest.raises(ValueError, match="a name of its own"):
        build_report([other], root=project, progress=False)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ReportSummary]:
    """A report of two notebooks, executed by real kernels, one of which fails."""
    root = tmp_path_factory.mktemp("project")
    (root / "sec_lab").mkdir()
    (root / "sec_lab" / "codes.py").touch()
    write(
        root / "notebooks" / "chapter2_chains.ipynb",
        "# Chains *of* $\\xi$\n\nSee [the next](chapter3_noise.ipynb#Noise) and [codes](../sec_lab/codes.py).\n\n"
        "## Formulas\n\n$$\\psi = \\begin{pmatrix} 0 & 1 \\\\ 2 & 9 \\end{pmatrix}$$",
        "import os, sys\nprint(sys.executable)\nprint(os.path.basename(os.getcwd()))",
        SHOW_DOT,
        "import ipywidgets\nipywidgets.IntSlider(3)",
        "from IPython.display import Latex\nLatex(r'$\\displaystyle \\alpha$')",
    )
    write(root / "notebooks" / "chapter3_noise.ipynb", "# Noise", "1", "{}['missing\\nkey']", "2")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MPLBACKEND", "agg")
        yield build_report(root=root, progress=False)


def test_kernels_are_this_interpreter_in_the_folder_of_the_notebook(built: ReportSummary) -> None:
    page = built.pages[0].page.read_text()
    assert f"{sys.executable}\nnotebooks\n" in page


def test_failing_cell_is_named(built: ReportSummary) -> None:
    assert built.errors == ("chapter3_noise.ipynb, code cell 2: KeyError: 'missing\\nkey'",)


def test_pages_stand_alone_and_their_links_lead_somewhere(built: ReportSummary) -> None:
    pages = [built.index, built.pages[0].page]
    for path in pages:
        page = path.read_text()
        assert not re.search(r"<(script|link|iframe)\b", page)
        assert not re.search(r"""(src|srcset|data)=["']?(https?:)?//""", page)
        assert network_loads(page) == []
        for target in re.findall(r'\bhref="([^"]+)"', page):
            file, _, fragment = target.partition("#")
            there = (path.parent / unquote(file)).resolve() if file else path
            assert there.exists(), target
            assert not fragment or there.suffix != ".html" or f'id="{fragment}"' in there.read_text()
    assert "chapter2_chains.html" in built.index.read_text()


def test_formulas_pictures_and_widgets_need_no_script(built: ReportSummary) -> None:
    page = built.pages[0].page.read_text()
    assert len(re.findall(r"<math\b", page)) == 3
    assert "$" not in re.sub(r"<style>.*?</style>|<pre>.*?</pre>", "", page, flags=re.DOTALL)
    assert f"data:image/png;base64,{DOT}" in page
    assert "make lab" in page
    assert "IntSlider(value=3)" not in page


def test_front_page_has_title_paragraph_and_picture(built: ReportSummary) -> None:
    page = built.index.read_text()
    assert "Chains <em>of</em> <math" in page
    assert "See the next and codes." in page
    assert f"data:image/png;base64,{DOT}" in page
    assert "prefers-color-scheme: dark" in page


def test_neighbours_are_linked_in_reading_order(project: Path, kernels: list[str]) -> None:
    summary = build_report(root=project, progress=False)
    assert [page.notebook.stem for page in summary.pages] == [
        "chapter2_first",
        "chapter10_last",
        "real_recordings_hands",
    ]
    middle = summary.pages[1].page.read_text()
    assert 'rel="prev" href="chapter2_first.html"' in middle
    assert 'rel="next" href="real_recordings_hands.html"' in middle
    assert 'rel="prev"' not in summary.pages[0].page.read_text()
    assert 'rel="next"' not in summary.pages[2].page.read_text()
    assert len(kernels) == 2


def test_execution_leaves_its_argument_as_it_was() -> None:
    source = notebook("1 + 1")
    before = json.dumps(source)
    ticks: list[int] = []
    done = execute(source, folder=Path(), on_cell=lambda: ticks.append(1))
    assert json.dumps(source) == before
    assert ticks == [1]
    assert done.cells[0].outputs[0].data["text/plain"] == "2"
    assert "execution" not in done.cells[0].metadata


def test_a_dead_kernel_is_a_failure_of_its_cell() -> None:
    with pytest.raises(NotebookFailure, match=r"^code cell 2: the kernel died$"):
        execute(notebook("1", "import os\nos._exit(1)"), folder=Path())


@pytest.mark.parametrize(
    ("page", "loads"),
    [
        ('<script src="https://a.b/x.js"></script>', ["https://a.b/x.js"]),
        ("<script src=//a.b/x.js></script>", ["//a.b/x.js"]),
        ('<link rel="stylesheet" href="http://a.b/x.css">', ["http://a.b/x.css"]),
        ("<style>@import 'https://a.b/x.css';</style>", ["https://a.b/x.css"]),
        ('<p style="background: url(https://a.b/x.png)">', ["https://a.b/x.png"]),
        ("<iframe srcdoc=\"<img src='https://a.b/x.png'>\"></iframe>", ["https://a.b/x.png"]),
        ('<img src="data:image/png;base64,AAAA"><a href="https://a.b">there</a>', []),
        ('<pre>&lt;script src="https://a.b/x.js"&gt;</pre> <img src="x.png">', []),
    ],
)
def test_network_loads(page: str, loads: list[str]) -> None:
    assert network_loads(page) == loads


def test_live_views_of_servers_become_a_note() -> None:
    shown = notebook("meshcat")
    frame = '<iframe src="http://127.0.0.1:7000/static/" height="400"></iframe>'
    shown.cells[0].outputs = [nbformat.v4.new_output("display_data", data={"text/html": f"<div>{frame}</div>"})]
    page = notebook_html(shown, source=Path("a.ipynb"), folder=Path(), pages={})
    assert "127.0.0.1" not in page
    assert "live 3D view" in page
    assert "127.0.0.1" in shown.cells[0].outputs[0].data["text/html"]


@pytest.mark.parametrize(
    ("source", "title", "paragraph"),
    [
        ("# A < B\n\nText with `code`.", "A &lt; B", "Text with <code>code</code>."),
        ("# A\n\n| a | b |\n|---|---|\n\n- item\n\n**Bold** start.", "A", "<strong>Bold</strong> start."),
        ("# A", "A", ""),
        ("# Only <script>alert(1)</script>", "Only &lt;script&gt;alert(1)&lt;/script&gt;", ""),
    ],
)
def test_summary(source: str, title: str, paragraph: str) -> None:
    summary = summarise(notebook(source), name="name")
    assert (summary.title, summary.paragraph, summary.picture) == (title, paragraph, "")


def test_summary_of_a_notebook_without_heading_is_its_name() -> None:
    assert summarise(notebook("1"), name="chapter2").plain_title == "chapter2"


def test_notebooks_are_read_as_they_are(tmp_path: Path) -> None:
    path = write(tmp_path / "a.ipynb", "# Title", "1 + 1")
    assert [cell.source for cell in read_notebook(path).cells] == ["# Title", "1 + 1"]
