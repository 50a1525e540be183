"""The explorer in Chromium: it computes what Python computes, answers to every control, and is quick."""

import base64
import importlib
import json
import re

import numpy as np
import pytest
from visits import Visit

import vsp
from studies import comparison
from vsp.show.explorer import SCRIPT

SIMPLEGOAL, MOUNTAINCAR, PENDULUM = TASKS = ("SimpleGoal-v0", "MountainCarContinuous-v0", "Pendulum-v1")
SOURCE = json.dumps(SCRIPT.read_text("utf-8"))
LOADED = f"const vsp = await import(URL.createObjectURL(new Blob([{SOURCE}], {{type: 'text/javascript'}})))"
PARITY = f"""async ([scene, which, encoded]) => {{
  {LOADED}
  const bytes = Uint8Array.from(atob(encoded), sign => sign.charCodeAt(0)), numbers = new Float64Array(bytes.buffer)
  const {{see, step}} = vsp.dynamics(scene.task.name), policy = vsp.ready(scene.policies[which])
  const counts = {{steps: 0, ties: 0, cells: 0, off: 0}}
  for (let i = 0; i < numbers.length; i += 7) {{
    const [x, y, cell, to_x, to_y, reward, outcome] = numbers.subarray(i, i + 7), seen = see([x, y])
    counts.steps += 1
    if (vsp.margin(policy, seen) < 1e-9) {{ counts.ties += 1; continue }}
    const acted = vsp.act(scene, policy, seen), [to, paid, end] = step([x, y], acted.action)
    const off = [to[0] - to_x, to[1] - to_y, paid - reward].some(gap => Math.abs(gap) > 1e-9)
    counts.cells += acted.cell !== cell
    counts.off += off || end !== outcome
  }}
  return counts
}}"""
TEACHER = f"async ([scene, points]) => {{ {LOADED}; return points.map(point => vsp.teacherAt(scene, point)) }}"


TIES = f"""async ([{{policies: [policy]}}, points]) => {{
  {LOADED}; return [...new Set(points.map(point => vsp.cellOf(vsp.ready(policy), point, 1e-9)))] }}"""
AGREES = r"""root => new Promise(resolve => { let frames = 0, look = () => {
  const counts = [/(\d+) cells?\b/, /Cell \d+ of (\d+)/].map(words => root.innerText.match(words)[1])
  counts[0] !== counts[1] || ++frames == 30 ? resolve(counts) : requestAnimationFrame(look) }; look() })"""
BORDER = f"""async ([scene, which, asked]) => {{
  {LOADED}
  const root = document.body.appendChild(document.createElement("div")), view = vsp.mount(root, scene)
  view.choose(which)
  view.asked = asked
  view.redo()
  const text = root.innerText
  root.remove()
  return text
}}"""


@pytest.fixture(scope="module")
def directive():
    return importlib.import_module("explorer")  # it needs Sphinx


@pytest.fixture(scope="module")
def explorers(directive):
    """The explorers of the site: each task's policies, and for the paper's tasks a replay."""
    return {task: directive.of_task(task) for task in TASKS}


@pytest.fixture(scope="module")
def opened(explorers, browser, tmp_path_factory):
    """An explorer's own file, opened from disk, for each size of window that is asked for."""
    folder, visits = tmp_path_factory.mktemp("explorers"), []

    def visit(task, **context):
        explorers[task].save(folder / f"{task}.html")
        visits.append(Visit(browser, folder.as_uri() + "/", f"{task}.html", **context))
        visits[-1].page.locator(".vsp-explorer canvas").wait_for()
        return visits[-1]

    yield visit
    for visit in visits:
        visit.close()


@pytest.fixture(scope="module")
def desk(opened):
    return {task: opened(task, viewport={"width": 1200, "height": 900}) for task in TASKS}


def recorded(policy, task, starts):
    """Every step of these episodes: state (2), cell, next state (2), reward and outcome. (t, 7)"""
    state, steps = starts, []
    for _ in range(task.max_steps):
        inputs = task.see(state)
        following, reward, outcome = task.step(state, policy.predict(inputs)[0])
        steps.append(np.column_stack([state, policy.cells(inputs), following, reward, outcome]))
        state = following[outcome == 0]
        if not len(state):
            break
    return np.concatenate(steps)


