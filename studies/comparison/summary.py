"""Summarise the committed rows of the comparison: means, which policies match their teacher, and who acts like it."""

import os

import numpy as np
import pandas as pd
from scipy import stats

from vsp.protocol.intervals import percentile_interval, share_interval

from ..committed import read_results

OURS, TUNED = "our cells", "our cells, tuned"
MEANS = ("failing", "error_teacher", "error_own", "cells")
INTERVAL = ("mean", "low", "high")
# When a policy matches its teacher. SimpleGoal: the mean return is at most 0.03 lower, and the failures at most 0.1
# percentage points more. MountainCar: no failure, and a higher mean return. Pendulum, where nothing can fail: the mean
# return is at most 1 % lower. LunarLander: at most 2 % lower.
AS_GOOD = {
    "SimpleGoal-v0": lambda rows, teacher: (
        (rows["mean"] >= teacher["mean"] - 0.03) & (rows["failing"] <= teacher["failing"] + 0.001)
    ),
    "MountainCarContinuous-v0": lambda rows, teacher: (rows["mean"] > teacher["mean"]) & (rows["failing"] == 0),
    "Pendulum-v1": lambda rows, teacher: rows["mean"] >= teacher["mean"] - 0.01 * abs(teacher["mean"]),
    "LunarLanderContinuous-v3": lambda rows, teacher: rows["mean"] >= 0.98 * teacher["mean"],
}
LEAST_R2 = {"SimpleGoal-v0": 0.95, "MountainCarContinuous-v0": 0.97, "Pendulum-v1": 0.95,
            "LunarLanderContinuous-v3": 0.9}  # fmt: skip
SAME_CELLS = 0.9  # least median adjusted Rand index over pairs of seeds for cells to count as the same
# The tuned method, whole and with one part removed or changed
PARTS = {TUNED: "all parts"} | {
    OURS if part == "no tuning" else f"{OURS}, {part}": part
    for part in ("no annealing", "one restart", "no correction", "no slope beyond the limits", "no tuning",
                 "no failure penalty", "no teacher", "weighted by criticality")
}  # fmt: skip


def read_rows(task: str, folder: str | os.PathLike | None = None, *, table: str = "methods") -> pd.DataFrame:
    """Read the rows of `task` in a table, by default the committed ones, or those in `folder`. `failing` is NaN for a
    task where no policy can reach a goal."""
    frame = read_results(f"{table}_{task}", folder)
    return frame.assign(failing=np.nan) if (frame["failing"] == 1).all() else frame


def teacher_of(rows: pd.DataFrame) -> pd.Series:
    """Return the row of the teacher."""
    return rows[rows["method"] == "teacher"].iloc[0]


def method_summary(frame: pd.DataFrame) -> pd.DataFrame:
    """Summarise rows of `read_rows`: one row per method and size, within a size the best mean return first. Columns:
    method, size, policies (how many), mean, low and high (its 95 % interval, for other seeds), median; and failing,
    error_teacher, error_own, cells (means over the seeds)."""
    table = []
    for (method, size), rows in frame.groupby(["method", "size"], sort=False):
        low, high = mean_interval(rows["mean"].to_numpy())
        scores = {"mean": rows["mean"].mean(), "low": low, "high": high, "median": rows["mean"].median()}
        means = {name: rows[name].mean() for name in MEANS}
        table.append({"method": method, "size": size, "policies": len(rows), **scores, **means})
    order = {"by": ["size", "mean"], "ascending": [True, False], "kind": "stable", "ignore_index": True}
    return pd.DataFrame(table).sort_values(**order)


