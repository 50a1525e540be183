"""A reader's own environment and pilot, through the public face alone."""

from dataclasses import replace

import gymnasium
import numpy as np
import own_tasks
import pytest

import vsp
import vsp_beyond
from vsp.tasks import registry
from vsp_beyond.few_cells.faithful import distill_faithfully

LITTLE = vsp_beyond.Faithful(
    n_cells=4, n_episodes=15, n_restarts=2, n_generations=3, n_tuning_episodes=5, n_validation=10, tolerance=1.0
)
NAMES = {"Dock-v0": (["east", "north", "ve", "vn"], ["push e", "push n"]), "Tank-v0": (["level", "mark"], ["valve"])}
PILOTS = {"Dock-v0": own_tasks.dock_pilot, "Tank-v0": own_tasks.tank_pilot}


def docked(observation, reward, info):
    return info["docked"]


@pytest.fixture(scope="module", autouse=True)
def forgotten():
    """What these tests register is not there for others."""
    before = dict(registry._ADDED)
    yield
    registry._ADDED.clear()
    registry._ADDED.update(before)


def test_a_changed_environment_is_a_changed_task():
    for most in (30, 40):  # as when a cell of a notebook runs again
        gymnasium.register("Changed-v0", entry_point=own_tasks.Dock, max_episode_steps=most)
        registry._ADDED.pop("Changed-v0", None)
        assert vsp.get_task("Changed-v0").max_steps == most
        assert vsp.register("Changed-v0").max_steps == vsp.get_task("Changed-v0").max_steps == most


@pytest.fixture(scope="module", params=NAMES)
def distilled(request):
    """The task, its pilot and the policy that is distilled quickly."""
    inputs, outputs = NAMES[request.param]
    outcome = docked if request.param == "Dock-v0" else None
    task = vsp.register(request.param, inputs=inputs, outputs=outputs, outcome=outcome)
    pilot = vsp.agent(PILOTS[request.param])
    policy, history = distill_faithfully(pilot, request.param, LITTLE, seed=0)
    return task, pilot, policy, history


def test_the_policy_acts_like_the_pilot(distilled):
    task, pilot, policy, history = distilled
    states = vsp.visited_states(pilot, task, vsp.start_states(task, 20, seed=9))
    actions = pilot.predict(states)[0]
    error = np.square(policy.predict(states)[0] - actions).mean() / actions.var(axis=0).mean()
    assert error < 0.1 and len(policy) <= 4 and history["kept"].sum() == 1


def test_it_explains_itself_by_the_names_that_were_given(distilled):
    task, _, policy, _ = distilled
    explained = policy.explain(0.5 * np.ones(len(task.low)))
    assert list(explained.contributions.columns[:-1]) == list(task.inputs) == NAMES[task.name][0]
    assert [text.split(" =")[0] for text in explained.equations] == NAMES[task.name][1]


def test_failures_are_defined_where_a_success_is(distilled):
    task, pilot, _, _ = distilled
    expected = {"Dock-v0": "goal"}.get(task.name, "truncated")
    assert set(vsp.evaluate(pilot, task, n_episodes=20, seed=1)["outcome"]) == {expected}


def test_one_call_with_defaults_and_one_line_for_each(capsys, monkeypatch):
    """Of the settings by size, a part of the work."""
    less = {"n_episodes": 10, "n_restarts": 1, "n_generations": 2, "n_tuning_episodes": 5, "n_validation": 5}
    for name in ("faithful_preset", "tuned_preset", "limit_preset"):
        whole = getattr(vsp_beyond, name)
        monkeypatch.setattr(vsp_beyond, name, lambda task, whole=whole, **given: replace(whole(task, **given), **less))
    policies = [vsp_beyond.faithful(own_tasks.tank_pilot, "Tank-v0", n_cells=2, seed=0),
                vsp_beyond.tuned(own_tasks.tank_pilot, "Tank-v0", seed=0),
                vsp_beyond.at_the_limit("Tank-v0", seed=0, teacher=own_tasks.tank_pilot)]  # fmt: skip
    assert all(policy.task.name == "Tank-v0" for policy in policies)
    method, task = vsp_beyond.faithful_method(n_cells=2), vsp.get_task("Tank-v0")  # the same for `vsp.compare`
    again = method(vsp.agent(own_tasks.tank_pilot), task, None, 0)
    assert again.digest == policies[0].digest
    assert method.identity(task) != vsp_beyond.faithful_method(n_cells=3).identity(task)
    with pytest.raises(ValueError, match="either these or a config"):
        vsp_beyond.faithful(own_tasks.tank_pilot, "Tank-v0", LITTLE, n_cells=2, seed=0)


# What does not fit


@pytest.mark.parametrize(
    ("about", "why"),
    [
        ({"inputs": ["level", "level"]}, "inputs are .*, expected 2 different names"),
        ({"outputs": "valve"}, "outputs are 'valve', expected 1 different names"),
        ({"outcome": True}, "outcome is True, expected a function"),
    ],
)
def test_bad_names_and_outcomes_are_refused(about, why):
    with pytest.raises(ValueError, match=why):
        vsp.register("Tank-v0", **about)
