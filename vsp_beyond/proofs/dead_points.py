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
    rounding of g. Raises ValueError for a policy of another task or class, and for the metric "chebyshev"."""
    check_provable(policy, TASK)
    parts, rows = list[tuple[Fraction, Fraction, int]](), []
    for low, high in pairwise(_possible_borders(policy)):
        cell = int(np.argmin(_distances(policy, (low + high) / 2)))
        if parts and parts[-1][2] == cell:  # no border: a third codeword is nearer
            low, _, _ = parts.pop()
        parts.append((low, high, cell))
    for low, high, cell in parts:
        weight, _, bias = policy.coefficients[cell, :, 0]
        ends = np.array([float(low), float(high)])
        rows.append([*ends, cell, *(1000 * acceleration(ends, weight * ends + bias))])
    table = pd.DataFrame(rows, columns=["low", "high", "cell", "g_low", "g_high"])
    return table.assign(dead=table["g_low"] * table["g_high"] <= 0.0)


def _possible_borders(policy: VoronoiPolicy) -> list[Fraction]:
    """Return the ends of the line of starts, and all places between at which two codewords are equally near, or at
    which a Manhattan distance bends."""
    bends = [Fraction(float(place)) for place in policy.codewords[:, 0]]
    ends = sorted({LOW, HIGH, *(bend for bend in bends if LOW < bend < HIGH)})
    borders = set(ends)
    for low, high in pairwise(ends):
        at_low, at_high = _distances(policy, low), _distances(policy, high)
        for i, j in combinations(range(len(policy)), 2):
            gap, gap_at_high = at_low[i] - at_low[j], at_high[i] - at_high[j]
            if gap * gap_at_high < 0:  # the difference is linear between them
                borders.add(low + (high - low) * gap / (gap - gap_at_high))
    return sorted(borders)


def _distances(policy: VoronoiPolicy, x: Fraction) -> np.ndarray:
    """Return the exact distances from the state (x, 0) to the codewords, squared if they are Euclidean. (k,)"""
    exact = np.vectorize(Fraction, otypes=[object])
    gaps = np.abs([x, Fraction(0)] - exact(policy.codewords)) / exact(policy.scale)
    return (gaps if policy.metric == "manhattan" else gaps**2).sum(axis=1)
