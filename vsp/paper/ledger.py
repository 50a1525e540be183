"""The ledger: every value that the paper prints, the rerun's value and interval, and a verdict by stated rules.

Rules:

1. A value that is inconsistent with the paper's other values "contradicts itself" (`audit` has the arithmetic).
2. A setting (a limit of a task, a hyperparameter, a count of the protocol) is "reproduced" if the code uses the same
   number, else "differs".
3. A result is "reproduced" if the printed value, plus or minus half a unit of its last digit, lies in the rerun's 95 %
   interval; else it "differs". The interval is widened by the square root of 2, because the paper's value comes from a
   sample of the same size. Intervals come from 1000 resamples of runs *and* start states; of start states alone for the
   one teacher.
   The cells of the best run are those of one run: they are set against the middle 95 % of the rerun's runs.
4. A result "cannot be told" if the printed value lies in an interval that, widened, is longer than the standard
   deviation of what is counted: for returns the printed one, for a share that of one episode. Such an interval contains
   nearly anything.
5. A lowest or highest value has no such interval. It "differs" if at least `BEYOND` of the rerun's runs, from as many
   starts, go beyond the printed value: were the paper's runs of the same kind, none of theirs would go so far by chance
   once in 2 ** `BEYOND` times. Else it "cannot be told".
6. A value that no rerun can show, or that is not measured here (the parameters of one run, the machine), "cannot be
   checked".

Each fact counts once (`FOLLOWS`). `studies.reproduction.verdicts` measures how often these rules are wrong.
"""

import numpy as np
import pandas as pd

from ..config import paper_preset
from ..evaluation import fences
from ..tasks import base, mountaincar, registry, simplegoal
from . import audit, printed
from .runs import Results, Run
from .statistics import outlier_numbers, resample, spread

VERDICTS = REPRODUCED, UNTOLD, DIFFERS, UNCHECKED, CONTRADICTED = (
    "reproduced", "cannot be told", "differs", "cannot be checked", "contradicts itself"
)  # fmt: skip
N_RESAMPLES = 1000
BEYOND = 6
EXTREME = "(?:^|_)(?:min|max)$"  # ids of lowest and highest values
# Results that follow from others, or are printed again elsewhere: interquartile range, coverage, the share of the
# outliers on the other side, the lowest outlier, and in the text the mean, deviation and extremes of the tables
FOLLOWS = "_(?:iqr|coverage|outliers_above_share|outliers_min|caption_cells)$|^.._(?:drl|ours)_(?:mean|std|min|max)$"
CHOSEN = "^sg_(?:spread_)?drl_"  # results of SimpleGoal's teacher, whose recipe was chosen with its return known
# Parts of the paper by patterns of ids; the first match counts
PARTS = {
    "_cell_": "coefficients",
    "_(?:spread|drl|ours)_(?!episodes)|^.._(?:caption_)?cells$": "results",
    "": "settings",
}
# The notebook and the cell that compute the rerun's number, in the same way
CELLS = {
    "^.._(?:caption_)?cells$": "03, best", "^.._(?:caption|text|policies)": "03, runs",
    "_hyper_": "04, hyperparameters", "^sg_spread_": "04, simplegoal-spread", "^mc_spread_": "04, mountaincar-spread",
    "^.._(?:drl|ours)_": "04, text-numbers", "_cell_": "05, replay", "": "05, ledger",
}  # fmt: skip
# The results that the notebook shows, in words
_WORDS = {"mean": "mean", "std": "standard deviation", "q1": "first quartile"}
_WORDS |= {"median": "median", "q3": "third quartile"}
SHOWN = {f"spread_{who}_{name}": words for who in ("drl", "ours") for name, words in _WORDS.items()}
SHOWN |= {"spread_ours_coverage": "share of non-outliers", "cells": "cells of the best"}
COLUMNS = "id part fact task where quantity subject paper value here low high verdict cell".split()


