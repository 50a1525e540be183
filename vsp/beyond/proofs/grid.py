"""Proofs by a grid: the states are cut into boxes, and of each box it is known into which boxes its states can go.

Whatever holds of all states of these boxes holds of all episodes, also on borders; what is not proved may hold
nevertheless.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Way:
    """Where a step leads from some boxes: into a rectangle of boxes each."""

    boxes: np.ndarray  # (m,) their indices, in the flat grid
    first: np.ndarray  # (2, m) the first box of the rectangle, in both coordinates
    last: np.ndarray  # (2, m) before which box it ends
    safe: np.ndarray  # (m,) whether nothing that may happen in this step is forbidden

    def among(self, boxes: np.ndarray) -> Way:
        """The way of those boxes for which `boxes`, a mask over the flat grid, is true."""
        kept = boxes[self.boxes]
        return Way(self.boxes[kept], self.first[:, kept], self.last[:, kept], self.safe[kept])


def steps_into(target: np.ndarray, ways: Sequence[Way], most: int, *, periodic: bool = False) -> np.ndarray:
    """The steps, at least one and up to `most`, after which every state of a box is or has been in `target` (n, n); 0
    where that is not proved. A box may have several ways, all of which can happen. (n, n)

    `periodic`: the first coordinate is an angle; ends of rectangles may lie up to one turn beyond the grid.
    """
    found = np.zeros(target.shape, dtype=np.int32)
    for t in range(1, most + 1):
        waiting = found == 0
        ways = [way.among(waiting.ravel()) for way in ways]
        if not (new := waiting & _all_within(target | ~waiting, ways, periodic)).any():
            break
        found[new] = t
    return found


def invariant(inside: np.ndarray, ways: Sequence[Way], *, periodic: bool = False) -> np.ndarray:
    """The largest set of boxes in `inside` (n, n) that no step leaves. (n, n)"""
    kept = inside.copy()
    while True:
        staying = kept & _all_within(kept, ways := [way.among(kept.ravel()) for way in ways], periodic)
        if (staying == kept).all():
            return kept
        kept = staying


def around(low: np.ndarray, high: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The first box that numbers between `low` and `high` touch, and before which it ends; a box is 1 wide. Of numbers
    on an edge, boxes on both sides; not beyond the boxes 0 to n - 1."""
    first = np.clip(np.ceil(low) - 1, 0, n - 1).astype(np.int32)
    return first, np.clip(np.floor(high) + 1, 1, n).astype(np.int32)


def summed(others: np.ndarray, *, periodic: bool = False) -> np.ndarray:
    """How many boxes up to each one are marked in `others` (n, n), a summed-area table; `periodic`: of a turn and the
    next. (n + 1, or 2 n + 1, n + 1)"""
    count = np.zeros((len(others) * (1 + periodic) + 1, others.shape[1] + 1), dtype=np.int32)
    count[1:, 1:] = np.concatenate([others] * (1 + periodic)).cumsum(axis=0, dtype=np.int32).cumsum(axis=1)
    return count


def rectangles_within(count: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Which rectangles of boxes, as in `Way`, hold no marked one, by a table that `summed` made. (m,)"""
    (a, b), (c, d) = first, last
    return count[c, d] - count[a, d] - count[c, b] + count[a, b] == 0


def _all_within(good: np.ndarray, ways: Sequence[Way], periodic: bool) -> np.ndarray:
    """Of which boxes all ways are safe, and lead into boxes that are `good`."""
    count = summed(~good, periodic=periodic)
    found = np.zeros(good.size, dtype=bool)  # a box without a way is not known
    for way in ways:
        found[way.boxes] = True
    for way in ways:
        found[way.boxes[~(rectangles_within(count, way.first, way.last) & way.safe)]] = False
    return found.reshape(good.shape)
