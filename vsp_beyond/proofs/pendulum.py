"""Prove for Pendulum and a policy of linear maps: a set around upright that it never leaves, and from where it gets
there.

The states, angle and angular velocity, are cut into boxes (`grid`). Each coordinate after a step is a smooth function
of the state. So over a box it differs from its value in the middle by no more than its steepest slope allows. The proof
holds for the program, which observes float32 and rounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsp.checks import check_count
from vsp.policy import VoronoiPolicy
from vsp.tasks.pendulum import TASK

from .grid import ROUNDING, SEEN, Way, around, invariant, steps_into, touches
from .proof import Proof, check_provable

FASTEST, LIMIT = 8.0, 2.0  # largest angular velocity, rad/s; largest torque
START_SPEED = 1.0  # rad/s, largest of the starts
DT, FALL, PUSH = 0.05, 0.75, 0.15  # per step: seconds, and what sine and torque add to the angular velocity
REACH = np.array([1.0, 1.0, FASTEST])  # the largest observations
UPRIGHT = 0.5  # rad: a set "around upright" lies within this angle


@dataclass(frozen=True)
class PendulumProof(Proof):
    """What is proved for the boxes of an n by n grid. The boxes of row i begin at angle -pi + 2 pi i / n, those of
    column j at angular velocity -8 + 16 j / n."""

    kept: np.ndarray  # (n, n) whether the box belongs to a set around upright that no step leaves
    steps: np.ndarray  # (n, n) the most steps into that set; 0: not proved

    @property
    def starts(self) -> np.ndarray:
        """Which columns hold starts: angular velocities below 1 rad/s. (n,)"""
        n = len(self.steps)
        middle = FASTEST * (2 * (np.arange(n) + 0.5) / n - 1)
        return np.abs(middle) < START_SPEED

    @property
    def share(self) -> float:
        """The share of starts from which the pendulum is proved to get into the set."""
        return float((self.steps > 0)[:, self.starts].mean())

    @property
    def claim(self) -> dict:
        """The grid's `n`, the number of proved boxes of starts, the number of all boxes of starts, and the most steps
        from any box."""
        of_starts = (self.steps > 0)[:, self.starts]
        longest = int(self.steps[~self.kept].max(initial=0))
        return {"n": len(self.steps), "proved": int(of_starts.sum()), "starts": of_starts.size, "longest": longest}

    def parts(self) -> list:
        """Return for each row its runs of boxes: steps (-1 in the set), length, steps, length, ..."""
        runs = []
        for row in np.where(self.kept, -1, self.steps):
            begins = np.flatnonzero(np.diff(row, prepend=row[0] - 1))
            lengths = np.diff(begins, append=len(row))
            runs.append(np.column_stack([row[begins], lengths]).ravel().tolist())
        return runs


def prove_pendulum(policy: VoronoiPolicy, *, n: int = 1008) -> PendulumProof:
    """Prove from which boxes the pendulum gets upright within 200 steps, and stays. Takes seconds, and 200 bytes a box.

    Raises ValueError for a policy that is not made of linear maps and Euclidean or Manhattan cells for Pendulum, and
    for an `n` that is not divisible by 16 (else starts are not whole boxes) or above 8000."""
    check_provable(policy, TASK)
    check_count("n", n, most=8000)
    if n % 16:
        raise ValueError(f"n is {n}, expected a multiple of 16")
    ways = [_way(policy, cell, n) for cell in range(len(policy))]
    angle = np.pi * (2 * (np.arange(n) + 0.5) / n - 1)
    near = np.repeat((np.abs(angle) + np.pi / n < UPRIGHT)[:, None], n, axis=1)
    kept = invariant(near, ways, periodic=True)
    return PendulumProof(policy, kept, steps_into(kept, ways, TASK.max_steps, periodic=True))


def _way(policy: VoronoiPolicy, cell: int, n: int) -> Way:
    """Bound where a step by the map of `cell` leads from each box that touches the cell."""
    half = np.array([np.pi, FASTEST]) / n  # of a box
    angles, speeds = (width * (2 * np.arange(n) + 1 - n) for width in half)  # their middles
    touched = _touched(policy, cell, angles, speeds, half)
    angle, speed = angles[touched // n], speeds[touched % n]
    (w_cos, w_sin, w_speed, bias), (cos, sin) = policy.coefficients[cell, :, 0], (np.cos(angle), np.sin(angle))
    slack = SEEN * (abs(w_cos) + abs(w_sin) + FASTEST * abs(w_speed)) + ROUNDING

    raw = w_cos * cos + w_sin * sin + w_speed * speed + bias
    slope = np.abs(w_sin * cos - w_cos * sin) + (abs(w_cos) + abs(w_sin)) * half[0]
    spread = slope * half[0] + abs(w_speed) * half[1] + slack
    torque, doubt, free = limited(raw, spread, LIMIT)
    # The new speed in the middle, and its slopes along the angle and along the speed
    along = np.where(free, (FALL + PUSH * w_sin) * cos - PUSH * w_cos * sin, FALL * cos)
    bend = FALL + PUSH * (abs(w_cos) + abs(w_sin)) * free
    across = np.where(free, 1 + PUSH * w_speed, 1.0)
    rest = PUSH * np.where(free, slack, doubt) + ROUNDING
    new_speed = speed + FALL * sin + PUSH * torque
    new_angle = angle + DT * new_speed
    speed_by = (np.abs(along) + bend * half[0]) * half[0] + np.abs(across) * half[1] + rest
    angle_by = (np.abs(1 + DT * along) + DT * bend * half[0]) * half[0] + DT * (np.abs(across) * half[1] + rest)

    speeds = [np.clip(new_speed + side * speed_by, -FASTEST, FASTEST) for side in (-1, 1)]
    at_limit = np.abs(new_speed) + speed_by > FASTEST  # there the new angle follows from the limited speed
    ends = [
        np.where(at_limit, angle + side * half[0] + DT * speed_there, new_angle + side * angle_by)
        for side, speed_there in zip((-1, 1), speeds)
    ]
    return Way(touched, *boxes_between(ends, speeds, n), np.ones(len(touched), dtype=bool))


def limited(value: np.ndarray, spread: np.ndarray, limit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Limit numbers, known up to `spread`, to -`limit` to `limit`. Return their middle values, how far they may be from
    these, and where the limit surely does not act: there the values stay, and 0 stands for `spread`."""
    low, high = (np.clip(value + side * spread, -limit, limit) for side in (-1, 1))
    free = np.abs(value) + spread <= limit
    return np.where(free, value, (low + high) / 2), np.where(free, 0.0, (high - low) / 2), free


