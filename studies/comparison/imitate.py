"""`imitate`: find cells that act as much like the teacher as possible, whereas `distill_tuned` maximises the return.

Annealing alone ends in local optima, where some cells do little and others too much. So cells are relocated: a cell
that the error hardly needs moves to where another cell errs most. All cells are fitted again, and the result is kept if
it is better (split and merge, as for mixtures in Ueda et al. 2000).
"""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from vsp.checks import check_seed
from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy, visited_states
from vsp.tasks.base import Task
from vsp.tasks.registry import get_task
from vsp_beyond.few_cells.anneal import anneal, random_init, squared_error, squared_errors, warm
from vsp_beyond.few_cells.config import Tuned, check_kind
from vsp_beyond.few_cells.units import Cells, LabelledStates, Scaling

N_MOVES = 40  # relocations tried after each restart
SPARE = 3  # number of the least needed cells that may be relocated


@threadpool_limits.wrap(limits=1)
def imitate(teacher: Policy, task: str | Task, config: Tuned, *, seed: int) -> VoronoiPolicy:
    """Find the policy with the least mean squared action error on `config.n_episodes` of the teacher's own episodes.

    Best of `config.n_restarts`; nothing is corrected or tuned. Same arguments, same policy. Raises ValueError for a bad
    seed, and if `config.n_cells` is below 2: then there is nothing to relocate.
    """
    check_seed(seed)
    check_kind(config, Tuned)
    if config.n_cells < 2:
        raise ValueError(f"n_cells is {config.n_cells}, expected at least 2: `distill_tuned` fits one cell")
    task = get_task(task)
    starts, init, batches = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    states = visited_states(teacher, task, task.start(starts, config.n_episodes))
    frame = Scaling.of(task, states)
    seen = frame.labelled(teacher, states)
    found = []
    for _ in range(config.n_restarts):
        cells = anneal(seen, random_init(seen, config.n_cells, init), config, batches)
        for _ in range(N_MOVES):
            moved = anneal(seen, relocate(seen, cells, init), warm(config), batches)
            cells = min(cells, moved, key=lambda one: squared_error(seen, one))
        found.append(cells)
    return frame.policy(min(found, key=lambda one: squared_error(seen, one)))


def relocate(seen: LabelledStates, cells: Cells, rng: np.random.Generator) -> Cells:
    """Move one cell to a state of another cell, where it takes over that cell's map.

    The moved cell is one of those that are needed least: without it, its states would go to their second nearest
    codewords, and the error would grow least. The state is drawn in proportion to its error.
    """
    k, every = len(cells.codewords), np.arange(len(seen.inputs))
    errors, (first, second) = squared_errors(seen, cells), nearest_two(seen, cells)
    own = errors[first, every]
    needed = np.bincount(first, errors[second, every] - own, minlength=k)
    mover = np.argsort(needed, kind="stable")[rng.integers(min(SPARE, k))]
    weights = np.where(first == mover, 0.0, own)
    if not weights.any():
        return cells
    place = rng.choice(every, p=weights / weights.sum())
    codewords, maps = cells.codewords.copy(), cells.coefficients.copy()
    codewords[mover], maps[mover] = seen.inputs[place, :-1], maps[first[place]]
    return Cells(codewords, maps)


def nearest_two(seen: LabelledStates, cells: Cells) -> np.ndarray:
    """Return the nearest and the second nearest codeword of every state. (2, n)"""
    near = cells.closeness(seen.inputs[:, :-1])
    first = near.argmax(axis=0)
    near[first, np.arange(len(first))] = -np.inf
    return np.stack([first, near.argmax(axis=0)])
