"""What came out of the comparison beyond the paper, from the committed rows: summaries, rivals, and who is as good.

`method_tables` says what the methods are, `method_rows` makes the rows.
"""

from __future__ import annotations

import os

import numpy as np
import pandas as pd

from ...paper.results import read_results
from ...paper.statistics import interval
from ..refinement.config import tuned_preset
from .method_tables import ABLATION, METHODS

MEASURED = ("mean", "failing", "error_teacher", "error_own", "cells", "parameters", "operations")
INTERVAL = ("mean", "low", "high")


def read_rows(task: str, folder: str | os.PathLike | None = None, *, table: str = "beyond") -> pd.DataFrame:
    """The committed rows of `task` in a table of `method_tables`, or those in another folder; `failing` is NaN where
    nothing can reach a goal."""
    frame = read_results(f"{table}_{task}", folder)
    return frame.assign(failing=np.nan) if (frame["failing"] == 1).all() else frame


def method_summary(frame: pd.DataFrame) -> pd.DataFrame:
    """One row per method and size of `frame`, rows as `read_rows` has them, the best mean return of a size first.

    Columns: method, size, policies (how many), mean, low and high (its 95 % interval, for other seeds), median,
    failing, error_teacher, error_own, cells, parameters, operations: means over the seeds.
    """
    found = []
    for (method, size), rows in frame.groupby(["method", "size"], sort=False):
        low, high = interval(rows["mean"].to_numpy(), np.mean, vectorized=True) if len(rows) > 1 else (np.nan, np.nan)
        scores = {"mean": rows["mean"].mean(), "low": low, "high": high, "median": rows["mean"].median()}
        means = {name: rows[name].mean() for name in MEASURED[1:]}
        found.append({"method": method, "size": size, "policies": len(rows), **scores, **means})
    order = {"by": ["size", "mean"], "ascending": [True, False], "kind": "stable", "ignore_index": True}
    return pd.DataFrame(found).sort_values(**order)


def rivals(table: pd.DataFrame) -> pd.DataFrame:
    """`refined` in a `method_summary` beside the best of the other methods at every size, one row per size.

    Columns: size, mean, low, high, rival (its name), rival mean, rival low, rival high, ahead: "ours" or "theirs" where
    the two intervals do not overlap, else "level"; untuned: the mean of `refined` without tuning, and untuned ahead
    likewise.
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
    """Who is ahead: "ours" or "theirs" where the intervals low to high do not overlap, else "level"."""
    return "ours" if own["low"] > other["high"] else "theirs" if other["low"] > own["high"] else "level"


def ablation(frame: pd.DataFrame) -> pd.DataFrame:
    """`refined`, whole and with one part removed, at the size of the preset, as `method_summary` has it.

    The column `part` names what was removed, in the words and the order of `PARTS`. Raises ValueError
    for a task without such rows, one of `LONG`.
    """
    names = {f"refined, {part}": part for part in ABLATION} | {"refined": "all of it"}
    ablated = frame["method"].isin(names) & ~frame["method"].isin(METHODS)
    if not ablated.any():
        raise ValueError(f"no method of {sorted(set(frame['method']))} is an ablation, expected one of {sorted(names)}")
    rows = frame[(frame["size"] == frame.loc[ablated, "size"].iloc[0]) & frame["method"].isin(names)]
    table = method_summary(rows).assign(part=lambda table: table["method"].map(names)).set_index("part")
    return table.loc[[part for part in PARTS if part in table.index]].rename(index=PARTS).reset_index()


PARTS = {  # of an ablation, in words
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
    """How many seeds of a method match their teacher, as `AS_GOOD` defines it, one row per size.

    Columns: size, policies, reached (share of them), gap (median, to the teacher's mean return), failing (the most).
    """
    teacher = frame[frame["method"] == "teacher"].iloc[0]
    rows = frame[frame["method"] == method].assign(good=lambda own: AS_GOOD[task](own, teacher))
    parts = rows.groupby("size").agg(policies=("good", "size"), reached=("good", "mean"), gap=("mean", "median"),
                                     failing=("failing", "max"))  # fmt: skip
    return parts.assign(gap=parts["gap"] - teacher["mean"]).reset_index()


def headline(frames: dict[str, pd.DataFrame], summaries: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """What came out in short: `refined` at the size of the preset, one row per task.

    `frames` are as `read_rows` has them, by task, and `summaries` theirs.

    Columns: task, teacher (its mean return), cells, mean, low, high, reached and failing, as in `seeds_as_good`, rival
    (the best of the other methods with as many cells or leaves), rival mean, and rival reached.
    """
    columns = ["cells", *INTERVAL, "reached", "failing", "rival", "rival mean"]
    found = []
    for task, frame in frames.items():
        table = rivals(summaries[task]).merge(seeds_as_good(task, frame), on="size").rename(columns={"size": "cells"})
        (row,) = table.loc[table["cells"] == tuned_preset(task).n_cells, columns].to_dict("records")
        theirs = seeds_as_good(task, frame, row["rival"]).set_index("size")
        teacher = frame.loc[frame["method"] == "teacher", "mean"].iloc[0]
        found.append({"task": task, "teacher": teacher, **row, "rival reached": theirs.loc[row["cells"], "reached"]})
    return pd.DataFrame(found)


# When a policy is as good as its teacher. SimpleGoal: the mean return within 0.03 and the failures within 0.1 points.
# MountainCar: no failure, and a higher return. Pendulum, where nothing can fail: within one part in a hundred.
# LunarLander: within two.
AS_GOOD = {
    "SimpleGoal-v0": lambda own, teacher: (
        (own["mean"] >= teacher["mean"] - 0.03) & (own["failing"] <= teacher["failing"] + 0.001)
    ),
    "MountainCarContinuous-v0": lambda own, teacher: (own["mean"] > teacher["mean"]) & (own["failing"] == 0),
    "Pendulum-v1": lambda own, teacher: own["mean"] >= teacher["mean"] - 0.01 * abs(teacher["mean"]),
    "LunarLanderContinuous-v3": lambda own, teacher: own["mean"] >= 0.98 * teacher["mean"],
}
