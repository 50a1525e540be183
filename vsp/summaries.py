"""What tables say of many runs: a row per run, the span over the runs, teacher against copies."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pandas as pd

from . import store
from .evaluate import interval, spread
from .experiments import SHARES, Experiment, Results, Run


def summary(runs: list[Run], experiment: Experiment) -> pd.DataFrame:
    """One row per run: seed, cells, splits, merges, spread of the returns and shares of the outcomes."""
    return pd.DataFrame(
        {
            "settings": experiment.id,
            "seed": run.seed,
            "cells": len(run.policy),
            "splits": run.splits,
            "merges": run.merges,
            "validation_mean": run.validation_mean,
            **spread(run.outcomes.returns),
            **{name: np.mean(run.outcomes.codes == code) for name, code in SHARES.items()},
        }
        for run in runs
    )


def overview(results: Results) -> pd.DataFrame:
    """Mean, lowest and highest value over the runs, one row per property of a run."""
    frame = summary(results.runs, results.experiment)
    return frame[["cells", "splits", "merges", "mean", *SHARES]].agg(["mean", "min", "max"]).T


def comparison(results: Results) -> dict[str, float]:
    """Teacher against distilled policies: means, and 95 % intervals that resample policies.

    The difference is taken start by start. "± if independent" is what the half-width would be if all episodes were
    independent of each other, which they are not.
    """
    teacher, runs = results.teacher_returns, results.returns
    means = runs.mean(axis=1)
    low, high = interval(runs, np.mean)
    gap_low, gap_high = interval(runs - teacher, np.mean)
    return {
        "TD3, mean": teacher.mean(),
        "distilled, mean": runs.mean(),
        "95 % interval from": low,
        "to": high,
        "± of it": (high - low) / 2,
        "± if independent": 1.96 * runs.std(ddof=1) / np.sqrt(runs.size),
        "difference, from": gap_low,
        "difference, to": gap_high,
        "runs above TD3": np.mean(means > teacher.mean()),
        "lowest run": means.min(),
        "median run": np.median(means),
        "highest run": means.max(),
    }


def write_summary(results: Results, *, out: str | os.PathLike) -> None:
    """Write the summary of the runs to OUT/data/results/TASK.csv, and the CPU types that made them beside it."""
    folder, task = Path(out) / "data" / "results", results.experiment.task
    text = summary(results.runs, results.experiment).to_csv(index=False, float_format="%.6f", lineterminator="\n")
    store.write_listed(folder / f"{task}.csv", text)
    store.write_listed(folder / "made_on.txt", "".join(f"{cpu}\n" for cpu in sorted({run.cpu for run in results.runs})))
