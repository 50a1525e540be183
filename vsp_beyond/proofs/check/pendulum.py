"""Check Pendulum's certificates: from every box of a grid, a step leads to boxes that need one step fewer.

A certificate names a policy, a claim, and for each row of boxes (one range of angles) runs of boxes along the angular
velocity. Each run has a number: -1 in the set that no step leaves, n for "at most n steps to it", 0 for nothing
claimed. The next state is a sum of one sine wave of the angle and a linear function of the velocity. So it is largest
at the ends of the box, or at the crest of the wave.
"""

from __future__ import annotations

import numpy as np

from .refused import Refused

FASTEST, LIMIT, N_STEPS = 8.0, 2.0, 200
DT, FALL, PUSH = 0.05, 0.75, 0.15
SIDES = np.array([[-1.0], [1.0]])
SEEN, ROUNDING = 1e-7, 1e-10  # observations are float32; float64 loses less
TIES = 1e-12  # relative difference of distances that rounding may decide


def check_content(content: dict) -> dict:
    """Return the claim of a certificate that was read. Raises `Refused` if it is not proved."""
    claim, numbers = content["claim"], unpacked(content["pieces"])
    n = len(numbers)
    if numbers.dtype.kind != "i":
        raise Refused("the numbers of the boxes are not whole numbers")
    if n % 16 or numbers.shape != (n, n) or not -1 <= numbers.min() <= numbers.max() <= N_STEPS:
        raise Refused(f"the grid is {numbers.shape}, numbers are {numbers.min()} to {numbers.max()}")
    middle = (2 * (np.arange(n) + 0.5) / n - 1) * FASTEST
    starts = numbers[:, np.abs(middle) < 1.0]
    proved = {"n": n, "proved": int((starts != 0).sum()), "starts": starts.size, "longest": int(numbers.max())}
    if claim != proved:
        raise Refused(f"the boxes prove {proved}, but the claim is {claim}")
    farthest = np.pi * (np.abs(2 * np.arange(n) + 1 - n) + 1) / n  # angle of each row's end, from upright
    if (numbers[farthest > 0.5] == -1).any():
        raise Refused("a box of the set is more than 0.5 rad from upright")
    worst = np.tile(np.where(numbers == 0, N_STEPS + 1, np.maximum(numbers, 0)), (2, 1))
    with np.errstate(over="raise", invalid="raise"):
        policy = Policy(**content["policy"])
        for i in range(n):
            check_row(policy, i, numbers[i], worst)
    return claim


def unpacked(rows: list[list[int]]) -> np.ndarray:
    """Return the numbers of all boxes, from runs: number, length, number, length, ..."""
    return np.stack([np.repeat(row[::2], row[1::2]) for row in rows])


def check_row(policy: Policy, i: int, numbers: np.ndarray, worst: np.ndarray) -> None:
    """Raise `Refused` where a step from a box of row `i` may lead to boxes that do not need fewer steps."""
    n = len(numbers)
    boxes = np.flatnonzero(numbers)
    angle = (2 * np.array([i, i + 1]) / n - 1) * np.pi
    speed = (2 * np.stack([boxes, boxes + 1]) / n - 1) * FASTEST
    allowed, in_cell = np.maximum(numbers[boxes] - 1, 0), np.zeros(len(boxes), dtype=bool)
    for cell in range(len(policy.maps)):
        next_angle, next_speed, kept = policy.after(cell, angle, speed)
        in_cell[kept] = True
        rows = np.floor((next_angle / np.pi + 1) * n / 2).astype(int)
        columns = np.floor((next_speed / FASTEST + 1) * n / 2).astype(int).clip(0, n - 1)
        rows -= rows[0] // n * n  # full turns
        for down in range((rows[1] - rows[0]).max(initial=0) + 1):
            for across in range((columns[1] - columns[0]).max(initial=0) + 1):
                at = np.minimum(rows[0] + down, rows[1]), np.minimum(columns[0] + across, columns[1])
                if (bad := worst[at] > allowed[kept]).any():
                    box = boxes[kept][bad][0]
                    raise Refused(f"box {i}, {box} has {numbers[box]}, but may lead to one with {worst[at][bad][0]}")
    if not in_cell.all():
        raise Refused(f"a box of row {i} is in no cell")


