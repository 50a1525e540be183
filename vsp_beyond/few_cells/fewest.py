"""`fewest`: as few cells as act like an agent and return as much, found in stages that a clock may end.

1, 2, 4 and 8 cells are fitted to the agent's actions. On states that no fit saw, the smallest number is chosen whose R²
is at most `LOSS` below the highest and whose return is level with the agent's. If none is level, the best of them is
tuned on the return. Finished stages are kept in files, from which a longer call goes on.
"""

import contextlib
import math
import os
import signal
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from threadpoolctl import threadpool_limits

from vsp import Policy, Task, VoronoiPolicy, start_states
from vsp.evaluation import Likeness, likeness
from vsp.protocol import Job, interval
from vsp.protocol.job import make_all, provenance
from vsp.rollouts import rollout, visited_states
from vsp.teachers import digest_of

from .config import Faithful, faithful_preset
from .faithful import distill_faithfully
from .search import least_error
from .units import METRIC, LabelledStates, Scaling, spread, warn_outside

VERSION = 1  # raise it when the same arguments give another policy
SIZES = (1, 2, 4, 8)
LOSS = 0.01  # of R²: so much may fewer cells cost
SHARE = 0.02  # of the distance to the best constant action: so much may the return fall short
RIDGE = 1e-6  # weight of squared slopes in the error: they stay small where an input hardly varies


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
        warn_outside(self.task, states)
        scaling = Scaling.of(self.task, states)
        states = states[spread(states / scaling.scale, self.config.n_states, init)]
        return scaling, replace(scaling.labelled(states, self.agent.predict(states)[0]), ridge=RIDGE)

    @cached_property
    def best_constant(self) -> float:
        """The highest mean return of the lowest, middle and highest action."""
        task, zeros = self.task, np.zeros((1, len(self.task.low)))
        starts = start_states(task, max(10, 200 // task.slowness), 7)
        actions = [task.action_low, (task.action_low + task.action_high) / 2, task.action_high]
        maps = [np.vstack([np.zeros((zeros.size, len(action))), action])[None] for action in actions]
        return max(rollout(VoronoiPolicy(zeros, one, task=task), task, starts).returns.mean() for one in maps)


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
            cells = least_error(labelled, self.n_cells, self.seen.config.n_restarts, rng)
            policy = scaling.policy(cells.among(labelled.states).by_visits(labelled.states))
        return {"codewords": policy.codewords, "coefficients": policy.coefficients, "scale": policy.scale}, {}


@dataclass(frozen=True, eq=False)
class Tried:
    """A finished stage: its policy, how much it acts like the agent, and whether it returns as much."""

    stage: Stage
    policy: VoronoiPolicy
    alike: Likeness
    level: bool

    @classmethod
    def of(cls, stage: Stage, folder: str | os.PathLike) -> "Tried":
        """Make the stage, unless its file exists, and judge it. It is level if it falls short by no more than half of
        the paired 95 % interval, or than `SHARE` of the agent's distance to the best constant action."""
        make_all([stage], folder, stage.name)
        arrays, task = stage.load(folder)[0], stage.seen.task
        maps = arrays.pop("coefficients")
        policy = VoronoiPolicy(arrays["codewords"], maps, task=task, metric=METRIC, scale=arrays["scale"])
        alike = likeness(policy, stage.seen.agent, task)
        agent = alike.returns["agent"]
        gap = alike.returns["policy"] - agent
        low, high = interval(gap, np.mean, vectorized=True)
        short = max((high - low) / 2, SHARE * abs(agent.mean() - stage.seen.best_constant))
        return cls(stage, policy, alike, bool(gap.mean() >= -short))


def fewest(
    agent: Policy, task: Task, *, seed: int, folder: str | os.PathLike, until: float = math.inf,
    sizes: Sequence[int] = SIZES,
) -> tuple[Tried, list[Tried], list[str]]:  # fmt: skip
    """Return the chosen stage, all finished ones, and the names of those that were left out because the time was over.
    `until` is a time of `time.monotonic`; it decides only which stages are finished, not what they give. Raises
    `TimeUp` if none is."""
    seen, tried = Seen(agent, task, replace(faithful_preset(task), margin=0.0), seed), list[Tried]()
    work = [Stage(seen, size, seed) for size in sizes]
    for stage in work:  # which may grow
        try:
            with limited(until - time.monotonic()):
                tried.append(Tried.of(stage, folder))
        except TimeUp:
            break
        if len(tried) == len(sizes) and not any(one.level for one in close(tried)):
            best = max(close(tried), key=lambda one: one.alike.returns["policy"].mean())
            work.append(replace(best.stage, tuned=True))
    if not tried:
        raise TimeUp(f"{work[0].name}: not finished in time, allow more minutes")
    good = [one for one in close(tried) if one.level]
    chosen = (
        min(good, key=lambda one: one.stage.n_cells)
        if good
        else max(close(tried), key=lambda one: one.alike.returns["policy"].mean())
    )
    return chosen, tried, [stage.name for stage in work[len(tried) :]]


def close(tried: list[Tried]) -> list[Tried]:
    """Return those whose R² is at most `LOSS` below the highest."""
    highest = max(one.alike.r2 for one in tried)
    return [one for one in tried if one.alike.r2 >= highest - LOSS]


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
