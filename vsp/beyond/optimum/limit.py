"""How near a few cells come to the best: distilled from the best policy, then tuned on the return.

Where the search begins decides where it ends. So several beginnings are tuned for a while, and the best of them to the
end.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from ...checks import check_seed
from ...policy import VoronoiPolicy
from ...rollouts import Policy, rollout, score
from ...tasks.base import Task
from ...tasks.registry import get_task
from ...teachers.teacher import load_teacher
from ..refinement.config import Refinement, check_refinement, faithful_preset, tuned_preset
from ..refinement.faithful import distill_faithfully
from ..refinement.refine import refine
from .references import TASKS, best_policy

VERSION = 1  # raise it when the same arguments give another policy; tests/golden/methods.json guards it
BEGINNINGS = 4  # every other one of them the closest imitation
SHARE = 0.2  # of the generations that each beginning is tuned for
PRICE = {"MountainCarContinuous-v0": 3e-3}  # of a step: who comes sooner can be imitated with less care

_LIMIT = {
    "SimpleGoal-v0": {"n_cells": 4, "n_generations": 400, "n_tuning_episodes": 500},
    "MountainCarContinuous-v0": {"n_cells": 3, "n_generations": 100, "tuning_step": 0.03},
    "Pendulum-v1": {
        "n_cells": 8, "n_episodes": 500, "n_correction_episodes": 300, "n_restarts": 6,
        "n_generations": 400, "n_tuning_episodes": 200, "n_validation": 2000,
    },
    "LunarLanderContinuous-v3": {"n_cells": 3, "n_generations": 300},
}  # fmt: skip


def limit_preset(task: str | Task) -> Refinement:
    """The settings of `at_the_limit` for a task: those of `tuned_preset` with a longer search. Raises ValueError as it
    does."""
    return replace(tuned_preset(task), **_LIMIT[get_task(task).name])


def at_the_limit(
    task: str | Task, config: Refinement | None = None, *, seed: int, teacher: Policy | None = None
) -> VoronoiPolicy:
    """At most `config.n_cells` cells with a return as near the best as the search comes. Same arguments, same policy.

    `config`: by default `limit_preset(task)`. `teacher`: by default the best policy where it is known, else the shipped
    teacher. Raises ValueError as `refine` does.
    """
    check_seed(seed)
    task = get_task(task)
    config = limit_preset(task) if config is None else config
    check_refinement(config)
    teacher = _best_teacher(task) if teacher is None else teacher
    last, *seeds = np.random.SeedSequence(seed).generate_state(1 + BEGINNINGS).tolist()
    short = replace(config, n_generations=round(SHARE * config.n_generations))
    begun = [_begun(teacher, task, short, one, closest=i % 2 == 0) for i, one in enumerate(seeds)]
    starts = task.start(np.random.default_rng(last), config.n_validation)
    best = max(begun, key=lambda policy: score(rollout(policy, task, starts), config.failure_penalty))
    return _on(best, teacher, task, config, last)


def _best_teacher(task: Task) -> Policy:
    return best_policy(task, price=PRICE.get(task.name)) if task.name in TASKS else load_teacher(task.name)


def _begun(teacher: Policy, task: Task, config: Refinement, seed: int, *, closest: bool) -> VoronoiPolicy:
    """Tuned for a while: the closest imitation that is known, or the best of `refine`."""
    if not closest:
        return refine(teacher, task, config, seed=seed)[0]
    like = replace(faithful_preset(task, n_cells=config.n_cells), n_episodes=config.n_episodes, n_generations=0)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no policy of")  # its return is not the aim
        policy, _ = distill_faithfully(teacher, task, like, seed=seed)
    return _on(policy, teacher, task, config, seed)


def _on(policy: VoronoiPolicy, teacher: Policy, task: Task, config: Refinement, seed: int) -> VoronoiPolicy:
    """The policy tuned as `config` says."""
    config = replace(config, n_cells=len(policy), n_restarts=1, n_corrections=0)
    return refine(teacher, task, config, seed=seed, start=policy)[0]
