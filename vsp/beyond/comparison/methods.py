"""The methods that are compared beyond the paper, each a function of a budget, a size and a seed.

The budget is the teacher and the episodes of a `Refinement`. Fits to the teacher's own episodes alone get as many as
the others get in all rounds. Methods that find their own size ignore the budget: the paper's method has the episodes of
its own preset, and TD-AVQ has no teacher.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...algorithms import distill
from ...baselines import tdavq
from ...baselines.dagger import dagger
from ...baselines.simple import Heuristic, PumpAndBalance, ZeroPolicy, kmeans_cells, linear_map, rule_of_thumb
from ...baselines.small_network import SmallNetwork, units_for
from ...baselines.soft_tree import SoftTree
from ...baselines.trees import LinearTree, ObliqueLinearTree, Tree
from ...config import Config
from ...policy import VoronoiPolicy
from ...rollouts import Policy, visited_states
from ...tasks.base import Task
from ..optimum import at_the_limit
from ..refinement.config import Faithful, Refinement
from ..refinement.faithful import distill_faithfully
from ..refinement.imitate import imitate
from ..refinement.refine import refine
from ..refinement.units import Frame, LabelledStates
from ..robots import Walking, imitate_pushed, search_one_map
from .tuning import in_units, tuned


@dataclass(frozen=True)
class Budget:
    """What a method may use: the teacher, its task, and the settings of its preset; of those that imitate or tune, the
    episodes and rounds of a `Refinement`."""

    teacher: Policy
    task: Task
    config: Refinement | Faithful | Config | Walking


# Our own


def refined(budget: Budget, size: int, seed: int, **changes) -> Policy:
    """`refine`, with some settings changed."""
    config = replace(budget.config, n_cells=size, **changes)
    return refine(budget.teacher, budget.task, config, seed=seed)[0]


def no_teacher(budget: Budget, size: int, seed: int) -> Policy:
    """`refine` with a teacher that does nothing: what the tuning finds by itself."""
    return refined(replace(budget, teacher=ZeroPolicy(budget.task)), size, seed)


def faithfully(budget: Budget, size: int, seed: int, **changes) -> Policy:
    """`distill_faithfully`, by the faithful preset with some settings changed."""
    config = replace(budget.config, n_cells=size, **changes)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no policy of")  # the row says what was found
        return distill_faithfully(budget.teacher, budget.task, config, seed=seed)[0]


def limited(budget: Budget, size: int, seed: int, *, by_teacher: bool = False) -> Policy:
    """`at_the_limit`, from the best policy where it is known, or from the teacher."""
    teacher = budget.teacher if by_teacher else None
    return at_the_limit(budget.task, replace(budget.config, n_cells=size), seed=seed, teacher=teacher)


def imitated(budget: Budget, size: int, seed: int) -> Policy:
    """The closest imitation of the teacher's own episodes: cells are relocated, nothing is corrected or tuned."""
    config = budget.config
    n = config.n_episodes + config.n_corrections * config.n_correction_episodes
    config = replace(config, n_cells=size, n_episodes=n, n_restarts=3)
    return imitate(budget.teacher, budget.task, config, seed=seed)


def faithful(budget: Budget, size: int, seed: int, **changes) -> Policy:
    """`imitated`, then tuned gently, as long as the gain outweighs the distance from the teacher.

    The teacher plays the episodes of one round for the tuning, and those of the other rounds for the fit.
    """
    config = budget.config
    start = imitated(replace(budget, config=replace(config, n_corrections=config.n_corrections - 1)), size, seed)
    changes |= {"n_restarts": 1, "n_corrections": 0, "n_episodes": config.n_correction_episodes}
    return refine(budget.teacher, budget.task, replace(config, n_cells=size, **changes), seed=seed, start=start)[0]


# Of robots


def robot(budget: Budget, size: int, seed: int) -> Policy:
    """`imitate_pushed`: cells that act like the teacher, also after a push or a mistake of their own."""
    return imitate_pushed(budget.teacher, budget.task, replace(budget.config, n_cells=size), seed=seed)


def robot_tree(budget: Budget, size: int, seed: int) -> Policy:
    """An oblique tree with linear leaves, fitted to states gathered in the same way, in as many rounds."""

    def fit(frame: Frame, seen: LabelledStates, before: Policy | None, rng: np.random.Generator) -> Policy:
        states, actions = frame.states(seen.inputs), frame.actions(seen.actions)
        tree_seed = int(rng.integers(2**31))
        return ObliqueLinearTree(states, actions, leaves=size, task=budget.task, seed=tree_seed)

    return imitate_pushed(budget.teacher, budget.task, budget.config, seed=seed, fit=fit)


