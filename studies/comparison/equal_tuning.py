"""Compare methods at equal tuning: each with the same number of cells or leaves, before and after; and what they
cost."""

import numpy as np
import pandas as pd

from vsp import get_task, load_teacher, start_states
from vsp.rollouts import visited_states
from vsp_beyond import Faithful, Tuned, faithful_preset, tuned_preset
from vsp_beyond.few_cells import faithful, tune

from ..committed import read_results
from .measure import ERROR_SEED, N_ERROR, in_half_ranges
from .methods import LONG, TABLES
from .summary import AS_GOOD, INTERVAL, OURS, TUNED, ahead, method_summary, read_rows, teacher_of

# By the name in tables: the untuned method; the same method tuned is "..., tuned"
IMITATIONS = {
    OURS: OURS,
    "axis tree, constants": "CART, DAgger",
    "axis tree, linear": "CART, linear leaves, DAgger",
    "oblique tree, constants": "oblique tree, constant leaves, DAgger",
    "oblique tree, linear": "oblique tree, linear leaves, DAgger",
    "k-means cells": "k-means cells, DAgger",
    "small network": "small network, DAgger",
    "one linear map": "one linear map",
}
ONE_MAP = "one linear map, tuned"
SOURCES = ("methods", "tuned", "apart", "faithful", "demanded")  # tables that hold all methods of the shipped teacher
SHOWN = (1, 2, 3, 4, 8, 13)  # sizes of the table
COLUMNS = ["mean", "low", "high", "r2"]


def all_rows(task: str) -> pd.DataFrame:
    """Return the committed rows of `task` for all methods, from the shipped teacher, `with_r2`. Of equal rows, that of
    the last of `SOURCES` counts."""
    frame = pd.concat([read_rows(task, table=table) for table in SOURCES if table in TABLES[task]])
    return with_r2(frame.drop_duplicates(["method", "size", "seed"], keep="last", ignore_index=True), task)


