"""What the cells buy: distilled policies beside simpler ones, fitted to the teacher data that each distillation saw."""

import os
from importlib.metadata import version

import numpy as np
import pandas as pd

from vsp import VoronoiPolicy, get_task, teacher_episodes
from vsp.evaluation import rollout_from_seed
from vsp.paper import printed
from vsp.paper.baselines import Tree, kmeans_cells, linear_map, refit, rule_of_thumb
from vsp.paper.runs import EVALUATION_SEED, N_RUNS, Experiment, Results, Run, paper_results
from vsp.protocol import crossed_interval
from vsp.protocol.job import settings_id
from vsp.rollouts import Outcomes
from vsp.run import workers
from vsp.tasks import GOAL

VERSION = 2  # raise it when the same runs give other results
LEAVES = (13, 32)  # cells of the partitions that the paper prints
N_FITTED = 20  # runs whose teacher episodes the simpler policies are fitted to


def study(runs: str | os.PathLike, *, jobs: int | str = 1) -> pd.DataFrame:
    """Return `compare_simpler` for both tasks, one row per policy; the paper's runs are in the folder `runs`."""
    tables = {}
    for task in printed.TASKS:
        result = paper_results(task, runs=runs, jobs=jobs)
        tables[task] = compare_simpler(result, jobs=jobs).assign(**provenance_of(result.experiment))
    return pd.concat(tables, names=["task", "policy"]).reset_index()


def provenance_of(experiment: Experiment) -> dict[str, str | int]:
    """Return the provenance of the rows of an experiment; the version is that of the paper's method."""
    policy = printed.published_policy(experiment.task)
    settings = {
        "runs": experiment.settings, "number of runs": N_RUNS[experiment.task], "fitted": N_FITTED, "leaves": LEAVES,
        "published": [policy.codewords.tolist(), policy.coefficients.tolist()],
        "scikit-learn": version("scikit-learn"), "study": VERSION,
    }  # fmt: skip
    return experiment.provenance | {"settings": settings_id(settings)}


def teacher_data(experiment: Experiment, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return all states (n, d) and actions (n, m) of the teacher that `distill` sees under `seed`."""
    rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(3)[0])
    task, n = get_task(experiment.task), experiment.config.n_iterations
    episodes = list(teacher_episodes(experiment.teacher, task, n, rng))
    return np.concatenate([e.states for e in episodes]), np.concatenate([e.actions for e in episodes])


def fit(experiment: Experiment, run: Run) -> dict[str, VoronoiPolicy | Tree]:
    """Fit the simpler policies that need a teacher to the data that `run` was distilled from; return them by name."""
    states, actions = teacher_data(experiment, run.seed)
    return {
        "one linear map": linear_map(states, actions, experiment.task),
        **{f"tree, {leaves} leaves": Tree(states, actions, leaves=leaves) for leaves in LEAVES},
        "same cells, least squares": refit(run.policy, states, actions),
        "same cells, constants": refit(run.policy, states, actions, constant=True),
        "k-means cells": kmeans_cells(states, actions, cells=len(run.policy), task=experiment.task, seed=run.seed),
    }


def compare_simpler(result: Results, n_runs: int = N_FITTED, *, jobs: int | str = 1) -> pd.DataFrame:
    """Compare the distilled policies with simpler ones: one row per kind of policy (the index), best mean return first.
    Columns: policies (how many), cells (mean number of cells or leaves), mean (return), gap (mean return minus the
    teacher's from the same starts), low and high (95 % interval of the gap), std (of all returns), failing (share of
    episodes that miss the goal). Intervals resample policies and start states together. Simpler policies are fitted to
    the data of the first `n_runs` runs; `jobs` as in `workers`."""
    experiment, task = result.experiment, result.experiment.task
    work = [(experiment, run) for run in result.runs[:n_runs]]
    fitted = dict(workers.results(_fitted, work, f"{task}, simpler", jobs=jobs, total=len(work), unit="fits"))
    name, rule = rule_of_thumb(task)
    played: dict[str, list] = {"teacher (TD3)": [(np.nan, result.teacher_outcomes)]}
    unfitted = _played(experiment, {name: rule, "published policy": printed.published_policy(task)})
    for policies in (unfitted, *(fitted[i] for i in range(len(work)))):
        for kind, evaluated in policies.items():
            played.setdefault(kind, []).append(evaluated)
    played["distilled, all runs"] = [(len(run.policy), run.outcomes) for run in result.runs]
    played["distilled, best run"] = [(len(result.best.policy), result.best.outcomes)]
    rows = {kind: _row(evaluated, result.teacher_returns) for kind, evaluated in played.items()}
    return pd.DataFrame.from_dict(rows, orient="index").sort_values("mean", ascending=False, kind="stable")


def _fitted(experiment: Experiment, run: Run) -> dict[str, tuple[int, Outcomes]]:
    return _played(experiment, fit(experiment, run))


def _played(experiment: Experiment, policies: dict[str, VoronoiPolicy | Tree]) -> dict[str, tuple[int, Outcomes]]:
    task, n, seed = experiment.task, experiment.n_episodes, EVALUATION_SEED
    return {kind: (len(p), rollout_from_seed(p, task, n, seed=seed)) for kind, p in policies.items()}


def _row(evaluated: list[tuple[float, Outcomes]], teacher: np.ndarray) -> dict[str, float]:
    returns, codes = (np.stack([getattr(o, name) for _, o in evaluated]) for name in ("returns", "outcomes"))
    low, high = crossed_interval(returns - teacher)
    row = {"policies": len(evaluated), "cells": np.mean([n for n, _ in evaluated]), "mean": returns.mean()}
    row |= {"gap": np.mean(returns - teacher), "low": low, "high": high}
    return row | {"std": returns.std(ddof=1), "failing": np.mean(codes != GOAL)}
