"""Simple baselines: one linear map, k-means cells, rules of thumb, hand-written controllers.

A partition that does not beat them gains nothing from its cells. All act through the same `predict` as `VoronoiPolicy`,
and raise ValueError for arrays of a wrong shape, numbers that are not finite, and a seed below 0 or not an integer.
"""

from __future__ import annotations

import numpy as np

from ..checks import check_array, check_choice, check_count, check_data, check_seed
from ..policy import VoronoiPolicy
from ..rollouts import standard
from ..tasks.base import Task


def kmeans_cells(states: np.ndarray, actions: np.ndarray, *, cells: int, task: str, seed: int) -> VoronoiPolicy:
    """Cells around k-means centres (scikit-learn) of the standardised states, with a least-squares map in each."""
    from sklearn.cluster import KMeans

    states, actions = check_data(states, actions)
    check_count("cells", cells, most=len(np.unique(states, axis=0)))
    check_seed(seed)
    scale = standard(states)[1]
    centres = KMeans(cells, n_init=4, random_state=seed).fit(states / scale).cluster_centers_ * scale
    maps = np.zeros((cells, states.shape[1] + 1, actions.shape[1]))
    return refit(VoronoiPolicy(centres, maps, task=task, metric="euclidean", scale=scale), states, actions)


def linear_map(states: np.ndarray, actions: np.ndarray, task: str) -> VoronoiPolicy:
    """One linear map for the whole space, by least squares on `states` (n, d) and `actions` (n, m): a single cell."""
    states, actions = check_data(states, actions)
    inputs = np.column_stack([states, np.ones(len(states))])
    coefficients = np.linalg.lstsq(inputs, actions, rcond=None)[0]
    return VoronoiPolicy(states.mean(axis=0)[None], coefficients[None], task=task)


def refit(policy: VoronoiPolicy, states: np.ndarray, actions: np.ndarray, *, constant: bool = False) -> VoronoiPolicy:
    """Return `policy` with new maps, by least squares on the states (n, d) and actions (n, m) in each cell.

    These are the maps that training would converge to. `constant` fits a constant action per cell instead. A cell
    without states keeps its map. Raises ValueError unless the maps are linear.
    """
    policy.check_linear()
    states, actions = check_data(states, actions, *np.subtract(policy.coefficients.shape[1:], (1, 0)))
    cells, coefficients = policy.cells(states), policy.coefficients.copy()
    inputs = np.column_stack([np.zeros_like(states) if constant else states, np.ones(len(states))])
    for i in np.unique(cells):
        coefficients[i] = np.linalg.lstsq(inputs[cells == i], actions[cells == i], rcond=None)[0]
    return VoronoiPolicy(policy.codewords, coefficients, task=policy.task, metric=policy.metric, scale=policy.scale)


def rule_of_thumb(task: str) -> tuple[str, VoronoiPolicy]:
    """Return the name and the policy that a person would write for `task` without a teacher.

    SimpleGoal: walk diagonally towards the goal and ignore the pit. MountainCarContinuous: push in the direction of
    motion, 12 times the velocity, limited to [-1, 1]. Raises ValueError for another task.
    """
    rules = {
        "SimpleGoal-v0": ("always (−1, −1)", [[0, 0], [0, 0], [-1, -1]]),
        "MountainCarContinuous-v0": ("12 · velocity", [[0], [12], [0]]),
    }
    check_choice("task", task, rules)
    name, weights = rules[task]
    return name, VoronoiPolicy(np.zeros((1, 2)), np.array([weights], dtype=float), task=task)


class Heuristic:
    """The hand-written controller of Gymnasium's LunarLander (`gymnasium.envs.box2d.lunar_lander.heuristic`).

    It leans against its drift, keeps a height in proportion to its distance from the pad, and brakes with a leg down.
    """

    COST = 12, 20.0  # numbers in the formulas of `predict`; operations and comparisons, without the action limits

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Return actions (n, 2), main and side engine, for observations (n, 8)."""
        x, y, vx, vy, angle, spin, left, right = check_array("observations", obs, (-1, 8)).T
        down = (left != 0) | (right != 0)
        lean = np.clip(0.5 * x + 1.0 * vx, -0.4, 0.4)
        turn = np.where(down, 0.0, 0.5 * (lean - angle) - 1.0 * spin)
        lift = np.where(down, 0.0, 0.5 * (0.55 * np.abs(x) - y)) - 0.5 * vy
        return np.clip(np.column_stack([20.0 * lift - 1.0, -20.0 * turn]), -1.0, 1.0), None


class PumpAndBalance:
    """Energy-based swing-up of a pendulum, then linear control upright (Åström and Furuta 2000)."""

    COST = 6, 9.0  # numbers; operations of the longer branch

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Return torques (n, 1) for cosine and sine of the angle and angular velocity (n, 3)."""
        cosine, sine, velocity = check_array("observations", obs, (-1, 3)).T
        missing = velocity**2 / 6 + 5.0 * (cosine - 1.0)  # energy of the rod, minus that of standing upright
        torque = np.where(cosine > 0.8, -10.0 * sine - 2.0 * velocity, -2.0 * missing * np.sign(velocity))
        return np.clip(torque, -2.0, 2.0)[:, None], None


class ZeroPolicy:
    """A stand-in for a teacher, whose action is always zero."""

    def __init__(self, task: Task):
        self._d, self._action = len(task.low), np.zeros(len(task.action_low))

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Return zeros (n, m) for observations (n, d)."""
        return np.tile(self._action, (len(check_array("observations", obs, (-1, self._d))), 1)), None
