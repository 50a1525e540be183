"""Simpler policies to set beside the Voronoi partition, fitted on the teacher data that a distillation sees.

One linear map for the whole space, cells of k-means, rules of thumb, and the trees of `trees.py`. A partition that does
not beat them buys nothing with its cells. All act through the same `predict` as `VoronoiPolicy`, and raise ValueError
for arrays of a wrong shape, numbers that are not finite, and a seed that is no integer from 0 on.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from importlib.metadata import version

import numpy as np
import pandas as pd

from . import paper, store, workers
from .checks import check_array, check_choice, check_count, check_data, check_seed
from .config import Refinement, check_refinement
from .distill import teacher_episodes
from .envs import GOAL, Task, get_task
from .evaluate import outcomes
from .experiments import EVALUATION_SEED, Experiment, Results, Run, code_id
from .policy import VoronoiPolicy
from .refine import worth
from .rollouts import Outcomes, Policy, play, visited
from .trees import Tree, standard

LEAVES = (13, 32)  # cells of the partitions that the paper prints
N_RUNS, QUICK_RUNS = 20, 2  # whose teacher episodes the baselines are fitted to


def kmeans_cells(states: np.ndarray, actions: np.ndarray, *, cells: int, task: str, seed: int) -> VoronoiPolicy:
    """Cells around the centres of k-means (scikit-learn) of the standardised states, and least squares in each."""
    from sklearn.cluster import KMeans

    states, actions = check_data(states, actions)
    check_count("cells", cells, most=len(states))
    check_seed(seed)
    scale = standard(states)[1]
    centres = KMeans(cells, n_init=4, random_state=seed).fit(states / scale).cluster_centers_ * scale
    maps = np.zeros((cells, states.shape[1] + 1, actions.shape[1]))
    return refit(VoronoiPolicy(centres, maps, task=task, metric="euclidean", scale=scale), states, actions)


Fit = Callable[[np.ndarray, np.ndarray], Policy]  # a policy from states (n, d) and actions (n, m)


def dagger(fits: Sequence[Fit], teacher: Policy, task: str, *, config: Refinement, seed: int) -> Policy:
    """Fit to the teacher's states, then again with those that the fitted policy visits (DAgger, Ross et al. 2011).

    Episodes, rounds, validation and the choice of the best are those of `config`, as `refine` has them. `fits` may be
    several, which differ in their random numbers: the one with the best first policy goes on.
    """
    check_refinement(config)
    check_seed(seed)
    task, streams = get_task(task), np.random.SeedSequence(seed).spawn(2)
    starts, checks = (np.random.default_rng(stream) for stream in streams)
    validation = task.start(checks, config.n_validation)
    policy, states, best = teacher, np.zeros((0, len(task.low))), (-np.inf, None)
    for i in range(1 + config.n_corrections):
        n = config.n_correction_episodes if i else config.n_episodes
        states = np.concatenate([states, visited(policy, task, task.start(starts, n))])
        actions = np.asarray(teacher.predict(states)[0], dtype=np.float64)
        made = [(fit, fit(states, actions)) for fit in fits]
        values = [worth(play(policy, task, validation), config.failure_price) for _, policy in made]
        fit, policy = made[int(np.argmax(values))]
        fits, best = [fit], max(best, (max(values), policy), key=lambda pair: pair[0])
    return best[1]


def linear_map(states: np.ndarray, actions: np.ndarray, task: str) -> VoronoiPolicy:
    """One linear map for the whole space, by least squares on `states` (n, d) and `actions` (n, m): a single cell."""
    states, actions = check_data(states, actions)
    inputs = np.column_stack([states, np.ones(len(states))])
    coefficients = np.linalg.lstsq(inputs, actions, rcond=None)[0]
    return VoronoiPolicy(states.mean(axis=0)[None], coefficients[None], task=task)


def refit(policy: VoronoiPolicy, states: np.ndarray, actions: np.ndarray, *, constant: bool = False) -> VoronoiPolicy:
    """The cells of `policy` with new maps, by least squares on the states and actions in each cell: what training to
    the end would give. `constant`: a constant action per cell instead. A cell without states keeps its map. Raises
    ValueError unless the maps are linear."""
    policy.check_linear()
    states, actions = check_data(states, actions, *np.subtract(policy.coefficients.shape[1:], (1, 0)))
    cells, coefficients = policy.cells(states), policy.coefficients.copy()
    inputs = np.column_stack([np.zeros_like(states) if constant else states, np.ones(len(states))])
    for i in np.unique(cells):
        coefficients[i] = np.linalg.lstsq(inputs[cells == i], actions[cells == i], rcond=None)[0]
    return VoronoiPolicy(policy.codewords, coefficients, task=policy.task, metric=policy.metric, scale=policy.scale)


def rule_of_thumb(task: str) -> tuple[str, VoronoiPolicy]:
    """A policy that a person would write down without any teacher, with its name.

    SimpleGoal: walk diagonally towards the goal, pit or no pit. MountainCarContinuous: push the way the car moves,
    12 times the velocity, limited to [-1, 1].
    """
    check_choice("task", task, paper.TASKS)
    names = {"SimpleGoal-v0": "always (−1, −1)", "MountainCarContinuous-v0": "12 · velocity"}
    maps = {"SimpleGoal-v0": [[0, 0], [0, 0], [-1, -1]], "MountainCarContinuous-v0": [[0], [12], [0]]}
    return names[task], VoronoiPolicy(np.zeros((1, 2)), np.array([maps[task]], dtype=float), task=task)


class Heuristic:
    """The controller by hand that comes with Gymnasium's LunarLander (`gymnasium.envs.box2d.lunar_lander.heuristic`).

    It leans against its drift, holds a height in proportion to its distance from the pad, and brakes with a leg down.
    """

    COST = 12, 20.0  # numbers in the formulas of `predict`, and operations and comparisons, limits of actions aside

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, 2), main and side engine, for observations (n, 8)."""
        x, y, vx, vy, angle, spin, left, right = check_array("observations", obs, (-1, 8)).T
        down = (left != 0) | (right != 0)
        lean = np.clip(0.5 * x + 1.0 * vx, -0.4, 0.4)
        turn = np.where(down, 0.0, 0.5 * (lean - angle) - 1.0 * spin)
        lift = np.where(down, 0.0, 0.5 * (0.55 * np.abs(x) - y)) - 0.5 * vy
        return np.clip(np.column_stack([20.0 * lift - 1.0, -20.0 * turn]), -1.0, 1.0), None


