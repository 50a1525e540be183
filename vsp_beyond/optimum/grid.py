"""Dynamic programming (Bellman 1957) on a grid over two state variables: best returns, and the actions that reach them.

Values are interpolated between the points of the grid, so one sparse matrix describes a step of all points under one
action. The error falls with the spacing of the grid; comparing two spacings shows its size.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy import sparse

from vsp.rollouts import Policy, visited_states
from vsp.tasks import RUNNING, Task, get_task

SWEEPS = 60  # sweeps of evaluation between two improvements (modified policy iteration, Puterman & Shin 1978)
MOST_IMPROVEMENTS = 1000
AT_ONCE = 5000  # states in which `GridPolicy` compares actions at once
CLOSE = 1e-6  # the iteration ends when the values change by less
UPRIGHT, SLOW = 0.5, 2.0  # rad and rad/s: Pendulum is held if angle and velocity are below these


@dataclass(frozen=True)
class Grid:
    """Evenly spaced points over a box of two variables, ends included. A `periodic` variable runs around a circle."""

    low: tuple[float, float]
    high: tuple[float, float]
    shape: tuple[int, int]
    periodic: tuple[bool, bool] = (False, False)

    def finer(self, times: float) -> "Grid":
        """Return a grid over the same box, with the spacing of the points divided by `times`."""
        ends = [not closed for closed in self.periodic]  # an axis has one point more than steps, unless it is a circle
        m, n = (2 * round(times * (n - end) / 2) + end for n, end in zip(self.shape, ends))
        return replace(self, shape=(m, n))

    def points(self) -> np.ndarray:
        """Return all points; the last variable varies fastest. (n, 2)"""
        about = zip(self.low, self.high, self.shape, self.periodic)
        axes = [np.linspace(low, high, n, endpoint=not closed) for low, high, n, closed in about]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)

    def interpolation(self, states: np.ndarray) -> sparse.csr_array:
        """Return the matrix that maps values at the points (n,) to values at the states (t, 2)."""
        (i, j, u), (k, m, v) = (self._between(states[:, axis], axis) for axis in (0, 1))
        width = self.shape[1]
        columns = np.stack([i * width + k, i * width + m, j * width + k, j * width + m], axis=1)
        weights = np.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v], axis=1)
        ends = np.arange(len(states) + 1, dtype=np.int32) * 4
        shape = len(states), np.prod(self.shape)
        return sparse.csr_array((weights.ravel(), columns.ravel().astype(np.int32), ends), shape=shape)

    def _between(self, x: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the two neighbours of each x along an axis, and its distance from the first in units of spacing."""
        low, high, n = self.low[axis], self.high[axis], self.shape[axis]
        if self.periodic[axis]:
            place = (x - low) / (high - low) * n
            first = np.floor(place).astype(np.int64)
            return first % n, (first + 1) % n, place - first
        place = np.clip((x - low) / (high - low), 0.0, 1.0) * (n - 1)
        first = np.minimum(place.astype(np.int64), n - 2)
        return first, first + 1, place - first


def best_values(task: Task, grid: Grid, actions: np.ndarray, *, price: float = 0.0) -> np.ndarray:
    """Return the highest return from every point of `grid` with `actions` (a,), minus `price` for each step: (n,). The
    task must have one action, and the grid's variables as its state. Episodes have no step limit here; a price keeps
    them short. Raises RuntimeError if the values do not converge."""
    moves = [_move(task, grid, action, price) for action in actions]
    rewards = np.concatenate([of_action for of_action, _ in moves])  # (a n,)
    matrix = sparse.vstack([of_action for _, of_action in moves], format="csr")  # (a n, n)
    n = matrix.shape[1]
    values = np.zeros(n)
    for _ in range(MOST_IMPROVEMENTS):
        offers = (rewards + matrix @ values).reshape(-1, n)
        before, values = values, offers.max(axis=0)
        if np.abs(values - before).max() < CLOSE:
            return values
        best = offers.argmax(axis=0) * n + np.arange(n)  # the rows of the best actions
        rewards_of_best, matrix_of_best = rewards[best], matrix[best]
        for _ in range(SWEEPS):
            values = rewards_of_best + matrix_of_best @ values
    raise RuntimeError(f"values still change by {np.abs(values - before).max():g}, expected less than {CLOSE:g}")


