"""Simple baselines: one linear map, k-means cells, a tree, rules of thumb.

A partition that does not beat them gains nothing from its cells. All act through the same `predict` as `VoronoiPolicy`,
and raise ValueError for arrays of a wrong shape, numbers that are not finite, and a seed below 0 or not an integer.
"""

from typing import TypeVar

import numpy as np

from ..checks import check_array, check_choice, check_count, check_data, check_seed
from ..policy import PiecewisePolicy, VoronoiPolicy
from ..rollouts import standard

P = TypeVar("P", bound=PiecewisePolicy)


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
    maps = np.zeros((1, states.shape[1] + 1, actions.shape[1]))
    return refit(VoronoiPolicy(states.mean(axis=0)[None], maps, task=task), states, actions)


def refit(policy: P, states: np.ndarray, actions: np.ndarray, *, constant: bool = False) -> P:
    """Return `policy` with new maps, by least squares on the states (n, d) and actions (n, m) in each cell. These are
    the maps that training would converge to. `constant` fits a constant action per cell instead. A cell without states
    keeps its map. Raises ValueError unless the maps are linear."""
    policy.check_linear()
    states, actions = check_data(states, actions, *np.subtract(policy.coefficients.shape[1:], (1, 0)))
    cells, coefficients = policy.cells(states), policy.coefficients.copy()
    inputs = np.column_stack([np.zeros_like(states) if constant else states, np.ones(len(states))])
    for i in np.unique(cells):
        coefficients[i] = np.linalg.lstsq(inputs[cells == i], actions[cells == i], rcond=None)[0]
    return policy.with_maps(coefficients)


def rule_of_thumb(task: str) -> tuple[str, VoronoiPolicy]:
    """Return the name and the policy that a person would write for `task` without a teacher. SimpleGoal: walk
    diagonally towards the goal and ignore the pit. MountainCarContinuous: push in the direction of motion, 12 times the
    velocity, limited to [-1, 1]. Raises ValueError for another task."""
    rules = {
        "SimpleGoal-v0": ("always (−1, −1)", [[0, 0], [0, 0], [-1, -1]]),
        "MountainCarContinuous-v0": ("12 · velocity", [[0], [12], [0]]),
    }
    check_choice("task", task, rules)
    name, weights = rules[task]
    return name, VoronoiPolicy(np.zeros((1, 2)), np.array([weights], dtype=float), task=task)


class Tree:
    """A regression tree (CART, Breiman et al. 1984) with at most `leaves` leaves, each with one constant action.
    scikit-learn grows it, best split first, on the mean squared error of `actions` (n, m) at `states` (n, d)."""

    def __init__(self, states: np.ndarray, actions: np.ndarray, *, leaves: int):
        from sklearn.tree import DecisionTreeRegressor

        states, actions = check_data(states, actions)
        check_count("leaves", leaves)
        # scikit-learn requires two leaves or more; for one leaf, `min_samples_split` is too large to split the root
        options = {"max_leaf_nodes": max(2, leaves), "min_samples_split": 2 if leaves > 1 else len(states) + 1}
        self.model = DecisionTreeRegressor(**options, random_state=0).fit(states, actions)
        self._d, self._m = states.shape[1], actions.shape[1]

    def __len__(self) -> int:
        return self.model.get_n_leaves()

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d): means of the teacher's actions, hence inside the action box."""
        obs = check_array("observations", obs, (-1, self._d))
        return (self.model.predict(obs) if len(obs) else np.zeros(0)).reshape(len(obs), self._m), None
