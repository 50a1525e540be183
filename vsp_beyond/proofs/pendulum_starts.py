"""Cut Pendulum's starts into boxes smaller than a grid's, and follow each until it is within boxes that the grid has
proved.

After some steps a box of starts becomes the states c + M d + r, with d from -1 to 1 in both coordinates. M is the
product of the slopes of the steps so far, and r is a remainder. A grid rounds every step up to whole boxes. Here only
curvature, limits and rounding add to r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.run.progress import progress
from vsp.tasks.pendulum import TASK

from .grid import ROUNDING, SEEN, rectangles_within, summed, touches
from .pendulum import DT, FALL, FASTEST, LIMIT, PUSH, REACH, PendulumProof, boxes_between, limited

HALF_WAY = TASK.max_steps // 2  # most steps followed here; the grid proves the other half
WIDEST = 0.1  # rad, or rad/s: a box with a larger half width is given up
MOST_WAYS = 40  # branches of one box, one for each cell that its states may be in; with more it is given up
PARTS, LEVELS = 4, 3  # parts into which each side of a box is cut, and how often boxes are cut
CHUNK = 100_000  # boxes at a time


@dataclass(frozen=True)
class Boxes:
    """Boxes of starts, each with its states after some steps."""

    start: np.ndarray  # (m,) the number of the box
    centre: np.ndarray  # (2, m) c: angle and angular velocity
    slopes: np.ndarray  # (2, 2, m) M
    rest: np.ndarray  # (2, m) bounds on r

    def __len__(self) -> int:
        return len(self.start)

    @property
    def half(self) -> np.ndarray:
        """Half the width of the range of states, in both coordinates. (2, m)"""
        return np.abs(self.slopes).sum(axis=1) + self.rest

    def at(self, index: np.ndarray) -> Boxes:
        """Return the boxes at `index`."""
        return Boxes(*(part[..., index] for part in vars(self).values()))

    def spread(self, along: np.ndarray) -> np.ndarray:
        """Bound the change of a function with slopes `along` (2, m) between the middle and any other state. (m,)"""
        through = np.abs(np.einsum("im,ijm->jm", along, self.slopes)).sum(axis=0)
        return through + (np.abs(along) * self.rest).sum(axis=0)


def shares_of_starts(proof: PendulumProof) -> list[float]:
    """Return the share of starts from which the pendulum surely gets upright within 200 steps, first as proved by a
    grid's `proof`, then by smaller and smaller boxes. Takes a minute.

    Boxes of starts that the grid leaves unproved are cut into `PARTS` x `PARTS` boxes, which are followed. Those that
    stay unproved are cut again, `LEVELS` times in all. Returns `LEVELS` + 1 shares."""
    n = len(proof.steps)
    half = np.array([np.pi, FASTEST]) / n
    left = np.argwhere((proof.steps == 0) & proof.starts).T
    middles, shares = half[:, None] * (2 * left + 1 - n), [proof.share]
    good = summed(~(proof.kept | ((proof.steps > 0) & (proof.steps <= TASK.max_steps - HALF_WAY))), periodic=True)
    for level in range(1, LEVELS + 1):
        half, middles = half / PARTS, _cut(middles, half)
        cuts = range(0, middles.shape[1], CHUNK)
        failed = [_failed(proof.policy, middles[:, i : i + CHUNK], half, good)
                  for i in progress(cuts, f"starts cut {level} times", total=len(cuts), unit="chunks")]  # fmt: skip
        middles = np.concatenate(failed, axis=1)
        shares.append(1.0 - middles.shape[1] / (n * int(proof.starts.sum()) * PARTS ** (2 * level)))
    return shares


def _cut(middles: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the middles of the `PARTS` x `PARTS` boxes in each box. (2, m PARTS^2)"""
    offsets = (2 * np.arange(PARTS) + 1) / PARTS - 1
    grid = np.stack(np.meshgrid(offsets, offsets)).reshape(2, 1, -1) * half[:, None, None]
    return (middles[:, :, None] + grid).reshape(2, -1)


