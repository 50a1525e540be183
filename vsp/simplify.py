"""`simplify`: the fewest cells, then the fewest and shortest coefficients, that keep the return within a tolerance."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd

from .checks import check_array, check_count, check_number, check_seed
from .config import Refinement, check_refinement
from .envs import GOAL, Task, get_task
from .evaluate import start_states
from .policy import VoronoiPolicy
from .progress import progress
from .refine import refine, worth
from .rollouts import Outcomes, Policy, play, visited

N_VISITED = 100  # episodes that tell where the states are
DIGITS = range(1, 17)  # significant digits that are tried, the fewest first


def simplify(
    teacher: Policy, task: str | Task, config: Refinement, *, tolerance: float, seed: int
) -> tuple[VoronoiPolicy, pd.DataFrame]:
    """The simplest policy that returns at most `tolerance` less than `teacher`; up to `config.n_cells` cells are tried.

    Everything is compared by `worth` from the same `config.n_validation` starts, so report the result from others.
    Returns the policy, its codewords `gathered`, and what was tried, one row each: stage ("cells", "prune", "round"),
    cells, nonzero coefficients, digits (0: as they are), mean return, failing, kept. The rows of stage "cells" are the
    curve of return over cells; `attrs` hold the teacher's mean return. Where no number of cells will do, the best one
    goes on and nothing may cost it more than `tolerance`. Raises ValueError as `refine` does, and for a tolerance below
    0.
    """
    check_seed(seed)
    check_refinement(config)
    check_number("tolerance", tolerance, least=0)
    task = get_task(task)
    starts = start_states(task, config.n_validation, seed)
    own = play(teacher, task, starts)
    bar = worth(own, config.failure_price) - tolerance
    tried = _Tried(task, starts, config.failure_price)
    policies = []
    for k in progress(range(1, config.n_cells + 1), "cells tried", total=config.n_cells, unit="sizes"):
        policies.append(refine(teacher, task, dataclasses.replace(config, n_cells=k), seed=seed)[0])
        if tried.reaches(bar, "cells", policies[-1]):
            break
    best = int(np.argmax(tried.worths))
    if tried.worths[best] < bar:  # no number of cells will do
        bar = tried.worths[best] - tolerance
    states = visited(policies[best], task, starts[:N_VISITED])
    policy = prune(gathered(policies[best], states), lambda one: tried.reaches(bar, "prune", one))
    for digits in DIGITS:
        short = rounded(policy, digits)
        if short is not None and tried.reaches(bar, "round", short, digits=digits):
            policy = short
            break
    frame = pd.DataFrame(tried.rows)
    frame.attrs["teacher"] = float(own.returns.mean())
    return policy, frame


def gathered(policy: VoronoiPolicy, states: np.ndarray) -> VoronoiPolicy:
    """The same cells, with codewords nearer to `states` (n, d): a tuning cares about borders alone.

    The borders of up to d + 1 Euclidean cells have a point in common, as far from one codeword as from the others;
    codewords may come nearer to it, all in one proportion, and no border moves. Other policies stay as they are.
    Raises ValueError for no states, or some that do not fit or are not finite.
    """
    states = check_array("states", states, (-1, len(policy.task.low)))
    if not len(states):
        raise ValueError(f"states have shape {states.shape}, expected at least one state")
    points = policy.codewords / policy.scale
    k, d = points.shape
    if policy.metric != "euclidean" or not 1 < k <= d + 1:
        return policy
    middle, unit = states.mean(axis=0) / policy.scale, (states / policy.scale).std(axis=0).mean()
    points = points - middle
    gaps = points[1:] - points[0]
    if np.linalg.matrix_rank(gaps) < k - 1:
        return policy
    apart = 0.5 * np.square(gaps).sum(axis=1)  # x is as far from codeword i as from the first if gaps[i] @ x is this
    arms = points - points[0] - np.linalg.lstsq(gaps, apart, rcond=None)[0]
    common = np.linalg.lstsq(gaps, apart + gaps @ points[0], rcond=None)[0]  # of such points the nearest to the middle
    nearest = -(arms @ common).sum() / np.square(arms).sum()  # that brings the codewords nearest to the middle
    least = unit / np.linalg.norm(arms, axis=1).max()  # but apart
    codewords = (middle + common + max(nearest, least) * arms) * policy.scale
    return _like(policy, codewords, policy.coefficients, policy.scale)


def prune(policy: VoronoiPolicy, good) -> VoronoiPolicy:
    """Set to zero, one by one, the coefficients without which the policy is still `good`, a function of a policy.

    Those go first that move the action least when their input moves by one unit of `policy.scale`.
    """
    policy.check_linear()
    sizes = np.abs(policy.coefficients) * np.append(policy.scale, 1.0)[:, None]
    for place in np.argsort(sizes, axis=None, kind="stable"):
        coefficients = policy.coefficients.copy()
        if not coefficients.flat[place]:
            continue
        coefficients.flat[place] = 0.0
        without = _like(policy, policy.codewords, coefficients, policy.scale)
        policy = without if good(without) else policy
    return policy


def rounded(policy: VoronoiPolicy, digits: int) -> VoronoiPolicy | None:
    """The policy with all its numbers rounded to so many significant digits; None if two codewords become equal."""
    check_count("digits", digits)
    codewords, coefficients, scale = (
        _significant(values, digits) for values in (policy.codewords, policy.coefficients, policy.scale)
    )
    different = len(np.unique(codewords, axis=0)) == len(codewords)
    return _like(policy, codewords, coefficients, scale) if different else None


def _significant(values: np.ndarray, digits: int) -> np.ndarray:
    return np.array([float(f"{value:.{digits}g}") for value in values.flat]).reshape(values.shape)


def _like(policy: VoronoiPolicy, codewords: np.ndarray, coefficients: np.ndarray, scale: np.ndarray) -> VoronoiPolicy:
    about = {"task": policy.task, "metric": policy.metric, "sub_policy": policy.form.name}
    return VoronoiPolicy(codewords, coefficients, scale=scale, **about)


class _Tried:
    """What was tried, and how it did from the same starts."""

    def __init__(self, task: Task, starts: np.ndarray, price: float):
        self.rows, self.worths = [], []
        self._task, self._starts, self._price = task, starts, price

    def reaches(self, bar: float, stage: str, policy: VoronoiPolicy, *, digits: int = 0) -> bool:
        """Play `policy`, note it, and say whether it is worth at least `bar`."""
        result: Outcomes = play(policy, self._task, self._starts)
        self.worths.append(worth(result, self._price))
        about = {"stage": stage, "cells": len(policy), "nonzero": np.count_nonzero(policy.coefficients)}
        scores = {"mean": result.returns.mean(), "failing": np.mean(result.codes != GOAL)}
        self.rows.append({**about, "digits": digits, **scores, "kept": self.worths[-1] >= bar})
        return self.rows[-1]["kept"]
