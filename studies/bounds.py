"""Compute the returns of SimpleGoal's episodes from the pieces: bounds on the mean over the square.

The rewards for progress of all steps but the last telescope. So an episode that reaches the goal returns
10 |s| - 10 |s'| + 10, where s is the start and s' the state before the last step. If the episode ends in the pit, the
last term is -10. After 50 steps it is 0, and s' is the last state. Distances are convex: over a triangle the mean of
|s'| is at least its value at the centroid, and at most the mean of its values at the corners.
"""

from collections.abc import Sequence

import numpy as np

from vsp.tasks.base import GOAL, PIT, TRUNCATED
from vsp_beyond.proofs.simplegoal import Piece

LAST = {GOAL: 10.0, PIT: -10.0, TRUNCATED: 0.0}
MEAN_DISTANCE = (np.sqrt(2.0) + np.arcsinh(1.0)) / 3  # mean distance of the square's points from the origin
ROUNDING = 1e-11  # far more than float64 loses in these sums


def mean_return(pieces: Sequence[Piece], *, width: float = 1e-6) -> tuple[float, float]:
    """Return bounds on the mean return from all starts of the square, at most `width` apart. `pieces` come from
    `follow`."""
    starts, ends, last = _triangles(pieces)
    areas = _areas(starts)
    sure = 10.0 * MEAN_DISTANCE + float(areas @ last)
    low = high = 0.0
    while True:
        at_corners, at_centre = _distance(ends).mean(axis=1), _distance(ends.mean(axis=1))
        doubt = areas * (at_corners - at_centre)
        done = doubt <= width / 10.0 * areas  # all areas add up to 1
        low, high = low + float(areas[done] @ at_centre[done]), high + float(areas[done] @ at_corners[done])
        if done.all():
            return float(sure - 10.0 * high - ROUNDING), float(sure - 10.0 * low + ROUNDING)
        starts, ends, areas = _quarters(starts[~done]), _quarters(ends[~done]), np.repeat(areas[~done] / 4, 4)


def _triangles(pieces: Sequence[Piece]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut the pieces into triangles (n, 3, 2), the largest first. Return them, the states before the last reward at
    their corners, and that reward (n,)."""
    starts, ends, last = [], [], []
    for piece in pieces:
        corners = piece.starts.points()
        state = piece.state if piece.outcome == TRUNCATED else piece.before
        after = [state.at(*corner) for corner in corners]
        for i in range(1, len(corners) - 1):
            starts.append([corners[0], corners[i], corners[i + 1]])
            ends.append([after[0], after[i], after[i + 1]])
            last.append(LAST[piece.outcome])
    order = np.argsort(-_areas(np.array(starts)), kind="stable")
    return np.array(starts)[order], np.array(ends)[order], np.array(last)[order]


def _areas(triangles: np.ndarray) -> np.ndarray:
    (a, b), (c, d) = (triangles[:, 1] - triangles[:, 0]).T, (triangles[:, 2] - triangles[:, 0]).T
    return 0.5 * np.abs(a * d - b * c)


def _distance(points: np.ndarray) -> np.ndarray:
    return np.hypot(points[..., 0], points[..., 1])


def _quarters(triangles: np.ndarray) -> np.ndarray:
    """Cut each triangle (n, 3, 2) into four of equal area, listed one after another. (4 n, 3, 2)"""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.stack([np.stack(part, axis=1) for part in parts], axis=1).reshape(-1, 3, 2)