def ledger_table(results: dict[str, Results], *, n_resamples: int = N_RESAMPLES) -> pd.DataFrame:
    """Return one row per printed value, with columns `COLUMNS`; `results` by task. The same results give the same rows.
    `here` is the rerun's value, NaN where there is none; `low` and `high` are NaN for settings. Column `cell` names the
    notebook and the cell that computes it."""
    settings = pd.DataFrame.from_dict(_settings(results), orient="index", columns=["here"])
    parts = [measured(task, result, n_resamples=n_resamples) for task, result in results.items()]
    frame = printed.printed_values().join(pd.concat([settings, *parts]), on="id")
    frame["verdict"] = verdicts(frame, in_doubt=frame["id"].isin(audit.in_doubt()))
    frame["part"] = _first_match(frame["id"], PARTS)
    frame["fact"] = (frame["part"] == "results") & ~frame["id"].str.contains(FOLLOWS)
    frame["cell"] = _first_match(frame["id"], CELLS)
    return frame[COLUMNS]


def _first_match(ids: pd.Series, values: dict[str, str]) -> np.ndarray:
    return np.select([ids.str.contains(pattern) for pattern in values], list(values.values()), "")


def verdict_counts(book: pd.DataFrame) -> pd.DataFrame:
    """Count settings and coefficients by verdict, and each fact once: of SimpleGoal's teacher, whose recipe was chosen
    with its return known, of MountainCar's, and of the distilled policies."""
    facts = book[book["fact"]]
    of_teacher, chosen = facts["subject"] == "DRL", facts["id"].str.contains(CHOSEN)
    groups = {
        "distilled policies": facts[~of_teacher], "MountainCar's teacher": facts[of_teacher & ~chosen],
        "SimpleGoal's teacher (chosen)": facts[chosen], "settings": book[book["part"] == "settings"],
        "coefficients": book[book["part"] == "coefficients"],
    }  # fmt: skip
    table = pd.DataFrame({name: rows["verdict"].value_counts() for name, rows in groups.items()}).T
    return table.reindex(columns=VERDICTS).fillna(0).astype(int).rename_axis("of").reset_index()


def wrong_verdicts(frame: pd.DataFrame) -> pd.DataFrame:
    """Return how often "differs" is the verdict, in percent of the pairs of samples: one row per kind of result.
    Columns: kind; of the same runs the mean over the results of a kind, and the highest; for runs that are known to be
    others, by what changed, the highest."""
    told = frame[frame["cannot be checked"] < 1].assign(differs=100 * frame["differs"])
    same, others = (told[(told["against"] == "the same") == side] for side in (True, False))
    shares = same.groupby("kind", sort=False)["differs"].agg(["mean", "max"])
    names = {"mean": "the same runs, mean", "max": "the same runs, highest"}
    highest = others.groupby(["kind", "against"])["differs"].max().unstack()
    return shares.rename(columns=names).join(highest).rename_axis(columns=None).reset_index()


def verdicts(rows: pd.DataFrame, *, in_doubt: pd.Series) -> np.ndarray:
    """Return the verdicts by this module's rules; `rows` have paper (as printed), value, here, low, high, beyond (of
    extremes: how many runs go beyond the value) and unit (the deviation of what is counted; NaN for one run's value).
    """
    here, half = rows["here"], 0.5 * rows["paper"].map(last_digit)
    wider = np.where(rows["unit"].isna(), 1.0, np.sqrt(2))
    low, high = here - wider * (here - rows["low"]), here + wider * (rows["high"] - here)
    extreme = rows["beyond"].notna()
    same = rows["low"].isna() & ~extreme & np.isclose(here, rows["value"], rtol=1e-9)
    inside = rows["value"].between(low - half, high + half)  # false for settings, which have no interval
    beyond = np.where(extreme, rows["beyond"] >= BEYOND, ~same & ~inside)
    untold = extreme | (high - low > rows["unit"])
    rules = {CONTRADICTED: in_doubt, UNCHECKED: here.isna(), DIFFERS: beyond, UNTOLD: untold}
    return np.select([*rules.values()], [*rules], REPRODUCED)  # the first that applies


