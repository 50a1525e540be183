import numpy as np
import pytest
from support import LUNARLANDER, PENDULUM, SIMPLEGOAL, random_policy

from vsp.rollouts import rollout
from vsp.tasks.registry import get_task
from vsp_beyond.few_cells.tune import rollout_population


@pytest.mark.parametrize(("task", "n"), [(SIMPLEGOAL, 50), (PENDULUM, 10), (LUNARLANDER, 3)])
def test_a_population_plays_as_each_policy_alone(task, n):
    policies = [random_policy(3, seed=seed, task=task, metric="euclidean", scaled=True) for seed in range(4)]
    task = get_task(task)
    starts = task.start(np.random.default_rng(0), n)
    for policy, together in zip(policies, rollout_population(policies, task, starts), strict=True):
        alone = rollout(policy, task, starts)
        assert np.allclose(together.returns, alone.returns) and len(together.returns) == n
        assert np.array_equal(together.outcomes, alone.outcomes) and np.array_equal(together.lengths, alone.lengths)
