"""Prove by a grid: cut the states into boxes, and bound for each box the boxes that its states can go to.

What holds for all states of these boxes holds for all episodes, also on borders. What is not proved may still hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsp.policy import VoronoiPolicy

SEEN = 1e-7  # largest distance of an observation (float32) from the state
TIES = 1e-12  # relative to the distances: far more than float64 loses in one
ROUNDING = 1e-9  # far more than float64 loses in a step


@dataclass(frozen=True)
class Way:
    """Where a step leads from some boxes: from each into a rectangle of boxes."""

    boxes: np.ndarray  # (m,) their indices, in the flat grid
    first: np.ndarray  # (2, m) the first box of the rectangle, in both coordinates
    last: np.ndarray  # (2, m) the exclusive end of the rectangle, in both coordinates
    safe: np.ndarray  # (m,) whether this step surely avoids what is forbidden

    def among(self, boxes: np.ndarray) -> Way:
        """Return the way of those boxes for which `boxes`, a mask over the flat grid, is true."""
        kept = boxes[self.boxes]
        return Way(self.boxes[kept], self.first[:, kept], self.last[:, kept], self.safe[kept])


def steps_into(target: np.ndarray, ways: Sequence[Way], most: int, *, periodic: bool = False) -> np.ndarray:
    """Return for each box the number of steps, 1 to `most`, after which every state of the box is or has been in
    `target` (n, n); 0 where that is not proved. (n, n)

    A box may have several ways, all of which can happen. `periodic`: the first coordinate is an angle, and rectangles
    may end up to one turn beyond the grid."""
    steps = np.zeros(target.shape, dtype=np.int32)
    for t in range(1, most + 1):
        waiting = steps == 0
        ways = [way.among(waiting.ravel()) for way in ways]
        if not (new := waiting & _all_within(target | ~waiting, ways, periodic)).any():
            break
        steps[new] = t
    return steps


def invariant(inside: np.ndarray, ways: Sequence[Way], *, periodic: bool = False) -> np.ndarray:
    """The largest set of boxes in `inside` (n, n) that no step leaves. (n, n)"""
    kept = inside.copy()
    while True:
        staying = kept & _all_within(kept, ways := [way.among(kept.ravel()) for way in ways], periodic)
        if (staying == kept).all():
            return kept
        kept = staying


def around(low: np.ndarray, high: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first box that numbers between `low` and `high` touch, and the exclusive end of these boxes. A box is
    1 wide. A number on an edge touches the boxes on both sides. Only boxes 0 to n - 1 count."""
    first = np.clip(np.ceil(low) - 1, 0, n - 1).astype(np.int32)
    return first, np.clip(np.floor(high) + 1, 1, n).astype(np.int32)


def summed(others: np.ndarray, *, periodic: bool = False) -> np.ndarray:
    """Return a summed-area table: how many boxes up to each one are marked in `others` (n, n). (n + 1, n + 1), or
    (2 n + 1, n + 1) if `periodic`: then it covers two turns."""
    count = np.zeros((len(others) * (1 + periodic) + 1, others.shape[1] + 1), dtype=np.int32)
    count[1:, 1:] = np.concatenate([others] * (1 + periodic)).cumsum(axis=0, dtype=np.int32).cumsum(axis=1)
    return count


def rectangles_within(count: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return which rectangles of boxes, as in `Way`, contain no marked box, by a table from `summed`. (m,)"""
    (a, b), (c, d) = first, last
    return count[c, d] - count[a, d] - count[c, b] + count[a, b] == 0


def _all_within(good: np.ndarray, ways: Sequence[Way], periodic: bool) -> np.ndarray:
    """Return the boxes from which all ways are safe and lead only into boxes that are `good`."""
    count = summed(~good, periodic=periodic)
    within = np.zeros(good.size, dtype=bool)  # for a box without a way, nothing is known
    for way in ways:
        within[way.boxes] = True
    for way in ways:
        within[way.boxes[~(rectangles_within(count, way.first, way.last) & way.safe)]] = False
    return within.reshape(good.shape)


def touches(policy: VoronoiPolicy, cell: int, low: np.ndarray, high: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return which boxes of observations, from `low` to `high` (d, m), may hold one in `cell`. (m,)

    Rounding may decide between codewords that are nearly as near, for observations up to `reach` (d,) in size."""
    power = 1 if policy.metric == "manhattan" else 2  # Euclidean distances are squared, as in the look-up
    sizes = (np.abs(policy.codewords).max(axis=0) + reach) / policy.scale
    tie = TIES * float(np.sum(sizes**power))
    touched = np.ones(low.shape[1], dtype=bool)
    for other in range(len(policy)):
        if other != cell:
            farther = np.zeros(low.shape[1])  # at least, than from `other`: each coordinate adds a monotone function
            for axis, scale in enumerate(policy.scale):
                places = policy.codewords[[cell, other], axis]
                at_ends = [np.abs((end - places[:, None]) / scale) ** power for end in (low[axis], high[axis])]
                farther += np.minimum(*(to_cell - to_other for to_cell, to_other in at_ends))
            touched &= farther <= tie
    return touched