@pytest.mark.parametrize("task", TASKS)
def test_each_step_is_pythons(desk, explorers, task):
    explorer, starts = explorers[task], vsp.start_states(task, 1000, 3)
    for i, policy in enumerate(explorer.policies.values()):
        steps, totals = recorded(policy, explorer.task, starts), {"steps": 0, "ties": 0, "cells": 0, "off": 0}
        for part in np.array_split(steps, 1 + len(steps) // 100_000):
            counts = desk[task].page.evaluate(PARITY, [explorer.scene, i, base64.b64encode(part.tobytes()).decode()])
            totals = {name: totals[name] + counts[name] for name in totals}
        assert totals.pop("steps") == len(steps) > 5000 and totals.pop("ties") < 10
        assert totals == {"cells": 0, "off": 0}


class Shown:
    """What a reader sees of an explorer."""

    def __init__(self, visit):
        self.page, self.root = visit.page, visit.page.locator(".vsp-explorer")
        self.canvas = self.root.locator("canvas")

    def picture(self):
        return self.canvas.evaluate("canvas => canvas.toDataURL()")

    def changes(self, act):
        """Whether picture and text change by this."""
        before, text = self.picture(), self.root.inner_text()
        act()
        self.page.wait_for_timeout(400)  # until the map is sharp
        return before != self.picture(), text != self.root.inner_text()

    def at(self, x, y):
        """Where a point of the unit square is on the page."""
        box, inner = self.canvas.bounding_box(), self.canvas.bounding_box()["width"] - 52
        return box["x"] + 44 + x * inner, box["y"] + 8 + (1 - y) * (box["height"] - 42)

    def drag(self, start, end):
        self.page.mouse.move(*self.at(*start))
        self.page.mouse.down()
        self.page.mouse.move(*self.at(*end), steps=5)
        self.page.mouse.up()

    def results(self):
        self.page.wait_for_timeout(500)
        return re.search("Mean return from 400 starts.*", self.root.inner_text())[0]


@pytest.fixture
def shown(desk):
    explorer = Shown(desk[SIMPLEGOAL])
    explorer.root.get_by_label("policy", exact=True).select_option("0")
    explorer.page.wait_for_timeout(400)
    return explorer


def test_a_click_a_drag_and_keys_choose_a_state(shown):
    assert shown.changes(lambda: shown.page.mouse.click(*shown.at(0.3, 0.6))) == (True, True)
    assert "x = 0.30" in shown.root.inner_text()
    assert shown.changes(lambda: shown.drag((0.3, 0.6), (0.8, 0.55))) == (True, True)
    assert "x = 0.80" in shown.root.inner_text()
    shown.canvas.focus()
    assert shown.changes(lambda: shown.page.keyboard.press("ArrowLeft")) == (True, True)
    assert shown.changes(lambda: shown.page.keyboard.press("Shift+ArrowDown")) == (True, True)
    assert shown.changes(lambda: shown.page.keyboard.press("Alt+ArrowUp")) == (False, False)  # the browser's
    assert shown.changes(lambda: shown.page.mouse.click(*shown.at(0.8, 0.2), button="right")) == (False, False)


def test_the_replay_goes_to_changes_plays_and_stops(shown):
    slider = shown.root.get_by_label("iteration")
    assert shown.changes(lambda: slider.press("Home")) == (True, True)
    assert "iteration 0: 1 cell" in shown.root.inner_text()
    assert shown.changes(lambda: shown.root.get_by_role("button", name="next change").click()) == (True, True)
    assert "split" in shown.root.inner_text()
    slider.press("End")
    shown.root.get_by_role("button", name="play").click()  # from the beginning again
    assert len(set(shown.root.evaluate(AGREES))) == 1  # in every frame, label and panel tell the same number of cells
    shown.root.get_by_role("button", name="pause").click()
    assert 0 < int(slider.input_value()) < int(slider.get_attribute("max"))
    shown.page.wait_for_timeout(400)
    assert not any(shown.changes(lambda: None))


def test_a_codeword_is_dragged_and_a_coefficient_turned(shown, explorers):
    x, y = explorers[SIMPLEGOAL].scene["policies"][0]["codewords"][0]
    assert shown.changes(lambda: shown.drag((x, y), (0.5 * x + 0.25, 0.5 * y + 0.25))) == (True, True)
    assert "Cell 1 of" in shown.root.inner_text()
    before = shown.results()
    assert shown.changes(lambda: shown.root.get_by_label("Δx: bias").fill("9")) == (True, True)
    assert shown.results() != before
    assert shown.changes(lambda: shown.root.get_by_role("button", name="reset").click()) == (True, True)


def test_a_number_can_be_written_while_the_state_changes_its_cell(opened):
    """The first digits move the codeword away from the state; the field stays until the reader leaves it."""
    root = Shown(opened(SIMPLEGOAL, viewport={"width": 1200, "height": 900})).root
    field = root.get_by_label("codeword: x")
    cell = re.search(r"Cell \d+", root.inner_text())[0]
    field.fill("")
    field.press_sequentially("-5.25")
    root.page.wait_for_timeout(300)
    assert field.input_value() == "-5.25" and not root.inner_text().count(f"{cell} of")
    field.press("Tab")
    root.get_by_label("policy", exact=True).focus()
    root.page.wait_for_timeout(300)
    assert root.locator("legend").inner_text().endswith(re.search(r"Cell (\d+) of", root.inner_text())[1])


@pytest.mark.parametrize("task", TASKS)
def test_the_teachers_action_is_as_near_as_is_said(desk, explorers, task):
    scene = explorers[task].scene
    points = np.random.default_rng(7).uniform(scene["plane"]["low"], scene["plane"]["high"], (5000, 2))
    actions = np.array(desk[task].page.evaluate(TEACHER, [scene, points.tolist()]))
    gap = np.abs(actions - vsp.load_teacher(task).predict(vsp.get_task(task).see(points))[0]).max(axis=1)
    assert np.mean(gap <= scene["teacher"]["usual"]) == pytest.approx(0.9, abs=0.015)


def test_on_pendulum_the_smallest_change_may_pass_the_edge(desk, explorers):
    """As Python finds it: the angle goes on beyond the edge of the picture."""
    task, explorer, range_ = vsp.get_task(PENDULUM), explorers[PENDULUM], np.array([2 * np.pi, 16.0])
    which = next(i for i, name in enumerate(explorer.policies) if "faithful" in name)
    policy = list(explorer.policies.values())[which]
    moves = np.linspace(-1, 1, 20001)[:, None]
    for point in np.array([[2.99, 7.53], *np.random.default_rng(0).uniform([-3.1, -7.9], [3.1, 7.9], (10, 2))]):
        least = []
        for axis in (0, 1):
            moved = point + moves * range_ * np.eye(2)[axis]
            leaves = policy.cells(task.see(moved)) != policy.cells(task.see(point[None]))
            least.append(np.abs(moves[leaves & (np.abs(moved[:, 1]) <= 8)]).min(initial=np.inf))
        axis = int(np.argmin(least))
        text = desk[PENDULUM].page.evaluate(BORDER, [explorer.scene, which, point.tolist()]).replace("−", "-")
        gap, name = re.search(r"A change of (-?[\d.]+) in (angular|angle)", text).groups()
        assert name == ("angle", "angular")[axis]
        assert abs(float(gap)) == pytest.approx(range_[axis] * least[axis], abs=5e-3)


def test_a_border_is_told_in_words_and_ties_are_one_cell_of_the_map(desk):
    policy = vsp.VoronoiPolicy([[0.1, 0.2], [0.2, 0.1]], [[[0, 0]] * 3] * 2, task=SIMPLEGOAL)
    page, scene = desk[SIMPLEGOAL].page, vsp.explore(policy).scene
    points = np.random.default_rng(0).uniform(0.3, 1, (1000, 2)).tolist()  # all as far from one as from the other
    assert "The state is on the border to cell 2." in page.evaluate(BORDER, [scene, 0, [0.15, 0.15]])
    assert page.evaluate(TIES, [scene, points]) == [0]


def test_with_little_motion_asked_for_the_player_goes_slowly(opened):
    visit = opened(SIMPLEGOAL, viewport={"width": 1200, "height": 900}, reduced_motion="reduce")
    root = visit.page.locator(".vsp-explorer")
    root.get_by_label("iteration").press("Home")
    root.get_by_role("button", name="play").click()
    visit.page.wait_for_timeout(700)
    assert int(root.get_by_label("iteration").input_value()) <= 2


def test_nothing_fails(desk):
    assert [visit.troubles for visit in desk.values()] == [[]] * len(TASKS)


# Stored episodes

LUNARLANDER, WALKER = "LunarLanderContinuous-v3", "BipedalWalker-v3"
STORED = f"""async scene => {{
  {LOADED}
  return scene.policies.map(vsp.ready).map(policy => policy.episodes.map(({{states}}) => states.map(state => {{
    const {{cell, action}} = vsp.act(scene, policy, state)
    return [cell, ...action, vsp.margin(policy, state)]
  }})))
}}"""


@pytest.fixture(scope="module")
def lander(browser, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lander")
    policy = vsp.VoronoiPolicy.load(comparison.RESULTS / f"faithful_{LUNARLANDER}.policy")
    explorer = vsp.explore({"faithful": policy}, teacher=vsp.load_teacher(LUNARLANDER), axes=("x", "y"))
    explorer.save(folder / "lander.html")
    visit = Visit(browser, folder.as_uri() + "/", "lander.html", viewport={"width": 1200, "height": 900})
    visit.page.locator(".vsp-explorer canvas").wait_for()
    yield Shown(visit), explorer
    visit.close()


def test_in_stored_states_cell_and_action_are_pythons(lander):
    shown, explorer = lander
    policy = explorer.policies["faithful"]
    (episodes,) = shown.page.evaluate(STORED, explorer.scene)
    for episode, acted in zip(explorer.scene["policies"][0]["episodes"], map(np.array, episodes), strict=True):
        states, sure = np.array(episode["states"]), acted[:, -1] > 1e-9
        assert np.array_equal(policy.cells(states)[sure], acted[sure, 0]) and sure.mean() > 0.99
        assert np.allclose(policy.predict(states)[0][sure], acted[sure, 1:-1], atol=1e-9)


def test_a_click_and_the_slider_choose_stored_states_and_nothing_can_be_changed(lander):
    shown, _ = lander
    box = shown.canvas.bounding_box()
    assert "Nothing can be changed here: the browser cannot play this task" in shown.root.inner_text()
    assert shown.root.locator("fieldset").count() == 0 and not shown.root.get_by_label("iteration").is_visible()
    assert shown.changes(lambda: shown.page.mouse.click(box["x"] + 200, box["y"] + 300)) == (True, True)
    assert shown.changes(lambda: shown.root.get_by_label("step", exact=True).fill("5")) == (True, True)
    assert "step 6 of" in shown.root.inner_text()
    shown.root.get_by_role("button", name="play").click()
    shown.page.wait_for_timeout(400)
    shown.root.get_by_role("button", name="pause").click()
    assert "step 6 of" not in shown.root.inner_text()


def test_twenty_four_inputs_fit_on_a_phone(browser, tmp_path):
    policy = vsp.VoronoiPolicy.load(comparison.RESULTS / f"robots_{WALKER}.policy")
    vsp.explore(policy).save(tmp_path / "walker.html")
    visit = Visit(browser, tmp_path.as_uri() + "/", "walker.html", viewport={"width": 390, "height": 844})
    visit.page.locator(".vsp-explorer canvas").wait_for()
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= 390
    assert visit.page.locator(".vsp-explorer details summary").inner_text() == "equations"
    visit.close()


# The reader guesses first


def test_results_are_hidden_until_the_reader_has_guessed(directive, browser, tmp_path):
    directive.challenge(SIMPLEGOAL, "How many are lost?").save(tmp_path / "guess.html")
    visit = Visit(browser, tmp_path.as_uri() + "/", "guess.html", viewport={"width": 1200, "height": 900})
    root = visit.page.locator(".vsp-explorer")
    root.locator("canvas").wait_for()
    visit.page.wait_for_timeout(400)
    assert "How many are lost?" in root.inner_text() and "Mean return" not in root.inner_text()
    root.get_by_label("your guess").fill("7")
    root.get_by_role("button", name="guess", exact=True).click()
    visit.page.wait_for_timeout(400)
    text = root.inner_text()
    assert "Mean return from 400 starts" in text and re.search(r"Your guess: 7\. .*: \d+ of 400 fail\.", text)
    assert "fail" not in "".join(root.locator("b").all_inner_texts())  # it is about this policy, whichever is chosen
    visit.close()
