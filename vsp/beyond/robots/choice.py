"""Choose the policy with the highest return, where rare falls decide."""

from __future__ import annotations

import numpy as np

from ...rollouts import Policy, rollout
from ...tasks.base import Task

N_FINALISTS, LONGER = 4, 5  # policies that are compared again, over so many times as many episodes


def most_rewarding(policies: list[Policy], task: Task, n_episodes: int, rng: np.random.Generator) -> Policy:
    """Return the policy with the highest mean return: the best of `n_episodes` episodes are compared again over more of
    them."""
    few, many = (task.start(rng, n) for n in (n_episodes, LONGER * n_episodes))
    finalists = sorted(policies, key=lambda policy: -rollout(policy, task, few).returns.mean())[:N_FINALISTS]
    return max(finalists, key=lambda policy: rollout(policy, task, many).returns.mean())
