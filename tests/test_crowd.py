import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from vsp.crowd import Crowd, play_all
from vsp.envs import get_task
from vsp.policy import VoronoiPolicy
from vsp.rollouts import play


def crowd_of(task, p=4, k=3, seed=0):
    task, rng = get_task(task), np.random.default_rng(seed)
    d, m = len(task.low), len(task.action_low)
    scale = rng.uniform(0.5, 1.5, size=d)
    return [
        VoronoiPolicy(rng.uniform(task.low, task.high, (k, d)), rng.normal(0, 3, size=(k, d + 1, m)), task=task,
                      metric="euclidean", scale=scale)
        for _ in range(p)
    ]  # fmt: skip


@pytest.mark.parametrize(("task", "n"), [(SIMPLEGOAL, 50), (MOUNTAINCAR, 10), (PENDULUM, 10), (LUNARLANDER, 3)])
def test_many_policies_at_once_play_as_each_alone(task, n):
    policies, task = crowd_of(task), get_task(task)
    starts = task.start(np.random.default_rng(0), n)
    for policy, together in zip(policies, play_all(policies, task, starts), strict=True):
        alone = play(policy, task, starts)
        assert np.allclose(together.returns, alone.returns) and len(together.returns) == n
        assert np.array_equal(together.codes, alone.codes) and np.array_equal(together.lengths, alone.lengths)


def test_a_crowd_acts_for_the_policy_of_the_number():
    policies = crowd_of(SIMPLEGOAL)
    states = np.random.default_rng(1).random((40, 2))
    numbers = np.sort(np.random.default_rng(2).integers(4, size=40))
    actions, _ = Crowd(policies).predict(np.column_stack([states, numbers]))
    assert np.allclose(actions, [policies[i].predict(state)[0] for i, state in zip(numbers, states)])
