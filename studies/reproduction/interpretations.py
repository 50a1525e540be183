"""The study of the readings: how each choice that the paper leaves open changes the result.

Every reading is tried alone. Those that change the result most are also tried in all combinations. One set of seeds
ranks the variants; another compares the first few with the default.
"""

from __future__ import annotations

import dataclasses
import itertools
import os

import numpy as np
import pandas as pd

from vsp.evaluation import rollout_from_seed
from vsp.paper import printed
from vsp.paper.readings import ALTERNATIVES, Readings
from vsp.paper.runs import EVALUATION_SEED, Distillation, Experiment, Run, load_runs, outcome_shares, paper_experiment
from vsp.paper.statistics import quartiles_from_fences, resample, spread
from vsp.protocol.intervals import percentile_interval
from vsp.protocol.job import make_all, settings_id
from vsp.rollouts import Outcomes

VERSION = 1  # raise it when the same runs give other rows
CHOOSING, CONFIRMING = range(1000, 1010), range(2000, 2060)  # seeds that rank the variants; seeds that check the first
N_RESAMPLES = 1000  # per interval
N_CONFIRMED = 5  # variants to check, in addition to the default and the nearest one of each task

# Readings to try in all combinations: they change the number of cells or how fast the maps learn
FACTORS: dict[str, dict[str, object]] = {
    "R2": {"split_lookup": "kept"},
    "R3": {"split_metric": "euclidean"},
    "R4": {"one_split": True},
    "R7 rate": {"learning_rate": 3e-3},
    "R7 zeros": {"initial": "zeros"},
}
# Algorithms 1 to 3 as printed, where the prose around them says something else
AS_PRINTED = {
    "freeze": "first_n_freeze", "merge_reset": "neighbours", "merge_visits_removed": True, "split_reset": "neighbours",
    "split_neighbours": "new", "loss_after_split": "kept", "inclusive": True,
}  # fmt: skip


def variants() -> dict[str, dict]:
    """Return the variants by name: the default, each reading alone, the algorithms as printed, all combinations."""
    tried: dict[str, dict] = {"default": {}}
    for number, changes in ALTERNATIVES.items():
        for change in changes:
            ((name, value),) = change.items()
            tried[f"{number} {name}" if value is True else f"{number} {name} {value}"] = change
    tried["algorithms as printed"] = AS_PRINTED
    for size in range(2, len(FACTORS) + 1):
        for chosen in itertools.combinations(FACTORS, size):
            if not {"R2", "R4"} <= set(chosen):  # after one split a pass needs no second look-up
                tried[" + ".join(chosen)] = {name: v for part in chosen for name, v in FACTORS[part].items()}
    return tried


def experiments(tried: dict[str, dict]) -> dict[tuple[str, str], Experiment]:
    """Return the paper's experiment with the readings of each variant, by name of the variant and task."""
    usual = {task: paper_experiment(task) for task in printed.TASKS}
    made = {}
    for (name, change), (task, one) in itertools.product(tried.items(), usual.items()):
        passes = {field: value for field, value in change.items() if hasattr(Readings, field)}
        config = dataclasses.replace(one.config, **{field: change[field] for field in change.keys() - passes.keys()})
        made[name, task] = dataclasses.replace(one, config=config, readings=Readings(**passes) if passes else None)
    return made


# How far from the paper


def landmarks(task: str) -> dict[str, float]:
    """Return the `standing` of the paper's distilled policies relative to the paper's own teacher.

    MountainCar's quartiles come from the whisker bounds of the text, since T6 repeats the teacher's quartiles (see
    `audit`).
    """
    teacher, ours = (printed.printed_spread_values(task, who) for who in ("drl", "ours"))
    if task == "MountainCarContinuous-v0":
        bounds = printed.printed_value("mc_ours_whisker_low"), printed.printed_value("mc_ours_whisker_high")
        ours["q1"], ours["q3"] = quartiles_from_fences(*bounds)
    return standing(ours, teacher)


def standing(policies: dict[str, float], teacher: dict[str, float]) -> dict[str, float]:
    """Return where policies stand relative to a teacher.

    This is the mean and quartiles of the return minus the teacher's mean, in units of the teacher's standard deviation,
    and the logarithm of the ratio of the standard deviations.
    """
    scaled = {name: (policies[name] - teacher["mean"]) / teacher["std"] for name in ("mean", "q1", "q3")}
    return {**scaled, "std": float(np.log(policies["std"] / teacher["std"]))}


