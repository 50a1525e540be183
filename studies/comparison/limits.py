"""Summarise how near policies come to the best possible return, and how near robots come to their teacher's.

data/beyond/optimum.csv holds the returns of the best policies, from the start states used for all reported rows.
Regret is the best possible mean return minus a policy's.
"""

import os

import numpy as np
import pandas as pd

from ..committed import read_results
from .methods import PRESETS
from .summary import INTERVAL, TUNED, method_summary, read_rows, teacher_of

# Least mean return of a policy at the limit; for SimpleGoal, its largest distance below the best mean return
NEAR = {"MountainCarContinuous-v0": 99.2, "Pendulum-v1": -141.0, "LunarLanderContinuous-v3": 290.0}
GAP = {"SimpleGoal-v0": 0.015}
SEARCHES = (TUNED, "our cells, 800 generations", "at the limit, from the teacher", "at the limit")
WALKER = "robot's teacher"


def best_mean(task: str, folder: str | os.PathLike | None = None) -> float:
    """Return the highest possible mean return from the report starts, or NaN if it is not known."""
    frame = read_results("optimum", folder)
    return float(frame.loc[frame["task"] == task, "mean"].iloc[-1]) if task in set(frame["task"]) else np.nan


def with_regret(table: pd.DataFrame, task: str) -> pd.DataFrame:
    """Add a column regret to `table`: the best possible mean return minus the column mean. It is "not known" for a task
    whose best return is not computed."""
    best = best_mean(task)
    return table.assign(regret="not known" if np.isnan(best) else best - table["mean"])


def references() -> pd.DataFrame:
    """Return the computed best returns beside the teacher's, one row per task.

    Columns: task; best (mean return of the best policy); error (difference of this mean between two grids; NaN where it
    is exact); found, worst (lowest return of an episode), failing and longest, of the best policy as in `optimum`;
    teacher (its mean return); regret (of the teacher).
    """
    table = []
    for task, rows in read_results("optimum").groupby("task", sort=False):
        last, teacher = rows.iloc[-1], teacher_of(read_rows(task))["mean"]
        error = abs(rows["mean"].diff().iloc[-1]) if len(rows) > 1 else np.nan
        about = {name: last[name] for name in ("found", "worst", "failing", "longest")}
        table.append({"task": task, "best": last["mean"], "error": error, **about, "teacher": teacher})
    return pd.DataFrame(table).assign(regret=lambda rows: rows["best"] - rows["teacher"])


def near(task: str, folder: str | os.PathLike | None = None) -> float:
    """Return the least mean return with which a policy of `task` counts as at the limit."""
    return NEAR[task] if task in NEAR else best_mean(task, folder) - GAP[task]


def limit_summary(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Summarise the policies at the limit, one row per number of cells. Columns: size, policies; mean, low and high
    (its 95 % interval), least and most (lowest and highest mean return of a seed), regret (of the mean; NaN where the
    best return is not known), failing (highest of a seed); near (share of the policies that are at the limit)."""
    rows = read_rows(task, folder, table="limit")
    table, is_near = _with_extremes(rows, "size").sort_index(), rows["mean"] >= near(task, folder)
    table.insert(table.columns.get_loc("failing"), "regret", best_mean(task, folder) - table["mean"])
    return table.assign(near=is_near.groupby(rows["size"]).mean()).reset_index()


def _with_extremes(rows: pd.DataFrame, by: str) -> pd.DataFrame:
    """Return policies, mean, low, high, least, most and failing (the highest of a seed) by the column `by`."""
    table, groups = method_summary(rows).set_index(by)[["policies", *INTERVAL]], rows.groupby(by)
    return table.assign(least=groups["mean"].min(), most=groups["mean"].max(), failing=groups["failing"].max())


def starts_summary(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Compare the `SEARCHES` by their start and their length, one row per search. Columns: method, policies, mean, low,
    high (its 95 % interval), least and most (lowest and highest mean return of a seed) and failing (highest of a
    seed)."""
    rows = pd.concat([read_rows(task, folder, table=table) for table in ("methods", "starts", "limit")])
    rows = rows[(rows["size"] == PRESETS["limit"](task).n_cells) & rows["method"].isin(SEARCHES)]
    return _with_extremes(rows, "method").loc[list(SEARCHES)].reset_index()


def robots_summary(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Summarise the policies of a robot, one row per method and size, the teacher first. Columns: method, size,
    policies, mean, low, high (its 95 % interval), seeds (the mean return of each, the lowest first), failing, share
    (mean divided by the teacher's mean return), and r2 (the median)."""
    rows, kind = read_rows(task, folder, table="robots"), ["method", "size"]
    teacher = rows.loc[rows["method"] == WALKER, "mean"].iloc[0]
    each = rows.groupby(kind).agg(
        seeds=("mean", lambda means: ", ".join(f"{m:.0f}" for m in sorted(means))), r2=("r2", "median")
    )
    table = method_summary(rows).join(each, on=kind).assign(share=lambda means: means["mean"] / teacher)
    columns = [*kind, "policies", *INTERVAL, "seeds", "failing", "share", "r2"]
    return table.loc[(table["method"] != WALKER).sort_values(kind="stable").index, columns]
