"""Compute the best policies of the tasks whose optimum is known. Each can be used as a teacher.

SimpleGoal's best returns have a closed form. The rewards for progress add up to ten times the distance gained, whatever
the path. The step into the goal pays 10 instead. So it is best to enter the goal from the point outside it that is
nearest to the origin, on an edge at distance 0.1. From a start at distance d, this returns 10 (d - 0.1) + 10. From
starts inside the goal at d < 0.1, entering at once is better and returns 10.
"""

from collections.abc import Callable

import numpy as np

from vsp import Policy, Task, get_task
from vsp.checks import check_array, check_choice, check_number
from vsp.tasks.simplegoal import GOAL_EDGE, PIT_HIGH, PIT_LOW, STRIDE

from .grid import Grid, GridPolicy, best_values

BESIDE = 1e-6  # distance from the goal's edge: stays outside the goal, however the observation is rounded


def best_returns(starts: np.ndarray) -> np.ndarray:
    """Return the highest possible return from each start (n, 2). (n,)"""
    starts = check_array("starts", starts, (-1, 2))
    return np.maximum(10.0, 10.0 * np.hypot(*starts.T) + 10.0 - 10.0 * GOAL_EDGE)


class Shortest:
    """Go around the pit to `DOOR`, the point from which to enter the goal, then enter: best return, less 2e-5."""

    DOOR = np.array([GOAL_EDGE + BESIDE, 0.0])

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, 2) for observations (n, 2)."""
        aims = np.apply_along_axis(self._aim, 1, obs.astype(np.float64))
        return np.clip((aims - obs) / STRIDE, -1.0, 1.0), None

    def _aim(self, state: np.ndarray) -> np.ndarray:
        """Return the next point to go to from a state (2,)."""
        (x, y), middle = state, (PIT_LOW + PIT_HIGH) / 2
        if np.abs(state - self.DOOR).max() < BESIDE or np.hypot(x, y) < GOAL_EDGE:
            return np.zeros(2)
        if PIT_LOW < x < PIT_HIGH and PIT_LOW < y < PIT_HIGH:
            return np.array([0.0 if x < middle else 1.0, y])
        if y >= PIT_HIGH and x > PIT_LOW:  # do not go down into the pit
            return np.array([0.0, y])
        if y > PIT_LOW:
            return np.array([x, 0.0])
        return self.DOOR


def _angle_first(obs: np.ndarray) -> np.ndarray:
    """Return Pendulum's angle and velocity (n, 2) from observations (n, 3)."""
    return np.column_stack([np.arctan2(obs[:, 1], obs[:, 0]), obs[:, 2]])


N_ACTIONS = 61  # between which `GridPolicy` interpolates
_SOLVABLE: dict[str, tuple[Grid, Callable[[np.ndarray], np.ndarray], float]] = {  # grid, `state_of`, price of a step
    # A gentler push gives a higher return but reaches the goal later. At this price all 10,000 report starts reach the
    # goal by step 985 of 999. At a price 10 % lower, some do not
    "MountainCarContinuous-v0": (Grid((-1.2, -0.07), (0.6, 0.07), (361, 361)), lambda obs: obs, 3e-4),
    # Upright at rest has to be a point of the grid: holding the pendulum beside it would cost some return in every step
    "Pendulum-v1": (Grid((-np.pi, -8.0), (np.pi, 8.0), (360, 361), periodic=(True, False)), _angle_first, 0.0),
}
TASKS = ("SimpleGoal-v0", *_SOLVABLE)


def best_policy(task: str | Task, *, finer: float = 1.0, price: float | None = None) -> Policy:
    """Compute the policy with the highest mean return for one of `TASKS`. Takes some seconds. SimpleGoal's is exact up
    to 2e-5 in return, and needs neither `finer` nor `price`. The others are solved on a grid with `finer` times as many
    points in each variable. `price` is subtracted in each step; by default it is 0, or, on MountainCar, just high
    enough that every start tried reaches the goal in time. With a higher price the policy reaches a goal sooner. Raises
    ValueError for a task whose optimum is not known, `finer` outside 0.1 to 10, and a negative price."""
    task = get_task(task)
    check_choice("the task", task.name, TASKS)
    check_number("finer", finer, least=0.1, most=10.0)
    if price is not None:
        check_number("price", price, least=0.0)
    if task.name == "SimpleGoal-v0":
        return Shortest()
    grid, state_of, least_price = _SOLVABLE[task.name]
    grid, actions = grid.finer(finer), np.linspace(task.action_low[0], task.action_high[0], N_ACTIONS)
    price = least_price if price is None else price
    values = best_values(task, grid, actions, price=price)
    return GridPolicy(task, grid, values, actions, state_of, price)
