"""Newer published methods with linear maps, as functions of a budget, a size and a seed.

All are fitted to the teacher's own episodes, without corrections. They raise ValueError for a teacher without critics.
"""

from __future__ import annotations

from vsp.rollouts import Policy

from ..rivals.critics import advantage_weighted, critic_driven
from .methods import Budget, alone


def critic_driven_cells(budget: Budget, size: int, seed: int) -> Policy:
    """Add cells where the critics give the distilled action too low a value: `critic_driven`."""
    return _with_critics(critic_driven, budget, size, seed)


def advantage_weighted_cells(budget: Budget, size: int, seed: int) -> Policy:
    """Fit maps in k-means cells, weighted by the cost of a wrong action: `advantage_weighted`."""
    return _with_critics(advantage_weighted, budget, size, seed)


def _with_critics(fit, budget: Budget, size: int, seed: int) -> Policy:
    def asking(states, actions, size, task, seed):
        return fit(states, actions, cells=size, teacher=budget.teacher, task=task, seed=seed)

    return alone(budget, size, seed, fit=asking)
