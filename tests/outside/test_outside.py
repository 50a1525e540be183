"""What a researcher adds from outside the packages: each is compared, explained, saved, loaded, exported, shown."""

import dataclasses
import functools
import importlib
import re
import sys
import types

import next_map
import next_method
import next_metric
import next_split
import next_task
import numpy as np
import pytest
from support import SIMPLEGOAL, TASKS, Constant, acted, compiled, tiny

import vsp
import vsp_beyond
from vsp.paper.runs import Experiment
from vsp.run.atomic import ROOT
from vsp.run.identity import identity
from vsp.tasks.registry import _ADDED

PILOT = vsp.agent(next_task.pilot, name="pilot")
CONFIG = tiny(n_epochs=200, n_freeze=20)
DISTILLED = {  # with the objects that a file names
    "split": ({}, {"split": next_split.at_the_worst_state}, []),
    "minkowski": ({"metric": next_metric.MINKOWSKI}, {}, [next_metric.MINKOWSKI]),
    "circle": ({"metric": next_metric.CIRCLE}, {}, [next_metric.CIRCLE]),
    "sines": ({"sub_policy": next_map.sines}, {}, [lambda task: next_map.sines(task)]),
}
METHODS = {
    name: vsp.paper_method(dataclasses.replace(CONFIG, **changes), **passes)
    for name, (changes, passes, _) in DISTILLED.items()
} | {"SVM": vsp.Method(next_method.SvmSplits(4), n_data=20)}


@pytest.fixture(scope="module")
def comparison(tmp_path_factory):
    return vsp.compare(METHODS, [SIMPLEGOAL], seeds=range(2), n_episodes=50, runs=tmp_path_factory.mktemp("runs"))


@pytest.mark.parametrize("name", METHODS)
def test_a_part_from_outside_goes_all_the_way(name, comparison, tmp_path, monkeypatch):
    monkeypatch.setattr("vsp_beyond.page.PROVERS", {})  # a proof takes long
    task, agent = vsp.get_task(SIMPLEGOAL), vsp.load_teacher(SIMPLEGOAL)
    data = vsp.collect_episodes(agent, task, vsp.start_states(task, 20, 3))
    policy = METHODS[name](agent, task, data, 0)
    row = comparison.frame.set_index("method").loc[name]
    assert row["policies"] == 2 and row["cells"] >= 2
    assert (row["low"], row["high"]) == vsp.protocol.crossed_interval(comparison.returns[SIMPLEGOAL, name])
    states = np.random.default_rng(0).uniform(0, 1, size=(500, 2))
    known = DISTILLED[name][2] if name in DISTILLED else []
    policy.save(tmp_path / "policy.vsp")
    if known:
        with pytest.raises(ValueError, match="lacks or names .*known"):
            vsp.PiecewisePolicy.load(tmp_path / "policy.vsp")
    back = vsp.PiecewisePolicy.load(tmp_path / "policy.vsp", known=known)
    assert np.array_equal(back.predict(states)[0], policy.predict(states)[0]) and back.digest == policy.digest
    why = back.explain(states[0])
    assert why.next_cell not in (None, why.cell) and why.margin >= 0 and "\\begin{tabular}" in back.to_latex()
    library, module = compiled(policy, tmp_path), {}
    exec(policy.to_python(), module)
    for state, action in zip(states, policy.predict(states)[0]):
        assert acted(library, state, 2) == (policy.cells(state), pytest.approx(action, abs=1e-12))
        assert module["act"](state) == pytest.approx(action, abs=1e-12)
    made = vsp_beyond.report(back, agent, SIMPLEGOAL)
    assert ("\\sin(x)" in back.to_latex()) == (name == "sines")
    drawn = name in ("split", "minkowski")
    assert ("application/json" in made) == drawn and ("No episode is shown" in made) == (not drawn)


def test_a_policy_is_identified_by_what_its_parts_do():
    """Not by their names alone."""
    metrics = [vsp.Metric("mine", order) for order in (3, 4)]
    maps = [dataclasses.replace(next_map.sines(vsp.get_task(SIMPLEGOAL)), features=one) for one in (np.sin, np.cos)]
    policies = [vsp.VoronoiPolicy(np.eye(2), np.ones((2, 3, 2)), task=SIMPLEGOAL, metric=one) for one in metrics]
    policies += [policies[0].with_maps(np.ones((2, 3, 2)), sub_policy=lambda task, made=one: made) for one in maps]
    assert len({policy.digest for policy in policies}) == 4


def test_a_page_is_about_cells_and_maps():
    with pytest.raises(ValueError, match="expected cells and maps"):
        vsp_beyond.report(PILOT, PILOT, SIMPLEGOAL)


