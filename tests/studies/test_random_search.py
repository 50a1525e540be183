from dataclasses import replace

import numpy as np
from support import PENDULUM

from studies.robots.random_search import RunningMoments, search_one_map
from studies.robots.settings import Walking
from vsp import get_task, rollout

FEW = Walking(n_cells=1, n_random_steps=60_000, n_directions=8, n_best=4, n_validation=10)


def test_running_moments_are_those_of_all_states_at_once():
    rng, found = np.random.default_rng(0), RunningMoments(3)
    parts = [rng.normal(5, [1, 2, 0], size=(n, 3)) for n in (1, 10, 100)]
    for part in parts:
        found.add(part)
    everything = np.concatenate(parts)
    assert found.n == 111 and np.allclose(found.mean, everything.mean(axis=0))
    assert np.allclose(found.deviation[:2], everything[:, :2].std(axis=0)) and found.deviation[2] == 1


def test_a_search_gains_and_repeats():
    task = get_task(PENDULUM)
    starts = task.start(np.random.default_rng(1), 200)
    long, again, brief = (search_one_map(task, one, seed=0) for one in (FEW, FEW, replace(FEW, n_random_steps=1)))
    assert np.array_equal(long.coefficients, again.coefficients) and len(long) == 1
    gained = rollout(long, task, starts).returns.mean() - rollout(brief, task, starts).returns.mean()
    assert gained > 50
