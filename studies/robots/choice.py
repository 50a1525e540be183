"""Choose the policy with the highest return, where rare falls decide."""

from __future__ import annotations

import numpy as np

from vsp import Policy, Task, rollout

N_FINALISTS, LONGER = 4, 5  # the best N_FINALISTS policies play LONGER times as many episodes


def most_rewarding(policies: list[Policy], task: Task, n_episodes: int, rng: np.random.Generator) -> Policy:
    """Return the policy with the highest mean return. All play `n_episodes` episodes; the best then play more, and
    these decide."""
    few, many = (task.start(rng, n) for n in (n_episodes, LONGER * n_episodes))
    finalists = sorted(policies, key=lambda policy: -rollout(policy, task, few).returns.mean())[:N_FINALISTS]
    return max(finalists, key=lambda policy: rollout(policy, task, many).returns.mean())
