"""`distill_tuned`: optimise a few codewords and their coefficients together, which the paper's method does not.

Three parts: deterministic annealing on the teacher's actions, correction on the states that the policy itself visits,
tuning on the return. A `Tuned` can switch off the last two.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from vsp.checks import check_seed
from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy, visited_states
from vsp.run.progress import steps
from vsp.tasks.base import Task
from vsp.tasks.registry import get_task

from .anneal import anneal, linear_init, random_init, warm
from .config import Tuned
from .criticality import Critics
from .tune import Candidates, tune
from .units import Scaling, warn_outside


@threadpool_limits.wrap(limits=1)
def distill_tuned(
    teacher: Policy, task: str | Task, config: Tuned, *, seed: int, start: VoronoiPolicy | None = None
) -> tuple[VoronoiPolicy, pd.DataFrame]:
    """Distil `teacher` to `config.n_cells` cells, from scratch or from those of `start`. Same arguments, same policy.

    Returns the policy and its history, one row per candidate: stage ("line", one linear map, or "start"; "fit",
    "correct", "tune"), restart, mean return and share of failed episodes from the validation starts. Distances are
    Euclidean, also those of `start`, which is for the same task and has as many cells; its scale is kept. Raises
    ValueError as `distill` does, and for `criticality` with a teacher that has no critics.
    """
    check_seed(seed)
    task = get_task(task)
    critics = Critics(teacher) if config.criticality else None  # raises now, not after an hour
    streams = np.random.SeedSequence(seed).spawn(5)
    starts, init, batches, validation, search = map(np.random.default_rng, streams)
    states = visited_states(teacher, task, task.start(starts, config.n_episodes))
    warn_outside(task, states)
    scaling = Scaling.of(task, states)
    if start is not None:
        scaling = replace(scaling, scale=start.scale)  # with another one the borders of `start` would move
    criticality = critics.criticality(states) if critics else None
    labelled = scaling.labelled(states, teacher.predict(states)[0], criticality)
    candidates = Candidates(scaling.policy, task, task.start(validation, config.n_validation), config.failure_penalty)

    first = linear_init(labelled, config.n_cells, init) if start is None else scaling.cells(start)
    candidates.add("line" if start is None else "start", 0, first)
    hot = config if start is None else replace(warm(config), n_steps=config.n_steps)
    for restart in steps(range(config.n_restarts), "fits", total=config.n_restarts, unit="starts"):
        cells = random_init(labelled, config.n_cells, init) if start is None else first
        candidates.add("fit", restart, anneal(labelled, cells, hot, batches))
    cells = candidates.best
    for _ in range(config.n_corrections):
        states = visited_states(scaling.policy(cells), task, task.start(starts, config.n_correction_episodes))
        criticality = critics.criticality(states) if critics else None
        labelled = labelled.with_more(scaling.labelled(states, teacher.predict(states)[0], criticality))
        cells = anneal(labelled, cells, warm(config), batches)
        candidates.add("correct", candidates.best_restart, cells)
    for cells in tune(scaling.policy, task, candidates.best, config, search):
        candidates.add("tune", candidates.best_restart, cells)
    return scaling.policy(candidates.best), pd.DataFrame(candidates.rows)
