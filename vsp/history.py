"""What happened during one distillation, so that a notebook can replay it."""

from __future__ import annotations

from bisect import bisect_right
from typing import NamedTuple

import numpy as np
import pandas as pd

from .checks import check_count
from .partition import Partition
from .policy import VoronoiPolicy

SNAPSHOT_EVERY = 10  # iterations between two stored copies of the parameters
SNAPSHOTS = 500  # of a longer run, where more iterations lie between two of them: memory is bounded


class Event(NamedTuple):
    """A codeword that came by a split or went by a merge."""

    iteration: int
    kind: str  # "split" or "merge"
    codeword: np.ndarray  # (d,)


class History:
    """Cells, losses and events over the iterations of one run, and snapshots of the policy on the way.

    Snapshots are about `SNAPSHOTS` at most, and one per change of the codewords. What grows with the iterations is two
    numbers for each, 40 bytes.
    """

    def __init__(self, n_iterations: int = 0) -> None:
        self.every = max(SNAPSHOT_EVERY, n_iterations // SNAPSHOTS)  # iterations between two snapshots
        self.events: list[Event] = []
        self.cells: list[int] = []  # number of cells after each iteration
        self.losses: list[float] = []  # minibatch loss of each iteration before its step, averaged over cells
        self._snapshots: list[tuple[int, VoronoiPolicy]] = []

    def add_events(self, n: int, kind: str, codewords: list[np.ndarray]) -> None:
        """Note the codewords that a pass of iteration n added or removed."""
        self.events += [Event(n, kind, codeword) for codeword in codewords]

    def observe(self, n: int, loss: float, partition: Partition) -> None:
        """Note how iteration n left the partition."""
        self.cells.append(len(partition.codewords))
        self.losses.append(loss)
        changed = self.events and self.events[-1].iteration == n
        if changed or n % self.every == 0:
            self._snapshots.append((n, partition.policy()))

    def policy_at(self, n: int) -> VoronoiPolicy:
        """The policy after iteration n, fewer than `every` iterations old. Raises ValueError outside the run."""
        check_count("iteration", n, least=0, most=len(self.cells) - 1)
        return self._snapshots[bisect_right(self._snapshots, n, key=lambda snapshot: snapshot[0]) - 1][1]

    def to_frame(self) -> pd.DataFrame:
        """One row per iteration: cells, loss, splits, merges."""
        frame = pd.DataFrame({"cells": self.cells, "loss": self.losses}).rename_axis("iteration")
        for kind in ("split", "merge"):
            counts = pd.Series([e.iteration for e in self.events if e.kind == kind], dtype=int).value_counts()
            frame[f"{kind}s"] = counts.reindex(frame.index, fill_value=0)
        return frame
