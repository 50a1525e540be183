"""What is reported of a policy beyond the paper: returns, failures, distance from its teacher, and cost.

No method saw the start states: nothing was fitted to them or chosen by them.
"""

from __future__ import annotations

import numpy as np

from ...baselines import tdavq
from ...baselines.soft_tree import SoftTree
from ...baselines.trees import LinearTree, ObliqueLinearTree, Tree
from ...evaluation import start_states
from ...policy import VoronoiPolicy
from ...rollouts import Policy, rollout, visited_states
from ...tasks.base import GOAL, Task
from ...tasks.registry import SLOW

VERSION = 1  # raise it when the same policy gets other numbers
REPORT_SEED, ERROR_SEED = 21, 22  # of the start states: for returns, and for action errors
N_REPORTED, N_ERROR = 10_000, 100  # episodes
N_COMMON = 10_000  # states on which actions and cells are compared
TAIL = 0.01  # share of the episodes: the worst ones


def settings(*, tail: bool = False) -> dict:
    """What decides the numbers of a policy, as JSON-able values."""
    about = {"starts": [REPORT_SEED, ERROR_SEED], "episodes": [N_REPORTED, N_ERROR], "version": VERSION}
    return about | ({"tail": TAIL} if tail else {})


def common() -> dict:
    """What decides the numbers of `fidelity` beside, as JSON-able values."""
    return {"states": N_COMMON}


def measure(policy: Policy, teacher: Policy, task: Task, *, tail: bool = False) -> dict[str, float]:
    """Mean return, share of episodes without the goal, action errors on the states of the teacher and on its own,
    cells or leaves (0: none), parameters, operations per decision; with `tail`, the mean return of the worst episodes.
    Tasks in `SLOW` are played fewer times."""
    fewer = SLOW.get(task.name, 1)
    result = rollout(policy, task, start_states(task, N_REPORTED // fewer, REPORT_SEED))
    starts = start_states(task, N_ERROR // fewer, ERROR_SEED)
    parameters, operations = cost(policy)
    row = {
        "mean": float(result.returns.mean()),
        "failing": float(np.mean(result.outcomes != GOAL)),
        "error_teacher": action_error(policy, teacher, task, starts, by=teacher),
        "error_own": action_error(policy, teacher, task, starts, by=policy),
        "cells": len(policy) if hasattr(policy, "__len__") else 0,
        "parameters": parameters,
        "operations": operations,
    }
    return row | ({"worst": worst(result.returns)} if tail else {})


def worst(returns: np.ndarray) -> float:
    """The mean of the worst `TAIL` of the returns, of one at least: the conditional value at risk."""
    return float(np.sort(returns)[: max(1, round(TAIL * len(returns)))].mean())


def action_error(policy: Policy, teacher: Policy, task: Task, starts: np.ndarray, *, by: Policy) -> float:
    """Root mean square difference of the actions in the states that `by` visits, in units of half the action range."""
    states = visited_states(by, task, starts)
    half = 0.5 * (task.action_high - task.action_low)
    gaps = (np.asarray(policy.predict(states)[0], dtype=np.float64) - teacher.predict(states)[0]) / half
    return float(np.sqrt(np.square(gaps).mean()))


def fidelity(policy: Policy, teacher: Policy, task: Task) -> dict[str, float]:
    """R² of the actions, all coordinates pooled, and of the worst coordinate, on `common_states`; the share of them
    where an action is off by more than a tenth of its range."""
    states, half = common_states(teacher, task), 0.5 * (task.action_high - task.action_low)
    wanted = np.asarray(teacher.predict(states)[0], dtype=np.float64) / half
    errors = np.square(policy.predict(states)[0] / half - wanted)
    spread = np.square(wanted - wanted.mean(axis=0))
    varies = spread.any(axis=0)  # R² is not defined of a coordinate that is constant
    worst = (errors.mean(axis=0)[varies] / spread.mean(axis=0)[varies]).max()
    off = float((errors > 0.2**2).any(axis=1).mean())
    return {"r2": float(1 - errors.sum() / spread.sum()), "r2_worst": float(1 - worst), "off": off}


def common_states(teacher: Policy, task: Task) -> np.ndarray:
    """10,000 states of the teacher's own episodes from starts that no fit, choice or tuning has seen."""
    episodes = N_REPORTED // SLOW.get(task.name, 1)
    states = visited_states(teacher, task, start_states(task, episodes, ERROR_SEED))
    return states[np.random.default_rng(ERROR_SEED).permutation(len(states))[:N_COMMON]]


def cost(policy: Policy) -> tuple[int, float]:
    """Parameters of a policy, and arithmetic operations and comparisons per decision, the mean over decisions."""
    if isinstance(policy, VoronoiPolicy):
        policy.check_linear()
        k, rows, m = policy.coefficients.shape
        units = (rows - 1) * bool((policy.scale != 1).any())  # that states are divided by
        look_up = (k > 1) * (units + k * 3 * (rows - 1) + k - 1)
        return policy.coefficients.size + (k > 1) * (policy.codewords.size + units), look_up + 2 * (rows - 1) * m
    if isinstance(policy, tdavq.DiscretePolicy):  # the values are no part of what acts
        (k, d), m = policy.codewords.shape, policy.actions.shape[1]
        return k * (d + m), float((k > 1) * (k * 3 * d + k - 1))
    if isinstance(policy, Tree | LinearTree):
        return _tree_cost(policy)
    if hasattr(policy, "COST"):  # counted by hand
        return policy.COST
    if isinstance(policy, SoftTree):  # the probabilities of all leaves, then the most probable one
        nodes, leaves = policy.nodes, len(policy)
        return nodes.size + policy.values.size, float(2 * nodes.size + leaves * policy.depth + leaves - 1)
    layers = policy.layers
    return sum(w.size + b.size for w, b in layers), float(sum(2 * w.size for w, _ in layers))


def _tree_cost(policy: Tree | LinearTree) -> tuple[int, float]:
    """A split along an axis is two numbers and a comparison, an oblique one d + 1 numbers and 2 d operations."""
    leaves = len(policy)
    if isinstance(policy, Tree):
        tree, ends = policy.model.tree_, policy.model.tree_.children_left < 0
        depths, weights = tree.compute_node_depths()[ends] - 1, tree.n_node_samples[ends]
        return leaves * policy.model.n_outputs_ + 2 * (leaves - 1), float(np.average(depths, weights=weights))
    rows, m = policy.maps.shape[1:]
    depth = float(np.average([node.depth for node in policy.ends], weights=[len(node.rows) for node in policy.ends]))
    oblique = isinstance(policy, ObliqueLinearTree)
    numbers = leaves * rows * m + (leaves - 1) * (rows if oblique else 2)
    return numbers, depth * (2 * (rows - 1) if oblique else 1) + 2 * (rows - 1) * m