def last_digit(printed: str) -> float:
    """One unit of the last digit of a number as printed: 0.01 for "12.30" and "86.17%"."""
    return 10.0 ** -len(printed.rstrip("%").partition(".")[2])


def measured(task: str, result: Results, *, n_resamples: int = N_RESAMPLES) -> pd.DataFrame:
    """Return the rerun's results under the ids of the paper's values: the columns of `set_against`."""
    values, prefix, parts = printed.printed_values().set_index("id")["value"], printed.PREFIX[task], []
    for subject, returns in (("drl", result.teacher_returns[None]), ("ours", result.returns)):
        here, std = of_returns(returns, n_resamples=n_resamples), values[f"{prefix}_spread_{subject}_std"]
        for begin in (f"{prefix}_{subject}_", f"{prefix}_spread_{subject}_"):
            own = values[values.index.str.startswith(begin)].rename(lambda id, begin=begin: id.removeprefix(begin))
            parts.append(set_against(here, returns, own, std).rename(lambda name, begin=begin: begin + name))
    cells = of_cells(means_and_cells(result.runs))
    return pd.concat([*parts, cells.set_axis([f"{prefix}_cells"]), cells.set_axis([f"{prefix}_caption_cells"])])


def means_and_cells(runs: list[Run]) -> np.ndarray:
    """Return of each run the mean return on the validation starts, and the number of cells. (p, 2)"""
    return np.array([(run.validation_mean, len(run.policy)) for run in runs])


def of_cells(runs: np.ndarray) -> pd.DataFrame:
    """Return the cells of the best of some runs, given as `means_and_cells` (p, 2): one row "cells", with the middle
    95 % of the runs, because the best is one of them; so it has no unit."""
    low, high = np.quantile(runs[:, 1], [0.025, 0.975])
    return pd.DataFrame({"here": runs[runs[:, 0].argmax(), 1], "low": low, "high": high}, index=["cells"])


def of_returns(returns: np.ndarray, *, n_resamples: int = N_RESAMPLES) -> pd.DataFrame:
    """Return the statistics of returns (p, n), one row each: columns here, low and high (95 %; NaN for extremes)."""
    here = outlier_numbers(returns) | spread(returns)
    here["coverage"] *= 100
    ends = resample(returns, n_resamples=n_resamples).quantile([0.025, 0.975]).T.set_axis(["low", "high"], axis=1)
    ends.loc["outliers"] = np.floor(ends.at["outliers", "low"]), np.ceil(ends.at["outliers", "high"])
    frame = pd.DataFrame({"here": here}).join(ends)
    return frame.where(frame["here"].notna() & ~frame.index.str.contains(EXTREME), frame[["here"]])


def set_against(found: pd.DataFrame, returns: np.ndarray, values: pd.Series, std: float) -> pd.DataFrame:
    """Add to what `of_returns` found of `returns` (p, n) the columns beyond and unit, as `verdicts` needs them.
    `values` are the paper's by name; `std` is its standard deviation of the returns."""
    frame = found.assign(beyond=np.nan, unit=std)
    for name, value in values[values.index.isin(frame.index)].items():
        if name.endswith(("share", "coverage")):
            frame.loc[name, "unit"] = 100 * np.sqrt(value / 100 * (1 - value / 100))
        elif name == "outliers":
            frame.loc[name, "unit"] = np.sqrt(value * max(0, returns.size - value))
        elif f"_{name}".endswith(("_min", "_max")):
            frame.loc[name, "beyond"] = _beyond(name, returns, value)
    return frame


def _beyond(name: str, returns: np.ndarray, value: float) -> int:
    """Count the runs that go beyond the paper's lowest or highest value, or the starts if these are fewer or the policy
    is one."""
    low, high = fences(*np.quantile(returns, (0.25, 0.75)))
    counted = (returns < low) | (returns > high) if name.startswith("outliers") else np.ones(returns.shape, bool)
    beyond = counted & (returns < value if name.endswith("min") else returns > value)
    return min(int(beyond.any(axis=axis).sum()) for axis in (0, 1) if axis == 0 or len(returns) > 1)


