"""`distill_faithfully`: few cells that act like the teacher and return what it returns.

The cells with the least action error come first; then CMA-ES raises their return to the teacher's where that costs the
least error. The return is a constraint, not the aim: beyond the teacher's it earns nothing.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from ...checks import check_seed
from ...policy import VoronoiPolicy
from ...rollouts import Policy, rollout, score, visited_states
from ...tasks.base import Task
from ...tasks.registry import get_task
from .anneal import squared_error
from .config import Faithful, check_faithful
from .population import rollout_population
from .search import least_error, moves, uncorrelated
from .tune import cma_es, is_snapshot
from .units import Cells, Frame, LabelledStates

SNAPSHOTS = 25  # candidates that a tuning yields, evenly spread over its generations
TUNING_STATES = 8000  # on which the error of a candidate is measured
FIRST_STEP = 0.02  # of the tuning: its candidates have about so much more error, relatively
NUDGE = 0.05  # of a codeword, for the curvature of the error; in deviations of the states
PRICE = 0.03  # of a return that is missed by the whole tolerance, in units of the unexplained variance, 1 - R²


@threadpool_limits.wrap(limits=1)
def distill_faithfully(
    teacher: Policy, task: str | Task, config: Faithful, *, seed: int
) -> tuple[VoronoiPolicy, pd.DataFrame]:
    """Distil `teacher` to at most `config.n_cells` cells that act like it and are as good. Same arguments, same policy.

    Returns the policy and its history, one row per candidate: stage ("fit", "tune"), r2 (of the limited actions, on the
    states of the fit), gap (of the mean return, less the failure penalty, to the teacher's from the same starts), kept.
    The most visited cell comes first. Raises ValueError as `distill` does.
    """
    check_seed(seed)
    check_faithful(config)
    task = get_task(task)
    starts, init, validation, search = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(4))
    states = visited_states(teacher, task, task.start(starts, config.n_episodes))
    states = states[init.permutation(len(states))[: config.n_states]]
    frame = Frame.of(task, states)
    seen = frame.labelled(teacher, states)
    judge = _Judge(frame, teacher, seen, config, task.start(validation, config.n_validation))

    cells = least_error(seen, config.n_cells, config.n_restarts, init)
    judge.add("fit", cells)
    for tuned in _tune(frame, teacher, seen.some(TUNING_STATES, init), cells, config, search):
        judge.add("tune", tuned)
    return frame.policy(by_visits(needed_only(judge.best, seen), seen)), judge.frame()


class _Judge:
    """Chooses between candidates: the least error among those whose return is accepted, else the highest return."""

    def __init__(self, frame: Frame, teacher: Policy, seen: LabelledStates, config: Faithful, starts: np.ndarray):
        self.rows, self._cells = [], []
        self._frame, self._seen, self._config, self._starts = frame, seen, config, starts
        self._own = score(rollout(teacher, frame.task, starts), config.failure_penalty)

    def add(self, stage: str, cells: Cells) -> None:
        result = rollout(self._frame.policy(cells), self._frame.task, self._starts)
        gap = score(result, self._config.failure_penalty) - self._own
        r2 = 1.0 - squared_error(self._seen, cells) / variance(self._seen)
        self.rows.append({"stage": stage, "r2": r2, "gap": gap})
        self._cells.append(cells)

    @property
    def _best(self) -> int:
        least = self._config.margin - 0.5 * self._config.tolerance
        accepted = [i for i, row in enumerate(self.rows) if row["gap"] >= least]
        if accepted:
            return max(accepted, key=lambda i: self.rows[i]["r2"])
        return max(range(len(self.rows)), key=lambda i: self.rows[i]["gap"])

    @property
    def best(self) -> Cells:
        return self._cells[self._best]

    def frame(self) -> pd.DataFrame:
        return pd.DataFrame(self.rows).assign(kept=np.arange(len(self.rows)) == self._best)


def variance(seen: LabelledStates) -> float:
    """Mean squared error of the best constant: what R² is measured against; 1 for a teacher that is constant."""
    found = float(seen.actions.var(axis=0).mean())
    return found if found > 1e-12 else 1.0


def _tune(
    frame: Frame, teacher: Policy, seen: LabelledStates, cells: Cells, config: Faithful, rng: np.random.Generator
) -> Iterator[Cells]:
    """CMA-ES (Hansen 2016) on the error and the price of a return below the teacher's; yields it `SNAPSHOTS` times.

    Steps have units in which each raises the error by as much: so the search goes where fidelity costs little.
    """
    move, _ = moves(cells, *_units(seen, cells))
    whole, price = variance(seen), PRICE / config.tolerance
    step = np.sqrt(FIRST_STEP * max(squared_error(seen, cells), 1e-6) / cells.vector.size)
    search = cma_es(np.zeros(cells.vector.size), step, rng)
    for i in range(config.n_generations):
        starts, steps = frame.task.start(rng, config.n_tuning_episodes), search.ask()
        aim = score(rollout(teacher, frame.task, starts), config.failure_penalty) + config.margin
        candidates = [move(one) for one in steps]
        results = rollout_population([frame.policy(one) for one in candidates], frame.task, starts)
        missed = [max(0.0, aim - score(result, config.failure_penalty)) for result in results]
        search.tell(steps, [squared_error(seen, one) / whole + price * less for one, less in zip(candidates, missed)])
        if is_snapshot(i, config.n_generations, SNAPSHOTS):
            yield move(search.result.xfavorite)


def _units(seen: LabelledStates, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Bases of the maps and units of the codewords for `moves`, by the curvature of the error."""
    own = cells.nearest(seen.inputs[:, :-1])
    here, vector, units = squared_error(seen, cells), cells.vector, np.empty(cells.codewords.size)
    for j in range(len(units)):
        nudge = np.zeros_like(vector)
        nudge[j] = NUDGE
        more = sum(squared_error(seen, cells.like(vector + sign * nudge)) - here for sign in (1, -1))
        units[j] = 1.0 / np.sqrt(max(0.0, 0.5 * more / NUDGE**2) + 1e-3)
    return uncorrelated(seen, (own == np.arange(len(cells.codewords))[:, None]).astype(np.float64)), units


def needed_only(cells: Cells, seen: LabelledStates) -> Cells:
    """Without cells that the error does not need: their states are as well served by the next codeword, as where two
    neighbours hold the same map."""
    while (k := len(cells.codewords)) > 1:
        errors = [squared_error(seen, _without(cells, i)) for i in range(k)]
        if min(errors) > squared_error(seen, cells):
            break
        cells = _without(cells, int(np.argmin(errors)))
    return cells


def _without(cells: Cells, i: int) -> Cells:
    return Cells(np.delete(cells.codewords, i, axis=0), np.delete(cells.maps, i, axis=0))


def by_visits(cells: Cells, seen: LabelledStates) -> Cells:
    """The same cells, the one with the most states of `seen` first."""
    visits = np.bincount(cells.nearest(seen.inputs[:, :-1]), minlength=len(cells.codewords))
    order = np.argsort(-visits, kind="stable")
    return Cells(cells.codewords[order], cells.maps[order])
