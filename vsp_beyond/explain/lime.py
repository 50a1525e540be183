"""Compare LIME (Ribeiro et al. 2016) with the equations of a partition: two linear maps that explain one teacher.

LIME explains one state at a time by a linear map fitted around it. A `VoronoiPolicy` has one map for a whole cell, and
acts by this map. Both are compared with the teacher's own gradient.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from vsp.checks import check_array, check_count
from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy
from vsp.tasks.base import Task
from vsp.tasks.registry import get_task

WIDTH = 0.75  # width of LIME's kernel, in units of the square root of the number of inputs
NEAR = 0.25  # standard deviation of the test states around a state, in units of that of the data
STEP = 0.01  # step of the finite differences, in the same units


def local_map(
    policy: Policy, task: str | Task, state: np.ndarray, *, scale: np.ndarray, rng: np.random.Generator, n: int = 5000
) -> np.ndarray:
    """Return LIME's linear map around `state` (d,): weights, then bias, in the units of the task. (d + 1, m)

    The procedure is LIME's for tabular data without discretisation. It draws `n` normal perturbations with the data's
    standard deviation `scale` (d,), weights them by an exponential kernel of the standardised distance, and fits a
    ridge regression with penalty 1. Samples lie around the state itself (`sample_around_instance`); LIME's default is
    around the mean of all data. As in the authors' library, the weights are the square root of the kernel, and
    perturbed states may leave the task's box. Raises ValueError for a state or scale that has a wrong shape or is not
    finite, and for a scale that is not above 0.
    """
    from sklearn.linear_model import Ridge

    d, m = len(get_task(task).low), len(get_task(task).action_low)
    state, scale = _checked(state, scale, (d,))
    check_count("n", n)
    moves = np.vstack([np.zeros(d), rng.normal(size=(n - 1, d))])
    actions = np.asarray(policy.predict(state + moves * scale)[0], dtype=np.float64).reshape(n, m)
    closeness = np.sqrt(np.exp(-np.square(moves).sum(axis=1) / (WIDTH**2 * d)))
    model = Ridge(alpha=1.0).fit(moves, actions, sample_weight=closeness)
    weights = model.coef_.reshape(m, d).T / scale[:, None]
    return np.vstack([weights, model.intercept_ - state @ weights])


def gradient_map(policy: Policy, state: np.ndarray, *, scale: np.ndarray) -> np.ndarray:
    """Return the tangent map of `policy` at `state` (d,), by central differences: weights, then bias. (d + 1, m)

    Raises ValueError as `local_map` does.
    """
    state, scale = _checked(state, scale, (-1,))
    moves = STEP * np.diag(scale)
    places = state + moves, state - moves, state[None]
    ahead, behind, here = (np.asarray(policy.predict(states)[0], dtype=np.float64) for states in places)
    weights = (ahead - behind) / (2 * STEP * scale[:, None])
    return np.vstack([weights, here - state @ weights])


def compare_maps(
    policy: VoronoiPolicy, teacher: Policy, states: np.ndarray, *, scale: np.ndarray, rng: np.random.Generator
) -> pd.DataFrame:
    """Return the linear maps of gradient, LIME and cell at `states` (n, d), and how well each predicts the teacher.

    One row per state, action and map. Columns: state, action, map, the weight of every input, the bias, and error. The
    error is the root mean square difference, in units of the action, between the map limited to the action box and the
    teacher. It is measured at 1000 states around the state: normally distributed with standard deviation `NEAR` times
    `scale`, and clipped to the task's box. Raises ValueError as `local_map` does.
    """
    policy.check_linear()
    task, rows = policy.task, []
    states, scale = _checked(states, scale, (-1, len(task.low)))
    for i, state in enumerate(states):
        maps = {
            "gradient": gradient_map(teacher, state, scale=scale),
            "LIME": local_map(teacher, task, state, scale=scale, rng=rng),
            "cell": policy.coefficients[policy.cells(state)],
        }
        around = np.clip(state + NEAR * scale * rng.normal(size=(1000, len(state))), task.low, task.high)
        expected = np.asarray(teacher.predict(around)[0], dtype=np.float64)
        for name, coefficients in maps.items():
            predicted = np.clip(around @ coefficients[:-1] + coefficients[-1], task.action_low, task.action_high)
            errors = np.sqrt(np.square(predicted - expected).mean(axis=0))
            for output, column, error in zip(task.outputs, coefficients.T, errors):
                weights = dict(zip([*task.inputs, "bias"], column))
                rows.append({"state": i, "action": output, "map": name, **weights, "error": error})
    return pd.DataFrame(rows)


def _checked(states: np.ndarray, scale: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return both in float64. Raises ValueError as `local_map` does."""
    states = check_array("states", states, shape)
    scale = check_array("scale", scale, states.shape[-1:])
    if not (scale > 0).all():
        raise ValueError(f"scale is {scale.tolist()}, expected positive numbers")
    return states, scale
