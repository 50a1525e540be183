"""Compute regret: how far returns are below the best possible return, for the tasks whose optimum is computed.

data/beyond/optimum.csv holds the returns of the best policies, from the start states used for all reported rows.
"""

from __future__ import annotations

import os

import numpy as np
import pandas as pd

from studies.results import read_results
from vsp.evaluation import start_states
from vsp.paper.results import provenance
from vsp.rollouts import rollout
from vsp.run.progress import progress
from vsp.tasks.base import GOAL, Task
from vsp.tasks.registry import get_task
from vsp_beyond.optimum import TASKS, best_policy, best_returns
from vsp_beyond.optimum.grid import GridPolicy

from .measure import N_REPORTED, REPORT_SEED

VERSION = 1  # raise it when the best policies give different returns; tests/golden/methods.json checks this
# Tasks, and how much finer the grid is; the difference between two returns of a task shows the grid's error
WAYS = (("SimpleGoal-v0", 1.0), *((task, finer) for task in TASKS[1:] for finer in (1.0, 2.0)))
CLOSED, WITHOUT_GOAL = "closed form", ("Pendulum-v1",)


def optimum() -> pd.DataFrame:
    """Return the returns of the best policies, one row per task and way to find them. A task's last row is its best.

    Columns: task, found (how: `CLOSED`, or the points of the grid), mean, worst, failing (share of the episodes that
    miss the goal; NaN for a task without a goal), longest (steps), and the provenance. Takes about five minutes.
    """
    shown = progress(WAYS, "optimum", total=len(WAYS), unit="policies")
    return pd.DataFrame([_played(get_task(task), finer) for task, finer in shown])


def _played(task: Task, finer: float) -> dict:
    """Return the row of a task, from a grid with `finer` times the points in each variable."""
    policy, starts = best_policy(task, finer=finer), start_states(task, N_REPORTED, REPORT_SEED)
    result, on_grid = rollout(policy, task, starts), isinstance(policy, GridPolicy)
    returns, failing = result.returns if on_grid else best_returns(starts), np.mean(result.outcomes != GOAL)
    found = "{} × {} points".format(*policy.grid.shape) if on_grid else CLOSED
    row = {"task": task.name, "found": found, "mean": returns.mean(), "worst": returns.min()}
    row |= {"failing": np.nan if task.name in WITHOUT_GOAL else failing, "longest": result.lengths.max()}
    return row | provenance_of(task.name, finer)


def provenance_of(task: str, finer: float) -> dict[str, str | int]:
    """Return the provenance of a row. Its teacher is "none"."""
    return provenance({"task": task, "finer": finer, "starts": [REPORT_SEED, N_REPORTED]}, "none", VERSION)


def best_mean(task: str, folder: str | os.PathLike | None = None) -> float:
    """Return the highest possible mean return from the report starts, or NaN if it is not known."""
    frame = read_results("optimum", folder)
    found = frame.loc[frame["task"] == task, "mean"]
    return float(found.iloc[-1]) if len(found) else np.nan


def with_regret(table: pd.DataFrame, task: str) -> pd.DataFrame:
    """Add a column regret to `table`: the best possible mean return minus the column mean.

    It is "not known" for a task whose best return is not computed.
    """
    best = best_mean(task)
    return table.assign(regret="not known" if np.isnan(best) else best - table["mean"])
