"""Find where a policy loses return relative to the best one: what each step costs if the best actions follow."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from vsp.rollouts import Policy, visited_states
from vsp.tasks.base import Task
from vsp.tasks.registry import get_task

from .grid import GridPolicy

Region = Callable[[np.ndarray], np.ndarray]  # maps observations (n, d) to whether they are in the region (n,)

UPRIGHT, SLOW = 0.5, 2.0  # rad and rad/s: Pendulum is held if angle and velocity are below these


def held(obs: np.ndarray) -> np.ndarray:
    """Return whether Pendulum is held upright in the observations (n, 3): cos θ, sin θ, ω. (n,)"""
    angle, velocity = np.arctan2(obs[:, 1], obs[:, 0]), obs[:, 2]
    return (np.abs(angle) < UPRIGHT) & (np.abs(velocity) < SLOW)


PENDULUM_REGIONS: dict[str, Region] = {"swing-up": lambda obs: ~held(obs), "hold": held}


def losses(
    policy: Policy, best: GridPolicy, task: str | Task, starts: np.ndarray, regions: dict[str, Region]
) -> pd.DataFrame:
    """Return what `policy` loses in each of the `regions`, such as `PENDULUM_REGIONS`, one row per region.

    Columns: steps (share of the policy's steps that are in the region) and lost (return lost there per episode). The
    sum of all losses of an episode is its regret, up to the grid's error, if no more return is possible after its end.
    Raises ValueError as `visited_states` does.
    """
    task = get_task(task)
    states = visited_states(policy, task, starts)
    lost = best.lost(states, np.asarray(policy.predict(states)[0], dtype=np.float64))
    where = {name: region(states) for name, region in regions.items()}
    rows = {name: {"steps": here.mean(), "lost": lost[here].sum() / len(starts)} for name, here in where.items()}
    return pd.DataFrame(rows).T.rename_axis("region")
