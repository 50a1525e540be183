"""The methods that are compared beyond the paper, each a function of a budget, a size and a seed.

The budget is the teacher and the episodes of a `Tuned`. A fit to the teacher's own episodes alone gets as many
episodes as the other methods get in all rounds. Methods that find their own size ignore `size`. The paper's method
uses the episodes of its own preset, and TD-AVQ has no teacher.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from vsp.algorithms import distill
from vsp.config import Config
from vsp.paper.baselines import Tree, kmeans_cells, linear_map, rule_of_thumb
from vsp.rollouts import Policy
from vsp.tasks.base import Task
from vsp_beyond.few_cells.config import Faithful, Tuned
from vsp_beyond.few_cells.faithful import distill_faithfully
from vsp_beyond.few_cells.limit import search_limit
from vsp_beyond.few_cells.tuned import distill_tuned

from ..rivals import tdavq
from ..rivals.dagger import dagger
from ..rivals.hand_written import Heuristic, PumpAndBalance, ZeroPolicy
from ..rivals.small_network import SmallNetwork, units_for
from ..rivals.soft_tree import SoftTree
from ..rivals.trees import LinearTree, ObliqueLinearTree
from ..robots import Walking
from .imitate import imitate
from .tuning import tuned


@dataclass(frozen=True)
class Budget:
    """What a method may use: the teacher, its task, and the settings of its preset.

    Methods that imitate or tune take their episodes and rounds from a `Tuned`.
    """

    teacher: Policy
    task: Task
    config: Tuned | Faithful | Config | Walking


# Our own


def refined(budget: Budget, size: int, seed: int, **changes) -> Policy:
    """Call `distill_tuned` with some settings changed."""
    config = replace(budget.config, n_cells=size, **changes)
    return distill_tuned(budget.teacher, budget.task, config, seed=seed)[0]


def no_teacher(budget: Budget, size: int, seed: int) -> Policy:
    """Call `distill_tuned` with a teacher that does nothing, to see what tuning finds without one."""
    return refined(replace(budget, teacher=ZeroPolicy(budget.task)), size, seed)


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


def imitated(budget: Budget, size: int, seed: int) -> Policy:
    """Imitate the teacher's own episodes as closely as possible: relocate cells, without correction or tuning."""
    config = budget.config
    n = config.n_episodes + config.n_corrections * config.n_correction_episodes
    config = replace(config, n_cells=size, n_episodes=n, n_restarts=3)
    return imitate(budget.teacher, budget.task, config, seed=seed)


def gently(budget: Budget, size: int, seed: int, **changes) -> Policy:
    """Tune the policy of `imitated` gently, as long as the gain outweighs the distance from the teacher.

    Of the teacher's episodes, those of one round serve the tuning, and those of the other rounds the fit.
    """
    config = budget.config
    start = imitated(replace(budget, config=replace(config, n_corrections=config.n_corrections - 1)), size, seed)
    changes |= {"n_restarts": 1, "n_corrections": 0, "n_episodes": config.n_correction_episodes}
    return distill_tuned(budget.teacher, budget.task, replace(config, n_cells=size, **changes), seed=seed, start=start)[
        0
    ]


# Fits to states x (n, d) and actions y (n, m), with `size` cells or leaves
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


def corrected(budget: Budget, size: int, seed: int, *, fit: Callable[..., Policy], rounds: int, by_chance: bool):
    """Run DAgger with `fit`, with as many corrected episodes as ours, in more rounds since these fits are quick.

    A fit that depends `by_chance` on its seed gets as many restarts as ours; the best is corrected.
    """
    n = budget.config.n_corrections * budget.config.n_correction_episodes
    config = replace(budget.config, n_corrections=rounds, n_correction_episodes=n // rounds)
    return _fitted(fit, config, budget, size, seed, config.n_restarts if by_chance else 1)


def alone(budget: Budget, size: int, seed: int, *, fit: Callable[..., Policy]) -> Policy:
    """Call `fit` on the teacher's own episodes, without corrections."""
    config = budget.config
    n = config.n_episodes + config.n_corrections * config.n_correction_episodes
    return _fitted(fit, replace(config, n_corrections=0, n_episodes=n), budget, size, seed, 1)


def tuned_fit(budget: Budget, size: int, seed: int, *, imitation: Callable[..., Policy], **settings) -> Policy:
    """Tune the policy of `imitation` on the return as `distill_tuned` tunes its cells."""
    start = imitation(budget, size, seed, **settings)
    return tuned(start, budget.teacher, budget.task, budget.config, seed)


def numbers_of(cells: int, task: Task) -> int:
    """Return how many numbers a policy of `cells` Voronoi cells with linear maps has."""
    d, m = len(task.low), len(task.action_low)
    return cells * (d + 1) * m + (cells > 1) * (cells + 1) * d


def _fitted(fit, config: Tuned, budget: Budget, size: int, seed: int, n_restarts: int) -> Policy:
    seeds = range(n_restarts * seed, n_restarts * (seed + 1))
    fits = [partial(fit, size=size, task=budget.task, seed=one) for one in seeds]
    return dagger(fits, budget.teacher, budget.task, rounds=config, seed=seed)


# Methods that find their own size


def the_teacher(budget: Budget, size: int, seed: int) -> Policy:
    """Return the teacher itself."""
    return budget.teacher


def by_thumb(budget: Budget, size: int, seed: int) -> Policy:
    """Return the rule of thumb that a person would write down for the task."""
    return rule_of_thumb(budget.task.name)[1]


def by_hand(budget: Budget, size: int, seed: int) -> Policy:
    """Return a hand-written controller."""
    return {"Pendulum-v1": PumpAndBalance, "LunarLanderContinuous-v3": Heuristic}[budget.task.name]()


def td_avq(budget: Budget, size: int, seed: int, **settings) -> Policy:
    """Learn from rewards by TD-AVQ, without a teacher."""
    return tdavq.learn(budget.task, seed=seed, **settings)


def paper_method(budget: Budget, size: int, seed: int) -> Policy:
    """Call `distill` with the paper's preset."""
    return distill(budget.teacher, budget.task, budget.config, seed=seed)[0]
