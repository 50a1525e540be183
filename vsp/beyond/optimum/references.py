"""The best policies of the tasks whose optimum can be computed; each can be a teacher like any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...checks import check_number
from ...rollouts import Policy
from ...tasks.base import Task
from ...tasks.registry import get_task
from .grid import Grid, GridPolicy, best_values
from .simplegoal import Shortest


@dataclass(frozen=True)
class _Solvable:
    """How a task with two state variables and one action is solved."""

    grid: Grid
    state_of: Callable[[np.ndarray], np.ndarray]  # from observations (n, d) to states (n, 2)
    price: float = 0.0  # of a step


def _angle_first(seen: np.ndarray) -> np.ndarray:
    """Pendulum's angle and velocity (n, 2) of observations (n, 3)."""
    return np.column_stack([np.arctan2(seen[:, 1], seen[:, 0]), seen[:, 2]])


N_ACTIONS = 61  # between which `GridPolicy` interpolates
_SOLVABLE = {
    # The gentler the push, the higher the return, and the later the goal. At this price all starts are there by step
    # 985 of 999; at a tenth less, some are not
    "MountainCarContinuous-v0": _Solvable(
        Grid((-1.2, -0.07), (0.6, 0.07), (361, 361)), state_of=lambda seen: seen, price=3e-4
    ),
    # Upright at rest has to be a point: standing beside it costs something for ever
    "Pendulum-v1": _Solvable(
        Grid((-np.pi, -8.0), (np.pi, 8.0), (360, 361), periodic=(True, False)), state_of=_angle_first
    ),
}
TASKS = ("SimpleGoal-v0", *_SOLVABLE)


def best_policy(task: str | Task, *, finer: float = 1.0, price: float | None = None) -> Policy:
    """The policy with the highest mean return, for one of `TASKS`; made anew, in some seconds.

    SimpleGoal's is exact but 2e-5; the others are solved on a grid, with `finer` times as many points in each variable.
    `price`: of each step, by default as little as the best return allows; a higher one comes sooner where there is a
    goal. Raises ValueError for a task whose optimum is not known, for `finer` beyond 0.1 to 10, and a negative price.
    """
    task = get_task(task)
    check_number("finer", finer, least=0.1, most=10.0)
    if price is not None:
        check_number("price", price, least=0.0)
    if task.name == "SimpleGoal-v0":
        return Shortest()
    if task.name not in _SOLVABLE:
        raise ValueError(f"the best return of {task.name} is not known, expected one of {TASKS}")
    about = _SOLVABLE[task.name]
    grid, actions = about.grid.finer(finer), np.linspace(task.action_low[0], task.action_high[0], N_ACTIONS)
    price = about.price if price is None else price
    values = best_values(task, grid, actions, price=price)
    return GridPolicy(task, grid, values, actions, about.state_of, price)
