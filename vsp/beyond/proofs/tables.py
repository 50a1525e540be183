"""What was proved, as tables and curves: from data/results/proofs*.csv and the certificates."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ...paper.results import read_results
from ...policy import VoronoiPolicy
from ...rollouts import rollout
from ...tasks import mountaincar
from .check.mountaincar import edge
from .check.pendulum import unpacked
from .dead_points import at_rest
from .proof import load_certificate

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
N_RETURNS = 2000  # starts whose mean return stands beside a dead point


def simplegoal_table() -> pd.DataFrame:
    """What is certain of policies for SimpleGoal, one row per policy.

    Columns: policy, cells; failing, the exact area of starts that do not reach the goal, outside, of those outside the
    pit, sampled, the share of 10^6 episodes; steps, the most; mean, its lower bound; program, the share of starts
    outside the pit that the program surely takes to the goal; disturbance, the largest one that it stands.
    """
    rows = read_results("proofs").set_index("name").loc[list(NAMES)]
    table = pd.DataFrame({"policy": rows.index.map(NAMES), "cells": rows["cells"].to_numpy()})
    table["failing"] = (rows["pit"] + rows["left"]).to_numpy()
    table["outside"] = rows["failing_outside"].to_numpy()
    table["sampled"] = (rows["sampled_pit"] + rows["sampled_left"]).to_numpy()
    table["steps"] = rows["longest"].to_numpy()
    for column, source in (("mean", "mean_low"), ("program", "program"), ("disturbance", "disturbance")):
        table[column] = rows[source].to_numpy()
    return table


def dead_point_table(policies: dict[str, VoronoiPolicy]) -> pd.DataFrame:
    """Whether policies for MountainCar have a dead point, and what they return.

    Columns: policy; left and right, the acceleration at rest at both ends of the starts times 1000; borders, of cells
    between them; dead point, where one is (NaN: nowhere); mean return; failing, the share of starts.
    """
    rows = []
    for name, policy in policies.items():
        parts = at_rest(policy)
        dead = parts[parts["dead"]]
        starts = mountaincar.start(np.random.default_rng(0), N_RETURNS)
        found = rollout(policy, mountaincar.TASK, starts)
        rows.append({
            "policy": name, "left": parts["g_low"].iloc[0], "right": parts["g_high"].iloc[-1],
            "borders": len(parts) - 1, "dead point": _zero(policy, dead.iloc[0]) if len(dead) else np.nan,
            "mean return": found.returns.mean(), "failing": (found.lengths == mountaincar.TASK.max_steps).mean(),
        })  # fmt: skip
    return pd.DataFrame(rows)


def pendulum_table() -> pd.DataFrame:
    """What is proved of Pendulum by a grid, and by smaller and smaller boxes of starts. Columns: boxes (so many would
    cut an axis), share of starts."""
    return read_results("proofs_grid")[["boxes", "share"]]


def teacher_table() -> pd.DataFrame:
    """What is proved of SimpleGoal's teacher. Columns: boxes (per axis), share of the starts outside the pit, steps (at
    most), minutes that it took."""
    found = read_results("proofs_teacher").rename(columns={"n": "boxes", "longest": "steps"})
    return found.assign(minutes=found["seconds"] / 60).drop(columns="seconds")


def least_returns() -> tuple[np.ndarray, np.ndarray]:
    """MountainCar's starts, and the least return that the program has from there. (n,) each"""
    blocks = load_certificate("mountaincar_limit")[1]["pieces"]
    middles = [edge(block["first"] + block["n"] // 2, -1) for block in blocks]
    return np.array(middles), np.array([block["least"] for block in blocks])


def pendulum_steps() -> np.ndarray:
    """Pendulum's boxes, angle by angular velocity: steps upright, -1 in the set, 0 where nothing is proved. (n, n)"""
    return unpacked(load_certificate("pendulum_faithful")[1]["pieces"])


def _zero(policy: VoronoiPolicy, part: pd.Series) -> float:
    """Where the acceleration at rest is zero, in a part in which it changes its sign."""
    from scipy.optimize import brentq

    from .dead_points import acceleration

    def at(x: float) -> float:
        return float(acceleration(x, policy.linear(np.array([x, 0.0]))[0]))

    inner = 1e-12 * (part["high"] - part["low"])
    return brentq(at, part["low"] + inner, part["high"] - inner)
