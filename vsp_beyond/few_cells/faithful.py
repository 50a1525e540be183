"""`distill_faithfully`: find few cells that act like the teacher and match its return.

First it finds the cells with the least action error. Then CMA-ES raises their return to the teacher's where that costs
the least error. The return is a constraint, not the objective: a return above the teacher's earns nothing.
"""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from vsp import Policy, Task, VoronoiPolicy, get_task
from vsp.checks import check_seed
from vsp.rollouts import rollout, visited_states
from vsp.run.progress import steps
from vsp.tasks import GOAL

from .config import Faithful
from .search import even_moves, least_error
from .tune import cma_es, is_snapshot, rollout_population, score
from .units import LabelledStates, ScaledCells, Scaling, needed_only, spread, squared_error, unexplained, warn_outside

VERSION = 1  # raise it when the same arguments give another policy
SNAPSHOTS = 20  # candidates that a tuning yields, evenly spread over its generations
TUNING_STATES = 8000  # states on which the error of a candidate is measured
POOL = 20  # times the episodes of a generation: size of the pool of starts, from each of which the teacher plays once
MANY = 150  # with more numbers, the tuning learns no covariances: it is too short for them
FIRST_STEP = 0.02  # relative increase of the error by the first candidates of the tuning, about
SHARE = 0.02  # default tolerance, as a share of the teacher's mean return
BEYOND = 0.001  # unexplained variance beyond that of `min_r2` that costs as much as one tolerance of return
NEAR = 2.0  # times the error of the closest cells: limit for what is kept if no candidate returns enough
PRICE = 0.03  # penalty for missing the return by one tolerance, in units of the unexplained variance, 1 - R²


@threadpool_limits.wrap(limits=1)
def distill_faithfully(
    teacher: Policy, task: str | Task, config: Faithful, *, seed: int
) -> tuple[VoronoiPolicy, pd.DataFrame]:
    """Distil `teacher` to at most `config.n_cells` cells that act like it and are as good. Same arguments, same policy.
    Returns the policy and its history, one row per candidate: stage ("fit", "tune"), r2 (of the limited actions, on the
    states of the fit), gap (mean return less the failure penalty, minus the teacher's from the same starts), kept. The
    most visited cell comes first. Warns if no such policy is found. Raises ValueError as `distill` does."""
    check_seed(seed)
    task = get_task(task)
    starts, init, validation, search = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(4))

    states = visited_states(teacher, task, task.start(starts, config.n_episodes))
    compared = task.start(validation, config.n_validation)  # starts from which candidates are compared
    of_teacher = rollout(teacher, task, compared)
    expected = score(of_teacher, config.failure_penalty)
    tolerance = config.tolerance or max(SHARE * abs(float(of_teacher.returns.mean())), 1e-9)
    warn_outside(task, states)
    scaling = Scaling.of(task, states)
    states = states[spread(states / scaling.scale, config.n_states, init)]
    labelled = scaling.labelled(states, teacher.predict(states)[0])

    candidates = _Candidates(config, scaling, labelled, compared, expected, tolerance)
    closest = least_error(labelled, config.n_cells, config.n_restarts, init)
    candidates.add("fit", closest)
    if config.min_r2 is not None or candidates.shortfall:  # else tuning gains nothing
        some = labelled.thinned(TUNING_STATES, init)
        pool = task.start(search, POOL * config.n_tuning_episodes)
        result = rollout(teacher, task, pool)
        goals = result.returns - config.failure_penalty * (result.outcomes != GOAL)
        for tuned in _tune(candidates, some, closest, pool, goals, search):
            candidates.add("tune", tuned)
    if candidates.shortfall:
        warnings.warn(candidates.shortfall, stacklevel=4)  # points at the caller of `vsp_beyond.faithful`
    cells = candidates.best
    fewer = needed_only(cells, labelled)
    if len(fewer) < len(cells) and candidates.returns_enough(fewer):
        cells = fewer
    return scaling.policy(cells.among(labelled.states).by_visits(labelled.states)), candidates.history()


