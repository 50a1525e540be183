"""Simpler policies to set beside the Voronoi partition, fitted on the teacher data that a distillation sees.

One linear map for the whole space, regression trees, and a rule of thumb. A partition that does not beat them buys
nothing with its cells. All act through the same `predict` as `VoronoiPolicy`.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from . import paper
from .distill import teacher_episodes
from .envs import GOAL, get_task
from .evaluate import interval, outcomes
from .experiments import EVALUATION_SEED, Experiment, Results
from .policy import VoronoiPolicy
from .rollouts import Outcomes, Policy

LEAVES = (13, 32)  # cells of the partitions that the paper prints
SEEDS = range(20)  # each brings teacher episodes of its own


class Tree:
    """A regression tree (CART, Breiman et al. 1984) with at most `leaves` leaves, each with one constant action.

    Grown best split first on the mean squared error of `actions` (n, m) at `states` (n, d), by scikit-learn.
    """

    def __init__(self, states: np.ndarray, actions: np.ndarray, *, leaves: int):
        from sklearn.tree import DecisionTreeRegressor

        self.model = DecisionTreeRegressor(max_leaf_nodes=leaves, random_state=0).fit(states, actions)
        self._m = actions.shape[1]

    def __len__(self) -> int:
        return self.model.get_n_leaves()

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d): means of the teacher's, so they stay inside the action box."""
        return self.model.predict(obs).reshape(len(obs), self._m), None


def linear_map(states: np.ndarray, actions: np.ndarray, task: str) -> VoronoiPolicy:
    """One linear map for the whole space, by least squares on `states` (n, d) and `actions` (n, m): a single cell."""
    inputs = np.column_stack([states, np.ones(len(states))])
    coefficients = np.linalg.lstsq(inputs, actions, rcond=None)[0]
    return VoronoiPolicy(states.mean(axis=0)[None], coefficients[None], task=task)


def rule_of_thumb(task: str) -> tuple[str, VoronoiPolicy]:
    """A policy that a person would write down without any teacher, with its name.

    SimpleGoal: walk diagonally towards the goal, pit or no pit. MountainCarContinuous: push the way the car moves,
    12 times the velocity, limited to [-1, 1].
    """
    names = {"SimpleGoal-v0": "always (−1, −1)", "MountainCarContinuous-v0": "12 · velocity"}
    maps = {"SimpleGoal-v0": [[0, 0], [0, 0], [-1, -1]], "MountainCarContinuous-v0": [[0], [12], [0]]}
    return names[task], VoronoiPolicy(np.zeros((1, 2)), np.array([maps[task]], dtype=float), task=task)


def teacher_data(experiment: Experiment, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Every state (n, d) and action (n, m) that `distill` sees of its teacher under `seed`."""
    rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(3)[0])
    task, n = get_task(experiment.task), experiment.config.n_iterations
    episodes = list(teacher_episodes(experiment.teacher, task, n, rng))
    return np.concatenate([e.states for e in episodes]), np.concatenate([e.actions for e in episodes])


def fit(experiment: Experiment, seed: int) -> dict[str, Policy]:
    """The baselines that need a teacher, by name, fitted on the data of `seed`."""
    states, actions = teacher_data(experiment, seed)
    trees = {f"tree, {leaves} leaves": Tree(states, actions, leaves=leaves) for leaves in LEAVES}
    return {"one linear map": linear_map(states, actions, experiment.task), **trees}


def compare(result: Results, seeds=SEEDS) -> pd.DataFrame:
    """What stands beside the distilled policies: one row per kind of policy (the index), best mean return first.

    Columns: policies (how many), cells (or leaves, their mean), here (mean return), low and high (95 %), std of all
    returns, failing (share of episodes that do not reach the goal). Intervals resample policies where there are
    several, start states where there is one. Baselines are fitted once per seed and played from the shared starts.
    """
    experiment, task = result.experiment, result.experiment.task
    name, rule = rule_of_thumb(task)
    kinds = {name: [rule], "published policy": [paper.published_policy(task)]}
    for seed in seeds:
        for kind, policy in fit(experiment, seed).items():
            kinds.setdefault(kind, []).append(policy)
    rows = {"teacher (TD3)": _row(np.nan, [result.teacher_outcomes])}
    for kind, policies in kinds.items():
        played = [outcomes(policy, task, experiment.n_episodes, seed=EVALUATION_SEED) for policy in policies]
        rows[kind] = _row(np.mean([len(policy) for policy in policies]), played)
    cells = [len(run.policy) for run in result.runs]
    rows["distilled, all runs"] = _row(np.mean(cells), [run.outcomes for run in result.runs])
    rows["distilled, best run"] = _row(len(result.best.policy), [result.best.outcomes])
    return pd.DataFrame.from_dict(rows, orient="index").sort_values("here", ascending=False, kind="stable")


def _row(cells: float, played: list[Outcomes]) -> dict[str, float]:
    returns, codes = np.stack([o.returns for o in played]), np.stack([o.codes for o in played])
    low, high = interval(returns if len(played) > 1 else returns.T, np.mean)
    row = {"policies": len(played), "cells": cells, "here": returns.mean(), "low": low, "high": high}
    return row | {"std": returns.std(ddof=1), "failing": np.mean(codes != GOAL)}
