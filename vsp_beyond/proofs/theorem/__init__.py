"""Let a proof kernel check that SimpleGoal's policy with a margin reaches the goal: `make theorem`.

The theorem is `Statement.v`, its proof `Check.v` and `Sound.v`. Coq also needs two files of data, which this module
writes: the policy's numbers, exactly as its certificate holds them, and for each box of a grid a number of steps. The
proof trusts neither the numbers of steps nor anything else that is computed here.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from fractions import Fraction
from math import floor
from pathlib import Path

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.tasks.simplegoal import TASK

from ..grid import Way, steps_into
from ..proof import load_certificate

POLICY = "simplegoal_margin"  # the certificate with the policy's numbers
SOURCES = Path(__file__).parent  # of the theorem and its proof
N = 300  # boxes per axis; a multiple of 10, so that goal and pit are made of whole boxes
FINE = 2**24  # units of a box's width, to which the check rounds outwards
ERROR, TIE = Fraction(1, 2**20), Fraction(1, 2**16)  # of a step in each coordinate; of squared scaled distances
UNPROVED = 62  # steps of a box from which nothing is proved


def terms(policy: VoronoiPolicy) -> list[tuple[Fraction, ...]]:
    """Return the codeword (2) and the two rows of coefficients (3 each) of every cell, exactly."""
    numbers = [[*codeword, *maps.T.flat] for codeword, maps in zip(policy.codewords, policy.coefficients)]
    return [tuple(map(Fraction, row)) for row in numbers]


def steps(policy: VoronoiPolicy) -> np.ndarray:
    """Return for each box the most steps from any of its states to the goal, as Coq will check it; `UNPROVED` where
    the grid is too coarse, or the pit is entered. (N, N)"""
    boxes = np.stack(np.meshgrid(np.arange(N), np.arange(N), indexing="ij")).reshape(2, -1)
    goal = (boxes < N // 10).all(axis=0).reshape(N, N)
    found = steps_into(goal, [_way(policy, cell, boxes) for cell in range(len(policy))], TASK.max_steps)
    return np.where(found > 0, found, UNPROVED)


def _way(policy: VoronoiPolicy, cell: int, boxes: np.ndarray) -> Way:
    """Bound where a step by the map of `cell` leads from the boxes in which it may act, as `image` in Check.v does."""
    cells, scale = terms(policy), [Fraction(unit) for unit in policy.scale.tolist()]
    own, may_act = cells[cell], np.ones(boxes.shape[1], dtype=bool)
    for other in cells:
        x, y = (2 * (other[i] - own[i]) / scale[i] ** 2 for i in (0, 1))
        constant = sum((own[i] ** 2 - other[i] ** 2) / scale[i] ** 2 for i in (0, 1))
        may_act &= _least((x, y, constant - TIE), boxes) <= 0
    boxes = boxes[:, may_act]
    low, high, tenth, spread = [], [], N * FINE // 10, floor(N * FINE * ERROR)
    for axis in (0, 1):
        stride = [weight / 10 for weight in own[2 + 3 * axis : 5 + 3 * axis]]
        moved = [weight + (i == axis) for i, weight in enumerate(stride)]
        first, last = (_least(stride, boxes), _most(stride, boxes))
        below, above = boxes[axis] * FINE + np.clip([first, last], -tenth, tenth) + [[0], [FINE]]
        below = np.where(last <= tenth, np.maximum(below, _least(moved, boxes)), below)
        above = np.where(first >= -tenth, np.minimum(above, _most(moved, boxes)), above)
        low.append(np.clip(below - spread, 0, N * FINE))
        high.append(np.clip(above + spread, 0, N * FINE))
    safe = ((np.array(high) <= 4 * tenth) | (np.array(low) >= 6 * tenth)).any(axis=0)
    first, last = (np.minimum(np.array(ends) // FINE, N - 1).astype(np.int32) for ends in (low, high))
    return Way(np.flatnonzero(may_act), first, last + 1, safe)


def _least(form: Sequence[Fraction], boxes: np.ndarray) -> np.ndarray:
    """Bound p x + q y + r from below, in units of 1 / (N FINE), over boxes (2, m). (m,)"""
    p, q, r = floor(form[0] * FINE), floor(form[1] * FINE), floor(form[2] * FINE * N)
    return p * boxes[0] + q * boxes[1] + (r + min(p, 0) + min(q, 0))


def _most(form: Sequence[Fraction], boxes: np.ndarray) -> np.ndarray:
    return -_least([-number for number in form], boxes)
