"""JupyterLab with a kernel: notebook 02 runs from top to bottom, its controls answer, and it can be opened again."""

import json
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
GONE = "Error displaying widget"  # what JupyterLab says of a widget without a kernel
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


def _below(page, place):
    """The first such place, which is drawn when one scrolls there."""
    for _ in range(200):
        if page.locator(place).count():
            page.locator(place).first.scroll_into_view_if_needed()
            return page.locator(place).first
        page.mouse.move(900, 500)
        page.mouse.wheel(0, 400)
        page.wait_for_timeout(100)
    raise AssertionError(f"nothing here is {place}")


def _expect(place):
    from playwright.sync_api import expect

    return expect(place)


@pytest.fixture(scope="module")
def explorer(notebook):
    """That of SimpleGoal, the first."""
    _below(notebook, ".vsp-explorer.vsp-controls canvas")
    return notebook.locator(".vsp-explorer.vsp-controls").first


@pytest.fixture(scope="module")
def laboratory(notebook, explorer):  # further down
    return _below(notebook, ".vsp-controls:has(.widget-label:text-is('min_pol_distance'))")


def _drawn(explorer):
    explorer.page.wait_for_timeout(500)
    return explorer.locator("canvas").evaluate("canvas => canvas.toDataURL()")


def test_the_explorer_replays_and_answers(explorer):
    explorer.scroll_into_view_if_needed()
    pictures = [_drawn(explorer)]
    for act in (
        lambda: explorer.get_by_label("iteration").press("Home"),
        lambda: explorer.get_by_label("iteration").press("ArrowRight"),
        lambda: explorer.get_by_role("button", name="next change").click(),
        lambda: explorer.locator("canvas").click(position={"x": 100, "y": 100}),
        lambda: explorer.locator("canvas").press("ArrowRight"),
        lambda: explorer.get_by_label("Δx: bias").fill("2"),
    ):
        act()
        pictures.append(_drawn(explorer))
    assert len(set(pictures)) == len(pictures)
    assert "Mean return from 400 starts" in explorer.inner_text()


def test_the_explorer_is_in_view_as_a_whole(explorer):
    whole = explorer.bounding_box()
    room = explorer.page.locator(".jp-WindowedPanel-outer").first.bounding_box()
    assert whole["height"] < room["height"] and whole["x"] + whole["width"] <= room["x"] + room["width"]


def test_controls_and_words_are_as_wide_as_the_notebook(notebook, laboratory):
    for width in (1400, 1024):
        notebook.set_viewport_size({"width": width, "height": 1000})
        notebook.wait_for_timeout(500)
        whole, room = (
            place.bounding_box() for place in (laboratory, notebook.locator(".jp-WindowedPanel-outer").first)
        )
        assert whole["x"] + whole["width"] <= room["x"] + room["width"]
        assert laboratory.locator("canvas").bounding_box()["width"] <= whole["width"]
    notebook.set_viewport_size({"width": 1400, "height": 1000})


def test_a_setting_of_the_laboratory_makes_a_trial_that_the_explorer_draws(laboratory):
    before = _drawn(laboratory)
    laboratory.get_by_label("sub-policy").select_option("constant")
    _expect(laboratory).to_contain_text("distilling …", timeout=60_000)
    _expect(laboratory).to_contain_text("→ 2", timeout=60_000)
    _expect(laboratory).to_contain_text("Change a setting", timeout=60_000)
    after = _drawn(laboratory)
    assert after != before and "trial 2" in laboratory.locator(".vsp-explorer select option").first.inner_text()
    laboratory.get_by_role("button", name="back to trial 1").click()
    _expect(laboratory).to_contain_text("→ 1", timeout=60_000)
    assert _drawn(laboratory) not in (after,)


def test_the_strip_stands_in_for_the_controls_once_the_kernel_is_gone(lab, notebook, laboratory):
    """While they live it is hidden; in a notebook that is opened again they are, and JupyterLab's word on them."""
    assert not any(strip.is_visible() for strip in notebook.locator(".vsp-strip").all())
    notebook.evaluate("window.jupyterapp.commands.execute('docmanager:save')")
    sessions = f"{lab}/api/sessions"
    for session in json.load(urllib.request.urlopen(f"{sessions}?token={TOKEN}")):
        end = urllib.request.Request(f"{sessions}/{session['id']}?token={TOKEN}", method="DELETE")
        urllib.request.urlopen(end)
    notebook.goto(f"{lab}/lab/tree/{NOTEBOOK}?token={TOKEN}&reset")
    for i in range(3):  # two explorers and the laboratory
        place = _below(notebook, f".vsp-strip >> nth={i}")
        _expect(place.locator("img")).to_have_count(1)
        _expect(place.locator("img").first).to_be_visible()
    notebook.get_by_text(GONE).nth(1).wait_for(state="attached")
    assert not any(word.is_visible() for word in notebook.get_by_text(GONE).all())
