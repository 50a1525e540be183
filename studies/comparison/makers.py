"""How the compared methods make a policy, each as a function of a budget, a size and a seed.

The budget is the teacher and the episodes of a `Tuned`. A fit to the teacher's own episodes alone gets as many
episodes as the other methods get in all rounds. Methods that find their own size ignore `size`. Methods for robots read
a `Walking`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vsp import Policy, Task, VoronoiPolicy, agent
from vsp.paper.baselines import Tree, kmeans_cells, linear_map
from vsp.rollouts import visited_states
from vsp_beyond import Faithful, Tuned
from vsp_beyond.few_cells.faithful import distill_faithfully
from vsp_beyond.few_cells.limit import search_limit
from vsp_beyond.few_cells.tuned import distill_tuned
from vsp_beyond.few_cells.units import LabelledStates, Scaling

from ..rivals.dagger import dagger
from ..rivals.small_network import SmallNetwork, units_for
from ..rivals.trees import LinearTree, ObliqueLinearTree
from ..robots import Walking, imitate_pushed, search_one_map
from ..robots.imitation import COOL
from .global_fit import descend, global_cells, global_tree, greedy_cells
from .tuning import TunableTree, tuned


@dataclass(frozen=True)
class Budget:
    """What a method may use: the teacher, its task, and the settings of its preset."""

    teacher: Policy
    task: Task
    config: Tuned | Faithful | Walking


# Our own


def our_cells(budget: Budget, size: int, seed: int, **changes) -> Policy:
    """Call `distill_tuned` with some settings changed."""
    config = replace(budget.config, n_cells=size, **changes)
    return distill_tuned(budget.teacher, budget.task, config, seed=seed)[0]


def no_teacher(budget: Budget, size: int, seed: int) -> Policy:
    """Call `distill_tuned` with a teacher that does nothing, to see what tuning finds without one."""
    m = len(budget.task.action_low)
    return our_cells(replace(budget, teacher=agent(lambda obs: np.zeros((len(obs), m)))), size, seed)


def faithful(budget: Budget, size: int, seed: int, **changes) -> Policy:
    """Call `distill_faithfully` with some settings of the faithful preset changed."""
    config = replace(budget.config, n_cells=size, **changes)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no policy of")  # the row shows what was found
        return distill_faithfully(budget.teacher, budget.task, config, seed=seed)[0]


def limited(budget: Budget, size: int, seed: int, *, by_teacher: bool = False) -> Policy:
    """Call `search_limit`, from the best policy where it is known, or with `by_teacher` from the teacher."""
    teacher = budget.teacher if by_teacher else None
    return search_limit(budget.task, replace(budget.config, n_cells=size), seed=seed, teacher=teacher)


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


def corrected(budget: Budget, size: int, seed: int, *, fit: str, rounds: int, by_chance: bool) -> Policy:
    """Run DAgger with a fit of `FITS`, with as many corrected episodes as ours, in more rounds since it is quick.

    A fit that depends `by_chance` on its seed gets as many restarts as ours; the best is corrected.
    """
    n = budget.config.n_corrections * budget.config.n_correction_episodes
    config = replace(budget.config, n_corrections=rounds, n_correction_episodes=n // rounds)
    return _fitted(FITS[fit], config, budget, size, seed, config.n_restarts if by_chance else 1)


def uncorrected(budget: Budget, size: int, seed: int, *, fit: str) -> Policy:
    """Call a fit of `FITS` on the teacher's own episodes."""
    config = budget.config
    n = config.n_episodes + config.n_corrections * config.n_correction_episodes
    return _fitted(FITS[fit], replace(config, n_corrections=0, n_episodes=n), budget, size, seed, 1)


def tuned_fit(budget: Budget, size: int, seed: int, *, imitation: Callable[..., Policy], **settings) -> Policy:
    """Tune the policy of `imitation` on the return as `distill_tuned` tunes its cells."""
    start = imitation(budget, size, seed, **settings)
    return tuned(start, budget.teacher, budget.task, budget.config, seed)


def _fitted(fit, config: Tuned, budget: Budget, size: int, seed: int, n_restarts: int) -> Policy:
    seeds = range(n_restarts * seed, n_restarts * (seed + 1))
    fits = [partial(fit, size=size, task=budget.task, seed=restart) for restart in seeds]
    return dagger(fits, budget.teacher, budget.task, rounds=config, seed=seed)


# Methods that find their own size


def the_teacher(budget: Budget, size: int, seed: int) -> Policy:
    """Return the teacher itself."""
    return budget.teacher


# Robots


def robot_cells(budget: Budget, size: int, seed: int) -> Policy:
    """Call `imitate_pushed`: cells act like the teacher, also after a push or a mistake of their own."""
    return imitate_pushed(budget.teacher, budget.task, replace(budget.config, n_cells=size), seed=seed)


def robot_tree(budget: Budget, size: int, seed: int) -> Policy:
    """Fit an oblique tree with linear leaves in as many rounds as `robot_cells`, and in the same way.

    All its numbers are fitted together: in the first round from random and from greedy trees, later from the tree of
    the round before.
    """

    def fit(frame: Scaling, labelled: LabelledStates, before: Policy | None, rng: np.random.Generator) -> Policy:
        states, actions = frame.states(labelled.inputs), frame.actions(labelled.actions)
        if before is None:
            return global_tree(states, actions, size, budget.task, int(rng.integers(2**31)))
        return descend(before, states, actions, COOL)

    return imitate_pushed(budget.teacher, budget.task, budget.config, seed=seed, fit=fit)


def trained_further(
    budget: Budget, size: int, seed: int, *, imitation: Callable[..., VoronoiPolicy | TunableTree]
) -> Policy:
    """Continue the teacher's training with the policy of `imitation` as its actor."""
    from ..robots.further_training import train_further  # imported here, since it imports torch

    start, task = imitation(budget, size, seed), budget.task
    if isinstance(start, TunableTree):
        return train_further(start.frame, start, budget.teacher, budget.config, seed=seed)
    states = visited_states(budget.teacher, task, task.start(np.random.default_rng(seed), budget.config.n_episodes))
    frame = replace(Scaling.of(task, states), scale=start.scale)
    return train_further(frame, frame.cells(start), budget.teacher, budget.config, seed=seed)


def searched(budget: Budget, size: int, seed: int, **settings: int) -> Policy:
    """Find one linear map by random search on the return alone, with other `settings` than those of `budget`."""
    return search_one_map(budget.task, replace(budget.config, **settings), seed=seed)