def test_a_task_on_arrays_is_registered_and_compared(tmp_path):
    """Its name is known, and a change of its step is another task."""
    vsp.register(next_task.CART)
    try:
        assert len(vsp.evaluate(PILOT, "Cart-v0", 5, seed=0)) == 5
        methods = {"SVM": METHODS["SVM"], "theirs": np.ones((3, 10))}
        frame = vsp.compare(methods, ["Cart-v0"], {"Cart-v0": PILOT}, seeds=[0], n_episodes=10, runs=tmp_path).frame
        assert frame["policies"].tolist() == [1, 1, 3] and frame["failing"].iloc[0] == 0
        other = vsp.agent(lambda obs: -next_task.pilot(obs), name="backwards")
        backwards = vsp.compare(methods, ["Cart-v0"], {"Cart-v0": other}, seeds=[0], n_episodes=10, runs=tmp_path).frame
        assert (backwards["mean"] < frame["mean"])[:2].all() and len([*tmp_path.glob("Cart-v0/*/*")]) == 4
    finally:
        _ADDED.pop("Cart-v0")
    changed = dataclasses.replace(next_task.CART, step=against_the_wind)
    frame = vsp.compare(methods, [changed], {"Cart-v0": PILOT}, seeds=[0], n_episodes=10, runs=tmp_path).frame
    assert frame["failing"].isna().all()  # nobody arrives
    vsp.protocol.comparison._PLAYED.clear()
    again = vsp.compare(methods, [changed], {"Cart-v0": PILOT}, seeds=[0], n_episodes=10, runs=tmp_path / "again").frame
    assert again["r2"].equals(frame["r2"])  # not on states of the other task
    for taken in (SIMPLEGOAL, dataclasses.replace(next_task.CART, name=SIMPLEGOAL)):
        with pytest.raises(ValueError, match=f"'{SIMPLEGOAL}' is one of vsp's own"):
            vsp.register(taken)


def against_the_wind(states, actions):
    return next_task.step(states, actions - 2)


def test_a_comparison_makes_what_is_missing_alone(comparison, tmp_path, monkeypatch):
    made = []
    make = vsp.protocol.comparison.Trial.make
    monkeypatch.setattr(vsp.protocol.comparison.Trial, "make", lambda t: (made.append((t.method, t.seed)), make(t))[1])
    few = {"SVM": METHODS["SVM"]}
    first = vsp.compare(few, [SIMPLEGOAL], seeds=[0], n_episodes=20, runs=tmp_path)
    again = vsp.compare(few | {"split": METHODS["split"]}, [SIMPLEGOAL], seeds=[0, 1], n_episodes=20, runs=tmp_path)
    kinds = [(one.name or "SVM", seed) for one, seed in made]
    of_the_paper = [("the paper's method", seed) for seed in (0, 1)]
    assert kinds == [("the agent itself", 0), ("SVM", 0), ("SVM", 1), *of_the_paper]
    key = SIMPLEGOAL, "SVM"
    assert np.array_equal(first.returns[key][0], again.returns[key][0]) and len(again.frame) == 3
    assert "\\toprule" in again.to_latex() and again.plot(SIMPLEGOAL).get_title() == SIMPLEGOAL
    twins = {name: vsp.Method(make, name="mine", version=1) for name, make in (("a", max), ("b", min))}
    for methods, why in (
        (twins, "'b' has the name, version and settings"),
        ({"agent": METHODS["SVM"]}, "another name"),
    ):
        with pytest.raises(ValueError, match=why):
            vsp.compare(methods, [SIMPLEGOAL], runs=tmp_path)
    with pytest.raises(ValueError, match="one array, expected one by name of the task"):
        vsp.compare({"theirs": np.ones((2, 5))}, TASKS, runs=tmp_path)


def test_data_are_the_agents_episodes_from_starts_of_the_seed(tmp_path):
    method = vsp.Method(shown, n_data=7)
    assert method.identity(task := vsp.get_task(SIMPLEGOAL)) != vsp.Method(shown, n_data=8).identity(task)
    agent = vsp.load_teacher(SIMPLEGOAL)
    compared = vsp.compare({"shown": method}, [SIMPLEGOAL], seeds=[0, 1], n_episodes=3, runs=tmp_path)
    first, second = compared.returns[SIMPLEGOAL, "shown"][:, 0]
    starts = task.start(np.random.default_rng(np.random.SeedSequence([1, 1])), 7)
    data = vsp.collect_episodes(agent, task, starts)
    again = vsp.rollout_from_seed(shown(agent, task, data, 1), task, 3, seed=1).returns[0]
    assert first != second == again and len(data.states) == len(data.actions) == sum(len(e.states) for e in data)


def shown(agent, task, data, seed):
    """Always the mean action of the seven episodes."""
    assert len(data) == 7 and np.allclose(agent.predict(data[3].states)[0], data[3].actions, atol=1e-5)
    return Constant(*data.actions.mean(axis=0))


