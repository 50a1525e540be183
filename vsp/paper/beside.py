"""Compare distilled policies with simpler ones, fitted to the teacher data that each distillation saw."""

from __future__ import annotations

import os
from importlib.metadata import version

import numpy as np
import pandas as pd

from ..algorithms import teacher_episodes
from ..checks import check_seed
from ..evaluation import rollout_from_seed
from ..rollouts import Outcomes, Policy
from ..run import atomic, listed, sealed, workers
from ..tasks.base import GOAL
from ..tasks.registry import get_task
from . import printed
from .baselines import Tree, kmeans_cells, linear_map, refit, rule_of_thumb
from .results import load_made, settings_id
from .runs import EVALUATION_SEED, Experiment, Results, Run
from .statistics import crossed_interval

VERSION = 2  # raise it when the same runs give other results
LEAVES = (13, 32)  # cells of the partitions that the paper prints
N_BESIDE, QUICK_BESIDE = 20, 2  # runs whose teacher episodes the baselines are fitted to


def teacher_data(experiment: Experiment, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return all states (n, d) and actions (n, m) of the teacher that `distill` sees under `seed`."""
    check_seed(seed)
    rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(3)[0])
    task, n = get_task(experiment.task), experiment.config.n_iterations
    episodes = list(teacher_episodes(experiment.teacher, task, n, rng))
    return np.concatenate([e.states for e in episodes]), np.concatenate([e.actions for e in episodes])


def fit(experiment: Experiment, run: Run) -> dict[str, Policy]:
    """Fit the baselines that need a teacher to the data that `run` was distilled from; return them by name."""
    states, actions = teacher_data(experiment, run.seed)
    trees = {f"tree, {leaves} leaves": Tree(states, actions, leaves=leaves) for leaves in LEAVES}
    return {
        "one linear map": linear_map(states, actions, experiment.task),
        **trees,
        "same cells, least squares": refit(run.policy, states, actions),
        "same cells, constants": refit(run.policy, states, actions, constant=True),
        "k-means cells": kmeans_cells(states, actions, cells=len(run.policy), task=experiment.task, seed=run.seed),
    }


def compare_simpler(result: Results, n_runs: int = N_BESIDE, *, jobs: int | str = 1) -> pd.DataFrame:
    """Compare the distilled policies with simpler ones: one row per kind of policy (the index), best mean return first.

    Columns: policies (how many), cells (mean number of cells or leaves), mean (return), gap (mean return minus the
    teacher's from the same starts), low and high (95 % interval of the gap), std (of all returns), failing (share of
    episodes that miss the goal). Intervals resample policies and start states together. Baselines are fitted to the
    data of the first `n_runs` runs; `jobs` as in `workers`.
    """
    experiment, task = result.experiment, result.experiment.task
    name, rule = rule_of_thumb(task)
    asked = [(experiment, run) for run in result.runs[:n_runs]]
    label = f"{task}, beside the runs"
    fitted = dict(workers.results(_fitted, asked, label, jobs=jobs, total=len(asked), unit="fits"))
    found = [_played(experiment, {name: rule, "published policy": printed.published_policy(task)})]
    found += [fitted[i] for i in range(len(asked))]
    own = result.teacher_returns
    rows = {"teacher (TD3)": _row(np.nan, [result.teacher_outcomes], own)}
    for kind in {kind: None for one in found for kind in one}:  # in order of first appearance
        cells, played = zip(*(one[kind] for one in found if kind in one))
        rows[kind] = _row(np.mean(cells), played, own)
    cells = [len(run.policy) for run in result.runs]
    rows["distilled, all runs"] = _row(np.mean(cells), [run.outcomes for run in result.runs], own)
    rows["distilled, best run"] = _row(len(result.best.policy), [result.best.outcomes], own)
    return pd.DataFrame.from_dict(rows, orient="index").sort_values("mean", ascending=False, kind="stable")


def _fitted(experiment: Experiment, run: Run) -> dict[str, tuple[int, Outcomes]]:
    return _played(experiment, fit(experiment, run))


def _played(experiment: Experiment, policies: dict[str, Policy]) -> dict[str, tuple[int, Outcomes]]:
    """Return the number of cells and the evaluated episodes of each policy."""
    n = experiment.n_episodes
    return {
        kind: (len(p), rollout_from_seed(p, experiment.task, n, seed=EVALUATION_SEED)) for kind, p in policies.items()
    }


def kept_comparison(
    result: Results, n_runs: int = N_BESIDE, *, runs: str | os.PathLike, jobs: int | str = -1
) -> pd.DataFrame:
    """Load `compare_simpler` from a file beside the runs, or make it: another CPU type would give other fits."""
    experiment = result.experiment
    settings = {"leaves": LEAVES, "printed": atomic.sha256(printed.FOLDER / listed.MANIFEST)}
    name = f"baselines-{n_runs}-{settings_id(settings | {'scikit-learn': version('scikit-learn')})}-v{VERSION}"
    path = experiment.folder(runs) / f"{name}.run"
    about = {**experiment.about(EVALUATION_SEED), "comparison": name}
    if not path.exists():
        frame = compare_simpler(result, n_runs, jobs=jobs)
        arrays = {name: frame[name].to_numpy() for name in frame}
        names = {"policies": list(frame.index), "columns": list(frame)}
        sealed.save_arrays(path, arrays, {"kind": "Comparison", **about, **names})
    arrays, found = load_made(path, "Comparison", about)
    return pd.DataFrame({name: arrays[name] for name in found["columns"]}, index=found["policies"])


def _row(cells: float, played: list[Outcomes], own: np.ndarray) -> dict[str, float]:
    returns, codes = np.stack([o.returns for o in played]), np.stack([o.outcomes for o in played])
    low, high = crossed_interval(returns - own)
    row = {"policies": len(played), "cells": cells, "mean": returns.mean(), "gap": np.mean(returns - own)}
    return row | {"low": low, "high": high, "std": returns.std(ddof=1), "failing": np.mean(codes != GOAL)}