@dataclass(frozen=True)
class _Candidates:
    """Candidates with their R² and their gap: the mean return less penalties, minus the teacher's from the same
    starts."""

    config: Faithful
    scaling: Scaling
    labelled: LabelledStates
    starts: np.ndarray  # (n, s)
    expected: float  # the teacher's mean return less penalties, from these starts
    tolerance: float
    rows: list[dict] = field(default_factory=list)  # stage, cells, r2, gap

    def add(self, stage: str, cells: ScaledCells) -> None:
        gap, r2 = self._gap(cells), 1.0 - unexplained(self.labelled, cells)
        self.rows.append({"stage": stage, "cells": cells, "r2": r2, "gap": gap})

    def _gap(self, cells: ScaledCells) -> float:
        result = rollout(self.scaling.policy(cells), self.scaling.task, self.starts)
        return score(result, self.config.failure_penalty) - self.expected

    @property
    def least_gap(self) -> float:
        return self.config.margin - 0.5 * self.tolerance

    @property
    def kept(self) -> int:
        r2, gap = (np.array([row[name] for row in self.rows]) for name in ("r2", "gap"))
        return kept(r2, gap, least_gap=self.least_gap, min_r2=self.config.min_r2)

    @property
    def best(self) -> ScaledCells:
        return self.rows[self.kept]["cells"]

    def returns_enough(self, cells: ScaledCells) -> bool:
        """Whether `cells` return as much as the best candidate or, without `min_r2`, enough to be accepted."""
        gap = self.rows[self.kept]["gap"]
        return self._gap(cells) >= (gap if self.config.min_r2 is not None else min(gap, self.least_gap))

    @property
    def shortfall(self) -> str | None:
        """The requirement that no candidate meets, in words; None if one meets all."""
        best, k, min_r2 = self.rows[self.kept], self.config.n_cells, self.config.min_r2
        if min_r2 is not None and best["r2"] < min_r2:
            return f"no policy of {k} cells with R² {min_r2:g} was found: the closest is kept, R² {best['r2']:.3f}"
        if min_r2 is None and best["gap"] < self.least_gap:
            each = f" ({cost:g} less for each that fails)" if (cost := self.config.failure_penalty) else ""
            what = f"{best['gap']:+.4g} an episode{each}, expected {self.least_gap:+.4g} or more"
            return f"no policy of {k} cells acts like the agent and returns as much: the best differs by {what}"
        return None

    def history(self) -> pd.DataFrame:
        rows = pd.DataFrame(self.rows).drop(columns="cells")
        return rows.assign(kept=np.arange(len(rows)) == self.kept)


def kept(r2: np.ndarray, gap: np.ndarray, *, least_gap: float, min_r2: float | None) -> int:
    """Return which candidate is kept, by the R² (c,) and the gap (c,) of all candidates. The first is the closest. It
    is the one with the highest R² among those with a gap of at least `least_gap`. If there is none, it is the one with
    the highest return among those with at most `NEAR` times the error of the first. With `min_r2`, it is the one with
    the highest return among those with at least this R², or else the one with the highest R²."""
    if min_r2 is not None:
        accepted, value, instead = r2 >= min_r2, gap, r2
    else:
        near = 1.0 - r2 <= NEAR * (1.0 - r2[0])
        accepted, value, instead = gap >= least_gap, r2, np.where(near, gap, -np.inf)
    return int(np.where(accepted, value, -np.inf).argmax() if accepted.any() else instead.argmax())


def _tune(
    candidates: _Candidates, labelled: LabelledStates, cells: ScaledCells, pool: np.ndarray, goals: np.ndarray,
    rng: np.random.Generator,
) -> Iterator[ScaledCells]:  # fmt: skip
    """Run CMA-ES (Hansen 2016) on the error plus a penalty for a return below its target; yield the solution
    `SNAPSHOTS` times. Each generation is rolled out from some starts of the `pool`, where the teacher scores `goals`.
    Steps are scaled so that each raises the error equally. So the search goes where fidelity costs little."""
    config, scaling = candidates.config, candidates.scaling
    move = even_moves(labelled, cells)
    step = np.sqrt(FIRST_STEP * max(squared_error(labelled, cells), 1e-6) / cells.vector.size)
    search = cma_es(np.zeros(cells.vector.size), step, rng, diagonal=cells.vector.size > MANY)
    for i in steps(range(config.n_generations), "tuning", total=config.n_generations, unit="generations"):
        rows, vectors = rng.choice(len(pool), size=config.n_tuning_episodes, replace=False), search.ask()
        moved = [move(vector) for vector in vectors]
        results = rollout_population([scaling.policy(cells) for cells in moved], scaling.task, pool[rows])
        target = goals[rows].mean() + config.margin
        missed = np.array([target - score(result, config.failure_penalty) for result in results])
        errors = np.array([unexplained(labelled, cells) for cells in moved])
        search.tell(vectors, _cost(errors, missed, candidates.tolerance, config.min_r2).tolist())
        if is_snapshot(i, config.n_generations, SNAPSHOTS):
            yield move(search.result.xfavorite)


def _cost(errors: np.ndarray, missed: np.ndarray, tolerance: float, min_r2: float | None) -> np.ndarray:
    """Return the cost to minimise, from the unexplained variances `errors` and the missed returns `missed` (p,): the
    error plus a penalty for a missed return; with `min_r2`, the missed return plus a penalty for an error beyond it."""
    if min_r2 is None:
        return errors + PRICE / tolerance * np.maximum(0.0, missed)
    return missed / tolerance + np.maximum(0.0, errors - (1.0 - min_r2)) / BEYOND
