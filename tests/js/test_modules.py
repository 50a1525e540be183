"""The scripts in Node: they compute what Python computes, and modules.test.mjs holds by itself."""

import base64
import dataclasses
import functools
import importlib
import itertools
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import vsp
from studies import comparison
from vsp.geometry import METRICS
from vsp.paper.printed import TASKS as PAPER
from vsp.paper.printed import published_policy
from vsp.rollouts import rollout
from vsp.run.atomic import ROOT
from vsp.show import state_space
from vsp.show.explorer import PLANES, scene_of

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


@pytest.mark.parametrize("seed", range(3))
def test_a_run_in_the_browser_is_pythons(seed):
    """Codewords and maps, for thresholds between which runs differ much."""
    task, teacher = vsp.get_task(SIMPLEGOAL), vsp.load_teacher(SIMPLEGOAL)
    schedule = {"n_epochs": 100, "n_split": 2, "n_merge": 5, "n_freeze": 10, "n_reset": 1000}
    exact = dataclasses.replace(vsp.preset(task), fit="closed_form", initial="zeros", **schedule)
    starts, *_ = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))  # as a run draws
    with threadpool_limits(1):  # for the same last bits
        taught = [*vsp.teacher_episodes(teacher, task, 100, starts)]
    episodes = [{name: getattr(each, name).astype(float).tolist() for name in ("states", "actions")} for each in taught]
    limits = [*itertools.product((1e-4, 0.1, 0.5), (0.1, 0.3), (0.3, 1.2))]
    code = """return limits.map(([loss, distance, difference]) => {
      const partition = new algorithms.Partition({ loss, distance, difference }, 2)
      for (const _ of algorithms.distil(partition, episodes, { split: 2, merge: 5, freeze: 10 }));
      return partition
    })"""
    made = model(code, ROOT / "vsp/show/explorer/algorithms.js", limits=limits, episodes=episodes)
    for (loss, far, apart), found in zip(limits, made, strict=True):
        config = dataclasses.replace(exact, max_pol_loss=loss, min_pol_distance=far, min_param_distance=apart)
        policy, _ = vsp.distill(teacher, task, config, seed=seed, progress=False)
        assert np.array_equal(policy.codewords, found["codewords"])
        assert np.allclose(policy.coefficients, found["coefficients"], rtol=0, atol=1e-7)


def test_no_two_neighbours_share_a_colour():
    side, metrics = 60, 200 * ("euclidean", "manhattan", "chebyshev")
    square = state_space.grid(np.zeros(2), np.ones(2), side)[2]
    pictures = [vsp.nearest(RANDOM.uniform(size=(2 + i // 4, 2)), square, metrics[i]) for i in range(200)]
    for task in TASKS:
        low, high = map(np.array, PLANES[task][:2])
        inputs = vsp.get_task(task).see(state_space.grid(low, high, side)[2])
        pictures += [policy.cells(inputs) for policy in policies(task)]
    code = "return pictures.map(cells => model.colouring(cells, side, Math.max(...cells) + 1))"
    for cells, colours in zip(pictures, model(code, side=side, pictures=[cells.tolist() for cells in pictures])):
        cells, shown = cells.reshape(side, side), np.array(colours)[cells].reshape(side, side)
        for axis in (0, 1):
            assert (np.diff(shown, axis=axis)[np.diff(cells, axis=axis) != 0] != 0).all()
