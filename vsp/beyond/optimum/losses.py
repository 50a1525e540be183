"""Where a policy loses return against the best one: what each of its steps costs, if the best actions follow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from ...rollouts import Policy, visited_states
from ...tasks.base import Task
from ...tasks.registry import get_task
from .grid import GridPolicy

Region = Callable[[np.ndarray], np.ndarray]  # observations (n, d) to whether they belong to it (n,)

UPRIGHT, SLOW = 0.5, 2.0  # rad and rad/s: within both, Pendulum is held


def held(obs: np.ndarray) -> np.ndarray:
    """Whether Pendulum is held upright in the observations (n, 3): cos θ, sin θ, ω. (n,)"""
    angle, velocity = np.arctan2(obs[:, 1], obs[:, 0]), obs[:, 2]
    return (np.abs(angle) < UPRIGHT) & (np.abs(velocity) < SLOW)


def swung(obs: np.ndarray) -> np.ndarray:
    """Whether Pendulum is on its way up, or falls. (n,)"""
    return ~held(obs)


PENDULUM: dict[str, Region] = {"swing-up": swung, "hold": held}


def losses(
    policy: Policy, best: GridPolicy, task: str | Task, starts: np.ndarray, regions: dict[str, Region] = PENDULUM
) -> pd.DataFrame:
    """What `policy` loses in each region, a row each: share of its steps, and return lost there per episode.

    The sum of all losses of an episode is its regret, but for the error of the grid, where the time is long enough for
    no more to be had at its end. Raises ValueError as `visited_states` does.
    """
    task = get_task(task)
    states = visited_states(policy, task, starts)
    lost = best.lost(states, np.asarray(policy.predict(states)[0], dtype=np.float64))
    where = {name: region(states) for name, region in regions.items()}
    rows = {name: {"steps": here.mean(), "lost": lost[here].sum() / len(starts)} for name, here in where.items()}
    return pd.DataFrame(rows).T.rename_axis("region")
