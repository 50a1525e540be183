"""What notebook 05 shows of the tables readings.csv and teachers.csv, which `make study` writes."""

from __future__ import annotations

import pandas as pd

SHOWN = {  # the variants that change a result most, with their labels
    "default": "default",
    "R1 freeze last_n_split": "split to the end",
    "R4 one_split": "one split per pass",
    "R7 n_minibatches 5": "five minibatches",
    "R7 learning_rate 0.01": "ten times the step size",
    "R7 learning_rate 0.0003": "a third of the step size",
    "R7 initial zeros": "maps start from zero",
}
LABELS = SHOWN | {  # and those that were run again
    "R13 split_reset neighbours": "a split keeps the buffer of its cell",
    "R13 split_neighbours new": "a split resets the new cell's neighbours",
    "R7 batch_size 16": "minibatches of 16 states",
    "R6 merge_visits_removed": "merging visits removed cells",
    "R3 + R4 + R7 zeros": "Euclidean, one split per pass, from zero",
}


def shown_variants(frame: pd.DataFrame, task: str, phase: str = "choosing") -> pd.DataFrame:
    """Return mean return (here, low, high), cells and failures per variant of `SHOWN`; NaN if not in `phase`."""
    rows = frame[(frame["phase"] == phase) & (frame["task"] == task)].set_index("variant").reindex(SHOWN)
    rows = rows.assign(failed=100 * (1 - rows["goal"])).rename(index=SHOWN)
    names = {"mean": "here", "mean_low": "low", "mean_high": "high", "cells": "cells", "failed": "failed (%)"}
    return rows[[*names]].rename(columns=names)


def teacher_summary(frame: pd.DataFrame) -> pd.DataFrame:
    """Return one row per teacher: its own return, and the return, deviation, cells and failures over its runs."""
    groups = frame.assign(failing=1 - frame["goal"]).groupby(["task", "teacher"], sort=False)
    means = groups[["steps", "linear_error", "teacher_mean", "teacher_std", "mean", "cells", "failing"]].mean()
    means.insert(5, "deviation between runs", groups["mean"].std())
    return means.reset_index()


def wrong_verdicts(frame: pd.DataFrame) -> pd.DataFrame:
    """Return how often "differs" is the verdict, in percent of the pairs of samples: one row per kind of result.

    Columns: kind; of the same runs the mean over the results of a kind, and the highest; for runs that are known to be
    others, by what changed, the highest.
    """
    told = frame[frame["cannot be checked"] < 1].assign(differs=100 * frame["differs"])
    same, others = (told[(told["against"] == "the same") == side] for side in (True, False))
    shares = same.groupby("kind", sort=False)["differs"].agg(["mean", "max"])
    names = {"mean": "the same runs, mean", "max": "the same runs, highest"}
    highest = others.groupby(["kind", "against"])["differs"].max().unstack()
    return shares.rename(columns=names).join(highest).rename_axis(columns=None).reset_index()
