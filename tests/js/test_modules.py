"""The scripts in Node: they compute what Python computes, and modules.test.mjs holds by itself."""

import base64
import dataclasses
import functools
import importlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import vsp
from studies import comparison
from vsp.geometry import METRICS
from vsp.paper.printed import TASKS as PAPER
from vsp.paper.printed import published_policy
from vsp.rollouts import rollout
from vsp.run.atomic import ROOT
from vsp.show import state_space
from vsp.show.explorer import PLANES, scene_of
from vsp.show.explorer.scene import network_of

HERE, NODE = Path(__file__).resolve().parent, shutil.which("node")
SIMPLEGOAL, *_ = TASKS = [*PLANES]
RANDOM = np.random.default_rng(0)
pytestmark = pytest.mark.skipif(NODE is None, reason="it needs Node.js")


def node(*arguments, given=None):
    """What a script prints; `given` is its input."""
    command = [NODE, "--no-warnings", *arguments]
    done = subprocess.run(command, input=json.dumps(given), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def model(code, *modules, **given):
    """What `code` returns, with these names and after these modules are imported, too."""
    paths = {"model": ROOT / "vsp/show/explorer/model.js"} | {path.stem: path for path in modules}
    imports = "".join(f"import * as {name} from {json.dumps(path.as_uri())}; " for name, path in paths.items())
    read = (
        f"import {{ readFileSync }} from 'fs'; const {{ {', '.join(given)} }} = JSON.parse(readFileSync(0, 'utf8')); "
    )
    script = f"{imports}{read}console.log(JSON.stringify((() => {{ {code} }})()))"
    return json.loads(node("--input-type=module", "-e", script, given=given))


def test_the_scripts_by_themselves():
    said = node("--test", "--test-reporter=tap", HERE / "modules.test.mjs")
    if without := re.search("# SKIP (.*)", said):
        pytest.skip(f"{without[1]}; the others pass")


# What Python computes


@functools.cache
def policies(task):
    """The paper's policies and committed ones, and the first of them with each distance."""
    found = [published_policy(task)] if task in PAPER else []
    found += [vsp.VoronoiPolicy.load(path) for path in sorted(comparison.RESULTS.rglob(f"*{task}*.policy"))]
    words, maps, scale = found[0].codewords, found[0].coefficients, found[0].scale
    return found + [vsp.VoronoiPolicy(words, maps, task=task, metric=metric, scale=scale) for metric in METRICS]


@pytest.mark.parametrize("task", TASKS)
def test_each_step_and_each_episode_is_pythons(task, tmp_path):
    """A step from each of many states, and episodes from the explorer's starts."""
    several, task = policies(task), vsp.get_task(task)
    scene = scene_of(dict(enumerate(several)), task)
    states = RANDOM.uniform(scene["plane"]["low"], scene["plane"]["high"], (20_000, 2))
    for i, policy in enumerate(several):
        stepped = task.step(states, policy.predict(task.see(states))[0])
        np.column_stack([states, policy.cells(task.see(states)), *stepped]).tofile(tmp_path / "steps")
        code = f"return steps.compare(file, scene, scene.policies[{i}])"
        found = model(code, HERE / "steps.mjs", file=str(tmp_path / "steps"), scene=scene)
        result = rollout(policy, task, np.array(scene["starts"]))
        assert found["steps"] == len(states) and (found["cells"], found["off"]) == (0, 0)
        assert found["ties"] < (10 if policy.metric == "euclidean" else 1000)  # others are equal on whole areas
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


def test_the_network_is_the_teachers():
    values = states = RANDOM.uniform(size=(500, 2)).astype(np.float32).astype(float)  # as a network sees them
    layers = [[part.astype(float) for part in layer] for layer in vsp.load_teacher(SIMPLEGOAL).actor.layers]
    for i, (weights, biases) in enumerate(layers, 1):
        values = values @ weights + biases
        values = np.maximum(values, 0) if i < len(layers) else np.tanh(values)
    code = "const policy = model.network(network); return states.map(state => model.act(scene, policy, state).action)"
    given = {"network": network_of(vsp.load_teacher(SIMPLEGOAL)), "scene": scene_of({}, vsp.get_task(SIMPLEGOAL))}
    assert np.allclose(model(code, **given, states=states.tolist()), values, rtol=0, atol=1e-6)


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


SOON = {"n_split": 20, "n_merge": 30, "n_reset": 100}
READINGS = [
    {}, {"one_split": True, "scale": "box"}, {"freeze": "first_n_freeze"},
    {"freeze": "last_n_split", "initial": "zeros"},
    {"split_metric": "euclidean", "metric": "euclidean"}, {"periodic_reset": "off", "adam_on_reset": "restart"},
    {"split_loss": "clipped", "merge_parameters": "weights"}, {"inclusive": True, "metric": "chebyshev"},
    {"fit": "closed_form", "max_pol_loss": 0.02}, {"n_minibatches": 3, "batch_size": 16, "learning_rate": 0.01},
    {"n_split": 10, "n_merge": 30, "min_pol_distance": 0.02, "min_param_distance": 0.8},
]  # fmt: skip


class Recorder:
    """A generator that keeps what it draws, from 0 to 1."""

    def __init__(self, seed):
        self.rng, self.drawn = np.random.Generator(np.random.PCG64(seed)), []

    def __getattr__(self, name):
        return getattr(self.rng, name)

    def random(self, size):
        self.drawn.append(self.rng.random(size))
        return self.drawn[-1]

    def uniform(self, low, high, size):
        return low + (high - low) * self.random(size)


def recorded(task, config, monkeypatch):
    """A run: its history, numbers drawn for maps and for rows, and the teacher's episodes."""
    recorders, episodes = [], []
    monkeypatch.setattr(vsp.history, "SNAPSHOT_EVERY", 1)
    with monkeypatch.context() as patch:
        patch.setattr(np.random, "default_rng", lambda seed: recorders.append(Recorder(seed)) or recorders[-1])
        patch.setattr(vsp.algorithms, "steps", lambda each, *_, **__: (episodes.append(e) or e for e in each))
        _, history = vsp.algorithms.distill(vsp.load_teacher(task.name), task, config, seed=3)
    maps, rows = (np.concatenate([part.ravel() for part in r.drawn] or [[]]).tolist() for r in recorders[1:])
    given = [{what: getattr(e, what).astype(float).tolist() for what in ("states", "actions")} for e in episodes]
    return history, {"maps": maps, "rows": rows, "episodes": given}


@pytest.mark.parametrize("name", PAPER)
def test_a_run_in_the_browser_is_pythons_in_every_iteration(name, monkeypatch):
    """The same episodes and draws give the same codewords, maps and losses, for eleven settings."""
    task, n = vsp.get_task(name), {"SimpleGoal-v0": 240}.get(name, 110)
    code = """return (([at, drawn]) => {
      const draws = { map: n => maps.slice(at, (at += n)), rows: n => rows.slice(drawn, (drawn += n)) }
      const partition = new algorithms.Partition(config, task, draws), found = []
      for (const { n, loss } of algorithms.distil(partition, episodes))
        found[n] = structuredClone([partition.look.codewords, partition.look.coefficients, loss])
      return [found, maps.length - at, rows.length - drawn]
    })([0, 0])"""
    ends = {"low": task.low, "high": task.high, "actionLow": task.action_low, "actionHigh": task.action_high}
    box = {end: numbers.tolist() for end, numbers in ends.items()}
    for reading in READINGS:
        config = dataclasses.replace(vsp.preset(task), n_epochs=n, n_freeze=n // 5, **SOON | reading)
        history, given = recorded(task, config, monkeypatch)
        about = {"config": dataclasses.asdict(config), "task": box, **given}
        found, maps, rows = model(code, ROOT / "vsp/show/explorer/algorithms.js", **about)
        assert len(history.events) > 2 and rows == 0 and maps in (0, len(given["maps"]))  # zeros need no draws
        near = 1e-9 if config.fit == "adam" else 1e-8  # a ridge of 1e-6 enlarges rounding
        for i, (words, coefficients, loss) in enumerate(found):
            policy = history.policy_at(i)
            assert np.array_equal(policy.codewords, words), (reading, i)
            assert np.allclose(policy.coefficients, coefficients, rtol=0, atol=near), (reading, i)
            assert config.fit != "adam" or loss == pytest.approx(history.losses[i], abs=1e-9)


def test_numbers_and_colours_of_codewords_are_pythons():
    task = vsp.get_task(SIMPLEGOAL)
    policy, history = vsp.distill(vsp.load_teacher(task.name), task, vsp.preset(task).quick(), seed=0, progress=False)
    scene = scene_of({"": policy}, task, history=history)
    code = "const [policy] = scene.policies; model.name(policy); return [policy.born, policy.tints]"
    numbers, tints = state_space.birth_colours(policy, history)
    assert model(code, scene=scene) == [numbers.tolist(), tints.tolist()] and max(numbers) > len(policy)
    for each in policies(SIMPLEGOAL):
        assert model(code, scene=scene_of({"": each}, task))[1] == state_space.birth_colours(each)[1].tolist()
