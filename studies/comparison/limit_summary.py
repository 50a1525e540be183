"""Summarise the policies at the limit and those of robots: returns by number of cells.

Returns are compared with the best possible return, or with the teacher's.
"""

from __future__ import annotations

import os

import numpy as np
import pandas as pd

from studies.results import read_results
from vsp.paper.statistics import share_interval
from vsp_beyond.few_cells.limit import limit_preset

from .method_summary import INTERVAL, method_summary, read_rows
from .method_tables import LIMIT, STARTS
from .regret import best_mean

# Least mean return of a policy at the limit; for SimpleGoal, its largest distance below the best mean return
NEAR = {"MountainCarContinuous-v0": 99.2, "Pendulum-v1": -141.0, "LunarLanderContinuous-v3": 290.0}
GAP = {"SimpleGoal-v0": 0.015}


def near(task: str, folder: str | os.PathLike | None = None) -> float:
    """Return the least mean return with which a policy of `task` counts as at the limit."""
    return NEAR[task] if task in NEAR else best_mean(task, folder) - GAP[task]


def limit_summary(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Summarise the policies at the limit, one row per number of cells.

    Columns: size, policies; mean, low and high (its 95 % interval), least (lowest mean return of a seed), regret (of
    the mean; NaN where the best return is not known), failing (highest of a seed); near (share of the policies that are
    at the limit), near_low and near_high (its 95 % interval).
    """
    rows = read_rows(task, folder, table="limit")
    found, bar = method_summary(rows).sort_values("size"), near(task, folder)
    by_size = rows.groupby("size")["mean"]
    table = found[["size", "policies", "mean", "low", "high"]].reset_index(drop=True)
    table["least"] = by_size.min().to_numpy()
    table["regret"] = best_mean(task, folder) - table["mean"]
    table["failing"] = rows.groupby("size")["failing"].max().to_numpy()
    table["near"] = by_size.agg(lambda means: np.mean(means >= bar)).to_numpy()
    bounds = [share_interval(int((means >= bar).sum()), len(means)) for _, means in by_size]
    table["near_low"], table["near_high"] = zip(*bounds)
    return table


def starts_summary(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Compare searches by their start and their length, one row per search, "at the limit" last.

    Columns: method, policies, mean, low, high (its 95 % interval), least (lowest mean return of a seed) and failing
    (highest of a seed).
    """
    size, order = limit_preset(task).n_cells, ["refined", *reversed(STARTS), *LIMIT]
    rows = pd.concat([read_rows(task, folder, table=table) for table in ("methods", "starts", "limit")])
    rows = rows[(rows["size"] == size) & rows["method"].isin(order)]
    table = method_summary(rows).set_index("method")[["policies", "mean", "low", "high"]]
    by_method = rows.groupby("method")
    return table.assign(least=by_method["mean"].min(), failing=by_method["failing"].max()).loc[order].reset_index()


def references() -> pd.DataFrame:
    """Return the computed best returns beside the teacher's, one row per task.

    Columns: task; best (mean return of the best policy); error (difference of this mean between two grids; NaN where it
    is exact); found, worst (lowest return of an episode), failing and longest, of the best policy as in `optimum`;
    teacher (its mean return); regret (of the teacher).
    """
    found = []
    for task, rows in read_results("optimum").groupby("task", sort=False):
        last, frame = rows.iloc[-1], read_rows(task)
        teacher = frame.loc[frame["method"] == "teacher", "mean"].iloc[0]
        error = abs(rows["mean"].diff().iloc[-1]) if len(rows) > 1 else np.nan
        about = {name: last[name] for name in ("found", "worst", "failing", "longest")}
        found.append({"task": task, "best": last["mean"], "error": error, **about, "teacher": teacher})
    table = pd.DataFrame(found)
    return table.assign(regret=table["best"] - table["teacher"])


def robots_summary(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Summarise the policies of a robot, one row per method and size, the teacher first.

    Columns: method, size, policies, mean, low, high (its 95 % interval), least and most (lowest and highest mean return
    of a seed), failing, share (mean divided by the teacher's mean return), r2 (the median) and parameters.
    """
    rows = read_rows(task, folder, table="robots")
    teacher = rows.loc[rows["method"] == "robot's teacher", "mean"].iloc[0]
    table = method_summary(rows)
    by_kind = rows.groupby(["method", "size"])
    found = by_kind.agg(least=("mean", "min"), most=("mean", "max"), r2=("r2", "median"))
    table = table.join(found, on=["method", "size"]).assign(share=table["mean"] / teacher)
    columns = ["method", "size", "policies", *INTERVAL, "least", "most", "failing", "share", "r2", "parameters"]
    return table.loc[(table["method"] != "robot's teacher").sort_values(kind="stable").index, columns]
