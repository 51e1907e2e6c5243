"""JupyterLab on loopback, and Debian's Chromium through Playwright; without a browser all of this skips."""

import os
import re
import secrets
import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import nbformat
import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, sync_playwright

ROOT = Path(__file__).parents[2]
SCREENS = ROOT / "build" / "screens"
START_S = 60
RUN_MS = 60_000
IS_READY = """() => {
  const context = globalThis.jupyterapp?.shell.currentWidget?.sessionContext;
  return context?.isReady && context.session?.kernel?.status === "idle";
}"""
RUN_CELL = """async (place) => {
  const notebook = jupyterapp.shell.currentWidget.content;
  notebook.deselectAll();
  notebook.activeCellIndex = place;
  await jupyterapp.commands.execute("notebook:run-cell");
  const outputs = notebook.model.cells.get(place).outputs.toJSON();
  const error = outputs.find((one) => one.output_type === "error");
  if (error) throw new Error(`cell ${place}: ${error.ename}: ${error.evalue}`);
}"""
EXECUTABLE = os.environ.get("SEC_LAB_CHROMIUM") or shutil.which("chromium") or "/usr/bin/chromium"
# JupyterLab complains about itself; what counts is what concerns widgets.
OURS = re.compile(r"widget|sec-lab|createImageBitmap", re.IGNORECASE)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Without a browser, one test stands for all and is skipped with one line."""
    if Path(EXECUTABLE).is_file():
        return
    without = [item for item in items if "browser" in getattr(item, "fixturenames", ())]
    reason = f"{len(without)} tests: no browser, {EXECUTABLE} is not there (SEC_LAB_CHROMIUM names another)"
    for item in without[:1]:
        item.add_marker(pytest.mark.skip(reason=reason))
    config.hook.pytest_deselected(items=without[1:])
    items[:] = [item for item in items if item not in without[1:]]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        rights = ["--no-sandbox"] if os.geteuid() == 0 else []
        launched = playwright.chromium.launch(executable_path=EXECUTABLE, args=rights)
        yield launched
        launched.close()


@dataclass
class Lab:
    """A running JupyterLab, which serves Notebook 7 too."""

    address: str
    token: str
    folder: Path
    browser: Browser
    pages: list[tuple[Page, list[str]]]

    def open(
        self, *sources: str, front: str = "lab", dark: bool = False, width: int = 1300, height: int = 1000
    ) -> Page:
        """Open a notebook of some cells, execute them all, and wait until the last one is done."""
        notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in sources])
        notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
        notebook.metadata["language_info"] = {"name": "python"}
        name = f"page_{len(self.pages)}.ipynb"
        nbformat.write(notebook, self.folder / name)
        page = self._page_of(name, front=front, width=width, height=height)
        if dark:
            page.evaluate("() => void jupyterapp.commands.execute('apputils:change-theme', {theme: 'JupyterLab Dark'})")
            page.wait_for_selector("body[data-jp-theme-light=false]", state="attached", timeout=RUN_MS)
        page.evaluate("() => void jupyterapp.commands.execute('notebook:run-all-cells')")
        last = page.locator(".jp-CodeCell .jp-InputPrompt").nth(len(sources) - 1)
        deadline = time.monotonic() + RUN_MS / 1000
        while not re.search(r"\[\d+\]", last.inner_text()):
            if time.monotonic() > deadline:
                page.screenshot(path=SCREENS / "not_executed.png")
                pytest.fail("the cells are not executed: see build/screens/not_executed.png")
            page.wait_for_timeout(50)
        errors = page.locator(".jp-OutputArea-output[data-mime-type='application/vnd.jupyter.stderr']")
        assert not errors.count(), errors.first.inner_text()
        return page

    def open_stored(self, path: Path, places: list[int], *, width: int = 1300, height: int = 1000) -> Page:
        """Open a copy of a notebook with its stored outputs, and execute some of its cells, one after the other."""
        name = f"page_{len(self.pages)}_{path.name}"
        shutil.copyfile(path, self.folder / name)
        page = self._page_of(name, front="lab", width=width, height=height)
        self.execute(page, f"import os; os.chdir({str(path.parent)!r})")
        for place in places:
            page.evaluate(RUN_CELL, place)
        return page

    def beside(self, page: Page, *, front: str, width: int = 1300, height: int = 1000) -> Page:
        """The notebook of a page in a second page, with the same kernel; it must have been saved."""
        return self._page_of(Path(urlsplit(page.url).path).name, front=front, width=width, height=height)

    def _page_of(self, name: str, *, front: str, width: int, height: int) -> Page:
        """Open a notebook of the folder, and wait until its kernel is there."""
        page = self.browser.new_page(viewport={"width": width, "height": height})
        said: list[str] = []
        self.pages.append((page, said))

        def hear(message: ConsoleMessage) -> None:
            if message.type == "error" and OURS.search(message.text):
                said.append(message.text)

        page.on("console", hear)
        page.on("pageerror", lambda error: said.append(str(error)) if OURS.search(f"{error} {error.stack}") else None)
        # A workspace of its own, or JupyterLab would open what was open before.
        where = f"lab/workspaces/w{len(self.pages)}/tree" if front == "lab" else "notebooks"
        page.goto(f"{self.address}/{where}/{name}?token={self.token}")
        page.wait_for_selector(".jp-Notebook .jp-CodeCell .cm-content", timeout=RUN_MS)
        page.wait_for_function(IS_READY, timeout=RUN_MS)
        return page

    def execute(self, page: Page, source: str) -> None:
        """Execute something in the kernel of a page, from outside its cells."""
        page.evaluate(
            "(code) => void jupyterapp.shell.currentWidget.sessionContext.session.kernel.requestExecute({ code })",
            source,
        )


@pytest.fixture(scope="session")
def running_lab(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    folder = tmp_path_factory.mktemp("pages")
    home = tmp_path_factory.mktemp("home")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    token = secrets.token_hex(20)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "JUPYTER_PREFER_ENV_PATH": "1", "SEC_LAB_ROOT": str(ROOT)}
    environment |= {f"JUPYTER_{place}_DIR": str(home / place.lower()) for place in ("CONFIG", "RUNTIME", "DATA")}
    environment |= {"JUPYTERLAB_SETTINGS_DIR": str(home / "settings"), "IPYTHONDIR": str(home / "ipython")}
    environment |= {"JUPYTERLAB_WORKSPACES_DIR": str(home / "workspaces"), "JUPYTER_TOKEN": token}
    environment.pop("MPLBACKEND", None)
    # Asked nothing, and asking nobody.
    news = home / "settings" / "@jupyterlab" / "apputils-extension" / "notification.jupyterlab-settings"
    news.parent.mkdir(parents=True)
    news.write_text('{"fetchNews": "false", "checkForUpdates": false}')
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--ServerApp.ip=127.0.0.1"]
    command += [f"--ServerApp.port={port}", "--ServerApp.port_retries=0", f"--ServerApp.root_dir={folder}"]
    command += ["--LabApp.expose_app_in_browser=True", "--JupyterNotebookApp.expose_app_in_browser=True"]
    command += ["--LabApp.news_url=None", "--LabApp.extension_manager=readonly"]
    command += ["--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate"]
    with (home / "server.log").open("w") as log:
        server = subprocess.Popen(command, env=environment, stdout=log, stderr=log, cwd=folder)
        try:
            address = f"http://127.0.0.1:{port}"
            _wait_for(f"{address}/api?token={token}", server, home / "server.log")
            yield Lab(address, token, folder, browser, [])
        finally:
            server.terminate()
            server.wait(timeout=30)


def _wait_for(address: str, server: "subprocess.Popen[bytes]", log: Path) -> None:
    deadline = time.monotonic() + START_S
    while True:
        try:
            urllib.request.urlopen(address, timeout=2).close()
            return
        except (urllib.error.URLError, OSError):
            assert server.poll() is None, log.read_text()[-2000:]
            assert time.monotonic() < deadline, log.read_text()[-2000:]
            time.sleep(0.1)


@pytest.fixture
def lab(running_lab: Lab, request: pytest.FixtureRequest) -> Iterator[Lab]:
    """The running lab; pages that the test opens are closed after it, their kernels shut down, and complaints told."""
    before, failed_before = len(running_lab.pages), request.session.testsfailed
    yield running_lab
    complaints = []
    if request.session.testsfailed > failed_before:
        # What the last page looked like, for whoever has to find out why.
        SCREENS.mkdir(parents=True, exist_ok=True)
        running_lab.pages[-1][0].screenshot(path=SCREENS / "failed.png")
    for page, said in running_lab.pages[before:]:
        complaints += said
        page.evaluate("() => void jupyterapp.serviceManager.sessions.shutdownAll()")
        page.close()
    assert complaints == []


@pytest.fixture
def screenshot() -> Callable[..., Path]:
    """Take a picture of a page, or of a part of it, into build/screens."""

    def take(shown: Any, name: str) -> Path:
        SCREENS.mkdir(parents=True, exist_ok=True)
        path = SCREENS / f"{name}.png"
        shown.screenshot(path=path)
        return path

    return take
