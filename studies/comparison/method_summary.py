"""Summarise the comparison beyond the paper from its committed rows: means, rivals, and which policies match.

A policy matches its teacher as `AS_GOOD` defines. `method_tables` defines the methods, `method_rows` makes the rows.
"""

from __future__ import annotations

import os

import numpy as np
import pandas as pd
from scipy import stats

from studies.results import read_results
from vsp_beyond.few_cells.config import tuned_preset

from .method_tables import ABLATION, METHODS, UNTUNED

MEASURED = ("mean", "failing", "error_teacher", "error_own", "cells", "parameters", "operations")
INTERVAL = ("mean", "low", "high")


def read_rows(task: str, folder: str | os.PathLike | None = None, *, table: str = "methods") -> pd.DataFrame:
    """Read the rows of `task` in a table of `method_tables`, by default the committed ones, or those in `folder`.

    `failing` is NaN for a task where no policy can reach a goal.
    """
    frame = read_results(f"{table}_{task}", folder)
    return frame.assign(failing=np.nan) if (frame["failing"] == 1).all() else frame


def method_summary(frame: pd.DataFrame) -> pd.DataFrame:
    """Summarise rows of `read_rows`: one row per method and size, within a size the best mean return first.

    Columns: method, size, policies (how many), mean, low and high (its 95 % interval, for other seeds), median; and
    failing, error_teacher, error_own, cells, parameters, operations (means over the seeds).
    """
    found = []
    for (method, size), rows in frame.groupby(["method", "size"], sort=False):
        low, high = mean_interval(rows["mean"].to_numpy())
        scores = {"mean": rows["mean"].mean(), "low": low, "high": high, "median": rows["mean"].median()}
        means = {name: rows[name].mean() for name in MEASURED[1:]}
        found.append({"method": method, "size": size, "policies": len(rows), **scores, **means})
    order = {"by": ["size", "mean"], "ascending": [True, False], "kind": "stable", "ignore_index": True}
    return pd.DataFrame(found).sort_values(**order)