def ledger_gaps(book: pd.DataFrame, task: str) -> pd.DataFrame:
    """Return the results of `SHOWN`: columns subject, verdict and gap (index: names in words). The gap is the printed
    value minus the rerun's, in half-widths of the rerun's interval on that side, which count as at least half a unit of
    the last printed digit."""
    rows = book.set_index("id").loc[[f"{printed.PREFIX[task]}_{name}" for name in SHOWN]]
    half = np.where(rows["value"] > rows["here"], rows["high"] - rows["here"], rows["here"] - rows["low"])
    half = np.maximum(half, 0.5 * rows["paper"].map(last_digit))
    rows = rows.assign(gap=(rows["value"] - rows["here"]) / half).replace({"subject": printed.SUBJECTS})
    return rows[["subject", "verdict", "gap"]].set_axis(rows["subject"] + ": " + [*SHOWN.values()])


# Settings, read from the code that uses them


def _settings(results: dict[str, Results]) -> dict[str, float]:
    """Return the rerun's settings under the ids of the paper's: limits, rewards, hyperparameters, counts."""
    settings = _environments() | {"initial_subpolicies": float(next(iter(results.values())).runs[0].cells[0])}
    for task, result in results.items():
        prefix, (runs, episodes) = printed.PREFIX[task], result.returns.shape
        counts = {"policies": runs, "episodes_per_policy": episodes, "total_episodes": runs * episodes}
        counts["drl_episodes"] = len(result.teacher_returns)
        settings |= {f"{prefix}_{place}{name}": n for place in ("", "caption_", "text_") for name, n in counts.items()}
        settings |= {name: counts[name] for name in ("episodes_per_policy", "drl_episodes")}
        settings[f"{prefix}_algorithm_runs"] = runs
        settings[f"{prefix}_training_steps"] = result.experiment.teacher.card["recipe"]["steps"]
        for name in printed.printed_hyperparameters(task):
            settings[f"{prefix}_hyper_{name}"] = float(getattr(paper_preset(task), name))
    return settings


def _environments() -> dict[str, float]:
    """Return limits and rewards of both tasks; rewards are measured by taking steps."""
    goal, car = (registry.get_task(task) for task in printed.TASKS)
    full, half = (_reward(car, [-0.5, 0.0], [force]) for force in (1.0, 0.5))
    settings = {
        "state_dimensions": len(goal.low), "sg_max_steps": goal.max_steps, "mc_max_steps": car.max_steps,
        "sg_reward_factor": _reward(goal, [0.5, 0.0], [-1.0, 0.0]) / simplegoal.STRIDE,
        "sg_goal_reward": _reward(goal, [0.15, 0.0], [-1.0, 0.0]),
        "sg_pit_reward": _reward(goal, [0.35, 0.5], [1.0, 0.0]), "mc_force_reward_factor": full,
        "mc_force_reward_exponent": np.log2(full / half), "mc_goal_reward": _reward(car, [0.449, 0.07], [0.0]),
        "mc_goal_position": mountaincar.FLAG,
    }  # fmt: skip
    for axis, name in enumerate("xy"):
        settings[f"sg_size_{name}"] = goal.high[axis] - goal.low[axis]
        settings |= {f"sg_goal_{name}_high": simplegoal.GOAL_EDGE, f"sg_stride_{name}": simplegoal.STRIDE}
        settings |= {f"sg_pit_{name}_low": simplegoal.PIT_LOW, f"sg_pit_{name}_high": simplegoal.PIT_HIGH}
    for axis, name in enumerate(("position", "velocity")):
        settings |= {f"mc_{name}_low": car.low[axis], f"mc_{name}_high": car.high[axis]}
    for name, task in (("sg_action", goal), ("mc_force", car)):
        settings |= {f"{name}_low": task.action_low[0], f"{name}_high": task.action_high[0]}
    return settings


def _reward(task: base.Task, state: list[float], action: list[float]) -> float:
    return float(task.step(np.array([state]), np.array([action]))[1][0])
