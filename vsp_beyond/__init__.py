"""What goes beyond the paper: few cells that act like any agent or return much, and proofs of what they do.

`faithful` and `tuned` distil an agent, `at_the_limit` searches for the highest return, `simplify` reduces cells and
numbers, `prove` proves what a policy does from every start. Each has defaults for any task where that is possible.
`few_cells`, `optimum`, `explain` and `proofs` hold the parts, `show` draws figures.
"""

from __future__ import annotations

from vsp import agent as as_agent
from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy
from vsp.tasks import Task, get_task

from .few_cells import Faithful, Tuned, faithful_preset, simplify, tuned_preset
from .few_cells.duration import announcement
from .few_cells.faithful import distill_faithfully
from .few_cells.limit import at_the_limit, limit_preset
from .few_cells.tuned import distill_tuned
from .proofs import prove


def faithful(
    agent: Policy, task: str | Task, config: Faithful | None = None, *,
    n_cells: int | None = None, min_r2: float | None = None, seed: int,
) -> VoronoiPolicy:  # fmt: skip
    """Distil `agent` to few cells that act like it and return as much, in any task. Prints the expected time.

    `config` defaults to `faithful_preset(task)`. `n_cells` is the largest number of cells. Given `min_r2`, the policy
    has the highest return among those whose actions have at least this R² against the agent's. The same arguments give
    the same policy. Warns if no such policy is found. Raises ValueError if the agent does not fit the task, and for
    numbers out of range.
    """
    agent, task = as_agent(agent), get_task(task)
    if config is None:
        config = faithful_preset(task, n_cells=n_cells, min_r2=min_r2)
    elif (n_cells, min_r2) != (None, None):
        raise ValueError("n_cells and min_r2 are settings of config, expected either these or a config")
    print(f"distilling for {task.name}: {announcement(agent, task, config)}")
    return distill_faithfully(agent, task, config, seed=seed)[0]


def tuned(agent: Policy, task: str | Task, config: Tuned | None = None, *, seed: int) -> VoronoiPolicy:
    """Distil `agent` to few cells and tune them on the return alone: they may act unlike it.

    `config` defaults to `tuned_preset(task)`. The same arguments give the same policy. Raises ValueError if the agent
    does not fit the task.
    """
    return distill_tuned(agent, task, tuned_preset(task) if config is None else config, seed=seed)[0]
