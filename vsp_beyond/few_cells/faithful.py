"""`distill_faithfully`: find few cells that act like the teacher and match its return.

First it finds the cells with the least action error. Then CMA-ES raises their return to the teacher's where that costs
the least error. The return is a constraint, not the objective: a return above the teacher's earns nothing.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from vsp.checks import check_seed
from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy, rollout, visited_states
from vsp.run import progress
from vsp.tasks.base import GOAL, Task
from vsp.tasks.registry import get_task

from .anneal import squared_error
from .config import Faithful, check_kind
from .population import rollout_population
from .search import least_error, moves, spread, uncorrelated
from .tune import cma_es, is_snapshot, score
from .units import LabelledStates, ScaledCells, Scaling, warn_outside

SNAPSHOTS = 20  # candidates that a tuning yields, evenly spread over its generations
TUNING_STATES = 8000  # states on which the error of a candidate is measured
POOL = 20  # times the episodes of a generation: size of the pool of starts, from each of which the teacher plays once
MANY = 150  # with more numbers, the tuning learns no covariances: it is too short for them
FIRST_STEP = 0.02  # relative increase of the error by the first candidates of the tuning, about
NUDGE = 0.05  # move of a codeword that shows the curvature of the error, in deviations of the states
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
    most visited cell comes first. Warns if no such policy is found. Raises ValueError as `distill` does.
    """
    check_seed(seed)
    check_kind(config, Faithful)
    task = get_task(task)
    starts, init, validation, search = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(4))
    states = visited_states(teacher, task, task.start(starts, config.n_episodes))
    warn_outside(task, states)
    scaling = Scaling.of(task, states)
    labelled = scaling.labelled(teacher, states[spread(states / scaling.scale, config.n_states, init)])
    candidates = _Candidates(scaling, teacher, labelled, config, task.start(validation, config.n_validation))

    cells = least_error(labelled, config.n_cells, config.n_restarts, init)
    candidates.add("fit", cells)
    if config.min_r2 is not None or candidates.shortfall:  # else tuning gains nothing
        some = labelled.rows(spread(labelled.inputs[:, :-1], TUNING_STATES, init))
        for tuned in _tune(candidates, teacher, some, cells, search):
            candidates.add("tune", tuned)
    if candidates.shortfall:
        warnings.warn(candidates.shortfall, stacklevel=4)  # points at the caller of `vsp_beyond.faithful`
    cells, fewer = candidates.best, needed_only(candidates.best, labelled)
    if len(fewer.codewords) < len(cells.codewords) and candidates.returns_enough(fewer):
        cells = fewer
    return scaling.policy(by_visits(among_states(cells, labelled), labelled)), candidates.history()


class _Candidates:
    """Candidates with their R² and their gap: the mean return less penalties, minus the teacher's from the same
    starts."""

    def __init__(
        self, scaling: Scaling, teacher: Policy, labelled: LabelledStates, config: Faithful, starts: np.ndarray
    ):
        self._rows, self._cells = [], []
        self.scaling, self._labelled, self.config, self._starts = scaling, labelled, config, starts
        result = rollout(teacher, scaling.task, starts)
        self._teacher_score = score(result, config.failure_penalty)
        self.tolerance = config.tolerance or max(SHARE * abs(float(result.returns.mean())), 1e-9)
        self._least_gap = config.margin - 0.5 * self.tolerance

    def add(self, stage: str, cells: ScaledCells) -> None:
        r2 = 1.0 - squared_error(self._labelled, cells) / variance(self._labelled)
        self._rows.append({"stage": stage, "r2": r2, "gap": self._gap(cells)})
        self._cells.append(cells)

    def _gap(self, cells: ScaledCells) -> float:
        result = rollout(self.scaling.policy(cells), self.scaling.task, self._starts)
        return score(result, self.config.failure_penalty) - self._teacher_score

    def returns_enough(self, cells: ScaledCells) -> bool:
        """Whether `cells` return as much as the best candidate or, without `min_r2`, enough to be accepted."""
        gap = self._rows[self._kept]["gap"]
        return self._gap(cells) >= (gap if self.config.min_r2 is not None else min(gap, self._least_gap))

    @property
    def _kept(self) -> int:
        r2, gap = (np.array([row[name] for row in self._rows]) for name in ("r2", "gap"))
        return kept(r2, gap, least_gap=self._least_gap, min_r2=self.config.min_r2)

    @property
    def best(self) -> ScaledCells:
        return self._cells[self._kept]

    @property
    def shortfall(self) -> str | None:
        """The requirement that no candidate meets, in words; None if one meets all."""
        best, k, min_r2 = self._rows[self._kept], self.config.n_cells, self.config.min_r2
        if min_r2 is not None and best["r2"] < min_r2:
            return f"no policy of {k} cells with R² {min_r2:g} was found: the closest is kept, R² {best['r2']:.3f}"
        if min_r2 is None and best["gap"] < self._least_gap:
            what = f"{best['gap']:+.4g} to the teacher's return less penalties, expected {self._least_gap:+.4g} or more"
            return f"no policy of {k} cells that acts like the teacher returns enough: the best has a gap of {what}"
        return None

    def history(self) -> pd.DataFrame:
        return pd.DataFrame(self._rows).assign(kept=np.arange(len(self._rows)) == self._kept)


