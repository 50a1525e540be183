"""`fewest`: as few cells as act like an agent and return as much, found in stages that a clock may end.

1, 2, 4 and 8 cells are fitted to the agent's actions. On states that no fit saw, the smallest number is chosen whose R²
is at most `LOSS` below the highest and whose return is level with the agent's. If none is level, the one of them with
the highest return is tuned. Each finished stage is kept in a file, from which a longer call goes on.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from vsp.evaluation import Likeness, likeness, start_states
from vsp.policy import VoronoiPolicy
from vsp.protocol import interval
from vsp.protocol.job import Job, make_all, provenance
from vsp.rollouts import Policy, rollout, visited_states
from vsp.tasks.base import Task
from vsp.teachers.agents import digest_of

from .config import Faithful, faithful_preset
from .faithful import distill_faithfully
from .search import least_error
from .units import METRIC, LabelledStates, Scaling, spread

VERSION = 1  # raise it when the same arguments give another policy
SIZES = (1, 2, 4, 8)
LOSS = 0.01  # of R²: so much may fewer cells cost
SHARE = 0.02  # of the distance to the best constant action: so much may the return fall short
RIDGE = (
    1e-6  # weight of squared slopes in the error, in units of the data: where an input hardly varies, they stay small
)


class TimeUp(Exception):
    """The time for a stage is over."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What an agent does in a task, and the settings of all fits to it."""

    agent: Policy
    task: Task
    config: Faithful
    seed: int

    @cached_property
    def labelled(self) -> tuple[Scaling, LabelledStates]:
        """States of the agent's episodes with its actions, in units in which one step size fits all."""
        starts, init = map(np.random.default_rng, np.random.SeedSequence(self.seed).spawn(2))
        states = visited_states(self.agent, self.task, self.task.start(starts, self.config.n_episodes))
        scaling = Scaling.of(self.task, states)
        states = states[spread(states / scaling.scale, self.config.n_states, init)]
        return scaling, scaling.labelled(states, self.agent.predict(states)[0])


@dataclass(frozen=True, eq=False)
class Stage(Job):
    """A fit of so many cells, or one that is tuned on the return, too."""

    seen: Seen
    n_cells: int
    seed: int
    tuned: bool = False
    kind = "Stage"

    @property
    def name(self) -> str:
        """The stage in words."""
        return f"{self.n_cells} cell{'s' * (self.n_cells > 1)}{', tuned' * self.tuned}"

    @property
    def task(self) -> str:
        """The name of the task."""
        return self.seen.task.name

    @property
    def provenance(self) -> dict[str, str | int]:
        """What identifies the stage besides its seed."""
        settings = vars(self.seen.config) | {"n_cells": self.n_cells, "tuned": self.tuned, "ridge": RIDGE}
        return provenance(settings, digest_of(self.seen.agent), VERSION)

    @threadpool_limits.wrap(limits=1)
    def make(self) -> tuple[dict[str, np.ndarray], dict]:
        """Fit the cells."""
        if self.tuned:
            config = replace(self.seen.config, n_cells=self.n_cells)
            policy = distill_faithfully(self.seen.agent, self.seen.task, config, seed=self.seed)[0]
        else:
            (scaling, labelled), rng = self.seen.labelled, np.random.default_rng([self.seed, self.n_cells])
            cells = least_error(labelled, self.n_cells, self.seen.config.n_restarts, rng, ridge=RIDGE)
            policy = scaling.policy(cells.among(labelled.states).by_visits(labelled.states))
        return {"codewords": policy.codewords, "coefficients": policy.coefficients, "scale": policy.scale}, {}


def fewest(
    agent: Policy, task: Task, *, seed: int, folder: str | os.PathLike, until: float = math.inf,
    sizes: Sequence[int] = SIZES,
) -> tuple[VoronoiPolicy, pd.DataFrame, list[str]]:  # fmt: skip
    """Return the policy, one row per finished stage, and the stages that were left out because the time was over.

    Rows: cells, r2, within (of the action that is within 5 % of its range in the fewest states), policy and agent (mean
    returns), failed, level, chosen. `until` is a time of `time.monotonic`; it decides only which stages are finished,
    not what they give. Raises `TimeUp` if none is.
    """
    seen, stages, tried = Seen(agent, task, replace(faithful_preset(task), margin=0.0), seed), [], {}
    work = [Stage(seen, size, seed) for size in sizes]
    for stage in work:  # which grows
        try:
            with limited(until - time.monotonic()):
                make_all([stage], folder, stage.name)
                arrays, _ = stage.load(folder)
                numbers = (arrays[name] for name in ("codewords", "coefficients"))
                policy = VoronoiPolicy(*numbers, task=task, metric=METRIC, scale=arrays["scale"])
                tried[stage.name] = policy, likeness(policy, agent, task)
                level = {name: is_level(alike, task) for name, (_, alike) in tried.items()}
        except TimeUp:
            break
        stages.append(stage)
        if len(stages) == len(sizes) and not any(level[one.name] for one in alike_of(stages, tried)):
            best = max(alike_of(stages, tried), key=lambda one: tried[one.name][1].returns["policy"].mean())
            work.append(replace(best, tuned=True))
    if not stages:
        raise TimeUp("no stage was finished in time: allow more minutes")
    good = [one for one in alike_of(stages, tried) if level[one.name]] or stages[-1:]
    chosen = min(good, key=lambda one: (one.n_cells, one.tuned))
    rows = [_row(one, tried[one.name][1]) | {"level": level[one.name], "chosen": one is chosen} for one in stages]
    return tried[chosen.name][0], pd.DataFrame(rows), [one.name for one in work if one not in stages]


def alike_of(stages: list[Stage], tried: dict[str, tuple[VoronoiPolicy, Likeness]]) -> list[Stage]:
    """Return the stages whose R² is at most `LOSS` below the highest."""
    highest = max(tried[one.name][1].r2 for one in stages)
    return [one for one in stages if tried[one.name][1].r2 >= highest - LOSS]


def is_level(alike: Likeness, task: Task) -> bool:
    """Whether the policy's return falls short of the agent's by no more than half of the paired 95 % interval, or than
    `SHARE` of the agent's distance to the best constant action."""
    gap, agent = alike.returns["policy"] - alike.returns["agent"], alike.returns["agent"].mean()
    low, high = interval(gap, np.mean, vectorized=True)
    return bool(gap.mean() >= -max((high - low) / 2, SHARE * abs(agent - _best_constant(task, len(gap)))))


def _best_constant(task: Task, n: int) -> float:
    """Return the highest mean return of the lowest, middle and highest action, from n starts."""
    starts, zeros = start_states(task, n, 7), np.zeros((1, len(task.low)))
    actions = [task.action_low, (task.action_low + task.action_high) / 2, task.action_high]
    maps = [np.vstack([np.zeros((len(task.low), len(action))), action])[None] for action in actions]
    return max(rollout(VoronoiPolicy(zeros, one, task=task), task, starts).returns.mean() for one in maps)


def _row(stage: Stage, alike: Likeness) -> dict:
    means = {name: returns.mean() for name, returns in alike.returns.items()}
    return {
        "stage": stage.name,
        "r2": alike.r2,
        "within": alike.within.min(),
        **means,
        "failed": alike.failures["policy"],
    }


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise `TimeUp` in what takes longer than so many seconds; in the main thread of a process, by a signal."""
    if not math.isfinite(seconds):
        yield
        return
    before = signal.signal(signal.SIGALRM, _stop)
    signal.setitimer(signal.ITIMER_REAL, max(seconds, 1e-3))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _stop(*_: object) -> None:
    raise TimeUp
