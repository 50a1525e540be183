"""Compare methods at equal tuning: each with the same number of cells or leaves, before and after tuning.

Also count what each method costs: episodes of every kind, and seconds.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from vsp import get_task, load_teacher, start_states, visited_states
from vsp_beyond import Faithful, Tuned, faithful_preset, tuned_preset
from vsp_beyond.few_cells import faithful, tune

from ..results import read_results
from ..rivals.small_network import units_for
from .makers import numbers_of
from .measure import ERROR_SEED, N_ERROR
from .methods import LONG, METHODS, TABLES
from .summary import INTERVAL, OURS, ahead, method_summary, read_rows

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
COSTED = (OURS, "oblique tree, linear", "small network", "one linear map")  # of these, costs are told
SOURCES = ("methods", "tuned", "apart", "faithful", "demanded")  # tables that hold all methods of the shipped teacher
SHOWN = (1, 2, 3, 4, 8, 13)  # sizes of the table
COLUMNS = ("mean", "low", "high", "r2")


def all_rows(task: str) -> pd.DataFrame:
    """Return the committed rows of `task` for all methods, from the shipped teacher, `with_r2`.

    Each method, size and seed occurs once: the last of `SOURCES` that has it counts.
    """
    frame = pd.concat([read_rows(task, table=table) for table in SOURCES if table in TABLES[task]])
    return with_r2(frame.drop_duplicates(["method", "size", "seed"], keep="last", ignore_index=True), task)


def with_r2(frame: pd.DataFrame, task: str) -> pd.DataFrame:
    """Add a column r2 to `frame`: 1 minus the squared action error divided by that of the best constant action.

    Both errors are measured in the teacher's states of `measure`, which no fit has seen. `likeness` gives R² on more
    states.
    """
    teacher, about = load_teacher(task), get_task(task)
    states = visited_states(teacher, about, start_states(about, N_ERROR // about.slowness, ERROR_SEED))
    half = 0.5 * (about.action_high - about.action_low)
    constant = float(np.sqrt((np.asarray(teacher.predict(states)[0], dtype=np.float64) / half).var(axis=0).mean()))
    return frame.assign(r2=1.0 - np.square(frame["error_teacher"] / constant))


def equal_budget(frame: pd.DataFrame) -> pd.DataFrame:
    """Return one row per size and method of `IMITATIONS`, within a size the best tuned mean return first.

    `frame` has the rows of a task, of all methods, with their r2. Columns: size, method, policies; mean,
    low, high (its 95 % interval) and r2 of the tuned policies; "untuned mean" and so on for the untuned ones. The only
    method of size 1 is one linear map. Sizes without rivals are left out.
    """
    table, rows = method_summary(frame).set_index(["method", "size"]), []
    r2 = frame.groupby(["method", "size"])["r2"].median()
    for size in SHOWN:
        for name, untuned in IMITATIONS.items():
            tuned, cells = f"{untuned}, tuned", 0 if name == "one linear map" else size
            if (size == 1) != (cells == 0) or (tuned, cells) not in table.index:
                continue
            row = {"size": size, "method": name, **table.loc[tuned, cells][["policies"]]}
            for prefix, method in (("", tuned), ("untuned ", untuned)):
                scores = table.loc[method, cells].to_dict() | {"r2": r2[method, cells]}
                row |= {prefix + column: scores[column] for column in COLUMNS}
            rows.append(row)
    compared = pd.DataFrame(rows).groupby("size").filter(lambda part: set(part["method"]) != {OURS})
    return compared.sort_values(["size", "mean"], ascending=[True, False], kind="stable", ignore_index=True)


def leaders(table: pd.DataFrame) -> pd.DataFrame:
    """Compare our cells with the best other method in an `equal_budget` table, one row per size above 1.

    Columns: size; mean, low, high and policies of our cells; rival (the name of the other method with the highest
    mean), "rival mean" and so on; ahead: "ours" if our interval is above those of all others, "theirs" if one of theirs
    is above ours, else "level".
    """
    compared, columns = [], [*INTERVAL, "policies"]
    for size, rows in table[table["size"] > 1].groupby("size"):
        ours, others = rows[rows["method"] == OURS].iloc[0], rows[rows["method"] != OURS]
        row = {"size": size, **ours[columns], "rival": others["method"].iloc[0]}
        row |= {f"rival {column}": others[column].iloc[0] for column in columns}
        compared.append(row | {"ahead": ahead(ours, others[["low", "high"]].max())})
    return pd.DataFrame(compared)


def possible(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the medians over seeds for the plot of return against fidelity, one row per method and size."""
    return frame.groupby(["method", "size"], sort=False)[["mean", "r2"]].median().reset_index()


