"""Summarise the committed rows of the comparison: means, which policies match their teacher, who acts like it,
and how near policies come to the best possible return, and robots to their teacher's."""

import os

import numpy as np
import pandas as pd
from scipy import stats

from vsp.protocol.intervals import percentile_interval, share_interval

from ..committed import read_results
from .methods import PRESETS

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
    """Summarise the faithful policies of a task, one row per requested number of cells: size; policies (how many);
    cells (median); r2 (median), r2_least (lowest) and r2_worst (median R² of the worst action coordinate); off (share
    of states where an action is off by more than a tenth of its range); mean and failing (medians); like, good and both
    (share of the policies whose R² is at least `LEAST_R2`, that match their teacher by `AS_GOOD`, and that do both);
    low and high (95 % interval of both). Over all pairs of seeds: the medians of index and ratio of `measure.sameness`;
    policies with one cell have no index."""
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
    their teacher)."""
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


# The best possible return, and regret: the best possible mean return minus a policy's

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
    """Return the computed best returns beside the teacher's, one row per task. Columns: task; best (mean return of the
    best policy); error (difference of this mean between two grids; NaN where it is exact); found, worst (lowest return
    of an episode), failing and longest, of the best policy as in `optimum`; teacher (its mean return); regret (of the
    teacher)."""
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