def trained_further(budget: Budget, size: int, seed: int, *, imitation: Callable[..., Policy]) -> Policy:
    """`imitation`, with which the training of the teacher goes on."""
    from ..robots.further_training import train_further  # which imports torch

    start, task = imitation(budget, size, seed), budget.task
    states = visited_states(budget.teacher, task, task.start(np.random.default_rng(seed), budget.config.n_episodes))
    frame = Frame.of(task, states)
    if isinstance(start, VoronoiPolicy):  # a single cell too
        frame = replace(frame, scale=start.scale)
        numbers = frame.cells(start)
    else:
        frame, numbers = in_units(start, frame)
    return train_further(frame, numbers, budget.teacher, budget.config, seed=seed)


def searched(budget: Budget, size: int, seed: int) -> Policy:
    """One linear map by random search on the return alone."""
    return search_one_map(budget.task, budget.config, seed=seed)


# Fits to states x (n, d) and actions y (n, m), with so many cells or leaves
FITS: dict[str, Callable[..., Policy]] = {
    "tree": lambda x, y, size, task, seed: Tree(x, y, leaves=size),
    "linear tree": lambda x, y, size, task, seed: LinearTree(x, y, leaves=size, task=task),
    "oblique tree": lambda x, y, size, task, seed: ObliqueLinearTree(x, y, leaves=size, task=task, seed=seed),
    "constant oblique tree": lambda x, y, size, task, seed: ObliqueLinearTree(
        x, y, leaves=size, task=task, seed=seed, constant=True
    ),
    "small network": lambda x, y, size, task, seed: SmallNetwork(
        x, y, units=units_for(numbers_of(size, task), task), task=task, seed=seed
    ),
    "soft tree": lambda x, y, size, task, seed: SoftTree(x, y, leaves=size, seed=seed),
    "k-means": lambda x, y, size, task, seed: kmeans_cells(x, y, cells=size, task=task, seed=seed),
    "one map": lambda x, y, size, task, seed: linear_map(x, y, task),
}


def corrected(budget: Budget, size: int, seed: int, *, fit: Callable[..., Policy], rounds: int, n_restarts: int):
    """`fit` by DAgger, with as many corrected episodes as `refine` has, in more rounds: these fits are quick.

    `n_restarts` fits with other random numbers; the best is kept.
    """
    n = budget.config.n_corrections * budget.config.n_correction_episodes
    config = replace(budget.config, n_corrections=rounds, n_correction_episodes=n // rounds)
    return _fitted(fit, config, budget, size, seed, n_restarts)


def alone(budget: Budget, size: int, seed: int, *, fit: Callable[..., Policy]) -> Policy:
    """`fit` to the teacher's own episodes, without corrections."""
    config = budget.config
    n = config.n_episodes + config.n_corrections * config.n_correction_episodes
    return _fitted(fit, replace(config, n_corrections=0, n_episodes=n), budget, size, seed, 1)


def tuned_fit(budget: Budget, size: int, seed: int, *, imitation: Callable[..., Policy], **settings) -> Policy:
    """`imitation`, tuned on the return as `refine` tunes its cells. Fits with random numbers have as many restarts."""
    if settings.get("n_restarts", 1) > 1:
        settings["n_restarts"] = budget.config.n_restarts
    start = imitation(budget, size, seed, **settings)
    return tuned(start, budget.teacher, budget.task, budget.config, seed)


def numbers_of(cells: int, task: Task) -> int:
    """How many numbers linear maps in Voronoi cells have."""
    d, m = len(task.low), len(task.action_low)
    return cells * (d + 1) * m + (cells > 1) * (cells + 1) * d


def _fitted(fit, config: Refinement, budget: Budget, size: int, seed: int, n_restarts: int) -> Policy:
    seeds = range(n_restarts * seed, n_restarts * (seed + 1))
    fits = [partial(fit, size=size, task=budget.task, seed=one) for one in seeds]
    return dagger(fits, budget.teacher, budget.task, rounds=config, seed=seed)


# Methods that find their own size


def the_teacher(budget: Budget, size: int, seed: int) -> Policy:
    """The teacher itself."""
    return budget.teacher


def by_thumb(budget: Budget, size: int, seed: int) -> Policy:
    """A rule that a person would write down."""
    return rule_of_thumb(budget.task.name)[1]


def by_hand(budget: Budget, size: int, seed: int) -> Policy:
    """A controller that a person programs."""
    return {"Pendulum-v1": PumpAndBalance, "LunarLanderContinuous-v3": Heuristic}[budget.task.name]()


def td_avq(budget: Budget, size: int, seed: int, **settings) -> Policy:
    """Learned from rewards."""
    return tdavq.learn(budget.task, seed=seed, **settings)


def paper_method(budget: Budget, size: int, seed: int) -> Policy:
    """`distill` with the paper's preset."""
    return distill(budget.teacher, budget.task, budget.config, seed=seed)[0]
