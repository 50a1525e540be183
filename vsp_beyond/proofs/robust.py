"""Prove over a grid what SimpleGoal's program does, also under disturbances.

The square is cut into equal boxes. From each box a step leads into the boxes that its next states can touch, over all
cells that the box may overlap, all roundings, and all disturbances. A box is good if all of these boxes are good or
surely in the goal. Boxes that are good within a given number of steps are found backwards. What is proved in this way
holds for every start, also on borders. What is not proved may still hold. For rounding, the goal is narrower and the
pit wider by `ROUNDING`.
"""

from __future__ import annotations

import numpy as np

from vsp.checks import check_count, check_number
from vsp.policy import VoronoiPolicy
from vsp.tasks.simplegoal import GOAL_EDGE, PIT_HIGH, PIT_LOW, STRIDE, TASK

from .grid import ROUNDING, SEEN, Way, around, steps_into, touches
from .proof import check_provable

TOLERANCE = 1e-4  # of the largest disturbance


def steps_to_goal(policy: VoronoiPolicy, *, disturbance: float = 0.0, n: int = 1000) -> np.ndarray:
    """Return the most steps from any state of each box into the goal, without entering the pit; 0 where this is not
    proved. (n, n)

    Row i, column j: the box from (i / n, j / n). Each step may be disturbed by up to `disturbance` in both coordinates.
    Raises ValueError for a policy that is not made of linear maps for SimpleGoal, and for numbers out of range."""
    check_provable(policy, TASK)
    check_number("disturbance", disturbance, least=0.0, most=1.0)
    check_count("n", n, most=4000)
    edges = np.linspace(0.0, 1.0, n + 1)
    low, high = (np.stack(np.meshgrid(ends, ends, indexing="ij")).reshape(2, -1) for ends in (edges[:-1], edges[1:]))
    ended = (high < GOAL_EDGE - ROUNDING).all(axis=0).reshape(n, n)
    ways = [_way(policy, cell, low, high, disturbance + ROUNDING, n) for cell in range(len(policy))]
    return steps_into(ended, ways, TASK.max_steps)


def largest_disturbance(policy: VoronoiPolicy, *, n: int = 1000) -> float:
    """Return the largest disturbance of a step, to `TOLERANCE`, for which a grid proves that every start outside the
    pit reaches the goal; NaN if this is not proved even without a disturbance. A coarse grid finds a smaller one, by
    about 1 / n."""
    low, high = 0.0, STRIDE
    if not proved(steps_to_goal(policy, n=n)):
        return float("nan")
    while high - low > TOLERANCE:
        middle = (low + high) / 2
        low, high = (middle, high) if proved(steps_to_goal(policy, disturbance=middle, n=n)) else (low, middle)
    return low


def proved(steps: np.ndarray) -> bool:
    """Return whether every start outside the pit reaches the goal, by the result of `steps_to_goal`."""
    return bool((steps > 0)[outside_pit(steps)].all())


def outside_pit(steps: np.ndarray) -> np.ndarray:
    """Return which boxes of a grid like `steps` (n, n) have starts outside the pit. (n, n)"""
    low, high = (np.arange(len(steps)) + end for end in (0, 1))
    within = (low > PIT_LOW * len(steps) - ROUNDING) & (high < PIT_HIGH * len(steps) + ROUNDING)
    return ~np.logical_and.outer(within, within)


def _way(policy: VoronoiPolicy, cell: int, low: np.ndarray, high: np.ndarray, spread: float, n: int) -> Way:
    """Bound where a step by the map of `cell` leads from each box `low` to `high` (2, n * n) that touches the cell."""
    touched = touches(policy, cell, low - SEEN, high + SEEN, np.ones(2))
    low, high = low[:, touched], high[:, touched]
    after_low, after_high = np.empty_like(low), np.empty_like(high)
    for axis in (0, 1):
        *weights, bias = policy.coefficients[cell, :, axis]
        raw = np.stack(_bounds(weights, bias, low - SEEN, high + SEEN))
        free = (np.abs(raw) <= 1.0).all(axis=0)  # no limit acts: bounding state and action together is tighter
        both = _bounds([(i == axis) + STRIDE * w for i, w in enumerate(weights)], STRIDE * bias, low, high)
        slack = spread + STRIDE * SEEN * np.abs(weights).sum()
        for after, before, action, bound, sign in zip((after_low, after_high), (low, high), raw, both, (-1, 1)):
            limited = before[axis] + STRIDE * np.clip(action, -1.0, 1.0)
            after[axis] = np.where(free, bound + sign * slack, limited + sign * spread)
    return way_to(np.flatnonzero(touched), after_low, after_high, n)


def way_to(boxes: np.ndarray, after_low: np.ndarray, after_high: np.ndarray, n: int) -> Way:
    """Return the way from `boxes` (m,) to states between `after_low` and `after_high` (2, m), before the walls limit
    them."""
    after_low, after_high = (np.clip(states, 0.0, 1.0) for states in (after_low, after_high))
    in_pit = np.all((after_high > PIT_LOW - ROUNDING) & (after_low < PIT_HIGH + ROUNDING), axis=0)
    return Way(boxes, *around(after_low * n - ROUNDING, after_high * n + ROUNDING, n), ~in_pit)


def _bounds(weights, bias: float, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest value of a linear function over boxes."""
    ends = [(w * low[i], w * high[i]) if w >= 0 else (w * high[i], w * low[i]) for i, w in enumerate(weights)]
    return tuple(bias + sum(pair[side] for pair in ends) for side in (0, 1))
