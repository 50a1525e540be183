import numpy as np
import pytest
from support import LUNARLANDER, PENDULUM, SIMPLEGOAL

from vsp.policy import VoronoiPolicy
from vsp.rollouts import rollout
from vsp.tasks.registry import get_task
from vsp_beyond.few_cells.population import rollout_population


def policies_of(task, p=4, k=3, seed=0):
    task, rng = get_task(task), np.random.default_rng(seed)
    d, m = len(task.low), len(task.action_low)
    scale = rng.uniform(0.5, 1.5, size=d)
    return [
        VoronoiPolicy(rng.uniform(task.low, task.high, (k, d)), rng.normal(0, 3, size=(k, d + 1, m)), task=task,
                      metric="euclidean", scale=scale)
        for _ in range(p)
    ]  # fmt: skip


@pytest.mark.parametrize(("task", "n"), [(SIMPLEGOAL, 50), (PENDULUM, 10), (LUNARLANDER, 3)])
def test_a_population_plays_as_each_policy_alone(task, n):
    policies, task = policies_of(task), get_task(task)
    starts = task.start(np.random.default_rng(0), n)
    for policy, together in zip(policies, rollout_population(policies, task, starts), strict=True):
        alone = rollout(policy, task, starts)
        assert np.allclose(together.returns, alone.returns) and len(together.returns) == n
        assert np.array_equal(together.outcomes, alone.outcomes) and np.array_equal(together.lengths, alone.lengths)
