"""Evaluate policies: episodic returns from start states that are the same for all policies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .checks import check_count, check_seed
from .rollouts import Outcomes, Policy, rollout
from .tasks.base import OUTCOMES, Task
from .tasks.registry import get_task

if TYPE_CHECKING:
    import pandas as pd


def start_states(task: str | Task, n_episodes: int, seed: int) -> np.ndarray:
    """Return the start states of `seed`, the same for every policy. (n, s)"""
    check_seed(seed)
    check_count("n_episodes", n_episodes)
    return get_task(task).start(np.random.default_rng(np.random.SeedSequence(seed)), n_episodes)


def rollout_from_seed(policy: Policy, task: str | Task, n_episodes: int = 1000, *, seed: int) -> Outcomes:
    """Run `policy` from the start states of `seed`. Returns arrays with one entry per episode."""
    task = get_task(task)
    return rollout(policy, task, start_states(task, n_episodes, seed))


def evaluate(policy: Policy, task: str | Task, n_episodes: int = 1000, *, seed: int) -> pd.DataFrame:
    """Run `policy` from the start states of `seed`. Returns a row per episode with return, length and outcome."""
    import pandas as pd  # here, because it takes long to import

    result = rollout_from_seed(policy, task, n_episodes, seed=seed)
    named = np.array(OUTCOMES)[result.outcomes]
    return pd.DataFrame({"return": result.returns, "length": result.lengths, "outcome": named}).rename_axis("episode")


def fences(q1: float, q3: float) -> tuple[float, float]:
    """Return the bounds beyond which a box plot marks outliers: 1.5 interquartile ranges from the quartiles."""
    return q1 - 1.5 * (q3 - q1), q3 + 1.5 * (q3 - q1)
