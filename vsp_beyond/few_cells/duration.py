"""Estimate how long `distill_faithfully` will take, from a short measurement on this machine."""

from __future__ import annotations

import time

import numpy as np
from threadpoolctl import threadpool_limits

from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy, rollout
from vsp.tasks.base import Task

from . import search
from .config import Faithful
from .faithful import POOL, SNAPSHOTS
from .tune import candidates_per_generation
from .units import METRIC, Cells, LabelledStates

PLAYED, IN_BATCH = 10, 500  # episodes of the teacher that are timed: one by one, or in one batch
STEPS = 20  # steps of such a batch that are timed for cells


@threadpool_limits.wrap(limits=1)
def expected_seconds(teacher: Policy, task: Task, config: Faithful) -> tuple[float, float]:
    """Estimate the seconds of the fit, and the further seconds of the tuning, which runs only if the return needs it.

    The estimate multiplies the times of some episodes and of one loss by how many of each there will be.
    """
    starts = task.start(np.random.default_rng(0), PLAYED if task.one_by_one else IN_BATCH)
    rollout(teacher, task, starts[:1])  # the first call takes longer
    by_teacher, by_cells = _of_an_episode(teacher, task, config, starts)
    candidates = config.n_generations * candidates_per_generation(_numbers(task, config))
    loss = _one_loss(task, config) * _losses(config.n_restarts, config.n_states)
    fit = by_teacher * (config.n_episodes + config.n_validation) + by_cells * config.n_validation + loss
    tuning = by_cells * (candidates * config.n_tuning_episodes + SNAPSHOTS * config.n_validation)
    return fit, tuning + by_teacher * POOL * config.n_tuning_episodes


def _of_an_episode(teacher: Policy, task: Task, config: Faithful, starts: np.ndarray) -> tuple[float, float]:
    """Measure the seconds of an episode of the teacher, and of cells that take as many steps."""
    began = time.perf_counter()
    result = rollout(teacher, task, starts)
    seconds = (time.perf_counter() - began) / len(starts)
    if task.one_by_one:  # the physics engine takes most of the time
        return seconds, seconds
    states, m = task.begin(starts), len(task.action_low)
    seen = task.observe(states)
    k, d = config.n_cells, seen.shape[1]
    codewords = np.resize(seen, (k, d)) + np.arange(k)[:, None]  # different ones, wherever they are
    cells = VoronoiPolicy(codewords, np.zeros((k, d + 1, m)), task=task, metric=METRIC)
    step = _seconds(lambda: [task.step(states, cells.predict(task.observe(states))[0]) for _ in range(STEPS)]) / STEPS
    return seconds, step * result.lengths.mean() / len(starts)


def announcement(teacher: Policy, task: Task, config: Faithful) -> str:
    """Say in words how long it will take."""
    fit, tuning = expected_seconds(teacher, task, config)
    return f"{in_words(fit)}, and {in_words(tuning)} more where its return has to be raised"


def _losses(n_restarts: int, n_states: int) -> float:
    """Return how many losses on `search.FEW` states `least_error` computes, one per iteration; the last ones use all
    states."""
    live, found = n_restarts, 0
    for stages, n_kept in search.ROUNDS:
        found, live = found + len(stages) * live, min(live, n_kept)
    last = search.N_LAST * len(search.LAST) * max(1.0, n_states / search.FEW)
    return search.N_ITERATIONS * found + last


def _one_loss(task: Task, config: Faithful) -> float:
    d, m, k = len(task.low), len(task.action_low), config.n_cells
    rng, n = np.random.default_rng(0), min(search.FEW, config.n_states)
    cells = Cells(rng.normal(size=(k, d)), rng.normal(size=(k, d + 1, m)))
    seen = LabelledStates(rng.normal(size=(n, d + 1)), rng.uniform(-1, 1, size=(n, m)))
    return min(_seconds(lambda: search.whole_loss(cells, seen, temperature=1.0, clip_slope=0.1)) for _ in range(3))


def _numbers(task: Task, config: Faithful) -> int:
    d, m = len(task.low), len(task.action_low)
    return config.n_cells * (d + (d + 1) * m)


def _seconds(work) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def in_words(seconds: float) -> str:
    """Return `seconds` in words, such as "about 20 seconds" or "about 3 minutes"."""
    if seconds < 90:
        return f"about {max(5, 5 * round(seconds / 5))} seconds"
    return f"about {round(seconds / 60)} minutes"