class Policy:
    """Linear maps of cosine, sine and speed, each for the observations that are nearest to its codeword."""

    def __init__(self, codewords, coefficients, scale, metric):
        if metric not in ("euclidean", "manhattan"):
            raise Refused(f"the metric is {metric!r}, expected 'euclidean' or 'manhattan'")
        self.power = 1 if metric == "manhattan" else 2
        self.codewords, self.scale, self.maps = np.array(codewords), np.array(scale), np.array(coefficients)[:, :, 0]
        reach = (np.abs(self.codewords).max(axis=0) + [1.0, 1.0, FASTEST]) / self.scale
        self.tie = TIES * float(np.sum(reach**self.power))

    def after(self, cell: int, angle: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bound a step from those boxes of a row that touch a cell. Return the ranges of the new angle and the new
        speed (2, m), and which boxes these are (m,)."""
        touched = np.flatnonzero(self.touches(cell, angle, speed))
        speed, (w_cos, w_sin, w_speed, bias) = speed[:, touched], self.maps[cell]
        slack = SIDES * (SEEN * (abs(w_cos) + abs(w_sin) + FASTEST * abs(w_speed)) + ROUNDING)
        torque = wave(w_cos, w_sin, angle) + np.sort(w_speed * speed, axis=0) + bias + slack
        free = (np.abs(torque) <= LIMIT).all(axis=0)
        push = PUSH * np.clip(torque, -LIMIT, LIMIT)
        # Where no limit acts, torque and fall add up to a wave of the angle and a line of the speed
        cosine, sine = PUSH * w_cos, FALL + PUSH * w_sin
        line = np.sort((1 + PUSH * w_speed) * speed, axis=0) + PUSH * (bias + slack)
        new_speed = np.where(free, wave(cosine, sine, angle) + line, wave(0.0, FALL, angle) + speed + push)
        # These waves are flat, so the new angle rises with the angle and is largest at the ends
        if DT * np.hypot(cosine, sine) >= 1:
            raise Refused(f"cell {cell} is too steep to be checked")
        ends, fall = angle[:, None], np.sin(angle[:, None])
        together = ends + DT * (cosine * np.cos(ends) + sine * fall + line)
        new_angle = np.where(free, together, ends + DT * (FALL * fall + speed + push))
        fast = (np.abs(new_speed) > FASTEST).any(axis=0)
        new_speed = np.clip(new_speed, -FASTEST, FASTEST)
        new_angle = np.where(fast, ends + DT * new_speed, new_angle)
        return new_angle + SIDES * ROUNDING, new_speed + SIDES * ROUNDING, touched

    def touches(self, cell: int, angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return which boxes (2, m) may hold a state that is nearest to the codeword of `cell`."""
        ranges = [ends + SIDES * FASTEST * SEEN for ends in (wave(1.0, 0.0, angle), wave(0.0, 1.0, angle), speed)]
        touched = np.ones(speed.shape[1], dtype=bool)
        for other in range(len(self.maps)):
            gap = 0.0
            for values, codeword, rival, scale in zip(ranges, self.codewords[cell], self.codewords[other], self.scale):
                near, far = (np.abs((values - place) / scale) ** self.power for place in (codeword, rival))
                gap = gap + (near - far).min(axis=0)
            touched &= (gap <= self.tie) | (other == cell)
        return touched


def wave(cosine: float, sine: float, angle: np.ndarray) -> np.ndarray:
    """Return the least and the largest value of a sum of cosine and sine over a short range of angles. (2, 1)"""
    size, crest = np.hypot(cosine, sine), np.arctan2(sine, cosine)
    ends = size * np.cos(angle - crest)
    low, high = ends.min(), ends.max()
    turns = (angle - crest) / np.pi  # a crest at every even number, a trough at every odd one
    for k in range(int(np.ceil(turns[0])), int(np.floor(turns[1])) + 1):
        low, high = (low, size) if k % 2 == 0 else (-size, high)
    return np.array([[low], [high]])