def kept(r2: np.ndarray, gap: np.ndarray, *, least_gap: float, min_r2: float | None) -> int:
    """Return which candidate is kept, by the R² (c,) and the gap (c,) of all candidates. The first is the closest.

    It is the one with the highest R² among those with a gap of at least `least_gap`. If there is none, it is the one
    with the highest return among those with at most `NEAR` times the error of the first. With `min_r2`, it is the one
    with the highest return among those with at least this R², or else the one with the highest R².
    """
    if min_r2 is not None:
        accepted, value, instead = r2 >= min_r2, gap, r2
    else:
        near = 1.0 - r2 <= NEAR * (1.0 - r2[0])
        accepted, value, instead = gap >= least_gap, r2, np.where(near, gap, -np.inf)
    return int(np.where(accepted, value, -np.inf).argmax() if accepted.any() else instead.argmax())


def variance(labelled: LabelledStates) -> float:
    """Return the mean squared error of the best constant, which R² is measured against; 1 if the teacher is
    constant."""
    mean = float(labelled.actions.var(axis=0).mean())
    return mean if mean > 1e-12 else 1.0


def _tune(
    candidates: _Candidates, teacher: Policy, labelled: LabelledStates, cells: ScaledCells, rng: np.random.Generator
) -> Iterator[ScaledCells]:
    """Run CMA-ES (Hansen 2016) on the error plus a penalty for a return below its target; yield the solution
    `SNAPSHOTS` times.

    Steps are scaled so that each raises the error equally. So the search goes where fidelity costs little.
    """
    config, policy, task = candidates.config, candidates.scaling.policy, candidates.scaling.task
    move, _ = moves(cells, *_units(labelled, cells))
    whole = variance(labelled)
    step = np.sqrt(FIRST_STEP * max(squared_error(labelled, cells), 1e-6) / cells.vector.size)
    search = cma_es(np.zeros(cells.vector.size), step, rng, diagonal=cells.vector.size > MANY)
    pool = task.start(rng, POOL * config.n_tuning_episodes)
    result = rollout(teacher, task, pool)
    scores = result.returns - config.failure_penalty * (result.outcomes != GOAL)
    for i in progress.steps(range(config.n_generations), "tuning", total=config.n_generations, unit="generations"):
        rows, steps = rng.choice(len(pool), size=config.n_tuning_episodes, replace=False), search.ask()
        starts, target = pool[rows], scores[rows].mean() + config.margin
        moved = [move(vector) for vector in steps]
        results = rollout_population([policy(cells) for cells in moved], task, starts)
        missed = np.array([target - score(result, config.failure_penalty) for result in results])
        errors = np.array([squared_error(labelled, cells) / whole for cells in moved])
        search.tell(steps, _cost(errors, missed, candidates.tolerance, config.min_r2).tolist())
        if is_snapshot(i, config.n_generations, SNAPSHOTS):
            yield move(search.result.xfavorite)


def _cost(errors: np.ndarray, missed: np.ndarray, tolerance: float, min_r2: float | None) -> np.ndarray:
    """Return the cost to minimise, from the unexplained variances `errors` and the missed returns `missed` (p,).

    It is the error plus a penalty for a missed return. With `min_r2`, it is the missed return plus a penalty for an
    error beyond it.
    """
    if min_r2 is None:
        return errors + PRICE / tolerance * np.maximum(0.0, missed)
    return missed / tolerance + np.maximum(0.0, errors - (1.0 - min_r2)) / BEYOND


def _units(labelled: LabelledStates, cells: ScaledCells) -> tuple[np.ndarray, np.ndarray]:
    """Return bases of the coefficients and units of the codewords for `moves`, from the curvature of the error."""
    here, vector, units = squared_error(labelled, cells), cells.vector, np.empty(cells.codewords.size)
    for j in range(len(units)):
        nudge = np.zeros_like(vector)
        nudge[j] = NUDGE
        more = sum(squared_error(labelled, cells.like(vector + sign * nudge)) - here for sign in (1, -1))
        units[j] = 1.0 / np.sqrt(max(0.0, 0.5 * more / NUDGE**2) + 1e-3)
    shares = cells.nearest(labelled.inputs[:, :-1]) == np.arange(len(cells.codewords))[:, None]
    return uncorrelated(labelled, shares.astype(np.float64)), units


def needed_only(cells: ScaledCells, labelled: LabelledStates) -> ScaledCells:
    """Remove cells that the error does not need: the next codeword serves their states as well, as where two neighbours
    hold the same map."""
    while (k := len(cells.codewords)) > 1:
        errors = [squared_error(labelled, _without(cells, i)) for i in range(k)]
        if min(errors) > squared_error(labelled, cells):
            break
        cells = _without(cells, int(np.argmin(errors)))
    return cells


def _without(cells: ScaledCells, i: int) -> ScaledCells:
    return ScaledCells(np.delete(cells.codewords, i, axis=0), np.delete(cells.coefficients, i, axis=0))


def among_states(cells: ScaledCells, labelled: LabelledStates) -> ScaledCells:
    """Draw the same border between two cells by codewords among the states. Of the many pairs that draw it, choose the
    one around the mean state. With more codewords there is no such choice."""
    if len(cells.codewords) != 2:
        return cells
    states, (first, second) = labelled.inputs[:, :-1], cells.codewords
    across = (second - first) / np.linalg.norm(second - first)
    beyond = (states - (first + second) / 2) @ across  # signed distances from the border
    on_border = states.mean(axis=0) - beyond.mean() * across
    return ScaledCells(on_border + np.outer([-1.0, 1.0], np.abs(beyond).mean() * across), cells.coefficients)


def by_visits(cells: ScaledCells, labelled: LabelledStates) -> ScaledCells:
    """Return the same cells, the one with the most states of `labelled` first."""
    visits = np.bincount(cells.nearest(labelled.inputs[:, :-1]), minlength=len(cells.codewords))
    order = np.argsort(-visits, kind="stable")
    return ScaledCells(cells.codewords[order], cells.coefficients[order])