def boxes_between(angles: list[np.ndarray], speeds: list[np.ndarray], n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first box between two angles and two speeds, and the exclusive end of these boxes, as in `Way`. Angles
    may be any number of turns away, but less than a turn apart."""
    low, high = ((end / FASTEST + 1) * n / 2 + side * ROUNDING for end, side in zip(speeds, (-1, 1)))
    first, last = around(low, high, n)
    low, high = ((end / np.pi + 1) * n / 2 + side * ROUNDING * n for end, side in zip(angles, (-1, 1)))
    begin, end = np.ceil(low).astype(np.int32) - 1, np.floor(high).astype(np.int32) + 1
    turns = begin // n * n
    return np.stack([begin - turns, first]), np.stack([end - turns, last])


def _touched(policy: VoronoiPolicy, cell: int, angles: np.ndarray, speeds: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the boxes of which a part may be in a cell, by the ranges of cosine, sine and speed."""
    n, ends = len(angles), []
    for sign in (-1, 1):
        waves = np.clip(np.stack([np.cos(angles), np.sin(angles)]) + sign * half[0], -1.0, 1.0)
        observed = np.vstack([np.repeat(waves, n, axis=1), np.tile(speeds + sign * half[1], n)])
        ends.append(observed + sign * SEEN * FASTEST)
    low, high = ends
    return np.flatnonzero(touches(policy, cell, low, high, REACH))
