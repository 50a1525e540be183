"""Algorithms 1, 2 and 3 of the paper, in this order: distil a teacher to linear policies in Voronoi cells.

Two speed-ups leave the algorithm unchanged. The teacher's episodes do not depend on the partition, so they are rolled
out in large batches ahead of the loop. The cells' models are stacked, so one step trains all of them. "l. 4" is a line
of the algorithm as the paper prints it; "R1" is an open question, a field of `Config` or a pass of `paper.readings`.
"""

from collections.abc import Callable, Iterator

import numpy as np
from threadpoolctl import threadpool_limits

from .checks import check_count
from .config import Config
from .history import Change, History
from .partition import Partition
from .policy import VoronoiPolicy
from .rollouts import Episode, Policy, collect_episodes
from .run.progress import steps
from .tasks import Task

# Number of teacher episodes rolled out together. The last bits of the teacher's float32 actions depend on the batch,
# and a run may depend on these bits: a seed reproduces a run only with this number.
EPISODES_AHEAD = 500
VERSION = 1  # increase it when a change makes the same arguments give another policy

SplitPass = Callable[[Partition, Episode, Config, np.random.Generator], list[Change]]
MergePass = Callable[[Partition, Config], list[Change]]


@threadpool_limits.wrap(limits=1)  # the same sums in the same order on any machine
def distill(
    teacher: Policy, task: Task, config: Config, *, seed: int, split: SplitPass | None = None,
    merge: MergePass | None = None,
) -> tuple[VoronoiPolicy, History]:  # fmt: skip
    """Algorithm 1: imitate `teacher` by sub-policies, each valid in the Voronoi cell of its codeword.

    `split` and `merge` replace Algorithms 2 and 3, as `paper.readings` does. Returns the policy and the history of the
    run. The same arguments give the same policy. `vsp.distill` checks the arguments first."""
    split, merge = split or split_regions, merge or merge_regions
    starts, init, batches = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    partition, history = Partition(task, config), History(config.n_iterations)
    episodes = teacher_episodes(teacher, task, config.n_iterations, starts)
    for n, episode in enumerate(steps(episodes, "distilling", total=config.n_iterations, unit="iterations")):
        if n == 0:
            partition.add(episode.states[0], init)  # l. 1: the first state is the first codeword
        partition.observe(episode)  # l. 3-12
        loss = partition.train(batches)  # l. 13-15
        if may_alter(n, config):  # l. 16
            if due(n, config.n_split, config):  # l. 17-19
                history.add_events(n, "split", split(partition, episode, config, init))
            if due(n, config.n_merge, config):  # l. 20-22
                history.add_events(n, "merge", merge(partition, config))
        if due(n, config.n_reset, config) and config.periodic_reset == "buffers":  # R5
            partition.clear()
        history.observe(n, loss, partition)
    return partition.policy(), history


def split_regions(partition: Partition, episode: Episode, config: Config, rng: np.random.Generator) -> list[Change]:
    """Algorithm 2: walk along the episode and split each cell where the running mean loss is too high. Returns the new
    codewords, each (d,), with the running mean loss that caused it."""
    previous: int | None = None
    losses: list[float] = []
    added: list[Change] = []
    for state, action in zip(episode.states, episode.actions):
        i = partition.locate(state)  # l. 4 (R2)
        if i != previous:  # l. 5-8
            previous, losses = i, []
        losses.append(partition.loss(i, state, action))  # l. 9
        loss = float(np.mean(losses))
        if loss > config.max_pol_loss and partition.far(i, state):  # l. 10
            affected = np.append(partition.neighbours()[i], False)  # the old region's neighbours (R13)
            affected[i] = True
            partition.add(state, rng)  # l. 11-12
            partition.reset(affected)  # l. 13-14
            added.append((state.copy(), loss))  # a view would keep the whole batch of episodes in memory
            losses = []  # R14
            if config.one_split:  # R4
                break
    return added


def merge_regions(partition: Partition, config: Config) -> list[Change]:
    """Algorithm 3: for each cell, remove neighbours with similar coefficients. Returns the removed codewords, each
    (d,), with the L-infinity distance of its map from that of the cell."""
    before, i = partition.codewords, 0
    causes: dict[tuple, float] = {}
    while i < len(partition.codewords):  # l. 1
        coefficients, near = partition.comparable_coefficients(), partition.neighbours()[i]  # l. 2
        distances = np.abs(coefficients - coefficients[i]).max(axis=1)  # L-infinity
        similar = near & (distances < config.min_param_distance)  # l. 3-4
        if similar.any():
            causes |= zip(map(tuple, partition.codewords[similar]), distances[similar].tolist())
            near[i] = True  # R6
            partition.reset(near)  # l. 7
            partition.keep(~similar)  # l. 5-6
        i += 1 - similar[:i].sum()  # removed cells before this one moved it up
    return [(codeword, causes[tuple(codeword)]) for codeword in before if tuple(codeword) in causes]


def may_alter(n: int, config: Config) -> bool:
    """R1: whether iteration n may split and merge."""
    if config.freeze == "first_n_freeze":
        return n < config.n_freeze
    last = config.n_freeze if config.freeze == "last_n_freeze" else config.n_split
    return n < config.n_iterations - last


def due(n: int, every: int, config: Config) -> bool:
    """R15: whether an event with a period of `every` iterations happens in iteration n."""
    return n % every == 0 and (n > 0 or config.inclusive)


def teacher_episodes(teacher: Policy, task: Task, n: int, rng: np.random.Generator) -> Iterator[Episode]:
    """Yield n episodes of the teacher from random starts, rolled out `EPISODES_AHEAD` at a time."""
    check_count("n", n, least=0)
    for done in range(0, n, EPISODES_AHEAD):
        yield from collect_episodes(teacher, task, task.start(rng, EPISODES_AHEAD)[: n - done])
