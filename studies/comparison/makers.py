"""How the compared methods make a policy, each as a function of a teacher, its task, settings and a seed.

The settings say how many cells or leaves there are, and with a `Tuned` how many episodes. A fit to the teacher's own
episodes alone gets as many episodes as the other methods get in all rounds. Methods for robots read a `Walking`.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vsp import Policy, Task, VoronoiPolicy, agent
from vsp.paper.baselines import Tree, kmeans_cells, linear_map
from vsp.rollouts import rollout, visited_states
from vsp_beyond import Faithful, Tuned
from vsp_beyond.few_cells.faithful import distill_faithfully
from vsp_beyond.few_cells.limit import search_limit
from vsp_beyond.few_cells.tune import score
from vsp_beyond.few_cells.tuned import distill_tuned
from vsp_beyond.few_cells.units import LabelledStates, Scaling

from ..rivals.small_network import SmallNetwork, units_for
from ..rivals.trees import LinearTree, ObliqueLinearTree
from ..robots import Walking, imitate_pushed, search_one_map
from ..robots.imitation import COOL
from .global_fit import descend, global_cells, global_tree, greedy_cells
from .tuning import TunableTree, tuned

# Our own


def our_cells(teacher: Policy, task: Task, config: Tuned, seed: int, **changes) -> Policy:
    """Call `distill_tuned`, some settings changed."""
    return distill_tuned(teacher, task, replace(config, **changes), seed=seed)[0]


def no_teacher(teacher: Policy, task: Task, config: Tuned, seed: int) -> Policy:
    """Call `distill_tuned` with a teacher that does nothing, to see what tuning finds without one."""
    m = len(task.action_low)
    return our_cells(agent(lambda obs: np.zeros((len(obs), m))), task, config, seed)


def faithful(teacher: Policy, task: Task, config: Faithful, seed: int, **changes) -> Policy:
    """Call `distill_faithfully` with some settings of the faithful preset changed."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no policy of")  # the row shows what was found
        return distill_faithfully(teacher, task, replace(config, **changes), seed=seed)[0]


def limited(teacher: Policy, task: Task, config: Tuned, seed: int, *, by_teacher: bool = False) -> Policy:
    """Call `search_limit`, from the best policy where it is known, or with `by_teacher` from the teacher."""
    return search_limit(task, config, seed=seed, teacher=teacher if by_teacher else None)


# Fits to states x (n, d) and actions y (n, m), with `size` cells or leaves, `of` a task and a seed

FITS: dict[str, Callable[..., Policy]] = {
    "tree": lambda x, y, size, **of: Tree(x, y, leaves=size),
    "linear tree": lambda x, y, size, task, seed: LinearTree(x, y, leaves=size, task=task),
    "oblique tree": lambda x, y, size, **of: ObliqueLinearTree(x, y, leaves=size, **of),
    "constant oblique tree": lambda x, y, size, **of: ObliqueLinearTree(x, y, leaves=size, constant=True, **of),
    "small network": lambda x, y, size, **of: SmallNetwork(x, y, units=units_for(size, of["task"]), **of),
    "k-means": lambda x, y, size, **of: kmeans_cells(x, y, cells=size, **of),
    "one map": lambda x, y, size, task, seed: linear_map(x, y, task),
    "global cells": global_cells,
    "greedy cells": greedy_cells,
    "global tree": global_tree,
}


def dagger(fits: Sequence[Callable[..., Policy]], teacher: Policy, task: Task, *, rounds: Tuned, seed: int) -> Policy:
    """Run DAgger (Ross et al. 2011): fit, visit states, let the teacher label them, fit again; return the best policy.
    `rounds` sets episodes, corrections and validation. All `fits` are tried in the first round, which helps if they
    differ in their random numbers; only the one with the best first policy is corrected."""
    rng, validation_rng = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(2))
    validation = task.start(validation_rng, rounds.n_validation)
    policy, states = teacher, np.zeros((0, len(task.low)))
    tried: list[tuple[float, Policy]] = []
    for i in range(1 + rounds.n_corrections):
        n = rounds.n_correction_episodes if i else rounds.n_episodes
        states = np.concatenate([states, visited_states(policy, task, task.start(rng, n))])
        actions = np.asarray(teacher.predict(states)[0], dtype=np.float64)
        candidates = [(fit, fit(states, actions)) for fit in fits]
        scores = [score(rollout(policy, task, validation), rounds.failure_penalty) for _, policy in candidates]
        fit, policy = candidates[int(np.argmax(scores))]
        fits = [fit]
        tried.append((max(scores), policy))
    return max(tried, key=lambda pair: pair[0])[1]


