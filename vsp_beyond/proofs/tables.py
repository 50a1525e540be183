"""Tables and curves of what is proved, from data/beyond/proofs*.csv and the certificates."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from vsp.paper.results import read_results
from vsp.policy import VoronoiPolicy
from vsp.rollouts import rollout
from vsp.tasks import mountaincar

from .check.mountaincar import edge
from .check.pendulum import unpacked
from .dead_points import acceleration, at_rest
from .proof import RESULTS, load_certificate

NAMES = {
    "simplegoal_paper": "the paper's, as published",
    "simplegoal_best_run": "the paper's method, best rerun",
    "simplegoal_one_map": "one linear map",
    "simplegoal_limit": "at the limit",
    "simplegoal_faithful": "faithful",
    "simplegoal_simplified": "simplified",
    "simplegoal_tuned": "tuned",
    "simplegoal_margin": "tuned with a margin",
}
N_RETURNS = 2000  # starts for the mean return in `dead_point_table`


def simplegoal_table() -> pd.DataFrame:
    """Return what is proved of policies for SimpleGoal, one row per policy.

    Columns: policy; cells; failing, the exact area of starts that do not reach the goal; outside, the same for starts
    outside the pit; sampled, the share of 10^6 episodes that fail; steps, the most; mean, the lower bound on the mean
    return; program, the share of starts outside the pit that the program surely takes to the goal; disturbance, the
    largest one under which all of these are proved to reach it."""
    rows = read_results("proofs", RESULTS).set_index("name").loc[list(NAMES)]
    failing, sampled = (rows[f"{prefix}pit"] + rows[f"{prefix}left"] for prefix in ("", "sampled_"))
    rows = rows.assign(policy=rows.index.map(NAMES), failing=failing, sampled=sampled)
    rows = rows.rename(columns={"failing_outside": "outside", "longest": "steps", "mean_low": "mean"})
    columns = ["policy", "cells", "failing", "outside", "sampled", "steps", "mean", "program", "disturbance"]
    return rows[columns].reset_index(drop=True)


def dead_point_table(policies: dict[str, VoronoiPolicy]) -> pd.DataFrame:
    """Return whether policies for MountainCar have a dead point, and their returns.

    Columns: policy; left and right, 1000 times the acceleration at rest at both ends of the starts; borders, the number
    of cell borders between them; dead point, its position (NaN: none); mean return; failing, the share of starts."""
    rows = []
    for name, policy in policies.items():
        parts = at_rest(policy)
        dead = parts[parts["dead"]]
        result = rollout(policy, mountaincar.TASK, mountaincar.start(np.random.default_rng(0), N_RETURNS))
        rows.append({
            "policy": name, "left": parts["g_low"].iloc[0], "right": parts["g_high"].iloc[-1],
            "borders": len(parts) - 1, "dead point": _zero(policy, dead.iloc[0]) if len(dead) else np.nan,
            "mean return": result.returns.mean(), "failing": (result.lengths == mountaincar.TASK.max_steps).mean(),
        })  # fmt: skip
    return pd.DataFrame(rows)


def pendulum_table() -> pd.DataFrame:
    """Return what is proved of Pendulum by a grid, and by smaller and smaller boxes of starts. Columns: boxes (per
    axis, if all were so small), share of starts."""
    return read_results("proofs_grid", RESULTS)[["boxes", "share"]]


def least_returns() -> tuple[np.ndarray, np.ndarray]:
    """Return MountainCar's starts, and the lowest return of the program from there. (n,) each"""
    blocks = load_certificate("mountaincar_limit")[1]["pieces"]
    middles = [edge(block["first"] + block["n"] // 2, -1) for block in blocks]
    return np.array(middles), np.array([block["least"] for block in blocks])


def pendulum_steps() -> np.ndarray:
    """Return the steps to upright of Pendulum's boxes, angle by angular velocity; -1 in the set around upright, 0 where
    nothing is proved. (n, n)"""
    return unpacked(load_certificate("pendulum_faithful")[1]["pieces"])


def _zero(policy: VoronoiPolicy, part: pd.Series) -> float:
    """Find where the acceleration at rest is zero, in a part of the starts where it changes its sign."""
    inner = 1e-12 * (part["high"] - part["low"])
    ends = part["low"] + inner, part["high"] - inner
    return brentq(lambda x: float(acceleration(x, policy.linear(np.array([x, 0.0]))[0])), *ends)