def with_r2(frame: pd.DataFrame, task: str) -> pd.DataFrame:
    """Add a column r2 to `frame`: 1 minus the squared action error divided by that of the best constant action, both in
    the teacher's states of `measure`, which no fit has seen."""
    teacher, about = load_teacher(task), get_task(task)
    states = visited_states(teacher, about, start_states(about, N_ERROR // about.slowness, ERROR_SEED))
    constant = float(np.sqrt(in_half_ranges(teacher, about, states).var(axis=0).mean()))
    return frame.assign(r2=1.0 - np.square(frame["error_teacher"] / constant))


def equal_budget(frame: pd.DataFrame) -> pd.DataFrame:
    """Return one row per size and method of `IMITATIONS`, within a size the best tuned mean return first. `frame` has
    the rows of a task, of all methods, with their r2. Columns: size, method, policies; mean, low, high (its 95 %
    interval) and r2 of the tuned policies; "untuned mean" and so on for the untuned ones. The only method of size 1 is
    one linear map. Sizes without rivals are left out."""
    r2, rows = frame.groupby(["method", "size"])["r2"].median(), []
    table = method_summary(frame).set_index(["method", "size"]).join(r2)
    for size in SHOWN:
        for name, untuned in IMITATIONS.items():
            tuned, cells = f"{untuned}, tuned", 0 if name == "one linear map" else size
            if (size == 1) != (cells == 0) or (tuned, cells) not in table.index:
                continue
            row = {"size": size, "method": name, **table.loc[tuned, cells][["policies", *COLUMNS]]}
            rows.append({**row, **table.loc[untuned, cells][COLUMNS].add_prefix("untuned ")})
    compared = pd.DataFrame(rows).groupby("size").filter(lambda part: set(part["method"]) != {OURS})
    return compared.sort_values(["size", "mean"], ascending=[True, False], kind="stable", ignore_index=True)


def leaders(table: pd.DataFrame) -> pd.DataFrame:
    """Compare our cells with the best other method in an `equal_budget` table, one row per size above 1. Columns: size;
    mean, low, high and policies of our cells; rival (the name of the other method with the highest mean), "rival mean"
    and so on; ahead: "theirs" if some other method is `ahead` of ours, else ours beside the rival; behind, how many of
    the other methods ours are ahead of."""
    compared, columns = [], [*INTERVAL, "policies"]
    for size, rows in table[table["size"] > 1].groupby("size"):
        ours, others = rows[rows["method"] == OURS].iloc[0], rows[rows["method"] != OURS]
        row = {"size": size, **ours[columns], "rival": others["method"].iloc[0]}
        row |= others[columns].iloc[0].add_prefix("rival ")
        pairs = [ahead(ours, other) for _, other in others.iterrows()]
        behind = f"{pairs.count('ours')} of {len(pairs)}"
        compared.append(row | {"ahead": "theirs" if "theirs" in pairs else pairs[0], "behind": behind})
    return pd.DataFrame(compared)


def closest(frame: pd.DataFrame, task: str) -> dict[str, str | float]:
    """Return who acts most like the teacher among those that are as good (`AS_GOOD`), with up to 13 cells or leaves.
    Keys: size, r2 and mean of our faithful policies; rival (the other method), "rival size" and so on."""
    points = possible(frame[(frame["size"] <= SHOWN[-1]) & (frame["method"] != "teacher")])
    good = points[AS_GOOD[task](points, teacher_of(frame))].sort_values("r2")
    ours, rival = (good[good["method"].str.match(kind)].iloc[-1] for kind in ("faithful$", "(?!faithful|our cells)"))
    scores = ["size", "r2", "mean"]
    return {**ours[scores], "rival": rival["method"], **rival[scores].add_prefix("rival ")}


def possible(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the medians over seeds of mean, r2 and failing, one row per method and size."""
    return frame.groupby(["method", "size"], sort=False)[["mean", "r2", "failing"]].median().reset_index()


def fit_and_geometry(task: str) -> pd.DataFrame:
    """Return the table "apart", which separates fit from geometry, one row per method. Columns: method; "r2 2" and so
    on (the median r2 at that size); "mean 2" and so on (the median mean return)."""
    rows = with_r2(read_rows(task, table="apart"), task)
    table = rows.groupby(["method", "size"], sort=False)[["r2", "mean"]].median().unstack("size")
    table.columns = [f"{what} {size}" for what, size in table.columns]
    return table.reset_index()


def budgets(task: str) -> pd.DataFrame:
    """Count the episodes of every kind that our policies and one tuned linear map need, and their seconds on one core.
    Columns: method, size (the preset's); numbers of episodes: teacher (played by the teacher), correction (played by
    the policy, labelled by the teacher), tuning and validation (played by candidates); seconds (median over the seeds).
    Faithful policies are tuned only if they return too little, so their tuning episodes are an upper bound."""
    long = "_long" * (task in LONG)
    times = pd.concat([read_results(f"{table}_seconds{long}") for table in ("methods", "tuned", "faithful")])
    seconds = times[times["task"] == task].groupby(["method", "size"])["seconds"].median()
    close, config = faithful_preset(task), tuned_preset(task)
    sizes = {"faithful": close.n_cells, TUNED: config.n_cells, ONE_MAP: 0}
    return pd.DataFrame([
        {"method": f"{OURS}, faithful" if method == "faithful" else method, "size": size or 1}
        | episodes(method, close if method == "faithful" else config, task) | {"seconds": seconds[method, size]}
        for method, size in sizes.items()
    ])  # fmt: skip


def episodes(method: str, config: Tuned | Faithful, task: str) -> dict[str, int]:
    """Count the episodes of "faithful", `TUNED` or `ONE_MAP` with the settings `config`, by kind."""
    k, d, m = config.n_cells, len(get_task(task).low), len(get_task(task).action_low)
    numbers = (d + 1) * m if method == ONE_MAP else k * d + k * (d + 1) * m
    # CMA-ES chooses the number of candidates by that of the numbers it tunes
    tuning = config.n_generations * tune.candidates_per_generation(numbers) * config.n_tuning_episodes
    if isinstance(config, Faithful):
        by_teacher = config.n_episodes + config.n_validation + faithful.POOL * config.n_tuning_episodes
        labelled, candidates = 0, 1 + faithful.SNAPSHOTS
    else:
        labels = config.n_corrections * config.n_correction_episodes
        snapshots = min(tune.SNAPSHOTS, config.n_generations)
        if method == ONE_MAP:
            by_teacher, labelled, candidates = config.n_episodes + labels, 0, 2 + snapshots
        else:  # the first candidate of `distill_tuned` is one linear map
            by_teacher, labelled = config.n_episodes, labels
            candidates = 1 + config.n_restarts + config.n_corrections + snapshots
    validation = candidates * config.n_validation
    return {"teacher": by_teacher, "correction": labelled, "tuning": tuning, "validation": validation}
