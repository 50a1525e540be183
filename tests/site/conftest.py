"""The site in Chromium, served from this machine. `make test-site` says where the site is; else all is skipped."""

import functools
import http.server
import os
import shutil
import sys
import threading
from pathlib import Path

import pytest

SITE = os.environ.get("SITE")
CHROMIUM = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

sys.path.append(str(Path(__file__).resolve().parents[2] / "docs" / "extensions"))


def pytest_collection_modifyitems(items):
    here = [item for item in items if Path(__file__).parent in item.path.parents]
    for item in here if not SITE else ():
        item.add_marker(pytest.mark.skip(reason="`make test-site` runs it, on a site that it makes"))


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *arguments):
        pass


@pytest.fixture(scope="session")
def address():
    """The address of the site, with a slash at its end."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Quiet, directory=SITE))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()


@pytest.fixture(scope="session")
def browser():
    from playwright.sync_api import sync_playwright

    path = next(filter(None, map(shutil.which, (os.environ.get("CHROMIUM", ""), *CHROMIUM))), None)
    if path is None:
        tried = ", ".join(CHROMIUM)
        pytest.exit(f"no browser found: tried {tried}; say where one is: make test-site CHROMIUM=/path", returncode=1)
    arguments = ["--no-sandbox"] if sys.platform == "linux" and os.geteuid() == 0 else []  # root has no sandbox there
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=arguments)
        yield browser
        browser.close()


@pytest.fixture(autouse=True)
def _windows_close(browser):
    """Those that a test has opened."""
    before = browser.contexts
    yield
    for window in {*browser.contexts} - {*before}:
        window.close()
