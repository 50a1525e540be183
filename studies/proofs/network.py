"""Prove for SimpleGoal's teacher, a ReLU network, what `vsp_beyond.proofs.robust` proves for a policy of linear maps.

Over a box of states, every unit is an affine function of the state plus a bounded error. A ReLU that is on or off over
the whole box adds no error. Otherwise it adds the error of the best line through its kink. (Affine arithmetic, as in
Singh et al., "Fast and effective robustness certification", 2018.) Errors grow from layer to layer by the absolute
weights, so boxes have to be small. The proof is about the network's real numbers: float32 rounding is left out.
"""

from __future__ import annotations

import numpy as np

from vsp.tasks.simplegoal import GOAL_EDGE, STRIDE, TASK
from vsp.teachers.teacher import Teacher
from vsp_beyond.proofs.grid import steps_into
from vsp_beyond.proofs.robust import ROUNDING, way_to

CHUNK = 8192  # boxes at a time: their units fit into a processor's cache
BEND = 0.385  # half of the largest second derivative of tanh


def teacher_steps_to_goal(teacher: Teacher, *, n: int = 1000) -> np.ndarray:
    """Compute `steps_to_goal` for the teacher. (n, n)

    Takes a minute for a million boxes.
    """
    middles = (np.arange(n) + 0.5) / n
    ends = np.empty((2, 2, n * n))  # low and high, of both coordinates
    for begin in range(0, n * n, CHUNK):
        boxes = np.arange(begin, min(begin + CHUNK, n * n))
        states = np.column_stack([middles[boxes // n], middles[boxes % n]])
        ends[:, :, boxes] = _after(teacher, states, 0.5 / n)
    way = way_to(np.arange(n * n), ends[0] - ROUNDING, ends[1] + ROUNDING, n)
    high = (np.arange(n) + 1) / n < GOAL_EDGE - ROUNDING
    return steps_into(np.logical_and.outer(high, high), [way], TASK.max_steps)


def _after(teacher: Teacher, states: np.ndarray, half: float) -> np.ndarray:
    """Bound the states after a step from boxes around `states` (n, 2), `half` wide on each side. (2, 2, n)"""
    value, slopes, error = affine_outputs(teacher, states, half)
    radius = half * np.abs(slopes).sum(axis=0) + error  # (n, 2)
    action = np.tanh(value)
    steep = 1.0 - action**2
    # Bound x + 0.1 tanh(z) as one affine function, and each term on its own; use the tighter bound
    along = np.eye(2)[:, None, :] + STRIDE * steep * slopes  # (2, n, 2)
    spread = half * np.abs(along).sum(axis=0) + STRIDE * (steep * error + BEND * radius**2)
    middle = states + STRIDE * action
    together = [middle - spread, middle + spread]
    apart = [states + side * half + STRIDE * np.tanh(value + side * radius) for side in (-1, 1)]
    return np.stack([np.maximum(together[0], apart[0]), np.minimum(together[1], apart[1])]).transpose(0, 2, 1)


def affine_outputs(teacher: Teacher, states: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bound the last layer before its tanh over boxes. Return values in the middle (n, m), slopes (d, n, m), and errors
    (n, m)."""
    (n, d), layers = states.shape, [(w.astype(np.float64), b.astype(np.float64)) for w, b in teacher.layers]
    value, slopes, error = states, np.repeat(np.eye(d)[:, None, :], n, axis=1), np.zeros_like(states)
    for i, (weight, bias) in enumerate(layers):
        value, slopes, error = value @ weight + bias, slopes @ weight, error @ np.abs(weight)
        if i < len(layers) - 1:
            radius = half * np.abs(slopes).sum(axis=0) + error
            low, high = value - radius, value + radius
            share = np.where(low >= 0, 1.0, np.where(high <= 0, 0.0, high / np.maximum(high - low, 1e-300)))
            kink = np.where((low < 0) & (high > 0), -share * low / 2, 0.0)  # half the gap between the line and the ReLU
            value, slopes, error = share * value + kink, share * slopes, share * error + kink
    return value, slopes, error