def corrected(
    teacher: Policy, task: Task, config: Tuned, seed: int, *, fit: str, rounds: int, by_chance: bool
) -> Policy:
    """Run DAgger with a fit of `FITS`, with as many corrected episodes as ours, in more rounds since it is quick. A fit
    that depends `by_chance` on its seed gets as many restarts as ours; the best is corrected."""
    n, n_fits = config.n_corrections * config.n_correction_episodes, config.n_restarts if by_chance else 1
    config = replace(config, n_corrections=rounds, n_correction_episodes=n // rounds)
    seeds = range(n_fits * seed, n_fits * (seed + 1))
    fits = [partial(FITS[fit], size=config.n_cells, task=task, seed=restart) for restart in seeds]
    return dagger(fits, teacher, task, rounds=config, seed=seed)


def uncorrected(teacher: Policy, task: Task, config: Tuned, seed: int, *, fit: str) -> Policy:
    """Call a fit of `FITS` on the teacher's own episodes."""
    n = config.n_episodes + config.n_corrections * config.n_correction_episodes
    alone = partial(FITS[fit], size=config.n_cells, task=task, seed=seed)
    return dagger([alone], teacher, task, rounds=replace(config, n_corrections=0, n_episodes=n), seed=seed)


def tuned_fit(
    teacher: Policy, task: Task, config: Tuned, seed: int, *, imitation: Callable[..., Policy], **settings
) -> Policy:
    """Tune the policy of `imitation` on the return as `distill_tuned` tunes its cells."""
    return tuned(imitation(teacher, task, config, seed, **settings), teacher, task, config, seed)


def the_teacher(teacher: Policy, task: Task, config: Tuned | Walking, seed: int) -> Policy:
    """Return the teacher itself."""
    return teacher


# Robots


def robot_cells(teacher: Policy, task: Task, config: Walking, seed: int) -> Policy:
    """Call `imitate_pushed`: cells act like the teacher, also after a push or a mistake of their own."""
    return imitate_pushed(teacher, task, config, seed=seed)


def robot_tree(teacher: Policy, task: Task, config: Walking, seed: int) -> Policy:
    """Fit an oblique tree with linear leaves in as many rounds as `robot_cells`, all its numbers together: first from
    random and greedy trees, later from the tree of the round before."""

    def fit(frame: Scaling, labelled: LabelledStates, before: Policy | None, rng: np.random.Generator) -> Policy:
        states, actions = frame.states(labelled.inputs), frame.actions(labelled.actions)
        if before is None:
            return global_tree(states, actions, config.n_cells, task, int(rng.integers(2**31)))
        return descend(before, states, actions, COOL)

    return imitate_pushed(teacher, task, config, seed=seed, fit=fit)


def trained_further(
    teacher: Policy, task: Task, config: Walking, seed: int, *, imitation: Callable[..., VoronoiPolicy | TunableTree]
) -> Policy:
    """Continue the teacher's training with the policy of `imitation` as its actor."""
    from ..robots.further_training import train_further  # imported here, since it imports torch

    start = imitation(teacher, task, config, seed)
    if isinstance(start, TunableTree):
        return train_further(start.frame, start, teacher, config, seed=seed)
    states = visited_states(teacher, task, task.start(np.random.default_rng(seed), config.n_episodes))
    frame = replace(Scaling.of(task, states), scale=start.scale)
    return train_further(frame, frame.cells(start), teacher, config, seed=seed)


def searched(teacher: Policy, task: Task, config: Walking, seed: int, **changes: int) -> Policy:
    """Find one linear map by random search on the return alone, with some settings changed."""
    return search_one_map(task, replace(config, **changes), seed=seed)
