"""Measure what is reported of a policy beyond the paper: returns, failures, distance from its teacher, and cost.

No run has seen these start states: nothing is fitted to them or selected with them. The methods for robots and the
search for the limit were changed after first results from the report starts. Policies of robots, and at the limit on
LunarLander, are measured from new starts. The longer search for one map was added after results from those.
"""

import numpy as np

from vsp import Policy, Task, VoronoiPolicy, start_states
from vsp.rollouts import rollout, visited_states
from vsp.tasks.base import GOAL

VERSION = 1  # raise it when the same policy gives different numbers
REPORT_SEED, ERROR_SEED = 21, 22  # seeds of the start states, for returns and for action errors
NEW_SEED, LIMIT_SEED = 23, 24  # seeds of start states for robots, and at the limit on LunarLander
N_REPORTED, N_ERROR = 10_000, 100  # episodes
N_COMMON = 10_000  # states on which actions and cells are compared


def settings(seed: int = REPORT_SEED) -> dict:
    """Return the settings that determine the numbers of a policy, as JSON-able values."""
    return {"starts": [seed, ERROR_SEED], "episodes": [N_REPORTED, N_ERROR], "version": VERSION}


def measure(policy: Policy, teacher: Policy, task: Task, seed: int = REPORT_SEED) -> dict[str, float]:
    """Measure a policy: returns, from the starts of `seed`, action errors and size. Keys: mean (return), failing (share
    of episodes without the goal), error_teacher and error_own (action errors in the teacher's states and in the
    policy's own), cells (or leaves; 0: none). Slow tasks are played from fewer starts; but of those of `LIMIT_SEED` all
    are played."""
    n = N_REPORTED if seed == LIMIT_SEED else N_REPORTED // task.slowness
    result = rollout(policy, task, start_states(task, n, seed))
    starts = start_states(task, N_ERROR // task.slowness, ERROR_SEED)
    return {
        "mean": float(result.returns.mean()),
        "failing": float(np.mean(result.outcomes != GOAL)),
        "error_teacher": action_error(policy, teacher, task, starts, by=teacher),
        "error_own": action_error(policy, teacher, task, starts, by=policy),
        "cells": len(policy) if hasattr(policy, "__len__") else 0,
    }


def action_error(policy: Policy, teacher: Policy, task: Task, starts: np.ndarray, *, by: Policy) -> float:
    """Return the root mean square difference between the actions of `policy` and `teacher` in the states `by` visits.
    It is in units of half the action range."""
    states = visited_states(by, task, starts)
    return _rmse(in_half_ranges(policy, task, states), in_half_ranges(teacher, task, states))


def in_half_ranges(policy: Policy, task: Task, states: np.ndarray) -> np.ndarray:
    """Return the actions (n, m) of a policy in `states` (n, d), in units of half the action range."""
    half = 0.5 * (task.action_high - task.action_low)
    return np.asarray(policy.predict(states)[0], dtype=np.float64) / half


def fidelity(policy: Policy, teacher: Policy, task: Task, states: np.ndarray | None = None) -> dict[str, float]:
    """Measure how closely the policy's actions match the teacher's on `states` (n, d), by default `common_states`.
    Keys: r2 (R² of the actions, all coordinates pooled), r2_worst (R² of the worst coordinate), off (share of the
    states where an action is off by more than a tenth of its range)."""
    states = common_states(teacher, task) if states is None else states
    wanted = in_half_ranges(teacher, task, states)
    errors = np.square(in_half_ranges(policy, task, states) - wanted)
    spread = np.square(wanted - wanted.mean(axis=0))
    varies = spread.any(axis=0)  # R² is not defined for a constant coordinate
    worst = (errors.mean(axis=0)[varies] / spread.mean(axis=0)[varies]).max()
    off = float((errors > 0.2**2).any(axis=1).mean())
    return {"r2": float(1 - errors.sum() / spread.sum()), "r2_worst": float(1 - worst), "off": off}


def common_states(teacher: Policy, task: Task) -> np.ndarray:
    """Return 10,000 states of the teacher's own episodes, from starts that no fit, selection or tuning has seen."""
    episodes = N_REPORTED // task.slowness
    states = visited_states(teacher, task, start_states(task, episodes, ERROR_SEED))
    return states[np.random.default_rng(ERROR_SEED).permutation(len(states))[:N_COMMON]]


def sameness(
    one: VoronoiPolicy, other: VoronoiPolicy, teacher: Policy, task: Task, states: np.ndarray
) -> dict[str, float]:
    """Compare two policies on `states` (n, d). Keys: index, the adjusted Rand index of their cells (Hubert & Arabie
    1985: 1 for the same cells, about 0 for unrelated ones; NaN where a policy has one cell); ratio, the root mean
    square difference between their actions, divided by that from the teacher's actions (mean over the two policies)."""
    from sklearn.metrics import adjusted_rand_score

    first, second, wanted = (in_half_ranges(policy, task, states) for policy in (one, other, teacher))
    one_cell = min(len(one), len(other)) == 1
    index = np.nan if one_cell else adjusted_rand_score(one.cells(states), other.cells(states))
    to_teacher = 0.5 * (_rmse(first, wanted) + _rmse(second, wanted))
    return {"index": index, "ratio": _rmse(first, second) / to_teacher if to_teacher else np.nan}


def _rmse(actions: np.ndarray, others: np.ndarray) -> float:
    return float(np.sqrt(np.square(actions - others).mean()))