def _failed(policy: VoronoiPolicy, middles: np.ndarray, half: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Return the middles of the boxes, of half width `half`, that are not proved to get upright. (2, m)"""
    m = middles.shape[1]
    slopes = np.zeros((2, 2, m))
    slopes[0, 0], slopes[1, 1] = half
    boxes, failed = Boxes(np.arange(m), middles, slopes, np.full((2, m), ROUNDING)), np.zeros(m, dtype=bool)
    for _ in range(HALF_WAY):
        angles, speeds = ([middle - width, middle + width] for middle, width in zip(boxes.centre, boxes.half))
        arrived = rectangles_within(good, *boxes_between(angles, speeds, good.shape[1] - 1))
        boxes = boxes.at(~arrived)
        lost = (boxes.half > WIDEST).any(axis=0) | (np.bincount(boxes.start, minlength=m) > MOST_WAYS)[boxes.start]
        failed[boxes.start[lost]] = True
        boxes = boxes.at(~failed[boxes.start])
        if not len(boxes):
            break
        ways = [stepped(policy, cell, boxes.at(_touched(policy, cell, boxes))) for cell in range(len(policy))]
        parts = zip(*[vars(way).values() for way in ways])
        boxes = Boxes(*(np.concatenate(part, axis=-1) for part in parts))
    failed[boxes.start] = True
    return middles[:, failed]


def stepped(policy: VoronoiPolicy, cell: int, boxes: Boxes) -> Boxes:
    """Advance the boxes by one step with the map of `cell`."""
    (w_cos, w_sin, w_speed, bias), (angle, speed) = policy.coefficients[cell, :, 0], boxes.centre
    cos, sin, ones = np.cos(angle), np.sin(angle), np.ones(len(boxes))
    curved = boxes.half[0] ** 2 / 2  # times a second derivative: the error of a linear approximation
    bend = np.hypot(w_cos, w_sin)

    raw = w_cos * cos + w_sin * sin + w_speed * speed + bias
    raw_slopes = np.stack([w_sin * cos - w_cos * sin, w_speed * ones])
    slack = SEEN * (abs(w_cos) + abs(w_sin) + FASTEST * abs(w_speed)) + ROUNDING
    torque, doubt, free = limited(raw, boxes.spread(raw_slopes) + bend * curved + slack, LIMIT)
    slopes = np.stack([FALL * cos, ones]) + PUSH * raw_slopes * free
    lost = FALL * curved + PUSH * np.where(free, bend * curved + slack, doubt) + ROUNDING
    new = speed + FALL * sin + PUSH * torque
    new, doubt, free = limited(new, boxes.spread(slopes) + lost, FASTEST)
    slopes, lost = slopes * free, np.where(free, lost, doubt)

    along = np.stack([np.stack([ones, 0 * ones]) + DT * slopes, slopes])  # slopes of the new angle and of the new speed
    rest = np.einsum("ijm,jm->im", np.abs(along), boxes.rest) + np.stack([DT * lost, lost]) + ROUNDING
    return Boxes(boxes.start, np.stack([angle + DT * new, new]), np.einsum("ijm,jkm->ikm", along, boxes.slopes), rest)


def _touched(policy: VoronoiPolicy, cell: int, boxes: Boxes) -> np.ndarray:
    """Return which boxes may have states in a cell, by the ranges of cosine, sine and speed. (m,)"""
    half, (angle, speed) = boxes.half, boxes.centre
    observed = np.stack([np.cos(angle), np.sin(angle), speed])
    # A sine changes by at most its slope times the change of the angle, plus half the square of that change
    change = [np.abs(slope) * half[0] + half[0] ** 2 / 2 for slope in (observed[1], observed[0])]
    width = np.stack([*change, half[1]]) + SEEN * FASTEST
    return touches(policy, cell, observed - width, observed + width, REACH)
