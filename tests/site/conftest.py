"""The site in Chromium, served from this machine. `make test-site` says where the site is; without that all is skipped."""

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


class Visit:
    """A page of the site in a window of its own, with everything that went wrong in it."""

    def __init__(self, browser, address: str, name: str = "index.html", **context):
        self.address, self.troubles = address, []
        self.page = browser.new_context(**context).new_page()
        self.page.on("request", self._request)
        self.page.on("requestfailed", lambda request: self.troubles.append(f"failed: {request.url}"))
        self.page.on("response", self._response)
        self.page.on("console", self._console)
        self.page.on("pageerror", lambda error: self.troubles.append(f"script: {error}"))
        self.page.goto(address + name, wait_until="load")
        self.page.evaluate("document.querySelectorAll('img').forEach(image => { image.loading = 'eager' })")
        self.page.wait_for_function("[...document.images].every(image => image.complete)")

    def _request(self, request):
        if not request.url.startswith((self.address, "data:")):
            self.troubles.append(f"another host: {request.url}")

    def _response(self, response):
        if response.status >= 400:
            self.troubles.append(f"{response.status}: {response.url}")

    def _console(self, message):
        if message.type == "error":
            self.troubles.append(f"console: {message.text}")

    def close(self):
        self.page.context.close()