def distance(here: dict[str, float], there: dict[str, float]) -> float:
    """Return the root mean square difference of two standings."""
    return float(np.sqrt(np.mean([(here[name] - there[name]) ** 2 for name in there])))


def provenance_of(experiment: Experiment, seeds: range) -> dict[str, str | int]:
    """Return the provenance of the row of an experiment in one phase; the version is that of the paper's method."""
    settings = {"runs": experiment.settings, "seeds": list(seeds), "resamples": N_RESAMPLES, "study": VERSION}
    return experiment.provenance | {"settings": settings_id(settings)}


# The study


def study(runs: str | os.PathLike, *, jobs: int | str = 1, tried: dict | None = None) -> pd.DataFrame:
    """Run every variant with the seeds CHOOSING, and those nearest to the paper with the seeds CONFIRMING.

    Returns one row per phase, variant and task; see `_row`. One for all tasks together (task "both") has the distance
    averaged over the tasks, and this minus the default's ("gap").
    """
    tried = variants() if tried is None else tried
    chosen = _phase("choosing", tried, CHOOSING, runs, jobs)
    first = ["default", *(name for name in ranking(chosen) if name != "default")][: N_CONFIRMED + 1]
    first = list(dict.fromkeys([*first, *(ranking(chosen, task)[0] for task in printed.TASKS)]))
    confirmed = _phase("confirming", {name: tried[name] for name in first}, CONFIRMING, runs, jobs)
    return pd.concat([chosen, confirmed], ignore_index=True)


def ranking(frame: pd.DataFrame, task: str = "both") -> list[str]:
    """Return the variants from the nearest to the paper to the farthest."""
    rows = frame[frame["task"] == task]
    return rows.sort_values("distance", kind="stable")["variant"].tolist()


def _phase(phase: str, tried: dict, seeds, runs, jobs: int | str) -> pd.DataFrame:
    work = experiments(tried)
    asked = itertools.starmap(Distillation, itertools.product(work.values(), seeds))
    make_all(asked, runs, f"readings, {phase}", jobs=jobs)
    teachers = {task: work["default", task].teacher for task in printed.TASKS}
    own = {task: rollout_from_seed(teacher, task, seed=EVALUATION_SEED) for task, teacher in teachers.items()}
    rows, away = [], {}
    for (name, task), one in work.items():
        row, away[name, task] = _row(load_runs(one, seeds, runs=runs), own[task], landmarks(task))
        rows.append({"phase": phase, "variant": name, "task": task, **provenance_of(one, seeds), **row})
    # Variants share seeds, and resamples of all variants draw the same seeds, so gaps are taken resample by resample
    joint = pd.DataFrame(away).T.groupby(level=0, sort=False).mean()
    default = joint.loc["default"].to_numpy()
    for name, values in zip(joint.index, joint.to_numpy()):
        intervals = _with_interval("distance", values) | _with_interval("gap", values - default)
        rows.append({"phase": phase, "variant": name, "task": "both", **intervals})
    return pd.DataFrame(rows).astype({"version": "Int64"})  # integers, beside rows without a version


def _row(made: list[Run], teacher: Outcomes, there: dict[str, float]) -> tuple[dict[str, float], np.ndarray]:
    """Return the results of one variant's runs, with 95 % intervals over runs, and their distances to the paper.

    The measured distance is first, then one per resample.
    """
    returns = np.stack([run.outcomes.returns for run in made])
    codes = np.stack([run.outcomes.outcomes for run in made])
    cells = np.array([len(run.policy) for run in made])
    facts, own, draws = spread(returns), spread(teacher.returns), resample(returns, n_resamples=N_RESAMPLES)
    away = np.array([distance(standing(drawn, own), there) for drawn in (facts, *draws.to_dict("records"))])
    row = {"runs": len(made), "cells": cells.mean(), "cells_min": cells.min(), "cells_max": cells.max()}
    row |= {name: facts[name] for name in ("mean", "std", "q1", "median", "q3")}
    row["mean_low"], row["mean_high"] = percentile_interval(draws["mean"])
    row |= outcome_shares(codes)
    row["runs_above_teacher"] = np.mean(returns.mean(axis=1) > own["mean"])
    return row | _with_interval("distance", away), away


def _with_interval(name: str, values: np.ndarray) -> dict[str, float]:
    """Return a measured value and the 95 % interval of its resamples; `values` holds it, then the resamples."""
    low, high = percentile_interval(values[1:])
    return {name: values[0], f"{name}_low": low, f"{name}_high": high}
