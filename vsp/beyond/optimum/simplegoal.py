"""SimpleGoal's best returns in closed form, and a policy that earns them.

Progress adds up to ten times the distance gained, wherever the way leads; the step into the goal pays 10 in its place.
So it is best to enter from the place outside the goal that is nearest to the origin, an edge at distance 0.1: this pays
10 (d - 0.1) + 10. From starts in the goal that are nearer than that, entering at once is better: 10.
"""

from __future__ import annotations

import numpy as np

from ...checks import check_array
from ...tasks.simplegoal import GOAL_EDGE, PIT_HIGH, PIT_LOW, STRIDE

BESIDE = 1e-6  # from the goal's edge: outside of it, however the observation is rounded


def best_returns(starts: np.ndarray) -> np.ndarray:
    """The highest return from each start (n, 2). (n,)"""
    starts = check_array("starts", starts, (-1, 2))
    return np.maximum(10.0, 10.0 * np.hypot(*starts.T) + 10.0 - 10.0 * GOAL_EDGE)


class Shortest:
    """Around the pit to the door, the place from which to enter the goal, then in: returns the best but 2e-5."""

    DOOR = np.array([GOAL_EDGE + BESIDE, 0.0])

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, 2) for observations (n, 2)."""
        aims = np.apply_along_axis(self._aim, 1, obs.astype(np.float64))
        return np.clip((aims - obs) / STRIDE, -1.0, 1.0), None

    def _aim(self, state: np.ndarray) -> np.ndarray:
        """Where to go next from a state (2,)."""
        (x, y), middle = state, (PIT_LOW + PIT_HIGH) / 2
        if np.abs(state - self.DOOR).max() < BESIDE or np.hypot(x, y) < GOAL_EDGE:
            return np.zeros(2)
        if PIT_LOW < x < PIT_HIGH and PIT_LOW < y < PIT_HIGH:
            return np.array([0.0 if x < middle else 1.0, y])
        if y >= PIT_HIGH and x > PIT_LOW:  # not down into the pit
            return np.array([0.0, y])
        if y > PIT_LOW:
            return np.array([x, 0.0])
        return self.DOOR
