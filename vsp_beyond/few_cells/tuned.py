"""`distill_tuned`: optimise a few codewords and their coefficients together, which the paper's method does not.

Three parts: deterministic annealing (Rose 1998) on the teacher's actions, correction on the states that the policy
itself visits, tuning on the return. A `Tuned` can switch off the last two.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from vsp import Policy, Task, VoronoiPolicy, get_task
from vsp.checks import check_seed
from vsp.rollouts import visited_states
from vsp.run.progress import steps
from vsp.subpolicies.stacked import BETA1, adam

from .config import Tuned
from .criticality import Critics
from .tune import Candidates, tune
from .units import LabelledStates, ScaledCells, Scaling, expected_loss, temperature_unit, warn_outside

WARM = 10  # initial temperature for cells that are already good, in units of the final temperature


@threadpool_limits.wrap(limits=1)
def distill_tuned(
    teacher: Policy, task: str | Task, config: Tuned, *, seed: int, start: VoronoiPolicy | None = None
) -> tuple[VoronoiPolicy, pd.DataFrame]:
    """Distil `teacher` to `config.n_cells` cells, from scratch or from those of `start`. Same arguments, same policy.
    Returns the policy and its history, one row per candidate: stage ("line", one linear map, or "start"; "fit",
    "correct", "tune"), restart, mean return and share of failed episodes from the validation starts. Distances are
    Euclidean, also those of `start`, which is for the same task and has as many cells; its scale is kept. Raises
    ValueError as `distill` does, and for `criticality` with a teacher that has no critics."""
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


def warm(config: Tuned) -> Tuned:
    """Return `config` for cells that are already good: annealing begins colder and takes half as many steps."""
    heat = min(config.initial_temperature, WARM * config.final_temperature)
    return replace(config, initial_temperature=heat, n_steps=max(1, config.n_steps // 2))


def linear_init(labelled: LabelledStates, k: int, rng: np.random.Generator) -> ScaledCells:
    """k codewords near states drawn from `labelled`; every cell gets the least-squares coefficients of all states."""
    states, common = labelled.states, np.linalg.lstsq(labelled.inputs, labelled.actions, rcond=None)[0]
    codewords = states[rng.integers(len(states), size=k)] + 0.01 * rng.normal(size=(k, states.shape[1]))
    return ScaledCells(codewords, np.tile(common, (k, 1, 1)))


def random_init(labelled: LabelledStates, k: int, rng: np.random.Generator) -> ScaledCells:
    """`linear_init` with a little noise in every coefficient."""
    cells = linear_init(labelled, k, rng)
    return ScaledCells(cells.codewords, cells.coefficients + 0.1 * rng.normal(size=cells.coefficients.shape))


def anneal(labelled: LabelledStates, cells: ScaledCells, config: Tuned, rng: np.random.Generator) -> ScaledCells:
    """Optimise all numbers of `cells` by Adam while the temperature falls from the initial to the final of `config`.
    Deterministic annealing (Rose 1998): each state belongs to all cells in shares that fall with the distance. The
    lower the temperature, the faster they fall. The last tenth of the steps stays at the final temperature."""
    unit = temperature_unit(labelled, len(cells))
    first, n_steps = config.initial_temperature, config.n_steps
    theta, draw = cells.vector, labelled.draw(config.batch_size, rng)
    mean = square = np.zeros_like(theta)
    for i in range(n_steps):
        done = i / n_steps
        temperature = unit * first * (config.final_temperature / first) ** min(1.0, done / 0.9)
        rows = draw()
        batch = cells.like(theta), labelled.inputs[rows], labelled.actions[rows]
        _, gradient = expected_loss(*batch, temperature=temperature, clip_slope=config.clip_slope)
        mean, square, spread = adam(gradient, mean, square, i + 1)
        step = mean / (1 - BETA1 ** (i + 1)) / spread
        theta = theta - config.learning_rate * (1 - done) * step
    return cells.like(theta)