class PumpAndBalance:
    """The textbook's pendulum: give it the energy of standing upright, then hold it there (Åström and Furuta 2000)."""

    COST = 6, 9.0  # numbers, and operations of the way that takes more of them

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Torques (n, 1) for cosine and sine of the angle and angular velocity (n, 3)."""
        cosine, sine, velocity = check_array("observations", obs, (-1, 3)).T
        missing = velocity**2 / 6 + 5.0 * (cosine - 1.0)  # energy of the rod, less that of standing still upright
        torque = np.where(cosine > 0.8, -10.0 * sine - 2.0 * velocity, -2.0 * missing * np.sign(velocity))
        return np.clip(torque, -2.0, 2.0)[:, None], None


class Still:
    """No teacher at all: it does nothing, whatever it sees."""

    def __init__(self, task: Task):
        self._d, self._action = len(task.low), np.zeros(len(task.action_low))

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Zeros (n, m) for observations (n, d)."""
        return np.tile(self._action, (len(check_array("observations", obs, (-1, self._d))), 1)), None


def teacher_data(experiment: Experiment, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Every state (n, d) and action (n, m) that `distill` sees of its teacher under `seed`."""
    check_seed(seed)
    rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(3)[0])
    task, n = get_task(experiment.task), experiment.config.n_iterations
    episodes = list(teacher_episodes(experiment.teacher, task, n, rng))
    return np.concatenate([e.states for e in episodes]), np.concatenate([e.actions for e in episodes])


def fit(experiment: Experiment, run: Run) -> dict[str, Policy]:
    """The baselines that need a teacher, by name, fitted on the data that `run` was distilled from."""
    states, actions = teacher_data(experiment, run.seed)
    trees = {f"tree, {leaves} leaves": Tree(states, actions, leaves=leaves) for leaves in LEAVES}
    return {
        "one linear map": linear_map(states, actions, experiment.task),
        **trees,
        "same cells, least squares": refit(run.policy, states, actions),
        "same cells, constants": refit(run.policy, states, actions, constant=True),
    }


def compare(result: Results, n_runs: int = N_RUNS, *, jobs: int | str = 1) -> pd.DataFrame:
    """What stands beside the distilled policies: one row per kind of policy (the index), best mean return first.

    Columns: policies (how many), cells (or leaves, their mean), mean return, gap (to the teacher's, from the same
    starts), low and high (95 %, of the gap), std of all returns, failing (share of episodes without the goal).
    Intervals resample policies and start states together. Baselines are fitted to the data of the first `n_runs` runs,
    by `jobs` as in `workers`.
    """
    experiment, task = result.experiment, result.experiment.task
    name, rule = rule_of_thumb(task)
    asked = [(experiment, run) for run in result.runs[:n_runs]]
    label = f"{task}, beside the runs"
    fitted = dict(workers.results(_fitted, asked, label, jobs=jobs, total=len(asked), unit="fits"))
    found = [_played(experiment, {name: rule, "published policy": paper.published_policy(task)})]
    found += [fitted[i] for i in range(len(asked))]
    own = result.teacher_returns
    rows = {"teacher (TD3)": _row(np.nan, [result.teacher_outcomes], own)}
    for kind in {kind: None for one in found for kind in one}:  # in their order
        cells, played = zip(*(one[kind] for one in found if kind in one))
        rows[kind] = _row(np.mean(cells), played, own)
    cells = [len(run.policy) for run in result.runs]
    rows["distilled, all runs"] = _row(np.mean(cells), [run.outcomes for run in result.runs], own)
    rows["distilled, best run"] = _row(len(result.best.policy), [result.best.outcomes], own)
    return pd.DataFrame.from_dict(rows, orient="index").sort_values("mean", ascending=False, kind="stable")


def _fitted(experiment: Experiment, run: Run) -> dict[str, tuple[int, Outcomes]]:
    return _played(experiment, fit(experiment, run))


def _played(experiment: Experiment, policies: dict[str, Policy]) -> dict[str, tuple[int, Outcomes]]:
    """Cells and evaluated episodes of each policy."""
    n = experiment.n_episodes
    return {kind: (len(p), outcomes(p, experiment.task, n, seed=EVALUATION_SEED)) for kind, p in policies.items()}


def kept_comparison(
    result: Results, n_runs: int = N_RUNS, *, runs: str | os.PathLike, jobs: int | str = -1
) -> pd.DataFrame:
    """`compare`, kept beside the runs as the teacher's episodes are: on another CPU type the fits would be others."""
    about = [
        code_id("baselines", "trees", "paper"),
        store.sha256(paper.FOLDER / store.MANIFEST),
        version("scikit-learn"),
    ]
    key = hashlib.sha256(json.dumps(about).encode()).hexdigest()[:10]
    name = f"baselines-{n_runs}-{key}.run"
    path = result.experiment.folder(runs) / name
    if not path.exists():
        frame = compare(result, n_runs, jobs=jobs)
        arrays = {name: frame[name].to_numpy() for name in frame}
        store.save(path, arrays, {"kind": "Comparison", "policies": list(frame.index), "columns": list(frame)})
    arrays, about = store.load(path, kind="Comparison")
    return pd.DataFrame({name: arrays[name] for name in about["columns"]}, index=about["policies"])


def _row(cells: float, played: list[Outcomes], own: np.ndarray) -> dict[str, float]:
    returns, codes = np.stack([o.returns for o in played]), np.stack([o.codes for o in played])
    low, high = _crossed_interval(returns - own)
    row = {"policies": len(played), "cells": cells, "mean": returns.mean(), "gap": np.mean(returns - own)}
    return row | {"low": low, "high": high, "std": returns.std(ddof=1), "failing": np.mean(codes != GOAL)}


def _crossed_interval(values: np.ndarray, n_resamples: int = 2000) -> tuple[float, float]:
    """95 % interval of the mean of `values` (p, n) for other policies *and* other start states: both are resampled.

    Policies may be so alike (twenty fits to much the same data) that the starts are all that matters.
    """
    rng = np.random.default_rng(0)
    policies, starts = (rng.multinomial(k, np.full(k, 1 / k), size=n_resamples) for k in values.shape)
    means = np.einsum("rn,rn->r", policies @ values, starts) / values.size
    return tuple(np.percentile(means, [2.5, 97.5]))
