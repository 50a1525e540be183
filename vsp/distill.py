"""Algorithms 1, 2 and 3 of the paper, in this order: distil a teacher to linear policies in Voronoi cells.

The teacher never sees the partition, so its episodes are rolled out in large batches ahead of the loop; the cells'
models are stacked, so one step trains them all. Neither changes the algorithm. Line numbers below refer to the
algorithms as the paper prints them, "R" numbers to `config.py`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from . import readings
from .checks import check_count, check_seed
from .config import Config, Refinement, preset
from .envs import Task, get_task
from .history import History
from .partition import Partition
from .policy import VoronoiPolicy
from .refine import refine
from .rollouts import Episode, Policy, record

# Teacher episodes rolled out together. Of a float32 network's actions the last bits depend on the batch, and what a run
# becomes may hang on them: the number is part of what a seed stands for.
EPISODES_AHEAD = 500


def distill(
    teacher: Policy, task: str | Task, config: Config | Refinement | None = None, *, seed: int
) -> tuple[VoronoiPolicy, History | pd.DataFrame]:
    """Distil `teacher` to a `VoronoiPolicy` (Algorithm 1). Same arguments, same policy.

    `teacher` is anything with `.predict(obs) -> (actions, None)` for batches; `config` defaults to the paper's preset
    of the task, and a `Refinement` hands over to `refine`. The history lets a notebook replay the run.
    Raises ValueError when the teacher does not fit the task, its states or actions are not finite, or `seed` is no
    integer from 0 on.
    """
    check_seed(seed)
    task = get_task(task)
    config = preset(task.name) if config is None else config
    if isinstance(config, Refinement):
        return refine(teacher, task, config, seed=seed)
    if not isinstance(config, Config):
        raise ValueError(f"config is {config!r}, expected a Config or a Refinement, such as vsp.preset({task.name!r})")
    with threadpool_limits(1):  # the same sums in the same order on any machine, and no threads to wait for
        return _distill(teacher, task, config, seed)


def _distill(teacher: Policy, task: Task, config: Config, seed: int) -> tuple[VoronoiPolicy, History]:
    starts, init, batches = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    episodes = teacher_episodes(teacher, task, config.n_iterations, starts)
    partition, history = Partition(task, config), History(config.n_iterations)
    for n in range(config.n_iterations):
        episode = next(episodes)
        if n == 0:
            partition.add(episode.states[0], init)  # l. 1: the first state is the first codeword
        partition.observe(episode)  # l. 3-12
        loss = partition.train(batches)  # l. 13-15
        if may_alter(n, config):  # l. 16
            if due(n, config.n_split, config):  # l. 17-19
                history.add_events(n, "split", split_regions(partition, episode, config, init))
            if due(n, config.n_merge, config):  # l. 20-22
                history.add_events(n, "merge", merge_regions(partition, config))
        if due(n, config.n_reset, config):
            readings.PERIODIC_RESET[config.periodic_reset](partition)
        history.observe(n, loss, partition)
    return partition.policy(), history


def split_regions(partition: Partition, episode: Episode, config: Config, rng: np.random.Generator) -> list[np.ndarray]:
    """Walk along the episode and split each cell where the running mean loss is too high (Algorithm 2).

    Returns the new codewords, each (d,).
    """
    locate = readings.SPLIT_LOOKUP[config.split_lookup](partition)
    affected = readings.SPLIT_NEIGHBOURS[config.split_neighbours]
    carry = readings.LOSS_AFTER_SPLIT[config.loss_after_split]
    most = 1 if config.one_split else len(episode.states)  # R4
    previous, losses, added = None, [], []
    for state, action in zip(episode.states, episode.actions):
        i = locate(state)  # l. 4
        if i != previous:  # l. 5-8
            previous, losses = i, []
        losses.append(partition.loss(i, state, action))  # l. 9
        if np.mean(losses) > config.max_pol_loss and partition.far(i, state):  # l. 10
            before = partition.neighbours()[i]
            j = partition.add(state, rng)  # l. 11-12
            near = affected(before, partition.neighbours()[j])
            near[i] |= config.split_reset == "cell_and_neighbours"  # R13
            partition.reset(near)  # l. 13-14
            losses = carry(losses)
            added.append(state.copy())  # a view would keep all episodes that were rolled out with its own
            if len(added) == most:
                break
    return added


def merge_regions(partition: Partition, config: Config) -> list[np.ndarray]:
    """Remove neighbours whose parameters agree with a cell's own (Algorithm 3). Returns the removed codewords."""
    k = len(partition.codewords)
    parameters = partition.comparable_parameters()
    alive = np.ones(k, dtype=bool)
    visited = np.ones(k, dtype=bool) if config.merge_visits_removed else alive  # R6
    known, graph = None, None  # neighbours among these cells; most cells remove none, and leave it as it is
    for i in range(k):  # l. 1
        if not visited[i]:
            continue
        members = alive.copy()
        members[i] = True
        if not np.array_equal(members, known):
            known, graph = members, partition.neighbours(members)
        near = np.zeros(k, dtype=bool)
        near[members] = graph[np.flatnonzero(members) == i][0]  # l. 2
        apart = np.abs(parameters - parameters[i]).max(axis=1)  # L-infinity
        similar = near & alive & (apart < config.min_param_distance)  # l. 3-4
        if not alive[i]:
            similar[:i] = False  # those before it had their turn: two equal cells must not remove each other
        if similar.any():
            alive &= ~similar  # l. 5-6
            near[i] |= config.merge_reset == "survivor_and_neighbours"  # R6
            partition.reset(near)  # l. 7
    removed = list(partition.codewords[~alive])
    partition.keep(alive)
    return removed


def may_alter(n: int, config: Config) -> bool:
    """R1: whether iteration n may split and merge."""
    return readings.MAY_ALTER[config.freeze](n, config)


def due(n: int, every: int, config: Config) -> bool:
    """R15: whether something that happens `every` so many iterations happens in iteration n."""
    return n % every == 0 and (n > 0 or config.inclusive)


def teacher_episodes(teacher: Policy, task: Task, n: int, rng: np.random.Generator) -> Iterator[Episode]:
    """Yield n episodes of the teacher from random starts, rolled out `EPISODES_AHEAD` at a time."""
    check_count("n", n, least=0)
    while n > 0:
        batch = record(teacher, task, task.start(rng, EPISODES_AHEAD)[:n])
        yield from batch
        n -= len(batch)
