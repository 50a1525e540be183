"""Compute the best policies of the tasks whose optimum is known. Each can be used as a teacher."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vsp.checks import check_number
from vsp.rollouts import Policy
from vsp.tasks.base import Task
from vsp.tasks.registry import get_task

from .grid import Grid, GridPolicy, best_values
from .simplegoal import Shortest


@dataclass(frozen=True)
class _Solvable:
    """How to solve a task with two state variables and one action."""

    grid: Grid
    state_of: Callable[[np.ndarray], np.ndarray]  # from observations (n, d) to states (n, 2)
    price: float = 0.0  # per step


def _angle_first(seen: np.ndarray) -> np.ndarray:
    """Return Pendulum's angle and velocity (n, 2) from observations (n, 3)."""
    return np.column_stack([np.arctan2(seen[:, 1], seen[:, 0]), seen[:, 2]])


N_ACTIONS = 61  # between which `GridPolicy` interpolates
_SOLVABLE = {
    # A gentler push gives a higher return but reaches the goal later. At this price all 10,000 report starts reach the
    # goal by step 985 of 999. At a price 10 % lower, some do not
    "MountainCarContinuous-v0": _Solvable(
        Grid((-1.2, -0.07), (0.6, 0.07), (361, 361)), state_of=lambda seen: seen, price=3e-4
    ),
    # Upright at rest has to be a point of the grid: holding the pendulum beside it would cost some return in every step
    "Pendulum-v1": _Solvable(
        Grid((-np.pi, -8.0), (np.pi, 8.0), (360, 361), periodic=(True, False)), state_of=_angle_first
    ),
}
TASKS = ("SimpleGoal-v0", *_SOLVABLE)


def best_policy(task: str | Task, *, finer: float = 1.0, price: float | None = None) -> Policy:
    """Compute the policy with the highest mean return for one of `TASKS`. Takes some seconds.

    SimpleGoal's is exact up to 2e-5 in return, and needs neither `finer` nor `price`. The others are solved on a grid
    with `finer` times as many points in each variable. `price` is subtracted in each step; by default it is 0, or, on
    MountainCar, just high enough that every start tried reaches the goal in time. With a higher price the policy
    reaches a goal sooner. Raises ValueError for a task whose optimum is not known, `finer` outside 0.1 to 10, and a
    negative price.
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