def mean_interval(values: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval (Student's t) of the mean of `values` (n,) over other seeds; NaN for a single value.

    Seeds are few, and of three or five a bootstrap interval would be too narrow.
    """
    if len(values) < 2:
        return np.nan, np.nan
    half = stats.t.ppf(0.975, len(values) - 1) * stats.sem(values)
    return values.mean() - half, values.mean() + half


def rivals(table: pd.DataFrame) -> pd.DataFrame:
    """Compare `refined` with the best other method in a `method_summary`, one row per size.

    Columns: size, mean, low, high, rival (the name of the best other method), rival mean, rival low, rival high, ahead
    ("ours" or "theirs" if the two intervals do not overlap, else "level"), untuned (the mean of `refined` without
    tuning), and untuned ahead (like ahead, for the untuned policies).
    """
    found = []
    for size, rows in table[table["size"] > 0].groupby("size"):
        (own,) = rows[rows["method"] == "refined"].to_dict("records")
        (untuned,) = rows[rows["method"] == "refined, not tuned"].to_dict("records")
        best = rows[~rows["method"].str.startswith("refined")].iloc[0]
        row = {"size": size, **{name: own[name] for name in INTERVAL}, "rival": best["method"]}
        row |= {f"rival {name}": best[name] for name in INTERVAL}
        row |= {"ahead": ahead(own, best), "untuned": untuned["mean"], "untuned ahead": ahead(untuned, best)}
        found.append(row)
    return pd.DataFrame(found)


def ahead(own: dict | pd.Series, other: pd.Series) -> str:
    """Return which is ahead: "ours" or "theirs" if the intervals from low to high do not overlap, else "level"."""
    return "ours" if own["low"] > other["high"] else "theirs" if other["low"] > own["high"] else "level"


def ablation(frame: pd.DataFrame) -> pd.DataFrame:
    """Summarise `refined`, complete and with one part removed, at the size of the preset.

    Columns are those of `method_summary`, and `part`: what was removed, in the words and the order of `PARTS`. Raises
    ValueError for a task without such rows (those of `LONG`).
    """
    names = {f"refined, {part}": part for part in ABLATION} | {"refined": "all of it"}
    ablated = frame["method"].isin(names) & ~frame["method"].isin(METHODS)
    if not ablated.any():
        raise ValueError(f"no method of {sorted(set(frame['method']))} is an ablation, expected one of {sorted(names)}")
    rows = frame[(frame["size"] == frame.loc[ablated, "size"].iloc[0]) & frame["method"].isin(names)]
    table = method_summary(rows).assign(part=lambda table: table["method"].map(names)).set_index("part")
    return table.loc[[part for part in PARTS if part in table.index]].rename(index=PARTS).reset_index()


PARTS = {  # the parts of the ablation, by key of `ABLATION`, as readers see them
    "all of it": "all parts",
    "cold from the start": "no annealing",
    "one beginning": "one restart",
    "not corrected": "no correction",
    "no leak": "no slope beyond the limits",
    "not tuned": "no tuning",
    "failures at no price": "no failure penalty",
    "no teacher": "no teacher",
    "drawn by stakes": "weighted by criticality",
}


def seeds_as_good(task: str, frame: pd.DataFrame, method: str = "refined") -> pd.DataFrame:
    """Return the share of a method's seeds that match the teacher, as `AS_GOOD` defines it, one row per size.

    Columns: size, policies, reached (the share), gap (median of the mean return minus the teacher's), failing (highest
    of a seed).
    """
    teacher = frame[frame["method"] == "teacher"].iloc[0]
    rows = frame[frame["method"] == method].assign(good=lambda own: AS_GOOD[task](own, teacher))
    parts = rows.groupby("size").agg(policies=("good", "size"), reached=("good", "mean"), gap=("mean", "median"),
                                     failing=("failing", "max"))  # fmt: skip
    return parts.assign(gap=parts["gap"] - teacher["mean"]).reset_index()


def headline(frames: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Summarise `refined` at the size of the preset, one row per task. `frames` holds the rows by task.

    Columns: task, teacher (its mean return), cells, mean, low, high, reached and failing (as in `seeds_as_good`), rival
    (the best other method with as many cells or leaves that is not tuned), rival mean, and rival reached.
    """
    columns = ["cells", *INTERVAL, "reached", "failing", "rival", "rival mean"]
    found = []
    for task, frame in frames.items():
        frame = frame[frame["method"].isin([*METHODS, *UNTUNED])]
        table = rivals(method_summary(frame)).merge(seeds_as_good(task, frame), on="size")
        table = table.rename(columns={"size": "cells"})
        (row,) = table.loc[table["cells"] == tuned_preset(task).n_cells, columns].to_dict("records")
        theirs = seeds_as_good(task, frame, row["rival"]).set_index("size")
        teacher = frame.loc[frame["method"] == "teacher", "mean"].iloc[0]
        found.append({"task": task, "teacher": teacher, **row, "rival reached": theirs.loc[row["cells"], "reached"]})
    return pd.DataFrame(found)


# When a policy matches its teacher. SimpleGoal: the mean return is at most 0.03 lower, and the failures at most 0.1
# percentage points more. MountainCar: no failure, and a higher mean return. Pendulum, where nothing can fail: the mean
# return is at most 1 % lower. LunarLander: at most 2 % lower.
AS_GOOD = {
    "SimpleGoal-v0": lambda own, teacher: (
        (own["mean"] >= teacher["mean"] - 0.03) & (own["failing"] <= teacher["failing"] + 0.001)
    ),
    "MountainCarContinuous-v0": lambda own, teacher: (own["mean"] > teacher["mean"]) & (own["failing"] == 0),
    "Pendulum-v1": lambda own, teacher: own["mean"] >= teacher["mean"] - 0.01 * abs(teacher["mean"]),
    "LunarLanderContinuous-v3": lambda own, teacher: own["mean"] >= 0.98 * teacher["mean"],
}
