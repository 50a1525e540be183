"""Record the explorer's moving picture for the README: replay a run, ask a policy about states, move a codeword.

    make venv-site-test && .venv/bin/python docs/record_explorer.py

It needs a browser, as `make test-site` does, so `make` does not run it: run it after the explorer has changed.
"""

import io
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

import vsp

TASK = "SimpleGoal-v0"
PICTURE = Path(__file__).with_name("explorer.gif")
WIDTH, HEIGHT = 800, 640  # pixels of the window
STEP, HOLD = 350, 2500  # milliseconds per frame, and for the last one
MOMENTS = np.linspace(0, 1, 8) ** 1.5  # of the replay, as shares of its slider: closer at the beginning
STATES = np.linspace((0.35, 0.9), (0.75, 0.7), 5)  # beyond the pit, where the teacher turns


def main() -> None:
    """Write docs/explorer.gif."""
    teacher = vsp.load_teacher(TASK)
    policy, history = vsp.distill(teacher, TASK, seed=0)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder) / "run.html"
        vsp.explore({"this run": policy}, teacher=teacher, history=history).save(path)
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.goto(path.as_uri())
        page.locator("canvas").wait_for()
        images = [Image.open(io.BytesIO(shot)).convert("RGB").quantize() for shot in shots(page, policy)]
        browser.close()
    durations = [STEP] * (len(images) - 1) + [HOLD]
    images[0].save(PICTURE, save_all=True, append_images=images[1:], duration=durations, loop=0)


def shots(page: Page, policy: vsp.VoronoiPolicy) -> Iterator[bytes]:
    """Screenshots as PNG: of the replay, of several states, and while a codeword is dragged."""
    slider = page.get_by_label("iteration")
    for moment in MOMENTS * int(slider.get_attribute("max")):
        slider.fill(str(round(moment)))
        yield still(page)
    for state in STATES:
        page.mouse.click(*place(page, state))
        yield still(page)
    codeword = policy.codewords[np.square(policy.codewords - (0.6, 0.75)).sum(axis=1).argmin()]
    page.mouse.move(*place(page, codeword))
    page.mouse.down()
    for there in np.linspace(codeword, (0.35, 0.35), 6):
        page.mouse.move(*place(page, there))
        yield still(page)
    page.mouse.up()
    yield still(page)


def still(page: Page) -> bytes:
    """A screenshot of the explorer as far down as its map, after the drawing has come to rest."""
    page.wait_for_timeout(400)
    box = page.locator("canvas").bounding_box()
    return page.screenshot(clip={"x": 0, "y": box["y"] - 8, "width": WIDTH, "height": box["height"] + 16})


def place(page: Page, state: np.ndarray) -> tuple[float, float]:
    """The pixel of a state (2,)."""
    box = page.locator("canvas").bounding_box()
    inner = box["width"] - 52, box["height"] - 42  # without the axes
    return box["x"] + 44 + state[0] * inner[0], box["y"] + 8 + (1 - state[1]) * inner[1]


if __name__ == "__main__":
    main()
