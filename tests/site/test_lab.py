"""JupyterLab as `make lab` starts it: an untouched notebook stays clean, notebook 02 runs, and its controls answer."""

import json
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request

import pytest

from vsp.run import ROOT

NOTEBOOK = "02_distillation.ipynb"
GONE = "Error displaying widget"  # what JupyterLab says of a widget without a kernel
UNDER_A_BUSY_MACHINE = 300_000  # ms
FIRST = "01_teacher.ipynb"
ADDRESS = re.compile(r"(http://localhost\S+)/lab\?(token=\S+)")


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """The folder in which the command runs: a copy of the notebooks, nobody's settings, and what it says."""
    home = tmp_path_factory.mktemp("lab")
    shutil.copytree(ROOT / "notebooks", home / "notebooks")
    names = ("HOME", "JUPYTER_DATA_DIR", "IPYTHONDIR")
    environment = os.environ | {name: str(home / name.lower()) for name in names}
    environment["JUPYTER_RUNTIME_DIR"] = tempfile.mkdtemp()  # a short path: those of sockets have 107 characters
    environment["JUPYTER_CONFIG_PATH"] = str(ROOT / ".jupyter")
    options = ["--no-browser", "--allow-root", "--LabApp.expose_app_in_browser=True"]
    command = [sys.executable, "-m", "jupyterlab", f"notebooks/{FIRST}", *options]
    with open(home / "said.txt", "w") as said:
        server = subprocess.Popen(command, cwd=home, env=environment, stdout=said, stderr=said, start_new_session=True)
    yield home
    os.killpg(server.pid, signal.SIGTERM)
    server.wait(30)


@pytest.fixture(scope="module")
def lab(home):
    """The address of the server, and `token=...`, once it answers."""
    for _ in range(240):
        if match := ADDRESS.search((home / "said.txt").read_text()):
            try:
                urllib.request.urlopen(f"{match[1]}/api?{match[2]}", timeout=5)
                return match.groups()
            except OSError:
                pass
        time.sleep(0.5)
    raise TimeoutError((home / "said.txt").read_text())


def _go(page, lab, notebook):
    page.goto(f"{lab[0]}/lab/tree/{notebook}?{lab[1]}&reset")
    page.locator(".jp-Notebook .jp-CodeCell").first.wait_for()


def _opened(lab, browser, notebook):
    page = browser.new_context(viewport={"width": 1400, "height": 1000}).new_page()
    page.set_default_timeout(UNDER_A_BUSY_MACHINE)
    _go(page, lab, notebook)
    page.wait_for_function("window.jupyterapp?.shell.currentWidget?.sessionContext?.session?.kernel?.status == 'idle'")
    return page


def test_the_first_notebook_opens_clean_and_saving_changes_no_byte(home, lab, browser):
    page = _opened(lab, browser, FIRST)
    path = home / "notebooks" / "01_teacher.ipynb"
    before = path.read_bytes()
    assert page.title().startswith("01_teacher")
    menus = page.locator(".lm-MenuBar-itemLabel").all_inner_texts()
    assert "File" in menus and not any("nbgrader" in menu.lower() for menu in menus)
    assert page.get_by_role("button", name="Validate").count() == 0  # nbgrader's
    assert not any(name.endswith(".toml") for name in page.locator(".jp-DirListing-itemText").all_inner_texts())
    assert page.get_by_text("Jupyter news").count() == 0
    if json.loads(before)["metadata"]["language_info"]["version"] == platform.python_version():
        page.wait_for_timeout(3000)  # until the kernel has said what it is
        assert page.locator(".jp-mod-dirty").count() == 0
        page.keyboard.press("Control+s")
        page.wait_for_timeout(3000)
        assert path.read_bytes() == before


@pytest.fixture(scope="module")
def notebook(lab, browser):
    """Notebook 02 after "Run All Cells" came to its end."""
    page = _opened(lab, browser, NOTEBOOK)
    page.get_by_role("menuitem", name="Run", exact=True).click()
    page.get_by_role("menuitem", name="Run All Cells", exact=True).click()
    page.wait_for_function(_ENDED)
    yield page
    page.context.close()


# JupyterLab draws the cells of a page one by one, as it finds time, but knows of all
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


def _reads(place, text):
    place.filter(has_text=text).wait_for(timeout=60_000)


@pytest.fixture(scope="module")
def explorer(notebook):
    """That of SimpleGoal, the first."""
    return notebook.locator(".vsp-explorer.vsp-controls").first


@pytest.fixture(scope="module")
def laboratory(notebook, explorer):  # further down
    return notebook.locator(".vsp-controls:has(.widget-label:text-is('min_pol_distance'))").first


def _drawn(explorer):
    explorer.page.wait_for_timeout(500)
    return explorer.locator(".vsp-stage > canvas").evaluate("canvas => canvas.toDataURL()")


def test_the_explorer_replays_and_answers(explorer):
    explorer.scroll_into_view_if_needed()
    pictures = [_drawn(explorer)]
    for act in (
        lambda: explorer.get_by_label("iteration").press("Home"),
        lambda: explorer.locator(".vsp-stage > canvas").click(position={"x": 100, "y": 100}),
        lambda: explorer.get_by_label("Δx: bias").fill("2"),
    ):
        act()
        pictures.append(_drawn(explorer))
    assert len(set(pictures)) == len(pictures)
    assert "of 400 fail, mean return" in explorer.inner_text()


def test_controls_fit_into_the_notebook(notebook, explorer, laboratory):
    room = notebook.locator(".jp-WindowedPanel-outer").first.bounding_box()
    for place in (explorer, laboratory):
        place.scroll_into_view_if_needed()
        whole = place.bounding_box()
        assert whole["x"] + whole["width"] <= room["x"] + room["width"]


def test_a_setting_of_the_laboratory_makes_a_trial_that_the_explorer_draws(laboratory):
    before = _drawn(laboratory)
    laboratory.get_by_label("sub-policy").select_option("constant")
    laboratory.get_by_role("button", name="distil").click()
    for text in ("distilling …", "→ 2", "Change a setting"):
        _reads(laboratory, text)
    after = _drawn(laboratory)
    assert after != before and "trial 2" in laboratory.locator(".vsp-explorer select option").first.inner_text()
    laboratory.get_by_role("button", name="back to trial 1").click()
    _reads(laboratory, "→ 1")
    assert _drawn(laboratory) != after


def test_the_strip_stands_in_for_the_controls_once_the_kernel_is_gone(lab, notebook, laboratory):
    """While they live it is hidden; in a notebook that is opened again they are, and JupyterLab's word on them."""
    assert not any(strip.is_visible() for strip in notebook.locator(".vsp-strip").all())
    notebook.evaluate("window.jupyterapp.commands.execute('docmanager:save')")
    address, token = lab
    for session in json.load(urllib.request.urlopen(f"{address}/api/sessions?{token}")):
        end = urllib.request.Request(f"{address}/api/sessions/{session['id']}?{token}", method="DELETE")
        urllib.request.urlopen(end)
    _go(notebook, lab, NOTEBOOK)
    for i in range(3):  # two explorers and the laboratory
        notebook.locator(".vsp-strip").nth(i).locator("img").wait_for()
    notebook.get_by_text(GONE).nth(1).wait_for(state="attached")
    assert not any(word.is_visible() for word in notebook.get_by_text(GONE).all())
