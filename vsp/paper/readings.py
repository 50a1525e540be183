"""Readings of Algorithms 2 and 3 that change the passes themselves: R2, R6, R13 and R14 (`make hidden` tries them).

The other open questions are fields of `Config`. With all defaults, the passes do what `vsp.algorithms` does.
"""

from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np

from ..config import Config, check_field, kinds_of
from ..history import Change
from ..partition import Partition
from ..rollouts import Episode

# The fields of `Config` and `Readings` that answer the open questions, R1 to R15
OPEN = (
    "freeze", "split_lookup", "split_metric", "one_split", "periodic_reset", "merge_reset", "merge_visits_removed",
    "batch_size", "n_minibatches", "learning_rate", "initial", "adam_on_reset", "scale", "neighbours", "split_loss",
    "merge_parameters", "split_reset", "split_neighbours", "loss_after_split", "inclusive",
)  # fmt: skip


@dataclass(frozen=True)
class Readings:
    """How a splitting and a merging pass read the paper; `split` and `merge` are for `algorithms.distill`. Raises
    ValueError for an unknown reading."""

    split_lookup: Literal["refreshed", "kept"] = "refreshed"
    """R2. The codewords among which a splitting pass looks states up: all, including those that it has just added
    (Algorithm 2 has line 4 inside the loop), or those that existed before the pass."""
    merge_reset: Literal["survivor_and_neighbours", "neighbours"] = "survivor_and_neighbours"
    """R6. Buffers that a merge resets: those of the survivor and its neighbours (prose), or of the neighbours only
    (Algorithm 3)."""
    merge_visits_removed: bool = False
    """R6. Whether a cell removed earlier in the pass is still visited, as in Algorithm 3, which removes while it
    iterates. If so, it may only remove cells that are visited later; otherwise equal cells would remove each other."""
    split_reset: Literal["cell_and_neighbours", "neighbours"] = "cell_and_neighbours"
    """R13. Buffers that a split resets: those of the neighbours and of the split cell, which still holds states of the
    new cell, or those of the neighbours only (Algorithm 2)."""
    split_neighbours: Literal["old", "new"] = "old"
    """R13. Which neighbours a split resets: those of the split cell (prose: "of the old region") or of the new cell."""
    loss_after_split: Literal["reset", "kept"] = "reset"
    """R14. Whether the running loss restarts after a split. The paper does not state it. By default it restarts, since
    the split already responds to the loss so far."""

    def __post_init__(self) -> None:
        for name, kind in kinds_of(type(self)).items():
            check_field(name, getattr(self, name), kind)

    def split(self, partition: Partition, episode: Episode, config: Config, rng: np.random.Generator) -> list[Change]:
        """Algorithm 2 with these readings. Returns what `vsp.split_regions` does."""
        cells, losses = partition.cells(episode.states), np.zeros(len(episode.states))
        previous, first, added = None, 0, []  # the running loss averages over the states from `first` on
        for t, (state, action) in enumerate(zip(episode.states, episode.actions)):
            i = cells[t]
            if i != previous:
                previous, first = i, t
            losses[t] = partition.loss(i, state, action)
            loss = float(losses[first : t + 1].mean())
            if loss > config.max_pol_loss and partition.far(i, state):
                before = partition.neighbours()[i]
                j = partition.add(state, rng)
                near = np.append(before, False) if self.split_neighbours == "old" else partition.neighbours()[j]  # R13
                near[i] |= self.split_reset == "cell_and_neighbours"  # R13
                partition.reset(near)
                added.append((state.copy(), loss))
                if config.one_split:  # R4
                    break
                if self.split_lookup == "refreshed":  # R2
                    cells = partition.cells(episode.states)
                if self.loss_after_split == "reset":  # R14
                    first = t + 1
        return added

    def merge(self, partition: Partition, config: Config) -> list[Change]:
        """Algorithm 3 with these readings. Returns what `vsp.merge_regions` does."""
        k, coefficients = len(partition.codewords), partition.comparable_coefficients()
        alive, causes = np.ones(k, dtype=bool), np.zeros(k)
        for i in range(k):
            if not alive[i] and not self.merge_visits_removed:  # R6
                continue
            members = alive | (np.arange(k) == i)
            near = np.zeros(k, dtype=bool)
            near[members] = partition.neighbours_of(partition.codewords[members])[members[:i].sum()]
            distances = np.abs(coefficients - coefficients[i]).max(axis=1)
            similar = near & alive & (distances < config.min_param_distance)
            if not alive[i]:
                similar[:i] = False  # earlier cells were visited: two equal cells must not remove each other
            if similar.any():
                alive[similar], causes[similar] = False, distances[similar]
                near[i] |= self.merge_reset == "survivor_and_neighbours"  # R6
                partition.reset(near)
        removed = list(zip(partition.codewords[~alive], causes[~alive].tolist()))
        partition.keep(alive)
        return removed


def defaults(config: Config) -> dict[str, object]:
    """Return every field that answers an open question, with its value in `config` or the default pass."""
    answers = {**asdict(config), **asdict(Readings())}
    return {name: answers[name] for name in OPEN}
