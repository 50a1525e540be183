"""Two routes to one result: `vsp.distill` and the direct way; `make bench` compares whole runs."""

import dataclasses

import direct
import gymnasium
import numpy as np
import pytest
import torch
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS

import vsp
from vsp.evaluation import rollout_from_seed
from vsp.paper import printed
from vsp.teachers.teacher import load_teacher

SHORT = {  # often enough split, merged and reset to be worth comparing
    SIMPLEGOAL: {"n_epochs": 300, "n_freeze": 50, "n_split": 10, "n_merge": 30, "n_reset": 70},
    MOUNTAINCAR: {"n_epochs": 90, "n_freeze": 15, "n_split": 5, "n_merge": 15, "n_reset": 35},
}


@pytest.fixture(scope="module", params=TASKS)
def task(request):
    torch.set_num_threads(1)
    return request.param


@pytest.fixture(scope="module")
def agent(task):
    return direct.teacher_agent(task)


def test_the_agent_is_the_shipped_teacher(task, agent):
    space = vsp.get_task(task)
    states = np.random.default_rng(0).uniform(space.low, space.high, size=(200, 2)).astype(np.float32)
    single = [agent.predict(state, deterministic=True)[0] for state in states]
    assert np.allclose(single, load_teacher(task).predict(states)[0], rtol=0, atol=1e-5)


def test_the_direct_way_comes_to_the_same_partition(task, agent, monkeypatch):
    config = dataclasses.replace(vsp.preset(task), **SHORT[task], min_param_distance=0.8)
    found = direct.distill(agent, gymnasium.make(task), config, seed=2)
    kinds = [kind for _, kind, _ in found[1]]
    assert kinds.count("split") >= 8 and kinds.count("merge") >= 2 and len(found[0]) >= 3
    assert direct.same_run(found, load_teacher(task), task, config, 2, monkeypatch)
    other = dataclasses.replace(config, batch_size=63)
    assert not direct.same_run(found, load_teacher(task), task, other, 2, monkeypatch)


def test_both_play_from_the_same_starts(task, agent):
    config = dataclasses.replace(vsp.preset(task), n_epochs=5, n_freeze=1)
    episodes = direct.distill(agent, gymnasium.make(task), config, seed=4)[3]
    starts = vsp.get_task(task).start(np.random.default_rng(np.random.SeedSequence(4).spawn(3)[0]), 5)
    assert np.array_equal([episode[0][0] for episode in episodes], starts.astype(np.float32))


@pytest.mark.parametrize("who", ["copy", "teacher"])
def test_evaluate_policy_comes_to_the_same_returns(task, agent, who):
    """To what it rounds to, and to what Gymnasium's MountainCar makes of an action in float32."""
    policy = printed.published_policy(task) if who == "copy" else direct.OneByOne(agent)
    returns, tolerance = direct.evaluate_directly(policy, task, 10, seed=3), 1e-6 if who == "copy" else 1e-5
    assert np.allclose(returns, rollout_from_seed(policy, task, 10, seed=3).returns, rtol=0, atol=tolerance)
