"""`closest`: cells that act as much like the teacher as so many are found to. `refine` asks what they return instead.

Annealing alone ends in places where some cells have little to do and others too much. So cells are moved: one that is
missed least goes to where another errs most, all are fitted on from there, and what helped is kept (Ueda et al. 2000
split and merge mixtures in this way).
"""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from .checks import check_seed
from .config import Refinement, check_refinement
from .envs import Task, get_task
from .policy import VoronoiPolicy
from .refine import WARM, Cells, Frame, Labelled, anneal, beginning, closeness, squared_error, squared_errors
from .rollouts import Policy, visited

N_MOVES = 40  # tried after each beginning
SPARE = 3  # so many cells that are missed least may be the one that moves


@threadpool_limits.wrap(limits=1)
def closest(teacher: Policy, task: str | Task, config: Refinement, *, seed: int) -> VoronoiPolicy:
    """The least mean squared action error on `config.n_episodes` of the teacher's own episodes that is found.

    Best of `config.n_restarts` beginnings; nothing is corrected or tuned. Same arguments, same policy. Raises
    ValueError for a bad seed, and where `config.n_cells` is below 2: there is nothing to move.
    """
    check_seed(seed)
    check_refinement(config)
    if config.n_cells < 2:
        raise ValueError(f"n_cells is {config.n_cells}, expected at least 2: `refine` fits one cell")
    task = get_task(task)
    starts, init, batches = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    states = visited(teacher, task, task.start(starts, config.n_episodes))
    frame = Frame.of(task, states)
    seen = frame.labelled(teacher, states)
    found = []
    for _ in range(config.n_restarts):
        cells = beginning(seen, config.n_cells, init)
        cells = anneal(seen, cells, config, batches, hottest=config.hottest, n_steps=config.n_steps)
        for _ in range(N_MOVES):
            cells = _better(seen, cells, moved(seen, cells, init), config, batches)
        found.append(cells)
    return frame.policy(min(found, key=lambda cells: squared_error(seen, cells)))


def _better(seen: Labelled, cells: Cells, other: Cells, config: Refinement, rng: np.random.Generator) -> Cells:
    """`cells`, or `other` if it has less error once it has been fitted."""
    hottest = min(config.hottest, WARM * config.coldest)
    other = anneal(seen, other, config, rng, hottest=hottest, n_steps=config.n_steps // 2)
    return min(cells, other, key=lambda one: squared_error(seen, one))


def moved(seen: Labelled, cells: Cells, rng: np.random.Generator) -> Cells:
    """The cells with one of those that are missed least at a state of another, drawn by its error, with that one's map.

    A cell is missed by as much as the error grows where its states go to their second nearest codewords.
    """
    k, every = len(cells.codewords), np.arange(len(seen.inputs))
    errors, (first, second) = squared_errors(seen, cells), nearest_two(seen, cells)
    own = errors[every, first]
    missed = np.bincount(first, errors[every, second] - own, minlength=k)
    mover = np.argsort(missed, kind="stable")[rng.integers(min(SPARE, k))]
    weights = np.where(first == mover, 0.0, own)
    if not weights.any():
        return cells
    place = rng.choice(every, p=weights / weights.sum())
    codewords, maps = cells.codewords.copy(), cells.maps.copy()
    codewords[mover], maps[mover] = seen.inputs[place, :-1], maps[first[place]]
    return Cells(codewords, maps)


def nearest_two(seen: Labelled, cells: Cells) -> np.ndarray:
    """The nearest and the second nearest codeword of every state, (2, n)."""
    near = closeness(seen, cells)
    first = near.argmax(axis=1)
    near[np.arange(len(near)), first] = -np.inf
    return np.stack([first, near.argmax(axis=1)])
