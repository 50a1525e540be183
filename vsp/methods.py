"""The methods that are compared beyond the paper, each a function of a budget, a size and a seed.

The budget is the teacher and the episodes of a `Refinement`. Fits that only see the teacher's own episodes have as many
of them as the others have in all rounds. Those that find their own size look at no budget: the paper's method has the
episodes of its own preset, and TD-AVQ no teacher at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from . import moves, tdavq
from .baselines import Heuristic, PumpAndBalance, Still, dagger, kmeans_cells, linear_map, rule_of_thumb
from .config import Refinement
from .distill import distill
from .envs import Task
from .refine import refine
from .rollouts import Policy
from .trees import LinearTree, ObliqueLinearTree, SoftTree, Tree


@dataclass(frozen=True)
class Budget:
    """What every method may use: the teacher, its task, and the episodes and rounds of a `Refinement`."""

    teacher: Policy
    task: Task
    config: Refinement


# Our own


def refined(budget: Budget, size: int, seed: int, **changes) -> Policy:
    """`refine`, with some settings changed."""
    config = replace(budget.config, n_cells=size, **changes)
    return refine(budget.teacher, budget.task, config, seed=seed)[0]


def untaught(budget: Budget, size: int, seed: int) -> Policy:
    """`refine` with a teacher that does nothing: what the tuning finds by itself."""
    return refined(replace(budget, teacher=Still(budget.task)), size, seed)


def closest(budget: Budget, size: int, seed: int) -> Policy:
    """Where to imitate is all that is asked, of the teacher's own episodes: cells that move, and neither correction nor
    tuning."""
    config = budget.config
    n = config.n_episodes + config.n_corrections * config.n_correction_episodes
    config = replace(config, n_cells=size, n_episodes=n, n_restarts=3)
    return moves.closest(budget.teacher, budget.task, config, seed=seed)


def faithful(budget: Budget, size: int, seed: int, **changes) -> Policy:
    """The `closest`, tuned gently, and only as far as that pays for being less like the teacher.

    The teacher plays the episodes of one round for the tuning, and those of the others for the fit.
    """
    config = budget.config
    start = closest(replace(budget, config=replace(config, n_corrections=config.n_corrections - 1)), size, seed)
    changes |= {"n_restarts": 1, "n_corrections": 0, "n_episodes": config.n_correction_episodes}
    return refine(budget.teacher, budget.task, replace(config, n_cells=size, **changes), seed=seed, start=start)[0]


# Fits to states (n, d) and actions (n, m)


def tree(states, actions, *, size: int, task: Task, seed: int) -> Policy:
    """CART."""
    return Tree(states, actions, leaves=size)


def linear_tree(states, actions, *, size: int, task: Task, seed: int) -> Policy:
    """A tree with linear leaves."""
    return LinearTree(states, actions, leaves=size, task=task)


def oblique_linear_tree(states, actions, *, size: int, task: Task, seed: int) -> Policy:
    """The same with oblique splits."""
    return ObliqueLinearTree(states, actions, leaves=size, task=task, seed=seed)


def soft_tree(states, actions, *, size: int, task: Task, seed: int) -> Policy:
    """A soft tree."""
    return SoftTree(states, actions, leaves=size, seed=seed)


def kmeans(states, actions, *, size: int, task: Task, seed: int) -> Policy:
    """Cells of k-means."""
    return kmeans_cells(states, actions, cells=size, task=task, seed=seed)


def line(states, actions, *, size: int, task: Task, seed: int) -> Policy:
    """One linear map."""
    return linear_map(states, actions, task)


def corrected(budget: Budget, size: int, seed: int, *, fit: Callable[..., Policy], rounds: int, beginnings: int):
    """`fit` by DAgger, with as many corrected episodes as `refine` has, in more rounds: fits so quick gain by them.

    `beginnings` with other random numbers, of which the best goes on.
    """
    n = budget.config.n_corrections * budget.config.n_correction_episodes
    config = replace(budget.config, n_corrections=rounds, n_correction_episodes=n // rounds)
    return _fitted(fit, config, budget, size, seed, beginnings)


def alone(budget: Budget, size: int, seed: int, *, fit: Callable[..., Policy]) -> Policy:
    """`fit` to the teacher's own episodes."""
    config = budget.config
    n = config.n_episodes + config.n_corrections * config.n_correction_episodes
    return _fitted(fit, replace(config, n_corrections=0, n_episodes=n), budget, size, seed, 1)


def _fitted(fit, config: Refinement, budget: Budget, size: int, seed: int, beginnings: int) -> Policy:
    seeds = range(beginnings * seed, beginnings * (seed + 1))
    fits = [partial(fit, size=size, task=budget.task, seed=one) for one in seeds]
    return dagger(fits, budget.teacher, budget.task, config=config, seed=seed)


# Those that find their own size


def the_teacher(budget: Budget, size: int, seed: int) -> Policy:
    """Itself."""
    return budget.teacher


def by_thumb(budget: Budget, size: int, seed: int) -> Policy:
    """What a person would write down."""
    return rule_of_thumb(budget.task.name)[1]


def by_hand(budget: Budget, size: int, seed: int) -> Policy:
    """A controller that a person programs."""
    return {"Pendulum-v1": PumpAndBalance, "LunarLanderContinuous-v3": Heuristic}[budget.task.name]()


def td_avq(budget: Budget, size: int, seed: int, **settings) -> Policy:
    """Learned from rewards."""
    return tdavq.learn(budget.task, seed=seed, **settings)


def paper_method(budget: Budget, size: int, seed: int) -> Policy:
    """`distill` with the paper's preset."""
    return distill(budget.teacher, budget.task, seed=seed)[0]