def test_who_always_fails_is_told_so(tmp_path):
    """Where somebody reaches a goal."""
    frame = vsp.compare({"still": standing}, [SIMPLEGOAL], seeds=[0], n_episodes=9, runs=tmp_path).frame
    assert frame["failing"].tolist() == [0, 1] and frame["cells"].isna().all()


def standing(agent, task, data, seed):
    return vsp.agent(np.zeros_like)


# What identifies a part


class NeverSplit:
    def split(self, partition, episode, config, rng):
        return []

    merge = staticmethod(vsp.merge_regions)


class LikeThePaper(NeverSplit):
    split = staticmethod(vsp.split_regions)


def test_rules_without_fields_are_told_apart(tmp_path):
    """Also from the paper's own passes: each loads its own run."""
    teacher, cells = vsp.load_teacher(SIMPLEGOAL), {}
    for rule in (NeverSplit(), LikeThePaper(), None):
        one = Experiment(SIMPLEGOAL, CONFIG, teacher, 5, rule)
        (run,) = vsp.paper.runs.make_runs(one, [0], runs=tmp_path)
        cells[type(rule)] = len(run.policy)
    assert cells[NeverSplit] == 1 < cells[LikeThePaper] == cells[type(None)] and len([*tmp_path.glob("*/*")]) == 3


BODY = """
import numpy as np
LEAST = 3
def helper(x): return x + 1
class Rule:
    table = {2: 3}
    def __init__(self, size=1): self.size = size
    def __call__(self, agent, task, data, seed): return helper(LEAST)
"""


@pytest.mark.parametrize(
    ("old", "new"), [("return helper", "return -helper"), ("= 3", "= 4"), ("x + 1", "x + 2"), ("{2: 3}", "{2: 4}")]
)
def test_an_edited_body_helper_or_constant_is_another_rule(old, new, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    found = []
    for text in (BODY, BODY, BODY.replace(old, new)):
        (tmp_path / "edited_rule.py").write_text(text)
        sys.modules.pop("edited_rule", None)
        importlib.invalidate_caches()
        found.append(identity(importlib.import_module("edited_rule").Rule()))
    assert found[0] == found[1] != found[2]
    assert identity(sys.modules["edited_rule"].Rule(2)) != found[2]


def made(k):
    def rule(x):
        return x + k

    return rule


def test_a_version_stands_for_the_source_alone():
    """Not for closures, arguments and attributes, and not for another lambda."""
    functions = [made(1), made(2), functools.partial(made, 1), functools.partial(made, 2), lambda x: x, lambda x: -x]
    for function in functions:
        function.version = 1
    assert len({str(identity(one)) for one in functions}) == 6 and identity(np.sin) != identity(np.cos)
    assert "source" in identity(functools.cache(made))["settings"]["of"]
    table = np.arange(6.0).reshape(2, 3)  # in either order of memory
    assert identity(np.asfortranarray(table)) == identity(table) != identity(table.T.reshape(2, 3))


def test_code_without_source_needs_a_version():
    for rule in (lambda *_: [], np.frompyfunc(abs, 1, 1), functools.partial(next_map.sines)):
        with pytest.raises(ValueError, match="or give it a `version`"):
            identity(rule)
    with pytest.raises(ValueError, match="version is 1 without a name"):
        vsp.Method(next_map.sines, version=1)
    rule = types.SimpleNamespace(version=2, settings={"a": 1})
    assert identity(rule)["version"] == 2 and identity(rule)["settings"] == {"a": 1}
    with pytest.raises(ValueError, match="has no identity, expected a name"):
        vsp.compare({"SVM": METHODS["SVM"]}, ["Pendulum-v1"], {"Pendulum-v1": vsp.agent(next_task.pilot)})
    assert PILOT.digest != vsp.agent(next_task.pilot, name="other").digest


def test_the_distance_is_part_of_every_id_and_file(tmp_path):
    teacher = vsp.load_teacher(SIMPLEGOAL)
    mine = next_metric.MINKOWSKI
    for metric in ("manhattan", "euclidean", mine, dataclasses.replace(mine, order=4)):
        one = Experiment(SIMPLEGOAL, dataclasses.replace(CONFIG, metric=metric), teacher, 5)
        (run,) = vsp.paper.runs.make_runs(one, [0], runs=tmp_path)
        again = vsp.rollout_from_seed(run.policy, SIMPLEGOAL, 5, seed=1)
        assert run.policy.where.metric == vsp.geometry.metric_of(metric)
        assert np.array_equal(run.outcomes.returns, again.returns)
    assert len([*tmp_path.glob("*/*")]) == 4


def test_the_page_shows_the_code_that_is_tested():
    code = re.search(r"```python\n(.*?)```", (ROOT / "docs/next_method.md").read_text("utf-8"), flags=re.S)[1]
    assert (ROOT / "tests/outside/next_method.py").read_text("utf-8").endswith(f"\n{code}") and len(code) > 1000
