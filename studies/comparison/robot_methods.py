"""The methods that are compared on robots, each a function of a budget, a size and a seed, as in `methods`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy, visited_states
from vsp_beyond.few_cells.units import LabelledStates, Scaling

from ..robots import imitate_pushed, search_one_map
from ..robots.imitation import COOL
from .apart import descend, global_tree
from .methods import Budget
from .tuning import in_units


def cells(budget: Budget, size: int, seed: int) -> Policy:
    """Call `imitate_pushed`: cells act like the teacher, also after a push or a mistake of their own."""
    return imitate_pushed(budget.teacher, budget.task, replace(budget.config, n_cells=size), seed=seed)


def oblique_tree(budget: Budget, size: int, seed: int) -> Policy:
    """Fit an oblique tree with linear leaves in as many rounds as `cells`, and in the same way.

    All its numbers are fitted together: in the first round from random and from greedy trees, later from the tree of
    the round before.
    """

    def fit(frame: Scaling, seen: LabelledStates, before: Policy | None, rng: np.random.Generator) -> Policy:
        states, actions = frame.states(seen.inputs), frame.actions(seen.actions)
        if before is None:
            return global_tree(states, actions, size, budget.task, int(rng.integers(2**31)))
        return descend(before, states, actions, COOL)

    return imitate_pushed(budget.teacher, budget.task, budget.config, seed=seed, fit=fit)


def trained_further(budget: Budget, size: int, seed: int, *, imitation: Callable[..., Policy]) -> Policy:
    """Continue the teacher's training with the policy of `imitation` as its actor."""
    from ..robots.further_training import train_further  # imported here, since it imports torch

    start, task = imitation(budget, size, seed), budget.task
    states = visited_states(budget.teacher, task, task.start(np.random.default_rng(seed), budget.config.n_episodes))
    frame = Scaling.of(task, states)
    if isinstance(start, VoronoiPolicy):  # including a single cell
        frame = replace(frame, scale=start.scale)
        numbers = frame.cells(start)
    else:
        frame, numbers = in_units(start, frame)
    return train_further(frame, numbers, budget.teacher, budget.config, seed=seed)


def searched(budget: Budget, size: int, seed: int, **settings: int) -> Policy:
    """Find one linear map by random search on the return alone, with other `settings` than those of `budget`."""
    return search_one_map(budget.task, replace(budget.config, **settings), seed=seed)