def mean_interval(values: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval (Student's t) of the mean of `values` (n,) over other seeds; NaN for a single value. Of
    three or five seeds a bootstrap interval would be too narrow."""
    if len(values) < 2:
        return np.nan, np.nan
    half = stats.t.ppf(0.975, len(values) - 1) * stats.sem(values)
    return values.mean() - half, values.mean() + half


def ahead(ours: pd.Series, other: pd.Series) -> str:
    """Return which mean is higher, "ours" or "theirs", if Welch's t-test tells them apart (p < 0.05), else "cannot be
    told". Both are rows of `method_summary`."""
    sides = []
    for row in (ours, other):
        error = (row["high"] - row["mean"]) / stats.t.ppf(0.975, row["policies"] - 1)
        sides += [row["mean"], error * np.sqrt(row["policies"]), row["policies"]]
    told = stats.ttest_ind_from_stats(*sides, equal_var=False).pvalue < 0.05
    return "cannot be told" if not told else "ours" if ours["mean"] > other["mean"] else "theirs"


def ablation(frame: pd.DataFrame) -> pd.DataFrame:
    """Summarise our tuned cells, complete and with one part removed, at the size of the preset. Columns are those of
    `method_summary`, and `part`: what was removed, in the words and the order of `PARTS`."""
    size = frame.loc[frame["method"] == "our cells, one restart", "size"].iloc[0]
    table = method_summary(frame[(frame["size"] == size) & frame["method"].isin(PARTS)]).set_index("method")
    return table.loc[[name for name in PARTS if name in table.index]].reset_index().assign(
        part=lambda rows: rows["method"].map(PARTS)
    )  # fmt: skip


# Policies that act like their teacher


def likeness(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Summarise the faithful policies of a task, one row per requested number of cells.

    Columns: size; policies (how many); cells (median); r2 (median), r2_least (lowest) and r2_worst (median R² of the
    worst action coordinate); off (share of states where an action is off by more than a tenth of its range); mean and
    failing (medians); like, good and both (share of the policies whose R² is at least `LEAST_R2`, share that match
    their teacher by `AS_GOOD`, and share that do both); low and high (95 % interval of both).

    Over all pairs of seeds: the medians of index (adjusted Rand index of their cells; policies with one cell are left
    out) and of ratio (difference between their actions, divided by their difference from the teacher's).
    """
    rows, pairs = read_rows(task, folder, table="faithful"), read_results(f"same_{task}", folder)
    rows = rows.assign(like=rows["r2"] >= LEAST_R2[task], good=AS_GOOD[task](rows, teacher_of(read_rows(task, folder))))
    rows = rows.assign(both=rows["like"] & rows["good"])
    by_size, by_pair = rows.groupby("size"), pairs.groupby("size")
    table = by_size[["cells", "r2", "r2_worst", "off", "mean", "failing"]].median()
    table.insert(0, "policies", by_size.size())
    table.insert(3, "r2_least", by_size["r2"].min())
    table[["like", "good", "both"]] = by_size[["like", "good", "both"]].mean()
    table[["low", "high"]] = [share_interval(int(both.sum()), len(both)) for _, both in by_size["both"]]
    return table.join(by_pair[["index", "ratio"]].median()).reset_index()


def largest_alike(table: pd.DataFrame) -> int | None:
    """Return the largest size up to which the median pair of seeds has the same cells, or None. `table` is that of
    `likeness`. Cells count as the same if their index is at least `SAME_CELLS`."""
    known = table[table["index"].notna()]
    alike = known.loc[(known["index"] >= SAME_CELLS).cummin(), "size"]
    return int(alike.iloc[-1]) if len(alike) else None


def other_teachers(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Compare the methods across all teachers of a task: for each method a row per teacher, then one over all teachers.

    Columns: teacher (0: the shipped one; "all"), own (the teacher's mean return), method, size, policies, gap (mean
    return minus the teacher's, the mean over seeds), low and high (95 % interval of the gap by `mean_interval`, over
    all teachers by `over_groups`), r2 (median; NaN where it was not measured), good (share of the policies that match
    their teacher).
    """
    others = read_rows(task, folder, table="teachers")
    asked = others[["method", "size"]].drop_duplicates()
    shipped = [read_rows(task, folder, table=table) for table in ("methods", "tuned", "faithful")]
    rows = pd.concat([pd.concat(shipped).merge(asked).assign(agent=0), others], ignore_index=True)
    teachers = rows[rows["method"] == "teacher"].set_index("agent")
    own = rows["agent"].map(teachers["mean"])
    good = pd.concat([AS_GOOD[task](part, teachers.loc[agent]) for agent, part in rows.groupby("agent")])
    rows = rows.assign(gap=rows["mean"] - own, own=own, good=good)[rows["method"] != "teacher"]
    table = []
    for (method, size), of_method in rows.groupby(["method", "size"], sort=False):
        by_teacher = [part for _, part in of_method.groupby("agent")]
        for part in by_teacher:
            about = {"teacher": part["agent"].iloc[0], "own": part["own"].iloc[0], "method": method, "size": size}
            table.append({**about, **_of_gaps([part])})
        table.append({"teacher": "all", "method": method, "size": size, **_of_gaps(by_teacher)})
    return pd.DataFrame(table)


def _of_gaps(groups: list[pd.DataFrame]) -> dict[str, float]:
    """Summarise the rows of some teachers, each group with equal weight."""
    gaps = [rows["gap"].to_numpy() for rows in groups]
    low, high = over_groups(gaps) if len(gaps) > 1 else mean_interval(gaps[0])
    r2, (mean, good) = pd.concat(groups)["r2"], np.mean([rows[["gap", "good"]].mean() for rows in groups], axis=0)
    return {"policies": len(r2), "gap": mean, "low": low, "high": high, "r2": r2.dropna().median(), "good": good}


def over_groups(groups: list[np.ndarray]) -> tuple[float, float]:
    """Return the percentile bootstrap interval (95 %) of the mean of the groups' means. Resamples the groups, such as
    teachers, and the values within each, such as policies. With few groups the interval understates how much another
    group may differ."""
    rng, n = np.random.default_rng(0), len(groups)
    means = [group[rng.integers(len(group), size=(2000, n, len(group)))].mean(axis=2) for group in groups]
    drawn = rng.integers(n, size=(2000, n))
    return percentile_interval(np.take_along_axis(np.stack(means), drawn[None], axis=0)[0].mean(axis=1))
