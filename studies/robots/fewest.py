"""Find the fewest numbers that keep most of a robot's return: remove cells, small coefficients, and digits."""

from __future__ import annotations

import numpy as np
import pandas as pd

from vsp.checks import check_count, check_number, check_seed
from vsp.policy import VoronoiPolicy
from vsp.rollouts import rollout, visited_states
from vsp.run.progress import progress
from vsp_beyond.few_cells.simplification import like, rounded

DIGITS = (1, 2, 3, 4)  # significant digits to try, the fewest first


def fewest_numbers(
    policy: VoronoiPolicy, *, keep: float, n_episodes: int, seed: int
) -> tuple[VoronoiPolicy, pd.DataFrame]:
    """Return `policy` with fewer cells, coefficients and digits, and at least `keep` of its mean return.

    Cells are removed one by one, the least visited first; their states then belong to the next codewords. Coefficients
    are set to zero together, in order of increasing effect on the action where their cell acts; a bisection finds how
    many, as if more zeros never returned more. Every candidate plays
    `n_episodes` episodes from the same starts. Returns the policy, and a row per candidate: stage ("cells", "zeros",
    "digits"), cells, nonzero coefficients, digits (0: all), mean return, kept. Raises ValueError unless `policy` has
    linear cells and a positive mean return, and for a bad seed.
    """
    check_seed(seed)
    check_count("n_episodes", n_episodes)
    check_number("keep", keep, least=0.0, most=1.0)
    policy.check_linear()
    starts = policy.task.start(np.random.default_rng(seed), n_episodes)
    own = float(rollout(policy, policy.task, starts).returns.mean())
    if own <= 0:
        raise ValueError(f"the policy returns {own:.4g} on average, expected more than 0: `keep` is a share of it")
    rows = []

    def good(stage: str, candidate: VoronoiPolicy, digits: int = 0) -> bool:
        mean = float(rollout(candidate, candidate.task, starts).returns.mean())
        size = {"cells": len(candidate), "nonzero": np.count_nonzero(candidate.coefficients), "digits": digits}
        rows.append({"stage": stage, **size, "mean": mean, "kept": mean >= keep * own})
        return rows[-1]["kept"]

    policy = _fewer_cells(policy, starts, good)
    policy = _more_zeros(policy, starts, good)
    for digits in DIGITS:
        short = rounded(policy, digits)
        if short is not None and good("digits", short, digits):
            policy = short
            break
    return policy, pd.DataFrame(rows)


def _fewer_cells(policy: VoronoiPolicy, starts: np.ndarray, good) -> VoronoiPolicy:
    """Remove the least visited cells, as long as the policy stays `good`; each is tried once."""
    visits = _visits(policy, visited_states(policy, policy.task, starts))
    places = list(range(len(policy)))
    order = np.argsort(visits, kind="stable").tolist()
    for cell in progress(order, "cells tried", total=len(order), unit="cells"):
        others = [one for one in places if one != cell]
        if others and good("cells", _only(policy, others)):
            places = others
    return _only(policy, places)


def _more_zeros(policy: VoronoiPolicy, starts: np.ndarray, good) -> VoronoiPolicy:
    """Set coefficients to zero, by bisection over their number, as if the policy were `good` up to some number only."""
    states = visited_states(policy, policy.task, starts)
    effect = np.abs(policy.coefficients) * _spread(policy, states)
    order = np.argsort(effect, axis=None, kind="stable")
    least, most, best = 0, len(order), policy
    n = most.bit_length()
    for _ in progress(range(n), "numbers of zeros tried", total=n, unit="numbers"):
        if (middle := (least + most) // 2) == least:
            break
        coefficients = policy.coefficients.copy()
        coefficients.flat[order[:middle]] = 0.0
        candidate = like(policy, policy.codewords, coefficients, policy.scale)
        if good("zeros", candidate):
            least, best = middle, candidate
        else:
            most = middle
    return best


def _visits(policy: VoronoiPolicy, states: np.ndarray) -> np.ndarray:
    return np.bincount(policy.cells(states), minlength=len(policy))


def _spread(policy: VoronoiPolicy, states: np.ndarray) -> np.ndarray:
    """Return how much each input varies where a cell acts (1 for the bias), times the square root of the cell's share
    of the states. (k, d + 1, 1)"""
    own, found = policy.cells(states), np.ones(policy.coefficients.shape[:2])
    for cell in range(len(policy)):
        here = states[own == cell]
        found[cell, :-1] = here.std(axis=0) if len(here) else 0.0
        found[cell] *= np.sqrt(len(here) / len(states))
    return found[:, :, None]


def _only(policy: VoronoiPolicy, cells: list[int]) -> VoronoiPolicy:
    return like(policy, policy.codewords[cells], policy.coefficients[cells], policy.scale)
