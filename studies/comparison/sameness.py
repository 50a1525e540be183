"""Measure whether different seeds give the same policy: the same cells, and the same actions."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd

from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy
from vsp.tasks.base import Task

from .measure import common_states


def sameness(policies: dict[int, VoronoiPolicy], teacher: Policy, task: Task) -> pd.DataFrame:
    """Compare every pair of `policies` (by seed) on `common_states`, one row per pair.

    Columns: seed, other; index, the adjusted Rand index of their cells (Hubert & Arabie 1985: 1 for the same cells,
    about 0 for unrelated ones; NaN where a policy has one cell); ratio, the root mean square difference between their
    actions, divided by that from the teacher's actions (mean over the two policies).
    """
    from sklearn.metrics import adjusted_rand_score

    states, half = common_states(teacher, task), 0.5 * (task.action_high - task.action_low)
    wanted = np.asarray(teacher.predict(states)[0], dtype=np.float64) / half
    cells = {seed: policy.cells(states) for seed, policy in policies.items()}
    actions = {seed: policy.predict(states)[0] / half for seed, policy in policies.items()}
    found = []
    for one, other in combinations(policies, 2):
        alone = min(len(policies[one]), len(policies[other])) == 1
        index = np.nan if alone else adjusted_rand_score(cells[one], cells[other])
        to_teacher = 0.5 * (_rmse(actions[one], wanted) + _rmse(actions[other], wanted))
        ratio = _rmse(actions[one], actions[other]) / to_teacher if to_teacher else np.nan
        found.append({"seed": one, "other": other, "index": index, "ratio": ratio})
    return pd.DataFrame(found)


def _rmse(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.sqrt(np.square(one - other).mean()))
