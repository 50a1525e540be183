import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL

from studies.robots.fewest import fewest_numbers
from vsp.policy import VoronoiPolicy
from vsp.rollouts import rollout
from vsp.tasks.registry import get_task

PUSH = np.array([[0.0], [0.0], [0.7]])


def pumping():
    """Pushes the way it moves, in three cells: a third one far away, and slopes that hardly matter."""
    maps = np.stack([-PUSH, PUSH + [[1e-4], [1e-5], [0.0]], PUSH])
    codewords = [[-0.5, -0.02], [-0.5, 0.02], [50.0, 50.0]]
    return VoronoiPolicy(codewords, maps, task=MOUNTAINCAR, metric="euclidean", scale=np.array([1.0, 0.02]))


def test_what_does_nothing_goes_and_the_return_stays():
    policy = pumping()
    found, frame = fewest_numbers(policy, keep=0.97, n_episodes=30, seed=0)
    assert len(found) == 2 and 1 <= np.count_nonzero(found.coefficients) <= 2  # one push may do
    task = get_task(MOUNTAINCAR)
    starts = task.start(np.random.default_rng(9), 100)
    before, after = (rollout(one, task, starts).returns.mean() for one in (policy, found))
    assert after > 0.95 * before
    kept = frame[frame.kept]
    assert kept.stage.tolist()[0] == "cells" and (kept["mean"] >= 0.97 * before - 1).all()
    assert frame.iloc[-1].stage == "digits" and frame.iloc[-1].kept


def test_a_policy_that_returns_nothing_and_a_share_beyond_one_are_refused():
    still = VoronoiPolicy(np.zeros((1, 2)), np.zeros((1, 3, 1)), task=MOUNTAINCAR)
    with pytest.raises(ValueError, match="the policy returns 0 on average, expected more than 0"):
        fewest_numbers(still, keep=0.95, n_episodes=3, seed=0)
    with pytest.raises(ValueError, match="keep is 1.5, expected"):
        fewest_numbers(pumping(), keep=1.5, n_episodes=3, seed=0)
    goal = VoronoiPolicy(np.zeros((1, 2)), np.full((1, 3, 2), -1.0), task=SIMPLEGOAL)
    with pytest.raises(ValueError, match="seed"):
        fewest_numbers(goal, keep=0.9, n_episodes=3, seed=-1)
