"""JupyterLab with a kernel: notebook 02 runs from top to bottom, and the slider of `explorer.replay` moves its picture.

What the second needs of `vsp/explorer.py`: an ipywidgets IntSlider whose description begins with "iteration", and an
<img> in the same output whose source changes with it.
"""

import importlib.util
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOK, TOKEN = "02_distillation.ipynb", "vsp"
SLIDER = ".jp-OutputArea-child:has(.widget-label:text-matches('^iteration'))"
UNDER_A_BUSY_MACHINE = 300_000  # ms


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """The address of a JupyterLab on a copy of the notebooks, with nobody's settings."""
    home = tmp_path_factory.mktemp("lab")
    shutil.copytree(ROOT / "notebooks", home / "notebooks")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    own = {name: str(home / name.lower()) for name in ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR")}
    with open(home / "log.txt", "w") as log:
        server = subprocess.Popen(
            [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", f"--port={port}", "--port-retries=0",
             f"--IdentityProvider.token={TOKEN}", f"--ServerApp.root_dir={home / 'notebooks'}",
             "--LabApp.expose_app_in_browser=True", "--LabApp.news_url=None",
             "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate"],
            env={**os.environ, **own, "IPYTHONDIR": str(home / "ipython")}, stdout=log, stderr=log,
        )  # fmt: skip
    address = f"http://127.0.0.1:{port}"
    try:
        _wait_for(address, server, home / "log.txt")
        yield address
    finally:
        server.terminate()
        server.wait(30)


def _wait_for(address, server, log):
    for _ in range(240):
        assert server.poll() is None, log.read_text()
        try:
            return urllib.request.urlopen(f"{address}/api?token={TOKEN}", timeout=5)
        except OSError:
            time.sleep(0.5)
    raise TimeoutError(log.read_text())


@pytest.fixture(scope="module")
def notebook(lab, browser):
    """The notebook in JupyterLab, after "Run All Cells" came to its end."""
    page = browser.new_context(viewport={"width": 1400, "height": 1000}).new_page()
    page.goto(f"{lab}/lab/tree/{NOTEBOOK}?token={TOKEN}&reset")
    page.set_default_timeout(UNDER_A_BUSY_MACHINE)
    page.locator(".jp-Notebook .jp-CodeCell").first.wait_for()
    page.wait_for_function("window.jupyterapp?.shell.currentWidget?.sessionContext?.session?.kernel?.status == 'idle'")
    page.get_by_role("menuitem", name="Run", exact=True).click()
    page.get_by_role("menuitem", name="Run All Cells", exact=True).click()
    page.wait_for_function(_ENDED)
    yield page
    page.context.close()


# JupyterLab draws only the cells in view, but knows of all
_CELLS = "window.jupyterapp.shell.currentWidget.content.model.sharedModel.cells.filter(c => c.cell_type == 'code')"
_ENDED = f"""() => {{
    const failed = {_CELLS}.some(c => c.outputs.some(o => o.output_type == 'error'))
    return failed || {_CELLS}.every(c => c.execution_count)
}}"""


def _outputs(page):
    return page.evaluate(f"{_CELLS}.flatMap(c => c.outputs)")


def test_every_cell_of_a_notebook_runs(notebook):
    assert [output["evalue"] for output in _outputs(notebook) if output["output_type"] == "error"] == []
    assert sum("<figure>" in "".join(output.get("data", {}).get("text/html", "")) for output in _outputs(notebook)) >= 6


@pytest.mark.skipif(not importlib.util.find_spec("vsp.explorer"), reason="there is no vsp/explorer.py yet")
def test_the_slider_of_the_replay_changes_the_picture(notebook):
    from playwright.sync_api import expect

    output = notebook.locator(SLIDER).first
    while not output.count():  # cells out of view are drawn when one scrolls there
        notebook.mouse.move(700, 500)
        notebook.mouse.wheel(0, 600)
        notebook.wait_for_timeout(200)
    picture, handle = output.locator("img").first, output.get_by_role("slider").first
    before, at = picture.get_attribute("src"), float(handle.get_attribute("aria-valuenow"))
    handle.focus()
    for _ in range(3):
        notebook.keyboard.press("PageUp")
    expect(picture).not_to_have_attribute("src", before, timeout=60_000)
    assert float(handle.get_attribute("aria-valuenow")) > at
    assert picture.evaluate("image => image.decode().then(() => image.naturalWidth)") > 0
