"""Summarise whether policies act like their teacher, match its return, and are the same for every seed."""

from __future__ import annotations

import os

import numpy as np
import pandas as pd

from studies.results import read_results
from vsp.paper.statistics import percentile_interval, share_interval

from .method_summary import AS_GOOD, mean_interval, read_rows

LEAST_R2 = {
    "SimpleGoal-v0": 0.95,
    "MountainCarContinuous-v0": 0.97,
    "Pendulum-v1": 0.95,
    "LunarLanderContinuous-v3": 0.9,
}
SAME_CELLS = 0.9  # least median adjusted Rand index over pairs of seeds for cells to count as the same


def likeness(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Summarise the faithful policies of a task, one row per requested number of cells.

    Columns: size; policies (how many); cells (median); r2 (median), r2_least (lowest) and r2_worst (median R² of the
    worst action coordinate); off (share of states where an action is off by more than a tenth of its range); mean and
    failing (medians); like, good and both (share of the policies whose R² is at least `LEAST_R2`, share that match
    their teacher by `AS_GOOD`, and share that do both); low and high (95 % interval of both).

    Over all pairs of seeds: index and index_least (median and lowest adjusted Rand index of their cells) and ratio
    (median of the difference between their actions, divided by their difference from the teacher's). one_cell is the
    number of policies with one cell; the index leaves them out.
    """
    rows, pairs = read_rows(task, folder, table="faithful"), read_results(f"same_{task}", folder)
    every = read_rows(task, folder)
    teacher = every[every["method"] == "teacher"].iloc[0]
    rows = rows.assign(like=rows["r2"] >= LEAST_R2[task], good=AS_GOOD[task](rows, teacher))
    rows = rows.assign(both=rows["like"] & rows["good"], one_cell=rows["cells"] == 1)
    by_size, by_pair = rows.groupby("size"), pairs.groupby("size")
    table = by_size[["cells", "r2", "r2_worst", "off", "mean", "failing"]].median()
    table.insert(0, "policies", by_size.size())
    table.insert(3, "r2_least", by_size["r2"].min())
    table[["like", "good", "both"]] = by_size[["like", "good", "both"]].mean()
    bounds = [share_interval(int(own["both"].sum()), len(own)) for _, own in by_size]
    table["low"], table["high"] = zip(*bounds)
    table["index"], table["index_least"] = by_pair["index"].median(), by_pair["index"].min()
    table["ratio"], table["one_cell"] = by_pair["ratio"].median(), by_size["one_cell"].sum()
    return table.reset_index()


def largest_alike(table: pd.DataFrame) -> int | None:
    """Return the largest size up to which the median pair of seeds has the same cells, or None.

    `table` is that of `likeness`. Cells count as the same if their index is at least `SAME_CELLS`.
    """
    found = None
    for size, index in table.loc[table["index"].notna(), ["size", "index"]].to_numpy():
        if index < SAME_CELLS:
            break
        found = int(size)
    return found


def other_teachers(task: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Compare the methods across all teachers of a task: for each method a row per teacher, then one over all teachers.

    Columns: teacher (0: the shipped one; "all"), own (the teacher's mean return), method, size, policies, gap (mean
    return minus the teacher's, the mean over seeds), low and high (95 % interval of the gap by `mean_interval`, over
    all teachers by `over_groups`), r2 (median; NaN where it was not measured), good (share of the policies that match
    their teacher), good_low and good_high (interval of this share for one teacher, by `share_interval`).
    """
    others = read_rows(task, folder, table="teachers")
    asked = others[["method", "size"]].drop_duplicates()
    shipped = [read_rows(task, folder, table=table) for table in ("methods", "tuned", "faithful")]
    rows = pd.concat([pd.concat(shipped).merge(asked).assign(agent=0), others], ignore_index=True)
    teachers = rows[rows["method"] == "teacher"].set_index("agent")
    own = rows["agent"].map(teachers["mean"])
    good = pd.concat([AS_GOOD[task](part, teachers.loc[agent]) for agent, part in rows.groupby("agent")])
    rows = rows.assign(gap=rows["mean"] - own, own=own, good=good)[rows["method"] != "teacher"]
    found = []
    for (method, size), of_method in rows.groupby(["method", "size"], sort=False):
        by_teacher = [part for _, part in of_method.groupby("agent")]
        for part in by_teacher:
            good_low, good_high = share_interval(int(part["good"].sum()), len(part))
            shares = {"good": part["good"].mean(), "good_low": good_low, "good_high": good_high}
            about = {"teacher": part["agent"].iloc[0], "own": part["own"].iloc[0], "method": method, "size": size}
            found.append({**about, **_of_gaps([part]), **shares})
        shares = {"good": np.mean([part["good"].mean() for part in by_teacher])}
        found.append({"teacher": "all", "method": method, "size": size, **_of_gaps(by_teacher), **shares})
    return pd.DataFrame(found)


def _of_gaps(groups: list[pd.DataFrame]) -> dict[str, float]:
    """Summarise the rows of some teachers, each group with equal weight."""
    gaps = [rows["gap"].to_numpy() for rows in groups]
    low, high = over_groups(gaps) if len(gaps) > 1 else mean_interval(gaps[0])
    r2 = pd.concat(groups)["r2"]
    return {
        "policies": len(r2),
        "gap": np.mean([rows["gap"].mean() for rows in groups]),
        "low": low,
        "high": high,
        "r2": r2.median() if r2.notna().any() else np.nan,
    }


def over_groups(groups: list[np.ndarray]) -> tuple[float, float]:
    """Return the percentile bootstrap interval (95 %) of the mean of the groups' means.

    Resamples the groups, such as teachers, and the values within each, such as policies. With few groups the interval
    understates how much another group may differ.
    """
    rng, n = np.random.default_rng(0), len(groups)
    means = [group[rng.integers(len(group), size=(2000, n, len(group)))].mean(axis=2) for group in groups]
    drawn = rng.integers(n, size=(2000, n))
    return percentile_interval(np.take_along_axis(np.stack(means), drawn[None], axis=0)[0].mean(axis=1))