def tail(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the worst returns beside the mean, one row per method and size of `all_rows` that has them.

    Columns: method, size; mean, worst (the mean return of the worst `measure.TAIL` of the episodes) and failing, each
    as a mean over the seeds.
    """
    table = frame[frame["worst"].notna()].groupby(["method", "size"])[["mean", "worst", "failing"]].mean()
    names = {f"{untuned}, tuned": f"{name}, tuned" for name, untuned in IMITATIONS.items()}
    table = table.rename(index=names | {"faithful": f"{OURS}, faithful"})
    return table.sort_values("mean", ascending=False, kind="stable").reset_index()


def fit_and_geometry(task: str) -> pd.DataFrame:
    """Return the table "apart", which separates fit from geometry and adds newer methods, one row per method.

    Columns: method; "r2 2" and so on (the median r2 at that size); "mean 2" and so on (the median mean return).
    """
    rows = with_r2(read_rows(task, table="apart"), task)
    table = rows.groupby(["method", "size"], sort=False)[["r2", "mean"]].median().unstack("size")
    table.columns = [f"{what} {size}" for what, size in table.columns]
    return table.reset_index()


def budgets(task: str) -> pd.DataFrame:
    """Count the episodes of every kind that a policy of the preset's size needs, and its seconds on one core.

    One row per method of `COSTED`, the faithful one first. Columns: method, size; numbers of episodes: teacher (played
    by the teacher), correction (played by the policy, labelled by the teacher), tuning and validation (played by
    candidates); seconds (median over the seeds). Faithful policies are tuned only if they return too little, so their
    tuning episodes are an upper bound.
    """
    config, close, seconds = tuned_preset(task), faithful_preset(task), _seconds(task)
    cost = {**_of_faithful(close, task), "seconds": seconds["faithful", close.n_cells]}
    rows = [{"method": f"{OURS}, faithful", "size": close.n_cells, **cost}]
    for name in COSTED:
        method, size = f"{IMITATIONS[name]}, tuned", 0 if name == "one linear map" else config.n_cells
        if (method, size) in seconds:
            cost = {**episodes(name, config, task), "seconds": seconds[method, size]}
            rows.append({"method": f"{name}, tuned", "size": size or 1, **cost})
    return pd.DataFrame(rows)


def _seconds(task: str) -> pd.Series:
    """Return the median seconds by method and size, from all committed tables of times."""
    long = "_long" * (task in LONG)
    frame = pd.concat([read_results(f"{table}_seconds{long}") for table in ("methods", "tuned", "faithful")])
    return frame[frame["task"] == task].groupby(["method", "size"])["seconds"].median()


def episodes(name: str, config: Tuned, task: str) -> dict[str, int]:
    """Count the episodes of a method of `COSTED` with the settings `config`, tuning included.

    Keys: teacher, correction, tuning, validation.
    """
    if name == OURS:  # the first candidate of `distill_tuned` is one linear map
        rounds, candidates = config.n_corrections, 1 + config.n_restarts + config.n_corrections
    else:
        method = METHODS[IMITATIONS[name]]
        rounds = method.settings.get("rounds", 0)
        candidates = rounds + (config.n_restarts if "n_restarts" in method.reads else 1) + 1
    n = config.n_corrections * config.n_correction_episodes
    return {
        "teacher": config.n_episodes + (0 if rounds else n),
        "correction": n if rounds else 0,
        "tuning": _tuning(config, _tuned_numbers(name, config.n_cells, task)),
        "validation": (candidates + min(tune.SNAPSHOTS, config.n_generations)) * config.n_validation,
    }


def _of_faithful(config: Faithful, task: str) -> dict[str, int]:
    return {
        "teacher": config.n_episodes + config.n_validation + faithful.POOL * config.n_tuning_episodes,
        "correction": 0,
        "tuning": _tuning(config, _tuned_numbers(OURS, config.n_cells, task)),
        "validation": (1 + faithful.SNAPSHOTS) * config.n_validation,
    }


def _tuning(config: Tuned | Faithful, numbers: int) -> int:
    """Count the episodes of all generations. CMA-ES chooses the number of candidates by that of the tuned `numbers`."""
    return config.n_generations * tune.candidates_per_generation(numbers) * config.n_tuning_episodes


def _tuned_numbers(name: str, k: int, task: str) -> int:
    """Return how many numbers are tuned in a method of `COSTED` with k cells or leaves."""
    about = get_task(task)
    d, m = len(about.low), len(about.action_low)
    maps, units = k * (d + 1) * m, units_for(numbers_of(k, about), about)
    return {
        OURS: k * d + maps,
        "oblique tree, linear": (k - 1) * (d + 1) + maps,
        "small network": (d + 1) * units + (units + 1) * m,
        "one linear map": (d + 1) * m,
    }[name]
