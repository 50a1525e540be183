"""Record one distillation, so that a notebook can replay it."""

from bisect import bisect_right
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .checks import check_count
from .partition import Partition
from .policy import VoronoiPolicy

if TYPE_CHECKING:
    import pandas as pd

SNAPSHOT_EVERY = 10  # iterations between two stored copies of the coefficients
SNAPSHOTS = 500  # approximate maximum; in long runs snapshots are further apart, which bounds memory


Change = tuple[np.ndarray, float]  # codeword (d,) that a pass added or removed, and its cause as in `Event`


class Event(NamedTuple):
    """A codeword that a split added or a merge removed, and why.

    The cause of a split is the running mean loss, which exceeded `Config.max_pol_loss`. That of a merge is the
    L-infinity distance between the maps of the removed and the remaining cell, which was below
    `Config.min_param_distance`."""

    iteration: int
    kind: str  # "split" or "merge"
    codeword: np.ndarray  # (d,)
    cause: float


class History:
    """Cells, losses and events over the iterations of one run, and snapshots of the policy. There are at most about
    `SNAPSHOTS` snapshots, and one more per change of the codewords. Two numbers are kept per iteration, 40 bytes."""

    def __init__(self, n_iterations: int = 0) -> None:
        self.every = max(SNAPSHOT_EVERY, n_iterations // SNAPSHOTS)  # iterations between two snapshots
        self.events: list[Event] = []
        self.cells: list[int] = []  # number of cells after each iteration
        self.losses: list[float] = []  # minibatch loss of each iteration before its step, averaged over cells
        self._snapshots: list[tuple[int, VoronoiPolicy]] = []

    def __repr__(self) -> str:
        return f"<History of {len(self.cells)} iterations, {len(self.events)} splits and merges; to_frame() shows it>"

    def add_events(self, n: int, kind: str, changes: list[Change]) -> None:
        """Record what a pass of iteration n added or removed."""
        self.events += [Event(n, kind, *change) for change in changes]

    def observe(self, n: int, loss: float, partition: Partition) -> None:
        """Record the partition after iteration n."""
        self.cells.append(len(partition.codewords))
        self.losses.append(loss)
        changed = self.events and self.events[-1].iteration == n
        if changed or n % self.every == 0:
            self._snapshots.append((n, partition.policy()))

    def policy_at(self, n: int) -> VoronoiPolicy:
        """Return the policy after iteration n, or less than `every` iterations before it. Raises ValueError outside the
        run."""
        check_count("iteration", n, least=0, most=len(self.cells) - 1)
        return self._snapshots[bisect_right(self._snapshots, n, key=lambda snapshot: snapshot[0]) - 1][1]

    def to_frame(self) -> "pd.DataFrame":
        """One row per iteration: cells, loss, splits, merges."""
        import pandas as pd  # here, because it takes long to import

        frame = pd.DataFrame({"cells": self.cells, "loss": self.losses}).rename_axis("iteration")
        for kind in ("split", "merge"):
            iterations = [event.iteration for event in self.events if event.kind == kind]
            frame[f"{kind}s"] = np.bincount(iterations, minlength=len(frame))
        return frame
