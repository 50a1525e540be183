"""How often the ledger's rules are wrong: the rerun against itself, and against runs that are known to be others.

A "paper" is a sample of runs, from start states of its own; so is the "rerun". If both come from the same runs, each
"differs" is wrong. If the paper's are fitted by least squares, or have another teacher, the rules should see it.
"""

import os
import re
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from vsp.evaluation import start_states
from vsp.paper import ledger, printed
from vsp.paper.runs import N_EPISODES, N_RUNS, Experiment, make_runs, paper_experiment
from vsp.paper.statistics import outlier_numbers, spread
from vsp.protocol.job import settings_id
from vsp.rollouts import Policy, rollout
from vsp.run import workers

from .hidden import experiment

VERSION = 2  # raise it when the same runs give other rows
N_PAIRS, N_RESAMPLES, START_SEED = 200, 300, 41
N_STARTS = 6000  # of which the paper gets N_EPISODES, and the rerun others
MOVED = "mean moved by one deviation"
KINDS = {  # patterns of names
    "mean": "^mean", "deviation": "^(?:std|iqr)$", "quartile": "^(?:q1|median|q3|whisker_.*)$",
    "outliers": "^(?:outliers|coverage|outliers_below_share)$", "of outliers": "^outliers_.*(?:mean|std)$",
    "extreme": "(?:^|_)(?:min|max)$", "cells": "^cells$",
}  # fmt: skip


def experiments(task: str) -> dict[str, Experiment]:
    """Return the rerun's experiment, and those that are known to be others."""
    usual = paper_experiment(task)
    fitted = replace(usual, config=replace(usual.config, fit="closed_form"))
    return {"the same": usual, "least squares": fitted, "another teacher": experiment({"teacher": 1}, task)}


def study(runs: str | os.PathLike, *, jobs: int | str = 1) -> pd.DataFrame:
    """Return one row per task, subject, what the rerun is set against, and name of a result. Columns: kind, and the
    shares of `N_PAIRS` pairs that have each of `ledger.VERDICTS`."""
    work = []
    for task in printed.TASKS:
        starts, n = start_states(task, N_STARTS, START_SEED), N_RUNS[task]
        for against, one in experiments(task).items():
            made = make_runs(one, range(2 * n if against == "the same" else n), runs=runs, jobs=jobs)
            actors = [(actor, task, starts) for actor in (*(run.policy for run in made), one.teacher)]
            label = f"{task}, {against}"
            played = dict(workers.results(_played, actors, label, jobs=jobs, total=len(actors), unit="policies"))
            pool = Pool(np.stack([played[i] for i in range(len(made))]), ledger.means_and_cells(made))
            about = {"task": task, "subject": "distilled", "against": against, **provenance_of(one)}
            if against == "the same":
                usual = pool
                work.append((about | {"subject": "teacher"}, 1, Pool(played[len(made)][None]), None))
            work.append((about, n, usual, None if pool is usual else pool))
    tables = dict(workers.results(judged, work, "verdicts", jobs=jobs, total=len(work), unit="comparisons"))
    return pd.concat([tables[i] for i in range(len(work))], ignore_index=True)


@dataclass(frozen=True, eq=False)
class Pool:
    """Runs to draw from: returns (p, s), and of each run the mean on the validation starts and the cells (p, 2)."""

    returns: np.ndarray
    best: np.ndarray | None = None


def _played(policy: Policy, task: str, starts: np.ndarray) -> np.ndarray:
    return rollout(policy, task, starts).returns


def provenance_of(experiment: Experiment) -> dict[str, str | int]:
    """Return the provenance of the rows of an experiment; the version is that of the paper's method."""
    settings = {"runs": experiment.settings, "pairs": [N_PAIRS, N_RESAMPLES, START_SEED, N_STARTS], "study": VERSION}
    return experiment.provenance | {"settings": settings_id(settings)}


def judged(about: dict, n: int, ours: Pool, other: Pool | None) -> pd.DataFrame:
    """Draw `N_PAIRS` times n runs as the rerun and n others as the paper, of the same pool or of `other`, each with its
    own starts; return the shares of the verdicts, a row per name."""
    rng, verdicts, theirs = np.random.default_rng(0), [], other or ours
    for _ in range(N_PAIRS):
        first, starts = rng.permutation(len(ours.returns)), rng.permutation(N_STARTS)
        second = np.arange(n) if other else first[-n:]
        here = ours.returns[np.ix_(first[:n], starts[:N_EPISODES])]
        there = theirs.returns[np.ix_(second, starts[-N_EPISODES:])]
        values = pd.Series(outlier_numbers(there) | spread(there))
        values["coverage"] *= 100
        found = ledger.set_against(ledger.of_returns(here, n_resamples=N_RESAMPLES), here, values, values["std"])
        moved = found.loc[["mean"]].set_axis([MOVED])
        values[MOVED] = values["mean"] + values["std"]
        if ours.best is not None and theirs.best is not None:
            found = pd.concat([found, ledger.of_cells(ours.best[first[:n]])])
            values["cells"] = ledger.of_cells(theirs.best[second])["here"].iloc[0]
        rows = pd.concat([found, moved]).assign(value=values, paper=values.map("{:.3f}".format))
        rows["here"] = rows["here"].where(rows["value"].notna())
        verdicts.append(pd.Series(ledger.verdicts(rows, in_doubt=pd.Series(False, rows.index)), rows.index))
    shares = pd.DataFrame(verdicts).apply(lambda column: column.value_counts(normalize=True)).T
    shares = shares.reindex(columns=ledger.VERDICTS[:-1]).fillna(0.0).rename_axis("name").reset_index()
    kinds = [next((kind for kind, names in KINDS.items() if re.search(names, name)), "") for name in shares["name"]]
    table = shares.assign(kind=kinds, **about).query("kind != ''")
    moved = table["name"] == MOVED
    table.loc[moved, ["name", "against"]] = "mean", MOVED
    return table[~moved | (about["against"] == "the same")]
