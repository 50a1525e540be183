"""The explorer's modules in Node, each by itself: they compute what Python computes, and stay short."""

import base64
import importlib
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import playwright
import pytest

import vsp
from vsp.paper.printed import published_policy
from vsp.rollouts import rollout
from vsp.show import state_space
from vsp.show.explorer import MODULES, scene_of

HERE, ROOT = Path(__file__).resolve().parent, Path(__file__).resolve().parents[2]
NODE = Path(playwright.__file__).parent / "driver" / "node"
SCRIPTS = [*MODULES, *sorted((ROOT / "docs/article").glob("*.js"))]  # not the site's own script
SIMPLEGOAL, TASKS = "SimpleGoal-v0", ("SimpleGoal-v0", "MountainCarContinuous-v0", "Pendulum-v1")
RANDOM = np.random.default_rng(0)


def node(*arguments, given=None):
    """What a script prints as JSON; `given` is its input."""
    command = [NODE, *arguments]
    done = subprocess.run(command, input=json.dumps(given), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def run(code, given, *modules):
    """What `code` returns after these modules are imported; it has `given`."""
    imports = "".join(f"import * as {path.stem} from {json.dumps(path.as_uri())}; " for path in modules)
    read = "import { readFileSync } from 'fs'; const given = JSON.parse(readFileSync(0, 'utf8')); "
    script = f"{imports}{read}console.log(JSON.stringify((() => {{ {code} }})()))"
    return node("--input-type=module", "-e", script, given=given)


def model(code, **given):
    return run(f"const {{ {', '.join(given)} }} = given; {code}", given, MODULES[0])


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_a_module_needs_no_page_to_be_imported_and_only_those_before_it(path):
    assert run(f"return Object.keys({path.stem})", {}, path)
    names = [before.name for before in MODULES[: MODULES.index(path)]]
    assert set(re.findall(r'^import .*"\./(.*)"', path.read_text("utf-8"), re.MULTILINE)) <= set(names)


# What Python computes


@pytest.fixture(scope="module")
def explorers():
    """The explorers of the site: each task's policies."""
    return {task: importlib.import_module("explorer").of_task(task) for task in TASKS}


@pytest.mark.parametrize("task", TASKS)
def test_each_step_and_each_episode_is_pythons(explorers, task, tmp_path):
    """A step from each of many states, and episodes from the explorer's starts."""
    explorer, task = explorers[task], vsp.get_task(task)
    scene = {name: part for name, part in explorer.scene.items() if name != "teacher"}
    states = RANDOM.uniform(scene["plane"]["low"], scene["plane"]["high"], (20_000, 2))
    for i, policy in enumerate(explorer.policies.values()):
        stepped = task.step(states, policy.predict(task.see(states))[0])
        np.column_stack([states, policy.cells(task.see(states)), *stepped]).tofile(tmp_path / "steps")
        given = {"file": str(tmp_path / "steps"), "scene": scene}
        code = f"return steps.compare(given.file, given.scene, given.scene.policies[{i}])"
        found, result = run(code, given, HERE / "steps.mjs"), rollout(policy, task, np.array(scene["starts"]))
        assert found["steps"] == len(states) and found["ties"] < 10 and (found["cells"], found["off"]) == (0, 0)
        assert [end % 3 for end in result.outcomes] == found["outcomes"]  # 3: stopped
        # Python's observations are rounded to float32
        assert np.mean(found["totals"]) == pytest.approx(result.returns.mean(), abs=1e-3)


def test_least_squares_are_numpys():
    cases = [(RANDOM.normal(size=(n, d)), RANDOM.normal(size=(n, 2))) for n in (1, 2, 5, 400) for d in (1, 3, 4)]
    ones, line = np.ones((30, 1)), RANDOM.uniform(size=(30, 1))
    cases += [(np.hstack([line, 2 * line, ones]), line), (np.hstack([0 * line, ones, ones]), line), (0 * ones, line)]
    code, given = "return cases.map(([a, b]) => model.leastSquares(a, b))", [(a.tolist(), b.tolist()) for a, b in cases]
    for (a, b), found in zip(cases, model(code, cases=given), strict=True):
        assert np.allclose(found, np.linalg.lstsq(a, b)[0], rtol=0, atol=1e-9)


def test_the_network_is_the_teachers(article):
    values = states = RANDOM.uniform(size=(500, 2)).astype(np.float32).astype(float)  # as a network sees them
    layers = [[part.astype(float) for part in layer] for layer in vsp.load_teacher(SIMPLEGOAL).actor.layers]
    for i, (weights, biases) in enumerate(layers, 1):
        values = values @ weights + biases
        values = np.maximum(values, 0) if i < len(layers) else np.tanh(values)
    code = "const policy = model.network(network); return states.map(state => model.act(scene, policy, state).action)"
    given = {"network": article.network(), "states": states.tolist(), "scene": scene_of({}, vsp.get_task(SIMPLEGOAL))}
    assert np.allclose(model(code, **given), values, rtol=0, atol=1e-6)


@pytest.fixture(scope="module")
def article():
    """What Python computes for the article."""
    sys.path.append(str(ROOT / "docs/article"))
    return importlib.import_module("data")


def test_what_the_teacher_did_is_pythons_and_so_are_r2_and_refitted_maps(article):
    policy, episodes = published_policy(SIMPLEGOAL), article.learnt_from()
    code = """const [policy] = scene.policies
      return [model.rSquared(scene, model.ready(policy), visited), model.refit(policy, visited)]"""
    stored = (np.frombuffer(base64.b64decode(part), "<f4").reshape(-1, 2) for part in article.visited().values())
    states, actions = (part.astype(float) for part in stored)
    visited = {"states": states.tolist(), "actions": actions.tolist()}
    r2, maps = model(code, scene=scene_of({"": policy}, policy.task), visited=visited)
    assert np.array_equal(states, np.concatenate([episode.states for episode in episodes]))
    assert np.array_equal(actions, np.concatenate([episode.actions for episode in episodes]).astype("f4"))
    off = np.square(policy.predict(states)[0] - actions).sum()
    assert r2 == pytest.approx(1 - off / np.square(actions - actions.mean(axis=0)).sum(), abs=1e-9)
    inputs, cells = np.column_stack([states, np.ones(len(states))]), policy.cells(states)
    for cell, found in enumerate(maps):
        inside = cells == cell
        wanted = np.linalg.lstsq(inputs[inside], actions[inside])[0] if inside.any() else policy.coefficients[cell]
        assert np.allclose(found, wanted, rtol=0, atol=1e-9)


def test_no_two_neighbours_share_a_colour(explorers):
    side, metrics = 60, 200 * ("euclidean", "manhattan", "chebyshev")
    square = state_space.grid(np.zeros(2), np.ones(2), side)[2]
    pictures = [vsp.nearest(RANDOM.uniform(size=(2 + i // 4, 2)), square, metrics[i]) for i in range(200)]
    for explorer in explorers.values():
        low, high, _ = map(np.array, explorer.scene["plane"].values())
        inputs = explorer.task.see(state_space.grid(low, high, side)[2])
        pictures += [policy.cells(inputs) for policy in explorer.policies.values()]
    code = "return pictures.map(cells => model.colouring(cells, side, Math.max(...cells) + 1))"
    for cells, colours in zip(pictures, model(code, side=side, pictures=[cells.tolist() for cells in pictures])):
        cells, shown = cells.reshape(side, side), np.array(colours)[cells].reshape(side, side)
        for axis in (0, 1):
            assert (np.diff(shown, axis=axis)[np.diff(cells, axis=axis) != 0] != 0).all()


def test_colours_stay_where_they_can():
    code = "return [[0, 1, 2], [1, 1, 2]].map(wanted => model.colouring([0, 1, 1, 2], 2, 3, wanted))"
    kept, changed = model(code)
    assert kept == [0, 1, 2] and changed[0] != changed[1] and changed[1:] == [1, 2]


def test_what_is_said():
    code = """const told = { scene: { starts: [0, 1, 2], lost: [2] }, teacher: { mean: 2 } }
      const results = { played: 3, failures: 2, mean: -1.5 }, base = { failures: 1, mean: -1 }
      const split = { kind: "split", codeword: [0.5, -0.25], cause: 0.0123 }, merge = { ...split, kind: "merge" }
      return [controls.digits(-1e-5), controls.digits(-1.5),
        texts.resultOf({ ...told, results }), texts.resultOf({ ...told, results, base }),
        texts.resultOf({ scene: { ...told.scene, lost: [] }, results: { ...results, played: 1 } }),
        texts.causeOf(split), texts.causeOf(split, { split: 0.01 }), texts.causeOf(merge, { merge: 0.02 })]"""
    at = "at (0.50, −0.25): "
    assert run(code, {}, *MODULES[1::2]) == [
        "0.000", "−1.500",
        "2 of 3 starts fail. Mean return −1.50 (teacher: 2.00).",
        "1 → 2 of 3 starts fail. Mean return −1.00 → −1.50 (teacher: 2.00).",
        "Mean return about −1.50.",
        f"split {at}loss 0.0123", f"split {at}loss 0.0123, above 0.01", f"merge {at}maps differ by 0.0123, below 0.02",
    ]  # fmt: skip


# Limits


def test_all_scripts_are_short_with_short_lines():
    texts = [path.read_text("utf-8") for path in SCRIPTS]
    assert sum(text.count("\n") for text in texts) <= 1500
    assert sum(len(text.encode()) for text in texts) <= 60 * 1024
    assert [line for text in texts for line in text.splitlines() if len(line) > 100] == []


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_no_function_is_longer_than_forty_lines(path):
    """As V8 finds them: top-level functions and methods. Those inside of them are shorter."""
    text, found = path.read_text("utf-8"), node(HERE / "functions.mjs", path.as_uri())
    parts = [text[low:high] for low, high in found if (low, high) != (0, len(text))]
    assert parts and [part for part in parts if part.count("\n") >= 40] == []
