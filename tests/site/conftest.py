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
ON_A_MAC = "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome"

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

    found = [shutil.which(name) for name in (os.environ.get("CHROMIUM", ""), *CHROMIUM, ON_A_MAC)]
    path = next(filter(None, found), None)
    if path is None:
        pytest.exit(
            f"no browser found: tried {', '.join(CHROMIUM)}; install one (Debian: apt install chromium; macOS: "
            "brew install --cask google-chrome) or say where it is: make test-site CHROMIUM=/path/to/chromium",
            returncode=1,
        )
    arguments = ["--no-sandbox"] if sys.platform == "linux" and os.geteuid() == 0 else []  # root has no sandbox there
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=arguments)
        yield browser
        browser.close()
