"""Find MountainCar's dead points: starts at rest from which the car never moves.

At rest the car accelerates by g(x) = 0.0015 a(x) - 0.0025 cos 3x, where a is the limited action. Let a be continuous
between the starts -0.6 and -0.4, and let a(-0.6) > 5/3 cos 1.8 and a(-0.4) < 5/3 cos 1.2. Then g(-0.6) > 0 > g(-0.4).
By the intermediate value theorem g(x) = 0 for some x between. From there the car does not move in the first step, nor
in any other. So no such policy reaches the flag from every start. A cell border in between removes this condition:
there the action may jump, and g may jump over zero with it.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, pairwise

import numpy as np
import pandas as pd

from vsp.policy import VoronoiPolicy
from vsp.tasks.mountaincar import TASK

from .proof import check_provable

LOW, HIGH = Fraction(-3, 5), Fraction(-2, 5)  # the starts
PUSH, PULL = 0.0015, 0.0025


def acceleration(x: np.ndarray, push: np.ndarray) -> np.ndarray:
    """Return the change of the velocity in one step, for a car at rest at `x` and the action `push`."""
    return PUSH * np.clip(push, -1.0, 1.0) - PULL * np.cos(3.0 * x)


def at_rest(policy: VoronoiPolicy) -> pd.DataFrame:
    """Return the parts of the line of starts on which the action is continuous, from left to right.

    Columns: low, high (the positions of both ends), cell; g_low, g_high, the acceleration at both ends, times 1000;
    dead, whether the acceleration changes its sign between them, so that there is a dead point. Exact except for the
    rounding of g. Raises ValueError for a policy of another task or class, and for the metric "chebyshev".
    """
    check_provable(policy, TASK)
    rows = []
    for low, high in pairwise(_borders(policy)):
        cell = min(range(len(policy)), key=lambda i: (_distance(policy, (low + high) / 2, i), i))
        weight, _, bias = policy.coefficients[cell, :, 0]
        ends = np.array([float(low), float(high)])
        rows.append([float(low), float(high), cell, *(1000 * acceleration(ends, weight * ends + bias))])
    table = pd.DataFrame(rows, columns=["low", "high", "cell", "g_low", "g_high"])
    runs = (table["cell"] != table["cell"].shift()).cumsum()  # no border where a third codeword is nearer
    table = table.groupby(runs).agg(
        {"low": "first", "high": "last", "cell": "first", "g_low": "first", "g_high": "last"}
    )
    return table.assign(dead=table["g_low"] * table["g_high"] <= 0.0).reset_index(drop=True)


def _borders(policy: VoronoiPolicy) -> list[Fraction]:
    """Return the ends of the line of starts, and all places between at which two codewords are equally near. For the
    Manhattan distance, return also where the difference of two distances bends."""
    borders = {LOW, HIGH}
    for i, j in combinations(range(len(policy)), 2):
        bends = {Fraction(float(policy.codewords[k, 0])) for k in (i, j)} if policy.metric == "manhattan" else set()
        ends = sorted({LOW, HIGH} | {bend for bend in bends if LOW < bend < HIGH})
        borders |= set(ends)
        for low, high in pairwise(ends):
            gap, gap_at_high = (_distance(policy, x, i) - _distance(policy, x, j) for x in (low, high))
            if gap * gap_at_high < 0:  # the difference is linear between them
                borders.add(low + (high - low) * gap / (gap - gap_at_high))
    return sorted(borders)


def _distance(policy: VoronoiPolicy, x: Fraction, i: int) -> Fraction:
    """Return the distance from the state (x, 0) to a codeword, squared if it is Euclidean."""
    total = Fraction(0)
    for value, code, scale in zip((x, Fraction(0)), policy.codewords[i], policy.scale):
        gap = abs(value - Fraction(float(code))) / Fraction(float(scale))
        total += gap if policy.metric == "manhattan" else gap * gap
    return total
