"""`simplify`: the fewest cells, then the fewest and shortest coefficients, that keep the return within a tolerance."""

import dataclasses

import numpy as np
import pandas as pd

from vsp import Policy, Task, VoronoiPolicy, get_task, start_states
from vsp.checks import check_number, check_seed
from vsp.rollouts import rollout, visited_states
from vsp.run.progress import progress
from vsp.tasks import GOAL

from .config import Tuned, check_kind
from .tune import score
from .tuned import distill_tuned
from .units import METRIC

N_VISITED = 100  # episodes that show where the states lie
DIGITS = range(1, 17)  # significant digits to try, the fewest first


def simplify(
    teacher: Policy, task: str | Task, config: Tuned, *, tolerance: float, seed: int
) -> tuple[VoronoiPolicy, pd.DataFrame]:
    """The simplest policy that returns at most `tolerance` less than `teacher`; up to `config.n_cells` cells are tried.

    Candidates are compared by `score` from the same `config.n_validation` starts, so report the result from others.
    Returns the policy, its codewords `gathered`, and one row per candidate: stage ("cells", "prune", "round"), cells,
    nonzero coefficients, digits (0: not rounded), mean return, failing, kept. The rows of stage "cells" are the curve
    of return over cells. If no number of cells suffices, the best one is simplified, and `tolerance` counts from its
    return. Raises ValueError as `distill_tuned` does, and for a tolerance below 0."""
    check_seed(seed)
    check_kind(config, Tuned)
    check_number("tolerance", tolerance, least=0)
    task = get_task(task)
    starts = start_states(task, config.n_validation, seed)
    threshold = score(rollout(teacher, task, starts), config.failure_penalty) - tolerance
    policies, scores, rows = [], list[float](), list[dict]()

    def reaches(threshold: float, stage: str, policy: VoronoiPolicy, digits: int = 0) -> bool:
        """Roll out `policy`, add its row, and return whether it scores at least `threshold`."""
        result = rollout(policy, task, starts)
        scores.append(score(result, config.failure_penalty))
        rows.append({
            "stage": stage, "cells": len(policy), "nonzero": np.count_nonzero(policy.coefficients), "digits": digits,
            "mean": result.returns.mean(), "failing": np.mean(result.outcomes != GOAL),
            "kept": scores[-1] >= threshold,
        })  # fmt: skip
        return scores[-1] >= threshold

    for k in progress(range(1, config.n_cells + 1), "cells tried", total=config.n_cells, unit="sizes"):
        policies.append(distill_tuned(teacher, task, dataclasses.replace(config, n_cells=k), seed=seed)[0])
        if reaches(threshold, "cells", policies[-1]):
            break
    best = int(np.argmax(scores))
    if scores[best] < threshold:  # no number of cells suffices
        threshold = scores[best] - tolerance
    states = visited_states(policies[best], task, starts[:N_VISITED])
    policy = prune(gathered(policies[best], states), lambda pruned: reaches(threshold, "prune", pruned))
    for digits in DIGITS:
        short = rounded(policy, digits)
        if short is not None and reaches(threshold, "round", short, digits):
            policy = short
            break
    return policy, pd.DataFrame(rows)


def gathered(policy: VoronoiPolicy, states: np.ndarray) -> VoronoiPolicy:
    """Move the codewords nearer to `states` (n, d) without changing the cells: tuning fixes the borders only. The
    borders of up to d + 1 Euclidean cells have a point in common, at the same distance from all codewords. Moving all
    codewords towards it by the same proportion moves no border. Where the borders have no common point, the policy is
    returned unchanged."""
    points = policy.codewords / policy.scale
    k, d = points.shape
    if not 1 < k <= d + 1:
        return policy
    middle, unit = states.mean(axis=0) / policy.scale, (states / policy.scale).std(axis=0).mean() or 1.0
    points = points - middle
    gaps = points[1:] - points[0]
    if np.linalg.matrix_rank(gaps) < k - 1:
        return policy
    halves = 0.5 * np.square(gaps).sum(axis=1)  # x is equally far from codeword i and the first if gaps[i] @ x is this
    arms = points - points[0] - np.linalg.lstsq(gaps, halves, rcond=None)[0]
    common = np.linalg.lstsq(gaps, halves + gaps @ points[0], rcond=None)[0]  # the common point nearest to the middle
    nearest = -(arms @ common).sum() / np.square(arms).sum()  # proportion that brings codewords nearest to the middle
    least = unit / np.linalg.norm(arms, axis=1).max()  # proportion that keeps them apart
    codewords = (middle + common + max(nearest, least) * arms) * policy.scale
    return VoronoiPolicy(codewords, policy.coefficients, task=policy.task, metric=METRIC, scale=policy.scale)


def prune(policy: VoronoiPolicy, good) -> VoronoiPolicy:
    """Set coefficients to zero one by one, as long as `good`, a function of a policy, returns True. Coefficients are
    tried in order of increasing effect on the action, for a change of the input by `policy.scale`."""
    sizes = np.abs(policy.coefficients) * np.append(policy.scale, 1.0)[:, None]
    for place in np.argsort(sizes, axis=None, kind="stable"):
        coefficients = policy.coefficients.copy()
        if not coefficients.flat[place]:
            continue
        coefficients.flat[place] = 0.0
        without = policy.with_maps(coefficients)
        policy = without if good(without) else policy
    return policy


def rounded(policy: VoronoiPolicy, digits: int) -> VoronoiPolicy | None:
    """Return the policy rounded to `digits` significant digits; None if two codewords become equal."""
    short = np.vectorize(lambda value: float(f"{value:.{digits}g}"))
    codewords, coefficients, scale = map(short, (policy.codewords, policy.coefficients, policy.scale))
    if len(np.unique(codewords, axis=0)) < len(codewords):
        return None
    return VoronoiPolicy(codewords, coefficients, task=policy.task, metric=METRIC, scale=scale)
