"""What goes beyond the paper: few cells that act like any agent or return much, and proofs of what they do.

`faithful` and `tuned` distil an agent, `at_the_limit` searches for the highest return: each has defaults for any task.
`simplify` reduces cells and numbers, `report` writes a page about a policy and its agent, `prove` proves what a policy
does from every start. `few_cells`, `optimum`, `proofs` and `atlas` hold the parts.
"""

import importlib
from collections.abc import Callable

from vsp import Policy, Task, VoronoiPolicy, get_task
from vsp import agent as as_agent
from vsp.evaluation import remark
from vsp.protocol import Method
from vsp.rollouts import Episodes
from vsp.run.progress import shown

from .few_cells import Faithful, Tuned, faithful_preset, limit_preset, simplify, tuned_preset
from .few_cells.config import check_kind
from .few_cells.faithful import VERSION, distill_faithfully
from .few_cells.limit import search_limit
from .few_cells.tuned import distill_tuned
from .proofs import prove


def faithful(
    agent: Policy, task: str | Task, config: Faithful | None = None, *,
    n_cells: int | None = None, min_r2: float | None = None, seed: int, progress: bool = True,
) -> VoronoiPolicy:  # fmt: skip
    """Distil `agent` to few cells that act like it and return as much, in any task. `config` defaults to
    `faithful_preset(task)`. `n_cells` is the largest number of cells. Given `min_r2`, the policy has the highest return
    among those whose actions have at least this R² against the agent's. The same arguments give the same policy.
    `progress` shows how far it is, and at last how alike agent and policy are. Warns if no such policy is found. Raises
    ValueError if the agent does not fit the task, and for numbers out of range."""
    agent, task = as_agent(agent), get_task(task)
    if config is None:
        config = faithful_preset(task, n_cells=n_cells, min_r2=min_r2)
    elif (n_cells, min_r2) != (None, None):
        raise ValueError("n_cells and min_r2 are settings of config, expected either these or a config")
    check_kind(config, Faithful)
    with shown(progress):
        policy = distill_faithfully(agent, task, config, seed=seed)[0]
        played = config.n_episodes + 2 * config.n_validation
        remark(policy, agent, task, played, f"n_cells={2 * config.n_cells}")
    return policy


def faithful_method(**options) -> Method:
    """Return `faithful` as a method of `vsp.compare`; `options` as `faithful_preset` takes them."""

    def make(agent: Policy, task: Task, data: Episodes | None, seed: int) -> VoronoiPolicy:
        return distill_faithfully(agent, task, faithful_preset(task, **options), seed=seed)[0]

    return Method(make, name="faithful", version=VERSION, settings=lambda task: vars(faithful_preset(task, **options)))


def tuned(
    agent: Policy, task: str | Task, config: Tuned | None = None, *, seed: int, progress: bool = True
) -> VoronoiPolicy:
    """Distil `agent` to few cells and tune them on the return alone: they may act unlike it. `config` defaults to
    `tuned_preset(task)`. Same arguments, same policy. Raises ValueError if the agent does not fit the task."""
    task = get_task(task)
    config = tuned_preset(task) if config is None else config
    check_kind(config, Tuned)
    agent = agent if config.criticality else as_agent(agent)  # which would hide the critics
    with shown(progress):
        return distill_tuned(agent, task, config, seed=seed)[0]


def at_the_limit(
    task: str | Task, config: Tuned | None = None, *, seed: int, teacher: Policy | None = None, progress: bool = True
) -> VoronoiPolicy:
    """Search for at most `config.n_cells` cells whose return is as high as possible. `config` defaults to
    `limit_preset(task)`. `teacher` defaults to the best policy if it is known, else to the shipped teacher; for other
    tasks it is needed. For a task with a physics engine, which is played in fewer episodes, two shorter searches
    follow, each from the result of the one before. The same arguments give the same policy. Raises ValueError if the
    teacher does not fit the task, and without a teacher for a task that has none."""
    task = get_task(task)
    config = limit_preset(task) if config is None else config
    check_kind(config, Tuned)
    with shown(progress):
        return search_limit(task, config, seed=seed, teacher=None if teacher is None else as_agent(teacher))


def __getattr__(name: str) -> Callable:
    """Import `vsp_beyond.report` on first use: it draws."""
    if name == "report":
        return importlib.import_module(".page", __name__).report
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
