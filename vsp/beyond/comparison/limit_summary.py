"""What came out at the limit, and of robots: returns over cells, beside the best possible one or the teacher's."""

from __future__ import annotations

import os

import numpy as np
import pandas as pd

from ...paper.results import read_results
from ..optimum.limit import limit_preset
from .faithful_summary import share_interval
from .method_summary import method_summary, read_rows
from .method_tables import LIMIT, STARTS
from .regret import best_mean

# Mean return from which on a policy is said to be at the limit; SimpleGoal's: so much below the best
NEAR = {"MountainCarContinuous-v0": 99.2, "Pendulum-v1": -141.0, "LunarLanderContinuous-v3": 290.0}
GAP = {"SimpleGoal-v0": 0.015}


def near(task: str, folder: str | os.PathLike | None = None) -> float:
    """The mean return from which on a policy of `task` is at the limit."""
    return NEAR[task] if task in NEAR else best_mean(task, folder) - GAP[task]


def limit_summary(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """The policies at the limit, one row per number of cells.

    Columns: size, policies; mean, low and high (its 95 % interval), least (of a seed), regret of the mean (NaN where
    the best return is not known), failing (the most); near, the share of the policies that are at the limit, near_low
    and near_high, its 95 % interval.
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
    """Whether the start or the length of the search decides, one row per search, "at the limit" last.

    Columns: method, policies, mean, low, high (its 95 % interval), least (of a seed) and failing (the most).
    """
    size, order = limit_preset(task).n_cells, ["refined", *reversed(STARTS), *LIMIT]
    rows = pd.concat([read_rows(task, folder, table=table) for table in ("beyond", "starts", "limit")])
    rows = rows[(rows["size"] == size) & rows["method"].isin(order)]
    table = method_summary(rows).set_index("method")[["policies", "mean", "low", "high"]]
    by_method = rows.groupby("method")
    return table.assign(least=by_method["mean"].min(), failing=by_method["failing"].max()).loc[order].reset_index()


def references(folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """The best returns that are computed, one row per task, beside what the teacher returns.

    Columns: task; best, worst (of an episode), failing and longest, of the best policy; error, the difference of its
    mean return on two grids (NaN where it is exact); teacher, its mean return; regret, the teacher's.
    """
    found = []
    for task, rows in read_results("optimum", folder).groupby("task", sort=False):
        last, frame = rows.iloc[-1], read_rows(task, folder)
        teacher = frame.loc[frame["method"] == "teacher", "mean"].iloc[0]
        error = abs(rows["mean"].diff().iloc[-1]) if len(rows) > 1 else np.nan
        about = {name: last[name] for name in ("found", "worst", "failing", "longest")}
        found.append({"task": task, "best": last["mean"], "error": error, **about, "teacher": teacher})
    table = pd.DataFrame(found)
    return table.assign(regret=table["best"] - table["teacher"])


def walking(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """The policies of a robot, one row per method and size, the teacher first.

    Columns: method, size, policies, mean, low, high (its 95 % interval), failing, share (of the teacher's mean
    return), r2 (the median) and parameters.
    """
    rows = read_rows(task, folder, table="robots")
    teacher = rows.loc[rows["method"] == "robot's teacher", "mean"].iloc[0]
    table = method_summary(rows)
    r2 = rows.groupby(["method", "size"])["r2"].median()
    table["share"] = table["mean"] / teacher
    table["r2"] = [r2[about] for about in zip(table["method"], table["size"])]
    columns = ["method", "size", "policies", "mean", "low", "high", "failing", "share", "r2", "parameters"]
    return table.loc[(table["method"] != "robot's teacher").sort_values(kind="stable").index, columns]
