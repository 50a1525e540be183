"""Which of several policies returns most, where a rare fall decides."""

from __future__ import annotations

import numpy as np

from ...rollouts import Policy, rollout
from ...tasks.base import Task

N_FINALISTS, LONGER = 4, 5  # the best over a few episodes play so many times as many


def most_rewarding(policies: list[Policy], task: Task, n_episodes: int, rng: np.random.Generator) -> Policy:
    """The policy with the highest mean return: the best of `n_episodes` episodes, compared again over more of them."""
    few, many = (task.start(rng, n) for n in (n_episodes, LONGER * n_episodes))
    finalists = sorted(policies, key=lambda policy: -rollout(policy, task, few).returns.mean())[:N_FINALISTS]
    return max(finalists, key=lambda policy: rollout(policy, task, many).returns.mean())
