"""`make lab`: opens the first notebook, shows no grader's buttons, changes nothing and says little."""

import json
import os
import platform
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from vsp.run.lab import FIRST

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    """The command, with nobody's settings, and the file that it writes its lines to."""
    home = tmp_path_factory.mktemp("home")
    own = {name: str(home / name.lower()) for name in ("HOME", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR")}
    with open(home / "said.txt", "w") as said:
        server = subprocess.Popen(
            [sys.executable, "-m", "vsp.run.lab", "--no-browser"], cwd=ROOT, env=os.environ | own, stdout=said,
            stderr=said, start_new_session=True,
        )  # fmt: skip
    yield home / "said.txt"
    os.killpg(server.pid, signal.SIGTERM)
    server.wait(30)


@pytest.fixture(scope="module")
def page(started, browser):
    for _ in range(240):
        if found := re.search(r"http://\S+", started.read_text()):
            break
        time.sleep(0.5)
    page = browser.new_context(viewport={"width": 1400, "height": 900}).new_page()
    page.set_default_timeout(120_000)
    for _ in range(60):
        try:
            page.goto(found[0])
            break
        except Exception:
            time.sleep(1)  # the server prints its address before it answers
    page.locator(".jp-Notebook .jp-Cell").first.wait_for()
    page.locator(".jp-NotebookPanel-toolbar").first.wait_for()
    page.wait_for_timeout(8000)  # until the kernel has said what it is
    yield page
    page.context.close()


def test_it_opens_the_first_notebook(page):
    assert FIRST.name[:10] in page.title()


def test_no_graders_buttons_are_there(page):
    menus = page.locator(".lm-MenuBar-itemLabel").all_inner_texts()
    assert "File" in menus and not any("nbgrader" in menu.lower() for menu in menus)
    assert page.get_by_role("button", name="Validate").count() == 0


@pytest.mark.skipif(
    json.loads(FIRST.read_text("utf-8"))["metadata"]["language_info"]["version"] != platform.python_version(),
    reason="notebooks name another version of Python, which JupyterLab replaces",
)
def test_an_untouched_notebook_is_clean_and_saving_changes_no_byte(page):
    before = FIRST.read_bytes()
    assert page.locator(".jp-mod-dirty").count() == 0
    page.keyboard.press("Control+s")
    page.wait_for_timeout(3000)
    assert FIRST.read_bytes() == before


def test_it_says_at_most_three_lines(page, started):
    lines = started.read_text().splitlines()
    assert 1 <= len(lines) <= 3 and "Control-C" in lines[1]
