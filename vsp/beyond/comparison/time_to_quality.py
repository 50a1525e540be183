"""How long it takes from a teacher's weights to a policy nearly as good, on SimpleGoal: ours and trees with DAgger.

All methods are timed in turn, in one process and one thread. Each has several settings, since the fastest may not be
good enough. A tree of constants has as many leaves as its data ask for, one of linear maps has 32. The results go to
data/results/beyond_race.csv; times differ from run to run.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial

import pandas as pd
from threadpoolctl import threadpool_limits

from ...baselines.dagger import dagger
from ...baselines.trees import LinearTree, Tree
from ...evaluation import start_states
from ...paper.results import provenance
from ...rollouts import Policy, rollout
from ...run.progress import progress
from ...tasks.base import GOAL
from ...tasks.registry import get_task
from ...teachers.teacher import load_teacher
from ..refinement.config import tuned_preset
from ..refinement.refine import refine
from .measure import N_REPORTED, REPORT_SEED

VERSION = 1  # raise it when the same settings give other policies; tests/golden/methods.json guards it
TASK = "SimpleGoal-v0"
SEEDS = range(20)
ENOUGH = 0.99  # of the teacher's mean return
QUICK = replace(tuned_preset(TASK), n_restarts=1, n_generations=0, n_validation=1000)
TREES = {  # by the episodes of the teacher: with two rounds of corrections
    f"{n} + 2 × {more} episodes": replace(QUICK, n_episodes=n, n_correction_episodes=more)
    for n, more in ((300, 200), (2000, 500), (5000, 1000), (10_000, 3000))
}
LINEAR_TREES = dict(list(TREES.items())[:2])
OURS = {
    f"{cells} cells, {steps} steps": replace(QUICK, n_cells=cells, n_steps=steps, n_episodes=300)
    for cells, steps in ((13, 500), (20, 800), (26, 1000), (32, 1500))
}


def _by_dagger(fit: Callable[..., Policy]) -> Callable[..., Policy]:
    return lambda teacher, config, seed: dagger([fit], teacher, TASK, rounds=config, seed=seed)


METHODS = {
    "CART, DAgger": (_by_dagger(lambda states, actions: Tree(states, actions, leaves=len(states))), TREES),
    "CART, linear leaves, DAgger": (_by_dagger(partial(LinearTree, leaves=32, task=TASK)), LINEAR_TREES),
    "refined, not tuned": (lambda teacher, config, seed: refine(teacher, TASK, config, seed=seed)[0], OURS),
}


@threadpool_limits.wrap(limits=1)
def time_to_quality(seeds=SEEDS) -> pd.DataFrame:
    """One row per method, setting and seed: seconds, mean return, share of failed episodes, share of the teacher's
    mean return, provenance."""
    teacher, task = load_teacher(TASK), get_task(TASK)
    starts = start_states(task, N_REPORTED, REPORT_SEED)
    own, rows = rollout(teacher, task, starts).returns.mean(), []
    makers = {}
    for method, (make, settings) in METHODS.items():
        makers |= {(method, setting): partial(make, teacher, config) for setting, config in settings.items()}
    for make in makers.values():
        make(seed=0)  # imports, and memory that is allocated once
    for seed in progress(seeds, "race", total=len(seeds), unit="seeds"):
        for (method, setting), make in makers.items():
            began = time.perf_counter()
            policy = make(seed=seed)
            seconds, result = time.perf_counter() - began, rollout(policy, task, starts)
            scores = {"mean": result.returns.mean(), "failing": (result.outcomes != GOAL).mean()}
            about = {"method": method, "setting": setting, "seed": seed, "seconds": seconds}
            rows.append({**about, **scores, "share": scores["mean"] / own, **provenance_of(method, setting)})
    return pd.DataFrame(rows)


def provenance_of(method: str, setting: str) -> dict[str, str | int]:
    """The provenance of the rows of a method with a setting."""
    about = {"method": method, "config": asdict(METHODS[method][1][setting]), "starts": [REPORT_SEED, N_REPORTED]}
    return provenance(about, load_teacher(TASK).digest, VERSION)


def quickest(frame: pd.DataFrame) -> pd.DataFrame:
    """The quickest setting of each method whose median share is `ENOUGH`; a method without one is left out.

    `frame` has the rows of `time_to_quality`. Columns: method, setting; seconds, mean, failing, share: medians over the
    seeds; crossing, the share of the seeds that reach `ENOUGH`. The quickest method comes first.
    """
    groups = frame.assign(crossing=frame["share"] >= ENOUGH).groupby(["method", "setting"], sort=False)
    medians = groups[["seconds", "mean", "failing", "share"]].median()
    medians = medians.assign(crossing=groups["crossing"].mean()).reset_index()
    enough = medians[medians["share"] >= ENOUGH].sort_values("seconds", ignore_index=True)
    return enough.drop_duplicates("method", ignore_index=True)