def _move(task: Task, grid: Grid, action: float, price: float) -> tuple[np.ndarray, sparse.csr_array]:
    """Return the rewards of one action at all points, and the matrix that maps values to those after the step. Its rows
    are 0 where the episode ended."""
    points = grid.points()
    after, rewards, outcomes = task.step(points, np.full((len(points), 1), action))
    goes_on = sparse.diags_array((outcomes == RUNNING).astype(np.float64))
    return rewards - price, (goes_on @ grid.interpolation(after)).tocsr()


@dataclass(frozen=True, eq=False)
class GridPolicy:
    """A policy that takes the best action by the values of a grid, looking one step ahead."""

    task: Task
    grid: Grid
    values: np.ndarray  # (n,) at the points of the grid
    actions: np.ndarray  # (a,) evenly spaced
    state_of: Callable[[np.ndarray], np.ndarray]  # from observations (n, d) to states (n, 2)
    price: float = 0.0  # per step

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, 1) for observations (n, d)."""
        states = self.state_of(obs.astype(np.float64))
        parts = np.split(states, range(AT_ONCE, len(states), AT_ONCE))
        return np.concatenate([self._best(part) for part in parts])[:, None], None

    def lost(self, obs: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Return what `actions` (n, 1) cost in the observations (n, d) if the best actions follow, in units of return:
        (n,). The sum over an episode is its regret, up to the grid's error, if no more return is possible after its
        end."""
        states, best = self.state_of(obs.astype(np.float64)), self.predict(obs)[0]
        return self._offers(states, best[:, 0]) - self._offers(states, np.asarray(actions, dtype=np.float64)[:, 0])

    def _best(self, states: np.ndarray) -> np.ndarray:
        """Return the action at the top of the parabola through the best action and its two neighbours. (n,)"""
        n = len(self.actions)
        offers = self._offers(np.tile(states, (n, 1)), np.repeat(self.actions, len(states))).reshape(n, -1)
        best, rows = offers.argmax(axis=0), np.arange(len(states))
        middle = np.clip(best, 1, n - 2)
        left, top, right = (offers[middle + shift, rows] for shift in (-1, 0, 1))
        bend = left - 2 * top + right
        inside = (best == middle) & (bend < 0)
        shift = np.where(inside, 0.5 * (left - right) / np.where(inside, bend, 1.0), 0.0)
        return self.actions[best] + shift * (self.actions[1] - self.actions[0])

    def _offers(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray:
        after, rewards, outcomes = self.task.step(states, actions[:, None])
        return rewards - self.price + (outcomes == RUNNING) * (self.grid.interpolation(after) @ self.values)


# What a policy loses


def held(obs: np.ndarray) -> np.ndarray:
    """Return whether Pendulum is held upright in the observations (n, 3): cos θ, sin θ, ω. (n,)"""
    angle, velocity = np.arctan2(obs[:, 1], obs[:, 0]), obs[:, 2]
    return (np.abs(angle) < UPRIGHT) & (np.abs(velocity) < SLOW)


Region = Callable[[np.ndarray], np.ndarray]  # maps observations (n, d) to whether they are in the region (n,)
PENDULUM_REGIONS: dict[str, Region] = {"swing-up": lambda obs: ~held(obs), "hold": held}


def losses(
    policy: Policy, best: GridPolicy, task: str | Task, starts: np.ndarray, regions: dict[str, Region]
) -> pd.DataFrame:
    """Return what `policy` loses in each of the `regions`, such as `PENDULUM_REGIONS`, one row per region. Columns:
    steps (share of the policy's steps that are in the region) and lost (return lost there per episode). The sum of all
    losses of an episode is its regret, up to the grid's error, if no more return is possible after its end. Raises
    ValueError as `visited_states` does."""
    task = get_task(task)
    states = visited_states(policy, task, starts)
    lost = best.lost(states, np.asarray(policy.predict(states)[0], dtype=np.float64))
    where = {name: region(states) for name, region in regions.items()}
    rows = {name: {"steps": here.mean(), "lost": lost[here].sum() / len(starts)} for name, here in where.items()}
    return pd.DataFrame(rows).T.rename_axis("region")
